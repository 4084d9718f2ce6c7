//! Timers: TIM1, TIM2, TIM3, TIM8, TIM15.
//!
//! A counter is not stepped: its value follows from the cycle at which it had
//! a known one. Only what has a consequence is an event: an update that
//! triggers, interrupts, reloads or stops something, and a match or capture
//! that somebody listens to.

use super::Refusal;

/// Which timer, with what it can do.
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

const CR1: usize = 0x00;
const CR2: usize = 0x04;
const SMCR: usize = 0x08;
const DIER: usize = 0x0C;
const SR: usize = 0x10;
const EGR: usize = 0x14;
const CCMR1: usize = 0x18;
const CCMR2: usize = 0x1C;
const CCER: usize = 0x20;
const CNT: usize = 0x24;
const PSC: usize = 0x28;
const ARR: usize = 0x2C;
const RCR: usize = 0x30;
const CCR1: usize = 0x34;
const CCR4: usize = 0x40;
const BDTR: usize = 0x44;

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
    /// The counter had `base` at `since`.
    base: u32,
    since: u64,
    /// Events up to this cycle have been handled.
    seen: u64,
    /// Quadrature edges since reset, as the plant counts them (encoder mode).
    edges: i32,
    edges_base: i32,
    /// The counter as the program read it last.
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

    /// The counter runs.
    pub(crate) fn runs(&self) -> bool {
        self.cr1 & 1 != 0
    }

    fn encoder_mode(&self) -> bool {
        self.smcr & 7 == 3
    }

    fn divider(&self) -> u64 {
        u64::from(self.psc_now) + 1
    }

    /// Counter at a cycle.
    pub(crate) fn count(&self, cycle: u64) -> u32 {
        if self.encoder_mode() {
            // Both edges of both signals; an inverted A turns the direction:
            // A leads B counts up, and forward is B before A.
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

    /// The wheel turned: edges since reset.
    pub(crate) fn turn(&mut self, edges: i32) {
        self.edges = edges;
    }

    fn set_count(&mut self, value: u32, cycle: u64) {
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
        // Beyond its end a counter goes on to the end of its bits.
        if self.base <= self.arr_now {
            let at = reaches(self.arr_now);
            if at > self.seen {
                return Some(at);
            }
        }
        Some(reaches(self.top()))
    }

    fn listens_to_update(&self) -> bool {
        let update_trigger = self.cr2 >> 4 & 7 == 2;
        let one_pulse = self.cr1 & 8 != 0;
        self.dier & 0x101 != 0 || update_trigger || one_pulse
    }

    fn listens_to_match(&self, channel: usize) -> bool {
        let output = self.ccmr_of(channel) & 3 == 0;
        let compare_pulse = channel == 0 && self.cr2 >> 4 & 7 == 3;
        output && (self.dier >> (1 + channel) & 0x101 != 0 || compare_pulse)
    }

    fn match_at(&self, channel: usize) -> Option<u64> {
        if !self.runs() || !self.listens_to_match(channel) {
            return None;
        }
        let distance = u64::from(self.ccr_now[channel].wrapping_sub(self.base) & self.top());
        let at = self.since + distance * self.divider();
        if at > self.seen {
            return Some(at);
        }
        // A free-running counter comes by again after its whole range.
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
            // A match beyond the overflow of a counter that reloads comes after it.
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

    /// Reload of all preloaded registers.
    fn update(&mut self) {
        self.psc_now = self.psc;
        self.arr_now = self.arr;
        self.ccr_now = self.ccr;
        self.sr |= 1;
        if self.bdtr & AOE != 0 && self.sr & 1 << 7 == 0 {
            self.bdtr |= MOE;
        }
    }

    /// Whether an update is a trigger for others.
    pub(crate) fn triggers_on_update(&self) -> bool {
        self.cr2 >> 4 & 7 == 2
    }

    /// Whether a match of channel 1 is a trigger for others.
    pub(crate) fn triggers_on_match(&self) -> bool {
        self.cr2 >> 4 & 7 == 3
    }

    /// A trigger on internal input `itr`: capture, or start of a one-shot.
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

    /// Level of the break input; an active one takes the outputs away.
    pub(crate) fn break_input(&mut self, high: bool) {
        let active = self.bdtr & BKE != 0 && high == (self.bdtr & BKP != 0);
        if active {
            self.bdtr &= !MOE;
            self.sr |= 1 << 7;
        }
    }

    fn ccmr_of(&self, channel: usize) -> u32 {
        self.ccmr[channel / 2] >> (8 * (channel % 2)) & 0xFF
    }

    fn mode_of(&self, channel: usize) -> u32 {
        let half = self.ccmr[channel / 2] >> (8 * (channel % 2));
        half >> 4 & 7 | (half >> 16 & 1) << 3
    }

    /// Counts of one period in which the pin of a channel is high.
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

    /// Counts of this timer in whole microseconds.
    pub(crate) fn micros(&self, counts: u32, hz: u64) -> u64 {
        (u64::from(counts) * self.divider() * 1_000_000 + hz / 2) / hz
    }

    /// From when to when the output of channel 1 is high in the one-shot that
    /// would start, or has started, at `start`.
    pub(crate) fn pulse(&self, start: u64) -> Option<(u64, u64)> {
        let armed = self.bdtr & MOE != 0 && self.ccer & 3 == 1 && self.mode_of(0) == 7;
        let high = start + u64::from(self.ccr[0]) * self.divider();
        armed.then(|| (high, start + self.period_cycles()))
    }

    /// Start of the one-shot that runs, or ran last.
    pub(crate) fn started_at(&self) -> u64 {
        self.since
    }

    /// One-pulse timer waiting for its trigger `itr`.
    pub(crate) fn waits_for(&self, itr: u32) -> bool {
        self.smcr & 7 == 6 && self.smcr >> 4 & 7 == itr && !self.runs()
    }

    /// Cycle at which a free-running counter will have `value`.
    pub(crate) fn cycle_of(&self, value: u32) -> u64 {
        self.since + u64::from(value.wrapping_sub(self.base)) * self.divider()
    }

    /// Interrupt line.
    pub(crate) fn line(&self) -> bool {
        self.sr & self.dier & 0x1F != 0
    }

    /// Takes the DMA request of a channel, if there is one.
    pub(crate) fn dma_request(&self, channel: usize) -> bool {
        self.dier >> (9 + channel) & 1 != 0
    }

    pub(crate) fn read(&mut self, offset: usize, cycle: u64) -> Result<u32, Refusal> {
        Ok(match offset {
            CR1 => self.cr1,
            CR2 => self.cr2,
            SMCR => self.smcr,
            DIER => self.dier,
            SR => self.sr,
            CCMR1 => self.ccmr[0],
            CCMR2 if self.kind != Kind::Small => self.ccmr[1],
            CCER => self.ccer,
            CNT => {
                self.counted = self.count(cycle);
                self.counted
            }
            PSC => self.psc,
            ARR => self.arr,
            RCR => 0,
            CCR1..=CCR4 if offset.is_multiple_of(4) => {
                let channel = (offset - CCR1) / 4;
                if self.ccmr_of(channel) & 3 != 0 {
                    // Reading a capture takes its flag away.
                    self.sr &= !(2 << channel);
                }
                self.ccr[channel]
            }
            BDTR if matches!(self.kind, Kind::Advanced | Kind::Small) => self.bdtr,
            _ => return Err(Refusal::Register),
        })
    }

    pub(crate) fn write(&mut self, offset: usize, value: u32, cycle: u64) -> Result<(), Refusal> {
        let only = |mask: u32| {
            if value & !mask == 0 {
                Ok(())
            } else {
                Err(Refusal::Bits(value & !mask))
            }
        };
        match offset {
            CR1 => {
                only(0x8D)?;
                let starts = value & 1 != 0 && !self.runs();
                let stops = value & 1 == 0 && self.runs();
                if stops {
                    let count = self.count(cycle);
                    self.set_count(count, cycle);
                }
                self.cr1 = value;
                if starts {
                    self.since = cycle;
                    self.seen = cycle;
                }
            }
            // Idle states other than low would be an output that is on without MOE.
            CR2 => {
                only(0x70)?;
                if !matches!(value >> 4 & 7, 0 | 2 | 3) {
                    return Err(Refusal::Bits(value));
                }
                self.cr2 = value;
            }
            SMCR => {
                only(0x77)?;
                if !matches!(value & 7, 0 | 3 | 6) {
                    return Err(Refusal::Bits(value));
                }
                let count = self.count(cycle);
                self.set_count(count, cycle);
                self.smcr = value;
            }
            DIER => {
                only(0x1F1F)?;
                self.dier = value;
            }
            SR => self.sr &= value,
            EGR => {
                only(1)?;
                if value & 1 != 0 {
                    self.set_count(0, cycle);
                    self.seen = cycle;
                    let quiet = self.cr1 & 4 != 0;
                    let flag = self.sr & 1;
                    self.update();
                    if quiet {
                        self.sr = self.sr & !1 | flag;
                    }
                }
            }
            CCMR1 => self.ccmr[0] = value,
            CCMR2 if self.kind != Kind::Small => self.ccmr[1] = value,
            CCER => {
                only(0x3333)?;
                let count = self.count(cycle);
                self.set_count(count, cycle);
                self.ccer = value;
            }
            CNT => {
                self.set_count(value, cycle);
                self.seen = cycle;
            }
            PSC => {
                only(0xFFFF)?;
                self.psc = value;
            }
            ARR => {
                self.arr = value & self.top();
                if self.cr1 & 0x80 == 0 {
                    self.arr_now = self.arr;
                }
            }
            RCR => only(0)?,
            CCR1..=CCR4 if offset.is_multiple_of(4) => {
                let channel = (offset - CCR1) / 4;
                self.ccr[channel] = value & self.top();
                let preload = self.ccmr_of(channel) & 8 != 0;
                // Updates that nobody listens to are no events here; they come
                // within one period, 50 µs on the motor's bridge.
                if !preload || !self.listens_to_update() {
                    self.ccr_now[channel] = self.ccr[channel];
                }
                // What lies behind is not reached again before the next round.
                self.seen = self.seen.max(cycle);
            }
            BDTR if matches!(self.kind, Kind::Advanced | Kind::Small) => {
                only(0xFFFF)?;
                let broken = self.sr & 1 << 7 != 0 && self.bdtr & BKE != 0;
                self.bdtr = if broken { value & !MOE } else { value };
            }
            _ => return Err(Refusal::Register),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick() -> Tim {
        let mut tim = Tim::new(Kind::Advanced);
        for (register, value) in [
            (PSC, 169),
            (ARR, 999),
            (CCMR1, 0x6868),
            (CCER, 0x1111),
            (CR2, 0x20),
            (EGR, 1),
            (BDTR, MOE),
            (CR1, 0x81),
        ] {
            tim.write(register, value, 0).expect("modelled");
        }
        tim
    }

    #[test]
    fn a_preloaded_compare_value_acts_from_the_next_edge() {
        let mut tim = tick();
        tim.write(CCR1, 350, 10).expect("modelled");
        assert_eq!(tim.high_counts(0), (0, 1000));
        assert_eq!(tim.next(), Some((170_000, Event::Update)));
        assert_eq!(tim.count(169_999), 999);
        tim.happen(170_000, Event::Update);
        assert_eq!(tim.high_counts(0), (350, 1000));
        tim.write(CCER, 0x1113, 170_001).expect("modelled");
        assert_eq!(tim.high_counts(0), (650, 1000), "inverted");
        tim.write(BDTR, 0, 170_001).expect("modelled");
        assert_eq!(tim.high_counts(0), (0, 1000), "main output off");
    }

    #[test]
    fn a_free_running_counter_matches_once_a_round() {
        let mut tim = Tim::new(Kind::Wide);
        tim.write(PSC, 169, 0).expect("modelled");
        tim.write(EGR, 1, 0).expect("modelled");
        tim.write(CNT, (-1000_i32) as u32, 0).expect("modelled");
        tim.write(DIER, 1 << 12, 0).expect("modelled");
        tim.write(CR1, 1, 0).expect("modelled");
        tim.write(CCR4, 5, 1).expect("modelled");
        assert_eq!(tim.next(), Some((170 * 1005, Event::Match(3))));
        assert_eq!(tim.cycle_of(5), 170 * 1005);
        assert_eq!(tim.count(170 * 1000), 0);
        tim.happen(170 * 1005, Event::Match(3));
        assert!(tim.next().is_some_and(|(at, _)| at > 1 << 39));
    }

    #[test]
    fn the_encoder_counts_both_ways_and_its_polarity_turns_it() {
        let mut tim = Tim::new(Kind::General);
        tim.write(SMCR, 3, 0).expect("modelled");
        tim.write(CCER, 2, 0).expect("modelled");
        tim.turn(5);
        assert_eq!(tim.count(0), 5);
        tim.turn(-3);
        assert_eq!(tim.count(0), 0xFFFD);
        tim.write(CCER, 0, 0).expect("modelled");
        tim.write(CNT, 0, 0).expect("modelled");
        tim.turn(0);
        assert_eq!(tim.count(0), 0xFFFD, "turned round, three back from −3");
    }

    #[test]
    fn a_one_shot_ends_itself() {
        let mut tim = Tim::new(Kind::Small);
        for (register, value) in [
            (PSC, 169),
            (ARR, 13),
            (CCR1, 1),
            (CCMR1, 0x70),
            (CCER, 1),
            (EGR, 1),
            (BDTR, MOE),
            (SMCR, 0x16),
            (CR1, 8),
        ] {
            tim.write(register, value, 0).expect("modelled");
        }
        assert!(tim.waits_for(1));
        tim.trigger(0, 1000);
        assert!(!tim.runs(), "another input");
        tim.trigger(1, 1000);
        assert_eq!(tim.pulse(tim.started_at()), Some((1170, 1000 + 14 * 170)));
        assert_eq!(tim.next(), Some((1000 + 14 * 170, Event::Update)));
        tim.happen(1000 + 14 * 170, Event::Update);
        assert!(!tim.runs());
    }
}
