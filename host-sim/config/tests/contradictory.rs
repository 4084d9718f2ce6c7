//! Fields that contradict each other, as people get them wrong: the field at fault is named, and what is
//! advised is accepted.

mod common;
#[path = "common/values.rs"]
mod values;

use common::{assert_all, report};
use values::{SHORT, with};
use wheeleg_config::{AxisConfig, ConfigError, RobotConfig};

const WALKER: &str = include_str!("../../robots/wheeleg.toml");
const ROBOT: &str = include_str!("../../robots/wheeleg-2003.toml");
const AXIS: &str = include_str!("../../axes/bench-vq110u.toml");

/// A path, its value as it is written, and its unit.
type Set = (&'static str, &'static str, &'static str);

/// Shorter cylinders are sound with feet of another height.
#[test]
fn short_cylinders_stand() {
    let mut text = ROBOT.to_owned();
    for (path, value, unit) in SHORT {
        text = with(&text, path, value, unit);
    }
    let read = RobotConfig::parse("my.toml", &text);
    assert!(read.is_ok(), "{:?}", read.err().map(|error| report(&error)));
}

/// Two parameters that are both wrong are named by what they break, each with its value, its line and what
/// is allowed, though neither is enough alone; and what is advised is accepted, one after the other.
#[test]
fn every_relation_of_boards_is_named_where_several_values_break_it() {
    let cases: &[(&[Set], &[[&str; 2]])] = &[
        (
            &[("release_band", "0.1", "mm"), ("settle_band", "5.0", "mm")],
            &[["release_band", "settle_band"]],
        ),
        (
            &[
                ("valve_t_on", "12000", "us"),
                ("valve_t_off", "12000", "us"),
            ],
            &[["valve_t_on", "pwm_period"], ["valve_t_off", "pwm_period"]],
        ),
        (
            &[
                ("friction_coulomb", "15.0", "N"),
                ("friction_breakaway", "10.0", "N"),
                ("rod", "20.0", "mm"),
                ("bore", "8.0", "mm"),
            ],
            &[["friction_breakaway", "friction_coulomb"], ["rod", "bore"]],
        ),
        (
            &[("sensor_min", "190.0", "mm"), ("sensor_max", "-5.0", "mm")],
            &[["sensor_max", "sensor_min"]],
        ),
        (
            &[("stroke_min", "180.0", "mm"), ("stroke_max", "0.0", "mm")],
            &[["stroke_max", "stroke_min"]],
        ),
        (
            &[
                ("valve_t_on", "50000", "us"),
                ("valve_t_off", "50000", "us"),
                ("pwm_period", "10000", "us"),
            ],
            &[["valve_t_on", "pwm_period"], ["valve_t_off", "pwm_period"]],
        ),
    ];
    for (values, relations) in cases {
        let mut text = WALKER.to_owned();
        for (name, value, unit) in *values {
            text = with(&text, &format!("node.joint.{name}"), value, unit);
        }
        let error = RobotConfig::parse("my.toml", &text).expect_err("contradictory");
        let said = report(&error);
        for [one, other] in *relations {
            let told = error.problems().iter().find(|problem| {
                let said = problem.to_string();
                let [one, other] = [one, other].map(|name| format!("`node.joint.{name}` = "));
                said.contains("contradicts") && said.contains(&one) && said.contains(&other)
            });
            let told = told.unwrap_or_else(|| panic!("{one}, {other}: {said}"));
            let given = values
                .iter()
                .filter(|(name, ..)| [*one, *other].contains(name));
            let lines = told.to_string().matches("(line ").count();
            assert!(lines >= given.count(), "{told}");
            assert!(!told.advice().is_empty(), "{said}");
        }
        assert!(!said.contains("see the sections"), "{said}");
        // The first value that each refusal advises, until nothing is left that the board refuses.
        for _ in 0..4 {
            let Err(error) = RobotConfig::parse("my.toml", &text) else {
                break;
            };
            let mut problems = error.problems().iter();
            let next = problems.find(|problem| problem.to_string().contains("contradicts"));
            let Some(problem) = next else { break };
            let advised = &problem.advice()[0][0];
            let value = format!("{:?}", advised.value);
            text = with(&text, &advised.path, &value, &advised.unit);
        }
        if let Err(error) = RobotConfig::parse("my.toml", &text) {
            let said = report(&error);
            assert!(!said.contains("contradicts"), "{values:?}: {said}");
        }
    }
}

/// What is said of a robot with these other values.
fn said_of(values: &[Set]) -> (String, ConfigError) {
    let mut text = WALKER.to_owned();
    for (path, value, unit) in values {
        text = with(&text, path, value, unit);
    }
    let error = RobotConfig::parse("my.toml", &text).expect_err("refused");
    (report(&error), error)
}

/// N/m where N/mm were meant: the robot sinks until its chassis lies on the ground, and the contact is
/// pointed at, with a stiffness that does.
#[test]
fn a_contact_that_is_too_soft_is_named_with_the_stiffness_that_holds() {
    for (path, values, told) in [
        (
            "wheel_contact.stiffness",
            ["60.0", "600.0"],
            "the robot lies on its chassis, which bears ",
        ),
        ("contact.stiffness", ["20.0", "200.0"], "kg"),
    ] {
        for value in values {
            let (said, error) = said_of(&[(path, value, "N/m")]);
            let [problem] = error.problems() else {
                panic!("{said}")
            };
            assert!(
                said.contains(told)
                    && problem
                        .summary()
                        .contains(&format!(": `{path}` = {value:.0}")),
                "{said}"
            );
            let [set] = problem.advice() else {
                panic!("{said}")
            };
            assert_eq!(set[0].path, path, "{said}");
            let mended = with(WALKER, path, &format!("{:?}", set[0].value), &set[0].unit);
            RobotConfig::parse("my.toml", &mended).expect("accepted");
        }
    }
}

/// A hip on the wrong side, in the middle or outside of the wheels; feet behind the axle.
#[test]
fn hips_that_cannot_be_are_named_with_the_track() {
    for left in ["-0.20", "0.0", "2.0"] {
        let text = with(WALKER, "body.o4", &format!("[0.60, {left}, 0.15]"), "m");
        let error = RobotConfig::parse("my.toml", &text).expect_err("refused");
        let said = report(&error);
        assert_all(
            &said,
            &[
                "`body.o4` = ",
                "`spatial.track` = 0.56 m",
                "above 0 and up to 0.28 m",
            ],
        );
    }
    let (said, _) = said_of(&[("body.o4", "[-0.60, 0.20, 0.15]", "m")]);
    assert_all(&said, &["behind the axle", "such as 0.6 m"]);
    assert!(!said.contains("from 0 to -"), "{said}");
}

/// The radius has a part in what the plant can follow of a wheel.
#[test]
fn a_wheel_that_is_too_large_is_named_by_its_radius() {
    let (said, _) = said_of(&[("body.wheel_radius", "1.5", "m")]);
    assert_all(&said, &["`body.wheel_radius` = 1.5 m"]);
}

/// Where so much is wrong that not every value can be tried, what each relation asks for is told for itself.
#[test]
fn errors_that_hide_each_other_have_a_range_each() {
    let (said, error) = said_of(&[
        ("fill_valve.conductance", "1000.0", "dm3/(s bar)"),
        ("vent_valve.conductance", "1000.0", "dm3/(s bar)"),
        ("line.conductance", "1000.0", "dm3/(s bar)"),
        ("line.volume", "0.0", "cm3"),
        ("cylinder.dead_volume_a", "0.01", "cm3"),
        ("cylinder.dead_volume_b", "0.01", "cm3"),
    ]);
    assert!(error.problems().len() > 1, "{said}");
    for problem in error.problems() {
        let help = problem.help_text().unwrap_or_default();
        let mut words = [
            "` is allowed from ",
            "` is allowed up to ",
            "allowed together are `",
        ]
        .iter();
        assert!(words.any(|word| help.contains(word)), "{problem}: {help}");
    }
}

/// What is advised of a field leaves room for what else is counted with it.
#[test]
fn a_volume_or_an_offset_that_is_too_large_is_told_its_own_limit() {
    for (path, value, unit, most) in [
        ("cylinder.dead_volume_a", "500.0", "cm3", 500.0),
        ("sensor.potentiometer.offset", "30.0", "mm", 18.0),
    ] {
        let text = with(AXIS, path, value, unit);
        let error = AxisConfig::parse("my.toml", &text).expect_err("too much");
        let mut advised = error
            .problems()
            .iter()
            .flat_map(|problem| problem.advice().iter().flatten());
        let advised = advised.find(|advised| advised.path == path);
        let value = advised
            .unwrap_or_else(|| panic!("{}", report(&error)))
            .value;
        assert!(
            value < most + 1e-9 && value > 0.9 * most,
            "{path} = {value}"
        );
        let mended = with(AXIS, path, &format!("{value:?}"), unit);
        AxisConfig::parse("my.toml", &mended).expect("accepted");
    }
}
