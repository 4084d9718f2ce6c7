//! B6 lost contact and B2 tip guard: feet that should stand but do not.

use fixed::types::I16F16;
use wheeleg_units::PositionMm;

use super::{SIDES, Senses};
use crate::behaviour::{Act, Behaviour, Behaviours};
use crate::setpoint::{LegPlan, WHEELS, WalkPlan};

/// Cycles with all switches open after which a standing foot has lost the ground (50 ms).
const LOST: u16 = 5;
/// After losing the ground a leg extends by this much per cycle (100 mm/s) …
const FOLLOW_MM: PositionMm = PositionMm::from_int(1);
/// … up to this far.
const FARTHEST_MM: PositionMm = PositionMm::from_int(20);
/// The same while no foot carries load: a leg that extends then lifts the nose.
const TIPPING_MM: PositionMm = PositionMm::from_int(10);
/// Number of cycles without any foot on the ground after which the wheels give way (200 ms), because their torque is
/// what holds the nose up.
const GIVES_WAY: u16 = 20;
/// Pace while a foot searches for the ground.
const HALF: I16F16 = I16F16::lit("0.5");

/// State of the feet's contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Contact {
    /// Cycles for which all switches have been open without a break.
    open: [u16; WHEELS],
    /// How far a leg has extended in this stance after losing the ground.
    followed_mm: [PositionMm; WHEELS],
    lost: [bool; WHEELS],
    deep: [bool; WHEELS],
    tipping: bool,
}

impl Contact {
    /// Whether each foot stands on nothing and follows the ground.
    pub(super) const fn lost(&self) -> [bool; WHEELS] {
        self.lost
    }

    /// Whether each foot has followed as far as it may.
    pub(super) const fn deep(&self) -> [bool; WHEELS] {
        self.deep
    }

    /// Whether the wheels hold the nose up and should give way.
    pub(super) fn gives_way(&self) -> bool {
        self.tipping && self.open.iter().all(|open| *open > GIVES_WAY)
    }

    /// How far the legs have extended.
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
        // Whatever the legs are doing: a swinging foot carries nothing, either.
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
