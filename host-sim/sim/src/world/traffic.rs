//! Traffic on the line, and who hears it.

use wheeleg_protocol::{Address, Node};
use wheeleg_units::Micros;

use super::{Elsewhere, World};
use crate::SimError;
use crate::audit::Audit;
use crate::bus::{Bus, Driver};
use crate::clock::{NS_PER_US, micros};
use crate::faults::Injector;
use crate::rogue_nodes;

/// Time to a start on the board's own clock, µs, when that shows `now`.
fn ahead_us(now: Micros, start_at: Micros) -> u32 {
    let ahead = start_at.get().wrapping_sub(now.get());
    // More than half the counter's range means: already past.
    if ahead < 1 << 31 { ahead } else { 0 }
}

/// Puts bytes on the line, with the line's errors and delay.
fn transmit(
    bus: &mut Bus,
    audit: &mut Audit,
    faults: &mut Injector,
    from: Driver,
    start_ns: u64,
    bytes: Vec<u8>,
) {
    audit.sent(&bytes);
    let (received, late_ns) = faults.transmit(bytes);
    bus.transmit(from, start_ns + late_ns, received);
}

impl World {
    pub(super) fn transmit(&mut self, from: Driver, start_ns: u64, bytes: Vec<u8>) {
        let (bus, audit) = (&mut self.bus, &mut self.audit);
        transmit(bus, audit, &mut self.faults, from, start_ns, bytes);
    }

    /// From now on the master is at the other end of the line.
    pub(crate) fn leave_to_a_master_elsewhere(&mut self) {
        self.master_alive = false;
        self.elsewhere = Some(Elsewhere::default());
    }

    /// Puts bytes of a master elsewhere on the line from `t_ns` on, behind those before them.
    pub(crate) fn heard_from_elsewhere(&mut self, t_ns: u64, bytes: &[u8]) {
        let Some(elsewhere) = &mut self.elsewhere else {
            return;
        };
        let start_ns = elsewhere.until_ns.max(t_ns);
        elsewhere.until_ns = start_ns + self.bus.duration_ns(bytes.len());
        self.transmit(Address::MASTER.raw(), start_ns, bytes.to_vec());
    }

    /// Takes the bytes that a master elsewhere hears.
    pub(crate) fn take_said(&mut self) -> Vec<u8> {
        let elsewhere = self.elsewhere.as_mut();
        elsewhere.map_or_else(Vec::new, |e| std::mem::take(&mut e.said))
    }

    /// The master's cycle begins: SYNC.
    pub(super) fn master_cycle(&mut self) {
        if self.master_alive {
            let stalls = self.faults.layer_one_stalls();
            self.master.set_layer1_enabled(!stalls);
            let sync = self.master.cycle(self.now_ns / NS_PER_US);
            if let Some(bytes) = self.faults.master_sends(&sync) {
                self.transmit(Address::MASTER.raw(), self.now_ns, bytes);
            }
        }
        self.cycles += 1;
        let due_ns = self.cycles * self.cycle_ns;
        self.next_cycle_ns = due_ns.saturating_add_signed(self.faults.cycle_jitter_ns());
    }

    /// Delivers transmissions that have reached their end on the line.
    pub(super) fn deliver(&mut self) -> Result<(), SimError> {
        // No node answers a node's frame: boards outside hear it in their next run, which saves most of the
        // round trips to them.
        let mut answerable = false;
        while let Some(delivery) = self.bus.take_due(self.now_ns) {
            answerable |= Node::new(delivery.from).is_none();
            for node in Node::ALL {
                let Some(from_ns) = self.hears_from_ns(node) else {
                    continue;
                };
                let Some((bytes, end_ns)) = self.bus.heard_by(node.number(), &delivery) else {
                    continue;
                };
                // A board that starts up hears the end of a frame.
                let heard = end_ns.saturating_sub(from_ns).div_ceil(self.bus.byte_ns());
                let missed = bytes.len().saturating_sub(heard as usize);
                let bytes = &bytes[missed..];
                if bytes.is_empty() {
                    continue;
                }
                let t_end = self.clock(node, end_ns);
                let board = self.board_mut(node);
                board.application.on_bus_bytes(bytes, t_end);
            }
            let master = Address::MASTER.raw();
            if self.master_alive
                && let Some((bytes, end_ns)) = self.bus.heard_by(master, &delivery)
            {
                self.master.on_bus_bytes(&bytes, end_ns / NS_PER_US);
            }
            if let Some(elsewhere) = &mut self.elsewhere
                && let Some((bytes, _)) = self.bus.heard_by(master, &delivery)
            {
                elsewhere.said.extend_from_slice(&bytes);
            }
            self.rogue_nodes.hear(&self.bus, &delivery);
            if let Some((bytes, _)) = self.bus.heard_by(rogue_nodes::AUDITOR, &delivery) {
                self.audit.heard(&bytes);
            }
        }
        if answerable {
            self.deliver_remote()?;
        }
        self.collect_transmissions();
        self.offer_line();
        Ok(())
    }

    /// Puts the boards' transmissions on the line, at the times they chose.
    pub(super) fn collect_transmissions(&mut self) {
        let now_ns = self.now_ns;
        let clocks: [Micros; 8] = Node::ALL.map(|node| self.clock(node, now_ns));
        let clock = |node: Node| clocks[node.index()];
        let (bus, audit) = (&mut self.bus, &mut self.audit);
        let (faults, remote) = (&mut self.faults, &mut self.remote);
        // True if the guard of the board's driver cut it off.
        let mut send = |from: Node, t: wheeleg_node::Transmission| {
            // Start times are on the board's own clock.
            let ahead_us = ahead_us(clock(from), t.start_at);
            let start_ns = now_ns + faults.duration_ns(from, ahead_us);
            match remote {
                // The frame of the board outside goes on the line; the comparison is of the frame before any
                // fault acts on it.
                Some(remote) if remote.has(from) => {
                    remote.expect_frame(from, start_ns, t.bytes.to_vec());
                    false
                }
                _ => {
                    let Some(bytes) = faults.board_sends(from, t.bytes.to_vec()) else {
                        return false;
                    };
                    transmit(bus, audit, faults, from.number(), start_ns, bytes);
                    faults.cuts_off(from)
                }
            }
        };
        for (board, node) in self.boards.iter_mut().zip(Node::ALL) {
            while let Some(t) = board.application.take_transmission() {
                if send(node, t) {
                    board.application.driver_cut_off(clock(node));
                }
            }
        }
        while let Some((from, t)) = self.rogue_nodes.take_transmission() {
            let ahead_us = ahead_us(micros(now_ns), t.start_at);
            let start_ns = now_ns + u64::from(ahead_us) * NS_PER_US;
            transmit(bus, audit, faults, from, start_ns, t.bytes.to_vec());
        }
        if let Some(remote) = remote {
            for node in Node::ALL {
                for (start_ns, bytes) in remote.take_frames(node) {
                    if let Some(bytes) = faults.board_sends(node, bytes) {
                        transmit(bus, audit, faults, node.number(), start_ns, bytes);
                    }
                }
            }
        }
    }

    /// While nothing is on the line or scheduled, lets the master use it for a request, then a service tool,
    /// then any node that has a stream to send.
    pub(super) fn offer_line(&mut self) {
        if self.bus.next_delivery_ns().is_some() {
            return;
        }
        let now_us = self.now_ns / NS_PER_US;
        if self.master_alive
            && self.faults.master_requests()
            && let Some(bytes) = self.master.next_acyclic(now_us)
        {
            self.transmit(Address::MASTER.raw(), self.now_ns, bytes.to_vec());
            return;
        }
        let left_ns = self.next_cycle_ns.saturating_sub(self.now_ns);
        if let Some(bytes) = self.rogue_nodes.service_request(now_us, left_ns) {
            self.transmit(rogue_nodes::SERVICE, self.now_ns, bytes);
            return;
        }
        let room = (left_ns / self.bus.byte_ns()) as usize;
        if let Some(bytes) = self.faults.stream(room) {
            self.transmit(rogue_nodes::STREAM, self.now_ns, bytes);
        }
    }

    /// Sends the bytes of boards whose driver is stuck on, in the tick that begins now.
    pub(super) fn babble(&mut self, tick_ns: u64) {
        let bytes = (tick_ns / self.bus.byte_ns()) as usize;
        for node in Node::ALL {
            if self.runs(node)
                && let Some(rubbish) = self.faults.babble(node, bytes)
            {
                self.transmit(node.number(), self.now_ns, rubbish);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_that_is_past_is_now_and_the_counter_may_wrap() {
        let ahead = |now: u32, start: u32| ahead_us(Micros(now), Micros(start));
        assert_eq!(ahead(100, 350), 250);
        assert_eq!(ahead(350, 100), 0);
        assert_eq!(ahead(u32::MAX - 9, 40), 50);
    }
}
