//! Frames of a client as typed requests. They come over the network: every answer is a value, nothing panics,
//! and nothing grows beyond the frame.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json};
use wheeleg_config::faults::FaultSpec;
use wheeleg_master::command::{Command, CommandCode, TABLE};
use wheeleg_telemetry::channel_index;

use crate::arguments::{self, meant};
use crate::host::{HOLD_S, HOST_TABLE, HostCode, HostInfo, SPEED, STEP_MAX};
use crate::reason::Reason;

/// Largest frame of a client, MAC included.
pub const FRAME_MAX: usize = 4096;
/// Fastest subscription, Hz.
pub const HZ_MAX: u64 = 50;
/// Longest life of a command, ms.
const VALID_MAX_MS: u64 = 1_000;
/// Longest life of a command about parameters, ms.
const PARAMETER_VALID_MAX_MS: u64 = 5_000;

/// A frame of a client.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Its number.
    pub n: u64,
    /// Its request.
    pub body: Body,
}

/// The request of a frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Body {
    /// The operator has seen the robot.
    Beat {
        /// As it was at this master time, µs.
        seen_us: u64,
    },
    /// Stop.
    Stop,
    /// Samples from now on.
    Subscribe {
        /// Indices of channels.
        channels: Vec<u16>,
        /// Samples per second; `None`: all.
        hz: Option<u32>,
    },
    /// No samples from now on.
    Unsubscribe {
        /// Indices of channels.
        channels: Vec<u16>,
    },
    /// A command.
    Give {
        /// Which.
        order: Order,
        /// The same as its sender wrote it.
        spoken: Spoken,
        /// Newest master time shown, µs.
        seen_us: u64,
        /// How long after it the command may begin, µs.
        valid_us: u64,
    },
    /// Well-formed, but impossible.
    Refused(BadRequest),
}

/// A command as its sender wrote it, for repetition from a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spoken {
    /// Name.
    pub cmd: String,
    /// Arguments by name.
    pub args: Map<String, Json>,
}

impl Spoken {
    /// The command.
    ///
    /// # Errors
    /// [`BadRequest`] if there is no command with this name and these arguments.
    pub fn order(&self) -> Result<Order, BadRequest> {
        order(&self.cmd, &self.args)
    }
}

/// Target of a command.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// The robot, by its master.
    Robot(Command),
    /// The simulation, or who is in control.
    Host(HostCommand),
    /// Control passes from the holder to the client of this session.
    HandOver(String),
    /// Control is taken away from the holder.
    Revoke {
        /// Time for which the control is then reserved for the robot's own computer.
        hold: Duration,
    },
}

/// A command of the host.
#[derive(Debug, Clone, PartialEq)]
pub enum HostCommand {
    /// Stops the clock.
    Pause,
    /// Resumes it.
    Resume,
    /// Some bus cycles.
    Step(u32),
    /// Simulated over wall time.
    Speed(f64),
    /// A fault begins.
    Inject(FaultSpec),
    /// A fault ends.
    EndFault(FaultSpec),
    /// A recording begins.
    RecordStart,
    /// The recording ends.
    RecordStop,
}

/// Why a well-formed frame is impossible.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadRequest {
    /// Name that stays the same.
    pub reason: Reason,
    /// For a person.
    pub text: String,
}

/// The frame is not of the contract.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Malformed;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    n: u64,
    op: Option<String>,
    seen_us: Option<u64>,
    valid_ms: Option<u64>,
    cmd: Option<String>,
    args: Option<Map<String, Json>>,
    channels: Option<Vec<String>>,
    hz: Option<Rate>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Rate {
    Hz(u64),
    Word(String),
}

/// Reads the JSON of a frame.
///
/// # Errors
/// [`Malformed`] if it is not of the contract's form.
pub fn parse(json: &[u8]) -> Result<Frame, Malformed> {
    let raw: Raw = serde_json::from_slice(json).map_err(|_| Malformed)?;
    let n = raw.n;
    let body = body(raw)?;
    Ok(Frame { n, body })
}

fn body(raw: Raw) -> Result<Body, Malformed> {
    Ok(match raw {
        Raw {
            op: Some(op),
            seen_us: Some(seen_us),
            valid_ms: None,
            cmd: None,
            args: None,
            channels: None,
            hz: None,
            ..
        } if op == "beat" => Body::Beat { seen_us },
        Raw {
            op: Some(op),
            seen_us: None,
            valid_ms: None,
            cmd: None,
            args: None,
            channels: None,
            hz: None,
            ..
        } if op == "stop" => Body::Stop,
        Raw {
            op: Some(op),
            seen_us: None,
            valid_ms: None,
            cmd: None,
            args: None,
            channels: Some(topics),
            hz,
            ..
        } => {
            let channels = match indices(&topics) {
                Ok(channels) => channels,
                Err(bad) => return Ok(Body::Refused(bad)),
            };
            match (op.as_str(), hz) {
                ("subscribe", Some(Rate::Hz(hz @ 1..=HZ_MAX))) => Body::Subscribe {
                    channels,
                    hz: Some(hz as u32),
                },
                ("subscribe", Some(Rate::Word(word))) if word == "all" => {
                    Body::Subscribe { channels, hz: None }
                }
                ("subscribe", Some(_)) => Body::Refused(BadRequest {
                    reason: Reason::BadArgument,
                    text: format!("`hz`: allowed are 1 to {HZ_MAX}, and \"all\""),
                }),
                ("unsubscribe", None) => Body::Unsubscribe { channels },
                _ => return Err(Malformed),
            }
        }
        Raw {
            op: None,
            seen_us: Some(seen_us),
            valid_ms: Some(valid_ms),
            cmd: Some(name),
            args: Some(args),
            channels: None,
            hz: None,
            ..
        } => {
            let spoken = Spoken { cmd: name, args };
            let order = spoken.order();
            match order.and_then(|order| Ok((valid_us(&order, valid_ms)?, order))) {
                Ok((valid_us, order)) => Body::Give {
                    order,
                    spoken,
                    seen_us,
                    valid_us,
                },
                Err(bad) => Body::Refused(bad),
            }
        }
        _ => return Err(Malformed),
    })
}

fn indices(topics: &[String]) -> Result<Vec<u16>, BadRequest> {
    let find = |topic: &String| {
        channel_index(topic)
            .map(|index| index as u16)
            .ok_or_else(|| BadRequest {
                reason: Reason::UnknownChannel,
                text: format!("there is no channel {topic:?}: `wheeleg channels` lists them"),
            })
    };
    topics.iter().map(find).collect()
}

fn valid_us(order: &Order, valid_ms: u64) -> Result<u64, BadRequest> {
    let most = match order {
        Order::Robot(
            Command::ReadParameter { .. }
            | Command::WriteParameter { .. }
            | Command::SaveParameters { .. },
        ) => PARAMETER_VALID_MAX_MS,
        _ => VALID_MAX_MS,
    };
    if (1..=most).contains(&valid_ms) {
        Ok(valid_ms * 1_000)
    } else {
        Err(BadRequest {
            reason: Reason::BadArgument,
            text: format!("`valid_ms`: allowed are 1 to {most}, not {valid_ms}"),
        })
    }
}

fn order(name: &str, args: &Map<String, Json>) -> Result<Order, BadRequest> {
    if let Some(code) = CommandCode::of_name(name) {
        let command = arguments::command(code, args).map_err(bad_argument)?;
        return Ok(Order::Robot(command));
    }
    if let Some(info) = HOST_TABLE.iter().find(|row| row.name == name) {
        return host(info, args);
    }
    let robots = TABLE.iter().map(|row| row.name);
    let names = robots.chain(HOST_TABLE.iter().map(|row| row.name));
    let near = meant(name, names);
    Err(BadRequest {
        reason: Reason::BadCommand,
        text: format!(
            "there is no command {name:?}{near}: `wheeleg commands` lists those of the robot"
        ),
    })
}

fn bad_argument(text: impl ToString) -> BadRequest {
    BadRequest {
        reason: Reason::BadArgument,
        text: text.to_string(),
    }
}

fn host(info: &HostInfo, args: &Map<String, Json>) -> Result<Order, BadRequest> {
    if let Some(name) = args
        .keys()
        .find(|name| info.arguments.iter().all(|a| a.name != *name))
    {
        let near = meant(name, info.arguments.iter().map(|a| a.name));
        return Err(bad_argument(format!(
            "{} takes no {name:?}{near}",
            info.name
        )));
    }
    let given = |name: &str| {
        let missing = || bad_argument(format!("{} needs `{name}`", info.name));
        args.get(name).ok_or_else(missing)
    };
    let fault = || {
        let json = given("fault")?;
        let no_text = || bad_argument(format!("`fault` is {json}, and must be a text"));
        let text = json.as_str().ok_or_else(no_text)?;
        if let Some((before, _)) = text.split_once('@') {
            return Err(bad_argument(format!(
                "`fault` is {text:?}, and takes no time: it begins now, and ends with EndFault; \
                 write {before:?}"
            )));
        }
        FaultSpec::at_once(text).map_err(bad_argument)
    };
    let whole = |name: &str, min: u32, max: u32| {
        let json = given(name)?;
        let number = json.as_u64().and_then(|n| u32::try_from(n).ok());
        let number = number.filter(|n| (min..=max).contains(n));
        number.ok_or_else(|| {
            bad_argument(format!(
                "`{name}` is {json}; allowed: whole numbers from {min} to {max}"
            ))
        })
    };
    Ok(Order::Host(match info.code {
        HostCode::Pause => HostCommand::Pause,
        HostCode::Resume => HostCommand::Resume,
        HostCode::Step => HostCommand::Step(whole("cycles", 1, STEP_MAX)?),
        HostCode::Speed => {
            let (min, max) = SPEED;
            let json = given("speed")?;
            let speed = json.as_f64().filter(|v| (min..=max).contains(v));
            HostCommand::Speed(speed.ok_or_else(|| {
                bad_argument(format!("`speed` is {json}; allowed: {min} to {max}"))
            })?)
        }
        HostCode::Inject => HostCommand::Inject(fault()?),
        HostCode::EndFault => HostCommand::EndFault(fault()?),
        HostCode::RecordStart => HostCommand::RecordStart,
        HostCode::RecordStop => HostCommand::RecordStop,
        HostCode::HandOver => {
            let json = given("to")?;
            let no_text = || bad_argument(format!("`to` is {json}, and must be a text"));
            let to = json.as_str().ok_or_else(no_text)?.to_owned();
            return Ok(Order::HandOver(to));
        }
        HostCode::Revoke => {
            let seconds = whole("hold", HOLD_S.0, HOLD_S.1)?;
            return Ok(Order::Revoke {
                hold: Duration::from_secs(seconds.into()),
            });
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn give(json: &str) -> Body {
        parse(json.as_bytes()).expect("of the contract").body
    }

    #[test]
    fn commands_are_those_of_the_table() {
        let body = give(
            r#"{"n":7,"seen_us":81230000,"valid_ms":500,"cmd":"JointReference","args":{"joint":3,"stroke":120.0}}"#,
        );
        let Body::Give {
            order: Order::Robot(Command::JointReference { joint, stroke_mm }),
            seen_us,
            valid_us,
            ..
        } = body
        else {
            panic!("{body:?}");
        };
        assert_eq!((joint, stroke_mm.to_f64()), (3, 120.0));
        assert_eq!((seen_us, valid_us), (81_230_000, 500_000));
        let body = give(
            r#"{"n":7,"seen_us":0,"valid_ms":5000,"cmd":"ReadParameter","args":{"board":3,"parameter":"proportional"}}"#,
        );
        assert!(matches!(body, Body::Give { .. }), "{body:?}");
    }

    /// In the unit of the parameter, as a scenario's file has it.
    #[test]
    fn a_parameter_is_written_in_its_unit() {
        let write = |args: &str| {
            give(&format!(
                r#"{{"n":1,"seen_us":0,"valid_ms":5000,"cmd":"WriteParameter","args":{args}}}"#
            ))
        };
        let raw_of = |args: &str| match write(args) {
            Body::Give {
                order: Order::Robot(Command::WriteParameter { node, id, raw }),
                ..
            } => (node, id, raw),
            other => panic!("{args}: {other:?}"),
        };
        // I16F16, and in the scenario's words.
        let args = r#"{"board":3,"parameter":"error_scale","value":21}"#;
        assert_eq!(raw_of(args), (3, 0x0105, 21 << 16));
        let text =
            "command = \"WriteParameter\"\nboard = 3\nparameter = \"error_scale\"\nvalue = 21\n";
        let wanted = wheeleg_config::command(text).expect("a command");
        let (node, id, raw) = raw_of(args);
        assert_eq!(Command::WriteParameter { node, id, raw }, wanted);
        for (args, told) in [
            (
                r#"{"board":3,"parameter":"proportional","value":5}"#,
                "`value` is 5; allowed: 0 to 4 1/mm",
            ),
            (
                r#"{"board":3,"parameter":"proportional","value":"1"}"#,
                "`value` is \"1\"; allowed: 0 to 4 1/mm",
            ),
            (
                r#"{"board":3,"parameter":261,"value":5}"#,
                "`parameter` is 261, not a parameter; allowed: a parameter of the board, by its \
                 name: 261 of this board is `error_scale`",
            ),
            (
                r#"{"board":3,"parameter":"proportionl","value":1}"#,
                "did you mean `proportional`?",
            ),
            (
                r#"{"board":9,"parameter":"proportional","value":1}"#,
                "`board` is 9; allowed: 1 to 8",
            ),
            (r#"{"board":3,"value":1}"#, "`parameter` is missing"),
            (
                r#"{"board":3,"parameter":"proportional"}"#,
                "`value` is missing; allowed: 0 to 4 1/mm",
            ),
        ] {
            let Body::Refused(bad) = write(args) else {
                panic!("{args}: accepted");
            };
            assert!(bad.text.contains(told), "{args}: {}", bad.text);
        }
    }

    #[test]
    fn what_cannot_be_done_is_refused_by_name() {
        let refused = |cmd: &str, args: &str, valid: u64| {
            let json =
                format!(r#"{{"n":1,"seen_us":0,"valid_ms":{valid},"cmd":"{cmd}","args":{args}}}"#);
            match give(&json) {
                Body::Refused(bad) => (bad.reason, bad.text),
                other => panic!("{other:?}"),
            }
        };
        for (cmd, args, reason, word) in [
            ("Fly", "{}", "bad_command", "Fly"),
            ("JointReference", "{}", "bad_argument", "joint"),
            (
                "JointReference",
                r#"{"joint":7,"stroke":1}"#,
                "bad_argument",
                "joint",
            ),
            (
                "JointReference",
                r#"{"joint":-1e99,"stroke":1}"#,
                "bad_argument",
                "joint",
            ),
            (
                "JointReference",
                r#"{"joint":18446744073709551615,"stroke":1}"#,
                "bad_argument",
                "joint",
            ),
            (
                "JointReference",
                r#"{"joint":1,"stroke":1e300}"#,
                "bad_argument",
                "stroke",
            ),
            (
                "JointReference",
                r#"{"joint":1,"stroke":"1"}"#,
                "bad_argument",
                "stroke",
            ),
            ("Arm", r#"{"now":true}"#, "bad_argument", "now"),
            (
                "SelectCorrection",
                r#"{"joint":1,"correction":"xx"}"#,
                "bad_argument",
                "correction",
            ),
            ("Step", r#"{"cycles":0}"#, "bad_argument", "cycles"),
            ("Speed", r#"{"speed":11}"#, "bad_argument", "speed"),
            ("Pause", r#"{"speed":1}"#, "bad_argument", "speed"),
            (
                "Inject",
                r#"{"fault":"pot-open:joint9"}"#,
                "bad_argument",
                "joint9",
            ),
            (
                "Inject",
                r#"{"fault":"pot-open:joint3@1s"}"#,
                "bad_argument",
                "time",
            ),
        ] {
            let (got, text) = refused(cmd, args, 500);
            assert!(
                got.name() == reason && text.contains(word),
                "{cmd} {args}: {got} {text}"
            );
        }
        for (cmd, args, advice) in [
            ("jointreference", "{}", "did you mean `JointReference`?"),
            ("WheelRefrence", "{}", "did you mean `WheelReference`?"),
            ("pause", "{}", "did you mean `Pause`?"),
            (
                "JointReference",
                r#"{"joint":1,"strok":1}"#,
                "did you mean `stroke`?",
            ),
            (
                "JointReference",
                r#"{"joint":1,"stroke":"120mm"}"#,
                "without a unit: 120",
            ),
            (
                "JointReference",
                r#"{"joint":1,"stroke":"12cm"}"#,
                "without a unit: 120",
            ),
            (
                "JointReference",
                r#"{"joint":1,"stroke":"0.12 m"}"#,
                "without a unit: 120",
            ),
            (
                "WheelReference",
                r#"{"travel":"-0.5m"}"#,
                "without a unit: -500",
            ),
            (
                "ReadParameter",
                r#"{"board":1,"parameter":268}"#,
                "268 of this board is `settle_band`",
            ),
            ("Speed", r#"{"sped":1}"#, "did you mean `speed`?"),
        ] {
            let (_, text) = refused(cmd, args, 500);
            assert!(text.contains(advice), "{cmd} {args}: {text}");
        }
        // A value without a unit of length would be a wrong length.
        let (_, text) = refused("JointReference", r#"{"joint":1,"stroke":"4in"}"#, 500);
        assert!(
            text.contains("0 to 180 mm") && !text.contains("without a unit"),
            "{text}"
        );
        for valid in [0, 1001] {
            let (_, text) = refused("Arm", "{}", valid);
            assert!(text.contains("valid_ms"), "{text}");
        }
    }

    /// Every wrong argument is reported, with its value and the allowed range.
    #[test]
    fn all_that_is_wrong_is_told_with_value_and_range() {
        for (cmd, args, parts) in [
            (
                "Walk",
                r#"{"speed":30,"pattern":"trot"}"#,
                &[
                    "`pattern` is \"trot\"; allowed: alternate, tandem",
                    "`turn` is missing; allowed: ",
                    "`lift` is missing; allowed: ",
                    "`nose` is missing; allowed: ",
                ][..],
            ),
            (
                "JointReference",
                r#"{"joint":-1e99,"stroke":1e300,"now":1}"#,
                &[
                    "`joint` is -1e",
                    "1 to 6",
                    "`stroke` is 1e",
                    "0 to 180 mm",
                    "takes no \"now\"",
                ],
            ),
            (
                "JointReference",
                "{}",
                &["`joint` is missing", "`stroke` is missing"],
            ),
            (
                "SetGait",
                r#"{"push":-1}"#,
                &["`push` is -1; allowed: 0 to 60 s"],
            ),
            (
                "Speed",
                r#"{"speed":50}"#,
                &["`speed` is 50; allowed: 0.1 to 10"],
            ),
            (
                "Step",
                r#"{"cycles":1e9}"#,
                &["`cycles` is 1000000000.0", "1 to 1000"],
            ),
            (
                "Inject",
                r#"{"fault":"bogus@0s"}"#,
                &["\"bogus@0s\"", "write \"bogus\""],
            ),
            ("Inject", r#"{"fault":"bogus"}"#, &["bogus"]),
            ("Inject", r#"{"fault":7}"#, &["`fault` is 7"]),
        ] {
            let json =
                format!(r#"{{"n":1,"seen_us":0,"valid_ms":500,"cmd":"{cmd}","args":{args}}}"#);
            let Body::Refused(bad) = give(&json) else {
                panic!("{cmd} {args}: accepted");
            };
            assert_eq!(bad.reason, Reason::BadArgument);
            for part in parts {
                assert!(
                    bad.text.contains(part),
                    "{cmd} {args}: no {part} in {}",
                    bad.text
                );
            }
        }
    }

    #[test]
    fn what_is_not_of_the_contract_is_malformed() {
        for json in [
            "",
            "{}",
            "[]",
            r#"{"n":1}"#,
            r#"{"n":-1,"op":"stop"}"#,
            r#"{"n":1,"op":"stop","x":1}"#,
            r#"{"n":1,"op":"stop","n":2}"#,
            r#"{"n":1,"op":"beat"}"#,
            r#"{"n":1,"op":"beat","seen_us":-1}"#,
            r#"{"n":1,"op":"subscribe","channels":["/body"]}"#,
            r#"{"n":1,"op":"stop","cmd":"Arm"}"#,
            r#"{"n":1,"seen_us":0,"cmd":"Arm","args":{}}"#,
        ] {
            assert_eq!(parse(json.as_bytes()), Err(Malformed), "{json}");
        }
        assert_eq!(parse(&[0xFF; 100]), Err(Malformed));
        let deep = "[".repeat(4000);
        assert_eq!(parse(deep.as_bytes()), Err(Malformed));
    }

    #[test]
    fn no_frame_makes_the_parser_panic() {
        const SOUND: [&str; 3] = [
            r#"{"n":7,"seen_us":81230000,"valid_ms":500,"cmd":"JointReference","args":{"joint":3,"stroke":120.0}}"#,
            r#"{"n":1,"op":"subscribe","channels":["/joint/3","/body"],"hz":50}"#,
            r#"{"n":9,"seen_us":1,"valid_ms":1,"cmd":"Inject","args":{"fault":"pot-open:joint3"}}"#,
        ];
        const PIECES: [&str; 12] = [
            "1e999",
            "-0",
            "null",
            "\\u0000",
            "[]",
            "{}",
            "é",
            "\"",
            "18446744073709551616",
            "@",
            ":",
            "=",
        ];
        let mut seed = 1_u64;
        let mut random = |below: usize| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as usize % below
        };
        let (mut read, mut refused) = (0, 0);
        for _ in 0..200_000 {
            let mut frame = SOUND[random(SOUND.len())].as_bytes().to_vec();
            for _ in 0..=random(4) {
                let at = random(frame.len());
                match random(4) {
                    0 => frame[at] ^= 1 << random(8),
                    1 => drop(frame.drain(at..(at + random(9)).min(frame.len()))),
                    2 => drop(frame.splice(at..at, PIECES[random(12)].bytes())),
                    _ => frame.truncate(at + 1),
                }
                if frame.is_empty() {
                    break;
                }
            }
            match parse(&frame) {
                Ok(_) => read += 1,
                Err(_) => refused += 1,
            }
        }
        // Both happen often, or the test frames are not as intended.
        assert!(read > 1_000 && refused > 1_000, "{read} {refused}");
    }

    #[test]
    fn subscriptions_name_channels_and_a_rate() {
        let body = give(r#"{"n":1,"op":"subscribe","channels":["/joint/3","/body"],"hz":50}"#);
        let wanted = Body::Subscribe {
            channels: vec![2, 8],
            hz: Some(50),
        };
        assert_eq!(body, wanted);
        let body = give(r#"{"n":1,"op":"subscribe","channels":["/body"],"hz":"all"}"#);
        assert!(matches!(body, Body::Subscribe { hz: None, .. }));
        for json in [
            r#"{"n":1,"op":"subscribe","channels":["/body"],"hz":51}"#,
            r#"{"n":1,"op":"subscribe","channels":["/body"],"hz":"some"}"#,
            r#"{"n":1,"op":"subscribe","channels":["/nobody"],"hz":1}"#,
        ] {
            assert!(matches!(give(json), Body::Refused(_)), "{json}");
        }
    }
}
