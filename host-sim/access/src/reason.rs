//! Why a request is refused, by the names of PROTOCOL.md.

use std::fmt;

/// Why a request is refused. Names are stable; texts for people go with them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// The sender does not hold the control.
    NotInControl,
    /// Another holds the control.
    ControlHeld,
    /// `seen_us` is ahead of the master.
    SeenInFuture,
    /// Above the rate, or a queue is full.
    Busy,
    /// A robot command while the simulation is paused.
    Paused,
    /// The control was revoked at the robot's computer.
    Revoked,
    /// The role may not do this.
    Role,
    /// There is no such command, or it has a way of its own.
    BadCommand,
    /// An argument is unknown, missing, of another kind or out of range.
    BadArgument,
    /// There is no such channel.
    UnknownChannel,
    /// Nobody can be in control at this speed.
    TooFast,
    /// The serial adapter is too slow for the bus.
    SlowAdapter,
    /// A recording is under way, or none is, or its files cannot be written.
    Recording,
    /// The master does not answer.
    NoMaster,
    /// The simulation refuses.
    Simulation,
    /// Nobody confirms a stop.
    NotConfirmed,
    /// The master refuses, for the reason that its events name.
    Master(&'static str),
}

impl Reason {
    /// All but the master's.
    pub const ALL: [Self; 16] = [
        Self::NotInControl,
        Self::ControlHeld,
        Self::SeenInFuture,
        Self::Busy,
        Self::Paused,
        Self::Revoked,
        Self::Role,
        Self::BadCommand,
        Self::BadArgument,
        Self::UnknownChannel,
        Self::TooFast,
        Self::SlowAdapter,
        Self::Recording,
        Self::NoMaster,
        Self::Simulation,
        Self::NotConfirmed,
    ];

    /// Its name in answers.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotInControl => "not_in_control",
            Self::ControlHeld => "control_held",
            Self::SeenInFuture => "seen_in_future",
            Self::Busy => "busy",
            Self::Paused => "paused",
            Self::Revoked => "revoked",
            Self::Role => "role",
            Self::BadCommand => "bad_command",
            Self::BadArgument => "bad_argument",
            Self::UnknownChannel => "unknown_channel",
            Self::TooFast => "too_fast",
            Self::SlowAdapter => "slow_adapter",
            Self::Recording => "recording",
            Self::NoMaster => "no_master",
            Self::Simulation => "simulation",
            Self::NotConfirmed => "not_confirmed",
            Self::Master(name) => name,
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// The table in the contract has all reasons of the server, and no others.
    #[test]
    fn the_contract_lists_the_reasons() {
        let contract = include_str!("../../console/PROTOCOL.md");
        let (_, table) = contract.split_once("| `reason` | |\n").expect("the table");
        let rows = table.lines().take_while(|line| line.starts_with('|'));
        let mut listed: BTreeSet<&str> = BTreeSet::new();
        for names in rows.filter_map(|row| row.split('|').nth(1)) {
            listed.extend(names.split('`').skip(1).step_by(2));
        }
        // The master's own; only one of them has a line.
        assert!(listed.remove("expired"));
        let known: BTreeSet<&str> = Reason::ALL.into_iter().map(Reason::name).collect();
        assert_eq!(listed, known);
    }
}
