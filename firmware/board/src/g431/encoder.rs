//! TIM3: quadrature counter of the wheel, extended to 24 bits.

use super::{latch, pac};
use pac::timer::vals::{CcmrInputCcs, FilterValue, Sms};
use wheeleg_node::hardware::Encoder;
use wheeleg_units::WheelCount;

/// Starts the counter at 0.
pub(super) fn start() -> WheelEncoder {
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
    tim.cnt().write(|r| r.set_cnt(0));
    tim.cr1().modify(|r| r.set_cen(true));
    WheelEncoder { last: 0, total: 0 }
}

/// The counter at a tick edge.
#[inline]
pub(super) fn raw() -> u16 {
    pac::TIM3.cnt().read().cnt()
}

/// The wheel's 24-bit count. A sample must bring fewer than 32 768 counts; at
/// full speed it brings about 150.
#[derive(Debug)]
pub struct WheelEncoder {
    last: u16,
    total: i32,
}

impl Encoder for WheelEncoder {
    fn count(&mut self) -> WheelCount {
        if let Some(raw) = latch::sample() {
            let counts = raw.wrapping_sub(self.last) as i16;
            self.last = raw;
            self.total = self.total.wrapping_add(i32::from(counts));
        }
        WheelCount::wrapping_new(self.total)
    }
}
