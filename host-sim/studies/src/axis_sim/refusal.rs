//! Why the joint board refuses a design, in words.

use wheeleg_control::axis::AxisField;
use wheeleg_control::joint::{ConfigError, JointParameter};

/// The error, with its parameter.
pub(super) fn message(error: &ConfigError) -> String {
    match error {
        ConfigError::OutOfRange(which) => format!("{} is out of its range", name(which)),
        ConfigError::Inconsistent(which) => format!("{} contradicts another value", name(which)),
        _ => "it is not usable".to_owned(),
    }
}

/// Name of a parameter as in the table of the boards, or of a quantity of the axis.
const fn name(which: &JointParameter) -> &'static str {
    match which {
        JointParameter::Tick => "the control tick",
        JointParameter::Proportional => "`proportional`",
        JointParameter::CorrectionPd => "`correction_pd`",
        JointParameter::CorrectionId => "`correction_id`",
        JointParameter::FeedForward => "`feed_forward`",
        JointParameter::ErrorScale => "`error_scale`",
        JointParameter::VelocityScale => "`velocity_scale`",
        JointParameter::IntegralScale => "`integral_scale`",
        JointParameter::IntegralZone => "`integral_zone`",
        JointParameter::DutyLimit => "`duty_limit`",
        JointParameter::DeadZoneDuty => "`dead_zone_duty`",
        JointParameter::MinimumDuty => "`minimum_duty`",
        JointParameter::SettleBand => "`settle_band`",
        JointParameter::SettleVelocity => "`settle_velocity`",
        JointParameter::SettleDwell => "`settle_dwell`",
        JointParameter::ReleaseBand => "`release_band`",
        JointParameter::ReleaseDwell => "`release_dwell`",
        JointParameter::BumplessTime => "`bumpless_time`",
        JointParameter::VelocityWindow => "`velocity_window`",
        JointParameter::Stroke => "the stroke, `stroke_min` to `stroke_max`,",
        JointParameter::PwmPeriod => "`pwm_period`",
        JointParameter::Integral => "`integral`",
        JointParameter::Derivative => "`derivative`",
        JointParameter::SlidingTime => "`sliding_time`",
        JointParameter::Rules => "the rule base",
        JointParameter::Axis(field) => of_axis(*field),
        _ => "a parameter",
    }
}

const fn of_axis(field: AxisField) -> &'static str {
    match field {
        AxisField::Bore => "the bore",
        AxisField::Rod => "the rod",
        AxisField::DeadVolume => "a dead volume",
        AxisField::Conductance => "a conductance",
        AxisField::CriticalRatio => "a critical ratio",
        AxisField::Supply => "the supply pressure",
        AxisField::Mass => "the mass",
        AxisField::Friction => "the Coulomb, break-away or viscous friction",
        AxisField::Delay => "a switching or line delay, or its margin,",
        AxisField::Band => "the rest band",
        AxisField::Stroke => "the stroke of the axis",
        _ => "a quantity of the axis",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_names_the_parameter() {
        let bore = ConfigError::OutOfRange(JointParameter::Axis(AxisField::Bore));
        assert_eq!(message(&bore), "the bore is out of its range");
        let band = ConfigError::Inconsistent(JointParameter::ReleaseBand);
        assert_eq!(message(&band), "`release_band` contradicts another value");
    }
}
