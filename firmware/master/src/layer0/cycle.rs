//! The bus cycle: its end, the contents of SYNC, and the slots.

use core::num::NonZeroU8;

use wheeleg_protocol::{
    Address, Envelope, InputBits, JointSetpoint as WireJoint, LinkLossAction, MAX_ENCODED, Message,
    NextReference, SlotReply, Sync, SyncFlags, SyncSlots, Warning,
};
use wheeleg_units::VelocityMmS;

use super::behaviours::{JointSense, Senses, WheelSense};
use super::questions::has_started;
use super::{Layer0, Power};
use crate::TxBytes;
use crate::config::SwitchFrame;
use crate::contact::{FootSwitches, INNER, OUTER, Side};
use crate::event::{Event, Events};
use crate::layer1::params::in_stroke;
use crate::setpoint::{Cylinder, Feedback, JOINTS, JointSetpoint, OnLinkLoss, Setpoints};
use crate::telemetry::Record;

impl Layer0 {
    /// Ends the running cycle at `now_us`: supervision, odometry, feet. Returns its record and layer 1's feedback.
    pub fn finish_cycle(&mut self, now_us: u64, events: &mut Events) -> (Record, Feedback) {
        self.supervise(now_us, events);
        self.sense_feet(now_us, events);
        self.behave(now_us, events);
        let mut replies = [None; crate::setpoint::NODES];
        for (slot, (_, node)) in replies.iter_mut().zip(self.nodes.iter()) {
            *slot = node.reply;
        }
        let mut feedback = Feedback {
            time_us: self.cycle_start_us,
            strokes_mm: [None; JOINTS],
            feet: self.feet,
            travel_um: self.odometry.travel_um(),
            wheels_um: [Side::Left, Side::Right].map(|side| self.odometry.wheel_um(side)),
            acts: *self.behaving.acts(),
            motion_allowed: self.motion_allowed(),
            permit: self.permit,
        };
        for (stroke, reply) in feedback.strokes_mm.iter_mut().zip(replies) {
            *stroke = reply.map(|reply| reply.joint_position());
        }
        self.counters.missed = self.liveness.total_missed();
        self.counters.link = *self.decoder.quality();
        self.counters.behaviours = *self.behaving.tally();
        let bearing = |side: Side| self.foot(side)?.bearing_rad(side);
        let record = Record {
            cycle: self.cycle,
            time_us: self.cycle_start_us,
            phase: self.setpoints.phase,
            step: self.setpoints.step,
            armed: self.is_armed(),
            emergency_stop: self.emergency_stop,
            hold: self.hold,
            slots: self.slots,
            replies,
            feet: self.feet,
            bearing_rad: [bearing(Side::Left), bearing(Side::Right)],
            travel_um: feedback.travel_um,
            walk: self.setpoints.walk,
            acts: feedback.acts,
            counters: self.counters,
        };
        (record, feedback)
    }

    /// Starts a cycle at `now_us` with the newest set-points of layer 1, if there are any, and returns the bytes of
    /// SYNC.
    pub fn start_cycle(&mut self, now_us: u64, setpoints: Option<Setpoints>) -> TxBytes {
        let setpoints = setpoints.filter(|setpoints| setpoints.permit == self.permit);
        match setpoints.filter(|_| self.orphan.given_up.is_none()) {
            Some(setpoints) => {
                self.stale_cycles = 0;
                self.take(setpoints);
            }
            None => self.miss(),
        }
        self.cycle = self.cycle.wrapping_add(1);
        self.cycle_start_us = now_us;
        self.slots = self.build_slots(now_us);
        self.nodes.begin_cycle();
        let flags = if self.emergency_stop {
            SyncFlags::ESTOP
        } else {
            SyncFlags::NONE
        };
        // Both counters wrap by design; the casts keep their low bits.
        let sync = Message::from(Sync {
            cycle: self.cycle as u16,
            master_time_us: now_us as u32,
            flags,
            slots: self.slots,
        });
        frame_of(&sync, Address::BROADCAST, 0)
    }

    fn take(&mut self, setpoints: Setpoints) {
        // A motion of layer 1 ends the user's references of single axes, and so does a Hold.
        let held = core::mem::replace(&mut self.holds, setpoints.holds) != setpoints.holds;
        if setpoints.phase.is_moving() || held {
            self.direct = [None; JOINTS];
            self.direct_travel = None;
        }
        if held {
            // All axes stay where they are.
            self.behaving.reset();
        }
        if let Some(push) = setpoints.push {
            self.shape_pushes(push);
        }
        if self.frozen.is_none() {
            self.setpoints = setpoints;
            self.orphan.note(&setpoints, self.behaving.acts());
        }
    }

    /// Layer 1 has provided nothing for this cycle. A walk is carried on by the behaviours.
    fn miss(&mut self) {
        self.stale_cycles = self.stale_cycles.saturating_add(1);
        if self.setpoints.walk.is_some() && self.power == Power::Armed {
            let senses = self.senses();
            let acts = *self.behaving.acts();
            let walk = &self.config.walk;
            self.orphan.carry(&mut self.setpoints, &senses, &acts, walk);
        }
    }

    /// The behaviours of a walk, at the end of a cycle.
    fn behave(&mut self, now_us: u64, events: &mut Events) {
        if self.power == Power::Armed && self.frozen.is_none() {
            let senses = self.senses();
            self.behaving
                .observe(&senses, &self.setpoints, now_us, events);
            if self.orphan.given_up.is_some() {
                self.behaving.stop_wheels();
            }
        }
    }

    fn build_slots(&mut self, now_us: u64) -> SyncSlots {
        let mut slots = SyncSlots::NONE;
        if self.power != Power::Armed {
            return slots;
        }
        let senses = self.senses();
        let setpoints = self.setpoints;
        let travel_um = self.odometry.travel_um();
        self.reflexes.observe(&setpoints, &senses, travel_um);
        for (index, address) in Address::nodes().enumerate().take(JOINTS) {
            let joint = self.joint_reference(index, travel_um);
            let measured = self.nodes.get(index).and_then(|node| node.last);
            let slot = match (joint, measured) {
                (Some(joint), _) => self.wire_joint(joint),
                // No reference: the axis keeps its position.
                (None, Some(reply)) => WireJoint {
                    // Because of noise a measured stroke may lie beyond an end.
                    reference: in_stroke(reply.joint_position()),
                    velocity: VelocityMmS::ZERO.to_wire(),
                    next: None,
                    on_link_loss: LinkLossAction::Hold,
                    track: false,
                },
                (None, None) => continue,
            };
            let _is_joint = slots.set_joint(address, slot);
        }
        let direct = self.direct_travel.map(|travel| travel.setpoint(now_us));
        let (walks, fresh) = (setpoints.walk.is_some(), self.fresh());
        let led = setpoints
            .travel
            .map(|travel| self.behaving.lead(travel, walks, fresh));
        if let Some(travel) = direct.or(led) {
            for (side, number) in [(Side::Left, 7), (Side::Right, 8)] {
                let slot = self.wheels.setpoint(
                    side,
                    &travel,
                    self.config.wheel_drive,
                    &self.odometry,
                    &self.units,
                );
                if let (Some(slot), Some(address)) = (slot, Address::wheel(number)) {
                    let _is_wheel = slots.set_wheel(address, slot);
                }
            }
        }
        slots
    }

    /// Reference of joint index 0..6: frozen, the user's, or layer 1's.
    fn joint_reference(&self, index: usize, travel_um: i64) -> Option<JointSetpoint> {
        let plain = |reference_mm| JointSetpoint {
            reference_mm,
            ..JointSetpoint::default()
        };
        if let Some(frozen) = &self.frozen {
            return frozen.get(index).copied().flatten().map(plain);
        }
        if let Some(direct) = self.direct.get(index).copied().flatten() {
            return Some(plain(direct));
        }
        let setpoint = self.setpoints.joints.get(index).copied().flatten()?;
        let setpoint = self.reflexes.apply(index, setpoint, travel_um);
        let plan = self.setpoints.walk.as_ref();
        let mut setpoint = self.behaving.apply(index, setpoint, plan);
        if !self.fresh() {
            // Layer 1 is late: its last reference is held, not extrapolated.
            setpoint.velocity_mm_s = VelocityMmS::ZERO;
            setpoint.ahead = None;
        }
        Some(setpoint)
    }

    fn wire_joint(&self, joint: JointSetpoint) -> WireJoint {
        let next = joint.ahead.and_then(|ahead| {
            Some(NextReference {
                reference: ahead.reference_mm.to_wire(),
                cycles: NonZeroU8::new(ahead.cycles)?,
            })
        });
        WireJoint {
            reference: in_stroke(joint.reference_mm),
            velocity: joint.velocity_mm_s.to_wire(),
            next,
            on_link_loss: match joint.on_link_loss {
                OnLinkLoss::Hold => LinkLossAction::Hold,
                OnLinkLoss::HoldThenExhaust => LinkLossAction::HoldThenExhaust,
            },
            track: true,
        }
    }

    /// Whether layer 1 has provided the references of this cycle.
    fn fresh(&self) -> bool {
        self.stale_cycles == 0
    }

    /// The boards' reports in their slots.
    fn senses(&self) -> Senses {
        let mut senses = Senses {
            feet: self.feet,
            ..Senses::default()
        };
        for (joint, (_, node)) in senses.joints.iter_mut().zip(self.nodes.iter()) {
            *joint = node.last.as_ref().map(JointSense::of);
        }
        for (wheel, side) in senses.wheels.iter_mut().zip([Side::Left, Side::Right]) {
            let node = self.nodes.get(JOINTS.saturating_add(side.index()));
            let reply = node.and_then(|node| node.last);
            *wheel = WheelSense {
                travel_um: self.odometry.wheel_um(side),
                effort_percent: reply.map_or(0, |reply| reply.effort_raw),
            };
        }
        senses
    }

    /// Switches of a foot that count, in the leg's own frame.
    #[must_use]
    pub fn foot(&self, side: Side) -> Option<FootSwitches> {
        self.feet.get(side.index()).copied().flatten()
    }

    fn sense_feet(&mut self, now_us: u64, events: &mut Events) {
        let senses = self.senses();
        let [left_mm, right_mm] = [Side::Left, Side::Right].map(|side| senses.vertical_mm(side));
        let shorter_mm = left_mm.min(right_mm);
        let ways_um = self.foot_ways.update(&self.config.walk, &senses);
        for (side, way_um) in [Side::Left, Side::Right].into_iter().zip(ways_um) {
            let node = self.nodes.get(side.joint(Cylinder::Vertical));
            let Some(reply) = node.and_then(|node| node.reply) else {
                // Not heard in this cycle: the last state holds until the node is lost.
                continue;
            };
            let closed = self.switches(side, reply.inputs);
            // A leg that carries no load is swinging.
            let vertical = self.setpoints.joints.get(side.joint(Cylinder::Vertical));
            let swings = vertical
                .copied()
                .flatten()
                .is_some_and(|joint| joint.on_link_loss == OnLinkLoss::HoldThenExhaust);
            let b6_mm = reply.joint_position();
            let of_side = self
                .foot_watches
                .get_mut(side.index())
                .zip(self.feet.get_mut(side.index()));
            let Some((watch, foot)) = of_side else {
                continue;
            };
            let found = watch.sample(closed, b6_mm, shorter_mm, way_um, swings);
            let now = watch.believed(closed);
            let before = foot.replace(now);
            if let Some(stuck) = found {
                let warning = if stuck.closed {
                    Warning::SwitchStuckClosed
                } else {
                    Warning::SwitchStuckOpen
                };
                let sector = stuck.switch.sector(side);
                events.push(
                    now_us,
                    Event::FootSwitch {
                        side,
                        sector,
                        warning,
                    },
                );
            }
            match (before.is_some_and(FootSwitches::any), now.any()) {
                (false, true) => {
                    let sector = now.sector(side);
                    events.push(now_us, Event::TouchDown { side, sector });
                }
                (true, false) => events.push(now_us, Event::LiftOff(side)),
                _ => {}
            }
        }
    }

    /// Converts board inputs to switches in the leg's frame.
    fn switches(&self, side: Side, inputs: InputBits) -> FootSwitches {
        let raw = inputs.raw() & InputBits::FOOT.raw();
        if side == Side::Right && self.config.switch_frame == SwitchFrame::Robot {
            let other = raw & !(OUTER | INNER);
            let outer = if raw & INNER != 0 { OUTER } else { 0 };
            let inner = if raw & OUTER != 0 { INNER } else { 0 };
            return FootSwitches(other | outer | inner);
        }
        FootSwitches(raw)
    }

    /// Takes the reply of one node's slot.
    pub(super) fn on_reply(&mut self, from: Address, reply: SlotReply) {
        let Some(index) = from.slot() else {
            return;
        };
        // SYNC carries the low 16 bits of the cycle.
        if !self
            .liveness
            .on_reply(index, reply.sync_echo, self.cycle as u16)
        {
            self.counters.stale_replies = self.counters.stale_replies.wrapping_add(1);
            return;
        }
        let before = self.nodes.get(index).and_then(|node| node.last);
        self.questions.on_reply(index, before.as_ref(), &reply);
        self.nodes.store(from, reply);
        let side = match from.raw() {
            7 => Side::Left,
            8 => Side::Right,
            _ => return,
        };
        if has_started(before.as_ref(), &reply) {
            // Its counter restarts at 0: that is not motion.
            self.odometry.rebase(side);
        }
        if let Some(count) = reply.wheel_position() {
            self.odometry.update(side, count);
        }
    }
}

/// Bytes of a message from the master. Empty only if it could not be encoded, which the sizes of all messages rule out.
pub(super) fn frame_of(message: &Message, destination: Address, sequence: u16) -> TxBytes {
    let mut out = [0_u8; MAX_ENCODED];
    let envelope = Envelope {
        source: Address::MASTER,
        destination,
        sequence,
    };
    match message.emit(envelope, &mut out) {
        Ok(bytes) => TxBytes::from_slice(bytes).unwrap_or_default(),
        Err(_) => TxBytes::new(),
    }
}
