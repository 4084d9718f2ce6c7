//! Foot trajectory of the paper's §6 ("y = sin²(time/8)", Figs. 5–8) through inverse kinematics.
//!
//! The axes of Figs. 5–8 allow only one reading (MODEL.md §6.1): the abscissa is the argument time/8, the arch takes 8π
//! s, and with rate Ω = 1/8 rad/s
//!
//! `x = X t/T,  z = A sin²(Ω t),  T = π/Ω`.
//!
//! [`FootShape::Literal`] takes the caption word for word: z = sin²(t/8) metres over 3.5 s.

use fixed::types::I16F16;
use wheeleg_kinematics::LegParameters;
use wheeleg_units::{PositionMm, VelocityMmS};

use super::params::{ParamError, STROKE_MM, in_stroke};
use super::units::{metres, seconds_to_us, us_to_seconds};
use crate::argument::{self, Argument, Value};
use crate::contact::Side;
use crate::mirror;
use crate::setpoint::{Cylinder, JointSetpoint, OnLinkLoss, Phase, Setpoints};

/// Path of the foot relative to its starting point, in the robot's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FootShape {
    /// One arch: forward at constant speed, up and down as sin².
    Arch {
        /// Distance X forward, mm ([`argument::FORWARD`]). The 240 mm that fit Fig. 5 exceed the stroke of Figs. 12–13
        /// and are only for drawing.
        forward_mm: PositionMm,
        /// Distance to the robot's left, mm ([`argument::LEFT`]; 0 in the paper).
        left_mm: PositionMm,
        /// Height A, mm ([`argument::HEIGHT`]).
        height_mm: PositionMm,
        /// Rate Ω, rad/s ([`argument::RATE`]; 1/8 in the paper).
        rate_rad_s: f32,
    },
    /// The caption of Fig. 5 taken literally: z = sin²(t/8) m over 3.5 s, so that the foot rises 179.5 mm and stays up.
    Literal {
        /// Distance X forward, mm ([`argument::FORWARD`]).
        forward_mm: PositionMm,
    },
}

impl Default for FootShape {
    /// A = 180 mm, Ω = 1/8 rad/s; X = 180 mm, the stroke.
    fn default() -> Self {
        Self::Arch {
            forward_mm: STROKE_MM,
            left_mm: PositionMm::ZERO,
            height_mm: STROKE_MM,
            rate_rad_s: 0.125,
        }
    }
}

/// Duration of the literal variant, s.
const LITERAL_S: f32 = 3.5;

impl FootShape {
    /// Checks the limits.
    ///
    /// # Errors
    /// The first violation.
    pub fn validate(&self) -> Result<(), ParamError> {
        let length = |argument: &'static Argument, mm: PositionMm| {
            let checked = argument.check(Value::Fixed(mm.get()));
            checked.map_err(ParamError::OutOfRange)
        };
        match *self {
            Self::Arch {
                forward_mm,
                left_mm,
                height_mm,
                rate_rad_s,
            } => {
                length(&argument::FORWARD, forward_mm)?;
                length(&argument::LEFT, left_mm)?;
                length(&argument::HEIGHT, height_mm)?;
                let rate = I16F16::checked_from_num(rate_rad_s).filter(|_| rate_rad_s.is_finite());
                let rate = rate.ok_or(ParamError::NotFinite(&argument::RATE))?;
                let checked = argument::RATE.check(Value::Fixed(rate));
                checked.map_err(ParamError::OutOfRange)
            }
            Self::Literal { forward_mm } => length(&argument::FORWARD, forward_mm),
        }
    }

    /// Duration, s.
    #[must_use]
    pub fn duration_s(&self) -> f32 {
        match self {
            Self::Arch { rate_rad_s, .. } => core::f32::consts::PI / rate_rad_s,
            Self::Literal { .. } => LITERAL_S,
        }
    }

    /// Displacement (forward, left, up) in m and velocity in m/s at `t_s`.
    #[must_use]
    pub fn at(&self, t_s: f32) -> ([f32; 3], [f32; 3]) {
        let (forward_mm, left_mm, height_m, rate) = match *self {
            Self::Arch {
                forward_mm,
                left_mm,
                height_mm,
                rate_rad_s,
            } => (forward_mm, left_mm, metres(height_mm), rate_rad_s),
            Self::Literal { forward_mm } => (forward_mm, PositionMm::ZERO, 1.0, 0.125),
        };
        let duration = self.duration_s();
        // Not `clamp`, which panics for a duration that is not a number.
        let t = t_s.max(0.0).min(duration);
        let (x, y) = (metres(forward_mm), metres(left_mm));
        let (sin, cos) = (libm::sinf(rate * t), libm::cosf(rate * t));
        let moving = if t_s < duration { 1.0 / duration } else { 0.0 };
        let climb = if t_s < duration {
            2.0 * height_m * rate * sin * cos
        } else {
            0.0
        };
        (
            [x * t / duration, y * t / duration, height_m * sin * sin],
            [x * moving, y * moving, climb],
        )
    }
}

/// A foot trajectory under way.
#[derive(Clone, Copy, Debug)]
pub struct FootTrajectory {
    shape: FootShape,
    side: Side,
    leg: LegParameters<f32>,
    start: Setpoints,
    start_us: u64,
    /// Foot at the start, in the robot's axes from O4, m.
    origin_m: [f32; 3],
}

/// Number of points of the path that are checked before it is accepted.
const CHECKS: u8 = 64;

impl FootTrajectory {
    /// Prepares the path of `side`'s foot from the pose in `start`.
    ///
    /// # Errors
    /// A parameter out of range, or [`ParamError::OutOfReach`].
    pub fn new(
        shape: FootShape,
        leg: LegParameters<f32>,
        side: Side,
        start: Setpoints,
        start_us: u64,
    ) -> Result<Self, ParamError> {
        shape.validate()?;
        let stroke = |cylinder| {
            start
                .joints
                .get(side.joint(cylinder))
                .copied()
                .flatten()
                .map_or(PositionMm::ZERO, |joint| joint.reference_mm)
        };
        let strokes = [Cylinder::Yaw, Cylinder::Horizontal, Cylinder::Vertical].map(stroke);
        let origin_m = mirror::foot_of_strokes(&leg, side, strokes.map(metres))
            .ok_or(ParamError::OutOfReach { at_ms: 0 })?;
        let path = Self {
            shape,
            side,
            leg,
            start,
            start_us,
            origin_m,
        };
        let duration = shape.duration_s();
        for i in 0..=CHECKS {
            let t_s = duration * f32::from(i) / f32::from(CHECKS);
            if path.strokes_at(t_s).is_none() {
                let at_ms = seconds_to_us(t_s).checked_div(1000).unwrap_or(0);
                return Err(ParamError::OutOfReach { at_ms });
            }
        }
        Ok(path)
    }

    /// Strokes (m) and rates (m/s) of the three cylinders at `t_s`.
    fn strokes_at(&self, t_s: f32) -> Option<([f32; 3], [f32; 3])> {
        let (moved, velocity) = self.shape.at(t_s);
        let [x, y, z] = self.origin_m;
        let [dx, dy, dz] = moved;
        mirror::strokes_of_foot(&self.leg, self.side, [x + dx, y + dy, z + dz], velocity)
    }

    /// References at `now_us`. The other leg and the wheels stay as they were.
    pub fn setpoints(&mut self, now_us: u64) -> Setpoints {
        let t_s = us_to_seconds(now_us.saturating_sub(self.start_us));
        let done = t_s >= self.shape.duration_s();
        let mut out = Setpoints {
            time_us: now_us,
            phase: if done { Phase::Done } else { Phase::Trajectory },
            stepping: Some(self.side),
            ..self.start
        };
        let Some((strokes, rates)) = self.strokes_at(t_s) else {
            // The path was checked when it was accepted; between two checked points the last references are held.
            return out;
        };
        let on_link_loss = if done {
            OnLinkLoss::Hold
        } else {
            OnLinkLoss::HoldThenExhaust
        };
        let cylinders = [Cylinder::Yaw, Cylinder::Horizontal, Cylinder::Vertical];
        for (cylinder, (stroke, rate)) in cylinders.into_iter().zip(strokes.into_iter().zip(rates))
        {
            if let Some(slot) = out.joints.get_mut(self.side.joint(cylinder)) {
                *slot = Some(JointSetpoint {
                    reference_mm: in_stroke(PositionMm::from_f64(f64::from(stroke) * 1.0e3)),
                    velocity_mm_s: VelocityMmS::from_f64(f64::from(rate) * 1.0e3),
                    on_link_loss: if cylinder == Cylinder::Yaw {
                        OnLinkLoss::Hold
                    } else {
                        on_link_loss
                    },
                    ..JointSetpoint::default()
                });
            }
        }
        // Holds the end of the path in case a later point cannot be computed.
        if done {
            self.start = out;
        }
        out
    }
}
