//! Supervision of the link from both ends.

use super::timing::CYCLE_US;
use crate::fault::Fault;

/// Missed cycles that are a link loss: 1–10, never off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct WatchdogCycles(u8);

impl WatchdogCycles {
    /// Five cycles, 50 ms.
    pub const DEFAULT: Self = Self(5);

    /// `None` outside 1–10: the supervision can be lengthened, not disabled.
    #[must_use]
    pub const fn new(cycles: u8) -> Option<Self> {
        match cycles {
            1..=10 => Some(Self(cycles)),
            _ => None,
        }
    }

    /// Number of cycles.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }

    const fn timeout_us(self) -> u64 {
        // Eight bits by 14.
        (self.0 as u64).wrapping_mul(CYCLE_US as u64)
    }
}

impl Default for WatchdogCycles {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Largest step of the counter that is an advance: the longest watchdog, and one more. A restarted master
/// counts from 1; with a window of half the range half of all restarts would look as if the old one went on,
/// with this one only those within 11 counts before the wrap.
pub const ADVANCE_MOST: u16 = 11;

/// Why a link was declared lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LinkLoss {
    /// No SYNC at all.
    Missing,
    /// SYNC came, but its counter did not advance.
    Stale,
}

impl LinkLoss {
    /// The fault to latch.
    #[must_use]
    pub const fn fault(self) -> Fault {
        match self {
            Self::Missing => Fault::LinkLost,
            Self::Stale => Fault::StaleMaster,
        }
    }
}

/// State of a node's link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LinkState {
    /// No advancing counter seen yet: not a fault, but no reason to arm.
    Waiting,
    /// SYNC arrives and its counter advances.
    Up,
    /// Lost and latched, whatever arrives, until [`LinkSupervisor::clear`].
    Lost(LinkLoss),
}

/// Why a lost link cannot be cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ClearError;

impl core::fmt::Display for ClearError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("no SYNC with an advancing counter arrives")
    }
}

/// A node's watch over SYNC.
///
/// The counter of SYNC must advance (by 1 to [`ADVANCE_MOST`] modulo 2^16: lost frames are
/// fine, repeats, steps back and jumps are not) at least once within the watchdog
/// time, otherwise the link is lost. On from the first advancing SYNC; latched.
///
/// The time is an argument: microseconds of a clock that does not wrap. Call
/// [`Self::poll`] every tick after the received SYNC, if any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkSupervisor {
    watchdog: WatchdogCycles,
    state: LinkState,
    counter: Option<u16>,
    /// Time of the last advance of the counter.
    advanced_at_us: Option<u64>,
    /// Whether a SYNC without an advance came since then.
    stale_since_advance: bool,
}

impl LinkSupervisor {
    /// Waiting for the first SYNC.
    #[must_use]
    pub const fn new(watchdog: WatchdogCycles) -> Self {
        Self {
            watchdog,
            state: LinkState::Waiting,
            counter: None,
            advanced_at_us: None,
            stale_since_advance: false,
        }
    }

    /// Takes the counter of a SYNC. True if it advanced: only then may the
    /// set-points be used.
    pub fn on_sync(&mut self, cycle: u16, now_us: u64) -> bool {
        let Some(last) = self.counter else {
            self.counter = Some(cycle);
            return false;
        };
        let advanced = matches!(cycle.wrapping_sub(last), 1..=ADVANCE_MOST);
        if advanced {
            self.counter = Some(cycle);
            self.advanced_at_us = Some(now_us);
            self.stale_since_advance = false;
            if self.state == LinkState::Waiting {
                self.state = LinkState::Up;
            }
        } else {
            self.stale_since_advance = true;
            // A restarted master counts from the start: follow it once the link is not in use, so that it can
            // be cleared.
            if self.state != LinkState::Up {
                self.counter = Some(cycle);
            }
        }
        advanced
    }

    /// Looks at the clock. The loss is reported once, at its start.
    pub fn poll(&mut self, now_us: u64) -> Option<LinkLoss> {
        if self.state == LinkState::Up && !self.is_fresh(now_us) {
            let loss = if self.stale_since_advance {
                LinkLoss::Stale
            } else {
                LinkLoss::Missing
            };
            self.state = LinkState::Lost(loss);
            self.counter = None;
            self.advanced_at_us = None;
            return Some(loss);
        }
        None
    }

    /// Clears the latch of a lost link, only on an explicit command.
    ///
    /// # Errors
    /// [`ClearError`] while no SYNC with an advancing counter arrives.
    pub fn clear(&mut self, now_us: u64) -> Result<(), ClearError> {
        match self.state {
            LinkState::Lost(_) if !self.is_fresh(now_us) => Err(ClearError),
            LinkState::Lost(_) => {
                self.state = LinkState::Up;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// State.
    #[must_use]
    pub const fn state(&self) -> LinkState {
        self.state
    }

    /// Whether `newest` is the counter of the newest SYNC, as far as that is certain:
    /// while the link is up and nothing stale came since.
    #[must_use]
    pub fn agrees(&self, newest: u16) -> bool {
        let certain = self.state == LinkState::Up && !self.stale_since_advance;
        !certain || self.counter == Some(newest)
    }

    /// Changes the watchdog time.
    pub fn set_watchdog(&mut self, watchdog: WatchdogCycles) {
        self.watchdog = watchdog;
    }

    /// The end of the time does not wrap; that of a damaged instant does, and lies in the past.
    fn is_fresh(&self, now_us: u64) -> bool {
        self.advanced_at_us
            .is_some_and(|at| now_us <= at.wrapping_add(self.watchdog.timeout_us()))
    }
}

impl Default for LinkSupervisor {
    fn default() -> Self {
        Self::new(WatchdogCycles::DEFAULT)
    }
}

/// The master's watch over one node: replies with the right echo, cycle by cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeMonitor {
    answered: bool,
    missed_in_a_row: u8,
    /// Missed replies since start-up; stops at its maximum.
    missed_total: u32,
}

impl NodeMonitor {
    /// Missed replies in a row that make a node absent.
    pub const LIMIT: u8 = 3;

    /// Takes a reply in its slot; one with the echo of another cycle does not count.
    pub fn on_reply(&mut self, sync_echo: u8, cycle: u16) {
        let [low, _] = cycle.to_le_bytes();
        self.answered |= sync_echo == low;
    }

    /// Ends the cycle.
    pub fn end_cycle(&mut self) {
        if self.answered {
            self.missed_in_a_row = 0;
        } else {
            self.missed_in_a_row = self.missed_in_a_row.saturating_add(1);
            self.missed_total = self.missed_total.saturating_add(1);
        }
        self.answered = false;
    }

    /// Whether the node has missed [`Self::LIMIT`] replies in a row.
    #[must_use]
    pub const fn is_absent(&self) -> bool {
        self.missed_in_a_row >= Self::LIMIT
    }

    /// Missed replies since start-up.
    #[must_use]
    pub const fn missed_total(&self) -> u32 {
        self.missed_total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn up_at(now_us: u64) -> LinkSupervisor {
        let mut link = LinkSupervisor::default();
        assert!(!link.on_sync(100, now_us - 10_000));
        assert_eq!(link.state(), LinkState::Waiting);
        assert!(link.on_sync(101, now_us));
        assert_eq!(link.state(), LinkState::Up);
        link
    }

    #[test]
    fn silence_is_lost_after_fifty_milliseconds_not_before() {
        let mut link = up_at(1_000_000);
        assert_eq!(link.poll(1_050_000), None);
        assert_eq!(link.poll(1_050_001), Some(LinkLoss::Missing));
        assert_eq!(link.poll(1_060_000), None, "reported once");
        assert_eq!(link.state(), LinkState::Lost(LinkLoss::Missing));
    }

    #[test]
    fn waiting_for_the_first_sync_is_no_fault() {
        let mut link = LinkSupervisor::default();
        assert_eq!(link.poll(u64::MAX), None);
        assert_eq!(link.state(), LinkState::Waiting);
    }

    #[test]
    fn frozen_backward_and_jumping_counters_are_stale() {
        for step in [0_u16, u16::MAX, 0x8000, 0x7FFF, 1000, 12] {
            let mut link = up_at(1_000_000);
            for k in 1..=5 {
                let now = 1_000_000 + k * 10_000;
                assert!(!link.on_sync(101_u16.wrapping_add(step), now));
                assert_eq!(link.poll(now), None);
            }
            assert_eq!(link.poll(1_051_000), Some(LinkLoss::Stale));
        }
    }

    #[test]
    fn four_lost_syncs_and_a_wrap_are_survived() {
        let mut link = LinkSupervisor::default();
        link.on_sync(65_533, 0);
        let mut cycle = 65_534_u16;
        let mut now = 10_000;
        for _ in 0..20 {
            assert!(link.on_sync(cycle, now));
            assert_eq!(link.poll(now), None);
            cycle = cycle.wrapping_add(5);
            now += 50_000;
            assert_eq!(link.poll(now - 1), None);
        }
    }

    /// Ten, the longest watchdog, and one more.
    #[test]
    fn a_step_of_eleven_is_an_advance() {
        let mut link = up_at(1_000_000);
        link.set_watchdog(WatchdogCycles::new(10).unwrap());
        assert!(link.on_sync(101 + 11, 1_100_000));
        assert_eq!(link.poll(1_100_001), None);
    }

    /// A new master counts from 1. Just before the wrap the counter cannot distinguish it from the old one;
    /// the master itself finds a board armed that it has not armed.
    #[test]
    fn a_master_that_starts_again_is_stale_but_for_eleven_counts_before_the_wrap() {
        for last in 65_526..=u16::MAX {
            let mut link = LinkSupervisor::default();
            link.on_sync(last - 1, 990_000);
            assert!(link.on_sync(last, 1_000_000));
            assert!(link.on_sync(1, 1_010_000), "{last}");
        }
        for last in (20..=u16::MAX).step_by(997).chain([6, 65_525]) {
            let mut link = LinkSupervisor::default();
            link.on_sync(last - 1, 990_000);
            assert!(link.on_sync(last, 1_000_000));
            for k in 1..=5_u16 {
                let now = 1_000_000 + u64::from(k) * 10_000;
                assert!(!link.on_sync(k, now), "{last} {k}");
                assert_eq!(link.poll(now), None);
            }
            assert_eq!(link.poll(1_051_000), Some(LinkLoss::Stale), "{last}");
        }
    }

    #[test]
    fn loss_is_latched_until_cleared_with_a_live_stream() {
        let mut link = up_at(1_000_000);
        link.poll(1_060_000);
        assert_eq!(link.clear(1_060_000), Err(ClearError));
        // The master starts again, counting from 0.
        link.on_sync(0, 2_000_000);
        assert_eq!(
            link.clear(2_000_000),
            Err(ClearError),
            "one frame proves nothing"
        );
        link.on_sync(0, 2_010_000);
        assert_eq!(link.clear(2_010_000), Err(ClearError), "frozen");
        assert!(link.on_sync(1, 2_020_000));
        assert_eq!(
            link.state(),
            LinkState::Lost(LinkLoss::Missing),
            "still latched"
        );
        assert_eq!(link.clear(2_080_000), Err(ClearError), "gone again");
        assert!(link.on_sync(2, 2_090_000));
        assert_eq!(link.clear(2_090_000), Ok(()));
        assert_eq!(link.state(), LinkState::Up);
        assert_eq!(link.poll(2_140_000), None);
        assert_eq!(link.poll(2_140_001), Some(LinkLoss::Missing));
    }

    #[test]
    fn a_second_restart_of_the_master_can_be_cleared_too() {
        let mut link = up_at(1_000_000);
        link.poll(1_060_000);
        // It comes back counting from 5000, and starts again from 0 before the clear.
        link.on_sync(5_000, 2_000_000);
        assert!(link.on_sync(5_001, 2_010_000));
        assert!(!link.on_sync(0, 3_000_000), "a step back is no advance");
        assert_eq!(link.clear(3_000_000), Err(ClearError));
        assert!(link.on_sync(1, 3_010_000));
        assert_eq!(link.clear(3_010_000), Ok(()));
        // In use, a step back is not followed: that stream is stale.
        assert!(!link.on_sync(0, 3_020_000));
        assert!(!link.on_sync(1, 3_030_000));
        assert_eq!(link.poll(3_060_001), Some(LinkLoss::Stale));
    }

    #[test]
    fn the_watchdog_has_limits() {
        assert_eq!(WatchdogCycles::new(0), None);
        assert_eq!(WatchdogCycles::new(11), None);
        let mut link = up_at(1_000_000);
        link.set_watchdog(WatchdogCycles::new(10).unwrap());
        assert_eq!(link.poll(1_100_000), None);
        assert_eq!(link.poll(1_100_001), Some(LinkLoss::Missing));
    }

    #[test]
    fn a_node_is_absent_after_three_cycles() {
        let mut node = NodeMonitor::default();
        for cycle in 0..3_u16 {
            assert!(!node.is_absent());
            // A reply of another cycle does not count.
            node.on_reply(cycle as u8 ^ 1, cycle + 256);
            node.end_cycle();
        }
        assert!(node.is_absent());
        node.on_reply(3, 259);
        node.end_cycle();
        assert!(!node.is_absent());
        assert_eq!(node.missed_total(), 3);
    }
}
