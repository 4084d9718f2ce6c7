//! The eight boards of a simulated robot, led over a line.

use wheeleg_config::{RobotConfig, Scenario};
use wheeleg_telemetry::Recorder;

use crate::{Boards, Session, SimError};

/// Boards and plant on one clock; their master is at the other end of a line.
///
/// The same bytes at the same times give the same bytes, however the time is cut into calls.
pub struct LineBoards {
    /// Boxed: it is large, and should not be moved about.
    session: Box<Session>,
    now_ns: u64,
}

impl LineBoards {
    /// Powers the robot up in the start pose of the scenario.
    ///
    /// # Errors
    /// [`SimError`] if a part refuses its parameters.
    pub fn new(scenario: &Scenario, robot: &RobotConfig, seed: u64) -> Result<Self, SimError> {
        let session = Session::live(Boards::default(), scenario, robot, seed)?;
        let mut session = Box::new(session);
        session.world().leave_to_a_master_elsewhere();
        Ok(Self { session, now_ns: 0 })
    }

    /// Simulated time, ns since power-up.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Takes incoming bytes. On the line they take the time of their bits.
    pub fn hear(&mut self, bytes: &[u8]) {
        let now_ns = self.now_ns;
        if !bytes.is_empty() {
            self.session.world().heard_from_elsewhere(now_ns, bytes);
        }
    }

    /// Simulates up to `t_ns`, and gives the bytes that the boards sent until then.
    ///
    /// # Errors
    /// [`SimError`] when the plant leaves the range of its model.
    pub fn step_to(&mut self, t_ns: u64, recorder: &mut Recorder) -> Result<Vec<u8>, SimError> {
        self.session.step_to(t_ns, recorder)?;
        self.now_ns = self.now_ns.max(t_ns);
        Ok(self.session.world().take_said())
    }

    /// True strokes of the six cylinders, mm.
    #[must_use]
    pub fn strokes_mm(&mut self) -> [f64; 6] {
        let cylinders = &self.session.world().outputs().cylinders;
        std::array::from_fn(|i| cylinders[i].stroke_m * 1e3)
    }

    /// On-times of all valves in the tick under way, µs.
    #[must_use]
    pub fn valves_us(&mut self) -> [[u16; 4]; 6] {
        self.session.world().tick_inputs().on_us
    }
}
