//! Power, resets and restarts: boards without power or with a stopped program,
//! and a master or a user's program that starts anew.

use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::{Reject, Request, Ticket};
use wheeleg_master::master::LOCAL_DEADLINE_US;
use wheeleg_master::{Master, MasterConfig};
use wheeleg_protocol::{Address, ResetCause};
use wheeleg_remote_link as link;
use wheeleg_units::Micros;

use super::boards::{JointBoard, WheelBoard, identity};
use super::downtime::{DownTimes, Due};
use super::traffic::{NS_PER_US, micros};
use super::world::World;
use crate::SimError;
use wheeleg_config::timing::JOINT_TICK_NS;

/// From power-up to the first tick edge, ns: a joint board's, and a wheel board's.
/// Memory, clock, converter and parameters as the shipped images set them up, measured on
/// emulated boards (tests/system/pil.rs). A crystal that is slow to swing makes it longer.
pub const BOARD_START_UP_NS: [u64; 2] = [3_198_000, 2_248_000];
/// What a master adds to the first number of its requests at every start, so that
/// no board takes them for repetitions; any odd number would do.
const SEQUENCE_STEP: u16 = 0x2F35;

/// Why a board does not run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Down {
    /// It runs.
    No,
    /// It has no power: all its outputs are off.
    Off {
        /// When power comes back, ns.
        until_ns: u64,
    },
    /// Its processor starts: all its outputs are off.
    Starting {
        /// When its first tick begins at the earliest, ns; it hears the line a tick before.
        until_ns: u64,
        /// What it finds as the cause of its reset.
        cause: ResetCause,
    },
    /// It stores its parameters, which keeps its processor from everything else: its
    /// outputs stay as they are, off.
    Storing {
        /// When that is done, ns.
        until_ns: u64,
    },
    /// Its program has stopped: its outputs stay as they are.
    Hung {
        /// When the watchdog bites, ns.
        until_ns: u64,
    },
}

impl Down {
    /// Whether nothing drives the outputs of the board.
    pub(super) fn is_off(self) -> bool {
        matches!(self, Self::Off { .. } | Self::Starting { .. })
    }
}

/// The program through which the user gives commands: a client of the master.
#[derive(Debug, Clone, Copy)]
pub(super) struct Client {
    next_id: u32,
}

impl Client {
    /// Number of the client at the master.
    const NUMBER: u8 = 1;

    /// A program that has just been started and opens its session.
    pub(super) fn connect(master: &mut Master) -> Self {
        master.open_session(Self::NUMBER);
        Self { next_id: 1 }
    }

    /// Gives a command.
    ///
    /// # Errors
    /// See [`Reject`].
    pub(super) fn submit(
        &mut self,
        master: &mut Master,
        command: Command,
        now_us: u64,
    ) -> Result<Ticket, Reject> {
        let request = Request {
            client: Self::NUMBER,
            id: self.next_id,
            deadline_us: now_us.saturating_add(LOCAL_DEADLINE_US),
            command,
        };
        self.next_id += 1;
        master.submit_request(request, now_us)
    }
}

impl World {
    /// Whether the board at `address` works: here unless it is down, outside
    /// unless it is in reset.
    pub(super) fn runs(&self, address: u8) -> bool {
        self.first_edge_ns(address)
            .is_some_and(|edge_ns| edge_ns <= self.now_ns)
    }

    /// Whether the board at `address` drives its bridge: from its first tick edge on, and
    /// on with what it was told last when its program has stopped.
    pub(super) fn drives(&self, address: u8) -> bool {
        let started = self.started_ns(address);
        !self.down[usize::from(address) - 1].is_off() && started.is_some_and(|ns| ns <= self.now_ns)
    }

    /// Whether the program of the board at `address` has stopped.
    pub(super) fn hangs(&self, address: u8) -> bool {
        matches!(self.down[usize::from(address) - 1], Down::Hung { .. })
    }

    /// First tick edge of the board at `address` since its processor has started, ns;
    /// `None` while it is down.
    fn first_edge_ns(&self, address: u8) -> Option<u64> {
        let runs = self.down[usize::from(address) - 1] == Down::No;
        self.started_ns(address).filter(|_| runs)
    }

    /// First tick edge of the board at `address` since its newest start, ns; `None` if
    /// that is not known yet.
    fn started_ns(&self, address: u8) -> Option<u64> {
        match self.outside.as_ref().filter(|o| o.has(address)) {
            Some(outside) => outside.running_from_ns(address),
            None => Some(self.clock_zero_ns[usize::from(address) - 1]),
        }
    }

    /// From when on the board at `address` hears the line, ns: its tick timer is started
    /// a tick before its first edge.
    pub(super) fn hears_from_ns(&self, address: u8) -> Option<u64> {
        let edge_ns = self.first_edge_ns(address)?;
        Some(edge_ns.saturating_sub(self.tick_ns(address)))
    }

    /// Tick of a board, ns.
    fn tick_ns(&self, address: u8) -> u64 {
        match address.checked_sub(7) {
            Some(wheel) => u64::from(self.wheels[usize::from(wheel)].period_us()) * NS_PER_US,
            None => JOINT_TICK_NS,
        }
    }

    /// The clock of the board at `address` at `ns`: it counts from the first tick edge
    /// after its processor has started.
    pub(super) fn clock(&self, address: u8, ns: u64) -> Micros {
        let outside = self.outside.as_ref();
        let there = outside.and_then(|o| o.running_from_ns(address));
        let zero_ns = there.unwrap_or(self.clock_zero_ns[usize::from(address) - 1]);
        let now = micros(self.faults.clock_ns(address, ns));
        let zero = micros(self.faults.clock_ns(address, zero_ns));
        Micros(now.get().wrapping_sub(zero.get()))
    }

    /// Does to boards here what had become of them outside, in the run that this one
    /// repeats.
    ///
    /// # Errors
    /// [`SimError`] if the application refuses its parameters.
    pub(super) fn keep_down_times(&mut self) -> Result<(), SimError> {
        let now_ns = self.now_ns;
        loop {
            let struck = |address: u8| match self.down[usize::from(address) - 1] {
                Down::Off { .. } | Down::Starting { .. } | Down::Hung { .. } => true,
                Down::No | Down::Storing { .. } => false,
            };
            match self.kept.next(now_ns, struck) {
                None => return Ok(()),
                Some(Due::Reset(raw, cause)) => {
                    if let Some(address) = Address::new(raw) {
                        self.start_anew(address, cause)?;
                    }
                    self.down[usize::from(raw) - 1] = Down::Starting {
                        until_ns: u64::MAX,
                        cause,
                    };
                }
                Some(Due::FirstEdge(raw, until_ns)) => {
                    let down = &mut self.down[usize::from(raw) - 1];
                    let cause = match *down {
                        Down::Starting { cause, .. } => cause,
                        // Struck once more while it started.
                        _ => ResetCause::PowerUp,
                    };
                    *down = Down::Starting { until_ns, cause };
                }
            }
        }
    }

    /// When boards outside were down, at the end of the run.
    pub(super) fn take_down_times(&mut self) -> DownTimes {
        std::mem::take(&mut self.down_times)
    }

    /// The application of a board from its reset by `cause` on.
    pub(super) fn start_anew(
        &mut self,
        address: Address,
        cause: ResetCause,
    ) -> Result<(), SimError> {
        let i = usize::from(address.raw()) - 1;
        let outside = self.outside.as_ref();
        let outside = outside.is_some_and(|o| o.has(address.raw()));
        // A board outside that has lost its power stays without until it is given back.
        if !(outside && matches!(self.down[i], Down::Off { .. })) {
            self.down[i] = Down::No;
        }
        let who = identity(address);
        let stored = self.memories[i].records();
        if i < 6 {
            self.joints[i] = JointBoard::new(who, stored.as_deref(), cause)?;
        } else {
            self.wheels[i - 6] = WheelBoard::new(who, stored.as_deref(), cause)?;
        }
        self.clock_zero_ns[i] = self.now_ns + self.tick_ns(address.raw());
        Ok(())
    }

    /// A board that wants to stores its parameters, once it has nothing to send, and
    /// stands still meanwhile.
    pub(super) fn store(&mut self, address: u8) {
        if self.bus.is_driven_by(address) {
            return;
        }
        let i = usize::from(address) - 1;
        let now = self.clock(address, self.now_ns);
        let taken = match self.joints.get_mut(i) {
            Some(board) => board.take_save(now),
            None => self.wheels[i - 6].take_save(now),
        };
        if let Some(records) = taken {
            let until_ns = self.memories[i].begin(records, self.now_ns);
            self.down[i] = Down::Storing { until_ns };
        }
    }

    /// Boards whose time without power, or in a stopped program, is over; a
    /// master that has been reset.
    pub(super) fn bring_up(&mut self) -> Result<(), SimError> {
        for raw in 1..=8_u8 {
            let down = self.down[usize::from(raw) - 1];
            let until_ns = match down {
                Down::No => continue,
                // It begins with an edge of its own.
                Down::Starting { .. } if raw > 6 => continue,
                Down::Starting { until_ns, .. } => until_ns.saturating_sub(JOINT_TICK_NS),
                // How long that takes is known from the run that this one repeats.
                Down::Off { .. } | Down::Hung { .. } if self.kept.rule(raw) => continue,
                Down::Off { until_ns } | Down::Hung { until_ns } => until_ns,
                // The tick of the last edge before the end is worked off then.
                Down::Storing { until_ns } => {
                    if until_ns < self.now_ns.saturating_add(JOINT_TICK_NS) {
                        self.memories[usize::from(raw) - 1].end();
                        self.down[usize::from(raw) - 1] = Down::No;
                    }
                    continue;
                }
            };
            let Some(address) = Address::new(raw).filter(|_| until_ns <= self.now_ns) else {
                continue;
            };
            match &mut self.outside {
                // Its own watchdog and its own start-up end the fault.
                Some(outside) if outside.has(raw) => {
                    outside.set_power(raw, link::Power::Good);
                    if matches!(down, Down::Off { .. }) {
                        self.down[usize::from(raw) - 1] = Down::No;
                    }
                    // From this very instant on.
                    self.run_outside(&[(raw, None)])?;
                }
                _ => match down {
                    Down::Starting { cause, .. } => self.start_anew(address, cause)?,
                    Down::Hung { .. } => self.begin_start(raw, ResetCause::Watchdog),
                    _ => self.begin_start(raw, ResetCause::PowerUp),
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
    pub(super) fn begin_start(&mut self, address: u8, cause: ResetCause) {
        let start_up_ns = BOARD_START_UP_NS[usize::from(address > 6)];
        self.down[usize::from(address) - 1] = Down::Starting {
            until_ns: self.now_ns.saturating_add(start_up_ns),
            cause,
        };
    }

    /// A wheel board begins with the next sample, if it has started by then.
    pub(super) fn start_wheel(&mut self, wheel: usize) -> Result<(), SimError> {
        let Some(address) = Address::new(wheel as u8 + 7) else {
            return Ok(());
        };
        match self.down[wheel + 6] {
            Down::Starting { until_ns, cause }
                if until_ns <= self.now_ns + self.tick_ns(address.raw()) =>
            {
                self.start_anew(address, cause)
            }
            _ => Ok(()),
        }
    }

    /// Wheel boards whose first sample is the one that now comes: their counters have
    /// counted since their start-up, between the two samples before this one.
    pub(super) fn start_counters(&mut self) {
        for wheel in 0..2 {
            let address = wheel as u8 + 7;
            let due = self.next_wheel_ns[wheel] == self.now_ns;
            if due && self.first_edge_ns(address) == Some(self.now_ns) {
                let [_, edges] = self.wheel_edges[wheel];
                self.wheels[wheel].counts_from(edges);
                if let Some(outside) = &mut self.outside {
                    outside.counts_from(address, edges);
                }
            }
        }
    }

    /// A master that remembers nothing. Whoever was connected to it reconnects.
    fn restart_master(&mut self) -> Result<(), SimError> {
        let first_sequence = self.config.first_sequence.wrapping_add(SEQUENCE_STEP);
        self.config = MasterConfig {
            first_sequence,
            ..self.config
        };
        self.master = Master::new(self.config).map_err(|e| {
            SimError::simulation(format!("the master does not start again: {e:?}"), "")
        })?;
        self.master_alive = true;
        Ok(())
    }
}
