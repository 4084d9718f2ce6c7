//! A flipped bit in what a joint board keeps between two ticks means Hold.

use super::node::JointNode;
use super::reference::Target;
use crate::NodeIdentity;
use crate::hardware::{NoSwitches, PinError, PositionSensor, SensorError, ValveBank};
use crate::mode::{Event, Mode};
use crate::parameters::JointParameters;
use wheeleg_control::joint::{Correction, JointConfig, JointGains};
use wheeleg_control::pwm::PwmTiming;
use wheeleg_control::valve::ValveMode;
use wheeleg_protocol::param::JointParam;
use wheeleg_protocol::{Address, Fault};
use wheeleg_units::{AdcCode, Micros, PositionMm};

struct Valves([u16; 4]);

impl ValveBank for Valves {
    fn max_duty(&self) -> u16 {
        1000
    }

    fn write(&mut self, duty: [u16; 4]) -> Result<(), PinError> {
        self.0 = duty;
        Ok(())
    }
}

struct Sensor;

impl PositionSensor for Sensor {
    fn read(&mut self) -> Result<AdcCode, SensorError> {
        Ok(AdcCode::new(36_000))
    }
}

type Node = JointNode<Valves, Sensor, NoSwitches>;

fn armed() -> Node {
    let identity = NodeIdentity {
        address: Address::joint(1).unwrap(),
        unique_id: [0; 12],
    };
    let parameters = JointParameters::default();
    let mut node =
        JointNode::new(identity, parameters, Valves([0; 4]), Sensor, NoSwitches).unwrap();
    for tick in 0..20 {
        node.tick(Micros(tick * 1000));
    }
    assert_eq!(node.mode(), Mode::Idle);
    node.core
        .supervisor
        .apply(Event::Arm, Micros(20_000))
        .unwrap();
    node.tick(Micros(20_000));
    assert_eq!(node.mode(), Mode::Armed);
    node
}

fn holds_after(damage: impl FnOnce(&mut Node)) -> bool {
    let mut node = armed();
    damage(&mut node);
    node.tick(Micros(21_000));
    let held = node.mode() == Mode::Hold && node.faults().contains(Fault::StateCorrupt);
    held && node.snapshot().pulses == [Micros::ZERO; 4]
}

#[test]
fn untouched_state_is_sound() {
    assert!(!holds_after(|_| {}));
}

#[test]
fn every_flipped_bit_of_the_reference_is_seen() {
    for bit in 0..32 {
        assert!(holds_after(|node| {
            node.state.reference = PositionMm::from_raw(node.state.reference.raw() ^ (1 << bit));
        }));
    }
}

#[test]
fn damaged_controller_valve_and_target_state_is_seen() {
    // One hidden sample of position in the history of the velocity estimate.
    assert!(holds_after(|node| {
        node.controller.observe(PositionMm::from_int(50));
    }));
    assert!(holds_after(|node| {
        node.controller.set_correction(Correction::Id);
    }));
    assert!(holds_after(|node| {
        let push = ValveMode::Push.openings(Micros(10_000));
        let _ = node.pwm.tick(&push);
    }));
    assert!(holds_after(|node| {
        node.target = Target::at(PositionMm::from_raw(1));
    }));
    assert!(holds_after(|node| {
        node.settings.staged_exhaust = ValveMode::BlowThrough.openings(Micros(10_000));
    }));
}

#[test]
fn a_request_does_not_hide_earlier_damage() {
    assert!(holds_after(|node| {
        node.state.reference = PositionMm::from_raw(node.state.reference.raw() ^ 1);
        node.change(|node| node.controller.set_correction(Correction::Id));
    }));
    assert!(!holds_after(|node| {
        node.change(|node| node.controller.set_correction(Correction::Id));
    }));
}

#[test]
fn damaged_parameters_settings_and_gains_are_seen() {
    let slow = JointParam::FollowingTime.id();
    assert!(holds_after(|node| {
        node.parameters = node.parameters.with(slow, 1501, true).unwrap();
    }));
    assert!(holds_after(|node| {
        node.settings.sensor.step_max = PositionMm::ZERO;
    }));
    assert!(holds_after(|node| {
        node.core.times.hold = Micros(node.core.times.hold.get() ^ 1);
    }));
    assert!(holds_after(|node| {
        let gains = JointGains {
            feed_forward: fixed::FixedI32::from_bits(1),
            ..*node.controller.config().gains()
        };
        let config = JointConfig::new(&gains, Micros(1000)).unwrap();
        node.controller.retune(config);
    }));
    assert!(holds_after(|node| {
        let tick = Micros(1000);
        let timing = PwmTiming::new(Micros(20_000), tick, tick, tick, tick).unwrap();
        node.pwm.set_timing(timing);
    }));
}
