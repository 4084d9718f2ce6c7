//! JSON that the commands of campaigns print, `plan.json` and the summary of the field tests, with their published schemas.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use wheeleg_studies::study::schema::{Form, of_file, of_form, schema};

use crate::report::{Findings, Pairs};
use crate::store::{FORMAT, PlanFile};
use crate::{Cause, Merged, State, Status};

/// Number of causes listed; any others are only counted.
pub const CAUSES: usize = 20;

/// What `wheeleg campaign status --json` prints: a line of JSON.
#[derive(Debug, Serialize, JsonSchema)]
pub struct StatusForm {
    /// Cases of the plan, or of the shard.
    pub cases: u64,
    /// Cases with a row.
    pub rows: u64,
    /// Of these, rows in files of unfinished blocks.
    pub partial: u64,
    /// Cases without a row that a process has begun.
    pub begun: u64,
    /// Cases that have ended, but whose row is in no file yet.
    pub unsaved: u64,
    /// Cases of both kinds whose process was killed: the next run repeats them.
    pub lost: u64,
    /// Rows that missed a required target or have no result.
    pub failed: u64,
    /// The most frequent causes of these failures.
    pub causes: Vec<CauseForm>,
    /// Number of causes that are not listed.
    pub other_causes: usize,
    /// Rows by status.
    pub status: BTreeMap<&'static str, u64>,
    /// Blocks without a part.
    pub missing_blocks: Vec<u64>,
    /// Parts that cannot be read or belong to another plan.
    pub bad_parts: Vec<BadPart>,
    /// Files that nobody reads: those of processes that were killed, and temporary files of other computers,
    /// which may still be writing them.
    pub leftovers: Vec<String>,
}

/// Why cases failed.
#[derive(Debug, Serialize, JsonSchema)]
pub struct CauseForm {
    /// `missed`, `not-measured`, or the status of cases without a result.
    pub cause: &'static str,
    /// Target that was missed or not measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<String>,
    /// What a case without a result reported.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
    /// Number of cases.
    pub cases: u64,
}

/// A part that is not valid.
#[derive(Debug, Serialize, JsonSchema)]
pub struct BadPart {
    /// Its file.
    pub part: String,
    /// Why.
    pub why: String,
}

impl Form for StatusForm {
    const SCHEMA: &'static str = "wheeleg.campaign-status/1";
}

impl StatusForm {
    /// The status of a folder.
    #[must_use]
    pub fn of(state: &State) -> Self {
        let causes = state.causes.first(CAUSES).into_iter();
        let causes = causes.map(|(cause, cases)| {
            let (cause, target, message) = match cause {
                Cause::NoResult { status, message } => (status.name(), None, Some(message)),
                Cause::Missed { target } => ("missed", Some(target), None),
                Cause::NotMeasured { target } => ("not-measured", Some(target), None),
            };
            CauseForm {
                cause,
                target: target.cloned(),
                message: message.cloned(),
                cases,
            }
        });
        let counts = Status::ALL.iter().zip(state.by_status);
        let bad = state.bad.iter().map(|(path, why)| BadPart {
            part: path.display().to_string(),
            why: why.clone(),
        });
        Self {
            cases: state.cases,
            rows: state.rows,
            partial: state.partial,
            begun: state.begun,
            unsaved: state.unsaved,
            lost: state.lost,
            failed: state.failed,
            causes: causes.collect(),
            other_causes: state.causes.kinds().saturating_sub(CAUSES),
            status: counts.map(|(status, n)| (status.name(), n)).collect(),
            missing_blocks: state.missing.clone(),
            bad_parts: bad.collect(),
            leftovers: (state.leftovers.iter())
                .map(|path| path.display().to_string())
                .collect(),
        }
    }
}

/// What `wheeleg campaign merge --json` prints.
#[derive(Debug, Serialize, JsonSchema)]
pub struct MergeForm {
    /// Rows of the table.
    pub rows: u64,
    /// Cases without a row: 0 unless `--partial` allowed them to be missing.
    pub missing: u64,
    /// BLAKE3 hash over case, status, log hash and the bits of all figures, in the order of the plan.
    pub hash: String,
    /// File of the table.
    pub table: String,
}

impl Form for MergeForm {
    const SCHEMA: &'static str = "wheeleg.campaign-merge/1";
}

impl MergeForm {
    /// The form for a table that was written.
    #[must_use]
    pub fn of(merged: &Merged, table: &Path) -> Self {
        Self {
            rows: merged.rows,
            missing: merged.missing,
            hash: merged.hash.clone(),
            table: table.display().to_string(),
        }
    }
}

/// What `wheeleg campaign report --json` prints.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ReportForm<'a> {
    /// What the table shows.
    pub findings: &'a Findings,
    /// The comparison with the table given by `--against`.
    pub against: Option<&'a Pairs>,
}

impl Form for ReportForm<'_> {
    const SCHEMA: &'static str = "wheeleg.campaign-report/1";
}

/// The published schemas by name.
#[must_use]
pub fn schemas() -> Vec<(&'static str, Value)> {
    let mut plan = of_file::<PlanFile>("wheeleg.campaign-plan/1");
    plan.1["properties"]["format"]["const"] = FORMAT.into();
    vec![
        of_form::<StatusForm>(),
        of_form::<MergeForm>(),
        of_form::<ReportForm<'static>>(),
        plan,
        schema::<crate::field::Summary>(),
    ]
}
