//! Arguments of commands: one table both for building commands and for the checks of the layers.

use fixed::types::I16F16;
use wheeleg_master::MasterConfig;
use wheeleg_master::argument::{Argument, ArgumentKind, Limits, Value};
use wheeleg_master::command::{ArgumentError, Command, CommandCode, Given, TABLE};
use wheeleg_master::contact::Side;
use wheeleg_master::dispatcher::Refusal;
use wheeleg_master::layer1::foot::FootShape;
use wheeleg_master::layer1::params::{ParamError, Pattern};
use wheeleg_units::{PositionMm, VelocityMmS};

use crate::common::TestRig;

/// Arguments that the master accepts: those of the paper's gait, otherwise about the middle of the range.
fn usual(argument: &'static Argument) -> Value {
    let seconds = |us| Value::Micros(us);
    match (argument.name, argument.kind) {
        ("period", _) => seconds(3_333_333),
        ("lift", ArgumentKind::Length(_)) => Value::Fixed(I16F16::lit("60")),
        ("lift", _) => seconds(100_000),
        ("reach", _) => seconds(500_000),
        ("lower", _) => seconds(1_000_000),
        ("push", _) => seconds(2_000_000),
        ("nose", _) => Value::Fixed(I16F16::lit("-20")),
        ("turn", _) => Value::Fixed(I16F16::lit("0.05")),
        ("speed", _) => Value::Fixed(I16F16::lit("120")),
        ("push_acceleration", _) => Value::Fixed(I16F16::lit("600")),
        ("left", _) => Value::Fixed(I16F16::ZERO),
        ("steps" | "joint", _) => Value::Whole(3),
        ("rate", _) => Value::Fixed(I16F16::lit("0.125")),
        (_, ArgumentKind::Whole(_)) => Value::Whole(7),
        (_, ArgumentKind::Parameter | ArgumentKind::Raw) => Value::Whole(0x101),
        (_, ArgumentKind::Choice(_)) => Value::Choice(0),
        (_, ArgumentKind::Flag) => Value::Flag(true),
        _ => Value::Fixed(I16F16::lit("180")),
    }
}

fn given(code: CommandCode) -> Vec<Given<'static>> {
    let arguments = code.info().arguments.iter();
    arguments
        .map(|argument| Given {
            name: argument.name,
            value: usual(argument),
        })
        .collect()
}

fn given_with(code: CommandCode, name: &str, value: Value) -> Vec<Given<'static>> {
    let mut given = given(code);
    for one in given.iter_mut().filter(|one| one.name == name) {
        one.value = value;
    }
    given
}

/// Smallest and largest value, and the next ones beyond them if the type can hold them.
fn edges(argument: &Argument) -> ([Value; 2], [Option<Value>; 2]) {
    let step = I16F16::from_bits(1);
    match argument.kind {
        ArgumentKind::Whole(Limits { min, max }) => (
            [min, max].map(Value::Whole),
            [min - 1, max + 1].map(|v| Some(Value::Whole(v))),
        ),
        ArgumentKind::Length(Limits { min, max })
        | ArgumentKind::Velocity(Limits { min, max })
        | ArgumentKind::Acceleration(Limits { min, max })
        | ArgumentKind::Rate(Limits { min, max }) => (
            [min, max].map(Value::Fixed),
            [min - step, max + step].map(|v| Some(Value::Fixed(v))),
        ),
        ArgumentKind::Time(Limits { min, max }) => (
            [min, max].map(Value::Micros),
            [
                min.checked_sub(1).map(Value::Micros),
                Some(Value::Micros(max + 1)),
            ],
        ),
        ArgumentKind::Choice(words) => {
            let beyond = words.len() as u8;
            let edges = [0, beyond - 1].map(Value::Choice);
            (edges, [None, Some(Value::Choice(beyond))])
        }
        ArgumentKind::Flag => ([false, true].map(Value::Flag), [None, None]),
        ArgumentKind::Parameter => (
            [0, 0xFFFF].map(Value::Whole),
            [-1, 0x1_0000].map(|v| Some(Value::Whole(v))),
        ),
        ArgumentKind::Raw => ([i32::MIN, i32::MAX].map(Value::Whole), [None, None]),
    }
}

/// The command with one value replaced, bypassing all checks; `None` if its type cannot hold it.
fn forced(command: Command, name: &str, value: Value) -> Option<Command> {
    let mut command = command;
    let byte = |v| u8::try_from(v).ok();
    let mm = PositionMm::new;
    match (&mut command, name, value) {
        (
            Command::JointReference { joint, .. }
            | Command::TransmitPosition { joint }
            | Command::OpenAllValves { joint }
            | Command::EmergencyBrake { joint }
            | Command::SelectCorrection { joint, .. }
            | Command::BlowThrough { joint },
            "joint",
            Value::Whole(v),
        ) => *joint = byte(v)?,
        (
            Command::ReadParameter { node, .. }
            | Command::WriteParameter { node, .. }
            | Command::SaveParameters { node },
            "board",
            Value::Whole(v),
        ) => *node = byte(v)?,
        (Command::JointReference { stroke_mm, .. }, "stroke", Value::Fixed(v)) => {
            *stroke_mm = mm(v);
        }
        (Command::WheelReference { travel_mm }, "travel", Value::Fixed(v)) => *travel_mm = mm(v),
        (Command::WheelSpeed { speed_mm_s, .. }, "speed", Value::Fixed(v)) => {
            *speed_mm_s = VelocityMmS::new(v);
        }
        (
            Command::WheelAcceleration {
                acceleration_mm_s2, ..
            },
            "acceleration",
            Value::Fixed(v),
        ) => *acceleration_mm_s2 = v,
        (Command::SetGait(gait), _, Value::Whole(v)) => gait.steps = u16::try_from(v).ok()?,
        (Command::SetGait(gait), _, Value::Micros(v)) => match name {
            "period" => gait.period_us = v,
            "lift" => gait.lift_us = v,
            "reach" => gait.reach_us = v,
            "lower" => gait.lower_us = v,
            _ => gait.push_us = v,
        },
        (Command::SetGait(gait), _, Value::Fixed(v)) => match name {
            "stroke" => gait.stroke_mm = mm(v),
            "held_leg_s5" => gait.held_leg_s5_mm = mm(v),
            "held_leg_s6" => gait.held_leg_s6_mm = mm(v),
            "yaw_s2" => gait.yaw_s2_mm = mm(v),
            "push_speed" => gait.push_speed_mm_s = VelocityMmS::new(v),
            "touchdown_speed" => gait.touchdown_speed_mm_s = VelocityMmS::new(v),
            _ => gait.push_acceleration_mm_s2 = v,
        },
        (Command::Walk(order), _, Value::Fixed(v)) => match name {
            "speed" => order.speed_mm_s = VelocityMmS::new(v),
            "turn" => order.turn_rad_s = v,
            "lift" => order.lift_mm = mm(v),
            _ => order.nose_mm = mm(v),
        },
        (
            Command::FootTrajectory {
                shape:
                    FootShape::Arch {
                        forward_mm,
                        left_mm,
                        height_mm,
                        rate_rad_s,
                    },
                ..
            },
            _,
            Value::Fixed(v),
        ) => match name {
            "forward" => *forward_mm = mm(v),
            "left" => *left_mm = mm(v),
            "height" => *height_mm = mm(v),
            _ => *rate_rad_s = v.to_num(),
        },
        // A byte and a choice hold nothing beyond their range.
        _ => return None,
    }
    Some(command)
}

/// Which argument, if any, makes the master refuse the command.
fn refused(command: Command) -> Option<Refusal> {
    let mut rig = TestRig::new(MasterConfig::default());
    match command {
        Command::FootTrajectory { .. } => rig.stand(),
        Command::BlowThrough { .. } | Command::SaveParameters { .. } => rig.run(30),
        _ => rig.arm(),
    }
    let ticket = rig.submit(command);
    rig.run(1);
    rig.refusal(ticket).filter(|refusal| {
        matches!(
            refusal,
            Refusal::Parameter(_) | Refusal::NoSuchJoint { .. } | Refusal::NoSuchBoard { .. }
        )
    })
}

#[test]
fn every_command_is_built_from_exactly_the_arguments_of_its_row() {
    for row in TABLE {
        let all = given(row.code);
        let command = Command::build(row.code, &all).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(command.code(), row.code);
        assert_eq!(CommandCode::of_name(row.name), Some(row.code));
        for (place, argument) in row.arguments.iter().enumerate() {
            let mut fewer = all.clone();
            fewer.remove(place);
            let missing = Err(ArgumentError::Missing(argument));
            assert_eq!(Command::build(row.code, &fewer), missing, "{}", row.name);
            let mut twice = all.clone();
            twice.push(all[place]);
            let name = argument.name;
            assert_eq!(
                Command::build(row.code, &twice),
                Err(ArgumentError::Twice { name })
            );
            let other = match argument.kind {
                ArgumentKind::Flag => Value::Whole(1),
                _ => Value::Flag(true),
            };
            let wrong = given_with(row.code, name, other);
            assert_eq!(
                Command::build(row.code, &wrong),
                Err(ArgumentError::WrongKind(argument))
            );
        }
        let mut more = all.clone();
        more.push(Given {
            name: "nothing",
            value: Value::Whole(1),
        });
        let unknown = ArgumentError::Unknown {
            code: row.code,
            name: "nothing",
        };
        assert_eq!(Command::build(row.code, &more), Err(unknown));
    }
}

/// The layers check exactly the ranges of the table when they carry a command out.
#[test]
fn the_layers_refuse_what_lies_one_step_beyond_the_table_and_nothing_within() {
    let mut refusals = 0;
    for row in TABLE {
        let sound = Command::build(row.code, &given(row.code)).unwrap();
        for argument in row.arguments {
            let at = format!("{} {}", row.name, argument.name);
            let (within, beyond) = edges(argument);
            for value in within {
                match Command::build(row.code, &given_with(row.code, argument.name, value)) {
                    Ok(command) => {
                        // The path of a foot is checked as well, and leads out of reach.
                        let refusal = refused(command).filter(|refusal| {
                            let reach = matches!(
                                refusal,
                                Refusal::Parameter(ParamError::OutOfReach { .. })
                            );
                            !reach
                        });
                        assert_eq!(refusal, None, "{at} {value:?}");
                    }
                    // An instant at its limit is out of order with the others, not out of range.
                    Err(ArgumentError::Relation(
                        ParamError::Order { .. } | ParamError::PushTooLong { .. },
                    )) => {}
                    Err(error) => panic!("{at} {value:?}: {error}"),
                }
            }
            for value in beyond.into_iter().flatten() {
                let beyond = given_with(row.code, argument.name, value);
                let Err(ArgumentError::OutOfRange(range)) = Command::build(row.code, &beyond)
                else {
                    panic!("{at} {value:?} is built");
                };
                assert_eq!((range.argument, range.value), (argument, value), "{at}");
                let Some(command) = forced(sound, argument.name, value) else {
                    continue;
                };
                refusals += 1;
                match refused(command) {
                    Some(Refusal::NoSuchJoint { .. } | Refusal::NoSuchBoard { .. }) => {}
                    Some(Refusal::Parameter(ParamError::OutOfRange(found))) => {
                        assert_eq!(found, range, "{at}");
                    }
                    other => panic!("{at} {value:?}: {other:?}"),
                }
            }
        }
    }
    assert!(refusals >= 50, "{refusals}");
}

#[test]
fn words_become_what_they_mean() {
    let build = |code, name, choice| {
        Command::build(code, &given_with(code, name, Value::Choice(choice))).unwrap()
    };
    let Command::SetGait(gait) = build(CommandCode::SetGait, "leg", 1) else {
        panic!("another command");
    };
    assert_eq!(gait.pattern, Pattern::Single(Side::Right));
    let Command::SetGait(gait) = build(CommandCode::SetGait, "pattern", 1) else {
        panic!("another command");
    };
    assert_eq!(gait.pattern, Pattern::Alternate { first: Side::Left });
    assert!(matches!(
        build(CommandCode::WheelFilter, "side", 1),
        Command::WheelFilter {
            side: Side::Right,
            ..
        }
    ));
}

#[test]
fn mistakes_are_told_in_sentences() {
    let told = |code, given: &[Given]| Command::build(code, given).unwrap_err().to_string();
    let stroke = |name, value| Given { name, value };
    let far = Value::Fixed(I16F16::lit("180.5"));
    assert_eq!(
        told(
            CommandCode::JointReference,
            &[stroke("joint", Value::Whole(3)), stroke("stroke", far)]
        ),
        "`stroke` is 180.5 mm, allowed: 0 to 180 mm"
    );
    assert_eq!(
        told(CommandCode::TransmitPosition, &[stroke("stroke", far)]),
        "TransmitPosition takes no `stroke`; it takes: `joint`"
    );
    assert_eq!(
        told(CommandCode::TransmitPosition, &[]),
        "`joint` is missing; allowed: 1 to 6"
    );
    assert_eq!(
        told(CommandCode::TransmitPosition, &[stroke("joint", far)]),
        "`joint` must be a whole number; allowed: 1 to 6"
    );
}
