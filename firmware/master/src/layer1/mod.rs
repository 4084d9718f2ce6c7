//! Layer 1: gaits and foot trajectories. One call per bus cycle.
//!
//! It takes commands and measurements from its RT-FIFOs, writes one set of references per cycle to layer 0's, and
//! touches nothing else. So it can run in a thread of its own; layer 0 notices when it stops ([`Layer1::cycle`] not
//! called for 100 ms).

mod commands;
pub mod foot;
pub mod homing;
pub mod params;
pub mod profile;
pub mod square;
pub(crate) mod units;
pub mod walk;

use heapless::spsc::{Consumer, Producer};
use wheeleg_kinematics::LegParameters;
use wheeleg_units::PositionMm;

use crate::behaviour::Tally;
use crate::command::Command;
use crate::contact::Side;
use crate::dispatcher::{Accepted, Refusal, Ticket};
use crate::event::{Event, Events};
use crate::setpoint::{
    Feedback, JOINTS, JointSetpoint, Phase, PushProfile, Setpoints, TravelSetpoint,
};
use foot::FootTrajectory;
use homing::{Homing, HomingConfig, HomingStep};
use params::GaitParams;
use square::SquareGait;
use walk::{Walk, WalkGeometry};

/// Bus cycle, µs.
pub(crate) const CYCLE_US: u64 = wheeleg_protocol::link::CYCLE_US as u64;

/// What layer 1 is doing.
#[derive(Clone, Copy, Debug)]
enum Mode {
    /// No references.
    Idle,
    /// Slewing to the start pose.
    Homing(Homing),
    /// In the start pose.
    Ready(Setpoints),
    /// Stepping.
    Gait(SquareGait),
    /// Walking.
    Walk(Walk),
    /// One foot on a sinusoid.
    Foot(FootTrajectory),
    /// Last references held.
    Done(Setpoints),
}

/// State of layer 1.
#[derive(Clone, Copy, Debug)]
pub struct Layer1 {
    params: GaitParams,
    homing: HomingConfig,
    /// Dimensions of a leg.
    leg: LegParameters<f32>,
    /// What a walk needs to know of the robot; `None`: its wheels cannot be controlled in a walk.
    walks: Option<WalkGeometry>,
    mode: Mode,
    feedback: Feedback,
    /// Command whose end is still to be reported.
    active: Option<Ticket>,
    segment: u16,
    /// Number of `Hold` commands carried out (wraps).
    holds: u8,
    /// Number of the permission to move that is in force.
    permit: u16,
    lost_setpoints: u32,
    tally: Tally,
}

impl Layer1 {
    /// Idle, with the given parameters.
    ///
    /// # Errors
    /// The first limit that the gait parameters violate.
    pub fn new(
        params: GaitParams,
        homing: HomingConfig,
        leg: LegParameters<f32>,
        walks: Option<WalkGeometry>,
    ) -> Result<Self, params::ParamError> {
        params.validate()?;
        Ok(Self {
            params,
            homing,
            leg,
            walks,
            mode: Mode::Idle,
            feedback: Feedback::default(),
            active: None,
            segment: 0,
            holds: 0,
            permit: 0,
            lost_setpoints: 0,
            tally: Tally::default(),
        })
    }

    /// Gait parameters in use.
    #[must_use]
    pub const fn params(&self) -> &GaitParams {
        &self.params
    }

    /// Sets of set-points that found their queue full, since start-up (wraps).
    #[must_use]
    pub const fn lost_setpoints(&self) -> u32 {
        self.lost_setpoints
    }

    /// How often the behaviours of layer 1 have acted.
    #[must_use]
    pub const fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Runs one cycle: takes the newest feedback and all waiting commands (at most as many as the queue holds), and
    /// writes one set of references.
    pub fn cycle(
        &mut self,
        now_us: u64,
        commands: &mut Consumer<'_, Accepted>,
        feedback: &mut Consumer<'_, Feedback>,
        setpoints: &mut Producer<'_, Setpoints>,
        events: &mut Events,
    ) {
        for _ in 0..feedback.capacity() {
            match feedback.dequeue() {
                Some(newest) => self.feedback = newest,
                None => break,
            }
        }
        let permit = core::mem::replace(&mut self.permit, self.feedback.permit);
        if !self.feedback.motion_allowed || permit != self.permit {
            self.interrupt(now_us, events);
        }
        for _ in 0..commands.capacity() {
            let Some(accepted) = commands.dequeue() else {
                break;
            };
            let stop = matches!(accepted.command, Command::Hold);
            if stop && self.feedback.motion_allowed && !accepted.expired(now_us) {
                self.interrupt(now_us, events);
            }
            let answer = if accepted.expired(now_us) {
                Err(Refusal::Expired)
            } else {
                self.execute(&accepted, now_us)
            };
            match answer {
                Ok(true) => events.push(now_us, Event::Done(accepted.ticket)),
                Ok(false) => {}
                Err(reason) => events.push(
                    now_us,
                    Event::Refused {
                        ticket: accepted.ticket,
                        reason,
                    },
                ),
            }
        }
        let mut out = self.advance(now_us, events);
        out.holds = self.holds;
        out.permit = self.permit;
        out.push = Some(PushProfile {
            speed_mm_s: self.params.push_speed_mm_s,
            acceleration_mm_s2: self.params.push_acceleration_mm_s2,
        });
        if setpoints.enqueue(out).is_err() {
            self.lost_setpoints = self.lost_setpoints.wrapping_add(1);
        }
    }

    /// Drops every motion, because layer 0 reports that none is allowed.
    fn interrupt(&mut self, now_us: u64, events: &mut Events) {
        self.mode = Mode::Idle;
        if let Some(ticket) = self.active.take() {
            let reason = Refusal::Interrupted;
            events.push(now_us, Event::Refused { ticket, reason });
        }
    }

    /// Bus address of the first joint that was not heard in the last cycle.
    fn unheard(&self) -> u8 {
        let index = self.feedback.strokes_mm.iter().position(Option::is_none);
        index
            .and_then(|i| u8::try_from(i.saturating_add(1)).ok())
            .unwrap_or(0)
    }

    fn pose(&self, params: &GaitParams) -> [PositionMm; JOINTS] {
        let [l2, l5, l6] = params.start_pose(Side::Left);
        let [r2, r5, r6] = params.start_pose(Side::Right);
        [l2, l5, l6, r2, r5, r6]
    }

    /// References equal to the measured strokes; those of joints that were not heard are withdrawn.
    fn frozen(&self, now_us: u64) -> Setpoints {
        let mut out = Setpoints::idle(now_us);
        out.phase = Phase::Hold;
        for (slot, stroke) in out.joints.iter_mut().zip(self.feedback.strokes_mm) {
            *slot = stroke.map(|reference_mm| JointSetpoint {
                reference_mm,
                ..JointSetpoint::default()
            });
        }
        out
    }

    fn standing_wheels(&self) -> TravelSetpoint {
        TravelSetpoint {
            segment: self.segment,
            ..TravelSetpoint::default()
        }
    }

    fn finish(&mut self, now_us: u64, event: Event, events: &mut Events) {
        events.push(now_us, event);
        if let Some(ticket) = self.active.take() {
            events.push(now_us, Event::Done(ticket));
        }
    }

    fn advance(&mut self, now_us: u64, events: &mut Events) -> Setpoints {
        let wheels = self.standing_wheels();
        match &mut self.mode {
            Mode::Idle => Setpoints::idle(now_us),
            Mode::Ready(held) | Mode::Done(held) => Setpoints {
                time_us: now_us,
                ..*held
            },
            Mode::Homing(homing) => {
                let (joints, step) = homing.cycle(&self.feedback);
                let mut out = Setpoints::idle(now_us);
                out.phase = Phase::Homing;
                out.joints = joints;
                out.travel = Some(wheels);
                match step {
                    HomingStep::Moving => {}
                    HomingStep::Settled => {
                        out.phase = Phase::Ready;
                        self.mode = Mode::Ready(out);
                        self.finish(now_us, Event::Homed, events);
                    }
                    HomingStep::TimedOut { joint } => {
                        out.phase = Phase::Done;
                        self.mode = Mode::Done(out);
                        let joint = joint.saturating_add(1);
                        events.push(now_us, Event::HomingFailed { joint });
                        if let Some(ticket) = self.active.take() {
                            let reason = Refusal::NotSettled { joint };
                            events.push(now_us, Event::Refused { ticket, reason });
                        }
                    }
                }
                out
            }
            Mode::Gait(gait) => {
                let out = gait.setpoints(now_us, &self.feedback);
                self.segment = gait.segment();
                let steps = gait.steps();
                if out.phase == Phase::Done {
                    self.mode = Mode::Done(out);
                    self.finish(now_us, Event::GaitDone { steps }, events);
                }
                out
            }
            Mode::Walk(walk) => {
                let out = walk.setpoints(now_us, &self.feedback);
                for act in walk.take_acts() {
                    self.tally.count(act.behaviour());
                    events.push(now_us, Event::Behaviour(act));
                }
                self.segment = walk.segment();
                let steps = walk.steps();
                if out.phase == Phase::Done {
                    self.mode = Mode::Done(out);
                    self.finish(now_us, Event::GaitDone { steps }, events);
                }
                out
            }
            Mode::Foot(trajectory) => {
                let out = trajectory.setpoints(now_us);
                if out.phase == Phase::Done {
                    self.mode = Mode::Done(out);
                    self.finish(now_us, Event::TrajectoryDone, events);
                }
                out
            }
        }
    }
}
