//! Checks that the part can run at its clock, given its wait states, its core voltage and the steps of the
//! change. A real part would read wrong instructions from its flash memory, or none.

use super::Soc;

/// Voltage range of the core (RM0440 section 6.1.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Range {
    /// Range 1, boost mode.
    Boost,
    /// Range 1, normal mode.
    Normal,
    /// Range 2.
    Low,
}

const MHZ: u64 = 1_000_000;
/// A system clock above this must be divided for 1 µs before the processor may run at full speed (RM0440
/// section 7.2.7).
const STEP_ABOVE_HZ: u64 = 80 * MHZ;
const STEP_NS: u64 = 1_000;

impl Range {
    /// The clock that the flash memory supports per wait state, and the maximum clock [Hz] (RM0440 table 29).
    const fn limits_hz(self) -> (u64, u64) {
        match self {
            Self::Boost => (34 * MHZ, 170 * MHZ),
            Self::Normal => (30 * MHZ, 150 * MHZ),
            Self::Low => (12 * MHZ, 26 * MHZ),
        }
    }
}

impl Soc {
    /// Checks that the part supports its present clock; otherwise returns why not.
    pub(super) fn bears_its_clock(&self) -> Result<(), String> {
        let (system, processor) = (self.rcc.system_hz(), self.rcc.hclk_hz());
        let (range, waits) = (self.pwr.range(), self.flash.wait_states());
        let (each, most) = range.limits_hz();
        let in_mhz = |hz: u64| hz.div_ceil(MHZ);
        if system > most {
            return Err(format!(
                "{} MHz at a core voltage for {} MHz ({range:?})",
                in_mhz(system),
                in_mhz(most)
            ));
        }
        let followed = each * (waits + 1);
        if processor > followed {
            return Err(format!(
                "{} MHz with {waits} wait states of the flash memory, which follows {} MHz \
                 ({range:?})",
                in_mhz(processor),
                in_mhz(followed)
            ));
        }
        Ok(())
    }

    /// Whether the processor's clock may change from its present value to `hz` at `cycle`.
    pub(super) fn may_step(&self, hz: u64, cycle: u64) -> bool {
        let present = self.time.hz();
        let divided = hz < self.rcc.system_hz();
        let through_half = 2 * present >= hz && self.time.steady_ns(cycle) >= STEP_NS;
        hz <= STEP_ABOVE_HZ || divided || hz <= present || through_half
    }
}

#[cfg(test)]
mod tests {
    use crate::soc::Soc;
    use crate::soc::flash::STORE_SIZE;

    const CR: u32 = 0x4002_1000;
    const CFGR: u32 = 0x4002_1008;
    const PLLCFGR: u32 = 0x4002_100C;
    const APB1ENR1: u32 = 0x4002_1058;
    const ACR: u32 = 0x4002_2000;
    const PWR_CR1: u32 = 0x4000_7000;
    const PWR_CR5: u32 = 0x4000_7080;

    /// The board's sequence to 170 MHz: from 16 MHz at cycle 0, to the divided clock.
    const WAY: [(u32, u32); 8] = [
        (APB1ENR1, 1 << 28),
        (PWR_CR1, 1 << 9),
        (PWR_CR5, 0),
        (CR, 1 << 8 | 1 << 16),
        (PLLCFGR, 3 | 5 << 4 | 85 << 8 | 1 << 24),
        (CR, 1 << 8 | 1 << 16 | 1 << 24),
        (ACR, 0x0004_0704),
        (CFGR, 3 | 8 << 4),
    ];

    /// Runs the sequence with each write changed by `change`, which omits a write by returning `None`, then
    /// switches to the full clock after `steady` cycles at half of it.
    fn go(
        change: impl Fn(u32, u32) -> Option<u32>,
        steady: u64,
        further: &[(u32, u32)],
    ) -> Result<(), String> {
        let mut soc = Soc::new(vec![0xFF; STORE_SIZE], [0; 12], true, 0);
        for (register, value) in WAY {
            if let Some(value) = change(register, value) {
                soc.write(register, 4, value, 1_000)?;
            }
        }
        let at = 1_000 + steady;
        soc.write(CFGR, 4, 3, at)?;
        for (register, value) in further {
            soc.write(*register, 4, *value, at + 1_000)?;
        }
        Ok(())
    }

    /// The sequence without the writes to `register`, or with another value in them.
    fn other(register: u32, value: Option<u32>) -> Result<(), String> {
        go(|r, v| if r == register { value } else { Some(v) }, 85, &[])
    }

    #[test]
    fn full_speed_takes_four_wait_states_boost_and_a_microsecond_at_half_of_it() {
        go(|_, value| Some(value), 85, &[]).expect("the board's way");
        let refused = [
            (other(ACR, None), "wait states"),
            (other(ACR, Some(0x0004_0703)), "wait states"),
            (other(PWR_CR5, None), "core voltage"),
            (other(PWR_CR5, Some(1 << 8)), "core voltage"),
            (other(PWR_CR1, Some(2 << 9)), "core voltage"),
            (other(CFGR, None), "through half"),
            (go(|_, value| Some(value), 84, &[]), "through half"),
        ];
        for (number, (result, word)) in refused.into_iter().enumerate() {
            let why = result.expect_err("refused");
            assert!(why.contains(word), "{number}: {why}");
        }
    }

    #[test]
    fn what_a_running_clock_lives_on_stays() {
        for (register, value) in [
            (ACR, 0x0004_0703),
            (PWR_CR1, 2 << 9),
            (PWR_CR5, 1 << 8),
            (CR, 1 << 8 | 1 << 16),
            (CR, 1 << 8 | 1 << 24),
            (PLLCFGR, 3 | 5 << 4 | 80 << 8 | 1 << 24),
        ] {
            let done = go(|_, v| Some(v), 85, &[(register, value)]);
            assert!(done.is_err(), "{register:#x} = {value:#x}");
        }
        // Going down again takes no particular steps.
        let down = [(CFGR, 1), (CR, 1 << 8), (ACR, 0x0004_0700)];
        go(|_, value| Some(value), 85, &down).expect("16 MHz needs none of it");
    }
}
