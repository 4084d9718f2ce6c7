//! The machine-readable summary of a run.

use std::collections::HashMap;

use serde::Serialize;

use crate::analysis::{Analysis, Target};
use wheeleg_config::{RobotConfig, Scenario};
use wheeleg_remote_host::PilSummary;
use wheeleg_telemetry::{EventSample, Recording};

/// Facts about a run that are not in its recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInfo {
    /// Seed used.
    pub seed: u64,
    /// Simulated time, start-up included, s.
    pub simulated_s: f64,
    /// Scenario time in the record, s.
    pub recorded_s: f64,
    /// Wall time of simulation and log, without figures and report, s.
    pub wall_s: f64,
    /// False when the run was stopped before its end.
    pub complete: bool,
    /// What boards outside of this process did, if there were any.
    pub pil: Option<PilSummary>,
}

/// Contents of `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the scenario.
    pub scenario: String,
    /// Name of the robot.
    pub robot: String,
    /// Fingerprint of the robot's parameters (BLAKE3 over name, value and unit,
    /// hexadecimal): tells a changed robot from the original of the same name.
    pub robot_hash: String,
    /// Version of the program.
    pub version: &'static str,
    /// Seed used.
    pub seed: u64,
    /// Faults injected, of the scenario and of the command line.
    pub faults: Vec<String>,
    /// What went wrong and what to do about it, and commands that were not carried out, in order
    /// of time; equal ones of these are one message that tells how many.
    pub messages: Vec<String>,
    /// Determinism hash of the telemetry (BLAKE3, hexadecimal).
    pub hash: String,
    /// Messages that could not be written to the log file.
    pub dropped_messages: u64,
    /// Log and tables that could not be written to their end, and why; not there if all were.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unwritten: Vec<String>,
    /// Simulated time, start-up included, s.
    pub simulated_s: f64,
    /// Scenario time in the record, s.
    pub recorded_s: f64,
    /// Wall time of simulation and log, without figures and report, s.
    pub wall_s: f64,
    /// Simulated over wall time.
    pub realtime_factor: f64,
    /// False when the run was stopped before its end.
    pub complete: bool,
    /// Whether every required target is met.
    pub passed: bool,
    /// Targets with values and verdicts.
    pub targets: Vec<Target>,
    /// Boards outside of this process and their comparison, if there were any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pil: Option<PilSummary>,
}

/// Whether a user's command, or a service tool's, came to nothing. The record has the answers to
/// all commands as one kind of event; only the words tell a refusal.
fn is_refusal(event: &EventSample) -> bool {
    let words = ["refused", "refuses", "nobody answers"];
    event.kind == "command" && words.iter().any(|word| event.text.contains(word))
}

/// Faults, findings and refusals as the user reads them, with their time. A user who asks for the
/// same again and again gets one line, at the time of the first refusal.
fn messages(recording: &Recording) -> Vec<String> {
    let mut counts: HashMap<&str, usize> = HashMap::new();
    for event in recording.events.iter().filter(|e| is_refusal(&e.v)) {
        *counts.entry(&event.v.text).or_default() += 1;
    }
    let told = recording.events.iter().filter_map(|e| {
        let line = format!("{:.3} s: {}", e.t_s(), e.v.text);
        if e.v.kind == "fault" {
            return Some(line);
        }
        // Taken out with the first, so that the others find none.
        let count = is_refusal(&e.v).then(|| counts.remove(e.v.text.as_str()));
        match count.flatten()? {
            1 => Some(line),
            n => Some(format!("{line} ({n} times)")),
        }
    });
    let mut lines: Vec<String> = told.collect();
    if recording.events_left_out > 0 {
        lines.push(format!(
            "{} later events are in the log and the tables alone",
            recording.events_left_out
        ));
    }
    lines
}

impl Summary {
    /// Collects the summary of a run.
    #[must_use]
    pub fn new(
        scenario: &Scenario,
        robot: &RobotConfig,
        recording: &Recording,
        analysis: &Analysis,
        info: RunInfo,
    ) -> Self {
        Self {
            scenario: scenario.name.clone(),
            robot: robot.name.clone(),
            robot_hash: robot.fingerprint(),
            version: env!("CARGO_PKG_VERSION"),
            seed: info.seed,
            faults: scenario.faults.iter().map(ToString::to_string).collect(),
            messages: messages(recording),
            hash: recording.hash.clone(),
            dropped_messages: recording.dropped,
            unwritten: Vec::new(),
            simulated_s: info.simulated_s,
            recorded_s: info.recorded_s,
            wall_s: info.wall_s,
            realtime_factor: info.simulated_s / info.wall_s.max(1e-9),
            complete: info.complete,
            passed: info.complete && analysis.passed(),
            pil: info.pil,
            targets: analysis.targets.clone(),
        }
    }

    /// As indented JSON with a final newline.
    #[must_use]
    pub fn to_json(&self) -> String {
        // A struct of numbers and texts always serialises.
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_telemetry::Row;

    #[test]
    fn faults_are_all_told_and_equal_refusals_once_with_their_number() {
        let mut recording = Recording::default();
        for (ms, kind, text) in [
            (1, "command", "Arm: accepted"),
            (2, "command", "JointReference refused: the robot is moving"),
            (3, "fault", "joint 1: a thing"),
            (4, "command", "JointReference refused: the robot is moving"),
            (5, "fault", "joint 1: a thing"),
            (6, "command", "master: Arm refused: a stop came between"),
            (7, "info", "nothing is refused"),
        ] {
            recording.events.push(Row {
                t_ns: ms * 1_000_000,
                v: EventSample {
                    kind: kind.to_owned(),
                    text: text.to_owned(),
                },
            });
        }
        let expected = [
            "0.002 s: JointReference refused: the robot is moving (2 times)",
            "0.003 s: joint 1: a thing",
            "0.005 s: joint 1: a thing",
            "0.006 s: master: Arm refused: a stop came between",
        ];
        assert_eq!(messages(&recording), expected);
    }
}
