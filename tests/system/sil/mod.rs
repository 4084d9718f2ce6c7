//! Runs of the whole robot for the system tests, and how to look at them.

// Every test program uses another part of this module.
#![allow(dead_code)]

use std::ops::ControlFlow;

use wheeleg_config::{
    EventAction, LegChoice, Motion, Origin, RobotConfig, Scenario, ScenarioEvent, TargetSet,
    builtin,
};
use wheeleg_protocol::param::JointParam;
use wheeleg_remote_host::{Nodes, PilSummary};
use wheeleg_studies::analysis::Target;
use wheeleg_telemetry::{FootSample, JointSample, Recorder, Recording, Row};

/// The one robot.
pub(crate) fn robot() -> RobotConfig {
    builtin::robot("wheeleg-2003").expect("built in")
}

/// The robot with a parameter of all six joints set.
pub(crate) fn robot_with(parameter: JointParam, raw: i32) -> RobotConfig {
    let mut robot = robot();
    let id = parameter.id();
    for joint in &mut robot.node.joints {
        joint.retain(|(other, _)| *other != id);
        joint.push((id, raw));
        joint.sort_unstable();
    }
    robot
}

/// A built-in scenario.
pub(crate) fn scenario(name: &str) -> Scenario {
    builtin::scenario(name).expect("built in")
}

/// The square-wave gait of the paper on one leg, cut at `duration_s`, with events.
pub(crate) fn gait(leg: LegChoice, duration_s: f64, events: &[(f64, EventAction)]) -> Scenario {
    with_events(Motion::SquareWave { leg }, duration_s, events)
}

/// The robot standing in its start pose, with events.
pub(crate) fn stand(duration_s: f64, events: &[(f64, EventAction)]) -> Scenario {
    with_events(Motion::Stand, duration_s, events)
}

fn with_events(motion: Motion, duration_s: f64, events: &[(f64, EventAction)]) -> Scenario {
    assert!(events.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    Scenario {
        duration_s,
        motion,
        events: events
            .iter()
            .map(|(at_s, action)| ScenarioEvent {
                at_s: *at_s,
                action: action.clone(),
                place: Origin::default(),
            })
            .collect(),
        targets: TargetSet::None,
        bars: Vec::new(),
        ..scenario("three-step")
    }
}

/// What was measured for a target of this id.
pub(crate) fn value(targets: &[Target], id: &str) -> Option<f64> {
    let target = targets.iter().find(|target| target.id == id);
    target.and_then(|target| target.value)
}

/// Simulates a scenario to its end, with some nodes outside.
pub(crate) fn run_with(scenario: &Scenario, nodes: &Nodes) -> (Recording, PilSummary) {
    let mut recorder = Recorder::in_memory();
    let outcome = wheeleg_sim::run_with(scenario, &robot(), 1, nodes, &mut recorder, &mut |_| {
        ControlFlow::Continue(())
    })
    .expect("the run gets to its end");
    let recording = recorder.finish().expect("nothing is written to a file");
    (recording, outcome.pil.expect("boards outside"))
}

/// Simulates a scenario to its end.
pub(crate) fn run(scenario: &Scenario, robot: &RobotConfig, seed: u64) -> Recording {
    let mut recorder = Recorder::in_memory();
    let outcome = wheeleg_sim::run(scenario, robot, seed, &mut recorder, &mut |_| {
        ControlFlow::Continue(())
    })
    .expect("the run gets to its end");
    assert!(!outcome.stopped);
    assert!((outcome.recorded_s - scenario.duration_s).abs() < 1e-9);
    recorder.finish().expect("nothing is written to a file")
}

/// Rows with `from <= t < to`, in s.
pub(crate) fn window<S>(rows: &[Row<S>], from_s: f64, to_s: f64) -> &[Row<S>] {
    let index = |t: f64| rows.partition_point(|r| r.t_s() < t - 1e-9);
    &rows[index(from_s)..index(to_s)]
}

/// The sample at `t_s`.
pub(crate) fn at<S>(rows: &[Row<S>], t_s: f64) -> &S {
    let index = rows.partition_point(|r| r.t_s() < t_s - 1e-9);
    &rows[index].v
}

/// Smallest and largest value.
pub(crate) fn range<S>(rows: &[Row<S>], value: impl Fn(&S) -> f64) -> (f64, f64) {
    assert!(!rows.is_empty(), "an empty window shows nothing");
    rows.iter()
        .map(|r| value(&r.v))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
            (lo.min(v), hi.max(v))
        })
}

/// Whether a valve of the joint is energised in the tick that begins here.
pub(crate) fn energised(s: &JointSample) -> bool {
    [s.fill_a_us, s.vent_a_us, s.fill_b_us, s.vent_b_us] != [0; 4]
}

/// Times at which a foot left the ground (false) or met it (true) for at least
/// 50 ms, by its switches, s.
pub(crate) fn settled_touches(rows: &[Row<FootSample>]) -> Vec<(f64, bool)> {
    let closed: Vec<bool> = rows.iter().map(|r| r.v.switches != 0).collect();
    let mut grounded = closed[0];
    let mut touches = Vec::new();
    for i in 1..closed.len().saturating_sub(50) {
        if closed[i] != grounded && closed[i..i + 50].iter().all(|c| *c != grounded) {
            grounded = !grounded;
            touches.push((rows[i].t_s(), grounded));
        }
    }
    touches
}

/// Texts of all events, for messages of failed tests.
pub(crate) fn story(recording: &Recording) -> String {
    recording
        .events
        .iter()
        .map(|r| {
            let kind = r.v.cause.kind().name();
            format!("{:8.3} {kind:8} {}\n", r.t_s(), r.v)
        })
        .collect()
}
