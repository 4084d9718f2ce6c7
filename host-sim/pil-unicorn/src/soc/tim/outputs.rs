//! What a timer's pins show: pulse width, break, the pulse of a one-shot.

use super::registers::SBIF;
use super::{BKE, BKP, Kind, MOE, Tim};

impl Tim {
    /// Sets the level of the break input; an active level disables the outputs.
    pub(crate) fn break_input(&mut self, high: bool) {
        let active = self.bdtr & BKE != 0 && high == (self.bdtr & BKP != 0);
        if active {
            self.bdtr &= !MOE;
            self.sr |= 1 << 7;
        }
    }

    /// A break from within the system disables the outputs.
    pub(crate) fn system_break(&mut self) {
        if self.bdtr & BKE != 0 {
            self.bdtr &= !MOE;
            self.sr |= SBIF;
        }
    }

    pub(super) fn mode_of(&self, channel: usize) -> u32 {
        let half = self.ccmr[channel / 2] >> (8 * (channel % 2));
        half >> 4 & 7 | (half >> 16 & 1) << 3
    }

    /// The counts of one period in which a channel's pin is high, and the period.
    pub(crate) fn high_counts(&self, channel: usize) -> (u32, u32) {
        let period = self.arr_now.saturating_add(1);
        let main = !matches!(self.kind, Kind::Advanced | Kind::Small) || self.bdtr & MOE != 0;
        let enabled = self.ccer >> (4 * channel) & 1 != 0;
        if !main || !enabled || !self.runs() {
            // Idle state and disabled outputs are low (CR2.OISx = 0 is enforced).
            return (0, period);
        }
        let reference = match self.mode_of(channel) {
            6 => self.ccr_now[channel].min(period),
            7 => period - self.ccr_now[channel].min(period),
            5 => period,
            _ => 0,
        };
        let inverted = self.ccer >> (4 * channel + 1) & 1 != 0;
        (
            if inverted {
                period - reference
            } else {
                reference
            },
            period,
        )
    }

    /// Converts counts of this timer to whole microseconds.
    pub(crate) fn micros(&self, counts: u32, hz: u64) -> u64 {
        (u64::from(counts) * self.divider() * 1_000_000 + hz / 2) / hz
    }

    /// Interval in which the output of channel 1 is high in the one-shot that would start, or has started, at
    /// `start`.
    pub(crate) fn pulse(&self, start: u64) -> Option<(u64, u64)> {
        let armed = self.bdtr & MOE != 0 && self.ccer & 3 == 1 && self.mode_of(0) == 7;
        let high = start + u64::from(self.ccr[0]) * self.divider();
        armed.then(|| (high, start + self.period_cycles()))
    }

    /// Start of the current or last one-shot.
    pub(crate) fn started_at(&self) -> u64 {
        self.since
    }
}
