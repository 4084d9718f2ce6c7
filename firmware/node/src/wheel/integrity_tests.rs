//! A flipped bit in the state that a wheel board keeps between two samples leads to Hold at the next sample.

use super::motion::Target;
use super::node::WheelNode;
use crate::NodeIdentity;
use crate::hardware::{Encoder, MotorDrive, NoDumpValve, NoSwitches, PinError};
use crate::mode::{Event, Mode};
use crate::parameters::WheelParameters;
use wheeleg_control::wheel::{
    LeadFilter, SampleTimer, WheelAcceleration, WheelCommand, WheelVelocity,
};
use wheeleg_protocol::param::WheelParam;
use wheeleg_protocol::{Address, Fault, WheelControlMode};
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
    fn count(&mut self, _: WheelCount) -> WheelCount {
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
    is_held_at(&mut node, 21)
}

fn is_held_at(node: &mut Node, sample: u32) -> bool {
    node.tick(Micros(sample * 520));
    let held = node.mode() == Mode::Hold && node.faults().contains(Fault::StateCorrupt);
    held && node.motor.0 == 0
}

/// A flipped bit of the configuration is found by the next sample.
fn found_at_once(damage: impl Fn(&mut Node)) {
    assert!(holds_after(damage));
}

#[test]
fn damaged_configuration_is_seen_by_the_next_sample() {
    found_at_once(|node| {
        let speed = WheelParam::MaxSpeed.id();
        let raw = node.parameters.by_id(speed).unwrap();
        node.parameters = node.parameters.with(speed, raw - 1, true).unwrap();
    });
    found_at_once(|node| node.settings.max_speed ^= 1);
    found_at_once(|node| node.settings.stop_ramp = Micros::ZERO);
    found_at_once(|node| {
        node.core.times.tick = Micros(node.core.times.tick.get() ^ 1);
    });
    found_at_once(|node| node.control_mode = WheelControlMode::ProportionalVelocity);
}

/// After a later clear the node must not continue with damaged state.
#[test]
fn after_damage_the_controller_begins_anew_with_its_parameters() {
    let damages: [fn(&mut Node); 3] = [
        |node| {
            let filter = LeadFilter {
                gain: 99,
                ..node.settings.filter
            };
            node.controller.apply(WheelCommand::Filter(filter)).unwrap();
        },
        |node| {
            let timer = SampleTimer(77);
            let _ = node.controller.apply(WheelCommand::SampleTimer(timer));
        },
        |node| {
            let speed = WheelCommand::MaximumVelocity(3);
            node.controller.apply(speed).unwrap();
        },
    ];
    let stopped = |damage: fn(&mut Node)| {
        let mut node = armed();
        damage(&mut node);
        assert!(is_held_at(&mut node, 21));
        node.tick(Micros(22 * 520));
        node.controller
    };
    let sound = stopped(|node| node.state.drive ^= 1);
    for (index, damage) in damages.into_iter().enumerate() {
        assert_eq!(stopped(damage), sound, "{index}");
    }
}

#[test]
fn untouched_state_is_sound() {
    assert!(!holds_after(|_| {}));
}

#[test]
fn damaged_controller_and_state_are_seen() {
    assert!(holds_after(|node| {
        let command = WheelCommand::Position(WheelCount::wrapping_new(1));
        node.controller.apply(command).unwrap();
    }));
    assert!(holds_after(|node| node.state.drive ^= 1));
    assert!(holds_after(|node| {
        node.target = Target::at(WheelCount::wrapping_new(1));
    }));
    assert!(holds_after(|node| {
        node.state.drive ^= 1;
        node.change(|node| node.target = Target::at(WheelCount::ZERO));
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

/// A counter of 16 bits, as on the boards.
struct Short(u16);

impl Encoder for Short {
    fn count(&mut self, before: WheelCount) -> WheelCount {
        let counts = self.0.wrapping_sub(before.get() as u16) as i16;
        WheelCount::wrapping_new(before.get().wrapping_add(i32::from(counts)))
    }
}

#[test]
fn a_count_longer_than_the_counter_survives_a_flip_in_any_of_its_copies() {
    type Node = WheelNode<Motor, Short, NoSwitches, NoDumpValve>;
    // Beyond 16 bits in both directions: 400 counts per sample, and back.
    let turned = |node: &mut Node, samples: std::ops::Range<u32>, by: u16| {
        for sample in samples {
            node.encoder.0 = node.encoder.0.wrapping_add(by);
            node.tick(Micros(sample * 520));
        }
    };
    for (by, each) in [(400, 400), (400_u16.wrapping_neg(), -400)] {
        for bit in 0..24 {
            for copy in 0..6 {
                let identity = NodeIdentity {
                    address: Address::wheel(8).unwrap(),
                    unique_id: [0; 12],
                };
                let parameters = WheelParameters::default();
                let (motor, encoder) = (Motor(0), Short(0));
                let mut node = Node::new(
                    identity,
                    parameters,
                    motor,
                    encoder,
                    NoSwitches,
                    NoDumpValve,
                )
                .unwrap();
                turned(&mut node, 0..200, by);
                assert_eq!(node.snapshot().count.get(), 200 * each);
                let flip = |count: &mut WheelCount| {
                    *count = WheelCount::wrapping_new(count.get() ^ 1 << bit);
                };
                match copy {
                    0 => flip(&mut node.state.actual),
                    1 => flip(&mut node.counts[0]),
                    2 => flip(&mut node.counts[1]),
                    // Damage elsewhere does not matter here, even together with that of a copy.
                    3 => node.state.drive ^= 1,
                    _ => {
                        node.state.drive ^= 1;
                        flip(&mut node.counts[copy - 4]);
                    }
                }
                turned(&mut node, 200..201, by);
                let found = node.faults().contains(Fault::StateCorrupt);
                assert_eq!(found, copy == 0 || copy >= 3, "bit {bit}, copy {copy}");
                assert_eq!(
                    node.snapshot().count.get(),
                    201 * each,
                    "bit {bit}, copy {copy}"
                );
                turned(&mut node, 201..300, by);
                assert_eq!(node.snapshot().count.get(), 300 * each, "and after it");
            }
        }
    }
}
