//! Which nodes answer: three consecutive missed cycles make a node lost.

use wheeleg_protocol::link::NodeMonitor;

use crate::setpoint::NODES;

/// Change of a node's state at the end of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The node has just been lost.
    Lost,
    /// The node answers again, or for the first time.
    Back,
}

/// One node: the protocol's count of misses, and whether the node was ever heard.
#[derive(Clone, Copy, Debug, Default)]
struct Presence {
    monitor: NodeMonitor,
    heard: bool,
    alive: bool,
}

/// Presence of all nodes. A node that was never heard is not alive, and cannot be lost.
#[derive(Clone, Copy, Debug, Default)]
pub struct Liveness {
    nodes: [Presence; NODES],
}

impl Liveness {
    /// A reply of node index 0..8. Returns `false` if it echoes another cycle: a node that repeats itself does not
    /// count as alive.
    pub fn on_reply(&mut self, index: usize, sync_echo: u8, cycle: u16) -> bool {
        let Some(node) = self.nodes.get_mut(index) else {
            return false;
        };
        let [low, _] = cycle.to_le_bytes();
        node.monitor.on_reply(sync_echo, cycle);
        node.heard |= sync_echo == low;
        sync_echo == low
    }

    /// Ends a cycle: counts misses, and calls `report` for each change.
    pub fn end_cycle(&mut self, mut report: impl FnMut(usize, Change)) {
        for (index, node) in self.nodes.iter_mut().enumerate() {
            node.monitor.end_cycle();
            if core::mem::take(&mut node.heard) {
                if !node.alive {
                    node.alive = true;
                    report(index, Change::Back);
                }
            } else if node.alive && node.monitor.is_absent() {
                node.alive = false;
                report(index, Change::Lost);
            }
        }
    }

    /// Whether node index 0..8 counts as present.
    #[must_use]
    pub fn alive(&self, index: usize) -> bool {
        self.nodes.get(index).is_some_and(|node| node.alive)
    }

    /// Cycles in which each node did not answer, since start-up.
    #[must_use]
    pub fn total_missed(&self) -> [u32; NODES] {
        self.nodes.map(|node| node.monitor.missed_total())
    }
}
