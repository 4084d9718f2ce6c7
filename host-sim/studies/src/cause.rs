//! What went wrong first: the faults of a run or a log, without those that only follow from one.

use wheeleg_protocol::Fault;
use wheeleg_telemetry::{Event, EventKind, finding_of_name};

/// What comes so soon after a fault may follow from it, ns.
const FOLLOWS_NS: u64 = 1_000_000_000;
/// Reasons of the master to hold that a fault of a board gives.
const HOLDS_THAT_FOLLOW: [&str; 3] = ["board_fault", "board_lost", "board_disarmed"];

/// An event of the kind [`EventKind::Fault`], by the names that stay the same.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FaultEvent {
    pub(crate) t_ns: u64,
    pub(crate) code: String,
    pub(crate) detail: String,
    /// Number of the board's fault; 0: none.
    pub(crate) fault: u64,
    /// Boards that it is about.
    pub(crate) who: Vec<String>,
    /// Behind their names.
    pub(crate) what: String,
}

impl FaultEvent {
    /// That of an event of a run, if it is a fault after the start-up.
    pub(crate) fn of(t_ns: u64, event: &Event) -> Option<Self> {
        let is_fault = event.cause.kind() == EventKind::Fault && event.start_up_us.is_none();
        is_fault.then(|| {
            let sample = event.sample();
            let board = event.cause.board().map(|board| board.to_string());
            let (who, what) = named(board, sample.text);
            Self {
                t_ns,
                code: sample.code,
                detail: sample.detail,
                fault: sample.fault.into(),
                who,
                what,
            }
        })
    }

    /// Whether it is no more than what comes of `cause`: the master holds, a board says why, other
    /// boards report the same.
    fn follows(&self, cause: &Self) -> bool {
        self.t_ns.abs_diff(cause.t_ns) <= FOLLOWS_NS
            && match self.code.as_str() {
                "hold" => HOLDS_THAT_FOLLOW.contains(&self.detail.as_str()),
                "diagnosis" | "run_failed" => true,
                code => code == cause.code && self.fault == cause.fault,
            }
    }
}

/// A text that begins with the name of its board, as that name and what is the same for all boards.
pub(crate) fn named(board: Option<String>, text: String) -> (Vec<String>, String) {
    let split = board.and_then(|who| {
        let what = text.strip_prefix(&who)?.strip_prefix(": ")?.to_owned();
        Some((vec![who], what))
    });
    split.unwrap_or((Vec::new(), text))
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
        let row = match event.code.as_str() {
            "fault_latched" => u8::try_from(event.fault)
                .ok()
                .and_then(Fault::from_code)
                .map(|fault| (fault.sentence(), fault.remedy())),
            "finding" => {
                finding_of_name(&event.detail).map(|finding| (finding.sentence(), finding.remedy()))
            }
            _ => None,
        };
        let what = row.map_or(event.what.as_str(), |(sentence, _)| sentence);
        let remedy = row.map(|(_, remedy)| remedy);
        let what = what.trim_start_matches("master: ").trim_end_matches('.');
        let headline = match event.who.as_slice() {
            [] => what.to_owned(),
            who => format!("{}: {}", who.join(", "), within(what)),
        };
        Self {
            t_s: event.t_ns as f64 * 1e-9,
            headline,
            remedy,
        }
    }
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
    for event in events.filter(|event| event.code != "faults_cleared") {
        // What is latched again within the second is the same.
        if !causes.iter().any(|cause| event.follows(cause)) {
            causes.push(event);
        }
    }
    let cause = causes.first().map(Cause::of)?;
    Some((cause, causes.len()))
}

/// What went wrong, in a sentence without its end.
pub(crate) fn sentence(cause: &Cause, count: usize) -> String {
    let Cause { t_s, headline, .. } = cause;
    match count {
        1 => format!("{headline}, at {t_s:.2} s"),
        _ => format!("{count} faults, the first: {headline}, at {t_s:.2} s"),
    }
}

#[cfg(test)]
mod tests {
    use wheeleg_master::finding::Finding;

    use super::*;

    fn event(ms: u64, code: &str, detail: &str, fault: u64, who: &str, what: &str) -> FaultEvent {
        FaultEvent {
            t_ns: ms * 1_000_000,
            code: code.to_owned(),
            detail: detail.to_owned(),
            fault,
            who: (!who.is_empty())
                .then(|| who.to_owned())
                .into_iter()
                .collect(),
            what: what.to_owned(),
        }
    }

    #[test]
    fn what_follows_from_a_fault_is_none_of_its_own() {
        let fault = Fault::SensorRange;
        let number = u64::from(fault.code());
        let latched = |ms, who| event(ms, "fault_latched", "sensor_range", number, who, "");
        let hold = |ms, detail| event(ms, "hold", detail, 0, "", "master: all axes hold: so");
        let one = [
            latched(3_000, "joint 3"),
            event(
                3_014,
                "diagnosis",
                "fault",
                number,
                "",
                "master: joint 3 says why",
            ),
            hold(3_020, "board_fault"),
            event(3_500, "faults_cleared", "", 0, "joint 3", "faults cleared"),
        ];
        let (cause, count) = first(one.clone().into_iter()).expect("a cause");
        assert_eq!((count, cause.remedy), (1, Some(fault.remedy())));
        let told = sentence(&cause, count);
        assert_eq!(
            told,
            "joint 3: the position sensor reads outside its range, at 3.00 s"
        );
        // The operator is lost for a reason of their own; what comes later, too.
        for (another, expected) in [
            (hold(3_100, "operator_lost"), 2),
            (latched(3_100, "joint 4"), 1),
            (latched(4_100, "joint 3"), 2),
            (
                event(3_100, "fault_latched", "link_lost", 1, "joint 3", ""),
                2,
            ),
        ] {
            let all = one.iter().cloned().chain([another.clone()]);
            let (cause, count) = first(all).expect("a cause");
            assert_eq!(count, expected, "{another:?}");
            assert!(sentence(&cause, count).contains("joint 3: the position sensor"));
        }
        let (cause, _) = first([hold(10, "operator_lost")].into_iter()).expect("a cause");
        assert_eq!(sentence(&cause, 1), "all axes hold: so, at 0.01 s");
        assert_eq!(first(std::iter::empty()), None);
    }

    #[test]
    fn a_finding_is_told_apart_from_its_remedy() {
        let text = Finding::LineFull.to_string();
        let found = event(0, "finding", "line_full", 0, "joint 2", &text);
        let (cause, _) = first([found].into_iter()).expect("a cause");
        assert_eq!(cause.remedy, Some(Finding::LineFull.remedy()));
        let sentence = Finding::LineFull.sentence().trim_end_matches('.');
        assert_eq!(cause.headline, format!("joint 2: {}", within(sentence)));
    }
}
