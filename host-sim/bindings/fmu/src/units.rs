//! SI exponents of the units that axis files accept, for importers that convert.

use wheeleg_config::Dimension;

/// Base units of a dimension with their exponents.
pub(crate) const fn exponents(dimension: Dimension) -> &'static [(&'static str, &'static str)] {
    match dimension {
        Dimension::Number | Dimension::Count | Dimension::Flag | Dimension::Lsb => &[],
        Dimension::Length => &[("m", "1")],
        Dimension::Area | Dimension::VolumePerLength => &[("m", "2")],
        Dimension::Volume => &[("m", "3")],
        Dimension::Time => &[("s", "1")],
        Dimension::BitRate => &[("s", "-1")],
        Dimension::Velocity => &[("m", "1"), ("s", "-1")],
        Dimension::Acceleration => &[("m", "1"), ("s", "-2")],
        Dimension::Mass => &[("kg", "1")],
        Dimension::MassMoment => &[("kg", "1"), ("m", "1")],
        Dimension::Inertia => &[("kg", "1"), ("m", "2")],
        Dimension::Force => &[("kg", "1"), ("m", "1"), ("s", "-2")],
        Dimension::Torque => &[("kg", "1"), ("m", "2"), ("s", "-2")],
        Dimension::Pressure => &[("kg", "1"), ("m", "-1"), ("s", "-2")],
        Dimension::Temperature => &[("K", "1")],
        // m3/(s Pa)
        Dimension::SonicConductance => &[("kg", "-1"), ("m", "4"), ("s", "1")],
        Dimension::Density => &[("kg", "1"), ("m", "-3")],
        Dimension::Stiffness => &[("kg", "1"), ("s", "-2")],
        Dimension::Damping => &[("kg", "1"), ("s", "-1")],
        Dimension::PerVelocity => &[("m", "-1"), ("s", "1")],
        Dimension::Angle => &[("rad", "1")],
        Dimension::AngularVelocity => &[("rad", "1"), ("s", "-1")],
        Dimension::Voltage => &[("kg", "1"), ("m", "2"), ("s", "-3"), ("A", "-1")],
        Dimension::Resistance => &[("kg", "1"), ("m", "2"), ("s", "-3"), ("A", "-2")],
        Dimension::Inductance => &[("kg", "1"), ("m", "2"), ("s", "-2"), ("A", "-2")],
        Dimension::TorqueConstant => &[("kg", "1"), ("m", "2"), ("s", "-2"), ("A", "-1")],
        Dimension::HeatTransfer => &[("kg", "1"), ("s", "-3"), ("K", "-1")],
        Dimension::SpecificHeat => &[("m", "2"), ("s", "-2"), ("K", "-1")],
    }
}
