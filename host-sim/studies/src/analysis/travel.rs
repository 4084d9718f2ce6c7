//! The whole robot's travel over the ground, against the bars of the scenario.

use wheeleg_config::{Bar, Measure, RobotConfig};
use wheeleg_master::behaviour::Act;
use wheeleg_master::event::Event as MasterEvent;
use wheeleg_telemetry::event::BoardChange;
use wheeleg_telemetry::{
    BodySample, Cause, Event, FootSample, MasterSample, SupplySample, WheelSample,
};

use super::Extremes;
use super::indices::LegIndices;
use super::target::Target;

/// Speed, slip, radius, steps in time and air count from here on, s: the robot has begun to move.
const FROM_S: f64 = 3.0;
/// A foot is loaded above this force, N.
const LOADED_N: f64 = 1.0;

/// First and last value.
#[derive(Debug, Clone, Copy, Default)]
struct Ends(Option<(f64, f64)>);

impl Ends {
    fn add(&mut self, value: f64) {
        let first = self.0.map_or(value, |(first, _)| first);
        self.0 = Some((first, value));
    }

    fn change(self) -> Option<f64> {
        self.0.map(|(first, last)| last - first)
    }
}

/// Angles unwrapped beyond half a turn.
#[derive(Debug, Clone, Copy, Default)]
struct Unwrapped {
    last_deg: Option<f64>,
    sum_deg: f64,
}

impl Unwrapped {
    fn add(&mut self, deg: f64) -> f64 {
        let step = self.last_deg.map_or(0.0, |last| deg - last);
        self.sum_deg += step - 360.0 * (step / 360.0).round();
        self.last_deg = Some(deg);
        self.sum_deg
    }
}

/// Every measure for a bar, while samples come in.
#[derive(Debug, Default)]
pub(super) struct TravelMeter {
    last_s: Option<f64>,
    way_m: f64,
    later_way_m: f64,
    later_time_s: f64,
    height_m: Ends,
    rims_m: [Ends; 2],
    heading: Unwrapped,
    later_heading_deg: Ends,
    roll_deg: (Option<f64>, Extremes),
    pitch_deg: (Option<f64>, Extremes),
    chassis_n: f64,
    foot_n: [f64; 2],
    supported_s: f64,
    steps: u32,
    later_steps: Ends,
    later_air_m3: Ends,
    gives_up_s: Option<f64>,
    faults: u32,
}

fn against_start((start, extremes): &mut (Option<f64>, Extremes), value: f64) {
    let start = *start.get_or_insert(value);
    extremes.add(value - start);
}

impl TravelMeter {
    pub(super) fn body(&mut self, t_s: f64, v: &BodySample) {
        let dt_s = self.last_s.map_or(0.0, |last| t_s - last);
        self.last_s = Some(t_s);
        let way_m = 1e-3 * v.speed_mm_s * dt_s;
        self.way_m += way_m;
        let heading_deg = self.heading.add(v.yaw_deg);
        if t_s >= FROM_S {
            self.later_way_m += way_m;
            self.later_time_s += dt_s;
            self.later_heading_deg.add(heading_deg);
        }
        self.height_m.add(1e-3 * v.z_mm);
        against_start(&mut self.roll_deg, v.roll_deg);
        against_start(&mut self.pitch_deg, v.pitch_deg);
        self.chassis_n = self.chassis_n.max(v.chassis_force_n);
        if t_s >= FROM_S && self.foot_n.iter().any(|n| *n > LOADED_N) {
            self.supported_s += dt_s;
        }
    }

    pub(super) fn foot(&mut self, foot: usize, v: &FootSample) {
        self.foot_n[foot] = v.normal_force_n;
    }

    pub(super) fn wheel(&mut self, wheel: usize, t_s: f64, v: &WheelSample) {
        if t_s >= FROM_S {
            self.rims_m[wheel].add(1e-3 * v.position_mm);
        }
    }

    pub(super) fn master(&mut self, t_s: f64, v: &MasterSample) {
        self.steps = self.steps.max(v.step);
        if t_s >= FROM_S {
            self.later_steps.add(f64::from(self.steps));
        }
    }

    pub(super) fn supply(&mut self, t_s: f64, v: &SupplySample) {
        if t_s >= FROM_S {
            self.later_air_m3.add(1e-3 * v.air_used_dm3);
        }
    }

    pub(super) fn event(&mut self, t_s: f64, event: &Event) {
        match event.cause {
            Cause::Master(MasterEvent::Behaviour(Act::Stuck)) => {
                self.gives_up_s.get_or_insert(t_s);
            }
            Cause::Board {
                change: BoardChange::FaultLatched(_),
                ..
            } => self.faults += 1,
            _ => {}
        }
    }

    /// A measure, SI; `None` if the run was too short or the measure has no meaning.
    fn value(&self, measure: Measure, robot: &RobotConfig) -> Option<f64> {
        let steps = || self.later_steps.change().filter(|steps| *steps > 0.0);
        let leg = || LegIndices::of(&robot.plant);
        let largest = |(_, Extremes(range)): &(Option<f64>, Extremes)| {
            range.map(|(low, high)| low.abs().max(high.abs()).to_radians())
        };
        match measure {
            Measure::Speed => {
                (self.later_time_s > 0.0).then(|| self.later_way_m / self.later_time_s)
            }
            Measure::Distance => Some(self.way_m),
            Measure::Climb => self.height_m.change(),
            Measure::Slip => {
                let [left, right] = self.rims_m.map(Ends::change);
                let rims_m = 0.5 * (left? + right?);
                (rims_m.abs() > 1e-3).then(|| 1.0 - self.later_way_m / rims_m)
            }
            Measure::Supported => {
                (self.later_time_s > 0.0).then(|| self.supported_s / self.later_time_s)
            }
            Measure::Roll => largest(&self.roll_deg),
            Measure::Pitch => largest(&self.pitch_deg),
            Measure::Heading => Some(self.heading.sum_deg.to_radians()),
            Measure::Radius => {
                let turned = self.later_heading_deg.change()?.to_radians();
                (turned.abs() > 1e-3).then(|| self.later_way_m / turned)
            }
            Measure::ChassisForce => Some(self.chassis_n),
            Measure::Steps => Some(f64::from(self.steps)),
            Measure::StuckAfter => self.gives_up_s,
            Measure::Faults => Some(f64::from(self.faults)),
            Measure::StepTime => Some(self.later_time_s / steps()?),
            Measure::AirPerStep => Some(self.later_air_m3.change()? / steps()?),
            Measure::AirPerMetre => {
                // A robot that stands has no such figure.
                let way_m = Some(self.later_way_m).filter(|way_m| *way_m > 0.1)?;
                Some(self.later_air_m3.change()? / way_m)
            }
            Measure::Conditioning => Some(leg()?.conditioning),
            Measure::Manipulability => Some(leg()?.manipulability),
            Measure::Workspace => Some(leg()?.workspace_m3),
            Measure::FootForce => Some(leg()?.foot_force_n),
        }
    }

    pub(super) fn targets(&self, robot: &RobotConfig, bars: &[Bar]) -> Vec<Target> {
        let target = |bar: &Bar| {
            let (measure, scale) = (bar.measure, bar.measure.per_si());
            // Bands are written in other units than SI: convert their ends back, without rounding errors.
            let shown = |si: f64| (si * scale * 1e9).round() / 1e9;
            let target = Target::new(
                measure.name(),
                measure.meaning().trim_end_matches('.'),
                self.value(measure, robot).map(|si| si * scale),
                measure.unit(),
                bar.min.map(shown),
                bar.max.map(shown),
            );
            // A robot that has not given up by the end gives up later, if at all.
            let pass = target.pass
                || measure == Measure::StuckAfter && self.gives_up_s.is_none() && bar.max.is_none();
            let target = Target { pass, ..target };
            if bar.required { target } else { target.info() }
        };
        bars.iter().map(target).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot() -> RobotConfig {
        wheeleg_config::builtin::robot("wheeleg").expect("built in")
    }

    fn driven(speed_mm_s: f64, turn_deg_s: f64, rim_mm_s: f64) -> TravelMeter {
        let mut meter = TravelMeter::default();
        for i in 0..=10_000_u32 {
            let t_s = f64::from(i) * 1e-3;
            meter.foot(
                0,
                &FootSample {
                    normal_force_n: if i % 4 == 0 { 0.0 } else { 20.0 },
                    ..FootSample::default()
                },
            );
            let yaw_deg = (turn_deg_s * t_s + 180.0).rem_euclid(360.0) - 180.0;
            let (pitch_deg, roll_deg) = (10.0 - t_s, 0.5);
            meter.body(
                t_s,
                &BodySample {
                    speed_mm_s,
                    yaw_deg,
                    pitch_deg,
                    roll_deg,
                    ..BodySample::default()
                },
            );
            // A swing every 2 s, and 3 dm3 of air for it; start-up has used 50 dm3.
            meter.master(
                t_s,
                &MasterSample {
                    step: i / 2000,
                    ..MasterSample::default()
                },
            );
            meter.supply(
                t_s,
                &SupplySample {
                    air_used_dm3: 50.0 + 1.5 * t_s,
                    ..SupplySample::default()
                },
            );
            for wheel in 0..2 {
                meter.wheel(
                    wheel,
                    t_s,
                    &WheelSample {
                        position_mm: rim_mm_s * t_s,
                        ..WheelSample::default()
                    },
                );
            }
        }
        meter
    }

    #[test]
    fn a_steady_turn_is_measured_as_it_is() {
        let (meter, robot) = (driven(100.0, 40.0, 125.0), robot());
        let near = |measure, wanted: f64| {
            let value = meter.value(measure, &robot).expect("measured");
            assert!(
                (value - wanted).abs() < 1e-3,
                "{measure:?}: {value}, {wanted}"
            );
        };
        near(Measure::Speed, 0.1);
        near(Measure::Distance, 1.0);
        near(Measure::Slip, 0.2);
        near(Measure::Supported, 0.75);
        near(Measure::Heading, 400.0_f64.to_radians());
        near(Measure::Radius, 0.1 / 40.0_f64.to_radians());
        near(Measure::Pitch, 10.0_f64.to_radians());
        near(Measure::Roll, 0.0);
        // From 3 to 10 s: swings 2 to 5, 10.5 dm3, 0.7 m.
        near(Measure::StepTime, 7.0 / 4.0);
        near(Measure::AirPerStep, 10.5e-3 / 4.0);
        near(Measure::AirPerMetre, 10.5e-3 / 0.7);
        let leg = LegIndices::of(&robot.plant).expect("a leg");
        near(Measure::Conditioning, leg.conditioning);
        near(Measure::FootForce, leg.foot_force_n);
        let stands = driven(0.0, 0.0, 0.0);
        assert_eq!(stands.value(Measure::AirPerMetre, &robot), None);
    }

    /// A robot that does not give up has no time at which it did: the bar is missed.
    #[test]
    fn the_first_time_that_it_gives_up_counts_and_every_fault() {
        let mut meter = driven(100.0, 0.0, 100.0);
        let bar = Bar {
            measure: Measure::StuckAfter,
            min: None,
            max: Some(20.0),
            required: true,
        };
        let robot = robot();
        assert!(!meter.targets(&robot, &[bar])[0].pass);
        // "Not before 5 s" is met.
        let later = Bar {
            min: Some(5.0),
            max: None,
            ..bar
        };
        assert!(meter.targets(&robot, &[later])[0].pass);
        let gives_up = || Event::from(Cause::Master(MasterEvent::Behaviour(Act::Stuck)));
        meter.event(12.5, &gives_up());
        meter.event(30.0, &gives_up());
        let target = &meter.targets(&robot, &[bar])[0];
        assert_eq!(
            (target.value, target.unit, target.pass),
            (Some(12.5), "s", true)
        );
        assert_eq!(meter.value(Measure::Faults, &robot), Some(0.0));
        for node in 1..=2 {
            let board = wheeleg_protocol::Address::joint(node).expect("a joint");
            let change = BoardChange::FaultLatched(wheeleg_protocol::Fault::NoMotion);
            meter.event(1.0, &Cause::Board { board, change }.into());
        }
        assert_eq!(meter.value(Measure::Faults, &robot), Some(2.0));
    }

    #[test]
    fn bands_are_shown_in_the_unit_of_the_measure() {
        let meter = driven(100.0, 0.0, 100.0);
        let bar = Bar {
            measure: Measure::Speed,
            min: Some(0.114),
            max: Some(0.126),
            required: true,
        };
        let target = &meter.targets(&robot(), &[bar])[0];
        assert_eq!((target.min, target.max), (Some(114.0), Some(126.0)));
        assert!(!target.pass && target.required);
        // No turn: no radius, and a measure without a value is not met.
        let radius = Bar {
            measure: Measure::Radius,
            ..bar
        };
        assert!(!meter.targets(&robot(), &[radius])[0].pass);
    }
}
