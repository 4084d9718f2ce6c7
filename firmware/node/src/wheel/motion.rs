//! From the set-points of the bus to commands of the wheel controller.
//!
//! Position mode: the wanted position advances with the velocity of its set-point for at most one bus cycle. The
//! command follows it by at most the maximum speed per sample, and starts at the actual position when the board arms.
//! Trapezoidal mode: a changed reference starts a profile as soon as none is running. Velocity modes: the velocity of
//! the set-point.

use super::settings::WheelSettings;
use wheeleg_control::wheel::{WheelCommand, WheelController, WheelMode, WheelVelocity};
use wheeleg_protocol::{WheelControlMode, WheelSetpoint};
use wheeleg_units::WheelCount;

/// What the bus requests of the wheel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Target {
    pub(super) position: WheelCount,
    /// 12.4 counts per sample.
    pub(super) velocity_raw: i16,
    age: u32,
}

impl Target {
    /// Stands still at `position`.
    pub(super) const fn at(position: WheelCount) -> Self {
        Self {
            position,
            velocity_raw: 0,
            age: 0,
        }
    }

    /// Turns at a velocity.
    pub(super) const fn turning(position: WheelCount, velocity_raw: i16) -> Self {
        Self {
            position,
            velocity_raw,
            age: 0,
        }
    }

    pub(super) const fn from_setpoint(setpoint: &WheelSetpoint) -> Self {
        Self {
            position: setpoint.reference,
            velocity_raw: setpoint.velocity_raw,
            age: 0,
        }
    }

    /// Wanted position of this sample; then makes the target one sample older.
    fn advance(&mut self, cycle_ticks: u32) -> WheelCount {
        let samples = i64::from(self.age.min(cycle_ticks));
        let sixteenths = i64::from(self.velocity_raw).saturating_mul(samples);
        let counts = i32::try_from(sixteenths.wrapping_shr(4)).unwrap_or(0);
        self.age = self.age.saturating_add(1);
        self.position.wrapping_add(counts)
    }
}

/// What limited the command of this sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct MotionLimits {
    /// The command was slowed to the maximum speed, or the velocity step to what the controller accepts.
    pub(super) rate: bool,
}

/// Puts the controller into `mode`, at standstill at the actual position.
///
/// Trapezoidal mode stays in position control until a profile is started.
pub(super) fn engage(controller: &mut WheelController, mode: WheelControlMode, actual: WheelCount) {
    let enter = match mode {
        WheelControlMode::Idle => WheelMode::Idle,
        WheelControlMode::Position | WheelControlMode::Trapezoidal => WheelMode::Position,
        WheelControlMode::ProportionalVelocity => WheelMode::ProportionalVelocity,
        WheelControlMode::IntegralVelocity => WheelMode::IntegralVelocity,
    };
    // From idle, with a sample timer that the settings have checked, none of these is refused. If one were, the
    // controller would stay in idle, which drives nothing.
    let _ = controller.apply(WheelCommand::Idle);
    let _ = controller.apply(WheelCommand::Position(actual));
    let _ = controller.apply(WheelCommand::FinalPosition(actual));
    let _ = controller.apply(WheelCommand::Velocity(WheelVelocity::ZERO));
    let _ = controller.apply(WheelCommand::Enter(enter));
}

/// Passes speed and acceleration to the controller, which refuses them while a profile is running.
#[inline]
pub(super) fn tune_profile(controller: &mut WheelController, settings: &WheelSettings) {
    let _ = controller.apply(WheelCommand::MaximumVelocity(settings.max_speed));
    let _ = controller.apply(WheelCommand::Acceleration(settings.acceleration));
}

/// Passes the command of this sample to the controller.
#[inline]
pub(super) fn command(
    controller: &mut WheelController,
    mode: WheelControlMode,
    target: &mut Target,
    settings: &WheelSettings,
) -> MotionLimits {
    let mut limits = MotionLimits::default();
    match mode {
        WheelControlMode::Idle => {}
        WheelControlMode::Position => {
            let wanted = target.advance(settings.cycle_ticks);
            let present = controller.command();
            let distance = wanted.wrapping_difference(present);
            let speed = i32::from(settings.max_speed);
            let step = distance.clamp(speed.saturating_neg(), speed);
            limits.rate = step != distance;
            let _ = controller.apply(WheelCommand::Position(present.wrapping_add(step)));
        }
        WheelControlMode::Trapezoidal => {
            let arrived = controller.command() == target.position;
            if controller.mode() == WheelMode::Position && !arrived {
                tune_profile(controller, settings);
                let _ = controller.apply(WheelCommand::FinalPosition(target.position));
                let _ = controller.apply(WheelCommand::Enter(WheelMode::Trapezoidal));
            }
        }
        WheelControlMode::ProportionalVelocity => {
            let velocity = WheelVelocity::from_bits(target.velocity_raw);
            let _ = controller.apply(WheelCommand::Velocity(velocity));
        }
        WheelControlMode::IntegralVelocity => {
            let wanted = whole_velocity(target.velocity_raw);
            if controller
                .apply(WheelCommand::IntegralVelocity(wanted))
                .is_err()
            {
                // Too large a step for the chip: go via zero.
                limits.rate = true;
                let _ = controller.apply(WheelCommand::IntegralVelocity(0));
            }
        }
    }
    limits
}

/// 12.4 counts per sample as whole counts, rounded toward −∞, −128…127.
pub(super) fn whole_velocity(velocity_raw: i16) -> i8 {
    let whole = velocity_raw.wrapping_shr(4);
    i8::try_from(whole).unwrap_or(if whole < 0 { i8::MIN } else { i8::MAX })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::WheelParameters;
    use wheeleg_control::wheel::WheelInput;

    const MODE: WheelControlMode = WheelControlMode::Trapezoidal;

    fn settings() -> WheelSettings {
        WheelSettings::new(&WheelParameters::default(), MODE).unwrap()
    }

    fn standing_at(actual: WheelCount) -> WheelController {
        let mut controller = WheelController::new();
        engage(&mut controller, MODE, actual);
        controller
    }

    #[test]
    fn a_profile_runs_once_to_a_new_reference_and_none_when_it_has_arrived() {
        let (start, goal) = (WheelCount::wrapping_new(0), WheelCount::wrapping_new(3_000));
        let settings = settings();
        let mut controller = standing_at(start);
        let mut target = Target::at(goal);
        let mut starts = 0;
        for _ in 0..1_000 {
            let ran = controller.mode() == WheelMode::Trapezoidal;
            command(&mut controller, MODE, &mut target, &settings);
            let runs = controller.mode() == WheelMode::Trapezoidal;
            starts += u32::from(runs && !ran);
            let actual = controller.command();
            controller.step(&WheelInput {
                actual,
                limit: false,
                stop: false,
            });
        }
        assert_eq!(controller.command(), goal);
        assert_eq!(controller.mode(), WheelMode::Position);
        assert_eq!(starts, 1);
    }

    #[test]
    fn a_controller_that_does_not_control_starts_no_profile() {
        let mut controller = standing_at(WheelCount::wrapping_new(0));
        controller.apply(WheelCommand::Idle).unwrap();
        let mut target = Target::at(WheelCount::wrapping_new(3_000));
        command(&mut controller, MODE, &mut target, &settings());
        assert_eq!(controller.mode(), WheelMode::Idle);
    }

    #[test]
    fn whole_velocity_rounds_down_and_saturates() {
        for (raw, whole) in [
            (i16::MIN, -128),
            (-2_049, -128),
            (-2_048, -128),
            (-2_047, -128),
            (-2_032, -127),
            (-17, -2),
            (-16, -1),
            (-1, -1),
            (0, 0),
            (15, 0),
            (16, 1),
            (2_031, 126),
            (2_032, 127),
            (2_047, 127),
            (2_048, 127),
            (i16::MAX, 127),
        ] {
            assert_eq!(whole_velocity(raw), whole, "{raw}");
        }
    }
}
