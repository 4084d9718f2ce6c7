//! Commands of the physical level.

use wheeleg_protocol as proto;
use wheeleg_protocol::{Address, Correction, Message, OpenMode, WheelControlMode};

use super::acyclic::{ARMING_JOBS, Job, PROFILE_JOBS, Purpose};
use super::wheels::DirectMove;
use super::{Group, GroupKind, Layer0, Power};
use crate::argument::{self, Argument, Value};
use crate::command::{Command, CorrectionKind};
use crate::config::WheelDrive;
use crate::contact::Side;
use crate::dispatcher::{Accepted, Refusal};
use crate::event::{Event, Events};
use crate::layer1::params::ParamError;
use crate::setpoint::PushProfile;

impl Layer0 {
    /// Carries out a command or starts to; reports to `events`.
    pub fn execute(&mut self, accepted: &Accepted, now_us: u64, events: &mut Events) {
        let ticket = accepted.ticket;
        let result = if accepted.expired(now_us) {
            Err(Refusal::Expired)
        } else {
            self.begin(accepted, now_us, events)
        };
        match result {
            Ok(true) => events.push(now_us, Event::Done(ticket)),
            Ok(false) => {}
            Err(reason) => events.push(now_us, Event::Refused { ticket, reason }),
        }
    }

    /// `Ok(true)`: done; `Ok(false)`: the nodes' answers complete it.
    fn begin(
        &mut self,
        accepted: &Accepted,
        now_us: u64,
        events: &mut Events,
    ) -> Result<bool, Refusal> {
        // Control may have ended since the command was accepted.
        self.may_command(accepted.ticket.client, &accepted.command)?;
        match accepted.command {
            Command::Arm => self.begin_arming(accepted),
            Command::Disarm => {
                self.power = Power::Disarmed;
                self.release();
                self.drop_requests(now_us, events);
                self.begin_group(accepted, GroupKind::Disarm, &[proto::Disarm {}.into()])
            }
            Command::ClearFault => {
                self.drop_requests(now_us, events);
                self.emergency_stop = false;
                self.hold = None;
                self.frozen = None;
                self.power = Power::Disarmed;
                self.release();
                // A node that had not stopped is still armed after the clear.
                let requests = [proto::ClearFault {}.into(), proto::Disarm {}.into()];
                self.begin_group(accepted, GroupKind::Clear, &requests)
            }
            Command::JointReference { joint, stroke_mm } => {
                self.may_lead()?;
                let _exists = joint_address(joint)?;
                in_range(&argument::STROKE, Value::Fixed(stroke_mm.get()))?;
                let index = usize::from(joint).saturating_sub(1);
                if let Some(slot) = self.direct.get_mut(index) {
                    *slot = Some(stroke_mm);
                }
                Ok(true)
            }
            Command::WheelReference { travel_mm } => {
                self.may_lead()?;
                in_range(&argument::TRAVEL, Value::Fixed(travel_mm.get()))?;
                let limit = self.units.travel_limit();
                if travel_mm.get().unsigned_abs() > limit.get().unsigned_abs() {
                    return Err(Refusal::Parameter(ParamError::BeyondCounter {
                        limit_mm: limit,
                    }));
                }
                if !self
                    .wheels
                    .has_room(&travel_mm, &self.odometry, &self.units)
                {
                    return Err(Refusal::Moving);
                }
                self.direct_segment = self.direct_segment.wrapping_add(1) | 0x8000;
                self.direct_travel = Some(DirectMove::new(
                    travel_mm,
                    &self.push,
                    self.cycle_start_us,
                    self.direct_segment,
                ));
                Ok(true)
            }
            Command::OpenAllValves { joint } => {
                let mode = OpenMode::Exhaust;
                let to = joint_address(joint)?;
                self.freeze_if_armed();
                self.ask(accepted, to, proto::OpenAllValves { mode }.into())
            }
            Command::BlowThrough { joint } => {
                if self.power != Power::Disarmed {
                    return Err(Refusal::NotDisarmed);
                }
                let mode = OpenMode::BlowThrough;
                let to = joint_address(joint)?;
                self.ask(accepted, to, proto::OpenAllValves { mode }.into())
            }
            Command::EmergencyBrake { joint } => {
                let to = joint_address(joint)?;
                self.freeze_if_armed();
                self.ask(accepted, to, proto::EmergencyBrake {}.into())
            }
            Command::TransmitPosition { joint } => {
                let to = joint_address(joint)?;
                self.ask(accepted, to, proto::TransmitPosition {}.into())
            }
            Command::SelectCorrection { joint, correction } => {
                let correction = match correction {
                    CorrectionKind::Pd => Correction::Pd,
                    CorrectionKind::Id => Correction::Id,
                };
                let to = joint_address(joint)?;
                self.ask(accepted, to, proto::SelectCorrection { correction }.into())
            }
            Command::WheelSpeed { side, speed_mm_s } => {
                in_range(&argument::SPEED, Value::Fixed(speed_mm_s.get()))?;
                let speed = self.units.speed(speed_mm_s);
                self.ask(
                    accepted,
                    wheel_address(side)?,
                    proto::WheelMaxSpeed { speed }.into(),
                )
            }
            Command::WheelAcceleration {
                side,
                acceleration_mm_s2,
            } => {
                in_range(&argument::ACCELERATION, Value::Fixed(acceleration_mm_s2))?;
                let acceleration = self.units.acceleration(acceleration_mm_s2);
                let message = proto::WheelAcceleration { acceleration };
                self.ask(accepted, wheel_address(side)?, message.into())
            }
            Command::WheelFilter { side, a, b, k } => {
                let message = proto::WheelFilter {
                    zero: a,
                    pole: b,
                    gain: k,
                };
                self.ask(accepted, wheel_address(side)?, message.into())
            }
            Command::TakeControl => {
                self.take_control(now_us);
                Ok(true)
            }
            Command::ReleaseControl => self.release_control().map(|()| true),
            Command::SetBehaviours(enabled) => {
                self.behaving.enable(enabled);
                Ok(true)
            }
            Command::Commission => {
                if self.power != Power::Disarmed {
                    return Err(Refusal::NotDisarmed);
                }
                let liveness = &self.liveness;
                self.nodes
                    .commission(|index| liveness.alive(index), self.schema_hash)?;
                for to in Address::nodes() {
                    if let Some(unique_id) = self.nodes.commissioned(to) {
                        let node = to.raw();
                        events.push(now_us, Event::Commissioned { node, unique_id });
                    }
                }
                Ok(true)
            }
            Command::ReadParameter { node, id } => {
                let to = board_address(node)?;
                self.ask(accepted, to, proto::ParamGet { id }.into())
            }
            Command::WriteParameter { node, id, raw } => {
                let to = board_address(node)?;
                let message = proto::ParamSet { id, value: raw };
                self.ask(accepted, to, message.into())
            }
            Command::SaveParameters { node } => {
                if self.power != Power::Disarmed {
                    return Err(Refusal::NotDisarmed);
                }
                let to = board_address(node)?;
                if !self.jobs.has_room(2) {
                    return Err(Refusal::Busy);
                }
                // Its counts before and after show whether it was reset.
                let look = Job::new(to, proto::LinkReport {}.into(), Purpose::Report);
                let _fits = self.jobs.push(look);
                self.ask(accepted, to, proto::ParamSave {}.into())
            }
            // The E-stop does not queue, and commands of layer 1 are never routed here.
            Command::EmergencyStop
            | Command::Stand
            | Command::Hold
            | Command::StartGait
            | Command::StopGait
            | Command::Walk(_)
            | Command::SetGait(_)
            | Command::FootTrajectory { .. } => Err(Refusal::NotMoving),
        }
    }

    /// Whether the user may command single axes.
    fn may_lead(&self) -> Result<(), Refusal> {
        if self.hold.is_some() || self.frozen.is_some() {
            Err(Refusal::Latched)
        } else if self.power != Power::Armed {
            Err(Refusal::NotArmed)
        } else if self.setpoints.phase.is_moving() {
            Err(Refusal::Moving)
        } else {
            Ok(())
        }
    }

    /// A stop of one axis ends every motion; the others keep their position.
    fn freeze_if_armed(&mut self) {
        if self.power == Power::Armed && self.frozen.is_none() {
            self.freeze();
        }
    }

    fn ask(&mut self, accepted: &Accepted, to: Address, message: Message) -> Result<bool, Refusal> {
        let mut job = Job::new(to, message, Purpose::User(accepted.ticket));
        if matches!(message, Message::OpenAllValves(_)) {
            job.until_us = accepted.deadline_us;
        }
        if self.jobs.push(job) {
            Ok(false)
        } else {
            Err(Refusal::Busy)
        }
    }

    fn begin_arming(&mut self, accepted: &Accepted) -> Result<bool, Refusal> {
        if self.group.is_some() {
            return Err(Refusal::Busy);
        }
        if self.hold.is_some() || self.emergency_stop {
            return Err(Refusal::Latched);
        }
        if self.power != Power::Disarmed {
            return Err(Refusal::NotDisarmed);
        }
        let alive = |index| self.liveness.alive(index);
        if let Some(bar) = self.nodes.bar_to_arming(alive, self.schema_hash) {
            return Err(bar);
        }
        if self.has_no_air() {
            return Err(Refusal::NoAir);
        }
        // All or nothing: arming only some nodes is not acceptable.
        if !self.jobs.has_room(ARMING_JOBS) {
            return Err(Refusal::Busy);
        }
        let mode = match self.config.wheel_drive {
            WheelDrive::Profile => WheelControlMode::Trapezoidal,
            WheelDrive::Stream => WheelControlMode::Position,
        };
        let [speed, acceleration] = self.profile_messages();
        let wheel_setup = [speed, acceleration, proto::WheelMode { mode }.into()];
        let arm = Message::from(proto::Arm {
            schema_hash: self.schema_hash,
        });
        self.frozen = None;
        self.release();
        let mut left = 0_u8;
        for to in Address::nodes() {
            let setup = wheel_setup.iter().filter(|_| to.is_wheel());
            for message in setup.chain(core::iter::once(&arm)) {
                let job = Job::new(to, *message, Purpose::Group);
                // They fit, as checked above.
                left = left.saturating_add(u8::from(self.jobs.push(job)));
            }
        }
        self.power = Power::Arming;
        self.group = Some(Group {
            ticket: accepted.ticket,
            kind: GroupKind::Arm,
            left,
            failed: None,
            waited: 0,
        });
        Ok(false)
    }

    /// Messages that set the speed and acceleration of a wheel board's profiles or, if its references are streamed, the
    /// speed that these never exceed.
    fn profile_messages(&self) -> [Message; 2] {
        let push = self.push.speed_mm_s;
        let speed = match self.config.wheel_drive {
            WheelDrive::Profile => self.units.speed(push),
            WheelDrive::Stream => self.units.limit(push.max(self.config.walk.fastest_wheel())),
        };
        [
            proto::WheelMaxSpeed { speed }.into(),
            proto::WheelAcceleration {
                acceleration: self.units.acceleration(self.push.acceleration_mm_s2),
            }
            .into(),
        ]
    }

    /// Adopts the profile that layer 1 wants for its pushes. Armed wheels get it at once, the others when they arm.
    pub(super) fn shape_pushes(&mut self, push: PushProfile) {
        if push == self.push {
            return;
        }
        let tell = self.power == Power::Armed;
        // This is only a delay: layer 1 asks again in every cycle.
        if tell && !self.jobs.has_room(PROFILE_JOBS) {
            return;
        }
        self.push = push;
        if !tell {
            return;
        }
        for to in Address::nodes().filter(|node| node.is_wheel()) {
            for message in self.profile_messages() {
                // They fit, as checked above.
                let _fits = self.jobs.push(Job::new(to, message, Purpose::Profile));
            }
        }
    }

    fn begin_group(
        &mut self,
        accepted: &Accepted,
        kind: GroupKind,
        requests: &[Message],
    ) -> Result<bool, Refusal> {
        let mut left = 0_u8;
        for message in requests {
            for to in Address::nodes() {
                // A node that is not alive cannot be asked.
                if to.slot().is_none_or(|index| !self.liveness.alive(index)) {
                    continue;
                }
                let job = Job::new(to, *message, Purpose::Group);
                if self.jobs.push(job) {
                    left = left.saturating_add(1);
                }
            }
        }
        if left == 0 {
            return Ok(true);
        }
        self.group = Some(Group {
            ticket: accepted.ticket,
            kind,
            left,
            failed: None,
            waited: 0,
        });
        Ok(false)
    }
}

fn in_range(argument: &'static Argument, value: Value) -> Result<(), Refusal> {
    let checked = argument.check(value).map_err(ParamError::OutOfRange);
    checked.map_err(Refusal::Parameter)
}

fn joint_address(joint: u8) -> Result<Address, Refusal> {
    Address::joint(joint).ok_or(Refusal::NoSuchJoint { joint })
}

fn board_address(node: u8) -> Result<Address, Refusal> {
    Address::new(node)
        .filter(|address| address.is_node())
        .ok_or(Refusal::NoSuchBoard { node })
}

fn wheel_address(side: Side) -> Result<Address, Refusal> {
    let number = match side {
        Side::Left => 7,
        Side::Right => 8,
    };
    Address::wheel(number).ok_or(Refusal::NoSuchJoint { joint: number })
}
