//! Safe states after the loss of the master or an E-stop (`docs/decisions/0010-safe-states.md`).

use super::{Extremes, Target, within};
use wheeleg_telemetry::{JointSample, Row, SupplySample, WheelSample};

/// Valves must be commanded shut, and wheel ramps begun, within this, s.
const REACTION_S: f64 = 0.060;
/// Wheels must stand within this, s.
const WHEEL_STOP_S: f64 = 0.500;
/// A staged exhaust may open vents again only after this, s.
const STAGE_S: f64 = 0.500;
/// A rim slower than this stands, mm/s.
const STANDING_MM_S: f64 = 5.0;
/// Modes that are safe: hold, exhaust, fault.
const SAFE_MODES: [u8; 3] = [4, 5, 6];

/// A reaction within a window of time, while samples come in.
#[derive(Debug, Default)]
struct Reaction {
    /// Time of the last sample in the window, s.
    end_s: Option<f64>,
    /// Time of the last sample before it came, s.
    last_s: Option<f64>,
}

impl Reaction {
    fn sample(&mut self, t_s: f64, pending: bool) {
        self.end_s = Some(t_s);
        if pending {
            self.last_s = Some(t_s);
        }
    }

    /// Time from the event to the last pending sample, including that sample's own length; `None` without
    /// samples.
    fn after(&self, at_s: f64, sample_s: f64) -> Option<f64> {
        self.end_s?;
        Some(self.last_s.map_or(0.0, |t_s| t_s + sample_s - at_s))
    }

    /// The same before the staged exhaust may begin; `None` if the record ends before that.
    fn within_stage(&self, at_s: f64) -> Option<f64> {
        self.end_s.filter(|end| *end >= at_s + STAGE_S - 0.01)?;
        self.after(at_s, 0.001)
    }
}

/// Modes and faults of an axis.
#[derive(Debug, Default)]
struct Axis {
    /// Whether all its samples from the reaction time on are in safe modes.
    safe: Option<bool>,
    latched: bool,
}

impl Axis {
    fn sample(&mut self, reacted: bool, mode: u8, faults: u32) {
        if reacted {
            self.safe = Some(self.safe.unwrap_or(true) && SAFE_MODES.contains(&mode));
        }
        self.latched = faults != 0;
    }
}

/// One joint.
#[derive(Debug, Default)]
struct Joint {
    commanded: Reaction,
    physical: Reaction,
    held_mm: Extremes,
    axis: Axis,
}

/// One wheel.
#[derive(Debug, Default)]
struct Wheel {
    stopped: Reaction,
    ramp: Reaction,
    axis: Axis,
}

/// The reactions to an event, while samples come in.
#[derive(Debug, Default)]
pub(super) struct SafeStateMeter {
    /// `None`: the scenario has no such event.
    at_s: Option<f64>,
    estop: bool,
    joints: [Joint; 6],
    wheels: [Wheel; 2],
    /// When the dump valve was first commanded open, and open, s.
    dump_s: [Option<f64>; 2],
}

impl SafeStateMeter {
    pub(super) fn new(at_s: Option<f64>, estop: bool) -> Self {
        Self {
            at_s,
            estop,
            ..Self::default()
        }
    }

    pub(super) fn joint(&mut self, joint: usize, row: &Row<JointSample>) {
        let Some(at_s) = self.at_s else { return };
        let (joint, v) = (&mut self.joints[joint], &row.v);
        if within(row, at_s, at_s + STAGE_S) {
            joint.commanded.sample(row.t_s(), commanded_open(v));
            joint.physical.sample(row.t_s(), v.valves_open != 0);
        }
        if within(row, at_s + REACTION_S, at_s + STAGE_S) {
            joint.held_mm.add(v.position_mm);
        }
        let reacted = within(row, at_s + REACTION_S, f64::INFINITY);
        joint.axis.sample(reacted, v.mode, v.faults);
    }

    pub(super) fn wheel(&mut self, wheel: usize, row: &Row<WheelSample>) {
        let Some(at_s) = self.at_s else { return };
        let (wheel, v) = (&mut self.wheels[wheel], &row.v);
        if within(row, at_s, f64::INFINITY) {
            let (t_s, rim_mm_s) = (row.t_s(), v.velocity_mm_s.abs());
            wheel.stopped.sample(t_s, rim_mm_s > STANDING_MM_S);
            wheel.ramp.sample(t_s, !SAFE_MODES.contains(&v.mode));
        }
        let reacted = within(row, at_s + REACTION_S, f64::INFINITY);
        wheel.axis.sample(reacted, v.mode, v.faults);
    }

    pub(super) fn supply(&mut self, row: &Row<SupplySample>) {
        let Some(at_s) = self.at_s else { return };
        if within(row, at_s, f64::INFINITY) {
            let dumps = [row.v.dump_commanded, row.v.dump_open];
            for (first_s, _) in self.dump_s.iter_mut().zip(dumps).filter(|(_, d)| *d) {
                first_s.get_or_insert(row.t_s());
            }
        }
    }

    fn axes(&self) -> impl Iterator<Item = &Axis> {
        let joints = self.joints.iter().map(|j| &j.axis);
        joints.chain(self.wheels.iter().map(|w| &w.axis))
    }

    pub(super) fn targets(&self) -> Vec<Target> {
        match self.at_s {
            Some(at_s) => self.targets_at(at_s),
            None => vec![Target::new(
                "SS0",
                "the scenario has the event that these targets measure",
                None,
                "s",
                None,
                None,
            )],
        }
    }

    fn targets_at(&self, at_s: f64) -> Vec<Target> {
        let joints = || self.joints.iter();
        let shut = worst(joints().map(|j| j.commanded.within_stage(at_s)));
        let physical = worst(joints().map(|j| j.physical.within_stage(at_s)));
        let wheels = worst(self.wheels.iter().map(|w| w.stopped.after(at_s, 0.0)));
        let moved = worst(joints().map(|j| j.held_mm.span()));
        let safe = self.axes().filter(|axis| axis.safe == Some(true)).count();
        let latched = self.axes().filter(|axis| axis.latched).count();
        let mut targets = vec![
            Target::new(
                "SS1",
                "every valve of every cylinder commanded shut (slowest joint)",
                shut.map(|s| s * 1e3),
                "ms",
                None,
                Some(REACTION_S * 1e3),
            ),
            Target::new(
                "SS2",
                "every valve physically shut (slowest joint; t_off later than commanded)",
                physical.map(|s| s * 1e3),
                "ms",
                None,
                Some(REACTION_S * 1e3 + 30.0),
            ),
            Target::new(
                "SS3",
                "both wheels at a standstill (slower wheel)",
                wheels.map(|s| s * 1e3),
                "ms",
                None,
                Some(WHEEL_STOP_S * 1e3),
            ),
            Target::new(
                "SS4",
                "axes in a safe mode at the reaction time and at every sample after it",
                Some(safe as f64),
                "1",
                Some(8.0),
                Some(8.0),
            ),
            Target::new(
                "SS5",
                "axes with a latched fault at the end of the run",
                Some(latched as f64),
                "1",
                Some(8.0),
                Some(8.0),
            ),
            Target::new(
                "SS6",
                "largest movement of a held cylinder from 60 to 500 ms after the event",
                moved,
                "mm",
                None,
                None,
            )
            .info(),
        ];
        if self.estop {
            let first = |i: usize| self.dump_s[i].map(|t_s| (t_s - at_s) * 1e3);
            for (id, what, value) in [
                ("SS7", "supply dump valve commanded open", first(0)),
                ("SS7-open", "supply dump valve physically open", first(1)),
            ] {
                let limit = Some(REACTION_S * 1e3);
                targets.push(Target::new(id, what, value, "ms", None, limit));
            }
        }
        let ramps = worst(self.wheels.iter().map(|w| w.ramp.after(at_s, 0.001)));
        targets.push(Target::new(
            "SS8",
            "ramp of the wheels begun: the board has left tracking (slower wheel)",
            ramps.map(|s| s * 1e3),
            "ms",
            None,
            Some(REACTION_S * 1e3),
        ));
        targets
    }
}

/// Largest value; `None` if any is unknown.
fn worst(mut values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    values.try_fold(0.0_f64, |worst, v| Some(worst.max(v?)))
}

/// Whether a valve of the joint is energised in the tick that begins here.
pub(crate) fn commanded_open(s: &JointSample) -> bool {
    s.fill_a_us | s.vent_a_us | s.fill_b_us | s.vent_b_us != 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_telemetry::Recording;

    fn targets(recording: &Recording, at_s: f64, estop: bool) -> Vec<Target> {
        let mut meter = SafeStateMeter::new(Some(at_s), estop);
        for (i, rows) in recording.joints.iter().enumerate() {
            rows.iter().for_each(|row| meter.joint(i, row));
        }
        for (i, rows) in recording.wheels.iter().enumerate() {
            rows.iter().for_each(|row| meter.wheel(i, row));
        }
        recording.supply.iter().for_each(|row| meter.supply(row));
        meter.targets()
    }

    /// Valves busy until `shut_ms`, physically open 4 ms longer, mode 3 until then.
    fn recording(shut_ms: u64) -> Recording {
        let mut r = Recording::default();
        for ms in 0..2000_u64 {
            let t_ns = ms * 1_000_000;
            let busy = ms < shut_ms;
            for joint in &mut r.joints {
                let v = JointSample {
                    fill_a_us: if busy { 500 } else { 0 },
                    valves_open: u8::from(ms < shut_ms + 4),
                    mode: if busy { 3 } else { 4 },
                    faults: u32::from(!busy),
                    ..JointSample::default()
                };
                joint.push(Row { t_ns, v });
            }
            for wheel in &mut r.wheels {
                let v = WheelSample {
                    velocity_mm_s: if ms < 1300 { 180.0 } else { 0.0 },
                    mode: if busy { 3 } else { 4 },
                    faults: u32::from(!busy),
                    ..WheelSample::default()
                };
                wheel.push(Row { t_ns, v });
            }
        }
        r
    }

    fn value(targets: &[Target], id: &str) -> (f64, bool) {
        let t = targets.iter().find(|t| t.id == id).expect("present");
        (t.value.expect("measured"), t.pass)
    }

    #[test]
    fn reaction_times_are_measured_from_the_event() {
        let targets = targets(&recording(1055), 1.0, false);
        let (shut, pass) = value(&targets, "SS1");
        assert!((shut - 55.0).abs() < 1e-6 && pass, "{shut}");
        let (physical, pass) = value(&targets, "SS2");
        assert!((physical - 59.0).abs() < 1e-6 && pass);
        assert!((value(&targets, "SS3").0 - 299.0).abs() < 1e-6);
        let (ramp, pass) = value(&targets, "SS8");
        assert!((ramp - 55.0).abs() < 1e-6 && pass, "{ramp}");
        assert_eq!(value(&targets, "SS4"), (8.0, true));
        assert_eq!(value(&targets, "SS5"), (8.0, true));
    }

    /// The dump valve is commanded 20 ms after the event and opens 25 ms later.
    #[test]
    fn dump_is_measured_as_commanded_and_as_it_is() {
        let mut recording = recording(1055);
        for ms in 0..2000_u64 {
            let v = SupplySample {
                dump_commanded: ms >= 1020,
                dump_open: ms >= 1045,
                ..SupplySample::default()
            };
            let t_ns = ms * 1_000_000;
            recording.supply.push(Row { t_ns, v });
        }
        let found = targets(&recording, 1.0, true);
        let (commanded, pass) = value(&found, "SS7");
        assert!((commanded - 20.0).abs() < 1e-6 && pass, "{commanded}");
        let (open, pass) = value(&found, "SS7-open");
        assert!((open - 45.0).abs() < 1e-6 && pass, "{open}");
        recording.supply.clear();
        let without = self::targets(&recording, 1.0, true);
        assert!(without.iter().any(|t| t.id == "SS7" && !t.pass));
    }

    #[test]
    fn a_late_reaction_fails() {
        let targets = targets(&recording(1080), 1.0, false);
        assert!(!value(&targets, "SS1").1);
        assert!(!value(&targets, "SS8").1);
        assert_eq!(value(&targets, "SS4"), (0.0, false));
    }
}
