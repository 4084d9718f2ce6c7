//! What a joint board does with SYNC and with its own requests.

use super::no_motion_detector::MotionWatch;
use super::node::JointNode;
use super::precharge::Precharge;
use super::reference::Target;
use super::settings::JointSettings;
use crate::board::{Application, BoardCore, ack};
use crate::hardware::{PositionSensor, SwitchBank, ValveBank};
use crate::mode::{Event, Mode, ModeRules};
use wheeleg_control::joint::Correction;
use wheeleg_protocol::{
    Correction as WireCorrection, InputBits, LimitBits, LinkLossAction, Message, NackReason,
    OpenMode, ParamValue, Position, PositionReference, SlotReply, Sync,
};
use wheeleg_units::{Micros, Ticks};

impl<V: ValveBank, S: PositionSensor, W: SwitchBank> Application for JointNode<V, S, W> {
    fn core(&mut self) -> &mut BoardCore {
        &mut self.core
    }

    fn is_healthy(&self) -> bool {
        self.monitor.is_settled()
    }

    fn armed(&mut self) {
        self.change(|node| {
            // Here, and not only in ticks at rest: disarming and arming may fall between two ticks.
            node.state.start_from(node.state.measured);
            node.state.following = Ticks::ZERO;
            node.target = Target::at(node.state.measured);
            node.state.precharge = Precharge::begin(&mut node.state.motion, &node.settings);
        });
    }

    fn sync(&mut self, sync: &Sync, at: Micros) {
        let setpoint = sync.slots.joint(self.core.identity.address);
        let exhaust =
            setpoint.is_some_and(|slot| slot.on_link_loss == LinkLossAction::HoldThenExhaust);
        self.core.supervisor.allow_exhaust(exhaust);
        let was_tracking = self.core.mode() == Mode::Tracking;
        match setpoint.filter(|slot| slot.track) {
            Some(setpoint) => {
                // Refused unless armed: a set-point alone moves nothing.
                if self.core.supervisor.apply(Event::SetpointValid, at).is_ok() {
                    self.aim(Target::from_setpoint(&setpoint));
                }
            }
            None => {
                let withdrawn = self.core.supervisor.apply(Event::SetpointWithdrawn, at);
                if withdrawn.is_ok() && was_tracking {
                    self.aim(Target::at(self.state.reference.position));
                }
            }
        }
    }

    fn slot_reply(&self) -> SlotReply {
        let snapshot = &self.snapshot;
        SlotReply {
            position_raw: snapshot.measured.raw(),
            velocity_raw: snapshot.velocity.to_wire().to_bits(),
            effort_raw: snapshot.duty.to_wire().to_bits(),
            active_faults: self.core.supervisor.faults().latched(),
            mode: self.core.mode(),
            limits: snapshot.limits,
            inputs: InputBits::from_raw(snapshot.switches & InputBits::FOOT.raw())
                .unwrap_or(InputBits::NONE),
            sync_echo: 0,
        }
    }

    fn request(&mut self, request: &Message, at: Micros) -> Result<Message, NackReason> {
        match request {
            Message::TransmitPosition(_) => return Ok(self.position().into()),
            Message::PositionReference(command) => self.position_reference(command)?,
            Message::OpenAllValves(command) => {
                let event = match command.mode {
                    OpenMode::Exhaust => Event::OpenAllValves,
                    // Inlets are never opened after something went wrong.
                    OpenMode::BlowThrough
                        if !self.core.supervisor.faults().latched().is_empty() =>
                    {
                        return Err(NackReason::FaultLatched);
                    }
                    OpenMode::BlowThrough => Event::BlowThrough,
                };
                self.core.supervisor.apply(event, at)?;
            }
            Message::SelectCorrection(command) => {
                let correction = match command.correction {
                    WireCorrection::Pd => Correction::Pd,
                    WireCorrection::Id => Correction::Id,
                };
                self.change(|node| node.controller.set_correction(correction));
            }
            Message::ParamGet(command) => {
                return Ok(ParamValue {
                    id: command.id,
                    value: self.parameters.by_id(command.id)?,
                }
                .into());
            }
            Message::ParamSet(command) => {
                self.set_parameter(command.id, command.value, at)?;
                return Ok(ParamValue {
                    id: command.id,
                    value: command.value,
                }
                .into());
            }
            _ => return Err(NackReason::WrongBoard),
        }
        Ok(ack(request))
    }

    fn limits(&self) -> LimitBits {
        self.snapshot.limits
    }

    fn parameter_sum(&self) -> u32 {
        self.parameters.sum()
    }
}

impl<V: ValveBank, S: PositionSensor, W: SwitchBank> JointNode<V, S, W> {
    fn position(&self) -> Position {
        Position {
            position_raw: self.snapshot.measured.raw(),
            velocity_raw: self.snapshot.velocity.to_wire().to_bits(),
            cycle: self.core.cycle,
            age_us: self.core.age_us(self.snapshot.at),
        }
    }

    /// The board command of the paper: a reference outside the SYNC slots, for an armed axis that is not tracking.
    fn position_reference(&mut self, command: &PositionReference) -> Result<(), NackReason> {
        match self.core.mode() {
            // It would wait past its deadline.
            Mode::Armed if self.state.precharge.is_under_way() => return Err(NackReason::Busy),
            Mode::Armed => {}
            Mode::Tracking => return Err(NackReason::WrongMode),
            _ => return Err(NackReason::NotArmed),
        }
        if !self.core.in_time(command.deadline_cycle) {
            return Err(NackReason::Expired);
        }
        let gains = self.controller.config().gains();
        let reference = command.reference();
        if reference < gains.stroke_min || reference > gains.stroke_max {
            return Err(NackReason::OutOfRange);
        }
        self.aim(Target::at(reference));
        Ok(())
    }

    /// Sets one parameter, or changes nothing.
    #[inline(never)]
    fn set_parameter(&mut self, id: u16, raw: i32, at: Micros) -> Result<(), NackReason> {
        // The watches restart with other units or limits, but what they have found remains valid.
        if let Some(fault) = self.found() {
            self.axis_fault(fault, at);
        }
        let disarmed = self.core.mode().is_disarmed();
        let trial = self.parameters.with(id, raw, disarmed)?;
        // By reference: each move of the settings would cost hundreds of bytes of code.
        let Some(settings) = &JointSettings::new(&trial) else {
            return Err(NackReason::OutOfRange);
        };
        self.change(|node| {
            let sensor_differs = settings.tick.sensor != node.settings.sensor;
            if sensor_differs {
                // Another calibration moves the stroke without a motion: this is neither a rate fault nor a velocity.
                // The new calibration has to prove itself before the board may arm.
                node.monitor.restart();
                node.controller.reset();
            }
            if sensor_differs || settings.tick.motion != node.settings.motion {
                // Other units or positions: nothing that was learnt remains valid.
                node.state.motion = MotionWatch::new(&settings.tick.motion, node.state.measured);
            }
            if settings.tick.correction != node.settings.correction {
                node.controller.set_correction(settings.tick.correction);
            }
            node.controller.retune(settings.control);
            node.pwm.set_timing(settings.timing);
            node.core.times = settings.times;
            node.settings = settings.tick;
            node.parameters = trial;
            node.core.parameters_changed();
        });
        Ok(())
    }
}
