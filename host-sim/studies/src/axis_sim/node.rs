//! The joint board's whole application on the bench: bus, modes, supervision.
//!
//! [`super::Firmware`] is only the control path. [`Node`] is everything that runs on a board: SYNC frames
//! every 10 ms, the slew limit, the sensor's checks, the following-error and link supervision and the seal of
//! its state, all by [`wheeleg_node::joint::JointNode`]. It is powered up, tested and armed before the
//! recording begins, on the reading of its first sample.

use std::num::NonZeroU8;

use wheeleg_control::joint::JointConfig;
use wheeleg_node::mode::ModeRules as _;
use wheeleg_node::snapshot::JointSnapshot;
use wheeleg_protocol::link::CYCLE_US;
use wheeleg_protocol::param::JointParam;
use wheeleg_protocol::{
    Address, Arm, Envelope, JointSetpoint, LinkLossAction, MAX_ENCODED, Message, NextReference,
    ResetCause, SCHEMA_HASH, Sync, SyncFlags, SyncSlots,
};
use wheeleg_units::Micros;

use super::commission::commission;
use super::error::AxisSimError;
use super::firmware::{Design, TICK};
use super::run::{Action, Board, Sample};
use wheeleg_sim::{JointBoard, identity};

/// Ticks of a bus cycle.
const CYCLE_TICKS: u32 = CYCLE_US / TICK.get();
/// A SYNC ends this long before the tick that uses it, µs (ASSUMED: any time within the tick before it gives
/// the same result).
const AHEAD_US: u32 = 100;
/// The joint whose address straps the board has: one without foot switches.
const JOINT: u8 = 2;
/// Bus cycles from power-up to arming: the self-test takes ten readings.
const START_CYCLES: u32 = 3;

/// A joint board's application, with SYNC frames from the bench as from a master. A clone continues on its
/// own from the same state.
#[allow(missing_debug_implementations)] // The application has none.
#[derive(Clone)]
pub struct Node {
    board: JointBoard,
    address: Address,
    /// Ticks since power-up.
    tick: u32,
    cycle: u16,
    sequence: u16,
    running: bool,
    /// The E-stop bit of future SYNC frames.
    pub emergency_stop: bool,
    /// Action after a stop that the slots of future SYNC frames allow.
    pub on_link_loss: LinkLossAction,
}

impl Node {
    /// A board, switched off, commissioned with a design.
    ///
    /// # Errors
    /// [`AxisSimError`] if a value of the design is outside the board's parameter
    /// table, or the board refuses the set.
    pub fn new(design: &Design) -> Result<Self, AxisSimError> {
        Self::with(design, &[])
    }

    /// As [`Node::new`], with further parameters (raw) that the design does not set.
    ///
    /// # Errors
    /// As [`Node::new`].
    pub fn with(design: &Design, others: &[(JointParam, i32)]) -> Result<Self, AxisSimError> {
        let address = Address::joint(JOINT).unwrap_or(Address::MASTER);
        // First the values that its parameter table does not hold: such an error has a name and limits.
        let commissioned = commission(design)?;
        JointConfig::new(&design.gains, TICK).map_err(AxisSimError::Design)?;
        let stored: Vec<(u16, i32)> = commissioned
            .into_iter()
            .chain(others.iter().copied())
            .map(|(parameter, raw)| (parameter.id(), raw))
            .collect();
        let board = JointBoard::new(identity(address), Some(&stored), ResetCause::PowerUp)
            .map_err(|e| AxisSimError::Board(e.to_string()))?;
        Ok(Self {
            board,
            address,
            tick: 0,
            cycle: 0,
            sequence: 0,
            running: false,
            emergency_stop: false,
            on_link_loss: LinkLossAction::Hold,
        })
    }

    /// Sends a request of the master between two ticks. The answer is ignored.
    pub fn request(&mut self, message: &Message) {
        self.send(self.address, message);
    }

    /// Internals of the board after its last tick.
    #[must_use]
    pub fn snapshot(&self) -> &JointSnapshot {
        self.board.snapshot()
    }

    fn now(&self) -> Micros {
        Micros(self.tick.wrapping_mul(TICK.get()))
    }

    fn send(&mut self, destination: Address, message: &Message) {
        let envelope = Envelope {
            source: Address::MASTER,
            destination,
            sequence: self.sequence,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let mut buffer = [0; MAX_ENCODED];
        // Every message fits the largest frame, and the master is not a broadcast address.
        if let Ok(bytes) = message.emit(envelope, &mut buffer) {
            let t_end = Micros(self.now().get().wrapping_sub(AHEAD_US));
            self.board.on_bus_bytes(bytes, t_end);
        }
        // The replies are ignored.
        while self.board.take_transmission().is_some() {}
    }

    fn sync(&mut self, setpoint: Option<JointSetpoint>) {
        let mut slots = SyncSlots::default();
        if let Some(setpoint) = setpoint {
            slots.set_joint(self.address, setpoint);
        }
        let sync = Sync {
            cycle: self.cycle,
            master_time_us: self.now().get(),
            flags: if self.emergency_stop {
                SyncFlags::ESTOP
            } else {
                SyncFlags::NONE
            },
            slots,
        };
        self.cycle = self.cycle.wrapping_add(1);
        self.send(Address::BROADCAST, &sync.into());
    }

    /// Self-test, link, arming. The valves stay shut, and nothing moves.
    fn start(&mut self, code: u16) {
        // The first SYNC ends before the first tick, and its time must not be negative.
        self.tick = CYCLE_TICKS;
        for _ in 0..START_CYCLES {
            self.sync(None);
            for _ in 0..CYCLE_TICKS {
                self.board.tick(self.now(), code, [false; 4]);
                self.tick = self.tick.wrapping_add(1);
            }
        }
        let arm = Arm {
            schema_hash: SCHEMA_HASH,
        };
        self.send(self.address, &arm.into());
        self.running = true;
    }

    fn setpoint(&self, sample: &Sample) -> JointSetpoint {
        let next = sample.announced.and_then(|(reference, ticks)| {
            let cycles = u8::try_from(ticks.div_ceil(CYCLE_TICKS)).ok()?;
            Some(NextReference {
                reference: reference.to_wire(),
                cycles: NonZeroU8::new(cycles)?,
            })
        });
        JointSetpoint {
            reference: sample.reference,
            velocity: sample.reference_velocity.to_wire(),
            next,
            on_link_loss: self.on_link_loss,
            track: true,
        }
    }
}

impl Board for Node {
    fn tick(&mut self, sample: &Sample) -> Action {
        let code = sample.code.get();
        if !self.running {
            self.start(code);
        }
        if self.tick.is_multiple_of(CYCLE_TICKS) {
            self.sync(Some(self.setpoint(sample)));
        }
        let report = self.board.tick(self.now(), code, [false; 4]);
        self.tick = self.tick.wrapping_add(1);
        let snapshot = self.board.snapshot();
        Action {
            on_us: self.board.active_on_us(),
            settled: snapshot.settled,
            measured_mm: snapshot.measured.to_f64(),
            faults: report.faults,
            driving: report.mode.may_drive(),
        }
    }
}
