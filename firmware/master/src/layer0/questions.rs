//! Diagnostic requests that the master sends in otherwise unused time: why a board failed or
//! restarted, what it has received, what it has logged.
//!
//! They take one acyclic exchange in ten cycles, and one immediately after a fault. What boards have received is
//! requested while the master itself receives broken frames, and on an undisturbed line, where there is little to
//! report, only in every eighth round. The checksum of the parameters in force comes with it.

use wheeleg_protocol::{Address, FaultReport, LinkReport, LogRead, Message, NodeMode, SlotReply};

use crate::setpoint::NODES;

/// Cycles between two questions of the round.
const PERIOD_CYCLES: u32 = 10;
/// Questions of a round: link and log of every board.
const ROUND: usize = 2 * NODES;
/// On an undisturbed line, number of rounds without links between two rounds with them; a round takes 0.8 s.
const QUIET_ROUNDS: u8 = 7;
/// Time for which the boards continue recording, ms: three rounds of 1.6 s.
const LEASE_MS: u16 = 5_000;

/// Open questions to one board.
#[derive(Clone, Copy, Debug, Default)]
struct Open {
    why: bool,
    link: bool,
    log: bool,
    /// It was lost after it was last heard.
    lost: bool,
    /// Faults that its newest reply showed.
    faults: u16,
}

/// Open questions to all boards.
#[derive(Clone, Copy, Debug, Default)]
pub struct Questions {
    nodes: [Open; NODES],
    turn: usize,
    next_cycle: u32,
    /// Broken frames that the master had received when the last round began.
    errors: u32,
    /// Rounds without link reports still to come; the present one has them if this is the full number.
    quiet: u8,
}

/// Whether a board has restarted between two replies.
pub(super) fn has_started(before: Option<&SlotReply>, reply: &SlotReply) -> bool {
    reply.mode == NodeMode::Boot && before.is_some_and(|b| b.mode != NodeMode::Boot)
}

impl Questions {
    /// A reply of node index 0..8; `before` is the previous one, unless the node has been lost since. A new fault, or a
    /// start during operation, raises a question.
    pub fn on_reply(&mut self, index: usize, before: Option<&SlotReply>, reply: &SlotReply) {
        let Some(node) = self.nodes.get_mut(index) else {
            return;
        };
        let faults = reply.active_faults.raw();
        let started = has_started(before, reply);
        node.why |= faults & !node.faults != 0 || started || core::mem::take(&mut node.lost);
        node.faults = faults;
    }

    /// Node index 0..8 is lost: it is asked for the reason when it is heard again.
    pub fn lost(&mut self, index: usize) {
        if let Some(node) = self.nodes.get_mut(index) {
            *node = Open {
                lost: true,
                ..Open::default()
            };
        }
    }

    /// Asks node index 0..8 why it stopped.
    pub fn why(&mut self, index: usize) {
        if let Some(node) = self.nodes.get_mut(index) {
            node.why = true;
        }
    }

    /// Node index 0..8 has more log records than were read.
    pub fn log(&mut self, index: usize) {
        if let Some(node) = self.nodes.get_mut(index) {
            node.log = true;
        }
    }

    /// Asks all nodes what they have received.
    pub fn links(&mut self) {
        for node in &mut self.nodes {
            node.link = true;
        }
    }

    /// Repeats an unanswered question.
    pub fn again(&mut self, to: Address, message: &Message) {
        let Some(node) = to.slot().and_then(|index| self.nodes.get_mut(index)) else {
            return;
        };
        match message {
            Message::FaultReport(_) => node.why = true,
            Message::LogRead(_) => node.log = true,
            _ => node.link = true,
        }
    }

    /// The next question in cycle `cycle` to a node that is `alive`; it then counts as asked. `errors` is the number of
    /// broken frames that the master has received.
    pub fn next(
        &mut self,
        cycle: u32,
        errors: u32,
        alive: impl Fn(usize) -> bool,
    ) -> Option<(Address, Message)> {
        let mut open = Address::nodes().zip(&mut self.nodes).enumerate();
        let urgent = open.find_map(|(index, (to, node))| {
            if !alive(index) {
                return None;
            }
            let message: Message = if core::mem::take(&mut node.why) {
                FaultReport {}.into()
            } else if core::mem::take(&mut node.log) {
                read_log()
            } else if core::mem::take(&mut node.link) {
                LinkReport {}.into()
            } else {
                return None;
            };
            Some((to, message))
        });
        urgent.or_else(|| self.routine(cycle, errors, alive))
    }

    fn routine(
        &mut self,
        cycle: u32,
        errors: u32,
        alive: impl Fn(usize) -> bool,
    ) -> Option<(Address, Message)> {
        // A next cycle more than half the counter's range ahead is in the past: it is due.
        if self.next_cycle.wrapping_sub(cycle) as i32 > 0 {
            return None;
        }
        self.next_cycle = cycle.wrapping_add(PERIOD_CYCLES);
        if self.turn == 0 {
            self.quiet = if errors != self.errors {
                QUIET_ROUNDS
            } else {
                self.quiet.checked_sub(1).unwrap_or(QUIET_ROUNDS)
            };
            self.errors = errors;
        }
        let turn = if self.quiet == QUIET_ROUNDS {
            self.turn
        } else {
            self.turn.max(NODES)
        };
        self.turn = if turn.saturating_add(1) < ROUND {
            turn.saturating_add(1)
        } else {
            0
        };
        let index = turn.checked_rem(NODES)?;
        let to = Address::of_slot(index).filter(|_| alive(index))?;
        Some(if turn < NODES {
            (to, LinkReport {}.into())
        } else {
            (to, read_log())
        })
    }
}

fn read_log() -> Message {
    LogRead { lease_ms: LEASE_MS }.into()
}

// A lease outlasts the round that renews it, even with a lost answer or two.
const _: () = assert!(LEASE_MS as u32 > 2 * ROUND as u32 * PERIOD_CYCLES * 10);

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_protocol::{Fault, FaultBits, InputBits, LimitBits};

    fn reply(mode: NodeMode, faults: FaultBits) -> SlotReply {
        SlotReply {
            position_raw: 0,
            velocity_raw: 0,
            effort_raw: 0,
            active_faults: faults,
            mode,
            limits: LimitBits::NONE,
            inputs: InputBits::NONE,
            sync_echo: 0,
        }
    }

    /// Questions of the cycles 0 to `cycles`, at most one per cycle.
    fn asked(questions: &mut Questions, cycles: u32) -> Vec<(u8, Message)> {
        let next = |cycle| questions.next(cycle, 5, |_| true);
        let found: Vec<_> = (0..cycles).filter_map(next).collect();
        found.into_iter().map(|(to, m)| (to.raw(), m)).collect()
    }

    #[test]
    fn a_round_asks_every_living_board_for_its_link_and_its_log() {
        let mut questions = Questions::default();
        let round = asked(&mut questions, 160);
        let expected: Vec<_> = (1..=8)
            .map(|n| (n, LinkReport {}.into()))
            .chain((1..=8).map(|n| (n, read_log())))
            .collect();
        assert_eq!(round, expected);
        let quiet = asked(&mut questions, 240);
        let logs = |m: &Message| matches!(m, Message::LogRead(_));
        assert!(
            quiet.len() == 8 && quiet.iter().all(|(_, m)| logs(m)),
            "{quiet:?}"
        );
        for cycle in 80..320 {
            let asked = questions.next(160 + cycle, 5, |index| index == 3);
            assert!(asked.is_none_or(|(to, _)| to.raw() == 4));
        }
    }

    #[test]
    fn rounds_on_a_noisy_line_follow_each_other() {
        let mut questions = Questions::default();
        let mut errors = 5;
        let mut next = |cycle| {
            errors += 1;
            questions.next(cycle, errors, |_| true)
        };
        let found: Vec<_> = (0..480).filter_map(&mut next).collect();
        assert_eq!(found.len(), 48);
        assert_eq!(found[..16], found[16..32]);
        assert_eq!(found[..16], found[32..]);
    }

    #[test]
    fn a_new_fault_is_asked_for_at_once_and_once() {
        let mut questions = Questions {
            next_cycle: 100,
            ..Questions::default()
        };
        let fault = reply(NodeMode::Hold, Fault::NoMotion.into());
        questions.on_reply(2, None, &fault);
        questions.on_reply(2, Some(&fault), &fault);
        assert_eq!(asked(&mut questions, 50), [(3, FaultReport {}.into())]);
        let another = reply(
            NodeMode::Hold,
            FaultBits::from(Fault::NoMotion).with(Fault::LinkLost),
        );
        questions.on_reply(2, Some(&fault), &another);
        assert_eq!(asked(&mut questions, 50).len(), 1);
        questions.on_reply(2, Some(&another), &reply(NodeMode::Hold, FaultBits::NONE));
        assert_eq!(asked(&mut questions, 50), []);
    }

    #[test]
    fn a_log_with_more_to_read_is_read_on_and_a_question_cut_off_is_asked_again() {
        let busy = || Questions {
            next_cycle: 100,
            ..Questions::default()
        };
        let mut questions = busy();
        questions.log(6);
        assert_eq!(asked(&mut questions, 50), [(7, read_log())]);
        let to = Address::of_slot(2).expect("a board");
        for message in [FaultReport {}.into(), read_log(), LinkReport {}.into()] {
            let mut questions = busy();
            questions.again(to, &message);
            assert_eq!(asked(&mut questions, 50), [(3, message)]);
        }
    }

    #[test]
    fn a_board_that_starts_in_operation_or_comes_back_is_asked_why_but_not_at_first_sight() {
        let mut questions = Questions {
            next_cycle: 100,
            ..Questions::default()
        };
        let (boot, idle) = (
            reply(NodeMode::Boot, FaultBits::NONE),
            reply(NodeMode::Idle, FaultBits::NONE),
        );
        questions.on_reply(4, None, &boot);
        questions.on_reply(4, Some(&boot), &idle);
        assert_eq!(asked(&mut questions, 50), [], "power-up");
        questions.on_reply(4, Some(&idle), &boot);
        assert_eq!(asked(&mut questions, 50).len(), 1, "asked again");
        questions.lost(4);
        assert_eq!(asked(&mut questions, 50), [], "nobody answers");
        questions.on_reply(4, None, &idle);
        assert_eq!(asked(&mut questions, 50).len(), 1, "back");
    }
}
