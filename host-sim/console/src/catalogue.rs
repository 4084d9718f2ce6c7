//! What can be seen and given, as data: channels, commands of the master, commands of the host,
//! faults, each with what a form or a plot needs to know.

use serde_json::{Value, json};
use wheeleg_config::faults::KINDS;
use wheeleg_master::argument::{Argument, ArgumentKind, Limits};
use wheeleg_master::command::{CommandCode, TABLE};
use wheeleg_telemetry::channels;

/// An argument of a command of the host.
#[derive(Debug, Clone, Copy)]
pub struct HostArgument {
    /// Name.
    pub name: &'static str,
    /// Kind: `number`, `whole number` or `text`.
    pub kind: &'static str,
    /// Unit; `1` if it has none.
    pub unit: &'static str,
    /// Smallest and largest value of a number.
    pub limits: Option<(f64, f64)>,
    /// Meaning.
    pub doc: &'static str,
}

/// Which command of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostCode {
    /// Stops the clock.
    Pause = 0x0301,
    /// Lets it go on.
    Resume = 0x0302,
    /// Some bus cycles of a paused robot.
    Step = 0x0303,
    /// How fast the clock goes.
    Speed = 0x0304,
    /// A fault begins.
    Inject = 0x0305,
    /// A fault ends.
    EndFault = 0x0306,
    /// A recording begins.
    RecordStart = 0x0307,
    /// The recording ends.
    RecordStop = 0x0308,
    /// The control goes to another client.
    HandOver = 0x0309,
    /// The control is revoked.
    Revoke = 0x030A,
}

/// A command that acts on the simulation or on who is in control, and does not move the robot.
#[derive(Debug, Clone, Copy)]
pub struct HostInfo {
    /// Number.
    pub code: HostCode,
    /// Name.
    pub name: &'static str,
    /// Arguments.
    pub arguments: &'static [HostArgument],
    /// What it does.
    pub effect: &'static str,
}

/// Most bus cycles of one `Step`.
pub const STEP_MAX: u32 = 1_000;
/// Shortest and longest time for which revoked control is reserved for the robot's own computer, s.
pub const HOLD_S: (u32, u32) = (2, 600);
/// Slowest and fastest pace.
pub const SPEED: (f64, f64) = (0.1, 10.0);
/// Fastest pace at which somebody may be in control.
pub(crate) const SPEED_OF_CONTROL: f64 = 2.0;

const FAULT: HostArgument = HostArgument {
    name: "fault",
    kind: "text",
    unit: "1",
    limits: None,
    doc: "Fault and target, such as `pot-open:joint3`, as `wheeleg faults list` has them.",
};

/// Commands of the host.
pub const HOST_TABLE: &[HostInfo] = &[
    HostInfo {
        code: HostCode::Pause,
        name: "Pause",
        arguments: &[],
        effect: "Stops the clock of the simulation.",
    },
    HostInfo {
        code: HostCode::Resume,
        name: "Resume",
        arguments: &[],
        effect: "Resumes the clock of the simulation.",
    },
    HostInfo {
        code: HostCode::Step,
        name: "Step",
        arguments: &[HostArgument {
            name: "cycles",
            kind: "whole number",
            unit: "1",
            limits: Some((1.0, STEP_MAX as f64)),
            doc: "Bus cycles of 10 ms.",
        }],
        effect: "Simulates some bus cycles of a paused robot.",
    },
    HostInfo {
        code: HostCode::Speed,
        name: "Speed",
        arguments: &[HostArgument {
            name: "speed",
            kind: "number",
            unit: "1",
            limits: Some(SPEED),
            doc: "Ratio of simulated to wall time; above 2 only while nobody is in control.",
        }],
        effect: "Sets the pace of the simulation.",
    },
    HostInfo {
        code: HostCode::Inject,
        name: "Inject",
        arguments: &[FAULT],
        effect: "Injects a fault, which lasts until it is ended or ends by itself.",
    },
    HostInfo {
        code: HostCode::EndFault,
        name: "EndFault",
        arguments: &[FAULT],
        effect: "Ends a fault.",
    },
    HostInfo {
        code: HostCode::RecordStart,
        name: "RecordStart",
        arguments: &[],
        effect: "Starts a recording: the log, and every command with its time, so that the run can be replayed.",
    },
    HostInfo {
        code: HostCode::RecordStop,
        name: "RecordStop",
        arguments: &[],
        effect: "Ends the recording.",
    },
    HostInfo {
        code: HostCode::HandOver,
        name: "HandOver",
        arguments: &[HostArgument {
            name: "to",
            kind: "text",
            unit: "1",
            limits: None,
            doc: "Session of the client, as reported when that client asked for control.",
        }],
        effect: "Releases control, and reserves it for another client for 2 s. Refused in the same cases as ReleaseControl.",
    },
    HostInfo {
        code: HostCode::Revoke,
        name: "Revoke",
        arguments: &[HostArgument {
            name: "hold",
            kind: "whole number",
            unit: "s",
            limits: Some((HOLD_S.0 as f64, HOLD_S.1 as f64)),
            doc: "Time for which only clients on the robot's own computer may then take control.",
        }],
        effect: "Revokes control from its holder, or from who has asked for it, as if the operator were lost: an armed robot holds. For a while after that, only clients on the robot's own computer may take control. Only on that computer.",
    },
];

/// What the arguments of a command usually are, for who leaves some of them out: forms begin with it. Few
/// commands have such values: a slow walk straight ahead on level ground.
#[must_use]
pub fn usual(command: &str) -> Vec<(String, Value)> {
    let arguments = match CommandCode::of_name(command) {
        Some(CommandCode::Walk) => json!({
            "speed": 100, "turn": 0, "pattern": "alternate", "lift": 60, "nose": -20,
        }),
        _ => json!({}),
    };
    match arguments {
        Value::Object(arguments) => arguments.into_iter().collect(),
        _ => Vec::new(),
    }
}

/// First 16 digits of the BLAKE3 of what a list says.
fn hash(list: &Value) -> String {
    let digest = blake3::hash(list.to_string().as_bytes());
    digest.to_hex().as_str()[..16].to_owned()
}

/// Channels and commands, made once.
#[derive(Debug)]
pub(crate) struct Catalogue {
    /// Hash of the channels.
    pub(crate) layout: String,
    /// Hash of the commands.
    pub(crate) commands: String,
    /// Answer of `/api/v1/channels`.
    pub(crate) channels_json: String,
    /// Answer of `/api/v1/commands`.
    pub(crate) commands_json: String,
    /// The faults that can begin in a robot that runs.
    pub(crate) faults_json: String,
}

impl Catalogue {
    pub(crate) fn new() -> Self {
        let channels = channel_list();
        let mut commands = command_list();
        commands.extend(host_list());
        let (channels, commands) = (Value::Array(channels), Value::Array(commands));
        let (layout, hash) = (hash(&channels), hash(&commands));
        Self {
            channels_json: json!({ "layout": layout, "channels": channels }).to_string(),
            commands_json: json!({ "hash": hash, "commands": commands }).to_string(),
            faults_json: Value::Array(fault_list()).to_string(),
            layout,
            commands: hash,
        }
    }
}

fn channel_list() -> Vec<Value> {
    let list = channels().iter().enumerate().map(|(id, channel)| {
        let fields = channel.fields.iter().map(|f| {
            json!({
                "name": f.name,
                "unit": f.unit,
                "wire": f.wire.name(),
                "decimals": f.decimals,
                "layer": f.layer.name(),
                "description": f.doc,
            })
        });
        json!({
            "id": id,
            "topic": channel.topic,
            "schema": channel.schema,
            "rate_hz": channel.rate_hz,
            "written": channel.written.name(),
            "description": channel.doc,
            "fields": fields.collect::<Vec<_>>(),
        })
    });
    list.collect()
}

/// The commands of the master, as JSON.
#[must_use]
pub fn command_list() -> Vec<Value> {
    let list = TABLE.iter().map(|row| {
        let usual = usual(row.name);
        let arguments = row.arguments.iter().map(|row| {
            let mut value = argument(row);
            if let Some((_, usual)) = usual.iter().find(|(name, _)| name == row.name) {
                value["usual"] = usual.clone();
            }
            value
        });
        let arguments: Vec<Value> = arguments.collect();
        json!({
            "name": row.name,
            "code": row.code as u16,
            "layer": row.code.layer() as u8,
            "effect": row.effect,
            "arguments": arguments,
        })
    });
    list.collect()
}

fn host_list() -> Vec<Value> {
    let list = HOST_TABLE.iter().map(|row| {
        let arguments = row.arguments.iter().map(|argument| {
            let mut value = json!({
                "name": argument.name,
                "kind": argument.kind,
                "unit": argument.unit,
                "description": argument.doc,
            });
            if let Some((min, max)) = argument.limits {
                value["min"] = json!(min);
                value["max"] = json!(max);
            }
            value
        });
        json!({
            "name": row.name,
            "code": row.code as u16,
            "layer": 2,
            "effect": row.effect,
            "arguments": arguments.collect::<Vec<_>>(),
        })
    });
    list.collect()
}

/// An argument; its limits are in its unit.
fn argument(argument: &Argument) -> Value {
    let mut value = json!({
        "name": argument.name,
        "kind": argument.kind.name(),
        "unit": argument.kind.unit(),
        "description": argument.doc,
    });
    // The shortest decimal number that means the limit.
    let number = |text: String| text.parse::<f64>().map_or(Value::Null, Value::from);
    match argument.kind {
        ArgumentKind::Whole(Limits { min, max }) => {
            value["min"] = json!(min);
            value["max"] = json!(max);
        }
        ArgumentKind::Length(Limits { min, max })
        | ArgumentKind::Velocity(Limits { min, max })
        | ArgumentKind::Acceleration(Limits { min, max })
        | ArgumentKind::Rate(Limits { min, max }) => {
            value["min"] = number(min.to_string());
            value["max"] = number(max.to_string());
        }
        ArgumentKind::Time(Limits { min, max }) => {
            value["min"] = json!(f64::from(min) / 1e6);
            value["max"] = json!(f64::from(max) / 1e6);
        }
        ArgumentKind::Choice(words) => value["choices"] = json!(words),
        ArgumentKind::Flag | ArgumentKind::Parameter | ArgumentKind::Raw => {}
    }
    value
}

fn fault_list() -> Vec<Value> {
    let list = KINDS.iter().filter(|row| !row.kind.is_built_in());
    let list = list.map(|row| {
        json!({
            "fault": row.name,
            "targets": row.place.expected(),
            "places": row.place.targets(),
            "effect": row.doc,
            "value": row.value.map(|v| json!({
                "unit": v.unit, "min": v.min, "max": v.max, "default": v.default, "description": v.doc,
            })),
        })
    });
    list.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_field_command_and_argument_is_listed() {
        let catalogue = Catalogue::new();
        let value: Value = serde_json::from_str(&catalogue.channels_json).expect("JSON");
        let list = value["channels"].as_array().expect("a list");
        assert_eq!(list.len(), channels().len());
        for (channel, shown) in channels().iter().zip(list) {
            let fields = shown["fields"].as_array().expect("a list");
            assert_eq!(fields.len(), channel.fields.len(), "{}", channel.topic);
        }
        let value: Value = serde_json::from_str(&catalogue.commands_json).expect("JSON");
        let list = value["commands"].as_array().expect("a list");
        assert_eq!(list.len(), TABLE.len() + HOST_TABLE.len());
        for (row, shown) in TABLE.iter().zip(list) {
            assert_eq!(shown["name"], row.name);
            let arguments = shown["arguments"].as_array().expect("a list");
            assert_eq!(arguments.len(), row.arguments.len());
            let has_usual = arguments.iter().filter(|a| !a["usual"].is_null()).count();
            assert_eq!(has_usual, usual(row.name).len(), "{}", row.name);
        }
        // A walk can be given without any argument.
        let walk = usual("Walk").into_iter().collect();
        assert!(crate::arguments::command(CommandCode::Walk, &walk).is_ok());
        assert_eq!(list[list.len() - 1]["code"], 0x030A);
        assert_eq!(catalogue.layout.len(), 16);
        assert_ne!(catalogue.layout, catalogue.commands);
    }
}
