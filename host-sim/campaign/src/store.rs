//! The folder of a campaign.
//!
//! | name | contents |
//! |---|---|
//! | `plan.json` | plan with all texts that it depends on, its hash, block size, program |
//! | `parts/000123.parquet` | rows of block 123; identical bytes from any executor |
//! | `parts/000123.run.parquet` | who computed them, and in what time |
//! | `parts/000123.NAME.partial.parquet` | rows of a block in progress, or whose process was stopped or killed |
//! | `attempts/000123.jsonl` | cases that were begun and ended |
//! | `aside/` | parts that are unreadable or foreign |
//! | `logs/CASE.mcap` | logs that the plan keeps |
//!
//! A file appears under its name only when it is complete: it is written under another name and then renamed.
//! For what a killed process leaves, see `leftovers.rs`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use wheeleg_config::plan::{MOST_BLOCKS, MOST_IN_BLOCK, Plan, Sources, Text};
use wheeleg_config::{open_file, word};
use wheeleg_report::output::same_file;
use wheeleg_studies::study::Stop;

use crate::columns::Columns;
use crate::part::{NO_ROWS, NotAPart};
use crate::row::{self, Row};
use crate::table::Table;
use crate::{CampaignError, host, part, program};

/// Name of the plan in the folder.
pub(crate) const PLAN_FILE: &str = "plan.json";
/// Version of the format of `plan.json`.
pub(crate) const FORMAT: u32 = 1;

/// `plan.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct PlanFile {
    /// Version of this form.
    pub format: u32,
    /// Program that made it.
    pub program: String,
    /// Hash of the texts and the block size.
    pub hash: String,
    /// Number of cases.
    pub cases: u64,
    /// Cases of a block.
    pub block: u64,
    /// Texts that the plan depends on.
    pub sources: Sources,
}

/// What to do about a plan file that cannot be read. The parts have the hash of their plan, so they are found
/// again.
const DAMAGED: &str = "if it is the damaged file of a campaign, remove it and give the command that made it again, or run its plan with \
     --out into this folder: the cases that have a row are found again; otherwise give another folder";

/// Work per block, s, if the plan does not set the block size.
const BLOCK_S: f64 = 60.0;

impl PlanFile {
    /// The file for a plan and this program. `work_s` is the approximate processor time of a case.
    #[must_use]
    pub fn of(plan: &Plan, work_s: f64) -> Self {
        let by_work = (BLOCK_S / work_s).clamp(1.0, MOST_IN_BLOCK as f64) as u64;
        // The largest power of two not above it, unless that makes too many parts.
        let by_work = 1 << by_work.ilog2();
        let by_number = plan.cases().div_ceil(MOST_BLOCKS).next_power_of_two();
        let block = plan.block.unwrap_or_else(|| by_number.max(by_work));
        Self {
            format: FORMAT,
            program: program(),
            hash: hash(&plan.sources, block),
            cases: plan.cases(),
            block,
            sources: plan.sources.clone().with_bare_names(),
        }
    }

    /// The same plan, attributed to this program.
    #[must_use]
    pub fn for_this_program(self) -> Self {
        Self {
            program: program(),
            ..self
        }
    }

    /// Reads a plan file.
    ///
    /// # Errors
    /// [`CampaignError::Unreadable`] if it is not one.
    pub fn read(path: &Path) -> Result<Self, CampaignError> {
        let text = open_file(path).and_then(std::io::read_to_string);
        let text = text.map_err(|e| CampaignError::unreadable(path, e))?;
        Self::parse(&text).map_err(|reason| CampaignError::Unreadable {
            path: path.to_owned(),
            reason,
            help: DAMAGED.to_owned(),
        })
    }

    /// Parses the text of a plan file, or says why it is none.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let file: Self = serde_json::from_str(text).map_err(|e| e.to_string())?;
        if file.format != FORMAT {
            return Err(format!("form {}, not {FORMAT}", file.format));
        }
        if file.hash != hash(&file.sources, file.block) {
            return Err("its texts are not those of its hash".to_owned());
        }
        // The number of cases follows from the texts. For a plan that only another program can read, it is
        // taken as stated.
        let cases = file.plan().map_or(file.cases, |plan| plan.cases());
        if file.cases != cases || cases == 0 {
            return Err(format!(
                "`cases` is {}, allowed: {cases}, as in its plan",
                file.cases
            ));
        }
        Ok(file)
    }

    /// Number of blocks.
    #[must_use]
    pub fn blocks(&self) -> u64 {
        self.cases.div_ceil(self.block)
    }

    /// The plan in the file.
    ///
    /// # Errors
    /// [`CampaignError::Config`] if this program refuses it.
    pub fn plan(&self) -> Result<Plan, CampaignError> {
        Ok(Plan::of(self.sources.clone())?)
    }

    /// How another plan file differs, for a message.
    fn difference(&self, other: &Self) -> Option<String> {
        let texts = |of: &Self| {
            let Sources {
                plan,
                scenarios,
                robots,
                axes,
                data,
                ..
            } = of.sources.clone();
            let named = scenarios
                .into_iter()
                .map(|(n, t)| (format!("scenario {n}"), t));
            let robots = robots.into_iter().map(|(n, t)| (format!("robot {n}"), t));
            let axes = axes.into_iter().map(|(n, t)| (format!("axis {n}"), t));
            let plan = [("plan".to_owned(), plan)];
            let files = data.into_iter().flat_map(|(scenario, files)| {
                files.into_iter().map(move |(file, data)| {
                    let text = data.digest();
                    let name = format!("data file {file} of the scenario {scenario}");
                    (name, Text { file, text })
                })
            });
            plan.into_iter()
                .chain(named)
                .chain(robots)
                .chain(axes)
                .chain(files)
                .collect::<Vec<_>>()
        };
        if self.program != other.program {
            return Some(format!(
                "made by `{}`, and this is `{}`",
                self.program, other.program
            ));
        }
        if self.hash == other.hash {
            return None;
        }
        let (own, others) = (texts(self), texts(other));
        for (name, text) in &own {
            let same = others.iter().find(|(other, _)| other == name);
            let Some((_, found)) = same else {
                return Some(format!("it has a {name}"));
            };
            if text.text != found.text {
                let place = first_difference(&text.text, &found.text);
                return Some(format!("the {name} differs, first in {place}"));
            }
        }
        if self.block != other.block {
            return Some(format!("block {}, not {}", self.block, other.block));
        }
        Some("it lacks a scenario, a robot or an axis".to_owned())
    }
}

/// The first line in which two different texts differ, as it was and as it is.
fn first_difference(was: &str, is: &str) -> String {
    let (mut was, mut is) = (was.lines(), is.lines());
    let line = |line: Option<&str>| match line {
        Some(line) => format!("`{}`", word(line)),
        None => "missing".to_owned(),
    };
    let mut number = 0_u64;
    loop {
        number += 1;
        match (was.next(), is.next()) {
            (None, None) => return "how a line ends".to_owned(),
            (was, is) if was != is => {
                return format!("line {number}: {} then, {} now", line(was), line(is));
            }
            _ => {}
        }
    }
}

/// Hashes the texts; the names of the files do not enter.
fn hash(sources: &Sources, block: u64) -> String {
    let mut hasher = blake3::Hasher::new_derive_key("wheeleg campaign plan v1");
    let mut add = |text: &str| {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    };
    add(&block.to_string());
    add(&sources.plan.text);
    let kinds = [
        ("scenario", &sources.scenarios),
        ("robot", &sources.robots),
        ("axis", &sources.axes),
    ];
    for (kind, files) in kinds {
        for (name, source) in files {
            add(kind);
            add(name);
            add(&source.text);
        }
    }
    for (scenario, files) in &sources.data {
        for (name, data) in files {
            add("data");
            add(scenario);
            add(name);
            add(&data.digest());
        }
    }
    hasher.finalize().to_hex()[..32].to_owned()
}

/// Rows of an unfinished block.
#[derive(Debug, Default)]
pub(crate) struct Kept {
    pub(crate) rows: Vec<Row>,
    /// The files that they are in.
    pub(crate) files: Vec<PathBuf>,
    /// Unreadable files, where they are now, and why.
    pub(crate) aside: Vec<(PathBuf, String)>,
}

/// A folder with the parts of one plan.
#[derive(Debug, Clone)]
pub struct Store {
    folder: PathBuf,
    plan: PlanFile,
}

impl Store {
    /// Creates the folder, or continues with a folder of the same plan and program. If a signal ends the
    /// program before this point, nothing has been written; from here on there is something to finish.
    ///
    /// # Errors
    /// [`CampaignError::Refused`] if the folder belongs to another plan or program, which is named;
    /// [`CampaignError::Output`] if it cannot be written.
    pub fn create(folder: &Path, plan: PlanFile, stop: &Stop) -> Result<Self, CampaignError> {
        // Nothing is written into the folder of another campaign.
        Self::ensure_not_of_another(folder, &plan)?;
        stop.begin();
        for name in ["parts", "attempts"] {
            let path = folder.join(name);
            fs::create_dir_all(&path)
                .map_err(|e| CampaignError::output("create the folder", &path, e))?;
        }
        let path = folder.join(PLAN_FILE);
        let mut text = serde_json::to_string_pretty(&plan).expect("texts are JSON");
        text.push('\n');
        if !path.exists() {
            create_new(&path, text.as_bytes())?;
        }
        // Another process may have been the first.
        Ok(Self {
            folder: folder.to_owned(),
            plan: Self::same_plan(PlanFile::read(&path)?, folder, &plan)?,
        })
    }

    /// Checks, without writing anything, that [`Store::create`] would take the folder.
    ///
    /// # Errors
    /// [`CampaignError::Refused`] if the folder belongs to another plan or program, which is named;
    /// [`CampaignError::Unreadable`] if its plan is invalid.
    pub fn ensure_not_of_another(folder: &Path, plan: &PlanFile) -> Result<(), CampaignError> {
        let path = folder.join(PLAN_FILE);
        if path.exists() {
            Self::same_plan(PlanFile::read(&path)?, folder, plan)?;
        }
        Ok(())
    }

    /// Whether the folder belongs to another plan or program.
    ///
    /// # Errors
    /// [`CampaignError::Unreadable`] if its plan is invalid.
    pub(crate) fn is_of_another(folder: &Path, plan: &PlanFile) -> Result<bool, CampaignError> {
        let path = folder.join(PLAN_FILE);
        Ok(path.exists() && PlanFile::read(&path)?.difference(plan).is_some())
    }

    /// The plan found in a folder, if it is the one that is wanted.
    fn same_plan(
        found: PlanFile,
        folder: &Path,
        wanted: &PlanFile,
    ) -> Result<PlanFile, CampaignError> {
        let Some(difference) = found.difference(wanted) else {
            return Ok(found);
        };
        Err(CampaignError::refused(
            format!(
                "the folder `{}` is of another campaign: {difference}",
                folder.display()
            ),
            "give another folder with --out DIR; every character of a plan counts, in its comments too",
        ))
    }

    /// Opens an existing folder.
    ///
    /// # Errors
    /// [`CampaignError::Refused`] if there is no plan in it; [`CampaignError::Unreadable`] if the plan is
    /// invalid.
    pub fn open(folder: &Path) -> Result<Self, CampaignError> {
        let plan = folder.join(PLAN_FILE);
        if plan.try_exists().is_ok_and(|there| !there) {
            let what = format!("there is no campaign in `{}`", folder.display());
            let help =
                format!("give the folder of a `wheeleg campaign run`, which has a `{PLAN_FILE}`");
            return Err(CampaignError::refused(what, help));
        }
        Ok(Self {
            plan: PlanFile::read(&plan)?,
            folder: folder.to_owned(),
        })
    }

    /// Path of the folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether a path is that of one of the folder's own files, or would be among them.
    pub(crate) fn owns(&self, path: &Path) -> bool {
        let parent = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let mut own = ["parts", "attempts"].into_iter();
        same_file(path, &self.folder.join(PLAN_FILE))
            || own.any(|name| same_file(parent, &self.folder.join(name)))
    }

    /// The plan file.
    #[must_use]
    pub fn plan(&self) -> &PlanFile {
        &self.plan
    }

    /// Number of blocks.
    #[must_use]
    pub fn blocks(&self) -> u64 {
        self.plan.blocks()
    }

    /// Indices of the cases of a block.
    #[must_use]
    pub fn cases_of(&self, block: u64) -> std::ops::Range<u64> {
        let from = block * self.plan.block;
        from..(from + self.plan.block).min(self.plan.cases)
    }

    /// The part file of a block.
    #[must_use]
    pub fn part(&self, block: u64) -> PathBuf {
        self.folder.join(format!("parts/{block:06}.parquet"))
    }

    /// Writes the part of a block that has all its rows.
    ///
    /// # Errors
    /// [`CampaignError::Output`] if it cannot be written.
    pub fn write_part(
        &self,
        columns: &Columns,
        block: u64,
        rows: &[Row],
    ) -> Result<(), CampaignError> {
        let bytes = part::bytes(columns, &self.plan.hash, rows);
        write_whole(&self.part(block), &bytes)
    }

    pub(crate) fn attempts(&self, block: u64) -> PathBuf {
        self.folder.join(format!("attempts/{block:06}.jsonl"))
    }

    /// The rows of a finished block, `None` if it has no part, or why its part is torn or foreign.
    pub(crate) fn table(&self, block: u64) -> Result<Option<Table>, String> {
        let expected = self.cases_of(block);
        let table = match part::read_table(&self.part(block), &self.plan.hash) {
            Ok(table) => table,
            Err(NotAPart::Missing) => return Ok(None),
            Err(NotAPart::Torn(why) | NotAPart::Foreign(why)) => return Err(why),
        };
        let indices = table.wholes("index").iter().copied();
        if indices.eq(expected.map(|index| i64::try_from(index).ok())) {
            return Ok(Some(table));
        }
        Err("it has not each case of its block once".to_owned())
    }

    /// Moves an invalid part out of the way; returns its new path.
    pub(crate) fn set_aside(&self, path: &Path) -> Result<PathBuf, CampaignError> {
        let folder = self.folder.join("aside");
        let failed = |e| CampaignError::output("set aside", path, e);
        fs::create_dir_all(&folder).map_err(failed)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let to = folder.join(format!("{name}.{}", host::unique()));
        fs::rename(path, &to).map_err(failed)?;
        Ok(to)
    }

    /// Blocks that have a file, whether complete or not; a process that was killed soon leaves only the record
    /// of the cases that it had begun.
    pub(crate) fn begun(&self) -> BTreeSet<u64> {
        let folders = ["parts", "attempts"].into_iter();
        let entries = folders.map(|name| fs::read_dir(self.folder.join(name)));
        let names = entries.flatten().flatten().flatten();
        let number = |name: &str| name.split('.').next()?.parse().ok();
        let blocks = names.filter_map(|entry| number(&entry.file_name().to_string_lossy()));
        blocks.collect()
    }

    /// Files with rows of an unfinished block.
    pub(crate) fn partials(&self, block: u64) -> Vec<PathBuf> {
        let begin = format!("{block:06}.");
        let entries = fs::read_dir(self.folder.join("parts"));
        let entries = entries.into_iter().flatten().flatten();
        let mut found: Vec<PathBuf> = entries
            .filter(|entry| {
                let name = entry.file_name();
                let name = name.to_string_lossy();
                name.starts_with(&begin) && name.ends_with(".partial.parquet")
            })
            .map(|entry| entry.path())
            .collect();
        found.sort();
        found
    }

    /// A name for such a file that no other process uses.
    pub(crate) fn new_partial(&self, block: u64) -> PathBuf {
        let name = format!("parts/{block:06}.{}.partial.parquet", host::unique());
        self.folder.join(name)
    }

    /// All rows so far, in the order of the plan.
    ///
    /// # Errors
    /// [`CampaignError::Unreadable`] for a part that is damaged.
    pub fn rows(&self) -> Result<Vec<Row>, CampaignError> {
        let mut rows = BTreeMap::new();
        for block in self.begun() {
            let unreadable = |why| CampaignError::unreadable(self.part(block), why);
            let found = match self.table(block).map_err(unreadable)? {
                Some(table) => row::rows(&table).ok_or_else(|| unreadable(NO_ROWS.to_owned()))?,
                None => self.kept_rows(block)?.rows,
            };
            rows.extend(found.into_iter().map(|row| (row.index, row)));
        }
        Ok(rows.into_values().collect())
    }

    /// What the files of an unfinished block have; unreadable ones are set aside.
    pub(crate) fn kept_rows(&self, block: u64) -> Result<Kept, CampaignError> {
        let mut kept = Kept::default();
        for path in self.partials(block) {
            match part::read(&path, &self.plan.hash) {
                Ok((found, _)) => {
                    kept.rows.extend(found);
                    kept.files.push(path);
                }
                Err(NotAPart::Missing) => {}
                Err(NotAPart::Torn(why) | NotAPart::Foreign(why)) => {
                    kept.aside.push((self.set_aside(&path)?, why));
                }
            }
        }
        let cases = self.cases_of(block);
        kept.rows.retain(|row| cases.contains(&row.index));
        Ok(kept)
    }
}

/// Writes a file as a whole: under another name, synced, renamed, and the folder synced.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), CampaignError> {
    let temporary = temporary(path);
    let result = fill(&temporary, path, bytes).and_then(|()| {
        fs::rename(&temporary, path)
            .and_then(|()| sync_folder(path))
            .map_err(|e| CampaignError::output("write", path, e))
    });
    if result.is_err() {
        let _ = fs::remove_file(&temporary);
    }
    result
}

/// Creates a file as a whole, unless it exists by then.
fn create_new(path: &Path, bytes: &[u8]) -> Result<(), CampaignError> {
    let temporary = temporary(path);
    let result =
        fill(&temporary, path, bytes).and_then(|()| match fs::hard_link(&temporary, path) {
            Ok(()) => sync_folder(path).map_err(|e| CampaignError::output("write", path, e)),
            Err(e) if e.kind() == ErrorKind::AlreadyExists => Ok(()),
            // On a file system without hard links, the second process writes the same bytes.
            Err(_) => {
                fs::rename(&temporary, path).map_err(|e| CampaignError::output("write", path, e))
            }
        });
    let _ = fs::remove_file(&temporary);
    result
}

fn temporary(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.{}.tmp", host::unique()))
}

/// Writes the temporary file. Errors name `path`, its final name, which the user knows.
fn fill(temporary: &Path, path: &Path, bytes: &[u8]) -> Result<(), CampaignError> {
    let write = || -> std::io::Result<()> {
        let mut file = File::create(temporary)?;
        file.write_all(bytes)?;
        file.sync_all()
    };
    write().map_err(|e| {
        let _ = fs::remove_file(temporary);
        CampaignError::output("write", path, e)
    })
}

fn sync_folder(path: &Path) -> std::io::Result<()> {
    if cfg!(unix)
        && let Some(folder) = path.parent()
    {
        // A bare file name is relative to the current folder.
        let here = folder.as_os_str().is_empty();
        return File::open(if here { Path::new(".") } else { folder })?.sync_all();
    }
    Ok(())
}
