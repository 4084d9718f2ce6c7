//! A flipped bit in what a wheel board keeps between two samples means Hold.

use super::motion::Target;
use super::node::WheelNode;
use crate::NodeIdentity;
use crate::hardware::{Encoder, MotorDrive, NoDumpValve, NoSwitches, PinError};
use crate::mode::{Event, Mode};
use crate::parameters::WheelParameters;
use wheeleg_control::wheel::{
    LeadFilter, SampleTimer, WheelAcceleration, WheelCommand, WheelVelocity,
};
use wheeleg_protocol::{Address, Fault};
use wheeleg_units::{Micros, WheelCount};

struct Motor(i8);

impl MotorDrive for Motor {
    fn write(&mut self, percent: i8) -> Result<(), PinError> {
        self.0 = percent;
        Ok(())
    }
}

struct Still;

impl Encoder for Still {
    fn count(&mut self) -> WheelCount {
        WheelCount::ZERO
    }
}

type Node = WheelNode<Motor, Still, NoSwitches, NoDumpValve>;

fn armed() -> Node {
    let identity = NodeIdentity {
        address: Address::wheel(8).unwrap(),
        unique_id: [0; 12],
    };
    let mut node = WheelNode::new(
        identity,
        WheelParameters::default(),
        Motor(0),
        Still,
        NoSwitches,
        NoDumpValve,
    )
    .unwrap();
    for tick in 0..20 {
        node.tick(Micros(tick * 520));
    }
    let now = Micros(20 * 520);
    node.core.supervisor.apply(Event::Arm, now).unwrap();
    node.change(Node::engage);
    node.tick(now);
    assert_eq!(node.mode(), Mode::Armed);
    node
}

fn holds_after(damage: impl FnOnce(&mut Node)) -> bool {
    let mut node = armed();
    damage(&mut node);
    node.tick(Micros(21 * 520));
    let held = node.mode() == Mode::Hold && node.faults().contains(Fault::StateCorrupt);
    held && node.motor.0 == 0
}

#[test]
fn untouched_state_is_sound() {
    assert!(!holds_after(|_| {}));
}

#[test]
fn damaged_controller_settings_and_state_are_seen() {
    assert!(holds_after(|node| {
        let command = WheelCommand::Position(WheelCount::wrapping_new(1));
        node.controller.apply(command).unwrap();
    }));
    assert!(holds_after(|node| node.settings.max_speed ^= 1));
    assert!(holds_after(|node| node.state.drive ^= 1));
    assert!(holds_after(|node| {
        node.target = Target::at(WheelCount::wrapping_new(1));
    }));
    assert!(holds_after(|node| {
        node.state.drive ^= 1;
        node.change(|node| node.target = Target::at(WheelCount::ZERO));
    }));
    assert!(holds_after(|node| {
        node.core.times.tick = Micros(node.core.times.tick.get() ^ 1);
    }));
}

#[test]
fn every_damaged_register_of_the_controller_is_seen() {
    let filter = |change: fn(&mut LeadFilter)| {
        let mut filter = armed().settings.filter;
        change(&mut filter);
        WheelCommand::Filter(filter)
    };
    for damage in [
        filter(|filter| filter.zero ^= 1),
        filter(|filter| filter.pole ^= 0x80),
        filter(|filter| filter.gain ^= 1),
        WheelCommand::SampleTimer(SampleTimer(0x41)),
        WheelCommand::Velocity(WheelVelocity::from_bits(1)),
        WheelCommand::Velocity(WheelVelocity::from_bits(i16::MIN)),
        WheelCommand::IntegralVelocity(1),
        WheelCommand::Acceleration(WheelAcceleration::from_bits(0x7FFF)),
        WheelCommand::MaximumVelocity(126),
        WheelCommand::FinalPosition(WheelCount::MIN),
        WheelCommand::SignReversalInhibit(true),
        WheelCommand::Enter(wheeleg_control::wheel::WheelMode::Idle),
    ] {
        assert!(
            holds_after(|node| node.controller.apply(damage).unwrap()),
            "{damage:?}"
        );
    }
}
