//! B5 bump: a swinging foot that runs against something.

use wheeleg_units::VelocityMmS;

use super::Senses;
use crate::behaviour::{Behaviour, Behaviours};
use crate::contact::Side;
use crate::setpoint::{Cylinder, LegPlan};

/// A reach whose cylinders are slower than this …
const STALLED_MM_S: VelocityMmS = VelocityMmS::from_int(10);
/// … for so many cycles (200 ms), …
const STALLED: u16 = 20;
/// … from so many after its begin on (250 ms), has run against something; so has a foot that
/// touches.
const STARTED: u16 = 25;

/// The reach of a foot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Bump {
    cycles: u16,
    stalled: u16,
    met: bool,
}

impl Bump {
    /// It has just run against something.
    pub(super) const fn met(&self) -> bool {
        self.met
    }

    /// One cycle; whether the foot has run against something.
    pub(super) fn update(
        &mut self,
        plan: LegPlan,
        senses: &Senses,
        side: Side,
        enabled: Behaviours,
    ) -> bool {
        if plan != LegPlan::Reach || !enabled.contains(Behaviour::Bump) {
            *self = Self::default();
            return false;
        }
        self.cycles = self.cycles.saturating_add(1);
        let slow = [Cylinder::Yaw, Cylinder::Horizontal]
            .into_iter()
            .all(|cylinder| {
                let joint = senses.joint(side, cylinder).unwrap_or_default();
                joint.velocity_mm_s.saturating_abs() < STALLED_MM_S
            });
        let started = self.cycles > STARTED;
        self.stalled = if started && slow {
            self.stalled.saturating_add(1)
        } else {
            0
        };
        let touches = senses.touches(side).unwrap_or(false);
        self.met = self.stalled >= STALLED || started && touches;
        if self.met {
            self.stalled = 0;
            self.cycles = 0;
        }
        self.met
    }
}
