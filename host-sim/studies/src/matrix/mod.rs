//! The fault matrix (host-sim/FAULTS.md): a table of failures with their required responses, run on the
//! simulated robot and compared with the measurements.
//!
//! * [`row`], [`rows`]: the table; [`expected`]: the messages that the user must get;
//! * [`run`]: one run per row;
//! * [`measure`]: latencies, latching, deviation, messages;
//! * [`judge`]: measurements against requirements;
//! * [`page`], [`summary`]: report and JSON.

mod expected;
mod judge;
mod measure;
mod operator;
mod page;
mod ran;
mod row;
mod rows;
mod run;
mod summary;

pub use expected::Expected;
pub use judge::{AfterAll, Outcome, Verdict};
pub use measure::Measured;
pub use row::{Connection, Expect, Phase, Row, RowFault, Since, Stop, Variant};
pub use rows::ROWS;
pub use run::{run, select};
pub use summary::Summary;

use crate::StudyError;
use crate::study::schema::json;
use crate::study::{Finished, Job, Settings};

/// Rows with this verdict.
#[must_use]
pub fn count(outcomes: &[Outcome], verdict: Verdict) -> usize {
    outcomes.iter().filter(|o| o.verdict == verdict).count()
}

/// Runs rows and writes `report.html` and `summary.json`. The outcomes are in the order of the
/// rows.
///
/// # Errors
/// [`StudyError`] if a run without a fault fails or a result cannot be written.
pub fn write(
    rows: &[&'static Row],
    seed: u64,
    settings: &Settings,
) -> Result<Finished<Vec<Outcome>>, StudyError> {
    let job = Job::begin("faults", settings, &[])?;
    let outcomes = run(rows, seed, &job.progress)?;
    let (done, of) = (outcomes.len() as u64, rows.len() as u64);
    let stopped = job.progress.stopped(done, of, "rows");
    let summary = json(&Summary::new(&outcomes, seed), stopped.as_ref());
    let why = stopped.clone();
    Ok(job.finish(outcomes, summary, stopped, |_, outcomes| {
        (page::render(outcomes, seed, why.as_ref()), Vec::new())
    }))
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
        let refused = one("brown-out/update")
            .expect_err("not implemented")
            .to_string();
        assert!(refused.contains("not implemented"), "{refused}");
    }

    /// Rows that cannot be run, or need an operator at a console, are the faults that cannot be
    /// injected, in their order.
    #[test]
    fn rows_and_faults_that_are_not_implemented_are_the_same() {
        let missing = ROWS
            .iter()
            .filter(|row| row.expect == Expect::NotImplemented || row.connection.is_some());
        let ids: Vec<&str> = missing.map(|row| row.id).collect();
        let listed: Vec<&str> = NOT_IMPLEMENTED.iter().map(|(id, _)| *id).collect();
        assert_eq!(ids, listed);
    }

    /// A second board at an address is found as quickly as a missing one.
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
