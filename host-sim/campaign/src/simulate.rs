//! Simulates one case in memory; no file is written unless its log is requested.

use std::ops::ControlFlow;
use std::path::Path;

use wheeleg_config::bench::Bench;
use wheeleg_scene::Scene;
use wheeleg_sim::Boards;
use wheeleg_studies::StudyError;
use wheeleg_studies::analysis::Target;
use wheeleg_studies::bench::{self, BenchSummary, PlayedBench};
use wheeleg_studies::run::{self, Simulated};
use wheeleg_studies::study::Stop;
use wheeleg_telemetry::{Keep, LogFile, Recorder};

use crate::CampaignError;
use crate::cases::{Case, Setup};
use crate::reasons::why;
use crate::row::Status;

/// The result of a case.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// How the case ended.
    pub status: Status,
    /// What went wrong.
    pub error: Option<String>,
    /// Hash of the log up to where it ended.
    pub log_hash: Option<String>,
    /// Simulated time, start-up included, s.
    pub simulated_s: Option<f64>,
    /// Whether all required targets were met; `None` unless the case ran to its end.
    pub passed: Option<bool>,
    /// Targets; empty unless the case ran to its end.
    pub targets: Vec<Target>,
}

impl Outcome {
    /// An outcome without a result.
    pub(crate) fn without(status: Status, error: String) -> Self {
        Self {
            status,
            error: Some(error),
            log_hash: None,
            simulated_s: None,
            passed: None,
            targets: Vec::new(),
        }
    }
}

/// Simulates a case and judges it; returns `None` if `stop` was requested before its end. The case is given
/// up when the scenario's simulated time exceeds `limit_s`.
#[must_use]
pub fn simulate(case: &Case, limit_s: Option<f64>, stop: &Stop) -> Option<Outcome> {
    recorded(case, Recorder::new(Keep::nothing()), limit_s, stop)
}

/// Plays a case on the bench.
fn on_bench(bench: &Bench, seed: u64) -> Outcome {
    let played = match bench::play(bench, seed) {
        Ok(played) => played,
        Err(error) => return Outcome::without(Status::Error, error.to_string()),
    };
    let BenchSummary {
        faults,
        simulated_s,
        passed,
        targets,
        ..
    } = BenchSummary::of(bench, seed, &played);
    Outcome {
        status: Status::Ok,
        error: (!faults.is_empty()).then(|| format!("fault {}", faults.join(", "))),
        log_hash: Some(hash(&played)),
        simulated_s: Some(simulated_s),
        passed: Some(passed),
        targets,
    }
}

/// Hash of everything recorded.
pub(crate) fn hash(played: &PlayedBench) -> String {
    let mut hasher = blake3::Hasher::new_derive_key("wheeleg campaign bench v1");
    let mut bytes = Vec::new();
    for (name, trace) in played.played.traces() {
        hasher.update(name.as_bytes());
        for row in &trace.rows {
            bytes.clear();
            let [a_pa, b_pa] = row.pressure_pa;
            for value in [
                row.reference_m,
                row.stroke_m,
                row.measured_m,
                row.velocity_m_s,
                a_pa,
                b_pa,
                row.load_n,
                row.air_kg,
            ] {
                bytes.extend(value.to_le_bytes());
            }
            for on_us in row.on_us {
                bytes.extend(on_us.to_le_bytes());
            }
            bytes.extend(row.switches.to_le_bytes());
            bytes.push(u8::from(row.settled));
            hasher.update(&bytes);
        }
    }
    hasher.finalize().to_hex().to_string()
}

/// As [`simulate`], and writes a log that appears at `path` once it is complete.
pub(crate) fn log(
    case: &Case,
    path: &Path,
    limit_s: Option<f64>,
    stop: &Stop,
) -> Result<Option<Outcome>, CampaignError> {
    let failed = |e: std::io::Error| CampaignError::output("write", path, e);
    let temporary = path.with_extension(format!("{}.tmp", crate::host::unique()));
    let made = || {
        let mut file = LogFile::create(&temporary).map_err(StudyError::from)?;
        // If a case cannot be built, its row says so.
        if let Some((scenario, robot)) = case.setup.as_ref().ok().and_then(Setup::robot) {
            let scene = Scene::new(robot, scenario).map_err(StudyError::from)?;
            file = file.with(scene).map_err(StudyError::from)?;
        }
        let recorder = Recorder::new(Keep::nothing()).with(file);
        let outcome = recorded(case, recorder, limit_s, stop);
        if outcome.is_some() {
            std::fs::rename(&temporary, path).map_err(failed)?;
        }
        Ok(outcome)
    };
    let result = made();
    let _ = std::fs::remove_file(&temporary);
    result
}

fn recorded(
    case: &Case,
    recorder: Recorder<'_>,
    limit_s: Option<f64>,
    stop: &Stop,
) -> Option<Outcome> {
    let (scenario, robot) = match &case.setup {
        Ok(Setup::Robot(both)) => (&both.0, &both.1),
        Ok(Setup::Bench(bench)) => return Some(on_bench(bench, case.seed)),
        Err(why) => return Some(Outcome::without(Status::Error, why.clone())),
    };
    let mut over = false;
    let simulated = run::simulate(
        Boards::default(),
        scenario,
        robot,
        case.seed,
        recorder,
        &mut |t_s| {
            over = limit_s.is_some_and(|limit_s| t_s > limit_s);
            if over || stop.is_asked() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        },
    );
    let Simulated {
        outcome,
        recording,
        analysis,
        ..
    } = match simulated {
        Ok(simulated) => simulated,
        Err(error) => return Some(Outcome::without(Status::Error, why(&error))),
    };
    let (status, error) = match (&outcome.failure, limit_s.filter(|_| over)) {
        (Some(failure), _) => (Status::Error, Some(failure.to_string())),
        (None, Some(limit_s)) => (Status::Limit, Some(format!("more than {limit_s} s"))),
        (None, None) if outcome.stopped => return None,
        (None, None) => (Status::Ok, None),
    };
    let whole = status == Status::Ok;
    Some(Outcome {
        status,
        error,
        log_hash: Some(recording.hash),
        simulated_s: Some(outcome.simulated_s),
        passed: whole.then(|| analysis.passed()),
        targets: if whole { analysis.targets } else { Vec::new() },
    })
}
