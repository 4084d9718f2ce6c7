//! Arguments of the master's commands, from JSON: values are in the units of the table of commands,
//! and a parameter's value in the unit of the parameter.

use fixed::types::I16F16;
use serde_json::{Map, Value as Json};
use wheeleg_config::{Dimension, allowed_raw, allowed_values, argument_dimension, closest, pretty};
use wheeleg_master::argument::{self, Argument, ArgumentKind, Value};
use wheeleg_master::command::{Command, CommandCode, CommandInfo, Given};
use wheeleg_protocol::Node;
use wheeleg_protocol::param::{Format, ParamInfo, params_at};

/// Most arguments of a command.
const ARGUMENTS_MAX: usize = 32;

/// The command with these arguments.
///
/// # Errors
/// All that is wrong with them, in words.
pub fn command(code: CommandCode, args: &Map<String, Json>) -> Result<Command, String> {
    if args.len() > ARGUMENTS_MAX {
        return Err("too many arguments".to_owned());
    }
    let info = code.info();
    let given = args.iter().map(|(name, json)| Given {
        name,
        // Of an argument that does not exist, the value is not looked at.
        value: info
            .argument(name)
            .map_or(Value::Flag(false), |argument| value(argument, json, args)),
    });
    let given: Vec<Given> = given.collect();
    Command::build(code, &given).map_err(|error| {
        let wrong = wrong_arguments(&info, args);
        match wrong.is_empty() {
            // Values that contradict each other.
            true => error.to_string(),
            false => wrong.join("; "),
        }
    })
}

/// The name that is most likely meant, as a question.
pub(crate) fn meant<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    let near = closest(word, names);
    near.map_or(String::new(), |near| format!(", did you mean `{near}`?"))
}

/// The raw number of a value that a parameter may have.
#[must_use]
pub fn raw(info: &ParamInfo, json: &Json) -> Option<i32> {
    match (json, info.format) {
        (Json::Bool(flag), Format::Flag) => allowed_raw(info, f64::from(u8::from(*flag))),
        (Json::Number(number), _) => allowed_raw(info, number.as_f64()?),
        _ => None,
    }
}

/// The parameters of the board that the arguments name.
fn parameters(args: &Map<String, Json>) -> &'static [ParamInfo] {
    let number = args.get(argument::BOARD.name).and_then(Json::as_u64);
    let board = number.and_then(|number| Node::new(u8::try_from(number).ok()?));
    board.map_or(&[], |board| params_at(board.number()))
}

/// The parameter that the arguments name.
fn parameter(args: &Map<String, Json>) -> Option<&'static ParamInfo> {
    let name = args.get(argument::PARAMETER.name)?.as_str()?;
    parameters(args).iter().find(|row| row.name == name)
}

/// All that is wrong with single arguments, in words; values as their sender wrote them.
fn wrong_arguments(info: &CommandInfo, args: &Map<String, Json>) -> Vec<String> {
    let mut wrong = Vec::new();
    for name in args.keys().filter(|name| info.argument(name).is_none()) {
        let names: Vec<&str> = info.arguments.iter().map(|a| a.name).collect();
        let takes = match names.is_empty() {
            true => "it takes none".to_owned(),
            false => format!("it takes: {}", names.join(", ")),
        };
        let near = meant(name, names);
        wrong.push(format!("{} takes no {name:?}{near}; {takes}", info.name));
    }
    for argument in info.arguments {
        let name = argument.name;
        let range = match (argument.kind, parameter(args)) {
            (ArgumentKind::Raw, Some(info)) => allowed_values(info),
            _ => argument.range().to_string(),
        };
        let Some(json) = args.get(name) else {
            wrong.push(format!("`{name}` is missing; allowed: {range}"));
            continue;
        };
        let how = advice(argument, json, args);
        match argument.kind.admits(value(argument, json, args)) {
            Some(true) => {}
            // The unknown parameter is reported instead.
            None if argument.kind == ArgumentKind::Raw && parameter(args).is_none() => {}
            Some(false) => wrong.push(format!("`{name}` is {json}; allowed: {range}{how}")),
            None if argument.kind == ArgumentKind::Raw => {
                wrong.push(format!("`{name}` is {json}; allowed: {range}{how}"));
            }
            None => {
                let kind = argument.kind.name();
                wrong.push(format!(
                    "`{name}` is {json}, not a {kind}; allowed: {range}{how}"
                ));
            }
        }
    }
    wrong
}

/// How to write a value that was meant as a number, a word or a parameter of a board.
fn advice(argument: &Argument, json: &Json, args: &Map<String, Json>) -> String {
    if argument.kind == ArgumentKind::Parameter {
        let table = parameters(args);
        let Some(text) = json.as_str() else {
            let row = table
                .iter()
                .find(|row| Some(u64::from(row.id)) == json.as_u64());
            return row.map_or(String::new(), |row| {
                format!(", by its name: {} of this board is `{}`", row.id, row.name)
            });
        };
        return meant(text, table.iter().map(|row| row.name));
    }
    let Some(text) = json.as_str() else {
        return String::new();
    };
    match argument.kind {
        ArgumentKind::Choice(words) => meant(text, words.iter().copied()),
        kind => without_unit(kind, text).map_or(String::new(), |number| {
            format!(", without a unit: {number}")
        }),
    }
}

/// Converts a number with a unit to the unit of its argument; `None` if that is not known: a number in
/// another unit would move the robot somewhere else.
fn without_unit(kind: ArgumentKind, text: &str) -> Option<String> {
    let is_part = |c: char| c.is_ascii_digit() || "+-.".contains(c);
    let end = text.find(|c| !is_part(c)).unwrap_or(text.len());
    let (number, unit) = (&text[..end], text[end..].trim());
    let value: f64 = number.parse().ok()?;
    if unit.is_empty() || unit == kind.unit() {
        return Some(number.to_owned());
    }
    let dimension = argument_dimension(kind);
    if matches!(dimension, Dimension::Flag | Dimension::Count) {
        return None;
    }
    let factor = dimension.factor(unit)? / dimension.factor(kind.unit())?;
    Some(pretty(value * factor))
}

/// The value of an argument; one of another kind if the JSON is of another kind, or if it cannot be
/// interpreted.
fn value(argument: &Argument, json: &Json, args: &Map<String, Json>) -> Value {
    let wrong = match argument.kind {
        ArgumentKind::Flag => Value::Whole(0),
        _ => Value::Flag(false),
    };
    match argument.kind {
        ArgumentKind::Whole(_) => {
            let whole = json.as_i64().or_else(|| json.as_u64().map(|_| i64::MAX));
            whole.map_or(wrong, |v| {
                Value::Whole(v.clamp(i32::MIN.into(), i32::MAX.into()) as i32)
            })
        }
        ArgumentKind::Parameter => match (json, parameter(args)) {
            (_, Some(info)) => Value::Whole(info.id.into()),
            // No number that a parameter has.
            (Json::String(_), None) => Value::Whole(-1),
            _ => wrong,
        },
        ArgumentKind::Raw => parameter(args)
            .and_then(|info| raw(info, json))
            .map_or(wrong, Value::Whole),
        ArgumentKind::Length(_)
        | ArgumentKind::Velocity(_)
        | ArgumentKind::Acceleration(_)
        | ArgumentKind::Rate(_) => json
            .as_f64()
            .map_or(wrong, |v| Value::Fixed(I16F16::saturating_from_num(v))),
        // The cast saturates; a time before now is as far out of range as there is.
        ArgumentKind::Time(_) => json.as_f64().map_or(wrong, |s| match s < 0.0 {
            true => Value::Micros(u32::MAX),
            false => Value::Micros((s * 1e6).round() as u32),
        }),
        ArgumentKind::Choice(words) => {
            let place = json
                .as_str()
                .and_then(|word| words.iter().position(|w| *w == word));
            match (json.as_str(), place) {
                (Some(_), Some(place)) => Value::Choice(place as u8),
                (Some(_), None) => Value::Choice(u8::MAX),
                _ => wrong,
            }
        }
        ArgumentKind::Flag => json.as_bool().map_or(wrong, Value::Flag),
    }
}
