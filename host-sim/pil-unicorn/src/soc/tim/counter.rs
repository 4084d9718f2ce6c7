//! The counter: counts up at the divided clock, or in both directions in encoder mode.

use super::Tim;

impl Tim {
    /// Value of the counter at a cycle.
    pub(crate) fn count(&self, cycle: u64) -> u32 {
        if self.encoder_mode() {
            // Both edges of both signals count. Inverting A reverses the direction: A leading B counts up,
            // and forward is B before A.
            let moved = self.edges.wrapping_sub(self.edges_base);
            let up = if self.ccer & 2 != 0 {
                moved
            } else {
                moved.wrapping_neg()
            };
            return self.base.wrapping_add(up as u32) & self.arr_now;
        }
        if !self.runs() {
            return self.base;
        }
        let steps = (cycle.saturating_sub(self.since) / self.divider()) as u32;
        self.base.wrapping_add(steps) & self.top()
    }

    pub(super) fn encoder_mode(&self) -> bool {
        self.smcr & 7 == 3
    }

    /// After a reset of the counter, keeps the wheel where `old` last saw it.
    pub(crate) fn keep_wheel(&mut self, old: &Self) {
        self.edges = old.edges;
        self.edges_base = old.edges;
    }

    /// Sets the wheel's position, in edges since power-up.
    pub(crate) fn turn(&mut self, edges: i32) {
        self.edges = edges;
    }

    /// Starts counting with the wheel at `edges`.
    pub(crate) fn count_from(&mut self, edges: i32) {
        self.edges_base = edges;
    }

    pub(super) fn set_count(&mut self, value: u32, cycle: u64) {
        self.base = value & self.top();
        self.since = cycle;
        self.edges_base = self.edges;
    }

    /// Period of the counter in cycles.
    pub(crate) fn period_cycles(&self) -> u64 {
        (u64::from(self.arr_now) + 1) * self.divider()
    }

    /// Cycle of the next overflow.
    pub(crate) fn overflow_at(&self) -> Option<u64> {
        if !self.runs() || self.encoder_mode() {
            return None;
        }
        let reaches =
            |end: u32| self.since + (u64::from(end) + 1 - u64::from(self.base)) * self.divider();
        // Beyond its reload value, a counter continues to the end of its bits.
        if self.base <= self.arr_now {
            let at = reaches(self.arr_now);
            if at > self.seen {
                return Some(at);
            }
        }
        Some(reaches(self.top()))
    }

    /// Cycle at which a free-running counter will have `value`.
    pub(crate) fn cycle_of(&self, value: u32) -> u64 {
        self.since + u64::from(value.wrapping_sub(self.base)) * self.divider()
    }
}
