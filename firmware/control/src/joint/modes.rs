//! The usual laws: on/off, P, PID, and sliding mode on seven valve modes.
//!
//! ```text
//! e = reference − measured              ė = reference velocity − velocity
//! on/off    u = sign e
//! P         u = Kp e + Kf · reference velocity
//! PID       u = Kp e + Ki ∫e + Kd ė + Kf · reference velocity
//! sliding   s = e + T ė
//!           |s| ≤ settle band: hold
//!           |s| ≤ error scale: one valve, which vents the counter chamber, or fills it to brake
//!           else: push or pull, by the sign of s
//! ```
//!
//! Source: textbook laws; seven-mode sliding control after Hodgson, Le, Tavakoli and Pham, Mechatronics 22 (2012). Its
//! two bounds on s are ASSUMED to be those of rest and of the fuzzy correction.
//!
//! Assumes: a velocity with little noise ([`crate::paper::velocity`]), and a period much shorter than the move.

use super::config::JointGains;
use super::types::Law;
use crate::valve::{ValveMode, ValveOpenings};
use wheeleg_units::{Duty, Micros, PositionMm, VelocityMmS, saturate_i32, shift_right_round};

/// From gain (24) × position or velocity (16) fractional bits to duty (30).
const PHYSICAL_SHIFT: u32 = 24 + 16 - 30;

/// u × 2^30 of the on/off, P and PID laws; for the sliding law that of the on/off law, for the record. `integral` is Σ
/// e in raw mm × ticks.
#[inline]
pub(super) fn law(
    gains: &JointGains,
    error: PositionMm,
    error_rate: VelocityMmS,
    reference_velocity: VelocityMmS,
    integral: i64,
    tick: Micros,
) -> i64 {
    let product = |a: i32, b: i32| i64::from(a).wrapping_mul(i64::from(b));
    match gains.law {
        Law::OnOff | Law::Sliding => {
            let full = i64::from(Duty::ONE.raw());
            match error.raw() {
                0 => 0,
                e if e > 0 => full,
                _ => full.wrapping_neg(),
            }
        }
        _ => {
            let mut sum = product(gains.proportional.to_bits(), error.raw()).wrapping_add(product(
                gains.feed_forward.to_bits(),
                reference_velocity.raw(),
            ));
            if gains.law == Law::Pid {
                // |integral| < 2^26 mm s raw × 10^4 ticks; converted to mm s by the tick in s × 2^30, at most 2^21.
                let tick_s = i64::from(tick.get()).wrapping_mul(1074);
                let area = shift_right_round(integral.wrapping_mul(tick_s), 30);
                let area = i64::from(saturate_i32(area));
                sum = sum
                    .wrapping_add(product(gains.derivative.to_bits(), error_rate.raw()))
                    .wrapping_add(i64::from(gains.integral.to_bits()).wrapping_mul(area));
            }
            shift_right_round(sum, PHYSICAL_SHIFT)
        }
    }
}

/// One of seven valve modes, chosen by the surface s = e + T ė.
///
/// Inside the settle band nothing opens. Up to the error scale one valve acts: the counter chamber is vented to drive,
/// and filled to brake. Beyond that the mode is push or pull. Openings are whole periods: a mode is held until it
/// changes.
#[inline]
pub(super) fn sliding(
    gains: &JointGains,
    error: PositionMm,
    error_rate: VelocityMmS,
    velocity: VelocityMmS,
) -> ValveOpenings {
    let time = i64::from(gains.sliding_time.get());
    // mm/s raw × µs to mm raw: / 10^6 = × 4295 / 2^32.
    let lead = i64::from(error_rate.raw())
        .wrapping_mul(time)
        .wrapping_mul(4295)
        .wrapping_shr(32);
    let surface = i64::from(error.raw()).wrapping_add(lead);
    let size = surface.wrapping_abs();
    let out = surface > 0;
    let brakes = (velocity.raw() > 0) != out && velocity.raw() != 0;
    let mode = if size <= i64::from(gains.settle_band.raw()) {
        ValveMode::Hold
    } else if size <= i64::from(gains.error_scale.raw()) {
        match (out, brakes) {
            (true, false) => ValveMode::VentB,
            (true, true) => ValveMode::FillA,
            (false, false) => ValveMode::VentA,
            (false, true) => ValveMode::FillB,
        }
    } else if out {
        ValveMode::Push
    } else {
        ValveMode::Pull
    };
    mode.openings(gains.pwm_period)
}
