//! The report page of a campaign: what its table shows, and how certain that is.

mod asked;
mod cells;
mod findings;
mod page;
mod pairs;
mod shares;
mod worst;

use std::path::{Path, PathBuf};

use wheeleg_config::open_file;
use wheeleg_studies::export::write_new;

use crate::columns::Columns;
use crate::part::PROGRAM;
use crate::store::PlanFile;
use crate::table::{Table, TableReader};
use crate::{CampaignError, replay};

pub use asked::{Asked, OfFactor};
pub use findings::{Findings, OfScenario, Rate};
pub use pairs::{Change, Paired, Pairs};
pub use worst::Worst;

/// A merged table with its plan.
pub struct Merged {
    /// Its rows.
    pub table: Table,
    /// Its columns.
    pub columns: Columns,
    /// Its plan.
    pub plan: PlanFile,
    /// Program that computed it.
    pub program: String,
    /// Its file.
    pub path: PathBuf,
}

impl Merged {
    /// Reads a merged table.
    ///
    /// # Errors
    /// [`CampaignError::Unreadable`] if the file is not a merged table.
    pub fn read(path: &Path) -> Result<Self, CampaignError> {
        let failed = |e: &dyn std::fmt::Display| CampaignError::unreadable(path, e);
        let plan = replay::plan_of_table(path)?;
        let file = open_file(path).map_err(|e| failed(&e))?;
        let reader = TableReader::new(file).map_err(|e| failed(&e))?;
        let program = reader.fact(PROGRAM).unwrap_or_default().to_owned();
        let table = reader.read().map_err(|e| failed(&e))?;
        Ok(Self {
            columns: Columns::read(table.columns.clone()),
            table,
            plan,
            program,
            path: path.to_owned(),
        })
    }
}

/// The findings of a table, optionally compared with a second one.
pub struct Report {
    /// Findings of the table.
    pub findings: Findings,
    /// Comparison of the two tables.
    pub pairs: Option<Pairs>,
    page: String,
    /// The tables it was made from.
    tables: Vec<PathBuf>,
}

impl Report {
    /// Writes the page.
    ///
    /// # Errors
    /// [`CampaignError::Study`] with the path, and either the error of the operating system or the table that
    /// the page would overwrite.
    pub fn write(&self, out: &Path) -> Result<(), CampaignError> {
        let tables: Vec<&Path> = self.tables.iter().map(PathBuf::as_path).collect();
        Ok(write_new(out, &self.page, &tables)?)
    }

    /// Reads a table and, if `against` is given, compares it with another.
    ///
    /// # Errors
    /// [`CampaignError::Unreadable`] if a file is not a table.
    pub fn of(path: &Path, against: Option<&Path>) -> Result<Self, CampaignError> {
        let merged = Merged::read(path)?;
        let findings = findings::find(&merged)?;
        let other = against.map(Merged::read).transpose()?;
        let pairs = match &other {
            Some(other) => Some(pairs::against(&merged, other)?),
            None => None,
        };
        let page = page::render(&merged, &findings, pairs.as_ref())?;
        Ok(Self {
            findings,
            pairs,
            page,
            tables: [Some(path), against]
                .into_iter()
                .flatten()
                .map(Path::to_owned)
                .collect(),
        })
    }
}
