//! A row of the matrix: the failure, its time, and the required response.

use super::expected::Expected;
use wheeleg_config::faults::NOT_IMPLEMENTED;

/// When the fault begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// From power-up on.
    PowerUp,
    /// Standing in the start pose.
    Stand,
    /// Up to 0.1 s before the foot is lifted for the second step.
    BeforeLift,
    /// Up to 0.1 s before the foot reaches forward for the second step.
    BeforeReach,
    /// The same before the first step: the axis has not moved since power-up.
    FirstReach,
    /// Foot in the air, between reaching out and lowering.
    Flight,
    /// Up to 0.1 s before the foot is lowered.
    BeforeLower,
    /// The same in the second step.
    SecondLower,
    /// Wheels push the robot over the standing foot.
    Push,
    /// At the very start of the walk.
    Start,
}

impl Phase {
    /// In words.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::PowerUp => "from power-up on",
            Self::Stand => "standing",
            Self::BeforeLift => "walking, before the lift",
            Self::BeforeReach => "walking, before the second reach",
            Self::FirstReach => "walking, before the first reach",
            Self::Flight => "walking, foot in the air",
            Self::BeforeLower => "walking, before the lowering",
            Self::SecondLower => "walking, before the second lowering",
            Self::Push => "walking, wheels push",
            Self::Start => "walking, from the start on",
        }
    }
}

/// A fault of a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowFault {
    /// As on the command line, without the time.
    pub what: &'static str,
    /// Begin after the row's instant, s.
    pub after_s: f64,
    /// Duration, s; infinite: permanent.
    pub lasts_s: f64,
}

/// The required response.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Expect {
    /// Every axis is stopped and stays so.
    Stop(Stop),
    /// The motion continues.
    GoesOn {
        /// Largest deviation of a stroke from the same run without the fault, mm.
        deviation_mm: f64,
    },
    /// The motion goes on, or every axis is stopped and stays so; nothing is done that was not commanded on
    /// the line.
    Degrades,
    /// This board, disarmed, is reset and stays disarmed; nothing else happens.
    Restarts {
        /// Bus address.
        board: u8,
    },
    /// The robot does not arm.
    NoArming,
    /// It cannot be injected ([`NOT_IMPLEMENTED`] says why).
    NotImplemented,
}

/// Limits of a stop, ms after the instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// The axis that the fault affects, by bus address; 0: none, or all.
    pub axis: u8,
    /// First latched fault or the master's HOLD: not before, not after.
    pub detected_ms: [f64; 2],
    /// Valves of the axis commanded shut, its mode safe.
    pub own_ms: f64,
    /// The same of all axes.
    pub all_ms: f64,
    /// Start of the latencies.
    pub since: Since,
}

/// The instant from which latencies count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Since {
    /// The begin of the fault.
    Fault,
    /// The stroke that the board of this joint reads is 2 mm from that of the same run without the fault:
    /// until then, no expected motion is missing.
    Motion(u8),
}

/// The robot of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Variant {
    /// As in the robot file.
    Plain,
    /// With the touch-down reflex on.
    Reflex,
    /// Walks 18 steps, a minute.
    Long,
}

/// A user's request about a board's parameters in a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ask {
    /// Disarm the robot: parameters are stored only then.
    Disarm,
    /// Set a parameter of a joint, by name, to a value in its unit.
    Write(u8, &'static str, f64),
    /// Store a board's parameters.
    Save(u8),
    /// Read a parameter of a joint.
    Read(u8, &'static str),
}

/// Failure of the connection of an operator in control.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Connection {
    /// It is cut.
    Lost,
    /// The robot's messages no longer arrive; the operator's do.
    HalfOpen,
    /// The operator's messages take 0.5 s.
    Slow,
    /// It is cut for 1 s; then the client reconnects and sends 1,000 old commands.
    Reconnects,
    /// Another client sends commands, takes control and sends beats.
    SecondClient,
    /// Frames have a flipped bit, or come under another session's key.
    BadMac,
    /// Frames come twice, in another session, or before their turn.
    Replay,
}

impl Connection {
    /// Whether frames come that must have no effect.
    #[must_use]
    pub const fn has_intruder(self) -> bool {
        !matches!(self, Self::Lost | Self::HalfOpen | Self::Slow)
    }

    /// In words.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::Lost => "operator's line cut",
            Self::HalfOpen => "operator sees nothing new",
            Self::Slow => "operator's line 0.5 s late",
            Self::Reconnects => "operator's line cut for 1 s, 1,000 commands then",
            Self::SecondClient => "second operator",
            Self::BadMac => "forged frames",
            Self::Replay => "repeated frames",
        }
    }
}

/// One row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Its name.
    pub id: &'static str,
    /// The faults.
    pub faults: &'static [RowFault],
    /// The user's requests, s after the instant.
    pub asks: &'static [(f64, Ask)],
    /// Whether the E-stop is pressed 100 ms after the instant; latencies count from then.
    pub estop: bool,
    /// Failure of the connection of an operator, who is in control in such a row.
    pub connection: Option<Connection>,
    /// When.
    pub phase: Phase,
    /// How long the run continues after the instant, s.
    pub after_s: f64,
    /// The robot.
    pub variant: Variant,
    /// The required response.
    pub expect: Expect,
    /// Boards that must keep answering in their slots.
    pub answering: u8,
    /// Largest movement of a held joint in the half second after the stop, mm, if it is judged.
    pub held_mm: Option<f64>,
    /// Messages that the user must get: all of them.
    pub reads: &'static [Expected],
    /// Messages that the user must not get: they would blame a sound part.
    pub silent_about: &'static [Expected],
    /// Remark beyond the numbers.
    pub note: &'static str,
}

impl Row {
    /// Why it cannot be run, if it cannot.
    #[must_use]
    pub fn not_implemented(&self) -> Option<&'static str> {
        if self.connection.is_some() {
            return None;
        }
        let listed = NOT_IMPLEMENTED.iter().find(|(id, _)| *id == self.id);
        listed.map(|(_, reason)| *reason)
    }
}

/// A run continues for this long after the instant, s.
const AFTER_S: f64 = 2.0;

/// A permanent fault.
pub(super) const FOR_GOOD: f64 = f64::INFINITY;

/// A row of the matrix.
pub(super) const fn row(
    id: &'static str,
    faults: &'static [RowFault],
    phase: Phase,
    expect: Expect,
    reads: &'static [Expected],
) -> Row {
    Row {
        id,
        faults,
        asks: &[],
        estop: false,
        connection: None,
        phase,
        after_s: AFTER_S,
        variant: Variant::Plain,
        expect,
        answering: 0,
        held_mm: None,
        reads,
        silent_about: &[],
        note: "",
    }
}

/// A row that cannot be run.
pub(super) const fn missing(id: &'static str) -> Row {
    row(id, &[], Phase::Stand, Expect::NotImplemented, &[])
}

impl Row {
    pub(super) const fn noted(mut self, note: &'static str) -> Self {
        self.note = note;
        self
    }

    pub(super) const fn silent_about(mut self, messages: &'static [Expected]) -> Self {
        self.silent_about = messages;
        self
    }

    pub(super) const fn lasting(mut self, after_s: f64) -> Self {
        self.after_s = after_s;
        self
    }

    pub(super) const fn of(mut self, variant: Variant) -> Self {
        self.variant = variant;
        self
    }

    pub(super) const fn answering(mut self, boards: u8) -> Self {
        self.answering = boards;
        self
    }

    pub(super) const fn holding(mut self, held_mm: f64) -> Self {
        self.held_mm = Some(held_mm);
        self
    }

    pub(super) const fn asking(mut self, asks: &'static [(f64, Ask)]) -> Self {
        self.asks = asks;
        self
    }

    pub(super) const fn of_connection(mut self, connection: Connection) -> Self {
        self.connection = Some(connection);
        self
    }

    pub(super) const fn with_estop(mut self) -> Self {
        self.estop = true;
        self
    }
}

/// A fault that begins at the instant.
pub(super) const fn at(what: &'static str, lasts_s: f64) -> RowFault {
    RowFault {
        what,
        after_s: 0.0,
        lasts_s,
    }
}

/// A stop of all axes, none of them affected itself.
pub(super) const fn stop(detected_ms: [f64; 2], all_ms: f64) -> Expect {
    Expect::Stop(Stop {
        axis: 0,
        detected_ms,
        own_ms: all_ms,
        all_ms,
        since: Since::Fault,
    })
}

/// A stop of one axis by its own board, of the others by the master.
pub(super) const fn stop_axis(axis: u8, detected_ms: [f64; 2], own_ms: f64, all_ms: f64) -> Expect {
    Expect::Stop(Stop {
        axis,
        detected_ms,
        own_ms,
        all_ms,
        since: Since::Fault,
    })
}

/// A stop within 200 ms of 2 mm of expected motion of an axis.
pub(super) const fn stop_moving(axis: u8) -> Expect {
    Expect::Stop(Stop {
        axis,
        detected_ms: [-150.0, 200.0],
        own_ms: 203.0,
        all_ms: 240.0,
        since: Since::Motion(axis),
    })
}
