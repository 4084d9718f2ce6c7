//! Gains from the data of an axis.
//!
//! Nothing here is tuned to a plant: the same rules give every gain of every law from bore, stroke, volumes,
//! valve, mass and delays. The rules for the usual laws are stated beside each; the predictive law's own are
//! in [`wheeleg_control::axis::AxisModel::new`].

use wheeleg_config::SENSOR_TRACK;
use wheeleg_config::bench::Kind;
use wheeleg_config::derived::{derived, limits};
use wheeleg_control::axis::AxisData;
use wheeleg_control::joint::{Correction, Gain, JointGains, Law};
use wheeleg_node::sensor::SensorConfig;
use wheeleg_plant::axis::AxisParams;
use wheeleg_protocol::param::JointParam;
use wheeleg_units::{AdcCode, Duty, Micros, PositionMm, VelocityMmS};

use super::firmware::{Design, Supervision};

/// Widest band of rest \[mm\]: to that the predictive law's own patience widens a band, and below the error at rest
/// of 0.5 mm that a comparison allows.
const WIDEST_BAND_MM: f64 = 0.4;

/// The designer's knowledge of an axis: its data sheet. The designer does not know the load, nor deviations
/// from the data sheet.
#[derive(Debug, Clone, Copy)]
struct Facts {
    /// Stroke \[mm\].
    stroke_mm: f64,
    /// Speed of the piston at a choked outlet, slower side \[mm/s\].
    speed_mm_s: f64,
    /// Tick, t_on and delay of the line \[s\].
    dead_time_s: f64,
    /// Shortest opening over PWM period \[-\].
    shortest_duty: f64,
    /// PWM period \[s\].
    period_s: f64,
}

/// The design of a controller for an axis.
#[must_use]
pub fn design(axis: &AxisParams, kind: Kind) -> Design {
    let data = axis_data(axis);
    let facts = facts(axis, &data);
    Design {
        gains: gains(&data, &facts, kind),
        correction: if kind == Kind::FuzzyId {
            Correction::Id
        } else {
            Correction::Pd
        },
        sensor: sensor(axis),
        supervision: supervision(&facts),
    }
}

/// No move takes three times as long as the whole stroke at full speed, or stays a tenth of the stroke behind
/// (a board allows less for a standing piston).
fn supervision(facts: &Facts) -> Supervision {
    let limit_s = 0.5 + 3.0 * facts.stroke_mm / facts.speed_mm_s;
    Supervision {
        // As fast as the parameter table allows: a step stays a step.
        slew_rate: VelocityMmS::from_f64(5000.0),
        following_error: PositionMm::from_f64((0.1 * facts.stroke_mm).max(2.0)),
        following_time: Micros((limit_s.clamp(0.01, 10.0) * 1e6).round() as u32),
    }
}

/// The axis's data sheet in the formats of the board.
#[must_use]
pub fn axis_data(axis: &AxisParams) -> AxisData {
    let of = |parameter: JointParam| derived(axis, parameter).unwrap_or_default();
    let fixed = |parameter: JointParam| PositionMm::from_f64(of(parameter));
    let micros = |us: f64| Micros(us.round() as u32);
    let gain = |parameter: JointParam| Gain::saturating_from_num(of(parameter));
    let c = &axis.cylinder;
    // Also no less than an eighth of the smallest pulse's effect: below it, rest is luck.
    let eighth_mm = (0.13e3 * free_step_m(axis)).min(WIDEST_BAND_MM);
    let band_mm = of(JointParam::RestBand).max(eighth_mm);
    AxisData {
        bore: fixed(JointParam::Bore),
        rod: fixed(JointParam::Rod),
        dead_a: fixed(JointParam::DeadVolumeA),
        dead_b: fixed(JointParam::DeadVolumeB),
        conductance: gain(JointParam::Conductance),
        critical_ratio: gain(JointParam::CriticalRatio),
        supply: fixed(JointParam::SupplyPressure),
        mass: fixed(JointParam::MovingMass),
        standing_mass: PositionMm::ZERO,
        coulomb: fixed(JointParam::FrictionCoulomb),
        breakaway: fixed(JointParam::FrictionBreakaway),
        viscous: fixed(JointParam::FrictionViscous),
        valve_on: micros(of(JointParam::ValveOn)),
        valve_off: micros(of(JointParam::ValveOff)),
        margin: micros(0.1e6 * c.fill_valve.t_on_s.max(1e-3)),
        line_delay: micros(of(JointParam::LineDelay)),
        band: PositionMm::from_f64(within(JointParam::RestBand, band_mm)),
        release: PositionMm::ZERO,
        precharged: false,
        learns_mass: true,
        stroke: fixed(JointParam::StrokeMax),
    }
}

/// A value of the designer's choice, as close as a board allows.
fn within(parameter: JointParam, value: f64) -> f64 {
    let [low, high] = limits(parameter);
    value.clamp(low, high)
}

/// Distance by which the shortest opening of one valve moves a free piston, at mid stroke \[m\].
fn free_step_m(axis: &AxisParams) -> f64 {
    let c = &axis.cylinder;
    let quarter_pi = std::f64::consts::FRAC_PI_4;
    let area_a = quarter_pi * c.bore_m * c.bore_m;
    let area_b = area_a - quarter_pi * c.rod_m * c.rod_m;
    let volume = |dead_m3: f64, area: f64| dead_m3 + c.line_volume_m3 + 0.5 * area * c.stroke_m;
    let volume_a = volume(c.dead_volume_a_m3, area_a);
    let volume_b = volume(c.dead_volume_b_m3, area_b);
    let open_s = c.fill_valve.t_off_s + 0.1 * c.fill_valve.t_on_s;
    let flow = c.fill_valve.flow.conductance_m3_s_pa * axis.gas.choked_outflow_pa();
    // The exponent and the pressure appear in force and stiffness alike.
    let force = flow * open_s * area_a / volume_a;
    force / (area_a * area_a / volume_a + area_b * area_b / volume_b)
}

fn facts(axis: &AxisParams, data: &AxisData) -> Facts {
    let c = &axis.cylinder;
    let area_m2 = std::f64::consts::FRAC_PI_4 * c.bore_m * c.bore_m;
    let flow = data.conductance.to_num::<f64>() * 1e-8;
    let us = |value: Micros| f64::from(value.get()) * 1e-6;
    // As fast as possible with half of the period usable, 100 Hz at most; slower than 50 Hz only if an
    // effective pulse or gap would not fit half a period of 20 ms.
    let (on_s, off_s, margin_s) = (us(data.valve_on), us(data.valve_off), us(data.margin));
    let delays_s = on_s + off_s + 2.0 * margin_s;
    let least_s = 2.0 * (on_s.max(off_s) + margin_s);
    let period_ms = (2e3 * delays_s).min(20.0).max(1e3 * least_s);
    let period_s = period_ms.clamp(10.0, 120.0).ceil() * 1e-3;
    Facts {
        stroke_mm: c.stroke_m * 1e3,
        speed_mm_s: flow * axis.gas.choked_outflow_pa() / area_m2 * 1e3,
        dead_time_s: 1e-3 + us(data.valve_on) + us(data.line_delay),
        shortest_duty: (us(data.valve_off) + us(data.margin)) / period_s,
        period_s,
    }
}

fn gains(data: &AxisData, facts: &Facts, kind: Kind) -> JointGains {
    use JointParam as P;
    let gain = |of: P, value: f64| Gain::saturating_from_num(within(of, value));
    let mm = |of: P, value: f64| PositionMm::from_f64(within(of, value));
    let duty = |value: f64| Duty::from_per_mille((value * 1000.0).round() as i16);
    // A PWM loop acts half a period and the dead time late.
    let lag_s = facts.dead_time_s + 0.5 * facts.period_s;
    // Full duty at an error of six lags at full speed: the factors here and below were searched once, on the
    // bench axis, for no limit cycle, then for error and settling time; they have no unit.
    let full_mm = 6.0 * lag_s * facts.speed_mm_s;
    let proportional = 1.0 / full_mm;
    let (settle_mm, release_mm) = (0.5, 1.5);
    let base = JointGains {
        proportional: gain(P::Proportional, proportional),
        correction_pd: gain(P::CorrectionPd, 0.6),
        correction_id: gain(P::CorrectionId, 0.6),
        feed_forward: gain(P::FeedForward, 1.0 / facts.speed_mm_s),
        error_scale: mm(P::ErrorScale, full_mm),
        velocity_scale: VelocityMmS::from_f64(within(P::VelocityScale, 0.5 * facts.speed_mm_s)),
        integral_scale: mm(P::IntegralScale, full_mm * 0.1),
        integral_zone: mm(P::IntegralZone, 0.3 * full_mm),
        duty_limit: Duty::ONE,
        dead_zone_duty: duty((facts.shortest_duty + 0.01).min(0.5)),
        minimum_duty: duty(0.01),
        settle_band: mm(P::SettleBand, settle_mm),
        settle_velocity: VelocityMmS::from_f64(10.0),
        release_band: mm(P::ReleaseBand, release_mm),
        velocity_window: 16,
        stroke_min: PositionMm::ZERO,
        stroke_max: mm(P::StrokeMax, facts.stroke_mm),
        pwm_period: Micros((facts.period_s * 1e6).round() as u32),
        axis: *data,
        ..JointGains::default()
    };
    match kind {
        Kind::OnOff => JointGains {
            law: Law::OnOff,
            // A full push cannot be shorter than the dead time: a dead band of four dead times at full speed,
            // or it chatters even more.
            settle_band: mm(P::SettleBand, 4.0 * facts.speed_mm_s * facts.dead_time_s),
            release_band: mm(P::ReleaseBand, 6.0 * facts.speed_mm_s * facts.dead_time_s),
            ..base
        },
        Kind::PwmP => JointGains {
            law: Law::Proportional,
            // Without damping, a quarter of the gain.
            proportional: gain(P::Proportional, proportional * 6.0 / 25.0),
            ..base
        },
        Kind::PwmPid => JointGains {
            law: Law::Pid,
            proportional: gain(P::Proportional, proportional * 0.5),
            derivative: gain(P::Derivative, proportional * 4.0 * lag_s),
            integral: gain(P::Integral, proportional / (130.0 * lag_s)),
            ..base
        },
        Kind::FuzzyPd => base,
        Kind::FuzzyId => JointGains {
            correction_id: gain(P::CorrectionId, 0.5),
            settle_band: mm(P::SettleBand, 0.4),
            release_band: mm(P::ReleaseBand, 1.2),
            ..base
        },
        Kind::Sliding => JointGains {
            law: Law::Sliding,
            sliding_time: Micros(
                within(P::SlidingTime, 6.0 * facts.dead_time_s * 1e6).round() as u32,
            ),
            settle_band: mm(P::SettleBand, facts.speed_mm_s * facts.dead_time_s),
            release_band: mm(P::ReleaseBand, 3.0 * facts.speed_mm_s * facts.dead_time_s),
            error_scale: mm(P::ErrorScale, 20.0 * facts.speed_mm_s * facts.dead_time_s),
            ..base
        },
        Kind::Predictive => JointGains {
            law: Law::Predictive,
            ..base
        },
    }
}

/// A piston is measured beyond its stops up to this share of its stroke, and this much more \[m\].
const BEYOND_STOP: (f64, f64) = (0.02, 0.005);

/// Calibration of the axis's position sensor, as commissioning would find it.
fn sensor(axis: &AxisParams) -> SensorConfig {
    let p = &axis.potentiometer;
    let code = |share: f64| AdcCode::new((share * 65_536.0).round().clamp(0.0, 65_535.0) as u16);
    let mm = |metres: f64| PositionMm::from_f64(metres * 1e3);
    let stroke_m = axis.cylinder.stroke_m;
    SensorConfig {
        zero: code(p.offset_m / p.electrical_stroke_m),
        full_scale: mm(p.electrical_stroke_m / p.gain),
        code_min: code(SENSOR_TRACK[0]),
        code_max: code(SENSOR_TRACK[1]),
        travel_min: mm(-BEYOND_STOP.1 - BEYOND_STOP.0 * stroke_m),
        travel_max: mm((1.0 + BEYOND_STOP.0) * stroke_m + BEYOND_STOP.1),
        step_max: PositionMm::from_int(10),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis_sim::{Delays, Node, design_with};
    use wheeleg_config::AxisConfig;

    /// Wider valves widen the band of rest, but not beyond what counts as rest.
    #[test]
    fn coarse_valves_widen_the_band_of_rest_to_a_limit() {
        let mut sheet = AxisConfig::load("bench-vq110u").expect("built in").axis;
        let fine_mm = axis_data(&sheet).band.to_f64();
        let mut band_mm = |times: f64| {
            for valve in [
                &mut sheet.cylinder.fill_valve,
                &mut sheet.cylinder.vent_valve,
            ] {
                valve.flow.conductance_m3_s_pa *= times;
            }
            axis_data(&sheet).band.to_f64()
        };
        let (wider_mm, widest_mm) = (band_mm(4.0), band_mm(10.0));
        assert!(wider_mm > 1.2 * fine_mm, "{fine_mm} {wider_mm}");
        assert!((widest_mm - WIDEST_BAND_MM).abs() < 1e-3, "{widest_mm}");
    }

    /// Valves of a few milliseconds and of forty: a board accepts every controller's design, with the delays
    /// of the sheet and with twice those delays.
    #[test]
    fn a_board_accepts_designs_for_fast_and_slow_valves() {
        let mut sheet = AxisConfig::load("bench-vq110u").expect("built in").axis;
        for (t_on_s, t_off_s) in [
            (0.001, 0.0005),
            (0.005, 0.003),
            (0.006, 0.006),
            (0.012, 0.008),
            (0.004, 0.015),
            (0.024, 0.02),
        ] {
            for valve in [
                &mut sheet.cylinder.fill_valve,
                &mut sheet.cylinder.vent_valve,
            ] {
                valve.t_on_s = t_on_s;
                valve.t_off_s = t_off_s;
            }
            let twice = Delays {
                t_on_s: 2.0 * t_on_s,
                t_off_s: 2.0 * t_off_s,
            };
            for kind in Kind::ALL {
                for delays in [None, Some(twice)] {
                    let design = design_with(&sheet, delays, kind);
                    let board = Node::new(&design);
                    assert!(
                        board.is_ok(),
                        "{} {t_on_s} {t_off_s} {delays:?}: {:?}",
                        kind.name(),
                        board.err()
                    );
                }
            }
        }
    }

    /// Valves that fit a period of 10 to 20 ms get one.
    #[test]
    fn the_period_is_longer_than_20_ms_only_where_it_must_be() {
        let sheet = AxisConfig::load("bench-vq110u").expect("built in").axis;
        let period_ms = |t_on_s, t_off_s| {
            let delays = Delays { t_on_s, t_off_s };
            let period = design_with(&sheet, Some(delays), Kind::PwmP)
                .gains
                .pwm_period;
            f64::from(period.get()) * 1e-3
        };
        assert!((period_ms(0.002, 0.001) - 10.0).abs() < 1e-9);
        assert!((period_ms(0.009, 0.009) - 20.0).abs() < 1e-9);
        let slow = period_ms(0.02, 0.01);
        assert!((40.0..=46.0).contains(&slow), "{slow}");
    }

    /// A board can hold every design for values of an axis file at and between the ends of their ranges: it
    /// refuses none.
    #[test]
    fn a_board_accepts_the_designs_for_every_axis_that_a_file_may_have() {
        use rand::{RngExt as _, SeedableRng as _};
        const BENCH: &str = include_str!("../../../axes/bench-vq110u.toml");
        let listed = AxisConfig::parse("bench.toml", BENCH)
            .expect("built in")
            .parameters;
        let free = |path: &str| {
            let parts = [
                "fill_valve.",
                "vent_valve.",
                "line.",
                "cylinder.",
                "friction.",
                "moving.m",
            ];
            let parts = parts.iter().chain(&["sensor.", "supply.set", "numerics."]);
            let mut parts = parts.filter(|part| path.starts_with(**part));
            parts.next().is_some()
        };
        let listed: Vec<_> = listed.iter().filter(|p| free(&p.path)).collect();
        let (mut sound, mut tried) = (0, 0);
        for seed in 0..1500 {
            let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
            let changes = (0..rng.random_range(1..5)).map(|_| {
                let p = listed[rng.random_range(0..listed.len())];
                let share: f64 = [0.0, 1.0, rng.random()][rng.random_range(0..3)];
                let low = p.min.max(1e-4 * p.max);
                let value = match share {
                    0.0 => p.min,
                    share => (low * (p.max / low).powf(share)).clamp(p.min, p.max),
                };
                let value = if p.whole { value.round() } else { value };
                wheeleg_config::axis::Change {
                    path: p.path.clone(),
                    values: vec![value; p.value.len()],
                    unit: p.unit.clone(),
                    source: "ASSUMED".to_owned(),
                }
            });
            let changes: Vec<_> = changes.collect();
            let text = AxisConfig::rewritten("bench.toml", BENCH, &changes).expect("sound");
            tried += 1;
            let Ok(config) = AxisConfig::parse("bench.toml", &text) else {
                continue;
            };
            sound += 1;
            for kind in Kind::ALL {
                let board = Node::new(&design(&config.axis, kind));
                assert!(
                    board.is_ok(),
                    "{}, {changes:?}: {:?}",
                    kind.name(),
                    board.err()
                );
            }
        }
        println!("{sound} of {tried} axes can be");
        assert!(sound > tried / 5, "{sound} of {tried}");
    }
}
