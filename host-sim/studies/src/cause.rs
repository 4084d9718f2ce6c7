//! First causes of failures: the faults of a run or a log, and where the robot gave up, without those that
//! only follow from another.

use serde::Serialize;
use wheeleg_master::event::HoldReason;
use wheeleg_protocol::{Address, Fault};
use wheeleg_telemetry::event::{hold_name, hold_words_of};
use wheeleg_telemetry::messages::within;
use wheeleg_telemetry::{Event, EventCode, EventKind, finding_of_name};

/// An event this soon after a fault may follow from it, ns.
const FOLLOWS_NS: u64 = 1_000_000_000;
/// The master's reasons to hold that follow from a fault of a board.
const HOLDS_THAT_FOLLOW: [&str; 3] = [
    hold_name(&HoldReason::NodeFault { node: 0, faults: 0 }),
    hold_name(&HoldReason::NodeLost(0)),
    hold_name(&HoldReason::NodeDisarmed(0)),
];

/// Whether an event is a failure: a fault, or a robot that gives up.
pub(crate) fn goes_wrong(kind: Option<EventKind>, code: Option<EventCode>) -> bool {
    match code {
        Some(EventCode::Stuck) => true,
        Some(EventCode::FaultsCleared) => false,
        _ => kind == Some(EventKind::Fault),
    }
}

/// An event for which [`goes_wrong`] holds.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FaultEvent {
    pub(crate) t_ns: u64,
    /// `None` for a code of a later version.
    pub(crate) code: Option<EventCode>,
    pub(crate) detail: String,
    pub(crate) fault: Option<Fault>,
    /// Boards concerned.
    pub(crate) boards: Vec<Address>,
    /// For a person.
    pub(crate) text: String,
}

impl FaultEvent {
    /// From an event of a run, if it is a failure after the start-up.
    pub(crate) fn of(t_ns: u64, event: &Event) -> Option<Self> {
        let (kind, code) = (event.cause.kind(), event.cause.code());
        let is_wrong = goes_wrong(Some(kind), Some(code)) && event.start_up_us.is_none();
        is_wrong.then(|| Self {
            t_ns,
            code: Some(code),
            detail: event.cause.detail(),
            fault: event.cause.fault_code().and_then(Fault::from_code),
            boards: event.cause.board().into_iter().collect(),
            text: event.to_string(),
        })
    }

    /// Whether it only follows from `cause`: the master holds, a board says why, other boards report the
    /// same.
    fn follows(&self, cause: &Self) -> bool {
        self.t_ns.abs_diff(cause.t_ns) <= FOLLOWS_NS
            && match self.code {
                Some(EventCode::Hold) => HOLDS_THAT_FOLLOW.contains(&self.detail.as_str()),
                Some(EventCode::Diagnosis | EventCode::RunFailed) => true,
                code => code.is_some() && code == cause.code && self.fault == cause.fault,
            }
    }
}

/// Names of boards as a list.
pub(crate) fn names(boards: &[Address]) -> String {
    let names: Vec<String> = boards.iter().map(Address::to_string).collect();
    names.join(", ")
}

/// A failure, with its remedy.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cause {
    pub(crate) t_s: f64,
    /// What happened, and to which board.
    pub(crate) headline: String,
    /// The robot's reaction, if it is not the usual one to a fault of a board.
    pub(crate) consequence: Option<&'static str>,
    pub(crate) remedy: Option<String>,
}

/// The robot's reaction when the master holds.
const ALL_HOLD: &str = "all axes hold";

impl Cause {
    fn of(event: &FaultEvent) -> Self {
        let stem = |sentence: &str| sentence.trim_end_matches('.').to_owned();
        let told = |headline: String, consequence, remedy| Self {
            t_s: event.t_ns as f64 * 1e-9,
            headline: capital(&headline),
            consequence,
            remedy,
        };
        let of_boards = |what: &str| match event.boards.is_empty() {
            true => what.to_owned(),
            false => format!("{}: {}", names(&event.boards), within(what)),
        };
        let row = match event.code {
            Some(EventCode::Stuck) => {
                let remedy = Some("Turn it, or lead it another way.".to_owned());
                return told("The robot got stuck and gave up".to_owned(), None, remedy);
            }
            Some(EventCode::Hold) => {
                let words = hold_words_of(&event.detail);
                // A board's own report is in the text.
                if let Some(words) = words.filter(|_| event.fault.is_none()) {
                    let consequence = Some(words.consequence.unwrap_or(ALL_HOLD));
                    return told(of_boards(words.cause), consequence, Some(words.way_on()));
                }
                None
            }
            Some(EventCode::FaultLatched) => {
                event.fault.map(|fault| (fault.sentence(), fault.remedy()))
            }
            Some(EventCode::Finding) => {
                finding_of_name(&event.detail).map(|finding| (finding.sentence(), finding.remedy()))
            }
            _ => None,
        };
        let headline = match row {
            Some((sentence, _)) => of_boards(&stem(sentence)),
            None => stem(&event.text),
        };
        told(headline, None, row.map(|(_, remedy)| remedy.to_owned()))
    }

    /// As a sentence without its full stop; `count`: the number of causes.
    pub(crate) fn sentence(&self, count: usize) -> String {
        let Self { t_s, headline, .. } = self;
        let first = match count {
            0 | 1 => String::new(),
            _ => format!(", the first of {count} faults"),
        };
        let consequence = self.consequence.map(|what| format!(": {what}"));
        format!(
            "{headline} at {t_s:.2} s{first}{}",
            consequence.unwrap_or_default()
        )
    }
}

/// A text with a capital first letter.
pub(crate) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next();
    first.map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

/// Causes of failures, from events in their order. Most runs have none; the others are listed one by one.
pub(crate) fn causes(events: impl Iterator<Item = FaultEvent>) -> Vec<Cause> {
    let mut causes: Vec<FaultEvent> = Vec::new();
    for event in events {
        // A fault latched again within the second is the same.
        if !causes.iter().any(|cause| event.follows(cause)) {
            causes.push(event);
        }
    }
    causes.iter().map(Cause::of).collect()
}

/// Most causes in the list of a page.
pub(crate) const LISTED: usize = 10;

/// A failure, for a template.
#[derive(Serialize)]
pub(crate) struct Wrong {
    /// Time on the clock of the page, s.
    t: f64,
    text: String,
    remedy: Option<String>,
}

/// The first causes, for the list of a page; `clock` converts their time to that of the page.
pub(crate) fn listed(causes: &[Cause], clock: impl Fn(f64) -> f64) -> Vec<Wrong> {
    let listed = causes.iter().take(LISTED);
    let wrong = listed.map(|cause| Wrong {
        t: clock(cause.t_s),
        text: cause.sentence(1),
        remedy: cause.remedy.clone(),
    });
    wrong.collect()
}

/// The first of some causes, as a sentence without its full stop.
pub(crate) fn first_sentence(causes: &[Cause]) -> Option<String> {
    causes.first().map(|first| first.sentence(causes.len()))
}

#[cfg(test)]
mod tests {
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
        ];
        let found = causes(one.clone().into_iter());
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].remedy.as_deref(), Some(fault.remedy()));
        assert_eq!(
            first_sentence(&found).expect("a cause"),
            "Joint 3: the position sensor reads outside its range at 3.00 s"
        );
        // A lost operator has a reason of its own; so have later events.
        for (another, expected) in [
            (hold(3_100, HoldReason::OperatorLost), 2),
            (latched(3_100, 4, fault), 1),
            (latched(4_100, 3, fault), 2),
            (latched(3_100, 3, Fault::LinkLost), 2),
        ] {
            let all = one.iter().cloned().chain([another.clone()]);
            let found = causes(all);
            assert_eq!(found.len(), expected, "{another:?}");
            assert_eq!(
                found[0].headline,
                "Joint 3: the position sensor reads outside its range"
            );
        }
        assert!(first_sentence(&causes(std::iter::empty())).is_none());
    }

    /// A board that has lost its supply gives no fault: the master's reason is reported, as typed.
    #[test]
    fn a_hold_is_told_by_its_reason_with_the_remedy_apart() {
        let told = |reason: HoldReason| {
            let text = "master: all axes hold: so";
            let hold = event(3_050, EventCode::Hold, hold_name(&reason), None, None, text);
            let found = causes([hold].into_iter());
            (
                found[0].sentence(1),
                found[0].sentence(2),
                found[0].remedy.clone(),
            )
        };
        let (one, several, remedy) = told(HoldReason::SupplyLost);
        assert_eq!(one, "Supply pressure lost at 3.05 s: all axes hold");
        let first = "Supply pressure lost at 3.05 s, the first of 2 faults: all axes hold";
        assert_eq!(several, first);
        assert!(remedy.expect("a remedy").starts_with("Check compressor"));
        for reason in [
            HoldReason::LayerOneStalled,
            HoldReason::LayerOneGone,
            HoldReason::OperatorLost,
            HoldReason::EmergencyStop,
        ] {
            let (one, ..) = told(reason);
            assert!(!one.contains("master"), "{one}");
        }
        let of_board = event(
            3_050,
            EventCode::Hold,
            hold_name(&HoldReason::NodeLost(3)),
            None,
            Some(3),
            "",
        );
        let found = causes([of_board].into_iter());
        assert_eq!(
            found[0].sentence(1),
            "Joint 3: missed three cycles at 3.05 s: all axes hold"
        );
    }

    /// It is not a fault of a board, but the reason why the run failed.
    #[test]
    fn a_robot_that_gives_up_has_gone_wrong() {
        let stuck = event(
            26_340,
            EventCode::Stuck,
            "",
            None,
            None,
            "master: no progress",
        );
        let found = causes([stuck].into_iter());
        assert_eq!(
            found[0].sentence(1),
            "The robot got stuck and gave up at 26.34 s"
        );
        assert!(found[0].remedy.is_some());
        let info = Some(EventKind::Info);
        assert!(goes_wrong(info, Some(EventCode::Stuck)));
        assert!(!goes_wrong(info, Some(EventCode::BackOff)));
        let fault = Some(EventKind::Fault);
        assert!(!goes_wrong(fault, Some(EventCode::FaultsCleared)) && goes_wrong(fault, None));
    }

    #[test]
    fn a_finding_is_told_apart_from_its_remedy() {
        let finding = Finding::LineFull;
        let found = |node| {
            let found = wheeleg_telemetry::Cause::Master(MasterEvent::Found { node, finding });
            let event = FaultEvent::of(0, &found.into()).expect("a fault");
            causes([event].into_iter()).remove(0)
        };
        let sentence = finding.sentence().trim_end_matches('.');
        let cause = found(Some(2));
        assert_eq!(cause.remedy.as_deref(), Some(finding.remedy()));
        assert_eq!(cause.headline, format!("Joint 2: {}", within(sentence)));
        assert_eq!(found(None).headline, sentence);
    }
}
