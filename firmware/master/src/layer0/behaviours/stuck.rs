//! B9 stuck: a robot that is driven but makes no progress. What it then tries is up to layer 1.

use wheeleg_units::PositionMm;

use super::ground::Ways;
use super::{SIDES, Senses};
use crate::behaviour::{Behaviour, Behaviours};
use crate::setpoint::{Cylinder, LegPlan, Setpoints, WHEELS, WalkPlan};

/// There is no progress if the standing legs have moved by less than this, …
const PROGRESS_MM: PositionMm = PositionMm::from_int(5);
/// … or the wheels have turned by less than this, µm, …
const PROGRESS_UM: i64 = 10_000;
/// … in this many cycles (3 s): legs that step on the spot move, too.
const PATIENCE: u16 = 300;
/// This many consecutive swings that ran against something are no progress, whatever wheels and legs do: in front of a
/// wall both may slip alike.
const BUMPED: u8 = 3;
/// Wheels that give way this often within half a metre make no progress: soft ground lifts the nose again and again.
const GAVE_WAY: u8 = 5;
/// After a robot has been stuck, this many of either are enough, until its wheels have moved this far, µm (0.5 m).
const AGAIN: u8 = 2;
const AGAIN_UM: i64 = 500_000;
/// A wheel is blocked if its motor command is above this, nearly its maximum, %, …
const EFFORT_PERCENT: u16 = 90;
/// … at less than this share of the demanded speed, 1/n, …
const SPEED_SHARE: i64 = 5;
/// … for this many cycles (1 s).
const BLOCKED: u16 = 100;

/// Progress of a walk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Stuck {
    /// Strokes of yaw and b5 from which progress is measured.
    anchor: [[PositionMm; 2]; WHEELS],
    /// There is something to measure from.
    begun: bool,
    /// A leg has moved since the last progress.
    moved: bool,
    /// Travel of the wheels from which progress is measured, µm.
    anchor_um: [i64; WHEELS],
    /// How often the wheels have given way recently.
    gave_way: u8,
    /// Number of cycles without progress.
    idle: u16,
    /// The present swing of each leg has run against something.
    bumped: [bool; WHEELS],
    /// Number of consecutive swings that have.
    bumps: u8,
    /// Travel of the wheels when the robot was last stuck, µm.
    stuck_um: Option<[i64; WHEELS]>,
    /// Cycles for which a wheel has been blocked.
    blocked: [u16; WHEELS],
    ways: Ways,
}

impl Stuck {
    /// Sets how often the wheels have given way recently.
    pub(super) const fn wheels_gave_way(&mut self, times: u8) {
        self.gave_way = times;
    }

    /// One cycle; returns whether the robot is stuck, and again after the same time. `landed`: feet that have just come
    /// down; `bumps`: feet that have just run against something.
    pub(super) fn update(
        &mut self,
        senses: &Senses,
        plan: &WalkPlan,
        setpoints: &Setpoints,
        landed: [bool; WHEELS],
        bumps: [bool; WHEELS],
        enabled: Behaviours,
    ) -> bool {
        self.count(landed, bumps);
        let progress = self.progress(senses, plan);
        let blocked = self.blocked(senses, setpoints);
        if !enabled.contains(Behaviour::Stuck) || !plan.driven {
            self.idle = 0;
            self.bumps = 0;
            self.blocked = [0; WHEELS];
            return false;
        }
        self.idle = if progress {
            0
        } else {
            self.idle.saturating_add(1)
        };
        let now_um = senses.wheels.map(|wheel| wheel.travel_um);
        let near = |before: [i64; WHEELS]| {
            let mut ways = now_um.into_iter().zip(before);
            ways.all(|(now, before)| now.saturating_sub(before).saturating_abs() < AGAIN_UM)
        };
        self.stuck_um = self.stuck_um.filter(|before| near(*before));
        let most = |first: u8| self.stuck_um.map_or(first, |_| AGAIN);
        let repeats = self.bumps >= most(BUMPED) || self.gave_way >= most(GAVE_WAY);
        let stuck = self.idle > PATIENCE || blocked || repeats;
        if stuck {
            self.stuck_um = Some(now_um);
            self.idle = 0;
            self.bumps = 0;
            self.blocked = [0; WHEELS];
        }
        stuck
    }

    /// Counts the consecutive swings that ran against something.
    fn count(&mut self, landed: [bool; WHEELS], bumps: [bool; WHEELS]) {
        for ((bumped, landed), bump) in self.bumped.iter_mut().zip(landed).zip(bumps) {
            *bumped |= bump;
            if landed {
                self.bumps = if *bumped {
                    self.bumps.saturating_add(1)
                } else {
                    0
                };
                *bumped = false;
            }
        }
    }

    /// Whether a standing leg and a wheel have moved since the last progress.
    fn progress(&mut self, senses: &Senses, plan: &WalkPlan) -> bool {
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
            self.moved |= moved && stands && self.begun;
        }
        let now = senses.wheels.map(|wheel| wheel.travel_um);
        let far = |(a, b): (i64, &i64)| a.saturating_sub(*b).saturating_abs() >= PROGRESS_UM;
        if !self.begun {
            self.begun = true;
            self.anchor_um = now;
        }
        let turned = now.into_iter().zip(&self.anchor_um).any(far);
        let progress = self.moved && turned;
        if progress {
            self.moved = false;
            self.anchor_um = now;
        }
        progress
    }

    /// Whether a wheel works at its maximum and hardly turns.
    fn blocked(&mut self, senses: &Senses, setpoints: &Setpoints) -> bool {
        let mut blocked = false;
        let wheels = self.ways.since(senses).into_iter().zip(senses.wheels);
        for ((side, count), (way_um, wheel)) in SIDES.into_iter().zip(&mut self.blocked).zip(wheels)
        {
            let asked = setpoints
                .travel
                .and_then(|t| t.wheels.get(side.index()).copied());
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
