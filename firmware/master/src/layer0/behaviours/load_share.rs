//! B10 load share: two legs that both stand should share the work equally.
//!
//! The only sign of a leg's load is the effort of its vertical cylinder: the one with the greater effort, smoothed over
//! 0.32 s, gives way, and the other follows.

use fixed::types::I16F16;
use wheeleg_units::PositionMm;

use super::{SIDES, Senses, eased};
use crate::behaviour::{Act, Behaviour, Behaviours};
use crate::setpoint::{Cylinder, LegPlan, WHEELS, WalkPlan};

/// Difference of the efforts below which they count as equal.
const ALIKE: I16F16 = I16F16::lit("0.2");
/// Number of cycles over which the effort is smoothed, as a power of two (0.32 s).
const SMOOTH: u32 = 5;
/// A leg gives way, or returns, by this much per cycle (30 mm/s for both), up to this much.
const STEP_MM: PositionMm = PositionMm::from_raw(9_830);
const FARTHEST_MM: PositionMm = PositionMm::from_int(10);

/// The legs' efforts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct LoadShare {
    effort: [I16F16; WHEELS],
    /// How much longer each leg stands.
    longer_mm: [PositionMm; WHEELS],
    shares: bool,
}

impl LoadShare {
    /// How much longer each leg stands.
    pub(super) const fn longer_mm(&self) -> [PositionMm; WHEELS] {
        self.longer_mm
    }

    /// Nothing is shared any more: forgets everything except how much longer the legs stand, which is reduced as slowly
    /// as it grew.
    pub(super) fn rest(&mut self) {
        *self = Self {
            longer_mm: self.longer_mm.map(|longer| eased(longer, STEP_MM)),
            ..Self::default()
        };
    }

    pub(super) fn update(
        &mut self,
        senses: &Senses,
        plan: &WalkPlan,
        enabled: Behaviours,
    ) -> Option<Act> {
        let stand = plan.legs == [LegPlan::Stance; WHEELS];
        if !stand || !enabled.contains(Behaviour::LoadShare) {
            self.rest();
            for (side, longer) in SIDES.into_iter().zip(&mut self.longer_mm) {
                if matches!(plan.leg(side), LegPlan::Lower(_)) {
                    // It stands afresh where it touches.
                    *longer = PositionMm::ZERO;
                }
            }
            return None;
        }
        for (side, effort) in SIDES.into_iter().zip(&mut self.effort) {
            let joint = senses.joint(side, Cylinder::Vertical).unwrap_or_default();
            let away = I16F16::saturating_from_num(joint.duty.get()).saturating_sub(*effort);
            let part = away.checked_shr(SMOOTH).unwrap_or(I16F16::ZERO);
            *effort = effort.saturating_add(part);
        }
        let [left, right] = self.effort;
        let more = left.saturating_sub(right);
        let shares = more.saturating_abs() > ALIKE;
        if shares {
            let shorter = PositionMm::ZERO.saturating_sub(STEP_MM);
            let steps = if more > I16F16::ZERO {
                [shorter, STEP_MM]
            } else {
                [STEP_MM, shorter]
            };
            let least = PositionMm::ZERO.saturating_sub(FARTHEST_MM);
            for (longer, step) in self.longer_mm.iter_mut().zip(steps) {
                *longer = longer.saturating_add(step).limit(least, FARTHEST_MM);
            }
        }
        let begins = shares && !self.shares;
        self.shares = shares;
        begins.then_some(Act::LoadShare)
    }
}
