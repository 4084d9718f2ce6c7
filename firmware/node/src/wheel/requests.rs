//! What a wheel board does with SYNC and with its own requests.

use super::motion::{Target, whole_velocity};
use super::node::WheelNode;
use super::settings::WheelSettings;
use crate::board::{Application, BoardCore, ack};
use crate::hardware::{DumpValve, Encoder, MotorDrive, SwitchBank};
use crate::mode::{Event, Mode, ModeRules};
use wheeleg_protocol::param::WheelParam;
use wheeleg_protocol::{
    Fault, InputBits, LimitBits, Message, NackReason, ParamValue, Position, SlotReply, Sync,
    WheelControlMode,
};
use wheeleg_units::Micros;

impl<M: MotorDrive, E: Encoder, P: SwitchBank, D: DumpValve> Application for WheelNode<M, E, P, D> {
    fn core(&mut self) -> &mut BoardCore {
        &mut self.core
    }

    fn is_healthy(&self) -> bool {
        // An encoder shows its faults only when driven.
        true
    }

    fn armed(&mut self) {
        self.change(Self::engage);
    }

    fn sync(&mut self, sync: &Sync, at: Micros) {
        let setpoint = sync.slots.wheel(self.core.identity.address);
        // A wheel has nothing to exhaust: Hold is its last stage.
        self.core.supervisor.allow_exhaust(false);
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
                    self.aim(Target::at(self.controller.command()));
                }
            }
        }
    }

    fn slot_reply(&self) -> SlotReply {
        let snapshot = &self.snapshot;
        let supply = if snapshot.supply_present {
            InputBits::SUPPLY_PRESSURE
        } else {
            InputBits::NONE
        };
        let dump = if snapshot.dump_open {
            InputBits::DUMP_OPEN
        } else {
            InputBits::NONE
        };
        SlotReply {
            position_raw: snapshot.count.get(),
            velocity_raw: self.velocity_raw(),
            effort_raw: i16::from(snapshot.drive_percent),
            active_faults: self.core.supervisor.faults().latched(),
            mode: self.core.mode(),
            limits: snapshot.limits,
            inputs: supply.with(dump),
            sync_echo: 0,
        }
    }

    fn request(&mut self, request: &Message, at: Micros) -> Result<Message, NackReason> {
        use WheelParam as P;
        match request {
            Message::TransmitPosition(_) => return Ok(self.position().into()),
            Message::WheelReference(command) => {
                self.check_motion(command.deadline_cycle)?;
                match self.control_mode {
                    WheelControlMode::Position | WheelControlMode::Trapezoidal => {}
                    _ => return Err(NackReason::WrongMode),
                }
                self.aim(Target::at(command.position.get()));
            }
            Message::WheelVelocity(command) => {
                self.check_motion(command.deadline_cycle)?;
                self.check_velocity(command.velocity_raw)?;
                let velocity_raw = command.velocity_raw;
                self.change(|node| {
                    node.target = Target::turning(node.state.actual, velocity_raw);
                });
            }
            Message::WheelMode(command) => self.select_mode(command.mode)?,
            Message::WheelMaxSpeed(command) => {
                self.set_parameters(&[(P::MaxSpeed.id(), i32::from(command.speed.get()))], at)?;
            }
            Message::WheelAcceleration(command) => {
                let raw = i32::from(command.acceleration.raw());
                self.set_parameters(&[(P::Acceleration.id(), raw)], at)?;
            }
            Message::WheelFilter(command) => self.set_parameters(
                &[
                    (P::FilterZero.id(), i32::from(command.zero)),
                    (P::FilterPole.id(), i32::from(command.pole)),
                    (P::FilterGain.id(), i32::from(command.gain)),
                ],
                at,
            )?,
            Message::WheelSampleTimer(command) => {
                self.set_parameters(&[(P::SampleTimer.id(), i32::from(command.timer))], at)?;
            }
            Message::ParamGet(command) => {
                return Ok(ParamValue {
                    id: command.id,
                    value: self.parameters.by_id(command.id)?,
                }
                .into());
            }
            Message::ParamSet(command) => {
                self.set_parameters(&[(command.id, command.value)], at)?;
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

impl<M: MotorDrive, E: Encoder, P: SwitchBank, D: DumpValve> WheelNode<M, E, P, D> {
    /// 12.4 counts per sample, saturating.
    fn velocity_raw(&self) -> i16 {
        let velocity = self.snapshot.control.velocity.saturating_mul(16);
        velocity.clamp(i16::MIN.into(), i16::MAX.into()) as i16
    }

    fn position(&self) -> Position {
        Position {
            position_raw: self.snapshot.count.get(),
            velocity_raw: self.velocity_raw(),
            cycle: self.core.cycle,
            age_us: self.core.age_us(self.snapshot.at),
        }
    }

    /// Motion outside the SYNC slots is for an armed wheel that is not tracking, and before the deadline.
    fn check_motion(&self, deadline_cycle: u16) -> Result<(), NackReason> {
        match self.core.mode() {
            Mode::Armed => {}
            Mode::Tracking => return Err(NackReason::WrongMode),
            _ => return Err(NackReason::NotArmed),
        }
        if self.core.in_time(deadline_cycle) {
            Ok(())
        } else {
            Err(NackReason::Expired)
        }
    }

    fn check_velocity(&self, velocity_raw: i16) -> Result<(), NackReason> {
        match self.control_mode {
            WheelControlMode::ProportionalVelocity => Ok(()),
            WheelControlMode::IntegralVelocity => {
                let whole = i16::from(whole_velocity(velocity_raw)).wrapping_shl(4);
                if whole == velocity_raw {
                    Ok(())
                } else {
                    Err(NackReason::OutOfRange)
                }
            }
            _ => Err(NackReason::WrongMode),
        }
    }

    /// Changes the controller mode, unless the wheel is tracking. An armed wheel then stops and holds its position.
    fn select_mode(&mut self, mode: WheelControlMode) -> Result<(), NackReason> {
        if self.core.mode() == Mode::Tracking {
            return Err(NackReason::WrongMode);
        }
        let settings = WheelSettings::new(&self.parameters, mode).ok_or(NackReason::OutOfRange)?;
        self.change(|node| {
            node.settings = settings;
            node.control_mode = mode;
            if node.core.mode() == Mode::Armed {
                node.engage();
            }
        });
        Ok(())
    }

    /// Sets all of these parameters, or changes nothing.
    fn set_parameters(&mut self, changes: &[(u16, i32)], at: Micros) -> Result<(), NackReason> {
        // Under other limits there may be no error, but what was found remains valid.
        if self.is_behind() {
            self.axis_fault(Fault::FollowingError, at);
        }
        let disarmed = self.core.mode().is_disarmed();
        let mut trial = self.parameters;
        for (id, raw) in changes {
            trial = trial.with(*id, *raw, disarmed)?;
        }
        let settings =
            WheelSettings::new(&trial, self.control_mode).ok_or(NackReason::OutOfRange)?;
        self.change(|node| {
            node.settings = settings;
            node.parameters = trial;
            node.core.parameters_changed();
            if node.core.times.tick != settings.times.tick {
                node.core.supervisor.restart_timing();
            }
            node.core.times = settings.times;
            node.tune();
        });
        Ok(())
    }
}
