//! The published schemas of all summaries.

use serde_json::Value;

use crate::study::schema::schema;

/// Every schema with its name. `docs/reference/schema` has them as files.
#[must_use]
pub fn schemas() -> Vec<(&'static str, Value)> {
    vec![
        schema::<crate::run::Summary>(),
        schema::<crate::compare::Cases<'static>>(),
        schema::<crate::bench::BenchSummary>(),
        schema::<crate::tune::Summary<'static>>(),
        schema::<crate::delay::Summary<'static>>(),
        schema::<crate::matrix::Summary<'static>>(),
        schema::<crate::figures::Summary<'static>>(),
        schema::<crate::identify::Summary<'static>>(),
    ]
}
