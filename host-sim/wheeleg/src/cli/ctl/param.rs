//! `wheeleg ctl param`: parameters of the boards. Each command takes control and asks the board.

use std::process::ExitCode;

use clap::Subcommand;
use serde_json::{Value, json};
use wheeleg_console::client::{Outcome, http};
use wheeleg_console::keys::CONTROL_FILE;
use wheeleg_protocol::Node;
use wheeleg_studies::StudyError;

use super::super::{print, whole};
use super::reach::Reach;

/// Number of boards, whose addresses begin at 1.
const BOARDS: u8 = Node::ALL.len() as u8;

fn board() -> String {
    format!("Board, 1 to {BOARDS}")
}

#[derive(Debug, Subcommand)]
pub(super) enum ParamCommand {
    /// Read a parameter of a board.
    Get {
        #[arg(value_parser = whole(1, BOARDS), help = board())]
        board: u8,
        /// Name of the parameter, such as error_scale.
        parameter: String,
    },
    /// Write a parameter of a board, and read it back. Unless it is saved, it lasts until power-off.
    Set {
        #[arg(value_parser = whole(1, BOARDS), help = board())]
        board: u8,
        /// Name of the parameter, such as error_scale.
        parameter: String,
        /// Value in the parameter's unit; true or false for a flag.
        #[arg(allow_negative_numbers = true, value_parser = value)]
        value: Value,
    },
    /// Save all parameters of a board in its memory; the robot must be disarmed.
    Save {
        #[arg(value_parser = whole(1, BOARDS), help = board())]
        board: u8,
    },
}

fn value(text: &str) -> Result<Value, String> {
    let read = serde_json::from_str::<Value>(text).ok();
    let read = read.filter(|value| value.is_number() || value.is_boolean());
    read.ok_or_else(|| "allowed are numbers, such as 21 or 0.03, true and false".to_owned())
}

/// Carries out a command on a board.
pub(super) fn command(reach: &Reach, command: &ParamCommand) -> miette::Result<ExitCode> {
    let read = |board: u8, parameter: &str| {
        let arguments = json!({ "board": board, "parameter": parameter });
        ("ReadParameter", arguments)
    };
    let (board, parameter, commands) = match command {
        ParamCommand::Get { board, parameter } => {
            (*board, parameter, vec![read(*board, parameter)])
        }
        ParamCommand::Set {
            board,
            parameter,
            value,
        } => {
            let arguments = json!({ "board": board, "parameter": parameter, "value": value });
            let write = ("WriteParameter", arguments);
            (*board, parameter, vec![write, read(*board, parameter)])
        }
        ParamCommand::Save { board } => {
            let save = ("SaveParameters", json!({ "board": board }));
            return reach.print_outcome(&reach.in_control(&[save])?);
        }
    };
    let end = reach.in_control(&commands)?;
    if end != Outcome::Done {
        return reach.print_outcome(&end);
    }
    let key = reach.key(CONTROL_FILE)?;
    let (code, all) = http(&reach.url(), "GET", "parameters", &key)?;
    if code != 200 {
        return reach.not_answered(&all, CONTROL_FILE);
    }
    let (value, unit) = reported(&all, board, parameter).ok_or_else(|| {
        StudyError::refused(
            format!("the server has not received `{parameter}` from board {board}"),
            "use the `wheeleg` of the same version as the server",
        )
    })?;
    if reach.json {
        let answer =
            json!({ "board": board, "parameter": parameter, "value": value, "unit": unit });
        return Ok(print(&format!("{answer}\n"))?);
    }
    Ok(print(&match unit {
        "1" => format!("{value}\n"),
        unit => format!("{value} {unit}\n"),
    })?)
}

/// Value and unit of a parameter that its board has reported, in the answer of `/api/v1/parameters`.
fn reported<'a>(all: &'a Value, board: u8, parameter: &str) -> Option<(&'a Value, &'a str)> {
    let mut boards = all["boards"].as_array()?.iter();
    let board = boards.find(|of| of["address"] == board)?;
    let table = all[board["kind"].as_str()?].as_array()?;
    let row = table.iter().position(|row| row["name"] == parameter)?;
    let of_board = &board["values"][row];
    (of_board["told"] == true).then_some((&of_board["value"], table[row]["unit"].as_str()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_that_of_its_board_and_of_its_row_and_one_that_it_has_told() {
        let rows = json!([{ "name": "a", "unit": "mm" }, { "name": "b", "unit": "1" }]);
        let of = |address: u8, kind: &str, b: Value, told: bool| {
            let values = json!([{ "value": 1, "told": true }, { "value": b, "told": told }]);
            json!({ "address": address, "kind": kind, "values": values })
        };
        let all = json!({
            "joint": rows,
            "wheel": [{ "name": "b", "unit": "s" }],
            "boards": [of(1, "joint", json!(2.5), true), of(2, "joint", json!(3), false)],
        });
        assert_eq!(reported(&all, 1, "b"), Some((&json!(2.5), "1")));
        assert_eq!(reported(&all, 2, "a"), Some((&json!(1), "mm")));
        for (board, parameter) in [(2, "b"), (3, "a"), (1, "c")] {
            assert_eq!(
                reported(&all, board, parameter),
                None,
                "{board} {parameter}"
            );
        }
        assert_eq!(reported(&json!({}), 1, "a"), None);
    }

    #[test]
    fn values_are_numbers_and_flags() {
        assert_eq!(value("-0.5"), Ok(json!(-0.5)));
        assert_eq!(value("true"), Ok(json!(true)));
        for wrong in ["", "NaN", "1e999", "21 mm", "\"1\"", "[1]"] {
            assert!(value(wrong).is_err(), "{wrong}");
        }
    }
}
