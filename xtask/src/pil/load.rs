//! How much of the machine others use during a run.

use std::fs;
use std::time::Instant;

/// Ticks of a second in which Linux counts processor time for programs.
const TICKS_PER_S: f64 = 100.0;

/// Processor time so far.
pub(super) struct Meter {
    /// Of all programs, and taken by a host of this machine, ticks.
    all: u64,
    /// Of this program and those it has started and waited for, ticks.
    own: u64,
    since: Instant,
}

impl Meter {
    /// Begins; `None` if the system has no such figures.
    pub(super) fn begin() -> Option<Self> {
        Some(Self {
            all: all(&fs::read_to_string("/proc/stat").ok()?)?,
            own: own(&fs::read_to_string("/proc/self/stat").ok()?)?,
            since: Instant::now(),
        })
    }

    /// Use by others since then, in cores.
    pub(super) fn others(&self) -> Option<f64> {
        let now = Self::begin()?;
        let passed_s = self.since.elapsed().as_secs_f64();
        let used = now.all.saturating_sub(self.all);
        let own = now.own.saturating_sub(self.own);
        Some(used.saturating_sub(own) as f64 / TICKS_PER_S / passed_s.max(1e-3))
    }
}

/// The first line of /proc/stat: user, nice, system, idle, waiting, interrupts, soft
/// interrupts, stolen; guests are within user.
fn all(text: &str) -> Option<u64> {
    let line = text.lines().next()?.strip_prefix("cpu ")?;
    let numbers: Vec<u64> = line
        .split_whitespace()
        .map_while(|n| n.parse().ok())
        .collect();
    let [user, nice, system, _, _, irq, soft, stolen, ..] = numbers[..] else {
        return None;
    };
    Some(user + nice + system + irq + soft + stolen)
}

/// Fields 14 to 17 of /proc/self/stat; the name before them may hold anything.
fn own(text: &str) -> Option<u64> {
    let behind = text.rsplit_once(") ")?.1;
    let times = behind.split(' ').skip(11).map_while(|n| n.parse().ok());
    let times: Vec<u64> = times.take(4).collect();
    (times.len() == 4).then(|| times.iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn idle_time_is_nobodys_and_a_name_with_blanks_is_passed_over() {
        let stat = "cpu  100 2 30 4000 50 6 7 800 9 0\ncpu0 1 1\n";
        assert_eq!(all(stat), Some(100 + 2 + 30 + 6 + 7 + 800));
        assert_eq!(all("cpu  1 2 3\n"), None);
        let own_stat = "17 (a ) name) S 1 2 3 4 5 6 7 8 9 10 11 22 33 44 20 0";
        assert_eq!(own(own_stat), Some(11 + 22 + 33 + 44));
        assert_eq!(own("17 (short) S 1 2"), None);
    }
}
