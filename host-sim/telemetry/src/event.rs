//! Events of a run, as data. [`messages`](crate::messages) makes their text, last of all.

pub(crate) mod code;
mod holds;
mod names;

use wheeleg_config::faults::FaultSpec;
use wheeleg_master::command::CommandCode;
use wheeleg_master::contact::Side;
use wheeleg_master::dispatcher::{Refusal, Reject};
use wheeleg_master::event::{Event as MasterEvent, HoldReason};
use wheeleg_protocol::{
    Address, Fault, FaultBits, LinkQuality, LogEntry, LogEvent, NackReason, NodeMode,
};

use crate::samples::EventSample;
pub use code::{EventCode, EventKind};
pub use holds::{HoldWords, hold_words, hold_words_of, holds};
pub(crate) use names::parameter_name;
pub(crate) use names::refusing_board;
pub use names::{finding_of_name, hold_name, reject_name};
use names::{master_board, master_code, master_detail, master_kind, side_name, snake_case};

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// What.
    pub cause: Cause,
    /// Time since power-up of an event of the start-up, µs. The start-up is recorded at scenario
    /// time 0; `None`: the event happened later.
    pub start_up_us: Option<u64>,
}

/// What happened, by its source.
#[derive(Debug, Clone, PartialEq)]
pub enum Cause {
    /// The master reports something.
    Master(MasterEvent),
    /// A board is seen to change.
    Board {
        /// Which.
        board: Address,
        /// How.
        change: BoardChange,
    },
    /// A foot really touches the ground, or leaves it; the state that the master derives from its switches is
    /// logged beside it.
    Contact {
        /// Which foot.
        side: Side,
        /// Switches closed by the ground: front, left, back, right. None: the foot is free.
        switches: [bool; 4],
    },
    /// The scenario's user gives a command.
    Command {
        /// Which.
        code: CommandCode,
        /// The master's answer at the door.
        answer: Answer,
    },
    /// The first refusal of a user who gives commands without end.
    Flood {
        /// Number of the command within its bus cycle, from 0.
        number: usize,
        /// Why.
        reason: Reject,
    },
    /// The scenario acts.
    Scenario(Act),
    /// A service tool sends a board a request that it must refuse.
    Service {
        /// Which board.
        board: Address,
        /// Number of the parameter.
        parameter: u16,
        /// The outcome.
        outcome: ServiceOutcome,
    },
    /// The master has heard broken frames: its counts at the end of the run.
    LineErrors(LinkQuality),
    /// The line to boards elsewhere is broken; the operating system's reason.
    LineBroken(String),
    /// It works again. All axes are disarmed.
    LineMended,
    /// Why the run ended early, in words.
    Failed(String),
}

/// How a board changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoardChange {
    /// Its mode.
    Mode {
        /// Before.
        from: NodeMode,
        /// Now.
        to: NodeMode,
    },
    /// It latches a fault.
    FaultLatched(Fault),
    /// Its last fault is cleared.
    FaultsCleared,
}

/// The answer to a user's command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// It is queued.
    Accepted,
    /// It is refused at the door.
    Rejected(Reject),
    /// Nothing: the master is dead.
    Nothing,
}

/// What the scenario does to the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Act {
    /// The master dies.
    KillMaster,
    /// The E-stop is pressed.
    EStop,
    /// A fault begins.
    FaultBegins(FaultSpec),
    /// A fault ends.
    FaultEnds(FaultSpec),
}

/// Outcome of a service tool's requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ServiceOutcome {
    /// The board refuses.
    Refused {
        /// What.
        request: BadRequest,
        /// Why.
        reason: NackReason,
    },
    /// The board accepts a request that it must refuse.
    Taken(BadRequest),
    /// The parameter has kept its value.
    Unchanged {
        /// Raw value.
        raw: i32,
    },
    /// The parameter has changed.
    Changed {
        /// Raw value now.
        raw: i32,
    },
    /// The board does not give the parameter's value.
    NotGiven,
}

/// A request that a board must refuse.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BadRequest {
    /// A value above the parameter's limit.
    AboveLimit,
    /// A number that no parameter has.
    UnknownParameter(
        /// The number.
        u16,
    ),
    /// A value of another size: a float that is not a number.
    NotANumber,
}

impl From<Cause> for Event {
    /// An event after the start-up.
    fn from(cause: Cause) -> Self {
        Self {
            cause,
            start_up_us: None,
        }
    }
}

impl Event {
    /// An event of the start-up, µs after power-up.
    #[must_use]
    pub fn of_start_up(cause: Cause, after_power_up_us: u64) -> Self {
        Self {
            cause,
            start_up_us: Some(after_power_up_us),
        }
    }

    /// As written in the log.
    #[must_use]
    pub fn sample(&self) -> EventSample {
        let cause = &self.cause;
        EventSample {
            kind: cause.kind(),
            code: cause.code(),
            detail: cause.detail(),
            board: cause.board().map_or(0, Address::raw),
            fault: cause.fault_code().unwrap_or(0),
            command: cause.command().map_or(0, |code| code as u16),
            start_up_us: self.start_up_us.unwrap_or(0),
            text: self.to_string(),
        }
    }
}

impl Cause {
    /// Kind, for the eye and for coarse filters.
    #[must_use]
    pub const fn kind(&self) -> EventKind {
        match self {
            Self::Master(event) => master_kind(event),
            Self::Board { change, .. } => match change {
                BoardChange::Mode { .. } => EventKind::Mode,
                BoardChange::FaultLatched(_) | BoardChange::FaultsCleared => EventKind::Fault,
            },
            Self::Contact { .. } => EventKind::Contact,
            Self::Command { .. } | Self::Flood { .. } | Self::Service { .. } => EventKind::Command,
            Self::Scenario(_) => EventKind::Scenario,
            Self::LineErrors(_) | Self::LineMended => EventKind::Info,
            Self::LineBroken(_) | Self::Failed(_) => EventKind::Fault,
        }
    }

    /// Its code.
    #[must_use]
    pub const fn code(&self) -> EventCode {
        match self {
            Self::Master(event) => master_code(event),
            Self::Board { change, .. } => match change {
                BoardChange::Mode { .. } => EventCode::Mode,
                BoardChange::FaultLatched(_) => EventCode::FaultLatched,
                BoardChange::FaultsCleared => EventCode::FaultsCleared,
            },
            Self::Contact { switches, .. } => match switches {
                [false, false, false, false] => EventCode::GroundFree,
                _ => EventCode::GroundContact,
            },
            Self::Command { answer, .. } => match answer {
                Answer::Accepted => EventCode::CommandAccepted,
                Answer::Rejected(_) => EventCode::CommandRejected,
                Answer::Nothing => EventCode::CommandUnanswered,
            },
            Self::Flood { .. } => EventCode::FloodRejected,
            Self::Scenario(act) => match act {
                Act::KillMaster => EventCode::MasterKilled,
                Act::EStop => EventCode::EStopPressed,
                Act::FaultBegins(_) => EventCode::FaultBegins,
                Act::FaultEnds(_) => EventCode::FaultEnds,
            },
            Self::Service { outcome, .. } => match outcome {
                ServiceOutcome::Refused { .. } => EventCode::ServiceRefused,
                ServiceOutcome::Taken(_) => EventCode::ServiceTaken,
                ServiceOutcome::Unchanged { .. } => EventCode::ServiceUnchanged,
                ServiceOutcome::Changed { .. } => EventCode::ServiceChanged,
                ServiceOutcome::NotGiven => EventCode::ServiceNotGiven,
            },
            Self::LineErrors(_) => EventCode::LineErrors,
            Self::LineBroken(_) => EventCode::LineBroken,
            Self::LineMended => EventCode::LineMended,
            Self::Failed(_) => EventCode::RunFailed,
        }
    }

    /// Distinguishes events of one [`code`](Self::code), in snake case: the mode entered, the reason, the
    /// finding, the record of a board's log, the side of a foot, the parameter, the fault injected. Empty if
    /// the code is enough.
    #[must_use]
    pub fn detail(&self) -> String {
        match self {
            Self::Master(event) => master_detail(event),
            Self::Board { change, .. } => match change {
                BoardChange::Mode { to, .. } => snake_case(to.name()),
                BoardChange::FaultLatched(fault) => snake_case(fault.name()),
                BoardChange::FaultsCleared => String::new(),
            },
            Self::Contact { side, .. } => side_name(*side).to_owned(),
            Self::Command { answer, .. } => match answer {
                Answer::Rejected(reason) => reject_name(reason).to_owned(),
                Answer::Accepted | Answer::Nothing => String::new(),
            },
            Self::Flood { reason, .. } => reject_name(reason).to_owned(),
            Self::Scenario(act) => match act {
                Act::KillMaster | Act::EStop => String::new(),
                Act::FaultBegins(fault) | Act::FaultEnds(fault) => {
                    fault.kind.name().replace('-', "_")
                }
            },
            Self::Service {
                board, parameter, ..
            } => parameter_name(board.raw(), *parameter),
            Self::LineErrors(_) | Self::LineBroken(_) | Self::LineMended | Self::Failed(_) => {
                String::new()
            }
        }
    }

    /// The board concerned, by its address 1 to 8.
    #[must_use]
    pub fn board(&self) -> Option<Address> {
        match self {
            Self::Master(event) => master_board(event).and_then(Address::new),
            Self::Board { board, .. } | Self::Service { board, .. } => Some(*board),
            _ => None,
        }
    }

    /// Number of the fault or warning, in the protocol's tables; of several, the first.
    #[must_use]
    pub fn fault_code(&self) -> Option<u8> {
        let first = |bits: u16| FaultBits::from_raw(bits).iter().next().map(Fault::code);
        match self {
            Self::Board {
                change: BoardChange::FaultLatched(fault),
                ..
            } => Some(fault.code()),
            Self::Master(event) => match event {
                MasterEvent::Hold(HoldReason::NodeFault { faults, .. })
                | MasterEvent::Refused {
                    reason: Refusal::NodeFault { faults, .. },
                    ..
                } => first(*faults),
                MasterEvent::Diagnosis { record, .. } => {
                    record.first_fault.fault().map(Fault::code)
                }
                MasterEvent::Log {
                    entry:
                        LogEntry {
                            event: LogEvent::Fault,
                            a,
                            ..
                        },
                    ..
                } => Some(*a),
                MasterEvent::FootSwitch { warning, .. } => Some(warning.code()),
                _ => None,
            },
            _ => None,
        }
    }

    /// The user's command that it answers.
    #[must_use]
    pub const fn command(&self) -> Option<CommandCode> {
        match self {
            Self::Command { code, .. } => Some(*code),
            Self::Master(MasterEvent::Done(ticket) | MasterEvent::Refused { ticket, .. }) => {
                Some(ticket.code)
            }
            _ => None,
        }
    }

    /// Whether all axes were commanded to hold.
    #[must_use]
    pub const fn is_hold(&self) -> bool {
        matches!(self, Self::Master(MasterEvent::Hold(_)))
    }

    /// Whether a command of a user, or a request of a service tool, failed.
    #[must_use]
    pub const fn is_refusal(&self) -> bool {
        matches!(
            self,
            Self::Master(MasterEvent::Refused { .. })
                | Self::Command {
                    answer: Answer::Rejected(_) | Answer::Nothing,
                    ..
                }
                | Self::Flood { .. }
                | Self::Service {
                    outcome: ServiceOutcome::Refused { .. },
                    ..
                }
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_master::dispatcher::Ticket;
    use wheeleg_master::finding::Finding;

    fn joint(number: u8) -> Address {
        Address::joint(number).expect("a joint")
    }

    #[test]
    fn a_log_is_filtered_by_fields_without_reading_the_text() {
        let latched = Event::from(Cause::Board {
            board: joint(3),
            change: BoardChange::FaultLatched(Fault::SensorRange),
        });
        let sample = latched.sample();
        assert_eq!(
            (sample.kind, sample.code, &*sample.detail),
            (EventKind::Fault, EventCode::FaultLatched, "sensor_range")
        );
        assert_eq!((sample.board, sample.fault, sample.command), (3, 32, 0));
        assert!(sample.text.starts_with("joint 3: The position sensor"));

        let ticket = Ticket {
            client: 0,
            id: 7,
            code: CommandCode::SaveParameters,
        };
        let reason = Refusal::NodeBusy { node: 8 };
        let refused = Event::from(Cause::Master(MasterEvent::Refused { ticket, reason }));
        let sample = refused.sample();
        assert_eq!(
            (sample.kind, sample.code, &*sample.detail),
            (EventKind::Command, EventCode::CommandRefused, "board_busy")
        );
        assert_eq!((sample.board, sample.command), (8, 0x0132));

        let ready = Cause::Master(MasterEvent::NodeReady(1));
        let sample = Event::of_start_up(ready, 5_000).sample();
        assert_eq!(
            (sample.code, sample.start_up_us),
            (EventCode::BoardReady, 5_000)
        );
        assert!(sample.text.starts_with("start-up, 0.005 s after power-up"));
    }

    #[test]
    fn faults_are_named_wherever_they_are_told() {
        let node = 4;
        let faults = FaultBits::from(Fault::FollowingError)
            .with(Fault::NoMotion)
            .raw();
        let hold = Cause::Master(MasterEvent::Hold(HoldReason::NodeFault { node, faults }));
        assert!(hold.is_hold() && hold.kind() == EventKind::Fault);
        assert_eq!(hold.board(), Some(joint(4)));
        assert_eq!(hold.fault_code(), Some(Fault::FollowingError.code()));
        let entry = |event, a| {
            let entry = LogEntry {
                time_us: 1,
                event,
                a,
                b: 0,
            };
            Cause::Master(MasterEvent::Log { node, entry })
        };
        let logged = entry(LogEvent::Fault, Fault::LinkLost.code());
        assert_eq!(
            (logged.kind(), logged.fault_code()),
            (EventKind::Log, Some(1))
        );
        // A record that requires action is more than a log record.
        let late = entry(LogEvent::PrechargeLate, 0);
        assert_eq!(late.kind(), EventKind::Fault);
        assert_eq!(
            (late.fault_code(), &*late.detail()),
            (None, "precharge_late")
        );
    }

    #[test]
    fn findings_have_details_of_their_own() {
        let detail = |finding| {
            Cause::Master(MasterEvent::Found {
                node: None,
                finding,
            })
            .detail()
        };
        assert_eq!(detail(Finding::SlotBabble), "slot_babble");
        let mut all: Vec<String> = Finding::ALL.iter().map(|f| detail(*f)).collect();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), Finding::ALL.len());
    }
}
