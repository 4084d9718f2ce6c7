//! Tick edges of boards outside of this process: their inputs, and the comparison
//! of their outputs with those of the native application beside them.

use wheeleg_protocol::{Address, ResetCause};
use wheeleg_remote_link as link;

use super::World;
use crate::SimError;
use crate::board::BoardInputs;
use wheeleg_remote_host::RemoteBoards;

impl World {
    /// The edge of all joint boards outside, and the comparison of the outputs
    /// that act from it on.
    pub(super) fn joint_edge_remote(&mut self, sensed: &[BoardInputs; 6]) -> Result<(), SimError> {
        // The dump valve acts at once: its board is brought to this instant.
        let mut edges: Vec<(u8, Option<link::Inputs>)> = vec![(7, None)];
        for (address, board) in (1..).zip(sensed) {
            let inputs = link::Inputs {
                adc: board.code,
                switches: link::Switches::from_foot(board.feet),
                encoder: 0,
            };
            edges.push((address, Some(inputs)));
        }
        edges.rotate_left(1);
        self.run_remote(&edges)?;
        for address in 1..=6 {
            self.compare_outputs(address);
        }
        Ok(())
    }

    /// Compares the outputs of a board outside with those of the application beside it.
    fn compare_outputs(&mut self, address: u8) {
        if self.runs(address) {
            let here = self.board(address).application.active_outputs();
            if let Some(remote) = &mut self.remote {
                remote.compare_outputs(self.now_ns, address, &here);
            }
        }
    }

    /// The edge of a wheel board outside, and the comparison of its outputs. Boards
    /// whose edges fall on one instant work at the same time.
    pub(super) fn wheel_edge_remote(&mut self, wheel: usize) -> Result<(), SimError> {
        let now_ns = self.now_ns;
        let mut edges = Vec::new();
        for i in 0..2 {
            let address = i as u8 + 7;
            let fresh = |remote: &RemoteBoards| remote.edge_ns(address) != Some(now_ns);
            if self.next_wheel_ns[i] == now_ns && self.remote.as_ref().is_some_and(fresh) {
                let board = self.wheel_inputs(i);
                let inputs = link::Inputs {
                    adc: 0,
                    switches: link::Switches::from_supply(board.supply),
                    // The counter wraps, as the board's does.
                    encoder: board.edges as i32,
                };
                edges.push((address, Some(inputs)));
            }
        }
        if !edges.is_empty() {
            self.run_remote(&edges)?;
        }
        self.compare_outputs(wheel as u8 + 7);
        Ok(())
    }

    /// Brings all boards outside to this instant, so that they answer what was
    /// delivered just now.
    pub(super) fn deliver_remote(&mut self) -> Result<(), SimError> {
        let all: [(u8, Option<link::Inputs>); 8] = std::array::from_fn(|i| (i as u8 + 1, None));
        self.run_remote(&all)
    }

    /// Runs boards outside to this instant, with an edge those that have inputs.
    pub(super) fn run_remote(
        &mut self,
        edges: &[(u8, Option<link::Inputs>)],
    ) -> Result<(), SimError> {
        let (now_ns, bus) = (self.now_ns, &self.bus);
        let Some(remote) = &mut self.remote else {
            return Ok(());
        };
        remote.run(now_ns, edges, bus.byte_ns(), |address, after_ns| {
            bus.heard(address, after_ns, now_ns)
        })?;
        self.bus.forget_delivered(remote.heard_by_all_ns());
        self.restart_tripped()
    }

    /// A board outside that was reset: the application beside it starts anew.
    fn restart_tripped(&mut self) -> Result<(), SimError> {
        for raw in 1..=8_u8 {
            let trip = self.remote.as_mut().and_then(|o| o.take_trip(raw));
            let Some((trip, address)) = trip.zip(Address::new(raw)) else {
                continue;
            };
            let cause = match trip.cause {
                flags if flags & link::WATCHDOG_RESET != 0 => ResetCause::Watchdog,
                flags if flags & link::SOFTWARE_RESET != 0 => ResetCause::ProcessorFault,
                _ => ResetCause::PowerUp,
            };
            self.down_times.reset(self.now_ns, raw, cause);
            self.start_anew(address, cause)?;
        }
        for raw in 1..=8_u8 {
            let first = self.remote.as_mut().and_then(|o| o.take_first_edge(raw));
            if let Some(first_ns) = first {
                self.down_times.first_edge(self.now_ns, raw, first_ns);
            }
        }
        Ok(())
    }
}
