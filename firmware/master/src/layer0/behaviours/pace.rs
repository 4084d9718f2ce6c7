//! The wheels of a walk at the pace that the behaviours allow.
//!
//! Layer 1 tells where the wheels should be; what they are held back by is given up, not made up
//! for. Where layer 1 is late the wheels go on as they did, and slow down when it stays away.

use fixed::types::I16F16;
use wheeleg_units::{PositionMm, VelocityMmS};

use crate::setpoint::{TravelSetpoint, WHEELS};

/// Change of speed in a cycle: 0.3 m/s².
const STEP_MM_S: I16F16 = I16F16::lit("3");
/// Bus cycle, s.
const CYCLE_S: I16F16 = I16F16::lit("0.01");

/// The pace of the wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pace {
    segment: Option<u16>,
    /// Travel that layer 1 has told last, or would have.
    told_mm: [PositionMm; WHEELS],
    /// Travel that the wheels were led.
    led_mm: [PositionMm; WHEELS],
    share: I16F16,
    wish: I16F16,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            segment: None,
            told_mm: [PositionMm::ZERO; WHEELS],
            led_mm: [PositionMm::ZERO; WHEELS],
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
        let mut out = travel;
        let places = self.told_mm.iter_mut().zip(&mut self.led_mm);
        for (wheel, (told, led)) in out.wheels.iter_mut().zip(places) {
            let speed = wheel.velocity_mm_s.get();
            let step = if fresh || !walks {
                let step = wheel.travel_mm.saturating_sub(*told);
                *told = wheel.travel_mm;
                step
            } else {
                let step = PositionMm::new(speed.saturating_mul(CYCLE_S));
                *told = told.saturating_add(step);
                step
            };
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
        }
        out
    }

    /// Brings the share nearer to the wish, by what the acceleration allows at this speed.
    fn slew(&mut self, travel: &TravelSetpoint) {
        let speed =
            |wheel: &crate::setpoint::WheelTravel| wheel.velocity_mm_s.get().saturating_abs();
        let fastest = travel.wheels.iter().map(speed).fold(STEP_MM_S, I16F16::max);
        let step = STEP_MM_S.checked_div(fastest).unwrap_or(I16F16::ONE);
        let away = self.wish.saturating_sub(self.share);
        let change = away.clamp(I16F16::ZERO.saturating_sub(step), step);
        self.share = self.share.saturating_add(change);
    }
}
