//! Boards, bus, master and plant on one clock.
//!
//! The clock counts nanoseconds. Four kinds of events exist, and at equal times
//! they are taken in this order: bytes delivered by the bus, joint ticks
//! (1 kHz, addresses ascending), wheel samples, master cycles (100 Hz). The
//! plant is advanced to a tick before its inputs are latched; bus events do
//! not touch it.

use wheeleg_master::{Master, MasterConfig};
use wheeleg_pil_link as link;
use wheeleg_plant::robot::{Inputs, Outputs, Plant, PlantParams, PlantState};
use wheeleg_protocol::Address;
use wheeleg_units::Micros;

use super::boards::{JointBoard, WheelBoard};
use super::bus::Bus;
use crate::SimError;
use crate::config::{NodeParams, RobotConfig};
use crate::faults::{FaultKind, FaultSpec, Injector, Victim};
use crate::pil::Outside;

/// Joint tick, ns.
pub(super) const JOINT_TICK_NS: u64 = 1_000_000;
const NS_PER_US: u64 = 1_000;
/// A stopped program is reset after this, ns: the independent watchdog of the
/// boards (firmware/board/BOARD.md).
const WATCHDOG_NS: u64 = 50_000_000;

/// Why a board does not run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Down {
    /// It runs.
    No,
    /// It has no power: all its outputs are off.
    Off {
        /// When power comes back, ns.
        until_ns: u64,
    },
    /// Its program has stopped: its outputs stay as they are.
    Hung {
        /// When the watchdog bites, ns.
        until_ns: u64,
    },
}

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
    plant: Plant,
    state: PlantState,
    inputs: Inputs,
    outputs: Outputs,
    joints: [JointBoard; 6],
    wheels: [WheelBoard; 2],
    bus: Bus,
    master: Master,
    master_alive: bool,
    cycle_ns: u64,
    now_ns: u64,
    next_joint_ns: u64,
    next_wheel_ns: [u64; 2],
    cycles: u64,
    next_cycle_ns: u64,
    tick_inputs: TickInputs,
    faults: Injector,
    down: [Down; 8],
    outside: Option<Outside>,
    stored: NodeParams,
}

/// Valve on-times of the tick that has just begun, and how many edges all commands made so far.
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

/// What the joint boards read at a tick edge.
#[derive(Debug, Clone, Copy, Default)]
struct Sensed {
    codes: [u16; 6],
    feet: [[bool; 4]; 6],
}

/// Whether the board at `address` works at `now_ns`: here unless it is down,
/// outside unless it is in reset.
fn runs(outside: Option<&Outside>, down: &[Down; 8], address: u8, now_ns: u64) -> bool {
    down[usize::from(address) - 1] == Down::No
        && outside
            .and_then(|o| o.ticks(address, now_ns))
            .unwrap_or(true)
}

/// Duty of a bridge, −1..=1.
fn duty(outputs: &link::Outputs) -> f64 {
    let magnitude = f64::from(outputs.bridge_percent) / 100.0;
    if outputs.bridge_backward {
        -magnitude
    } else {
        magnitude
    }
}

fn micros(ns: u64) -> Micros {
    // The boards' clocks are 32-bit microsecond counters and wrap.
    Micros((ns / NS_PER_US) as u32)
}

impl World {
    /// Builds the robot in its initial pose, everything unpowered.
    ///
    /// # Errors
    /// [`SimError::Simulation`] if a part refuses its parameters.
    pub(super) fn new(
        robot: &RobotConfig,
        plant: &PlantParams,
        master: MasterConfig,
        seed: u64,
        outside: Option<Outside>,
    ) -> Result<Self, SimError> {
        let refused = |part: &str, e: &dyn std::fmt::Display| {
            SimError::simulation(
                format!("the {part} refuses its parameters: {e}"),
                format!(
                    "correct the robot `{}`; `wheeleg params` lists it",
                    robot.name
                ),
            )
        };
        let plant = Plant::new(plant).map_err(|e| refused("plant", &e))?;
        let state = plant
            .initial_state(seed)
            .map_err(|e| refused("plant", &e))?;
        let stored = &robot.node;
        let address = |n: u8| {
            Address::new(n).ok_or_else(|| SimError::simulation(format!("no address {n}"), ""))
        };
        let joint = |n: u8| JointBoard::new(address(n)?, &stored.joints[usize::from(n) - 1]);
        let wheel = |n: u8| WheelBoard::new(address(n)?, &stored.wheels[usize::from(n) - 7]);
        let outputs = plant.outputs(&state);
        let mut bus = Bus::new(robot.bus.baud_bit_s as u32);
        if outside.is_some() {
            bus.keep_delivered();
        }
        let wheels = [wheel(7)?, wheel(8)?];
        // Both ends count speeds per sample, so the master must know the board's.
        let master = MasterConfig {
            wheel_sample_us: wheels[0].period_us(),
            ..master
        };
        Ok(Self {
            outputs,
            plant,
            state,
            inputs: Inputs::default(),
            joints: [
                joint(1)?,
                joint(2)?,
                joint(3)?,
                joint(4)?,
                joint(5)?,
                joint(6)?,
            ],
            wheels,
            bus,
            master: Master::new(master).map_err(|e| refused("master", &format!("{e:?}")))?,
            master_alive: true,
            cycle_ns: (robot.bus.cycle_s * 1e9).round() as u64,
            now_ns: 0,
            next_joint_ns: 0,
            next_wheel_ns: [0; 2],
            cycles: 0,
            next_cycle_ns: 0,
            tick_inputs: TickInputs::default(),
            faults: Injector::new(seed),
            down: [Down::No; 8],
            outside,
            stored: stored.clone(),
        })
    }

    /// Takes the next event.
    ///
    /// # Errors
    /// [`SimError::Simulation`] when the plant leaves the range of its model.
    pub(super) fn step(&mut self) -> Result<Happened, SimError> {
        let wheel_ns = self.next_wheel_ns[0].min(self.next_wheel_ns[1]);
        let tick_ns = self.next_joint_ns.min(wheel_ns).min(self.next_cycle_ns);
        if let Some(due) = self.bus.next_delivery_ns()
            && due <= tick_ns
        {
            self.now_ns = due;
            self.deliver()?;
            return Ok(Happened::Delivery);
        }
        self.now_ns = tick_ns;
        if self.next_joint_ns == tick_ns {
            self.joint_tick()?;
            return Ok(Happened::JointTick);
        }
        if wheel_ns == tick_ns {
            self.wheel_sample(usize::from(self.next_wheel_ns[0] != tick_ns))?;
            return Ok(Happened::WheelSample);
        }
        self.master_cycle();
        Ok(Happened::MasterCycle)
    }

    fn advance_plant(&mut self) -> Result<(), SimError> {
        self.plant
            .advance_to(&mut self.state, self.now_ns)
            .map_err(|e| unphysical(self.now_ns, &e))
    }

    /// Positions and foot contacts as the boards read them now.
    fn sense(&mut self) -> Sensed {
        let feet = self.outputs.foot_switches;
        let mut sensed = Sensed::default();
        for i in 0..6 {
            let code = self.plant.read_position(&mut self.state, i);
            let stroke_m = self.plant.params().potentiometers[i].electrical_stroke_m;
            sensed.codes[i] = self.faults.position_code(i, code, stroke_m);
            sensed.feet[i] = self.faults.switches(i / 3, feet[i / 3]);
        }
        sensed
    }

    fn joint_tick(&mut self) -> Result<(), SimError> {
        self.advance_plant()?;
        self.bring_up()?;
        // A board outside answers with the outputs that act from this edge on
        // when it is told the inputs of the edge. Neither depends on the other.
        let sensed = if self.outside.is_some() {
            self.outputs = self.plant.outputs(&self.state);
            let sensed = self.sense();
            self.joint_edge_outside(&sensed)?;
            Some(sensed)
        } else {
            None
        };
        for (i, address) in (0..6).zip(1..) {
            let outside = self.outside.as_ref().and_then(|o| o.outputs(address));
            let on_us = match (outside, self.down[i]) {
                (Some(outputs), _) => outputs.valve_on_us,
                (None, Down::Off { .. }) => [0; 4],
                (None, _) => self.joints[i].active_on_us(),
            };
            self.tick_inputs.take(i, on_us);
            self.inputs.valve_on_us[i] = on_us;
        }
        let outside = self.outside.as_ref().and_then(|o| o.outputs(7));
        self.inputs.dump = match (outside, self.down[6]) {
            (Some(outputs), _) => outputs.dump,
            // The dump valve shuts without current: air stays on.
            (None, Down::Off { .. }) => false,
            (None, _) => self.wheels[0].dumps(),
        };
        self.plant
            .apply(&mut self.state, &self.inputs)
            .map_err(|e| unphysical(self.now_ns, &e))?;
        self.outputs = self.plant.outputs(&self.state);
        let sensed = match sensed {
            Some(sensed) => sensed,
            None => self.sense(),
        };
        for (i, address) in (0..6).zip(1..) {
            let now = micros(self.faults.clock_ns(address, self.now_ns));
            if runs(self.outside.as_ref(), &self.down, address, self.now_ns) {
                self.joints[i].tick(now, sensed.codes[i], sensed.feet[i]);
            }
        }
        self.next_joint_ns += JOINT_TICK_NS;
        self.collect_transmissions();
        self.offer_acyclic();
        Ok(())
    }

    /// The edge of all joint boards outside, and the comparison of the outputs
    /// that act from it on.
    fn joint_edge_outside(&mut self, sensed: &Sensed) -> Result<(), SimError> {
        let (now_ns, bus) = (self.now_ns, &self.bus);
        let Some(outside) = &mut self.outside else {
            return Ok(());
        };
        let mut edges: Vec<(u8, Option<link::Inputs>)> = (1..)
            .zip(sensed.codes.iter().zip(sensed.feet))
            .map(|(address, (code, feet))| {
                let inputs = link::Inputs {
                    adc: *code,
                    switches: link::Switches::from_foot(feet),
                    encoder: 0,
                };
                (address, Some(inputs))
            })
            .collect();
        // The dump valve acts at once: its board is brought to this instant.
        edges.push((7, None));
        outside.run(now_ns, &edges, bus.byte_ns(), |address, after_ns| {
            bus.heard(address, after_ns, now_ns)
        })?;
        self.restart_tripped()?;
        for (board, address) in self.joints.iter().zip(1..) {
            if runs(self.outside.as_ref(), &self.down, address, now_ns)
                && let Some(outside) = &mut self.outside
            {
                outside.compare_outputs(now_ns, address, &board.active_outputs());
            }
        }
        Ok(())
    }

    /// A board outside that was reset: the application beside it starts anew.
    fn restart_tripped(&mut self) -> Result<(), SimError> {
        for raw in 1..=8_u8 {
            let trip = self.outside.as_mut().and_then(|o| o.take_trip(raw));
            let Some(address) = trip.and_then(|_| Address::new(raw)) else {
                continue;
            };
            self.start_anew(address)?;
        }
        Ok(())
    }

    /// The application of a board from its reset on.
    fn start_anew(&mut self, address: Address) -> Result<(), SimError> {
        let i = usize::from(address.raw()) - 1;
        self.down[i] = Down::No;
        if i < 6 {
            self.joints[i] = JointBoard::new(address, &self.stored.joints[i])?;
        } else {
            self.wheels[i - 6] = WheelBoard::new(address, &self.stored.wheels[i - 6])?;
        }
        Ok(())
    }

    /// Boards whose time without power, or in a stopped program, is over.
    fn bring_up(&mut self) -> Result<(), SimError> {
        for raw in 1..=8_u8 {
            let until_ns = match self.down[usize::from(raw) - 1] {
                Down::No => continue,
                Down::Off { until_ns } | Down::Hung { until_ns } => until_ns,
            };
            let Some(address) = Address::new(raw).filter(|_| until_ns <= self.now_ns) else {
                continue;
            };
            match &mut self.outside {
                // Its own watchdog and its own start-up end the fault.
                Some(outside) if outside.has(raw) => outside.set_power(raw, link::Power::Good),
                _ => self.start_anew(address)?,
            }
        }
        Ok(())
    }

    fn wheel_sample(&mut self, wheel: usize) -> Result<(), SimError> {
        self.advance_plant()?;
        let core = &self.state.core;
        let mechanics = &self.plant.assembly.mechanics;
        let angle_rad = mechanics.wheel_angle_rad(&core.motion);
        let edges = mechanics.motors[wheel].encoder_edges(angle_rad);
        let edges = self.faults.edges(wheel, edges);
        let switch = core.supply.pressure_switch;
        self.wheel_edge_outside(wheel, edges, switch)?;
        let address = wheel as u8 + 7;
        let outside = self.outside.as_ref().and_then(|o| o.outputs(address));
        // Only the bridge takes new inputs here: the valves keep their tick.
        let off = matches!(self.down[wheel + 6], Down::Off { .. });
        self.inputs.bridge_duty[wheel] = match outside {
            Some(outputs) => duty(&outputs),
            None if off => 0.0,
            None => self.wheels[wheel].active_duty(),
        };
        self.inputs.bridge_enabled[wheel] = outside.is_some() || !off;
        let motor = &mut self.state.core.motion.motors[wheel];
        motor.duty = self.inputs.bridge_duty[wheel];
        motor.enabled = self.inputs.bridge_enabled[wheel];
        let now_ns = self.faults.clock_ns(address, self.now_ns);
        let board = &mut self.wheels[wheel];
        if runs(self.outside.as_ref(), &self.down, address, self.now_ns) {
            board.tick(micros(now_ns), edges, switch);
        }
        self.next_wheel_ns[wheel] += u64::from(board.period_us()) * NS_PER_US;
        self.collect_transmissions();
        Ok(())
    }

    /// The edge of a wheel board outside, and the comparison of its outputs.
    fn wheel_edge_outside(
        &mut self,
        wheel: usize,
        edges: i64,
        switch: bool,
    ) -> Result<(), SimError> {
        let (now_ns, bus) = (self.now_ns, &self.bus);
        let address = wheel as u8 + 7;
        let Some(outside) = &mut self.outside else {
            return Ok(());
        };
        let inputs = link::Inputs {
            adc: 0,
            switches: link::Switches::from_supply(switch),
            // The counter wraps, as the board's does.
            encoder: edges as i32,
        };
        let edge = [(address, Some(inputs))];
        outside.run(now_ns, &edge, bus.byte_ns(), |address, after_ns| {
            bus.heard(address, after_ns, now_ns)
        })?;
        self.restart_tripped()?;
        if runs(self.outside.as_ref(), &self.down, address, now_ns)
            && let Some(outside) = &mut self.outside
        {
            let here = self.wheels[wheel].active_outputs();
            outside.compare_outputs(now_ns, address, &here);
        }
        Ok(())
    }

    fn master_cycle(&mut self) {
        if self.master_alive {
            self.master
                .set_layer1_enabled(!self.faults.layer_one_stalls());
            let sync = self.master.cycle(self.now_ns / NS_PER_US);
            if let Some(bytes) = self.faults.master_sends(&sync) {
                let master = Address::MASTER.raw();
                transmit(&mut self.bus, &mut self.faults, master, self.now_ns, bytes);
            }
        }
        self.cycles += 1;
        let due_ns = self.cycles * self.cycle_ns;
        self.next_cycle_ns = due_ns.saturating_add_signed(self.faults.cycle_jitter_ns());
    }

    fn deliver(&mut self) -> Result<(), SimError> {
        while let Some(delivery) = self.bus.take_due(self.now_ns) {
            let outside = self.outside.as_ref();
            let t_end = |address| micros(self.faults.clock_ns(address, delivery.end_ns));
            for (board, address) in self.joints.iter_mut().zip(1..) {
                if delivery.from != address && runs(outside, &self.down, address, self.now_ns) {
                    board.on_bus_bytes(&delivery.bytes, t_end(address));
                }
            }
            for (board, address) in self.wheels.iter_mut().zip(7..) {
                if delivery.from != address && runs(outside, &self.down, address, self.now_ns) {
                    board.on_bus_bytes(&delivery.bytes, t_end(address));
                }
            }
            if self.master_alive && delivery.from != Address::MASTER.raw() {
                self.master
                    .on_bus_bytes(&delivery.bytes, delivery.end_ns / NS_PER_US);
            }
        }
        if let Some(outside) = &mut self.outside {
            let (now_ns, bus) = (self.now_ns, &self.bus);
            let all: [(u8, Option<link::Inputs>); 8] = std::array::from_fn(|i| (i as u8 + 1, None));
            outside.run(now_ns, &all, bus.byte_ns(), |address, after_ns| {
                bus.heard(address, after_ns, now_ns)
            })?;
            self.bus.forget_delivered();
            self.restart_tripped()?;
        }
        self.collect_transmissions();
        self.offer_acyclic();
        Ok(())
    }

    /// Puts on the line what the boards want to send, at the times they chose.
    fn collect_transmissions(&mut self) {
        let now_ns = self.now_ns;
        let bus = &mut self.bus;
        let faults = &mut self.faults;
        let outside = &mut self.outside;
        let mut send = |from: u8, t: wheeleg_node::Transmission| {
            if !faults.can_send(from) {
                return;
            }
            // Start times are on the board's own clock.
            let now = micros(faults.clock_ns(from, now_ns));
            let ahead = t.start_at.get().wrapping_sub(now.get());
            // More than half the counter's range ahead means: already past.
            let ahead_ns = if ahead < 1 << 31 {
                u64::from(ahead) * NS_PER_US
            } else {
                0
            };
            let (start_ns, bytes) = (now_ns + ahead_ns, t.bytes.to_vec());
            match outside {
                // What goes on the line is what the board outside sends.
                Some(outside) if outside.has(from) => outside.expect_frame(from, start_ns, bytes),
                _ => transmit(bus, faults, from, start_ns, bytes),
            }
        };
        for (board, address) in self.joints.iter_mut().zip(1..) {
            while let Some(t) = board.take_transmission() {
                send(address, t);
            }
        }
        for (board, address) in self.wheels.iter_mut().zip(7..) {
            while let Some(t) = board.take_transmission() {
                send(address, t);
            }
        }
        if let Some(outside) = &mut self.outside {
            for address in 1..=8 {
                for (start_ns, bytes) in outside.take_frames(address) {
                    if self.faults.can_send(address) {
                        transmit(&mut self.bus, &mut self.faults, address, start_ns, bytes);
                    }
                }
            }
        }
    }

    /// The boards outside of this process.
    pub(super) fn outside(&mut self) -> Option<&mut Outside> {
        self.outside.as_mut()
    }

    /// Lets the master use the line for a request while nothing is on it or scheduled.
    fn offer_acyclic(&mut self) {
        if self.master_alive
            && self.faults.master_requests()
            && self.bus.next_delivery_ns().is_none()
            && let Some(bytes) = self.master.next_acyclic(self.now_ns / NS_PER_US)
        {
            let master = Address::MASTER.raw();
            let bytes = bytes.to_vec();
            transmit(&mut self.bus, &mut self.faults, master, self.now_ns, bytes);
        }
    }

    /// A fault begins, or ends.
    ///
    /// # Errors
    /// [`SimError`] if a board outside refuses it.
    pub(super) fn strike(&mut self, fault: &FaultSpec, begin: bool) -> Result<(), SimError> {
        self.faults
            .strike(fault, begin, &mut self.plant, &mut self.state);
        let Victim::Board(address) = fault.victim else {
            return Ok(());
        };
        let after_ns = |ns: u64| self.now_ns.saturating_add(ns);
        let down = match fault.kind {
            FaultKind::NodeOff if begin => Down::Off { until_ns: u64::MAX },
            FaultKind::NodeOff => Down::Off { until_ns: 0 },
            FaultKind::NodeReset if begin => Down::Off {
                until_ns: after_ns(JOINT_TICK_NS),
            },
            FaultKind::BrownOut if begin => Down::Off {
                until_ns: after_ns((fault.value * 1e6) as u64),
            },
            FaultKind::NodeHang if begin => Down::Hung {
                until_ns: after_ns(WATCHDOG_NS),
            },
            _ => return Ok(()),
        };
        self.down[usize::from(address) - 1] = down;
        let Some(outside) = &mut self.outside else {
            return Ok(());
        };
        match down {
            Down::Hung { .. } => outside.hook(address, link::Hook::StopProcessor),
            _ => {
                outside.set_power(address, link::Power::BrownOut);
                Ok(())
            }
        }
    }

    /// The faults under way.
    pub(super) fn faults(&self) -> &Injector {
        &self.faults
    }

    /// The master dies: it never sends or hears again.
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

    /// Simulated time since power-up, ns.
    pub(super) fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Everything that can be seen of the plant at the last joint tick.
    pub(super) fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// BLAKE3 of the plant's state.
    pub(super) fn state_hash(&self) -> [u8; 32] {
        self.plant.state_hash(&self.state)
    }

    /// Commands of the tick that has just begun.
    pub(super) fn tick_inputs(&self) -> &TickInputs {
        &self.tick_inputs
    }

    /// The joint boards, addresses 1 to 6.
    pub(super) fn joints(&self) -> &[JointBoard; 6] {
        &self.joints
    }

    /// The wheel boards, addresses 7 and 8.
    pub(super) fn wheels(&self) -> &[WheelBoard; 2] {
        &self.wheels
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

/// Puts bytes on the line as the line lets them through.
fn transmit(bus: &mut Bus, faults: &mut Injector, from: u8, start_ns: u64, bytes: Vec<u8>) {
    let (received, late_ns) = faults.transmit(bytes);
    bus.transmit(from, start_ns + late_ns, received);
}

fn unphysical(now_ns: u64, error: &wheeleg_plant::PlantError) -> SimError {
    SimError::simulation(
        format!(
            "the plant left its range at {:.4} s after power-up: {error}",
            now_ns as f64 * 1e-9
        ),
        "what was logged up to here is complete; check the robot's parameters",
    )
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
