//! Modes, flags and the output port.
//!
//! ```text
//! position, trapezoidal, integral velocity   MC = D(z) (command − actual)
//! proportional velocity                      MC = (K/4)(command − actual velocity)
//! PWM = MC limited to ±100
//! ```
//!
//! Source: HCTL-1100 data sheet pp. 14–35 (DATASHEET); deviations are listed at [`WheelController`].

use super::filter::{FilterMemory, MotorCommand};
use super::profile::{Profile, Ramp};
use super::types::{
    LeadFilter, SampleTimer, WheelAcceleration, WheelCommand, WheelError, WheelInput, WheelMode,
    WheelOutput, WheelStatus, WheelVelocity,
};
use wheeleg_units::WheelCount;

/// Largest acceleration, raw: 127 + 255/256 counts per sample².
const ACCELERATION_MAX: u16 = 0x7FFF;
/// Linear range of the PWM port (data sheet: 9CH…64H).
const PWM_MAX: i8 = 100;

/// What runs in each mode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
enum Run {
    #[default]
    Idle,
    Position,
    ProportionalVelocity,
    Trapezoidal(Profile),
    /// The ramp starts at the first sample, from the actual position.
    IntegralVelocity(Option<Ramp>),
}

/// One wheel's motion controller. Call [`WheelController::step`] once per
/// sample, every [`WheelController::sample_timer`] period.
///
/// Kept from the chip: 24-bit wrapping positions; modes are entered only from idle; the trapezoidal profile runs from
/// the *command* position, accepts no new data, and ends in position control, from which the next profile may be
/// started; the gain-only law in proportional velocity mode; velocity commands of integral velocity mode that differ by
/// at most 127; idle clears the filter memory; LIMIT goes to idle from any mode; STOP acts only in integral velocity
/// mode; both flags stay until they are cleared with the input inactive; the motor command saturates at 8 bits and the
/// PWM earlier, at ±100; blanking after a change of sign; a new sample timer takes effect after the present sample.
///
/// Different from the chip, for safety: idle sets the integral velocity command to zero; integral velocity mode starts
/// from the actual position; no mode can be entered while LIMIT is latched; a sample timer below the minimum of the
/// mode is refused. As on the chip, the position command is a register of its own: set it to the actual position before
/// entering position control, or the wheel moves.
///
/// Its `Hash` covers every field, so that a board can seal it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WheelController {
    run: Run,
    memory: FilterMemory,
    filter: LeadFilter,
    timer: SampleTimer,
    next_timer: SampleTimer,
    command: WheelCount,
    final_position: WheelCount,
    velocity: WheelVelocity,
    integral_velocity: i8,
    acceleration: WheelAcceleration,
    maximum_velocity: u8,
    inhibit: bool,
    limit: bool,
    stop: bool,
    /// Inputs of the last sample, if there was one.
    input: WheelInput,
    sampled: bool,
    negative: bool,
}

impl core::hash::Hash for WheelController {
    #[inline]
    fn hash<H: core::hash::Hasher>(&self, state: &mut H) {
        // Destructured, so that a new field cannot be forgotten here.
        let Self {
            run,
            memory,
            filter,
            timer,
            next_timer,
            command,
            final_position,
            velocity,
            integral_velocity,
            acceleration,
            maximum_velocity,
            inhibit,
            limit,
            stop,
            input,
            sampled,
            negative,
        } = self;
        (run, memory, command, final_position, input.actual).hash(state);
        // Each in a byte of its own, four per word.
        let [velocity_low, velocity_high] = velocity.to_bits().to_le_bytes();
        let [acceleration_low, acceleration_high] = acceleration.to_bits().to_le_bytes();
        for bytes in [
            [filter.zero, filter.pole, filter.gain, timer.0],
            [
                velocity_low,
                velocity_high,
                acceleration_low,
                acceleration_high,
            ],
            [
                next_timer.0,
                integral_velocity.cast_unsigned(),
                *maximum_velocity,
                u8::from(*negative),
            ],
            [
                u8::from(*inhibit),
                u8::from(*limit),
                u8::from(*stop),
                u8::from(input.limit),
            ],
            [u8::from(input.stop), u8::from(*sampled), 0, 0],
        ] {
            state.write_u32(u32::from_le_bytes(bytes));
        }
    }
}

impl WheelController {
    /// As after a reset of the chip: idle, default filter and timer, positions zero.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The present mode.
    #[must_use]
    pub const fn mode(&self) -> WheelMode {
        match self.run {
            Run::Idle => WheelMode::Idle,
            Run::Position => WheelMode::Position,
            Run::ProportionalVelocity => WheelMode::ProportionalVelocity,
            Run::Trapezoidal(_) => WheelMode::Trapezoidal,
            Run::IntegralVelocity(_) => WheelMode::IntegralVelocity,
        }
    }

    /// The timer of the sample in progress.
    #[must_use]
    pub const fn sample_timer(&self) -> SampleTimer {
        self.timer
    }

    /// Filter parameters in use.
    #[must_use]
    pub const fn filter(&self) -> LeadFilter {
        self.filter
    }

    /// The position command register.
    #[must_use]
    pub const fn command(&self) -> WheelCount {
        self.command
    }

    /// Velocity generated by the profile or the ramp, 1/256 count per sample; zero in the other modes. It shows when a
    /// commanded stop has been completely generated.
    #[must_use]
    pub const fn generated_velocity_raw(&self) -> i32 {
        match &self.run {
            Run::Trapezoidal(profile) => profile.velocity_raw(),
            Run::IntegralVelocity(Some(ramp)) => ramp.velocity_raw(),
            _ => 0,
        }
    }

    /// Carries out a request.
    ///
    /// # Errors
    /// [`WheelError`]; then nothing has changed.
    // Inlined, because most callers name the command: what remains is then a store.
    #[inline(always)]
    pub fn apply(&mut self, command: WheelCommand) -> Result<(), WheelError> {
        match command {
            WheelCommand::Reset => *self = Self::new(),
            WheelCommand::Idle => self.idle(),
            WheelCommand::Enter(mode) => return self.enter(mode),
            WheelCommand::Position(position) => {
                self.check_no_profile()?;
                self.command = position;
            }
            WheelCommand::Velocity(velocity) => self.velocity = velocity,
            WheelCommand::IntegralVelocity(velocity) => {
                let change = i16::from(velocity).wrapping_sub(i16::from(self.integral_velocity));
                if change.unsigned_abs() > 127 {
                    return Err(WheelError::VelocityStep);
                }
                self.integral_velocity = velocity;
            }
            WheelCommand::Acceleration(acceleration) => {
                self.check_no_profile()?;
                if acceleration.to_bits() > ACCELERATION_MAX {
                    return Err(WheelError::Acceleration);
                }
                self.acceleration = acceleration;
            }
            WheelCommand::MaximumVelocity(maximum) => {
                self.check_no_profile()?;
                if maximum > 127 {
                    return Err(WheelError::MaximumVelocity);
                }
                self.maximum_velocity = maximum;
            }
            WheelCommand::FinalPosition(position) => {
                self.check_no_profile()?;
                self.final_position = position;
            }
            WheelCommand::Filter(filter) => self.filter = filter,
            WheelCommand::SampleTimer(timer) => {
                check_timer(timer, self.mode())?;
                self.next_timer = timer;
            }
            WheelCommand::SignReversalInhibit(inhibit) => self.inhibit = inhibit,
            WheelCommand::ClearStatus => return self.clear_status(),
        }
        Ok(())
    }

    /// INIT/IDLE, from any mode.
    fn idle(&mut self) {
        self.run = Run::Idle;
        self.memory = FilterMemory::default();
        self.integral_velocity = 0;
    }

    #[inline]
    fn enter(&mut self, mode: WheelMode) -> Result<(), WheelError> {
        if mode == WheelMode::Idle {
            self.idle();
            return Ok(());
        }
        if self.limit {
            return Err(WheelError::LimitLatched);
        }
        self.check_no_profile()?;
        let from_idle = self.run == Run::Idle;
        if mode == WheelMode::Trapezoidal {
            if !from_idle && self.run != Run::Position {
                return Err(WheelError::NotPositioning);
            }
        } else if !from_idle {
            return Err(WheelError::NotIdle);
        }
        check_timer(self.next_timer, mode)?;
        self.run = match mode {
            WheelMode::Idle => Run::Idle,
            WheelMode::Position => Run::Position,
            WheelMode::ProportionalVelocity => Run::ProportionalVelocity,
            WheelMode::IntegralVelocity => Run::IntegralVelocity(None),
            WheelMode::Trapezoidal => {
                if self.acceleration.to_bits() == 0 {
                    return Err(WheelError::Acceleration);
                }
                if self.maximum_velocity == 0 {
                    return Err(WheelError::MaximumVelocity);
                }
                Run::Trapezoidal(Profile::new(
                    self.command,
                    self.final_position,
                    self.maximum_velocity,
                    self.acceleration.to_bits(),
                ))
            }
        };
        Ok(())
    }

    fn check_no_profile(&self) -> Result<(), WheelError> {
        if matches!(self.run, Run::Trapezoidal(_)) {
            Err(WheelError::ProfileActive)
        } else {
            Ok(())
        }
    }

    fn clear_status(&mut self) -> Result<(), WheelError> {
        let held = (self.limit && self.input.limit) || (self.stop && self.input.stop);
        self.limit = self.limit && self.input.limit;
        self.stop = self.stop && self.input.stop;
        if held {
            Err(WheelError::InputActive)
        } else {
            Ok(())
        }
    }

    /// One sample. Never panics.
    #[inline]
    pub fn step(&mut self, input: &WheelInput) -> WheelOutput {
        self.timer = self.next_timer;
        let actual = input.actual;
        let last = if self.sampled {
            self.input.actual
        } else {
            actual
        };
        let velocity = actual.wrapping_difference(last);
        self.input = *input;
        self.sampled = true;
        self.limit |= input.limit;
        self.stop |= input.stop;
        if input.limit {
            self.idle();
        }

        let mode = self.mode();
        let status = WheelStatus {
            limit: self.limit,
            stop: self.stop,
            ..WheelStatus::default()
        };
        let Some((motor, command, error)) = self.run(actual, velocity) else {
            self.negative = false;
            return WheelOutput {
                mode,
                command: actual,
                velocity,
                status,
                ..WheelOutput::default()
            };
        };
        let pwm = motor.value.clamp(-PWM_MAX, PWM_MAX);
        // The sign output is low ("positive") at zero, too.
        let negative = pwm < 0;
        let reversed = negative != self.negative;
        self.negative = negative;
        WheelOutput {
            motor_command: motor.value,
            pwm,
            blank_first_pulse: self.inhibit && reversed && pwm != 0,
            mode,
            command,
            error,
            velocity,
            status: WheelStatus {
                profile: matches!(self.run, Run::Trapezoidal(_)),
                command_saturated: motor.saturated,
                pwm_saturated: pwm != motor.value,
                ..status
            },
        }
    }

    /// Motor command, position command and error of this sample; `None` in idle.
    #[inline]
    fn run(
        &mut self,
        actual: WheelCount,
        velocity: i32,
    ) -> Option<(MotorCommand, WheelCount, i32)> {
        match &mut self.run {
            Run::Idle => return None,
            Run::ProportionalVelocity => {
                // |velocity| <= 2^23: sixteenths fit 28 bits.
                let wanted = i32::from(self.velocity.to_bits());
                let error = wanted.wrapping_sub(velocity.wrapping_mul(16));
                let motor = FilterMemory::gain_only(self.filter, error);
                return Some((motor, actual, error));
            }
            Run::Position => {}
            Run::Trapezoidal(profile) => {
                self.command = profile.advance();
                if profile.is_finished() {
                    self.run = Run::Position;
                }
            }
            Run::IntegralVelocity(ramp) => {
                let target = if self.stop { 0 } else { self.integral_velocity };
                let ramp = ramp.get_or_insert(Ramp::new(actual));
                self.command = ramp.advance(target, self.acceleration.to_bits());
            }
        }
        let error = self.command.wrapping_difference(actual);
        let motor = self.memory.update(self.filter, error);
        Some((motor, self.command, error))
    }
}

fn check_timer(timer: SampleTimer, mode: WheelMode) -> Result<(), WheelError> {
    let minimum = SampleTimer::minimum(mode);
    if timer < minimum {
        Err(WheelError::SampleTimer { minimum })
    } else {
        Ok(())
    }
}
