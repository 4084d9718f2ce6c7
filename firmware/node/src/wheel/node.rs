//! The wheel board application.

use super::encoder::EncoderWatch;
use super::motion::{Target, command, engage};
use super::settings::WheelSettings;
use crate::board::{BoardCore, NodeIdentity, receive};
use crate::debounce::Debounce;
use crate::hardware::{DumpValve, Encoder, MotorDrive, PinError, SwitchBank};
use crate::mode::{Event, Mode, ModeRules};
use crate::parameters::WheelParameters;
use crate::seal::Seal;
use crate::snapshot::{TickReport, WheelSnapshot};
use crate::transmission::Transmission;
use crate::{ConfigError, SWITCH_TICKS};
use wheeleg_control::wheel::{
    WheelCommand, WheelController, WheelInput, WheelMode, WheelOutput, WheelStatus,
};
use wheeleg_protocol::{
    BoardKind, DisarmReason, Fault, FaultBits, Limit, LimitBits, WheelControlMode,
};
use wheeleg_units::{Micros, Ticks, WheelCount};

/// Samples in Boot: long enough for the switch to be debounced.
const BOOT_TICKS: Ticks = Ticks(10);

/// State that only a tick changes, sealed between two ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct TickState {
    pub(super) actual: WheelCount,
    /// Drive written last, per cent.
    pub(super) drive: i8,
    /// Drive from which the ramp of a stop starts.
    ramp_from: i8,
    following: Ticks,
    boot_ticks: Ticks,
    encoder: EncoderWatch,
}

/// Application of one wheel board: encoder, HCTL-1100 control, H-bridge.
///
/// `M` is the motor driver, `E` the encoder, `P` the supply-pressure switch and
/// `D` the supply dump valve; only the first wheel board has the last two, the
/// other takes [`crate::hardware::NoSwitches`] and
/// [`crate::hardware::NoDumpValve`].
#[derive(Debug)]
pub struct WheelNode<M, E, P, D> {
    pub(super) core: BoardCore,
    pub(super) parameters: WheelParameters,
    pub(super) settings: WheelSettings,
    pub(super) control_mode: WheelControlMode,
    pub(super) controller: WheelController,
    /// The controller as the last tick or request left it.
    shadow: WheelController,
    pub(super) target: Target,
    pub(super) state: TickState,
    seal: Seal,
    pub(super) snapshot: WheelSnapshot,
    switches: Debounce,
    motor: M,
    encoder: E,
    switch_pins: P,
    dump_valve: D,
}

impl<M: MotorDrive, E: Encoder, P: SwitchBank, D: DumpValve> WheelNode<M, E, P, D> {
    /// A board in Boot with its drive off, in position control when armed.
    ///
    /// # Errors
    /// [`ConfigError::Address`] when the straps do not name a wheel,
    /// [`ConfigError::Parameters`] when the parameters contradict each other.
    pub fn new(
        identity: NodeIdentity,
        parameters: WheelParameters,
        motor: M,
        encoder: E,
        supply_switch: P,
        dump_valve: D,
    ) -> Result<Self, ConfigError> {
        if !identity.address.is_wheel() {
            return Err(ConfigError::Address);
        }
        let control_mode = WheelControlMode::Position;
        let settings =
            WheelSettings::new(&parameters, control_mode).ok_or(ConfigError::Parameters)?;
        let mut node = Self {
            core: BoardCore::new(BoardKind::Wheel, identity, settings.times),
            parameters,
            settings,
            control_mode,
            controller: WheelController::new(),
            shadow: WheelController::new(),
            target: Target::default(),
            state: TickState::default(),
            seal: Seal::default(),
            snapshot: WheelSnapshot::at_boot(),
            switches: Debounce::new(SWITCH_TICKS),
            motor,
            encoder,
            switch_pins: supply_switch,
            dump_valve,
        };
        node.tune();
        Ok(node)
    }

    /// Present tick: the sample time of the controller, µs. The board's timer
    /// takes it over after every tick.
    pub const fn tick_period_us(&self) -> u32 {
        self.settings.times.tick.get()
    }

    /// Takes bytes of the bus, in any chunking; the last of them ended at
    /// `t_end`. Never panics, for any bytes.
    pub fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros) {
        receive(self, bytes, t_end);
    }

    /// The next frame to send and when to start; call until `None`.
    pub fn take_transmission(&mut self) -> Option<Transmission> {
        self.core.port.take()
    }

    /// One sample that starts at `now`: latches the inputs, controls, writes
    /// the outputs. They act from the next tick edge on.
    pub fn tick(&mut self, now: Micros) -> TickReport {
        let actual = self.encoder.count();
        let switches = self.switch_pins.read();
        let overruns = self.core.supervisor.overrun().overruns();

        self.core.supervisor.begin_tick(now, &self.core.times);
        if !self.seal.holds(&(&self.parameters, &self.state)) || self.shadow != self.controller {
            self.axis_fault(Fault::StateCorrupt, now);
        }
        // A pin that cannot be read keeps its last debounced level.
        if let Ok(raw) = switches {
            self.switches.sample(raw);
        }
        let counts = actual.wrapping_difference(self.state.actual);
        self.state.actual = actual;
        if self.core.mode() == Mode::Boot {
            self.state.boot_ticks = self.state.boot_ticks.next();
            if self.state.boot_ticks >= BOOT_TICKS {
                let _ = self.core.supervisor.apply(Event::SelfTestPassed, now);
            }
        } else {
            self.state.boot_ticks = Ticks::ZERO;
            let drive = self.state.drive;
            let lost = self
                .state
                .encoder
                .sample(drive, counts, self.core.times.tick);
            if lost && self.core.mode().may_drive() {
                self.axis_fault(Fault::EncoderFault, now);
            }
        }

        let mut limits = LimitBits::NONE;
        let output = if self.core.mode().may_drive() {
            self.drive(&mut limits, now)
        } else {
            self.rest(now)
        };
        let dump_open = self.core.supervisor.emergency_stop();
        if self.write(dump_open).is_err() {
            self.core
                .supervisor
                .fault(Fault::StateCorrupt, Event::BoardFault, now);
            self.state.drive = 0;
            let _ = self.write(dump_open);
        }
        self.snapshot = WheelSnapshot {
            at: now,
            mode: self.core.mode(),
            count: actual,
            control: output,
            drive_percent: self.state.drive,
            supply_present: self.switches.state() & 1 != 0,
            dump_open,
            faults: self.faults(),
            limits,
        };
        self.reseal();
        TickReport {
            mode: self.core.mode(),
            faults: self.faults(),
            overran: self.core.supervisor.overrun().overruns() != overruns,
        }
    }

    /// The tick's work ended at `end`; a tick longer than its period is a
    /// latched fault.
    pub fn tick_done(&mut self, end: Micros) {
        self.core.supervisor.end_tick(end, &self.core.times);
    }

    /// Internals after the last tick.
    pub const fn snapshot(&self) -> &WheelSnapshot {
        &self.snapshot
    }

    /// Present mode.
    pub const fn mode(&self) -> Mode {
        self.core.mode()
    }

    /// Controller mode that the board takes when armed.
    pub const fn control_mode(&self) -> WheelControlMode {
        self.control_mode
    }

    /// Latched faults.
    pub const fn faults(&self) -> FaultBits {
        self.core.supervisor.faults().latched()
    }

    /// Parameters in force.
    pub const fn parameters(&self) -> &WheelParameters {
        &self.parameters
    }

    /// Hands parameters to the controller; then seals.
    pub(super) fn tune(&mut self) {
        let settings = &self.settings;
        // Speed and acceleration are refused while a profile runs; `drive`
        // hands them over again before the next one starts.
        let _ = self.controller.apply(WheelCommand::Filter(settings.filter));
        let _ = self
            .controller
            .apply(WheelCommand::SampleTimer(settings.timer));
        self.tune_profile();
        self.reseal();
    }

    fn tune_profile(&mut self) {
        let speed = WheelCommand::MaximumVelocity(self.settings.max_speed);
        let acceleration = WheelCommand::Acceleration(self.settings.acceleration);
        let _ = self.controller.apply(speed);
        let _ = self.controller.apply(acceleration);
    }

    pub(super) fn reseal(&mut self) {
        self.shadow = self.controller.clone();
        self.seal = Seal::of(&(&self.parameters, &self.state));
    }

    fn axis_fault(&mut self, fault: Fault, now: Micros) {
        self.core.supervisor.fault(fault, Event::AxisFault, now);
    }

    /// Closed loop.
    fn drive(&mut self, limits: &mut LimitBits, now: Micros) -> WheelOutput {
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
    fn rest(&mut self, now: Micros) -> WheelOutput {
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

    fn write(&mut self, dump_open: bool) -> Result<(), PinError> {
        let motor = self.motor.write(self.state.drive);
        let dump = self.dump_valve.set_open(dump_open);
        motor.and(dump)
    }

    /// The wheel has armed: closed loop at standstill where it is.
    pub(super) fn engage(&mut self) {
        self.target = Target::at(self.state.actual);
        engage(&mut self.controller, self.control_mode, self.state.actual);
        self.reseal();
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
