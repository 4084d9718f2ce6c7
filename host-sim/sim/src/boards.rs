//! Board models: an application, the simulated hardware around it, and the
//! latching at its tick edges.
//!
//! At a tick edge the outputs preloaded during the last tick become active,
//! then the inputs are latched, then the application runs. So a measurement
//! acts on a valve one tick later, as on the board.

use wheeleg_node::hardware::{
    DumpPin, FootSwitches, FourValves, HBridge, NoDumpValve, NoSwitches, SupplySwitch,
};
use wheeleg_node::joint::JointNode;
use wheeleg_node::parameters::{JointParameters, WheelParameters};
use wheeleg_node::snapshot::TickReport;
use wheeleg_node::wheel::WheelNode;
use wheeleg_node::{ConfigError, NodeIdentity, Transmission};
use wheeleg_protocol::{Address, Fault, FaultBits, NackReason, Node, ResetCause};
use wheeleg_units::Micros;

use super::hal::{AdcInput, CounterInput, Line, PwmChannel};
use super::memory::Taken;
use crate::SimError;

/// Counts of the valve timer in one tick: 1 µs each.
const VALVE_COUNTS: u16 = 1000;
/// Counts of the H-bridge timer in one period: per cent, as on the HCTL-1100.
const BRIDGE_COUNTS: u16 = 100;

type Valves = FourValves<PwmChannel, PwmChannel, PwmChannel, PwmChannel>;
type Feet = FootSwitches<Line, Line, Line, Line>;

/// The application of a joint board; vertical joints read the foot switches.
enum JointApplication {
    Plain(JointNode<Valves, AdcInput, NoSwitches>),
    WithFoot(JointNode<Valves, AdcInput, Feet>),
}

macro_rules! each {
    ($self:expr, $node:ident => $call:expr) => {
        match $self {
            JointApplication::Plain($node) => $call,
            JointApplication::WithFoot($node) => $call,
        }
    };
}

/// One joint board.
pub struct JointBoard {
    application: JointApplication,
    sensor: AdcInput,
    foot: [Line; 4],
    valves: [PwmChannel; 4],
}

/// The four valve channels as the application owns them.
fn bank(valves: &[PwmChannel; 4]) -> Valves {
    let [fill_a, vent_a, fill_b, vent_b] = valves.clone();
    FourValves {
        fill_a,
        vent_a,
        fill_b,
        vent_b,
    }
}

/// The four foot switches as the application owns them.
fn feet(foot: &[Line; 4]) -> Feet {
    let [front, left, rear, right] = foot.clone();
    FootSwitches(front, left, rear, right)
}

/// A board of its own, in the same state: the two share no hardware.
impl Clone for JointBoard {
    fn clone(&self) -> Self {
        let sensor = self.sensor.copy();
        let foot = self.foot.each_ref().map(Line::copy);
        let valves = self.valves.each_ref().map(PwmChannel::copy);
        let application = match &self.application {
            JointApplication::Plain(node) => JointApplication::Plain(node.clone().on_hardware(
                bank(&valves),
                sensor.clone(),
                NoSwitches,
            )),
            JointApplication::WithFoot(node) => JointApplication::WithFoot(
                node.clone()
                    .on_hardware(bank(&valves), sensor.clone(), feet(&foot)),
            ),
        };
        Self {
            application,
            sensor,
            foot,
            valves,
        }
    }
}

/// The board at an address; the 96-bit unique id of its processor is the address in
/// every byte.
pub fn identity(address: Address) -> NodeIdentity {
    NodeIdentity {
        address,
        unique_id: [address.raw(); 12],
    }
}

/// Another processor behind the same straps.
pub(super) fn duplicate_identity(address: Address) -> NodeIdentity {
    NodeIdentity {
        address,
        unique_id: [!address.raw(); 12],
    }
}

/// Whether a board has refused the parameters that it was given.
const fn is_refused(faults: FaultBits) -> bool {
    faults.contains(Fault::ParameterCorrupt)
}

fn rejected(address: Address, error: ConfigError) -> SimError {
    let why = match error {
        ConfigError::Address => "its address straps name a board of another kind",
        ConfigError::Parameters => "its parameters contradict each other",
    };
    SimError::simulation(
        format!("the board of {address} refuses its configuration: {why}"),
        "see the sections [node.…] of the robot file",
    )
}

/// The board's parameters: its defaults with the commissioned values on top.
fn stored_parameters<P>(
    address: Address,
    stored: Option<&[(u16, i32)]>,
    defaults: P,
    with: impl Fn(&P, u16, i32) -> Result<P, NackReason>,
) -> Result<Option<P>, SimError> {
    let Some(stored) = stored else {
        return Ok(None);
    };
    let set = stored.iter().try_fold(defaults, |parameters, (id, raw)| {
        with(&parameters, *id, *raw).map_err(|reason| {
            SimError::simulation(
                format!(
                    "the board of {address} refuses parameter 0x{id:04X} = {raw}: {}",
                    reason.text()
                ),
                "see the sections [node.…] of the robot file",
            )
        })
    });
    set.map(Some)
}

impl JointBoard {
    /// The board `who`, in boot, all valves off. `stored` are the parameters
    /// (number, raw value) that its memory holds, none if it is damaged, `cause` why its
    /// processor starts.
    ///
    /// # Errors
    /// [`SimError::Simulation`] if the application refuses its parameters.
    pub fn new(
        who: NodeIdentity,
        stored: Option<&[(u16, i32)]>,
        cause: ResetCause,
    ) -> Result<Self, SimError> {
        let address = who.address;
        let parameters =
            stored_parameters(address, stored, JointParameters::default(), |p, id, raw| {
                p.with(id, raw, true)
            })?;
        let sensor = AdcInput::default();
        let valves: [PwmChannel; 4] = std::array::from_fn(|_| PwmChannel::new(VALVE_COUNTS));
        let foot: [Line; 4] = std::array::from_fn(|_| Line::default());
        let valve_bank = bank(&valves);
        let application = if address.node().is_some_and(Node::has_foot) {
            JointNode::from_store(who, parameters, valve_bank, sensor.clone(), feet(&foot))
                .map(JointApplication::WithFoot)
        } else {
            JointNode::from_store(who, parameters, valve_bank, sensor.clone(), NoSwitches)
                .map(JointApplication::Plain)
        };
        let mut application = application.map_err(|e| rejected(address, e))?;
        if stored.is_some() && each!(&application, node => is_refused(node.faults())) {
            return Err(rejected(address, ConfigError::Parameters));
        }
        each!(&mut application, node => node.started_by(cause));
        Ok(Self {
            application,
            sensor,
            foot,
            valves,
        })
    }

    /// On-times that become active at this tick edge, µs.
    pub fn active_on_us(&self) -> [u16; 4] {
        std::array::from_fn(|i| self.valves[i].preloaded())
    }

    /// The outputs that become active at this tick edge, as boards outside of
    /// this process report them.
    pub(super) fn active_outputs(&self) -> wheeleg_remote_link::Outputs {
        wheeleg_remote_link::Outputs {
            valve_on_us: self.active_on_us(),
            ..Default::default()
        }
    }

    /// Latches the inputs and runs the tick that starts now.
    pub fn tick(&mut self, now: Micros, code: u16, foot: [bool; 4]) -> TickReport {
        self.sensor.latch(code);
        for (line, closed) in self.foot.iter().zip(foot) {
            line.set_level(closed);
        }
        each!(&mut self.application, node => {
            let report = node.tick(now);
            // Native code takes no simulated time; the emulated boards measure it.
            node.tick_done(now);
            report
        })
    }

    /// Hands received bytes over; the last one ended at `t_end`.
    pub fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros) {
        each!(&mut self.application, node => node.on_bus_bytes(bytes, t_end));
    }

    /// What is to be stored now, if the board wants it: then it takes it as stored.
    pub(super) fn take_save(&mut self, now: Micros) -> Option<Vec<(u16, i32)>> {
        let mut taken = Taken::default();
        each!(&mut self.application, node => if node.save_is_due() {
            node.save(&mut taken, now);
        });
        taken.0
    }

    /// The driver-enable guard has cut a transmission off.
    pub(super) fn driver_cut_off(&mut self, at: Micros) {
        each!(&mut self.application, node => node.driver_cut_off(at));
    }

    /// What the application wants to send.
    pub fn take_transmission(&mut self) -> Option<Transmission> {
        each!(&mut self.application, node => node.take_transmission())
    }

    /// Internals after the last tick.
    pub fn snapshot(&self) -> &wheeleg_node::snapshot::JointSnapshot {
        each!(&self.application, node => node.snapshot())
    }

    /// What the board makes of its piston after the last tick.
    pub(super) fn motion_account(&self) -> wheeleg_node::joint::MotionAccount {
        each!(&self.application, node => node.motion_account())
    }
}

/// The application of a wheel board; the first one has the supply switch and
/// the dump valve.
enum WheelApplication {
    Plain(WheelNode<HBridge<PwmChannel, Line>, CounterInput, NoSwitches, NoDumpValve>),
    WithSupply(
        WheelNode<HBridge<PwmChannel, Line>, CounterInput, SupplySwitch<Line>, DumpPin<Line>>,
    ),
}

macro_rules! each_wheel {
    ($self:expr, $node:ident => $call:expr) => {
        match $self {
            WheelApplication::Plain($node) => $call,
            WheelApplication::WithSupply($node) => $call,
        }
    };
}

/// One wheel board.
pub(crate) struct WheelBoard {
    application: WheelApplication,
    encoder: CounterInput,
    /// Quadrature edges at which the counter stood at 0.
    count_zero: i64,
    pulse: PwmChannel,
    sign: Line,
    supply: Line,
    dump: Line,
}

impl WheelBoard {
    /// The board `who`, in boot, bridge off. `stored` and `cause` as for joints.
    ///
    /// # Errors
    /// [`SimError::Simulation`] if the application refuses its parameters.
    pub(crate) fn new(
        who: NodeIdentity,
        stored: Option<&[(u16, i32)]>,
        cause: ResetCause,
    ) -> Result<Self, SimError> {
        let address = who.address;
        let parameters =
            stored_parameters(address, stored, WheelParameters::default(), |p, id, raw| {
                p.with(id, raw, true)
            })?;
        let encoder = CounterInput::default();
        let pulse = PwmChannel::new(BRIDGE_COUNTS);
        let (sign, supply, dump) = (Line::default(), Line::default(), Line::default());
        let bridge = HBridge {
            pulse: pulse.clone(),
            sign: sign.clone(),
        };
        let application = if address.node() == Some(Node::WHEELS[0]) {
            let switch = SupplySwitch(supply.clone());
            let valve = DumpPin(dump.clone());
            WheelNode::from_store(who, parameters, bridge, encoder.clone(), switch, valve)
                .map(WheelApplication::WithSupply)
        } else {
            WheelNode::from_store(
                who,
                parameters,
                bridge,
                encoder.clone(),
                NoSwitches,
                NoDumpValve,
            )
            .map(WheelApplication::Plain)
        };
        let mut application = application.map_err(|e| rejected(address, e))?;
        if stored.is_some() && each_wheel!(&application, node => is_refused(node.faults())) {
            return Err(rejected(address, ConfigError::Parameters));
        }
        each_wheel!(&mut application, node => node.started_by(cause));
        Ok(Self {
            application,
            encoder,
            count_zero: 0,
            pulse,
            sign,
            supply,
            dump,
        })
    }

    /// The counter of the board has just been started, with the wheel at `edges`.
    pub(super) fn counts_from(&mut self, edges: i64) {
        self.count_zero = edges;
    }

    /// The outputs that become active at this sample edge, as boards outside
    /// of this process report them.
    pub(super) fn active_outputs(&self) -> wheeleg_remote_link::Outputs {
        wheeleg_remote_link::Outputs {
            bridge_percent: self.pulse.preloaded() as u8,
            bridge_backward: self.sign.level(),
            dump: self.dump.level(),
            ..Default::default()
        }
    }

    /// Whether the dump valve is driven open.
    pub(super) fn dumps(&self) -> bool {
        self.dump.level()
    }

    /// Sample period of the application, µs.
    pub(super) fn period_us(&self) -> u32 {
        each_wheel!(&self.application, node => node.tick_period_us())
    }

    /// Latches the inputs and runs the sample that starts now.
    pub(super) fn tick(
        &mut self,
        now: Micros,
        encoder_edges: i64,
        supply_switch: bool,
    ) -> TickReport {
        self.encoder
            .latch(encoder_edges.wrapping_sub(self.count_zero));
        self.supply.set_level(supply_switch);
        each_wheel!(&mut self.application, node => {
            let report = node.tick(now);
            node.tick_done(now);
            report
        })
    }

    /// Hands received bytes over; the last one ended at `t_end`.
    pub(super) fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros) {
        each_wheel!(&mut self.application, node => node.on_bus_bytes(bytes, t_end));
    }

    /// What is to be stored now, if the board wants it: then it takes it as stored.
    pub(super) fn take_save(&mut self, now: Micros) -> Option<Vec<(u16, i32)>> {
        let mut taken = Taken::default();
        each_wheel!(&mut self.application, node => if node.save_is_due() {
            node.save(&mut taken, now);
        });
        taken.0
    }

    /// The driver-enable guard has cut a transmission off.
    pub(super) fn driver_cut_off(&mut self, at: Micros) {
        each_wheel!(&mut self.application, node => node.driver_cut_off(at));
    }

    /// What the application wants to send.
    pub(super) fn take_transmission(&mut self) -> Option<Transmission> {
        each_wheel!(&mut self.application, node => node.take_transmission())
    }

    /// Internals after the last sample.
    pub(super) fn snapshot(&self) -> &wheeleg_node::snapshot::WheelSnapshot {
        each_wheel!(&self.application, node => node.snapshot())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_protocol::param::JointParam;

    #[test]
    fn a_damaged_memory_is_a_fault_and_contradicting_parameters_are_refused() {
        let who = identity(Address::new(2).expect("a joint"));
        let new = |stored: Option<&[(u16, i32)]>| JointBoard::new(who, stored, ResetCause::PowerUp);
        let faults = |board: &JointBoard| each!(&board.application, node => node.faults());
        let damaged = new(None).expect("it starts");
        assert!(faults(&damaged).contains(Fault::ParameterCorrupt));
        let blank = new(Some(&[])).expect("it starts");
        assert!(faults(&blank).is_empty());
        let (low, high) = (JointParam::StrokeMin.id(), JointParam::StrokeMax.id());
        let crossed = new(Some(&[(low, 150 << 16), (high, 20 << 16)]));
        assert!(crossed.is_err());
    }
}
