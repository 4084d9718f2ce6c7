//! Built-in files with mistakes in them: scenarios, robots, axes and plans of campaigns, with wrong units,
//! signs and magnitudes, swapped lines, sections pasted from other files. Each runs or is refused in words;
//! none panics, hangs, writes outside its folder, or leaves physics without a message.
//!
//! Two hundred here; `cargo xtask deep practice` takes more, with numbers of their own.

use std::num::NonZero;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, mpsc};
use std::time::Duration;
use std::{fmt, fs, thread};

use crate::long_checks::number;
use miette::Diagnostic;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use wheeleg_campaign::Cases;
use wheeleg_config::{AxisConfig, axis, builtin, plan::Plan};
use wheeleg_remote_host::Nodes;
use wheeleg_studies::axis_sim::plant_check;
use wheeleg_studies::run::{Options, run};
use wheeleg_studies::study::{Signal, Stop};
use wheeleg_studies::{StudyError, compare};

mod mutate;

use mutate::mutate;

/// How many files, and the number of the first.
const FILES_VARIABLE: &str = "WHEELEG_MUTATED_FILES";
const FIRST_VARIABLE: &str = "WHEELEG_MUTATED_FIRST";
const FILES: u64 = 200;
const FEW_FILES: u64 = 20;
/// A run that is not over is stopped with Ctrl-C then; a mistake may have made it a long one.
const PATIENCE: Duration = Duration::from_secs(10);
/// A run that continues after that hangs. It may share its processor with others.
const HUNG: Duration = Duration::from_secs(120);
/// Simulated time of a run that has not got another by mistake, s.
const DURATION_S: f64 = 0.3;

/// Kind of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Scenario,
    Robot,
    Axis,
    Plan,
}

/// Kinds, as often as they are drawn.
const KINDS: [Kind; 7] = [
    Kind::Scenario,
    Kind::Scenario,
    Kind::Scenario,
    Kind::Robot,
    Kind::Robot,
    Kind::Axis,
    Kind::Plan,
];

/// Outcome of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Fate {
    /// It was run to its end, or until it was stopped.
    Ran,
    /// Its run ended early; the reason given to the user.
    Ended(String),
    /// It was refused; the reason given to the user.
    Refused(String),
}

/// Every built-in file. Scenarios are short, and their events come early.
fn files() -> Vec<(Kind, String)> {
    let scenarios = builtin::SCENARIOS.iter().map(|(.., text)| {
        let lines = text.lines().map(|line| {
            if line.starts_with("duration = ") {
                format!("duration = {{ value = {DURATION_S}, unit = \"s\" }}\n")
            } else if line.starts_with("at = ") {
                "at = { value = 0.1, unit = \"s\" }\n".to_owned()
            } else {
                format!("{line}\n")
            }
        });
        (Kind::Scenario, lines.collect())
    });
    let of = |kind, list: &'static [(&str, &str, &str)]| {
        list.iter()
            .map(move |(.., text)| (kind, (*text).to_owned()))
    };
    scenarios
        .chain(of(Kind::Robot, builtin::ROBOTS))
        .chain(of(Kind::Axis, axis::AXES))
        .chain(of(Kind::Plan, builtin::PLANS))
        .collect()
}

/// A standing robot, to test robot files.
const STAND: &str = "name = \"stand\"\ndescription = \"\"\nrobot = \"wheeleg\"\n\
    duration = \"0.3 s\"\nseed = 1\ntargets = \"stand\"\n[motion]\nkind = \"stand\"\n";

/// Returns the messages to the user, and checks that they are in words: the file, the field or section, what
/// about it, and no value in a program's debug format.
fn messages(error: &dyn Diagnostic, file: &str) -> String {
    let mut text = error.to_string();
    let mut remedy = error.help().is_some() || error.related().is_some();
    for problem in error.related().into_iter().flatten() {
        let said = problem.to_string();
        let of_file = text.contains("mutant.toml") || text.contains("stand.toml");
        assert!(of_file, "no file: {text}\n{said}");
        let field = said.contains('`') || said.contains('[') || said.contains("not valid TOML");
        assert!(field, "no field: {said}");
        text += &format!("\n{said}");
        remedy |= problem.help().is_some();
    }
    if let (None, Some(help)) = (error.related(), error.help()) {
        // Of a run that ended: the field, the section, or at least the file.
        let whole = format!("{text}: {help}");
        let named = whole.contains(['`', '[']) || whole.contains(".toml");
        assert!(named, "no field: {whole}");
    }
    assert!(error.code().is_some(), "no code: {text}");
    assert!(remedy, "no remedy: {text}");
    assert!(text.len() < 20_000, "too long: {} bytes", text.len());
    ensure_words(&text, file);
    text
}

/// Whether a text has a word in it that a program writes for itself: of the file's own values, which
/// are quoted as they stand, it has those that the file has.
fn program_word(text: &str, file: &str) -> Option<String> {
    // A value of the file such as `= { value = 1 }` is in braces as well, but behind no name.
    let braces = |at: usize| {
        let before = text[..at].chars().next_back();
        before.is_some_and(|c| c.is_ascii_alphanumeric())
    };
    if text.match_indices(" { ").any(|(at, _)| braces(at)) {
        return Some(" { ".to_owned());
    }
    let of_program = ["Some(", "None", "Err(", "Ok(", "::", "PlantError"];
    let found = of_program.into_iter().find(|word| {
        // The TOML parser quotes the tokens that it expected.
        text.contains(word) && !file.contains(word) && !text.contains("not valid TOML")
    });
    let not_a_number = |text: &str| {
        let words = text.split(|c: char| !c.is_ascii_alphanumeric());
        words
            .filter(|word| ["nan", "inf"].contains(&word.to_ascii_lowercase().as_str()))
            .count()
    };
    match found {
        Some(word) => Some(word.to_owned()),
        None => {
            (not_a_number(text) > 0 && not_a_number(file) == 0).then(|| "nan or inf".to_owned())
        }
    }
}

fn ensure_words(text: &str, file: &str) {
    let found = program_word(text, file);
    assert!(
        found.is_none(),
        "`{}` in: {text}",
        found.unwrap_or_default()
    );
}

#[test]
fn words_of_a_program_are_noticed() {
    for (text, file) in [
        ("`moving.mass` = NaN kg", "mass = 1"),
        ("it is -nan m", "x = 1"),
        ("it is inf m", "x = 1"),
        ("`x` = Some(3)", "x = 3"),
        ("Order { field: 3 }", "x = { value = 3 }"),
        ("wheeleg_config::x", ""),
        ("it is nan m away from None", "x = nan"),
    ] {
        assert!(program_word(text, file).is_some(), "{text}");
    }
    for (text, file) in [
        ("`x` = nan must be a number", "x = nan"),
        ("`x` = { value = 3 } must", "x = { value = 3 }"),
        ("the maintenance of information", ""),
    ] {
        assert_eq!(program_word(text, file), None, "{text}");
    }
}

fn options(scenario: &Path, robot: Option<&Path>, out: &Path) -> Options {
    let text = |path: &Path| path.to_string_lossy().into_owned();
    Options {
        scenario: text(scenario),
        robot: robot.map(text),
        law: None,
        seed: None,
        nodes: Nodes::default(),
        faults: Vec::new(),
        out: Some(out.to_owned()),
        png: false,
        compared: false,
    }
}

/// Runs and judges; its log must have numbers of this world.
fn played(options: &Options, text: &str, stop: &Stop) -> Result<Fate, StudyError> {
    let finished = run(options, stop)?;
    let out = finished.report.parent().expect("a folder");
    assert!(out.join("summary.json").exists(), "no summary");
    assert!(finished.unwritten.is_empty());
    let mut looked_at = 0;
    let read = wheeleg_telemetry::read(&out.join("log.mcap"), &mut |logged| {
        for (name, least, most) in [
            // Four times the highest source that a file may have.
            ("pressure_a_bar", 0.0, 100.1),
            ("pressure_b_bar", 0.0, 100.1),
            ("pressure_bar", 0.0, 100.1),
            ("velocity_mm_s", -1e5, 1e5),
            ("speed_mm_s", -1e5, 1e5),
        ] {
            if let Some(value) = logged.number(name) {
                // So is one that is not a number.
                let sound = least < value && value < most;
                assert!(sound, "{name} = {value}, and nobody said so");
                looked_at += 1;
            }
        }
        ControlFlow::Continue(())
    });
    assert!(read.expect("a log").whole, "the log breaks off");
    let failed = finished.result.failure.is_some();
    assert!(
        failed || looked_at > 0,
        "a log without a pressure or a speed"
    );
    Ok(match finished.result.failure {
        Some(failure) => Fate::Ended(messages(&failure, text)),
        None => Fate::Ran,
    })
}

fn refused(error: &dyn Diagnostic, text: &str) -> Fate {
    Fate::Refused(messages(error, text))
}

/// Outcome of running a file of a kind.
fn fate(kind: Kind, file: &Path, stop: &Stop) -> Fate {
    let folder = file.parent().expect("a folder");
    let out = folder.join("out");
    let text = &std::fs::read_to_string(file).unwrap_or_default();
    match kind {
        Kind::Scenario => {
            played(&options(file, None, &out), text, stop).unwrap_or_else(|e| refused(&e, text))
        }
        Kind::Robot => {
            let stand = folder.join("stand.toml");
            played(&options(&stand, Some(file), &out), text, stop)
                .unwrap_or_else(|e| refused(&e, text))
        }
        Kind::Axis => axis_fate(file, text),
        Kind::Plan => plan_fate(file, text, stop).unwrap_or_else(|e| refused(&e, text)),
    }
}

fn axis_fate(file: &Path, text: &str) -> Fate {
    let config = match AxisConfig::from_path(file) {
        Ok(config) => config,
        Err(error) => return refused(&error, text),
    };
    match plant_check::check(&config.axis) {
        Ok(check) => {
            let finite = |f: &plant_check::Finding| f.value.is_finite();
            assert!(check.findings.iter().all(finite), "{:#?}", check.findings);
        }
        // The command's own words are tested with it.
        Err(error) => {
            ensure_words(&error.to_string(), text);
            return Fate::Ended(error.to_string());
        }
    }
    let id = format!("{}/predictive/step-100/nominal/1", config.name);
    let id = id.parse().expect("a case");
    match compare::play(&id, &[file.to_string_lossy().into_owned()]) {
        Ok(_) => Fate::Ran,
        Err(error) => refused(&error, text),
    }
}

fn plan_fate(
    file: &Path,
    text: &str,
    stop: &Stop,
) -> Result<Fate, wheeleg_campaign::CampaignError> {
    let plan = Plan::load(&file.to_string_lossy())?;
    let cases = Cases::new(&plan)?;
    cases.ensure_possible()?;
    let limit_s = Some(plan.limit_s.unwrap_or(DURATION_S).min(DURATION_S));
    for index in [0, plan.cases() - 1] {
        if let Some(error) = wheeleg_campaign::simulate(&cases.case(index), limit_s, stop)
            .and_then(|outcome| outcome.error)
        {
            ensure_words(&error, text);
        }
    }
    Ok(Fate::Ran)
}

/// Outcome of a file, run in its own thread; the message of a panic, or that it hangs.
fn judged(kind: Kind, file: PathBuf) -> Result<Fate, String> {
    let (sender, receiver) = mpsc::channel();
    let stop = Stop::default();
    let of_thread = stop.clone();
    thread::Builder::new()
        .stack_size(16 << 20)
        .spawn(move || {
            let fate = catch_unwind(AssertUnwindSafe(|| fate(kind, &file, &of_thread)));
            let _ = sender.send(fate.map_err(|panic| {
                let text = panic.downcast_ref::<String>().cloned();
                text.unwrap_or_else(|| format!("{:?}", panic.downcast_ref::<&str>()))
            }));
        })
        .expect("a thread");
    if let Ok(fate) = receiver.recv_timeout(PATIENCE) {
        return fate;
    }
    stop.ask(Signal::Interrupt);
    let late = receiver.recv_timeout(HUNG);
    late.unwrap_or_else(|_| Err(format!("still at work {HUNG:?} after Ctrl-C")))
}

/// A file in its own folder, with the files it may need beside it; its path.
fn laid_down(folder: &Path, text: &str) -> PathBuf {
    let data = builtin::DATA.iter();
    data.for_each(|(name, bytes)| fs::write(folder.join(name), bytes).expect("written"));
    fs::write(folder.join("stand.toml"), STAND).expect("written");
    let file = folder.join("mutant.toml");
    fs::write(&file, text).expect("written");
    file
}

/// Names of everything in a folder.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder").flatten();
    let names = entries.map(|e| e.file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.filter(|name| name != "out").collect();
    names.sort();
    names
}

/// How often each came.
#[derive(Default)]
struct Tally {
    ran: u64,
    ended: u64,
    refused: u64,
    wrong: Vec<String>,
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            ran,
            ended,
            refused,
            ..
        } = self;
        write!(f, "{ran} run, {ended} ended early, {refused} refused")
    }
}

/// Makes the file of a number, and reports the outcome.
fn try_one(files: &[(Kind, String)], number: u64, tally: &Mutex<Tally>) {
    let mut rng = Pcg64Mcg::seed_from_u64(number);
    let wanted = KINDS[rng.random_range(0..KINDS.len())];
    let of_kind: Vec<_> = files.iter().filter(|(kind, _)| *kind == wanted).collect();
    let (kind, text) = of_kind[rng.random_range(0..of_kind.len())];
    let (_, other) = &files[rng.random_range(0..files.len())];
    let mutant = mutate(&mut rng, text, other);
    // Anything written outside its folder lands in this one.
    let around = tempfile::tempdir().expect("temporary folder");
    let folder = around.path().join("its-own");
    fs::create_dir(&folder).expect("created");
    let file = laid_down(&folder, &mutant.text);
    let before = names(&folder);
    let fate = judged(*kind, file);
    let left = names(&folder) != before || names(around.path()) != ["its-own"];
    let told = format!("{number} {kind:?}{}: {fate:?}", mutant.what);
    println!("{told}");
    let mut tally = tally.lock().expect("no panic while it is held");
    match &fate {
        Ok(Fate::Ran) => tally.ran += 1,
        Ok(Fate::Ended(_)) => tally.ended += 1,
        Ok(Fate::Refused(_)) => tally.refused += 1,
        Err(_) => {}
    }
    if fate.is_err() || left {
        tally.wrong.push(format!("{told}, left its folder: {left}"));
    }
}

#[test]
fn a_few_are_run_or_refused_in_words() {
    are_run_or_refused_in_words(1, FEW_FILES);
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn each_is_run_or_refused_in_words() {
    let first = number(FIRST_VARIABLE, 1);
    are_run_or_refused_in_words(first, number(FILES_VARIABLE, FILES));
}

fn are_run_or_refused_in_words(first: u64, count: u64) {
    let files = files();
    let tally = Mutex::new(Tally::default());
    let next = AtomicU64::new(first);
    let processors = thread::available_parallelism().map_or(1, NonZero::get);
    thread::scope(|scope| {
        for _ in 0..processors {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= first + count {
                        break;
                    }
                    try_one(&files, number, &tally);
                }
            });
        }
    });
    let tally = tally.into_inner().expect("no panic while it is held");
    println!("{count} mutated files from number {first}: {tally}");
    assert!(tally.wrong.is_empty(), "{}", tally.wrong.join("\n"));
    // Mistakes of all kinds: some matter, some do not.
    let few = count / 10;
    assert!(tally.ran > few && tally.refused > few, "{tally}");
}
