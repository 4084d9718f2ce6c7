//! What the master says, as a person reads it.

mod refusal;

use wheeleg_master::config::UniqueId;
use wheeleg_master::event::{Event, HoldReason};
use wheeleg_master::finding::Finding;
use wheeleg_protocol::param::{ParamInfo, params_at};
use wheeleg_protocol::{Address, DisarmReason, Fault, FaultBits, FaultRecord};

use refusal::refusal;
pub(super) use refusal::reject;
use wheeleg_interface::{Side, first_difference};

/// An event of the master in words.
pub(crate) fn describe(event: &Event) -> String {
    let text = match *event {
        Event::Done(ticket) => format!("{:?} done", ticket.code),
        Event::Refused { ticket, reason } => {
            format!("{:?} refused: {}", ticket.code, refusal(&reason))
        }
        Event::NodeReady(node) => format!("{} identified, interface matches", board(node)),
        Event::SchemaMismatch {
            node,
            master,
            theirs,
            firmware: [major, minor, patch],
        } => format!(
            "{} has interface {theirs:016x} (firmware {major}.{minor}.{patch}), the master has \
             {master:016x} ({}): will not arm. {}",
            board(node),
            env!("CARGO_PKG_VERSION"),
            other_interface(node, master, theirs)
        ),
        Event::ForeignBoard {
            node,
            commissioned,
            found,
            belongs,
        } => {
            let belongs = belongs.map_or_else(
                || "was commissioned nowhere".to_owned(),
                |home| format!("belongs to {}", board(home)),
            );
            format!(
                "at the address of {} stands the board {}, which {belongs}; commissioned is {}: will not arm. {}",
                board(node),
                hex(found),
                hex(commissioned),
                Finding::ForeignBoard
            )
        }
        Event::Commissioned { node, unique_id } => {
            format!("{} is the board {}", board(node), hex(unique_id))
        }
        Event::Found { node, finding } => match node {
            Some(node) => format!("{}: {finding}", board(node)),
            None => finding.to_string(),
        },
        Event::Diagnosis { node, record } => diagnosis(node, &record),
        // Sample by sample in the log.
        Event::Link { node, record } => {
            format!("{} has heard {} sound frames", board(node), record.frames)
        }
        Event::Log { node, entry } => format!(
            "{} logs at {:.6} s of its clock: {entry}",
            board(node),
            f64::from(entry.time_us) * 1e-6
        ),
        Event::LogLost { node, records } => {
            format!("{records} records of the log of {} are lost", board(node))
        }
        Event::Parameter { node, id, raw } => {
            format!(
                "parameter {} of {} is {}",
                parameter(node, id),
                board(node),
                value(node, id, raw)
            )
        }
        Event::DuplicateAddress { node, unique_ids } => {
            let [one, other] = unique_ids.map(hex);
            let remedy = Fault::DuplicateAddress.remedy();
            format!(
                "two boards at the address of {}, unique ids {one} and {other}: will not arm. {remedy}",
                board(node)
            )
        }
        Event::WrongRole(node) => format!("{}: {}", board(node), Finding::WrongRole),
        Event::NodeLost(node) => format!("{} is lost. {}", board(node), Finding::NodeLost),
        Event::NodeBack(node) => format!("{} answers", board(node)),
        Event::Armed => "all axes armed".to_owned(),
        Event::Disarmed => "all axes disarmed".to_owned(),
        Event::Hold(reason) => format!("all axes hold: {}", hold_reason(&reason)),
        Event::Homed => "start pose reached".to_owned(),
        Event::HomingFailed { joint } => format!("start pose not reached: joint {joint}"),
        Event::GaitDone { steps } => format!("gait over after {steps} steps"),
        Event::TrajectoryDone => "foot trajectory over".to_owned(),
        Event::TouchDown { side, sector } => match sector {
            Some(sector) => format!("{} foot touches with its {} side", word(side), word(sector)),
            None => format!("{} foot stands flat", word(side)),
        },
        Event::FootSwitch {
            side,
            sector,
            warning,
        } => {
            let place = sector.map_or_else(String::new, word);
            format!("{} foot, {place} switch: {warning}", word(side))
        }
        Event::LiftOff(side) => format!("{} foot leaves the ground", word(side)),
        Event::Position { joint, stroke_mm } => {
            format!("joint {joint} stands at {:.2} mm", stroke_mm.to_f64())
        }
    };
    format!("master: {text}")
}

/// Name of a side or sector inside a sentence.
fn word(name: impl std::fmt::Debug) -> String {
    format!("{name:?}").to_lowercase()
}

/// Name of a board by its bus address.
fn board(address: u8) -> String {
    Address::new(address).map_or_else(|| format!("address {address}"), |a| a.to_string())
}

fn hold_reason(reason: &HoldReason) -> String {
    match *reason {
        HoldReason::NodeLost(node) => format!("{} missed three cycles", board(node)),
        HoldReason::NodeFault { node, faults } => {
            let words: Vec<&str> = FaultBits::from_raw(faults)
                .iter()
                .map(|fault| fault.sentence())
                .collect();
            format!("{} reports: {}", board(node), words.join(" "))
        }
        HoldReason::NodeDisarmed(node) => {
            format!("{} is no longer armed: it has restarted", board(node))
        }
        HoldReason::SupplyLost => {
            "supply pressure lost. Check compressor, hose and regulator, then clear and arm."
                .to_owned()
        }
        HoldReason::LayerOneStalled => "layer 1 gave nothing for 100 ms".to_owned(),
        HoldReason::EmergencyStop => "E-stop".to_owned(),
    }
}

/// What is wrong with a board of another interface, and where it begins to differ.
fn other_interface(node: u8, master: u64, theirs: u64) -> String {
    let here = Side {
        name: "the master",
        hash: master,
    };
    let there = Side {
        name: &board(node),
        hash: theirs,
    };
    format!(
        "{} {}",
        Finding::OtherInterface,
        first_difference(here, there)
    )
}

/// A unique id, hexadecimal, lowest byte first.
pub fn hex(id: UniqueId) -> String {
    id.iter().map(|b| format!("{b:02x}")).collect()
}

/// Why a board stopped or started, with the remedy of the tables.
fn diagnosis(node: u8, record: &FaultRecord) -> String {
    let mut parts = Vec::new();
    if let Some(fault) = record.first_fault.fault() {
        // Both clocks count microseconds modulo 2^32.
        let at_us = record.first_time_us.wrapping_add(record.clock_offset_us);
        let at_s = f64::from(at_us) * 1e-6;
        parts.push(format!("first fault, {at_s:.3} s after power-up: {fault}"));
    }
    if record.disarm_reason == DisarmReason::Reset || record.reset_cause.is_fault() {
        let cause = record.reset_cause;
        parts.push(format!(
            "it has started anew: {} {}",
            cause.text(),
            cause.remedy()
        ));
    }
    if parts.is_empty() {
        parts.push(format!(
            "no fault of its own. {}",
            record.disarm_reason.text()
        ));
    }
    format!("{} says why: {}", board(node), parts.join(" "))
}

/// Row of a board's parameter.
pub(crate) fn parameter_row(node: u8, id: u16) -> Option<&'static ParamInfo> {
    params_at(node).iter().find(|row| row.id == id)
}

fn parameter(node: u8, id: u16) -> String {
    parameter_row(node, id).map_or_else(|| format!("0x{id:04X}"), |row| row.name.to_owned())
}

/// Value of a parameter in its unit.
fn value(node: u8, id: u16, raw: i32) -> String {
    parameter_row(node, id).map_or_else(
        || raw.to_string(),
        |row| {
            let scale = f64::from(row.format.fraction_bits()).exp2();
            format!("{} {}", f64::from(raw) / scale, row.unit)
        },
    )
}
