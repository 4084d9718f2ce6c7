//! TIM1's four channels: the valves.
//!
//! The HIL images are built without this module, so that no code in them can
//! drive a valve pin.

use super::inhibit::Inhibited;
use super::{pac, pins};
use embedded_hal::pwm::{ErrorType, SetDutyCycle};
use pac::timer::vals::{Bkp, Ocm, Ossi};
use wheeleg_node::hardware::FourValves;

/// Counts of one tick, 1 µs each.
const MAX: u16 = 1000;

/// One valve: channel `N` of TIM1, counted from 0.
#[derive(Debug)]
pub struct Valve<const N: usize> {
    _made_here: (),
}

impl<const N: usize> ErrorType for Valve<N> {
    type Error = Inhibited;
}

impl<const N: usize> SetDutyCycle for Valve<N> {
    fn max_duty_cycle(&self) -> u16 {
        MAX
    }

    /// Microseconds open in the next tick; more than a tick means all of it, as in the compare unit. Opening
    /// an inhibited output is an error; keeping it shut is not.
    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Inhibited> {
        pac::TIM1.ccr(N).write(|r| r.set_ccr(duty));
        if duty > 0 && !pac::TIM1.bdtr().read().moe() {
            return Err(Inhibited);
        }
        Ok(())
    }
}

/// The four valves, fill A, vent A, fill B, vent B.
#[cfg(not(feature = "mutant-valve-pins"))]
pub type Valves = FourValves<Valve<0>, Valve<1>, Valve<2>, Valve<3>>;
/// Wrong on purpose.
#[cfg(feature = "mutant-valve-pins")]
pub type Valves = FourValves<Valve<1>, Valve<0>, Valve<2>, Valve<3>>;

/// Sets up the four channels, shut, and hands them the pins. The timer's time
/// base is set up already and stands still.
pub(super) fn configure() -> Valves {
    let tim = pac::TIM1;
    for channel in 0..4 {
        tim.ccr(channel).write(|r| r.set_ccr(0));
        tim.ccmr_output(channel / 2).modify(|r| {
            r.set_ocm(channel % 2, Ocm::PWM_MODE1);
            r.set_ocpe(channel % 2, true);
        });
        tim.ccer().modify(|r| r.set_cce(channel, true));
        #[cfg(feature = "mutant-pwm-polarity")]
        tim.ccer().modify(|r| r.set_ccp(channel, true));
    }
    tim.cr1().modify(|r| r.set_arpe(true));
    tim.bdtr().write(|r| {
        r.set_bke(0, true);
        r.set_bkp(0, Bkp::ACTIVE_LOW);
        // With MOE off the pins are driven to the idle level, which is low.
        r.set_ossi(Ossi::IDLE_LEVEL);
    });
    // The compare values and the prescaler become active.
    tim.egr().write(|r| r.set_ug(true));
    pins::configure_valves();
    FourValves {
        fill_a: Valve { _made_here: () },
        vent_a: Valve { _made_here: () },
        fill_b: Valve { _made_here: () },
        vent_b: Valve { _made_here: () },
    }
}

/// Permits the outputs if all valves are shut; hardware refuses while POWER_OK
/// is low. So valves never open because power comes back.
#[inline]
pub(super) fn permit() {
    let tim = pac::TIM1;
    if !tim.bdtr().read().moe() && (0..4).all(|n| tim.ccr(n).read().ccr() == 0) {
        tim.bdtr().modify(|r| r.set_moe(true));
    }
}
