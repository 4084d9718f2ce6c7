//! Physical dimensions and the units accepted for each.

/// A physical dimension with its accepted units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// A pure number.
    Number,
    /// A whole number of things.
    Count,
    /// Yes or no.
    Flag,
    /// Least significant bits of a converter.
    Lsb,
    /// Length.
    Length,
    /// Area.
    Area,
    /// Volume.
    Volume,
    /// Volume per travelled length.
    VolumePerLength,
    /// Time.
    Time,
    /// Bits per second.
    BitRate,
    /// Speed.
    Velocity,
    /// Acceleration.
    Acceleration,
    /// Mass.
    Mass,
    /// First moment of mass.
    MassMoment,
    /// Moment of inertia.
    Inertia,
    /// Force.
    Force,
    /// Torque.
    Torque,
    /// Absolute pressure.
    Pressure,
    /// Absolute temperature.
    Temperature,
    /// Sonic conductance of ISO 6358.
    SonicConductance,
    /// Density.
    Density,
    /// Linear stiffness.
    Stiffness,
    /// Linear viscous damping.
    Damping,
    /// Gain from speed to a pure number.
    PerVelocity,
    /// Angle.
    Angle,
    /// Angular velocity.
    AngularVelocity,
    /// Voltage.
    Voltage,
    /// Electrical resistance.
    Resistance,
    /// Inductance.
    Inductance,
    /// Torque constant of a motor.
    TorqueConstant,
    /// Heat transfer coefficient.
    HeatTransfer,
    /// Specific gas constant or heat capacity.
    SpecificHeat,
}

impl Dimension {
    /// Accepted units and the factor from each to SI; help texts name the first one first.
    #[must_use]
    pub const fn units(self) -> &'static [(&'static str, f64)] {
        use std::f64::consts::PI;
        match self {
            Self::Number => &[("1", 1.0), ("%", 0.01)],
            Self::Count => &[("count", 1.0), ("bit", 1.0), ("byte", 1.0)],
            Self::Flag => &[("flag", 1.0)],
            Self::Lsb => &[("LSB", 1.0)],
            Self::Length => &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("um", 1e-6)],
            Self::Area => &[("m2", 1.0), ("cm2", 1e-4), ("mm2", 1e-6)],
            Self::Volume => &[("m3", 1.0), ("dm3", 1e-3), ("cm3", 1e-6), ("mm3", 1e-9)],
            Self::VolumePerLength => &[("m3/m", 1.0), ("dm3/m", 1e-3)],
            Self::Time => &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)],
            Self::BitRate => &[("bit/s", 1.0), ("kbit/s", 1e3), ("Mbit/s", 1e6)],
            Self::Velocity => &[("m/s", 1.0), ("cm/s", 1e-2), ("mm/s", 1e-3)],
            Self::Acceleration => &[("m/s2", 1.0), ("mm/s2", 1e-3)],
            Self::Mass => &[("kg", 1.0), ("g", 1e-3)],
            Self::MassMoment => &[("kg m", 1.0)],
            Self::Inertia => &[("kg m2", 1.0), ("g cm2", 1e-7)],
            Self::Force => &[("N", 1.0), ("kN", 1e3)],
            Self::Torque => &[("N m", 1.0), ("mN m", 1e-3)],
            Self::Pressure => &[("Pa", 1.0), ("kPa", 1e3), ("MPa", 1e6), ("bar", 1e5)],
            Self::Temperature => &[("K", 1.0)],
            Self::SonicConductance => &[("m3/(s Pa)", 1.0), ("dm3/(s bar)", 1e-8)],
            Self::Density => &[("kg/m3", 1.0)],
            Self::Stiffness => &[("N/m", 1.0), ("N/mm", 1e3), ("kN/m", 1e3)],
            Self::Damping => &[("N s/m", 1.0), ("N s/mm", 1e3)],
            Self::PerVelocity => &[("s/m", 1.0), ("s/mm", 1e3)],
            Self::Angle => &[("deg", PI / 180.0), ("rad", 1.0)],
            Self::AngularVelocity => &[("rad/s", 1.0), ("deg/s", PI / 180.0), ("rpm", PI / 30.0)],
            Self::Voltage => &[("V", 1.0), ("mV", 1e-3)],
            Self::Resistance => &[("ohm", 1.0), ("kohm", 1e3)],
            Self::Inductance => &[("H", 1.0), ("mH", 1e-3), ("uH", 1e-6)],
            Self::TorqueConstant => &[("N m/A", 1.0), ("mN m/A", 1e-3)],
            Self::HeatTransfer => &[("W/(m2 K)", 1.0)],
            Self::SpecificHeat => &[("J/(kg K)", 1.0), ("kJ/(kg K)", 1e3)],
        }
    }

    /// The factor from `unit` to SI, if it is accepted.
    #[must_use]
    pub fn factor(self, unit: &str) -> Option<f64> {
        self.units()
            .iter()
            .find(|(name, _)| *name == unit)
            .map(|(_, factor)| *factor)
    }

    /// Accepted unit names, for messages.
    #[must_use]
    pub fn unit_names(self) -> String {
        let names: Vec<String> = self
            .units()
            .iter()
            .map(|(n, _)| format!("\"{n}\""))
            .collect();
        names.join(", ")
    }
}

/// A unit behind a number, for messages; empty for a pure number.
#[must_use]
pub(crate) fn suffix(unit: &str) -> String {
    match unit {
        "1" | "count" => String::new(),
        unit => format!(" {unit}"),
    }
}

/// A number to four digits, for messages with computed values.
pub fn brief(value: f64) -> String {
    pretty(format!("{value:.3e}").parse().unwrap_or(value))
}

/// A number for people: up to `digits` significant digits, without float noise.
#[must_use]
pub fn pretty(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let magnitude = value.abs();
    if !(1e-4..1e7).contains(&magnitude) {
        let text = format!("{value:.5e}");
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
        return format!("{mantissa}e{exponent}");
    }
    let decimals = (8 - magnitude.log10().floor() as i32 - 1).clamp(0, 12) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_right() {
        assert_eq!(Dimension::Pressure.factor("bar"), Some(1e5));
        assert_eq!(
            Dimension::SonicConductance.factor("dm3/(s bar)"),
            Some(1e-8)
        );
        assert_eq!(Dimension::Stiffness.factor("N/mm"), Some(1e3));
        assert_eq!(Dimension::Length.factor("s"), None);
        let rpm = Dimension::AngularVelocity.factor("rpm").expect("accepted");
        assert!((rpm * 60.0 - std::f64::consts::TAU).abs() < 1e-12);
    }

    #[test]
    fn numbers_are_written_for_people() {
        assert_eq!(pretty(0.18), "0.18");
        assert_eq!(pretty(0.1 + 0.2), "0.3");
        assert_eq!(pretty(1e-8), "1e-8");
        assert_eq!(pretty(-1_000_000.0), "-1000000");
        assert_eq!(pretty(0.0), "0");
        assert_eq!(pretty(1.44e-9), "1.44e-9");
        assert_eq!(["mm", "1", "count"].map(suffix), [" mm", "", ""]);
    }
}
