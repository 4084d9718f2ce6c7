//! Converts a design to the parameters of a joint board.
//!
//! Gains get into a board only through its parameter table, so this is also how they get onto the bench of
//! the comparison, and into the file that `wheeleg tune` writes.

use wheeleg_control::joint::{Correction, Law};
use wheeleg_protocol::param::{Format, JointParam, ParamInfo};
use wheeleg_units::PositionMm;

use super::error::AxisSimError;
use super::firmware::Design;

/// Every parameter that a design sets, raw, in ascending order of number. Parameters that do not depend on
/// the axis (watchdog, staged exhaust) keep their default.
///
/// # Errors
/// [`AxisSimError::Parameter`] names a value outside the board's table.
pub fn commission(design: &Design) -> Result<Vec<(JointParam, i32)>, AxisSimError> {
    let mut list: Vec<(JointParam, i32)> = JointParam::ALL
        .iter()
        .filter_map(|p| Some((*p, raw(design, *p)?)))
        .collect();
    list.sort_by_key(|(p, _)| p.id());
    for (parameter, raw) in &list {
        let row = parameter.info();
        if !row.permits(*raw) {
            return Err(AxisSimError::Parameter {
                name: row.name,
                value: value(row, *raw),
                min: value(row, row.min),
                max: value(row, row.max),
                unit: row.unit,
            });
        }
    }
    Ok(list)
}

/// A raw number in the unit of its row.
#[must_use]
pub fn value(row: &ParamInfo, raw: i32) -> f64 {
    f64::from(raw) / f64::from(row.format.fraction_bits()).exp2()
}

/// A value of the control crate, which uses the table's formats.
fn raw(design: &Design, parameter: JointParam) -> Option<i32> {
    use JointParam as P;
    let (g, a, s) = (&design.gains, &design.gains.axis, &design.sensor);
    let us = |time: wheeleg_units::Micros| i32::try_from(time.get()).unwrap_or(i32::MAX);
    let law = |law: Law| Law::ALL.iter().position(|l| *l == law).unwrap_or(0);
    Some(match parameter {
        P::Proportional => g.proportional.to_bits(),
        P::CorrectionPd => g.correction_pd.to_bits(),
        P::CorrectionId => g.correction_id.to_bits(),
        P::FeedForward => g.feed_forward.to_bits(),
        P::ErrorScale => g.error_scale.raw(),
        P::VelocityScale => g.velocity_scale.raw(),
        P::IntegralScale => g.integral_scale.raw(),
        P::IntegralZone => g.integral_zone.raw(),
        P::DutyLimit => g.duty_limit.raw(),
        P::DeadZoneDuty => g.dead_zone_duty.raw(),
        P::MinimumDuty => g.minimum_duty.raw(),
        P::SettleBand => g.settle_band.raw(),
        P::SettleVelocity => g.settle_velocity.raw(),
        P::SettleDwell => us(g.settle_dwell),
        P::ReleaseBand => g.release_band.raw(),
        P::ReleaseDwell => us(g.release_dwell),
        P::BumplessTime => us(g.bumpless_time),
        P::VelocityWindow => i32::from(g.velocity_window),
        P::StrokeMin => g.stroke_min.raw(),
        P::StrokeMax => g.stroke_max.raw(),
        P::PwmPeriod => us(g.pwm_period),
        P::Correction => i32::from(design.correction == Correction::Id),
        P::ValveOn => us(a.valve_on),
        P::ValveOff => us(a.valve_off),
        P::SlewRate => design.supervision.slew_rate.raw(),
        P::SensorZero => i32::from(s.zero.get()),
        P::SensorFullScale => s.full_scale.raw(),
        P::SensorCodeMin => i32::from(s.code_min.get()),
        P::SensorCodeMax => i32::from(s.code_max.get()),
        P::SensorMin => s.travel_min.raw(),
        P::SensorMax => s.travel_max.raw(),
        // Per tick of 1 ms; the board divides again.
        P::SensorRate => PositionMm::from_f64(s.step_max.to_f64() * 1000.0).raw(),
        P::FollowingError => design.supervision.following_error.raw(),
        P::FollowingTime => us(design.supervision.following_time) / 1000,
        P::Law => law(g.law) as i32,
        P::Integral => g.integral.to_bits(),
        P::Derivative => g.derivative.to_bits(),
        P::SlidingTime => us(g.sliding_time),
        P::Bore => a.bore.raw(),
        P::Rod => a.rod.raw(),
        P::DeadVolumeA => a.dead_a.raw(),
        P::DeadVolumeB => a.dead_b.raw(),
        P::Conductance => a.conductance.to_bits(),
        P::CriticalRatio => a.critical_ratio.to_bits(),
        P::SupplyPressure => a.supply.raw(),
        P::MovingMass => a.mass.raw(),
        P::FrictionCoulomb => a.coulomb.raw(),
        P::FrictionBreakaway => a.breakaway.raw(),
        P::FrictionViscous => a.viscous.raw(),
        P::LineDelay => us(a.line_delay),
        P::RestBand => a.band.raw(),
        P::RestRelease => a.release.raw(),
        P::MassLearning => i32::from(a.learns_mass),
        P::WatchdogCycles
        | P::HoldTime
        | P::ExhaustDuty
        | P::MotionMargin
        | P::Precharge
        | P::StandingMass
        | P::ReferenceAcceleration
        | P::ReferenceLead => return None,
    })
}

/// Lines `name = { value = …, unit = "…", source = "…" }` of a robot file's
/// `[node.…]` section.
#[must_use]
pub fn toml_lines(list: &[(JointParam, i32)], source: &str) -> String {
    use std::fmt::Write as _;
    let mut text = String::new();
    for (parameter, raw) in list {
        let row = parameter.info();
        let number = match row.format {
            Format::Integer | Format::Flag => raw.to_string(),
            // Enough digits to give the same raw number back.
            _ => {
                let digits = (f64::from(row.format.fraction_bits()) * 0.302).ceil() as usize + 1;
                let text = format!("{:.digits$}", value(row, *raw));
                let short = text.trim_end_matches('0');
                if short.ends_with('.') {
                    format!("{short}0")
                } else {
                    short.to_owned()
                }
            }
        };
        let _ = writeln!(
            text,
            "{:<18} = {{ value = {number}, unit = \"{}\", source = \"{source}\" }}",
            row.name, row.unit
        );
    }
    text
}
