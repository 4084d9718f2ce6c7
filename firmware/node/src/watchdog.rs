//! Command watchdog: link supervision on a SYNC counter that must advance.
//!
//! On by default and impossible to disable: the time can be lengthened within
//! its parameter limits only. A master that sends with a frozen counter, or
//! with one that runs backwards, counts as absent ("stale master"). After the
//! link is lost, the next SYNC with any counter establishes it again; the
//! latched stop stays until it is cleared.

use crate::overrun::elapsed;
use wheeleg_units::Micros;

/// What the watchdog knows about the link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// No SYNC since reset, or none since the link was lost.
    Absent,
    /// SYNC arrives and its counter advances.
    Alive,
}

/// Why the link was declared lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkLoss {
    /// No SYNC at all within the time.
    Silent,
    /// SYNC arrived, but its counter did not advance.
    Stale,
}

/// Supervises the SYNC counter.
#[derive(Clone, Copy, Debug)]
pub struct Watchdog {
    link: Link,
    counter: u16,
    fresh_at: Micros,
    stale: bool,
}

impl Default for Watchdog {
    fn default() -> Self {
        Self::new()
    }
}

impl Watchdog {
    /// No link yet.
    pub const fn new() -> Self {
        Self {
            link: Link::Absent,
            counter: 0,
            fresh_at: Micros::ZERO,
            stale: false,
        }
    }

    /// Takes the counter of a SYNC latched at `at`; true when it is fresh.
    pub fn sync(&mut self, counter: u16, at: Micros) -> bool {
        let advance = counter.wrapping_sub(self.counter);
        // Half of the number circle counts as backwards.
        let fresh = self.link == Link::Absent || (1..0x8000).contains(&advance);
        if fresh {
            self.link = Link::Alive;
            self.counter = counter;
            self.fresh_at = at;
        }
        self.stale = !fresh;
        fresh
    }

    /// Checks the time at a tick; reports a loss once.
    pub fn check(&mut self, now: Micros, time: Micros) -> Option<LinkLoss> {
        let age = elapsed(self.fresh_at, now);
        // A SYNC stamped after this tick's start is not an old one: the upper
        // half of the number circle is the future.
        let future = age.get() > u32::MAX / 2;
        if self.link == Link::Absent || future || age < time {
            return None;
        }
        self.link = Link::Absent;
        Some(if self.stale {
            LinkLoss::Stale
        } else {
            LinkLoss::Silent
        })
    }

    /// State of the link.
    pub const fn link(&self) -> Link {
        self.link
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIME: Micros = Micros(50_000);

    #[test]
    fn silence_is_reported_once_at_the_time() {
        let mut watchdog = Watchdog::new();
        assert_eq!(watchdog.check(Micros(1_000_000), TIME), None, "no link yet");
        assert!(watchdog.sync(7, Micros(10_000)));
        assert_eq!(watchdog.check(Micros(59_999), TIME), None);
        assert_eq!(
            watchdog.check(Micros(60_000), TIME),
            Some(LinkLoss::Silent)
        );
        assert_eq!(watchdog.check(Micros(61_000), TIME), None);
        assert!(watchdog.sync(7, Micros(70_000)), "any counter re-establishes");
    }

    #[test]
    fn frozen_and_backward_counters_are_stale() {
        for counter in [500, 499, 500_u16.wrapping_add(0x8000)] {
            let mut watchdog = Watchdog::new();
            watchdog.sync(500, Micros(0));
            for cycle in 1..=4 {
                assert!(!watchdog.sync(counter, Micros(cycle * 10_000)));
                assert_eq!(watchdog.check(Micros(cycle * 10_000), TIME), None);
            }
            assert_eq!(watchdog.check(TIME, TIME), Some(LinkLoss::Stale));
        }
    }

    #[test]
    fn counter_wraps_and_may_skip() {
        let mut watchdog = Watchdog::new();
        for (cycle, counter) in [65_534, 65_535, 0, 1, 5].into_iter().enumerate() {
            assert!(watchdog.sync(counter, Micros(cycle as u32 * 10_000)));
        }
    }

    #[test]
    fn sync_stamped_after_the_tick_start_is_not_old() {
        let mut watchdog = Watchdog::new();
        watchdog.sync(1, Micros(5_200));
        assert_eq!(watchdog.check(Micros(5_000), TIME), None);
        assert_eq!(watchdog.link(), Link::Alive);
        // Across the wrap of the microsecond counter.
        let mut watchdog = Watchdog::new();
        watchdog.sync(1, Micros(u32::MAX - 10));
        assert_eq!(watchdog.check(Micros(5_000), TIME), None);
        assert_eq!(watchdog.check(Micros(49_989), TIME), Some(LinkLoss::Silent));
    }
}
