//! The wheel board on a motor model: safe states, modes, services.

use crate::common::wheel::{WheelRig, select, setpoint};
use crate::common::{ARM, refusal};
use wheeleg_node::mode::Mode;
use wheeleg_protocol::param::WheelParam;
use wheeleg_protocol::{
    ClearFault, Count24, EmergencyBrake, Fault, InputBits, Limit, Message, NackReason, ParamSet,
    Speed7, WheelControlMode, WheelMaxSpeed, WheelReference, WheelVelocity,
};
use wheeleg_units::{Micros, WheelCount};

fn clear(rig: &mut WheelRig) -> Message {
    rig.request(&Message::ClearFault(ClearFault {}))
}

/// Runs without SYNC; gives the times at which Hold began to act and at which
/// the drive was first zero.
fn ramp(rig: &mut WheelRig) -> (u32, u32) {
    let (start, mut begun, mut last) = (rig.now, None, rig.drive());
    while rig.now - start < 1_000_000 {
        rig.tick();
        let drive = rig.drive();
        if rig.node.mode() == Mode::Hold {
            assert!(drive <= last, "no step up in the ramp: {last} to {drive}");
            begun.get_or_insert(rig.now - start);
            if drive == 0 {
                return (begun.unwrap(), rig.now - start);
            }
        }
        last = drive;
    }
    panic!("not stopped within 1 s");
}

#[test]
fn link_loss_ramps_within_60_ms_and_stops_within_500() {
    let mut rig = WheelRig::turning();
    // The last SYNC was up to one cycle before now.
    let (begun, stopped) = ramp(&mut rig);
    assert!((40_000..=50_000).contains(&begun), "{begun}");
    // The reference stood still since the last SYNC, so the control law was
    // braking already: no drive is added again, and the ramp is over at once.
    assert!(stopped - begun <= 300_000, "{begun} {stopped}");
    assert!(stopped + 10_000 <= 500_000);
    assert!(rig.node.faults().contains(Fault::LinkLost));
    for _ in 0..2_000 {
        rig.tick();
        assert_eq!(rig.drive(), 0);
    }
    assert_eq!(rig.node.mode(), Mode::Hold);
}

#[test]
fn a_drive_that_keeps_the_wheel_turning_is_ramped_over_the_ramp_time() {
    let mut rig = WheelRig::new();
    rig.run_ms(40, None);
    select(&mut rig, WheelControlMode::ProportionalVelocity);
    rig.request(&ARM);
    let velocity = Message::WheelVelocity(WheelVelocity {
        velocity_raw: 30 * 16,
        deadline_cycle: rig.cycle,
    });
    assert!(matches!(rig.request(&velocity), Message::Ack(_)));
    rig.run_ms(300, None);
    let steady = rig.drive();
    assert!(steady > 20, "drive {steady}");
    let (begun, stopped) = ramp(&mut rig);
    let took = stopped - begun;
    assert!((250_000..=300_000).contains(&took), "{took}");
    assert!(stopped + 10_000 <= 500_000);
}

#[test]
fn ramp_time_of_the_parameter_limits_keeps_the_deadline() {
    let mut rig = WheelRig::new();
    rig.run_ms(30, None);
    let set = Message::ParamSet(ParamSet {
        id: WheelParam::StopRamp.id(),
        value: WheelParam::StopRamp.info().max,
    });
    assert!(matches!(rig.request(&set), Message::ParamValue(_)));
    // 50 ms watchdog, one SYNC cycle, the longest ramp: below 500 ms.
    assert!(60 + WheelParam::StopRamp.info().max <= 500);
}

#[test]
fn emergency_stop_ramps_at_once_and_dumps_the_supply() {
    let mut rig = WheelRig::turning();
    assert!(!rig.dump.high.get());
    rig.sync(None, true);
    rig.tick();
    assert!(rig.dump.high.get(), "dump valve opens in the next tick");
    assert_eq!(rig.node.mode(), Mode::Hold);
    let reply = rig.sync(None, true);
    assert!(reply.inputs.contains(InputBits::DUMP_OPEN));
    assert_eq!(refusal(&clear(&mut rig)), Some(NackReason::FaultLatched));
    rig.run_ms(500, None);
    assert!(rig.dump.high.get(), "latched without the bit");
    assert_eq!(rig.drive(), 0);
    assert!(matches!(clear(&mut rig), Message::Ack(_)));
    rig.tick();
    assert!(!rig.dump.high.get());
}

/// Found by the fuzzer: the ramp of a stop began again, at the drive of its start.
#[test]
fn a_stop_that_is_cleared_and_braked_anew_does_not_begin_its_ramp_again() {
    let mut rig = WheelRig::turning();
    let brake = Message::EmergencyBrake(EmergencyBrake {});
    rig.request(&brake);
    rig.run_ms(100, None);
    assert_eq!(rig.node.mode(), Mode::Hold);
    assert!(rig.drive() > 0, "half way down the ramp");
    assert!(matches!(clear(&mut rig), Message::Ack(_)));
    assert_eq!(rig.node.mode(), Mode::Idle);
    rig.request(&brake);
    assert_eq!(rig.node.mode(), Mode::Hold);
    rig.tick();
    assert_eq!(rig.drive(), 0, "a disarmed wheel has nothing to ramp down");
}

#[test]
fn emergency_brake_ramps_only_this_wheel_and_keeps_the_supply() {
    let mut rig = WheelRig::turning();
    rig.request(&Message::EmergencyBrake(EmergencyBrake {}));
    rig.run_ms(310, None);
    assert_eq!((rig.node.mode(), rig.drive()), (Mode::Hold, 0));
    assert!(!rig.dump.high.get());
}

#[test]
fn lost_encoder_stops_the_drive_within_100_ms() {
    for speed_at_full in [0, -60] {
        let mut rig = WheelRig::armed();
        rig.speed_at_full = speed_at_full;
        let start = rig.now;
        while rig.node.mode() != Mode::Hold {
            let ahead = rig.counter.0.get() + 2_000;
            rig.run_ms(10, Some(setpoint(ahead, 0)));
            assert!(rig.now - start < 115_000, "encoder {speed_at_full}");
        }
        let faults = rig.node.faults();
        assert!(faults.contains(Fault::EncoderFault), "{faults:?}");
        rig.tick();
        assert_eq!(rig.drive(), 0, "no ramp: the drive may be what runs away");
    }
}

#[test]
fn following_error_stops_after_its_time() {
    let mut rig = WheelRig::armed();
    let start = rig.now;
    // Slower than the reference by far, but turning.
    rig.speed_at_full = 5;
    let mut target = rig.counter.0.get();
    while rig.node.mode() != Mode::Hold {
        target += 60 * 19;
        rig.run_ms(10, Some(setpoint(target, 60 * 16)));
        assert!(rig.now - start < 1_000_000);
    }
    assert!(rig.node.faults().contains(Fault::FollowingError));
    // 20 000 counts at 55 counts per 520 µs take 190 ms; 50 ms more.
    let took = rig.now - start;
    assert!((200_000..=300_000).contains(&took), "{took}");
}

#[test]
fn overrun_is_latched_with_the_drive_off() {
    let mut rig = WheelRig::turning();
    rig.node.tick(Micros(rig.now));
    rig.node.tick_done(Micros(rig.now + 521));
    assert_eq!(rig.node.mode(), Mode::Fault);
    rig.now += 520;
    rig.tick();
    assert_eq!(rig.drive(), 0);
    assert!(rig.node.faults().contains(Fault::TickOverrun));
}

#[test]
fn disarmed_wheel_does_not_turn() {
    let mut rig = WheelRig::new();
    rig.run_ms(200, Some(setpoint(100_000, 500)));
    assert_eq!((rig.node.mode(), rig.drive()), (Mode::Idle, 0));
}

#[test]
fn arming_far_from_the_reference_moves_at_the_maximum_speed() {
    let mut rig = WheelRig::armed();
    let start = rig.counter.0.get();
    let mut last = rig.node.snapshot().control.command;
    for sample in 0..200 {
        if sample % 19 == 0 {
            rig.sync(Some(setpoint(start + 1_000_000, 0)), false);
        }
        rig.tick();
        let snapshot = rig.node.snapshot();
        let step = snapshot.control.command.wrapping_difference(last);
        // max_speed: 60 counts per sample by default.
        assert!((0..=60).contains(&step), "step {step}");
        assert!(snapshot.limits.contains(Limit::RateLimited));
        last = snapshot.control.command;
    }
}

#[test]
fn position_is_reached_across_the_wrap_of_the_count() {
    let mut rig = WheelRig::new();
    rig.counter.0.set(8_388_000);
    rig.run_ms(40, None);
    rig.request(&ARM);
    rig.run_ms(400, Some(setpoint(8_388_000 + 2_000, 0)));
    let count = WheelCount::wrapping_new(rig.counter.0.get());
    let error = WheelCount::wrapping_new(8_390_000).wrapping_difference(count);
    assert!(error.abs() <= 8, "error {error}");
    assert!(count.get() < 0, "wrapped");
    assert!(rig.node.faults().is_empty());
}

#[test]
fn trapezoidal_reference_runs_a_profile_and_arrives() {
    let mut rig = WheelRig::new();
    rig.run_ms(40, None);
    assert!(matches!(
        select(&mut rig, WheelControlMode::Trapezoidal),
        Message::Ack(_)
    ));
    rig.request(&ARM);
    let speed = Message::WheelMaxSpeed(WheelMaxSpeed {
        speed: Speed7::new(20).unwrap(),
    });
    assert!(matches!(rig.request(&speed), Message::Ack(_)));
    let goal = rig.counter.0.get() + 6_000;
    let reference = Message::WheelReference(WheelReference {
        position: Count24::new(WheelCount::wrapping_new(goal)),
        deadline_cycle: rig.cycle.wrapping_add(3),
    });
    assert!(matches!(rig.request(&reference), Message::Ack(_)));
    let mut fastest = 0;
    let mut last = rig.node.snapshot().control.command;
    for _ in 0..110 {
        rig.run_ms(10, None);
        let command = rig.node.snapshot().control.command;
        fastest = fastest.max(command.wrapping_difference(last));
        last = command;
    }
    // 20 counts per sample for 19 or 20 samples.
    assert!((370..=400).contains(&fastest), "{fastest}");
    assert!((rig.counter.0.get() - goal).abs() <= 8);
    assert!(rig.node.faults().is_empty());
}

#[test]
fn velocity_modes_turn_at_the_commanded_velocity() {
    for mode in [
        WheelControlMode::ProportionalVelocity,
        WheelControlMode::IntegralVelocity,
    ] {
        let mut rig = WheelRig::new();
        rig.run_ms(40, None);
        select(&mut rig, mode);
        rig.request(&ARM);
        let velocity = |velocity_raw, deadline_cycle| {
            Message::WheelVelocity(WheelVelocity {
                velocity_raw,
                deadline_cycle,
            })
        };
        let cycle = rig.cycle;
        let stale = rig.request(&velocity(20 * 16, cycle.wrapping_sub(1)));
        assert_eq!(refusal(&stale), Some(NackReason::Expired));
        assert!(matches!(
            rig.request(&velocity(20 * 16, cycle)),
            Message::Ack(_)
        ));
        rig.run_ms(600, None);
        let from = rig.counter.0.get();
        rig.run_ms(520, None);
        let turned = rig.counter.0.get() - from;
        // 1000 samples; the gain-only law of proportional velocity has a droop.
        let expected = if mode == WheelControlMode::IntegralVelocity {
            19_800..=20_200
        } else {
            12_000..=20_000
        };
        assert!(expected.contains(&turned), "{mode:?}: {turned}");
    }
}

#[test]
fn integral_velocity_takes_whole_counts_only() {
    let mut rig = WheelRig::new();
    rig.run_ms(40, None);
    select(&mut rig, WheelControlMode::IntegralVelocity);
    rig.request(&ARM);
    for (velocity_raw, ok) in [
        (16, true),
        (-128 * 16, true),
        (17, false),
        (128 * 16, false),
    ] {
        let command = Message::WheelVelocity(WheelVelocity {
            velocity_raw,
            deadline_cycle: rig.cycle,
        });
        assert_eq!(
            refusal(&rig.request(&command)).is_none(),
            ok,
            "{velocity_raw}"
        );
    }
}

#[test]
fn an_armed_wheel_that_gets_another_mode_stops_and_keeps_its_place() {
    let mut rig = WheelRig::new();
    rig.run_ms(40, None);
    select(&mut rig, WheelControlMode::IntegralVelocity);
    rig.request(&ARM);
    let turn = Message::WheelVelocity(WheelVelocity {
        velocity_raw: 20 * 16,
        deadline_cycle: rig.cycle,
    });
    assert!(matches!(rig.request(&turn), Message::Ack(_)));
    rig.run_ms(600, None);
    assert!(rig.drive() > 10);
    let at = rig.counter.0.get();
    assert!(matches!(
        select(&mut rig, WheelControlMode::Position),
        Message::Ack(_)
    ));
    rig.run_ms(600, None);
    let off = (rig.counter.0.get() - at).abs();
    assert!(off <= 20, "{off}");
    assert_eq!(rig.node.mode(), Mode::Armed);
}

#[test]
fn rearming_starts_at_the_actual_count() {
    let mut rig = WheelRig::turning();
    rig.run_ms(1, None);
    for _ in 0..1000 {
        rig.tick();
    }
    assert_eq!(rig.node.mode(), Mode::Hold);
    // Pushed by hand while stopped.
    rig.counter.0.set(rig.counter.0.get() + 5_000);
    rig.run_ms(40, None);
    clear(&mut rig);
    rig.request(&ARM);
    rig.run_ms(50, None);
    assert_eq!(rig.drive(), 0);
    assert_eq!(rig.node.snapshot().control.error, 0);
}
