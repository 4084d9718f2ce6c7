//! Power, resets and restarts: boards without power or with a stopped program,
//! and a master or a user's program that restarts.

use wheeleg_master::{Master, MasterConfig};
use wheeleg_protocol::{Node, ResetCause};
use wheeleg_remote_link as link;
use wheeleg_units::Micros;

use super::World;
use crate::SimError;
use crate::board::Application;
use crate::clock::micros;
use crate::down::Down;
use crate::downtime::{DownTimes, Due};
use wheeleg_config::timing::JOINT_TICK_NS;

/// From power-up to the first tick edge, ns: a joint board's, and a wheel board's.
/// Memory, clock, converter and parameters as the shipped images set them up, measured on
/// emulated boards (tests/system/pil.rs). A crystal that is slow to swing makes it longer.
pub const BOARD_START_UP_NS: [u64; 2] = [3_200_750, 2_248_000];
/// Step of the master's first request number from start to start, so that no board takes its requests for
/// repetitions; any odd number would do.
const SEQUENCE_STEP: u16 = 0x2F35;

impl World {
    /// Whether a board works: here unless it is down, outside
    /// unless it is in reset.
    pub(super) fn runs(&self, node: Node) -> bool {
        self.first_edge_ns(node)
            .is_some_and(|edge_ns| edge_ns <= self.now_ns)
    }

    /// Whether a board drives its bridge: from its first tick edge on; with its last outputs if its program
    /// has stopped.
    pub(super) fn drives(&self, node: Node) -> bool {
        let started = self.started_ns(node);
        !self.board(node).down.is_off() && started.is_some_and(|ns| ns <= self.now_ns)
    }

    /// Whether the program of a board has stopped.
    pub(super) fn hangs(&self, node: Node) -> bool {
        matches!(self.board(node).down, Down::Hung { .. })
    }

    /// First tick edge of a board since its processor has started, ns;
    /// `None` while it is down.
    fn first_edge_ns(&self, node: Node) -> Option<u64> {
        let runs = self.board(node).down == Down::No;
        self.started_ns(node).filter(|_| runs)
    }

    /// First tick edge of a board since its newest start, ns; `None` if
    /// that is not known yet.
    fn started_ns(&self, node: Node) -> Option<u64> {
        match self.remote.as_ref().filter(|o| o.has(node)) {
            Some(remote) => remote.running_from_ns(node),
            None => Some(self.board(node).clock_zero_ns),
        }
    }

    /// From when on a board hears the line, ns: its tick timer is started
    /// a tick before its first edge.
    pub(super) fn hears_from_ns(&self, node: Node) -> Option<u64> {
        let edge_ns = self.first_edge_ns(node)?;
        Some(edge_ns.saturating_sub(self.tick_ns(node)))
    }

    /// Tick of a board, ns.
    fn tick_ns(&self, node: Node) -> u64 {
        self.board(node).application.tick_ns()
    }

    /// The clock of a board at `ns`: it counts from the first tick edge
    /// after its processor has started.
    pub(super) fn clock(&self, node: Node, ns: u64) -> Micros {
        let remote = self.remote.as_ref();
        let there = remote.and_then(|o| o.running_from_ns(node));
        let zero_ns = there.unwrap_or(self.board(node).clock_zero_ns);
        let now = micros(self.faults.clock_ns(node, ns));
        let zero = micros(self.faults.clock_ns(node, zero_ns));
        Micros(now.get().wrapping_sub(zero.get()))
    }

    /// Gives boards here the resets that they had outside, in the run that this one repeats.
    ///
    /// # Errors
    /// [`SimError`] if the application refuses its parameters.
    pub(super) fn replay_resets(&mut self) -> Result<(), SimError> {
        let now_ns = self.now_ns;
        loop {
            let boards = &self.boards;
            let affected = |node: Node| match boards[node.index()].down {
                Down::Off { .. } | Down::Starting { .. } | Down::Hung { .. } => true,
                Down::No | Down::Storing { .. } => false,
            };
            match self.replayed.next(now_ns, affected) {
                None => return Ok(()),
                Some(Due::Reset(node, cause)) => {
                    self.start_anew(node, cause)?;
                    self.board_mut(node).down = Down::Starting {
                        until_ns: u64::MAX,
                        cause,
                    };
                }
                Some(Due::FirstEdge(node, until_ns)) => {
                    let down = &mut self.board_mut(node).down;
                    let cause = match *down {
                        Down::Starting { cause, .. } => cause,
                        // Hit once more while it started.
                        _ => ResetCause::PowerUp,
                    };
                    *down = Down::Starting { until_ns, cause };
                }
            }
        }
    }

    /// When boards outside were down, at the end of the run.
    pub(crate) fn take_down_times(&mut self) -> DownTimes {
        std::mem::take(&mut self.down_times)
    }

    /// Restarts the application of a board from its reset by `cause`.
    pub(super) fn start_anew(&mut self, node: Node, cause: ResetCause) -> Result<(), SimError> {
        let remote = self.remote.as_ref();
        let remote = remote.is_some_and(|o| o.has(node));
        let now_ns = self.now_ns;
        let board = self.board_mut(node);
        // A board outside that has lost its power stays without until power is given back.
        if !(remote && matches!(board.down, Down::Off { .. })) {
            board.down = Down::No;
        }
        board.restart(node, cause)?;
        board.clock_zero_ns = now_ns + board.application.tick_ns();
        Ok(())
    }

    /// Lets a board store its parameters if it wants to, once it has nothing to send; it stands still
    /// meanwhile.
    pub(super) fn store(&mut self, node: Node) {
        if self.bus.is_driven_by(node.number()) {
            return;
        }
        let (now_ns, now) = (self.now_ns, self.clock(node, self.now_ns));
        let board = self.board_mut(node);
        if let Some(records) = board.application.take_save(now) {
            let until_ns = board.memory.begin(records, now_ns);
            board.down = Down::Storing { until_ns };
        }
    }

    /// Restarts boards whose time without power, or in a stopped program, is over, and a master that has been
    /// reset.
    pub(super) fn bring_up(&mut self) -> Result<(), SimError> {
        for node in Node::ALL {
            let down = self.board(node).down;
            let until_ns = match down {
                Down::No => continue,
                // It begins with an edge of its own.
                Down::Starting { .. } if !node.is_joint() => continue,
                Down::Starting { until_ns, .. } => until_ns.saturating_sub(JOINT_TICK_NS),
                // The run that this one repeats says how long that takes.
                Down::Off { .. } | Down::Hung { .. } if self.replayed.is_replayed(node) => continue,
                Down::Off { until_ns } | Down::Hung { until_ns } => until_ns,
                // Then the tick of the last edge before the end runs.
                Down::Storing { until_ns } => {
                    if until_ns < self.now_ns.saturating_add(JOINT_TICK_NS) {
                        self.board_mut(node).memory.end();
                        self.board_mut(node).down = Down::No;
                    }
                    continue;
                }
            };
            if until_ns > self.now_ns {
                continue;
            }
            match &mut self.remote {
                // Its own watchdog and its own start-up end the fault.
                Some(remote) if remote.has(node) => {
                    remote.set_power(node, link::Power::Good);
                    if matches!(down, Down::Off { .. }) {
                        self.board_mut(node).down = Down::No;
                    }
                    // From this very instant on.
                    self.run_remote(&[(node, None)])?;
                }
                _ => match down {
                    Down::Starting { cause, .. } => self.start_anew(node, cause)?,
                    Down::Hung { .. } => self.begin_start(node, ResetCause::Watchdog),
                    _ => self.begin_start(node, ResetCause::PowerUp),
                },
            }
        }
        if self.master_back_ns.is_some_and(|at| at <= self.now_ns) {
            self.master_back_ns = None;
            self.restart_master()?;
        }
        Ok(())
    }

    /// The processor of a board leaves its reset.
    pub(super) fn begin_start(&mut self, node: Node, cause: ResetCause) {
        let start_up_ns = BOARD_START_UP_NS[usize::from(!node.is_joint())];
        self.board_mut(node).down = Down::Starting {
            until_ns: self.now_ns.saturating_add(start_up_ns),
            cause,
        };
    }

    /// Starts a wheel board with the next sample, if its processor has started by then.
    pub(super) fn start_wheel(&mut self, wheel: usize) -> Result<(), SimError> {
        let node = Node::WHEELS[wheel];
        match self.board(node).down {
            Down::Starting { until_ns, cause } if until_ns <= self.now_ns + self.tick_ns(node) => {
                self.start_anew(node, cause)
            }
            _ => Ok(()),
        }
    }

    /// Starts the counters of wheel boards whose first sample is the next one: they have counted since their
    /// start-up, between the two samples before this one.
    pub(super) fn start_counters(&mut self) {
        for wheel in 0..2 {
            let node = Node::WHEELS[wheel];
            let due = self.next_wheel_ns[wheel] == self.now_ns;
            if due && self.first_edge_ns(node) == Some(self.now_ns) {
                let [_, edges] = self.wheel_edges[wheel];
                if let Application::Wheel(board) = &mut self.board_mut(node).application {
                    board.counts_from(edges);
                }
                if let Some(remote) = &mut self.remote {
                    remote.counts_from(node, edges);
                }
            }
        }
    }

    /// A master that remembers nothing. Its clients reconnect.
    fn restart_master(&mut self) -> Result<(), SimError> {
        let first_sequence = self.config.first_sequence.wrapping_add(SEQUENCE_STEP);
        self.config = MasterConfig {
            first_sequence,
            ..self.config
        };
        self.master = Master::new(self.config).map_err(|e| {
            SimError::simulation(format!("the master does not start again: {e}"), "")
        })?;
        self.master_alive = true;
        Ok(())
    }
}
