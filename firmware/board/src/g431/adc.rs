//! ADC1: one conversion of the potentiometer per tick, started by the tick edge.

use super::{latch, pac, pins, tick};
use pac::adc::vals::{Exten, Ovrmod, SampleTime};
use pac::adccommon::vals::Ckmode;
use wheeleg_node::JOINT_TICK;

/// Channel of PA0.
const CHANNEL: u8 = 1;
/// External trigger 9 is TIM1_TRGO (RM0440 §21.4.18).
const TRIGGER: u8 = 9;
/// Oversampling ratio code for 16.
const SIXTEEN: u8 = 3;
/// Time after an edge by which the conversion must be there, µs; it takes 23.
const DEADLINE_US: u32 = 100;

/// Calibrates the converter and sets it up, without a trigger yet.
pub(super) fn start() {
    pac::ADC12_COMMON
        .ccr()
        .modify(|r| r.set_ckmode(Ckmode::SYNC_DIV4));
    let adc = pac::ADC1;
    adc.cr().modify(|r| r.set_deeppwd(false));
    adc.cr().modify(|r| r.set_advregen(true));
    // The regulator needs 20 µs (DATASHEET).
    cortex_m::asm::delay(20 * (super::clock::CLOCK_HZ / 1_000_000));
    adc.cr().modify(|r| r.set_adcal(true));
    while adc.cr().read().adcal() {}
    // Four converter clocks between calibration and enabling (RM0440 §21.4.8).
    cortex_m::asm::delay(16);
    adc.isr().write(|r| r.set_adrdy(true));
    // Repeated until it is ready: so soon after a calibration the bit may be ignored.
    while !adc.isr().read().adrdy() {
        adc.cr().modify(|r| r.set_aden(true));
    }

    adc.sqr1().write(|r| r.set_sq(0, CHANNEL));
    adc.smpr()
        .write(|r| r.set_smp(usize::from(CHANNEL), SampleTime::CYCLES47_5));
    adc.cfgr2().write(|r| {
        r.set_rovse(true);
        r.set_ovsr(SIXTEEN);
        #[cfg(feature = "mutant-adc-scale")]
        r.set_ovss(1);
    });
    // The reset value: no trigger yet, and the injected queue stays off.
    adc.cfgr().write(|r| r.set_jqdis(true));
    // The first edge is at time 0.
    tick::enable_deadline(DEADLINE_US);
}

/// Converts once without a trigger, then waits for the tick edge. Called within a millisecond
/// before the first edge: a result later than that after the one before may be wrong (errata
/// sheet ES0431, read at second hand).
pub(super) fn arm() {
    let adc = pac::ADC1;
    adc.cr().modify(|r| r.set_adstart(true));
    while !adc.isr().read().eos() {}
    let _ = adc.dr().read();
    adc.isr().write(|r| r.set_eos(true));
    adc.cfgr().write(|r| {
        r.set_exten(Exten::RISING_EDGE);
        r.set_extsel(TRIGGER);
        r.set_ovrmod(Ovrmod::OVERWRITE);
        r.set_jqdis(true);
    });
    adc.ier().write(|r| r.set_eosie(true));
    adc.cr().modify(|r| r.set_adstart(true));
}

/// The end of a conversion: latches the tick.
#[inline]
pub fn on_conversion() {
    let adc = pac::ADC1;
    // Reading the result clears EOC; EOS is cleared by writing it.
    let code = adc.dr().read().rdata();
    adc.isr().write(|r| r.set_eos(true));
    let edge = tick::edge();
    tick::set_deadline(next_deadline(edge));
    latch::post(edge, Some(code), pins::port_a());
}

/// The deadline has passed without a conversion: the tick runs without it.
#[inline]
pub fn on_deadline() {
    if tick::take_deadline() {
        let edge = tick::edge();
        tick::set_deadline(next_deadline(edge));
        latch::post(edge, None, pins::port_a());
    }
}

#[inline]
fn next_deadline(edge: u32) -> u32 {
    edge.wrapping_add(JOINT_TICK.get())
        .wrapping_add(DEADLINE_US)
}
