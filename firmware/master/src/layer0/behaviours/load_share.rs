//! B10 load share: two legs that both stand are to work alike.
//!
//! The only sign of a leg's load is how its vertical cylinder works: the one with the greater effort
//! over the last half second gives way, the other follows.

use fixed::types::I16F16;
use wheeleg_units::PositionMm;

use super::{SIDES, Senses, eased};
use crate::behaviour::{Act, Behaviour, Behaviours};
use crate::setpoint::{Cylinder, LegPlan, WHEELS, WalkPlan};

/// Difference of the efforts that is none.
const ALIKE: I16F16 = I16F16::lit("0.2");
/// Effort counts over so many cycles, as a power of two (0.32 s).
const SMOOTH: u32 = 5;
/// A leg gives way, or back, by so much in a cycle (30 mm/s for both), up to so much.
const STEP_MM: PositionMm = PositionMm::from_raw(9_830);
const FARTHEST_MM: PositionMm = PositionMm::from_int(10);

/// The legs' efforts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct LoadShare {
    effort: [I16F16; WHEELS],
    /// What each leg stands longer.
    longer_mm: [PositionMm; WHEELS],
    shares: bool,
}

impl LoadShare {
    /// What legs stand longer.
    pub(super) const fn longer_mm(&self) -> [PositionMm; WHEELS] {
        self.longer_mm
    }

    /// Nothing is shared any more: forgets all but what the legs stand longer, which goes as slowly
    /// as it came.
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
                    // It stands anew where it touches.
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
