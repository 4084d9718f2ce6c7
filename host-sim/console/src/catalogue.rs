//! Lists for clients, as data: channels, commands of the master, commands of the host, faults, each with the
//! facts that a form or a plot needs.

use serde_json::{Value, json};
use wheeleg_access::host::HOST_TABLE;
use wheeleg_config::faults::KINDS;
use wheeleg_master::argument::{Argument, ArgumentKind, Limits};
use wheeleg_master::command::{CommandCode, TABLE};
use wheeleg_telemetry::channels;
use wheeleg_telemetry::event::holds;

/// Usual arguments of a command, for clients that leave some out: forms begin with them. Few commands have
/// such values: a slow walk straight ahead on level ground.
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

/// First 16 digits of the BLAKE3 of a list's contents.
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
    /// The faults that can begin while a robot runs.
    pub(crate) faults_json: String,
    /// Why all axes may hold, in words.
    pub(crate) holds_json: String,
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
            holds_json: Value::Array(hold_list()).to_string(),
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
    // The shortest decimal number for the limit.
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

fn hold_list() -> Vec<Value> {
    let list = holds().map(|(name, words)| {
        json!({
            "hold": name,
            "cause": words.cause,
            "consequence": words.consequence,
            "remedy": words.remedy,
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
        assert!(wheeleg_access::arguments::command(CommandCode::Walk, &walk).is_ok());
        assert_eq!(list[list.len() - 1]["code"], 0x030A);
        assert_eq!(catalogue.layout.len(), 16);
        assert_ne!(catalogue.layout, catalogue.commands);
    }
}
