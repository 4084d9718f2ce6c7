//! The pace of a live robot: absolute deadlines from a monotonic clock, one per bus cycle.

use std::mem::replace;
use std::time::{Duration, Instant};

use super::PaceStatus;

/// A cycle up to this late is caught up with; beyond it the base of the clock is shifted.
const CATCH_UP: Duration = Duration::from_millis(100);
/// A cycle that begins later than this counts as late: its SYNC is, too.
const LATE: Duration = Duration::from_millis(5);
/// Cycles that are caught up with at most.
const BURST: u32 = 10;
/// Time over which the pace is measured.
const SECOND: Duration = Duration::from_secs(1);
/// Cycles of a second whose lateness is measured: all of them, at the fastest pace that can be late at all.
const CYCLES: usize = 1_024;

/// When the next cycle is due.
#[derive(Debug)]
pub(super) struct Pace {
    cycle: Duration,
    /// Wall time of a cycle; `None`: as fast as possible.
    period: Option<Duration>,
    due: Instant,
    status: PaceStatus,
    /// Start of the measured second, and its cycles.
    since: Instant,
    cycles: u32,
    /// How late they began, ms.
    late_ms: Vec<f64>,
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
            since: now,
            cycles: 0,
            late_ms: Vec::with_capacity(CYCLES),
        };
        pace.set_period(speed);
        pace
    }

    /// Pace of the clock.
    pub(super) fn status(&self) -> PaceStatus {
        self.status
    }

    /// Sets the ratio of simulated to wall time. The measured second goes on, however often this is called,
    /// and the next cycle does not come before it was due.
    pub(super) fn set_speed(&mut self, speed: Option<f64>, now: Instant) {
        let had_period = self.period.is_some();
        self.set_period(speed);
        self.due = match self.period {
            Some(period) if had_period => self.due.clamp(now, now + period),
            _ => now,
        };
    }

    fn set_period(&mut self, speed: Option<f64>) {
        self.status.speed = speed;
        self.period = speed.map(|speed| self.cycle.div_f64(speed));
    }

    /// Pauses or resumes the clock.
    pub(super) fn pause(&mut self, paused: bool, now: Instant) {
        if replace(&mut self.status.paused, paused) == paused {
            return;
        }
        if paused {
            self.status.factor = 0.0;
        }
        self.rebase(now);
    }

    /// The next cycle is due now: missed cycles are not made up for, and the observed second starts again.
    pub(super) fn rebase(&mut self, now: Instant) {
        self.due = now;
        self.late_ms.clear();
        (self.since, self.cycles) = (now, 0);
    }

    /// How long to wait for the next cycle; zero: it is due.
    pub(super) fn wait(&self, now: Instant) -> Duration {
        match self.period {
            Some(_) => self.due.saturating_duration_since(now),
            None => Duration::ZERO,
        }
    }

    /// Begins a cycle. Returns the lateness of the last second's cycles, if one is over.
    pub(super) fn begin(&mut self, now: Instant) -> Option<Lateness> {
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
        if late > LATE {
            self.status.late += 1;
        }
        let late_ms = late.as_secs_f64() * 1e3;
        self.status.late_ms = late_ms;
        self.cycles += 1;
        if self.late_ms.len() < CYCLES {
            self.late_ms.push(late_ms);
        }
        let passed = now.saturating_duration_since(self.since);
        if passed < SECOND {
            return None;
        }
        let simulated_s = f64::from(self.cycles) * self.cycle.as_secs_f64();
        self.status.factor = simulated_s / passed.as_secs_f64();
        let lateness = Lateness::of(&mut self.late_ms);
        self.status.late_max_ms = lateness.max_ms;
        self.late_ms.clear();
        (self.since, self.cycles) = (now, 0);
        Some(lateness)
    }
}

/// How late the cycles of a second began.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lateness {
    /// Median, ms.
    pub(super) p50_ms: f64,
    /// 99th percentile, ms.
    pub(super) p99_ms: f64,
    /// Largest, ms.
    pub(super) max_ms: f64,
}

impl Lateness {
    /// From at least one cycle, in any order.
    fn of(late_ms: &mut [f64]) -> Self {
        late_ms.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| {
            let place = (share * late_ms.len() as f64) as usize;
            let place = place.min(late_ms.len().saturating_sub(1));
            late_ms.get(place).copied().unwrap_or(0.0)
        };
        Self {
            p50_ms: at(0.5),
            p99_ms: at(0.99),
            max_ms: at(1.0),
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

    /// A client that sets the pace again and again neither prevents its measurement nor makes the robot
    /// faster.
    #[test]
    fn a_pace_that_is_set_in_every_cycle_is_measured_and_kept() {
        let start = Instant::now();
        let mut pace = Pace::new(CYCLE, Some(1.0), false, start);
        let mut cycles = 0;
        for ms in 0..2_000 {
            let now = start + Duration::from_millis(ms);
            pace.set_speed(Some(if ms % 2 == 0 { 1.0 } else { 1.001 }), now);
            pace.pause(false, now);
            cycles += burst(&mut pace, now);
        }
        assert!((199..=202).contains(&cycles), "{cycles} of 200");
        let factor = pace.status().factor;
        assert!((factor - 1.0).abs() < 0.02, "{factor}");
        // From the slowest pace to a faster one, nobody waits for the slow cycle.
        let now = start + Duration::from_secs(3);
        let mut slow = Pace::new(CYCLE, Some(0.1), false, now);
        burst(&mut slow, now);
        slow.set_speed(Some(1.0), now);
        assert_eq!(slow.wait(now), CYCLE);
    }

    /// Nor does a cycle with a paused clock count as a slow one.
    #[test]
    fn after_a_pause_the_pace_is_measured_anew() {
        let start = Instant::now();
        let mut pace = Pace::new(CYCLE, Some(1.0), false, start);
        for n in 0..50 {
            pace.begin(start + CYCLE * n);
        }
        let [paused, resumed] = [1, 100].map(|s| start + Duration::from_secs(s));
        pace.pause(true, paused);
        assert_eq!(pace.status().factor, 0.0);
        pace.pause(false, resumed);
        let told = (0..=100).find_map(|n| pace.begin(resumed + CYCLE * n));
        assert!(told.is_some_and(|second| second.max_ms < 1.0), "{told:?}");
        let factor = pace.status().factor;
        assert!((factor - 1.0).abs() < 0.02, "{factor}");
    }

    #[test]
    fn each_second_tells_how_late_its_cycles_were() {
        let start = Instant::now();
        let mut pace = Pace::new(CYCLE, Some(1.0), false, start);
        let mut told = Vec::new();
        for n in 0..=200_u32 {
            // One in a hundred is 40 ms late, which is caught up with; the others are 2 ms late.
            let late_ms = if n % 100 == 50 { 40 } else { 2 };
            let now = start + CYCLE * n + Duration::from_millis(late_ms);
            told.extend(pace.begin(now));
        }
        assert_eq!(pace.status().late, 2, "those beyond 5 ms");
        assert_eq!(told.len(), 2, "{told:?}");
        for second in told {
            let Lateness {
                p50_ms,
                p99_ms,
                max_ms,
            } = second;
            assert!((p50_ms - 2.0).abs() < 1e-6, "{second:?}");
            assert!((p99_ms - 2.0).abs() < 1e-6 || (p99_ms - 40.0).abs() < 1e-6);
            assert!((max_ms - 40.0).abs() < 1e-6, "{second:?}");
        }
        let of = |late_ms: &mut [f64]| Lateness::of(late_ms);
        let many = of(&mut (0..200).map(f64::from).rev().collect::<Vec<f64>>());
        assert_eq!(
            (many.p50_ms, many.p99_ms, many.max_ms),
            (100.0, 198.0, 199.0)
        );
        assert_eq!(of(&mut [7.0]).p99_ms, 7.0);
    }
}
