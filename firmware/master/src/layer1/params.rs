//! Gait parameters with units, limits and typed errors.

use core::fmt;

use fixed::types::I16F16;
use wheeleg_units::{PositionMm, VelocityMmS};

use super::square::GUARD_MM;
use crate::argument::{self, Argument, OutOfRange, Seconds, Value};
use crate::contact::Side;

/// Stroke of every cylinder in mm (MODEL.md: ASSUMED, fits the axes of Figs. 12–13).
pub const STROKE_MM: PositionMm = PositionMm::from_int(180);

/// Limits a demanded stroke to the stroke of a cylinder.
pub(crate) const fn in_stroke(stroke_mm: PositionMm) -> PositionMm {
    stroke_mm.limit(PositionMm::ZERO, STROKE_MM)
}

/// Which leg steps when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// One leg makes every step; the other holds its place, foot on the ground. This is the test of the paper's Figs.
    /// 12–16 (three steps of one leg).
    Single(
        /// The stepping leg.
        Side,
    ),
    /// The legs step in turn (L–R–L). Each push covers half the reached stroke, and both legs follow the travel: a leg
    /// swings from 0 to the full stroke, and is carried back to half by its own push and to 0 by the other leg's.
    Alternate {
        /// The leg that steps first.
        first: Side,
    },
}

/// Square-wave gait (paper Figs. 9, 12–16). Times are measured from the start of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaitParams {
    /// Number of steps ([`argument::STEPS`]).
    pub steps: u16,
    /// Duration of a step, µs. Paper: three steps in 10 s.
    pub period_us: u32,
    /// Start of the lift: reference of b6 steps to 0, µs.
    pub lift_us: u32,
    /// Start of the reach: reference of b5 steps to the full stroke, µs.
    pub reach_us: u32,
    /// Start of the lowering: reference of b6 steps to the full stroke, µs.
    pub lower_us: u32,
    /// Start of the push: the wheels drive, b5 gives way, µs.
    pub push_us: u32,
    /// Stroke of b5 and b6 used by a step, mm ([`argument::STEP_STROKE`]).
    pub stroke_mm: PositionMm,
    /// Stroke of b5 at which the held leg (or, when alternating, the second leg) stands, mm.
    pub held_leg_s5_mm: PositionMm,
    /// Stroke of b6 at which the held leg stands, mm (180 = fully extended, foot on the ground).
    pub held_leg_s6_mm: PositionMm,
    /// Stroke of both yaw cylinders, mm; 90 is straight ahead (b2 = 0.40 m).
    pub yaw_s2_mm: PositionMm,
    /// Speed of the push, mm/s ([`argument::PUSH_SPEED`]).
    pub push_speed_mm_s: VelocityMmS,
    /// Acceleration of the push, mm/s² ([`argument::PUSH_ACCELERATION`]).
    pub push_acceleration_mm_s2: I16F16,
    /// Which leg steps when.
    pub pattern: Pattern,
    /// Speed of a foot near the ground, mm/s ([`argument::TOUCHDOWN_SPEED`]); 0: the reference of
    /// b6 jumps to the full stroke, as in the paper.
    pub touchdown_speed_mm_s: VelocityMmS,
    /// Stop the lowering of a foot at the stroke where its switches close.
    pub touchdown_reflex: bool,
}

impl Default for GaitParams {
    /// The paper's test: MODEL.md §6.2.
    fn default() -> Self {
        Self {
            steps: 3,
            period_us: 3_333_333,
            lift_us: 100_000,
            reach_us: 500_000,
            lower_us: 1_000_000,
            push_us: 2_000_000,
            stroke_mm: STROKE_MM,
            held_leg_s5_mm: PositionMm::from_int(90),
            held_leg_s6_mm: STROKE_MM,
            yaw_s2_mm: PositionMm::from_int(90),
            push_speed_mm_s: VelocityMmS::from_int(180),
            push_acceleration_mm_s2: const { I16F16::lit("600") },
            pattern: Pattern::Single(Side::Left),
            touchdown_speed_mm_s: VelocityMmS::ZERO,
            touchdown_reflex: false,
        }
    }
}

/// Why a parameter set is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParamError {
    /// A value is outside its range.
    OutOfRange(
        /// Which, and its range.
        OutOfRange,
    ),
    /// An instant of the gait is not before another one. The order is: lift before reach and before lower, both before
    /// push, push before period.
    Order {
        /// The instant that must come first.
        first: &'static Argument,
        /// Its value, µs.
        first_us: u32,
        /// The instant that must come later.
        then: &'static Argument,
        /// Its value, µs.
        then_us: u32,
    },
    /// The push takes longer than the step leaves for it.
    PushTooLong {
        /// Time needed, µs.
        needs_us: u32,
        /// Time available, µs.
        has_us: u32,
    },
    /// The slow part of the lowering alone takes all the time until the push.
    TouchdownTooSlow {
        /// Length of the slow part: a step may have less than [`GUARD_MM`] to go down.
        way_mm: PositionMm,
        /// Time needed, µs.
        needs_us: u32,
        /// Time available, µs.
        has_us: u32,
    },
    /// A number is not finite.
    NotFinite(
        /// Which.
        &'static Argument,
    ),
    /// The foot trajectory leaves the workspace of the leg.
    OutOfReach {
        /// Time at which it does so, ms from the start.
        at_ms: u32,
    },
    /// A move of the wheels is longer than their 24-bit counters can represent.
    BeyondCounter {
        /// Longest move in either direction, mm.
        limit_mm: PositionMm,
    },
}

impl ParamError {
    /// The arguments whose values are at fault, the main one first.
    pub fn arguments(&self) -> impl Iterator<Item = &'static Argument> + use<> {
        let list: [Option<&'static Argument>; 5] = match *self {
            Self::OutOfRange(OutOfRange { argument, .. }) | Self::NotFinite(argument) => {
                [Some(argument), None, None, None, None]
            }
            Self::Order { first, then, .. } => [Some(then), Some(first), None, None, None],
            Self::PushTooLong { .. } => [
                Some(&argument::PERIOD),
                Some(&argument::PUSH),
                Some(&argument::STEP_STROKE),
                Some(&argument::PUSH_SPEED),
                Some(&argument::PUSH_ACCELERATION),
            ],
            Self::TouchdownTooSlow { .. } => [
                Some(&argument::TOUCHDOWN_SPEED),
                Some(&argument::LOWER),
                Some(&argument::PUSH),
                Some(&argument::STEP_STROKE),
                None,
            ],
            Self::OutOfReach { .. } => [
                Some(&argument::FORWARD),
                Some(&argument::LEFT),
                Some(&argument::HEIGHT),
                None,
                None,
            ],
            Self::BeyondCounter { .. } => [Some(&argument::TRAVEL), None, None, None, None],
        };
        list.into_iter().flatten()
    }
}

impl fmt::Display for ParamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::OutOfRange(error) => error.fmt(f),
            Self::Order {
                first,
                first_us,
                then,
                then_us,
            } => write!(
                f,
                "`{}` is {} s and must be less than `{}`, which is {} s; allowed: lift before \
                 reach and lower, these before push, push before period",
                first.name,
                Seconds(first_us),
                then.name,
                Seconds(then_us)
            ),
            Self::PushTooLong { needs_us, has_us } => write!(
                f,
                "with this `stroke`, `push_speed` and `push_acceleration` the push takes {} s, \
                 but from `push` to the end of the `period` there are {} s; allowed: `period` at \
                 least {} s after `push`",
                Seconds(needs_us),
                Seconds(has_us),
                Seconds(needs_us)
            ),
            Self::TouchdownTooSlow {
                way_mm,
                needs_us,
                has_us,
            } => write!(
                f,
                "with this `touchdown_speed` the last {} mm of the lowering take {} s, but from `lower` \
                 to `push` there are {} s; allowed: `touchdown_speed` 0, or `push` more than {} s after \
                 `lower`",
                way_mm.get(),
                Seconds(needs_us),
                Seconds(has_us),
                Seconds(needs_us)
            ),
            Self::NotFinite(argument) => write!(
                f,
                "`{}` is not a finite number; allowed: {}",
                argument.name,
                argument.range()
            ),
            Self::OutOfReach { at_ms } => write!(
                f,
                "the foot would leave the reach of its leg {} s after the start; allowed: a \
                 smaller `forward`, `left` or `height`",
                Seconds(at_ms.saturating_mul(1000))
            ),
            Self::BeyondCounter { limit_mm } => write!(
                f,
                "`travel` is longer than the wheels' counters can tell; allowed: -{0} to {0} mm",
                limit_mm.get()
            ),
        }
    }
}

impl core::error::Error for ParamError {}

impl GaitParams {
    /// Checks every limit and every relation.
    ///
    /// # Errors
    /// The first violation found.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.violations().next().map_or(Ok(()), Err)
    }

    /// Every limit and relation that these parameters violate.
    pub fn violations(&self) -> impl Iterator<Item = ParamError> + use<> {
        let ranges = self.values().into_iter().filter_map(|(argument, value)| {
            let checked = argument.check(value);
            checked.err().map(ParamError::OutOfRange)
        });
        let [lift, reach, lower, push, period] = [
            (&argument::LIFT, self.lift_us),
            (&argument::REACH, self.reach_us),
            (&argument::LOWER, self.lower_us),
            (&argument::PUSH, self.push_us),
            (&argument::PERIOD, self.period_us),
        ];
        let order = [
            (lift, reach),
            (lift, lower),
            (reach, push),
            (lower, push),
            (push, period),
        ];
        let order = order.into_iter().filter(|(first, then)| first.1 >= then.1);
        let order = order.map(|((first, first_us), (then, then_us))| ParamError::Order {
            first,
            first_us,
            then,
            then_us,
        });
        ranges
            .chain(order)
            .chain(self.push_too_long())
            .chain(self.touchdown_too_slow())
    }

    /// The values that have a range of their own.
    fn values(&self) -> [(&'static Argument, Value); 13] {
        [
            (&argument::STEPS, Value::Whole(i32::from(self.steps))),
            (&argument::PERIOD, Value::Micros(self.period_us)),
            (&argument::LIFT, Value::Micros(self.lift_us)),
            (&argument::REACH, Value::Micros(self.reach_us)),
            (&argument::LOWER, Value::Micros(self.lower_us)),
            (&argument::PUSH, Value::Micros(self.push_us)),
            (&argument::STEP_STROKE, Value::Fixed(self.stroke_mm.get())),
            (
                &argument::HELD_LEG_S5,
                Value::Fixed(self.held_leg_s5_mm.get()),
            ),
            (
                &argument::HELD_LEG_S6,
                Value::Fixed(self.held_leg_s6_mm.get()),
            ),
            (&argument::YAW_S2, Value::Fixed(self.yaw_s2_mm.get())),
            (
                &argument::PUSH_SPEED,
                Value::Fixed(self.push_speed_mm_s.get()),
            ),
            (
                &argument::PUSH_ACCELERATION,
                Value::Fixed(self.push_acceleration_mm_s2),
            ),
            (
                &argument::TOUCHDOWN_SPEED,
                Value::Fixed(self.touchdown_speed_mm_s.get()),
            ),
        ]
    }

    /// Whether the push ends within the step. A push after the period is out of order, which is reported separately.
    fn push_too_long(&self) -> Option<ParamError> {
        let has_us = self
            .period_us
            .checked_sub(self.push_us)
            .filter(|us| *us > 0)?;
        let push = super::profile::Trapezoid::new(
            self.push_distance_mm(self.stroke_mm).get().to_num::<f32>(),
            self.push_speed_mm_s.get().to_num::<f32>(),
            self.push_acceleration_mm_s2.to_num::<f32>(),
        );
        let needs_us = super::units::seconds_to_us(push.duration_s());
        (needs_us > has_us).then_some(ParamError::PushTooLong { needs_us, has_us })
    }

    /// Whether a foot would still be lowering slowly when the push begins. The fast part before it ends when the piston
    /// arrives, which takes a time that is not known here.
    fn touchdown_too_slow(&self) -> Option<ParamError> {
        let has_us = self
            .push_us
            .checked_sub(self.lower_us)
            .filter(|us| *us > 0)?;
        let speed_mm_s = self.touchdown_speed_mm_s.get().to_num::<f32>();
        // At 0 the reference jumps.
        if speed_mm_s <= 0.0 {
            return None;
        }
        let way_mm = self.slow_way_mm();
        let needs_us = super::units::seconds_to_us(way_mm.get().to_num::<f32>() / speed_mm_s);
        (needs_us >= has_us).then_some(ParamError::TouchdownTooSlow {
            way_mm,
            needs_us,
            has_us,
        })
    }

    /// The part of the lowering at the touchdown speed: all of it, if a step is short.
    #[must_use]
    pub fn slow_way_mm(&self) -> PositionMm {
        self.stroke_mm.limit(PositionMm::ZERO, GUARD_MM)
    }

    /// Leg that steps in step `k`.
    #[must_use]
    pub const fn stepping_leg(&self, k: u16) -> Side {
        match (self.pattern, k.is_multiple_of(2)) {
            (Pattern::Single(side), _) => side,
            (Pattern::Alternate { first }, true) => first,
            (Pattern::Alternate { first }, false) => first.other(),
        }
    }

    /// Distance of the push in mm for a stroke `reached_mm` of b5.
    #[must_use]
    pub fn push_distance_mm(&self, reached_mm: PositionMm) -> PositionMm {
        match self.pattern {
            Pattern::Single(_) => reached_mm,
            Pattern::Alternate { .. } => PositionMm::from_raw(reached_mm.raw() >> 1_u32),
        }
    }

    /// Start pose of a leg before step 0: strokes (s2, s5, s6) in mm.
    #[must_use]
    pub fn start_pose(&self, side: Side) -> [PositionMm; 3] {
        if side == self.stepping_leg(0) {
            // Home: vertical leg fully extended, horizontal leg drawn back.
            [self.yaw_s2_mm, PositionMm::ZERO, self.stroke_mm]
        } else {
            [self.yaw_s2_mm, self.held_leg_s5_mm, self.held_leg_s6_mm]
        }
    }
}
