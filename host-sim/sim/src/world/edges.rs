//! Tick edges of boards outside of this process: their inputs, and the comparison
//! of their outputs with those of the native application beside them.

use wheeleg_protocol::{Node, ResetCause};
use wheeleg_remote_link as link;

use super::{LEFT_WHEEL, World};
use crate::SimError;
use crate::board::BoardInputs;
use wheeleg_remote_host::RemoteBoards;

impl World {
    /// Runs the edge of all joint boards outside, and compares the outputs that act from it on.
    pub(super) fn joint_edge_remote(&mut self, sensed: &[BoardInputs; 6]) -> Result<(), SimError> {
        // The dump valve acts at once: its board is brought to this instant.
        let mut edges: Vec<(Node, Option<link::Inputs>)> = vec![(LEFT_WHEEL, None)];
        for (node, board) in Node::JOINTS.into_iter().zip(sensed) {
            let inputs = link::Inputs {
                adc: board.code,
                switches: link::Switches::from_foot(board.feet),
                encoder: 0,
            };
            edges.push((node, Some(inputs)));
        }
        edges.rotate_left(1);
        self.run_remote(&edges)?;
        for node in Node::JOINTS {
            self.compare_outputs(node);
        }
        Ok(())
    }

    /// Compares the outputs of a board outside with those of the application beside it.
    fn compare_outputs(&mut self, node: Node) {
        if self.runs(node) {
            let here = self.board(node).application.active_outputs();
            if let Some(remote) = &mut self.remote {
                remote.compare_outputs(self.now_ns, node, &here);
            }
        }
    }

    /// Runs the edge of a wheel board outside, and compares its outputs. Boards whose edges fall on one
    /// instant work at the same time.
    pub(super) fn wheel_edge_remote(&mut self, wheel: usize) -> Result<(), SimError> {
        let now_ns = self.now_ns;
        let mut edges = Vec::new();
        for i in 0..2 {
            let node = Node::WHEELS[i];
            let fresh = |remote: &RemoteBoards| remote.edge_ns(node) != Some(now_ns);
            if self.next_wheel_ns[i] == now_ns && self.remote.as_ref().is_some_and(fresh) {
                let board = self.wheel_inputs(i);
                let inputs = link::Inputs {
                    adc: 0,
                    switches: link::Switches::from_supply(board.supply),
                    // The counter wraps, as the board's does.
                    encoder: board.edges as i32,
                };
                edges.push((node, Some(inputs)));
            }
        }
        if !edges.is_empty() {
            self.run_remote(&edges)?;
        }
        self.compare_outputs(Node::WHEELS[wheel]);
        Ok(())
    }

    /// Brings all boards outside to this instant, so that they can answer the bytes delivered just now.
    pub(super) fn deliver_remote(&mut self) -> Result<(), SimError> {
        self.run_remote(&Node::ALL.map(|node| (node, None)))
    }

    /// Runs boards outside to this instant; those with inputs run an edge.
    pub(super) fn run_remote(
        &mut self,
        edges: &[(Node, Option<link::Inputs>)],
    ) -> Result<(), SimError> {
        let (now_ns, bus) = (self.now_ns, &self.bus);
        let Some(remote) = &mut self.remote else {
            return Ok(());
        };
        remote.run(now_ns, edges, bus.byte_ns(), |node, after_ns| {
            bus.heard(node.number(), after_ns, now_ns)
        })?;
        self.bus.forget_delivered(remote.heard_by_all_ns());
        self.restart_tripped()
    }

    /// Restarts the application beside a board outside that was reset.
    fn restart_tripped(&mut self) -> Result<(), SimError> {
        for node in Node::ALL {
            let Some(trip) = self.remote.as_mut().and_then(|o| o.take_trip(node)) else {
                continue;
            };
            let cause = match trip.cause {
                flags if flags & link::WATCHDOG_RESET != 0 => ResetCause::Watchdog,
                flags if flags & link::SOFTWARE_RESET != 0 => ResetCause::ProcessorFault,
                _ => ResetCause::PowerUp,
            };
            self.down_times.reset(self.now_ns, node, cause);
            self.start_anew(node, cause)?;
        }
        for node in Node::ALL {
            let first = self.remote.as_mut().and_then(|o| o.take_first_edge(node));
            if let Some(first_ns) = first {
                self.down_times.first_edge(self.now_ns, node, first_ns);
            }
        }
        Ok(())
    }
}
