//! The motion and the commands of a scenario are judged with the robot that carries them out, as if their
//! values were in its file.

mod common;
#[path = "common/values.rs"]
mod values;

use common::{assert_all, report};
use values::SHORT;
use wheeleg_config::{Advised, ConfigError, Problem, RobotConfig, Scenario, builtin};

const ROBOT: &str = include_str!("../../robots/wheeleg-2003.toml");

/// Paths, values as written, and units.
type Changes<'a> = &'a [(&'a str, &'a str, &'a str)];

fn robot(changes: Changes<'_>) -> RobotConfig {
    let mut text = ROBOT.to_owned();
    for (path, value, unit) in changes {
        text = values::with(&text, path, value, unit);
    }
    RobotConfig::parse("my-robot.toml", &text).unwrap_or_else(|e| panic!("{}", report(&e)))
}

fn scenario(motion: &str, events: &str) -> String {
    format!(
        "name = \"x\"\ndescription = \"x\"\nrobot = \"wheeleg-2003\"\nduration = \"10 s\"\nseed = 1\n\
         targets = \"none\"\n[motion]\n{motion}\n{events}"
    )
}

const STAND: &str = "kind = \"stand\"";

fn event(at_s: u32, command: &str) -> String {
    format!("[[events]]\nat = \"{at_s} s\"\naction = \"command\"\n{command}\n")
}

/// The gait of the robot with other values.
fn gait(changes: &[(&str, &str)]) -> String {
    let mut text = String::from("command = \"SetGait\"\n");
    for (key, value) in [
        ("steps", "3"),
        ("period", "\"3.333333 s\""),
        ("lift", "\"0.1 s\""),
        ("reach", "\"0.5 s\""),
        ("lower", "\"1 s\""),
        ("push", "\"2 s\""),
        ("stroke", "\"90 mm\""),
        ("held_leg_s5", "\"45 mm\""),
        ("held_leg_s6", "\"90 mm\""),
        ("yaw_s2", "\"90 mm\""),
        ("push_speed", "\"0.18 m/s\""),
        ("push_acceleration", "\"0.6 m/s2\""),
        ("pattern", "\"single\""),
        ("leg", "\"left\""),
        ("touchdown_speed", "\"0 mm/s\""),
        ("touchdown_reflex", "false"),
    ] {
        let changed = changes.iter().find(|(other, _)| *other == key);
        let value = changed.map_or(value, |(_, value)| *value);
        text += &format!("{key} = {value}\n");
    }
    text
}

fn judged(text: &str, robot: &RobotConfig) -> Result<(), ConfigError> {
    let scenario = Scenario::parse("my.toml", text).unwrap_or_else(|e| panic!("{}", report(&e)));
    scenario.check_with(robot)
}

fn assert_accepted(text: &str, robot: &RobotConfig) {
    if let Err(error) = judged(text, robot) {
        panic!("{}", report(&error));
    }
}

/// One problem with these words; its advice, put into the file, is accepted.
fn assert_refused(text: &str, robot: &RobotConfig, parts: &[&str]) -> Problem {
    let error = judged(text, robot).expect_err("must be refused");
    let said = report(&error);
    assert_eq!(error.problems().len(), 1, "{said}");
    assert_all(&said, parts);
    assert_all(&error.to_string(), &["my.toml", "my-robot.toml"]);
    let problem = error.problems()[0].clone();
    for set in problem.advice() {
        let mut mended = text.to_owned();
        for Advised { path, value, unit } in set {
            mended = with(&mended, path, &format!("\"{value} {unit}\""));
        }
        assert_accepted(&mended, robot);
    }
    problem
}

/// A scenario with another value of a field of its last section.
fn with(text: &str, path: &str, value: &str) -> String {
    let (_, key) = path.rsplit_once('.').expect("a key");
    let at = text.rfind(&format!("\n{key} = ")).expect("the field") + 1;
    let end = text[at..].find('\n').map_or(text.len(), |end| at + end);
    let value = match key {
        // A number in the unit of its parameter.
        "value" => value.trim_matches('"').split(' ').next().expect("a number"),
        _ => value,
    };
    format!("{}{key} = {value}{}", &text[..at], &text[end..])
}

#[test]
fn a_gait_is_judged_with_the_cylinders_that_carry_it_out() {
    let short = robot(SHORT);
    let of = |changes: &[(&str, &str)]| scenario(STAND, &event(1, &gait(changes)));
    assert_accepted(&of(&[]), &short);
    for (key, line, relation) in [
        ("stroke", 19, "stroke of the gait"),
        ("held_leg_s5", 20, "held leg, forward"),
        ("held_leg_s6", 21, "held leg, down"),
        ("yaw_s2", 22, "yaw of the gait"),
    ] {
        let text = of(&[(key, "\"90.001 mm\"")]);
        let told = format!(
            "my.toml:{line}: `events[0].{key}` = 90.001 mm (line {line}) and `cylinder.stroke` = 90 mm of \
             my-robot.toml do not fit together"
        );
        let allowed = format!("`events[0].{key}` is allowed up to 90 mm");
        let problem = assert_refused(&text, &short, &[&told, &allowed]);
        assert_eq!(problem.relation(), Some(relation));
        assert_eq!(problem.advice().len(), 1, "of {key}");
        // In the file's own unit, and exactly the available stroke.
        assert_accepted(&of(&[(key, "\"0.09 m\"")]), &short);
    }
}

/// With its mass as far to the rear as it can stand with: drawing back a leg tips it over.
#[test]
fn a_pose_in_which_the_robot_does_not_stand_is_refused() {
    let robot = robot(&[("body.chassis_com", "[-0.265, 0.02]", "m")]);
    let of = |held: &str| {
        let changes = [
            ("stroke", "\"180 mm\""),
            ("held_leg_s6", "\"180 mm\""),
            ("held_leg_s5", held),
        ];
        scenario(STAND, &event(2, &gait(&changes)))
    };
    assert_accepted(&of("\"95 mm\""), &robot);
    let problem = assert_refused(
        &of("\"0 mm\""),
        &robot,
        &[
            "my.toml:19: `events[0].stroke` = 180 mm (line 19)",
            "`events[0].held_leg_s5` = 0 mm (line 20)",
            "`body.chassis_com` = [-0.265, 0.02] m of my-robot.toml",
            "does not stand",
            "allowed",
        ],
    );
    assert_eq!(problem.relation(), Some("standing"));
}

#[test]
fn a_parameter_that_an_event_writes_is_judged_with_the_sensor() {
    let robot = robot(&[]);
    let write = |at_s: u32, parameter: &str, value: &str| {
        event(
            at_s,
            &format!(
                "command = \"WriteParameter\"\nboard = 3\nparameter = \"{parameter}\"\nvalue = {value}"
            ),
        )
    };
    // At any time.
    assert_accepted(&scenario(STAND, &write(1, "settle_band", "0.8")), &robot);
    let problem = assert_refused(
        &scenario(STAND, &write(1, "settle_band", "0.1")),
        &robot,
        &[
            "`events[0].value` = 0.1 mm (line 15), the `settle_band` of board 3",
            "`sensor.adc.bits` = ",
            "`events[0].value` is allowed from ",
        ],
    );
    assert_eq!(problem.relation(), Some("steps of the converter"));
    // Only while disarmed: before that the board refuses it.
    let full_scale = |at_s: u32| write(at_s, "sensor_full_scale", "100.0");
    assert_accepted(&scenario(STAND, &full_scale(1)), &robot);
    let disarm = event(1, "command = \"Disarm\"");
    let problem = assert_refused(
        &scenario(STAND, &(disarm.clone() + &full_scale(2))),
        &robot,
        &[
            "`events[1].value` = 100 mm (line 19), the `sensor_full_scale` of board 3",
            "`cylinder.stroke` = 180 mm of my-robot.toml",
        ],
    );
    assert_eq!(problem.relation(), Some("measured stroke"));
    // The values when the board is armed count, not those in between.
    let back = write(3, "sensor_full_scale", "200.0");
    assert_accepted(
        &scenario(STAND, &(disarm.clone() + &full_scale(2) + &back)),
        &robot,
    );
    let arm = event(3, "command = \"Arm\"");
    let late = write(4, "sensor_full_scale", "200.0");
    let all = disarm + &full_scale(2) + &arm + &late;
    assert!(judged(&scenario(STAND, &all), &robot).is_err());
    // A value that no board accepts is refused when it is read.
    let beyond = scenario(STAND, &write(1, "settle_band", "1000"));
    let error = Scenario::parse("my.toml", &beyond).expect_err("must be refused");
    assert_all(
        &report(&error),
        &[
            "my.toml:15: `events[0].value` = 1000",
            "allowed 0 to 100 mm",
        ],
    );
}

/// A board that stays as wrong as it was is reported once; one that is made wrong in another way, again.
#[test]
fn a_wrong_parameter_of_a_board_is_told_once_whatever_is_written_after_it() {
    let robot = robot(&[]);
    let write = |at_s: u32, board: u8, parameter: &str, value: &str| {
        event(
            at_s,
            &format!(
                "command = \"WriteParameter\"\nboard = {board}\nparameter = \"{parameter}\"\nvalue = {value}"
            ),
        )
    };
    let refusals = |events: &[String]| {
        let error = judged(&scenario(STAND, &events.concat()), &robot).expect_err("refused");
        error.problems().len()
    };
    let wrong = write(1, 3, "settle_band", "0.1");
    let others = [
        write(2, 3, "settle_dwell", "50000"),
        write(3, 3, "settle_dwell", "60000"),
    ];
    assert_eq!(refusals(&[wrong.clone(), others.concat()]), 1);
    let worse = write(4, 3, "settle_band", "0.05");
    assert_eq!(refusals(&[wrong.clone(), others.concat(), worse]), 2);
    let another = write(4, 4, "settle_band", "0.1");
    assert_eq!(refusals(&[wrong, others.concat(), another]), 2);
}

#[test]
fn references_and_paths_stay_within_the_cylinders() {
    let short = robot(SHORT);
    let reference = |stroke: &str| {
        let command = format!("command = \"JointReference\"\njoint = 3\nstroke = \"{stroke}\"");
        scenario(STAND, &event(1, &command))
    };
    assert_accepted(&reference("90 mm"), &short);
    assert_accepted(&reference("180 mm"), &robot(&[]));
    assert_refused(
        &reference("9.1 cm"),
        &short,
        &[
            "my.toml:14: `events[0].stroke` = 9.1 cm (line 14) and `cylinder.stroke` = 90 mm of my-robot.toml",
            "`events[0].stroke` is allowed up to 9 cm",
        ],
    );
    let foot = |height: &str| {
        let command = format!(
            "command = \"FootTrajectory\"\nleg = \"left\"\nforward = \"50 mm\"\nleft = \"0 mm\"\n\
             height = \"{height}\"\nrate = \"0.5 rad/s\""
        );
        scenario(STAND, &event(1, &command))
    };
    assert_accepted(&foot("80 mm"), &short);
    assert_refused(
        &foot("120 mm"),
        &short,
        &[
            "`events[0].height` = \"120 mm\" (line 16)",
            "`cylinder.stroke` = 90 mm of my-robot.toml",
            "the foot would leave the reach of its leg",
            "`events[0].height` is allowed up to 90 mm",
        ],
    );
    let sinusoid = |length: &str, height: &str| {
        let motion = format!(
            "kind = \"sinusoid\"\nleg = \"right\"\nlength = \"{length}\"\nheight = \"{height}\"\n\
             rate = \"0.5 rad/s\""
        );
        scenario(&motion, "")
    };
    assert_accepted(&sinusoid("90 mm", "90 mm"), &short);
    assert_refused(
        &sinusoid("90 mm", "91 mm"),
        &short,
        &[
            "`motion.height` = \"91 mm\" (line 11)",
            "`motion.height` is allowed up to 90 mm",
        ],
    );
    // It starts in the pose of the gait in use.
    let paper = robot(&[]);
    assert_accepted(&foot("120 mm"), &paper);
    let lower = gait(&[("held_leg_s6", "\"180 mm\""), ("stroke", "\"100 mm\"")]);
    let path = foot("120 mm");
    let (_, events) = path.split_once("[[events]]").expect("an event");
    let text = scenario(STAND, &(event(0, &lower) + "[[events]]" + events));
    let told = judged(&text, &paper).map_err(|e| report(&e));
    assert!(told.is_err(), "{told:?}");
}

#[test]
fn a_walk_needs_the_strokes_that_it_is_planned_with() {
    let walk = "kind = \"walk\"\nspeed = \"50 mm/s\"\nturn = \"0 rad/s\"\npattern = \"alternate\"\n\
                lift = \"60 mm\"\nnose = \"-20 mm\"";
    let short = robot(SHORT);
    assert_refused(
        &scenario(walk, ""),
        &short,
        &[
            "my.toml:8: `motion.kind` = \"walk\" (line 8) and `cylinder.stroke` = 90 mm of my-robot.toml",
            "`cylinder.stroke` is allowed from 180 mm",
        ],
    );
    let command = walk.replace("kind = \"walk\"", "command = \"Walk\"");
    assert_refused(
        &scenario(STAND, &event(1, &command)),
        &short,
        &["`events[0].command` = \"Walk\" (line 12)"],
    );
    assert_accepted(&scenario(walk, ""), &robot(&[]));
    // Its nose cannot be lower than its legs are long.
    let low = robot(&[
        ("gait.stroke", "100.0", "mm"),
        ("body.foot_pad", "0.20", "m"),
    ]);
    let deep = |nose: &str| scenario(&walk.replace("-20 mm", nose), "");
    assert_accepted(&deep("-100 mm"), &low);
    assert_refused(
        &deep("-101 mm"),
        &low,
        &[
            "`motion.nose` = \"-101 mm\" (line 13) and `gait.stroke` = 100 mm of my-robot.toml",
            "`motion.nose` is allowed from -100 to 0 mm",
        ],
    );
}

/// The built-in scenarios ask for nothing that their robots cannot do.
#[test]
fn built_in_scenarios_fit_their_robots() {
    for (name, ..) in builtin::SCENARIOS {
        let scenario = builtin::scenario(name).expect("built in");
        let robot = builtin::robot_of(&scenario, name).expect("built in");
        if let Err(error) = scenario.check_with(&robot) {
            panic!("{name}: {}", report(&error));
        }
    }
}

/// A thousand wrong commands are reported quickly, each once.
#[test]
fn a_thousand_wrong_commands_are_judged_in_a_moment() {
    let short = robot(SHORT);
    let one = "command = \"JointReference\"\njoint = 3\nstroke = \"91 mm\"";
    let events: String = (0..1000).map(|i| event(i % 9, one)).collect();
    let text = scenario(STAND, &events);
    let begun = std::time::Instant::now();
    let error = judged(&text, &short).expect_err("refused");
    assert_eq!(error.problems().len(), 1000);
    let seconds = begun.elapsed().as_secs_f64();
    assert!(seconds < 10.0, "{seconds} s");
}
