//! Converts between processor cycles and the simulator's nanoseconds.

const SECOND_NS: i64 = 1_000_000_000;

/// The clock has had frequency `hz` since `cycle`, which was at `ns`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Time {
    cycle: u64,
    ns: i64,
    hz: u64,
}

impl Time {
    /// Begins with cycle 0 at 0 ns.
    pub(crate) fn new(hz: u64) -> Self {
        Self {
            cycle: 0,
            ns: 0,
            hz,
        }
    }

    /// Clock frequency [Hz].
    pub(crate) fn hz(&self) -> u64 {
        self.hz
    }

    /// Time since the last change of the clock, as of `cycle` [ns].
    pub(crate) fn steady_ns(&self, cycle: u64) -> u64 {
        cycle.saturating_sub(self.cycle) * SECOND_NS as u64 / self.hz
    }

    /// Changes the clock frequency.
    pub(crate) fn clock(&mut self, cycle: u64, hz: u64) {
        self.ns = self.signed_ns(cycle);
        self.cycle = cycle;
        self.hz = hz;
    }

    /// Sets the time of `cycle` to `ns`; returns how far the scale moved.
    pub(crate) fn align(&mut self, cycle: u64, ns: u64) -> i64 {
        let moved = ns as i64 - self.signed_ns(cycle);
        self.cycle = cycle;
        self.ns = ns as i64;
        moved
    }

    /// Time of a cycle, negative before time zero [ns].
    pub(crate) fn signed_ns(&self, cycle: u64) -> i64 {
        let cycles = cycle as i64 - self.cycle as i64;
        let (whole, rest) = (cycles / self.hz as i64, cycles % self.hz as i64);
        // The rest is below a second, so the product is below 2^30 · 2^30.
        self.ns + whole * SECOND_NS + rest * SECOND_NS / self.hz as i64
    }

    /// Time of a cycle, 0 before time zero [ns].
    pub(crate) fn ns_of(&self, cycle: u64) -> u64 {
        self.signed_ns(cycle).max(0) as u64
    }

    /// The first cycle not before `ns`.
    pub(crate) fn cycle_of(&self, ns: u64) -> u64 {
        let ahead = ns as i64 - self.ns;
        let (whole, rest) = (ahead.div_euclid(SECOND_NS), ahead.rem_euclid(SECOND_NS));
        let hz = self.hz as i64;
        let cycles = whole * hz + (rest * hz + SECOND_NS - 1) / SECOND_NS;
        (self.cycle as i64 + cycles).max(0) as u64
    }

    /// Cycles in `ns` nanoseconds.
    pub(crate) fn cycles(&self, ns: u64) -> u64 {
        (u128::from(ns) * u128::from(self.hz) / 1_000_000_000) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn microseconds_are_whole_cycles_at_170_mhz_and_alignment_is_exact() {
        let mut time = Time::new(16_000_000);
        assert_eq!(time.ns_of(16), 1_000);
        time.clock(1_600, 170_000_000);
        assert_eq!(time.ns_of(1_770), 101_000);
        time.align(5_000, 0);
        assert_eq!(time.cycle_of(3_000), 5_510);
        assert_eq!(time.ns_of(5_510), 3_000);
        assert_eq!(time.ns_of(4_000), 0, "before time zero");
        assert_eq!(time.cycles(22_588), 3_839);
    }
}
