//! Stops: E-stop, HOLD of all axes, and their triggers.

use wheeleg_protocol::{Address, EmergencyBrake, InputBits, Message};

use super::acyclic::{Job, Purpose};
use super::behaviours::CARRIED;
use super::line::{Found, Spoilt};
use super::liveness::Change;
use super::nodes::Node;
use super::{GroupKind, Layer0, Power, STALL_CYCLES};
use crate::dispatcher::Refusal;
use crate::event::{Event, Events, HoldReason};
use crate::finding::Finding;
use crate::setpoint::Setpoints;

/// Number of cycles in which the nodes have to show a closed loop after the last of them has acknowledged arming …
const CONFIRM_CYCLES: u8 = 10;
/// … and the same with a precharge, which joints end by themselves after 200 cycles.
const FILL_CYCLES: u8 = 220;

/// Index of the node with the supply-pressure switch: wheel board 7.
const SUPPLY_NODE: usize = 6;

impl Layer0 {
    /// E-stop: the bit goes out with the next SYNC and stays until cleared.
    pub fn emergency_stop(&mut self, now_us: u64, events: &mut Events) {
        self.emergency_stop = true;
        // Needed if everything is held already: no waiting command may open a valve after the stop.
        self.drop_openings(now_us, events);
        self.hold_all(HoldReason::EmergencyStop, now_us, events);
    }

    /// Stops every axis. References freeze at the joints' positions in the next SYNC, wheel references are withdrawn,
    /// and every node is commanded to brake (for an E-stop the bit in SYNC does this). The first reason stays until
    /// cleared.
    pub(crate) fn hold_all(&mut self, reason: HoldReason, now_us: u64, events: &mut Events) {
        if self.hold.is_some() && self.orphan.given_up.is_none() {
            return;
        }
        self.orphan.given_up = None;
        self.hold = Some(reason);
        events.push(now_us, Event::Hold(reason));
        self.freeze();
        self.drop_requests(now_us, events);
        if self.power != Power::Disarmed && !self.emergency_stop {
            let liveness = &self.liveness;
            self.jobs
                .ask_all(EmergencyBrake {}.into(), |index| liveness.alive(index));
        }
    }

    /// Layer 1 has stopped. If the robot was walking, the behaviours bring it to a stand and keep it there for a while
    /// ([`CARRIED`]); otherwise all axes hold.
    fn give_up_layer_one(&mut self, now_us: u64, events: &mut Events) {
        let reason = HoldReason::LayerOneStalled;
        if self.hold.is_some() || self.setpoints.walk.is_none() {
            self.hold_all(reason, now_us, events);
            return;
        }
        self.hold = Some(reason);
        events.push(now_us, Event::Hold(reason));
        self.orphan.given_up = Some(0);
        self.drop_requests(now_us, events);
    }

    /// Ends the requests to open valves, waiting or under way.
    fn drop_openings(&mut self, now_us: u64, events: &mut Events) {
        let opens = |job: &Job| matches!(job.message, Message::OpenAllValves(_));
        let reason = Refusal::Interrupted;
        let mut refuse = |ticket| events.push(now_us, Event::Refused { ticket, reason });
        self.jobs.drop_where(opens, &mut refuse);
        if let Some(job) = self.in_flight.take_if(|job| opens(job)) {
            self.requester.cancel();
            if let Some(ticket) = job.purpose.ticket() {
                refuse(ticket);
            }
        }
    }

    /// Ends every request, waiting or under way, and the group they belong to.
    pub(super) fn drop_requests(&mut self, now_us: u64, events: &mut Events) {
        let reason = Refusal::Interrupted;
        let mut refuse = |ticket| events.push(now_us, Event::Refused { ticket, reason });
        self.jobs.clear(&mut refuse);
        self.requester.cancel();
        match self.in_flight.take() {
            Some(Job {
                purpose: Purpose::Report,
                to,
                message,
                ..
            }) => self.questions.again(to, &message),
            Some(job) => {
                if let Some(ticket) = job.purpose.ticket() {
                    refuse(ticket);
                }
            }
            None => {}
        }
        if let Some(group) = self.group.take() {
            refuse(group.ticket);
        }
    }

    /// Freezes every joint at its last measured position and ends all references.
    pub(super) fn freeze(&mut self) {
        let mut strokes = [None; crate::setpoint::JOINTS];
        for (stroke, (_, node)) in strokes.iter_mut().zip(self.nodes.iter()) {
            *stroke = node.last.map(|reply| reply.joint_position());
        }
        self.frozen = Some(strokes);
        self.release();
    }

    /// Ends all references; the next motion of the wheels begins at their present positions.
    pub(super) fn release(&mut self) {
        self.direct = Default::default();
        self.direct_travel = None;
        self.wheels.reset();
        self.reflexes = Default::default();
        self.behaving.reset();
        self.orphan = Default::default();
        self.permit = self.permit.wrapping_add(1);
        self.setpoints = Setpoints::idle(self.cycle_start_us);
    }

    /// Ends arming once the replies of all nodes show a closed loop.
    fn confirm_arming(&mut self, now_us: u64, events: &mut Events) {
        let Some(group) = &mut self.group else {
            return;
        };
        if group.kind != GroupKind::Arm || group.left > 0 {
            return;
        }
        group.waited = group.waited.saturating_add(1);
        let (ticket, waited) = (group.ticket, group.waited);
        // A motion that starts while a joint is still filling would be caught up in one jump.
        let fills = self.nodes.fills();
        let allowed = if fills { FILL_CYCLES } else { CONFIRM_CYCLES };
        if self.nodes.all_armed() && !fills {
            self.group = None;
            self.power = Power::Armed;
            self.stale_cycles = 0;
            events.push(now_us, Event::Armed);
            events.push(now_us, Event::Done(ticket));
        } else if waited > allowed {
            self.group = None;
            self.abort_arming(now_us, events);
            let reason = Refusal::NotConfirmed;
            events.push(now_us, Event::Refused { ticket, reason });
        }
    }

    /// Whether the node at `address` is currently storing its parameters.
    fn is_saving(&self, address: u8) -> bool {
        self.power == Power::Disarmed
            && self.in_flight.is_some_and(|job| {
                job.to.raw() == address && matches!(job.message, Message::ParamSave(_))
            })
    }

    /// A save stalls the board for two or three cycles, at the master's own request: the board counts as missing only
    /// if it does not come back.
    fn unless_saving(
        &mut self,
        index: usize,
        address: u8,
        change: Option<Change>,
    ) -> Option<Change> {
        let saving = self.is_saving(address);
        let stalled = self.stalled.get_mut(index)?;
        match change {
            Some(Change::Lost) if saving => {
                *stalled = true;
                None
            }
            Some(Change::Back) if core::mem::take(stalled) => None,
            None if *stalled && !saving => {
                *stalled = false;
                Some(Change::Lost)
            }
            other => other,
        }
    }

    /// Checks the traffic of this cycle apart from the requested frames.
    fn watch_line(&mut self, now_us: u64, events: &mut Events) {
        let (nodes, questions) = (&self.nodes, &mut self.questions);
        let replied = |index| nodes.get(index).is_some_and(|node| node.reply.is_some());
        self.line.end_cycle(replied, |found| {
            let (node, finding) = match found {
                Found::Babble => (None, Finding::BusBabble),
                Found::Flood(from) => (Some(from.raw()), Finding::LineFull),
                Found::BabbleOver => {
                    questions.links();
                    return;
                }
            };
            events.push(now_us, Event::Found { node, finding });
        });
    }

    /// Whether the supply-pressure switch is open, as its board last reported.
    pub(super) fn has_no_air(&self) -> bool {
        let supply = self.nodes.get(SUPPLY_NODE).and_then(|node| node.reply);
        supply.is_some_and(|reply| !reply.inputs.contains(InputBits::SUPPLY_PRESSURE))
    }

    /// Supervises the nodes at the end of a cycle.
    pub(super) fn supervise(&mut self, now_us: u64, events: &mut Events) {
        if self.cycle == 0 {
            // No SYNC was sent, so nobody could answer.
            return;
        }
        self.watch_line(now_us, events);
        let mut lost = None;
        let mut changes = [None; crate::setpoint::NODES];
        self.liveness.end_cycle(|index, change| {
            if let Some(slot) = changes.get_mut(index) {
                *slot = Some(change);
            }
        });
        for (index, change) in changes.into_iter().enumerate() {
            let address = Address::of_slot(index).map_or(0, Address::raw);
            match self.unless_saving(index, address, change) {
                Some(Change::Lost) => {
                    lost = lost.or(Some(address));
                    self.nodes.forget(index);
                    self.questions.lost(index);
                    self.sums.lost(index);
                    events.push(now_us, Event::NodeLost(address));
                    if let Some(spoilt) = self.line.spoilt(index) {
                        let node = Some(address);
                        let finding = match spoilt {
                            Spoilt::Own => Finding::SlotBabble,
                            Spoilt::WithTheSlotBefore => Finding::SlotsOverlap,
                        };
                        events.push(now_us, Event::Found { node, finding });
                    }
                    match address {
                        7 => self.odometry.rebase(crate::contact::Side::Left),
                        8 => self.odometry.rebase(crate::contact::Side::Right),
                        _ => {}
                    }
                }
                Some(Change::Back) => {
                    if self.nodes.get(index).is_some_and(Node::has_duplicate) {
                        // It is heard again, so its duplicate is gone. Identify which one is left.
                        self.nodes.forget(index);
                    }
                    events.push(now_us, Event::NodeBack(address));
                }
                None => {}
            }
        }
        if self.power == Power::Disarmed {
            self.disarm_left_behind(now_us, events);
            return;
        }
        self.confirm_arming(now_us, events);
        if let Some(node) = lost {
            self.hold_all(HoldReason::NodeLost(node), now_us, events);
        }
        if let Some((node, faults)) = self.nodes.first_fault() {
            self.hold_all(HoldReason::NodeFault { node, faults }, now_us, events);
        }
        // A node that restarts before it is missed has lost its position loop all the same.
        if self.power == Power::Armed
            && let Some(node) = self.nodes.first_disarmed()
        {
            if self.hold.is_none() {
                self.questions.why(usize::from(node).saturating_sub(1));
            }
            self.hold_all(HoldReason::NodeDisarmed(node), now_us, events);
        }
        if self.has_no_air() {
            self.hold_all(HoldReason::SupplyLost, now_us, events);
        }
        match &mut self.orphan.given_up {
            Some(cycles) => {
                *cycles = cycles.saturating_add(1);
                if *cycles >= CARRIED {
                    self.hold_all(HoldReason::LayerOneGone, now_us, events);
                }
            }
            None if self.stale_cycles >= STALL_CYCLES => self.give_up_layer_one(now_us, events),
            None => {}
        }
    }
}
