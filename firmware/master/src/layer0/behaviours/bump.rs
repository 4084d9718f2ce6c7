//! B5 bump: a swinging foot that runs against something.

use wheeleg_units::{PositionMm, VelocityMmS};

use super::Senses;
use crate::behaviour::{Behaviour, Behaviours};
use crate::contact::Side;
use crate::layer1::params::in_stroke;
use crate::layer1::units::um_to_mm;
use crate::setpoint::{Cylinder, LegPlan};

/// A reach has run against something if its cylinders are slower than this …
const STALLED_MM_S: VelocityMmS = VelocityMmS::from_int(10);
/// … for this many cycles (100 ms), …
const STALLED: u16 = 10;
/// … starting this many cycles after its beginning (250 ms); so has a foot that touches after that time, or earlier for
/// more than [`STALLED`] cycles. b5 waits where the foot touches, because a joint's board takes a longer push without
/// motion for a fault of the axis.
const STARTED: u16 = 25;
/// The foot goes back by this much over the ground …
const BACK_MM: PositionMm = PositionMm::from_int(15);
/// … for this many cycles (250 ms), in which it is lifted and the wheels slow down; otherwise they would push it
/// against the obstacle.
const BACK: u16 = 25;

/// The reach of a foot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Bump {
    cycles: u16,
    stalled: u16,
    touched: u16,
    met: bool,
    place: Option<Place>,
    /// Remaining cycles of going back there.
    back: u16,
}

/// Where b5 waits, or to where it goes back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    /// Its stroke, if the robot were standing.
    stroke_mm: PositionMm,
    /// How far the wheel of this side has moved since, µm.
    way_um: i64,
    /// Travel of that wheel at the start, µm.
    travel_um: i64,
}

impl Bump {
    /// Whether it has just run against something.
    pub(super) const fn met(&self) -> bool {
        self.met
    }

    /// Reference of b5 while the foot waits or goes back.
    pub(super) fn place_mm(&self) -> Option<PositionMm> {
        let place = self.place?;
        Some(in_stroke(
            place.stroke_mm.saturating_sub(um_to_mm(place.way_um)),
        ))
    }

    /// One cycle; `wanted_mm` is the reference of b5, `nailed` a foot with nails. Returns whether the foot has run
    /// against something.
    pub(super) fn update(
        &mut self,
        plan: LegPlan,
        senses: &Senses,
        side: Side,
        wanted_mm: PositionMm,
        nailed: bool,
        enabled: Behaviours,
    ) -> bool {
        if plan != LegPlan::Reach || !enabled.contains(Behaviour::Bump) {
            *self = Self::default();
            return false;
        }
        self.met = false;
        let wheel = senses.wheels.get(side.index());
        let travel_um = wheel.map_or(0, |wheel| wheel.travel_um);
        self.cycles = self.cycles.saturating_add(1);
        let slow = [Cylinder::Yaw, Cylinder::Horizontal]
            .into_iter()
            .all(|cylinder| {
                let joint = senses.joint(side, cylinder).unwrap_or_default();
                joint.velocity_mm_s.saturating_abs() < STALLED_MM_S
            });
        let started = self.cycles > STARTED;
        // Tips of nails may still scratch the ground.
        let touches = !nailed && senses.touches(side).unwrap_or(false);
        let b5 = senses.joint(side, Cylinder::Horizontal).unwrap_or_default();
        let at = |stroke_mm| Place {
            stroke_mm,
            way_um: 0,
            travel_um,
        };
        if self.back > 0 {
            self.back = self.back.saturating_sub(1);
            self.place = self.place.filter(|_| self.back > 0);
        } else if touches {
            self.touched = self.touched.saturating_add(1);
            self.place.get_or_insert(at(b5.stroke_mm));
        } else {
            self.touched = 0;
            self.place = None;
        }
        if let Some(place) = &mut self.place {
            place.way_um = travel_um.saturating_sub(place.travel_um);
        }
        let pushes = touches && self.back == 0;
        self.stalled = if (started || pushes) && slow {
            self.stalled.saturating_add(1)
        } else {
            0
        };
        self.met = self.stalled >= STALLED || self.touched > STALLED || started && touches;
        if self.met {
            self.stalled = 0;
            self.touched = 0;
            self.cycles = 0;
            self.back = BACK;
            self.place = Some(at(if wanted_mm > b5.stroke_mm {
                b5.stroke_mm.saturating_sub(BACK_MM)
            } else {
                b5.stroke_mm.saturating_add(BACK_MM)
            }));
        }
        self.met
    }
}
