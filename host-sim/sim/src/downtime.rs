//! When boards outside were down, as taken down in one run and kept to in another.
//!
//! How long a processor takes to start, and when exactly its watchdog bites, are
//! properties of its hardware, which the simulator's own boards only take averages of.
//! A native run that repeats one with emulated boards is given those times, and nothing
//! else: whatever else differs between the two is a difference.

use std::collections::VecDeque;

use wheeleg_protocol::ResetCause;

/// What became of a board outside.
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
    /// Of each address from 1 that was outside, in the order in which they came. One
    /// board's wait for what does not come keeps nobody else waiting.
    entries: [Option<VecDeque<Entry>>; 8],
}

/// What a board does next, of one that keeps to the times of another run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Due {
    /// It is reset.
    Reset(u8, ResetCause),
    /// Its first tick edge is at this time, ns.
    FirstEdge(u8, u64),
}

impl DownTimes {
    /// Nothing has happened to the boards that are `remote` (addresses from 1).
    pub(super) fn new(remote: [bool; 8]) -> Self {
        Self {
            entries: remote.map(|remote| remote.then(VecDeque::new)),
        }
    }

    /// Whether the board at `address` keeps to these times instead of its own.
    pub(super) fn is_replayed(&self, address: u8) -> bool {
        let i = usize::from(address).wrapping_sub(1);
        self.entries.get(i).is_some_and(Option::is_some)
    }

    fn take_down(&mut self, known_ns: u64, address: u8, change: Change) {
        let i = usize::from(address).wrapping_sub(1);
        if let Some(Some(entries)) = self.entries.get_mut(i) {
            entries.push_back(Entry { known_ns, change });
        }
    }

    /// The processor of a board was reset.
    pub(super) fn reset(&mut self, known_ns: u64, address: u8, cause: ResetCause) {
        self.take_down(known_ns, address, Change::Reset(cause));
    }

    /// The first tick edge of a board after its reset is known.
    pub(super) fn first_edge(&mut self, known_ns: u64, address: u8, edge_ns: u64) {
        self.take_down(known_ns, address, Change::FirstEdge(edge_ns));
    }

    /// The next change that is due at `now_ns`, of the lowest address that has one. A board
    /// that nothing has brought `down` is not reset: a reset without a fault is no property
    /// of the hardware, and the runs shall differ by it.
    pub(super) fn next(&mut self, now_ns: u64, down: impl Fn(u8) -> bool) -> Option<Due> {
        (1..).zip(&mut self.entries).find_map(|(address, entries)| {
            let entries = entries.as_mut()?;
            entries
                .front()
                .filter(|entry| entry.known_ns <= now_ns && down(address))?;
            Some(match entries.pop_front()?.change {
                Change::Reset(cause) => Due::Reset(address, cause),
                Change::FirstEdge(edge_ns) => Due::FirstEdge(address, edge_ns),
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_come_in_order_when_they_are_due_and_only_to_boards_that_are_down() {
        let mut remote = [false; 8];
        remote[1] = true;
        let mut times = DownTimes::new(remote);
        times.reset(5_000, 2, ResetCause::Watchdog);
        times.first_edge(9_000, 2, 10_000);
        assert!(
            times.is_replayed(2)
                && !times.is_replayed(1)
                && !times.is_replayed(0)
                && !times.is_replayed(9)
        );
        assert_eq!(times.next(4_999, |_| true), None, "not yet");
        assert_eq!(times.next(5_000, |_| false), None, "nothing reset it");
        let reset = Due::Reset(2, ResetCause::Watchdog);
        assert_eq!(times.next(5_000, |address| address == 2), Some(reset));
        assert_eq!(times.next(5_000, |_| true), None);
        let edge = Due::FirstEdge(2, 10_000);
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
        times.reset(5_000, 2, cause);
        times.reset(6_000, 7, cause);
        times.first_edge(9_000, 2, 10_000);
        times.first_edge(9_500, 7, 10_400);
        let affected = |address| address == 7;
        assert_eq!(times.next(5_999, affected), None);
        assert_eq!(times.next(6_000, affected), Some(Due::Reset(7, cause)));
        assert_eq!(times.next(9_400, affected), None, "its own order is kept");
        let edge = Due::FirstEdge(7, 10_400);
        assert_eq!(times.next(9_500, affected), Some(edge));
        assert_eq!(times.next(u64::MAX, affected), None);
        // Both at once: each gets its own.
        assert_eq!(times.next(u64::MAX, |_| true), Some(Due::Reset(2, cause)));
        let edge = Due::FirstEdge(2, 10_000);
        assert_eq!(times.next(u64::MAX, |_| true), Some(edge));
        assert_eq!(times.next(u64::MAX, |_| true), None);
    }
}
