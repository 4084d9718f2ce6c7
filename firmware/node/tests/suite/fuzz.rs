//! Never-panic and the safety property: no sequence of bytes, frames, ticks and
//! sensor readings energises a valve or a motor of a disarmed board, and after
//! the last valid cycle the safe state comes within its deadline.

use crate::common::joint::{JointRig, setpoint};
use crate::common::wheel::WheelRig;
use crate::common::{ARM, frame};
use proptest::prelude::*;
use wheeleg_node::hardware::SensorError;
use wheeleg_node::mode::{Mode, ModeRules};
use wheeleg_protocol::param::{JointParam, WheelParam};
use wheeleg_protocol::{
    Address, Header, JointSetpoint, LinkLossAction, Message, MessageType, NextReference, Sync,
    SyncFlags, SyncSlots, VERSION, WheelSetpoint, encode,
};
use wheeleg_units::{AdcCode, Micros, PositionMm, WheelCount, WirePosition, WireVelocity};

#[derive(Clone, Debug)]
enum Action {
    /// Bytes as they come.
    Noise(Vec<u8>),
    /// A sound frame of any type with any payload of the right size.
    Frame {
        message_type: usize,
        payload: Vec<u8>,
        sequence: u16,
    },
    /// SYNC: counter step, flags, and the slot's raw content.
    Sync {
        step: u16,
        emergency: bool,
        reference: i32,
        velocity: i16,
        cycles: u8,
        track: bool,
        exhaust: bool,
    },
    /// A request that arms, with the right hash.
    Arm,
    Tick(u8),
    Sensor(u16),
    SensorOpen,
    /// Time jumps: an overrun.
    Late(u16),
}

fn action() -> impl Strategy<Value = Action> {
    prop_oneof![
        1 => proptest::collection::vec(any::<u8>(), 0..220).prop_map(Action::Noise),
        3 => (0..MessageType::ALL.len(), proptest::collection::vec(any::<u8>(), 120), any::<u16>())
            .prop_map(|(message_type, payload, sequence)| Action::Frame { message_type, payload, sequence }),
        8 => (prop_oneof![9 => Just(1_u16), 1 => any::<u16>()], prop::bool::weighted(0.02),
              any::<i32>(), any::<i16>(), any::<u8>(), any::<bool>(), any::<bool>())
            .prop_map(|(step, emergency, reference, velocity, cycles, track, exhaust)| Action::Sync {
                step, emergency, reference, velocity, cycles, track, exhaust }),
        2 => Just(Action::Arm),
        8 => (1..15_u8).prop_map(Action::Tick),
        2 => (3_000..60_000_u16).prop_map(Action::Sensor),
        1 => Just(Action::SensorOpen),
        1 => any::<u16>().prop_map(Action::Late),
    ]
}

fn any_frame(destination: Address, message_type: usize, payload: &[u8], sequence: u16) -> Vec<u8> {
    let message_type = MessageType::ALL[message_type];
    let header = Header {
        version: VERSION,
        message_type: message_type.code(),
        source: Address::MASTER,
        destination,
        sequence,
    };
    let payload = &payload[..message_type.payload_len().min(payload.len())];
    encode(&header, payload, &mut [0; 200]).unwrap().to_vec()
}

fn sync_frame(cycle: u16, action: &Action) -> Vec<u8> {
    let Action::Sync {
        emergency,
        reference,
        velocity,
        cycles,
        track,
        exhaust,
        ..
    } = action
    else {
        unreachable!()
    };
    let mut slots = SyncSlots::NONE;
    let joint = JointSetpoint {
        reference: PositionMm::from_raw(*reference),
        velocity: WireVelocity::from_bits(*velocity),
        next: core::num::NonZeroU8::new(*cycles).map(|cycles| NextReference {
            reference: WirePosition::from_bits(*velocity),
            cycles,
        }),
        on_link_loss: if *exhaust {
            LinkLossAction::HoldThenExhaust
        } else {
            LinkLossAction::Hold
        },
        track: *track,
    };
    slots.set_joint(Address::joint(3).unwrap(), joint);
    let wheel = WheelSetpoint {
        reference: WheelCount::wrapping_new(*reference),
        velocity_raw: *velocity,
        track: *track,
    };
    slots.set_wheel(Address::wheel(7).unwrap(), wheel);
    let flags = if *emergency {
        SyncFlags::ESTOP
    } else {
        SyncFlags::NONE
    };
    let message = Message::Sync(Sync {
        cycle,
        master_time_us: 0,
        flags,
        slots,
    });
    frame(Address::BROADCAST, 0, &message)
}

/// What the outputs may do in a mode.
fn check_joint(rig: &JointRig) -> Result<(), TestCaseError> {
    let mode = rig.node.mode();
    let [fill_a, vent_a, fill_b, vent_b] = rig.duty();
    if !mode.may_drive() && mode != Mode::Exhaust {
        prop_assert_eq!([fill_a, vent_a, fill_b, vent_b], [0; 4], "{:?}", mode);
    }
    if mode.may_drive() {
        prop_assert!(
            rig.node.faults().is_empty(),
            "{:?} drives with a fault",
            mode
        );
        prop_assert!(fill_a == 0 || vent_a == 0, "chamber A is filled and vented");
        prop_assert!(fill_b == 0 || vent_b == 0, "chamber B is filled and vented");
    }
    if mode == Mode::Exhaust && !rig.node.faults().is_empty() {
        prop_assert_eq!((fill_a, fill_b), (0, 0), "inlets are shut after a fault");
    }
    Ok(())
}

fn play_joint(rig: &mut JointRig, action: &Action) -> Result<(), TestCaseError> {
    match action {
        Action::Noise(bytes) => rig.node.on_bus_bytes(bytes, Micros(rig.now)),
        Action::Frame {
            message_type,
            payload,
            sequence,
        } => {
            let bytes = any_frame(rig.address, *message_type, payload, *sequence);
            rig.node.on_bus_bytes(&bytes, Micros(rig.now));
        }
        Action::Sync { step, .. } => {
            rig.cycle = rig.cycle.wrapping_add(*step);
            let bytes = sync_frame(rig.cycle, action);
            rig.node.on_bus_bytes(&bytes, Micros(rig.now));
        }
        Action::Arm => {
            rig.sequence = rig.sequence.wrapping_add(1);
            let bytes = frame(rig.address, rig.sequence, &ARM);
            rig.node.on_bus_bytes(&bytes, Micros(rig.now));
        }
        Action::Tick(ticks) => {
            for _ in 0..*ticks {
                rig.tick();
                check_joint(rig)?;
            }
        }
        Action::Sensor(code) => rig.sensor.set(Ok(AdcCode::new(*code))),
        Action::SensorOpen => rig.sensor.set(Err(SensorError::Converter)),
        Action::Late(micros) => rig.now = rig.now.wrapping_add(u32::from(*micros)),
    }
    while rig.node.take_transmission().is_some() {}
    Ok(())
}

fn play_wheel(rig: &mut WheelRig, action: &Action) -> Result<(), TestCaseError> {
    match action {
        Action::Noise(bytes) => rig.node.on_bus_bytes(bytes, Micros(rig.now)),
        Action::Frame {
            message_type,
            payload,
            sequence,
        } => {
            let bytes = any_frame(rig.address, *message_type, payload, *sequence);
            rig.node.on_bus_bytes(&bytes, Micros(rig.now));
        }
        Action::Sync { step, .. } => {
            rig.cycle = rig.cycle.wrapping_add(*step);
            let bytes = sync_frame(rig.cycle, action);
            rig.node.on_bus_bytes(&bytes, Micros(rig.now));
        }
        Action::Arm => {
            rig.sequence = rig.sequence.wrapping_add(1);
            let bytes = frame(rig.address, rig.sequence, &ARM);
            rig.node.on_bus_bytes(&bytes, Micros(rig.now));
        }
        Action::Tick(ticks) => {
            for _ in 0..*ticks {
                let before = rig.drive();
                rig.tick();
                let mode = rig.node.mode();
                prop_assert!(mode != Mode::Exhaust);
                if !mode.may_drive() && mode != Mode::Hold {
                    prop_assert_eq!(rig.drive(), 0, "{:?}", mode);
                }
                if mode == Mode::Hold {
                    prop_assert!(rig.drive().abs() <= before.abs(), "a stop ramps down only");
                }
            }
        }
        Action::Sensor(code) => rig.counter.0.set(i32::from(*code) << 9),
        Action::SensorOpen => rig.speed_at_full = -rig.speed_at_full,
        Action::Late(micros) => rig.now = rig.now.wrapping_add(u32::from(*micros)),
    }
    while rig.node.take_transmission().is_some() {}
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn joint_never_panics_and_never_drives_disarmed(
        armed in any::<bool>(),
        actions in proptest::collection::vec(action(), 1..120),
    ) {
        let mut rig = if armed { JointRig::armed() } else { JointRig::new() };
        for action in &actions {
            play_joint(&mut rig, action)?;
        }
        // Silence from here on: the deadline after the last valid cycle.
        for tick in 0..120 {
            rig.tick();
            check_joint(&rig)?;
            // Tick n starts n ms after the newest SYNC; the watchdog may have
            // been lengthened by a request.
            let cycles = rig.node.parameters().get(JointParam::WatchdogCycles);
            prop_assert!(tick <= 10 * cycles || !rig.node.mode().may_drive());
        }
    }

    #[test]
    fn wheel_never_panics_and_never_drives_disarmed(
        armed in any::<bool>(),
        actions in proptest::collection::vec(action(), 1..120),
    ) {
        let mut rig = if armed { WheelRig::armed() } else { WheelRig::new() };
        for action in &actions {
            play_wheel(&mut rig, action)?;
        }
        let watchdog = rig.node.parameters().get(WheelParam::WatchdogCycles);
        let end = rig.now.wrapping_add(500_000);
        while end.wrapping_sub(rig.now) < 0x8000_0000 {
            rig.tick();
        }
        prop_assert!(!rig.node.mode().may_drive());
        prop_assert!(watchdog > 5 || rig.drive() == 0);
    }

    #[test]
    fn no_valve_moves_without_an_arm_or_a_valve_command(
        actions in proptest::collection::vec(action(), 1..120),
    ) {
        let mut rig = JointRig::new();
        for action in &actions {
            let opens = match action {
                Action::Arm => true,
                Action::Frame { message_type, .. } => matches!(
                    MessageType::ALL[*message_type],
                    MessageType::OpenAllValves | MessageType::Arm
                ),
                _ => false,
            };
            if !opens {
                play_joint(&mut rig, action)?;
                prop_assert!(!rig.any_open());
            }
        }
    }

    #[test]
    fn chunking_changes_nothing(
        references in proptest::collection::vec(0..180_i16, 1..20),
        sizes in proptest::collection::vec(1..60_usize, 1..20),
    ) {
        let mut whole = JointRig::armed();
        let mut split = JointRig::armed();
        for (index, reference) in references.iter().enumerate() {
            let slot = setpoint(f64::from(*reference), LinkLossAction::Hold);
            whole.cycle += 1;
            let mut slots = SyncSlots::NONE;
            slots.set_joint(whole.address, slot);
            let message = Message::Sync(Sync {
                cycle: whole.cycle, master_time_us: 0, flags: SyncFlags::NONE, slots,
            });
            let bytes = frame(Address::BROADCAST, 0, &message);
            whole.node.on_bus_bytes(&bytes, Micros(whole.now));
            let size = sizes[index % sizes.len()];
            let mut left = bytes.len();
            for chunk in bytes.chunks(size) {
                left -= chunk.len();
                split.node.on_bus_bytes(chunk, Micros(split.now - 10 * left as u32));
            }
            prop_assert_eq!(whole.node.take_transmission(), split.node.take_transmission());
            for _ in 0..10 {
                whole.tick();
                split.tick();
                prop_assert_eq!(whole.node.snapshot(), split.node.snapshot());
            }
        }
    }
}
