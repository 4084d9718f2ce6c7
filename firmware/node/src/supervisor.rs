//! What joint and wheel boards have in common: mode, faults, link supervision, overrun detection and the staging of a
//! stop.
//!
//! # Staged stop
//!
//! Link loss and E-stop of an armed axis put it in Hold at once. After the hold time the axis proceeds to Exhaust, if
//! the link-loss action of the newest SYNC slot allows it (the gait phase: a swing leg may go limp, a stance leg may
//! not). While the master is alive no axis proceeds: the slots of a robot that it holds say Hold, and a SYNC with the
//! E-stop bit takes an axis back to it. After an emergency brake, or a sensor or state fault, the axis stays in Hold.

use crate::clock::Clock;
use crate::faults::FaultLog;
use crate::log::Log;
use crate::mode::{Event, Mode, ModeRules, Refusal};
use crate::overrun::{OverrunDetector, elapsed};
use wheeleg_protocol::link::{LinkState, LinkSupervisor, WatchdogCycles};
use wheeleg_protocol::{DisarmReason, Fault, LogEntry, LogEvent, LogRecords, NackReason};
use wheeleg_units::Micros;

/// Times of the supervision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SupervisionTimes {
    /// Control tick.
    pub tick: Micros,
    /// Number of missed SYNC cycles that counts as link loss.
    pub watchdog: WatchdogCycles,
    /// Time in Hold before a staged exhaust.
    pub hold: Micros,
    /// Longest blow-through.
    pub blow_through: Micros,
}

/// The watchdog of a parameter; the default if the number is invalid.
pub(crate) fn watchdog(cycles: i32) -> WatchdogCycles {
    u8::try_from(cycles)
        .ok()
        .and_then(WatchdogCycles::new)
        .unwrap_or_default()
}

/// Purpose of a mode with open outlets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum ExhaustKind {
    /// End of a staged stop: outlets are pulsed, so that a loaded leg sinks slowly.
    #[default]
    Staged,
    /// Commanded: outlets fully open.
    Commanded,
    /// Maintenance: inlets and outlets open, for a bounded time.
    BlowThrough,
}

/// Mode, faults and supervision of one board.
#[derive(Clone, Debug)]
pub struct Supervisor {
    mode: Mode,
    /// Complement of the state that steers the outputs, to detect a flipped bit.
    check: u32,
    entered_at: Micros,
    staged: bool,
    /// Whether the present Hold began while the outputs were driven.
    from_drive: bool,
    exhaust: ExhaustKind,
    exhaust_allowed: bool,
    emergency: bool,
    disarm_reason: DisarmReason,
    faults: FaultLog,
    link: LinkSupervisor,
    clock: Clock,
    overrun: OverrunDetector,
    log: Log,
}

/// The reason given when a request is refused.
impl From<Refusal> for NackReason {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::NotDisarmed => Self::Armed,
            Refusal::Latched | Refusal::CausePresent => Self::FaultLatched,
            Refusal::NotReady => Self::NotReady,
            Refusal::NotApplicable => Self::WrongMode,
            Refusal::NoLink => Self::LinkDown,
        }
    }
}

/// Why a board that was driving no longer does.
const fn disarm_reason(event: Event) -> DisarmReason {
    match event {
        Event::LinkLost => DisarmReason::LinkLost,
        Event::EmergencyStop => DisarmReason::EmergencyStop,
        Event::EmergencyBrake => DisarmReason::EmergencyBrake,
        Event::OpenAllValves => DisarmReason::OpenAllValves,
        Event::Disarm => DisarmReason::Command,
        _ => DisarmReason::Fault,
    }
}

impl Default for Supervisor {
    fn default() -> Self {
        Self::new()
    }
}

impl Supervisor {
    /// In Boot, no link, no fault.
    pub fn new() -> Self {
        let mut fresh = Self {
            mode: Mode::Boot,
            check: 0,
            entered_at: Micros::ZERO,
            staged: false,
            from_drive: false,
            exhaust: ExhaustKind::Staged,
            exhaust_allowed: false,
            emergency: false,
            disarm_reason: DisarmReason::Reset,
            faults: FaultLog::new(),
            link: LinkSupervisor::default(),
            clock: Clock::default(),
            overrun: OverrunDetector::new(),
            log: Log::default(),
        };
        fresh.check = !fresh.steering();
        fresh
    }

    /// The state that decides, together with the mode, which outputs are driven and when: all in one word.
    #[inline(always)]
    fn steering(&self) -> u32 {
        let flag = |flag: bool, place: u32| u32::from(flag).wrapping_shl(place);
        // Each in a byte of its own, in full.
        u32::from(self.mode as u8)
            ^ u32::from(self.exhaust as u8).wrapping_shl(8)
            ^ flag(self.staged, 16)
            ^ flag(self.from_drive, 20)
            ^ flag(self.exhaust_allowed, 24)
            ^ u32::from(self.emergency).rotate_left(28)
    }

    #[inline(always)]
    fn is_intact(&self) -> bool {
        self.check == !self.steering()
    }

    /// Changes state that the check covers. State that was already damaged keeps its broken check, so that the next
    /// tick still sees the damage.
    #[inline]
    fn change(&mut self, change: impl FnOnce(&mut Self)) {
        let intact = self.is_intact();
        change(self);
        if intact {
            self.check = !self.steering();
        }
    }

    /// Notes what happened, for the reader of the log.
    #[inline(never)]
    pub(crate) fn note(&mut self, event: LogEvent, a: u8, b: u16, at: Micros) {
        let entry = LogEntry {
            time_us: at.get(),
            event,
            a,
            b,
        };
        if let Err(entry) = self.log.note(entry) {
            self.note_more(entry);
        }
    }

    /// Without room for a note, the others are processed at once.
    #[cold]
    #[inline(never)]
    fn note_more(&mut self, entry: LogEntry) {
        self.settle_log();
        let _ = self.log.note(entry);
    }

    /// Processes notes, if there are any; called between two ticks.
    #[inline]
    pub(crate) fn settle_log(&mut self) {
        if self.log.has_notes() {
            self.work_off_notes();
        }
    }

    #[cold]
    #[inline(never)]
    fn work_off_notes(&mut self) {
        let clock = self.clock;
        self.log.settle(|at| {
            // A copy, because looking back must not set the clock.
            let mut clock = clock;
            clock.unwrap(at)
        });
    }

    /// The oldest records of the log, which continues for `lease_ms`.
    pub(crate) fn read_log(&mut self, lease_ms: u16, at: Micros) -> LogRecords {
        self.settle_log();
        let now_us = self.time_us(at);
        self.log.read(lease_ms, now_us)
    }

    /// Present mode.
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// Why the outlets are open; meaningful in Exhaust.
    pub const fn exhaust(&self) -> ExhaustKind {
        self.exhaust
    }

    /// Why the board is not driving, or last stopped driving.
    pub const fn disarm_reason(&self) -> DisarmReason {
        self.disarm_reason
    }

    /// Whether the present Hold began while the outputs were driven; otherwise
    /// there is nothing to ramp down.
    pub const fn held_from_drive(&self) -> bool {
        self.from_drive
    }

    /// Time since the present mode was entered (modulo 2^32 µs).
    pub const fn time_in_mode(&self, now: Micros) -> Micros {
        elapsed(self.entered_at, now)
    }

    /// Fault memory.
    pub const fn faults(&self) -> &FaultLog {
        &self.faults
    }

    /// Tick measurement.
    pub const fn overrun(&self) -> &OverrunDetector {
        &self.overrun
    }

    /// Whether SYNC frames with an advancing counter arrive and no link loss is latched.
    pub fn link_alive(&self) -> bool {
        self.link.state() == LinkState::Up
    }

    /// The unwrapped time of `now`, µs since reset. A single copy for all callers but the tick.
    #[inline(never)]
    pub fn time_us(&mut self, now: Micros) -> u64 {
        self.clock.unwrap(now)
    }

    /// Whether the E-stop bit was set in the newest fresh SYNC of a living link, or an E-stop is latched.
    pub fn emergency_stop(&self) -> bool {
        self.emergency || self.faults.latched().contains(Fault::EmergencyStop)
    }

    /// Sends an event through the mode table: the only place that changes the mode.
    pub fn apply(&mut self, event: Event, at: Micros) -> Result<Mode, Refusal> {
        let before = self.mode;
        let next = before.after(event)?;
        if next != before || matches!(event, Event::OpenAllValves | Event::BlowThrough) {
            self.enter(event, next, at);
        }
        // Inlets never stay open when something goes wrong.
        if matches!(event, Event::LinkLost | Event::AxisFault)
            && self.exhaust == ExhaustKind::BlowThrough
        {
            self.change(|own| own.exhaust = ExhaustKind::Commanded);
        }
        // An axis with a fault stays in Hold: whichever is found first, a lost link or an E-stop does not let it
        // exhaust later.
        if event == Event::AxisFault && self.staged {
            self.change(|own| own.staged = false);
        }
        Ok(next)
    }

    #[inline(never)]
    fn enter(&mut self, event: Event, next: Mode, at: Micros) {
        let before = self.mode;
        self.change(|own| {
            match event {
                Event::OpenAllValves => own.exhaust = ExhaustKind::Commanded,
                Event::StageExhaust => own.exhaust = ExhaustKind::Staged,
                Event::BlowThrough => own.exhaust = ExhaustKind::BlowThrough,
                _ => {}
            }
            if next == before {
                return;
            }
            own.entered_at = at;
            if before.may_drive() && !next.may_drive() {
                own.disarm_reason = disarm_reason(event);
            }
            if next == Mode::Hold {
                own.from_drive = before.may_drive();
                own.staged =
                    own.from_drive && matches!(event, Event::LinkLost | Event::EmergencyStop);
            }
            own.mode = next;
        });
        if next != before {
            self.note(LogEvent::Mode, before as u8, u16::from(next as u8), at);
        }
    }

    /// Latches a fault and applies the corresponding event.
    pub fn fault(&mut self, fault: Fault, event: Event, at: Micros) {
        if self.faults.latch(fault, at) {
            let mode = u16::from(self.mode as u8);
            self.note(LogEvent::Fault, fault.code(), mode, at);
        }
        // Every fault event has a next mode in every mode, as the test of the table checks, so no refusal is lost here.
        let _ = self.apply(event, at);
    }

    /// Whether the newest fresh SYNC had this counter, as far as that is certain.
    pub fn agrees(&self, newest: u16) -> bool {
        self.link.agrees(newest)
    }

    /// Takes the header of a SYNC latched at `at`. Returns true if it is fresh, so that its slot may be used.
    pub fn sync(&mut self, counter: u16, emergency: bool, at: Micros) -> bool {
        if emergency {
            // Even with a frozen counter: a stop needs no proof of freshness.
            self.set_emergency(true);
            self.fault(Fault::EmergencyStop, Event::EmergencyStop, at);
        }
        let at_us = self.time_us(at);
        let fresh = self.link.on_sync(counter, at_us);
        if fresh && emergency != self.emergency {
            self.set_emergency(emergency);
        }
        fresh
    }

    #[inline(never)]
    fn set_emergency(&mut self, emergency: bool) {
        self.change(|own| own.emergency = emergency);
    }

    /// Takes the link-loss action of a fresh SYNC slot: whether the gait phase
    /// allows the exhaust.
    pub fn allow_exhaust(&mut self, allowed: bool) {
        if allowed != self.exhaust_allowed {
            self.change(|own| own.exhaust_allowed = allowed);
        }
    }

    /// Supervision at the start of a tick: deadlines, link, own state, staging.
    #[inline]
    pub fn begin_tick(&mut self, now: Micros, times: &SupervisionTimes) {
        if self.overrun.begin(now, times.tick) {
            self.fault(Fault::TickOverrun, Event::BoardFault, now);
        }
        if !(self.is_intact() && self.clock.is_intact()) {
            self.repair(now);
        }
        self.link.set_watchdog(times.watchdog);
        let now_us = self.clock.unwrap(now);
        if let Some(loss) = self.link.poll(now_us) {
            self.fault(loss.fault(), Event::LinkLost, now);
        }
        let in_mode = elapsed(self.entered_at, now);
        if self.mode == Mode::Hold && self.staged && self.exhaust_allowed && in_mode >= times.hold {
            let _ = self.apply(Event::StageExhaust, now);
        }
        if self.mode == Mode::Exhaust
            && self.exhaust == ExhaustKind::BlowThrough
            && in_mode >= times.blow_through
        {
            let _ = self.apply(Event::BlowThroughOver, now);
        }
    }

    /// A bit has flipped: go to Hold, and keep nothing that may have been damaged.
    #[cold]
    #[inline(never)]
    fn repair(&mut self, now: Micros) {
        self.mode = Mode::Hold;
        self.exhaust = ExhaustKind::Staged;
        self.staged = false;
        self.from_drive = false;
        self.exhaust_allowed = false;
        // An E-stop bit that has flipped off comes again with the next SYNC; meanwhile the latched fault keeps the dump
        // valve open.
        self.emergency = false;
        self.check = !self.steering();
        self.clock.mend();
        self.fault(Fault::StateCorrupt, Event::AxisFault, now);
    }

    /// The tick ended at `end`.
    #[inline]
    pub fn end_tick(&mut self, end: Micros, times: &SupervisionTimes) {
        if self.overrun.end(end, times.tick) {
            self.fault(Fault::TickOverrun, Event::BoardFault, end);
        }
    }

    /// The tick period changes: the next tick starts a new measurement.
    pub fn restart_timing(&mut self) {
        self.overrun.restart();
    }

    /// Clears latched faults and leaves the latched stop, unless a cause persists.
    pub fn clear(&mut self, healthy: bool, at: Micros) -> Result<Mode, Refusal> {
        if !healthy || self.emergency {
            return Err(Refusal::CausePresent);
        }
        let now_us = self.time_us(at);
        self.link.clear(now_us).map_err(|_| Refusal::NoLink)?;
        let next = self.apply(Event::ClearFault, at)?;
        self.note(LogEvent::Cleared, 0, self.faults.latched().raw(), at);
        self.faults.clear();
        Ok(next)
    }

    /// Arms, if the link is alive and nothing is latched.
    pub fn arm(&mut self, at: Micros) -> Result<Mode, Refusal> {
        if !self.faults.latched().is_empty() {
            return Err(Refusal::Latched);
        }
        if !self.link_alive() {
            return Err(Refusal::NoLink);
        }
        self.apply(Event::Arm, at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_protocol::link::WatchdogCycles;

    const TIMES: SupervisionTimes = SupervisionTimes {
        tick: Micros(1000),
        watchdog: WatchdogCycles::DEFAULT,
        hold: Micros::from_millis(500),
        blow_through: Micros::from_millis(5000),
    };

    /// Armed, then in Hold after the loss of the link.
    fn held() -> Supervisor {
        let mut own = Supervisor::new();
        own.begin_tick(Micros(0), &TIMES);
        own.apply(Event::SelfTestPassed, Micros(0)).unwrap();
        own.apply(Event::Arm, Micros(0)).unwrap();
        own.allow_exhaust(true);
        own.fault(Fault::LinkLost, Event::LinkLost, Micros(0));
        own.begin_tick(Micros(1000), &TIMES);
        assert_eq!((own.mode(), own.staged), (Mode::Hold, true));
        own
    }

    /// A tick has room for eight notes; when more come, the first ones are processed at once.
    #[test]
    fn no_note_is_lost_however_many_a_tick_makes() {
        let mut own = Supervisor::new();
        own.read_log(1000, Micros(0));
        for n in 0..16 {
            own.note(LogEvent::Parameter, 0, n, Micros(5000));
        }
        let mut numbers = Vec::new();
        for _ in 0..4 {
            let records = own.read_log(1000, Micros(6000));
            assert_eq!(records.lost, 0);
            numbers.extend(records.iter().map(|entry| entry.b));
        }
        assert_eq!(numbers, (0..16).collect::<Vec<u16>>());
    }

    #[test]
    fn the_counter_of_the_newest_sync_is_compared_while_the_link_is_up() {
        let mut own = Supervisor::new();
        assert!(own.agrees(5), "nothing is certain yet");
        own.sync(7, false, Micros(0));
        own.sync(8, false, Micros(10_000));
        assert!(own.agrees(8) && !own.agrees(7) && !own.agrees(9));
        own.sync(8, false, Micros(20_000));
        assert!(own.agrees(7), "a stale one came since");
    }

    /// Only a fresh SYNC withdraws an E-stop; a repeated one proves nothing.
    #[test]
    fn a_stale_sync_does_not_take_an_emergency_stop_back() {
        let mut own = held();
        for (cycle, at) in [(1, 2000), (2, 12_000)] {
            own.sync(cycle, false, Micros(at));
        }
        assert!(own.sync(3, true, Micros(22_000)));
        for (cycle, fresh) in [(3, false), (2, false), (4, true)] {
            assert!(own.emergency);
            let cause = own.clear(true, Micros(22_000));
            assert_eq!(cause, Err(Refusal::CausePresent));
            assert_eq!(own.sync(cycle, false, Micros(32_000)), fresh);
        }
        assert!(!own.emergency && own.emergency_stop());
    }

    #[test]
    fn a_flipped_bit_of_what_steers_the_outputs_is_held() {
        let flips: [fn(&mut Supervisor); 7] = [
            |own| own.mode = Mode::Tracking,
            |own| own.exhaust = ExhaustKind::BlowThrough,
            |own| own.staged = false,
            |own| own.from_drive = false,
            |own| own.exhaust_allowed = false,
            |own| own.emergency = true,
            |own| own.check ^= 1 << 15,
        ];
        for (index, flip) in flips.into_iter().enumerate() {
            // Damage is seen even if something changes before the next tick.
            for changed in [false, true] {
                let mut own = held();
                flip(&mut own);
                if changed {
                    own.allow_exhaust(false);
                }
                own.begin_tick(Micros(2000), &TIMES);
                assert!(
                    own.faults().latched().contains(Fault::StateCorrupt),
                    "{index}"
                );
                assert_eq!((own.mode(), own.staged), (Mode::Hold, false));
                assert_eq!(own.exhaust(), ExhaustKind::Staged);
                assert!(own.is_intact(), "{index}");
                // Nothing is staged by a program whose state was wrong.
                for tick in 3..2000 {
                    own.begin_tick(Micros(tick * 1000), &TIMES);
                    assert_eq!(own.mode(), Mode::Hold);
                }
            }
        }
        let mut sound = held();
        sound.begin_tick(Micros(2000), &TIMES);
        assert!(!sound.faults().latched().contains(Fault::StateCorrupt));
    }
}
