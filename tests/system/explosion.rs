//! A plant that leaves physics reports it at once: when, which part, the likely cause, and its last known
//! state.

use std::fs;
use std::ops::ControlFlow;

use miette::Diagnostic as _;
use wheeleg_config::{AxisConfig, RobotConfig, Scenario};
use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::robot::Inputs;
use wheeleg_sim::SimError;
use wheeleg_studies::axis_sim::suite::{AxisSimError, TestRig};
use wheeleg_studies::axis_sim::{Kind, design, plant_check};
use wheeleg_studies::run::run_read;
use wheeleg_studies::study::Settings;

use crate::sil::robot;

/// A pressure that the supply cannot have made is an error, long before it is a strange number.
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
    // The reservoir has no other limit.
    let mut state = plant.initial_state(1).expect("it stands");
    state.core.supply.mass_kg *= 1.01 * most_pa / robot.plant.supply.initial_pressure_pa;
    let error = plant
        .tick(&mut state, &Inputs::default())
        .expect_err("too much");
    assert!(error.to_string().contains("supply_pressure_pa"), "{error}");
}

/// When the robot is commanded to drive, s.
const AT_S: f64 = 0.5;

/// A robot that is commanded to drive, with a winding of a hundredth of an ohm and next to no torque.
pub(crate) fn drives_without_torque() -> (Scenario, RobotConfig) {
    let mut robot = wheeleg_config::builtin::robot("wheeleg").expect("built in");
    for motor in &mut robot.plant.motors {
        (motor.resistance_ohm, motor.supply_v) = (0.01, 60.0);
        // They hardly turn for it, so that the board gives all that it has.
        motor.torque_constant_n_m_a = 1e-4;
    }
    let text = format!(
        "name = \"drive\"\ndescription = \"\"\nrobot = \"wheeleg\"\nduration = \"6 s\"\nseed = 1\n\
         targets = \"none\"\n[motion]\nkind = \"stand\"\n[[events]]\nat = \"{AT_S} s\"\n\
         action = \"command\"\ncommand = \"WheelReference\"\ntravel = \"800 mm\"\n"
    );
    let scenario = Scenario::parse("drive.toml", &text).expect("a scenario");
    (scenario, robot)
}

/// A whole run of a robot that stands, and is commanded to drive: with a winding of a hundredth of an ohm and
/// next to no torque, which a file may say, its motors draw more than the model allows.
#[test]
fn a_robot_that_explodes_ends_its_run_at_once_with_all_that_is_known() {
    let (scenario, robot) = drives_without_torque();
    let folder = tempfile::tempdir().expect("temporary folder");
    let out = folder.path().join("out");
    let finished = run_read(&scenario, &robot, 1, &Settings::new(&out)).expect("a run");
    let failure = finished.result.failure.expect("it explodes");
    assert!(matches!(failure, SimError::Unphysical { .. }), "{failure}");
    let (said, help) = (failure.to_string(), failure.help().expect("a cause"));
    for part in [
        "the plant left its range at ",
        " s after power-up, in wheel ",
        "(/wheel/",
        "last valid values, at ",
        " rad/s, ",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let help = help.to_string();
    for part in ["most likely `", "`motor.", "`numerics.step`"] {
        assert!(help.contains(part), "{part}: {help}");
    }
    // At once: soon after the command, long before the end.
    let summary = &finished.result.summary;
    assert_eq!(summary.failure.as_deref(), Some(&*said));
    assert!(!summary.complete);
    let ended_s = summary.recorded_s;
    assert!((AT_S..AT_S + 2.0).contains(&ended_s), "{ended_s} s");
    let kept = fs::read_to_string(out.join("summary.json")).expect("a summary");
    let kept: serde_json::Value = serde_json::from_str(&kept).expect("JSON");
    assert_eq!(kept["failure"], said);
    let page = fs::read_to_string(&finished.report).expect("a page");
    assert!(page.contains("the run failed; nothing is judged."));
    // The log ends whole, with the wheel's last values, and they are of this world.
    let (mut last_ns, mut worst_a) = (0, 0.0_f64);
    let read = wheeleg_telemetry::read(&out.join("log.mcap"), &mut |logged| {
        if let Some(current) = logged.number("current_a") {
            last_ns = logged.t_ns;
            worst_a = worst_a.max(current.abs());
        }
        ControlFlow::Continue(())
    });
    assert!(read.expect("a log").whole);
    let last_s = last_ns as f64 * 1e-9;
    assert!((last_s - ended_s).abs() < 0.05, "{last_s} s of {ended_s} s");
    assert!(worst_a <= 1000.0, "{worst_a} A");
}

/// A hundred kilograms on a piston of 32 mm; every field is within its range.
pub(crate) fn heavy() -> AxisParams {
    let text = include_str!("../../host-sim/axes/heavy-40x250.toml");
    let heavy = crate::axis_text::changed(
        text,
        &[
            ("cylinder.bore", 32.0, "mm"),
            ("cylinder.rod", 8.0, "mm"),
            ("cylinder.stroke", 80.0, "mm"),
            ("cylinder.dead_volume_a", 1.6, "cm3"),
            ("cylinder.dead_volume_b", 1.6, "cm3"),
            ("friction.coulomb", 14.0, "N"),
            ("friction.static", 21.0, "N"),
            ("moving.mass", 100.0, "kg"),
            ("start.stroke", 16.0, "mm"),
            ("sensor.potentiometer.electrical_stroke", 88.0, "mm"),
            ("sensor.potentiometer.offset", 4.0, "mm"),
            ("line.volume", 0.3, "cm3"),
        ],
    );
    AxisConfig::parse("heavy.toml", &heavy)
        .expect("within all ranges")
        .axis
}

/// The same of one cylinder: a hundred kilograms on a piston of 32 mm run through its stop or press
/// the air before it to many times the supply. Every field is within its range.
#[test]
fn an_axis_that_explodes_names_time_cause_and_the_last_values() {
    let axis = heavy();
    let told = |error: &AxisSimError| {
        let AxisSimError::Unphysical { what, help } = error else {
            panic!("another error: {error}");
        };
        for part in [
            "within 1 ms of ",
            " s: ",
            "last valid values: stroke ",
            " bar",
        ] {
            assert!(what.contains(part), "{part}: {what}");
        }
        assert!(!what.contains("..=") && what.len() < 400, "{what}");
        assert!(help.contains("most likely `moving.mass`"), "{help}");
    };
    told(&plant_check::check(&axis).expect_err("it explodes"));
    // A board that pushes it from stop to stop.
    let mut rig = TestRig::new(&axis, &design(&axis, Kind::OnOff), 1).expect("a rig");
    let ends = [0.079, 0.001];
    let moved = ends
        .iter()
        .cycle()
        .take(20)
        .try_for_each(|to_m| rig.step(*to_m, 2.0).map(drop));
    told(&moved.expect_err("it explodes"));
}
