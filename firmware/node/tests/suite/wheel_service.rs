//! What a wheel board answers: parameters, positions, switches, refusals.

use crate::common::wheel::{WheelRig, select, setpoint};
use crate::common::{ARM, refusal};
use wheeleg_node::mode::Mode;
use wheeleg_protocol::param::WheelParam;
use wheeleg_protocol::{
    Acceleration8p8, Count24, FaultReport, InputBits, Limit, Message, NackReason, OpenAllValves,
    OpenMode, ParamGet, TransmitPosition, WheelAcceleration, WheelControlMode, WheelFilter,
    WheelReference, WheelSampleTimer,
};
use wheeleg_units::WheelCount;

#[test]
fn filter_timer_and_profile_commands_are_parameters() {
    let mut rig = WheelRig::new();
    rig.run_ms(40, None);
    let commands = [
        Message::WheelFilter(WheelFilter {
            zero: 200,
            pole: 30,
            gain: 20,
        }),
        Message::WheelAcceleration(WheelAcceleration {
            acceleration: Acceleration8p8::new(300).unwrap(),
        }),
        Message::WheelSampleTimer(WheelSampleTimer { timer: 124 }),
    ];
    for command in commands {
        assert!(
            matches!(rig.request(&command), Message::Ack(_)),
            "{command:?}"
        );
    }
    for (parameter, expected) in [
        (WheelParam::FilterZero, 200),
        (WheelParam::FilterPole, 30),
        (WheelParam::FilterGain, 20),
        (WheelParam::Acceleration, 300),
        (WheelParam::SampleTimer, 124),
    ] {
        let get = Message::ParamGet(ParamGet { id: parameter.id() });
        let Message::ParamValue(value) = rig.request(&get) else {
            panic!()
        };
        assert_eq!(value.value, expected);
    }
    // 16 (124 + 1) clocks of 2 MHz.
    assert_eq!(rig.node.tick_period_us(), 1000);
    rig.run_ms(40, None);
    assert!(rig.node.faults().is_empty(), "a new period is no overrun");
    let shorter = Message::WheelSampleTimer(WheelSampleTimer { timer: 64 });
    assert!(matches!(rig.request(&shorter), Message::Ack(_)));
    rig.run_ms(40, None);
    assert!(rig.node.faults().is_empty(), "nor is a shorter one");
    rig.request(&ARM);
    let timer = Message::WheelSampleTimer(WheelSampleTimer { timer: 64 });
    assert_eq!(refusal(&rig.request(&timer)), Some(NackReason::Armed));
}

#[test]
fn sample_timer_below_the_minimum_of_the_mode_is_refused() {
    let mut rig = WheelRig::new();
    rig.run_ms(40, None);
    let timer = Message::WheelSampleTimer(WheelSampleTimer { timer: 10 });
    assert!(
        matches!(rig.request(&timer), Message::Ack(_)),
        "position mode: 7"
    );
    let refused = select(&mut rig, WheelControlMode::Trapezoidal);
    assert_eq!(
        refusal(&refused),
        Some(NackReason::OutOfRange),
        "profile: 15"
    );
    assert_eq!(rig.node.control_mode(), WheelControlMode::Position);
}

#[test]
fn joint_commands_are_for_the_other_board() {
    let mut rig = WheelRig::armed();
    let open = Message::OpenAllValves(OpenAllValves {
        mode: OpenMode::Exhaust,
    });
    assert_eq!(refusal(&rig.request(&open)), Some(NackReason::WrongBoard));
    assert_eq!(rig.node.mode(), Mode::Armed);
}

#[test]
fn supply_switch_is_debounced_and_reported() {
    let mut rig = WheelRig::new();
    rig.run_ms(20, None);
    assert!(
        !rig.sync(None, false)
            .inputs
            .contains(InputBits::SUPPLY_PRESSURE)
    );
    rig.supply.high.set(true);
    rig.tick();
    rig.tick();
    assert!(!rig.node.snapshot().supply_present);
    rig.tick();
    assert!(rig.node.snapshot().supply_present);
    assert!(
        rig.sync(None, false)
            .inputs
            .contains(InputBits::SUPPLY_PRESSURE)
    );
}

#[test]
fn a_wheel_that_tracks_takes_no_motion_beside_its_slots() {
    let mut rig = WheelRig::turning();
    let elsewhere = Message::WheelReference(WheelReference {
        position: Count24::new(WheelCount::ZERO),
        deadline_cycle: rig.cycle,
    });
    assert_eq!(
        refusal(&rig.request(&elsewhere)),
        Some(NackReason::WrongMode)
    );
}

#[test]
fn position_and_velocity_are_told_as_they_were_sampled() {
    let mut rig = WheelRig::turning();
    let counts = rig.node.snapshot().control.velocity;
    assert!((20..60).contains(&counts), "{counts}");
    let (cycle, at) = (rig.cycle, rig.node.snapshot().count.get());
    let position = |rig: &mut WheelRig| {
        let answer = rig.request(&Message::TransmitPosition(TransmitPosition {}));
        let Message::Position(position) = answer else {
            panic!("{answer:?}");
        };
        position
    };
    let told = position(&mut rig);
    assert_eq!((told.position_raw, told.cycle), (at, cycle));
    assert_eq!(i32::from(told.velocity_raw), 16 * counts);
    assert_eq!(i32::from(rig.sync(None, false).velocity_raw), 16 * counts);
    // Faster than the word holds, both ways.
    for (jump, most) in [(5_000, i16::MAX), (-5_000, i16::MIN)] {
        rig.counter.0.set(rig.counter.0.get().wrapping_add(jump));
        rig.tick();
        assert_eq!(position(&mut rig).velocity_raw, most);
    }
}

#[test]
fn a_fault_record_tells_the_limits_in_force() {
    let mut rig = WheelRig::armed();
    rig.run_ms(30, Some(setpoint(100_000, 0)));
    let limits = rig.node.snapshot().limits;
    assert!(limits.contains(Limit::DutySaturated), "{limits:?}");
    let Message::FaultRecord(told) = rig.request(&Message::FaultReport(FaultReport {})) else {
        panic!();
    };
    assert_eq!(told.limits, limits);
}
