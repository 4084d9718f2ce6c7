//! `wheeleg campaign`: one scenario or cylinder many times, on as many computers as are available.

mod print;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::{Args, Subcommand, ValueEnum};
use wheeleg_campaign::report::Report;
use wheeleg_campaign::{
    CampaignError, Cases, Options, PlanFile, Shard, Store, Submission, isolated, merge,
    merge_partial, replay, run, simulate, status,
};
use wheeleg_config::plan::{KeepLogs, Plan};
use wheeleg_studies::StudyError;
use wheeleg_studies::run::log_bytes;
use wheeleg_studies::study::Signal;

use super::exit::{self, CANNOT_WRITE, FAILED, INCOMPLETE, TARGETS_MISSED, TRY_AGAIN};
use super::{print, show, stop_on_signals, tell, tell_error, tell_unwritten, whole};

/// Arguments of `wheeleg campaign`.
#[derive(Debug, Args)]
#[command(after_help = exit::help(exit::CAMPAIGN))]
pub(super) struct CampaignArgs {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a campaign, or a shard of it. If it was killed or stopped, run it again to continue.
    Run(RunArgs),
    /// Submit the shards of a campaign to Slurm, or print a job for Kubernetes.
    Submit(SubmitArgs),
    /// Show the progress of a campaign; needs only its folder.
    Status(StatusArgs),
    /// Merge the parts in one or more folders into one table.
    Merge(MergeArgs),
    /// Make a page from a table: rates with intervals, distributions, correlations, worst cases.
    Report(ReportArgs),
    /// Repeat one case, with its row, log, figures and report.
    Replay(ReplayArgs),
    /// Run one case and write its row to a file; `run` does this for a case that may crash the process.
    #[command(hide = true)]
    Case(CaseArgs),
}

#[derive(Debug, Args)]
struct RunArgs {
    /// Built-in plan, path of a TOML file, or `plan.json` of a folder.
    plan: String,
    /// Folder for the parts [default: runs/<plan>].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Run only every N-th block, starting with the I-th (from 0) [default: the shard of the Slurm
    /// array or of the indexed Kubernetes job, if there is one].
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Completions of an indexed Kubernetes job.
    #[arg(long, value_name = "N", value_parser = whole(1_u64, 1_000_000))]
    shards: Option<u64>,
    /// Number of threads [default: all cores].
    #[arg(long, value_name = "N", value_parser = whole(1_u64, 4096))]
    threads: Option<u64>,
    /// Run only the first cases, as a pilot; a later run continues from them.
    #[arg(long, value_name = "N", value_parser = whole(1_u64, u64::MAX))]
    first: Option<u64>,
    /// Print the cases instead of running them.
    #[arg(long)]
    list: bool,
    /// Exit with code 1 if a case of this shard misses a required target or has no result.
    #[arg(long)]
    strict: bool,
    /// Form of the progress report: a bar, or a line every 30 s if standard error is not a terminal; or lines
    /// of JSON.
    #[arg(long, value_enum, default_value = "bar")]
    progress: Shown,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Shown {
    Bar,
    Json,
}

#[derive(Debug, Args)]
struct SubmitArgs {
    /// Built-in plan, or path of a TOML file.
    plan: String,
    /// Folder for the parts, on a disk that all computers share.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of tasks.
    #[arg(long, value_name = "N", value_parser = whole(1_u64, 1_000_000))]
    shards: u64,
    /// Submit a Slurm array, and a job that merges its results.
    #[arg(long, required_unless_present = "kubernetes")]
    slurm: bool,
    /// Print an indexed Kubernetes job, for `kubectl apply -f -`.
    #[arg(long, conflicts_with = "slurm")]
    kubernetes: bool,
    /// Print what would be submitted instead of submitting it; writes nothing.
    #[arg(long)]
    dry_run: bool,
    /// Further argument of sbatch, such as `--partition=long`; may be given several times.
    #[arg(long = "slurm-arg", value_name = "ARG", allow_hyphen_values = true)]
    slurm_args: Vec<String>,
    /// Image with this program.
    #[arg(long, value_name = "IMAGE", default_value = "wheeleg")]
    image: String,
    /// Claim of a volume that all pods can write to; it holds the campaign's folder.
    #[arg(long, value_name = "CLAIM", default_value = "wheeleg-campaign")]
    claim: String,
}

#[derive(Debug, Args)]
struct StatusArgs {
    /// Folder of a campaign.
    dir: PathBuf,
    /// Show only one shard.
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Print the status every two seconds until all cases have a row.
    #[arg(long)]
    watch: bool,
    /// Print the status as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct MergeArgs {
    /// Folders of one campaign.
    #[arg(required = true)]
    dirs: Vec<PathBuf>,
    /// Table to write; a missing folder is created [default: cases.parquet in the first DIR].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Merge even if cases are missing: a table of the finished cases, for example of a pilot.
    #[arg(long)]
    partial: bool,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct ReportArgs {
    /// Table of `wheeleg campaign merge`.
    table: PathBuf,
    /// Second table, from another version of the program, for a case-by-case comparison.
    #[arg(long, value_name = "FILE")]
    against: Option<PathBuf>,
    /// Page to write [default: next to the table].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print the findings as JSON on stdout.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct ReplayArgs {
    /// Folder of a campaign, or its merged table.
    from: PathBuf,
    /// The case: its id or the beginning of it, from 4 characters, or its index in the plan.
    case: String,
    /// Folder for log, figures and report [default: runs/<plan>-<case>].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    drawing: super::Drawing,
}

#[derive(Debug, Args)]
struct CaseArgs {
    dir: PathBuf,
    index: u64,
    #[arg(long)]
    row: PathBuf,
}

/// Runs the command. Errors have their own exit codes.
pub(super) fn command(args: &CampaignArgs) -> Result<ExitCode, StudyError> {
    let result = match &args.command {
        Command::Run(args) => run_command(args),
        Command::Submit(args) => submit_command(args),
        Command::Status(args) => status_command(args),
        Command::Merge(args) => merge_command(args),
        Command::Report(args) => report_command(args),
        Command::Replay(args) => replay_command(args),
        Command::Case(args) => case_command(args),
    };
    Ok(result.unwrap_or_else(|error| {
        let code = error.exit_code();
        tell_error(error);
        ExitCode::from(code)
    }))
}

/// Exit code of a command that a signal has stopped: a scheduler restarts what it has ended.
fn stopped_code(signal: Signal) -> u8 {
    match signal {
        Signal::Interrupt => signal.exit_code(),
        Signal::Terminate | Signal::HangUp => TRY_AGAIN,
    }
}

/// A plan and its `plan.json`.
fn plan_of(name_or_path: &str) -> Result<(Plan, PlanFile), CampaignError> {
    let is_json = Path::new(name_or_path)
        .extension()
        .is_some_and(|e| e == "json");
    if is_json {
        let file = PlanFile::read(Path::new(name_or_path))?.for_this_program();
        return Ok((file.plan()?, file));
    }
    let plan = Plan::load(name_or_path)?;
    let file = PlanFile::of(&plan, Cases::new(&plan)?.work_s());
    Ok((plan, file))
}

fn run_command(args: &RunArgs) -> Result<ExitCode, CampaignError> {
    let (plan, file) = plan_of(&args.plan)?;
    let cases = Cases::new(&plan)?;
    if args.list {
        cases.ensure_possible()?;
        return Ok(print::list(&cases, args.first.unwrap_or(u64::MAX))?);
    }
    let variable = |name: &str| std::env::var(name).ok();
    let shard = Shard::choose(args.shard, args.shards, &variable)?;
    cases.ensure_possible()?;
    let out = args.out.clone();
    let out = out.unwrap_or_else(|| Path::new("runs").join(&plan.name));
    announce(&cases, args.first);
    if let Some(idle) = print::idle(&file, shard) {
        tell(&idle);
    }
    let stop = stop_on_signals()?;
    let store = Store::create(&out, file, &stop)?;
    let whole = Options::whole(&stop);
    let options = Options {
        shard,
        threads: args.threads.map_or(whole.threads, |n| n as usize),
        first: args.first,
        program: std::env::current_exe().ok(),
        json: args.progress == Shown::Json,
        ..whole
    };
    let simulate = |case: &_| simulate(case, plan.limit_s, &stop);
    let begun = Instant::now();
    let ran = run(&store, &cases, &options, &simulate)?;
    let took = begun.elapsed();
    for (path, why) in &ran.aside {
        tell(&format!("set aside: {}: {why}", path.display()));
    }
    let pilot = args.first.map(|_| print::Took {
        took,
        threads: options.threads,
    });
    show(&print::ran(&ran, &store, shard, pilot))?;
    if let Some(signal) = ran.stopped {
        tell(&format!(
            "{} with {} of {} cases done; run the same command again to continue",
            signal.label(),
            ran.found + ran.computed,
            ran.of
        ));
        return Ok(ExitCode::from(stopped_code(signal)));
    }
    if args.strict && status(&store, shard)?.failed > 0 {
        return Ok(ExitCode::from(TARGETS_MISSED));
    }
    Ok(ExitCode::SUCCESS)
}

/// Size from which the disk space of a campaign's logs is announced, bytes.
const MUCH_BYTES: f64 = 1e9;

/// Announces the disk space of the logs, if every case keeps its log.
fn announce(cases: &Cases<'_>, first: Option<u64>) {
    let plan = cases.plan();
    if plan.keep != KeepLogs::All {
        return;
    }
    let count = plan.cases().min(first.unwrap_or(u64::MAX));
    let bytes = count as f64 * log_bytes(cases.duration_s());
    if bytes > MUCH_BYTES {
        let gigabytes = bytes * 1e-9;
        tell(&format!(
            "`keep` = \"all\": the logs of {count} cases take about {gigabytes:.0} GB"
        ));
    }
}

fn submit_command(args: &SubmitArgs) -> Result<ExitCode, CampaignError> {
    let (plan, file) = plan_of(&args.plan)?;
    let cases = Cases::new(&plan)?;
    cases.ensure_possible()?;
    let program = std::env::current_exe().unwrap_or_else(|_| PathBuf::from("wheeleg"));
    let (paths, case_s) = ([&*program, &*args.out], cases.work_s());
    let submission = Submission::new(&file, &plan.name, paths, args.shards, case_s)?;
    Store::ensure_not_of_another(&args.out, &file)?;
    let manifest = || submission.kubernetes(&args.image, &args.claim);
    if args.dry_run {
        return Ok(print(&match args.kubernetes {
            true => manifest(),
            false => print::slurm(&submission, &args.slurm_args),
        })?);
    }
    if args.slurm {
        submission.ensure_slurm_allows()?;
    }
    let stop = stop_on_signals()?;
    Store::create(&args.out, file, &stop)?;
    if let Some(signal) = stop.signal() {
        tell(&format!(
            "{} before anything was submitted; run the same command again",
            signal.label()
        ));
        return Ok(ExitCode::from(stopped_code(signal)));
    }
    let text = if args.kubernetes {
        manifest()
    } else {
        let [array, merge] = submission.submit_to_slurm(&args.slurm_args)?;
        format!(
            "array   {array}\nmerge   {merge}\nfolder  {}\n",
            submission.folder
        )
    };
    Ok(print(&text)?)
}

fn status_command(args: &StatusArgs) -> Result<ExitCode, CampaignError> {
    let store = Store::open(&args.dir)?;
    let shard = args.shard.unwrap_or(Shard::ALL);
    let stop = stop_on_signals()?;
    stop.begin();
    loop {
        let state = status(&store, shard)?;
        if args.json {
            print(&print::state_json(&state))?;
        } else {
            show(&print::state(&state, &store, shard))?;
        }
        let complete = state.missing.is_empty();
        if complete || !args.watch {
            return Ok(if complete {
                ExitCode::SUCCESS
            } else {
                ExitCode::from(INCOMPLETE)
            });
        }
        for _ in 0..20 {
            if let Some(signal) = stop.signal() {
                return Ok(ExitCode::from(stopped_code(signal)));
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}

fn merge_command(args: &MergeArgs) -> Result<ExitCode, CampaignError> {
    let stop = stop_on_signals()?;
    let merge = if args.partial { merge_partial } else { merge };
    let out = match (&args.out, args.dirs.first()) {
        (Some(out), _) => out.clone(),
        (None, first) => first.cloned().unwrap_or_default().join("cases.parquet"),
    };
    let Some(merged) = merge(&args.dirs, &out, &stop)? else {
        tell("stopped; no table was written, and the parts are unchanged");
        return Ok(ExitCode::from(stop.signal().map_or(FAILED, stopped_code)));
    };
    Ok(if args.json {
        print(&print::merged_json(&merged, &out))
    } else {
        show(&print::merged(&merged, &out))
    }?)
}

fn report_command(args: &ReportArgs) -> Result<ExitCode, CampaignError> {
    let out = args.out.clone();
    let out = out.unwrap_or_else(|| args.table.with_extension("html"));
    let stop = stop_on_signals()?;
    let report = Report::of(&args.table, args.against.as_deref())?;
    // A page that has been begun is finished.
    stop.begin();
    // Print the findings even if there is no room for the page.
    let written = report.write(&out);
    let (findings, pairs) = (&report.findings, report.pairs.as_ref());
    let page = written.is_ok().then_some(&*out);
    if args.json {
        print(&print::findings_json(findings, pairs))?;
    } else {
        show(&print::findings(&args.table, findings, pairs, page))?;
    }
    written?;
    Ok(ExitCode::from(stop.signal().map_or(0, stopped_code)))
}

fn replay_command(args: &ReplayArgs) -> Result<ExitCode, CampaignError> {
    let stop = stop_on_signals()?;
    stop.begin();
    let out = args.out.as_deref();
    let replayed = replay(&args.from, &args.case, out, args.drawing.png, &stop)?;
    let stopped = || stop.signal().map_or(FAILED, stopped_code);
    let Some(replayed) = replayed else {
        tell("stopped before the end of the case; nothing was written");
        return Ok(ExitCode::from(stopped()));
    };
    show(&print::replayed(&replayed))?;
    let same = replayed.same_row() != Some(false) && replayed.same_recording() != Some(false);
    if let Some(files) = replayed.files {
        if !tell_unwritten(files.unwritten) {
            return Ok(ExitCode::from(CANNOT_WRITE));
        }
        if let Some(why) = files.stopped {
            tell(&format!(
                "{why}; the files hold the results up to that point"
            ));
            return Ok(ExitCode::from(stopped()));
        }
    }
    if same {
        return Ok(ExitCode::SUCCESS);
    }
    Err(StudyError::refused(
        "the result of the case has changed",
        "another version of the program may give other rows; if it is the same version, please report this",
    )
    .into())
}

fn case_command(args: &CaseArgs) -> Result<ExitCode, CampaignError> {
    let store = Store::open(&args.dir)?;
    let limit_s = store.plan().plan()?.limit_s;
    let stop = stop_on_signals()?;
    stop.begin();
    let simulate = |case: &_| simulate(case, limit_s, &stop);
    Ok(if isolated(&store, args.index, &args.row, &simulate)? {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(TRY_AGAIN)
    })
}
