//! B5 bump: a swinging foot that runs against something.

use wheeleg_units::{PositionMm, VelocityMmS};

use super::Senses;
use crate::behaviour::{Behaviour, Behaviours};
use crate::contact::Side;
use crate::layer1::params::in_stroke;
use crate::setpoint::{Cylinder, LegPlan};

/// A reach whose cylinders are slower than this …
const STALLED_MM_S: VelocityMmS = VelocityMmS::from_int(10);
/// … for so many cycles (100 ms), …
const STALLED: u16 = 10;
/// … from so many after its begin on (250 ms), or with a switch closed from the begin on, has run
/// against something; so has a foot that touches later. A joint's board takes a longer push without
/// motion for a fault of the axis.
const STARTED: u16 = 25;
/// The foot goes back by so much …
const BACK_MM: PositionMm = PositionMm::from_int(15);
/// … for so many cycles (250 ms), in which it is lifted.
const BACK: u16 = 25;

/// The reach of a foot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Bump {
    cycles: u16,
    stalled: u16,
    met: bool,
    /// Where b5 goes back to, and for how many cycles more.
    back: Option<(PositionMm, u16)>,
}

impl Bump {
    /// It has just run against something.
    pub(super) const fn met(&self) -> bool {
        self.met
    }

    /// Reference of b5 while the foot goes back.
    pub(super) fn back_mm(&self) -> Option<PositionMm> {
        self.back.map(|(stroke, _)| stroke)
    }

    /// One cycle; `wanted_mm` is the reference of b5, `nailed` a foot with nails. Whether the foot has run against something.
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
        self.back = self.back.and_then(|(stroke, left)| {
            let left = left.checked_sub(1)?;
            (left > 0).then_some((stroke, left))
        });
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
        let pushes = touches && self.back.is_none();
        self.stalled = if (started || pushes) && slow {
            self.stalled.saturating_add(1)
        } else {
            0
        };
        self.met = self.stalled >= STALLED || started && touches;
        if self.met {
            self.stalled = 0;
            self.cycles = 0;
            let b5 = senses.joint(side, Cylinder::Horizontal).unwrap_or_default();
            let back = if wanted_mm > b5.stroke_mm {
                b5.stroke_mm.saturating_sub(BACK_MM)
            } else {
                b5.stroke_mm.saturating_add(BACK_MM)
            };
            self.back = Some((in_stroke(back), BACK));
        }
        self.met
    }
}
