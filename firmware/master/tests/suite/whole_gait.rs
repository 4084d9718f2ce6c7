//! The three-step test through dispatcher, layer 1, FIFOs, layer 0 and bus, with fake nodes.

use crate::common::TestRig;
use wheeleg_master::MasterConfig;
use wheeleg_master::command::Command;
use wheeleg_master::config::WheelDrive;
use wheeleg_master::contact::Side;
use wheeleg_master::dispatcher::Refusal;
use wheeleg_master::event::Event;
use wheeleg_master::layer1::foot::FootShape;
use wheeleg_master::layer1::params::GaitParams;
use wheeleg_master::setpoint::Phase;
use wheeleg_protocol::{Address, LinkLossAction, NodeMode};
use wheeleg_units::PositionMm;

fn rig() -> TestRig {
    // The trapezoid comes from the master, because the fake wheels make none.
    let mut rig = TestRig::new(MasterConfig {
        wheel_drive: WheelDrive::Stream,
        ..MasterConfig::default()
    });
    rig.stand();
    rig
}

#[test]
fn three_steps_cover_three_strokes() {
    let mut rig = rig();
    assert!(rig.saw(|event| *event == Event::Homed));
    for (node, mm) in [
        (1, 90.0),
        (2, 0.0),
        (3, 180.0),
        (4, 90.0),
        (5, 90.0),
        (6, 180.0),
    ] {
        assert_eq!(rig.node(node).stroke_mm(), mm, "start pose of joint {node}");
    }
    let ticket = rig.submit(Command::StartGait);
    let mut phases = Vec::new();
    let mut start_counts = rig.node(7).position;
    for n in 0..=1000 {
        let counts = rig.node(7).position;
        let sync = rig.cycle();
        let phase = rig.master.layer0().phase();
        if phases.last() != Some(&phase) {
            phases.push(phase);
            if phase == Phase::Push {
                start_counts = counts;
            }
        }
        // The gait clock starts with the cycle that takes the command.
        let b6 = sync.slots.joint(Address::joint(3).unwrap()).unwrap();
        if n < 10 {
            assert_eq!(b6.reference.to_f64(), 180.0);
            assert_eq!(b6.next.unwrap().cycles.get(), 10 - n as u8);
            assert_eq!(b6.next.unwrap().reference.to_num::<f64>(), 0.0);
        }
        if n == 10 {
            assert_eq!(b6.reference.to_f64(), 0.0);
            assert_eq!(b6.on_link_loss, LinkLossAction::HoldThenExhaust);
        }
        if phase == Phase::Push {
            // Leg–wheel co-operation: b5 follows the wheel travel measured in the last cycle.
            let b5 = sync.slots.joint(Address::joint(2).unwrap()).unwrap();
            let pushed = (counts - start_counts) as f64 * 942.478 / 104_000.0;
            let found = b5.reference.to_f64();
            assert!(
                (found - (180.0 - pushed)).abs() < 0.01,
                "cycle {n}: {found} {pushed}"
            );
        }
    }
    let step = [
        Phase::Unload,
        Phase::Lift,
        Phase::Reach,
        Phase::Lower,
        Phase::Push,
        Phase::Rest,
    ];
    assert_eq!(phases, [&step[..], &step, &step, &[Phase::Done]].concat());
    assert!(rig.done(ticket));
    assert!(rig.saw(|event| *event == Event::GaitDone { steps: 3 }));
    let travelled = rig.master.layer0().odometry().travel_um();
    assert!((travelled - 540_000).abs() < 50, "{travelled} µm");
    assert!(rig.node(2).stroke_mm().abs() < 0.1);
    assert_eq!(rig.node(3).stroke_mm(), 180.0);

    // Standing up again moves no wheel.
    let counts = rig.node(7).position;
    let ticket = rig.submit(Command::Stand);
    rig.run(100);
    assert!(rig.done(ticket));
    assert_eq!(rig.node(7).position, counts);
}

#[test]
fn profile_drive_sends_the_end_of_the_push() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.stand();
    rig.submit(Command::StartGait);
    let wheel = Address::wheel(8).unwrap();
    rig.run(200);
    let before = rig.last_sync.unwrap().slots.wheel(wheel).unwrap().reference;
    let push = rig.cycle().slots.wheel(wheel).unwrap();
    // 180 mm = 19 862.7 counts, immediately: the board makes the trapezoid.
    let distance = push.reference.wrapping_difference(before);
    assert!((distance - 19_863).abs() <= 1, "{distance}");
    assert_eq!(push.velocity_raw, 0);
}

#[test]
fn streamed_wheels_are_told_the_velocity_of_the_push() {
    let mut rig = rig();
    rig.submit(Command::StartGait);
    let wheel = Address::wheel(8).unwrap();
    let mut fastest = 0;
    for cycle in 0..1000 {
        let slot = rig.cycle().slots.wheel(wheel).unwrap();
        if rig.master.layer0().phase() != Phase::Push {
            assert_eq!(slot.velocity_raw, 0, "cycle {cycle}");
        }
        fastest = fastest.max(slot.velocity_raw);
    }
    // 180 mm/s are 10.33 counts per sample.
    assert_eq!(fastest, 165);
}

#[test]
fn commands_out_of_place_are_refused_with_the_reason() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(60);
    let refused = |rig: &mut TestRig, command| {
        let ticket = rig.submit(command);
        rig.run(1);
        rig.refusal(ticket)
    };
    assert_eq!(refused(&mut rig, Command::Stand), Some(Refusal::NotArmed));
    rig.arm();
    assert_eq!(refused(&mut rig, Command::Arm), Some(Refusal::NotDisarmed));
    assert_eq!(
        refused(&mut rig, Command::StartGait),
        Some(Refusal::NotAtStart)
    );
    assert_eq!(
        refused(&mut rig, Command::StopGait),
        Some(Refusal::NotMoving)
    );
    let bad = GaitParams {
        steps: 0,
        ..GaitParams::default()
    };
    assert!(matches!(
        refused(&mut rig, Command::SetGait(bad)),
        Some(Refusal::Parameter(_))
    ));
    // Another start pose must be taken up first.
    let ticket = rig.submit(Command::Stand);
    rig.run(400);
    assert!(rig.done(ticket));
    let other = GaitParams {
        held_leg_s5_mm: PositionMm::from_int(40),
        ..GaitParams::default()
    };
    assert_eq!(refused(&mut rig, Command::SetGait(other)), None);
    assert_eq!(
        refused(&mut rig, Command::StartGait),
        Some(Refusal::NotAtStart)
    );
    let ticket = rig.submit(Command::Stand);
    rig.run(400);
    assert!(rig.done(ticket));
    assert_eq!(refused(&mut rig, Command::StartGait), None);
    assert_eq!(
        refused(&mut rig, Command::SetGait(other)),
        Some(Refusal::Moving)
    );
    assert_eq!(refused(&mut rig, Command::Stand), Some(Refusal::Moving));
}

#[test]
fn hold_freezes_at_the_measured_strokes_without_a_latch() {
    let mut rig = rig();
    let gait = rig.submit(Command::StartGait);
    rig.run(60);
    let hold = rig.submit(Command::Hold);
    let before: Vec<_> = rig.nodes[..6].iter().map(|node| node.position).collect();
    rig.run(30);
    assert!(rig.done(hold));
    assert_eq!(rig.refusal(gait), Some(Refusal::Interrupted));
    for (node, before) in rig.nodes[..6].iter().zip(before) {
        assert_eq!(node.position, before);
        assert_eq!(node.mode, NodeMode::Tracking);
    }
    assert!(rig.master.is_armed());
    let stand = rig.submit(Command::Stand);
    rig.run(400);
    assert!(rig.done(stand), "motion goes on without a clear");
}

#[test]
fn stop_gait_ends_after_the_step() {
    let mut rig = rig();
    let gait = rig.submit(Command::StartGait);
    rig.run(100);
    rig.submit(Command::StopGait);
    rig.run(240);
    assert!(rig.done(gait));
    assert!(rig.saw(|event| *event == Event::GaitDone { steps: 1 }));
}

#[test]
fn the_sinusoid_runs_on_one_leg() {
    let mut rig = rig();
    let shape = FootShape::default();
    let side = Side::Left;
    let ticket = rig.submit(Command::FootTrajectory { side, shape });
    rig.run(1257);
    // Half of 8π s: the foot is at its highest point, half way.
    let highest = rig.node(3).stroke_mm();
    assert!(highest.abs() < 0.05, "{highest}");
    assert!((rig.node(2).stroke_mm() - 90.0).abs() < 0.1);
    rig.run(1258);
    assert!(rig.done(ticket));
    assert!((rig.node(2).stroke_mm() - 180.0).abs() < 0.01);
    assert!((rig.node(3).stroke_mm() - 180.0).abs() < 0.01);
    assert_eq!(rig.node(6).stroke_mm(), 180.0);
}

#[test]
fn disarm_in_mid_step_withdraws_every_reference() {
    let mut rig = rig();
    rig.submit(Command::StartGait);
    rig.run(60);
    let ticket = rig.submit(Command::Disarm);
    let sync = rig.cycle();
    assert_eq!(sync.slots, wheeleg_protocol::SyncSlots::NONE);
    rig.run(10);
    assert!(rig.done(ticket));
    assert!(rig.nodes.iter().all(|node| node.mode == NodeMode::Idle));
}

#[test]
fn a_motion_of_layer_one_ends_the_users_references() {
    let mut rig = rig();
    let stroke_mm = PositionMm::from_int(50);
    rig.submit(Command::JointReference {
        joint: 5,
        stroke_mm,
    });
    rig.run(60);
    assert_eq!(rig.node(5).stroke_mm(), 50.0);
    let ticket = rig.submit(Command::Stand);
    rig.run(400);
    assert!(rig.done(ticket));
    assert_eq!(rig.node(5).stroke_mm(), 90.0, "back in the start pose");
}

#[test]
fn a_wheel_that_stays_behind_does_not_shift_the_next_move() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    let start = rig.node(7).position;
    let travel_mm = PositionMm::from_int(100);
    rig.submit(Command::WheelReference { travel_mm });
    rig.run(30);
    // Pushed back by 1000 counts, and held there.
    rig.node(7).position -= 1_000;
    rig.node(7).rate = 0;
    rig.run(2);
    rig.submit(Command::WheelReference { travel_mm });
    let sync = rig.cycle();
    let slot = sync.slots.wheel(Address::wheel(7).unwrap()).unwrap();
    // Two moves of 55 174 counts from the start, not from where it was pushed to.
    let origin = wheeleg_units::WheelCount::wrapping_new(start as i32);
    assert_eq!(slot.reference.wrapping_difference(origin), 2 * 11_035);
}
