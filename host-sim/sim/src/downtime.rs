//! Times at which boards outside were down: recorded in one run, replayed in another.
//!
//! How long a processor takes to start, and when exactly its watchdog bites, are properties of its hardware,
//! of which the simulator's own boards have only averages. A native run that repeats one with emulated boards
//! gets those times, and nothing else: anything else that differs between the two counts as a difference.

use std::collections::VecDeque;

use wheeleg_protocol::{Node, ResetCause};

/// A change of a board outside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Change {
    /// Its processor was reset: outputs off, memory lost.
    Reset(ResetCause),
    /// Its tick timer was started; the first edge is at this time, ns.
    FirstEdge(u64),
}

/// One change, and when the simulator learnt of it, ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Entry {
    known_ns: u64,
    change: Change,
}

/// Resets and starts of the boards that were outside in a run.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct DownTimes {
    /// Changes of each node that was outside, in the order in which they came. A board that waits for one
    /// delays no other board.
    entries: [Option<VecDeque<Entry>>; 8],
}

/// Next change of a board that keeps to the times of another run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Due {
    /// It is reset.
    Reset(Node, ResetCause),
    /// Its first tick edge is at this time, ns.
    FirstEdge(Node, u64),
}

impl DownTimes {
    /// Nothing has happened to the boards that are `remote`.
    pub(super) fn new(remote: [bool; 8]) -> Self {
        Self {
            entries: remote.map(|remote| remote.then(VecDeque::new)),
        }
    }

    /// Whether a board keeps to these times instead of its own.
    pub(super) fn is_replayed(&self, node: Node) -> bool {
        self.entries[node.index()].is_some()
    }

    fn take_down(&mut self, known_ns: u64, node: Node, change: Change) {
        if let Some(entries) = &mut self.entries[node.index()] {
            entries.push_back(Entry { known_ns, change });
        }
    }

    /// The processor of a board was reset.
    pub(super) fn reset(&mut self, known_ns: u64, node: Node, cause: ResetCause) {
        self.take_down(known_ns, node, Change::Reset(cause));
    }

    /// The first tick edge of a board after its reset is known.
    pub(super) fn first_edge(&mut self, known_ns: u64, node: Node, edge_ns: u64) {
        self.take_down(known_ns, node, Change::FirstEdge(edge_ns));
    }

    /// The next change that is due at `now_ns`, of the lowest address that has one. A board that nothing has
    /// brought `down` is not reset: a reset without a fault is no property of the hardware, and must show as
    /// a difference between the runs.
    pub(super) fn next(&mut self, now_ns: u64, down: impl Fn(Node) -> bool) -> Option<Due> {
        let mut all = Node::ALL.into_iter().zip(&mut self.entries);
        all.find_map(|(node, entries)| {
            let entries = entries.as_mut()?;
            entries
                .front()
                .filter(|entry| entry.known_ns <= now_ns && down(node))?;
            Some(match entries.pop_front()?.change {
                Change::Reset(cause) => Due::Reset(node, cause),
                Change::FirstEdge(edge_ns) => Due::FirstEdge(node, edge_ns),
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: Node = Node::JOINTS[1];
    const SEVEN: Node = Node::WHEELS[0];

    #[test]
    fn changes_come_in_order_when_they_are_due_and_only_to_boards_that_are_down() {
        let mut remote = [false; 8];
        remote[1] = true;
        let mut times = DownTimes::new(remote);
        times.reset(5_000, TWO, ResetCause::Watchdog);
        times.first_edge(9_000, TWO, 10_000);
        assert!(times.is_replayed(TWO) && !times.is_replayed(Node::JOINTS[0]));
        assert_eq!(times.next(4_999, |_| true), None, "not yet");
        assert_eq!(times.next(5_000, |_| false), None, "nothing reset it");
        let reset = Due::Reset(TWO, ResetCause::Watchdog);
        assert_eq!(times.next(5_000, |node| node == TWO), Some(reset));
        assert_eq!(times.next(5_000, |_| true), None);
        let edge = Due::FirstEdge(TWO, 10_000);
        assert_eq!(times.next(9_000, |_| true), Some(edge));
        assert_eq!(times.next(u64::MAX, |_| true), None);
    }

    #[test]
    fn a_board_that_resets_by_itself_does_not_keep_the_others_waiting() {
        let mut remote = [false; 8];
        (remote[1], remote[6]) = (true, true);
        let mut times = DownTimes::new(remote);
        let cause = ResetCause::Watchdog;
        // Nothing reset board 2; board 7 was reset later.
        times.reset(5_000, TWO, cause);
        times.reset(6_000, SEVEN, cause);
        times.first_edge(9_000, TWO, 10_000);
        times.first_edge(9_500, SEVEN, 10_400);
        let affected = |node| node == SEVEN;
        assert_eq!(times.next(5_999, affected), None);
        assert_eq!(times.next(6_000, affected), Some(Due::Reset(SEVEN, cause)));
        assert_eq!(times.next(9_400, affected), None, "its own order is kept");
        let edge = Due::FirstEdge(SEVEN, 10_400);
        assert_eq!(times.next(9_500, affected), Some(edge));
        assert_eq!(times.next(u64::MAX, affected), None);
        // Both at once: each gets its own.
        assert_eq!(times.next(u64::MAX, |_| true), Some(Due::Reset(TWO, cause)));
        let edge = Due::FirstEdge(TWO, 10_000);
        assert_eq!(times.next(u64::MAX, |_| true), Some(edge));
        assert_eq!(times.next(u64::MAX, |_| true), None);
    }
}
