//! Messages that the user of a row must get, or must not: an event with its cause, not its text.

use std::fmt;

use wheeleg_config::raw_of;
use wheeleg_interface::changes;
use wheeleg_master::command::{CommandCode, Layer};
use wheeleg_master::contact::{Sector, Side};
use wheeleg_master::dispatcher::Reject;
use wheeleg_master::event::{Event as MasterEvent, HoldReason};
use wheeleg_master::finding::Finding;
use wheeleg_protocol::param::params_at;
use wheeleg_protocol::{
    Address, DisarmReason, Fault, NackReason, ResetCause, SCHEMA_HASH, Warning,
};
use wheeleg_telemetry::event::{BadRequest, BoardChange, Cause, ServiceOutcome};

/// An expected event. Boards are bus addresses, 1 to 8.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Expected {
    /// Any board latches the fault.
    Latched(Fault),
    /// This board latches the fault.
    LatchedBy(u8, Fault),
    /// This board latches one of the faults.
    LatchedOneOf(u8, &'static [Fault]),
    /// The master misses any board.
    AnyLost,
    /// The master misses this board.
    Lost(u8),
    /// The master commands all axes to hold, for this reason.
    Hold(HoldReason),
    /// The master reports this finding, about any board or none.
    Found(Finding),
    /// The master reports this finding about this board.
    FoundAt(u8, Finding),
    /// This board reports this fault as its first.
    SaysFault(u8, Fault),
    /// This board reports that it has restarted, for this cause.
    SaysReset(u8, ResetCause),
    /// Two boards answer at this address.
    Duplicate(u8),
    /// This board, of this program's version, has another interface, and the archive says how it differs.
    OtherInterface(u8),
    /// A switch of a foot does not follow the other three.
    FootSwitch(Side, Sector, Warning),
    /// The master counts frames with a wrong checksum.
    ChecksumErrors,
    /// A command is carried out.
    Done(CommandCode),
    /// A queued command is refused because of this board.
    Refused(CommandCode, u8),
    /// A command of a flood of them finds the queue to this layer full.
    FloodRefused(Layer),
    /// A parameter of this board, by name, has this value in its unit.
    Parameter(u8, &'static str, f64),
    /// This board refuses a service tool's request.
    ServiceRefused(u8, BadRequest, NackReason),
    /// A parameter of this board has kept its value from before the service tool's requests.
    ServiceUnchanged(u8),
    /// Messages could not be written to the log: no event, but a count of the recording.
    MessagesLost,
}

impl Expected {
    /// Whether this event is the expected one.
    pub(super) fn is(self, cause: &Cause) -> bool {
        match cause {
            Cause::Board { board, change } => self.is_change(board.raw(), *change),
            Cause::Master(event) => self.is_reported(event, cause.board().map_or(0, Address::raw)),
            Cause::Flood { reason, .. } => {
                matches!((self, *reason), (Self::FloodRefused(layer), Reject::QueueFull { layer: full }) if layer == full)
            }
            Cause::Service { board, outcome, .. } => match (self, *outcome) {
                (
                    Self::ServiceRefused(who, what, why),
                    ServiceOutcome::Refused { request, reason },
                ) => (who, what, why) == (board.raw(), request, reason),
                (Self::ServiceUnchanged(who), ServiceOutcome::Unchanged { .. }) => {
                    who == board.raw()
                }
                _ => false,
            },
            Cause::LineErrors(link) => self == Self::ChecksumErrors && link.crc > 0,
            Cause::LineBroken(_) | Cause::LineMended | Cause::Failed(_) => false,
            Cause::Contact { .. } | Cause::Command { .. } | Cause::Scenario(_) => false,
        }
    }

    fn is_change(self, board: u8, change: BoardChange) -> bool {
        let BoardChange::FaultLatched(fault) = change else {
            return false;
        };
        match self {
            Self::Latched(wanted) => wanted == fault,
            Self::LatchedBy(who, wanted) => (who, wanted) == (board, fault),
            Self::LatchedOneOf(who, wanted) => who == board && wanted.contains(&fault),
            _ => false,
        }
    }

    /// `about` is the board concerned, 0 for none.
    fn is_reported(self, event: &MasterEvent, about: u8) -> bool {
        match (self, *event) {
            (Self::AnyLost, MasterEvent::NodeLost(_)) => true,
            (Self::Lost(who), MasterEvent::NodeLost(node)) => who == node,
            (Self::Hold(wanted), MasterEvent::Hold(reason)) => wanted == reason,
            (Self::Found(wanted), MasterEvent::Found { finding, .. }) => wanted == finding,
            (Self::FoundAt(who, wanted), MasterEvent::Found { node, finding }) => {
                (Some(who), wanted) == (node, finding)
            }
            (Self::SaysFault(who, fault), MasterEvent::Diagnosis { node, record, .. }) => {
                (who, Some(fault)) == (node, record.first_fault.fault())
            }
            (Self::SaysReset(who, cause), MasterEvent::Diagnosis { node, record, .. }) => {
                let anew = record.disarm_reason == DisarmReason::Reset || cause.is_fault();
                anew && (who, cause) == (node, record.reset_cause)
            }
            (Self::Duplicate(who), MasterEvent::DuplicateAddress { node, .. }) => who == node,
            (
                Self::OtherInterface(who),
                MasterEvent::SchemaMismatch {
                    node,
                    master,
                    theirs,
                    firmware: [major, minor, patch],
                },
            ) => {
                let version = format!("{major}.{minor}.{patch}");
                (who, master) == (node, SCHEMA_HASH)
                    && version == env!("CARGO_PKG_VERSION")
                    && changes(master, theirs).is_ok_and(|changes| !changes.is_empty())
            }
            (
                Self::FootSwitch(foot, place, wanted),
                MasterEvent::FootSwitch {
                    side,
                    sector,
                    warning,
                },
            ) => (foot, Some(place), wanted) == (side, sector, warning),
            (Self::Done(code), MasterEvent::Done(ticket)) => code == ticket.code,
            (Self::Refused(code, who), MasterEvent::Refused { ticket, .. }) => {
                (code, who) == (ticket.code, about)
            }
            (Self::Parameter(who, of, wanted), MasterEvent::Parameter { node, id, raw }) => {
                let row = params_at(who).iter().find(|row| row.name == of);
                who == node && row.is_some_and(|row| (row.id, raw_of(row, wanted)) == (id, raw))
            }
            _ => false,
        }
    }
}

/// Name of a board.
fn board(address: u8) -> String {
    Address::new(address).map_or_else(|| format!("board {address}"), |a| a.to_string())
}

impl fmt::Display for Expected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Latched(fault) => write!(f, "fault {}", fault.name()),
            Self::LatchedBy(who, fault) => write!(f, "{}: fault {}", board(who), fault.name()),
            Self::LatchedOneOf(who, faults) => {
                let names: Vec<&str> = faults.iter().map(|fault| fault.name()).collect();
                write!(f, "{}: fault {}", board(who), names.join(" or "))
            }
            Self::AnyLost => f.write_str("a board is lost"),
            Self::Lost(who) => write!(f, "{} is lost", board(who)),
            Self::Hold(reason) => write!(f, "all axes hold: {reason:?}"),
            Self::Found(finding) => write!(f, "finding {finding:?}"),
            Self::FoundAt(who, finding) => write!(f, "{}: finding {finding:?}", board(who)),
            Self::SaysFault(who, fault) => {
                write!(f, "{} says why: first fault {}", board(who), fault.name())
            }
            Self::SaysReset(who, cause) => {
                write!(f, "{} says why: restarted, {}", board(who), cause.name())
            }
            Self::Duplicate(who) => write!(f, "two boards at the address of {}", board(who)),
            Self::OtherInterface(who) => {
                write!(f, "{} has another interface, and in what", board(who))
            }
            Self::FootSwitch(side, sector, warning) => write!(
                f,
                "{side:?} foot, {sector:?} switch: warning {}",
                warning.name()
            ),
            Self::ChecksumErrors => f.write_str("frames with a wrong checksum"),
            Self::Done(code) => write!(f, "{code:?} done"),
            Self::Refused(code, who) => write!(f, "{code:?} refused because of {}", board(who)),
            Self::FloodRefused(layer) => {
                write!(
                    f,
                    "flood of commands refused: queue to layer {layer:?} full"
                )
            }
            Self::Parameter(who, of, value) => write!(f, "{of} of {} is {value}", board(who)),
            Self::ServiceRefused(who, request, reason) => {
                write!(f, "{} refuses {request:?}: {}", board(who), reason.name())
            }
            Self::ServiceUnchanged(who) => write!(f, "parameter of {} unchanged", board(who)),
            Self::MessagesLost => f.write_str("messages not written to the log"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_protocol::{FaultBits, FaultCode, FaultRecord, LimitBits, LinkQuality};

    fn joint(number: u8) -> Address {
        Address::joint(number).expect("a joint")
    }

    #[test]
    fn an_event_of_another_board_fault_or_reason_is_not_the_one_looked_for() {
        let latched = |number, fault| Cause::Board {
            board: joint(number),
            change: BoardChange::FaultLatched(fault),
        };
        let wanted = Expected::LatchedBy(3, Fault::SensorRange);
        assert!(wanted.is(&latched(3, Fault::SensorRange)));
        assert!(!wanted.is(&latched(2, Fault::SensorRange)));
        assert!(!wanted.is(&latched(3, Fault::SensorRate)));
        assert!(Expected::Latched(Fault::SensorRange).is(&latched(2, Fault::SensorRange)));
        let either = Expected::LatchedOneOf(3, &[Fault::NoMotion, Fault::FollowingError]);
        assert!(
            either.is(&latched(3, Fault::NoMotion)) && !either.is(&latched(3, Fault::LinkLost))
        );

        let hold = |reason| Cause::Master(MasterEvent::Hold(reason));
        let wanted = Expected::Hold(HoldReason::NodeLost(3));
        assert!(wanted.is(&hold(HoldReason::NodeLost(3))));
        assert!(!wanted.is(&hold(HoldReason::NodeLost(4))));
        assert!(!wanted.is(&hold(HoldReason::SupplyLost)));
        assert!(!wanted.is(&Cause::Master(MasterEvent::NodeLost(3))));
    }

    #[test]
    fn a_board_that_started_anew_must_say_so_and_why() {
        let says = |disarm_reason, reset_cause| {
            let record = FaultRecord {
                disarm_reason,
                reset_cause,
                ..record()
            };
            Cause::Master(MasterEvent::Diagnosis {
                node: 2,
                record,
                ago_us: 0,
            })
        };
        let wanted = Expected::SaysReset(2, ResetCause::PowerUp);
        assert!(wanted.is(&says(DisarmReason::Reset, ResetCause::PowerUp)));
        assert!(!wanted.is(&says(DisarmReason::Reset, ResetCause::Pin)));
        // Every board has been switched on once: that alone is not a restart.
        assert!(!wanted.is(&says(DisarmReason::Fault, ResetCause::PowerUp)));
        let wanted = Expected::SaysReset(2, ResetCause::Watchdog);
        assert!(wanted.is(&says(DisarmReason::Fault, ResetCause::Watchdog)));
    }

    fn record() -> FaultRecord {
        FaultRecord {
            active: FaultBits::NONE,
            sticky: FaultBits::NONE,
            first_fault: FaultCode::NONE,
            first_time_us: 0,
            disarm_reason: DisarmReason::None,
            limits: LimitBits::NONE,
            reset_cause: ResetCause::PowerUp,
            clock_offset_us: 0,
        }
    }

    #[test]
    fn what_is_counted_is_told_by_its_count() {
        let line = |crc| {
            Cause::LineErrors(LinkQuality {
                crc,
                truncated: 5,
                ..LinkQuality::default()
            })
        };
        assert!(Expected::ChecksumErrors.is(&line(1)) && !Expected::ChecksumErrors.is(&line(0)));
    }

    #[test]
    fn another_interface_must_be_told_with_its_first_difference() {
        let mismatch = |theirs, firmware| {
            Cause::Master(MasterEvent::SchemaMismatch {
                node: 4,
                master: SCHEMA_HASH,
                theirs,
                firmware,
            })
        };
        let version: Vec<u8> = env!("CARGO_PKG_VERSION")
            .split('.')
            .map(|part| part.parse().expect("a number"))
            .collect();
        let version = [version[0], version[1], version[2]];
        let earlier = wheeleg_interface::archive::newest_earlier().expect("one");
        let wanted = Expected::OtherInterface(4);
        assert!(wanted.is(&mismatch(earlier, version)));
        // Not so if nothing is known of it, it is the same, or the board reports another version.
        assert!(!wanted.is(&mismatch(0x1234, version)));
        assert!(!wanted.is(&mismatch(SCHEMA_HASH, version)));
        assert!(!wanted.is(&mismatch(earlier, [9, 9, 9])));
    }
}
