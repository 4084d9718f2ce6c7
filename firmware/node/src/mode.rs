//! Modes of a board and the one table that says how they change.
//!
//! The table is the whole mode logic: every (mode, event) pair has an entry, and nothing else in this crate assigns a
//! mode. [`ModeRules::may_drive`] and [`ModeRules::is_latched`] determine what the outputs do in a mode; the joint and
//! wheel applications carry it out.
//!
//! | mode | joint outputs | wheel outputs | leaves by |
//! |---|---|---|---|
//! | Boot | all valves shut | drive off | self-test |
//! | Idle | all valves shut | drive off | arm, exhaust, faults |
//! | Armed | precharge, then closed loop on the position found when arming | closed loop at standstill | set-point, disarm, faults |
//! | Tracking | rest of a precharge, then closed loop on the bus reference | closed loop on the bus reference | set-point withdrawn, disarm, faults |
//! | Hold | all valves shut, air trapped | ramp to standstill, then drive off | clear fault, staged exhaust |
//! | Exhaust | inlets shut, outlets open (PWM-limited when staged) | (never entered) | clear fault, emergency brake, E-stop |
//! | Fault | all valves shut | drive off | clear fault |
//!
//! Hold is the answer to what comes from outside or from the axis (link, E-stop, brake, sensor, following error, a bit
//! flip). Fault is the answer when the board itself missed its deadline or failed its self-test, so that no staging is
//! run by a program that cannot be trusted. Both are latched.

pub use wheeleg_protocol::NodeMode as Mode;

/// What can change a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Event {
    /// Enough good sensor readings in a row after reset.
    SelfTestPassed = 0,
    /// No good sensor reading within the self-test time.
    SelfTestFailed = 1,
    /// Request: arm.
    Arm = 2,
    /// Request: disarm.
    Disarm = 3,
    /// Request: clear latched faults.
    ClearFault = 4,
    /// A SYNC slot with the valid bit set was latched.
    SetpointValid = 5,
    /// A SYNC slot without the valid bit was latched.
    SetpointWithdrawn = 6,
    /// Request: emergency brake of this axis.
    EmergencyBrake = 7,
    /// E-stop bit in a SYNC header.
    EmergencyStop = 8,
    /// No fresh SYNC for the watchdog time.
    LinkLost = 9,
    /// Sensor, following-error or state-check fault of this axis.
    AxisFault = 10,
    /// A tick overran, or the outputs could not be written.
    BoardFault = 11,
    /// Request: open all valves (inlets shut, outlets open).
    OpenAllValves = 12,
    /// Request: literal blow-through (maintenance).
    BlowThrough = 13,
    /// The hold time is over and the gait phase allows the exhaust.
    StageExhaust = 14,
    /// The blow-through time is over.
    BlowThroughOver = 15,
}

/// Why the table refuses an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Refusal {
    /// Only possible while disarmed (Idle).
    NotDisarmed,
    /// A latched stop must be cleared first.
    Latched,
    /// The self-test has not passed.
    NotReady,
    /// The event has no meaning in this mode.
    NotApplicable,
    /// The cause of the latched stop is still present.
    CausePresent,
    /// The link is not alive: arming would trip the watchdog at once.
    NoLink,
}

/// All events, in the row order of the table.
pub const EVENTS: [Event; 16] = [
    Event::SelfTestPassed,
    Event::SelfTestFailed,
    Event::Arm,
    Event::Disarm,
    Event::ClearFault,
    Event::SetpointValid,
    Event::SetpointWithdrawn,
    Event::EmergencyBrake,
    Event::EmergencyStop,
    Event::LinkLost,
    Event::AxisFault,
    Event::BoardFault,
    Event::OpenAllValves,
    Event::BlowThrough,
    Event::StageExhaust,
    Event::BlowThroughOver,
];

type Entry = Result<Mode, Refusal>;

const BOOT: Entry = Ok(Mode::Boot);
const IDLE: Entry = Ok(Mode::Idle);
const ARMD: Entry = Ok(Mode::Armed);
const TRCK: Entry = Ok(Mode::Tracking);
const HOLD: Entry = Ok(Mode::Hold);
const EXHA: Entry = Ok(Mode::Exhaust);
const FALT: Entry = Ok(Mode::Fault);
const NDIS: Entry = Err(Refusal::NotDisarmed);
const LTCH: Entry = Err(Refusal::Latched);
const NRDY: Entry = Err(Refusal::NotReady);
const NAPP: Entry = Err(Refusal::NotApplicable);

/// Row: event. Column: present mode. Entry: next mode, or the refusal.
///
/// A disarmed board does not move to Hold on link loss or axis faults (nothing is energised, and a staged exhaust would
/// energise outputs); the fault is still latched and bars arming.
#[rustfmt::skip]
const TABLE: [[Entry; 7]; 16] = [
    //                       Boot  Idle  Armed Track Hold  Exha  Fault
    /* SelfTestPassed    */ [IDLE, NAPP, NAPP, NAPP, NAPP, NAPP, NAPP],
    /* SelfTestFailed    */ [FALT, NAPP, NAPP, NAPP, NAPP, NAPP, NAPP],
    /* Arm               */ [NRDY, ARMD, ARMD, TRCK, LTCH, LTCH, LTCH],
    /* Disarm            */ [BOOT, IDLE, IDLE, IDLE, LTCH, LTCH, LTCH],
    /* ClearFault        */ [BOOT, IDLE, ARMD, TRCK, IDLE, IDLE, BOOT],
    /* SetpointValid     */ [NAPP, NAPP, TRCK, TRCK, NAPP, NAPP, NAPP],
    /* SetpointWithdrawn */ [NAPP, NAPP, ARMD, ARMD, NAPP, NAPP, NAPP],
    /* EmergencyBrake    */ [BOOT, HOLD, HOLD, HOLD, HOLD, HOLD, FALT],
    /* EmergencyStop     */ [BOOT, HOLD, HOLD, HOLD, HOLD, HOLD, FALT],
    /* LinkLost          */ [BOOT, IDLE, HOLD, HOLD, HOLD, EXHA, FALT],
    /* AxisFault         */ [BOOT, IDLE, HOLD, HOLD, HOLD, EXHA, FALT],
    /* BoardFault        */ [FALT, FALT, FALT, FALT, FALT, FALT, FALT],
    /* OpenAllValves     */ [NRDY, EXHA, EXHA, EXHA, EXHA, EXHA, LTCH],
    /* BlowThrough       */ [NRDY, EXHA, NDIS, NDIS, NDIS, NDIS, NDIS],
    /* StageExhaust      */ [NAPP, NAPP, NAPP, NAPP, EXHA, EXHA, NAPP],
    /* BlowThroughOver   */ [NAPP, NAPP, NAPP, NAPP, NAPP, IDLE, NAPP],
];

/// What the mode table implies for a mode.
pub trait ModeRules: Sized {
    /// The mode after `event`, or why the event is refused (then the mode stays).
    fn after(self, event: Event) -> Result<Mode, Refusal>;

    /// Whether the closed loop may drive outputs.
    fn may_drive(self) -> bool;

    /// Whether the mode is left only by an explicit clear.
    fn is_latched(&self) -> bool;

    /// Whether nothing is energised or about to be: parameters marked "disarmed only" may be set, and maintenance may
    /// run.
    fn is_disarmed(&self) -> bool;
}

impl ModeRules for Mode {
    fn after(self, event: Event) -> Result<Mode, Refusal> {
        TABLE
            .get(usize::from(event as u8))
            .and_then(|row| row.get(usize::from(self as u8)))
            .copied()
            .unwrap_or(Err(Refusal::NotApplicable))
    }

    fn may_drive(self) -> bool {
        matches!(self, Mode::Armed | Mode::Tracking)
    }

    fn is_latched(&self) -> bool {
        matches!(self, Mode::Hold | Mode::Exhaust | Mode::Fault)
    }

    fn is_disarmed(&self) -> bool {
        matches!(self, Mode::Boot | Mode::Idle | Mode::Fault)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every pair, written down a second time: modes by initial (Boot, Idle, Armed, Tracking, Hold, Exhaust, Fault),
    /// refusals by symbol: `-` not applicable, `!` latched, `r` not ready, `d` not disarmed.
    const EXPECTED: [(Event, &str); 16] = [
        (Event::SelfTestPassed, "I------"),
        (Event::SelfTestFailed, "F------"),
        (Event::Arm, "rAAT!!!"),
        (Event::Disarm, "BIII!!!"),
        (Event::ClearFault, "BIATIIB"),
        (Event::SetpointValid, "--TT---"),
        (Event::SetpointWithdrawn, "--AA---"),
        (Event::EmergencyBrake, "BHHHHHF"),
        (Event::EmergencyStop, "BHHHHHF"),
        (Event::LinkLost, "BIHHHEF"),
        (Event::AxisFault, "BIHHHEF"),
        (Event::BoardFault, "FFFFFFF"),
        (Event::OpenAllValves, "rEEEEE!"),
        (Event::BlowThrough, "rEddddd"),
        (Event::StageExhaust, "----EE-"),
        (Event::BlowThroughOver, "-----I-"),
    ];

    fn sign(entry: Result<Mode, Refusal>) -> char {
        match entry {
            Ok(mode) => mode.name().chars().next().unwrap(),
            Err(Refusal::NotApplicable) => '-',
            Err(Refusal::Latched) => '!',
            Err(Refusal::NotReady) => 'r',
            Err(Refusal::NotDisarmed) => 'd',
            Err(refusal) => panic!("{refusal:?} is not the table's to give"),
        }
    }

    #[test]
    fn every_pair_is_as_written() {
        for (index, (event, row)) in EXPECTED.into_iter().enumerate() {
            assert_eq!(event, EVENTS[index]);
            assert_eq!(event as usize, index);
            let actual: String = Mode::ALL
                .iter()
                .map(|mode| sign(mode.after(event)))
                .collect();
            assert_eq!(actual, row, "{event:?}");
        }
    }

    #[test]
    fn only_arming_leads_to_a_driving_mode() {
        for mode in Mode::ALL {
            for event in EVENTS {
                let Ok(next) = mode.after(event) else {
                    continue;
                };
                if next.may_drive() && !mode.may_drive() {
                    assert_eq!((event, *mode), (Event::Arm, Mode::Idle));
                }
            }
        }
    }

    #[test]
    fn latched_modes_end_with_an_explicit_clear_only() {
        for mode in Mode::ALL.iter().filter(|mode| mode.is_latched()) {
            for event in EVENTS {
                let Ok(next) = mode.after(event) else {
                    continue;
                };
                let ends = !next.is_latched();
                // A blow-through is a command of its own, not a stop.
                let allowed = matches!(event, Event::ClearFault | Event::BlowThroughOver);
                assert!(!ends || allowed, "{mode:?} {event:?} {next:?}");
            }
        }
    }

    #[test]
    fn every_fault_event_has_an_answer_in_every_mode() {
        use Event::{AxisFault, BoardFault, EmergencyBrake, EmergencyStop, LinkLost};
        for mode in Mode::ALL {
            for event in [
                AxisFault,
                BoardFault,
                EmergencyBrake,
                EmergencyStop,
                LinkLost,
            ] {
                assert!(
                    !mode.after(event).unwrap().may_drive(),
                    "{mode:?} {event:?}"
                );
            }
        }
    }
}
