//! Merges all parts into one table.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};

use wheeleg_studies::export::make_room;
use wheeleg_studies::study::Stop;

use crate::columns::{Columns, FACT};
use crate::pages::{GROUP_ROWS, in_words};
use crate::part::{self, PLAN, PROGRAM};
use crate::row::{self, Row};
use crate::store::Store;
use crate::table::{Data, Table, TableWriter};
use crate::{CampaignError, Cases, host};

/// The result of a merge.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Merged {
    /// Rows.
    pub rows: u64,
    /// Cases of the plan without a row: 0 unless they were allowed to be missing.
    pub missing: u64,
    /// BLAKE3 hash over case, status, log hash and the bits of all figures, in the order of the plan, in
    /// hexadecimal. Programs that compute the same have the same hash, however the work was shared.
    pub hash: String,
}

/// Number of blocks that a message names; any others are only counted.
const NAMED: usize = 12;

/// Merges the parts in several folders of one plan into one table, with each case once. Returns `None`, and
/// writes nothing, if it was stopped.
///
/// # Errors
/// [`CampaignError::Incomplete`] if blocks are missing, with the command that fills the gaps;
/// [`CampaignError::Refused`] for folders of different plans or programs, or a duplicate row;
/// [`CampaignError::Output`] if the table cannot be written.
pub fn merge(
    folders: &[PathBuf],
    out: &Path,
    stop: &Stop,
) -> Result<Option<Merged>, CampaignError> {
    table_of(folders, out, false, stop)
}

/// As [`merge`], for whichever cases have a row, including those of unfinished blocks: for a pilot, or while
/// other processes are still running.
///
/// # Errors
/// As for [`merge`], but [`CampaignError::Incomplete`] only if no case has a row.
pub fn merge_partial(
    folders: &[PathBuf],
    out: &Path,
    stop: &Stop,
) -> Result<Option<Merged>, CampaignError> {
    table_of(folders, out, true, stop)
}

fn table_of(
    folders: &[PathBuf],
    out: &Path,
    partial: bool,
    stop: &Stop,
) -> Result<Option<Merged>, CampaignError> {
    let stores: Vec<Store> = folders
        .iter()
        .map(|folder| Store::open(folder))
        .collect::<Result<_, _>>()?;
    let Some(first) = stores.first() else {
        return Err(CampaignError::refused(
            "no folder to merge",
            "give one or more",
        ));
    };
    for store in &stores {
        if store.owns(out) {
            return Err(CampaignError::refused(
                format!(
                    "`{}` would take the place of a file of the campaign itself",
                    out.display()
                ),
                "give another file with --out FILE",
            ));
        }
        if store.plan().hash != first.plan().hash || store.plan().program != first.plan().program {
            return Err(CampaignError::refused(
                format!(
                    "`{}` and `{}` are of different plans, block sizes or programs: {} by `{}`, \
                     and {} by `{}`",
                    first.folder().display(),
                    store.folder().display(),
                    first.plan().hash,
                    first.plan().program,
                    store.plan().hash,
                    store.plan().program,
                ),
                "only parts of one plan and one program make a table; write `block = …` into a \
                 plan that is run in several folders",
            ));
        }
    }
    let plan = first.plan().plan()?;
    let columns = Cases::new(&plan)?.columns().clone();
    let plan_text = serde_json::to_string(first.plan()).expect("texts are JSON");
    let temporary = out.with_extension(format!("{}.tmp", host::unique()));
    // From here on there is something to clean up.
    stop.begin();
    let parents = out.ancestors().skip(1);
    let made: Vec<&Path> = parents
        .take_while(|folder| !folder.as_os_str().is_empty() && !folder.exists())
        .collect();
    if let Some(folder) = made.first() {
        std::fs::create_dir_all(folder)
            .map_err(|e| CampaignError::output("create the folder", folder, e))?;
    }
    let facts = [plan_text.as_str(), &first.plan().program];
    let written = write([&temporary, out], &stores, &columns, facts, (partial, stop));
    let result = written.and_then(|merged| {
        if merged.is_some() && !is_same(&temporary, out) {
            make_room(out, &[])?;
            let renamed = std::fs::rename(&temporary, out);
            renamed.map_err(|e| CampaignError::output("write", out, e))?;
        }
        Ok(merged)
    });
    // It no longer exists if it has become the table.
    let _ = std::fs::remove_file(&temporary);
    if !matches!(result, Ok(Some(_))) {
        // Nothing is left where no table was written.
        for folder in made {
            let _ = std::fs::remove_dir(folder);
        }
    }
    result
}

/// Whether two files have the same bytes; false if one cannot be read.
fn is_same(one: &Path, other: &Path) -> bool {
    let open = |path: &Path| {
        let about = std::fs::metadata(path)
            .ok()
            .filter(std::fs::Metadata::is_file)?;
        Some((about.len(), BufReader::new(File::open(path).ok()?)))
    };
    let (Some((a_len, mut a)), Some((b_len, mut b))) = (open(one), open(other)) else {
        return false;
    };
    if a_len != b_len {
        return false;
    }
    // Both readers are filled alike, so their buffers have the same length.
    while let (Ok(left), Ok(right)) = (a.fill_buf(), b.fill_buf()) {
        let alike = left.len().min(right.len());
        if left[..alike] != right[..alike] {
            return false;
        }
        if alike == 0 {
            return left.is_empty() && right.is_empty();
        }
        a.consume(alike);
        b.consume(alike);
    }
    false
}

/// Blocks without a part, and invalid parts.
#[derive(Default)]
struct Holes {
    blocks: Vec<u64>,
    bad: Vec<String>,
}

impl Holes {
    /// The table of a block, from the first folder that has its part; `None` if no folder has it.
    fn find(&mut self, block: u64, stores: &[Store]) -> Option<(PathBuf, Table)> {
        for store in stores {
            match store.table(block) {
                Ok(Some(table)) => return Some((store.part(block), table)),
                Ok(None) => {}
                Err(why) => {
                    let path = store.part(block);
                    self.bad.push(format!("`{}`: {why}", path.display()));
                }
            }
        }
        self.blocks.push(block);
        None
    }

    /// The error that tells the user what to do about the gaps.
    fn error(&self, of: &Store) -> CampaignError {
        let named = self
            .blocks
            .iter()
            .take(NAMED)
            .map(|block| format!("{block:06}"));
        let mut what = format!(
            "{} of {} blocks have no part: {}",
            self.blocks.len(),
            of.blocks(),
            named.collect::<Vec<_>>().join(", ")
        );
        if self.blocks.len() > NAMED {
            what.push_str(", …");
        }
        for bad in self.bad.iter().take(NAMED) {
            what.push_str(&format!("; {bad}"));
        }
        let folder = of.folder().display();
        CampaignError::Incomplete {
            what,
            help: format!("`wheeleg campaign run {folder}/plan.json --out {folder}` computes them"),
        }
    }
}

/// The existing rows of an unfinished block, in the order of the plan.
fn unfinished(block: u64, stores: &[Store], columns: &Columns) -> Option<(PathBuf, Table)> {
    let mut rows = BTreeMap::new();
    for store in stores {
        for path in store.partials(block) {
            // An unreadable file is set aside when the block is computed.
            let Ok((found, _)) = part::read(&path, &store.plan().hash) else {
                continue;
            };
            let cases = store.cases_of(block);
            let found = found.into_iter().filter(|row| cases.contains(&row.index));
            rows.extend(found.map(|row| (row.index, row)));
        }
    }
    let rows: Vec<Row> = rows.into_values().collect();
    (!rows.is_empty()).then(|| (stores[0].part(block), row::table(columns, &rows)))
}

/// Writes the table of all blocks to `to`, reading each part once. Messages name `out`, the final path.
fn write(
    [to, out]: [&Path; 2],
    stores: &[Store],
    columns: &Columns,
    [plan_text, program]: [&str; 2],
    (partial, stop): (bool, &Stop),
) -> Result<Option<Merged>, CampaignError> {
    let failed = |e: std::io::Error| CampaignError::output("write", out, e);
    let full = |e: parquet::errors::ParquetError| failed(std::io::Error::other(in_words(&e)));
    let file = File::create(to).map_err(failed)?;
    let text = serde_json::to_string(&columns.all).expect("columns are JSON");
    let facts = [(FACT, text.as_str()), (PLAN, plan_text), (PROGRAM, program)];
    let file = std::io::BufWriter::new(file);
    let mut writer = TableWriter::new(file, &columns.all, &facts).map_err(full)?;
    let mut hasher = blake3::Hasher::new();
    let mut group = Table::empty(columns.all.clone());
    let mut rows = 0_u64;
    let mut holes = Holes::default();
    for block in 0..stores[0].blocks() {
        if stop.is_asked() {
            return Ok(None);
        }
        let found = holes.find(block, stores);
        let found = match found {
            None if partial => unfinished(block, stores, columns),
            found => found,
        };
        let Some((path, table)) = found else {
            continue;
        };
        if !partial && !holes.blocks.is_empty() {
            // There will be no table, so only look for further gaps.
            continue;
        }
        if table.columns != columns.all {
            return Err(CampaignError::unreadable(&path, "other columns"));
        }
        hash(&mut hasher, &table, columns);
        rows += table.rows() as u64;
        if group.rows() + table.rows() > GROUP_ROWS {
            writer.write(&group).map_err(full)?;
            group = Table::empty(columns.all.clone());
        }
        group.append(table);
    }
    if !holes.blocks.is_empty() && (!partial || rows == 0) {
        return Err(holes.error(&stores[0]));
    }
    writer.write(&group).map_err(full)?;
    let file = writer.finish().map_err(full)?;
    let file = file.into_inner().map_err(|e| failed(e.into_error()))?;
    file.sync_all().map_err(failed)?;
    Ok(Some(Merged {
        rows,
        missing: stores[0].plan().cases - rows,
        hash: hasher.finalize().to_hex().to_string(),
    }))
}

/// Hashes case, status, log hash and the bits of the figures of each row.
fn hash(hasher: &mut blake3::Hasher, table: &Table, columns: &Columns) {
    let texts = ["case", "status", "log_hash"].map(|name| table.texts(name));
    let figures: Vec<&Data> = columns
        .targets
        .iter()
        .filter_map(|id| table.column(id))
        .collect();
    let mut all = Vec::new();
    for row in 0..table.rows() {
        for column in texts {
            match column.get(row).and_then(Option::as_deref) {
                Some(text) => {
                    all.extend((text.len() as u64).to_le_bytes());
                    all.extend(text.as_bytes());
                }
                None => all.extend(u64::MAX.to_le_bytes()),
            }
        }
        for figure in &figures {
            let value = match figure {
                Data::Number(v) => v.get(row).copied().flatten(),
                _ => None,
            };
            // No figure has these bits: they encode a NaN.
            let bits = value.map_or(u64::MAX, f64::to_bits);
            all.extend(bits.to_le_bytes());
        }
    }
    hasher.update(&all);
}

#[cfg(test)]
mod tests {
    use wheeleg_config::plan::{Plan, Sources};

    use super::*;
    use parquet::file::reader::{FileReader as _, SerializedFileReader};

    use crate::store::{PlanFile, write_whole};
    use crate::table::TableReader;
    use crate::{Figure, Status, report};

    /// A row for a case that was not simulated.
    fn row(index: u64, columns: &Columns) -> Row {
        let identity = blake3::hash(&index.to_le_bytes()).to_hex();
        Row {
            case: identity[..32].parse().expect("an identity"),
            index,
            block: index / 1000,
            sample: 0,
            replicate: index,
            seed: index,
            factors: Vec::new(),
            status: Status::Error,
            error: Some("x".repeat(row::ERROR_MOST)),
            log_hash: None,
            simulated_s: None,
            passed: None,
            figures: vec![Figure::default(); columns.targets.len()],
        }
    }

    /// Blocks that do not divide a row group, one of them unfinished, and the longest texts: what is written
    /// can be read.
    #[test]
    fn a_table_of_any_blocks_is_read_again() {
        const CASES: u64 = 66_500;
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("plan.toml");
        let text = format!(
            "name = \"long\"\nroot = 1\nblock = 1000\nreplicates = {CASES}\n\
             [base]\nscenario = \"stand\"\n"
        );
        std::fs::write(&file, text).expect("written");
        let sources = Sources::load(&file.to_string_lossy()).expect("read");
        let plan = Plan::of(sources).expect("a plan");
        let columns = Cases::new(&plan).expect("cases").columns().clone();
        let store = Store::create(folder.path(), PlanFile::of(&plan, 1.0), &Stop::default())
            .expect("a folder");
        let write = |path: &Path, cases: std::ops::Range<u64>| {
            let rows: Vec<Row> = cases.map(|index| row(index, &columns)).collect();
            let bytes = part::bytes(&columns, &store.plan().hash, &rows);
            write_whole(path, &bytes).expect("written");
        };
        for block in 0..store.blocks() {
            let rows: Vec<Row> = store
                .cases_of(block)
                .map(|index| row(index, &columns))
                .collect();
            store.write_part(&columns, block, &rows).expect("written");
        }
        let out = folder.path().join("cases.parquet");
        let folders = [folder.path().to_owned()];
        let groups = || {
            let file = File::open(&out).expect("a file");
            TableReader::new(file).expect("a table").groups()
        };
        let indices = || {
            let table = report::Merged::read(&out).expect("a table").table;
            let indices = table.wholes("index").iter().flatten();
            indices.map(|index| *index as u64).collect::<Vec<_>>()
        };
        let merged = merge(&folders, &out, &Stop::default()).expect("merged");
        assert_eq!(merged.map(|merged| merged.rows), Some(CASES));
        assert_eq!(groups(), [65_000, 1_500]);
        assert!(indices().into_iter().eq(0..CASES));

        // A byte that is not what was written is found wherever the hash of the table looks: in the identities of the
        // cases, of both groups.
        let whole = std::fs::read(&out).expect("a table");
        let reader = SerializedFileReader::new(File::open(&out).expect("a file")).expect("a table");
        let damaged = folder.path().join("damaged.parquet");
        for group in reader.metadata().row_groups() {
            let identities = group.column(0);
            assert_eq!(identities.column_path().string(), "case");
            let (begin, length) = identities.byte_range();
            for share in [0.2, 0.5, 0.9] {
                let mut bytes = whole.clone();
                let at = begin as usize + (share * length as f64) as usize;
                bytes[at] ^= 0x10;
                std::fs::write(&damaged, &bytes).expect("written");
                assert!(report::Merged::read(&damaged).is_err(), "{share}");
            }
        }

        std::fs::remove_file(store.part(3)).expect("there");
        write(&store.new_partial(3), 3_000..3_400);
        let merged = merge_partial(&folders, &out, &Stop::default()).expect("merged");
        assert_eq!(merged.map(|merged| merged.missing), Some(600));
        assert_eq!(groups(), [65_400, 500]);
        assert!(indices().into_iter().eq((0..3_400).chain(4_000..CASES)));
    }
}
