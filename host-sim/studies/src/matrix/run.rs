//! Runs rows of the matrix on the simulated robot, as many at a time as there are processors.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::OnceLock;

use wheeleg_master::command::Command;
use wheeleg_node::mode::ModeRules as _;
use wheeleg_protocol::param::{ParamInfo, params_at};

use super::judge::{Outcome, judge};
use super::measure::{Measured, measure};
use super::operator::{Operator, Robot};
use super::ran::{ESTOP_S, Outputs, Ran};
use super::row::{Ask, Connection, Expect, Phase, Row, Variant};
use super::rows::ROWS;
use crate::StudyError;
use crate::study::Progress;
use wheeleg_config::builtin::DEFAULT_SCENARIO;
use wheeleg_config::faults::FaultSpec;
use wheeleg_config::{
    EventAction, LegChoice, Motion, Origin, RobotConfig, Scenario, ScenarioEvent, TargetSet,
    builtin, raw_of,
};
use wheeleg_remote_host::Nodes;
use wheeleg_sim::faults::check;
use wheeleg_sim::{self as sil, Boards, JointProbe, LineAudit, Observers, Session, SimError};
use wheeleg_telemetry::{Recorder, Recording};

/// Arming is requested this long before the end, s.
const ARM_S: f64 = 0.6;
/// Steps of the long walk.
const LONG_STEPS: u16 = 18;

/// The robots and their runs without faults.
struct Robots {
    scenario: Scenario,
    robots: [RobotConfig; 3],
    /// By the robot and whether it stands.
    baselines: BTreeMap<(Variant, bool), Baseline>,
    seed: u64,
}

/// A run without a fault, as a reference for others.
#[derive(Default)]
struct Baseline {
    /// Length of the longest run that is compared with it.
    duration_s: f64,
    /// None if the study was stopped in it.
    run: OnceLock<Option<Result<Recording, String>>>,
}

impl Robots {
    /// For these rows.
    fn new(rows: &[&Row], seed: u64) -> Result<Self, StudyError> {
        let scenario = builtin::scenario(DEFAULT_SCENARIO)?;
        let plain = builtin::robot_of(&scenario, DEFAULT_SCENARIO)?;
        let mut reflex = plain.clone();
        reflex.gait.touchdown_reflex = true;
        let mut long = plain.clone();
        long.gait.steps = LONG_STEPS;
        let mut robots = Self {
            scenario,
            robots: [plain, reflex, long],
            baselines: BTreeMap::new(),
            seed,
        };
        // The long walk is too long to run twice.
        for row in rows.iter().filter(|row| row.variant != Variant::Long) {
            let duration_s = robots.duration_s(row);
            let baseline = robots.baselines.entry(compared_with(row)).or_default();
            baseline.duration_s = baseline.duration_s.max(duration_s);
        }
        Ok(robots)
    }

    fn robot(&self, variant: Variant) -> &RobotConfig {
        match variant {
            Variant::Plain => &self.robots[0],
            Variant::Reflex => &self.robots[1],
            Variant::Long => &self.robots[2],
        }
    }

    fn scenario(&self, stands: bool, duration_s: f64) -> Scenario {
        let leg = LegChoice::Left;
        Scenario {
            duration_s,
            motion: if stands {
                Motion::Stand
            } else {
                Motion::SquareWave { leg }
            },
            events: Vec::new(),
            faults: Vec::new(),
            targets: TargetSet::None,
            bars: Vec::new(),
            ..self.scenario.clone()
        }
    }

    /// Duration of a row's run, s.
    fn duration_s(&self, row: &Row) -> f64 {
        instant_s(row, self.robot(row.variant), self.seed) + row.after_s
    }

    /// The same run without the fault, which the long walk does not have; none if the study is stopped in it.
    fn baseline(
        &self,
        row: &Row,
        is_stopped: &dyn Fn() -> bool,
    ) -> Result<Option<Option<&Recording>>, StudyError> {
        let Some(baseline) = self.baselines.get(&compared_with(row)) else {
            return Ok(Some(None));
        };
        let run = baseline.run.get_or_init(|| {
            let scenario = self.scenario(stands(row.phase), baseline.duration_s);
            let run = simulate(&scenario, self.robot(row.variant), self.seed, is_stopped)?;
            let failed = run.error.map(|error| error.to_string());
            Some(failed.map_or(Ok(run.recording), Err))
        });
        let run = run.as_ref().map(|run| run.as_ref().map(Some));
        run.transpose()
            .map_err(|e| StudyError::refused(format!("the run without a fault fails: {e}"), ""))
    }

    /// The outcome of a row; none if the study is stopped in it.
    fn run(&self, row: &Row, progress: &Progress) -> Result<Option<Outcome>, StudyError> {
        let robot = self.robot(row.variant);
        if let Some(reason) = row.not_implemented() {
            return Ok(Some(Outcome::not_implemented(*row, robot, reason)));
        }
        let at_s = instant_s(row, robot, self.seed);
        let faults = faults(row, at_s)?;
        let duration_s = self.duration_s(row);
        let mut scenario = self.scenario(stands(row.phase), duration_s);
        scenario.faults.clone_from(&faults);
        let event = |at_s: f64, action| ScenarioEvent {
            at_s,
            action,
            place: Origin::default(),
        };
        if row.estop {
            scenario
                .events
                .push(event(at_s + ESTOP_S, EventAction::EStop));
        }
        for (after_s, ask) in row.asks {
            scenario
                .events
                .push(event(at_s + after_s, EventAction::Command(asked(ask))));
        }
        let arm_s = duration_s - ARM_S;
        let stops = matches!(row.expect, Expect::Stop(_) | Expect::Degrades);
        if stops {
            scenario
                .events
                .push(event(arm_s, EventAction::Command(Command::Arm)));
        }
        check(&scenario, robot, &Nodes::default())?;
        let arming_asked = stops && faults.iter().all(|fault| fault.over_s() < arm_s);
        let is_stopped = || progress.is_stopped();
        let ran = match row.connection {
            Some(connection) => {
                operated(&scenario, robot, self.seed, (connection, at_s), &is_stopped)
            }
            None => simulate(&scenario, robot, self.seed, &is_stopped),
        };
        let Some(ran) = ran else {
            return Ok(None);
        };
        let ran = Ran {
            at_s,
            faults,
            arming_asked,
            ..ran
        };
        let Some(baseline) = self.baseline(row, &is_stopped)? else {
            return Ok(None);
        };
        let measured: Measured = measure(row, &ran, baseline);
        Ok(Some(judge(*row, robot, &ran, measured)))
    }
}

/// The command for a user's request about a board's parameters.
///
/// # Panics
/// If a row names a parameter that its board does not have.
fn asked(ask: &Ask) -> Command {
    let row = |node: u8, of: &str| -> &ParamInfo {
        let row = params_at(node).iter().find(|info| info.name == of);
        row.expect("a parameter of the board")
    };
    match *ask {
        Ask::Disarm => Command::Disarm,
        Ask::Save(node) => Command::SaveParameters { node },
        Ask::Read(node, of) => Command::ReadParameter {
            node,
            id: row(node, of).id,
        },
        Ask::Write(node, of, value) => Command::WriteParameter {
            node,
            id: row(node, of).id,
            raw: raw_of(row(node, of), value),
        },
    }
}

/// Robot, and whether it stands, of a row's run without a fault.
fn compared_with(row: &Row) -> (Variant, bool) {
    (row.variant, stands(row.phase))
}

fn stands(phase: Phase) -> bool {
    matches!(phase, Phase::Stand | Phase::PowerUp)
}

/// A run in memory; an error ends it and is kept. None if it was stopped.
fn simulate(
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    is_stopped: &dyn Fn() -> bool,
) -> Option<Ran> {
    let mut recorder = Recorder::in_memory();
    let mut outputs = Outputs::default();
    let mut look = |joint: &JointProbe<'_>| {
        let driven = joint.board.pulses != [0; 4] || joint.board.mode.may_drive();
        outputs.ticks += 1;
        outputs.driven += u64::from(driven);
    };
    let mut progress = |_| match is_stopped() {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    let run = sil::run_on(
        Boards::default(),
        scenario,
        robot,
        seed,
        &mut recorder,
        Observers::new(&mut progress).watching(&mut look),
    );
    let (line, error) = match run {
        Ok(outcome) => match outcome.failure {
            Some(failure) => (LineAudit::default(), Some(failure)),
            None if outcome.stopped => return None,
            None => (outcome.line, None),
        },
        Err(e) => (LineAudit::default(), Some(e)),
    };
    let (recording, error) = recorded(recorder, error);
    Some(Ran {
        at_s: 0.0,
        faults: Vec::new(),
        recording,
        line,
        arming_asked: false,
        intrusion: None,
        outputs,
        error,
    })
}

/// The recording, and the first failure.
fn recorded(recorder: Recorder<'_>, failed: Option<SimError>) -> (Recording, Option<SimError>) {
    match recorder.finish() {
        Ok(recording) => (recording, failed),
        Err(e) => (Recording::default(), failed.or(Some(e.into()))),
    }
}

/// The same with an operator in control, whose connection fails at `at_s`.
fn operated(
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    (connection, at_s): (Connection, f64),
    is_stopped: &dyn Fn() -> bool,
) -> Option<Ran> {
    let mut recorder = Recorder::in_memory();
    let mut operator = Operator::new(connection);
    let ran = operate(
        scenario,
        robot,
        seed,
        at_s,
        &mut operator,
        &mut recorder,
        is_stopped,
    );
    let (line, error) = match ran {
        Ok(None) => return None,
        Ok(Some(line)) => (line, None),
        Err(e) => (LineAudit::default(), Some(e)),
    };
    let (recording, error) = recorded(recorder, error);
    Some(Ran {
        at_s,
        faults: Vec::new(),
        recording,
        line,
        arming_asked: false,
        intrusion: connection.has_intruder().then_some(operator.intrusion),
        outputs: Outputs::default(),
        error,
    })
}

/// Steps a session through its scenario; `None`: it was stopped.
fn operate(
    scenario: &Scenario,
    robot: &RobotConfig,
    seed: u64,
    at_s: f64,
    operator: &mut Operator,
    recorder: &mut Recorder<'_>,
    is_stopped: &dyn Fn() -> bool,
) -> Result<Option<LineAudit>, SimError> {
    let mut session = Session::new(Boards::default(), scenario, robot, seed)?;
    let at_ms = (at_s * 1e3).round() as u64;
    let mut begin_ms = None;
    for now_ms in 1.. {
        session.step_to(now_ms * 1_000_000, recorder)?;
        if session.is_over() || is_stopped() {
            break;
        }
        if session.scenario_s().is_some() {
            let ms = now_ms - *begin_ms.get_or_insert(now_ms);
            let robot = &mut Robot {
                session: &mut session,
                recorder: &mut *recorder,
            };
            operator.tick(ms, ms.checked_sub(at_ms), robot);
        }
    }
    let whole = session.is_over();
    let outcome = session.finish(!whole, recorder);
    Ok(whole.then_some(outcome.line))
}

/// The instant of a row, s: somewhere in its phase, by the seed, on a whole tick.
fn instant_s(row: &Row, robot: &RobotConfig, seed: u64) -> f64 {
    let gait = &robot.gait;
    let (from_s, to_s) = match row.phase {
        Phase::PowerUp => return 0.0,
        Phase::Stand => (0.5, 0.6),
        Phase::Start => (0.1, 0.2),
        Phase::FirstReach => (gait.reach_s - 0.1, gait.reach_s),
        Phase::BeforeReach => {
            let reach_s = gait.period_s + gait.reach_s;
            (reach_s - 0.1, reach_s)
        }
        Phase::Flight => (gait.reach_s + 0.1, gait.lower_s - 0.1),
        Phase::BeforeLower => (gait.lower_s - 0.1, gait.lower_s),
        Phase::SecondLower => {
            let lower_s = gait.period_s + gait.lower_s;
            (lower_s - 0.1, lower_s)
        }
        Phase::Push => (gait.push_s + 0.2, gait.push_s + 0.8),
        Phase::BeforeLift => (gait.period_s - 0.1, gait.period_s),
    };
    let name = blake3::hash(format!("{} {seed}", row.id).as_bytes());
    let share = f64::from(name.as_bytes()[0]) / 256.0;
    ((from_s + share * (to_s - from_s)) * 1e3).round() * 1e-3
}

/// The faults of a row at its instant.
fn faults(row: &Row, at_s: f64) -> Result<Vec<FaultSpec>, StudyError> {
    row.faults
        .iter()
        .map(|fault| {
            let from_s = at_s + fault.after_s;
            let mut text = format!("{}@{from_s:.3}s", fault.what);
            if fault.lasts_s.is_finite() {
                text.push_str(&format!("..{:.3}s", from_s + fault.lasts_s));
            }
            text.parse()
                .map_err(|e: wheeleg_config::faults::SpecError| {
                    StudyError::refused(format!("row {}: {e}", row.id), "please report this")
                })
        })
        .collect()
}

/// Rows by name; all if `ids` is empty.
///
/// # Errors
/// [`StudyError::Refused`] for an unknown name, and for a row that is not implemented.
pub fn select(ids: &[String]) -> Result<Vec<&'static Row>, StudyError> {
    if ids.is_empty() {
        return Ok(ROWS.iter().collect());
    }
    let find = |id: &String| {
        let row = ROWS.iter().find(|row| row.id == id).ok_or_else(|| {
            StudyError::refused(
                format!("the fault matrix has no row `{id}`{}", meant(id)),
                "`wheeleg faults rows` prints all of them",
            )
        })?;
        row.not_implemented().map_or(Ok(row), |reason| {
            Err(StudyError::refused(
                format!("the row `{id}` is not implemented: {reason}"),
                "`wheeleg faults rows` says which rows are",
            ))
        })
    };
    let mut rows: Vec<&'static Row> = Vec::new();
    for id in ids {
        let row = find(id)?;
        if !rows.contains(&row) {
            rows.push(row);
        }
    }
    Ok(rows)
}

/// Rows that an unknown name may mean: those that begin with it, otherwise the nearest.
fn meant(id: &str) -> String {
    let ids = ROWS.iter().map(|row| row.id);
    let begin: Vec<String> = ids
        .clone()
        .filter(|row| !id.is_empty() && row.starts_with(id))
        .map(|row| format!("`{row}`"))
        .collect();
    if !begin.is_empty() {
        return format!("; these begin with it: {}", begin.join(", "));
    }
    wheeleg_config::closest(id, ids).map_or_else(String::new, |n| format!("; did you mean `{n}`?"))
}

/// Runs rows, until the study is stopped.
///
/// # Errors
/// [`StudyError`] if a run without a fault fails, or a row of the table is wrong.
pub fn run(
    rows: &[&'static Row],
    seed: u64,
    progress: &Progress,
) -> Result<Vec<Outcome>, StudyError> {
    let robots = Robots::new(rows, seed)?;
    let outcomes = progress.each("rows", rows, |row| robots.run(row, progress))?;
    Ok(outcomes.into_iter().flatten().flatten().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// A signal ends a row, and the run that it is compared with, at the next bus cycle.
    #[test]
    fn a_row_and_the_run_that_it_is_compared_with_are_not_finished_once_they_are_to_stop() {
        const ASKED: u32 = 20;
        let wanted = |operated: bool| {
            let mut rows = ROWS.iter();
            let row = rows.find(|row| {
                let plain = row.variant == Variant::Plain && row.not_implemented().is_none();
                plain && row.connection.is_some() == operated
            });
            row.expect("a row")
        };
        for row in [wanted(false), wanted(true)] {
            let robots = Robots::new(&[row], 1).expect("built in");
            let asked = Cell::new(0);
            let is_stopped = || {
                asked.set(asked.get() + 1);
                asked.get() >= ASKED
            };
            let baseline = robots.baseline(row, &is_stopped).expect("no failure");
            assert!(baseline.is_none(), "{}", row.id);
            assert_eq!(asked.get(), ASKED, "{}", row.id);
            if let Some(connection) = row.connection {
                asked.set(0);
                let scenario = robots.scenario(true, 5.0);
                let robot = robots.robot(row.variant);
                let ran = operated(&scenario, robot, 1, (connection, 1.0), &is_stopped);
                assert!(ran.is_none() && asked.get() == ASKED, "{}", row.id);
            }
        }
    }

    /// A row is compared with a run of the same motion: of two rows on one robot, one that stands and one
    /// that walks, each has its own.
    #[test]
    fn a_row_that_stands_is_not_compared_with_one_that_walks() {
        let of = |standing: bool, variant: Variant| {
            let mut rows = ROWS.iter().filter(|row| row.not_implemented().is_none());
            rows.find(|row| stands(row.phase) == standing && row.variant == variant)
        };
        let mut pairs = 0;
        for variant in [Variant::Plain, Variant::Reflex] {
            let (Some(standing), Some(walking)) = (of(true, variant), of(false, variant)) else {
                continue;
            };
            pairs += 1;
            let robots = Robots::new(&[standing, walking], 1).expect("built in");
            assert_eq!(robots.baselines.len(), 2);
            for row in [standing, walking] {
                let baseline = &robots.baselines[&compared_with(row)];
                assert!((baseline.duration_s - robots.duration_s(row)).abs() < 1e-9);
            }
        }
        assert!(pairs > 0, "no robot both stands and walks");
    }
}
