//! Repeats one case: recomputes its row and writes the full run with log, figures and report; on the bench,
//! the moves with tables, figures and page.

use std::path::{Path, PathBuf};

use wheeleg_config::bench::Bench;
use wheeleg_config::{RobotConfig, Scenario, open_file, word};
use wheeleg_report::plot::ensure_png;
use wheeleg_studies::bench;
use wheeleg_studies::run::run_read;
use wheeleg_studies::study::{Finished, Settings, Stop};

use crate::cases::{Cases, Setup};
use crate::identity::Beginning;
use crate::part::{self, PLAN};
use crate::row::{self, Row, Status};
use crate::simulate::{hash, simulate};
use crate::store::{PlanFile, Store};
use crate::table::TableReader;
use crate::{CampaignError, compute};

/// The result of repeating a case.
#[derive(Debug)]
pub struct Replayed {
    /// The row as computed now.
    pub row: Row,
    /// The previous row, if there is one.
    pub before: Option<Row>,
    /// Program that computed the previous row.
    pub program: String,
    /// Columns in which the new row differs from the previous one, to the bit.
    pub differs: Vec<String>,
    /// Its files; `None` for a case that cannot be simulated.
    pub files: Option<Finished<Files>>,
}

/// What a replay has written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Files {
    /// The kind of recording.
    pub recording: Recording,
    /// Hash of the recording; `None` for a run that was stopped or failed.
    pub hash: Option<String>,
}

/// The recording of a case, which has a hash.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Recording {
    /// The log of a robot.
    Log,
    /// The moves of a cylinder on the bench.
    Moves,
}

impl Replayed {
    /// Whether the new row equals the previous one, to the bit; `None` if there was none.
    #[must_use]
    pub fn same_row(&self) -> Option<bool> {
        self.before.as_ref().map(|_| self.differs.is_empty())
    }

    /// Whether the recording of the full run, a log or moves, has the hash in the row. `None` for a row
    /// without a hash, or for a case that was given up, because its log ends before that of the full run.
    #[must_use]
    pub fn same_recording(&self) -> Option<bool> {
        let files = self.files.as_ref();
        let files = files.filter(|_| self.row.status == Status::Ok)?;
        let hash = self
            .before
            .as_ref()
            .unwrap_or(&self.row)
            .log_hash
            .as_ref()?;
        Some(files.result.hash.as_ref()? == hash)
    }
}

/// Source of the case: a folder of parts, or the table merged from them.
enum From {
    Folder(Box<Store>),
    Table(PathBuf),
}

/// Repeats a case. `from` is the folder of a campaign or its merged table; `case` is an identity, its beginning, or an
/// index in the plan.
///
/// # Errors
/// [`CampaignError::Refused`] if there is no such case; otherwise as for a run.
pub fn replay(
    from: &Path,
    case: &str,
    out: Option<&Path>,
    png: bool,
    stop: &Stop,
) -> Result<Option<Replayed>, CampaignError> {
    if png {
        ensure_png()?;
    }
    let (place, plan_file) = if from.is_dir() {
        let store = Store::open(from)?;
        let plan = store.plan().clone();
        (From::Folder(Box::new(store)), plan)
    } else {
        let plan = plan_of_table(from)?;
        (From::Table(from.to_owned()), plan)
    };
    let plan = plan_file.plan()?;
    let cases = Cases::new(&plan)?;
    let (index, before) = find(&place, &plan_file, case)?;
    let limit_s = plan.limit_s;
    let simulate = |case: &crate::Case| simulate(case, limit_s, stop);
    let Some(row) = compute::row(&cases, index, plan_file.block, &simulate) else {
        return Ok(None);
    };
    let case = cases.case(index);
    let settings = Settings {
        out: out.map_or_else(
            || Path::new("runs").join(format!("{}-{}", plan.name, case.id)),
            Path::to_owned,
        ),
        png,
        stop: stop.clone(),
    };
    let files = match &case.setup {
        Ok(Setup::Robot(both)) => Some(run_again(&both.0, &both.1, case.seed, &settings)?),
        Ok(Setup::Bench(bench)) => play_again(bench, case.seed, &settings)?,
        Err(_) => None,
    };
    let differs = before.as_ref();
    let differs = differs.map(|before| row::differing(cases.columns(), before, &row));
    Ok(Some(Replayed {
        differs: differs.unwrap_or_default(),
        row,
        before,
        program: plan_file.program,
        files,
    }))
}

/// The whole run, with log, figures and report.
fn run_again(
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    settings: &Settings,
) -> Result<Finished<Files>, CampaignError> {
    let run = run_read(scenario, robot, seed, settings)?;
    Ok(run.map(|run| Files {
        recording: Recording::Log,
        hash: run.summary.complete.then_some(run.summary.hash),
    }))
}

/// The moves on the bench, with tables, figures and page; `None` if they cannot be played.
fn play_again(
    bench: &Bench,
    seed: u64,
    settings: &Settings,
) -> Result<Option<Finished<Files>>, CampaignError> {
    // The row says why not.
    let Ok(played) = bench::play(bench, seed) else {
        return Ok(None);
    };
    let written = bench::write(bench, seed, &played, settings)?;
    Ok(Some(written.map(|_| Files {
        recording: Recording::Moves,
        hash: Some(hash(&played)),
    })))
}

/// The plan in a merged table.
pub(crate) fn plan_of_table(path: &Path) -> Result<PlanFile, CampaignError> {
    let file = open_file(path).map_err(|e| CampaignError::Unreadable {
        path: path.to_owned(),
        reason: e.to_string(),
        help: "give a table that `wheeleg campaign merge` has made of a campaign's folder"
            .to_owned(),
    })?;
    let reader = TableReader::new(file).map_err(|e| CampaignError::unreadable(path, e))?;
    // A part has only the hash of its plan.
    let text = reader.fact(PLAN).filter(|text| text.starts_with('{'));
    let text = text.ok_or_else(|| CampaignError::Unreadable {
        path: path.to_owned(),
        reason: "it has no plan".to_owned(),
        help: "give the table of `wheeleg campaign merge`, or the folder of a campaign".to_owned(),
    })?;
    PlanFile::parse(text).map_err(|reason| CampaignError::unreadable(path, reason))
}

/// Index of a case, and its row. The case is a place in the plan, or an identity or its beginning.
fn find(place: &From, plan: &PlanFile, case: &str) -> Result<(u64, Option<Row>), CampaignError> {
    let missing = || {
        CampaignError::refused(
            format!("there is no case `{}`", word(case)),
            format!(
                "give one of the column `case` of a case that has a row, or its first characters (from 4; from 8 if all \
                 are digits), or a place from 0 to {}",
                plan.cases - 1
            ),
        )
    };
    let by_index = case.parse::<u64>().ok();
    if let Some(index) = by_index.filter(|index| *index < plan.cases && case.len() < 32) {
        let row = rows_at(place, Some(index / plan.block))?;
        let row = row.into_iter().find(|row| row.index == index);
        return Ok((index, row));
    }
    let beginning = Beginning::of(case).ok_or_else(missing)?;
    let mut rows = rows_at(place, None)?;
    rows.retain(|row| beginning.is_of(row.case));
    // Files of killed processes may have a row twice.
    rows.sort_by_key(|row| row.case);
    rows.dedup_by_key(|row| row.case);
    match rows.len() {
        0 => Err(missing()),
        1 => Ok((rows[0].index, rows.pop())),
        many => Err(CampaignError::refused(
            format!("{many} cases begin with `{}`", word(case)),
            "give more characters of the column `case`",
        )),
    }
}

/// Rows of one block, or of all blocks; for a folder, the rows that exist.
fn rows_at(place: &From, block: Option<u64>) -> Result<Vec<Row>, CampaignError> {
    match place {
        From::Folder(store) => {
            let blocks = block.map_or(0..store.blocks(), |block| block..block + 1);
            let mut rows = Vec::new();
            for block in blocks {
                match part::read(&store.part(block), &store.plan().hash) {
                    Ok((found, _)) => rows.extend(found),
                    Err(_) => rows.extend(store.kept_rows(block)?.rows),
                }
            }
            Ok(rows)
        }
        From::Table(path) => {
            let file = open_file(path).map_err(|e| CampaignError::unreadable(path, e))?;
            let read = TableReader::new(file).and_then(|reader| reader.read());
            let table = read.map_err(|e| CampaignError::unreadable(path, e))?;
            row::rows(&table).ok_or_else(|| CampaignError::unreadable(path, part::NO_ROWS))
        }
    }
}

#[cfg(test)]
mod tests {
    use wheeleg_config::plan::{Plan, Sources};

    use super::*;
    use crate::Figure;

    /// Four cases, two of which begin alike.
    const CASES: [&str; 4] = [
        "044f1d1a0af2183bb3b31813bface27d",
        "044f1d1a1af2183bb3b31813bface27d",
        "12345678901f183bb3b31813bface27d",
        "feed1d1a0af2183bb3b31813bface27d",
    ];

    #[test]
    fn a_case_is_found_by_its_place_its_identity_and_the_beginning_of_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("plan.toml");
        let text =
            "name = \"x\"\nroot = 1\nblock = 4\nreplicates = 4\n[base]\naxis = \"small-12x50\"\n";
        std::fs::write(&file, text).expect("written");
        let plan = Plan::of(Sources::load(&file.to_string_lossy()).expect("read")).expect("a plan");
        let columns = Cases::new(&plan).expect("cases").columns().clone();
        let of_plan = PlanFile::of(&plan, 1.0);
        let store = Store::create(folder.path(), of_plan.clone(), &Stop::default());
        let store = store.expect("a folder");
        let rows = CASES.iter().zip(0..).map(|(case, index)| Row {
            case: case.parse().expect("an identity"),
            index,
            block: 0,
            sample: 0,
            replicate: index,
            seed: index,
            factors: Vec::new(),
            status: Status::Error,
            error: None,
            log_hash: None,
            simulated_s: None,
            passed: None,
            figures: vec![Figure::default(); columns.targets.len()],
        });
        let rows: Vec<Row> = rows.collect();
        store.write_part(&columns, 0, &rows).expect("written");
        let place = From::Folder(Box::new(store));
        let found = |case: &str| find(&place, &of_plan, case).map(|(index, _)| index);
        for (case, index) in [
            ("2", 2),
            (CASES[3], 3),
            ("feed", 3),
            ("FEED1d…", 3),
            ("044f1d1a0", 0),
            ("12345678", 2),
        ] {
            assert_eq!(found(case).expect(case), index, "{case}");
        }
        for (case, told) in [
            ("044f1d1a", "2 cases begin with `044f1d1a`"),
            // Decimal digits may be a place beyond the plan.
            ("1234", "there is no case `1234`"),
            ("fee", "there is no case `fee`"),
            ("feed2", "there is no case `feed2`"),
            ("x", "there is no case `x`"),
            ("", "there is no case ``"),
        ] {
            let error = found(case).expect_err(case).to_string();
            assert!(error.contains(told), "{case}: {error}");
        }
    }
}
