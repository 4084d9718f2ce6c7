//! A plant that leaves physics says so at once, with the variable that did.

use wheeleg_plant::robot::Inputs;

use crate::sil::robot;

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
