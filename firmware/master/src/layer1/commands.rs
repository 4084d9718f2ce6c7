//! Commands of the gait level.

use super::foot::FootTrajectory;
use super::homing::Homing;
use super::square::SquareGait;
use super::walk::Walk;
use super::{Layer1, Mode};
use crate::command::Command;
use crate::dispatcher::{Accepted, Refusal};

impl Layer1 {
    /// Starts a command. `Ok(true)` if it is completed at once, `Ok(false)` if its end is reported later.
    pub(super) fn execute(&mut self, accepted: &Accepted, now_us: u64) -> Result<bool, Refusal> {
        let moving = matches!(
            self.mode,
            Mode::Homing(_) | Mode::Gait(_) | Mode::Walk(_) | Mode::Foot(_)
        );
        let allowed = self.feedback.motion_allowed;
        match accepted.command {
            Command::SetGait(params) => {
                if moving {
                    return Err(Refusal::Moving);
                }
                params.validate().map_err(Refusal::Parameter)?;
                let moved = self.pose(&params) != self.pose(&self.params);
                self.params = params;
                if let (true, Mode::Ready(last)) = (moved, self.mode) {
                    self.mode = Mode::Done(last);
                }
                return Ok(true);
            }
            _ if !allowed => return Err(Refusal::NotArmed),
            Command::Hold => {
                self.holds = self.holds.wrapping_add(1);
                let frozen = self.frozen(now_us);
                self.mode = Mode::Done(frozen);
                return Ok(true);
            }
            Command::StopGait => {
                match &mut self.mode {
                    Mode::Gait(gait) => gait.stop_after_step(now_us),
                    Mode::Walk(walk) => walk.stop(),
                    _ => return Err(Refusal::NotMoving),
                }
                return Ok(true);
            }
            Command::Walk(order) => {
                if let Mode::Walk(walk) = &mut self.mode {
                    walk.change(order).map_err(Refusal::Parameter)?;
                    return Ok(true);
                }
                if moving {
                    return Err(Refusal::Moving);
                }
                order.validate().map_err(Refusal::Parameter)?;
                let geometry = self.walks.ok_or(Refusal::WheelsNotStreamed)?;
                let segment = self.segment.wrapping_add(1);
                let walk = Walk::new(geometry, order, &self.feedback, segment)
                    .map_err(Refusal::Parameter)?;
                self.mode = Mode::Walk(walk.ok_or(Refusal::NodeMissing {
                    node: self.unheard(),
                })?);
            }
            _ if moving => return Err(Refusal::Moving),
            Command::Stand => {
                let target = self.pose(&self.params);
                let homing = Homing::new(self.homing, target, &self.feedback).ok_or(
                    Refusal::NodeMissing {
                        node: self.unheard(),
                    },
                )?;
                // A new motion of the wheels, in which they stay where they are.
                self.segment = self.segment.wrapping_add(1);
                self.mode = Mode::Homing(homing);
            }
            Command::StartGait => {
                if !matches!(self.mode, Mode::Ready(_)) {
                    return Err(Refusal::NotAtStart);
                }
                let gait = SquareGait::new(self.params, now_us, self.segment.wrapping_add(1))
                    .map_err(Refusal::Parameter)?;
                self.mode = Mode::Gait(gait);
            }
            Command::FootTrajectory { side, shape } => {
                let Mode::Ready(start) = self.mode else {
                    return Err(Refusal::NotAtStart);
                };
                if side != self.params.stepping_leg(0) {
                    return Err(Refusal::NotAtStart);
                }
                let trajectory = FootTrajectory::new(shape, self.leg, side, start, now_us)
                    .map_err(Refusal::Parameter)?;
                self.mode = Mode::Foot(trajectory);
            }
            // Commands of layer 0 are never routed here.
            Command::JointReference { .. }
            | Command::TransmitPosition { .. }
            | Command::OpenAllValves { .. }
            | Command::BlowThrough { .. }
            | Command::EmergencyBrake { .. }
            | Command::SelectCorrection { .. }
            | Command::WheelReference { .. }
            | Command::WheelSpeed { .. }
            | Command::WheelAcceleration { .. }
            | Command::WheelFilter { .. }
            | Command::Commission
            | Command::ReadParameter { .. }
            | Command::WriteParameter { .. }
            | Command::SaveParameters { .. }
            | Command::Arm
            | Command::Disarm
            | Command::ClearFault
            | Command::EmergencyStop
            | Command::TakeControl
            | Command::ReleaseControl
            | Command::SetBehaviours(_) => return Err(Refusal::NotMoving),
        }
        self.active = Some(accepted.ticket);
        Ok(false)
    }
}
