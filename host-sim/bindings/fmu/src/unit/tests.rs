use std::collections::BTreeSet;

use wheeleg_plant::axis::Axis;
use wheeleg_studies::axis_sim::{AxisSim, Kind as Law, Node, design};

use super::*;
use crate::description::{self, Fmi};

const SEED: u64 = 7;

fn model(kind: Kind) -> Model {
    let source = AxisConfig::source("bench-vq110u").expect("built in");
    Model::new(kind, Law::Predictive, &source.file, &source.text).expect("a sound axis")
}

fn unit(kind: Kind) -> Unit {
    let model = model(kind);
    let token = model.token.clone();
    Unit::new(model, &token).expect("its own token")
}

fn reference(unit: &Unit, name: &str) -> u32 {
    let found = unit.model.variables.iter().position(|v| v.name == name);
    found.expect(name) as u32
}

fn set(unit: &mut Unit, name: &str, value: Value) -> Result<(), FmuError> {
    let reference = reference(unit, name);
    unit.set(&[reference], &[value])
}

fn get(unit: &Unit, name: &str) -> f64 {
    let reference = reference(unit, name);
    let of = unit.model.variables[reference as usize].start.value_type();
    unit.get(&[reference], of).expect(name)[0].number()
}

fn running(kind: Kind) -> Unit {
    let mut unit = unit(kind);
    set(&mut unit, "seed", Value::Integer(SEED as i32)).expect("in range");
    unit.enter_initialization().expect("in turn");
    unit.exit_initialization().expect("sound");
    unit
}

fn go(unit: &mut Unit, ticks: u32) {
    for _ in 0..ticks {
        unit.step(unit.time_s(), TICK_S).expect("it goes on");
    }
}

#[test]
fn a_plant_goes_as_the_plant_itself() {
    let mut unit = running(Kind::Plant);
    let axis = Axis::new(&unit.model.config.axis).expect("sound");
    let mut state = axis.initial_state(SEED);
    let mut code = axis.read_position(&mut state);
    set(&mut unit, "fill_a_us", Value::Real(999.6)).expect("in range");
    set(&mut unit, "vent_b_us", Value::Real(1000.0)).expect("in range");
    set(&mut unit, "load_n", Value::Real(-5.0)).expect("in range");
    state.core.motion.load_n = -5.0;
    for _ in 0..300 {
        axis.tick(&mut state, [1000, 0, 0, 1000]).expect("sound");
        code = axis.read_position(&mut state);
    }
    go(&mut unit, 300);
    let seen = axis.outputs(&state);
    assert!(seen.stroke_m > 0.08, "it has moved: {}", seen.stroke_m);
    assert_eq!(get(&unit, "stroke_m").to_bits(), seen.stroke_m.to_bits());
    assert_eq!(
        get(&unit, "pressure_b_pa").to_bits(),
        seen.pressure_pa[1].to_bits()
    );
    assert_eq!(get(&unit, "code"), f64::from(code));
    assert!((unit.time_s() - 0.3).abs() < 1e-9);
}

#[test]
fn a_controlled_unit_goes_as_the_bench_of_the_studies() {
    let mut unit = running(Kind::Controlled);
    let params = unit.model.config.axis.clone();
    let node = Node::new(&design(&params, Law::Predictive)).expect("a board for it");
    let mut bench = AxisSim::new(&params, SEED, node).expect("sound");
    set(&mut unit, "reference_m", Value::Real(0.1)).expect("in range");
    for _ in 0..800 {
        bench.tick(0.1, 0.0).expect("sound");
    }
    // One step of many ticks equals many of one.
    unit.step(0.0, 0.8).expect("it goes on");
    let seen = bench.axis().outputs(&bench.state);
    assert_eq!(get(&unit, "stroke_m").to_bits(), seen.stroke_m.to_bits());
    assert!(
        (get(&unit, "stroke_m") - 0.1).abs() < 2e-3,
        "it is where it was sent"
    );
    assert_eq!((get(&unit, "driving"), get(&unit, "faults")), (1.0, 0.0));
}

#[test]
fn parameters_are_the_axis_files_and_are_checked_as_its() {
    let heavy = |kg| {
        let mut unit = unit(Kind::Plant);
        set(&mut unit, "moving.mass", Value::Real(kg)).expect("in range");
        set(&mut unit, "cylinder.timing_spread[2]", Value::Real(1.3)).expect("in range");
        set(&mut unit, "chamber.thermal", Value::Boolean(true)).expect("in range");
        unit.enter_initialization().expect("in turn");
        // Before the start, the values at the start are visible.
        assert_eq!(get(&unit, "stroke_m"), 0.04);
        unit.exit_initialization().expect("sound");
        set(&mut unit, "fill_a_us", Value::Real(1000.0)).expect("in range");
        set(&mut unit, "vent_b_us", Value::Real(1000.0)).expect("in range");
        go(&mut unit, 60);
        get(&unit, "stroke_m")
    };
    assert!(heavy(1.5) > heavy(6.0) + 1e-3, "more mass, less way");

    let mut unit = unit(Kind::Plant);
    let error = set(&mut unit, "moving.mass", Value::Real(-1.0)).expect_err("no mass");
    assert!(matches!(error, FmuError::Range { .. }), "{error}");
    let error = set(&mut unit, "moving.mass", Value::Real(f64::NAN)).expect_err("no number");
    assert!(matches!(error, FmuError::Range { .. }), "{error}");
    // Two that are each in range and contradict each other.
    set(&mut unit, "friction.coulomb", Value::Real(20.0)).expect("in range");
    unit.enter_initialization().expect("in turn");
    let error = unit
        .exit_initialization()
        .expect_err("more than the static friction");
    assert!(matches!(error, FmuError::Config(_)), "{error}");
    unit.reset();
    unit.enter_initialization().expect("in turn");
    unit.exit_initialization().expect("as in the file");
    let error = set(&mut unit, "moving.mass", Value::Real(2.0)).expect_err("it runs");
    assert!(matches!(error, FmuError::Fixed { .. }), "{error}");
    let error = set(&mut unit, "stroke_m", Value::Real(2.0)).expect_err("an output");
    assert!(matches!(error, FmuError::Fixed { .. }), "{error}");
}

#[test]
fn states_go_back_and_elsewhere() {
    for kind in [Kind::Plant, Kind::Controlled] {
        let mut one = running(kind);
        let input = match kind {
            Kind::Plant => "fill_b_us",
            Kind::Controlled => "reference_m",
        };
        let value = if kind == Kind::Plant { 300.0 } else { 0.12 };
        set(&mut one, input, Value::Real(value)).expect("in range");
        go(&mut one, 150);
        let state = one.state();
        go(&mut one, 150);
        let expected = get(&one, "stroke_m");
        one.restore(&state);
        assert!((one.time_s() - 0.15).abs() < 1e-9);
        go(&mut one, 150);
        assert_eq!(get(&one, "stroke_m").to_bits(), expected.to_bits());

        let mut other = running(kind);
        match one.serialize(&state) {
            Ok(bytes) => {
                let read = other.deserialize(&bytes).expect("its own bytes");
                other.restore(&read);
            }
            Err(error) => {
                assert_eq!(kind, Kind::Controlled, "{error}");
                other.restore(&state);
            }
        }
        go(&mut other, 150);
        assert_eq!(get(&other, "stroke_m").to_bits(), expected.to_bits());
    }
    let unit = running(Kind::Plant);
    let bytes = unit.serialize(&unit.state()).expect("written");
    for wrong in [&b""[..], b"{}", &bytes[..bytes.len() - 2]] {
        assert!(matches!(unit.deserialize(wrong), Err(FmuError::State(_))));
    }
}

#[test]
fn steps_are_whole_ticks_from_the_units_own_time() {
    let mut unit = running(Kind::Plant);
    for step_s in [0.0, -1e-3, 5e-4, 1.5e-3, f64::NAN, f64::INFINITY, 1e9] {
        let error = unit.step(0.0, step_s).expect_err("no tick");
        assert!(matches!(error, FmuError::Step { .. }), "{step_s}: {error}");
    }
    unit.step(0.0, 0.1 + 0.2 - 0.29)
        .expect("10 ms, as computers add");
    let error = unit.step(0.0, 1e-3).expect_err("it has gone on");
    assert!(matches!(error, FmuError::Time { .. }), "{error}");
    unit.terminate().expect("in turn");
    let error = unit.step(0.01, 1e-3).expect_err("it has ended");
    assert!(matches!(error, FmuError::Order { .. }), "{error}");
}

#[test]
fn what_explodes_ends_the_unit_with_its_reason() {
    let mut unit = unit(Kind::Plant);
    set(&mut unit, "moving.mass", Value::Real(0.5)).expect("in range");
    unit.enter_initialization().expect("in turn");
    unit.exit_initialization().expect("sound");
    set(&mut unit, "load_n", Value::Real(1e4)).expect("in range");
    let outcome = (0..2000).try_for_each(|_| unit.step(unit.time_s(), TICK_S));
    if let Err(error) = outcome {
        assert!(matches!(error, FmuError::Plant(_)), "{error}");
        let again = unit.step(unit.time_s(), TICK_S).expect_err("it has ended");
        assert!(matches!(again, FmuError::Order { .. }), "{again}");
    } else {
        panic!("10 kN on 0.5 kg went well");
    }
}

#[test]
fn descriptions_name_every_variable_once_with_units_that_are_defined() {
    for kind in [Kind::Plant, Kind::Controlled] {
        let model = model(kind);
        let names: BTreeSet<_> = model.variables.iter().map(|v| &v.name).collect();
        assert_eq!(names.len(), model.variables.len());
        for variable in &model.variables {
            let known = variable.dimension.factor(&variable.unit).is_some();
            assert!(variable.unit.is_empty() || known, "{}", variable.name);
        }
        for fmi in [Fmi::Two, Fmi::Three] {
            let text = String::from_utf8(description::write(&model, fmi).expect("in memory"));
            let text = text.expect("UTF-8");
            for name in names.iter() {
                assert!(text.contains(&format!(" name=\"{name}\"")), "{name}");
            }
            assert!(text.contains(&model.token));
        }
    }
    let other = AxisConfig::source("small-12x50").expect("built in");
    let other = Model::new(Kind::Plant, Law::Predictive, &other.file, &other.text);
    let other = other.expect("sound");
    assert_ne!(model(Kind::Plant).token, other.token);
    assert_ne!(model(Kind::Plant).token, model(Kind::Controlled).token);
    let error = Unit::new(other, &model(Kind::Plant).token)
        .err()
        .expect("another token");
    assert!(matches!(error, FmuError::Token { .. }), "{error}");
}
