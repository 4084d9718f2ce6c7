//! B9 stuck: a robot that is driven and does not get on. What it then tries is layer 1's.

use wheeleg_units::PositionMm;

use super::{SIDES, Senses};
use crate::behaviour::{Behaviour, Behaviours};
use crate::setpoint::{Cylinder, LegPlan, Setpoints, WHEELS, WalkPlan};

/// Legs that have moved less than this …
const PROGRESS_MM: PositionMm = PositionMm::from_int(5);
/// … in so many cycles (3 s) make no progress.
const PATIENCE: u16 = 300;
/// Motor command that is all that a wheel has, %, …
const EFFORT_PERCENT: u16 = 90;
/// … at less than this share of the speed asked for, 1/n, …
const SPEED_SHARE: i64 = 5;
/// … for so many cycles (1 s).
const BLOCKED: u16 = 100;

/// Progress of a walk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Stuck {
    /// Strokes of yaw and b5 from which progress counts.
    anchor: [[PositionMm; 2]; WHEELS],
    /// Cycles since a standing leg has moved.
    idle: u16,
    /// Cycles for which a wheel has been blocked.
    blocked: [u16; WHEELS],
    /// Travel of the wheels in the last cycle, µm.
    wheels_um: [Option<i64>; WHEELS],
}

impl Stuck {
    /// One cycle; whether the robot is stuck. It is told again after as long a time.
    pub(super) fn update(
        &mut self,
        senses: &Senses,
        plan: &WalkPlan,
        setpoints: &Setpoints,
        enabled: Behaviours,
    ) -> bool {
        let progress = self.progress(senses, plan);
        let blocked = self.blocked(senses, setpoints);
        if !enabled.contains(Behaviour::Stuck) || !plan.driven {
            self.idle = 0;
            self.blocked = [0; WHEELS];
            return false;
        }
        self.idle = if progress {
            0
        } else {
            self.idle.saturating_add(1)
        };
        let stuck = self.idle > PATIENCE || blocked;
        if stuck {
            self.idle = 0;
            self.blocked = [0; WHEELS];
        }
        stuck
    }

    /// Whether a standing leg has moved since it was last found to have.
    fn progress(&mut self, senses: &Senses, plan: &WalkPlan) -> bool {
        let mut progress = false;
        for (side, anchor) in SIDES.into_iter().zip(&mut self.anchor) {
            let stroke = |cylinder| senses.joint(side, cylinder).unwrap_or_default().stroke_mm;
            let now = [stroke(Cylinder::Yaw), stroke(Cylinder::Horizontal)];
            let far = |(a, b): (&PositionMm, PositionMm)| {
                a.saturating_sub(b).saturating_abs() >= PROGRESS_MM
            };
            let moved = anchor.iter().zip(now).any(far);
            let stands = plan.leg(side) == LegPlan::Stance;
            if moved || !stands {
                *anchor = now;
            }
            progress |= moved && stands;
        }
        progress
    }

    /// Whether a wheel gives all that it has, and hardly turns.
    fn blocked(&mut self, senses: &Senses, setpoints: &Setpoints) -> bool {
        let mut blocked = false;
        for side in SIDES {
            let at = side.index();
            let (Some(count), Some(before), Some(wheel)) = (
                self.blocked.get_mut(at),
                self.wheels_um.get_mut(at),
                senses.wheels.get(at),
            ) else {
                continue;
            };
            let way_um = before
                .replace(wheel.travel_um)
                .map_or(0, |before| wheel.travel_um.saturating_sub(before));
            let asked = setpoints.travel.and_then(|t| t.wheels.get(at).copied());
            // mm/s × 10 ms = 10 µm.
            let asked_um = asked.map_or(0, |wheel| {
                i64::from(wheel.velocity_mm_s.get().to_num::<i32>()).saturating_mul(10)
            });
            let slow =
                way_um.saturating_abs().saturating_mul(SPEED_SHARE) < asked_um.saturating_abs();
            let gives_all = wheel.effort_percent.unsigned_abs() > EFFORT_PERCENT;
            *count = if slow && gives_all {
                count.saturating_add(1)
            } else {
                0
            };
            blocked |= *count >= BLOCKED;
        }
        blocked
    }
}
