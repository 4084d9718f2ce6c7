//! Gains from the data of an axis.
//!
//! Nothing here is tuned to a plant: every gain of every law follows from bore,
//! stroke, volumes, valve, mass and delays by the same rules. The rules for the
//! usual laws are stated beside each; the predictive law's own are in
//! [`wheeleg_control::axis::AxisModel::new`].

use wheeleg_config::{SENSOR_TRACK, STEPS_AT_REST};
use wheeleg_control::axis::AxisData;
use wheeleg_control::joint::{Correction, Gain, JointGains, Law};
use wheeleg_node::sensor::SensorConfig;
use wheeleg_plant::axis::AxisParams;
use wheeleg_protocol::param::{JointParam, ParamInfo};
use wheeleg_units::{AdcCode, Duty, Micros, PositionMm, VelocityMmS};

use super::commission::value;
use super::firmware::{Design, Supervision};

/// A controller of the comparison.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Full push or pull outside a dead band.
    OnOff,
    /// PWM, proportional.
    PwmP,
    /// PWM, PID.
    PwmPid,
    /// The paper's P + fuzzy PD.
    FuzzyPd,
    /// P + fuzzy ID.
    FuzzyId,
    /// Sliding mode on seven valve modes.
    Sliding,
    /// Estimated pressures, dead time ahead; the default.
    Predictive,
}

impl Kind {
    /// All of them, simple to best.
    pub const ALL: [Self; 7] = [
        Self::OnOff,
        Self::PwmP,
        Self::PwmPid,
        Self::FuzzyPd,
        Self::FuzzyId,
        Self::Sliding,
        Self::Predictive,
    ];

    /// Name in reports and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::OnOff => "on-off",
            Self::PwmP => "pwm-p",
            Self::PwmPid => "pwm-pid",
            Self::FuzzyPd => "fuzzy-pd",
            Self::FuzzyId => "fuzzy-id",
            Self::Sliding => "sliding",
            Self::Predictive => "predictive",
        }
    }

    /// The controller of a name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// What the designer knows of an axis: its data sheet. Load, and what differs
/// from the data sheet, it does not know.
#[derive(Debug, Clone, Copy)]
struct Facts {
    /// Stroke \[mm\].
    stroke_mm: f64,
    /// Speed of the piston at a choked outlet, slower side \[mm/s\].
    speed_mm_s: f64,
    /// Tick, t_on and line \[s\].
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

/// No move takes three times as long as the whole stroke at full speed, or stays a tenth of the
/// stroke behind (a board allows a piston that stands less).
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
    let c = &axis.cylinder;
    let mm = |metres: f64| PositionMm::from_f64(metres * 1e3);
    let micros = |seconds: f64| Micros((seconds * 1e6).round() as u32);
    let path = match &c.line_flow {
        Some(line) => c.fill_valve.flow.in_series(line),
        None => c.fill_valve.flow,
    };
    let gain = |value: f64| Gain::saturating_from_num(value);
    let lsb_m = axis.potentiometer.electrical_stroke_m / f64::from(1_u32 << axis.adc.bits);
    AxisData {
        bore: mm(c.bore_m),
        rod: mm(c.rod_m),
        dead_a: PositionMm::from_f64((c.dead_volume_a_m3 + c.line_volume_m3) * 1e6),
        dead_b: PositionMm::from_f64((c.dead_volume_b_m3 + c.line_volume_m3) * 1e6),
        conductance: gain(path.conductance_m3_s_pa * 1e8),
        critical_ratio: gain(path.critical_ratio),
        supply: PositionMm::from_f64(axis.supply.set_pressure_pa * 1e-3),
        mass: PositionMm::from_f64(axis.moving_mass_kg),
        coulomb: PositionMm::from_f64(c.friction.coulomb_n),
        breakaway: PositionMm::from_f64(c.friction.static_n),
        viscous: PositionMm::from_f64(c.friction.viscous_n_s_m),
        valve_on: micros(c.fill_valve.t_on_s.max(c.vent_valve.t_on_s)),
        valve_off: micros(c.fill_valve.t_off_s.max(c.vent_valve.t_off_s)),
        margin: micros(0.1 * c.fill_valve.t_on_s.max(1e-3)),
        line_delay: micros(c.line_delay_s),
        // No less than an eighth of what the smallest pulse does, too: below it, rest is luck.
        band: mm((STEPS_AT_REST * lsb_m)
            .max(0.13 * free_step_m(axis))
            .max(2e-5)),
        release: PositionMm::ZERO,
        precharged: false,
        learns_mass: true,
        stroke: mm(c.stroke_m),
    }
}

/// How far a free piston is moved by the shortest opening of one valve, at mid stroke \[m\].
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
    // As fast as lets half of the period be used, 100 Hz at most; slower than 50 Hz only
    // where a pulse or a gap that acts would not fit half a period of 20 ms.
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
    let gain = |value: f64| Gain::saturating_from_num(value);
    let mm = |value: f64| PositionMm::from_f64(value);
    let duty = |value: f64| Duty::from_per_mille((value * 1000.0).round() as i16);
    // A PWM loop acts half a period and the dead time late.
    let lag_s = facts.dead_time_s + 0.5 * facts.period_s;
    // Full duty at an error of six lags at full speed: the factors here and below
    // were searched once, on the bench axis, for no limit cycle, then error and
    // settling time; they have no unit.
    let full_mm = 6.0 * lag_s * facts.speed_mm_s;
    let proportional = 1.0 / full_mm;
    let (settle_mm, release_mm) = (0.5, 1.5);
    let base = JointGains {
        proportional: gain(proportional),
        correction_pd: gain(0.6),
        correction_id: gain(0.6),
        feed_forward: gain(1.0 / facts.speed_mm_s),
        error_scale: mm(full_mm.clamp(0.25, 1000.0)),
        velocity_scale: VelocityMmS::from_f64((0.5 * facts.speed_mm_s).clamp(1.0, 5000.0)),
        integral_scale: mm((full_mm * 0.1).clamp(0.05, 1000.0)),
        integral_zone: mm(0.3 * full_mm),
        duty_limit: Duty::ONE,
        dead_zone_duty: duty((facts.shortest_duty + 0.01).min(0.5)),
        minimum_duty: duty(0.01),
        settle_band: mm(settle_mm),
        settle_velocity: VelocityMmS::from_f64(10.0),
        release_band: mm(release_mm),
        velocity_window: 16,
        stroke_min: PositionMm::ZERO,
        stroke_max: mm(facts.stroke_mm),
        pwm_period: Micros((facts.period_s * 1e6).round() as u32),
        axis: *data,
        ..JointGains::default()
    };
    match kind {
        Kind::OnOff => JointGains {
            law: Law::OnOff,
            // A full push cannot be shorter than the dead time: a dead band of four
            // dead times at full speed, or it chatters all the more.
            settle_band: mm(4.0 * facts.speed_mm_s * facts.dead_time_s),
            release_band: mm(6.0 * facts.speed_mm_s * facts.dead_time_s),
            ..base
        },
        Kind::PwmP => JointGains {
            law: Law::Proportional,
            // Without damping, a quarter of the gain.
            proportional: gain(proportional * 6.0 / 25.0),
            ..base
        },
        Kind::PwmPid => JointGains {
            law: Law::Pid,
            proportional: gain(proportional * 0.5),
            derivative: gain(proportional * 4.0 * lag_s),
            integral: gain(proportional / (130.0 * lag_s)),
            ..base
        },
        Kind::FuzzyPd => base,
        Kind::FuzzyId => JointGains {
            correction_id: gain(0.5),
            settle_band: mm(0.4),
            release_band: mm(1.2),
            ..base
        },
        Kind::Sliding => JointGains {
            law: Law::Sliding,
            sliding_time: Micros((6.0 * facts.dead_time_s * 1e6).round() as u32),
            settle_band: mm(facts.speed_mm_s * facts.dead_time_s),
            release_band: mm(3.0 * facts.speed_mm_s * facts.dead_time_s),
            error_scale: mm((20.0 * facts.speed_mm_s * facts.dead_time_s).clamp(0.25, 1000.0)),
            ..base
        },
        Kind::Predictive => JointGains {
            law: Law::Predictive,
            ..base
        },
    }
}

/// Beyond its stops a piston is measured to this share of its stroke, and this much more \[m\].
const BEYOND_STOP: (f64, f64) = (0.02, 0.005);

/// The longest stroke that a board can be told \[m\]: that of `stroke_max`, and what lies within
/// `sensor_max` with the way beyond the stops.
#[must_use]
pub fn longest_stroke_m() -> f64 {
    let most = |row: &ParamInfo| value(row, row.max) * 1e-3;
    let measured = (most(JointParam::SensorMax.info()) - BEYOND_STOP.1) / (1.0 + BEYOND_STOP.0);
    measured.min(most(JointParam::StrokeMax.info()))
}

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

    /// Valves of a few milliseconds and of forty: every controller's design is one that a
    /// board accepts, as on the sheet and with the delays twice as long as told there.
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

    /// Valves that fit a period of 10 to 20 ms have one.
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
}
