//! The pace of a live robot: absolute deadlines from a monotonic clock, one per bus cycle.

use std::time::{Duration, Instant};

use super::PaceStatus;

/// A cycle up to this late is caught up with; beyond it the base of the clock is shifted.
const CATCH_UP: Duration = Duration::from_millis(100);
/// Cycles that are caught up with at most.
const BURST: u32 = 10;

/// When the next cycle is due.
#[derive(Debug)]
pub(super) struct Pace {
    cycle: Duration,
    /// Wall time of a cycle; `None`: as fast as it goes.
    period: Option<Duration>,
    due: Instant,
    status: PaceStatus,
    /// Begin of the second that is looked at, and cycles and largest lateness in it.
    second: (Instant, u32, f64),
}

impl Pace {
    pub(super) fn new(cycle: Duration, speed: Option<f64>, paused: bool, now: Instant) -> Self {
        let mut pace = Self {
            cycle,
            period: None,
            due: now,
            status: PaceStatus {
                paused,
                ..PaceStatus::default()
            },
            second: (now, 0, 0.0),
        };
        pace.set_speed(speed, now);
        pace
    }

    /// How the clock goes.
    pub(super) fn status(&self) -> PaceStatus {
        self.status
    }

    /// Simulated over wall time from now on.
    pub(super) fn set_speed(&mut self, speed: Option<f64>, now: Instant) {
        self.status.speed = speed;
        self.period = speed.map(|speed| self.cycle.div_f64(speed));
        self.rebase(now);
    }

    /// Lets the clock stand, or go on.
    pub(super) fn pause(&mut self, paused: bool, now: Instant) {
        self.status.paused = paused;
        self.rebase(now);
    }

    /// The next cycle is due now: nothing of what was missed is made up for.
    pub(super) fn rebase(&mut self, now: Instant) {
        self.due = now;
    }

    /// How long to wait for the next cycle; zero: it is due.
    pub(super) fn wait(&self, now: Instant) -> Duration {
        match self.period {
            Some(_) => self.due.saturating_duration_since(now),
            None => Duration::ZERO,
        }
    }

    /// A cycle begins.
    pub(super) fn begin(&mut self, now: Instant) {
        let late = match self.period {
            Some(period) => {
                let late = now.saturating_duration_since(self.due);
                if late > CATCH_UP.min(period * BURST) {
                    self.status.shifts += 1;
                    self.due = now;
                }
                self.due += period;
                late
            }
            None => Duration::ZERO,
        };
        let late_ms = late.as_secs_f64() * 1e3;
        self.status.late_ms = late_ms;
        let (since, cycles, late_max_ms) = &mut self.second;
        *cycles += 1;
        *late_max_ms = late_max_ms.max(late_ms);
        let passed = now.saturating_duration_since(*since);
        if passed >= Duration::from_secs(1) {
            self.status.factor =
                f64::from(*cycles) * self.cycle.as_secs_f64() / passed.as_secs_f64();
            self.status.late_max_ms = *late_max_ms;
            self.second = (now, 0, 0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE: Duration = Duration::from_millis(10);

    /// Cycles begun without waiting from `now` on.
    fn burst(pace: &mut Pace, now: Instant) -> usize {
        (0..1_000)
            .take_while(|_| {
                let due = pace.wait(now).is_zero();
                if due {
                    pace.begin(now);
                }
                due
            })
            .count()
    }

    #[test]
    fn deadlines_are_absolute_and_a_late_cycle_is_caught_up_with() {
        let start = Instant::now();
        let mut pace = Pace::new(CYCLE, Some(1.0), false, start);
        assert_eq!(burst(&mut pace, start), 1);
        let late = start + Duration::from_millis(55);
        assert_eq!(burst(&mut pace, late), 5);
        assert_eq!(pace.wait(late), Duration::from_millis(5));
        assert_eq!(pace.status().shifts, 0);
    }

    #[test]
    fn after_a_suspension_the_base_is_shifted_and_there_is_no_burst() {
        let start = Instant::now();
        for speed in [0.1, 1.0, 10.0] {
            let mut pace = Pace::new(CYCLE, Some(speed), false, start);
            burst(&mut pace, start);
            let late = start + Duration::from_secs(10);
            assert_eq!(burst(&mut pace, late), 1, "{speed}");
            assert_eq!(pace.status().shifts, 1);
            // The largest burst that is made up for.
            let most = late + CATCH_UP.min(CYCLE.div_f64(speed) * BURST);
            assert!(burst(&mut pace, most) <= BURST as usize + 1, "{speed}");
        }
    }

    #[test]
    fn the_pace_is_measured() {
        let start = Instant::now();
        let mut pace = Pace::new(CYCLE, Some(2.0), false, start);
        for n in 0..=200 {
            pace.begin(start + Duration::from_millis(5) * n);
        }
        let factor = pace.status().factor;
        assert!((factor - 2.0).abs() < 0.02, "{factor}");
    }
}
