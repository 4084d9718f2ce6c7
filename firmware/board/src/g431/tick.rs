//! TIM1, the tick, and its time stamps from TIM2.

use super::{pac, timebase};
use pac::timer::vals::{CcmrInputCcs, Mms, Ts};
use wheeleg_units::Micros;

/// Channel 2 captures the tick edge. (Channels are counted from 0 in the
/// register crate.)
const EDGE: usize = 1;
/// Channel 3 is the deadline of the conversion.
const DEADLINE: usize = 2;

/// Time of the last tick edge, captured by hardware.
#[inline]
pub(super) fn edge() -> u32 {
    pac::TIM2.ccr(EDGE).read()
}

/// Sets up both timers, stopped; the first tick edge is at time 0.
pub(super) fn configure(period: Micros) {
    timebase::configure(period);
    let tim2 = pac::TIM2;
    tim2.smcr().write(|r| r.set_ts(Ts::ITR0));
    tim2.ccmr_input(0)
        .write(|r| r.set_ccs(EDGE, CcmrInputCcs::TRC));
    tim2.ccer().write(|r| r.set_cce(EDGE, true));
    tim2.cr2().write(|r| r.set_mms(Mms::COMPARE_PULSE));
    tim2.sr().write_value(pac::timer::regs::SrGp16(0));

    let tim1 = pac::TIM1;
    tim1.psc().write_value(timebase::PRESCALER);
    set_period(period);
    tim1.egr().write(|r| r.set_ug(true));
    tim1.cr2().modify(|r| r.set_mms(Mms::UPDATE));
}

/// Whether the tick has this period.
#[inline]
pub(super) fn runs_at(period: Micros) -> bool {
    let present = u32::from(pac::TIM1.arr().read().arr()).wrapping_add(1);
    present == period.get()
}

/// Period of the tick in µs, 2…65 536; without preload: the running period ends
/// with it.
#[inline(never)]
pub(super) fn set_period(period: Micros) {
    let last = u16::try_from(period.get().saturating_sub(1)).unwrap_or(u16::MAX);
    pac::TIM1.arr().write(|r| r.set_arr(last));
    // A counter that is already beyond the new end would run to its own end.
    if pac::TIM1.cnt().read().cnt() > last {
        pac::TIM1.egr().write(|r| r.set_ug(true));
    }
}

/// Starts both timers; TIM2 is a few processor cycles ahead, so that it has
/// counted the microsecond when TIM1 makes the edge.
pub(super) fn start() {
    cortex_m::interrupt::free(|_| {
        timebase::start();
        pac::TIM1.cr1().modify(|r| r.set_cen(true));
    });
}

/// Interrupt at every tick edge (wheel).
pub(super) fn enable_edge_interrupt() {
    pac::TIM2.dier().modify(|r| r.set_ccie(EDGE, true));
}

/// Whether this is the interrupt of the tick edge; clears it.
#[inline]
pub(super) fn take_edge_interrupt() -> bool {
    take(EDGE)
}

/// Interrupt at `time`, until [`set_deadline`] moves it.
pub(super) fn enable_deadline(time: u32) {
    set_deadline(time);
    clear(DEADLINE);
    pac::TIM2.dier().modify(|r| r.set_ccie(DEADLINE, true));
}

/// Moves the deadline.
#[inline]
pub(super) fn set_deadline(time: u32) {
    pac::TIM2.ccr(DEADLINE).write_value(time);
}

/// Whether the deadline has passed; clears the flag.
#[inline]
pub(super) fn take_deadline() -> bool {
    take(DEADLINE)
}

#[inline]
fn take(channel: usize) -> bool {
    let set = pac::TIM2.sr().read().ccif(channel);
    if set {
        clear(channel);
    }
    set
}

/// Clears one flag: writing 0 clears, and 1 has no effect.
#[inline]
fn clear(channel: usize) {
    let mut flags = pac::timer::regs::SrGp16(u32::MAX);
    flags.set_ccif(channel, false);
    pac::TIM2.sr().write_value(flags);
}
