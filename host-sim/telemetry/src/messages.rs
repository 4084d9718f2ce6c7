//! Text of events for people: the one place that turns events into text. Nothing decides by these texts.

mod refusal;

use std::fmt;

use wheeleg_config::faults::FaultSpec;
use wheeleg_interface::{Side, first_difference};
use wheeleg_master::behaviour::Act as Behaves;
use wheeleg_master::config::UniqueId;
use wheeleg_master::contact::{Sector, Side as FootSide};
use wheeleg_master::dispatcher::Refusal;
use wheeleg_master::event::{Event as MasterEvent, HoldReason};
use wheeleg_master::finding::Finding;
use wheeleg_protocol::param::params_at;
use wheeleg_protocol::{Address, DisarmReason, Fault, FaultBits, FaultRecord, LinkQuality};

use crate::event::{
    Act, Answer, BadRequest, BoardChange, Cause, Event, ServiceOutcome, hold_words, parameter_name,
};
use refusal::refusal;
pub use refusal::{refused, reject};

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.start_up_us {
            Some(us) => write!(f, "start-up, {}: {}", after_power_up(us), self.cause),
            None => self.cause.fmt(f),
        }
    }
}

/// A time of the start-up.
#[must_use]
pub fn after_power_up(us: u64) -> String {
    format!("{:.3} s after power-up", us as f64 * 1e-6)
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Master(event) => write!(f, "master: {}", master(event)),
            Self::Board { board, change } => write!(f, "{board}: {change}"),
            Self::Contact { side, switches } => {
                write!(f, "ground: {}", contact(*side, *switches))
            }
            Self::Command { code, answer } => match answer {
                Answer::Accepted => write!(f, "{}: accepted", code.name()),
                Answer::Rejected(reason) => {
                    write!(f, "{} refused: {}", code.name(), reject(reason))
                }
                Answer::Nothing => write!(f, "{}: nobody answers, the master is dead", code.name()),
            },
            Self::Flood { number, reason } => write!(
                f,
                "flood of commands: number {number} refused: {}",
                reject(reason)
            ),
            Self::Scenario(act) => match act {
                Act::KillMaster => f.write_str("the master dies and stays silent"),
                Act::EStop => f.write_str("E-stop pressed"),
                Act::FaultBegins(fault) => write!(f, "fault {} begins", injected(fault)),
                Act::FaultEnds(fault) => write!(f, "fault {} ends", injected(fault)),
            },
            Self::Service {
                board,
                parameter,
                outcome,
            } => {
                let name = parameter_name(board.raw(), *parameter);
                write!(f, "service: {}", service(*board, &name, outcome))
            }
            Self::LineErrors(link) => write!(f, "master: {}", line_errors(link)),
            Self::LineBroken(why) => write!(f, "line: broken: {why}"),
            Self::LineMended => f.write_str("line: restored; the axes are disarmed"),
            Self::Failed(why) => f.write_str(why),
        }
    }
}

impl fmt::Display for BoardChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mode { from, to } => write!(f, "{from:?} to {to:?}"),
            Self::FaultLatched(fault) => fault.fmt(f),
            Self::FaultsCleared => f.write_str("faults cleared"),
        }
    }
}

/// A fault injected during a run begins at once: its time is that of the event.
fn injected(fault: &FaultSpec) -> String {
    if fault.from_s <= 0.0 && fault.until_s.is_none() {
        fault.untimed()
    } else {
        fault.to_string()
    }
}

fn contact(side: FootSide, switches: [bool; 4]) -> String {
    let side = word(side);
    let closed: Vec<&str> = ["front", "left", "back", "right"]
        .into_iter()
        .zip(switches)
        .filter_map(|(name, closed)| closed.then_some(name))
        .collect();
    if closed.is_empty() {
        format!("{side} foot free")
    } else {
        format!("{side} foot touches, {}", closed.join(", "))
    }
}

fn service(board: Address, parameter: &str, outcome: &ServiceOutcome) -> String {
    let what = |request: &BadRequest| match request {
        BadRequest::AboveLimit => format!("{parameter} above its limit"),
        BadRequest::UnknownParameter(id) => format!("parameter 0x{id:04X}"),
        BadRequest::NotANumber => format!("{parameter} as a float, not a number"),
    };
    match outcome {
        ServiceOutcome::Refused { request, reason } => {
            format!("{board} refuses {}: {}", what(request), reason.text())
        }
        ServiceOutcome::Taken(request) => format!("{board} takes {}: WRONG", what(request)),
        ServiceOutcome::Unchanged { raw } => {
            format!("{board}: parameter {parameter} unchanged, raw {raw}")
        }
        ServiceOutcome::Changed { raw } => {
            format!("{board}: parameter {parameter} CHANGED, raw {raw}")
        }
        ServiceOutcome::NotGiven => format!("{board} does not report its parameter {parameter}"),
    }
}

/// What the master counted on the line.
fn line_errors(link: &LinkQuality) -> String {
    let kinds = [
        ("overflow", link.overflow),
        ("truncated", link.truncated),
        ("short", link.short),
        ("crc", link.crc),
        ("version", link.version),
        ("length", link.length),
        ("address", link.address),
    ];
    let kinds = kinds.iter().filter(|(_, count)| *count > 0);
    let kinds: Vec<String> = kinds
        .map(|(kind, count)| format!("{kind} {count}"))
        .collect();
    format!(
        "{} sound frames heard, broken ones: {}",
        link.frames,
        kinds.join(", ")
    )
}

fn master(event: &MasterEvent) -> String {
    match *event {
        MasterEvent::Done(ticket) => format!("{} done", ticket.code.name()),
        // It may have been under way for long.
        MasterEvent::Refused {
            ticket,
            reason: reason @ Refusal::Interrupted,
        } => format!("{} ended early: {}", ticket.code.name(), refusal(&reason)),
        MasterEvent::Refused { ticket, reason } => {
            format!("{} refused: {}", ticket.code.name(), refusal(&reason))
        }
        MasterEvent::NodeReady(node) => format!("{} identified, interface matches", board(node)),
        MasterEvent::SchemaMismatch {
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
        MasterEvent::ForeignBoard {
            node,
            commissioned,
            found,
            belongs,
        } => {
            let belongs = belongs.map_or_else(
                || "is not in the list".to_owned(),
                |home| format!("belongs to {}", board(home)),
            );
            format!(
                "the board at the address of {} is {}, which {belongs}; commissioned is {}: will not arm. {}",
                board(node),
                hex(found),
                hex(commissioned),
                Finding::ForeignBoard
            )
        }
        MasterEvent::Commissioned { node, unique_id } => {
            format!("{} is the board {}", board(node), hex(unique_id))
        }
        MasterEvent::Found { node, finding } => match node {
            Some(node) => format!("{}: {finding}", board(node)),
            None => finding.to_string(),
        },
        MasterEvent::Diagnosis {
            node,
            record,
            ago_us,
        } => diagnosis(node, &record, ago_us),
        // Sample by sample in the log.
        MasterEvent::Link { node, record } => {
            format!("{} has heard {} sound frames", board(node), record.frames)
        }
        MasterEvent::Log { node, entry } => format!(
            "{} logs at {:.6} s of its clock: {entry}",
            board(node),
            f64::from(entry.time_us) * 1e-6
        ),
        MasterEvent::LogLost { node, records } => {
            format!("{records} records of the log of {} are lost", board(node))
        }
        MasterEvent::Parameter { node, id, raw } => {
            format!(
                "parameter {} of {} is {}",
                parameter_name(node, id),
                board(node),
                value(node, id, raw)
            )
        }
        MasterEvent::DuplicateAddress { node, unique_ids } => {
            let [one, other] = unique_ids.map(hex);
            let remedy = Fault::DuplicateAddress.remedy();
            format!(
                "two boards at the address of {}, unique ids {one} and {other}: will not arm. {remedy}",
                board(node)
            )
        }
        MasterEvent::WrongRole(node) => format!("{}: {}", board(node), Finding::WrongRole),
        MasterEvent::NodeLost(node) => format!("{} is lost. {}", board(node), Finding::NodeLost),
        MasterEvent::NodeBack(node) => format!("{} answers", board(node)),
        MasterEvent::Armed => "all axes armed".to_owned(),
        MasterEvent::Disarmed => "all axes disarmed".to_owned(),
        MasterEvent::Hold(reason) => format!("all axes hold: {}", hold_reason(&reason)),
        MasterEvent::Homed => "start pose reached".to_owned(),
        MasterEvent::HomingFailed { joint } => format!("start pose not reached: joint {joint}"),
        MasterEvent::Behaviour(one) => act(one),
        MasterEvent::GaitDone { steps } => format!("gait over after {steps} steps"),
        MasterEvent::TrajectoryDone => "foot trajectory over".to_owned(),
        MasterEvent::TouchDown { side, sector } => match sector {
            Some(sector) => {
                format!(
                    "{} foot touches with its {} side",
                    word(side),
                    sector.name()
                )
            }
            None => format!("{} foot stands flat", word(side)),
        },
        MasterEvent::FootSwitch {
            side,
            sector,
            warning,
        } => {
            let place = sector.map_or("", Sector::name);
            format!("{} foot, {place} switch: {warning}", word(side))
        }
        MasterEvent::LiftOff(side) => format!("{} foot leaves the ground", word(side)),
        MasterEvent::Position { joint, stroke_mm } => {
            format!("joint {joint} stands at {:.2} mm", stroke_mm.to_f64())
        }
    }
}

/// What a behaviour does, and why.
fn act(act: Behaves) -> String {
    match act {
        Behaves::Overload { node } => format!(
            "{} pulls at its limit for 0.5 s and does not move: it holds where it is",
            board(node)
        ),
        Behaves::TipGuard => "no foot carries: the wheels slow down".to_owned(),
        Behaves::EarlyGround(side) => format!(
            "{} foot has met the ground 20 mm or more above where it was expected",
            word(side)
        ),
        Behaves::LateGround(side) => format!(
            "{} foot has met the ground 20 mm or more below where it was expected",
            word(side)
        ),
        Behaves::NoGround(side) => format!(
            "{} leg finds no ground at its full length: the nose goes down, then the foot is set nearer",
            word(side)
        ),
        Behaves::Bump(side) => format!(
            "{} foot runs against something in its swing: it is lifted higher, or set down there",
            word(side)
        ),
        Behaves::LostGround(side) => {
            format!("{} foot has lost the ground and follows it", word(side))
        }
        Behaves::Slip => "the wheels slip: the legs pull".to_owned(),
        Behaves::BackOff => "no progress: the robot backs off and lifts its feet higher".to_owned(),
        Behaves::Stuck => {
            "no progress after three tries: the robot stands. Turn it, or lead it another way"
                .to_owned()
        }
        Behaves::LoadShare => {
            "one leg carries more than the other: they are brought to share".to_owned()
        }
        Behaves::Governor => {
            "a standing foot is at the end of its reach: the wheels slow down for it".to_owned()
        }
    }
}

/// Name of a side inside a sentence.
fn word(side: FootSide) -> &'static str {
    match side {
        FootSide::Left => "left",
        FootSide::Right => "right",
    }
}

/// Name of a board by its bus address.
fn board(address: u8) -> String {
    Address::new(address).map_or_else(|| format!("address {address}"), |a| a.to_string())
}

fn hold_reason(reason: &HoldReason) -> String {
    let words = hold_words(reason);
    let what = match *reason {
        HoldReason::NodeFault { node, faults } => {
            let faults = FaultBits::from_raw(faults);
            let told: Vec<&str> = faults.iter().map(Fault::sentence).collect();
            return format!("{} reports: {}", board(node), told.join(" "));
        }
        HoldReason::NodeLost(node) | HoldReason::NodeDisarmed(node) => {
            format!("{}: {}", board(node), within(words.cause))
        }
        _ => within(words.cause),
    };
    let consequence = words.consequence.map(|what| format!("; {what}"));
    format!(
        "{what}{}. {}",
        consequence.unwrap_or_default(),
        words.way_on()
    )
}

/// A sentence for use after a colon; words all in capitals, and symbols, stay so.
#[must_use]
pub fn within(sentence: &str) -> String {
    let mut letters = sentence.chars();
    match (letters.next(), letters.next()) {
        (Some(first), Some(second))
            if !second.is_uppercase() && !second.is_numeric() && second != '-' =>
        {
            first
                .to_lowercase()
                .chain(sentence.chars().skip(1))
                .collect()
        }
        _ => sentence.to_owned(),
    }
}

/// The problem of a board with another interface, and the first difference.
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
#[must_use]
pub fn hex(id: UniqueId) -> String {
    id.iter().map(|b| format!("{b:02x}")).collect()
}

/// Why a board stopped or started, with the remedy of the tables.
fn diagnosis(node: u8, record: &FaultRecord, ago_us: u32) -> String {
    let mut parts = Vec::new();
    if let Some(fault) = record.first_fault.fault() {
        let ago_s = f64::from(ago_us) * 1e-6;
        parts.push(format!("first fault, {ago_s:.3} s ago: {fault}"));
    }
    if record.disarm_reason == DisarmReason::Reset || record.reset_cause.is_fault() {
        let cause = record.reset_cause;
        parts.push(format!(
            "it has restarted: {} {}",
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

/// Value of a parameter in its unit.
fn value(node: u8, id: u16, raw: i32) -> String {
    let row = params_at(node).iter().find(|row| row.id == id);
    row.map_or_else(
        || raw.to_string(),
        |row| {
            let scale = f64::from(row.format.fraction_bits()).exp2();
            format!("{} {}", f64::from(raw) / scale, row.unit)
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_interface::archive;
    use wheeleg_protocol::{FaultCode, LimitBits, ResetCause, SCHEMA_HASH};

    /// A message about a fault says what happened and what to do.
    #[test]
    fn faults_and_findings_are_told_with_their_remedies() {
        let board = Address::joint(3).expect("a joint");
        for fault in Fault::ALL {
            let change = BoardChange::FaultLatched(*fault);
            let text = Cause::Board { board, change }.to_string();
            assert!(text.starts_with("joint 3: "), "{text}");
            assert!(text.contains(fault.sentence()) && text.contains(fault.remedy()));
        }
        for finding in Finding::ALL {
            for (node, begin) in [(Some(5), "master: joint 5: "), (None, "master: ")] {
                let finding = *finding;
                let text = Cause::Master(MasterEvent::Found { node, finding }).to_string();
                assert!(text.starts_with(begin), "{text}");
                assert!(text.contains(finding.sentence()) && text.contains(finding.remedy()));
            }
        }
    }

    #[test]
    fn a_board_says_its_first_fault_and_why_it_restarted() {
        let says = |first_fault, reset_cause| {
            let record = FaultRecord {
                active: FaultBits::NONE,
                sticky: FaultBits::NONE,
                first_fault,
                first_time_us: 0,
                disarm_reason: DisarmReason::Fault,
                limits: LimitBits::NONE,
                reset_cause,
                clock_offset_us: 0,
            };
            let diagnosis = MasterEvent::Diagnosis {
                node: 8,
                record,
                ago_us: 2_298_000,
            };
            Cause::Master(diagnosis).to_string()
        };
        let fault = Fault::SlotOverrun;
        let text = says(FaultCode::new(fault), ResetCause::PowerUp);
        let expected = format!("master: wheel 8 says why: first fault, 2.298 s ago: {fault}");
        assert_eq!(text, expected);
        for cause in [
            ResetCause::Watchdog,
            ResetCause::BrownOut,
            ResetCause::ProcessorFault,
        ] {
            let text = says(FaultCode::NONE, cause);
            let told = [cause.text(), cause.remedy()];
            assert!(text.starts_with("master: wheel 8 says why: it has restarted"));
            assert!(told.iter().all(|part| text.contains(part)), "{text}");
        }
    }

    #[test]
    fn what_bars_arming_says_which_boards_and_in_what_they_differ() {
        let event = MasterEvent::SchemaMismatch {
            node: 4,
            master: SCHEMA_HASH,
            theirs: archive::newest_earlier().expect("one"),
            firmware: [1, 2, 3],
        };
        let text = Cause::Master(event).to_string();
        for part in [
            "joint 4 has interface",
            "(firmware 1.2.3)",
            "the master has",
            "will not arm",
            "The first difference is in",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let event = MasterEvent::DuplicateAddress {
            node: 4,
            unique_ids: [[4; 12], [0xFB; 12]],
        };
        let text = Cause::Master(event).to_string();
        assert!(
            text.contains("joint 4") && text.contains("fbfbfb") && text.contains("will not arm")
        );
        assert!(text.contains(Fault::DuplicateAddress.remedy()), "{text}");
    }

    #[test]
    fn a_fault_that_is_injected_in_a_run_is_told_without_a_time_of_its_own() {
        let told = |fault: &str| {
            let fault = fault.parse().expect("a fault");
            Cause::Scenario(Act::FaultBegins(fault)).to_string()
        };
        assert_eq!(told("pot-open:joint3@0s"), "fault pot-open:joint3 begins");
        for fault in ["pot-open:joint3@3s", "bit-errors=0.0001@0s..60s"] {
            assert_eq!(told(fault), format!("fault {fault} begins"));
        }
    }

    #[test]
    fn an_event_of_the_start_up_says_when_after_power_up() {
        let event = Event::of_start_up(Cause::Master(MasterEvent::Homed), 1_234_000);
        let expected = "start-up, 1.234 s after power-up: master: start pose reached";
        assert_eq!(event.to_string(), expected);
    }
}
