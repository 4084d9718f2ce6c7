//! Files that killed processes leave in a campaign's folder and that nobody reads.
//!
//! A process that is killed while writing a file leaves it under its temporary name. A process that is killed
//! after writing a part leaves the partial rows and the attempts that the part replaces. [`run`](crate::run)
//! removes both when it ends. It removes a temporary file only if the file's process is known to be dead: the
//! folder is often shared, and another computer may be writing the file.

use std::fs;
use std::path::{Path, PathBuf};

use crate::host;
use crate::store::Store;

/// Folders that a process writes to, below that of the campaign.
const FOLDERS: [&str; 4] = ["", "parts", "attempts", "logs"];

/// A file that nobody reads.
#[derive(Debug)]
enum Leftover {
    /// A file that a process was writing, and whether that process is alive, if known.
    Temporary(Option<bool>),
    /// A file of a block, useless once the block has its part.
    OfBlock(u64),
}

impl Leftover {
    fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy();
        if let Some(name) = name.strip_suffix(".tmp") {
            let (_, process) = name.rsplit_once('.')?;
            return Some(Self::Temporary(host::lives(process)));
        }
        let (block, kind) = name.split_once('.')?;
        let is_of_block = kind.ends_with("partial.parquet") || kind == "jsonl";
        is_of_block.then(|| block.parse().ok().map(Self::OfBlock))?
    }
}

impl Store {
    /// Removes the files that killed processes have left and that nobody will read.
    pub(crate) fn tidy(&self) {
        self.each_leftover(|path, known| {
            if known {
                let _ = fs::remove_file(path);
            }
        });
    }

    /// The files that [`Store::tidy`] would remove, and temporary files whose process may or may not be
    /// alive.
    pub(crate) fn leftovers(&self) -> Vec<PathBuf> {
        let mut found = Vec::new();
        self.each_leftover(|path, _| found.push(path.to_owned()));
        found.sort();
        found
    }

    /// Calls `what` for each leftover, with whether it is known that nobody needs it. A file that a living
    /// process is writing is not a leftover.
    fn each_leftover(&self, mut what: impl FnMut(&Path, bool)) {
        for folder in FOLDERS {
            let entries = fs::read_dir(self.folder().join(folder));
            for entry in entries.into_iter().flatten().flatten() {
                let path = entry.path();
                match Leftover::of(&path) {
                    Some(Leftover::Temporary(Some(true))) => {}
                    Some(Leftover::Temporary(lives)) => what(&path, lives == Some(false)),
                    Some(Leftover::OfBlock(block)) if self.has(block) => what(&path, true),
                    _ => {}
                }
            }
        }
    }

    /// Whether the part of a block exists and is valid.
    fn has(&self, block: u64) -> bool {
        block < self.blocks() && matches!(self.table(block), Ok(Some(_)))
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use crate::{Case, Cases, Options, Outcome, PlanFile, SAVE_EVERY, Shard, Status, run, status};
    use wheeleg_config::plan::{Plan, Sources};
    use wheeleg_studies::study::Stop;

    const PLAN: &str = "name = \"left\"\nroot = 1\nsamples = 12\nblock = 4\n[base]\nscenario = \"stand\"\n\
         [factor.droop]\nparameter = \"robot.supply.droop\"\n\
         uniform = { min = 0.2, max = 0.4, unit = \"bar\" }\n";

    fn outcome(_: &Case) -> Option<Outcome> {
        let mut outcome = Outcome::without(Status::Ok, String::new());
        outcome.error = None;
        Some(outcome)
    }

    /// Names of the files in a folder, except the records of who made the parts.
    fn names(folder: &Path) -> Vec<String> {
        let entries = FOLDERS.iter().flat_map(|name| {
            let entries = fs::read_dir(folder.join(name)).into_iter().flatten();
            entries.map(|entry| entry.expect("an entry"))
        });
        let files = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()));
        let mut names: Vec<String> = files
            .map(|entry| entry.file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// Plants everything that a killed process can leave, for the first block, which is finished, and for the
    /// last, which is not. After the next run, only the files of living processes and of other computers
    /// remain.
    #[test]
    fn a_finished_campaign_has_no_rubbish_and_files_of_others_stay() {
        let home = tempfile::tempdir().expect("a folder");
        let path = home.path().join("plan.toml");
        fs::write(&path, PLAN).expect("written");
        let plan = Plan::of(Sources::load(&path.to_string_lossy()).expect("read")).expect("a plan");
        let folder = home.path().join("out");
        let stop = Stop::default();
        let store = Store::create(&folder, PlanFile::of(&plan, 1.0), &stop).expect("a folder");
        let cases = Cases::new(&plan).expect("a plan");
        let run_again = || {
            let options = Options {
                shard: Shard::ALL,
                threads: 1,
                first: None,
                stop: Stop::default(),
                program: None,
                json: false,
                save_every: SAVE_EVERY,
            };
            run(&store, &cases, &options, &outcome).expect("it runs")
        };
        run_again();
        let whole = names(&folder);
        assert_eq!(whole.len(), 1 + 3 + 3, "{whole:?}");
        assert!(store.leftovers().is_empty());

        let mut child = std::process::Command::new("true").spawn().expect("started");
        child.wait().expect("ended");
        let own = host::unique();
        let process = format!("-{}-", std::process::id());
        let dead = own.replace(&process, &format!("-{}-", child.id()));
        let there = folder.join("parts/000000.parquet");
        let rows = fs::read(&there).expect("there");
        let torn = &rows[..rows.len() / 2];
        let mut planted = vec![
            format!(".plan.json.{dead}.tmp"),
            format!("logs/0123abcd.{dead}.tmp"),
        ];
        for block in ["000000", "000002"] {
            planted.extend([
                format!("parts/.{block}.parquet.{dead}.tmp"),
                format!("parts/.{block}.run.parquet.{dead}.tmp"),
                format!("parts/.{block}.{dead}.partial.parquet.{dead}.tmp"),
                format!("parts/{block}.{dead}.partial.parquet"),
                format!("attempts/{block}.jsonl"),
            ]);
        }
        fs::create_dir_all(folder.join("logs")).expect("created");
        for name in &planted {
            fs::write(folder.join(name), torn).expect("written");
        }
        let of_others = [
            format!("parts/.000001.parquet.{own}.tmp"),
            format!(
                "parts/.000001.parquet.elsewhere-0123abcd-{}-18ab-0.tmp",
                child.id()
            ),
            format!("parts/.000002.parquet.node-7-{}-18ab-0.tmp", child.id()),
        ];
        for name in &of_others {
            fs::write(folder.join(name), torn).expect("written");
        }
        // The last block is not done, so its partial rows are still needed.
        fs::copy(
            &there,
            folder
                .join("parts")
                .join(format!("000002.{dead}.partial.parquet")),
        )
        .expect("copied");
        fs::remove_file(folder.join("parts/000002.parquet")).expect("there");
        let told = status(&store, Shard::ALL).expect("readable").leftovers;
        // Without the two files of the unfinished block, and the one that this process is writing.
        assert_eq!(
            told.len(),
            planted.len() - 2 + of_others.len() - 1,
            "{told:?}"
        );

        run_again();
        let mut expected = whole;
        let name = |path: &String| path.rsplit('/').next().expect("a name").to_owned();
        expected.extend(of_others.iter().map(name));
        expected.sort();
        assert_eq!(names(&folder), expected);
        assert_eq!(
            status(&store, Shard::ALL)
                .expect("readable")
                .leftovers
                .len(),
            2
        );
    }
}
