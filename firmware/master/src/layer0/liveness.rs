//! Which nodes answer: three missed cycles in a row make a node lost.

use crate::setpoint::NODES;

/// Missed cycles in a row after which a node counts as lost.
pub const MISSED_LIMIT: u8 = 3;

/// Change of a node's state at the end of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The node has just been lost.
    Lost,
    /// The node answers again, or for the first time.
    Back,
}

/// Presence of all nodes.
#[derive(Clone, Copy, Debug)]
pub struct Liveness {
    heard: [bool; NODES],
    missed: [u8; NODES],
    alive: [bool; NODES],
    total_missed: [u32; NODES],
}

impl Default for Liveness {
    fn default() -> Self {
        Self::new()
    }
}

impl Liveness {
    /// No node heard yet: none is alive, and none can be lost.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            heard: [false; NODES],
            missed: [0; NODES],
            alive: [false; NODES],
            total_missed: [0; NODES],
        }
    }

    /// A valid slot reply of the running cycle came from node index 0..8.
    pub fn heard(&mut self, index: usize) {
        if let Some(heard) = self.heard.get_mut(index) {
            *heard = true;
        }
    }

    /// Whether node index 0..8 has answered in the running cycle.
    #[must_use]
    pub fn in_this_cycle(&self, index: usize) -> bool {
        self.heard.get(index).copied().unwrap_or(false)
    }

    /// Ends a cycle: counts misses, calls `report` for each change.
    pub fn end_cycle(&mut self, mut report: impl FnMut(usize, Change)) {
        let state = self
            .heard
            .iter_mut()
            .zip(self.missed.iter_mut())
            .zip(self.alive.iter_mut().zip(self.total_missed.iter_mut()));
        for (index, ((heard, missed), (alive, total))) in state.enumerate() {
            if core::mem::take(heard) {
                *missed = 0;
                if !*alive {
                    *alive = true;
                    report(index, Change::Back);
                }
            } else {
                *missed = missed.saturating_add(1);
                if *alive {
                    *total = total.wrapping_add(1);
                    if *missed >= MISSED_LIMIT {
                        *alive = false;
                        report(index, Change::Lost);
                    }
                }
            }
        }
    }

    /// Whether node index 0..8 counts as present.
    #[must_use]
    pub fn alive(&self, index: usize) -> bool {
        self.alive.get(index).copied().unwrap_or(false)
    }

    /// First node index that is not present.
    #[must_use]
    pub fn first_missing(&self) -> Option<usize> {
        self.alive.iter().position(|alive| !alive)
    }

    /// Cycles in which each present node did not answer, since start-up (wraps).
    #[must_use]
    pub const fn total_missed(&self) -> [u32; NODES] {
        self.total_missed
    }
}
