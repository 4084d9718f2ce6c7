//! Computes the row of a case, whatever happens to the case.

use crate::cases::{Case, Cases};
use crate::columns::Column;
use crate::panics::caught;
use crate::row::{self, Figure, Row, Status};
use crate::simulate::Outcome;

/// A function that simulates a case; it returns `None` if it was asked to stop before the end.
pub type Simulate<'a> = &'a (dyn Fn(&Case) -> Option<Outcome> + Sync);

/// Computes the row of a case; returns `None` if it was stopped.
pub(crate) fn row(
    cases: &Cases<'_>,
    index: u64,
    block: u64,
    simulate: Simulate<'_>,
) -> Option<Row> {
    let made = caught(|| {
        let case = cases.case(index);
        let outcome = simulate(&case);
        (case, outcome)
    });
    match made {
        Ok((case, outcome)) => Some(row_of(cases, &case, block, outcome?)),
        Err(message) => {
            // The case itself can be built, so it was its simulation that panicked.
            let case = caught(|| cases.case(index)).ok()?;
            let outcome = Outcome::without(Status::Panic, message);
            Some(row_of(cases, &case, block, outcome))
        }
    }
}

/// The row for a case and its outcome.
pub(crate) fn row_of(cases: &Cases<'_>, case: &Case, block: u64, outcome: Outcome) -> Row {
    let columns = cases.columns();
    let figures = columns.targets.iter().map(|id| {
        let target = outcome.targets.iter().find(|target| target.id == *id);
        let column = columns.all.iter().find(|column| column.name == *id);
        // If another scenario or move has limits and this one has none, there is nothing to meet.
        let others = column.is_some_and(Column::has_limits);
        let judged = target.filter(|target| !others || target.min.or(target.max).is_some());
        Figure {
            value: target.and_then(|target| target.value),
            pass: judged.map(|target| target.pass),
        }
    });
    Row {
        case: case.id,
        index: case.place.index,
        block: case.place.index / block,
        sample: case.place.sample,
        replicate: case.place.replicate,
        seed: case.seed,
        figures: figures.collect(),
        factors: case.values.clone(),
        status: outcome.status,
        error: outcome.error.map(row::shortened),
        log_hash: outcome.log_hash,
        simulated_s: outcome.simulated_s,
        passed: outcome.passed,
    }
}
