//! Updates, matches and captures: how a timer acts on others, and others on it.

use super::{AOE, Event, MOE, Tim};

impl Tim {
    pub(super) fn listens_to_update(&self) -> bool {
        let update_trigger = self.cr2 >> 4 & 7 == 2;
        let one_pulse = self.cr1 & 8 != 0;
        self.dier & 0x101 != 0 || update_trigger || one_pulse
    }

    pub(super) fn listens_to_match(&self, channel: usize) -> bool {
        let output = self.ccmr_of(channel) & 3 == 0;
        let compare_pulse = channel == 0 && self.cr2 >> 4 & 7 == 3;
        output && (self.dier >> (1 + channel) & 0x101 != 0 || compare_pulse)
    }

    pub(super) fn match_at(&self, channel: usize) -> Option<u64> {
        if !self.runs() || !self.listens_to_match(channel) {
            return None;
        }
        let distance = u64::from(self.ccr_now[channel].wrapping_sub(self.base) & self.top());
        let at = self.since + distance * self.divider();
        if at > self.seen {
            return Some(at);
        }
        // A free-running counter reaches the value again after its whole range.
        (self.arr_now == self.top()).then(|| at + (u64::from(self.top()) + 1) * self.divider())
    }

    /// The next event that has a consequence, and its cycle.
    pub(crate) fn next(&self) -> Option<(u64, Event)> {
        if !self.runs() {
            return None;
        }
        let (mut next, mut end) = (None, u64::MAX);
        if self.arr_now != self.top() || self.listens_to_update() {
            let overflow = self.overflow_at();
            if self.listens_to_update() {
                next = overflow.map(|at| (at, Event::Update));
            }
            // If the counter reloads, a match beyond the overflow comes only after it.
            if self.arr_now != self.top() {
                end = overflow.unwrap_or(u64::MAX);
            }
        }
        for channel in 0..4 {
            if let Some(at) = self.match_at(channel)
                && at < end
                && next.is_none_or(|n| (at, Event::Match(channel)) < n)
            {
                next = Some((at, Event::Match(channel)));
            }
        }
        next
    }

    /// Carries out an event at its cycle.
    pub(crate) fn happen(&mut self, cycle: u64, event: Event) {
        self.seen = cycle;
        match event {
            Event::Update => {
                self.set_count(0, cycle);
                self.update();
                if self.cr1 & 8 != 0 {
                    self.cr1 &= !1;
                }
            }
            Event::Match(channel) => self.sr |= 2 << channel,
        }
    }

    /// Loads all preloaded registers.
    pub(super) fn update(&mut self) {
        self.psc_now = self.psc;
        self.arr_now = self.arr;
        self.ccr_now = self.ccr;
        self.sr |= 1;
        if self.bdtr & AOE != 0 && self.sr & 1 << 7 == 0 {
            self.bdtr |= MOE;
        }
    }

    /// Whether an update triggers others.
    pub(crate) fn triggers_on_update(&self) -> bool {
        self.cr2 >> 4 & 7 == 2
    }

    /// Whether a match of channel 1 triggers others.
    pub(crate) fn triggers_on_match(&self) -> bool {
        self.cr2 >> 4 & 7 == 3
    }

    /// Handles a trigger on internal input `itr`: captures, or starts a one-shot.
    pub(crate) fn trigger(&mut self, itr: u32, cycle: u64) {
        if self.smcr >> 4 & 7 != itr || self.smcr & (3 << 20) != 0 {
            return;
        }
        if self.smcr & 7 == 6 && !self.runs() {
            self.cr1 |= 1;
            self.since = cycle;
            self.seen = cycle;
        }
        for channel in 0..4 {
            let captures = self.ccmr_of(channel) & 3 == 3 && self.ccer >> (4 * channel) & 1 != 0;
            if captures {
                self.ccr[channel] = self.count(cycle);
                self.ccr_now[channel] = self.ccr[channel];
                self.sr |= 2 << channel;
            }
        }
    }

    /// Whether this is a one-pulse timer waiting for trigger `itr`.
    pub(crate) fn waits_for(&self, itr: u32) -> bool {
        self.smcr & 7 == 6 && self.smcr >> 4 & 7 == itr && !self.runs()
    }

    /// Interrupt line.
    pub(crate) fn line(&self) -> bool {
        self.sr & self.dier & 0x1F != 0
    }

    /// Whether the DMA request of a channel is enabled.
    pub(crate) fn dma_request(&self, channel: usize) -> bool {
        self.dier >> (9 + channel) & 1 != 0
    }
}
