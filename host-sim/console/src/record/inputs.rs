//! The file `inputs.jsonl` of a recording: a line of JSON for each input of the robot.
//!
//! `ms` is the simulated time since power-up that the robot had reached; lines with the same `ms` are in the
//! order in which it took them.

use serde::{Deserialize, Serialize};

use super::Given;
use wheeleg_access::request::Spoken;

/// Longest line: a client's frame and its envelope.
pub(crate) const LINE_MAX: usize = 8 * 1024;

/// A line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Line {
    /// Simulated time, ms.
    pub(crate) ms: u64,
    /// The input.
    #[serde(flatten)]
    pub(crate) input: Input,
}

/// An input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Input {
    /// The operator has seen the robot's state of this time, µs.
    Beat(u64),
    /// A stop, by its number.
    Stop(u32),
    /// A command of the operator.
    Command(CommandInput),
    /// A fault begins.
    FaultBegins(String),
    /// A fault ends.
    FaultEnds(String),
    /// The pace changes. The robot does not notice; recorded for readers.
    Pace(PaceInput),
    /// Control was revoked. The robot then acts by itself, as beats stop coming; recorded for readers.
    Revoked(RevokedInput),
    /// Hash of everything so far.
    Hash(String),
}

/// A command of the operator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct CommandInput {
    /// Number of the request.
    pub(crate) id: u32,
    /// Master time by which it must begin, µs.
    pub(crate) deadline_us: u64,
    /// The command.
    pub(crate) spoken: Spoken,
    /// Name of the client that takes control; recorded for readers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) by: Option<String>,
}

/// Pace of the clock.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct PaceInput {
    /// Ratio of simulated to wall time; none: as fast as possible.
    pub(crate) speed: Option<f64>,
    /// It is paused.
    pub(crate) paused: bool,
}

/// Whose control was revoked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct RevokedInput {
    /// Name of the client that was in control, or had asked for it.
    pub(crate) holder: String,
    /// Name of the client that revoked it.
    pub(crate) by: String,
}

impl Line {
    pub(super) fn new(ms: u64, given: Given) -> Self {
        let input = match given {
            Given::Beat(seen_us) => Input::Beat(seen_us),
            Given::Stop(number) => Input::Stop(number),
            Given::Command {
                id,
                deadline_us,
                spoken,
                by,
            } => Input::Command(CommandInput {
                id,
                deadline_us,
                spoken,
                by,
            }),
            Given::Fault(fault, true) => Input::FaultBegins(fault.untimed()),
            Given::Fault(fault, false) => Input::FaultEnds(fault.untimed()),
            Given::Pace { speed, paused } => Input::Pace(PaceInput { speed, paused }),
            Given::Revoked { holder, by } => Input::Revoked(RevokedInput { holder, by }),
            Given::Hash(hash) => Input::Hash(hash),
        };
        Self { ms, input }
    }

    /// The line with its end.
    pub(super) fn push_to(&self, out: &mut Vec<u8>) {
        // Plain data is valid JSON: this cannot fail.
        if serde_json::to_writer(&mut *out, self).is_ok() {
            out.push(b'\n');
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let spoken =
            serde_json::from_str(r#"{"cmd":"JointReference","args":{"joint":3,"stroke":120.3}}"#);
        let given = [
            Given::Beat(81_230_000),
            Given::Stop(2),
            Given::Command {
                id: 7,
                deadline_us: 81_730_000,
                spoken: spoken.expect("a command"),
                by: Some("tablet".to_owned()),
            },
            Given::Fault("supply-sag=3.25@0s".parse().expect("a fault"), true),
            Given::Fault("pot-open:joint3@0s".parse().expect("a fault"), false),
            Given::Pace {
                speed: None,
                paused: true,
            },
            Given::Revoked {
                holder: "tablet".to_owned(),
                by: "ctl".to_owned(),
            },
            Given::Hash("ab".to_owned()),
        ];
        for given in given {
            let line = Line::new(12, given);
            let mut text = Vec::new();
            line.push_to(&mut text);
            assert_eq!(text.iter().filter(|b| **b == b'\n').count(), 1);
            let read: Line = serde_json::from_slice(&text).expect("a line");
            assert_eq!(read, line);
        }
        let line = Line::new(
            0,
            Given::Fault("supply-sag=3.25@0s".parse().expect("a fault"), true),
        );
        assert_eq!(line.input, Input::FaultBegins("supply-sag=3.25".to_owned()));
    }
}
