//! Parameters of a joint board that follow from its axis file, each with the fields from which it is
//! computed.
//!
//! The limits are those of the protocol's table. If a quantity is a single field of the file, they are the
//! range of that field; if it is computed from several, they are a relation between these.

use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::flow::Iso6358;
use wheeleg_protocol::param::JointParam;

use super::board_value::raw_within;

/// Smallest band of rest of a joint, in steps of the converter: below it, rest is noise.
pub const STEPS_AT_REST: f64 = 2.5;

/// One quantity.
#[derive(Debug, Clone, Copy)]
pub struct Derived {
    /// The board's parameter.
    pub parameter: JointParam,
    /// Fields of the axis file.
    pub fields: &'static [&'static str],
    value: fn(&AxisParams) -> f64,
}

impl Derived {
    /// The quantity of an axis, in the unit of the parameter.
    #[must_use]
    pub fn value(&self, axis: &AxisParams) -> f64 {
        (self.value)(axis)
    }

    /// Whether the board's table allows it.
    #[must_use]
    pub fn fits(&self, axis: &AxisParams) -> bool {
        raw_within(self.parameter.info(), self.value(axis)).is_some()
    }
}

/// The quantity of a parameter, in its unit; `None` if it does not follow from the axis.
#[must_use]
pub fn derived(axis: &AxisParams, parameter: JointParam) -> Option<f64> {
    let row = DERIVED.iter().find(|row| row.parameter == parameter);
    row.map(|row| row.value(axis))
}

/// All of them.
#[rustfmt::skip]
pub const DERIVED: &[Derived] = &[
    from_fields(JointParam::StrokeMax, &["cylinder.stroke"], |a| a.cylinder.stroke_m * 1e3),
    from_fields(JointParam::ValveOn, &["fill_valve.t_on", "vent_valve.t_on"], |a| longer(a, |v| v.t_on_s)),
    from_fields(JointParam::ValveOff, &["fill_valve.t_off", "vent_valve.t_off"], |a| longer(a, |v| v.t_off_s)),
    from_fields(JointParam::SensorFullScale, &["sensor.potentiometer.electrical_stroke", "sensor.potentiometer.gain"],
        |a| a.potentiometer.electrical_stroke_m / a.potentiometer.gain * 1e3),
    from_fields(JointParam::Bore, &["cylinder.bore"], |a| a.cylinder.bore_m * 1e3),
    from_fields(JointParam::Rod, &["cylinder.rod"], |a| a.cylinder.rod_m * 1e3),
    from_fields(JointParam::DeadVolumeA, &["cylinder.dead_volume_a", "line.volume"],
        |a| (a.cylinder.dead_volume_a_m3 + a.cylinder.line_volume_m3) * 1e6),
    from_fields(JointParam::DeadVolumeB, &["cylinder.dead_volume_b", "line.volume"],
        |a| (a.cylinder.dead_volume_b_m3 + a.cylinder.line_volume_m3) * 1e6),
    from_fields(JointParam::Conductance, &["fill_valve.conductance", "line.conductance"],
        |a| path(a).conductance_m3_s_pa * 1e8),
    from_fields(JointParam::CriticalRatio, &["fill_valve.critical_ratio", "line.critical_ratio"],
        |a| path(a).critical_ratio),
    from_fields(JointParam::SupplyPressure, &["supply.set_pressure"], |a| a.supply.set_pressure_pa * 1e-3),
    from_fields(JointParam::MovingMass, &["moving.mass"], |a| a.moving_mass_kg),
    from_fields(JointParam::FrictionCoulomb, &["friction.coulomb"], |a| a.cylinder.friction.coulomb_n),
    from_fields(JointParam::FrictionBreakaway, &["friction.static"], |a| a.cylinder.friction.static_n),
    from_fields(JointParam::FrictionViscous, &["friction.viscous"], |a| a.cylinder.friction.viscous_n_s_m),
    from_fields(JointParam::LineDelay, &["line.delay"], |a| a.cylinder.line_delay_s * 1e6),
    from_fields(JointParam::RestBand, &["sensor.potentiometer.electrical_stroke", "sensor.adc.bits"],
        |a| (STEPS_AT_REST * lsb_m(a) * 1e3).max(LEAST_BAND_MM)),
];

/// Smallest band of rest \[mm\]: that of the parameter.
const LEAST_BAND_MM: f64 = limits(JointParam::RestBand)[0];

const fn from_fields(
    parameter: JointParam,
    fields: &'static [&'static str],
    value: fn(&AxisParams) -> f64,
) -> Derived {
    Derived {
        parameter,
        fields,
        value,
    }
}

/// The longer time of fill and vent valve \[µs\]: a board has one parameter for both.
fn longer(axis: &AxisParams, time_s: fn(&wheeleg_plant::valve::ValveParams) -> f64) -> f64 {
    let c = &axis.cylinder;
    time_s(&c.fill_valve).max(time_s(&c.vent_valve)) * 1e6
}

/// An open valve with its line.
fn path(axis: &AxisParams) -> Iso6358 {
    let c = &axis.cylinder;
    match &c.line_flow {
        Some(line) => c.fill_valve.flow.in_series(line),
        None => c.fill_valve.flow,
    }
}

/// Step of the converter \[m\].
fn lsb_m(axis: &AxisParams) -> f64 {
    axis.potentiometer.electrical_stroke_m / f64::from(1_u32 << axis.adc.bits)
}

/// Limits of a board's parameter, in its unit, as in its table: with at most three decimals.
#[must_use]
pub const fn limits(parameter: JointParam) -> [f64; 2] {
    let row = parameter.info();
    let bits = row.format.fraction_bits();
    [thousandths(row.min, bits), thousandths(row.max, bits)]
}

/// A raw number with `bits` fractional bits, to the nearest thousandth.
const fn thousandths(raw: i32, bits: u32) -> f64 {
    let half = if raw < 0 { -0.5 } else { 0.5 };
    let thousandths = raw as f64 / (1_u64 << bits) as f64 * 1000.0 + half;
    thousandths as i64 as f64 / 1000.0
}

/// The same in SI, where `per_si` units of the parameter make one: dividing by these is exact to the last
/// digit.
pub(crate) const fn limits_si(parameter: JointParam, per_si: f64) -> [f64; 2] {
    let [low, high] = limits(parameter);
    [low / per_si, high / per_si]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board_value::scale;

    /// Three decimals are enough for the limits of these rows.
    #[test]
    fn limits_are_those_of_the_table_to_the_raw_number() {
        for derived in DERIVED {
            let row = derived.parameter.info();
            let raw = limits(derived.parameter).map(|limit| (limit * scale(row.format)).round());
            assert_eq!(
                raw,
                [f64::from(row.min), f64::from(row.max)],
                "{}",
                row.name
            );
        }
        assert_eq!(limits(JointParam::MovingMass), [0.02, 200.0]);
        assert_eq!(limits(JointParam::SensorMin)[0], -50.0);
        assert_eq!(limits_si(JointParam::ValveOn, 1e6), [0.0, 0.05]);
    }
}
