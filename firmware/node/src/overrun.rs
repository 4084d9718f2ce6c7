//! Overrun detection by measurement.
//!
//! A tick overruns when it ends later than one period after its start, or when the next one starts more than half a
//! period late, which means that a timer edge was missed. The first start after reset is accepted as it comes.
//!
//! Instants are the low 32 bits of a microsecond counter, compared modulo 2^32 (71 minutes).

use wheeleg_units::Micros;

/// `later - earlier` modulo 2^32 microseconds.
pub const fn elapsed(earlier: Micros, later: Micros) -> Micros {
    Micros(later.get().wrapping_sub(earlier.get()))
}

/// Measures each tick against its period.
#[derive(Clone, Copy, Debug, Default)]
pub struct OverrunDetector {
    start: Option<Micros>,
    longest: Micros,
    overruns: u32,
}

impl OverrunDetector {
    /// Nothing measured yet.
    pub const fn new() -> Self {
        Self {
            start: None,
            longest: Micros::ZERO,
            overruns: 0,
        }
    }

    /// Notes the start of a tick; returns true if it started too late after the last one.
    pub fn begin(&mut self, now: Micros, period: Micros) -> bool {
        let late = self.start.is_some_and(|last| {
            elapsed(last, now) > period.saturating_add(Micros(period.get() / 2))
        });
        self.start = Some(now);
        self.count(late)
    }

    /// Notes the end of the tick; returns true if it took longer than its period.
    pub fn end(&mut self, end: Micros, period: Micros) -> bool {
        let Some(start) = self.start else {
            return false;
        };
        let length = elapsed(start, end);
        self.longest = self.longest.max(length);
        self.count(length > period)
    }

    fn count(&mut self, overrun: bool) -> bool {
        if overrun {
            self.overruns = self.overruns.saturating_add(1);
        }
        overrun
    }

    /// The period changes: the next start is accepted as it comes.
    pub fn restart(&mut self) {
        self.start = None;
    }

    /// Longest tick so far.
    pub const fn longest(&self) -> Micros {
        self.longest
    }

    /// Number of overruns since reset.
    pub const fn overruns(&self) -> u32 {
        self.overruns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Micros = Micros(1000);

    #[test]
    fn tick_of_exactly_one_period_is_in_time() {
        let mut detector = OverrunDetector::new();
        assert!(!detector.begin(Micros(5000), PERIOD));
        assert!(!detector.end(Micros(6000), PERIOD));
        assert!(!detector.begin(Micros(6000), PERIOD));
        assert!(detector.end(Micros(7001), PERIOD));
        assert_eq!((detector.overruns(), detector.longest()), (1, Micros(1001)));
    }

    #[test]
    fn missed_edge_is_seen_at_the_next_start() {
        let mut detector = OverrunDetector::new();
        detector.begin(Micros(0), PERIOD);
        assert!(!detector.begin(Micros(1500), PERIOD));
        assert!(detector.begin(Micros(3001), PERIOD));
    }

    #[test]
    fn counter_wrap_is_no_overrun() {
        let mut detector = OverrunDetector::new();
        assert!(!detector.begin(Micros(u32::MAX - 99), PERIOD));
        assert!(!detector.end(Micros(300), PERIOD));
        assert!(!detector.begin(Micros(900), PERIOD));
        assert_eq!(detector.longest(), Micros(400));
    }
}
