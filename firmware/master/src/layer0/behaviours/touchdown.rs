//! B3 touchdown and B4 search: a foot being lowered.
//!
//! Fast to 10 mm above where ground is expected, then at 100 mm/s until a switch closes or the leg is at full length.

use wheeleg_units::{PositionMm, VelocityMmS};

use super::JointSense;
use crate::behaviour::{Act, Behaviour, Behaviours};
use crate::contact::Side;
use crate::layer1::params::{STROKE_MM, in_stroke};
use crate::setpoint::{APPROACH_MM, Landing, LegPlan, NO_GROUND, PRESS_MM};

/// Distance per cycle of the slow part: 100 mm/s.
const SEARCH_MM: PositionMm = PositionMm::from_int(1);
/// The slow part advances when the piston is within this distance of its reference.
const NEAR_MM: PositionMm = PositionMm::from_int(5);
/// A leg is at full length from this stroke on.
const FULL_MM: PositionMm = PositionMm::from_int(178);
/// Ground this far from where it was expected is reported.
const SURPRISE_MM: PositionMm = PositionMm::from_int(20);
/// A piston has arrived if it is slower than this …
const STILL_MM_S: VelocityMmS = VelocityMmS::from_int(10);
/// … for [`STILL`] cycles, once [`BEGUN`] cycles have passed.
const STILL: u16 = 10;
const BEGUN: u16 = 10;
/// A foot with nails that touches above the expected ground, and whose piston is that slow for this many cycles (50
/// ms), stands on a rock: its nails do not penetrate.
const STOPPED: u16 = 5;

/// A foot being lowered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Touchdown {
    /// Reference of b6; `None`: the foot is not being lowered.
    at_mm: Option<PositionMm>,
    cycles: u16,
    still: u16,
    stopped: u16,
    /// Stroke at which the foot met the ground that it still touches. A touch of one cycle may be a graze; ground is
    /// what is felt in two consecutive cycles.
    met_mm: Option<PositionMm>,
    landing: Landing,
}

/// Where the slow part begins, and where a foot that does not search stops.
const fn limits_mm(from_mm: PositionMm, enabled: Behaviours) -> [PositionMm; 2] {
    // A foot that is not stopped by its switches presses on below the expected ground.
    let plan_mm = in_stroke(from_mm.saturating_add(APPROACH_MM).saturating_add(PRESS_MM));
    let begin = if enabled.contains(Behaviour::Touchdown) {
        from_mm
    } else {
        plan_mm
    };
    let end = if enabled.contains(Behaviour::Search) {
        STROKE_MM
    } else {
        plan_mm
    };
    [begin, end]
}

impl Touchdown {
    pub(super) const fn landing(&self) -> Landing {
        self.landing
    }

    /// Reference of b6 for a foot that is lowered from `from_mm` on.
    pub(super) fn reference(&self, from_mm: PositionMm, enabled: Behaviours) -> PositionMm {
        let [begin, _] = limits_mm(from_mm, enabled);
        self.at_mm.unwrap_or(begin)
    }

    /// One cycle with the plan of the leg, its b6, and whether a switch is closed. `nailed`: nails touch before the
    /// sole does.
    pub(super) fn update(
        &mut self,
        side: Side,
        plan: LegPlan,
        b6: &JointSense,
        touches: bool,
        nailed: bool,
        enabled: Behaviours,
    ) -> Option<Act> {
        let LegPlan::Lower(from_mm) = plan else {
            *self = Self::default();
            return None;
        };
        let [begin, end] = limits_mm(from_mm, enabled);
        let at = self.at_mm.unwrap_or(begin);
        self.cycles = self.cycles.saturating_add(1);
        let still = self.cycles > BEGUN && b6.velocity_mm_s.saturating_abs() < STILL_MM_S;
        let count = |cycles: u16, on| if on { cycles.saturating_add(1) } else { 0 };
        self.still = count(self.still, still);
        self.stopped = count(self.stopped, still && touches);
        // Above the expected ground it may be only the nails.
        let nails = nailed && b6.stroke_mm < from_mm.saturating_add(APPROACH_MM);
        let touches = touches && (!nails || self.stopped >= STOPPED);
        let arrived = b6.stroke_mm >= at.saturating_sub(PRESS_MM) || self.still >= STILL;
        let (stops, searches) = (
            enabled.contains(Behaviour::Touchdown),
            enabled.contains(Behaviour::Search),
        );
        let met = self.met_mm.take();
        if touches && (stops || (at >= end || searches) && arrived && self.cycles > BEGUN) {
            let here = if stops {
                b6.stroke_mm
            } else {
                at.saturating_sub(PRESS_MM)
            };
            let stroke = *self.met_mm.insert(met.unwrap_or(here));
            if met.is_none() && self.stopped < STOPPED {
                if stops {
                    self.at_mm = Some(in_stroke(stroke.saturating_add(PRESS_MM)));
                }
                self.landing = Landing::Waiting;
                return None;
            }
            self.landing = Landing::Down(stroke);
            let expected = from_mm.saturating_add(APPROACH_MM);
            let off = stroke.saturating_sub(expected);
            return match off {
                _ if !stops => None,
                off if off <= PositionMm::ZERO.saturating_sub(SURPRISE_MM) => {
                    Some(Act::EarlyGround(side))
                }
                off if off >= SURPRISE_MM => Some(Act::LateGround(side)),
                _ => None,
            };
        }
        if !searches && at >= end && self.still >= STILL {
            // It is not checked whether there is ground.
            self.landing = Landing::Down(at.saturating_sub(PRESS_MM));
            return None;
        }
        self.at_mm = Some(if at < end && b6.stroke_mm >= at.saturating_sub(NEAR_MM) {
            at.saturating_add(SEARCH_MM).limit(PositionMm::ZERO, end)
        } else {
            at
        });
        if !searches || b6.stroke_mm < FULL_MM {
            self.landing = Landing::Waiting;
            return None;
        }
        let cycles = match self.landing {
            Landing::Nothing(cycles) => cycles.saturating_add(1),
            _ => 1,
        };
        self.landing = Landing::Nothing(cycles);
        (cycles == NO_GROUND).then_some(Act::NoGround(side))
    }
}
