//! How far a campaign is, from its files alone.

use std::path::PathBuf;

use crate::CampaignError;
use crate::part;
use crate::row::Status;
use crate::shard::Shard;
use crate::store::Store;

/// What a folder holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct State {
    /// Cases of the plan, or of the shard.
    pub cases: u64,
    /// Cases with a row.
    pub rows: u64,
    /// Of these, in files of blocks that are not finished.
    pub partial: u64,
    /// Rows that missed a required target or have no result.
    pub failed: u64,
    /// Rows by [`Status::ALL`].
    pub by_status: [u64; 5],
    /// Blocks without a part.
    pub missing: Vec<u64>,
    /// Parts that cannot be read or are foreign, and why.
    pub bad: Vec<(PathBuf, String)>,
}

/// Reads the parts of a shard.
///
/// # Errors
/// [`CampaignError::Unreadable`] if a part has no rows that this program knows.
pub fn status(store: &Store, shard: Shard) -> Result<State, CampaignError> {
    let mut state = State {
        cases: 0,
        rows: 0,
        partial: 0,
        failed: 0,
        by_status: [0; 5],
        missing: Vec::new(),
        bad: Vec::new(),
    };
    // Of a million blocks most may not be there: the folder is looked through once.
    let there = store.begun();
    for block in (0..store.blocks()).filter(|block| shard.has(*block)) {
        let cases = store.cases_of(block);
        state.cases += cases.end - cases.start;
        if !there.contains(&block) {
            state.missing.push(block);
            continue;
        }
        let tables = match store.table(block) {
            Ok(Some(table)) => vec![table],
            unfinished => {
                state.missing.push(block);
                if let Err(why) = unfinished {
                    state.bad.push((store.part(block), why));
                }
                let partials = store.partials(block).into_iter();
                partials
                    .filter_map(|path| part::read_table(&path, &store.plan().hash).ok())
                    .collect()
            }
        };
        let mut seen = std::collections::BTreeSet::new();
        for table in tables {
            let indices = table.wholes("index").iter();
            let rows = indices
                .zip(table.texts("status"))
                .zip(table.flags("passed"));
            for ((index, status), passed) in rows {
                if !seen.insert(*index) {
                    continue;
                }
                state.rows += 1;
                state.partial += u64::from(state.missing.last() == Some(&block));
                state.failed += u64::from(*passed != Some(true));
                let known = Status::ALL
                    .iter()
                    .position(|s| Some(s.name()) == status.as_deref());
                if let Some(known) = known {
                    state.by_status[known] += 1;
                }
            }
        }
    }
    Ok(state)
}
