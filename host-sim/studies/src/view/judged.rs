//! What the run of a log was judged by, as its summary beside the log says.

use std::io::Read as _;
use std::path::Path;

use serde::{Deserialize, Serialize};
use wheeleg_config::open_file;
use wheeleg_report::plain::plain;
use wheeleg_report::results::SUMMARY;

use super::content::Content;
use crate::analysis::{asked_text, measured_text};

/// Most bytes of a summary that is read.
const MOST: u64 = 1 << 22;
/// Missed targets that are listed.
const LISTED: usize = 50;

/// Judgement of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Judged {
    /// Required targets.
    pub(super) required: usize,
    /// How many of them were missed.
    pub(super) misses: usize,
    /// Those that were missed, the first of them.
    pub(super) missed: Vec<Missed>,
}

/// A required target that was missed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Missed {
    id: String,
    description: String,
    measured: String,
    asked: String,
}

#[derive(Deserialize)]
struct ReadSummary {
    scenario: String,
    robot: String,
    seed: String,
    complete: bool,
    targets: Vec<ReadTarget>,
}

#[derive(Deserialize)]
struct ReadTarget {
    id: String,
    description: String,
    value: Option<f64>,
    unit: String,
    min: Option<f64>,
    max: Option<f64>,
    pass: bool,
    required: bool,
}

impl Judged {
    /// Of the run of a log; none where no summary of it is beside the log, or the run was stopped.
    pub(super) fn beside(log: &Path, content: &Content) -> Option<Self> {
        let file = open_file(&log.with_file_name(SUMMARY)).ok()?;
        let mut text = String::new();
        file.take(MOST).read_to_string(&mut text).ok()?;
        let summary: ReadSummary = serde_json::from_str(&text).ok()?;
        let same = [
            ("scenario", &summary.scenario),
            ("robot", &summary.robot),
            ("seed", &summary.seed),
        ];
        // Another run may have been written to the folder since. One that was stopped has missed nothing yet.
        let is_other = same
            .iter()
            .any(|(kind, own)| content.about(kind) != Some(own));
        if is_other || !summary.complete {
            return None;
        }
        let required: Vec<&ReadTarget> = summary.targets.iter().filter(|t| t.required).collect();
        let missed: Vec<&&ReadTarget> = required.iter().filter(|t| !t.pass).collect();
        Some(Self {
            required: required.len(),
            misses: missed.len(),
            missed: missed.iter().take(LISTED).map(|t| t.told()).collect(),
        })
    }

    /// The end of a sentence; empty of a run that met all.
    pub(super) fn sentence(&self) -> String {
        match self.misses {
            0 => String::new(),
            n => format!("{n} of {} required targets missed", self.required),
        }
    }
}

impl ReadTarget {
    fn told(&self) -> Missed {
        let measured = measured_text(self.value, &self.unit);
        let asked = asked_text(self.min, self.max, &self.unit);
        let [id, description] = [&self.id, &self.description].map(|text| plain(text));
        Missed {
            id,
            description,
            measured: plain(&measured),
            asked: plain(&asked),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::Target;

    /// What the page of a log says of a target is what the report of its run says.
    #[test]
    fn a_target_is_told_as_in_the_report_of_its_run() {
        for (value, unit, min, max) in [
            (Some(26.5), "s", None, Some(20.0)),
            (Some(2.0), "1", Some(3.0), Some(3.0)),
            (Some(0.000_25), "mm", Some(-0.5), Some(0.5)),
            (Some(-123_456.7), "Pa", Some(0.0), None),
            (None, "mm", None, Some(5.0)),
        ] {
            let target = Target::new("X", "x", value, unit, min, max);
            let text = serde_json::to_string(&target).expect("JSON");
            let read: ReadTarget = serde_json::from_str(&text).expect("a target");
            let told = read.told();
            assert_eq!(
                (told.measured, told.asked),
                (target.measured_text(), target.asked_text())
            );
        }
    }
}
