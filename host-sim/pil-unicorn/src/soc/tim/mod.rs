//! Timers: TIM1, TIM2, TIM3, TIM8, TIM15.
//!
//! A counter is not stepped: its value follows from the cycle at which it had a known value. Only what has a
//! consequence is an event: an update that triggers, interrupts, reloads or stops something, and a match or
//! capture that something listens to.

mod counter;
mod events;
mod outputs;
mod registers;
#[cfg(test)]
mod tests;

/// Kind of a timer, by its abilities.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// TIM1, TIM8: complementary outputs and break.
    Advanced,
    /// TIM2: 32 bits.
    Wide,
    /// TIM3.
    General,
    /// TIM15: one channel pair and break.
    Small,
}

const MOE: u32 = 1 << 15;
const AOE: u32 = 1 << 14;
const BKP: u32 = 1 << 13;
const BKE: u32 = 1 << 12;

/// One event of a timer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Event {
    /// The counter overflowed.
    Update,
    /// The counter reached the compare value of channel 0…3.
    Match(usize),
}

/// A timer.
#[derive(Debug, Clone)]
pub(crate) struct Tim {
    kind: Kind,
    pub(crate) cr1: u32,
    cr2: u32,
    smcr: u32,
    pub(crate) dier: u32,
    pub(crate) sr: u32,
    ccmr: [u32; 2],
    ccer: u32,
    psc: u32,
    psc_now: u32,
    pub(crate) arr: u32,
    arr_now: u32,
    pub(crate) ccr: [u32; 4],
    ccr_now: [u32; 4],
    bdtr: u32,
    af1: u32,
    /// The counter had the value `base` at cycle `since`.
    base: u32,
    since: u64,
    /// Events up to this cycle have been handled.
    seen: u64,
    /// Quadrature edges since power-up, as the plant counts them (encoder mode).
    edges: i32,
    edges_base: i32,
    /// The counter value that the program read last.
    pub(crate) counted: u32,
}

impl Tim {
    pub(crate) fn new(kind: Kind) -> Self {
        let top = if kind == Kind::Wide { u32::MAX } else { 0xFFFF };
        Self {
            kind,
            cr1: 0,
            cr2: 0,
            smcr: 0,
            dier: 0,
            sr: 0,
            ccmr: [0; 2],
            ccer: 0,
            psc: 0,
            psc_now: 0,
            arr: top,
            arr_now: top,
            ccr: [0; 4],
            ccr_now: [0; 4],
            bdtr: 0,
            // The break pin is a source after reset.
            af1: 1,
            base: 0,
            since: 0,
            seen: 0,
            edges: 0,
            edges_base: 0,
            counted: 0,
        }
    }

    fn top(&self) -> u32 {
        if self.kind == Kind::Wide {
            u32::MAX
        } else {
            0xFFFF
        }
    }

    /// Whether the counter runs.
    pub(crate) fn runs(&self) -> bool {
        self.cr1 & 1 != 0
    }

    fn divider(&self) -> u64 {
        u64::from(self.psc_now) + 1
    }

    fn ccmr_of(&self, channel: usize) -> u32 {
        self.ccmr[channel / 2] >> (8 * (channel % 2)) & 0xFF
    }
}
