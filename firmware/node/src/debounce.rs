//! Debounce of up to eight switches: a bit changes after the raw level has differed from it for a number of consecutive
//! ticks.
//!
//! The delay is exactly `ticks` samples in both directions, so that lift and touchdown are delayed equally and step
//! lengths are not biased.

/// Largest number of samples.
const MOST: u8 = 7;

/// All ones if `ticks` has the bit, else zero.
const fn plane(ticks: u8, bit: u8) -> u8 {
    if ticks & bit == 0 { 0 } else { u8::MAX }
}

/// Debounced state of up to eight switches, one bit each.
///
/// The eight counters are stored bit-sliced: bit n of the three planes is the counter of switch n, so that all of them
/// count in one pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Debounce<const TICKS: u8> {
    state: u8,
    planes: [u8; 3],
}

impl<const TICKS: u8> Default for Debounce<TICKS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const TICKS: u8> Debounce<TICKS> {
    /// All ones where the number of samples has a one bit.
    const TARGET: [u8; 3] = {
        assert!(TICKS >= 1 && TICKS <= MOST, "1 to 7 samples");
        [plane(TICKS, 1), plane(TICKS, 2), plane(TICKS, 4)]
    };

    /// Switches that must be stable for `TICKS` samples, 1…7; all off.
    pub const fn new() -> Self {
        Self {
            state: 0,
            planes: [0; 3],
        }
    }

    /// Takes one sample of the raw levels and returns the debounced ones.
    #[inline]
    pub fn sample(&mut self, raw: u8) -> u8 {
        let changed = raw ^ self.state;
        if changed == 0 {
            self.planes = [0; 3];
            return self.state;
        }
        let [ones, twos, fours] = self.planes;
        // Where the level differs, the counter increases by one; elsewhere it is zero.
        let ones_up = !ones & changed;
        let twos_up = (twos ^ ones) & changed;
        let fours_up = (fours ^ (ones & twos)) & changed;
        let [one, two, four] = Self::TARGET;
        let reached = !((ones_up ^ one) | (twos_up ^ two) | (fours_up ^ four)) & changed;
        self.state ^= reached;
        self.planes = [ones_up & !reached, twos_up & !reached, fours_up & !reached];
        self.state
    }

    /// A tick in which the levels could not be read: samples on either side of it are not consecutive.
    pub fn missed(&mut self) {
        self.planes = [0; 3];
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
    fn samples_on_both_sides_of_an_unreadable_one_are_not_in_a_row() {
        let mut switches = Debounce::<3>::new();
        switches.sample(1);
        switches.sample(1);
        switches.missed();
        assert_eq!([1, 1, 1].map(|raw| switches.sample(raw)), [0, 0, 1]);
        switches.missed();
        assert_eq!(switches.state(), 1);
    }

    #[test]
    fn change_takes_exactly_three_samples_both_ways() {
        let mut switches = Debounce::<3>::new();
        assert_eq!(
            [0b0001, 0b0001, 0b0001, 0b0000, 0b0000, 0b0000].map(|raw| switches.sample(raw)),
            [0, 0, 1, 1, 1, 0]
        );
    }

    #[test]
    fn every_number_of_samples_is_counted_to_the_last() {
        fn count<const TICKS: u8>() {
            let mut switches = Debounce::<TICKS>::new();
            for level in [0xFF, 0x00] {
                for sample in 1..=TICKS {
                    let expected = if sample == TICKS { level } else { !level };
                    assert_eq!(switches.sample(level), expected, "{sample} of {TICKS}");
                }
            }
        }
        count::<1>();
        count::<2>();
        count::<3>();
        count::<4>();
        count::<5>();
        count::<6>();
        count::<7>();
    }

    #[test]
    fn chatter_shorter_than_three_samples_is_ignored() {
        let mut switches = Debounce::<3>::new();
        for raw in [1, 1, 0, 1, 1, 0, 1, 0, 1, 1, 0] {
            assert_eq!(switches.sample(raw), 0);
        }
    }

    #[test]
    fn switches_are_independent() {
        let mut switches = Debounce::<2>::new();
        assert_eq!(switches.sample(0b1000_0001), 0);
        assert_eq!(switches.sample(0b1000_0010), 0b1000_0000);
        assert_eq!(switches.sample(0b0000_0010), 0b1000_0010);
        assert_eq!(switches.sample(0b0000_0010), 0b0000_0010);
    }
}
