//! Look-ahead of the square-wave gait: the next move of each joint.

use wheeleg_units::PositionMm;

use super::{Instant, SquareGait, Touchdown};
use crate::contact::Side;
use crate::layer1::CYCLE_US;
use crate::setpoint::{Cylinder, NextReference};

impl SquareGait {
    /// Next move of a joint after `at`, if it begins within 254 cycles.
    ///
    /// For a square wave the reference jumps to the given value when the count runs out; for the push it starts to move
    /// towards it.
    pub(super) fn ahead(
        &self,
        side: Side,
        cylinder: Cylinder,
        at: Instant,
    ) -> Option<NextReference> {
        let p = &self.params;
        let up = PositionMm::ZERO;
        // The present step and the two after it; an alternating leg moves at least once in them.
        for later in 0..3_u16 {
            let step = at.step.saturating_add(later);
            if step >= self.steps {
                return None;
            }
            let leg = p.stepping_leg(step);
            let begun = u64::from(p.period_us).saturating_mul(u64::from(step));
            let moves: [Option<(u32, PositionMm)>; 2] = match cylinder {
                Cylinder::Yaw => [None, None],
                Cylinder::Vertical if side == leg => [
                    Some((p.lift_us, up)),
                    Some((p.lower_us, self.approach(side))),
                ],
                Cylinder::Vertical => [None, None],
                Cylinder::Horizontal => {
                    let (reach, from) = if side == leg {
                        (Some((p.reach_us, p.stroke_mm)), p.stroke_mm)
                    } else {
                        (None, self.standing_before(side, step))
                    };
                    let end = from.saturating_sub(p.push_distance_mm(p.stroke_mm));
                    let push = self
                        .follows(side, leg)
                        .then_some((p.push_us, end.limit(up, p.stroke_mm)));
                    [reach, push]
                }
            };
            for (offset_us, reference_mm) in moves.into_iter().flatten() {
                let wait = begun
                    .saturating_add(u64::from(offset_us))
                    .saturating_sub(at.elapsed_us);
                if wait > 0 {
                    let cycles = u8::try_from(wait.div_ceil(CYCLE_US)).ok()?;
                    return (cycles < u8::MAX).then_some(NextReference {
                        reference_mm,
                        cycles,
                    });
                }
            }
        }
        None
    }

    /// Stroke to which b6 jumps when its foot is lowered.
    fn approach(&self, side: Side) -> PositionMm {
        let touchdown = self.touchdown.get(side.index());
        touchdown.map_or(self.params.stroke_mm, Touchdown::approach)
    }

    /// Nominal stroke of b5 at which the leg that does not step in `step` stands before its push.
    fn standing_before(&self, side: Side, step: u16) -> PositionMm {
        if step == 0 {
            let [_, s5, _] = self.params.start_pose(side);
            s5
        } else {
            self.params
                .stroke_mm
                .saturating_sub(self.params.push_distance_mm(self.params.stroke_mm))
        }
    }
}
