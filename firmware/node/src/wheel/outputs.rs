//! From the mode and the control law to the drive of a sample.

use super::motion::{Target, command, engage};
use super::node::WheelNode;
use crate::hardware::{DumpValve, Encoder, MotorDrive, PinError, SwitchBank};
use crate::mode::Mode;
use wheeleg_control::wheel::{WheelCommand, WheelInput, WheelMode, WheelOutput, WheelStatus};
use wheeleg_protocol::{DisarmReason, Fault, Limit, LimitBits};
use wheeleg_units::{Micros, Ticks};

impl<M: MotorDrive, E: Encoder, P: SwitchBank, D: DumpValve> WheelNode<M, E, P, D> {
    /// Closed loop.
    pub(super) fn drive(&mut self, limits: &mut LimitBits, now: Micros) -> WheelOutput {
        if self.controller.mode() != WheelMode::Trapezoidal {
            self.tune_profile();
        }
        let motion = command(
            &mut self.controller,
            self.control_mode,
            &mut self.target,
            &self.settings,
        );
        let output = self.controller.step(&WheelInput {
            actual: self.state.actual,
            limit: false,
            stop: false,
        });
        self.state.drive = output.pwm;
        self.state.ramp_from = output.pwm;
        *limits = limit_bits(&output, motion.rate);
        let has_position = output.mode != WheelMode::ProportionalVelocity;
        let beyond = has_position && output.error.unsigned_abs() > self.settings.following_error;
        self.state.following = if beyond {
            self.state.following.next()
        } else {
            Ticks::ZERO
        };
        if self.state.following >= self.settings.following_ticks {
            self.axis_fault(Fault::FollowingError, now);
            self.state.drive = 0;
        }
        output
    }

    /// No control: ramp to standstill in Hold, nothing otherwise.
    pub(super) fn rest(&mut self, now: Micros) -> WheelOutput {
        self.state.following = Ticks::ZERO;
        self.target = Target::at(self.state.actual);
        let _ = self.controller.apply(WheelCommand::Idle);
        let output = self.controller.step(&WheelInput {
            actual: self.state.actual,
            limit: false,
            stop: false,
        });
        // After a fault of the axis its drive may be what runs away: no ramp.
        let ramps = self.core.mode() == Mode::Hold
            && self.core.supervisor.disarm_reason() != DisarmReason::Fault;
        let ramp = i64::from(self.settings.stop_ramp.get());
        let left = ramp.saturating_sub(i64::from(self.core.supervisor.time_in_mode(now).get()));
        self.state.drive = if ramps && left > 0 {
            let scaled = i64::from(self.state.ramp_from).saturating_mul(left);
            let drive = scaled.checked_div(ramp).unwrap_or(0);
            i8::try_from(drive).unwrap_or(0)
        } else {
            self.state.ramp_from = 0;
            0
        };
        output
    }

    pub(super) fn write(&mut self, dump_open: bool) -> Result<(), PinError> {
        let motor = self.motor.write(self.state.drive);
        let dump = self.dump_valve.set_open(dump_open);
        motor.and(dump)
    }

    /// The wheel has armed: closed loop at standstill where it is.
    pub(super) fn engage(&mut self) {
        self.target = Target::at(self.state.actual);
        engage(&mut self.controller, self.control_mode, self.state.actual);
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
