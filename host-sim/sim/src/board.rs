//! One board of the simulation: its application with the hardware around it, its parameter memory, its clock
//! and its power. For the simulation, joint and wheel boards differ only in their inputs and outputs.

use wheeleg_node::{NodeIdentity, Transmission};
use wheeleg_protocol::{Node, ResetCause};
use wheeleg_remote_link::Outputs;
use wheeleg_units::Micros;

use super::boards::{JointBoard, WheelBoard, identity};
use super::clock::NS_PER_US;
use super::down::Down;
use super::memory::{Memory, Taken};
use crate::SimError;
use wheeleg_config::timing::JOINT_TICK_NS;

/// What a board reads at a tick edge: a joint its potentiometer and foot switches, a wheel its
/// encoder and supply switch.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BoardInputs {
    /// Code of the potentiometer.
    pub(super) code: u16,
    /// Foot switches front, left, back, right.
    pub(super) feet: [bool; 4],
    /// Quadrature edges of the encoder since power-up of the robot.
    pub(super) edges: i64,
    /// The supply-pressure switch is closed.
    pub(super) supply: bool,
}

/// The application of a board and the simulated hardware around it.
#[expect(
    clippy::large_enum_variant,
    reason = "eight of them, made once and not moved"
)]
pub(super) enum Application {
    /// Addresses 1 to 6.
    Joint(JointBoard),
    /// Addresses 7 and 8.
    Wheel(WheelBoard),
}

macro_rules! either {
    ($self:expr, $board:ident => $call:expr) => {
        match $self {
            Application::Joint($board) => $call,
            Application::Wheel($board) => $call,
        }
    };
}

impl Application {
    /// The board `who`, in boot, all outputs off. `stored` are the parameters (number, raw
    /// value) that its memory holds, none if it is damaged, `cause` why its processor starts.
    ///
    /// # Errors
    /// [`SimError::Simulation`] if the application refuses its parameters.
    pub(super) fn new(
        who: NodeIdentity,
        stored: Option<&[(u16, i32)]>,
        cause: ResetCause,
    ) -> Result<Self, SimError> {
        Ok(if who.address.is_joint() {
            Self::Joint(JointBoard::new(who, stored, cause)?)
        } else {
            Self::Wheel(WheelBoard::new(who, stored, cause)?)
        })
    }

    /// Latches the inputs and runs the tick that starts now.
    pub(super) fn tick(&mut self, now: Micros, inputs: &BoardInputs) {
        match self {
            Self::Joint(board) => board.tick(now, inputs.code, inputs.feet),
            Self::Wheel(board) => board.tick(now, inputs.edges, inputs.supply),
        };
    }

    /// Hands received bytes over; the last one ended at `t_end`.
    pub(super) fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros) {
        either!(self, board => board.node.on_bus_bytes(bytes, t_end));
    }

    /// Takes the application's next transmission.
    pub(super) fn take_transmission(&mut self) -> Option<Transmission> {
        either!(self, board => board.node.take_transmission())
    }

    /// The driver-enable guard has cut a transmission off.
    pub(super) fn driver_cut_off(&mut self, at: Micros) {
        either!(self, board => board.node.driver_cut_off(at));
    }

    /// Takes the parameters that the board wants to store; it then takes them as stored.
    pub(super) fn take_save(&mut self, now: Micros) -> Option<Vec<(u16, i32)>> {
        let mut taken = Taken::default();
        either!(self, board => if board.node.save_is_due() {
            board.node.save(&mut taken, now);
        });
        taken.0
    }

    /// The outputs that become active at this tick edge.
    pub(super) fn active_outputs(&self) -> Outputs {
        either!(self, board => board.active_outputs())
    }

    /// Tick of the board, ns.
    pub(super) fn tick_ns(&self) -> u64 {
        match self {
            Self::Joint(_) => JOINT_TICK_NS,
            Self::Wheel(board) => u64::from(board.node.tick_period_us()) * NS_PER_US,
        }
    }
}

/// One board, wherever its outputs come from.
pub(super) struct Board {
    pub(super) application: Application,
    /// Its parameter memory.
    pub(super) memory: Memory,
    /// Why it does not run, if it does not.
    pub(super) down: Down,
    /// Its first tick edge since its processor has started, ns.
    pub(super) clock_zero_ns: u64,
}

impl Board {
    /// A board, as power comes on for the first time; `stored` are its
    /// commissioned parameters.
    ///
    /// # Errors
    /// As [`Application::new`].
    pub(super) fn new(node: Node, stored: &[(u16, i32)]) -> Result<Self, SimError> {
        let cause = ResetCause::PowerUp;
        Ok(Self {
            application: Application::new(identity(node.address()), Some(stored), cause)?,
            memory: Memory::new(stored),
            down: Down::No,
            clock_zero_ns: 0,
        })
    }

    /// The joint board, if it is one.
    pub(super) fn joint(&self) -> Option<&JointBoard> {
        match &self.application {
            Application::Joint(board) => Some(board),
            Application::Wheel(_) => None,
        }
    }

    /// The wheel board, if it is one.
    pub(super) fn wheel(&self) -> Option<&WheelBoard> {
        match &self.application {
            Application::Joint(_) => None,
            Application::Wheel(board) => Some(board),
        }
    }

    /// Restarts the application from a reset by `cause`.
    ///
    /// # Errors
    /// As [`Application::new`].
    pub(super) fn restart(&mut self, node: Node, cause: ResetCause) -> Result<(), SimError> {
        let stored = self.memory.records();
        self.application = Application::new(identity(node.address()), stored.as_deref(), cause)?;
        Ok(())
    }

    /// Outputs to valves, bridge and dump valve from this edge on, if the board runs here. Without power
    /// everything is off; a program that has stopped keeps its outputs.
    pub(super) fn outputs(&self) -> Outputs {
        if self.down.is_off() {
            Outputs::default()
        } else {
            self.application.active_outputs()
        }
    }
}
