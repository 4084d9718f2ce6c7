//! A signal of any length in limited memory: time is divided into stretches, and each keeps its smallest and
//! its largest value, so that no peak is lost. When there are too many stretches, every two neighbours are
//! merged.

/// Most stretches.
const MOST: usize = 1_000;
/// First length of a stretch, ns: shorter than the period of any channel.
const SHORTEST_NS: u64 = 1_000_000;

#[derive(Debug, Clone, Copy)]
struct Stretch {
    /// Number of the stretch at its length, from time 0.
    number: u64,
    low: (u64, f64),
    high: (u64, f64),
}

impl Stretch {
    fn join(&mut self, other: &Self) {
        if other.low.1 < self.low.1 {
            self.low = other.low;
        }
        if other.high.1 > self.high.1 {
            self.high = other.high;
        }
    }
}

/// A thinned signal.
#[derive(Debug, Clone)]
pub(super) struct Thin {
    length_ns: u64,
    stretches: Vec<Stretch>,
    newest_ns: u64,
}

impl Default for Thin {
    fn default() -> Self {
        Self {
            length_ns: SHORTEST_NS,
            stretches: Vec::new(),
            newest_ns: 0,
        }
    }
}

impl Thin {
    /// Takes a value. Time does not go back: a value from the past is ignored.
    pub(super) fn push(&mut self, t_ns: u64, value: f64) {
        if t_ns < self.newest_ns {
            return;
        }
        self.newest_ns = t_ns;
        let one = Stretch {
            number: t_ns / self.length_ns,
            low: (t_ns, value),
            high: (t_ns, value),
        };
        match self.stretches.last_mut() {
            Some(last) if last.number == one.number => last.join(&one),
            _ => self.stretches.push(one),
        }
        while self.stretches.len() > MOST {
            self.halve();
        }
    }

    fn halve(&mut self) {
        self.length_ns = self.length_ns.saturating_mul(2);
        let mut joined: Vec<Stretch> = Vec::with_capacity(MOST);
        for mut stretch in self.stretches.drain(..) {
            stretch.number /= 2;
            match joined.last_mut() {
                Some(last) if last.number == stretch.number => last.join(&stretch),
                _ => joined.push(stretch),
            }
        }
        self.stretches = joined;
    }

    /// The points that represent it, in order of time; times in s.
    pub(super) fn points(&self) -> Vec<(f64, f64)> {
        let mut points = Vec::with_capacity(2 * self.stretches.len());
        for Stretch { low, high, .. } in &self.stretches {
            let (first, second) = if low.0 <= high.0 {
                (low, high)
            } else {
                (high, low)
            };
            points.push((first.0 as f64 * 1e-9, first.1));
            if first != second {
                points.push((second.0 as f64 * 1e-9, second.1));
            }
        }
        points
    }

    /// Smallest and largest value.
    pub(super) fn range(&self) -> Option<(f64, f64)> {
        let low = self.stretches.iter().map(|s| s.low.1).reduce(f64::min)?;
        let high = self.stretches.iter().map(|s| s.high.1).reduce(f64::max)?;
        Some((low, high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_signal_is_kept_as_it_is() {
        let mut thin = Thin::default();
        for ms in 0..500_u64 {
            thin.push(ms * 2_000_000, ms as f64);
        }
        let points = thin.points();
        assert_eq!(points.len(), 500);
        assert_eq!((points[499].1, thin.range()), (499.0, Some((0.0, 499.0))));
    }

    #[test]
    fn of_ten_minutes_no_peak_is_lost_and_time_rises() {
        let mut thin = Thin::default();
        for i in 0..300_000_u64 {
            let value = match i {
                123_457 => 9.0,
                222_222 => -7.0,
                _ => 0.0,
            };
            thin.push(i * 2_000_000, value);
        }
        let points = thin.points();
        assert!(
            points.len() <= 2 * MOST && points.len() > MOST / 2,
            "{}",
            points.len()
        );
        assert!(points.windows(2).all(|pair| pair[0].0 <= pair[1].0));
        for (t, value) in [(246.914, 9.0), (444.444, -7.0)] {
            let found = points
                .iter()
                .any(|p| (p.0 - t).abs() < 1e-9 && p.1 == value);
            assert!(found, "{value} at {t} s");
        }
        assert_eq!(thin.range(), Some((-7.0, 9.0)));
    }

    #[test]
    fn any_times_are_taken() {
        let mut thin = Thin::default();
        for t_ns in [5, u64::MAX / 2, 4, u64::MAX, u64::MAX, 0] {
            thin.push(t_ns, 1.0);
        }
        for i in 0..10_000_u64 {
            thin.push(u64::MAX, i as f64);
        }
        assert_eq!(thin.points().len(), 4);
        assert!(Thin::default().points().is_empty() && Thin::default().range().is_none());
    }
}
