//! Output of `wheeleg campaign`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use wheeleg_campaign::report::{Findings, Paired, Pairs};
use wheeleg_campaign::{
    CAUSES, Cases, Causes, MergeForm, Merged, PlanFile, Ran, Recording, Replayed, ReportForm,
    Shard, State, Status, StatusForm, Store, Submission,
};
use wheeleg_report::number::{counted, p_equals};
use wheeleg_studies::StudyError;
use wheeleg_studies::study::schema;

/// Prints cases: index, identity, seed, and the value of each factor.
pub(super) fn list(cases: &Cases<'_>, most: u64) -> Result<ExitCode, StudyError> {
    let plan = cases.plan();
    let names = plan
        .factors
        .iter()
        .map(|factor| match factor.unit.as_str() {
            "" => factor.name.clone(),
            unit => format!("{} ({unit})", factor.name),
        });
    let mut head = vec!["index".to_owned(), "case".to_owned(), "seed".to_owned()];
    head.extend(names);
    if !super::super::print_on(&format!("{}\n", head.join("\t")))? {
        return Ok(ExitCode::SUCCESS);
    }
    for index in 0..plan.cases().min(most) {
        let case = cases.case(index);
        let mut line = format!("{index}\t{}\t{}", case.id, case.seed);
        for value in &case.values {
            let _ = write!(line, "\t{value}");
        }
        line.push('\n');
        // Each case takes time to build, so print each line at once.
        if !super::super::print_on(&line)? {
            break;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Duration of a pilot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Took {
    /// From start to end.
    pub(super) took: Duration,
    /// Number of cases that ran in parallel.
    pub(super) threads: usize,
}

/// What a process did, and what to do next.
pub(super) fn ran(ran: &Ran, store: &Store, shard: Shard, pilot: Option<Took>) -> String {
    let mut out = format!("cases   {} of {}", ran.found + ran.computed, ran.of);
    if shard != Shard::ALL {
        let _ = write!(out, " in shard {shard}");
    }
    match (ran.of, shard.i < store.blocks()) {
        (0, false) => {
            let _ = write!(
                out,
                ": it has no block, the campaign has {}",
                store.blocks()
            );
        }
        (0, true) => {
            let first = store.cases_of(shard.i).start;
            let _ = write!(
                out,
                ": it begins with place {first} in the plan, beyond those of --first"
            );
        }
        _ => {}
    }
    if ran.found > 0 {
        let _ = write!(out, ", {} of them found", ran.found);
    }
    let _ = writeln!(
        out,
        "\nfailed  {} of the {} computed now missed a required target or have no result",
        ran.failed, ran.computed
    );
    out.push_str(&causes(&ran.causes));
    if let Some(Took { took, threads }) = pilot
        && ran.computed > 0
    {
        let each_s = took.as_secs_f64() / ran.computed as f64;
        let _ = writeln!(
            out,
            "time    {:.1} s, {each_s:.2} s a case ({threads} at a time)",
            took.as_secs_f64()
        );
    }
    if ran.shared {
        out.push_str(
            "shared  another process worked on the same blocks: give each its --shard I/N\n",
        );
    }
    let folder = store.folder().display();
    let _ = writeln!(out, "folder  {folder}");
    if shard == Shard::ALL && ran.stopped.is_none() {
        let is_whole = ran.of == store.plan().cases;
        let partial = if is_whole { "" } else { " --partial" };
        let _ = writeln!(
            out,
            "next    wheeleg campaign merge {folder}{partial} --out {folder}/cases.parquet"
        );
    }
    out
}

/// Why cases failed, those without a result first.
fn causes(causes: &Causes) -> String {
    let mut out = String::new();
    for (cause, cases) in causes.first(CAUSES) {
        let _ = writeln!(out, "        {cases:>5}  {}", causes.message(cause));
    }
    let more = causes.kinds().saturating_sub(CAUSES);
    if more > 0 {
        let _ = writeln!(out, "        and {more} other causes");
    }
    out
}

/// A merged table.
pub(super) fn merged(merged: &Merged, table: &Path) -> String {
    let mut out = format!("rows    {}\n", merged.rows);
    if merged.missing > 0 {
        let _ = writeln!(out, "missing {} cases have no row yet", merged.missing);
    }
    let _ = writeln!(out, "hash    {}", merged.hash);
    let _ = writeln!(out, "table   {}", table.display());
    out
}

/// The merged table as JSON.
pub(super) fn merged_json(merged: &Merged, table: &Path) -> String {
    schema::indented(&MergeForm::of(merged, table))
}

/// What would be submitted to Slurm.
pub(super) fn slurm(submission: &Submission, further: &[String]) -> String {
    let array = submission.slurm_arguments(further).join(" ");
    let merge = submission.merge_arguments("ARRAY", further);
    let merge: Vec<String> = merge.iter().map(|word| format!("{word:?}")).collect();
    format!(
        "# the plan into {}/plan.json, then\n# sbatch {array} of\n{}\n# then, with the number of the array\n\
         # sbatch {}\n",
        submission.folder,
        submission.slurm_script(),
        merge.join(" ")
    )
}

/// For a campaign with fewer blocks than shards: that some have no work, and the size of block with which all
/// have.
pub(super) fn idle(plan: &PlanFile, shard: Shard) -> Option<String> {
    let blocks = plan.blocks();
    if blocks >= shard.n {
        return None;
    }
    let only = format!(
        "only {blocks} of {} shards have work: the {} cases make {}",
        shard.n,
        plan.cases,
        counted(blocks as usize, "block", "blocks")
    );
    let block = plan.cases / shard.n;
    Some(match block {
        0 => only,
        _ => format!(
            "{only}; for all, write `block = {block}` into the plan, and give another --out"
        ),
    })
}

/// Progress of a campaign.
pub(super) fn state(state: &State, store: &Store, shard: Shard) -> String {
    let mut out = format!("cases   {} of {} have a result\n", state.rows, state.cases);
    if state.partial > 0 {
        let _ = writeln!(out, "        {} of them in blocks under way", state.partial);
    }
    if state.begun + state.unsaved > 0 {
        let _ = writeln!(
            out,
            "begun   {} more cases, of which {} have ended and are not saved yet",
            state.begun + state.unsaved,
            state.unsaved
        );
    }
    if state.lost > 0 {
        let _ = writeln!(
            out,
            "lost    {} of them, whose process was killed: the next run repeats them",
            state.lost
        );
    }
    let counts = Status::ALL.iter().zip(state.by_status);
    let counts = counts.filter(|(_, n)| *n > 0);
    let counts: Vec<String> = counts.map(|(s, n)| format!("{n} {}", s.name())).collect();
    if !counts.is_empty() {
        let _ = writeln!(out, "status  {}", counts.join(", "));
    }
    let _ = writeln!(
        out,
        "failed  {} missed a required target or have no result",
        state.failed
    );
    out.push_str(&causes(&state.causes));
    let _ = writeln!(
        out,
        "blocks  {} of {} still to do",
        state.missing.len(),
        store.blocks()
    );
    if !state.leftovers.is_empty() {
        let _ = writeln!(
            out,
            "left    {} files of processes that were killed, or that write on other computers: the next `campaign run` \
             on the computer of a killed one removes its files",
            state.leftovers.len()
        );
    }
    out += &bad_parts(&state.bad);
    if !state.missing.is_empty() && !state.is_running {
        let folder = store.folder().display();
        let shard = match shard {
            Shard::ALL => String::new(),
            shard => format!(" --shard {shard}"),
        };
        let _ = writeln!(
            out,
            "next    wheeleg campaign run {folder}/plan.json --out {folder}{shard}"
        );
    }
    out
}

/// Unreadable or foreign parts.
fn bad_parts(bad: &[(PathBuf, String)]) -> String {
    let lines = bad
        .iter()
        .map(|(path, why)| format!("bad     {}: {why}", path.display()));
    listed(lines, "bad     and", "more: --json has them all")
}

/// Progress of a campaign, as a line of JSON.
pub(super) fn state_json(state: &State) -> String {
    schema::line(&StatusForm::of(state))
}

/// A replayed case.
pub(super) fn replayed(replayed: &Replayed) -> String {
    let row = &replayed.row;
    let mut out = format!("case    {}, place {}\n", row.case, row.index);
    let _ = writeln!(out, "status  {}", row.status.name());
    if let Some(error) = &row.error {
        let _ = writeln!(out, "error   {error}");
    }
    let _ = writeln!(
        out,
        "row     {}",
        match replayed.same_row() {
            Some(true) => "bit-identical".to_owned(),
            Some(false) => format!(
                "DIFFERS from that of `{}` in {}",
                replayed.program,
                in_short(&replayed.differs)
            ),
            None => "none before".to_owned(),
        }
    );
    if let Some(hash) = &row.log_hash {
        let _ = writeln!(out, "hash    {hash}");
    }
    if let Some(files) = &replayed.files {
        let same = match (&replayed.before, replayed.same_recording()) {
            (None, _) => "none before",
            (_, Some(true)) => "bit-identical",
            (_, Some(false)) => "DIFFERS",
            (_, None) => "not compared",
        };
        let what = match files.result.recording {
            Recording::Log => "log  ",
            Recording::Moves => "moves",
        };
        let _ = writeln!(out, "{what}   {same}");
        let _ = writeln!(out, "report  {}", files.report.display());
    }
    out
}

/// Number of differing columns that are named.
const COLUMNS: usize = 8;

/// The first columns of a list, and how many more there are.
fn in_short(columns: &[String]) -> String {
    let more = columns.len().saturating_sub(COLUMNS);
    let mut out = columns[..columns.len() - more].join(", ");
    if more > 0 {
        let _ = write!(out, " and {more} more columns");
    }
    out
}

/// The findings of a table, in a few lines.
pub(super) fn findings(
    table: &Path,
    findings: &Findings,
    pairs: Option<&Pairs>,
    page: Option<&Path>,
) -> String {
    let mut out = format!("rows    {}\n", findings.rows);
    let passed = findings.passed.iter().map(|(cell, rate)| {
        let cell = if cell.is_empty() { "all cases" } else { cell };
        let [low, high] = rate.exact.map(|share| 1e2 * share);
        format!(
            "passed  {} of {} ({low:.2} to {high:.2} %): {cell}",
            rate.met, rate.of
        )
    });
    out += &listed(
        passed,
        "passed  and",
        "more cells: the page and --json have them all",
    );
    let paired = findings.paired.iter().map(pair);
    out += &listed(
        paired,
        "paired  and",
        "more: the page and --json have them all",
    );
    for p in pairs.iter().map(|pairs| &pairs.paired) {
        out += &pair(p);
        out.push('\n');
    }
    if let Some(pairs) = pairs {
        let _ = writeln!(
            out,
            "logs    {} of {} bit-identical",
            pairs.same_log, pairs.paired.pairs
        );
    }
    if let Some(worst) = findings.worst.first() {
        let why = match (&worst.nearest, worst.missed.as_slice()) {
            (Some(nearest), _) => format!("passed, {nearest}"),
            (None, []) => worst.status.clone(),
            (None, missed) => format!("missed {}", missed.join(", ")),
        };
        let _ = writeln!(out, "worst   {}: {why}", worst.case);
    }
    if let Some(page) = page {
        let _ = writeln!(out, "report  {}", page.display());
    }
    if let Some(worst) = findings.worst.first() {
        let table = table.display();
        let _ = writeln!(
            out,
            "next    wheeleg campaign replay {table} {}",
            worst.case
        );
    }
    out
}

/// Number of lines of a list that are printed.
const LISTED: usize = 20;

/// The first lines of a list. If there are more, a final line has their number between the two texts.
fn listed(lines: impl ExactSizeIterator<Item = String>, before: &str, after: &str) -> String {
    let more = lines.len().saturating_sub(LISTED);
    let mut out: String = lines.take(LISTED).map(|line| line + "\n").collect();
    if more > 0 {
        let _ = writeln!(out, "{before} {more} {after}");
    }
    out
}

fn pair(p: &Paired) -> String {
    format!(
        "paired  {}: {} lost, {} gained, {} the same ({})",
        p.what,
        p.passed.lost,
        p.passed.gained,
        p.passed.same,
        p_equals(p.passed.p)
    )
}

/// The findings as JSON.
pub(super) fn findings_json(findings: &Findings, against: Option<&Pairs>) -> String {
    schema::indented(&ReportForm { findings, against })
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_campaign::report::Rate;

    /// Number of lines that begin with a word, and the last of them.
    fn lines(text: &str, word: &str) -> (usize, String) {
        let own = text.lines().filter(|line| line.starts_with(word));
        let own: Vec<&str> = own.collect();
        (
            own.len(),
            own.last().copied().unwrap_or_default().to_owned(),
        )
    }

    #[test]
    fn of_many_columns_that_differ_the_first_are_named() {
        let columns: Vec<String> = (0..10).map(|i| format!("c{i}")).collect();
        assert_eq!(in_short(&columns[..2]), "c0, c1");
        let told = in_short(&columns);
        assert!(
            told.starts_with("c0, ") && told.ends_with("c7 and 2 more columns"),
            "{told}"
        );
    }

    #[test]
    fn of_very_many_cells_pairs_and_bad_parts_the_first_are_listed_and_the_others_counted() {
        for (count, told) in [(20, 20), (150, 21)] {
            let numbers = || (0..count).map(|i: i32| i.to_string());
            let passed = numbers().map(|cell| (cell, Rate::default())).collect();
            let paired = numbers()
                .map(|what| Paired {
                    what,
                    ..Paired::default()
                })
                .collect();
            let findings = Findings {
                passed,
                paired,
                ..Findings::default()
            };
            let text = super::findings(Path::new("cases.parquet"), &findings, None, None);
            let (cells, last) = lines(&text, "passed  ");
            assert_eq!(cells, told, "{text}");
            assert_eq!(lines(&text, "paired  ").0, told, "{text}");
            assert_eq!(
                told == 21,
                last == "passed  and 130 more cells: the page and --json have them all"
            );
            let bad: Vec<_> = numbers()
                .map(|part| (part.into(), "torn".to_owned()))
                .collect();
            let (parts, last) = lines(&bad_parts(&bad), "bad     ");
            assert_eq!(parts, told, "{last}");
            assert_eq!(
                told == 21,
                last == "bad     and 130 more: --json has them all"
            );
        }
    }
}
