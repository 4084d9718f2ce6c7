//! B7 slip: wheels that turn faster than the standing legs go with the ground.
//!
//! Both are ways over the last 0.3 s. A foot that holds cannot go on faster than the robot; wheels
//! that slip do. If feet and wheels slip alike nothing on board can tell.

use fixed::types::I16F16;
use wheeleg_units::PositionMm;

use super::ways::{Ways, at_foot_um};
use super::{SIDES, Senses};
use crate::behaviour::{Act, Behaviour, Behaviours};
use crate::contact::Side;
use crate::layer1::units::mm_to_um;
use crate::setpoint::{Cylinder, LegPlan, WHEELS, WalkPlan};

/// Cycles over which ways are compared (0.3 s).
const WINDOW: usize = 30;
/// Way of the wheels below which nothing is compared, µm (20 mm/s).
const LEAST_UM: i64 = 6_000;
/// A leg counts when it has stood for so many cycles (0.3 s): before, its b5 still follows from where
/// it landed.
const STOOD: u16 = 30;
/// Slip above which for so many cycles (0.3 s) the legs pull, and below which they have pulled
/// enough. A foot that settles in sand looks like slip for a shorter time: told at once, it was 12
/// false alarms in 60 s on the level.
const SLIPS: I16F16 = I16F16::lit("0.15");
const LASTS: u16 = 30;
const HOLDS: I16F16 = I16F16::lit("0.10");
/// Slip at which wheels pull most in the soils that we have: more of it only digs them in, and they
/// slow down. Below it the slip follows from the pull that is asked for, not from the speed.
const BEST: I16F16 = I16F16::lit("0.75");
/// Change of the pace in a cycle, down and up, and its smallest.
const SLOWER: I16F16 = I16F16::lit("0.02");
const FASTER: I16F16 = I16F16::lit("0.005");
const LEAST: I16F16 = I16F16::lit("0.3");
/// A pulling leg's b5 leads by so much more in a cycle (50 mm/s), up to so much.
const PULL_MM: PositionMm = PositionMm::from_raw(1 << 15);
const FARTHEST_MM: PositionMm = PositionMm::from_int(30);

/// What is known of the wheels' hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Slip {
    /// Ways of the last cycles: wheels and legs, µm.
    ways_um: [[i32; 2]; WINDOW],
    at: usize,
    b5_mm: [Option<PositionMm>; WHEELS],
    /// Cycles for which a leg has stood.
    stood: [u16; WHEELS],
    ways: Ways,
    /// Slip; `None`: the wheels hardly turn.
    slip: Option<I16F16>,
    backward: bool,
    /// Cycles for which the slip has been above [`SLIPS`].
    above: u16,
    slips: bool,
    pace: I16F16,
    lead_mm: [PositionMm; WHEELS],
}

impl Default for Slip {
    fn default() -> Self {
        Self {
            ways_um: [[0; 2]; WINDOW],
            at: 0,
            b5_mm: [None; WHEELS],
            stood: [0; WHEELS],
            ways: Ways::default(),
            slip: None,
            backward: false,
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

    /// One cycle; tells when the wheels begin to slip.
    pub(super) fn update(
        &mut self,
        senses: &Senses,
        plan: &WalkPlan,
        enabled: Behaviours,
    ) -> Option<Act> {
        if !enabled.contains(Behaviour::Slip) {
            *self = Self::default();
            return None;
        }
        let ways = self.ways_um(senses, plan);
        if let Some(place) = self.ways_um.get_mut(self.at) {
            *place = ways;
        }
        self.at = if self.at >= WINDOW.saturating_sub(1) {
            0
        } else {
            self.at.saturating_add(1)
        };
        self.slip = self.measure();
        let before = self.slips;
        let slip = self.slip.unwrap_or(I16F16::ZERO);
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
        for (side, lead) in SIDES.into_iter().zip(&mut self.lead_mm) {
            *lead = match (plan.leg(side), self.slips) {
                (LegPlan::Stance, true) => lead.saturating_add(PULL_MM),
                (LegPlan::Stance, false) => lead.saturating_sub(PULL_MM),
                _ => PositionMm::ZERO,
            }
            .limit(PositionMm::ZERO, FARTHEST_MM);
        }
        (self.slips && !before).then_some(Act::Slip)
    }

    /// What a standing leg's b5 leads by, positive when it pulls the robot forward.
    pub(super) fn lead_mm(&self, side: Side) -> PositionMm {
        let lead = self.lead_mm.get(side.index()).copied().unwrap_or_default();
        if self.backward {
            PositionMm::ZERO.saturating_sub(lead)
        } else {
            lead
        }
    }

    /// Ways of the wheels and of the standing legs in this cycle, mean of the standing feet.
    fn ways_um(&mut self, senses: &Senses, plan: &WalkPlan) -> [i32; 2] {
        let wheels_um = self.ways.since(senses);
        let (mut sum, mut feet) = ([0_i64; 2], 0_u8);
        let legs = self.b5_mm.iter_mut().zip(&mut self.stood);
        for (side, (b5, stood)) in SIDES.into_iter().zip(legs) {
            let stroke = senses
                .joint(side, Cylinder::Horizontal)
                .map(|j| j.stroke_mm);
            let stroke = stroke.filter(|_| plan.leg(side) == LegPlan::Stance);
            *stood = if stroke.is_some() {
                stood.saturating_add(1)
            } else {
                0
            };
            let before = core::mem::replace(b5, stroke);
            let (Some(now), Some(before), true) = (stroke, before, *stood > STOOD) else {
                continue;
            };
            let [wheels, legs] = &mut sum;
            *wheels = wheels.saturating_add(at_foot_um(side, wheels_um));
            *legs = legs.saturating_add(mm_to_um(before.saturating_sub(now)));
            feet = feet.saturating_add(1);
        }
        let halve = u32::from(feet == 2);
        sum.map(|way| i32::try_from(way >> halve).unwrap_or(0))
    }

    fn measure(&mut self) -> Option<I16F16> {
        let (mut wheels, mut legs) = (0_i64, 0_i64);
        for [wheel, leg] in self.ways_um {
            wheels = wheels.saturating_add(i64::from(wheel));
            legs = legs.saturating_add(i64::from(leg));
        }
        if wheels.saturating_abs() < LEAST_UM {
            return None;
        }
        self.backward = wheels < 0;
        let missing = wheels.saturating_sub(legs);
        let raw = (missing << 16_u32).checked_div(wheels).unwrap_or(0);
        Some(I16F16::from_bits(
            i32::try_from(raw.clamp(0, 1 << 16)).unwrap_or(0),
        ))
    }
}
