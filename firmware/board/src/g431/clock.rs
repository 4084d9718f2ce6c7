//! System clock: 170 MHz from the crystal, or from the internal oscillator when
//! the crystal does not start.

use super::pac;
use pac::flash::vals::Latency;
use pac::pwr::vals::Vos;
use pac::rcc::vals::{Hpre, Pllm, Plln, Pllr, Pllsrc, Sw};

/// Core, bus and timer clock, Hz.
pub const CLOCK_HZ: u32 = 170_000_000;
/// Crystal, Hz (ASSUMED; the Nucleo-G431RB has the same).
const HSE_HZ: u32 = 24_000_000;
/// Internal oscillator, Hz (DATASHEET).
const HSI_HZ: u32 = 16_000_000;

const _: () = {
    // PLLN 85 and PLLR 2 for both sources; 4 MHz at the phase detector.
    assert!(HSE_HZ / 6 * 85 / 2 == CLOCK_HZ);
    assert!(HSI_HZ / 4 * 85 / 2 == CLOCK_HZ);
};

/// Polls of HSERDY before giving up on the crystal: about 20 ms at 16 MHz, ten times its usual start-up time.
const HSE_POLLS: u32 = 40_000;
/// Polls of any other ready flag; the watchdog ends what never gets ready.
const POLLS: u32 = 1_000_000;

/// Where the clock comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// 24 MHz crystal.
    Crystal,
    /// Internal oscillator, −1.9 to +1.6 % over 0 to 85 °C (DATASHEET): enough to be heard and to report the
    /// fault, not to keep to a slot (`wheeleg_node::time`).
    Internal,
}

fn wait(polls: u32, ready: impl Fn() -> bool) -> bool {
    (0..polls).any(|_| ready())
}

/// Brings the clock from 16 MHz after reset to 170 MHz.
pub fn start() -> Source {
    let rcc = pac::RCC;
    rcc.apb1enr1().modify(|r| r.set_pwren(true));
    // The dead-battery resistors of USB-C: 5.1 kΩ from PB6, the bus transmitter, to ground
    // while PA9 is high, and PB4 with PA10. They are on after a reset (RM0440 §6.4.3).
    pac::PWR.cr3().modify(|r| r.set_ucpd1_dbdis(true));
    // Voltage range 1, boost mode: needed above 150 MHz (RM0440 §6.1.5).
    pac::PWR.cr1().modify(|r| r.set_vos(Vos::RANGE1));
    // R1MODE is bit 8 and the only one there; 0 is boost (RM0440, PWR_CR5). The register crate has it in bit
    // 0.
    pac::PWR.cr5().write_value(pac::pwr::regs::Cr5(0));
    wait(POLLS, || !pac::PWR.sr2().read().vosf());

    rcc.cr().modify(|r| r.set_hseon(true));
    let source = if wait(HSE_POLLS, || rcc.cr().read().hserdy()) {
        Source::Crystal
    } else {
        rcc.cr().modify(|r| r.set_hseon(false));
        Source::Internal
    };
    rcc.pllcfgr().write(|r| {
        match source {
            Source::Crystal => {
                r.set_pllsrc(Pllsrc::HSE);
                r.set_pllm(Pllm::DIV6);
            }
            Source::Internal => {
                r.set_pllsrc(Pllsrc::HSI);
                r.set_pllm(Pllm::DIV4);
            }
        }
        r.set_plln(Plln::MUL85);
        r.set_pllr(Pllr::DIV2);
        r.set_pllren(true);
    });
    rcc.cr().modify(|r| {
        r.set_pllon(true);
        // A crystal that stops later raises the NMI, which resets the board.
        r.set_csson(source == Source::Crystal);
    });
    wait(POLLS, || rcc.cr().read().pllrdy());

    pac::FLASH.acr().modify(|r| {
        r.set_latency(Latency::WS4);
        r.set_prften(true);
        r.set_icen(true);
        r.set_dcen(true);
    });
    wait(POLLS, || pac::FLASH.acr().read().latency() == Latency::WS4);
    // Above 80 MHz through half the frequency for at least 1 µs (RM0440 §7.2.7).
    rcc.cfgr().write(|r| {
        r.set_sw(Sw::PLL1_R);
        r.set_hpre(Hpre::DIV2);
    });
    wait(POLLS, || rcc.cfgr().read().sws() == Sw::PLL1_R);
    cortex_m::asm::delay(CLOCK_HZ / 1_000_000);
    rcc.cfgr().modify(|r| r.set_hpre(Hpre::DIV1));
    source
}

/// Clocks of the peripherals that both kinds of board use.
pub fn enable_common() {
    let rcc = pac::RCC;
    rcc.ahb1enr().modify(|r| {
        r.set_dma1en(true);
        r.set_dmamux1en(true);
    });
    rcc.apb1enr1().modify(|r| r.set_tim2en(true));
    rcc.apb2enr().modify(|r| {
        r.set_syscfgen(true);
        r.set_tim1en(true);
        r.set_tim15en(true);
        r.set_usart1en(true);
    });
    // The last clock is on after a read of its register.
    let _ = rcc.apb2enr().read();
}

/// Clock of the converter.
pub fn enable_joint() {
    let rcc = pac::RCC;
    rcc.ahb2enr().modify(|r| r.set_adc12en(true));
    let _ = rcc.ahb2enr().read();
}

/// Clocks of motor and encoder timers.
pub fn enable_wheel() {
    let rcc = pac::RCC;
    rcc.apb1enr1().modify(|r| r.set_tim3en(true));
    rcc.apb2enr().modify(|r| r.set_tim8en(true));
    let _ = rcc.apb2enr().read();
}

/// Clocks of the serial line and the microsecond counter.
#[cfg(feature = "hil")]
pub fn enable_hil() {
    let rcc = pac::RCC;
    rcc.apb2enr().modify(|r| r.set_syscfgen(true));
    rcc.apb1enr1().modify(|r| {
        r.set_tim2en(true);
        r.set_usart2en(true);
    });
    let _ = rcc.apb1enr1().read();
}
