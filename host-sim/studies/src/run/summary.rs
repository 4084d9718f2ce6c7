//! The machine-readable summary of a run.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use crate::analysis::{Analysis, Target};
use crate::cause::{self, FaultEvent};
use crate::study;
use wheeleg_config::{RobotConfig, Scenario};
use wheeleg_master::behaviour::Behaviour;
use wheeleg_master::dispatcher::Ticket;
use wheeleg_master::event::Event as MasterEvent;
use wheeleg_protocol::Address;
use wheeleg_remote_host::PilSummary;
use wheeleg_telemetry::{Cause, Recording};

/// Facts about a run that are not in its recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInfo {
    /// Seed used.
    pub seed: u64,
    /// Why the run ended early.
    pub failure: Option<String>,
    /// Simulated time, start-up included, s.
    pub simulated_s: f64,
    /// Scenario time in the record, s.
    pub recorded_s: f64,
    /// Wall time of simulation and log, without figures and report, s.
    pub wall_s: f64,
    /// False when the run was stopped before its end.
    pub complete: bool,
    /// Summary of the boards outside of this process, if there were any.
    pub pil: Option<PilSummary>,
}

/// Contents of `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Summary {
    /// Name of the scenario.
    pub scenario: String,
    /// Name of the robot.
    pub robot: String,
    /// Fingerprint of the robot's parameters (BLAKE3 over name, value and unit,
    /// hexadecimal): tells a changed robot from the original of the same name.
    pub robot_hash: String,
    /// Version of the program.
    pub version: &'static str,
    /// Seed used, a whole number as text: JSON numbers are exact only up to 2^53.
    pub seed: String,
    /// Injected faults, from the scenario and from the command line.
    pub faults: Vec<String>,
    /// Failures with their remedies, and commands that were not carried out, in order of time; equal ones of
    /// these are one message with their number.
    pub messages: Vec<String>,
    /// The first failure, and below it the remedy; empty if there was none.
    #[serde(skip)]
    pub cause: Vec<String>,
    /// Determinism hash of the telemetry (BLAKE3, hexadecimal).
    pub hash: String,
    /// Messages that could not be written to the log file.
    pub dropped_messages: u64,
    /// Log and tables that could not be completed, and why; absent if all were.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unwritten: Vec<String>,
    /// Why the run ended early, such as a robot that does not get ready; absent if it did not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// Simulated time, start-up included, s.
    pub simulated_s: f64,
    /// Scenario time in the record, s.
    pub recorded_s: f64,
    /// Wall time of simulation and log, without figures and report, s.
    pub wall_s: f64,
    /// Simulated over wall time.
    pub realtime_factor: f64,
    /// False when the run was stopped before its end.
    pub complete: bool,
    /// Whether every required target is met.
    pub passed: bool,
    /// Targets with values and verdicts.
    pub targets: Vec<Target>,
    /// How often each behaviour of a walk has acted; absent if the robot did not walk.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub behaviours: Option<BTreeMap<&'static str, u32>>,
    /// Boards outside of this process and their comparison, if there were any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pil: Option<PilSummary>,
}

/// A refusal without the number of its request, so that repeated requests of a user give equal refusals.
fn refusal(cause: &Cause) -> Option<Cause> {
    match cause {
        Cause::Master(MasterEvent::Refused { ticket, reason }) => {
            let ticket = Ticket {
                client: 0,
                id: 0,
                ..*ticket
            };
            let reason = *reason;
            Some(Cause::Master(MasterEvent::Refused { ticket, reason }))
        }
        cause => cause.is_refusal().then(|| cause.clone()),
    }
}

/// A report that several boards may share, without the board.
fn alike(cause: &Cause) -> Option<Cause> {
    match cause {
        Cause::Board { change, .. } => Some(Cause::Board {
            board: Address::MASTER,
            change: *change,
        }),
        Cause::Master(MasterEvent::NodeLost(_)) => Some(Cause::Master(MasterEvent::NodeLost(0))),
        _ => None,
    }
}

/// Most faults, findings and refusals that are listed one by one.
const LISTED: usize = 20;
/// Equal reports of several boards within this time are one line \[ns\].
const ALIKE_NS: u64 = 50_000_000;

/// The first cause of a failure, one sentence per line.
fn cause(recording: &Recording) -> Vec<String> {
    let wrong = recording.events.iter();
    let wrong = wrong.filter_map(|row| FaultEvent::of(row.t_ns, &row.v));
    let causes = cause::causes(wrong);
    let remedy = causes.first().and_then(|first| first.remedy.clone());
    let sentence = cause::first_sentence(&causes).map(|told| format!("{told}."));
    sentence.into_iter().chain(remedy).collect()
}

/// Faults, findings and refusals as the user reads them, with their time: the first twenty, and the number of
/// the others. A user who repeats a request gets one line, at the time of the first refusal.
fn messages(recording: &Recording) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    // Each reported refusal, with the place of its line, and how often it came.
    let mut refusals: Vec<(Cause, usize, u32)> = Vec::new();
    // Reports of boards: time, place of the line, and the boards.
    let mut shared: Vec<(Cause, u64, usize, Vec<Address>)> = Vec::new();
    let mut more = 0_u64;
    for event in &recording.events {
        let refusal = refusal(&event.v.cause);
        let (kind, code) = (event.v.cause.kind(), event.v.cause.code());
        if refusal.is_none() && !cause::goes_wrong(Some(kind), Some(code)) {
            continue;
        }
        let known = refusals
            .iter_mut()
            .find(|known| refusal.as_ref() == Some(&known.0));
        if let Some((_, _, count)) = known {
            *count += 1;
            continue;
        }
        let (told, board) = (alike(&event.v.cause), event.v.cause.board());
        let told = told.zip(board);
        let known = told.as_ref().and_then(|(told, board)| {
            shared.iter_mut().find(|(cause, since_ns, _, boards)| {
                cause == told && event.t_ns < since_ns + ALIKE_NS && !boards.contains(board)
            })
        });
        if let (Some((.., boards)), Some(board)) = (known, board) {
            boards.push(board);
            continue;
        }
        if lines.len() == LISTED {
            more += 1;
            continue;
        }
        shared.extend(told.map(|(told, board)| (told, event.t_ns, lines.len(), vec![board])));
        refusals.extend(refusal.map(|refusal| (refusal, lines.len(), 1)));
        lines.push(format!("{:.3} s: {}", event.t_s(), event.v));
    }
    for (_, place, count) in refusals.into_iter().filter(|(_, _, count)| *count > 1) {
        lines[place].push_str(&format!(" ({count} times)"));
    }
    for (.., place, boards) in shared {
        let others: Vec<String> = boards[1..].iter().map(Address::to_string).collect();
        if !others.is_empty() {
            lines[place].push_str(&format!(" Likewise {}.", others.join(", ")));
        }
    }
    if more > 0 {
        lines.push(format!(
            "{more} more of these are in the log and the tables alone"
        ));
    }
    if recording.events_left_out > 0 {
        lines.push(format!(
            "{} later events are in the log and the tables alone",
            recording.events_left_out
        ));
    }
    lines
}

/// How often each behaviour has acted, by its name.
fn behaviours(recording: &Recording) -> Option<BTreeMap<&'static str, u32>> {
    let last = &recording.behaviours.last()?.v;
    let count = |one: Behaviour| match one {
        Behaviour::Overload => last.overload,
        Behaviour::TipGuard => last.tip_guard,
        Behaviour::Touchdown => last.touchdown,
        Behaviour::Search => last.search,
        Behaviour::Bump => last.bump,
        Behaviour::LostContact => last.lost_contact,
        Behaviour::Slip => last.slip,
        Behaviour::Hook => last.hook,
        Behaviour::Stuck => last.stuck,
        Behaviour::LoadShare => last.load_share,
        Behaviour::StrokeGovernor => last.stroke_governor,
    };
    let named = |one: Behaviour| (one.name(), count(one));
    Some(Behaviour::ALL.map(named).into_iter().collect())
}

impl Summary {
    /// Collects the summary of a run.
    #[must_use]
    pub fn new(
        scenario: &Scenario,
        robot: &RobotConfig,
        recording: &Recording,
        analysis: &Analysis,
        info: RunInfo,
    ) -> Self {
        Self {
            scenario: scenario.name.clone(),
            robot: robot.name.clone(),
            robot_hash: robot.fingerprint(),
            version: env!("CARGO_PKG_VERSION"),
            seed: info.seed.to_string(),
            faults: scenario.faults.iter().map(ToString::to_string).collect(),
            messages: messages(recording),
            cause: cause(recording),
            hash: recording.hash.clone(),
            dropped_messages: recording.dropped,
            unwritten: Vec::new(),
            failure: info.failure,
            simulated_s: info.simulated_s,
            recorded_s: info.recorded_s,
            wall_s: info.wall_s,
            realtime_factor: info.simulated_s / info.wall_s.max(1e-9),
            complete: info.complete,
            passed: info.complete && analysis.passed(),
            pil: info.pil,
            targets: analysis.targets.clone(),
            behaviours: behaviours(recording),
        }
    }
}

impl study::Summary for Summary {
    const SCHEMA: &'static str = "wheeleg.run/1";
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_master::behaviour::Act;
    use wheeleg_master::command::CommandCode;
    use wheeleg_master::dispatcher::{Refusal, Reject};
    use wheeleg_protocol::Fault;
    use wheeleg_telemetry::Row;
    use wheeleg_telemetry::event::{Answer, BoardChange};

    #[test]
    fn faults_are_all_told_and_equal_refusals_once_with_their_number() {
        let moving = || Cause::Command {
            code: CommandCode::JointReference,
            answer: Answer::Rejected(Reject::Refused(Refusal::Moving)),
        };
        let fault = || Cause::Board {
            board: Address::joint(1).expect("a joint"),
            change: BoardChange::FaultLatched(Fault::EmergencyStop),
        };
        let refused = |id| {
            let ticket = Ticket {
                client: 0,
                id,
                code: CommandCode::Arm,
            };
            let reason = Refusal::Interrupted;
            Cause::Master(MasterEvent::Refused { ticket, reason })
        };
        let accepted = Cause::Command {
            code: CommandCode::Arm,
            answer: Answer::Accepted,
        };
        let causes = [
            accepted,
            moving(),
            fault(),
            moving(),
            fault(),
            refused(6),
            refused(7),
            Cause::Master(MasterEvent::Homed),
            // A cleared fault is not a failure.
            Cause::Board {
                board: Address::joint(1).expect("a joint"),
                change: BoardChange::FaultsCleared,
            },
        ];
        let mut recording = Recording::default();
        for (ms, cause) in (1..).zip(causes) {
            recording.events.push(Row {
                t_ns: ms * 1_000_000,
                v: cause.into(),
            });
        }
        let found = messages(&recording);
        let begins = [
            "0.002 s: JointReference refused: the robot is moving",
            "0.003 s: joint 1: Emergency stop.",
            "0.005 s: joint 1: Emergency stop.",
            "0.006 s: master: Arm ended early: a stop, a hold or another command came between",
        ];
        let times = [
            " (2 times)",
            "releases the emergency stop.",
            "releases the emergency stop.",
            " (2 times)",
        ];
        assert_eq!(found.len(), begins.len(), "{found:?}");
        for ((line, begin), end) in found.iter().zip(begins).zip(times) {
            assert!(line.starts_with(begin) && line.ends_with(end), "{line}");
        }
    }

    /// However many there are, the first twenty are listed, with the number of the others; a listed refusal
    /// is counted to the end.
    #[test]
    fn of_very_many_faults_twenty_are_told_and_their_number() {
        let fault = || Cause::Board {
            board: Address::joint(1).expect("a joint"),
            change: BoardChange::FaultLatched(Fault::EmergencyStop),
        };
        let moving = || Cause::Command {
            code: CommandCode::JointReference,
            answer: Answer::Rejected(Reject::Refused(Refusal::Moving)),
        };
        let mut recording = Recording::default();
        for ms in 0..40_000 {
            let cause = if ms % 2 == 0 { moving() } else { fault() };
            recording.events.push(Row {
                t_ns: ms * 1_000_000,
                v: cause.into(),
            });
        }
        let begun = std::time::Instant::now();
        let found = messages(&recording);
        assert!(begun.elapsed().as_secs_f64() < 5.0);
        assert_eq!(found.len(), 21, "{found:?}");
        assert!(found[0].ends_with("(20000 times)"), "{}", found[0]);
        assert!(
            found[20].starts_with("19981 more of these"),
            "{}",
            found[20]
        );
    }

    /// The failure of the run comes first, whether a board has a fault or not.
    #[test]
    fn a_robot_that_gives_up_is_told_as_the_cause_and_as_a_message() {
        let mut recording = Recording::default();
        assert!(cause(&recording).is_empty());
        recording.events.push(Row {
            t_ns: 26_340_000_000,
            v: Cause::Master(MasterEvent::Behaviour(Act::Stuck)).into(),
        });
        let told = cause(&recording);
        let expected = [
            "The robot got stuck and gave up at 26.34 s.",
            "Turn it, or lead it another way.",
        ];
        assert_eq!(told, expected);
        let messages = messages(&recording);
        assert!(
            messages.len() == 1 && messages[0].starts_with("26.340 s: "),
            "{messages:?}"
        );
    }

    /// Boards with equal reports within 50 ms share a line; the same board later has its own.
    #[test]
    fn boards_that_tell_the_same_at_a_time_share_a_line() {
        let mut recording = Recording::default();
        for (ms, joint) in [(10, 1), (10, 2), (30, 4), (40, 1), (70, 2)] {
            let cause = Cause::Board {
                board: Address::joint(joint).expect("a joint"),
                change: BoardChange::FaultLatched(Fault::EmergencyStop),
            };
            recording.events.push(Row {
                t_ns: ms * 1_000_000,
                v: cause.into(),
            });
        }
        let found = messages(&recording);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].starts_with("0.010 s: joint 1: "), "{found:?}");
        assert!(
            found[0].ends_with(" Likewise joint 2, joint 4."),
            "{found:?}"
        );
        assert!(found[1].starts_with("0.040 s: joint 1: "), "{found:?}");
        assert!(found[1].ends_with(" Likewise joint 2."), "{found:?}");
    }
}
