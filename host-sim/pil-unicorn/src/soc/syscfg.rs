//! System configuration: sources of the timers' breaks other than their pins (RM0440 §10.2.8).

use super::{Refusal, Soc, TIM1, TIM8, TIM15};

const CFGR2: usize = 0x1C;
const CLL: u32 = 1;
const SPL: u32 = 1 << 1;
const PVDL: u32 = 1 << 2;
const ECCL: u32 = 1 << 3;
const SPF: u32 = 1 << 8;

/// A source that can raise the breaks of all timers at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BreakSource {
    /// The processor has locked up.
    LockUp,
    /// RAM has a parity error.
    RamParity,
    /// The supply is below the level of the voltage detector.
    Supply,
    /// The crystal has stopped.
    Crystal,
}

/// The registers that the images use.
#[derive(Debug, Clone, Default)]
pub(crate) struct Syscfg {
    /// Connections, which only a reset removes, and the flag of the parity error.
    cfgr2: u32,
}

impl Syscfg {
    pub(crate) fn read(&self, offset: usize) -> Result<u32, Refusal> {
        match offset {
            CFGR2 => Ok(self.cfgr2),
            _ => Err(Refusal::Register),
        }
    }

    pub(crate) fn write(&mut self, offset: usize, value: u32) -> Result<(), Refusal> {
        if offset != CFGR2 {
            return Err(Refusal::Register);
        }
        Refusal::beyond(CLL | SPL | PVDL | ECCL | SPF, value)?;
        self.cfgr2 &= !(value & SPF);
        self.cfgr2 |= value & (CLL | SPL | PVDL | ECCL);
        Ok(())
    }

    /// Whether a source is connected.
    fn connects(&self, source: BreakSource) -> bool {
        match source {
            BreakSource::LockUp => self.cfgr2 & CLL != 0,
            BreakSource::RamParity => self.cfgr2 & SPL != 0,
            BreakSource::Supply => self.cfgr2 & PVDL != 0,
            BreakSource::Crystal => true,
        }
    }
}

impl Soc {
    /// Raises the breaks if this source is connected.
    pub(crate) fn raise_break(&mut self, source: BreakSource) {
        if source == BreakSource::RamParity {
            self.syscfg.cfgr2 |= SPF;
        }
        if self.syscfg.connects(source) {
            for timer in [TIM1, TIM8, TIM15] {
                self.tim[timer].system_break();
            }
        }
    }

    /// The crystal stops; returns whether the processor is notified.
    pub(crate) fn crystal_stops(&mut self, cycle: u64) -> bool {
        let stops = self.rcc.crystal_stops();
        if stops {
            self.time.clock(cycle, self.rcc.hclk_hz());
            self.plan_bite();
            self.raise_break(BreakSource::Crystal);
        }
        stops
    }

    /// The supply falls below the level of the voltage detector.
    pub(crate) fn supply_sags(&mut self) {
        self.pwr.supply(true);
        if self.pwr.detects() {
            self.raise_break(BreakSource::Supply);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::soc::flash::STORE_SIZE;

    const TIM1_BASE: u32 = 0x4001_2C00;
    const BDTR: u32 = TIM1_BASE + 0x44;
    const MOE: u32 = 1 << 15;
    const BKE: u32 = 1 << 12;

    /// A part with the outputs of TIM1 on, the break enabled and `cfgr2` written.
    fn running(cfgr2: u32) -> Soc {
        let mut soc = Soc::new(vec![0xFF; STORE_SIZE], [0; 12], true, 0);
        soc.rcc.enr[3] = 1 | 1 << 11;
        soc.write(0x4001_001C, 4, cfgr2, 0).expect("modelled");
        soc.write(BDTR, 4, MOE | BKE, 0).expect("modelled");
        soc
    }

    #[test]
    fn a_connected_source_takes_the_outputs_away_and_another_does_not() {
        for (source, connection) in [
            (BreakSource::LockUp, CLL),
            (BreakSource::RamParity, SPL),
            (BreakSource::Supply, PVDL),
        ] {
            for connected in [true, false] {
                let mut soc = running(if connected { connection } else { 0 });
                soc.raise_break(source);
                let on = soc.read(BDTR, 4, 0).expect("modelled") & MOE != 0;
                assert_eq!(on, !connected, "{source:?}");
                // Not while the break flag is set.
                soc.write(BDTR, 4, MOE | BKE, 0).expect("modelled");
                let on = soc.read(BDTR, 4, 0).expect("modelled") & MOE != 0;
                assert_eq!(on, !connected, "{source:?}");
            }
        }
    }

    #[test]
    fn a_connection_stays_until_a_reset_and_the_parity_flag_until_it_is_written() {
        let mut soc = running(CLL | PVDL);
        soc.write(0x4001_001C, 4, 0, 0).expect("modelled");
        assert_eq!(soc.read(0x4001_001C, 4, 0), Ok(CLL | PVDL));
        soc.raise_break(BreakSource::RamParity);
        assert_eq!(soc.read(0x4001_001C, 4, 0), Ok(CLL | PVDL | SPF));
        soc.write(0x4001_001C, 4, SPF, 0).expect("modelled");
        assert_eq!(soc.read(0x4001_001C, 4, 0), Ok(CLL | PVDL));
    }
}
