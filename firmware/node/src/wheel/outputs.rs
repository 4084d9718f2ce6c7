//! From the mode and the control law to the drive of a sample.

use super::motion::{Target, command, engage, tune_profile};
use super::node::WheelNode;
use crate::hardware::{DumpValve, Encoder, MotorDrive, PinError, SwitchBank};
use crate::mode::Mode;
use wheeleg_control::wheel::{WheelCommand, WheelInput, WheelMode, WheelOutput, WheelStatus};
use wheeleg_protocol::{DisarmReason, Limit, LimitBits};
use wheeleg_units::{Micros, Ticks};

/// Fractional bits of the mean drive.
const MEAN_FRACTION_BITS: u32 = 8;
/// Samples over which the drive is averaged, as a power of two: 64, or 33 ms at the default sample time. The lead
/// filter answers one encoder edge with up to 16 counts, so a single sample says little about the drive that keeps the
/// wheel turning, and a ramp starting from it could accelerate a wheel.
const MEAN_SHIFT: u32 = 6;

/// Exponential mean of the drive, per cent × 2^8, rounded towards −∞.
const fn mean(mean: i32, percent: i8) -> i32 {
    // |mean| ≤ 128 × 2^8, so nothing here comes near the limits.
    let newest = (percent as i32).wrapping_shl(MEAN_FRACTION_BITS);
    mean.saturating_add(newest.saturating_sub(mean) >> MEAN_SHIFT)
}

/// Drive from which the ramp of a stop starts, per cent: the smaller of the mean and the newest drive, and zero if they
/// differ in direction. So the ramp neither follows a single sample nor undoes braking that has begun.
fn ramp_from(mean: i32, newest: i8) -> i8 {
    // The mean of percentages is itself a percentage.
    let mean = (mean >> MEAN_FRACTION_BITS) as i8;
    match (mean > 0, newest > 0) {
        (true, true) => mean.min(newest),
        (false, false) => mean.max(newest),
        _ => 0,
    }
}

/// Drive of a ramp from `from` per cent, with `left` of its `whole` time remaining.
fn ramped(from: i8, left: Micros, whole: Micros) -> i8 {
    // A ramp takes 0.4 s at most: the product is below 2^26.
    let scaled = i32::from(from).saturating_mul(left.get() as i32);
    let drive = scaled.checked_div(whole.get() as i32).unwrap_or(0);
    i8::try_from(drive).unwrap_or(0)
}

impl<M: MotorDrive, E: Encoder, P: SwitchBank, D: DumpValve> WheelNode<M, E, P, D> {
    /// Closed loop.
    pub(super) fn drive(&mut self) {
        let motion = command(
            &mut self.controller,
            self.control_mode,
            &mut self.target,
            &self.settings,
        );
        // Computed in place.
        self.snapshot.control = self.controller.step(&WheelInput {
            actual: self.state.actual,
            limit: false,
            stop: false,
        });
        let output = &self.snapshot.control;
        self.state.drive = output.pwm;
        self.state.drive_mean = mean(self.state.drive_mean, output.pwm);
        self.state.ramp_from = ramp_from(self.state.drive_mean, output.pwm);
        self.snapshot.limits = limit_bits(output, motion.rate);
        let has_position = output.mode != WheelMode::ProportionalVelocity;
        let beyond = has_position && output.error.unsigned_abs() > self.settings.following_error;
        self.state.following = if beyond {
            self.state.following.next()
        } else {
            Ticks::ZERO
        };
        if self.is_behind() {
            // A stop before the next sample has nothing to ramp down, either.
            self.state.drive = 0;
            self.state.drive_mean = 0;
            self.state.ramp_from = 0;
        }
    }

    /// Whether the following error has lasted for its time. The drive is off in the sample that finds this; the fault
    /// is latched in the next one, which has no law to compute at the same time.
    #[inline]
    pub(super) fn is_behind(&self) -> bool {
        self.state.following >= self.settings.following_ticks
    }

    /// No control: ramps to a standstill in Hold, otherwise off.
    pub(super) fn rest(&mut self, now: Micros) {
        self.state.following = Ticks::ZERO;
        self.target = Target::at(self.state.actual);
        let _ = self.controller.apply(WheelCommand::Idle);
        self.snapshot.control = self.controller.step(&WheelInput {
            actual: self.state.actual,
            limit: false,
            stop: false,
        });
        self.snapshot.limits = LimitBits::NONE;
        // After a fault of the axis its drive may be what runs away: no ramp. Nor for a stop of an axis that had
        // already been stopped: a ramp that is cleared and braked again between two ticks would start afresh.
        let ramps = self.core.mode() == Mode::Hold
            && self.core.supervisor.held_from_drive()
            && self.core.supervisor.disarm_reason() != DisarmReason::Fault;
        let ramp = self.settings.stop_ramp;
        let left = ramp.saturating_sub(self.core.supervisor.time_in_mode(now));
        self.state.drive = if ramps && left > Micros::ZERO {
            ramped(self.state.ramp_from, left, ramp)
        } else {
            self.state.drive_mean = 0;
            self.state.ramp_from = 0;
            0
        };
    }

    pub(super) fn write(&mut self, dump_open: bool) -> Result<(), PinError> {
        let motor = self.motor.write(self.state.drive);
        let dump = self.dump_valve.set_open(dump_open);
        motor.and(dump)
    }

    /// The wheel has armed: closed loop at standstill at its present position.
    pub(super) fn engage(&mut self) {
        // Nothing is driven yet: a stop before the next sample has nothing to ramp down.
        self.state.drive_mean = 0;
        self.state.ramp_from = 0;
        self.target = Target::at(self.state.actual);
        engage(&mut self.controller, self.control_mode, self.state.actual);
        tune_profile(&mut self.controller, &self.settings);
    }
}

fn limit_bits(output: &WheelOutput, rate: bool) -> LimitBits {
    let WheelStatus {
        command_saturated,
        pwm_saturated,
        ..
    } = output.status;
    [
        (command_saturated || pwm_saturated, Limit::DutySaturated),
        (rate, Limit::RateLimited),
        (output.blank_first_pulse, Limit::DriveInhibited),
    ]
    .into_iter()
    .filter(|(active, _)| *active)
    .fold(LimitBits::NONE, |bits, (_, limit)| bits.with(limit))
}

#[cfg(test)]
mod tests {
    use super::{mean, ramp_from};

    #[test]
    fn one_wild_sample_does_not_set_the_ramp() {
        let mut steady = 0;
        for _ in 0..1000 {
            steady = mean(steady, 40);
        }
        assert_eq!(steady >> 8, 39, "rounded down");
        assert_eq!(ramp_from(mean(steady, 100), 100), 40);
        assert_eq!(ramp_from(mean(steady, -100), -100), 0);
        assert_eq!(ramp_from(mean(steady, 10), 10), 10);
        let mut backward = 0;
        for _ in 0..1000 {
            backward = mean(backward, -100);
        }
        assert_eq!(ramp_from(backward, -128), -100);
        assert_eq!(ramp_from(backward, -3), -3);
        assert_eq!(ramp_from(0, 0), 0);
    }
}
