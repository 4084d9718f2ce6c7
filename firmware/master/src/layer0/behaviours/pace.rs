//! The wheels of a walk, at the pace that the behaviours allow.
//!
//! If no foot carries load, the torque of the wheels is what holds the nose up: wheels that are held keep it up, and
//! legs that extend do not reach the ground. So the wheels go back until a foot carries load.
//!
//! Layer 1 provides the position that the wheels should have. Travel that the behaviours withhold is given up, not
//! caught up. While layer 1 is late the wheels continue as before, and slow down if it stays away; the distance covered
//! in the meantime is not taken back.

use fixed::types::I16F16;
use wheeleg_units::{PositionMm, VelocityMmS};

use crate::setpoint::{TravelSetpoint, WHEELS, WheelTravel};

/// Change of a wheel's speed per cycle while the pace changes: 0.3 m/s².
const STEP_MM_S: I16F16 = I16F16::lit("3");
/// Wheels that give way do so at this speed …
const BACK_MM_S: I16F16 = I16F16::lit("50");
/// … and by this much, mm: with blocked wheels the chassis turns about them by 30 degrees.
const BACK_MM: I16F16 = I16F16::lit("80");
/// How often they do so is counted over half a metre.
const COUNTED_MM: I16F16 = I16F16::lit("500");
/// Bus cycle, s.
const CYCLE_S: I16F16 = I16F16::lit("0.01");

/// The pace of the wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pace {
    segment: Option<u16>,
    /// Travel as last provided by layer 1.
    told_mm: [PositionMm; WHEELS],
    /// Travel that was commanded to the wheels, and its speed, mm/s.
    led_mm: [PositionMm; WHEELS],
    led_mm_s: [I16F16; WHEELS],
    /// Layer 1 provided nothing in the last cycle.
    late: bool,
    share: I16F16,
    wish: I16F16,
    /// Whether the wheels should give way, at which speed they do, mm/s, and by how much they have, mm.
    gives_way: bool,
    back_mm_s: I16F16,
    back_mm: I16F16,
    /// How often they have given way, and the travel since the first time, mm.
    gave: u8,
    since_mm: I16F16,
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
            gives_way: false,
            back_mm_s: I16F16::ZERO,
            back_mm: I16F16::ZERO,
            gave: 0,
            since_mm: I16F16::ZERO,
        }
    }
}

impl Pace {
    /// The wheels' share of the walk's speed.
    pub(super) const fn share(&self) -> I16F16 {
        self.share
    }

    /// The wanted share, 0 to 1.
    pub(super) fn wish(&mut self, share: I16F16) {
        self.wish = share;
    }

    /// Whether the wheels should give way, because their torque holds the nose up.
    pub(super) fn give_way(&mut self, gives_way: bool) {
        if gives_way && !self.gives_way {
            self.gave = self.gave.saturating_add(1);
        }
        self.gives_way = gives_way;
    }

    /// How often the wheels have given way over the last half metre.
    pub(super) const fn gave_way(&self) -> u8 {
        self.gave
    }

    /// Restarts the count.
    pub(super) fn forget(&mut self) {
        self.gave = 0;
    }

    /// Adds the wheels' travel of a cycle, mm, which counts from the first time that they gave way.
    fn count_way(&mut self, step_mm: I16F16) {
        self.since_mm = match self.gave {
            0 => I16F16::ZERO,
            _ => self.since_mm.saturating_add(step_mm),
        };
        if self.since_mm >= COUNTED_MM {
            self.gave = 0;
        }
    }

    /// How far the wheels go back in a cycle, mm.
    pub(super) fn back_mm(&self) -> PositionMm {
        PositionMm::new(self.back_mm_s.saturating_mul(CYCLE_S))
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
        // Before the share is updated: wheels stop before they go back.
        let goes_back = self.back_mm_s > I16F16::ZERO;
        self.slew_back(walks);
        if walks {
            self.slew(&travel, goes_back);
        } else {
            self.share = I16F16::ONE;
            self.gave = 0;
        }
        let back_mm = self.back_mm();
        let mut way_mm = I16F16::ZERO;
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
            let step = step.saturating_sub(back_mm);
            let half = step.get().saturating_mul(I16F16::lit("0.5"));
            way_mm = way_mm.saturating_add(half);
            *led = led.saturating_add(step);
            let ahead = wheel.target_mm.saturating_sub(wheel.travel_mm);
            wheel.travel_mm = *led;
            wheel.target_mm = led.saturating_add(ahead);
            if self.share != I16F16::ONE {
                wheel.velocity_mm_s = VelocityMmS::new(speed.saturating_mul(self.share));
            }
            *led_mm_s = wheel.velocity_mm_s.get();
            wheel.velocity_mm_s = VelocityMmS::new(led_mm_s.saturating_sub(self.back_mm_s));
        }
        self.count_way(way_mm);
        out
    }

    /// Brings the speed at which the wheels give way as close to the wanted one as their acceleration allows.
    fn slew_back(&mut self, walks: bool) {
        let stopped = self.share == I16F16::ZERO;
        let goes = walks && stopped && self.gives_way && self.back_mm < BACK_MM;
        self.back_mm_s = if goes {
            self.back_mm_s.saturating_add(STEP_MM_S).min(BACK_MM_S)
        } else {
            self.back_mm_s.saturating_sub(STEP_MM_S).max(I16F16::ZERO)
        };
        self.back_mm = if self.gives_way {
            let step = self.back_mm_s.saturating_mul(CYCLE_S);
            self.back_mm.saturating_add(step)
        } else {
            I16F16::ZERO
        };
    }

    /// Brings the share as close to the wish as the acceleration of the wheels allows, whatever layer 1 does with their
    /// speed meanwhile.
    fn slew(&mut self, travel: &TravelSetpoint, goes_back: bool) {
        if self.share == I16F16::ONE && self.wish == I16F16::ONE {
            // Nothing is withheld: layer 1 has its own limits.
            return;
        }
        let (mut least, mut most) = (I16F16::ZERO, I16F16::ONE);
        for (wheel, led) in travel.wheels.iter().zip(self.led_mm_s) {
            let [slowest, fastest] = shares(wheel, led);
            least = least.max(slowest);
            most = most.min(fastest);
        }
        // If two wheels disagree, the lower share wins.
        let wish = if goes_back { I16F16::ZERO } else { self.wish };
        self.share = wish.max(least).min(most);
    }
}

/// Shares of a wheel's speed, 0 to 1, that are within [`STEP_MM_S`] of its last commanded speed.
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
