//! Gait parameters with units, limits and typed errors.

use fixed::types::I16F16;
use wheeleg_units::{PositionMm, VelocityMmS};

use crate::contact::Side;

/// Stroke of every cylinder in mm (MODEL.md: ASSUMED, fits the axes of Figs. 12–13).
pub const STROKE_MM: PositionMm = PositionMm::from_int(180);

/// Which leg steps when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// One leg steps every time; the other holds its place, foot on the
    /// ground. The test of the paper's Figs. 12–16 (three steps of one leg).
    Single(
        /// The stepping leg.
        Side,
    ),
    /// The legs step in turn (L–R–L). Each push covers half the reached
    /// stroke, and both legs follow the travel: a leg swings from 0 to the
    /// full stroke, and is carried back to half by its own push and to 0 by
    /// the other leg's.
    Alternate {
        /// The leg that steps first.
        first: Side,
    },
}

/// Square-wave gait (paper Figs. 9, 12–16). Times count from the start of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaitParams {
    /// Number of steps, 1..=10 000.
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
    /// Stroke of b5 and b6 used by a step, mm, 1..=180.
    pub stroke_mm: PositionMm,
    /// Stroke of b5 at which the held leg (or, alternating, the second leg)
    /// stands, mm, 0..=180.
    pub held_leg_s5_mm: PositionMm,
    /// Stroke of b6 at which the held leg stands, mm, 0..=180 (180 = fully
    /// extended, foot on the ground).
    pub held_leg_s6_mm: PositionMm,
    /// Stroke of both yaw cylinders, mm, 0..=180; 90 is straight ahead (b2 = 0.40 m).
    pub yaw_s2_mm: PositionMm,
    /// Speed of the push, mm/s, 1..=400.
    pub push_speed_mm_s: VelocityMmS,
    /// Acceleration of the push, mm/s², 10..=5000.
    pub push_acceleration_mm_s2: I16F16,
    /// Which leg steps when.
    pub pattern: Pattern,
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
            touchdown_reflex: false,
        }
    }
}

/// Why a parameter set is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParamError {
    /// A value is outside its range (both ends included, unit of the field).
    OutOfRange {
        /// Field name.
        field: &'static str,
        /// Smallest value allowed.
        min: I16F16,
        /// Largest value allowed.
        max: I16F16,
        /// Value given.
        value: I16F16,
    },
    /// `steps` outside 1..=10 000.
    Steps {
        /// Value given.
        value: u16,
    },
    /// The instants are not in the order lift < reach, lift < lower, reach ≤ push,
    /// lower < push < period.
    Order {
        /// Name of the first instant out of order.
        field: &'static str,
    },
    /// The period exceeds one minute.
    PeriodTooLong {
        /// Value given, µs.
        value_us: u32,
    },
    /// The push takes longer than the step leaves for it.
    PushTooLong {
        /// Time needed, µs.
        needs_us: u32,
        /// Time available, µs.
        has_us: u32,
    },
    /// A number is not finite.
    NotFinite {
        /// Field name.
        field: &'static str,
    },
    /// The foot trajectory leaves the workspace of the leg.
    OutOfReach {
        /// Time at which it does, ms from its start.
        at_ms: u32,
    },
}

/// Checks `value` against `min..=max`.
///
/// # Errors
/// [`ParamError::OutOfRange`] with the limits.
pub fn in_range(
    field: &'static str,
    value: I16F16,
    min: I16F16,
    max: I16F16,
) -> Result<(), ParamError> {
    if value < min || value > max {
        return Err(ParamError::OutOfRange {
            field,
            min,
            max,
            value,
        });
    }
    Ok(())
}

/// Longest step, µs.
pub const PERIOD_MAX_US: u32 = 60_000_000;
/// Most steps of one run.
pub const STEPS_MAX: u16 = 10_000;

impl GaitParams {
    /// Checks every limit.
    ///
    /// # Errors
    /// The first violation found.
    pub fn validate(&self) -> Result<(), ParamError> {
        let one = const { I16F16::lit("1") };
        if self.steps == 0 || self.steps > STEPS_MAX {
            return Err(ParamError::Steps { value: self.steps });
        }
        if self.period_us > PERIOD_MAX_US {
            return Err(ParamError::PeriodTooLong {
                value_us: self.period_us,
            });
        }
        for (bad, field) in [
            (self.lift_us >= self.reach_us, "reach_us"),
            (self.lift_us >= self.lower_us, "lower_us"),
            (self.reach_us >= self.push_us, "push_us"),
            (self.lower_us >= self.push_us, "push_us"),
            (self.push_us >= self.period_us, "period_us"),
        ] {
            if bad {
                return Err(ParamError::Order { field });
            }
        }
        in_range("stroke_mm", self.stroke_mm.get(), one, STROKE_MM.get())?;
        for (field, value) in [
            ("held_leg_s5_mm", self.held_leg_s5_mm),
            ("held_leg_s6_mm", self.held_leg_s6_mm),
            ("yaw_s2_mm", self.yaw_s2_mm),
        ] {
            in_range(field, value.get(), I16F16::ZERO, STROKE_MM.get())?;
        }
        in_range(
            "push_speed_mm_s",
            self.push_speed_mm_s.get(),
            one,
            const { I16F16::lit("400") },
        )?;
        in_range(
            "push_acceleration_mm_s2",
            self.push_acceleration_mm_s2,
            const { I16F16::lit("10") },
            const { I16F16::lit("5000") },
        )?;
        let push = super::profile::Trapezoid::new(
            self.push_distance_mm(self.stroke_mm).get().to_num::<f32>(),
            self.push_speed_mm_s.get().to_num::<f32>(),
            self.push_acceleration_mm_s2.to_num::<f32>(),
        );
        let needs_us = super::units::seconds_to_us(push.duration_s());
        let has_us = self.period_us.saturating_sub(self.push_us);
        if needs_us > has_us {
            return Err(ParamError::PushTooLong { needs_us, has_us });
        }
        Ok(())
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
