//! Kinds and codes of events: closed lists whose names in the log stay the same from version to
//! version.

/// Kind of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum EventKind {
    /// For information.
    #[default]
    Info,
    /// The scenario acted (master killed, E-stop pressed).
    Scenario,
    /// A user command was given or answered.
    Command,
    /// A node or the master changed its mode.
    Mode,
    /// A fault was latched or cleared, or something is to be mended.
    Fault,
    /// A foot touched or left the ground.
    Contact,
    /// A record of a board's own log.
    Log,
}

impl EventKind {
    /// All of them.
    const ALL: [Self; 7] = [
        Self::Info,
        Self::Scenario,
        Self::Command,
        Self::Mode,
        Self::Fault,
        Self::Contact,
        Self::Log,
    ];

    /// The kind of this name, as logged.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Whether such events are many, and matter only to whoever looks for a cause in them: a foot touches the ground
    /// and leaves it a dozen times in a step.
    #[must_use]
    pub const fn is_detail(self) -> bool {
        matches!(self, Self::Log | Self::Contact)
    }

    /// Lower-case name, as logged.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Scenario => "scenario",
            Self::Command => "command",
            Self::Mode => "mode",
            Self::Fault => "fault",
            Self::Contact => "contact",
            Self::Log => "log",
        }
    }
}

macro_rules! codes {
    ($($(#[$default:meta])? $code:ident = $name:literal,)*) => {
        /// What happened, by a name that is stable across versions.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        pub enum EventCode {$(
            #[doc = concat!("`", $name, "`")]
            $(#[$default])?
            $code,
        )*}

        impl EventCode {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$code),*];

            /// Name, as logged.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {$(
                    Self::$code => $name,
                )*}
            }
        }
    };
}

codes! {
    #[default]
    CommandDone = "command_done",
    CommandRefused = "command_refused",
    BoardReady = "board_ready",
    OtherInterface = "other_interface",
    WrongRole = "wrong_role",
    DuplicateAddress = "duplicate_address",
    ForeignBoard = "foreign_board",
    Commissioned = "commissioned",
    Finding = "finding",
    Diagnosis = "diagnosis",
    Link = "link",
    Log = "log",
    LogLost = "log_lost",
    Parameter = "parameter",
    BoardLost = "board_lost",
    BoardBack = "board_back",
    Armed = "armed",
    Disarmed = "disarmed",
    Hold = "hold",
    Homed = "homed",
    HomingFailed = "homing_failed",
    GaitDone = "gait_done",
    TrajectoryDone = "trajectory_done",
    TouchDown = "touch_down",
    FootSwitch = "foot_switch",
    LiftOff = "lift_off",
    Position = "position",
    Overload = "overload",
    TipGuard = "tip_guard",
    EarlyGround = "early_ground",
    LateGround = "late_ground",
    NoGround = "no_ground",
    Bump = "bump",
    LostGround = "lost_ground",
    Slip = "slip",
    BackOff = "back_off",
    Stuck = "stuck",
    LoadShare = "load_share",
    Governor = "governor",
    Mode = "mode",
    FaultLatched = "fault_latched",
    FaultsCleared = "faults_cleared",
    GroundFree = "ground_free",
    GroundContact = "ground_contact",
    CommandAccepted = "command_accepted",
    CommandRejected = "command_rejected",
    CommandUnanswered = "command_unanswered",
    FloodRejected = "flood_rejected",
    MasterKilled = "master_killed",
    EStopPressed = "e_stop_pressed",
    FaultBegins = "fault_begins",
    FaultEnds = "fault_ends",
    ServiceRefused = "service_refused",
    ServiceTaken = "service_taken",
    ServiceUnchanged = "service_unchanged",
    ServiceChanged = "service_changed",
    ServiceNotGiven = "service_not_given",
    LineErrors = "line_errors",
    LineBroken = "line_broken",
    LineMended = "line_mended",
    RunFailed = "run_failed",
}

impl EventCode {
    /// Whether it is what a walk does about the ground, many times in it; what stands in its way is not.
    #[must_use]
    pub const fn is_detail(self) -> bool {
        matches!(
            self,
            Self::TipGuard
                | Self::EarlyGround
                | Self::LateGround
                | Self::LostGround
                | Self::Slip
                | Self::LoadShare
                | Self::Governor
        )
    }

    /// The code of this name, as logged; none of a later version.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|code| code.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::names::snake_case;

    #[test]
    fn kinds_and_codes_are_read_as_they_are_logged() {
        for kind in EventKind::ALL {
            assert_eq!(EventKind::of_name(kind.name()), Some(kind));
        }
        for code in EventCode::ALL {
            assert_eq!(EventCode::of_name(code.name()), Some(*code));
            assert_eq!(snake_case(&format!("{code:?}")), code.name());
        }
        assert_eq!(EventCode::of_name("of_a_later_version"), None);
    }
}
