//! The robot's inputs as samples of the channel `/session`, for viewers. A recording's `inputs.jsonl` holds
//! them in full, for a repetition.

use std::fmt::Write as _;

use wheeleg_master::command::CommandCode;
use wheeleg_telemetry::SessionSample;

use super::Given;
use crate::live::PaceStatus;

impl Given {
    /// The sample; none for beats, which come 20 times a second, and for hashes, which are not inputs.
    pub(crate) fn sample(&self, pace: &PaceStatus) -> Option<SessionSample> {
        let mut sample = SessionSample {
            speed: pace.speed.unwrap_or(f64::NAN),
            paused: pace.paused,
            ..SessionSample::default()
        };
        let (kind, text) = match self {
            Self::Beat(_) | Self::Hash(_) => return None,
            Self::Stop(_) => ("stop", "stop".to_owned()),
            Self::Command { spoken, by, .. } => {
                sample.command = CommandCode::of_name(&spoken.cmd).map_or(0, |code| code as u16);
                sample.by = by.clone().unwrap_or_default();
                let mut text = spoken.cmd.clone();
                for (name, value) in &spoken.args {
                    // Writing into a text cannot fail.
                    let _ = match value.as_str() {
                        Some(word) => write!(text, " {name}={word}"),
                        None => write!(text, " {name}={value}"),
                    };
                }
                ("command", text)
            }
            Self::Fault(fault, begins) => {
                sample.fault = fault.untimed();
                let (kind, what) = match begins {
                    true => ("fault_begins", "begins"),
                    false => ("fault_ends", "ends"),
                };
                (kind, format!("{} {what}", sample.fault))
            }
            Self::Revoked { holder, by } => {
                sample.by.clone_from(by);
                let text = format!("{by} has revoked control from {holder}");
                ("revoked", text)
            }
            Self::Pace { .. } if pace.paused => ("pace", "the clock is paused".to_owned()),
            Self::Pace { speed, .. } => {
                let text = match speed {
                    Some(speed) => format!("the clock runs at {speed} times real time"),
                    None => "the clock runs as fast as it can".to_owned(),
                };
                ("pace", text)
            }
        };
        sample.kind = kind.to_owned();
        sample.text = text;
        Some(sample)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_told_with_their_arguments_and_beats_are_not_told() {
        let pace = PaceStatus {
            speed: Some(2.0),
            ..PaceStatus::default()
        };
        let of = |given: Given| given.sample(&pace).expect("a sample");
        let spoken = r#"{"cmd":"JointReference","args":{"joint":3,"stroke":120.5,"leg":"left"}}"#;
        let command = of(Given::Command {
            id: 7,
            deadline_us: 1,
            spoken: serde_json::from_str(spoken).expect("a command"),
            by: Some("tablet".to_owned()),
        });
        assert_eq!(command.kind, "command");
        assert_eq!(command.command, 0x0101);
        assert_eq!(command.by, "tablet");
        assert_eq!(command.text, "JointReference joint=3 leg=left stroke=120.5");
        assert_eq!((command.speed, command.paused), (2.0, false));
        let fault = of(Given::Fault(
            "supply-sag=3.25@0s".parse().expect("a fault"),
            false,
        ));
        assert_eq!(fault.kind, "fault_ends");
        assert_eq!(fault.fault, "supply-sag=3.25");
        assert_eq!(of(Given::Stop(1)).kind, "stop");
        let revoked = of(Given::Revoked {
            holder: "tablet".to_owned(),
            by: "ctl".to_owned(),
        });
        assert_eq!((&*revoked.kind, &*revoked.by), ("revoked", "ctl"));
        assert!(revoked.text.contains("tablet"), "{}", revoked.text);
        assert!(Given::Beat(1).sample(&pace).is_none());
        assert!(Given::Hash(String::new()).sample(&pace).is_none());
    }
}
