//! A plant that leaves physics ends its run at once, and says when, where, what most likely did it,
//! and what was last known. The files' own checks are gone round here: they refuse such robots.

use std::ops::ControlFlow;

use wheeleg_config::RobotConfig;
use wheeleg_plant::robot::Inputs;
use wheeleg_sim::{Boards, Observers, RunOutcome, SimError, run_on};
use wheeleg_telemetry::{Recorder, Recording};

use crate::sil::{robot, stand};

fn run(robot: &RobotConfig) -> (RunOutcome, Recording) {
    let mut recorder = Recorder::in_memory();
    let mut go_on = |_| ControlFlow::Continue(());
    let observers = Observers::new(&mut go_on);
    let scenario = stand(1.0, &[]);
    let outcome = run_on(
        Boards::default(),
        &scenario,
        robot,
        1,
        &mut recorder,
        observers,
    );
    let recording = recorder.finish().expect("in memory");
    (outcome.expect("it begins"), recording)
}

/// What the user is told, and that the record has it, with sound values before it.
fn exploded(robot: &RobotConfig) -> (String, String) {
    let (outcome, recording) = run(robot);
    assert!(outcome.stopped && outcome.simulated_s < 60.0, "{outcome:?}");
    let Some(SimError::Unphysical { what, help }) = outcome.failure else {
        panic!("it did not explode: {:?}", outcome.failure);
    };
    let last = recording.events.last().expect("an event");
    assert_eq!(last.v.cause.code(), "run_failed");
    assert_eq!(last.v.to_string(), what);
    for rows in &recording.joints {
        let last = &rows.last().expect("last values").v;
        for value in [last.pressure_a_bar, last.pressure_b_bar] {
            assert!((0.0..45.0).contains(&value), "{value} bar");
        }
        assert!(
            last.velocity_mm_s.abs() < 1e5,
            "{} mm/s",
            last.velocity_mm_s
        );
    }
    for word in ["s after power-up", "last sound values, at ", "explod"] {
        assert!(
            what.contains(word) || what.contains("no longer finite"),
            "{word}: {what}"
        );
    }
    (what, help)
}

#[test]
fn what_explodes_is_named_with_its_likely_cause() {
    // A reservoir that a step empties and fills.
    let mut small = robot();
    small.plant.supply.reservoir_m3 = 1e-6;
    small.plant.supply.droop_pa = 100.0;
    small.plant.supply.regulator_flow.conductance_m3_s_pa = 1e-5;
    let (what, help) = exploded(&small);
    assert!(what.contains("the supply (/supply)"), "{what}");
    assert!(help.contains("`supply.reservoir`"), "{help}");
}

/// A pressure that the supply cannot have made is none, long before it is a strange number.
#[test]
fn four_times_the_supply_is_too_much() {
    let robot = robot();
    let plant = wheeleg_plant::Plant::new(&robot.plant).expect("a plant");
    let mut state = plant.initial_state(1).expect("it stands");
    let most_pa = plant.assembly.supply.most_pa();
    let source_pa = robot.plant.supply.source_pressure_pa;
    assert!((most_pa / source_pa - 4.0).abs() < 1e-12, "{most_pa}");
    let chamber = &mut state.core.cylinders[2].chamber_a;
    chamber.pv_j *= 10.0;
    let error = plant
        .tick(&mut state, &Inputs::default())
        .expect_err("too much");
    assert!(error.to_string().contains("pressure_a_pa[2]"), "{error}");
}
