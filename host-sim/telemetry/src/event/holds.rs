//! Why all axes hold, in words for people: events, reports, the console's page and the command line take
//! their words from here.

use wheeleg_master::event::HoldReason;
use wheeleg_master::finding::Finding;

use super::names::hold_name;

/// The words for a reason to hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HoldWords {
    /// What happened; of a board, what happened to it. A sentence without its full stop.
    pub cause: &'static str,
    /// The consequence, if it is more than that all axes hold; without a full stop.
    pub consequence: Option<&'static str>,
    /// What to do before the fault is cleared.
    pub remedy: Option<&'static str>,
}

impl HoldWords {
    /// What to do until the robot can continue.
    #[must_use]
    pub fn way_on(&self) -> String {
        match self.remedy {
            Some(remedy) => format!("{remedy} Then clear the fault and arm."),
            None => "Clear the fault and arm.".to_owned(),
        }
    }
}

/// Every reason; the boards in them do not matter.
const ALL: [HoldReason; 8] = [
    HoldReason::NodeLost(0),
    HoldReason::NodeFault { node: 0, faults: 0 },
    HoldReason::NodeDisarmed(0),
    HoldReason::SupplyLost,
    HoldReason::LayerOneStalled,
    HoldReason::LayerOneGone,
    HoldReason::OperatorLost,
    HoldReason::EmergencyStop,
];

/// The words for a reason.
#[must_use]
pub const fn hold_words(reason: &HoldReason) -> HoldWords {
    let (cause, consequence, remedy) = match reason {
        HoldReason::NodeLost(_) => (
            "Missed three cycles",
            None,
            Some(Finding::NodeLost.remedy()),
        ),
        HoldReason::NodeFault { .. } => (
            "Reports a fault",
            None,
            Some("Do what the fault itself asks for."),
        ),
        HoldReason::NodeDisarmed(_) => (
            "Restarted, and no longer armed",
            None,
            Some("Check its supply."),
        ),
        HoldReason::SupplyLost => (
            "Supply pressure lost",
            None,
            Some("Check compressor, hose and regulator."),
        ),
        HoldReason::LayerOneStalled => (
            "The gait sent nothing for 0.1 s",
            Some("a walk is brought to a stand by its behaviours"),
            None,
        ),
        HoldReason::LayerOneGone => (
            "The gait does not come back",
            Some("no leg answers the ground any more"),
            None,
        ),
        HoldReason::OperatorLost => ("Operator lost", None, Some("Take control.")),
        HoldReason::EmergencyStop => ("Emergency stop", None, Some("Remove the cause.")),
    };
    HoldWords {
        cause,
        consequence,
        remedy,
    }
}

/// All reasons by their names in the log, with their words.
pub fn holds() -> impl Iterator<Item = (&'static str, HoldWords)> {
    ALL.iter()
        .map(|reason| (hold_name(reason), hold_words(reason)))
}

/// The words for a reason by its name in the log.
#[must_use]
pub fn hold_words_of(name: &str) -> Option<HoldWords> {
    holds()
        .find(|(known, _)| *known == name)
        .map(|(_, words)| words)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use wheeleg_master::event::Event as MasterEvent;
    use wheeleg_protocol::Fault;

    use super::*;
    use crate::Cause;
    use crate::messages::within;

    /// The text of an event uses the words of the table.
    #[test]
    fn every_reason_has_words_of_its_own_and_its_event_has_them() {
        let causes: BTreeSet<&str> = holds().map(|(_, words)| words.cause).collect();
        let names: BTreeSet<&str> = holds().map(|(name, _)| name).collect();
        assert_eq!((causes.len(), names.len()), (ALL.len(), ALL.len()));
        for reason in ALL {
            let words = hold_words(&reason);
            assert_eq!(hold_words_of(hold_name(&reason)), Some(words));
            assert!(!words.cause.ends_with('.'), "{}", words.cause);
            assert!(
                words.remedy.is_none_or(|told| told.ends_with('.')),
                "{words:?}"
            );
            let text = Cause::Master(MasterEvent::Hold(reason)).to_string();
            // If a board reports a fault, that is given instead.
            if !matches!(reason, HoldReason::NodeFault { .. }) {
                assert!(text.contains(&within(words.cause)), "{text}");
                assert!(text.ends_with(&words.way_on()), "{text}");
            }
        }
        let board = Cause::Master(MasterEvent::Hold(HoldReason::NodeLost(3))).to_string();
        let begin = "master: all axes hold: joint 3: missed three cycles. ";
        assert!(board.starts_with(begin), "{board}");
        let stop = hold_words(&HoldReason::EmergencyStop).cause;
        assert_eq!(
            format!("{stop}."),
            Fault::EmergencyStop.sentence(),
            "the boards' word"
        );
        assert!(hold_words_of("nosuch").is_none());
    }
}
