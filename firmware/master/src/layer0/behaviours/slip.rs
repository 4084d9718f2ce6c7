//! B7 slip: wheels that turn faster than the standing legs move with the ground.
//!
//! Both are distances of the feet over the last 0.3 s: according to the wheels, turns included, and according to the
//! legs, yaw included. A foot that holds cannot move faster than the robot; wheels that slip do. If feet and wheels
//! slip alike, nothing on board can tell.

use fixed::types::I16F16;
use wheeleg_units::PositionMm;

use super::ground::{Ways, moved, sensed_foot_m};
use super::{SIDES, Senses, eased};
use crate::behaviour::{Act, Behaviour, Behaviours};
use crate::contact::Side;
use crate::layer1::walk::{Twist, WalkGeometry};
use crate::setpoint::{LegPlan, WHEELS, WalkPlan};

/// Number of cycles over which the distances are compared (0.3 s).
const WINDOW: usize = 30;
/// Distance of the ground below which nothing is compared, m (20 mm/s).
const LEAST_M: f32 = 0.006;
/// A leg counts once it has stood for this many cycles (0.3 s): before that its b5 is still moving from where it
/// landed.
const STOOD: u16 = 30;
/// Slip above which for [`LASTS`] cycles (0.3 s) the legs pull, and below which ([`HOLDS`]) they have pulled enough. A
/// foot that settles in sand looks like slip for a shorter time: without the delay there were 12 false alarms in 60 s
/// on level ground.
const SLIPS: I16F16 = I16F16::lit("0.15");
const LASTS: u16 = 30;
const HOLDS: I16F16 = I16F16::lit("0.10");
/// Slip at which wheels pull most in the soils that are modelled: more of it only digs them in, so they slow down.
/// Below it the slip follows from the pull that is demanded, not from the speed.
const BEST: I16F16 = I16F16::lit("0.75");
/// Decrease and increase of the pace per cycle, and its smallest value.
const SLOWER: I16F16 = I16F16::lit("0.02");
const FASTER: I16F16 = I16F16::lit("0.005");
const LEAST: I16F16 = I16F16::lit("0.3");
/// The lead of a pulling leg's b5 changes by this much per cycle (50 mm/s), up to this much.
const PULL_MM: PositionMm = PositionMm::from_raw(1 << 15);
const FARTHEST_MM: PositionMm = PositionMm::from_int(30);

/// Motions in a cycle, m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Way {
    /// Motion of the robot, according to its wheels.
    robot: Twist,
    /// Motion of the ground below the feet that count, and of these feet; means, as seen from the robot.
    ground: [f32; 2],
    feet: [f32; 2],
}

/// State of the wheels' grip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Slip {
    ways_m: [Way; WINDOW],
    at: usize,
    /// Where a standing foot was, m.
    foot_m: [Option<[f32; 2]>; WHEELS],
    /// Cycles for which a leg has stood.
    stood: [u16; WHEELS],
    ways: Ways,
    /// Cycles for which the slip has been above [`SLIPS`].
    above: u16,
    slips: bool,
    pace: I16F16,
    /// Lead of b5, positive where it pulls the robot forward.
    lead_mm: [PositionMm; WHEELS],
}

impl Default for Slip {
    fn default() -> Self {
        Self {
            ways_m: [Way::default(); WINDOW],
            at: 0,
            foot_m: [None; WHEELS],
            stood: [0; WHEELS],
            ways: Ways::default(),
            above: 0,
            slips: false,
            pace: I16F16::ONE,
            lead_mm: [PositionMm::ZERO; WHEELS],
        }
    }
}

impl Slip {
    /// The pace that this allows.
    pub(super) const fn pace(&self) -> I16F16 {
        self.pace
    }

    /// Lead of b5 of a leg, positive where it pulls the robot forward.
    pub(super) fn lead_mm(&self, side: Side) -> PositionMm {
        self.lead_mm.get(side.index()).copied().unwrap_or_default()
    }

    /// No leg pulls any more: forgets everything but the leads, which are reduced as slowly as they grew.
    pub(super) fn rest(&mut self) {
        *self = Self {
            lead_mm: self.lead_mm.map(|lead| eased(lead, PULL_MM)),
            ..Self::default()
        };
    }

    /// One cycle; reports when the wheels begin to slip.
    pub(super) fn update(
        &mut self,
        senses: &Senses,
        plan: &WalkPlan,
        geometry: &WalkGeometry,
        enabled: Behaviours,
    ) -> Option<Act> {
        if !enabled.contains(Behaviour::Slip) {
            self.rest();
            return None;
        }
        let way = self.way(senses, plan, geometry);
        if let Some(place) = self.ways_m.get_mut(self.at) {
            *place = way;
        }
        self.at = if self.at >= WINDOW.saturating_sub(1) {
            0
        } else {
            self.at.saturating_add(1)
        };
        let before = self.slips;
        let slip = I16F16::checked_from_num(self.measure()).unwrap_or_default();
        self.above = if slip > SLIPS {
            self.above.saturating_add(1)
        } else {
            0
        };
        self.slips = if before {
            slip > HOLDS
        } else {
            self.above >= LASTS
        };
        self.pace = if slip > BEST {
            self.pace.saturating_sub(SLOWER)
        } else {
            self.pace.saturating_add(FASTER)
        }
        .clamp(LEAST, I16F16::ONE);
        self.pull(plan, geometry);
        (self.slips && !before).then_some(Act::Slip)
    }

    /// Brings the leads of the legs closer to the wanted ones.
    fn pull(&mut self, plan: &WalkPlan, geometry: &WalkGeometry) {
        let robot = self.total().robot;
        for (side, lead) in SIDES.into_iter().zip(&mut self.lead_mm) {
            let [ground_m, _] = robot.ground_m_s(geometry, side, [0.0; 2]);
            let farthest = if ground_m > 0.0 {
                PositionMm::ZERO.saturating_sub(FARTHEST_MM)
            } else {
                FARTHEST_MM
            };
            let pulls = self.slips && plan.leg(side) == LegPlan::Stance;
            let wanted = if pulls { farthest } else { PositionMm::ZERO };
            *lead = wanted.saturating_add(eased(lead.saturating_sub(wanted), PULL_MM));
        }
    }

    /// Motions in this cycle.
    fn way(&mut self, senses: &Senses, plan: &WalkPlan, geometry: &WalkGeometry) -> Way {
        let mut way = Way {
            robot: moved(geometry, self.ways.since(senses)),
            ..Way::default()
        };
        let mut feet = 0.0;
        let legs = self.foot_m.iter_mut().zip(&mut self.stood);
        for (side, (foot, stood)) in SIDES.into_iter().zip(legs) {
            let stands = plan.leg(side) == LegPlan::Stance;
            let here = sensed_foot_m(geometry, senses, side).filter(|_| stands);
            *stood = if here.is_some() {
                stood.saturating_add(1)
            } else {
                0
            };
            let before = core::mem::replace(foot, here);
            let (Some(here), Some(before), true) = (here, before, *stood > STOOD) else {
                continue;
            };
            way.ground = sum(way.ground, way.robot.ground_m_s(geometry, side, before));
            way.feet = sum(way.feet, sum(here, before.map(|m| -m)));
            feet += 1.0;
        }
        if feet > 1.0 {
            way.ground = way.ground.map(|m| m / feet);
            way.feet = way.feet.map(|m| m / feet);
        }
        way
    }

    /// Motions over the whole window.
    fn total(&self) -> Way {
        let mut all = Way::default();
        for way in &self.ways_m {
            all.robot.forward_m_s += way.robot.forward_m_s;
            all.robot.turn_rad_s += way.robot.turn_rad_s;
            all.ground = sum(all.ground, way.ground);
            all.feet = sum(all.feet, way.feet);
        }
        all
    }

    /// Slip, 0 to 1: the share of the ground's motion that the feet have not followed. 0 if the wheels hardly turn.
    fn measure(&self) -> f32 {
        let all = self.total();
        let dot = |[ax, ay]: [f32; 2], [bx, by]: [f32; 2]| ax * bx + ay * by;
        let ground = dot(all.ground, all.ground);
        if ground < LEAST_M * LEAST_M {
            return 0.0;
        }
        (1.0 - dot(all.feet, all.ground) / ground).clamp(0.0, 1.0)
    }
}

fn sum([ax, ay]: [f32; 2], [bx, by]: [f32; 2]) -> [f32; 2] {
    [ax + bx, ay + by]
}
