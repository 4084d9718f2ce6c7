//! The balance of mechanical energy in every built-in scenario.

use std::thread;

use wheeleg_config::builtin;
use wheeleg_sim::{Boards, EnergyBalance, Session};
use wheeleg_telemetry::Recorder;

/// Length of a scenario here, s: some steps of a walk, and every stop of the files.
const SHORT_S: f64 = 6.5;
/// Longest start-up, s.
const START_UP_S: f64 = 60.0;
/// Allowed residual: a share of the actuators' work, and a rest, J.
const SHARE: f64 = 0.005;
const REST_J: f64 = 0.1;

/// A scenario cut short, with the energy accounted for or not: its account and its hash.
fn run(name: &str, accounted: bool) -> (Option<EnergyBalance>, String) {
    let mut scenario = builtin::scenario(name).expect("built in");
    scenario.duration_s = scenario.duration_s.min(SHORT_S);
    let end_s = scenario.duration_s;
    scenario.events.retain(|event| event.at_s < end_s);
    let robot = builtin::robot_of(&scenario, name).expect("built in");
    let mut recorder = Recorder::new(wheeleg_telemetry::Keep::nothing());
    let mut session = Session::new(Boards::default(), &scenario, &robot, 1).expect("it stands");
    if accounted {
        session.account_for_energy().expect("a sound pose");
    }
    let limit_ns = ((START_UP_S + end_s) * 1e9) as u64;
    session.step_to(limit_ns, &mut recorder).expect("it runs");
    assert!(session.is_over(), "{name} is not over");
    let balance = session.energy().expect("a sound pose");
    (balance, recorder.hash())
}

/// Kinetic and potential energy change by what pistons, motors, ground and bearings do, and by
/// nothing else: on floor, slope, soil and rocks, in every stop and under every fault of the files.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn the_energy_of_every_scenario_is_accounted_for() {
    let names: Vec<&str> = builtin::SCENARIOS.iter().map(|(name, ..)| *name).collect();
    let (even, odd): (Vec<_>, Vec<_>) = names.iter().enumerate().partition(|(i, _)| i % 2 == 0);
    let judge = |some: Vec<(usize, &&str)>| -> Vec<String> {
        let mut missed = Vec::new();
        for (_, name) in some {
            let balance = run(name, true).0.expect("accounted for");
            let (residual_j, actuators_j) = (balance.residual_j(), balance.actuators_j);
            println!(
                "energy of {name}: residual {residual_j:.4} J of {actuators_j:.1} J by the actuators, \
                 gained {:.2} J",
                balance.gained_j
            );
            if residual_j.abs() > SHARE * actuators_j + REST_J {
                missed.push(format!("{name}: {residual_j:.3} J of {actuators_j:.1} J"));
            }
        }
        missed
    };
    let missed: Vec<String> = thread::scope(|scope| {
        let halves = [even, odd].map(|half| scope.spawn(|| judge(half)));
        halves.map(|half| half.join().expect("it runs")).concat()
    });
    assert!(missed.is_empty(), "{missed:?}");
}

/// The energy account must not change the run, and must find something to account for, or it proves nothing.
#[test]
fn an_account_of_the_energy_changes_nothing() {
    let (balance, accounted) = run("sand-flat", true);
    let (none, plain) = run("sand-flat", false);
    assert_eq!(accounted, plain);
    assert_eq!(none, None);
    let balance = balance.expect("accounted for");
    assert!(balance.actuators_j > 20.0, "{balance:?}");
    // Without the ground's share the balance would be out by far more than is allowed.
    assert!(
        balance.work_j.abs() < 0.5 * balance.actuators_j,
        "{balance:?}"
    );
}
