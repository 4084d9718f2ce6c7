//! The wheels of a walk, at the pace that the behaviours allow.
//!
//! Layer 1 gives the position that the wheels should have. Travel that the behaviours withhold is
//! given up, not caught up. While layer 1 is late the wheels continue as before, and slow down if it
//! stays away; the distance covered in the meantime is not taken back.

use fixed::types::I16F16;
use wheeleg_units::{PositionMm, VelocityMmS};

use crate::setpoint::{TravelSetpoint, WHEELS, WheelTravel};

/// Change of a wheel's speed in a cycle while the pace changes: 0.3 m/s².
const STEP_MM_S: I16F16 = I16F16::lit("3");
/// Bus cycle, s.
const CYCLE_S: I16F16 = I16F16::lit("0.01");

/// The pace of the wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pace {
    segment: Option<u16>,
    /// Travel that layer 1 has told last.
    told_mm: [PositionMm; WHEELS],
    /// Travel that the wheels were led, and at which speed, mm/s.
    led_mm: [PositionMm; WHEELS],
    led_mm_s: [I16F16; WHEELS],
    /// Layer 1 told nothing in the last cycle.
    late: bool,
    share: I16F16,
    wish: I16F16,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            segment: None,
            told_mm: [PositionMm::ZERO; WHEELS],
            led_mm: [PositionMm::ZERO; WHEELS],
            led_mm_s: [I16F16::ZERO; WHEELS],
            late: false,
            share: I16F16::ONE,
            wish: I16F16::ONE,
        }
    }
}

impl Pace {
    /// Share of the walk's speed that the wheels have.
    pub(super) const fn share(&self) -> I16F16 {
        self.share
    }

    /// The share that is wanted, 0 to 1.
    pub(super) fn wish(&mut self, share: I16F16) {
        self.wish = share;
    }

    /// References of the wheels from those of layer 1.
    pub(super) fn lead(
        &mut self,
        travel: TravelSetpoint,
        walks: bool,
        fresh: bool,
    ) -> TravelSetpoint {
        if self.segment != Some(travel.segment) {
            self.segment = Some(travel.segment);
            self.told_mm = [PositionMm::ZERO; WHEELS];
            self.led_mm = [PositionMm::ZERO; WHEELS];
        }
        if walks {
            self.slew(&travel);
        } else {
            self.share = I16F16::ONE;
        }
        let late = core::mem::replace(&mut self.late, !fresh) || !fresh;
        let mut out = travel;
        let places = self.told_mm.iter_mut().zip(&mut self.led_mm);
        let places = places.zip(&mut self.led_mm_s);
        for (wheel, ((told, led), led_mm_s)) in out.wheels.iter_mut().zip(places) {
            let speed = wheel.velocity_mm_s.get();
            let step = if late && walks {
                PositionMm::new(speed.saturating_mul(CYCLE_S))
            } else {
                wheel.travel_mm.saturating_sub(*told)
            };
            *told = wheel.travel_mm;
            let step = if self.share == I16F16::ONE {
                step
            } else {
                PositionMm::new(step.get().saturating_mul(self.share))
            };
            *led = led.saturating_add(step);
            let ahead = wheel.target_mm.saturating_sub(wheel.travel_mm);
            wheel.travel_mm = *led;
            wheel.target_mm = led.saturating_add(ahead);
            if self.share != I16F16::ONE {
                wheel.velocity_mm_s = VelocityMmS::new(speed.saturating_mul(self.share));
            }
            *led_mm_s = wheel.velocity_mm_s.get();
        }
        out
    }

    /// Brings the share as near to the wish as the acceleration of the wheels allows, whatever
    /// layer 1 makes of their speed meanwhile.
    fn slew(&mut self, travel: &TravelSetpoint) {
        if self.share == I16F16::ONE && self.wish == I16F16::ONE {
            // Nothing is held back: layer 1 has its own limits.
            return;
        }
        let (mut least, mut most) = (I16F16::ZERO, I16F16::ONE);
        for (wheel, led) in travel.wheels.iter().zip(self.led_mm_s) {
            let [slowest, fastest] = shares(wheel, led);
            least = least.max(slowest);
            most = most.min(fastest);
        }
        // Where two wheels do not agree, slowly.
        self.share = self.wish.max(least).min(most);
    }
}

/// Shares of a wheel's speed, 0 to 1, that are within [`STEP_MM_S`] of the speed that it was led at.
fn shares(wheel: &WheelTravel, led_mm_s: I16F16) -> [I16F16; 2] {
    let speed = wheel.velocity_mm_s.get();
    let (speed, led) = if speed < I16F16::ZERO {
        (speed.saturating_neg(), led_mm_s.saturating_neg())
    } else {
        (speed, led_mm_s)
    };
    let share = |mm_s: I16F16| match mm_s.checked_div(speed) {
        Some(share) if speed > STEP_MM_S => share.clamp(I16F16::ZERO, I16F16::ONE),
        // Too slow to matter.
        _ => {
            if mm_s > led {
                I16F16::ONE
            } else {
                I16F16::ZERO
            }
        }
    };
    [
        share(led.saturating_sub(STEP_MM_S)),
        share(led.saturating_add(STEP_MM_S)),
    ]
}
