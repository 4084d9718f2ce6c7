//! The fault matrix (host-sim/FAULTS.md): a table of what can go wrong with what must
//! come of it, run on the simulated robot and held against what was measured.
//!
//! * [`row`], [`rows`]: the table; [`expected`]: what the user must be told;
//! * [`run`]: one run per row;
//! * [`measure`]: latencies, latching, deviation, messages;
//! * [`judge`]: measured against expected;
//! * [`page`]: report and JSON.

mod expected;
mod judge;
mod measure;
mod page;
mod row;
mod rows;
mod run;

use std::path::{Path, PathBuf};

use indicatif::{ProgressBar, ProgressStyle};

pub use expected::Expected;
pub use judge::{AfterAll, Outcome, Verdict};
pub use measure::Measured;
pub use row::{Expect, Phase, Row, Since, Stop, Strike, Variant};
pub use rows::ROWS;
pub use run::{run, select};

use crate::StudyError;
use wheeleg_report::output;

/// What came of a run of the matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct Finished {
    /// Rows in the order of the table.
    pub outcomes: Vec<Outcome>,
    /// Contents of `summary.json`.
    pub summary: serde_json::Value,
    /// The page.
    pub report: PathBuf,
}

impl Finished {
    /// Whether no row that was run failed.
    #[must_use]
    pub fn passed(&self) -> bool {
        count(&self.outcomes, Verdict::Fail) == 0
    }
}

/// Rows that came out so.
#[must_use]
pub fn count(outcomes: &[Outcome], verdict: Verdict) -> usize {
    outcomes.iter().filter(|o| o.verdict == verdict).count()
}

/// Runs rows and writes `report.html` and `summary.json` into `folder`. Results of an
/// earlier run in it are set aside in its folders `previous`, `previous-2`, …
///
/// # Errors
/// [`StudyError`] if a run without a fault fails or something cannot be written.
pub fn write(rows: &[&'static Row], seed: u64, folder: &Path) -> Result<Finished, StudyError> {
    output::prepare(folder)?;
    let bar = progress_bar(rows.len() as u64);
    let outcomes = run(rows, seed, &|row| {
        bar.inc(1);
        bar.set_message(row.id);
    });
    bar.finish_and_clear();
    let outcomes = outcomes?;
    let summary = page::summary(&outcomes, seed);
    let save = |name: &str, text: String| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|e| StudyError::output("write", &path, e))?;
        Ok::<_, StudyError>(path)
    };
    save("summary.json", format!("{summary:#}\n"))?;
    let report = save("report.html", page::render(&outcomes, seed)?)?;
    Ok(Finished {
        outcomes,
        summary,
        report,
    })
}

fn progress_bar(rows: u64) -> ProgressBar {
    // Draws on stderr, and only if that is a terminal.
    let bar = ProgressBar::new(rows);
    let style = ProgressStyle::with_template("faults {wide_bar} {pos}/{len}  {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::faults::NOT_IMPLEMENTED;

    #[test]
    fn names_are_unique_and_a_wrong_one_is_named() {
        for (i, row) in ROWS.iter().enumerate() {
            assert!(
                ROWS[..i].iter().all(|other| other.id != row.id),
                "{}",
                row.id
            );
        }
        assert_eq!(select(&[]).expect("all").len(), ROWS.len());
        let one = |id: &str| select(&[id.to_owned()]).map(|rows| rows[0].id);
        assert_eq!(one("pot-open").expect("a row"), "pot-open");
        let unknown = one("pot-opn").expect_err("no row").to_string();
        assert!(unknown.contains("did you mean `pot-open`"), "{unknown}");
        let group = one("pot-frozen").expect_err("a group").to_string();
        assert!(
            group.contains("`pot-frozen/lowering`, `pot-frozen/reach`"),
            "{group}"
        );
        let twice = ["pot-open", "pot-short", "pot-open"].map(str::to_owned);
        let once = select(&twice).expect("rows");
        let ids: Vec<&str> = once.iter().map(|row| row.id).collect();
        assert_eq!(ids, ["pot-open", "pot-short"]);
        let refused = one("ui-replay").expect_err("not implemented").to_string();
        assert!(refused.contains("not implemented"), "{refused}");
    }

    /// Rows that cannot be run are the faults that cannot be injected, in their order.
    #[test]
    fn rows_and_faults_that_are_not_implemented_are_the_same() {
        let missing = ROWS
            .iter()
            .filter(|row| row.expect == Expect::NotImplemented);
        let ids: Vec<&str> = missing.map(|row| row.id).collect();
        let listed: Vec<&str> = NOT_IMPLEMENTED.iter().map(|(id, _)| *id).collect();
        assert_eq!(ids, listed);
    }

    /// A second board at an address is found as fast as one that is missing.
    #[test]
    fn duplicate_addresses_have_the_limits_of_a_board_that_is_silent() {
        let expected = |id: &str| select(&[id.to_owned()]).expect("a row")[0].expect;
        for place in ["joint", "wheel"] {
            assert_eq!(
                expected(&format!("duplicate-address/{place}")),
                expected(&format!("node-silent/{place}"))
            );
        }
    }
}
