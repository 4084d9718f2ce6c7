//! Slewed move of all joints to a pose, and the check that they have settled.

use fixed::types::I16F16;
use wheeleg_units::{PositionMm, VelocityMmS};

use crate::setpoint::{Feedback, JOINTS, JointSetpoint};

/// How the robot moves to its start pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HomingConfig {
    /// Speed of the references, mm/s, > 0.
    pub slew_mm_s: VelocityMmS,
    /// Largest distance from the pose that counts as settled, mm. The paper calls for "some millimetres".
    pub tolerance_mm: PositionMm,
    /// Consecutive cycles within tolerance before the pose is reached.
    pub settle_cycles: u16,
    /// Longest duration of the whole move, cycles.
    pub timeout_cycles: u16,
}

impl Default for HomingConfig {
    /// 90 mm/s (full stroke in 2 s), 3 mm, 0.3 s, 15 s (all ASSUMED).
    fn default() -> Self {
        Self {
            slew_mm_s: VelocityMmS::from_int(90),
            tolerance_mm: PositionMm::from_int(3),
            settle_cycles: 30,
            timeout_cycles: 1500,
        }
    }
}

/// State of a homing move.
#[derive(Clone, Copy, Debug)]
pub struct Homing {
    config: HomingConfig,
    target_mm: [PositionMm; JOINTS],
    reference_mm: [PositionMm; JOINTS],
    settled: u16,
    elapsed: u16,
}

/// Result of one cycle of homing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HomingStep {
    /// Still moving or settling.
    Moving,
    /// All joints settled at the pose.
    Settled,
    /// Time is up; gives the first joint (0..6) that is not within tolerance.
    TimedOut {
        /// Index of the joint.
        joint: u8,
    },
}

impl Homing {
    /// Starts from the measured strokes; `None` unless every joint was heard.
    #[must_use]
    pub fn new(
        config: HomingConfig,
        target_mm: [PositionMm; JOINTS],
        feedback: &Feedback,
    ) -> Option<Self> {
        let mut reference_mm = [PositionMm::ZERO; JOINTS];
        for (reference, measured) in reference_mm.iter_mut().zip(feedback.strokes_mm) {
            *reference = measured?;
        }
        Some(Self {
            config,
            target_mm,
            reference_mm,
            settled: 0,
            elapsed: 0,
        })
    }

    /// The target pose of this move.
    #[must_use]
    pub const fn target_mm(&self) -> [PositionMm; JOINTS] {
        self.target_mm
    }

    /// Advances by one cycle of 10 ms.
    pub fn cycle(&mut self, feedback: &Feedback) -> ([Option<JointSetpoint>; JOINTS], HomingStep) {
        // slew × 10 ms, but at least one LSB so that even a tiny slew arrives.
        let step = self
            .config
            .slew_mm_s
            .get()
            .checked_div_int(100)
            .unwrap_or(I16F16::ZERO)
            .max(I16F16::DELTA);
        let step = PositionMm::new(step);
        let mut out = [None; JOINTS];
        let mut far = None;
        let joints = self.reference_mm.iter_mut().zip(self.target_mm);
        for (index, ((reference, target), slot)) in joints.zip(out.iter_mut()).enumerate() {
            let left = target.saturating_sub(*reference);
            let back = PositionMm::ZERO.saturating_sub(step);
            *reference = reference.saturating_add(left.limit(back, step));
            let moving = *reference != target;
            let velocity_mm_s = match (moving, left > PositionMm::ZERO) {
                (false, _) => VelocityMmS::ZERO,
                (true, true) => self.config.slew_mm_s,
                (true, false) => VelocityMmS::ZERO.saturating_sub(self.config.slew_mm_s),
            };
            *slot = Some(JointSetpoint {
                reference_mm: *reference,
                velocity_mm_s,
                ..JointSetpoint::default()
            });
            let measured = feedback.strokes_mm.get(index).copied().flatten();
            let near = measured.is_some_and(|stroke| {
                stroke.saturating_sub(target).saturating_abs() <= self.config.tolerance_mm
            });
            if (moving || !near) && far.is_none() {
                far = Some(index);
            }
        }
        self.elapsed = self.elapsed.saturating_add(1);
        self.settled = if far.is_none() {
            self.settled.saturating_add(1)
        } else {
            0
        };
        let step = if self.settled >= self.config.settle_cycles {
            HomingStep::Settled
        } else if self.elapsed >= self.config.timeout_cycles {
            HomingStep::TimedOut {
                joint: far.and_then(|i| u8::try_from(i).ok()).unwrap_or(0),
            }
        } else {
            HomingStep::Moving
        };
        (out, step)
    }
}
