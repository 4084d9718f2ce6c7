//! Determines the progress of a campaign from its files alone.

use std::collections::BTreeSet;
use std::path::PathBuf;

use crate::CampaignError;
use crate::attempts::Attempts;
use crate::causes::Causes;
use crate::part::{self, NotAPart};
use crate::row::{Status, is_failed};
use crate::shard::Shard;
use crate::store::Store;

/// State of a campaign's folder.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Cases of the plan, or of the shard.
    pub cases: u64,
    /// Cases with a row.
    pub rows: u64,
    /// Of these, rows in files of unfinished blocks.
    pub partial: u64,
    /// Cases without a row that a process has begun and not ended: it is still running them, or died in them.
    pub begun: u64,
    /// Cases that have ended but whose row is in no file: their process has not saved it yet, or was killed
    /// before it could.
    pub unsaved: u64,
    /// Cases of both kinds whose process is known to be dead: the next run repeats them.
    pub lost: u64,
    /// Whether a process is known to be working on them.
    pub is_running: bool,
    /// Rows that missed a required target or have no result.
    pub failed: u64,
    /// Why these cases failed.
    pub causes: Causes,
    /// Rows by [`Status::ALL`].
    pub by_status: [u64; 5],
    /// Blocks without a part.
    pub missing: Vec<u64>,
    /// Parts that are unreadable or foreign, and why.
    pub bad: Vec<(PathBuf, String)>,
    /// Files of the whole folder that nobody reads: those of processes that were killed, and temporary files
    /// of other computers, which may still be writing them.
    pub leftovers: Vec<PathBuf>,
}

/// Reads the parts of a shard.
///
/// # Errors
/// [`CampaignError::Unreadable`] if the rows of a part have a form unknown to this program.
pub fn status(store: &Store, shard: Shard) -> Result<State, CampaignError> {
    let mut state = State {
        cases: 0,
        rows: 0,
        partial: 0,
        begun: 0,
        unsaved: 0,
        lost: 0,
        is_running: false,
        failed: 0,
        causes: Causes::default(),
        by_status: [0; 5],
        missing: Vec::new(),
        bad: Vec::new(),
        leftovers: store.leftovers(),
    };
    // Most of a million blocks may not exist, so the folder is listed only once.
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
                let mut tables = Vec::new();
                for path in store.partials(block) {
                    match part::read_table(&path, &store.plan().hash) {
                        Ok(table) => tables.push(table),
                        // Its process has replaced it meanwhile.
                        Err(NotAPart::Missing) => {}
                        Err(NotAPart::Torn(why) | NotAPart::Foreign(why)) => {
                            state.bad.push((path, why));
                        }
                    }
                }
                tables
            }
        };
        let unfinished = state.missing.last() == Some(&block);
        let mut seen = BTreeSet::new();
        for table in &tables {
            let why = state.causes.see(table);
            let indices = table.wholes("index").iter();
            let rows = indices
                .zip(table.texts("status"))
                .zip(table.flags("passed"));
            for (at, ((index, status), passed)) in rows.enumerate() {
                if !seen.insert(*index) {
                    continue;
                }
                state.rows += 1;
                state.partial += u64::from(unfinished);
                state.failed += u64::from(is_failed(*passed));
                state.causes.add_seen(&why, at);
                let known = status.as_deref().and_then(Status::named);
                if let Some(known) = known {
                    state.by_status[known as usize] += 1;
                }
            }
        }
        if unfinished {
            let attempts = Attempts::read(store.attempts(block));
            let open = attempts.all();
            for (_, known) in open.filter(|(case, _)| !seen.contains(&i64::try_from(*case).ok())) {
                state.lost += u64::from(known.lives == Some(false));
                state.is_running |= known.lives == Some(true);
                if known.open > 0 {
                    state.begun += 1;
                } else {
                    state.unsaved += 1;
                }
            }
        }
    }
    Ok(state)
}
