//! Commands of scenario files: every argument of the master's table, by its name, unit and range.

mod common;

use common::{assert_all, report};
use wheeleg_config::{ConfigError, EventAction, Motion, Scenario};
use wheeleg_master::argument::{Argument, ArgumentKind, Limits};
use wheeleg_master::command::{Command, CommandInfo, TABLE};
use wheeleg_master::contact::Side;
use wheeleg_master::layer1::foot::FootShape;
use wheeleg_protocol::param::{JOINT_PARAMS, ParamInfo, WHEEL_PARAMS};
use wheeleg_units::PositionMm;

const HEAD: &str = "name = \"x\"\ndescription = \"x\"\nrobot = \"wheeleg-2003\"\n\
                    duration = \"10 s\"\nseed = 1\ntargets = \"none\"\n";

fn scenario(event: &str) -> String {
    format!(
        "{HEAD}[motion]\nkind = \"stand\"\n[[events]]\nat = \"1 s\"\naction = \"command\"\n{event}"
    )
}

fn read(event: &str) -> Result<Command, ConfigError> {
    let scenario = Scenario::parse("my.toml", &scenario(event))?;
    match scenario.events[0].action {
        EventAction::Command(command) => Ok(command),
        ref other => panic!("{other:?}"),
    }
}

/// A wrong event gives one problem, with these words.
fn assert_told(event: &str, parts: &[&str]) {
    let error = read(event).expect_err("must be rejected");
    let text = report(&error);
    assert_eq!(error.problems().len(), 1, "{text}");
    assert_all(&text, parts);
}

/// The paper's gait and otherwise the largest values: accepted arguments.
fn usual(argument: &Argument) -> String {
    let instants = [
        ("period", "3.333333 s"),
        ("nose", "-20 mm"),
        ("turn", "0.05 rad/s"),
        ("reach", "0.5 s"),
        ("lower", "1 s"),
        ("push", "2 s"),
        ("push_acceleration", "0.6 m/s2"),
        ("rate", "0.125 rad/s"),
    ];
    if let Some((_, text)) = instants.iter().find(|(name, _)| *name == argument.name) {
        return format!("\"{text}\"");
    }
    match argument.kind {
        ArgumentKind::Time(_) => "\"100 ms\"".to_owned(),
        ArgumentKind::Whole(_) => "3".to_owned(),
        ArgumentKind::Choice(words) => format!("\"{}\"", words[0]),
        ArgumentKind::Flag => "true".to_owned(),
        ArgumentKind::Parameter => {
            // One that every board has.
            let common = |p: &&ParamInfo| WHEEL_PARAMS.iter().any(|w| w.name == p.name);
            let parameter = JOINT_PARAMS.iter().find(common).expect("there is one");
            format!("\"{}\"", parameter.name)
        }
        ArgumentKind::Raw => "20".to_owned(),
        _ => "{ value = 60, unit = \"mm\" }".replace("mm", argument.kind.unit()),
    }
}

fn event(row: &CommandInfo, but: Option<(&str, &str)>) -> String {
    let lines = row.arguments.iter().map(|argument| {
        let own = usual(argument);
        let value = but.filter(|(name, _)| *name == argument.name);
        format!(
            "{} = {}\n",
            argument.name,
            value.map_or(own.as_str(), |(_, value)| value)
        )
    });
    format!("command = \"{}\"\n{}", row.name, lines.collect::<String>())
}

/// Both limits as written in a file, and one step of the master beyond each.
fn edges(argument: &Argument) -> Option<[[String; 2]; 2]> {
    let kind = argument.kind;
    let step = 1.0 / 65_536.0;
    Some(match kind {
        ArgumentKind::Whole(Limits { min, max }) => [
            [min.to_string(), max.to_string()],
            [(min - 1).to_string(), (max + 1).to_string()],
        ],
        ArgumentKind::Length(Limits { min, max })
        | ArgumentKind::Velocity(Limits { min, max })
        | ArgumentKind::Acceleration(Limits { min, max })
        | ArgumentKind::Rate(Limits { min, max }) => {
            // As written in the documents.
            let numbers = [min, max].map(|v| v.to_string().parse::<f64>().unwrap());
            let [low, high] = numbers;
            let text = |v: f64| format!("{{ value = {v:.9}, unit = \"{}\" }}", kind.unit());
            [[low, high].map(text), [low - step, high + step].map(text)]
        }
        ArgumentKind::Time(Limits { min, max }) => {
            let text = |us: i64| format!("\"{us} us\"");
            let (min, max) = (i64::from(min), i64::from(max));
            [[min, max].map(text), [min - 1, max + 1].map(text)]
        }
        ArgumentKind::Choice(words) => [
            [words[0], words[words.len() - 1]].map(|word| format!("\"{word}\"")),
            ["\"\"", "\"both\""].map(str::to_owned),
        ],
        ArgumentKind::Flag => [
            ["true", "false"].map(str::to_owned),
            ["2", "\"yes\""].map(str::to_owned),
        ],
        ArgumentKind::Parameter | ArgumentKind::Raw => return None,
    })
}

/// Together with the test of the same name for the layers in the master's suite: a file accepts exactly what
/// the table says, and what the master accepts.
#[test]
fn every_argument_of_every_command_is_read_up_to_its_limits_and_no_step_beyond() {
    let mut arguments = 0;
    for row in TABLE {
        let command = read(&event(row, None)).unwrap_or_else(|e| panic!("{}", report(&e)));
        assert_eq!(command.code(), row.code);
        for argument in row.arguments {
            arguments += 1;
            let Some([within, beyond]) = edges(argument) else {
                continue;
            };
            for value in within {
                match read(&event(row, Some((argument.name, &value)))) {
                    Ok(command) => assert_eq!(command.code(), row.code),
                    Err(error) => {
                        // An instant at its limit is out of order with the others.
                        let text = report(&error);
                        assert!(
                            row.name == "SetGait" && text.contains("allowed: "),
                            "{text}"
                        );
                        assert!(!text.contains("out of range"), "{text}");
                    }
                }
            }
            for value in beyond {
                let path = format!("`events[0].{}`", argument.name);
                assert_told(
                    &event(row, Some((argument.name, &value))),
                    &["my.toml:", &path],
                );
            }
        }
    }
    assert_eq!(arguments, 50);
}

#[test]
fn a_missing_an_unknown_and_a_foreign_argument_are_told() {
    for row in TABLE {
        for argument in row.arguments {
            let line = format!("{} = {}\n", argument.name, usual(argument));
            let fewer = event(row, None).replace(&line, "");
            let error = read(&fewer).expect_err("must be rejected");
            let needs = format!(
                "`events[0]`: the command {} of the scenario needs `{}`",
                row.name, argument.name
            );
            let text = report(&error);
            assert!(text.contains(&needs), "{text}");
        }
    }
    assert_told(
        "command = \"JointReference\"\njoint = 1\n",
        &[
            "my.toml:9: `events[0]`: ",
            "needs `stroke`",
            "add `stroke` to it: `stroke = \"… mm\"`, 0 to 180 mm",
        ],
    );
    assert_told(
        "command = \"TransmitPosition\"\njoint = 1\nstroke = \"9 mm\"\n",
        &[
            "my.toml:14: ",
            "the command TransmitPosition takes no `stroke`",
            "it takes `joint`",
        ],
    );
    assert_told(
        "command = \"Arm\"\njoint = 1\n",
        &["the command Arm takes no `joint`", "it takes no arguments"],
    );
    assert_told(
        "command = \"Arm\"\njiont = 1\n",
        &[
            "unknown field `jiont` in [events[0]]",
            "known here: at, action, command",
        ],
    );
    assert_told(
        "command = \"JointReference\"\njoint = 1\nstroke = \"9 mm\"\nstrok = \"9 mm\"\n",
        &["unknown field `strok`", "did you mean `stroke`?"],
    );
    assert_told(
        "command = \"JointReferenc\"\njoint = 1\n",
        &[
            "`events[0].command`",
            "did you mean \"JointReference\"?",
            "\"SetGait\"",
        ],
    );
}

#[test]
fn joints_and_boards_count_from_1() {
    for (event, allowed) in [
        (
            "command = \"TransmitPosition\"\njoint = 0",
            "`events[0].joint` = 0 must be a whole number from 1 to 6",
        ),
        (
            "command = \"TransmitPosition\"\njoint = 9",
            "`events[0].joint` = 9 must be a whole number from 1 to 6",
        ),
        (
            "command = \"SaveParameters\"\nboard = 0",
            "`events[0].board` = 0 must be a whole number from 1 to 8",
        ),
        (
            "command = \"ReadParameter\"\nboard = 9\nparameter = \"proportional\"",
            "`events[0].board` = 9 must be a whole number from 1 to 8",
        ),
    ] {
        assert_told(event, &["my.toml:", allowed]);
    }
}

#[test]
fn gait_parameters_that_contradict_each_other_are_refused_on_reading() {
    let row = TABLE
        .iter()
        .find(|row| row.name == "SetGait")
        .expect("a command");
    assert_told(
        &event(row, Some(("period", "\"1 s\""))),
        &[
            "my.toml:14: `events[0].period` = 1 s (line 14) and `events[0].push` = 2 s (line 18) do not",
            "`push` is 2 s and must be less than `period`, which is 1 s; allowed: ",
            "`period`: 0.5 to 60 s, `push`: 0 to 60 s",
        ],
    );
    assert_told(
        &event(row, Some(("touchdown_speed", "\"10 mm/s\""))),
        &[
            "my.toml:27: `events[0].touchdown_speed` = 10 mm/s (line 27), `events[0].lower` = 1 s (line 17)",
            "`events[0].push` = 2 s (line 18) and `events[0].stroke` = ",
            "the last 15 mm of the lowering take 1.5 s, but from `lower` to `push` there are 1 s",
            "allowed: `touchdown_speed` 0, or `push` more than 1.5 s after `lower`",
        ],
    );
}

/// As text, with any unit of its kind, it is the same as a table; a number alone has no unit.
#[test]
fn quantities_may_be_written_as_text() {
    let stroke = |stroke: &str| {
        read(&format!(
            "command = \"JointReference\"\njoint = 3\nstroke = {stroke}\n"
        ))
    };
    let wanted = Command::JointReference {
        joint: 3,
        stroke_mm: PositionMm::from_int(90),
    };
    for text in [
        "\"90 mm\"",
        "\"9 cm\"",
        "\" 0.09   m \"",
        "\"90mm\"",
        "\"9e1mm\"",
        "\"+.9e-1m\"",
        "{ value = 90, unit = \"mm\" }",
        "{ value = 0.09, unit = \"m\", source = \"tried\" }",
    ] {
        assert_eq!(stroke(text).ok(), Some(wanted), "{text}");
    }
    for (text, told) in [
        ("90", "`events[0].stroke` has no unit; accepted: \"m\""),
        ("\"90\"", "`events[0].stroke` has no unit; accepted: \"m\""),
        (
            "\"90e\"",
            "`events[0].stroke` (value 90) is in \"e\"; accepted: \"m\"",
        ),
        (
            "\"90 s\"",
            "`events[0].stroke` (value 90) is in \"s\"; accepted: \"m\"",
        ),
        (
            "\"ninety mm\"",
            "`events[0].stroke` = \"ninety mm\" does not begin with a number; units: \"m\"",
        ),
        (
            "\"nan mm\"",
            "`events[0].stroke` = nan must be a finite number from 0 to 180 mm",
        ),
        (
            "\"0.19 m\"",
            "`events[0].stroke` = 0.19 m is out of range: allowed 0 to 0.18 m",
        ),
    ] {
        let error = stroke(text).expect_err("must be rejected");
        let report = report(&error);
        assert!(report.contains(told), "{text}: {report}");
    }
    let row = TABLE
        .iter()
        .find(|row| row.name == "SetGait")
        .expect("a command");
    assert_told(
        &event(row, Some(("touchdown_reflex", "2"))),
        &["`events[0].touchdown_reflex` = 2 must be true or false"],
    );
    let text = report(&stroke("90").expect_err("must be rejected"));
    assert!(text.contains("or `stroke = \"… m\"`"), "{text}");
}

/// A foot's path that the master refuses is refused in the motion as well.
#[test]
fn a_sinusoid_beyond_the_stroke_is_refused_on_reading() {
    let sinusoid = |length: &str, height: &str, rate: &str| {
        let text = format!(
            "{HEAD}[motion]\nkind = \"sinusoid\"\nleg = \"left\"\nlength = \"{length}\"\n\
             height = \"{height}\"\nrate = \"{rate}\"\n"
        );
        Scenario::parse("my.toml", &text).map(|scenario| scenario.motion)
    };
    let most = sinusoid("0.18 m", "180 mm", "2 rad/s").expect("the limits are allowed");
    let Motion::Sinusoid { length_m, .. } = most else {
        panic!("another motion");
    };
    assert!((length_m - 0.18).abs() < 1e-12);
    for (length, height, rate, told) in [
        (
            "0.24 m",
            "0.1 m",
            "0.125 rad/s",
            "my.toml:10: `motion.length` = 0.24 m is out of range: allowed 0 to 0.18 m",
        ),
        (
            "0.1 m",
            "0.19 m",
            "0.125 rad/s",
            "my.toml:11: `motion.height` = 0.19 m is out of range: allowed 0 to 0.18 m",
        ),
        (
            "0.1 m",
            "0.1 m",
            "0.04 rad/s",
            "my.toml:12: `motion.rate` = 0.04 rad/s is out of range: allowed 0.05 to 2 rad/s",
        ),
    ] {
        let error = sinusoid(length, height, rate).expect_err("must be rejected");
        assert!(report(&error).contains(told), "{}", report(&error));
    }
}

#[test]
fn arguments_arrive_in_the_units_of_the_master() {
    let foot = "command = \"FootTrajectory\"\nleg = \"right\"\nforward = \"0.12 m\"\n\
                left = \"-6 cm\"\nheight = \"50 mm\"\nrate = \"0.25 rad/s\"\n";
    let wanted = Command::FootTrajectory {
        side: Side::Right,
        shape: FootShape::Arch {
            forward_mm: PositionMm::from_int(120),
            left_mm: PositionMm::from_int(-60),
            height_mm: PositionMm::from_int(50),
            rate_rad_s: 0.25,
        },
    };
    assert_eq!(read(foot).ok(), Some(wanted));
    let row = TABLE
        .iter()
        .find(|row| row.name == "SetGait")
        .expect("a command");
    let Ok(Command::SetGait(gait)) = read(&event(row, None)) else {
        panic!("the paper's gait is accepted");
    };
    assert_eq!((gait.lift_us, gait.period_us), (100_000, 3_333_333));
    assert!(gait.touchdown_reflex);
    let write =
        "command = \"WriteParameter\"\nboard = 1\nparameter = \"proportional\"\nvalue = 0.5\n";
    let wanted = Command::WriteParameter {
        node: 1,
        id: 0x0101,
        raw: 1 << 23,
    };
    assert_eq!(read(write).ok(), Some(wanted));
    // A value that the board would refuse is refused before the run.
    for (parameter, value, allowed) in [
        ("proportional", "2100000", "allowed 0 to 4 1/mm"),
        ("law", "9", "allowed whole numbers from 0 to "),
        ("law", "0.5", "allowed whole numbers from 0 to "),
    ] {
        let write = format!(
            "command = \"WriteParameter\"\nboard = 1\nparameter = \"{parameter}\"\nvalue = {value}\n"
        );
        let text = report(&read(&write).expect_err("out of range"));
        assert_all(
            &text,
            &[
                &format!("`events[0].value` = {value} is out of range"),
                allowed,
            ],
        );
    }
}

/// Values without effect, and numbers in other countries' style.
#[test]
fn an_event_at_the_end_and_a_decimal_comma_are_refused() {
    let head =
        "name = \"x\"\ndescription = \"\"\nrobot = \"wheeleg\"\nseed = 1\ntargets = \"none\"\n";
    let told = |duration: &str, at: &str| {
        let text = format!(
            "{head}duration = \"{duration}\"\n[motion]\nkind = \"stand\"\n\
             [[events]]\nat = \"{at}\"\naction = \"e-stop\"\n"
        );
        Scenario::parse("my.toml", &text).map_err(|error| report(&error))
    };
    assert!(told("2 s", "1.999 s").is_ok());
    let late = told("2 s", "400 s").expect_err("beyond the end");
    assert_all(&late, &["`events[0].at` = 400 s", "0 s to below 2 s"]);
    assert!(!late.contains("0 to 2 s"), "{late}");
    for at in ["2 s", "2000 ms"] {
        let text = told("2 s", at).expect_err("does nothing");
        assert_all(
            &text,
            &[
                "my.toml:10:",
                "`events[0].at` = 2 s",
                "0 s to below 2 s",
                "duration",
            ],
        );
    }
    let text = told("2,5 s", "1 s").expect_err("a comma");
    assert_all(&text, &["my.toml:6:", "`duration`", "decimal point"]);
    for (comma, point) in [("0,5 s", "0.5 s"), ("-0,5s", "-0.5s"), ("2,25", "2.25")] {
        let text = told(comma, "1 s").expect_err("a comma");
        let comma = format!("`duration` = \"{comma}\" has a decimal comma");
        assert_all(
            &text,
            &["my.toml:6:", &comma, &format!("write \"{point}\"")],
        );
    }
    for (odd, help) in [
        ("200 µs", "\"us\" for \"µs\""),
        ("200 μs", "\"us\" for \"μs\""),
        ("2 с", "plain letters"),
        ("1_000 ms", "written as 1000"),
        ("0x10 s", "written as 16"),
        ("2,5,1 s", "decimal point"),
        ("２ s", "does not begin with a number"),
    ] {
        let text = told(odd, "1 s").expect_err("odd");
        assert_all(&text, &["my.toml:6:", "`duration`", "\"s\", \"ms\"", help]);
    }
    let text = told("2 S", "1 s").expect_err("another case");
    assert_all(&text, &["my.toml:6:", "`duration`", "did you mean \"s\""]);
    let digits = "9".repeat(300);
    let text = told(&digits, "1 s").expect_err("too long");
    assert_all(&text, &["my.toml:6:", "`duration`"]);
    assert!(text.len() < 300, "{text}");
}
