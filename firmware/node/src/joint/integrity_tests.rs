//! A flipped bit in the state that a joint board keeps between two ticks leads to Hold at the next tick.

use super::no_motion_detector::{MotionModel, MotionWatch};
use super::node::JointNode;
use super::precharge::Precharge;
use super::reference::Target;
use crate::NodeIdentity;
use crate::board::Application;
use crate::checksum::Checksum;
use crate::hardware::{NoSwitches, PinError, PositionSensor, SensorError, ValveBank};
use crate::mode::{Event, Mode};
use crate::parameters::JointParameters;
use wheeleg_control::joint::{Correction, JointConfig, JointGains};
use wheeleg_control::pwm::PwmTiming;
use wheeleg_control::valve::ValveMode;
use wheeleg_protocol::param::JointParam;
use wheeleg_protocol::{
    Address, Envelope, Fault, MAX_ENCODED, Message, ParamSet, Sync, SyncFlags, SyncSlots,
};
use wheeleg_units::{AdcCode, Micros, PositionMm};

pub(super) struct Valves(pub(super) [u16; 4]);

impl ValveBank for Valves {
    fn max_duty(&self) -> u16 {
        1000
    }

    fn write(&mut self, duty: [u16; 4]) -> Result<(), PinError> {
        self.0 = duty;
        Ok(())
    }
}

pub(super) struct Sensor;

impl PositionSensor for Sensor {
    fn read(&mut self) -> Result<AdcCode, SensorError> {
        Ok(AdcCode::new(36_000))
    }
}

type Node = JointNode<Valves, Sensor, NoSwitches>;

fn armed() -> Node {
    armed_with(JointParameters::default())
}

fn armed_with(parameters: JointParameters) -> Node {
    let identity = NodeIdentity {
        address: Address::joint(1).unwrap(),
        unique_id: [0; 12],
    };
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
    ticks_to_hold(armed(), 1, damage).is_some()
}

/// The tick after damage, up to `most`, in which the node goes to Hold with its valves shut.
fn ticks_to_hold(mut node: Node, most: u32, damage: impl FnOnce(&mut Node)) -> Option<u32> {
    damage(&mut node);
    (1..=most).find(|tick| {
        node.tick(Micros(20_000 + tick * 1000));
        let held = node.mode() == Mode::Hold && node.faults().contains(Fault::StateCorrupt);
        held && node.snapshot().pulses == [0; 4]
    })
}

#[test]
fn untouched_state_is_sound() {
    assert!(!holds_after(|_| {}));
}

#[test]
fn every_flipped_bit_of_the_reference_is_seen() {
    for bit in 0..32 {
        assert!(holds_after(|node| {
            node.state.reference.position =
                PositionMm::from_raw(node.state.reference.position.raw() ^ (1 << bit));
        }));
    }
}

#[test]
fn damaged_controller_valve_and_target_state_is_seen() {
    // One hidden position sample in the history of the velocity estimate.
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
}

#[test]
fn every_flipped_bit_of_a_precharge_is_seen() {
    let filling = || {
        let one_bar = 1 << 16;
        let parameters = JointParameters::default()
            .with(JointParam::Precharge.id(), one_bar, true)
            .unwrap();
        let mut node = armed_with(parameters);
        Application::armed(&mut node);
        node.tick(Micros(20_000));
        assert!(node.state.precharge.is_under_way());
        node
    };
    assert_eq!(ticks_to_hold(filling(), 5, |_| {}), None);
    for bit in 0..32 {
        let damage = |node: &mut Node| node.state.precharge.flip(bit);
        assert_eq!(ticks_to_hold(filling(), 1, damage), Some(1), "{bit}");
    }
    // So is a precharge that was not requested, and one that is forgotten.
    assert!(holds_after(|node| node.state.precharge.flip(3)));
    let forgotten = |node: &mut Node| node.state.precharge = Precharge::default();
    assert_eq!(ticks_to_hold(filling(), 1, forgotten), Some(1));
}

/// After a later clear the node must not continue with damaged state.
#[test]
fn after_damage_all_that_holds_a_history_of_strokes_begins_anew() {
    let damages: [fn(&mut Node); 2] = [
        |node| {
            node.controller.observe(PositionMm::from_int(50));
        },
        |node| {
            let (open, motion) = ([1000, 0, 0, 0], node.settings.motion);
            for _ in 0..9 {
                let at = PositionMm::from_int(50);
                node.state.motion.rest(&open, at, &motion);
            }
        },
    ];
    for law in [0, 5] {
        for damage in damages {
            let parameters = JointParameters::default();
            let law = parameters.with(JointParam::Law.id(), law, true).unwrap();
            let mut node = armed_with(law);
            let sound = node.motion_account();
            damage(&mut node);
            for tick in 1..40 {
                node.tick(Micros(20_000 + tick * 1000));
                assert_eq!(node.snapshot().velocity.raw(), 0, "{tick}");
                assert_eq!(node.motion_account().pressures, sound.pressures);
            }
            assert_eq!(node.mode(), Mode::Hold);
        }
    }
}

#[test]
fn after_damage_the_correction_is_that_of_the_parameters() {
    let mut node = armed();
    let sound = node.controller.correction();
    node.controller.set_correction(Correction::Id);
    assert_ne!(node.controller.correction(), sound);
    node.tick(Micros(21_000));
    assert_eq!(
        (node.mode(), node.controller.correction()),
        (Mode::Hold, sound)
    );
}

#[test]
fn a_request_does_not_hide_earlier_damage() {
    assert!(holds_after(|node| {
        node.state.reference.position =
            PositionMm::from_raw(node.state.reference.position.raw() ^ 1);
        node.change(|node| node.controller.set_correction(Correction::Id));
    }));
    assert!(!holds_after(|node| {
        node.change(|node| node.controller.set_correction(Correction::Id));
    }));
}

/// Whether a node that hears a SYNC after damage to its link goes to Hold.
fn holds_at_sync(damage: impl FnOnce(&mut Node)) -> bool {
    let mut node = armed();
    let sync = |node: &mut Node, cycle: u16| {
        let message = Message::Sync(Sync {
            cycle,
            master_time_us: 0,
            flags: SyncFlags::NONE,
            slots: SyncSlots::NONE,
        });
        let envelope = Envelope {
            source: Address::MASTER,
            destination: Address::BROADCAST,
            sequence: 0,
        };
        let mut buffer = [0; MAX_ENCODED];
        let bytes = message.emit(envelope, &mut buffer).unwrap();
        node.on_bus_bytes(bytes, Micros(20_000 + u32::from(cycle) * 100));
    };
    for cycle in 1..4 {
        sync(&mut node, cycle);
    }
    assert_eq!(node.mode(), Mode::Armed);
    damage(&mut node);
    sync(&mut node, 4);
    node.faults().contains(Fault::StateCorrupt)
}

#[test]
fn a_damaged_counter_or_address_is_seen_with_the_next_sync() {
    assert!(!holds_at_sync(|_| {}));
    for bit in 0..16 {
        assert!(holds_at_sync(|node| node.core.cycle ^= 1 << bit), "{bit}");
    }
    assert!(holds_at_sync(|node| {
        node.core.identity.address = Address::joint(2).unwrap();
    }));
}

/// A flipped bit of the configuration is found by the next tick.
fn found_at_once(damage: impl Fn(&mut Node)) {
    assert_eq!(ticks_to_hold(armed(), 1, damage), Some(1));
}

#[test]
fn damaged_parameters_settings_and_gains_are_seen_by_the_next_tick() {
    let (first, last) = (
        JointParam::ALL[0].id(),
        JointParam::ALL.last().unwrap().id(),
    );
    for id in [first, JointParam::FollowingTime.id(), last] {
        found_at_once(|node| {
            let raw = node.parameters.by_id(id).unwrap();
            let other = [raw + 1, raw - 1].into_iter();
            let mut other = other.filter_map(|raw| node.parameters.with(id, raw, true).ok());
            node.parameters = other.next().unwrap();
        });
    }
    found_at_once(|node| node.settings.sensor.step_max = PositionMm::ZERO);
    found_at_once(|node| {
        node.settings.staged_exhaust = ValveMode::BlowThrough.openings(Micros(10_000))
    });
    found_at_once(|node| {
        let gains = *node.controller.config().gains();
        node.settings.motion = MotionModel::new(&gains, PositionMm::from_int(77)).unwrap();
    });
    found_at_once(|node| node.core.times.hold = Micros(node.core.times.hold.get() ^ 1));
    found_at_once(|node| {
        let gains = JointGains {
            feed_forward: fixed::FixedI32::from_bits(1),
            ..*node.controller.config().gains()
        };
        let config = JointConfig::new(&gains, Micros(1000)).unwrap();
        node.controller.retune(config);
        // What the change of law leaves behind in the state is irrelevant here.
        node.reseal();
    });
    found_at_once(|node| {
        let tick = Micros(1000);
        let timing = PwmTiming::new(Micros(20_000), tick, tick, tick, tick).unwrap();
        node.pwm.set_timing(timing);
    });
}

#[test]
fn the_predictive_law_is_watched_as_well() {
    let law = JointParam::Law.id();
    let node = || armed_with(JointParameters::default().with(law, 5, true).unwrap());
    assert_eq!(ticks_to_hold(node(), 20, |_| {}), None);
    // Pressures, motion and valves tracked through a tick that never happened.
    let found = ticks_to_hold(node(), 1, |node| {
        node.controller.external_on_times(&[1000, 0, 0, 0]);
        node.controller.observe(PositionMm::from_int(50));
    });
    assert_eq!(found, Some(1));
    let found = ticks_to_hold(node(), 1, |node| {
        let mut gains = *node.controller.config().gains();
        gains.axis.mass = PositionMm::from_raw(gains.axis.mass.raw() + 1);
        node.controller
            .retune(JointConfig::new(&gains, Micros(1000)).unwrap());
        node.reseal();
    });
    assert_eq!(found, Some(1));
}

/// What the motion watch has learnt is valid only for the stroke and axis data of that time.
#[test]
fn another_calibration_or_axis_makes_the_watch_of_motion_start_anew() {
    let set = |param: JointParam, value: i32| {
        let mut node = armed();
        for tick in 0..100 {
            node.change(|node| node.target = Target::at(PositionMm::from_int(150)));
            node.tick(Micros(21_000 + tick * 1000));
        }
        let event = Event::Disarm;
        node.core.supervisor.apply(event, Micros(121_000)).unwrap();
        node.tick(Micros(121_000));
        assert_eq!(node.mode(), Mode::Idle);
        let before = Checksum::of(&node.state.motion);
        let fresh = |node: &Node| {
            Checksum::of(&MotionWatch::new(
                &node.settings.motion,
                node.state.measured,
            ))
        };
        assert_ne!(before, fresh(&node), "it has followed the valves");
        let id = param.id();
        let command = Message::ParamSet(ParamSet { id, value });
        node.request(&command, Micros(121_500)).unwrap();
        let after = Checksum::of(&node.state.motion);
        assert!(after == before || after == fresh(&node));
        after != before
    };
    assert!(set(JointParam::SensorZero, 3300), "the calibration alone");
    assert!(set(JointParam::MotionMargin, 20 << 16), "the axis alone");
    assert!(!set(JointParam::SlewRate, 1000 << 16), "neither");
}
