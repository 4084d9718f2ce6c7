//! User commands in scenario files, read by the master's table: names, units and ranges of their arguments
//! are defined only there.

use fixed::types::I16F16;
use wheeleg_master::argument::{Argument, ArgumentKind, Limits, Value};
use wheeleg_master::command::{ArgumentError, Command, CommandCode, CommandInfo, Given, TABLE};

use super::error::ConfigError;
use super::node;
use super::params::FieldSpec;
use super::quantity::Dimension;
use super::reader::{Entry, Reader};

/// Fields of an event that are not arguments of its command.
const OF_THE_EVENT: [&str; 3] = ["at", "action", "command"];

/// Reads the command of an event; `top` are the fields at the top of the file.
pub(super) fn read(r: &mut Reader, entry: &Entry, top: &[&str]) -> Option<Command> {
    let names: Vec<(&str, CommandCode)> = TABLE.iter().map(|row| (row.name, row.code)).collect();
    let code = r.choice(entry, "command", &names)?;
    reject_others(r, entry, &code.info(), top);
    arguments(r, entry, code)
}

/// A command from TOML text, as the fields of an event of a scenario:
/// `command = "JointReference"`, then its arguments.
///
/// # Errors
/// [`ConfigError`] with every problem: argument, value, accepted units or range.
pub fn command(text: &str) -> Result<Command, ConfigError> {
    let what = "the command is not usable";
    let mut r = Reader::parse(what, "command", text, false)?;
    let command = r.table("").and_then(|entry| read(&mut r, &entry, &[]));
    r.finish(what, command).map(|(command, _)| command)
}

/// Reads the arguments of a command from `entry`.
pub(super) fn arguments(r: &mut Reader, entry: &Entry, code: CommandCode) -> Option<Command> {
    let row = code.info();
    let missing = row
        .arguments
        .iter()
        .filter(|argument| !entry.has(argument.name));
    let mut complete = true;
    for argument in missing {
        complete = false;
        r.problem(
            Some(entry.span.clone()),
            format!(
                "`{}`: the command {} of the scenario needs `{}`",
                entry.path, row.name, argument.name
            ),
            "in this section",
            Some(format!(
                "add `{}` to it: {}",
                argument.name,
                example(argument)
            )),
        );
    }
    // Read all of them, so that every mistake is reported.
    let given: Vec<Option<Given>> = row
        .arguments
        .iter()
        .filter(|argument| entry.has(argument.name))
        .map(|argument| {
            let value = value(r, entry, argument)?;
            let name = argument.name;
            Some(Given { name, value })
        })
        .collect();
    let given: Vec<Given> = given.into_iter().collect::<Option<_>>()?;
    if !complete {
        return None;
    }
    match Command::build(code, &given) {
        Ok(command) => Some(command),
        Err(ArgumentError::Relation(error)) => {
            let fields: Vec<String> = error
                .arguments()
                .map(|argument| entry.field_path(argument.name))
                .collect();
            let fields: Vec<&str> = fields.iter().map(String::as_str).collect();
            let ranges = error
                .arguments()
                .map(|argument| format!("`{}`: {}", argument.name, argument.range()));
            let ranges: Vec<String> = ranges.collect();
            let help = format!("each for itself may be {}", ranges.join(", "));
            r.contradiction(&fields, &error.to_string(), &help, Vec::new());
            None
        }
        Err(error) => {
            let message = format!("`{}`: {error}", entry.path);
            r.problem(Some(entry.span.clone()), message, "in this section", None);
            None
        }
    }
}

/// Reports the fields that the command does not take.
fn reject_others(r: &mut Reader, entry: &Entry, row: &CommandInfo, top: &[&str]) {
    let own: Vec<&str> = row.arguments.iter().map(|argument| argument.name).collect();
    let known = [&OF_THE_EVENT[..], &own].concat();
    for (key, span) in entry.keys() {
        if known.contains(&key) {
            continue;
        }
        if TABLE.iter().any(|other| other.argument(key).is_some()) {
            let takes = match own.as_slice() {
                [] => "no arguments".to_owned(),
                own => format!("`{}`", own.join("`, `")),
            };
            r.problem(
                Some(span),
                format!(
                    "`{}`: the command {} takes no `{key}`",
                    entry.path, row.name
                ),
                "not of this command",
                Some(format!("it takes {takes}")),
            );
        } else {
            r.reject_field(entry, key, span, &known, top);
        }
    }
}

/// How to write an argument, and its allowed range.
fn example(argument: &Argument) -> String {
    let name = argument.name;
    let range = argument.range();
    match argument.kind {
        ArgumentKind::Whole(_) => format!("`{name} = …`, {range}"),
        ArgumentKind::Choice(_) => format!("`{name} = \"…\"`, one of {range}"),
        ArgumentKind::Flag => format!("`{name} = …`, one of {range}"),
        ArgumentKind::Parameter => {
            format!("`{name} = \"…\"`, by its name in the tables of the boards")
        }
        ArgumentKind::Raw => format!("`{name} = …`, in the unit of the parameter"),
        kind => format!("`{name} = \"… {}\"`, {range}", kind.unit()),
    }
}

fn value(r: &mut Reader, entry: &Entry, argument: &'static Argument) -> Option<Value> {
    let key = argument.name;
    match argument.kind {
        ArgumentKind::Whole(Limits { min, max }) => {
            // No whole number of the table is negative.
            let [min, max] = [min, max].map(|limit| u64::try_from(limit).unwrap_or(0));
            let value = r.whole(entry, key, min..=max);
            value.and_then(|v| i32::try_from(v).ok()).map(Value::Whole)
        }
        ArgumentKind::Choice(words) => {
            let words: Vec<(&str, u8)> = words.iter().copied().zip(0..).collect();
            r.choice(entry, key, &words).map(Value::Choice)
        }
        ArgumentKind::Parameter => {
            node::parameter(r, entry).map(|info| Value::Whole(info.id.into()))
        }
        ArgumentKind::Raw => node::value(r, entry).map(Value::Whole),
        ArgumentKind::Flag => quantity(r, entry, argument).map(|v| Value::Flag(v != 0.0)),
        ArgumentKind::Length(_) | ArgumentKind::Velocity(_) | ArgumentKind::Acceleration(_) => {
            let si = quantity(r, entry, argument)?;
            Some(Value::Fixed(I16F16::saturating_from_num(si * 1e3)))
        }
        ArgumentKind::Rate(_) => {
            let si = quantity(r, entry, argument)?;
            Some(Value::Fixed(I16F16::saturating_from_num(si)))
        }
        ArgumentKind::Time(_) => {
            let si = quantity(r, entry, argument)?;
            Some(Value::Micros((si * 1e6).round() as u32))
        }
    }
}

fn quantity(r: &mut Reader, entry: &Entry, argument: &'static Argument) -> Option<f64> {
    let values = r.quantity(entry, &spec(argument))?;
    values.first().copied()
}

/// The dimension of an argument's kind; numbers without one are counts.
#[must_use]
pub const fn argument_dimension(kind: ArgumentKind) -> Dimension {
    match kind {
        ArgumentKind::Length(_) => Dimension::Length,
        ArgumentKind::Velocity(_) => Dimension::Velocity,
        ArgumentKind::Acceleration(_) => Dimension::Acceleration,
        ArgumentKind::Rate(_) => Dimension::AngularVelocity,
        ArgumentKind::Time(_) => Dimension::Time,
        ArgumentKind::Flag => Dimension::Flag,
        _ => Dimension::Count,
    }
}

/// An argument that is a quantity, as a field of a file.
pub(super) const fn spec(argument: &Argument) -> FieldSpec {
    let [min, max] = bounds(argument);
    FieldSpec {
        key: argument.name,
        dimension: argument_dimension(argument.kind),
        min,
        max,
        components: 1,
        integer: matches!(
            argument.kind,
            ArgumentKind::Whole(_) | ArgumentKind::Flag | ArgumentKind::Choice(_)
        ),
        doc: argument.doc,
    }
}

/// Smallest and largest value of an argument, SI.
pub(super) const fn bounds(argument: &Argument) -> [f64; 2] {
    match argument.kind {
        ArgumentKind::Length(Limits { min, max })
        | ArgumentKind::Velocity(Limits { min, max })
        | ArgumentKind::Acceleration(Limits { min, max }) => {
            [decimal(min) / 1e3, decimal(max) / 1e3]
        }
        ArgumentKind::Rate(Limits { min, max }) => [decimal(min), decimal(max)],
        ArgumentKind::Time(Limits { min, max }) => [min as f64 / 1e6, max as f64 / 1e6],
        ArgumentKind::Whole(Limits { min, max }) => [min as f64, max as f64],
        _ => [0.0, 1.0],
    }
}

/// The decimal number behind a fixed-point limit: five decimals distinguish its steps of 1/65 536.
const fn decimal(value: I16F16) -> f64 {
    let scaled = value.to_bits() as i64 * 100_000 + 32_768;
    scaled.div_euclid(65_536) as f64 / 1e5
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_master::argument;

    #[test]
    fn limits_are_the_decimal_numbers_of_the_table() {
        let exact = |argument: &Argument, min: f64, max: f64| {
            let [low, high] = bounds(argument);
            assert_eq!(
                [low.to_bits(), high.to_bits()],
                [min.to_bits(), max.to_bits()]
            );
        };
        exact(&argument::STROKE, 0.0, 0.18);
        exact(&argument::STEP_STROKE, 1e-3, 0.18);
        exact(&argument::TRAVEL, -32.0, 32.0);
        exact(&argument::LEFT, -0.06, 0.06);
        exact(&argument::RATE, 0.05, 2.0);
        exact(&argument::SPEED, 1e-3, 0.4);
        exact(&argument::ACCELERATION, 0.01, 5.0);
        exact(&argument::PERIOD, 0.5, 60.0);
        exact(&argument::STEPS, 1.0, 10_000.0);
    }

    #[test]
    fn a_command_is_read_as_in_a_scenario_and_a_wrong_one_names_its_range() {
        let text = |stroke: &str| {
            format!("command = \"JointReference\"\njoint = 2\nstroke = \"{stroke}\"\n")
        };
        let read = command(&text("0.08 m")).expect("a command");
        let stroke_mm = wheeleg_units::PositionMm::from_f64(80.0);
        let joint = 2;
        assert_eq!(read, Command::JointReference { joint, stroke_mm });
        let error = command(&text("8 m")).expect_err("beyond the stroke");
        let told = error.problems()[0].summary();
        assert!(told.contains("stroke") && told.contains("0.18 m"), "{told}");
    }
}
