//! A clock that does not wrap, from a counter that does.

use wheeleg_units::Micros;

/// Unwraps the 32-bit microsecond counter; must be called at least every 35 min. It starts with the first instant,
/// whatever the counter shows then.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    time_us: u64,
    /// Minus the rounds of the counter in `time_us`: a flipped bit there would mean hours. One in the low word is
    /// harmless, because the counter itself corrects it.
    minus_rounds: u32,
    started: bool,
}

impl Clock {
    /// The unwrapped time of `now`.
    #[inline]
    pub fn unwrap(&mut self, now: Micros) -> u64 {
        let low = (self.time_us & 0xFFFF_FFFF) as u32;
        let step = now.get().wrapping_sub(low);
        if !self.started || now.get() < low || step > i32::MAX as u32 {
            return self.unwrap_far(now);
        }
        self.time_us = (self.time_us & !0xFFFF_FFFF) | u64::from(now.get());
        self.time_us
    }

    /// The first instant, one in the past, or one in the counter's next round.
    #[cold]
    #[inline(never)]
    fn unwrap_far(&mut self, now: Micros) -> u64 {
        if !self.started {
            self.started = true;
            self.time_us = u64::from(now.get());
        }
        let newest = self.time_us;
        // Low word of the newest time. The shorter way round is taken, so an instant slightly in the past counts as
        // past.
        let low = (newest & 0xFFFF_FFFF) as u32;
        let step = now.get().wrapping_sub(low);
        if step > i32::MAX as u32 {
            return newest.saturating_sub(u64::from(step.wrapping_neg()));
        }
        let time = newest.wrapping_add(u64::from(step));
        self.time_us = time;
        // Damage that was already there stays detectable.
        let carry = ((time >> 32) as u32).wrapping_sub((newest >> 32) as u32);
        self.minus_rounds = self.minus_rounds.wrapping_sub(carry);
        time
    }

    /// Accepts the rounds as they are, after damage to them was reported.
    #[cold]
    pub const fn mend(&mut self) {
        self.minus_rounds = ((self.time_us >> 32) as u32).wrapping_neg();
    }

    /// Whether no bit of the rounds has flipped.
    #[inline]
    pub const fn is_intact(&self) -> bool {
        ((self.time_us >> 32) as u32).wrapping_add(self.minus_rounds) == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wraps_are_counted_and_the_recent_past_stays_past() {
        let mut clock = Clock::default();
        assert_eq!(clock.unwrap(Micros(10)), 10);
        let quarter = 1_u32 << 30;
        for step in 1..=40_u64 {
            let low = (step * u64::from(quarter)) as u32;
            assert_eq!(clock.unwrap(Micros(low)), step << 30);
        }
        assert_eq!(clock.unwrap(Micros(u32::MAX)), (40 << 30) - 1);
        assert_eq!(clock.unwrap(Micros(5)), (40 << 30) + 5);
    }

    #[test]
    fn a_flipped_bit_is_seen_or_set_right_at_the_next_instant() {
        let mut clock = Clock::default();
        clock.unwrap(Micros(u32::MAX));
        let sound = clock.unwrap(Micros(1_000));
        assert_eq!((sound >> 32, clock.is_intact()), (1, true));
        for bit in 0..64 {
            let mut flipped = clock;
            flipped.time_us ^= 1 << bit;
            let next = flipped.unwrap(Micros(2_000));
            assert!(!flipped.is_intact() || next == sound + 1_000, "bit {bit}");
            flipped.mend();
            assert!(flipped.is_intact());
        }
    }

    #[test]
    fn half_a_round_ahead_is_ahead_and_more_is_behind() {
        let ahead = Micros(i32::MAX as u32 + 10);
        let mut clock = Clock::default();
        clock.unwrap(Micros(10));
        assert_eq!(clock.unwrap(ahead), u64::from(ahead.get()));
        let mut clock = Clock::default();
        clock.unwrap(Micros(10));
        assert_eq!(clock.unwrap(Micros(ahead.get() + 1)), 0);
    }

    #[test]
    fn a_counter_that_starts_in_its_upper_half_runs() {
        let mut clock = Clock::default();
        let start = 0x9000_0000_u32;
        assert_eq!(clock.unwrap(Micros(start)), u64::from(start));
        assert_eq!(
            clock.unwrap(Micros(start + 50_000)),
            u64::from(start) + 50_000
        );
    }
}
