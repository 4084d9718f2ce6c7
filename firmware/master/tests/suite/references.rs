//! Changes that behaviours make to references come and go at their stated rate, whatever the robot does meanwhile.

use crate::behaviours::{Robot, geometry, mm};
use crate::common::leg;
use wheeleg_master::behaviour::{Act, Behaviour, Behaviours};
use wheeleg_master::contact::Side;
use wheeleg_master::layer0::behaviours::{Behaving, WheelSense};
use wheeleg_master::layer1::walk::WalkGeometry;
use wheeleg_master::mirror;
use wheeleg_master::setpoint::{Landing, LegPlan, Phase, WalkPlan};
use wheeleg_units::{Duty, VelocityMmS};

const STAND: [LegPlan; 2] = [LegPlan::Stance; 2];
/// Left and right b5 and b6.
const B5: [usize; 2] = [1, 4];
const B6: [usize; 2] = [2, 5];

fn plans(robot: &mut Robot, legs: [LegPlan; 2]) {
    robot.setpoints.walk = Some(WalkPlan { legs, driven: true });
}

/// References of these joints for 100 mm each, even for a robot that no longer walks.
fn references(robot: &Robot, joints: [usize; 2]) -> [f64; 2] {
    let plan = robot.setpoints.walk;
    joints.map(|joint| {
        let asked = wheeleg_master::setpoint::JointSetpoint {
            reference_mm: mm(100.0),
            ..Default::default()
        };
        let out = robot.behaving.apply(joint, asked, plan.as_ref());
        out.reference_mm.to_f64()
    })
}

/// Runs cycles; no reference of these joints changes by more than this per cycle. Returns the last ones.
fn evenly(robot: &mut Robot, joints: [usize; 2], most_mm: f64, cycles: u32) -> [f64; 2] {
    let mut before = references(robot, joints);
    for cycle in 0..cycles {
        robot.run(1);
        let now = references(robot, joints);
        for (now, before) in now.iter().zip(before) {
            let step = (now - before).abs();
            assert!(step <= most_mm + 1e-4, "cycle {cycle}: {step}");
        }
        before = now;
    }
    before
}

/// Runs a cycle with this travel of the wheels, mm, and of the standing feet with this slip.
fn goes(robot: &mut Robot, wheels_mm: [f64; 2], slip: f64) {
    let turn = (wheels_mm[1] - wheels_mm[0]) / 560.0;
    let forward = 0.5 * (wheels_mm[0] + wheels_mm[1]);
    for (wheel, way) in robot.senses.wheels.iter_mut().zip(wheels_mm) {
        *wheel = WheelSense {
            travel_um: wheel.travel_um + (1e3 * way) as i64,
            effort_percent: 20,
        };
    }
    for (side, first) in [(Side::Left, 0), (Side::Right, 3)] {
        let strokes = [0, 1, 2].map(|i| robot.joint(first + i).stroke_mm.to_f64());
        let m = strokes.map(|mm| (1e-3 * mm) as f32);
        let [x, y, z] = mirror::foot_of_strokes(&leg(), side, m).expect("closes");
        let y_hip = if side == Side::Left { 200.0 } else { -200.0 };
        let (rx, ry) = (600.0 + 1e3 * f64::from(x), y_hip + 1e3 * f64::from(y));
        let share = 1.0 - slip;
        let dx = share * (turn * ry - forward);
        let dy = share * (-turn * rx);
        let foot = [x + (1e-3 * dx) as f32, y + (1e-3 * dy) as f32, z];
        if let Some((strokes, _)) = mirror::strokes_of_foot(&leg(), side, foot, [0.0; 3]) {
            for (i, stroke) in strokes.into_iter().enumerate() {
                robot.joint(first + i).stroke_mm = mm(1e3 * f64::from(stroke));
            }
        }
    }
}

/// A robot that has moved like this for some cycles, with both feet initially this far ahead of their yaw axes and to
/// the left of them, mm.
fn gone(
    geometry: WalkGeometry,
    wheels_mm: [f64; 2],
    slip: f64,
    cycles: u32,
    foot_mm: [f64; 2],
) -> Robot {
    let mut robot = Robot::all(STAND);
    robot.behaving = Behaving::new(Behaviours::ALL, geometry);
    for (side, first) in [(Side::Left, 0), (Side::Right, 3)] {
        let [x, y] = foot_mm.map(|mm| (1e-3 * mm) as f32);
        let strokes = mirror::strokes_of_foot(&geometry.leg, side, [x, y, -0.1], [0.0; 3]);
        let strokes = strokes.expect("in reach");
        for (i, stroke) in strokes.0.into_iter().take(2).enumerate() {
            robot.joint(first + i).stroke_mm = mm(1e3 * f64::from(stroke));
        }
    }
    for _ in 0..cycles {
        goes(&mut robot, wheels_mm, slip);
        robot.run(1);
    }
    robot
}

#[test]
fn a_turn_without_slip_is_none_and_one_with_slip_is_found() {
    // 20 mm/s and 6 °/s; 60 mm/s and 4 °/s; a spin of 5 °/s; the same to the right and back.
    for (wheels, foot) in [
        ([-0.09, 0.49], [150.0, 38.0]),
        ([0.49, -0.09], [150.0, -38.0]),
        ([0.40, 0.80], [175.0, 30.0]),
        ([-0.25, 0.25], [150.0, 35.0]),
        ([0.25, -0.25], [150.0, -35.0]),
        ([-0.40, -0.80], [70.0, -15.0]),
    ] {
        let told = |slip| gone(geometry(false), wheels, slip, 75, foot).told;
        assert!(!told(0.0).contains(&Act::Slip), "{wheels:?}");
        assert!(!told(0.12).contains(&Act::Slip), "{wheels:?}");
        assert!(told(0.20).contains(&Act::Slip), "{wheels:?}");
    }
}

#[test]
fn legs_pull_the_way_that_their_wheels_go_each_for_itself() {
    let lead = |wheels, foot| {
        let robot = gone(geometry(false), wheels, 0.5, 160, foot);
        references(&robot, B5)
    };
    assert_eq!(lead([0.8, 0.8], [180.0, 0.0]), [70.0, 70.0]);
    assert_eq!(lead([-0.8, -0.8], [30.0, 0.0]), [130.0, 130.0]);
    // When turning on the spot to the left, the left foot must move forward.
    assert_eq!(lead([-0.25, 0.25], [150.0, 35.0]), [130.0, 70.0]);
}

#[test]
fn the_lead_of_a_pulling_leg_goes_by_half_a_millimetre_in_a_cycle() {
    let pulls = || {
        let robot = gone(geometry(false), [0.8, 0.8], 0.5, 160, [180.0, 0.0]);
        assert_eq!(references(&robot, B5), [70.0; 2]);
        robot
    };
    // The robot lifts a leg.
    let mut robot = pulls();
    plans(&mut robot, [LegPlan::Lift, LegPlan::Stance]);
    robot.touch([false, true]);
    assert_eq!(evenly(&mut robot, B5, 0.5, 59)[0], 99.5);
    assert_eq!(evenly(&mut robot, B5, 0.5, 1)[0], 100.0);
    // It reverses its turn.
    let mut robot = pulls();
    let mut before = references(&robot, B5);
    for _ in 0..200 {
        goes(&mut robot, [-0.8, -0.8], 0.5);
        robot.run(1);
        let now = references(&robot, B5);
        assert!((now[0] - before[0]).abs() <= 0.5 + 1e-4);
        before = now;
    }
    assert_eq!(before, [130.0; 2], "and pulls the other way");
    // Its walk ends, and it holds the last references.
    let mut robot = pulls();
    robot.setpoints.walk = None;
    robot.setpoints.phase = Phase::Done;
    assert_eq!(evenly(&mut robot, B5, 0.5, 59), [99.5; 2]);
    assert_eq!(evenly(&mut robot, B5, 0.5, 1), [100.0; 2]);
    // The user switches it off.
    let mut robot = pulls();
    robot.behaving.enable(Behaviours::NONE);
    assert_eq!(evenly(&mut robot, B5, 0.5, 60), [100.0; 2]);
    // A hold ends it at once: the references equal the legs' positions.
    let mut robot = pulls();
    robot.setpoints.walk = None;
    robot.setpoints.phase = Phase::Hold;
    robot.run(1);
    assert_eq!(references(&robot, B5), [100.0; 2]);
}

#[test]
fn the_share_of_the_load_goes_by_0_15_mm_in_a_cycle() {
    let shares = || {
        let mut robot = Robot::all(STAND);
        robot.joint(B6[0]).duty = Duty::from_per_mille(300);
        robot.run(200);
        assert_eq!(references(&robot, B6), [90.0, 110.0]);
        robot
    };
    let rate = 9_830.0 / 65_536.0;
    for ends in ["lift", "done", "off"] {
        let mut robot = shares();
        match ends {
            "lift" => plans(&mut robot, [LegPlan::Lift, LegPlan::Stance]),
            "done" => (robot.setpoints.walk, robot.setpoints.phase) = (None, Phase::Done),
            _ => robot
                .behaving
                .enable(Behaviours::ALL.without(Behaviour::LoadShare)),
        }
        let late = evenly(&mut robot, B6, rate, 60);
        assert!((late[0] - 99.0).abs() < 0.01, "{ends}: {late:?}");
        assert_eq!(evenly(&mut robot, B6, rate, 8), [100.0; 2], "{ends}");
    }
    // A foot that lands starts a new stance.
    let mut robot = shares();
    plans(&mut robot, [LegPlan::Lower(mm(80.0)), LegPlan::Stance]);
    robot.run(1);
    plans(&mut robot, STAND);
    assert_eq!(references(&robot, B6)[0], 100.0);
}

#[test]
fn switching_behaviours_in_mid_walk_moves_no_reference_at_once() {
    // A leg that has followed lost ground stands on the ground that it has found.
    let mut robot = Robot::all(STAND);
    robot.touch([false, true]);
    robot.run(20);
    let before = references(&robot, B6);
    assert!(before[0] > 110.0);
    robot.behaving.enable(Behaviours::NONE);
    assert_eq!(evenly(&mut robot, B6, 0.0, 20), before);
    // An overloaded cylinder is freed by 3 mm per cycle.
    let mut robot = Robot::all(STAND);
    robot.joint(B5[0]).saturated = true;
    robot.joint(B5[0]).duty = Duty::from_per_mille(900);
    robot.joint(B5[0]).stroke_mm = mm(50.0);
    robot.run(50);
    assert_eq!(references(&robot, B5)[0], 45.0);
    robot.behaving.enable(Behaviours::NONE);
    assert_eq!(evenly(&mut robot, B5, 3.0, 17)[0], 96.0);
    assert_eq!(evenly(&mut robot, B5, 4.0, 2)[0], 100.0);
    // A searching foot stays where it is.
    let mut robot = Robot::all([LegPlan::Lower(mm(120.0)), LegPlan::Stance]);
    robot.touch([false, true]);
    for _ in 0..60 {
        robot.joint(B6[0]).stroke_mm = mm(references(&robot, B6)[0]);
        robot.run(1);
    }
    let deep = references(&robot, B6)[0];
    assert!(deep > 150.0);
    robot.behaving.enable(Behaviours::NONE);
    assert_eq!(evenly(&mut robot, B6, 0.0, 20)[0], deep);
}

#[test]
fn a_nailed_foot_that_is_stopped_above_the_ground_it_expects_lands_within_60_ms() {
    let lower = [LegPlan::Lower(mm(120.0)), LegPlan::Stance];
    let mut robot = Robot::all(lower);
    robot.behaving = Behaving::new(Behaviours::ALL, geometry(true));
    robot.touch([false, true]);
    robot.joint(B6[0]).stroke_mm = mm(70.0);
    robot.joint(B6[0]).velocity_mm_s = VelocityMmS::from_int(200);
    robot.run(15);
    // The nails penetrate: the foot touches, and continues downwards.
    robot.touch([true; 2]);
    robot.joint(B6[0]).velocity_mm_s = VelocityMmS::from_int(10);
    robot.run(30);
    assert_eq!(robot.acts().landing[0], Landing::Waiting);
    // A rock stops them.
    robot.joint(B6[0]).velocity_mm_s = VelocityMmS::from_f64(9.9);
    robot.run(4);
    assert_eq!(robot.acts().landing[0], Landing::Waiting);
    robot.run(1);
    assert_eq!(robot.acts().landing[0], Landing::Down(mm(70.0)));
    assert!(robot.told.contains(&Act::EarlyGround(Side::Left)));
    // A piston stopped by something other than the ground has not landed.
    let mut robot = Robot::all(lower);
    robot.behaving = Behaving::new(Behaviours::ALL, geometry(true));
    robot.touch([false, true]);
    robot.joint(B6[0]).stroke_mm = mm(70.0);
    robot.run(40);
    assert_eq!(robot.acts().landing[0], Landing::Waiting);
}

#[test]
fn the_pace_changes_the_speed_of_a_wheel_by_3_mm_s_whatever_the_walk_does_meanwhile() {
    let mut robot = Robot::new(STAND, Behaviours::ALL.without(Behaviour::LostContact));
    let mut asked: f64 = 120.0;
    let mut led = robot.lead(asked, true).wheels[0];
    robot.touch([false; 2]);
    let mut fastest: f64 = 0.0;
    for cycle in 0..400 {
        // Feet find the ground again, and lose it; the walk speeds up and slows down.
        if cycle % 90 == 45 {
            robot.touch([true; 2]);
        } else if cycle % 90 == 0 {
            robot.touch([false; 2]);
        }
        let faster = if (cycle / 70) % 2 == 0 { -3.0 } else { 3.0 };
        asked = (asked + faster).clamp(20.0, 150.0);
        let before = robot.acts().pace;
        robot.observe();
        let now = robot.lead(asked, true).wheels[0];
        let step = now.velocity_mm_s.to_f64() - led.velocity_mm_s.to_f64();
        let held = robot.acts().pace < 1 || before < 1;
        assert!(step.abs() < 3.01, "{cycle}: {step}");
        let way = now.travel_mm.to_f64() - led.travel_mm.to_f64();
        let speed = 0.01 * now.velocity_mm_s.to_f64();
        assert!((way - speed).abs() < 1e-3, "{cycle}: {way} {speed}");
        if held {
            fastest = fastest.max(step.abs());
        }
        led = now;
    }
    assert!(fastest > 2.9, "it uses what it may: {fastest}");
}

#[test]
fn a_robot_of_another_track_turns_otherwise() {
    // Half the track: the same wheel speeds turn the robot twice as fast, and the feet with it.
    let narrow = WalkGeometry {
        track_m: 0.28,
        ..geometry(false)
    };
    let told = |geometry| {
        let robot = gone(geometry, [-0.25, 0.25], 0.0, 75, [150.0, 35.0]);
        robot.told.contains(&Act::Slip)
    };
    assert!(told(narrow) && !told(geometry(false)));
}
