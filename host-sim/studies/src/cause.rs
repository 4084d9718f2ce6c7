//! What went wrong first: the faults of a run or a log, without those that only follow from one.

use wheeleg_master::event::HoldReason;
use wheeleg_protocol::{Address, Fault};
use wheeleg_telemetry::event::hold_name;
use wheeleg_telemetry::{Event, EventCode, EventKind, Row, finding_of_name};

/// What comes so soon after a fault may follow from it, ns.
const FOLLOWS_NS: u64 = 1_000_000_000;
/// Reasons of the master to hold that a fault of a board gives.
const HOLDS_THAT_FOLLOW: [&str; 3] = [
    hold_name(&HoldReason::NodeFault { node: 0, faults: 0 }),
    hold_name(&HoldReason::NodeLost(0)),
    hold_name(&HoldReason::NodeDisarmed(0)),
];

/// Why all axes hold although no board has a fault: what happened, and what to do about it.
const HOLDS: [(&str, &str, &str); 5] = [
    (
        hold_name(&HoldReason::SupplyLost),
        "Supply pressure lost: all axes hold",
        "Check compressor, hose and regulator, then clear and arm.",
    ),
    (
        hold_name(&HoldReason::OperatorLost),
        "Operator lost: all axes hold",
        "Reconnect, take the control, then clear and arm.",
    ),
    (
        hold_name(&HoldReason::EmergencyStop),
        "E-stop: all axes hold",
        "Remove the cause, then clear and arm.",
    ),
    (
        hold_name(&HoldReason::LayerOneStalled),
        "Layer 1 gave nothing for 100 ms: all axes hold",
        "Clear and arm.",
    ),
    (
        hold_name(&HoldReason::LayerOneGone),
        "Layer 1 does not come back: all axes hold",
        "Clear and arm.",
    ),
];

/// An event that somebody has to know of: of the kind [`EventKind::Fault`], or a robot that has given up.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FaultEvent {
    pub(crate) t_ns: u64,
    /// None of a later version.
    pub(crate) code: Option<EventCode>,
    pub(crate) detail: String,
    pub(crate) fault: Option<Fault>,
    /// Boards that it is about.
    pub(crate) boards: Vec<Address>,
    /// For a person.
    pub(crate) text: String,
}

impl FaultEvent {
    /// That of an event of a run, if it is a fault after the start-up.
    pub(crate) fn of(t_ns: u64, event: &Event) -> Option<Self> {
        let is_fault = is_fault(Some(event.cause.kind()), Some(event.cause.code()));
        (is_fault && event.start_up_us.is_none()).then(|| Self {
            t_ns,
            code: Some(event.cause.code()),
            detail: event.cause.detail(),
            fault: event.cause.fault_code().and_then(Fault::from_code),
            boards: event.cause.board().into_iter().collect(),
            text: event.to_string(),
        })
    }

    /// Whether it is no more than what comes of `cause`: the master holds, a board says why, other
    /// boards report the same.
    fn follows(&self, cause: &Self) -> bool {
        self.t_ns.abs_diff(cause.t_ns) <= FOLLOWS_NS
            && match self.code {
                Some(EventCode::Hold) => HOLDS_THAT_FOLLOW.contains(&self.detail.as_str()),
                Some(EventCode::Diagnosis | EventCode::RunFailed) => true,
                code => code.is_some() && code == cause.code && self.fault == cause.fault,
            }
    }
}

/// Whether an event is a fault, or tells that the robot has given up: it walks no more.
pub(crate) fn is_fault(kind: Option<EventKind>, code: Option<EventCode>) -> bool {
    kind == Some(EventKind::Fault) || code == Some(EventCode::Stuck)
}

/// Names of boards in a row.
pub(crate) fn names(boards: &[Address]) -> String {
    let names: Vec<String> = boards.iter().map(Address::to_string).collect();
    names.join(", ")
}

/// A fault with what to do about it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cause {
    pub(crate) t_s: f64,
    /// What happened, to whom.
    pub(crate) headline: String,
    pub(crate) remedy: Option<&'static str>,
}

impl Cause {
    fn of(event: &FaultEvent) -> Self {
        let row = match event.code {
            Some(EventCode::FaultLatched) => {
                event.fault.map(|fault| (fault.sentence(), fault.remedy()))
            }
            Some(EventCode::Finding) => {
                finding_of_name(&event.detail).map(|finding| (finding.sentence(), finding.remedy()))
            }
            Some(EventCode::Hold) => {
                let mut holds = HOLDS.into_iter();
                let found = holds.find(|(name, ..)| *name == event.detail);
                found.map(|(_, sentence, remedy)| (sentence, remedy))
            }
            Some(EventCode::Stuck) => Some((
                "The robot got no further in three tries, and stands",
                "Turn it, or lead it another way.",
            )),
            _ => None,
        };
        let stem = |sentence: &str| sentence.trim_end_matches('.').to_owned();
        let headline = match row {
            Some((sentence, _)) if event.boards.is_empty() => stem(sentence),
            Some((sentence, _)) => {
                format!("{}: {}", names(&event.boards), within(&stem(sentence)))
            }
            None => stem(&event.text),
        };
        Self {
            t_s: event.t_ns as f64 * 1e-9,
            headline,
            remedy: row.map(|(_, remedy)| remedy),
        }
    }
}

/// A sentence at its begin.
fn capital(sentence: &str) -> String {
    let mut letters = sentence.chars();
    let first = letters.next().map(char::to_uppercase);
    first.into_iter().flatten().chain(letters).collect()
}

/// A sentence as it stands behind a colon; what is all in capitals stays so.
fn within(sentence: &str) -> String {
    let mut letters = sentence.chars();
    match (letters.next(), letters.next()) {
        (Some(first), Some(second)) if !second.is_uppercase() => first
            .to_lowercase()
            .chain(sentence.chars().skip(1))
            .collect(),
        _ => sentence.to_owned(),
    }
}

/// The first cause of what went wrong, and how many there are; events in their order.
pub(crate) fn first(events: impl Iterator<Item = FaultEvent>) -> Option<(Cause, usize)> {
    let mut causes: Vec<FaultEvent> = Vec::new();
    for event in events.filter(|event| event.code != Some(EventCode::FaultsCleared)) {
        // What is latched again within the second is the same.
        if !causes.iter().any(|cause| event.follows(cause)) {
            causes.push(event);
        }
    }
    let cause = causes.first().map(Cause::of)?;
    Some((cause, causes.len()))
}

/// What went wrong first in a run, in a sentence without its end, and what to do about it.
pub(crate) fn of_run(events: &[Row<Event>]) -> Option<(String, Option<&'static str>)> {
    let faults = events
        .iter()
        .filter_map(|row| FaultEvent::of(row.t_ns, &row.v));
    let (cause, count) = first(faults)?;
    Some((sentence(&cause, count), cause.remedy))
}

/// What went wrong, in a sentence without its end.
pub(crate) fn sentence(cause: &Cause, count: usize) -> String {
    let Cause { t_s, headline, .. } = cause;
    match count {
        1 => format!("{}, at {t_s:.2} s", capital(headline)),
        _ => format!("{count} faults, the first: {headline}, at {t_s:.2} s"),
    }
}

#[cfg(test)]
mod tests {
    use wheeleg_master::behaviour::Act;
    use wheeleg_master::event::Event as MasterEvent;
    use wheeleg_master::finding::Finding;

    use super::*;

    fn event(
        ms: u64,
        code: EventCode,
        detail: &str,
        fault: Option<Fault>,
        board: Option<u8>,
        text: &str,
    ) -> FaultEvent {
        FaultEvent {
            t_ns: ms * 1_000_000,
            code: Some(code),
            detail: detail.to_owned(),
            fault,
            boards: board.and_then(Address::new).into_iter().collect(),
            text: text.to_owned(),
        }
    }

    #[test]
    fn what_follows_from_a_fault_is_none_of_its_own() {
        let fault = Fault::SensorRange;
        let latched = |ms, joint, fault| {
            event(
                ms,
                EventCode::FaultLatched,
                "",
                Some(fault),
                Some(joint),
                "",
            )
        };
        let hold = |ms, reason: HoldReason| {
            let text = "master: all axes hold: so";
            event(ms, EventCode::Hold, hold_name(&reason), None, None, text)
        };
        let one = [
            latched(3_000, 3, fault),
            event(
                3_014,
                EventCode::Diagnosis,
                "fault",
                Some(fault),
                Some(3),
                "",
            ),
            hold(3_020, HoldReason::NodeFault { node: 3, faults: 1 }),
            event(3_500, EventCode::FaultsCleared, "", None, Some(3), ""),
        ];
        let (cause, count) = first(one.clone().into_iter()).expect("a cause");
        assert_eq!((count, cause.remedy), (1, Some(fault.remedy())));
        let told = sentence(&cause, count);
        assert_eq!(
            told,
            "Joint 3: the position sensor reads outside its range, at 3.00 s"
        );
        // The operator is lost for a reason of their own; what comes later, too.
        for (another, expected) in [
            (hold(3_100, HoldReason::OperatorLost), 2),
            (latched(3_100, 4, fault), 1),
            (latched(4_100, 3, fault), 2),
            (latched(3_100, 3, Fault::LinkLost), 2),
        ] {
            let all = one.iter().cloned().chain([another.clone()]);
            let (cause, count) = first(all).expect("a cause");
            assert_eq!(count, expected, "{another:?}");
            assert_eq!(
                cause.headline,
                "joint 3: the position sensor reads outside its range"
            );
        }
        let lost = hold(10, HoldReason::OperatorLost);
        let (cause, _) = first([lost].into_iter()).expect("a cause");
        assert_eq!(
            sentence(&cause, 1),
            "Operator lost: all axes hold, at 0.01 s"
        );
        assert!(
            cause
                .remedy
                .is_some_and(|remedy| remedy.contains("clear and arm"))
        );
        assert_eq!(first(std::iter::empty()), None);
    }

    /// Nobody has a fault, and yet the robot does not do what it was asked for.
    #[test]
    fn a_robot_that_gives_up_is_a_cause() {
        let stuck = wheeleg_telemetry::Cause::Master(MasterEvent::Behaviour(Act::Stuck));
        let event = FaultEvent::of(26_340_000_000, &stuck.into()).expect("a cause");
        let (cause, count) = first([event].into_iter()).expect("a cause");
        let told = "The robot got no further in three tries, and stands, at 26.34 s";
        assert_eq!((sentence(&cause, count).as_str(), count), (told, 1));
        let homed = wheeleg_telemetry::Cause::Master(MasterEvent::Homed);
        assert_eq!(FaultEvent::of(0, &homed.into()), None);
    }

    #[test]
    fn a_finding_is_told_apart_from_its_remedy() {
        let finding = Finding::LineFull;
        let found = |node| {
            let found = wheeleg_telemetry::Cause::Master(MasterEvent::Found { node, finding });
            let event = FaultEvent::of(0, &found.into()).expect("a fault");
            first([event].into_iter()).expect("a cause").0
        };
        let sentence = finding.sentence().trim_end_matches('.');
        let cause = found(Some(2));
        assert_eq!(cause.remedy, Some(finding.remedy()));
        assert_eq!(cause.headline, format!("joint 2: {}", within(sentence)));
        assert_eq!(found(None).headline, sentence);
    }
}
