//! TIM2, the board's microsecond clock.

use super::pac;
use wheeleg_units::Micros;

/// Divides 170 MHz to 1 MHz.
pub(super) const PRESCALER: u16 = (super::clock::CLOCK_HZ / 1_000_000 - 1) as u16;

/// The clock now: µs since the first tick edge.
#[inline]
pub fn now() -> Micros {
    Micros(pac::TIM2.cnt().read())
}

/// Sets up the clock, stopped, `lead` before time 0.
pub(super) fn configure(lead: Micros) {
    let tim2 = pac::TIM2;
    tim2.psc().write_value(PRESCALER);
    tim2.arr().write_value(u32::MAX);
    // Takes the prescaler over, clears the counter.
    tim2.egr().write(|r| r.set_ug(true));
    tim2.cnt().write_value(0_u32.wrapping_sub(lead.get()));
}

/// Starts the clock.
#[inline]
pub(super) fn start() {
    pac::TIM2.cr1().modify(|r| r.set_cen(true));
}
