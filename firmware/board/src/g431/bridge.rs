//! TIM8 channel 1 and one pin: the motor's H-bridge.
//!
//! The outputs of a tick wait in two words until the next tick edge, where the edge's handler passes them to
//! timer and pin.

use super::inhibit::Inhibited;
use super::{pac, pins};
use core::convert::Infallible;
use core::sync::atomic::{AtomicU32, Ordering};
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::pwm::{ErrorType, SetDutyCycle};
use pac::timer::vals::{Bkp, Ocm, Ossi};
use wheeleg_node::hardware::HBridge;

/// Counts of one PWM period: per cent, as on the HCTL-1100.
const MAX: u16 = 100;
/// 170 MHz to 2 MHz: 20 kHz.
const PRESCALER: u16 = 84;

static DUTY: AtomicU32 = AtomicU32::new(0);
/// 1 for backward.
static BACKWARD: AtomicU32 = AtomicU32::new(0);
/// The pin's state.
static SHOWN_BACKWARD: AtomicU32 = AtomicU32::new(0);

/// Magnitude, effective from the next tick edge.
#[derive(Debug)]
pub struct Pulse {
    _made_here: (),
}

impl ErrorType for Pulse {
    type Error = Inhibited;
}

impl SetDutyCycle for Pulse {
    fn max_duty_cycle(&self) -> u16 {
        MAX
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Inhibited> {
        let duty = duty.min(MAX);
        DUTY.store(u32::from(duty), Ordering::Relaxed);
        if duty > 0 && !pac::TIM8.bdtr().read().moe() {
            return Err(Inhibited);
        }
        Ok(())
    }
}

/// Direction, effective from the next tick edge; high = backward.
#[derive(Debug)]
pub struct Sign {
    _made_here: (),
}

impl digital::ErrorType for Sign {
    type Error = Infallible;
}

impl OutputPin for Sign {
    fn set_low(&mut self) -> Result<(), Infallible> {
        BACKWARD.store(0, Ordering::Relaxed);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        BACKWARD.store(1, Ordering::Relaxed);
        Ok(())
    }
}

/// The dump valve's pin; acts at once, if it is fitted.
#[derive(Debug)]
pub struct Dump {
    /// Wheel 7 has it.
    pub fitted: bool,
}

impl digital::ErrorType for Dump {
    type Error = Infallible;
}

impl OutputPin for Dump {
    fn set_low(&mut self) -> Result<(), Infallible> {
        pins::set_dump(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        pins::set_dump(self.fitted);
        Ok(())
    }
}

/// Sets up the timer, off, and hands it the pin.
pub(super) fn configure() -> HBridge<Pulse, Sign> {
    let tim = pac::TIM8;
    tim.psc().write_value(PRESCALER);
    tim.arr().write(|r| r.set_arr(MAX.saturating_sub(1)));
    tim.ccr(0).write(|r| r.set_ccr(0));
    tim.ccmr_output(0).write(|r| {
        r.set_ocm(0, Ocm::PWM_MODE1);
        r.set_ocpe(0, true);
    });
    tim.ccer().write(|r| r.set_cce(0, true));
    #[cfg(feature = "mutant-pwm-polarity")]
    tim.ccer().modify(|r| r.set_ccp(0, true));
    tim.bdtr().write(|r| {
        r.set_bke(0, true);
        r.set_bkp(0, Bkp::ACTIVE_LOW);
        r.set_ossi(Ossi::IDLE_LEVEL);
    });
    tim.egr().write(|r| r.set_ug(true));
    tim.cr1().modify(|r| r.set_cen(true));
    pins::configure_wheel();
    HBridge {
        pulse: Pulse { _made_here: () },
        sign: Sign { _made_here: () },
    }
}

/// At a tick edge: the outputs of the last tick become active. A change of direction blanks the pulse until
/// the next PWM period, against shoot-through.
#[inline]
pub(super) fn apply() {
    let tim = pac::TIM8;
    let duty = DUTY.load(Ordering::Relaxed) as u16;
    let backward = BACKWARD.load(Ordering::Relaxed);
    if backward != SHOWN_BACKWARD.load(Ordering::Relaxed) {
        tim.ccr(0).write(|r| r.set_ccr(0));
        tim.egr().write(|r| r.set_ug(true));
        pins::set_motor_backward(backward != 0);
        SHOWN_BACKWARD.store(backward, Ordering::Relaxed);
    }
    tim.ccr(0).write(|r| r.set_ccr(duty));
}

/// Enables the output while its duty is zero; hardware refuses while POWER_OK is low.
#[inline]
pub(super) fn permit() {
    let tim = pac::TIM8;
    if !tim.bdtr().read().moe() && DUTY.load(Ordering::Relaxed) == 0 {
        tim.bdtr().modify(|r| r.set_moe(true));
    }
}
