//! TIM3: quadrature counter of the wheel, extended to 24 bits.

use super::{latch, pac};
use pac::timer::vals::{CcmrInputCcs, FilterValue, Sms};
use wheeleg_node::hardware::Encoder;
use wheeleg_units::WheelCount;

/// Sets the counter up; it stands still until [`start`].
pub(super) fn configure() -> WheelEncoder {
    let tim = pac::TIM3;
    tim.arr().write(|r| r.set_arr(u16::MAX));
    tim.ccmr_input(0).write(|r| {
        for channel in 0..2 {
            // TI1 on channel 1, TI2 on channel 2; eight equal samples, 47 ns.
            r.set_ccs(channel, CcmrInputCcs::TI4);
            r.set_icf(channel, FilterValue::FCK_INT_N8);
        }
    });
    // A inverted: B before A counts up, as on the HCTL-1100.
    tim.ccer()
        .write(|r| r.set_ccp(0, cfg!(not(feature = "mutant-encoder"))));
    tim.smcr().write(|r| r.set_sms(Sms::ENCODER_MODE_3));
    WheelEncoder
}

/// Counts from 0 on: together with the sample timer, so that the first sample holds only the counts of one
/// sample and not those of the start-up.
pub(super) fn start() {
    let tim = pac::TIM3;
    tim.cnt().write(|r| r.set_cnt(0));
    tim.cr1().modify(|r| r.set_cen(true));
}

/// The counter at a tick edge.
#[inline]
pub(super) fn raw() -> u16 {
    pac::TIM3.cnt().read().cnt()
}

/// The wheel's 24-bit count. A sample must bring fewer than 32 768 counts; at
/// full speed it brings about 150.
#[derive(Debug)]
pub struct WheelEncoder;

impl Encoder for WheelEncoder {
    fn count(&mut self, before: WheelCount) -> WheelCount {
        // Both began at 0: the low 16 bits of the count are the counter's.
        let Some(raw) = latch::sample() else {
            return before;
        };
        let counts = raw.wrapping_sub(before.get() as u16) as i16;
        WheelCount::wrapping_new(before.get().wrapping_add(i32::from(counts)))
    }
}
