//! The files of one case: summary, tables, figures and page.

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_config::bench::{Bench, Move};
use wheeleg_report::number::{counted, listed};
use wheeleg_report::plot::Figure;
use wheeleg_report::results::CSV;
use wheeleg_report::{Picture, page, pictures};
use wheeleg_telemetry::messages::within;

use super::{About, PlayedBench, targets};
use crate::StudyError;
use crate::analysis::{Judgement, Target};
use crate::axis_sim::Latched;
use crate::compare::{trace_csv, trace_figure};
use crate::study::schema::json;
use crate::study::{self, Drawn, Finished, Job, Settings};

const TEMPLATE: &str = include_str!("page.html");

/// A fault that the board latched.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BenchFault {
    /// Its name.
    pub name: &'static str,
    /// Recording in which it was latched: `first`, `measured-1` or `measured-2`.
    pub recording: String,
    /// Time from the start of that recording, s.
    pub at_s: f64,
    /// What it means.
    pub meaning: &'static str,
    /// What to do.
    pub remedy: &'static str,
}

/// Contents of `summary.json`.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct BenchSummary {
    /// The case.
    #[serde(flatten)]
    pub about: About,
    /// Version of the program.
    pub version: &'static str,
    /// Simulated time, s, without the search for the valves' delays.
    pub simulated_s: f64,
    /// Force on the rod at power-up, N, positive extends: that of the plant, of `load_share` and of a contact.
    pub load_n: f64,
    /// Names of the faults that the board latched.
    pub faults: Vec<&'static str>,
    /// The same with their times, in the order in which they were latched. A fault latched in the move between
    /// the first and the measured ones, which is not recorded, has the time 0 of the next recording.
    pub latched: Vec<BenchFault>,
    /// Whether every required target is met.
    pub passed: bool,
    /// Targets with values and verdicts.
    pub targets: Vec<Target>,
}

impl study::Summary for BenchSummary {
    const SCHEMA: &'static str = "wheeleg.bench/1";
}

impl BenchSummary {
    /// Of a case.
    #[must_use]
    pub fn of(bench: &Bench, seed: u64, case: &PlayedBench) -> Self {
        let targets = targets(bench, case);
        let traces = || case.played.traces();
        let faults = traces()
            .map(|(_, trace)| trace.faults)
            .reduce(|all, other| all.union(other));
        Self {
            about: About::of(bench, seed),
            version: env!("CARGO_PKG_VERSION"),
            simulated_s: case.simulated_s,
            load_n: traces()
                .find_map(|(_, trace)| trace.rows.first())
                .map_or(0.0, |row| row.load_n),
            latched: latched(case),
            faults: faults
                .iter()
                .flat_map(|all| all.iter())
                .map(|f| f.name())
                .collect(),
            passed: targets.iter().all(|t| t.pass || !t.required),
            targets,
        }
    }

    /// The page's first sentence.
    fn verdict(&self) -> String {
        let missed: Vec<String> = (self.targets.iter())
            .filter(|target| target.judgement() == Judgement::Missed)
            .map(Target::name_text)
            .collect();
        let required = self.targets.iter().filter(|target| target.required).count();
        match missed.len() {
            0 => format!("All {required} required targets are met"),
            n => format!(
                "{} of {required} required targets missed: {}",
                counted(n, "target", "targets"),
                listed(&missed)
            ),
        }
    }
}

/// The faults of a case, each with its first time.
fn latched(case: &PlayedBench) -> Vec<BenchFault> {
    let mut all: Vec<BenchFault> = Vec::new();
    for (recording, trace) in case.played.traces() {
        for Latched { at_s, fault } in &trace.latched {
            all.push(BenchFault {
                name: fault.name(),
                recording: recording.clone(),
                at_s: *at_s,
                meaning: fault.sentence(),
                remedy: fault.remedy(),
            });
        }
    }
    all
}

/// A target on the page.
#[derive(Serialize)]
struct Line<'a> {
    id: &'a str,
    description: &'a str,
    measured: String,
    asked: String,
    judgement: &'static str,
    class: Judgement,
}

/// A fault on the page.
#[derive(Serialize)]
struct Told<'a> {
    fault: &'a BenchFault,
    /// The recording, in words.
    recording: String,
}

#[derive(Serialize)]
struct Page<'a> {
    stopped: Option<String>,
    verdict: String,
    about: &'a About,
    load_n: f64,
    faults: Vec<Told<'a>>,
    missed: Vec<&'a Line<'a>>,
    targets: &'a [Line<'a>],
    /// Which moves are measured, in a sentence or two.
    measured: &'static str,
    figures: Vec<Picture<'a>>,
    version: &'static str,
}

/// Writes a case: `summary.json`, a table and a figure of every move, and the page; earlier results in the
/// folder are set aside.
///
/// # Errors
/// [`StudyError`] if the folder cannot be used.
pub fn write(
    bench: &Bench,
    seed: u64,
    case: &PlayedBench,
    settings: &Settings,
) -> Result<Finished<BenchSummary>, StudyError> {
    let job = Job::begin("case", settings, &[])?;
    let summary = BenchSummary::of(bench, seed, case);
    let text = json(&summary, None);
    Ok(job.finish(summary, text, None, |job, summary| {
        job.keep(job.subfolder(CSV));
        let mut figures: Vec<Figure> = Vec::new();
        for (name, trace) in case.played.traces() {
            job.keep(job.save(&format!("{CSV}/{name}.csv"), &trace_csv(trace)));
            figures.push(trace_figure(&name, title(bench.motion, &name), trace));
        }
        let drawn = job.draw(figures);
        (render(summary, bench.motion, &drawn), drawn)
    }))
}

fn title(motion: Move, name: &str) -> &str {
    match (motion, name) {
        (Move::FirstStep, _) | (_, "first") => "The first move after power-up",
        (_, "measured-1") => "The first measured move",
        _ => "The second measured move",
    }
}

/// Which moves are measured.
fn measured(motion: Move) -> &'static str {
    match motion {
        Move::FirstStep => {
            "The measured move is the first one after power-up: the board has learnt nothing."
        }
        _ => {
            "Of several measured moves, the worse. The first move after power-up is not one of them: in it the board \
             learns."
        }
    }
}

fn render(summary: &BenchSummary, motion: Move, drawn: &[Drawn]) -> Result<String, StudyError> {
    let lines: Vec<Line<'_>> = (summary.targets.iter())
        .map(|target| Line {
            id: &target.id,
            description: &target.description,
            measured: target.measured_text(),
            asked: target.asked_text(),
            judgement: target.judgement().word(),
            class: target.judgement(),
        })
        .collect();
    let missed = lines.iter().filter(|l| l.class == Judgement::Missed);
    let faults = summary.latched.iter().map(|fault| Told {
        fault,
        recording: within(title(motion, &fault.recording)),
    });
    let values = Page {
        stopped: None,
        verdict: summary.verdict(),
        about: &summary.about,
        load_n: summary.load_n,
        faults: faults.collect(),
        missed: missed.collect(),
        targets: &lines,
        measured: measured(motion),
        figures: pictures(drawn),
        version: summary.version,
    };
    Ok(page(TEMPLATE, values)?)
}
