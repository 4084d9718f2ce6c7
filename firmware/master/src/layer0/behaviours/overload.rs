//! B1 overload: a cylinder that pulls at its limit and does not move.
//!
//! Its valves would shut with the pull trapped if it only held; it goes back a little instead, and
//! stays there until its leg does something else. A blocked wheel is `stuck`'s.

use core::mem::discriminant;

use wheeleg_units::{PositionMm, VelocityMmS};

use super::{SIDES, Senses};
use crate::behaviour::{Act, Behaviour, Behaviours};
use crate::setpoint::{JOINTS, JointSetpoint, LegPlan, WHEELS, WalkPlan};

/// An axis that has been at its limit for so many cycles (0.5 s) …
const LIMITED: u16 = 50;
/// … and has moved less than this is overloaded.
const MOVED_MM: PositionMm = PositionMm::from_int(5);
/// It goes back by so much: most of the pull is gone.
const BACK_MM: PositionMm = PositionMm::from_int(5);

/// An axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Axis {
    /// Cycles at its limit.
    limited: u16,
    /// Stroke from which its motion counts.
    from_mm: PositionMm,
    /// Stroke at which it holds.
    held_mm: Option<PositionMm>,
}

/// All cylinders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Overload {
    axes: [Axis; JOINTS],
    plans: [LegPlan; WHEELS],
}

impl Overload {
    /// One cycle; tells of the first axis that it finds overloaded.
    pub(super) fn update(
        &mut self,
        senses: &Senses,
        plan: &WalkPlan,
        enabled: Behaviours,
    ) -> Option<Act> {
        if !enabled.contains(Behaviour::Overload) {
            *self = Self::default();
            return None;
        }
        let mut changed = [false; WHEELS];
        for ((side, changed), before) in SIDES.into_iter().zip(&mut changed).zip(&mut self.plans) {
            let now = plan.leg(side);
            *changed = discriminant(&now) != discriminant(before);
            *before = now;
        }
        let mut told = None;
        for ((axis, sense), index) in self.axes.iter_mut().zip(senses.joints).zip(0_u8..) {
            let Some(sense) = sense else {
                continue;
            };
            let leg = usize::from(index >= 3);
            if changed.get(leg) == Some(&true) {
                *axis = Axis::default();
            }
            let moved = sense.stroke_mm.saturating_sub(axis.from_mm);
            if axis.limited == 0 || !sense.saturated || moved.saturating_abs() >= MOVED_MM {
                axis.limited = u16::from(sense.saturated);
                axis.from_mm = sense.stroke_mm;
                continue;
            }
            axis.limited = axis.limited.saturating_add(1);
            if axis.limited >= LIMITED && axis.held_mm.is_none() {
                let back = if sense.duty.raw() > 0 {
                    sense.stroke_mm.saturating_sub(BACK_MM)
                } else {
                    sense.stroke_mm.saturating_add(BACK_MM)
                };
                axis.held_mm = Some(back);
                let node = index.saturating_add(1);
                told = told.or(Some(Act::Overload { node }));
            }
        }
        told
    }

    /// The set-point of an axis: where it is overloaded, where it holds.
    pub(super) fn apply(&self, joint: usize, setpoint: JointSetpoint) -> JointSetpoint {
        match self.axes.get(joint).and_then(|axis| axis.held_mm) {
            Some(held) => JointSetpoint {
                reference_mm: held,
                velocity_mm_s: VelocityMmS::ZERO,
                ahead: None,
                ..setpoint
            },
            None => setpoint,
        }
    }
}
