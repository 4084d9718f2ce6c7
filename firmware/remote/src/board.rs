//! The two applications, each behind the same face.

use wheeleg_node::hardware::{DumpPin, FourValves, HBridge, ParameterStore};
use wheeleg_node::joint::JointNode;
use wheeleg_node::parameters::{JointParameters, WheelParameters};
use wheeleg_node::wheel::WheelNode;
use wheeleg_node::{ConfigError, JOINT_TICK, NodeIdentity, Transmission};
use wheeleg_protocol::{NackReason, ResetCause};
use wheeleg_remote_link::{Inputs, Outputs, Switches as WireSwitches};
use wheeleg_units::Micros;

use crate::pins::{
    BRIDGE_COUNTS, Channel, JointPins, Output, Potentiometer, Quadrature, Switches, VALVE_COUNTS,
    WheelPins,
};

/// A board application with its hardware in messages.
pub trait Board<'p>: Sized {
    /// Cells in place of the peripherals.
    type Pins;
    /// Parameters of the application.
    type Parameters: Default + Clone;

    /// Name of the application: `joint` or `wheel`.
    const NAME: &'static str;

    /// A copy of the parameters with one value changed.
    ///
    /// # Errors
    /// [`NackReason`] of the table.
    fn with(
        parameters: &Self::Parameters,
        id: u16,
        raw: i32,
    ) -> Result<Self::Parameters, NackReason>;

    /// The board after reset, outputs off.
    ///
    /// # Errors
    /// [`ConfigError`]: wrong address for the role, or contradicting parameters.
    fn new(
        identity: NodeIdentity,
        parameters: Self::Parameters,
        pins: &'p Self::Pins,
    ) -> Result<Self, ConfigError>;

    /// Says why the board started, before its first tick.
    fn started_by(&mut self, cause: ResetCause);

    /// Whether the parameters should be stored.
    fn save_is_due(&self) -> bool;

    /// Stores the parameters.
    fn save(&mut self, store: &mut impl ParameterStore, at: Micros);

    /// Latches the inputs of the tick that is about to start.
    fn latch(&mut self, inputs: &Inputs);

    /// Runs the tick that starts at `now`.
    fn tick(&mut self, now: Micros);

    /// The tick's work ended at `end`.
    fn tick_done(&mut self, end: Micros);

    /// Preset outputs, effective at the next tick edge.
    fn outputs(&self) -> Outputs;

    /// Inputs as the application last read them; those that it does not read are zero.
    fn seen(&self) -> Inputs;

    /// Period of the tick timer, µs.
    fn period_us(&self) -> u32;

    /// Bytes of the bus; the last of them ended at `t_end`.
    fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros);

    /// The next frame to send.
    fn take_transmission(&mut self) -> Option<Transmission>;
}

type Valves<'p> = FourValves<Channel<'p>, Channel<'p>, Channel<'p>, Channel<'p>>;

/// A joint board.
#[derive(Debug)]
pub struct RemoteJoint<'p> {
    node: JointNode<Valves<'p>, Potentiometer<'p>, Switches<'p>>,
    pins: &'p JointPins,
    mask: u8,
}

/// Joint boards that read the foot switches of their leg.
const fn has_foot(address: u8) -> bool {
    matches!(address, 3 | 6)
}

/// The wheel board with supply switch and dump valve.
const fn has_supply(address: u8) -> bool {
    address == 7
}

impl<'p> Board<'p> for RemoteJoint<'p> {
    type Pins = JointPins;
    type Parameters = JointParameters;
    const NAME: &'static str = "joint";

    fn with(
        parameters: &JointParameters,
        id: u16,
        raw: i32,
    ) -> Result<JointParameters, NackReason> {
        parameters.with(id, raw, true)
    }

    // Made where it is kept: each move on the way would be kilobytes of stack.
    #[inline(always)]
    fn new(
        identity: NodeIdentity,
        parameters: JointParameters,
        pins: &'p JointPins,
    ) -> Result<Self, ConfigError> {
        let [fill_a, vent_a, fill_b, vent_b] = &pins.duty;
        let valves = FourValves {
            fill_a: Channel::new(fill_a, VALVE_COUNTS),
            vent_a: Channel::new(vent_a, VALVE_COUNTS),
            fill_b: Channel::new(fill_b, VALVE_COUNTS),
            vent_b: Channel::new(vent_b, VALVE_COUNTS),
        };
        // Nothing is left of a life before this reset.
        for duty in &pins.duty {
            duty.set(0);
        }
        pins.code.set(0);
        pins.switches.set(0);
        let mask = if has_foot(identity.address.raw()) {
            WireSwitches::FOOT
        } else {
            0
        };
        let switches = Switches {
            levels: &pins.switches,
            mask,
        };
        let sensor = Potentiometer(&pins.code);
        let node = JointNode::from_store(identity, Some(parameters), valves, sensor, switches)?;
        Ok(Self { node, pins, mask })
    }

    fn started_by(&mut self, cause: ResetCause) {
        self.node.started_by(cause);
    }

    fn save_is_due(&self) -> bool {
        self.node.save_is_due()
    }

    fn save(&mut self, store: &mut impl ParameterStore, at: Micros) {
        self.node.save(store, at);
    }

    fn latch(&mut self, inputs: &Inputs) {
        self.pins.code.set(inputs.adc);
        self.pins.switches.set(inputs.switches.0);
    }

    fn tick(&mut self, now: Micros) {
        self.node.tick(now);
    }

    fn tick_done(&mut self, end: Micros) {
        self.node.tick_done(end);
    }

    fn outputs(&self) -> Outputs {
        let [a, b, c, d] = &self.pins.duty;
        Outputs {
            valve_on_us: [a.get(), b.get(), c.get(), d.get()],
            ..Outputs::default()
        }
    }

    fn seen(&self) -> Inputs {
        Inputs {
            adc: self.pins.code.get(),
            switches: WireSwitches(self.pins.switches.get() & self.mask),
            ..Inputs::default()
        }
    }

    fn period_us(&self) -> u32 {
        JOINT_TICK.get()
    }

    fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros) {
        self.node.on_bus_bytes(bytes, t_end);
    }

    fn take_transmission(&mut self) -> Option<Transmission> {
        self.node.take_transmission()
    }
}

/// A wheel board.
#[derive(Debug)]
pub struct RemoteWheel<'p> {
    node: WheelNode<
        HBridge<Channel<'p>, Output<'p>>,
        Quadrature<'p>,
        Switches<'p>,
        DumpPin<Output<'p>>,
    >,
    pins: &'p WheelPins,
    has_supply: bool,
}

impl<'p> Board<'p> for RemoteWheel<'p> {
    type Pins = WheelPins;
    type Parameters = WheelParameters;
    const NAME: &'static str = "wheel";

    fn with(
        parameters: &WheelParameters,
        id: u16,
        raw: i32,
    ) -> Result<WheelParameters, NackReason> {
        parameters.with(id, raw, true)
    }

    fn new(
        identity: NodeIdentity,
        parameters: WheelParameters,
        pins: &'p WheelPins,
    ) -> Result<Self, ConfigError> {
        let has_supply = has_supply(identity.address.raw());
        // Nothing is left of a life before this reset.
        pins.pulse.set(0);
        pins.backward.set(false);
        pins.dump.set(false);
        pins.count.set(0);
        pins.supply.set(0);
        let bridge = HBridge {
            pulse: Channel::new(&pins.pulse, BRIDGE_COUNTS),
            sign: Output(&pins.backward),
        };
        let supply = Switches {
            levels: &pins.supply,
            mask: u8::from(has_supply),
        };
        let encoder = Quadrature(&pins.count);
        let dump = DumpPin(Output(&pins.dump));
        let node =
            WheelNode::from_store(identity, Some(parameters), bridge, encoder, supply, dump)?;
        Ok(Self {
            node,
            pins,
            has_supply,
        })
    }

    fn started_by(&mut self, cause: ResetCause) {
        self.node.started_by(cause);
    }

    fn save_is_due(&self) -> bool {
        self.node.save_is_due()
    }

    fn save(&mut self, store: &mut impl ParameterStore, at: Micros) {
        self.node.save(store, at);
    }

    fn latch(&mut self, inputs: &Inputs) {
        self.pins.count.set(inputs.encoder);
        self.pins.supply.set(u8::from(inputs.switches.supply()));
    }

    fn tick(&mut self, now: Micros) {
        self.node.tick(now);
    }

    fn tick_done(&mut self, end: Micros) {
        self.node.tick_done(end);
    }

    fn outputs(&self) -> Outputs {
        Outputs {
            // At most 100, the counts of the channel.
            bridge_percent: u8::try_from(self.pins.pulse.get()).unwrap_or(u8::MAX),
            bridge_backward: self.pins.backward.get(),
            // Board 8 has no dump valve behind the pin.
            dump: self.pins.dump.get() && self.has_supply,
            ..Outputs::default()
        }
    }

    fn seen(&self) -> Inputs {
        Inputs {
            encoder: self.pins.count.get(),
            switches: WireSwitches::from_supply(self.has_supply && self.pins.supply.get() != 0),
            ..Inputs::default()
        }
    }

    fn period_us(&self) -> u32 {
        self.node.tick_period_us()
    }

    fn on_bus_bytes(&mut self, bytes: &[u8], t_end: Micros) {
        self.node.on_bus_bytes(bytes, t_end);
    }

    fn take_transmission(&mut self) -> Option<Transmission> {
        self.node.take_transmission()
    }
}
