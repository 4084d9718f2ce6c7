//! Reset and clock control, power control, the external interrupt of the voltage detector, and the
//! independent watchdog.

use super::Refusal;
use super::clock::Range;

/// Internal oscillator [Hz].
pub(crate) const HSI_HZ: u64 = 16_000_000;
/// Crystal of the board [Hz].
const HSE_HZ: u64 = 24_000_000;
/// Low-speed oscillator, nominal [Hz].
const LSI_HZ: u64 = 32_000;

const HSION: u32 = 1 << 8;
const HSIRDY: u32 = 1 << 10;
const HSEON: u32 = 1 << 16;
const HSERDY: u32 = 1 << 17;
const CSSON: u32 = 1 << 19;
const PLLON: u32 = 1 << 24;
const PLLRDY: u32 = 1 << 25;

/// Reset flags of RCC_CSR.
pub(crate) const PIN_RESET: u32 = 1 << 26;
/// Brown-out or power-on.
pub(crate) const BROWN_OUT_RESET: u32 = 1 << 27;
pub(crate) use wheeleg_remote_link::{SOFTWARE_RESET, WATCHDOG_RESET};
const RMVF: u32 = 1 << 23;

/// Clock tree.
#[derive(Debug, Clone)]
pub(crate) struct Rcc {
    cr: u32,
    cfgr: u32,
    pllcfgr: u32,
    cier: u32,
    /// Flag of the clock security system.
    cssf: bool,
    csr: u32,
    /// Enable bits of AHB1, AHB2, APB1-1, APB2.
    pub(crate) enr: [u32; 4],
    /// The crystal oscillates.
    pub(crate) crystal: bool,
}

impl Rcc {
    pub(crate) fn new(crystal: bool, cause: u32) -> Self {
        Self {
            cr: HSION | HSIRDY,
            cfgr: 1 << 2 | 1,
            pllcfgr: 0x1000,
            cier: 0,
            cssf: false,
            csr: cause,
            // The flash interface is on after a reset.
            enr: [1 << 8, 0, 0, 0],
            crystal,
        }
    }

    /// The crystal stops. With the clock security system, the processor continues on the internal oscillator
    /// and is notified. Returns whether this is the case.
    pub(crate) fn crystal_stops(&mut self) -> bool {
        let watched = self.cr & CSSON != 0 && self.ready() & HSERDY != 0;
        self.crystal = false;
        if watched {
            self.cr &= !(HSEON | PLLON);
            self.cfgr = 1 << 2 | 1;
            self.cssf = true;
        }
        watched
    }

    fn pll_hz(&self) -> u64 {
        let source = match self.pllcfgr & 3 {
            2 => HSI_HZ,
            3 => HSE_HZ,
            _ => 0,
        };
        let m = u64::from(self.pllcfgr >> 4 & 0xF) + 1;
        let n = u64::from(self.pllcfgr >> 8 & 0x7F);
        let r = (u64::from(self.pllcfgr >> 25 & 3) + 1) * 2;
        source / m * n / r
    }

    /// System clock [Hz].
    pub(crate) fn system_hz(&self) -> u64 {
        match self.cfgr & 3 {
            2 => HSE_HZ,
            3 => self.pll_hz(),
            _ => HSI_HZ,
        }
    }

    /// Processor clock [Hz].
    pub(crate) fn hclk_hz(&self) -> u64 {
        let system = self.system_hz();
        match self.cfgr >> 4 & 0xF {
            n @ 8..=11 => system >> (n - 7),
            n @ 12..=15 => system >> (n - 6),
            _ => system,
        }
    }

    /// Whether the selected source of the system clock is running.
    fn runs(&self, choice: u32) -> bool {
        let ready = self.ready();
        match choice & 3 {
            1 => true,
            2 => ready & HSERDY != 0,
            3 => ready & PLLRDY != 0,
            _ => false,
        }
    }

    /// The control register with its ready flags.
    fn ready(&self) -> u32 {
        let mut cr = self.cr & !(HSERDY | PLLRDY);
        let hse = cr & HSEON != 0 && self.crystal;
        if hse {
            cr |= HSERDY;
        }
        let fed = if self.pllcfgr & 3 == 3 { hse } else { true };
        if cr & PLLON != 0 && fed {
            cr |= PLLRDY;
        }
        cr
    }

    /// Whether the buses run at the processor's clock, as the timers here assume.
    pub(crate) fn buses_undivided(&self) -> bool {
        self.cfgr >> 8 & 0x3F == 0
    }

    pub(crate) fn read(&self, offset: usize) -> Result<u32, Refusal> {
        Ok(match offset {
            0x00 => self.ready(),
            0x08 => self.cfgr & !(3 << 2) | (self.cfgr & 3) << 2,
            0x0C => self.pllcfgr,
            0x18 => self.cier,
            0x1C => u32::from(self.cssf) << 8,
            0x48 => self.enr[0],
            0x4C => self.enr[1],
            0x58 => self.enr[2],
            0x60 => self.enr[3],
            0x88 => 0,
            0x94 => self.csr | (self.csr & 1) << 1,
            _ => return Err(Refusal::Register),
        })
    }

    pub(crate) fn write(&mut self, offset: usize, value: u32) -> Result<(), Refusal> {
        let only = |mask: u32| Refusal::beyond(mask, value);
        match offset {
            0x00 => {
                only(HSION | HSIRDY | HSEON | HSERDY | CSSON | PLLON | PLLRDY)?;
                self.cr = value | HSIRDY;
                // The clock on which the processor runs may not be removed either.
                if !self.runs(self.cfgr) {
                    return Err(Refusal::Bits(value));
                }
            }
            0x08 => {
                // The processor would stop on a clock that is not running.
                if !self.runs(value) {
                    return Err(Refusal::Bits(value & 3));
                }
                self.cfgr = value;
            }
            // Not while the PLL is on (RM0440, RCC_PLLCFGR).
            0x0C if self.cr & PLLON != 0 => return Err(Refusal::Bits(value)),
            0x0C => self.pllcfgr = value,
            0x18 => self.cier = value,
            0x20 => self.cssf &= value & 1 << 8 == 0,
            0x48 => self.enr[0] = value,
            0x4C => self.enr[1] = value,
            0x58 => self.enr[2] = value,
            0x60 => self.enr[3] = value,
            // Other clocks for serial ports and converter are not modelled.
            0x88 => only(0)?,
            0x94 => {
                if value & RMVF != 0 {
                    self.csr &= 1;
                }
                self.csr = self.csr & !1 | value & 1;
            }
            _ => return Err(Refusal::Register),
        }
        Ok(())
    }
}

/// Power control and the external interrupt of the voltage detector.
#[derive(Debug, Clone)]
pub(crate) struct Pwr {
    cr1: u32,
    cr2: u32,
    cr3: u32,
    cr5: u32,
    imr: u32,
    rtsr: u32,
    ftsr: u32,
    pr: u32,
    /// The supply is below the detector's threshold.
    pub(crate) low: bool,
}

const PVD_LINE: u32 = 1 << 16;
/// Voltage range of the core: 1 or 2.
const VOS: u32 = 3 << 9;
const VOS_RANGE_1: u32 = 1 << 9;
const VOS_RANGE_2: u32 = 2 << 9;
/// Internal wake-up line, on after reset; dead-battery resistors of USB-C off.
const EIWUL: u32 = 1 << 15;
const UCPD1_DBDIS: u32 = 1 << 14;
/// Range 1 without boost.
const R1MODE: u32 = 1 << 8;

impl Default for Pwr {
    fn default() -> Self {
        Self {
            cr1: 0x200,
            cr2: 0,
            cr3: EIWUL,
            cr5: 0x100,
            imr: 0,
            rtsr: 0,
            ftsr: 0,
            pr: 0,
            low: false,
        }
    }
}

impl Pwr {
    /// The supply crosses the detector's threshold.
    pub(crate) fn supply(&mut self, low: bool) {
        let detector = self.cr2 & 1 != 0;
        let rising = low && !self.low && self.rtsr & PVD_LINE != 0;
        let falling = !low && self.low && self.ftsr & PVD_LINE != 0;
        if detector && (rising || falling) {
            self.pr |= PVD_LINE;
        }
        self.low = low;
    }

    /// Whether the detector reports a low supply.
    pub(crate) fn detects(&self) -> bool {
        self.low && self.cr2 & 1 != 0
    }

    /// Whether the dead-battery resistors are disconnected from the pins.
    pub(crate) fn dead_battery_is_off(&self) -> bool {
        self.cr3 & UCPD1_DBDIS != 0
    }

    /// Voltage range of the core, which is ready immediately.
    pub(crate) fn range(&self) -> Range {
        match (self.cr1 & VOS == VOS_RANGE_1, self.cr5 & R1MODE != 0) {
            (true, false) => Range::Boost,
            (true, true) => Range::Normal,
            (false, _) => Range::Low,
        }
    }

    /// Interrupt line of the detector.
    pub(crate) fn line(&self) -> bool {
        self.pr & self.imr & PVD_LINE != 0
    }

    pub(crate) fn read(&self, offset: usize) -> Result<u32, Refusal> {
        Ok(match offset {
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x08 => self.cr3,
            // The regulators are ready immediately; this is the detector's flag.
            0x14 => u32::from(self.low && self.cr2 & 1 != 0) << 11,
            0x80 => self.cr5,
            _ => return Err(Refusal::Register),
        })
    }

    pub(crate) fn write(&mut self, offset: usize, value: u32) -> Result<(), Refusal> {
        match offset {
            0x00 if [VOS_RANGE_1, VOS_RANGE_2].contains(&value) => self.cr1 = value,
            0x00 => return Err(Refusal::Bits(value)),
            0x04 if value & !0xF == 0 => self.cr2 = value,
            0x08 => {
                Refusal::beyond(EIWUL | UCPD1_DBDIS, value)?;
                self.cr3 = value;
            }
            0x80 => {
                Refusal::beyond(R1MODE, value)?;
                self.cr5 = value;
            }
            _ => return Err(Refusal::Register),
        }
        Ok(())
    }

    pub(crate) fn read_exti(&self, offset: usize) -> Result<u32, Refusal> {
        Ok(match offset {
            0x00 => self.imr,
            0x08 => self.rtsr,
            0x0C => self.ftsr,
            0x14 => self.pr,
            _ => return Err(Refusal::Register),
        })
    }

    pub(crate) fn write_exti(&mut self, offset: usize, value: u32) -> Result<(), Refusal> {
        match offset {
            0x00 => self.imr = value,
            0x08 => self.rtsr = value,
            0x0C => self.ftsr = value,
            0x14 => self.pr &= !value,
            _ => return Err(Refusal::Register),
        }
        Ok(())
    }
}

/// Independent watchdog. Once started, only a reset stops it.
#[derive(Debug, Clone)]
pub(crate) struct Watchdog {
    open: bool,
    prescaler: u32,
    reload: u32,
    /// When it was last fed [ns], if it runs; negative before time zero.
    fed_ns: Option<i64>,
    /// Whether it has been fed since the last query.
    fed: bool,
}

impl Default for Watchdog {
    fn default() -> Self {
        Self {
            open: false,
            prescaler: 0,
            reload: 0xFFF,
            fed_ns: None,
            fed: false,
        }
    }
}

impl Watchdog {
    fn timeout_ns(&self) -> u64 {
        let divider = 4_u64 << self.prescaler.min(6);
        (u64::from(self.reload) + 1) * divider * 1_000_000_000 / LSI_HZ
    }

    /// When it expires [ns].
    pub(crate) fn bites_at_ns(&self) -> Option<u64> {
        let at = self.fed_ns? + self.timeout_ns() as i64;
        Some(at.max(0) as u64)
    }

    /// Whether it has been fed since the last call: the program feeds it at the end of a tick's work.
    pub(crate) fn take_fed(&mut self) -> bool {
        std::mem::take(&mut self.fed)
    }

    /// Moves the time scale by `ns`.
    pub(crate) fn shift(&mut self, ns: i64) {
        self.fed_ns = self.fed_ns.map(|fed| fed + ns);
    }

    pub(crate) fn read(&self, offset: usize) -> Result<u32, Refusal> {
        Ok(match offset {
            0x04 => self.prescaler,
            0x08 => self.reload,
            0x0C => 0,
            _ => return Err(Refusal::Register),
        })
    }

    pub(crate) fn write(&mut self, offset: usize, value: u32, now_ns: i64) -> Result<(), Refusal> {
        match (offset, value) {
            (0x00, 0xCCCC) => self.fed_ns = self.fed_ns.or(Some(now_ns)),
            (0x00, 0x5555) => self.open = true,
            (0x00, 0xAAAA) => {
                self.open = false;
                self.fed = true;
                if self.fed_ns.is_some() {
                    self.fed_ns = Some(now_ns);
                }
            }
            (0x04, _) if self.open => self.prescaler = value & 7,
            (0x08, _) if self.open => self.reload = value & 0xFFF,
            (0x00 | 0x04 | 0x08, _) => return Err(Refusal::Bits(value)),
            _ => return Err(Refusal::Register),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_oscillators_give_170_mhz_and_a_dead_crystal_is_not_ready() {
        let mut rcc = Rcc::new(true, 0);
        assert_eq!(rcc.hclk_hz(), HSI_HZ);
        rcc.write(0x00, HSION | HSEON).expect("modelled");
        assert_ne!(rcc.read(0x00).expect("modelled") & HSERDY, 0);
        rcc.write(0x0C, 3 | 5 << 4 | 85 << 8 | 1 << 24)
            .expect("modelled");
        assert!(rcc.write(0x08, 3 | 8 << 4).is_err(), "the PLL is off");
        rcc.write(0x00, HSION | HSEON | PLLON).expect("modelled");
        rcc.write(0x08, 3 | 8 << 4).expect("modelled");
        assert_eq!(rcc.hclk_hz(), 85_000_000);
        rcc.write(0x08, 3).expect("modelled");
        assert_eq!(rcc.hclk_hz(), 170_000_000);
        let mut internal = Rcc::new(false, 0);
        internal
            .write(0x0C, 2 | 3 << 4 | 85 << 8 | 1 << 24)
            .expect("modelled");
        internal.write(0x00, HSION | PLLON).expect("modelled");
        internal.write(0x08, 3).expect("modelled");
        assert_eq!(internal.hclk_hz(), 170_000_000);
        rcc.crystal = false;
        assert_eq!(rcc.read(0x00).expect("modelled") & HSERDY, 0);
        assert!(rcc.write(0x08, 2).is_err(), "a dead crystal gives no clock");
    }

    #[test]
    fn an_unfed_watchdog_bites_after_its_time() {
        let mut dog = Watchdog::default();
        assert_eq!(dog.bites_at_ns(), None);
        dog.write(0x00, 0xCCCC, 5).expect("modelled");
        assert!(dog.write(0x04, 1, 5).is_err(), "closed");
        dog.write(0x00, 0x5555, 5).expect("modelled");
        dog.write(0x04, 1, 5).expect("modelled");
        dog.write(0x08, 399, 5).expect("modelled");
        dog.write(0x00, 0xAAAA, 1000).expect("modelled");
        assert_eq!(dog.bites_at_ns(), Some(1000 + 100_000_000));
        dog.write(0x00, 0xCCCC, 2000).expect("modelled");
        assert_eq!(
            dog.bites_at_ns(),
            Some(1000 + 100_000_000),
            "cannot be stopped"
        );
    }

    #[test]
    fn reset_flags_stay_until_they_are_removed() {
        let mut rcc = Rcc::new(true, WATCHDOG_RESET | PIN_RESET);
        rcc.write(0x94, 1).expect("modelled");
        assert_eq!(rcc.read(0x94), Ok(WATCHDOG_RESET | PIN_RESET | 3));
        rcc.write(0x94, 1 | RMVF).expect("modelled");
        assert_eq!(rcc.read(0x94), Ok(3));
    }
}
