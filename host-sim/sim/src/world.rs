//! Boards, bus, master and plant on one clock.
//!
//! The clock counts nanoseconds. Four kinds of events exist, and at equal times
//! they are taken in this order: bytes delivered by the bus, joint ticks
//! (1 kHz, addresses ascending), wheel samples, master cycles (100 Hz). The
//! plant is advanced to a tick before its inputs are latched; bus events do
//! not touch it.

mod account;
mod edges;
mod inject;
mod power;
mod traffic;

use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::{Reject, Ticket};
use wheeleg_master::{Master, MasterConfig};
use wheeleg_plant::PlantError;
use wheeleg_plant::body::ContactPoint;
use wheeleg_plant::robot::{Inputs, Outputs, Plant, PlantParams, PlantState};
use wheeleg_protocol::Node;
use wheeleg_remote_link as link;

use super::Boards;
use super::audit::{Audit, LineAudit};
use super::board::{Board, BoardInputs};
use super::boards::{JointBoard, WheelBoard};
use super::bus::Bus;
use super::client::Client;
use super::clock::NS_PER_US;
use super::downtime::DownTimes;
use super::energy::EnergyMeter;
use super::rogue_nodes::RogueNodes;
use crate::SimError;
use crate::faults::Injector;
use crate::{standing, unphysical};
use wheeleg_config::faults::{FaultKind, FaultSpec, FaultTarget};
use wheeleg_config::timing::JOINT_TICK_NS;
use wheeleg_config::{NodeParams, RobotConfig, Scenario};
use wheeleg_remote_host::RemoteBoards;
use wheeleg_telemetry::Cause;

pub use power::BOARD_START_UP_NS;

/// What has just happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Happened {
    /// Bytes reached the boards.
    Delivery,
    /// All joint boards ran one tick; the plant stands at its start.
    JointTick,
    /// A wheel board ran one sample.
    WheelSample,
    /// The master started a bus cycle (or would have, were it alive).
    MasterCycle,
}

/// Everything that is simulated.
pub(super) struct World {
    pub(super) plant: Plant,
    pub(super) state: PlantState,
    /// Account of the energy, if one is kept.
    pub(super) energy: Option<EnergyMeter>,
    pub(super) inputs: Inputs,
    pub(super) outputs: Outputs,
    /// Addresses 1 to 8.
    pub(super) boards: [Board; 8],
    /// Quadrature edges of each wheel at its newest sample and the one before it.
    pub(super) wheel_edges: [[i64; 2]; 2],
    pub(super) bus: Bus,
    pub(super) audit: Audit,
    pub(super) master: Master,
    pub(super) master_alive: bool,
    /// State of a master at the other end of the line, if it is not here.
    pub(super) elsewhere: Option<Elsewhere>,
    pub(super) cycle_ns: u64,
    pub(super) now_ns: u64,
    pub(super) next_joint_ns: u64,
    pub(super) next_wheel_ns: [u64; 2],
    pub(super) cycles: u64,
    pub(super) next_cycle_ns: u64,
    pub(super) tick_inputs: TickInputs,
    pub(super) faults: Injector,
    pub(super) rogue_nodes: RogueNodes,
    pub(super) config: MasterConfig,
    pub(super) master_back_ns: Option<u64>,
    pub(super) client: Client,
    pub(super) remote: Option<RemoteBoards>,
    /// When boards outside were down in this run.
    pub(super) down_times: DownTimes,
    /// When boards here are down after a fault, if they take those times from another run.
    pub(super) replayed: DownTimes,
    pub(super) stored: NodeParams,
}

/// A master at the other end of the line.
#[derive(Debug, Clone, Default)]
pub(super) struct Elsewhere {
    /// Bytes for it to hear, until they are taken.
    said: Vec<u8>,
    /// When the last of these bytes has passed, ns.
    until_ns: u64,
}

/// Valve on-times of the tick that has just begun, and the number of edges commanded so far.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TickInputs {
    /// On-times, µs, per joint `[fill A, vent A, fill B, vent B]`.
    pub on_us: [[u16; 4]; 6],
    /// Commanded edges since the start, per joint.
    pub edges: [u32; 6],
}

impl TickInputs {
    /// Takes the on-times of the next tick and counts the edges they make.
    fn take(&mut self, joint: usize, on_us: [u16; 4]) {
        for (before, now) in self.on_us[joint].iter().zip(on_us) {
            let full = VALVE_TICK_US;
            let stood_on = *before == full;
            let starts_on = now > 0;
            self.edges[joint] += u32::from(stood_on != starts_on);
            self.edges[joint] += u32::from(starts_on && now < full);
        }
        self.on_us[joint] = on_us;
    }
}

const VALVE_TICK_US: u16 = 1000;

/// The board that has the dump valve and the supply switch.
pub(super) const LEFT_WHEEL: Node = Node::WHEELS[0];

/// Duty of a bridge, −1..=1.
fn duty(outputs: &link::Outputs) -> f64 {
    let magnitude = f64::from(outputs.bridge_percent) / 100.0;
    if outputs.bridge_backward {
        -magnitude
    } else {
        magnitude
    }
}

impl World {
    /// Builds the robot in its initial pose, everything unpowered.
    ///
    /// # Errors
    /// [`SimError::Simulation`] if a part refuses its parameters, [`SimError::Config`] if a part of the
    /// scenario's ground is where the robot should stand.
    pub(super) fn new(
        (scenario, robot): (&Scenario, &RobotConfig),
        plant: &PlantParams,
        master: MasterConfig,
        seed: u64,
        boards: Boards,
    ) -> Result<Self, SimError> {
        let Boards {
            remote, replayed, ..
        } = boards;
        let refused = |part: &str, e: &dyn std::fmt::Display| {
            SimError::simulation(
                format!("the {part} refuses its parameters: {e}"),
                format!(
                    "correct the robot {}; `wheeleg params` lists it",
                    robot.file
                ),
            )
        };
        let plant = Plant::new(plant).map_err(|e| refused("plant", &e))?;
        let state = plant.initial_state(seed).map_err(|e| match e {
            PlantError::NotStanding
            | PlantError::OnChassis { .. }
            | PlantError::InChassis { .. } => {
                standing::refused(scenario, &robot.file, plant.params(), &e)
            }
            other => refused("plant", &other),
        })?;
        let mut boards = Vec::new();
        for node in Node::ALL {
            boards.push(Board::new(node, robot.node.of(node))?);
        }
        let count = boards.len();
        let boards: [Board; 8] = boards
            .try_into()
            .map_err(|_| SimError::simulation(format!("{count} boards, not eight"), ""))?;
        let outputs = plant.outputs(&state);
        let mut bus = Bus::new(robot.bus.baud_bit_s as u32);
        if remote.is_some() {
            bus.keep_delivered();
        }
        // Both ends count speeds per sample, so the master must know the board's.
        let master = MasterConfig {
            wheel_sample_us: (boards[LEFT_WHEEL.index()].application.tick_ns() / NS_PER_US) as u32,
            ..master
        };
        let mut brain = Master::new(master).map_err(|e| refused("master", &e.to_string()))?;
        Ok(Self {
            outputs,
            plant,
            state,
            energy: None,
            inputs: Inputs::default(),
            boards,
            wheel_edges: [[0; 2]; 2],
            bus,
            audit: Audit::default(),
            client: Client::connect(&mut brain),
            master: brain,
            config: master,
            master_back_ns: None,
            rogue_nodes: RogueNodes::default(),
            master_alive: true,
            elsewhere: None,
            cycle_ns: (robot.bus.cycle_s * 1e9).round() as u64,
            now_ns: 0,
            next_joint_ns: 0,
            next_wheel_ns: [0; 2],
            cycles: 0,
            next_cycle_ns: 0,
            tick_inputs: TickInputs::default(),
            faults: Injector::new(seed),
            down_times: DownTimes::new(Node::ALL.map(|node| {
                let there = remote.as_ref();
                there.is_some_and(|o| o.has(node))
            })),
            replayed,
            remote,
            stored: robot.node.clone(),
        })
    }

    /// When the next tick, sample or cycle begins, ns.
    fn next_tick_ns(&self) -> u64 {
        let [left_ns, right_ns] = self.next_wheel_ns;
        let sample_ns = left_ns.min(right_ns);
        self.next_joint_ns.min(sample_ns).min(self.next_cycle_ns)
    }

    /// When the next event is, ns.
    pub(super) fn next_ns(&self) -> u64 {
        let tick_ns = self.next_tick_ns();
        let due_ns = self.bus.next_delivery_ns();
        due_ns.map_or(tick_ns, |due_ns| due_ns.min(tick_ns))
    }

    /// Takes the next event.
    ///
    /// # Errors
    /// [`SimError::Simulation`] when the plant leaves the range of its model.
    pub(super) fn step(&mut self) -> Result<Happened, SimError> {
        let tick_ns = self.next_tick_ns();
        if let Some(due) = self.bus.next_delivery_ns()
            && due <= tick_ns
        {
            self.now_ns = due;
            self.replay_resets()?;
            self.deliver()?;
            return Ok(Happened::Delivery);
        }
        self.now_ns = tick_ns;
        self.replay_resets()?;
        if self.next_joint_ns == tick_ns {
            self.joint_tick()?;
            return Ok(Happened::JointTick);
        }
        if let Some(wheel) = self.next_wheel_ns.iter().position(|ns| *ns == tick_ns) {
            self.wheel_sample(wheel)?;
            return Ok(Happened::WheelSample);
        }
        self.master_cycle();
        Ok(Happened::MasterCycle)
    }

    fn advance_plant(&mut self) -> Result<(), SimError> {
        let (state, to_ns) = (&mut self.state, self.now_ns);
        let advanced = match &mut self.energy {
            Some(meter) => meter.advance(&self.plant, state, to_ns),
            None => self.plant.advance_to(state, to_ns),
        };
        advanced.map_err(|e| unphysical::failed(self.now_ns, &e, &self.outputs))
    }

    /// Outputs that act from this edge on: those of the board elsewhere, or of the one here.
    fn active_outputs(&self, node: Node) -> link::Outputs {
        let remote = self.remote.as_ref().and_then(|o| o.outputs(node));
        remote.unwrap_or_else(|| self.board(node).outputs())
    }

    /// Positions and foot contacts as the joint boards read them now.
    fn sense(&mut self) -> [BoardInputs; 6] {
        let feet = self.outputs.foot_switches;
        std::array::from_fn(|i| {
            let code = self.plant.read_position(&mut self.state, i);
            let stroke_m = self.plant.params().potentiometers[i].electrical_stroke_m;
            BoardInputs {
                code: self.faults.position_code(i, code, stroke_m),
                feet: self.faults.switches(i / 3, feet[i / 3]),
                ..BoardInputs::default()
            }
        })
    }

    fn joint_tick(&mut self) -> Result<(), SimError> {
        self.advance_plant()?;
        self.faults.sink(self.now_ns, &mut self.plant);
        self.bring_up()?;
        // A board outside gets the inputs of the edge, and answers with the outputs that act from this edge
        // on. Neither depends on the other.
        let sensed = if self.remote.is_some() {
            self.outputs = self.plant.outputs(&self.state);
            let sensed = self.sense();
            self.joint_edge_remote(&sensed)?;
            Some(sensed)
        } else {
            None
        };
        for (i, node) in Node::JOINTS.into_iter().enumerate() {
            let on_us = self.active_outputs(node).valve_on_us;
            self.tick_inputs.take(i, on_us);
            self.inputs.valve_on_us[i] = on_us;
        }
        // The dump valve shuts without current: air stays on.
        self.inputs.dump = self.active_outputs(LEFT_WHEEL).dump;
        self.plant
            .apply(&mut self.state, &self.inputs)
            .map_err(|e| unphysical::failed(self.now_ns, &e, &self.outputs))?;
        self.outputs = self.plant.outputs(&self.state);
        let sensed = match sensed {
            Some(sensed) => sensed,
            None => self.sense(),
        };
        for (node, inputs) in Node::JOINTS.into_iter().zip(&sensed) {
            self.tick_board(node, inputs);
        }
        self.rogue_nodes.joint_tick(self.now_ns);
        self.next_joint_ns += JOINT_TICK_NS;
        self.babble(JOINT_TICK_NS);
        self.collect_transmissions();
        self.offer_line();
        Ok(())
    }

    /// Runs the tick of a board's application that starts now, if the board runs.
    fn tick_board(&mut self, node: Node, inputs: &BoardInputs) {
        let now = self.clock(node, self.now_ns);
        if self.runs(node) {
            self.board_mut(node).application.tick(now, inputs);
            self.store(node);
        }
    }

    /// Inputs of a wheel board now: encoder edges and the supply switch.
    pub(super) fn wheel_inputs(&mut self, wheel: usize) -> BoardInputs {
        let core = &self.state.core;
        let mechanics = &self.plant.assembly.mechanics;
        let angle_rad = mechanics.wheel_angle_rad(&core.motion)[wheel];
        let edges = mechanics.motors[wheel].encoder_edges(angle_rad);
        BoardInputs {
            edges: self.faults.edges(wheel, edges),
            supply: core.supply.pressure_switch(),
            ..BoardInputs::default()
        }
    }

    fn wheel_sample(&mut self, wheel: usize) -> Result<(), SimError> {
        self.advance_plant()?;
        self.start_wheel(wheel)?;
        self.start_counters();
        let inputs = self.wheel_inputs(wheel);
        self.wheel_edge_remote(wheel)?;
        self.wheel_edges[wheel] = [inputs.edges, self.wheel_edges[wheel][0]];
        let node = Node::WHEELS[wheel];
        // Only the bridge takes new inputs here: the valves keep their tick.
        let drives = self.drives(node);
        let remote = self.remote.as_ref().and_then(|o| o.outputs(node));
        self.inputs.bridge_duty[wheel] = match remote {
            Some(outputs) => duty(&outputs),
            None if !drives => 0.0,
            // A running program outputs its newest value at the next edge; a stopped one does not.
            None if self.hangs(node) => self.inputs.bridge_duty[wheel],
            None => duty(&self.board(node).application.active_outputs()),
        };
        // A board that does not drive lets its wheel coast, wherever it runs.
        self.inputs.bridge_enabled[wheel] = drives;
        let motor = &mut self.state.core.motion.motors[wheel];
        motor.duty = self.inputs.bridge_duty[wheel];
        motor.enabled = self.inputs.bridge_enabled[wheel];
        self.tick_board(node, &inputs);
        self.rogue_nodes.wheel_sample(node, self.now_ns);
        self.next_wheel_ns[wheel] += self.board(node).application.tick_ns();
        self.collect_transmissions();
        Ok(())
    }

    /// The boards outside of this process.
    pub(super) fn remote(&mut self) -> Option<&mut RemoteBoards> {
        self.remote.as_mut()
    }

    /// Begins or ends a fault.
    ///
    /// # Errors
    /// [`SimError`] if a board outside refuses it, or one that restarts.
    pub(super) fn inject(&mut self, fault: &FaultSpec, begin: bool) -> Result<(), SimError> {
        let (plant, state) = (&mut self.plant, &mut self.state);
        self.faults.inject(fault, begin, self.now_ns, plant, state);
        match (fault.kind, fault.target) {
            (FaultKind::DuplicateAddress, FaultTarget::Board(node)) if begin => {
                self.rogue_nodes.plug_in(node, &self.stored)?;
            }
            (FaultKind::DuplicateAddress, FaultTarget::Board(node)) => {
                self.rogue_nodes.unplug(node);
            }
            (FaultKind::InvalidParameter, FaultTarget::Board(node)) if begin => {
                self.rogue_nodes.write_parameters(node);
            }
            _ => {}
        }
        self.inject_power(fault, begin)
    }

    /// Incidents on the line that are not the boards' own doing; each once.
    pub(super) fn take_notes(&mut self) -> Vec<Cause> {
        self.rogue_nodes.take_notes()
    }

    /// Counts of a listener that knows what was sent.
    pub(super) fn audit(&self) -> LineAudit {
        self.audit.counts()
    }

    /// The faults under way.
    pub(super) fn faults(&self) -> &Injector {
        &self.faults
    }

    /// Kills the master: it never sends or hears again.
    pub(super) fn kill_master(&mut self) {
        self.master_alive = false;
    }

    /// Whether the master lives.
    pub(super) fn master_alive(&self) -> bool {
        self.master_alive
    }

    /// The master, for user commands and its events.
    pub(super) fn master(&mut self) -> &mut Master {
        &mut self.master
    }

    /// The master, read only.
    pub(super) fn master_ref(&self) -> &Master {
        &self.master
    }

    /// Gives a command of the user's program.
    ///
    /// # Errors
    /// See [`Reject`].
    pub(super) fn submit(&mut self, command: Command) -> Result<Ticket, Reject> {
        let now_us = self.now_ns / NS_PER_US;
        self.client.submit(&mut self.master, command, now_us)
    }

    /// Simulated time since power-up, ns.
    pub(super) fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Everything that can be seen of the plant at the last joint tick.
    pub(super) fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// Every contact with the ground; none where the pose cannot be evaluated.
    pub(super) fn contact_points(&self) -> Vec<ContactPoint> {
        let mechanics = &self.plant.assembly.mechanics;
        let points = mechanics.contact_points(&self.state.core.motion);
        points.unwrap_or_default()
    }

    /// BLAKE3 of the plant's state.
    pub(super) fn state_hash(&self) -> [u8; 32] {
        self.plant.state_hash(&self.state)
    }

    /// Commands of the tick that has just begun.
    pub(super) fn tick_inputs(&self) -> &TickInputs {
        &self.tick_inputs
    }

    /// The board of a node.
    pub(super) fn board(&self, node: Node) -> &Board {
        &self.boards[node.index()]
    }

    /// As [`Self::board`].
    pub(super) fn board_mut(&mut self, node: Node) -> &mut Board {
        &mut self.boards[node.index()]
    }

    /// The joint boards, addresses 1 to 6.
    pub(super) fn joints(&self) -> impl Iterator<Item = &JointBoard> {
        self.boards.iter().filter_map(Board::joint)
    }

    /// The wheel boards, addresses 7 and 8.
    pub(super) fn wheels(&self) -> impl Iterator<Item = &WheelBoard> {
        self.boards.iter().filter_map(Board::wheel)
    }

    /// The line.
    pub(super) fn bus(&self) -> &Bus {
        &self.bus
    }

    /// The plant's model.
    pub(super) fn plant(&self) -> &Plant {
        &self.plant
    }
}

#[cfg(test)]
mod tests {
    use super::TickInputs;

    #[test]
    fn edges_are_counted_where_the_line_changes() {
        let mut inputs = TickInputs::default();
        let mut take = |on: u16| {
            let before = inputs.edges[0];
            inputs.take(0, [on, 0, 0, 0]);
            inputs.edges[0] - before
        };
        assert_eq!(take(0), 0, "stays off");
        assert_eq!(take(1000), 1, "on at the tick edge, stays on");
        assert_eq!(take(1000), 0, "stays on");
        assert_eq!(take(350), 1, "off within the tick");
        assert_eq!(take(350), 2, "on and off");
        assert_eq!(take(1000), 1);
        assert_eq!(take(0), 1, "off at the tick edge");
    }
}
