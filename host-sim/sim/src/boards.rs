//! Board models: an application, the simulated hardware around it, and the
//! latching at its tick edges.
//!
//! At a tick edge the outputs preloaded during the last tick become active,
//! then the inputs are latched, then the application runs. So a measurement
//! acts on a valve one tick later, as on the board.

use wheeleg_node::hardware::{
    DumpPin, DumpValve, FootSwitches, FourValves, HBridge, PinError, SupplySwitch, SwitchBank,
};
use wheeleg_node::joint::JointNode;
use wheeleg_node::parameters::{JointParameters, WheelParameters};
use wheeleg_node::snapshot::{JointSnapshot, TickReport};
use wheeleg_node::wheel::WheelNode;
use wheeleg_node::{ConfigError, NodeIdentity, Transmission};
use wheeleg_protocol::{Address, Fault, FaultBits, NackReason, Node, ResetCause};
use wheeleg_units::Micros;

use super::hal::{AdcInput, CounterInput, Line, PwmChannel};
use crate::SimError;

/// Counts of the valve timer in one tick: 1 µs each.
const VALVE_COUNTS: u16 = 1000;
/// Counts of the H-bridge timer in one period: per cent, as on the HCTL-1100.
const BRIDGE_COUNTS: u16 = 100;

type Valves = FourValves<PwmChannel, PwmChannel, PwmChannel, PwmChannel>;
type Feet = FootSwitches<Line, Line, Line, Line>;
type Bridge = HBridge<PwmChannel, Line>;
type Supply = Fitted<SupplySwitch<Line>>;
type Dump = Fitted<DumpPin<Line>>;

/// Hardware that not every board of a kind has.
#[derive(Clone)]
pub(super) struct Fitted<T>(Option<T>);

impl<T: SwitchBank> SwitchBank for Fitted<T> {
    fn read(&mut self) -> Result<u8, PinError> {
        self.0.as_mut().map_or(Ok(0), T::read)
    }
}

impl<T: DumpValve> DumpValve for Fitted<T> {
    fn set_open(&mut self, open: bool) -> Result<(), PinError> {
        let valve = self.0.as_mut();
        valve.map_or(Ok(()), |valve| valve.set_open(open))
    }
}

/// One joint board; vertical joints read the foot switches.
pub struct JointBoard {
    pub(super) node: JointNode<Valves, AdcInput, Fitted<Feet>>,
    address: Address,
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

/// The four foot switches as the application of this board owns them.
fn feet(address: Address, foot: &[Line; 4]) -> Fitted<Feet> {
    let has_foot = address.node().is_some_and(Node::has_foot);
    let [front, left, rear, right] = foot.clone();
    Fitted(has_foot.then_some(FootSwitches(front, left, rear, right)))
}

/// Makes a separate board in the same state: the two share no hardware.
impl Clone for JointBoard {
    fn clone(&self) -> Self {
        let sensor = self.sensor.copy();
        let foot = self.foot.each_ref().map(Line::copy);
        let valves = self.valves.each_ref().map(PwmChannel::copy);
        let node =
            self.node
                .clone()
                .on_hardware(bank(&valves), sensor.clone(), feet(self.address, &foot));
        Self {
            node,
            address: self.address,
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
        let (valve_bank, feet) = (bank(&valves), feet(address, &foot));
        let mut node = JointNode::from_store(who, parameters, valve_bank, sensor.clone(), feet)
            .map_err(|e| rejected(address, e))?;
        if stored.is_some() && is_refused(node.faults()) {
            return Err(rejected(address, ConfigError::Parameters));
        }
        node.started_by(cause);
        Ok(Self {
            node,
            address,
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
        let report = self.node.tick(now);
        // Native code takes no simulated time; the emulated boards measure it.
        self.node.tick_done(now);
        report
    }

    /// Hands received bytes over; the last one ended at `t_end`.
    pub fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros) {
        self.node.on_bus_bytes(bytes, t_end);
    }

    /// Takes the application's next transmission.
    pub fn take_transmission(&mut self) -> Option<Transmission> {
        self.node.take_transmission()
    }

    /// Internals after the last tick.
    pub fn snapshot(&self) -> &JointSnapshot {
        self.node.snapshot()
    }
}

/// One wheel board; the first one has the supply switch and the dump valve.
pub(crate) struct WheelBoard {
    pub(super) node: WheelNode<Bridge, CounterInput, Supply, Dump>,
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
        let has_supply = address.node() == Some(Node::WHEELS[0]);
        let switch = Fitted(has_supply.then(|| SupplySwitch(supply.clone())));
        let valve = Fitted(has_supply.then(|| DumpPin(dump.clone())));
        let mut node =
            WheelNode::from_store(who, parameters, bridge, encoder.clone(), switch, valve)
                .map_err(|e| rejected(address, e))?;
        if stored.is_some() && is_refused(node.faults()) {
            return Err(rejected(address, ConfigError::Parameters));
        }
        node.started_by(cause);
        Ok(Self {
            node,
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
        let report = self.node.tick(now);
        self.node.tick_done(now);
        report
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
        let faults = |board: &JointBoard| board.node.faults();
        let damaged = new(None).expect("it starts");
        assert!(faults(&damaged).contains(Fault::ParameterCorrupt));
        let blank = new(Some(&[])).expect("it starts");
        assert!(faults(&blank).is_empty());
        let (low, high) = (JointParam::StrokeMin.id(), JointParam::StrokeMax.id());
        let crossed = new(Some(&[(low, 150 << 16), (high, 20 << 16)]));
        assert!(crossed.is_err());
    }
}
