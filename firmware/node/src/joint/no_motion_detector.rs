//! Detects motion that is expected but does not happen.
//!
//! A frozen potentiometer, a stuck valve, a cylinder that leaks or is blocked: each looks like an
//! axis at rest, or like one that follows to some degree. What distinguishes them is the air:
//! [`Air`] estimates the force that the chambers should produce. Three conditions cannot occur on an
//! intact axis at rest:
//!
//! 1. It is pushed towards its reference by more than its motions take, break-away friction and the
//!    margin of the axis included, for 30 ms.
//! 2. Nothing has been learnt from motions yet, but the force should be nine tenths of the largest,
//!    with the opposing chamber known to be empty, for 200 ms.
//! 3. A chamber whose estimate has had time to become accurate should hold eleven eighths of the
//!    supply pressure, for 30 ms. No load causes this on an axis that the supply can move: the air
//!    has escaped.
//!
//! The force that a motion takes is learnt whenever the piston slides, as the mean over the last
//! 0.1 s of sliding: load and errors of the estimate together. So neither a load nor a supply or
//! valves that differ from their parameters are taken for a fault: the error of the estimate when
//! the piston comes to rest is subtracted, and during rest only that air counts which valves nearly
//! twice as slow as stated would certainly let through. A longer mean would lag behind an estimate
//! that drifts on the way, by as much as a valve that does not open for the short pulses at the end
//! of a motion. `tests/system/off_data.rs` runs robots that differ from their data; the results are
//! in `host-sim/FAULTS.md`.
//!
//! The margin leaves room for a load that changes while the axis is at rest. It is a parameter,
//! because only the user of the machine knows its loads; if none is stated, it is half of the
//! largest force.

use super::air::{Air, AirModel, ROUND};
use crate::JOINT_TICK;
use core::hash::{Hash, Hasher};
use wheeleg_control::axis::AxisModel;
use wheeleg_control::joint::JointGains;
use wheeleg_control::pwm::OnTimes;
use wheeleg_units::{Micros, PositionMm, VelocityMmS};

/// Motion that shows that the piston follows, raw mm (0.5 mm).
const SHOWN: i32 = 1 << 15;
/// Error below which no motion is expected, raw mm (4 mm): what the worst of the laws leaves where its pulses become
/// too short for the valves.
const ERROR: i32 = 4 << 16;
/// Rounds at standstill after which nothing is known of the air any more.
const MINUTE: u16 = u16::MAX / ROUND;
/// Doubt that is a fault …
const FAULT: u16 = 200;
/// … what a round adds that is impossible on a sound axis …
const STRONG: u16 = 20;
/// … and what a round with the largest force adds.
const WEAK: u16 = ROUND;
/// Rounds of sliding over which the force is averaged …
const MEMORY: u16 = 100 / ROUND;
/// … and below which nothing is known.
const LEARNT: u16 = 100 / ROUND;
/// The piston slides above this speed, raw mm/s (20 mm/s).
const SLIDES: i32 = 20 << 16;
/// It stands below this speed, raw mm/s (10 mm/s); a piston that reverses does not.
const STILL: i32 = 10 << 16;
/// Distance to an end of the stroke within which the piston may stand, mm.
const NEAR_END: PositionMm = PositionMm::from_int(3);
/// The same for the cushions, in which the force says nothing about the load, raw mm.
const CUSHION: i32 = 6 << 16;

/// What cannot happen on a sound axis at rest, numbered as in the module's documentation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum Rule {
    None = 0,
    Pushed = 1,
    Largest = 2,
    Impossible = 3,
}

impl Rule {
    /// What one round of it adds to the doubt.
    #[inline]
    const fn doubt(self) -> u16 {
        match self {
            Self::None => 0,
            Self::Pushed | Self::Impossible => STRONG,
            Self::Largest => WEAK,
        }
    }
}

/// What is expected of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MotionModel {
    air: AirModel,
    /// Force beyond the learnt one at which a piston must move, mN.
    margin: i32,
    /// Nine tenths of the largest forces, extending and retracting, mN.
    nearly_all: (i32, i32),
    /// Coulomb friction, mN: that of the axis data, never the learnt one. Supervision does not trust the law.
    coulomb: i32,
    /// Viscous friction, mN per mm/s × 2^8.
    viscous: i32,
    /// Stroke below which the piston may stand against its lower end, mm.
    low: PositionMm,
    /// Stroke above which it may stand against its upper end, mm.
    high: PositionMm,
}

impl MotionModel {
    /// From the axis's data and the margin; `None` if the data contradict each other.
    #[inline(never)]
    pub(super) fn new(gains: &JointGains, margin: PositionMm) -> Option<Self> {
        let axis = AxisModel::new(&gains.axis, JOINT_TICK).ok()?;
        let air = AirModel::new(&axis, gains.axis.valve_on);
        let [out, back] = air.largest();
        // N × 2^16 to mN.
        let told = match (i64::from(margin.raw()).wrapping_mul(1000) >> 16) as i32 {
            0 => out.min(back) >> 1,
            told => told,
        };
        let most = |force: i32| force.saturating_sub(force / 10);
        Some(Self {
            air,
            margin: told.saturating_add(axis.breakaway),
            nearly_all: (most(out), most(back)),
            coulomb: axis.coulomb,
            viscous: axis.viscous,
            low: gains.stroke_min.saturating_add(NEAR_END),
            high: gains.stroke_max.saturating_sub(NEAR_END),
        })
    }

    /// Absolute pressure of the atmosphere, 2^-17 of the supply pressure.
    #[inline]
    pub(super) const fn ambient(&self) -> i32 {
        self.air.ambient()
    }

    /// A pulse of the inlet of B or A: its opening, limited to `shortest` and `longest`, and its force, mN.
    #[inline]
    pub(super) fn pulse(
        &self,
        b: bool,
        at: PositionMm,
        shortest: Micros,
        longest: Micros,
    ) -> (Micros, i32) {
        self.air.pulse(b, at, shortest, longest)
    }

    /// Force by which a piston that has moved by `moved` (raw mm, a few millimetres) shifts the balance of a precharge:
    /// an eighth of the largest force per millimetre, mN.
    #[inline]
    pub(super) const fn given_way(&self, moved: i32) -> i32 {
        let (out, _) = self.nearly_all;
        (moved >> 8).wrapping_mul(out >> 3) >> 8
    }
}

/// What a driven axis was to do, and what it did.
#[derive(Clone, Copy, Debug)]
pub(super) struct Driven {
    pub(super) reference: PositionMm,
    pub(super) position: PositionMm,
    pub(super) velocity: VelocityMmS,
}

/// The motion watch's view of an axis between two ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MotionAccount {
    /// Doubt, as the time that the strongest rule takes to reach it.
    pub overdue: Micros,
    /// Rule that applies now, by its number in the module's documentation; 0: none.
    pub rule: u8,
    /// Force that the chambers should produce, mN, positive extends.
    pub force: i32,
    /// Force that the last motions required, without friction, mN.
    pub learnt: i32,
    /// Duration of the sliding from which it was learnt, ms; at most 99.
    pub slid_ms: u16,
    /// Pressures in A and B, 2^-17 of the supply pressure, absolute.
    pub pressures: [i32; 2],
}

/// The watch over one cylinder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MotionWatch {
    air: Air,
    /// Stroke about which the piston stands, raw mm.
    from: i32,
    /// Force that the last motions required, without friction, mN.
    learnt: i32,
    /// Rounds of sliding from which it was learnt, at most [`MEMORY`].
    slid: u16,
    /// Doubt.
    doubt: u16,
    /// Rounds for which the piston has stood still.
    stands: u16,
}

impl Hash for MotionWatch {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Destructured, so that a new field cannot be forgotten here; the small ones share a word.
        let Self {
            air,
            from,
            learnt,
            slid,
            doubt,
            stands,
        } = self;
        air.hash(state);
        // A flipped bit of either flips a bit of the word.
        state.write_i32(*from ^ i32::from(*stands).wrapping_shl(16));
        state.write_i32(*learnt);
        state.write_u32(u32::from(*slid) | u32::from(*doubt).wrapping_shl(16));
    }
}

impl MotionWatch {
    /// For an axis of which nothing is known.
    pub(super) const fn new(model: &MotionModel, position: PositionMm) -> Self {
        Self {
            air: Air::unknown(&model.air, position),
            from: position.raw(),
            learnt: 0,
            slid: 0,
            doubt: 0,
            stands: 0,
        }
    }

    /// A tick in which the law does not drive the valves, which are open for `on`: the air is tracked, nothing is
    /// expected, and loads have to be learnt again afterwards.
    #[inline(never)]
    pub(super) fn rest(&mut self, on: &OnTimes, position: PositionMm, model: &MotionModel) {
        let third = self.air.follow(on, position, &model.air, false);
        if *on == [0; 4] {
            self.air.forget();
            // Also counts what may have leaked while the piston stood under control and was not counted then; here, in
            // the tick in which no chamber is updated.
            let stood = self.stands.min(MINUTE);
            self.air
                .leak(&model.air, stood.wrapping_add(u16::from(third)));
        }
        self.slid = 0;
        self.doubt = 0;
        self.stands = 0;
        self.from = position.raw();
    }

    /// Notes the present force of both chambers as the one to be held. It is stored in place of the learnt one: while
    /// no law drives nothing is learnt, and afterwards it is learnt afresh.
    pub(super) fn hold_force(&mut self, model: &MotionModel) {
        self.slid = 0;
        self.learnt = self.air.force(&model.air);
    }

    /// Excess of the force of both chambers over the one to be held, mN, positive extends.
    #[inline]
    pub(super) fn unbalanced(&self, model: &MotionModel) -> i32 {
        self.air.force(&model.air).saturating_sub(self.learnt)
    }

    /// Lower one of the two chamber pressures, 2^-17 of the supply pressure, absolute.
    #[inline]
    pub(super) fn least_pressure(&self) -> i32 {
        let [a, b] = self.air.pressures();
        a.min(b)
    }

    /// A tick under control sends `on`. Updating the air takes two ticks of a round.
    #[inline]
    pub(super) fn follow(&mut self, on: &OnTimes, position: PositionMm, model: &MotionModel) {
        let third = self.air.follow(on, position, &model.air, self.stands > 0);
        if third && self.stands >= MINUTE && *on == [0; 4] {
            // After a minute at rest: seals leak.
            self.slid = 0;
            self.air.forget();
            self.air.leak(&model.air, 1);
        }
    }

    /// Whether a motion is overdue. This is judged in the third tick of a round, from the ticks before it, so it is
    /// known before the pulses of this tick are made.
    #[inline]
    pub(super) fn judge(&mut self, driven: &Driven, model: &MotionModel) -> bool {
        if !self.air.ends_round() {
            return false;
        }
        let &Driven {
            reference,
            position,
            velocity,
        } = driven;
        let speed = velocity.raw();
        let stroke = position.raw();
        if speed.wrapping_abs() >= SLIDES {
            self.learn(speed, position, model);
        }
        let moved = stroke.wrapping_sub(self.from).wrapping_abs();
        if moved >= SHOWN || speed.wrapping_abs() >= STILL {
            self.from = stroke;
            self.stands = 0;
            self.doubt = 0;
            return false;
        }
        self.stands = self.stands.saturating_add(1);
        let doubt = self.rule(reference, position, model).doubt();
        self.doubt = if doubt == 0 {
            0
        } else {
            self.doubt.saturating_add(doubt)
        };
        self.is_overdue()
    }

    /// Whether the piston has stood still since the last round.
    #[inline]
    pub(super) const fn stands(&self) -> bool {
        self.stands > 0
    }

    /// Whether a motion is overdue, as judged in the last round.
    #[inline]
    pub(super) const fn is_overdue(&self) -> bool {
        self.doubt >= FAULT
    }

    /// The rule that makes this round of a standing axis doubtful.
    #[inline]
    fn rule(&self, reference: PositionMm, position: PositionMm, model: &MotionModel) -> Rule {
        if self.air.is_impossible() && self.air.is_comparable(&model.air) {
            return Rule::Impossible;
        }
        let error = reference.raw().wrapping_sub(position.raw());
        if error.wrapping_abs() < ERROR {
            return Rule::None;
        }
        let extends = error > 0;
        let against_end = if extends {
            position > model.high
        } else {
            position < model.low
        };
        if against_end {
            return Rule::None;
        }
        let towards = |force: i32| if extends { force } else { force.wrapping_neg() };
        let force = self.air.force(&model.air);
        let (out, back) = model.nearly_all;
        if self.slid >= LEARNT && towards(force.saturating_sub(self.learnt)) > model.margin {
            Rule::Pushed
        } else if towards(force) > if extends { out } else { back }
            && self.air.is_known(extends, &model.air)
        {
            Rule::Largest
        } else {
            Rule::None
        }
    }

    /// Learns the force that a sliding piston needs, without friction.
    #[inline]
    fn learn(&mut self, speed: i32, position: PositionMm, model: &MotionModel) {
        let inside = position.raw() > CUSHION
            && position.raw()
                < model
                    .high
                    .raw()
                    .wrapping_add(NEAR_END.raw())
                    .wrapping_sub(CUSHION);
        if !inside || !self.air.is_comparable(&model.air) {
            return;
        }
        let coulomb = if speed < 0 {
            model.coulomb.wrapping_neg()
        } else {
            model.coulomb
        };
        // Speeds are below 2^15 mm/s and taken as whole numbers, because the viscous part is small.
        let viscous = (speed >> 16).saturating_mul(model.viscous) >> 8;
        let taken = self
            .air
            .force(&model.air)
            .saturating_sub(viscous)
            .saturating_sub(coulomb);
        self.slid = self.slid.saturating_add(1).min(MEMORY);
        let share = i32::from(self.slid.max(20 / ROUND));
        let change = taken
            .saturating_sub(self.learnt)
            .checked_div(share)
            .unwrap_or(0);
        self.learnt = self.learnt.saturating_add(change);
    }

    /// For tools: the watch's view of the axis.
    pub(super) fn account(
        &self,
        reference: PositionMm,
        position: PositionMm,
        model: &MotionModel,
    ) -> MotionAccount {
        MotionAccount {
            overdue: self.overdue(),
            rule: self.rule(reference, position, model) as u8,
            force: self.air.force(&model.air),
            learnt: self.learnt,
            slid_ms: self.slid.saturating_mul(ROUND),
            pressures: self.air.pressures(),
        }
    }

    /// How near the watch is to a fault, as the time that the strongest doubt takes.
    #[inline]
    pub(super) const fn overdue(&self) -> Micros {
        Micros((self.doubt as u32).wrapping_mul(const { 1000 * ROUND as u32 / STRONG as u32 }))
    }
}

#[cfg(test)]
mod tests;
