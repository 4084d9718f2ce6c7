//! Dispatcher: admits user commands, finds their layer by code, and answers each with a ticket (ack) or a reason
//! (nack).
//!
//! A command carries a deadline. A late command is refused, on arrival and again when its layer takes it from the
//! queue, so that nothing queued before a stall or a reconnection runs in a burst afterwards. A client numbers its
//! commands in increasing order; a repeated or older number is refused.

use heapless::spsc::Producer;

use crate::command::{Command, CommandCode, Layer};
use crate::layer1::params::ParamError;

/// Number of clients that may send commands.
pub const CLIENTS: usize = 4;
/// Latest deadline that is accepted, µs from now: a command is for the present.
pub const DEADLINE_MAX_US: u64 = 10_000_000;

/// A command with its sender's number and its deadline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Client, 0..4.
    pub client: u8,
    /// Number given by the client, increasing (wraps).
    pub id: u32,
    /// Latest master time at which the command may begin, µs.
    pub deadline_us: u64,
    /// The command.
    pub command: Command,
}

/// Receipt for an accepted command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ticket {
    /// Client that sent it.
    pub client: u8,
    /// Its number.
    pub id: u32,
    /// Code of the command.
    pub code: CommandCode,
}

/// Why a command is refused on arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reject {
    /// The deadline has passed.
    Expired {
        /// By how much, µs.
        late_us: u64,
    },
    /// The deadline is more than [`DEADLINE_MAX_US`] ahead.
    DeadlineTooFar,
    /// The client has sent this number before.
    Duplicate,
    /// The client has sent a higher number before.
    OutOfOrder {
        /// Highest number seen.
        last: u32,
    },
    /// No such client.
    UnknownClient,
    /// The queue of the layer is full.
    QueueFull {
        /// Which layer.
        layer: Layer,
    },
    /// The command does not fit the present state or its arguments are wrong.
    Refused(
        /// Why.
        Refusal,
    ),
}

/// Why a command does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Taken from the queue after its deadline.
    Expired,
    /// The command needs control, which this client does not have.
    NotInControl,
    /// The command needs armed axes.
    NotArmed,
    /// The command needs disarmed axes.
    NotDisarmed,
    /// Layer 1 is moving the robot.
    Moving,
    /// No gait is running.
    NotMoving,
    /// The robot is not settled in the start pose of the parameters.
    NotAtStart,
    /// An E-stop or HOLD is latched: clear it first.
    Latched,
    /// The supply-pressure switch is open: wait until there is pressure (after an E-stop, until the reservoir is filled
    /// again), then try again.
    NoAir,
    /// A node has not been heard.
    NodeMissing {
        /// Bus address.
        node: u8,
    },
    /// A node uses another version of the interface.
    SchemaMismatch {
        /// Bus address.
        node: u8,
        /// The master's schema hash.
        master: u64,
        /// The node's schema hash.
        theirs: u64,
    },
    /// A node is at an address strapped for another role.
    WrongRole {
        /// Bus address.
        node: u8,
    },
    /// Two boards answer at one address: set the address straps so that every board
    /// has its own, then restart the boards.
    DuplicateAddress {
        /// Bus address.
        node: u8,
    },
    /// A node is not the board that was commissioned at its address.
    ForeignBoard {
        /// Bus address.
        node: u8,
    },
    /// There is no board with this number.
    NoSuchBoard {
        /// Number given.
        node: u8,
    },
    /// A node has an active fault.
    NodeFault {
        /// Bus address.
        node: u8,
        /// Active fault bits.
        faults: u16,
    },
    /// A node was reset meanwhile: it is unknown whether the command was carried out.
    NodeReset {
        /// Bus address.
        node: u8,
    },
    /// A node refused.
    NodeRefused {
        /// Bus address.
        node: u8,
        /// Its reason.
        reason: wheeleg_protocol::NackReason,
    },
    /// A node stayed busy through all retries.
    NodeBusy {
        /// Bus address.
        node: u8,
    },
    /// A node did not answer after all retries.
    NoAnswer {
        /// Bus address.
        node: u8,
    },
    /// All nodes acknowledged arming, but not all show a closed loop.
    NotConfirmed,
    /// There is no such joint.
    NoSuchJoint {
        /// Number given.
        joint: u8,
    },
    /// A parameter is invalid.
    Parameter(
        /// Which, and its limits.
        ParamError,
    ),
    /// A walk needs wheels that follow the master's references; those of this robot make profiles of their own.
    WheelsNotStreamed,
    /// Another command of this kind is still being carried out.
    Busy,
    /// An E-stop or HOLD intervened.
    Interrupted,
    /// The start pose was not reached in time.
    NotSettled {
        /// First joint (1..=6) out of tolerance.
        joint: u8,
    },
}

/// A command on its way to a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accepted {
    /// Its receipt.
    pub ticket: Ticket,
    /// Latest time at which it may begin, µs.
    pub deadline_us: u64,
    /// The command.
    pub command: Command,
}

impl Accepted {
    /// Whether the deadline has passed at `now_us`.
    #[must_use]
    pub const fn expired(&self, now_us: u64) -> bool {
        now_us > self.deadline_us
    }
}

/// Admission and routing of commands.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dispatcher {
    last: [Option<u32>; CLIENTS],
}

impl Dispatcher {
    /// No client has sent anything yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            last: [None; CLIENTS],
        }
    }

    /// Forgets the command numbers of a client that reconnects.
    pub fn open_session(&mut self, client: u8) {
        if let Some(last) = self.last.get_mut(usize::from(client)) {
            *last = None;
        }
    }

    /// Checks number and deadline, and consumes the number.
    ///
    /// A number is consumed even if the command is refused later: a client that tries again sends a new command with a
    /// new number. An E-stop of a known client is never refused.
    ///
    /// # Errors
    /// See [`Reject`].
    pub fn admit(&mut self, request: &Request, now_us: u64) -> Result<Accepted, Reject> {
        let last = self
            .last
            .get_mut(usize::from(request.client))
            .ok_or(Reject::UnknownClient)?;
        let accepted = Accepted {
            ticket: Ticket {
                client: request.client,
                id: request.id,
                code: request.command.code(),
            },
            deadline_us: request.deadline_us,
            command: request.command,
        };
        if matches!(request.command, Command::EmergencyStop) {
            // A stop is obeyed however old, repeated or overtaken it is; a number behind the last one does not set the
            // count back.
            let ahead = last.is_none_or(|seen| request.id.wrapping_sub(seen) <= u32::MAX >> 1_u32);
            if ahead {
                *last = Some(request.id);
            }
            return Ok(accepted);
        }
        if let Some(seen) = *last {
            let ahead = request.id.wrapping_sub(seen);
            if ahead == 0 {
                return Err(Reject::Duplicate);
            }
            if ahead > u32::MAX >> 1_u32 {
                return Err(Reject::OutOfOrder { last: seen });
            }
        }
        *last = Some(request.id);
        if now_us > request.deadline_us {
            return Err(Reject::Expired {
                late_us: now_us.saturating_sub(request.deadline_us),
            });
        }
        if request.deadline_us.saturating_sub(now_us) > DEADLINE_MAX_US {
            return Err(Reject::DeadlineTooFar);
        }
        Ok(accepted)
    }

    /// Passes an admitted command to the queue of its layer.
    ///
    /// # Errors
    /// [`Reject::QueueFull`] with the layer.
    pub fn route(
        accepted: Accepted,
        layer0: &mut Producer<'_, Accepted>,
        layer1: &mut Producer<'_, Accepted>,
    ) -> Result<Ticket, Reject> {
        let layer = accepted.ticket.code.layer();
        let stored = match layer {
            Layer::Zero => layer0.enqueue(accepted),
            Layer::One => layer1.enqueue(accepted),
        };
        stored
            .map(|()| accepted.ticket)
            .map_err(|_full| Reject::QueueFull { layer })
    }
}
