//! Stops: E-stop, HOLD of all axes, and what triggers them.

use wheeleg_protocol::{Address, EmergencyBrake, InputBits};

use super::liveness::Change;
use super::{Layer0, Power, STALL_CYCLES};
use crate::dispatcher::Refusal;
use crate::event::{Event, Events, HoldReason};
use crate::setpoint::Setpoints;

/// Index of the node with the supply-pressure switch: wheel board 7.
const SUPPLY_NODE: usize = 6;

impl Layer0 {
    /// E-stop: the bit goes out with the next SYNC and stays until cleared.
    pub fn emergency_stop(&mut self, now_us: u64, events: &mut Events) {
        self.emergency_stop = true;
        self.hold_all(HoldReason::EmergencyStop, now_us, events);
    }

    /// Stops every axis. References freeze where the joints are in the next
    /// SYNC, wheels are withdrawn, and every node is asked to brake (E-stop: the
    /// bit in SYNC does it). The first reason stays until cleared.
    pub(super) fn hold_all(&mut self, reason: HoldReason, now_us: u64, events: &mut Events) {
        if self.hold.is_some() {
            return;
        }
        self.hold = Some(reason);
        events.push(now_us, Event::Hold(reason));
        self.freeze();
        self.fail_group(Refusal::Interrupted, now_us, events);
        let dropped = |ticket| {
            let reason = Refusal::Interrupted;
            events.push(now_us, Event::Refused { ticket, reason });
        };
        if self.power != Power::Disarmed {
            self.jobs.stop_all(EmergencyBrake {}.into(), dropped);
        }
    }

    /// Keeps every joint where it was last measured and ends all references.
    pub(super) fn freeze(&mut self) {
        let mut strokes = [None; crate::setpoint::JOINTS];
        for (stroke, (_, node)) in strokes.iter_mut().zip(self.nodes.iter()) {
            *stroke = node.last.map(|reply| reply.joint_position());
        }
        self.frozen = Some(strokes);
        self.release();
    }

    /// Ends all references; the wheels' next motion begins where they are.
    pub(super) fn release(&mut self) {
        self.direct = Default::default();
        self.direct_travel = None;
        self.wheels.reset();
        self.reflexes = Default::default();
        self.setpoints = Setpoints::idle(self.cycle_start_us);
    }

    /// Ends the running group of requests with a refusal.
    pub(super) fn fail_group(&mut self, reason: Refusal, now_us: u64, events: &mut Events) {
        if let Some(group) = self.group.take() {
            let ticket = group.ticket;
            events.push(now_us, Event::Refused { ticket, reason });
        }
    }

    /// Ends a cycle for the supervision of the nodes.
    pub(super) fn supervise(&mut self, now_us: u64, events: &mut Events) {
        if self.cycle == 0 {
            // No SYNC was sent: nobody could answer.
            return;
        }
        let mut lost = None;
        let mut changes = [None; crate::setpoint::NODES];
        self.liveness.end_cycle(|index, change| {
            if let Some(slot) = changes.get_mut(index) {
                *slot = Some(change);
            }
        });
        for (index, change) in changes.into_iter().enumerate() {
            let address = Address::of_slot(index).map_or(0, Address::raw);
            match change {
                Some(Change::Lost) => {
                    lost = lost.or(Some(address));
                    self.nodes.forget(index);
                    events.push(now_us, Event::NodeLost(address));
                    match address {
                        7 => self.odometry.rebase(crate::contact::Side::Left),
                        8 => self.odometry.rebase(crate::contact::Side::Right),
                        _ => {}
                    }
                }
                Some(Change::Back) => events.push(now_us, Event::NodeBack(address)),
                None => {}
            }
        }
        if self.power == Power::Disarmed {
            return;
        }
        if let Some(node) = lost {
            self.hold_all(HoldReason::NodeLost(node), now_us, events);
        }
        if let Some((node, faults)) = self.nodes.first_fault() {
            self.hold_all(HoldReason::NodeFault { node, faults }, now_us, events);
        }
        let supply = self.nodes.get(SUPPLY_NODE).and_then(|node| node.reply);
        if supply.is_some_and(|reply| !reply.inputs.contains(InputBits::SUPPLY_PRESSURE)) {
            self.hold_all(HoldReason::SupplyLost, now_us, events);
        }
        if self.stale_cycles >= STALL_CYCLES {
            self.hold_all(HoldReason::LayerOneStalled, now_us, events);
        }
    }
}
