//! A joint board on mocks.

use super::mock::{Pin, Pwm, Sensor};
use super::{ARM, decode, frame};
use wheeleg_node::hardware::{FootSwitches, FourValves};
use wheeleg_node::joint::JointNode;
use wheeleg_node::mode::Mode;
use wheeleg_node::parameters::JointParameters;
use wheeleg_node::snapshot::TickReport;
use wheeleg_node::{ConfigError, NodeIdentity, Transmission};
use wheeleg_protocol::{
    Address, ClearFault, JointSetpoint, LinkLossAction, Message, SlotReply, Sync, SyncFlags,
    SyncSlots,
};
use wheeleg_units::{AdcCode, Micros, PositionMm, WireVelocity};

type Valves = FourValves<Pwm, Pwm, Pwm, Pwm>;
type Feet = FootSwitches<Pin, Pin, Pin, Pin>;
pub type Node = JointNode<Valves, Sensor, Feet>;
type Make = fn(NodeIdentity, JointParameters, Valves, Sensor, Feet) -> Result<Node, ConfigError>;

/// Left-aligned code of a stroke with the default calibration: 200 mm full
/// scale, zero at 3277.
pub fn code_at(millimetres: f64) -> AdcCode {
    AdcCode::new(3277 + (millimetres * 65_536.0 / 200.0) as u16)
}

/// A set-point at rest.
pub fn setpoint(millimetres: f64, on_link_loss: LinkLossAction) -> JointSetpoint {
    JointSetpoint {
        reference: PositionMm::from_f64(millimetres),
        velocity: WireVelocity::ZERO,
        next: None,
        on_link_loss,
        track: true,
    }
}

pub struct JointRig {
    pub node: Node,
    pub valves: [Pwm; 4],
    pub sensor: Sensor,
    pub feet: [Pin; 4],
    /// Start of the next tick, µs.
    pub now: u32,
    pub cycle: u16,
    pub sequence: u16,
    pub address: Address,
}

impl JointRig {
    pub fn new() -> Self {
        Self::with(JointParameters::default())
    }

    pub fn with(parameters: JointParameters) -> Self {
        Self::made(Node::new, parameters, [3; 12])
    }

    /// With parameters from the board's memory.
    pub fn stored(parameters: JointParameters) -> Self {
        Self::made(
            |identity, parameters, valves, sensor, feet| {
                Node::from_store(identity, Some(parameters), valves, sensor, feet)
            },
            parameters,
            [3; 12],
        )
    }

    /// With a memory that is damaged.
    pub fn damaged() -> Self {
        Self::made(
            |identity, _, valves, sensor, feet| {
                Node::from_store(identity, None, valves, sensor, feet)
            },
            JointParameters::default(),
            [3; 12],
        )
    }

    /// With another processor.
    pub fn with_id(unique_id: [u8; 12]) -> Self {
        Self::made(Node::new, JointParameters::default(), unique_id)
    }

    fn made(make: Make, parameters: JointParameters, unique_id: [u8; 12]) -> Self {
        let valves: [Pwm; 4] = Default::default();
        let feet: [Pin; 4] = Default::default();
        let sensor = Sensor::at(code_at(100.0).get());
        let address = Address::joint(3).unwrap();
        let [fill_a, vent_a, fill_b, vent_b] = valves.clone();
        let [a, b, c, d] = feet.clone();
        let node = make(
            NodeIdentity { address, unique_id },
            parameters,
            FourValves {
                fill_a,
                vent_a,
                fill_b,
                vent_b,
            },
            sensor.clone(),
            FootSwitches(a, b, c, d),
        )
        .expect("defaults are consistent");
        Self {
            node,
            valves,
            sensor,
            feet,
            now: 1_000,
            cycle: 100,
            sequence: 0,
            address,
        }
    }

    /// Armed, with a living link, at 100 mm.
    pub fn armed() -> Self {
        let mut rig = Self::new();
        rig.run_cycles(3, None);
        assert_eq!(rig.node.mode(), Mode::Idle);
        assert!(matches!(rig.request(&ARM), Message::Ack(_)));
        rig
    }

    /// Tracking a reference of 100 mm with the given action on link loss.
    pub fn tracking(on_link_loss: LinkLossAction) -> Self {
        let mut rig = Self::armed();
        rig.run_cycles(5, Some(setpoint(100.0, on_link_loss)));
        assert_eq!(rig.node.mode(), Mode::Tracking);
        rig
    }

    /// Tracking with an error, so that valves are energised.
    pub fn pushing(on_link_loss: LinkLossAction) -> Self {
        let mut rig = Self::tracking(on_link_loss);
        rig.run_cycles(10, Some(setpoint(140.0, on_link_loss)));
        assert!(rig.any_open(), "the law pushes");
        rig
    }

    pub fn tick(&mut self) -> TickReport {
        let writes: Vec<u32> = self.valves.iter().map(|valve| valve.writes.get()).collect();
        let report = self.node.tick(Micros(self.now));
        for (valve, before) in self.valves.iter().zip(writes) {
            assert!(
                valve.writes.get() > before,
                "outputs are written every tick"
            );
        }
        self.node.tick_done(Micros(self.now.wrapping_add(200)));
        self.now = self.now.wrapping_add(1000);
        report
    }

    pub fn run(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.tick();
        }
    }

    /// Sends one SYNC that ends now; gives the reply.
    pub fn sync(&mut self, slot: Option<JointSetpoint>, emergency: bool) -> (u32, SlotReply) {
        self.cycle = self.cycle.wrapping_add(1);
        self.stale_sync(slot, emergency)
    }

    /// As [`Self::sync`], with the counter of the last one.
    pub fn stale_sync(&mut self, slot: Option<JointSetpoint>, emergency: bool) -> (u32, SlotReply) {
        let mut slots = SyncSlots::NONE;
        if let Some(slot) = slot {
            slots.set_joint(self.address, slot);
        }
        let message = Message::Sync(Sync {
            cycle: self.cycle,
            master_time_us: 0,
            flags: if emergency {
                SyncFlags::ESTOP
            } else {
                SyncFlags::NONE
            },
            slots,
        });
        let bytes = frame(Address::BROADCAST, 0, &message);
        self.node.on_bus_bytes(&bytes, Micros(self.now));
        let reply = self.node.take_transmission().expect("SYNC is answered");
        match decode(&reply) {
            (_, Message::SlotReply(message)) => (reply.start_at.get(), message),
            other => panic!("{other:?}"),
        }
    }

    /// Whole bus cycles of ten ticks.
    pub fn run_cycles(&mut self, cycles: u32, slot: Option<JointSetpoint>) {
        for _ in 0..cycles {
            self.sync(slot, false);
            self.run(10);
        }
    }

    pub fn send(&mut self, message: &Message, sequence: u16) -> Option<Transmission> {
        let bytes = frame(self.address, sequence, message);
        self.node.on_bus_bytes(&bytes, Micros(self.now));
        self.node.take_transmission()
    }

    /// A request and its answer.
    pub fn request(&mut self, message: &Message) -> Message {
        self.sequence = self.sequence.wrapping_add(1);
        let sequence = self.sequence;
        let answer = self.send(message, sequence).expect("requests are answered");
        let (envelope, message) = decode(&answer);
        assert_eq!(envelope.sequence, sequence);
        assert_eq!(envelope.destination, Address::MASTER);
        message
    }

    pub fn clear(&mut self) -> Message {
        self.request(&Message::ClearFault(ClearFault {}))
    }

    /// Duty of each channel for the next tick, 0…1000.
    pub fn duty(&self) -> [u16; 4] {
        [0, 1, 2, 3].map(|index: usize| self.valves[index].duty.get())
    }

    pub fn any_open(&self) -> bool {
        self.duty() != [0; 4]
    }

    pub fn move_to(&self, millimetres: f64) {
        self.sensor.set(Ok(code_at(millimetres)));
    }
}
