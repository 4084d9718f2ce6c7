//! A walk on an ideal robot: pistons that follow their references at a limited speed, wheels that follow theirs, and a
//! nose that rests on the feet. A leg touches the ground if it reaches as far down as the other one, to within the
//! compliance of the air.

use crate::common::leg;
use fixed::types::I16F16;
use wheeleg_master::behaviour::{Act, Behaviour, Behaviours};
use wheeleg_master::contact::{FootSwitches, Side};
use wheeleg_master::event::{Event, Events};
use wheeleg_master::layer0::behaviours::{Behaving, JointSense, Senses, WheelSense};
use wheeleg_master::layer1::walk::{Walk, WalkGeometry, WalkOrder, WalkPattern};
use wheeleg_master::mirror;
use wheeleg_master::setpoint::{Cylinder, Feedback, LegPlan, Phase, Setpoints};
use wheeleg_units::{PositionMm, VelocityMmS};

/// Speed of a piston, mm per cycle.
const PISTON_MM: f64 = 3.0;

struct Robot {
    walk: Walk,
    behaving: Behaving,
    /// Acts reported in the last cycle.
    told: Vec<Act>,
    speeds: [f64; 6],
    strokes: [f64; 6],
    /// Depth of the ground below each foot, mm.
    ground: [f64; 2],
    wheels_mm: [f64; 2],
    origin_mm: [f64; 2],
    segment: u16,
    now_us: u64,
    last: Setpoints,
    /// How often it was reported as stuck, not counting what the behaviours find.
    stuck: u8,
    /// An obstacle over which the feet cannot be lifted keeps b5 from extending beyond this, mm.
    wall_mm: [f64; 2],
}

fn order(speed_mm_s: i16, turn_rad_s: &str) -> WalkOrder {
    WalkOrder {
        speed_mm_s: VelocityMmS::from_int(speed_mm_s),
        turn_rad_s: turn_rad_s.parse().expect("a number"),
        ..WalkOrder::default()
    }
}

impl Robot {
    fn new(order: WalkOrder) -> Self {
        let strokes = [90.0, 0.0, 180.0, 90.0, 90.0, 180.0];
        let ground = [0.0; 2];
        let feedback = sensed(&strokes, &ground, [0.0; 2]);
        let walk = Walk::new(WalkGeometry::default(), order, &feedback, 7);
        Self {
            walk: walk.expect("in range").expect("all heard"),
            behaving: Behaving::new(Behaviours::ALL, WalkGeometry::default()),
            told: Vec::new(),
            speeds: [0.0; 6],
            strokes,
            ground,
            wheels_mm: [0.0; 2],
            origin_mm: [0.0; 2],
            segment: 7,
            now_us: 0,
            last: Setpoints::idle(0),
            stuck: 0,
            wall_mm: [180.0; 2],
        }
    }

    fn touches(&self, side: Side) -> bool {
        touches(&self.strokes, &self.ground, side)
    }

    /// Position of a leg's foot from its yaw axis, m.
    fn foot_m(&self, side: Side) -> [f64; 2] {
        let first = side.joint(Cylinder::Yaw);
        let strokes = [0, 1, 2].map(|i| (self.strokes[first + i] * 1e-3) as f32);
        let [x, y, _] = mirror::foot_of_strokes(&leg(), side, strokes).expect("closes");
        [x.into(), y.into()]
    }

    fn cycle(&mut self) -> Setpoints {
        self.now_us += 10_000;
        let mut feedback = sensed(&self.strokes, &self.ground, self.wheels_mm);
        let mut events = Events::new();
        let senses = self.senses(&feedback);
        self.behaving
            .observe(&senses, &self.last, self.now_us, &mut events);
        feedback.acts = *self.behaving.acts();
        feedback.acts.stuck += self.stuck;
        let mut out = self.walk.setpoints(self.now_us, &feedback);
        self.told = self.walk.take_acts().collect();
        while let Some((_, event)) = events.pop() {
            match event {
                Event::Behaviour(act) => self.told.push(act),
                other => panic!("{other:?}"),
            }
        }
        let before = self.strokes;
        for (joint, slot) in out.joints.iter_mut().enumerate() {
            let wanted = slot.as_mut().expect("every joint is led");
            *wanted = self.behaving.apply(joint, *wanted, out.walk.as_ref());
            let to = wanted.reference_mm.to_f64();
            self.strokes[joint] += (to - self.strokes[joint]).clamp(-PISTON_MM, PISTON_MM);
            for side in [Side::Left, Side::Right] {
                if joint == side.joint(Cylinder::Horizontal) {
                    let wall_mm = self.wall_mm[side.index()].max(before[joint]);
                    self.strokes[joint] = self.strokes[joint].min(wall_mm);
                }
            }
            self.speeds[joint] = 100.0 * (self.strokes[joint] - before[joint]);
        }
        let travel = out.travel.expect("the wheels are led");
        let travel = self.behaving.lead(travel, out.walk.is_some(), true);
        out.travel = Some(travel);
        if travel.segment != self.segment {
            self.segment = travel.segment;
            self.origin_mm = self.wheels_mm;
        }
        for (i, wheel) in travel.wheels.iter().enumerate() {
            self.wheels_mm[i] = self.origin_mm[i] + wheel.travel_mm.to_f64();
        }
        self.last = out;
        out
    }

    fn senses(&self, feedback: &Feedback) -> Senses {
        let joint = |i: usize| JointSense {
            stroke_mm: PositionMm::from_f64(self.strokes[i]),
            velocity_mm_s: VelocityMmS::from_f64(self.speeds[i]),
            ..JointSense::default()
        };
        Senses {
            feet: feedback.feet,
            joints: std::array::from_fn(|i| Some(joint(i))),
            wheels: feedback.wheels_um.map(|travel_um| WheelSense {
                travel_um,
                effort_percent: 0,
            }),
        }
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds * 100.0) as u32 {
            self.cycle();
        }
    }
}

/// Whether a foot reaches as far down as the other one, or as far as the air allows, mm.
fn touches(strokes: &[f64; 6], ground: &[f64; 2], side: Side) -> bool {
    let down = |side: Side| strokes[side.joint(Cylinder::Vertical)] - ground[side.index()];
    down(side) >= down(side.other()) - 3.5
}

fn sensed(strokes: &[f64; 6], ground: &[f64; 2], wheels_mm: [f64; 2]) -> Feedback {
    let switches = |side: Side| {
        let touches = touches(strokes, ground, side);
        Some(FootSwitches(if touches { 0x0F } else { 0 }))
    };
    Feedback {
        strokes_mm: strokes.map(|mm| Some(PositionMm::from_f64(mm))),
        feet: [switches(Side::Left), switches(Side::Right)],
        wheels_um: wheels_mm.map(|mm| (mm * 1e3) as i64),
        motion_allowed: true,
        ..Feedback::default()
    }
}

#[test]
fn a_foot_rises_only_when_the_other_has_been_loaded_for_100_ms() {
    for pattern in [WalkPattern::Alternate, WalkPattern::Tandem] {
        let mut robot = Robot::new(WalkOrder {
            pattern,
            ..order(120, "0")
        });
        let mut loaded = [0_u32; 2];
        let mut rises = [0_u32; 2];
        let mut before = [180.0; 2];
        for _ in 0..2000 {
            let out = robot.cycle();
            for side in [Side::Left, Side::Right] {
                let wanted = out.joints[side.joint(Cylinder::Vertical)]
                    .unwrap()
                    .reference_mm;
                // A lift is commanded in a single step.
                if wanted.to_f64() < before[side.index()] - 12.5 {
                    rises[side.index()] += 1;
                    // The tenth cycle is this one.
                    assert!(loaded[side.other().index()] >= 9, "{side:?} {loaded:?}");
                }
                before[side.index()] = wanted.to_f64();
            }
            for side in [Side::Left, Side::Right] {
                let count = &mut loaded[side.index()];
                *count = if robot.touches(side) { *count + 1 } else { 0 };
            }
            assert!(robot.touches(Side::Left) || robot.touches(Side::Right) || out.step < 2);
        }
        assert!(rises.iter().all(|n| *n >= 4), "{pattern:?} {rises:?}");
        assert!(rises[0].abs_diff(rises[1]) <= 1, "{pattern:?} {rises:?}");
    }
}

#[test]
fn standing_feet_stay_where_they_are_on_the_ground() {
    // Straight, backward, in a turn and on the spot: the feet move with the ground below them.
    for (speed, turn) in [
        (100, "0"),
        (-80, "0"),
        (60, "0.07"),
        (0, "0.08"),
        (60, "-0.05"),
    ] {
        let mut robot = Robot::new(order(speed, turn));
        robot.run(6.0);
        let mut worst = 0.0_f64;
        for _ in 0..600 {
            let before = (
                robot.wheels_mm,
                [Side::Left, Side::Right].map(|s| robot.foot_m(s)),
            );
            // A foot stands from its second cycle on the ground on.
            let stood = [Side::Left, Side::Right].map(|side| {
                let plan = robot.last.walk.expect("it walks").leg(side);
                robot.touches(side) && !matches!(plan, LegPlan::Lower(_))
            });
            robot.cycle();
            // Travel from the wheels, as the robot turns about the middle of its axle.
            let [left, right] = [0, 1].map(|i| 1e-3 * (robot.wheels_mm[i] - before.0[i]));
            let (way, turned) = (0.5 * (left + right), (right - left) / 0.56);
            for side in [Side::Left, Side::Right] {
                if !stood[side.index()] || !robot.touches(side) {
                    continue;
                }
                let hip = if side == Side::Left { 0.2 } else { -0.2 };
                let [x, y] = before.1[side.index()];
                let wanted = [x - way + turned * (y + hip), y - turned * (x + 0.6)];
                let now = robot.foot_m(side);
                let off = (now[0] - wanted[0]).hypot(now[1] - wanted[1]);
                worst = worst.max(off);
            }
        }
        // One step of the reference, where the leg's geometry is tightest.
        assert!(
            worst < 1.0e-3,
            "{speed} {turn}: {} mm in a cycle",
            1e3 * worst
        );
    }
}

#[test]
fn speed_and_turn_are_those_of_the_order_and_change_while_walking() {
    let mut robot = Robot::new(order(60, "0"));
    robot.run(6.0);
    let travelled = |robot: &mut Robot, seconds: f64| {
        let before = robot.wheels_mm;
        robot.run(seconds);
        [0, 1].map(|i| (robot.wheels_mm[i] - before[i]) / seconds)
    };
    let [left, right] = travelled(&mut robot, 10.0);
    assert!(
        (left - 60.0).abs() < 1.0 && (right - 60.0).abs() < 1.0,
        "{left} {right}"
    );
    robot.walk.change(order(40, "0.05")).expect("in range");
    robot.run(2.0);
    let [left, right] = travelled(&mut robot, 10.0);
    let turn = (right - left) / 560.0;
    assert!((turn - 0.05).abs() < 0.002, "{turn}");
    assert!((0.5 * (left + right) - 40.0).abs() < 1.0);
}

#[test]
fn a_walk_is_accelerated_by_0_3_m_s2_at_most_and_stops_with_both_feet_down() {
    let mut robot = Robot::new(order(150, "0"));
    let mut last = 0.0;
    for i in 0..3000 {
        if i == 1500 {
            robot.walk.stop();
        }
        let out = robot.cycle();
        let speed = out.travel.unwrap().wheels[0].velocity_mm_s.to_f64();
        assert!((speed - last).abs() < 3.1, "{last} {speed}");
        last = speed;
        if out.phase == Phase::Done {
            assert!(robot.touches(Side::Left) && robot.touches(Side::Right));
            assert_eq!(speed, 0.0);
            assert!(robot.walk.steps() > 4);
            return;
        }
    }
    panic!("it has not stopped");
}

#[test]
fn no_foot_is_dragged_where_a_swing_takes_long() {
    // The ground is out of reach for the left foot: the wheels wait.
    let mut robot = Robot::new(order(120, "0"));
    robot.run(8.0);
    robot.ground[0] = 300.0;
    robot.run(3.0);
    let speed = robot.last.travel.unwrap().wheels[0].velocity_mm_s.to_f64();
    assert!(speed.abs() < 2.0, "{speed} mm/s");
    // The standing foot is still inside its reach.
    let [x, _] = robot.foot_m(Side::Right);
    assert!(x > 0.012, "{x}");
    // It continues once there is ground again.
    robot.ground[0] = 0.0;
    robot.run(3.0);
    assert!(robot.last.travel.unwrap().wheels[0].velocity_mm_s.to_f64() > 50.0);
}

#[test]
fn a_hole_is_reached_with_the_nose_down() {
    let mut robot = Robot::new(order(100, "0"));
    robot.run(8.0);
    // Deeper than the 20 mm left below the foot, but within the range of the nose.
    robot.ground[0] = 40.0;
    let before = robot.wheels_mm[0];
    robot.run(10.0);
    assert!(robot.wheels_mm[0] - before > 700.0, "{:?}", robot.wheels_mm);
}

#[test]
fn a_walk_that_cannot_go_on_backs_off_three_times_and_stands() {
    let mut robot = Robot::new(order(120, "0"));
    robot.run(8.0);
    robot.ground[0] = 300.0;
    let (mut tries, mut farthest) = (0, 0.0_f64);
    for _ in 0..6000 {
        let out = robot.cycle();
        farthest = farthest.max(robot.wheels_mm[0]);
        for act in &robot.told {
            tries += u32::from(*act == Act::BackOff);
            if *act == Act::Stuck {
                assert_eq!(tries, 3);
            }
        }
        if out.phase == Phase::Done {
            assert_eq!(tries, 3);
            assert!(robot.wheels_mm[0] < farthest + 1.0);
            return;
        }
    }
    panic!("it tries for ever");
}

/// The number of attempts of a walk whose feet run against walls there, and the time from the first bump until it gives
/// up, s; `None` if it has not given up within a minute.
fn gives_up(mut robot: Robot, wall_mm: [f64; 2]) -> Option<(u32, f64)> {
    robot.wall_mm = wall_mm;
    let (mut tries, mut since) = (0, None);
    for cycle in 0..6000_u32 {
        robot.cycle();
        for act in &robot.told {
            match act {
                Act::Bump(_) => _ = since.get_or_insert(cycle),
                Act::BackOff => tries += 1,
                Act::Stuck => {
                    let begun = since.expect("it has run against something");
                    return Some((tries, 0.01 * f64::from(cycle - begun)));
                }
                _ => {}
            }
        }
    }
    None
}

/// A robot that has walked for some time.
fn walking() -> Robot {
    let mut robot = Robot::new(order(50, "0"));
    robot.run(8.0);
    robot
}

#[test]
fn what_no_wheel_climbs_is_tried_once_more() {
    let (tries, took_s) = gives_up(walking(), [60.0; 2]).expect("it gives up");
    assert_eq!(tries, 1);
    assert!(took_s < 8.0, "{took_s}");
    // In front of one leg only, the robot gets past it.
    assert_eq!(gives_up(walking(), [60.0, 180.0]), None);
}

/// A leg that stands before a wall and has less time left than the other does not swing again before that one has.
#[test]
fn a_leg_at_a_face_does_not_swing_twice_in_a_row() {
    for wall_mm in [[60.0; 2], [60.0, 180.0], [180.0, 60.0]] {
        let mut robot = walking();
        robot.wall_mm = wall_mm;
        let (mut bumped, mut swings) = (false, Vec::new());
        for _ in 0..2000 {
            let stood = robot.last.walk.map(|walk| walk.legs);
            robot.cycle();
            bumped |= robot.told.iter().any(|act| matches!(act, Act::Bump(_)));
            let (Some(stood), Some(walk)) = (stood, robot.last.walk) else {
                break;
            };
            for (leg, (before, now)) in stood.iter().zip(&walk.legs).enumerate() {
                if bumped && (before, now) == (&LegPlan::Stance, &LegPlan::Lift) {
                    swings.push(leg);
                }
            }
        }
        assert!(swings.len() >= 2, "{wall_mm:?}: {swings:?}");
        let twice = swings.windows(2).filter(|pair| pair[0] == pair[1]).count();
        assert_eq!(twice, 0, "{wall_mm:?}: {swings:?}");
    }
}

/// An attempt shortly before, for another cause, does not count.
#[test]
fn what_no_wheel_climbs_is_tried_once_more_after_another_try() {
    let mut robot = walking();
    robot.stuck = 1;
    robot.cycle();
    assert!(robot.told.contains(&Act::BackOff));
    let (tries, _) = gives_up(robot, [60.0; 2]).expect("it gives up");
    assert_eq!(tries, 1);
}

/// With its behaviour switched off, nothing gives up.
#[test]
fn what_no_wheel_climbs_ends_no_walk_whose_behaviour_is_off() {
    let mut robot = walking();
    let on = Behaviours::ALL.without(Behaviour::Stuck);
    robot.behaving = Behaving::new(on, WalkGeometry::default());
    assert_eq!(gives_up(robot, [60.0; 2]), None);
}

#[test]
fn a_stance_ends_before_its_reach_where_the_speed_leaves_time() {
    // 0.5 s at 60 mm/s are 30 mm; no stance begins or ends within 7.5 mm of the stroke.
    let mut robot = Robot::new(order(60, "0"));
    robot.run(8.0);
    let mut lifts = 0;
    for _ in 0..1000 {
        let stood = robot.last.walk.expect("it walks").legs;
        let feet = [Side::Left, Side::Right].map(|side| robot.foot_m(side)[0]);
        robot.cycle();
        let plan = robot.last.walk.expect("it walks").legs;
        for i in 0..2 {
            if stood[i] == LegPlan::Stance && plan[i] == LegPlan::Lift {
                let left_mm = 1e3 * (feet[i] - 0.0175);
                assert!((20.0..40.0).contains(&left_mm), "{left_mm}");
                lifts += 1;
            }
        }
    }
    assert!(lifts >= 4, "{lifts}");
}

#[test]
fn a_walk_goes_on_for_longer_than_the_references_can_tell() {
    // 32 m is the end of their format.
    let mut robot = Robot::new(order(120, "0"));
    robot.run(400.0);
    assert!(robot.wheels_mm[0] > 38_000.0, "{:?}", robot.wheels_mm);
    assert!(robot.segment > 7);
}

#[test]
fn what_is_out_of_range_is_refused() {
    let feedback = sensed(&[90.0; 6], &[0.0; 2], [0.0; 2]);
    let wrong = [
        order(151, "0"),
        order(-151, "0"),
        order(0, "0.2"),
        WalkOrder {
            lift_mm: PositionMm::from_int(19),
            ..WalkOrder::default()
        },
        WalkOrder {
            nose_mm: PositionMm::from_int(1),
            ..WalkOrder::default()
        },
        WalkOrder {
            turn_rad_s: I16F16::MIN,
            ..WalkOrder::default()
        },
    ];
    for order in wrong {
        assert!(Walk::new(WalkGeometry::default(), order, &feedback, 1).is_err());
        let mut walk = Walk::new(WalkGeometry::default(), WalkOrder::default(), &feedback, 1);
        let walk = walk.as_mut().expect("in range").as_mut().expect("heard");
        assert!(walk.change(order).is_err());
    }
    // A board was not heard: the position of its leg is unknown.
    let mut deaf = feedback;
    deaf.strokes_mm[4] = None;
    let walk = Walk::new(WalkGeometry::default(), WalkOrder::default(), &deaf, 1);
    assert!(walk.expect("in range").is_none());
}

#[test]
fn a_robot_that_is_stuck_backs_off_the_way_that_it_came() {
    for (speed, turn, way_mm) in [
        (100, "0", [-12.5, -12.5]),
        (-100, "0", [12.5, 12.5]),
        (0, "0.08", [12.5, -12.5]),
        (0, "-0.08", [-12.5, 12.5]),
        // The outer wheel is the faster one: 60 ± 20 mm/s.
        (60, "0.0714", [-6.25, -12.5]),
    ] {
        let mut robot = Robot::new(order(speed, turn));
        robot.run(4.0);
        // In the middle of a stance, so that the feet have room.
        for _ in 0..300 {
            robot.cycle();
            let plan = robot.last.walk.expect("it walks");
            if plan.legs == [LegPlan::Stance; 2] {
                break;
            }
        }
        robot.run(0.3);
        robot.stuck = 1;
        robot.cycle();
        assert!(robot.told.contains(&Act::BackOff), "{speed} {turn}");
        // It must slow down first.
        robot.run(0.35);
        let before = robot.wheels_mm;
        robot.run(0.25);
        let way = [0, 1].map(|i| robot.wheels_mm[i] - before[i]);
        for (way, wanted) in way.into_iter().zip(way_mm) {
            let share = way / wanted;
            assert!((0.3..1.05).contains(&share), "{speed} {turn}: {way:.2}");
        }
    }
}
