//! The square-wave gait of the paper's Figs. 9 and 12–16 (MODEL.md §6.2).
//!
//! The references are steps; the smooth curves of the figures are the responses of the cylinders. Within step `k`, with
//! `u` the time since its start:
//!
//! | u | b6 of the stepping leg | b5 of the stepping leg | wheels |
//! |---|---|---|---|
//! | 0 to lift | stroke | as before | stopped |
//! | lift to reach | 0 | 0 | stopped |
//! | reach to lower | 0 | stroke | stopped |
//! | lower to push | stroke | stroke | stopped |
//! | push to end | stroke | stroke reached − measured travel | trapezoid |
//!
//! With a touchdown speed the lowering has two parts (`touchdown`).

mod ahead;
mod touchdown;

pub use touchdown::GUARD_MM;
use wheeleg_units::{PositionMm, VelocityMmS};

use super::params::{GaitParams, ParamError, Pattern};
use super::profile::Trapezoid;
use super::units::{seconds_to_us, um_to_mm, us_to_seconds};
use crate::contact::Side;
use crate::setpoint::{
    Cylinder, Feedback, JointSetpoint, OnLinkLoss, Phase, Reflex, Setpoints, TravelSetpoint,
    WHEELS, WheelTravel,
};
use touchdown::Touchdown;

/// Progress of a running square-wave gait.
#[derive(Clone, Copy, Debug)]
pub struct SquareGait {
    params: GaitParams,
    start_us: u64,
    /// Number of steps to do; reduced by [`Self::stop_after_step`].
    steps: u16,
    /// Step whose push has been set up, if any.
    pushed: Option<u16>,
    push: Trapezoid,
    /// Stroke of b5 from which a standing leg follows the travel.
    standing_mm: [PositionMm; WHEELS],
    /// Measured travel when the present push began.
    travel_origin_um: i64,
    segment: u16,
    /// Which legs have been lowered since they were last lifted.
    lowered: [bool; WHEELS],
    /// How each foot comes down.
    touchdown: [Touchdown; WHEELS],
}

/// Step number, time within it, and phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Instant {
    elapsed_us: u64,
    step: u16,
    u_us: u32,
    phase: Phase,
}

impl SquareGait {
    /// Starts the gait clock at `start_us`; the robot stands in the start pose of the parameters. `segment` numbers the
    /// first motion of the wheels.
    ///
    /// # Errors
    /// The first limit that the parameters violate.
    pub fn new(params: GaitParams, start_us: u64, segment: u16) -> Result<Self, ParamError> {
        params.validate()?;
        let s5 = |side| {
            let [_, s5, _] = params.start_pose(side);
            s5
        };
        Ok(Self {
            params,
            start_us,
            steps: params.steps,
            pushed: None,
            push: Trapezoid::new(0.0, 0.0, 0.0),
            standing_mm: [s5(Side::Left), s5(Side::Right)],
            travel_origin_um: 0,
            segment,
            lowered: [false; WHEELS],
            touchdown: [Touchdown::new(params.stroke_mm, params.touchdown_speed_mm_s); WHEELS],
        })
    }

    /// Ends the gait after the step that is under way at `now_us`.
    pub fn stop_after_step(&mut self, now_us: u64) {
        let step = self.instant(now_us).step;
        self.steps = self.steps.min(step.saturating_add(1));
    }

    /// Number of steps that will have been done when the gait ends.
    #[must_use]
    pub const fn steps(&self) -> u16 {
        self.steps
    }

    /// Number of the present motion of the wheels.
    #[must_use]
    pub const fn segment(&self) -> u16 {
        self.segment
    }

    /// The references at `now_us`.
    pub fn setpoints(&mut self, now_us: u64, feedback: &Feedback) -> Setpoints {
        let at = self.instant(now_us);
        let stepping = self.params.stepping_leg(at.step);
        if matches!(at.phase, Phase::Push | Phase::Rest) && self.pushed != Some(at.step) {
            self.begin_push(at.step, stepping, feedback);
        }
        let phase = self.refine_push(at);
        if let Some(lowered) = self.lowered.get_mut(stepping.index()) {
            match phase {
                Phase::Lift | Phase::Reach => *lowered = false,
                Phase::Lower | Phase::Push | Phase::Rest => *lowered = true,
                _ => {}
            }
        }
        let stroke = feedback
            .strokes_mm
            .get(stepping.joint(Cylinder::Vertical))
            .copied()
            .flatten();
        if let Some(touchdown) = self.touchdown.get_mut(stepping.index()) {
            touchdown.update(now_us, phase, stroke);
        }
        let mut out = Setpoints::idle(now_us);
        out.phase = phase;
        out.step = at.step;
        out.stepping = Some(stepping);
        for side in [Side::Left, Side::Right] {
            for cylinder in [Cylinder::Yaw, Cylinder::Horizontal, Cylinder::Vertical] {
                if let Some(slot) = out.joints.get_mut(side.joint(cylinder)) {
                    *slot = Some(self.joint(side, cylinder, at, phase));
                }
            }
        }
        out.travel = Some(self.travel(at));
        out
    }

    fn instant(&self, now_us: u64) -> Instant {
        let p = &self.params;
        let elapsed_us = now_us.saturating_sub(self.start_us);
        let period = u64::from(p.period_us).max(1);
        let count = elapsed_us.checked_div(period).unwrap_or(0);
        let last = self.steps.saturating_sub(1);
        let done = count >= u64::from(self.steps);
        let step = u16::try_from(count).map_or(last, |k| k.min(last));
        let begun = period.saturating_mul(u64::from(step));
        let u_us = u32::try_from(elapsed_us.saturating_sub(begun)).unwrap_or(u32::MAX);
        let phase = if done {
            Phase::Done
        } else if u_us < p.lift_us {
            Phase::Unload
        } else if u_us < p.reach_us.min(p.lower_us) {
            Phase::Lift
        } else if u_us < p.lower_us {
            Phase::Reach
        } else if u_us < p.push_us {
            Phase::Lower
        } else {
            Phase::Push
        };
        Instant {
            elapsed_us,
            step,
            u_us,
            phase,
        }
    }

    /// `Push` becomes `Rest` once the profile of this step's push has ended.
    fn refine_push(&self, at: Instant) -> Phase {
        let over = self
            .params
            .push_us
            .saturating_add(seconds_to_us(self.push.duration_s()));
        if at.phase == Phase::Push && at.u_us >= over {
            Phase::Rest
        } else {
            at.phase
        }
    }

    fn begin_push(&mut self, step: u16, stepping: Side, feedback: &Feedback) {
        let reached = feedback
            .strokes_mm
            .get(stepping.joint(Cylinder::Horizontal))
            .copied()
            .flatten()
            .unwrap_or(self.params.stroke_mm)
            .limit(PositionMm::ZERO, self.params.stroke_mm);
        let travelled = um_to_mm(feedback.travel_um.saturating_sub(self.travel_origin_um));
        let first = self.pushed.is_none();
        for side in [Side::Left, Side::Right] {
            let follows = self.follows(side, stepping);
            if let Some(standing) = self.standing_mm.get_mut(side.index()) {
                if side == stepping {
                    *standing = reached;
                } else if follows && !first {
                    *standing = standing.saturating_sub(travelled);
                }
            }
        }
        self.push = Trapezoid::new(
            self.params.push_distance_mm(reached).get().to_num::<f32>(),
            self.params.push_speed_mm_s.get().to_num::<f32>(),
            self.params.push_acceleration_mm_s2.to_num::<f32>(),
        );
        self.travel_origin_um = feedback.travel_um;
        self.segment = self.segment.wrapping_add(1);
        self.pushed = Some(step);
    }

    /// Whether b5 of `side` follows the travel after `stepping` has stepped.
    fn follows(&self, side: Side, stepping: Side) -> bool {
        match self.params.pattern {
            Pattern::Single(_) => side == stepping,
            Pattern::Alternate { .. } => true,
        }
    }

    /// Speed of the wheels' references at an instant.
    fn push_speed(&self, at: Instant) -> VelocityMmS {
        VelocityMmS::from_f64(f64::from(self.push_at(at).1))
    }

    /// Distance, mm, and speed, mm/s, of the push at an instant.
    fn push_at(&self, at: Instant) -> (f32, f32) {
        match self.pushed {
            Some(step) if step == at.step => self.push.at(us_to_seconds(u64::from(
                at.u_us.saturating_sub(self.params.push_us),
            ))),
            Some(_) => self.push.at(f32::INFINITY),
            None => (0.0, 0.0),
        }
    }

    fn travel(&self, at: Instant) -> TravelSetpoint {
        let (travel_mm, velocity) = self.push_at(at);
        let wheel = WheelTravel {
            travel_mm: PositionMm::from_f64(f64::from(travel_mm)),
            target_mm: PositionMm::from_f64(f64::from(self.push.distance_mm())),
            velocity_mm_s: VelocityMmS::from_f64(f64::from(velocity)),
        };
        TravelSetpoint::common(wheel, self.segment)
    }

    fn joint(&self, side: Side, cylinder: Cylinder, at: Instant, phase: Phase) -> JointSetpoint {
        let stepping = side == self.params.stepping_leg(at.step);
        let mut out = JointSetpoint::default();
        let airborne = stepping && matches!(phase, Phase::Lift | Phase::Reach);
        match cylinder {
            Cylinder::Yaw => {
                out.reference_mm = self.params.yaw_s2_mm;
                return out;
            }
            Cylinder::Horizontal => self.horizontal(&mut out, side, stepping, at, phase),
            Cylinder::Vertical => self.vertical(&mut out, side, stepping, phase),
        }
        if airborne {
            out.on_link_loss = OnLinkLoss::HoldThenExhaust;
        }
        out.ahead = self.ahead(side, cylinder, at);
        out
    }

    fn horizontal(
        &self,
        out: &mut JointSetpoint,
        side: Side,
        stepping: bool,
        at: Instant,
        phase: Phase,
    ) {
        let swinging = stepping && matches!(phase, Phase::Lift | Phase::Reach | Phase::Lower);
        if swinging {
            out.reference_mm = if at.u_us < self.params.reach_us {
                PositionMm::ZERO
            } else {
                self.params.stroke_mm
            };
            return;
        }
        out.reference_mm = self
            .standing_mm
            .get(side.index())
            .copied()
            .unwrap_or_default();
        let last_stepping = self.pushed.map(|k| self.params.stepping_leg(k));
        if last_stepping.is_some_and(|leg| self.follows(side, leg)) {
            out.reflex = Reflex::FollowTravel;
            out.velocity_mm_s = VelocityMmS::ZERO.saturating_sub(self.push_speed(at));
        }
    }

    fn vertical(&self, out: &mut JointSetpoint, side: Side, stepping: bool, phase: Phase) {
        let lowered = self.lowered.get(side.index()).copied().unwrap_or(false);
        if stepping && matches!(phase, Phase::Lift | Phase::Reach) {
            out.reference_mm = PositionMm::ZERO;
            return;
        }
        let touchdown = self.touchdown.get(side.index());
        out.reference_mm = if lowered || side == self.params.stepping_leg(0) {
            touchdown.map_or(self.params.stroke_mm, Touchdown::reference)
        } else {
            self.params.held_leg_s6_mm
        };
        if self.params.touchdown_reflex && lowered {
            out.reflex = Reflex::StopOnTouch;
        }
    }
}
