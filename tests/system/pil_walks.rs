//! Walks with eight emulated boards: the images match the boards in the simulator bit for bit, over sand,
//! over rocks, and after layer 1 freezes. 10 s of each here; `cargo xtask deep pil-walks` runs them to their
//! ends.

use std::ops::ControlFlow;

use crate::sil::scenario;
use wheeleg_config::{Scenario, builtin};
use wheeleg_remote_host::{NodeKind, Nodes};
use wheeleg_sim::RunOutcome;
use wheeleg_telemetry::Recorder;

/// Variable: the whole length of each.
const WHOLE: &str = "WHEELEG_PIL_WHOLE";
const SUITE_S: f64 = 10.0;

/// The outcome, and the hash of the log.
fn played(scenario: &Scenario, nodes: &Nodes) -> (RunOutcome, String) {
    let robot = builtin::robot(&scenario.robot).expect("built in");
    let mut recorder = Recorder::in_memory();
    let outcome = wheeleg_sim::run_with(scenario, &robot, 1, nodes, &mut recorder, &mut |_| {
        ControlFlow::Continue(())
    });
    let recording = recorder.finish().expect("nothing is written to a file");
    (outcome.expect("the run gets to its end"), recording.hash)
}

fn walks_as_the_host(name: &str) {
    let mut scenario = scenario(name);
    if std::env::var_os(WHOLE).is_none() {
        scenario.duration_s = scenario.duration_s.min(SUITE_S);
    }
    let (boards, hash) = played(
        &scenario,
        &Nodes::new(&NodeKind::Pil, &[]).expect("one each"),
    );
    let pil = boards.pil.expect("boards outside");
    println!(
        "{name}, {:.0} s: {} bits compared, {} differ",
        scenario.duration_s, pil.compared_bits, pil.differing_bits
    );
    assert_eq!(pil.differing_bits, 0, "{name}: {:?}", pil.first_difference);
    assert!(pil.compared_bits > 1_000_000, "{}", pil.compared_bits);
    // The log of the boards in the simulator, to the bit.
    let (_, native) = played(&scenario, &Nodes::default());
    assert_eq!(hash, native, "{name}");
}

#[test]
fn a_walk_on_sand_is_that_of_the_host() {
    walks_as_the_host("sand-flat");
}

#[test]
fn a_walk_over_rocks_is_that_of_the_host() {
    walks_as_the_host("rocks-20");
}

#[test]
fn a_walk_whose_layer_1_stands_still_is_that_of_the_host() {
    walks_as_the_host("frozen-layer-1");
}
