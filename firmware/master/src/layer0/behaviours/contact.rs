//! B6 lost contact and B2 tip guard: feet that should stand and do not.

use fixed::types::I16F16;
use wheeleg_units::PositionMm;

use super::{SIDES, Senses};
use crate::behaviour::{Act, Behaviour, Behaviours};
use crate::setpoint::{LegPlan, WHEELS, WalkPlan};

/// Cycles with all switches open after which a standing foot has lost the ground (50 ms).
const LOST: u16 = 5;
/// A leg extends after lost ground by so much in a cycle (100 mm/s) …
const FOLLOW_MM: PositionMm = PositionMm::from_int(1);
/// … and so far.
const FARTHEST_MM: PositionMm = PositionMm::from_int(20);
/// The same while no foot carries: a leg that extends lifts the nose.
const TIPPING_MM: PositionMm = PositionMm::from_int(10);
/// Cycles without any foot on the ground after which the wheels give way (200 ms): what holds the nose
/// up is their torque.
const GIVES_WAY: u16 = 20;
/// Pace while a foot looks for the ground.
const HALF: I16F16 = I16F16::lit("0.5");

/// What is known of the feet's hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Contact {
    /// Cycles for which all switches have been open without a break.
    open: [u16; WHEELS],
    /// What a leg has extended after lost ground in this stance.
    followed_mm: [PositionMm; WHEELS],
    lost: [bool; WHEELS],
    deep: [bool; WHEELS],
    tipping: bool,
}

impl Contact {
    /// A foot stands on nothing and follows the ground.
    pub(super) const fn lost(&self) -> [bool; WHEELS] {
        self.lost
    }

    /// It has followed as far as it may.
    pub(super) const fn deep(&self) -> [bool; WHEELS] {
        self.deep
    }

    /// The wheels hold the nose up: they are to give way.
    pub(super) fn gives_way(&self) -> bool {
        self.tipping && self.open.iter().all(|open| *open > GIVES_WAY)
    }

    /// What legs have extended.
    pub(super) const fn followed_mm(&self) -> [PositionMm; WHEELS] {
        self.followed_mm
    }

    /// The pace that this allows.
    pub(super) fn pace(&self) -> I16F16 {
        if self.tipping {
            I16F16::ZERO
        } else if self.lost.contains(&true) {
            HALF
        } else {
            I16F16::ONE
        }
    }

    pub(super) fn update(
        &mut self,
        senses: &Senses,
        plan: &WalkPlan,
        enabled: Behaviours,
    ) -> [Option<Act>; 3] {
        let mut hangs = [false; WHEELS];
        for ((side, open), hangs) in SIDES.into_iter().zip(&mut self.open).zip(&mut hangs) {
            let touches = senses.touches(side).unwrap_or(false);
            *open = if touches { 0 } else { open.saturating_add(1) };
            *hangs = plan.leg(side) == LegPlan::Stance && *open > LOST;
        }
        // Whatever they are about: one that swings carries nothing either.
        let none_carries = self.open.iter().all(|open| *open > LOST);
        let tips = enabled.contains(Behaviour::TipGuard) && none_carries;
        let mut acts = [None; 3];
        if let ([first, ..], true) = (&mut acts, tips && !self.tipping) {
            *first = Some(Act::TipGuard);
        }
        self.tipping = tips;
        let farthest = if tips { TIPPING_MM } else { FARTHEST_MM };
        for (side, act) in SIDES.into_iter().zip(acts.iter_mut().skip(1)) {
            let at = side.index();
            let (Some(followed), Some(lost), Some(deep), Some(hangs)) = (
                self.followed_mm.get_mut(at),
                self.lost.get_mut(at),
                self.deep.get_mut(at),
                hangs.get(at),
            ) else {
                continue;
            };
            if plan.leg(side) != LegPlan::Stance {
                *followed = PositionMm::ZERO;
            }
            *lost = *hangs && enabled.contains(Behaviour::LostContact);
            *deep = *lost && !tips && *followed >= farthest;
            if *lost && *followed < farthest {
                if *followed == PositionMm::ZERO {
                    *act = Some(Act::LostGround(side));
                }
                *followed = followed.saturating_add(FOLLOW_MM);
            }
        }
        acts
    }
}
