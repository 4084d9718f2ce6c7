//! Debounce of up to eight switches: a bit changes after the raw level has
//! differed from it for a number of ticks in a row.
//!
//! The delay is exactly `ticks` samples in both directions, so that lift and
//! touchdown are delayed alike and step lengths are not biased.

/// Debounced state of up to eight switches, one bit each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Debounce {
    ticks: u8,
    state: u8,
    counts: [u8; 8],
}

impl Debounce {
    /// Switches that must be stable for `ticks` samples (0 acts as 1); all off.
    pub const fn new(ticks: u8) -> Self {
        Self {
            ticks: if ticks == 0 { 1 } else { ticks },
            state: 0,
            counts: [0; 8],
        }
    }

    /// Takes one sample of the raw levels and returns the debounced ones.
    pub fn sample(&mut self, raw: u8) -> u8 {
        let changed = raw ^ self.state;
        if changed == 0 {
            self.counts = [0; 8];
            return self.state;
        }
        for (bit, count) in self.counts.iter_mut().enumerate() {
            let mask = 1_u8.wrapping_shl(u32::try_from(bit).unwrap_or(0));
            if changed & mask == 0 {
                *count = 0;
                continue;
            }
            *count = count.saturating_add(1);
            if *count >= self.ticks {
                self.state ^= mask;
                *count = 0;
            }
        }
        self.state
    }

    /// Debounced levels, one bit per switch.
    pub const fn state(&self) -> u8 {
        self.state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn change_takes_exactly_three_samples_both_ways() {
        let mut switches = Debounce::new(3);
        assert_eq!(
            [0b0001, 0b0001, 0b0001, 0b0000, 0b0000, 0b0000].map(|raw| switches.sample(raw)),
            [0, 0, 1, 1, 1, 0]
        );
    }

    #[test]
    fn chatter_shorter_than_three_samples_is_ignored() {
        let mut switches = Debounce::new(3);
        for raw in [1, 1, 0, 1, 1, 0, 1, 0, 1, 1, 0] {
            assert_eq!(switches.sample(raw), 0);
        }
    }

    #[test]
    fn switches_are_independent() {
        let mut switches = Debounce::new(2);
        assert_eq!(switches.sample(0b1000_0001), 0);
        assert_eq!(switches.sample(0b1000_0010), 0b1000_0000);
        assert_eq!(switches.sample(0b0000_0010), 0b1000_0010);
        assert_eq!(switches.sample(0b0000_0010), 0b0000_0010);
    }
}
