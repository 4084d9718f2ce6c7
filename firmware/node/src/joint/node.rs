//! The joint board application.

use core::hash::Hash;

use super::no_motion_detector::{MotionAccount, MotionWatch};
use super::precharge::Precharge;
use super::reference::Target;
use super::settings::{JointSettings, TickSettings};
use crate::board::{BoardCore, NodeIdentity, receive};
use crate::checksum::Checksum;
use crate::debounce::Debounce;
use crate::hardware::{ParameterStore, PositionSensor, SwitchBank, ValveBank};
use crate::mode::{Event, Mode, ModeRules};
use crate::parameters::JointParameters;
use crate::sensor::{Reading, Rejection, SensorMonitor};
use crate::snapshot::{JointSnapshot, TickReport};
use crate::transmission::Transmission;
use crate::{ConfigError, JOINT_TICK, SELF_TEST_TICKS, SWITCH_TICKS};
use wheeleg_control::joint::JointController;
use wheeleg_control::law::reference_generator::Reference;
use wheeleg_control::pwm::ValvePwm;
use wheeleg_protocol::{BoardKind, Fault, FaultBits, InputBits, ResetCause};
use wheeleg_units::{Micros, PositionMm, Ticks};

/// State that only a tick changes, sealed between two ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct TickState {
    /// What the law follows.
    pub(super) reference: Reference,
    /// The command within the slew limit, with which supervision compares the piston: a reference that waits for a
    /// stuck piston would hide that it is stuck.
    pub(super) supervised: PositionMm,
    pub(super) measured: PositionMm,
    pub(super) following: Ticks,
    pub(super) motion: MotionWatch,
    pub(super) precharge: Precharge,
    boot_ticks: Ticks,
}

impl TickState {
    /// Sets the references of an axis that stands at `position`.
    pub(super) const fn start_from(&mut self, position: PositionMm) {
        self.reference = Reference::at(position);
        self.supervised = position;
    }
}

/// Application of one joint board: sense, control, valves.
///
/// `V` are the four valve outputs, `S` the position sensor, `W` the switches
/// (four on the vertical joints' boards, [`crate::hardware::NoSwitches`] on
/// the others).
#[derive(Clone, Debug)]
pub struct JointNode<V, S, W> {
    pub(super) core: BoardCore,
    pub(super) parameters: JointParameters,
    pub(super) settings: TickSettings,
    pub(super) controller: JointController,
    pub(super) pwm: ValvePwm,
    pub(super) monitor: SensorMonitor,
    pub(super) target: Target,
    pub(super) state: TickState,
    /// Checksum of what only requests change.
    fixed_seal: Checksum,
    /// Whether the last tick left its check to the next one.
    fixed_waits: bool,
    /// Checksum of what ticks change.
    seal: Checksum,
    target_seal: Checksum,
    pub(super) snapshot: JointSnapshot,
    pub(super) switches: Debounce<SWITCH_TICKS>,
    pub(super) valves: V,
    sensor: S,
    switch_pins: W,
}

impl<V: ValveBank, S: PositionSensor, W: SwitchBank> JointNode<V, S, W> {
    /// Control tick: 1 ms.
    pub const TICK: Micros = JOINT_TICK;

    /// A board in Boot with all valves shut.
    ///
    /// # Errors
    /// [`ConfigError::Address`] if the straps do not name a joint, [`ConfigError::Parameters`] if the parameters
    /// contradict each other.
    pub fn new(
        identity: NodeIdentity,
        parameters: JointParameters,
        valves: V,
        sensor: S,
        switches: W,
    ) -> Result<Self, ConfigError> {
        if !identity.address.is_joint() {
            return Err(ConfigError::Address);
        }
        let Some(settings) = &JointSettings::new(&parameters) else {
            return Err(ConfigError::Parameters);
        };
        Ok(Self::with(
            identity, parameters, settings, valves, sensor, switches,
        ))
    }

    /// With settings that follow from the parameters. Constructed in place: each move on the way would cost kilobytes
    /// of stack.
    #[inline(always)]
    fn with(
        identity: NodeIdentity,
        parameters: JointParameters,
        settings: &JointSettings,
        valves: V,
        sensor: S,
        switches: W,
    ) -> Self {
        let mut controller = JointController::new(settings.control);
        controller.set_correction(settings.tick.correction);
        let mut node = Self {
            core: BoardCore::new(BoardKind::Joint, identity, settings.times),
            controller,
            pwm: ValvePwm::new(settings.timing),
            monitor: SensorMonitor::new(),
            target: Target::default(),
            state: TickState {
                reference: Reference::default(),
                supervised: PositionMm::ZERO,
                measured: PositionMm::ZERO,
                following: Ticks::ZERO,
                motion: MotionWatch::new(&settings.tick.motion, PositionMm::ZERO),
                precharge: Precharge::default(),
                boot_ticks: Ticks::ZERO,
            },
            fixed_seal: Checksum::default(),
            fixed_waits: false,
            seal: Checksum::default(),
            target_seal: Checksum::default(),
            snapshot: JointSnapshot::at_boot(),
            switches: Debounce::new(),
            parameters,
            settings: settings.tick,
            valves,
            sensor,
            switch_pins: switches,
        };
        node.reseal_all();
        node
    }

    /// A board with the parameters that its memory kept. If these are damaged (`None`) or contradict each other they
    /// are not used: the board starts with its defaults and a latched fault, so that it can be reached and given better
    /// ones.
    ///
    /// # Errors
    /// [`ConfigError::Address`], as [`Self::new`].
    #[inline(always)]
    pub fn from_store(
        identity: NodeIdentity,
        stored: Option<JointParameters>,
        valves: V,
        sensor: S,
        switches: W,
    ) -> Result<Self, ConfigError> {
        if !identity.address.is_joint() {
            return Err(ConfigError::Address);
        }
        // Checked, and computed again below: this takes one copy less on the stack than keeping them.
        let stored = stored.filter(|stored| JointSettings::new(stored).is_some());
        let sound = stored.is_some();
        let parameters = stored.unwrap_or_default();
        let Some(settings) = &JointSettings::new(&parameters) else {
            return Err(ConfigError::Parameters);
        };
        let mut node = Self::with(identity, parameters, settings, valves, sensor, switches);
        if !sound {
            node.axis_fault(Fault::ParameterCorrupt, Micros::ZERO);
        }
        Ok(node)
    }

    /// The same board on other hardware of the same kind, used by a simulator to copy a board.
    #[must_use]
    pub fn on_hardware(self, valves: V, sensor: S, switches: W) -> Self {
        Self {
            valves,
            sensor,
            switch_pins: switches,
            ..self
        }
    }

    /// Takes bytes of the bus, in any chunking; the last of them ended at `t_end`. Never panics, for any bytes. Not
    /// inlined: the main loop would then save registers for every tick.
    #[inline(never)]
    pub fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros) {
        receive(self, bytes, t_end);
    }

    /// The next frame to send and when to start. Call it between two ticks until it returns `None`; that call also
    /// processes what a tick has deferred.
    pub fn take_transmission(&mut self) -> Option<Transmission> {
        self.core.take_transmission()
    }

    /// One control tick that starts at `now`: latches the inputs, controls, and writes all four outputs, which take
    /// effect at the next tick edge.
    #[inline(never)]
    pub fn tick(&mut self, now: Micros) -> TickReport {
        let reading = self.sensor.read();
        let switches = self.switch_pins.read();
        let overruns = self.core.supervisor.overrun().overruns();

        self.core.supervisor.begin_tick(now, &self.core.times);
        if !self.is_intact_now() {
            self.axis_fault(Fault::StateCorrupt, now);
            self.controller.reset();
            self.controller.set_correction(self.settings.correction);
            // It is unknown which stroke was damaged: with the next good reading everything that keeps a history of
            // strokes restarts.
            self.monitor.restart();
        }
        // A pin that cannot be read keeps its last debounced level.
        if let Ok(raw) = switches {
            self.switches.sample(raw);
        } else {
            self.switches.missed();
        }
        let reading = self.monitor.sample(reading, &self.settings.sensor);
        self.state.measured = reading.position;
        if reading.is_first {
            self.restart_estimators();
        }
        self.supervise_sensor(&reading, now);
        if let Some(fault) = self.found() {
            self.axis_fault(fault, now);
        }

        self.controller
            .set_foot_stands(self.switches.state() & InputBits::FOOT.raw() != 0);
        let on_times = if !self.core.mode().may_drive() {
            self.rest(now)
        } else if self.state.precharge.is_under_way() {
            self.fill(now)
        } else {
            self.drive(now)
        };
        if self.write(on_times).is_err() {
            self.give_up(now);
        }
        self.reseal();
        TickReport {
            mode: self.core.mode(),
            faults: self.core.supervisor.faults().latched(),
            overran: self.core.supervisor.overrun().overruns() != overruns,
        }
    }

    /// Restarts everything that keeps a history of strokes, at the measured one: the piston may have moved unseen, and
    /// how it got here is not a motion.
    #[cold]
    #[inline(never)]
    fn restart_estimators(&mut self) {
        self.controller.reset();
        self.state.motion = MotionWatch::new(&self.settings.motion, self.state.measured);
    }

    /// An output does not respond: releases all coils.
    #[cold]
    #[inline(never)]
    fn give_up(&mut self, now: Micros) {
        self.core
            .supervisor
            .fault(Fault::StateCorrupt, Event::BoardFault, now);
        let _ = self.write([0; 4]);
        self.snapshot.mode = self.core.mode();
        self.snapshot.faults = self.faults();
        self.snapshot.pulses = [0; 4];
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
    pub const fn snapshot(&self) -> &JointSnapshot {
        &self.snapshot
    }

    /// Doubt whether the piston follows its valves, as the time that the strongest doubt takes to reach it; zero
    /// without doubt.
    pub const fn motion_overdue(&self) -> Micros {
        self.state.motion.overdue()
    }

    /// The motion watch's view of the axis. The firmware sends none of it: it is for tests and tools around the node.
    pub fn motion_account(&self) -> MotionAccount {
        let TickState {
            supervised,
            measured,
            motion,
            ..
        } = &self.state;
        motion.account(*supervised, *measured, &self.settings.motion)
    }

    /// Present mode.
    pub const fn mode(&self) -> Mode {
        self.core.mode()
    }

    /// Latched faults.
    pub const fn faults(&self) -> FaultBits {
        self.core.supervisor.faults().latched()
    }

    /// Parameters in force.
    pub const fn parameters(&self) -> &JointParameters {
        &self.parameters
    }

    /// Pulses begun per valve since reset, wrapping.
    pub fn pulse_counts(&self) -> [u32; 4] {
        self.pwm.pulses()
    }

    /// Checksum of what shapes the outputs and is changed only by requests.
    #[inline(never)]
    fn fixed(&self) -> Checksum {
        Checksum::made(|sum| {
            self.parameters.hash(sum);
            self.controller.config().hash(sum);
            self.core.times.hash(sum);
            self.pwm.timing().hash(sum);
            self.settings.hash(sum);
        })
    }

    /// Checksum of the target, which a bus cycle changes without the rest.
    fn aimed(&self) -> Checksum {
        Checksum::made(|sum| self.target.hash(sum))
    }

    /// Checksum of what shapes the outputs of the next tick and is changed by every tick. The debounced switches are not
    /// in it: a flipped bit of theirs is mended by the next three samples.
    #[inline(never)]
    fn moving(&self) -> Checksum {
        Checksum::made(|sum| {
            self.state.hash(sum);
            self.monitor.hash(sum);
            self.controller.state().hash(sum);
            self.pwm.state().hash(sum);
        })
    }

    /// Whether everything is as the last tick or request left it.
    #[inline(never)]
    fn is_intact(&self) -> bool {
        self.is_moving_intact() && self.fixed_seal == self.fixed()
    }

    /// The same at the beginning of a tick. If the law has its work in this tick, the check of what only requests
    /// change waits for the next one, but never for more than one tick.
    fn is_intact_now(&mut self) -> bool {
        self.fixed_waits = self.controller.plans() && !self.fixed_waits;
        self.is_moving_intact() && (self.fixed_waits || self.fixed_seal == self.fixed())
    }

    fn is_moving_intact(&self) -> bool {
        self.target_seal == self.aimed() && self.seal == self.moving()
    }

    #[inline]
    pub(super) fn reseal(&mut self) {
        self.target_seal = self.aimed();
        self.seal = self.moving();
    }

    #[inline(never)]
    fn reseal_all(&mut self) {
        self.fixed_seal = self.fixed();
        self.reseal();
    }

    /// A change of sealed state between two ticks. State that was already damaged keeps its broken seal, so that the
    /// next tick still sees the damage.
    pub(super) fn change<R>(&mut self, change: impl FnOnce(&mut Self) -> R) -> R {
        let intact = self.is_intact();
        let result = change(self);
        if intact {
            self.reseal_all();
        }
        result
    }

    /// A new target between two ticks. It has a seal of its own, because a set-point comes in every bus cycle, shortly
    /// before the reply of the first board is due. A damaged target keeps its broken seal.
    pub(super) fn aim(&mut self, target: Target) {
        let intact = self.target_seal == self.aimed();
        self.target = target;
        if intact {
            self.target_seal = self.aimed();
        }
    }

    pub(super) fn axis_fault(&mut self, fault: Fault, now: Micros) {
        self.core.axis_fault(fault, now);
    }

    /// Self-test in Boot, sensor faults in every other mode.
    fn supervise_sensor(&mut self, reading: &Reading, now: Micros) {
        let fault = match reading.fault {
            Some(Rejection::Missing | Rejection::Range) => Some(Fault::SensorRange),
            Some(Rejection::Rate) => Some(Fault::SensorRate),
            Some(Rejection::Travel) => Some(Fault::OverTravel),
            None => None,
        };
        if self.core.mode() != Mode::Boot {
            if let Some(fault) = fault {
                self.axis_fault(fault, now);
            }
            return;
        }
        self.state.boot_ticks = self.state.boot_ticks.next();
        if self.monitor.is_settled() {
            let _ = self.core.supervisor.apply(Event::SelfTestPassed, now);
        } else if self.state.boot_ticks >= SELF_TEST_TICKS {
            let fault = fault.unwrap_or(Fault::SensorRange);
            self.core
                .supervisor
                .fault(fault, Event::SelfTestFailed, now);
        }
    }
}
