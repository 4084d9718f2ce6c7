//! What the run of a log was judged by, as its summary beside the log says.

use std::io::Read as _;
use std::path::Path;

use serde::{Deserialize, Serialize};
use wheeleg_config::open_file;
use wheeleg_report::number::short;
use wheeleg_report::plain::plain;
use wheeleg_report::results::SUMMARY;

use super::content::Content;
use crate::analysis::band_text;

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
        let unit = match self.unit.as_str() {
            "1" => String::new(),
            unit => format!(" {unit}"),
        };
        let measured = match self.value {
            Some(value) => format!("{}{unit}", short(value)),
            None => "not measured".to_owned(),
        };
        let asked = format!("{}{unit}", band_text(self.min, self.max));
        let [id, description] = [&self.id, &self.description].map(|text| plain(text));
        Missed {
            id,
            description,
            measured: plain(&measured),
            asked: plain(&asked),
        }
    }
}
