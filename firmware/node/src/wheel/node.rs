//! The wheel board application.

use core::hash::Hash;

use super::encoder::EncoderWatch;
use super::motion::{Target, tune_profile};
use super::settings::WheelSettings;
use crate::board::{BoardCore, NodeIdentity, receive};
use crate::checksum::Checksum;
use crate::debounce::Debounce;
use crate::hardware::{DumpValve, Encoder, MotorDrive, ParameterStore, SwitchBank};
use crate::mode::{Event, Mode, ModeRules};
use crate::parameters::WheelParameters;
use crate::snapshot::{TickReport, WheelSnapshot};
use crate::transmission::Transmission;
use crate::{ConfigError, SWITCH_TICKS};
use wheeleg_control::wheel::{WheelCommand, WheelController};
use wheeleg_protocol::{BoardKind, Fault, FaultBits, ResetCause, WheelControlMode};
use wheeleg_units::{Micros, Ticks, WheelCount};

/// Samples in Boot: long enough for the switch to be debounced.
const BOOT_TICKS: Ticks = Ticks(10);

/// State that only a tick changes, sealed between two ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct TickState {
    pub(super) actual: WheelCount,
    /// Last drive that was written, per cent.
    pub(super) drive: i8,
    /// Mean drive over the last samples, per cent × 2^8.
    pub(super) drive_mean: i32,
    /// Drive from which the ramp of a stop starts, per cent.
    pub(super) ramp_from: i8,
    pub(super) following: Ticks,
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
    pub(super) target: Target,
    pub(super) state: TickState,
    /// Copies of the count in `state`: once the count is damaged, a counter shorter than it cannot restore it.
    pub(super) counts: [WheelCount; 2],
    /// Checksum of what only requests change.
    fixed_seal: Checksum,
    /// Checksum of what samples change.
    seal: Checksum,
    pub(super) snapshot: WheelSnapshot,
    switches: Debounce<SWITCH_TICKS>,
    pub(super) motor: M,
    pub(super) encoder: E,
    switch_pins: P,
    pub(super) dump_valve: D,
}

impl<M: MotorDrive, E: Encoder, P: SwitchBank, D: DumpValve> WheelNode<M, E, P, D> {
    /// A board in Boot with its drive off, in position control when armed.
    ///
    /// # Errors
    /// [`ConfigError::Address`] if the straps do not name a wheel, [`ConfigError::Parameters`] if the parameters
    /// contradict each other.
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
            target: Target::default(),
            state: TickState::default(),
            counts: [WheelCount::ZERO; 2],
            fixed_seal: Checksum::default(),
            seal: Checksum::default(),
            snapshot: WheelSnapshot::at_boot(),
            switches: Debounce::new(),
            motor,
            encoder,
            switch_pins: supply_switch,
            dump_valve,
        };
        node.tune();
        node.reseal_all();
        Ok(node)
    }

    /// A board with the parameters that its memory kept. If these are damaged (`None`) or contradict each other they
    /// are not used: the board starts with its defaults and a latched fault, so that it can be reached and given better
    /// ones.
    ///
    /// # Errors
    /// [`ConfigError::Address`], as [`Self::new`].
    pub fn from_store(
        identity: NodeIdentity,
        stored: Option<WheelParameters>,
        motor: M,
        encoder: E,
        supply_switch: P,
        dump_valve: D,
    ) -> Result<Self, ConfigError> {
        let mode = WheelControlMode::Position;
        let stored = stored.filter(|stored| WheelSettings::new(stored, mode).is_some());
        let sound = stored.is_some();
        let parameters = stored.unwrap_or_default();
        let mut node = Self::new(
            identity,
            parameters,
            motor,
            encoder,
            supply_switch,
            dump_valve,
        )?;
        if !sound {
            node.axis_fault(Fault::ParameterCorrupt, Micros::ZERO);
        }
        Ok(node)
    }

    /// Present tick: the sample time of the controller, µs. The board's timer adopts it after every tick.
    pub const fn tick_period_us(&self) -> u32 {
        self.settings.times.tick.get()
    }

    /// Takes bytes of the bus, in any chunking; the last of them ended at `t_end`. Never panics, for any bytes.
    pub fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros) {
        receive(self, bytes, t_end);
    }

    /// The next frame to send and when to start. Call it between two ticks until it returns `None`; that call also
    /// processes what a tick has deferred.
    pub fn take_transmission(&mut self) -> Option<Transmission> {
        self.core.take_transmission()
    }

    /// One sample that starts at `now`: latches the inputs, controls, and writes the outputs, which take effect at the
    /// next tick edge.
    pub fn tick(&mut self, now: Micros) -> TickReport {
        let mut actual = self.encoder.count(self.state.actual);
        let switches = self.switch_pins.read();
        let overruns = self.core.supervisor.overrun().overruns();

        self.core.supervisor.begin_tick(now, &self.core.times);
        if !self.is_intact() {
            self.state.actual = self.undamaged_count();
            actual = self.encoder.count(self.state.actual);
            self.axis_fault(Fault::StateCorrupt, now);
            // After a later clear the node must not continue with damaged state.
            self.controller = WheelController::new();
            self.tune();
        }
        // A pin that cannot be read keeps its last debounced level.
        if let Ok(raw) = switches {
            self.switches.sample(raw);
        } else {
            self.switches.missed();
        }
        let counts = actual.wrapping_difference(self.state.actual);
        self.state.actual = actual;
        self.counts = [actual; 2];
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

        if self.is_behind() {
            self.axis_fault(Fault::FollowingError, now);
        }

        if self.core.mode().may_drive() {
            self.drive();
        } else {
            self.rest(now);
        }
        let dump_open = self.core.supervisor.emergency_stop();
        if self.write(dump_open).is_err() {
            self.core
                .supervisor
                .fault(Fault::StateCorrupt, Event::BoardFault, now);
            self.state.drive = 0;
            let _ = self.write(dump_open);
        }
        // The controller's output and the limits are recorded where they are computed.
        let snapshot = &mut self.snapshot;
        snapshot.at = now;
        snapshot.mode = self.core.mode();
        snapshot.count = actual;
        snapshot.drive_percent = self.state.drive;
        snapshot.supply_present = self.switches.state() & 1 != 0;
        snapshot.dump_open = dump_open;
        snapshot.faults = self.core.supervisor.faults().latched();
        self.reseal();
        TickReport {
            mode: self.core.mode(),
            faults: self.faults(),
            overran: self.core.supervisor.overrun().overruns() != overruns,
        }
    }

    /// The tick's work ended at `end`; a tick longer than its period is a latched fault.
    pub fn tick_done(&mut self, end: Micros) {
        self.core.supervisor.end_tick(end, &self.core.times);
    }

    /// States why the processor started; call it before the first tick. After a watchdog, a brown-out or a processor
    /// fault the board has a latched fault.
    pub fn started_by(&mut self, cause: ResetCause) {
        self.core.started_by(cause);
    }

    /// The board's transmitter was cut off by its time limit: a latched fault.
    pub fn driver_cut_off(&mut self, at: Micros) {
        self.core.axis_fault(Fault::SlotOverrun, at);
    }

    /// A frame that was taken was not sent, because its slot had passed.
    pub fn missed_slot(&mut self) {
        self.core.port.missed();
    }

    /// Whether the parameters are to be stored: call [`Self::save`] between two ticks.
    pub fn save_is_due(&self) -> bool {
        self.core.save_is_due()
    }

    /// Stores the parameters in force, which may take a while: the next tick is not measured against this one.
    pub fn save(&mut self, store: &mut impl ParameterStore, at: Micros) {
        let records = self.parameters.changed_from_default();
        self.core.save(records, store, at);
    }

    /// Internals after the last tick.
    pub const fn snapshot(&self) -> &WheelSnapshot {
        &self.snapshot
    }

    /// Present mode.
    pub const fn mode(&self) -> Mode {
        self.core.mode()
    }

    /// Controller mode that the board enters when armed.
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

    /// Passes parameters to the controller.
    pub(super) fn tune(&mut self) {
        let settings = &self.settings;
        let _ = self.controller.apply(WheelCommand::Filter(settings.filter));
        let _ = self
            .controller
            .apply(WheelCommand::SampleTimer(settings.timer));
        // Refused while a profile is running; the next profile takes them before it starts.
        tune_profile(&mut self.controller, settings);
    }

    /// Checksum of what shapes the outputs and is changed only by requests.
    #[inline(never)]
    fn fixed(&self) -> Checksum {
        Checksum::of(&(
            &self.parameters,
            &self.settings,
            &self.core.times,
            self.control_mode,
        ))
    }

    /// What shapes the outputs of the next sample and is changed by every sample.
    #[inline(always)]
    fn moving(&self) -> impl Hash + '_ {
        (&self.state, &self.target, &self.controller)
    }

    /// Whether everything is as the last sample or request left it.
    #[inline(never)]
    pub fn is_intact(&self) -> bool {
        self.seal.holds(&self.moving()) && self.fixed_seal == self.fixed()
    }

    /// The count of the previous sample, even if one of its three copies is damaged: a majority vote bit by bit.
    #[cold]
    fn undamaged_count(&self) -> WheelCount {
        let [a, b] = self.counts.map(WheelCount::get);
        let c = self.state.actual.get();
        WheelCount::wrapping_new(a & b | b & c | c & a)
    }

    #[inline]
    fn reseal(&mut self) {
        let seal = Checksum::of(&self.moving());
        self.seal = seal;
    }

    #[inline(never)]
    fn reseal_all(&mut self) {
        self.fixed_seal = self.fixed();
        self.reseal();
    }

    /// A change of sealed state between two samples. State that was already damaged keeps its broken seal, so that the
    /// next sample still sees the damage.
    pub(super) fn change<R>(&mut self, change: impl FnOnce(&mut Self) -> R) -> R {
        let intact = self.is_intact();
        let result = change(self);
        if intact {
            self.reseal_all();
        }
        result
    }

    /// A new target between two samples. Only what every sample changes is checked and sealed again.
    pub(super) fn aim(&mut self, target: Target) {
        let intact = self.seal.holds(&self.moving());
        self.target = target;
        if intact {
            self.reseal();
        }
    }

    pub(super) fn axis_fault(&mut self, fault: Fault, now: Micros) {
        self.core.axis_fault(fault, now);
    }
}
