//! Every threshold of the behaviours, from below and from above.

use wheeleg_master::behaviour::{Act, Behaviour, Behaviours};
use wheeleg_master::contact::{FootSwitches, Side};
use wheeleg_master::event::{Event, Events};
use wheeleg_master::layer0::behaviours::{Behaving, JointSense, Senses, WheelSense};
use wheeleg_master::layer1::walk::WalkGeometry;
use wheeleg_master::setpoint::{
    Acts, JointSetpoint, Landing, LegPlan, Setpoints, TravelSetpoint, WalkPlan, WheelTravel,
};
use wheeleg_units::{Duty, PositionMm, VelocityMmS};

const STAND: [LegPlan; 2] = [LegPlan::Stance; 2];
/// Indices of left yaw, b5 and b6.
const YAW: usize = 0;
const B5: usize = 1;
const B6: usize = 2;

/// A robot whose feet may have nails.
pub(crate) fn geometry(nailed: bool) -> WalkGeometry {
    WalkGeometry {
        nail_m: if nailed { 0.06 } else { 0.0 },
        ..WalkGeometry::default()
    }
}

pub(crate) fn mm(mm: f64) -> PositionMm {
    PositionMm::from_f64(mm)
}

/// A robot whose boards report what a test sets.
pub(crate) struct Robot {
    pub(crate) behaving: Behaving,
    pub(crate) senses: Senses,
    pub(crate) setpoints: Setpoints,
    pub(crate) told: Vec<Act>,
    travel_mm: f64,
}

impl Robot {
    pub(crate) fn new(legs: [LegPlan; 2], enabled: Behaviours) -> Self {
        let joint = JointSense {
            stroke_mm: mm(100.0),
            ..JointSense::default()
        };
        Self {
            behaving: Behaving::new(enabled, geometry(false)),
            senses: Senses {
                feet: [Some(FootSwitches(0x0F)); 2],
                joints: [Some(joint); 6],
                wheels: [WheelSense::default(); 2],
            },
            setpoints: Setpoints {
                walk: Some(WalkPlan { legs, driven: true }),
                ..Setpoints::idle(0)
            },
            told: Vec::new(),
            travel_mm: 0.0,
        }
    }

    pub(crate) fn all(legs: [LegPlan; 2]) -> Self {
        Self::new(legs, Behaviours::ALL)
    }

    pub(crate) fn joint(&mut self, index: usize) -> &mut JointSense {
        self.senses.joints[index].as_mut().expect("heard")
    }

    pub(crate) fn touch(&mut self, feet: [bool; 2]) {
        self.senses.feet = feet.map(|touches| Some(FootSwitches(if touches { 0x0F } else { 0 })));
    }

    /// Runs cycles; returns the acts reported in them.
    pub(crate) fn run(&mut self, cycles: u32) -> Vec<Act> {
        let mut told = Vec::new();
        for _ in 0..cycles {
            told.extend(self.observe());
            self.lead(self.speed(), true);
        }
        self.told.extend(&told);
        told
    }

    /// The behaviours' part of a cycle; returns the acts reported in it.
    pub(crate) fn observe(&mut self) -> Vec<Act> {
        let mut events = Events::new();
        self.behaving
            .observe(&self.senses, &self.setpoints, 0, &mut events);
        std::iter::from_fn(|| events.pop())
            .map(|(_, event)| match event {
                Event::Behaviour(act) => act,
                other => panic!("{other:?}"),
            })
            .collect()
    }

    pub(crate) fn acts(&self) -> &Acts {
        self.behaving.acts()
    }

    fn speed(&self) -> f64 {
        let travel = self.setpoints.travel;
        travel.map_or(0.0, |travel| travel.wheels[0].velocity_mm_s.to_f64())
    }

    /// Commands the wheels for a cycle at a speed, mm/s; returns the speed used.
    pub(crate) fn lead(&mut self, mm_s: f64, fresh: bool) -> TravelSetpoint {
        if fresh {
            self.travel_mm += 0.01 * mm_s;
        }
        let wheel = WheelTravel {
            travel_mm: mm(self.travel_mm),
            target_mm: mm(self.travel_mm),
            velocity_mm_s: VelocityMmS::from_f64(mm_s),
        };
        let travel = TravelSetpoint::common(wheel, 1);
        self.setpoints.travel = Some(travel);
        self.behaving.lead(travel, true, fresh)
    }

    pub(crate) fn reference(&self, joint: usize, mm_asked: f64) -> f64 {
        let asked = JointSetpoint {
            reference_mm: mm(mm_asked),
            ..JointSetpoint::default()
        };
        let plan = self.setpoints.walk.expect("walks");
        self.behaving
            .apply(joint, asked, Some(&plan))
            .reference_mm
            .to_f64()
    }
}

#[test]
fn b1_a_cylinder_at_its_limit_for_half_a_second_gives_way() {
    for (duty, back) in [(900, 95.0), (-900, 105.0)] {
        let mut robot = Robot::all(STAND);
        robot.joint(B5).saturated = true;
        robot.joint(B5).duty = Duty::from_per_mille(duty);
        assert_eq!(robot.run(49), []);
        assert_eq!(robot.reference(B5, 60.0), 60.0);
        assert_eq!(robot.run(1), [Act::Overload { node: 2 }]);
        let told = [false, true, false, false, false, false];
        assert_eq!(robot.acts().overload, told, "layer 1 knows");
        assert_eq!(robot.reference(B5, 60.0), back);
        assert_eq!(robot.run(200), [], "told once");
        // In another phase of the leg there is another attempt.
        robot.setpoints.walk = Some(WalkPlan {
            legs: [LegPlan::Lift, LegPlan::Stance],
            driven: true,
        });
        // It is freed by 3 mm per cycle.
        for cycle in 1..=11 {
            robot.run(1);
            let free = back + if back > 60.0 { -3.0 } else { 3.0 } * f64::from(cycle);
            assert_eq!(robot.reference(B5, 60.0), f64::max(60.0, free));
        }
        robot.run(4);
        assert_eq!(robot.reference(B5, 60.0), 60.0);
    }
    // 5 mm in half a second count as motion, 4.9 mm do not.
    for (way_mm, told) in [(4.9, true), (5.0, false)] {
        let mut robot = Robot::all(STAND);
        robot.joint(B5).saturated = true;
        robot.run(25);
        robot.joint(B5).stroke_mm = mm(100.0 + way_mm);
        assert_eq!(!robot.run(26).is_empty(), told, "{way_mm}");
    }
}

#[test]
fn b2_two_hanging_feet_stop_the_wheels_and_no_leg_extends_far() {
    let mut robot = Robot::all(STAND);
    robot.touch([false; 2]);
    assert_eq!(robot.run(5), [], "50 ms");
    let told = robot.run(1);
    assert_eq!(told[0], Act::TipGuard);
    robot.run(60);
    assert_eq!(robot.acts().pace, 0);
    assert_eq!(robot.acts().beyond_mm, [mm(10.0); 2]);
    assert_eq!(robot.acts().deep, [false; 2]);
    // A swinging foot carries nothing, either.
    let mut robot = Robot::all([LegPlan::Stance, LegPlan::Reach]);
    robot.touch([false; 2]);
    assert!(!robot.run(5).contains(&Act::TipGuard));
    assert!(robot.run(1).contains(&Act::TipGuard));
    assert!(!robot.acts().deep[0]);
}

/// Wheels that stop and hold keep up a nose that their torque has lifted: they go back until a foot carries load, by at
/// most 80 mm, and layer 1 knows how far.
#[test]
fn b2_wheels_give_way_after_200_ms_until_a_foot_carries() {
    let mut robot = Robot::all([LegPlan::Stance, LegPlan::Reach]);
    robot.run(1);
    robot.touch([false; 2]);
    robot.run(20);
    assert_eq!(robot.acts().back_mm, mm(0.0), "200 ms");
    let begin = robot.lead(0.0, true).wheels[0].travel_mm;
    let mut told_mm = 0.0;
    let mut last = 0.0;
    for cycle in 0..300 {
        robot.run(1);
        let led = robot.acts().back_mm.to_f64();
        assert!((led - last).abs() < 0.031, "{cycle}: {last} {led}");
        assert!(led <= 0.5, "50 mm/s");
        last = led;
        told_mm += led;
    }
    let back_mm = begin.to_f64() - robot.lead(0.0, true).wheels[0].travel_mm.to_f64();
    assert!((79.0..84.0).contains(&back_mm), "{back_mm}");
    assert!((told_mm - back_mm).abs() < 0.6, "{told_mm} {back_mm}");
    let mut robot = Robot::all([LegPlan::Stance, LegPlan::Reach]);
    robot.touch([false; 2]);
    robot.run(40);
    assert!(robot.acts().back_mm > mm(0.2));
    robot.touch([true, false]);
    robot.run(30);
    assert_eq!(robot.acts().back_mm, mm(0.0), "a foot carries");
    let mut robot = Robot::new(STAND, Behaviours::ALL.without(Behaviour::TipGuard));
    robot.touch([false; 2]);
    robot.run(40);
    assert_eq!(robot.acts().back_mm, mm(0.0), "switched off");
}

/// Feet that search for the ground at full length carry nothing: wheels that continued would drive in below the robot
/// until it lies on its tail. If one foot stands, the other is only set down.
#[test]
fn b2_the_wheels_stop_while_both_feet_are_set_down_without_ground() {
    let lower = LegPlan::Lower(mm(150.0));
    let led = |robot: &mut Robot| robot.lead(120.0, true).wheels[0].velocity_mm_s.to_f64();
    let mut robot = Robot::all([lower; 2]);
    robot.lead(120.0, true);
    robot.touch([false; 2]);
    assert!(!robot.run(5).contains(&Act::TipGuard));
    assert!(robot.run(1).contains(&Act::TipGuard));
    robot.run(10);
    assert!(led(&mut robot) < 120.0);
    robot.run(70);
    assert!(led(&mut robot) <= 0.0);
    robot.touch([false, true]);
    robot.run(60);
    assert_eq!(led(&mut robot), 120.0, "one touches");
}

#[test]
fn the_wheels_slow_down_and_speed_up_by_0_3_m_s2() {
    let mut robot = Robot::new(STAND, Behaviours::ALL.without(Behaviour::LostContact));
    robot.run(1);
    let mut last = 120.0;
    robot.touch([false; 2]);
    for cycle in 0..80 {
        robot.run(1);
        let led = robot.lead(120.0, true).wheels[0].velocity_mm_s.to_f64();
        // Commanded twice per cycle here.
        assert!(last - led < 6.1, "{cycle}: {last} {led}");
        last = led;
    }
    assert_eq!(last, -50.0, "they have stopped, and give way");
}

#[test]
fn b3_a_foot_stops_where_its_switches_close() {
    let from = mm(120.0);
    let mut robot = Robot::all([LegPlan::Lower(from), LegPlan::Stance]);
    robot.touch([false, true]);
    assert_eq!(robot.reference(B6, 0.0), 120.0, "fast to here");
    robot.joint(B6).stroke_mm = mm(114.9);
    robot.run(1);
    assert_eq!(robot.reference(B6, 0.0), 120.0, "not near yet");
    robot.joint(B6).stroke_mm = mm(115.0);
    robot.run(7);
    assert_eq!(
        robot.reference(B6, 0.0),
        121.0,
        "1 mm a cycle, while it is near"
    );
    robot.joint(B6).stroke_mm = mm(121.0);
    robot.touch([true; 2]);
    assert_eq!(robot.run(1), []);
    // It presses at once, and stands once the touch has lasted for two consecutive cycles.
    assert_eq!(robot.reference(B6, 0.0), 125.0);
    assert_eq!(robot.acts().landing[0], Landing::Waiting);
    robot.joint(B6).stroke_mm = mm(122.0);
    assert_eq!(robot.run(1), []);
    assert_eq!(robot.acts().landing[0], Landing::Down(mm(121.0)));
    assert_eq!(robot.behaving.tally().of(Behaviour::Touchdown), 1);
    // 20 mm off the expected place (130 mm) is reported, less is not.
    for (at, told) in [
        (110.0, vec![Act::EarlyGround(Side::Left)]),
        (110.1, vec![]),
        (149.9, vec![]),
        (150.0, vec![Act::LateGround(Side::Left)]),
    ] {
        let mut robot = Robot::all([LegPlan::Lower(from), LegPlan::Stance]);
        robot.joint(B6).stroke_mm = mm(at);
        assert_eq!(robot.run(2), told, "{at}");
    }
    // A touch of one cycle is a graze: the foot continues downwards.
    let mut robot = Robot::all([LegPlan::Lower(from), LegPlan::Stance]);
    robot.joint(B6).stroke_mm = mm(125.0);
    robot.run(1);
    robot.touch([false, true]);
    robot.run(1);
    assert_eq!(robot.acts().landing[0], Landing::Waiting);
    robot.joint(B6).stroke_mm = mm(129.0);
    robot.run(1);
    assert_eq!(robot.reference(B6, 0.0), 131.0);
    robot.touch([true; 2]);
    robot.run(1);
    assert_eq!(robot.acts().landing[0], Landing::Waiting, "felt anew");
    robot.run(1);
    assert_eq!(robot.acts().landing[0], Landing::Down(mm(129.0)));
    // With the behaviour off, the foot goes down to the expected ground, and 4 mm further.
    let mut robot = Robot::new(
        [LegPlan::Lower(from), LegPlan::Stance],
        Behaviours::ALL.without(Behaviour::Touchdown),
    );
    assert_eq!(robot.reference(B6, 0.0), 134.0);
    robot.joint(B6).stroke_mm = mm(90.0);
    robot.joint(B6).velocity_mm_s = VelocityMmS::from_int(200);
    robot.run(3);
    assert_eq!(
        robot.acts().landing[0],
        Landing::Waiting,
        "touches and goes on"
    );
}

#[test]
fn b3_nails_do_not_end_the_way_down_before_the_ground_that_is_expected() {
    for (at, nailed, lands) in [
        (129.9, true, false),
        (130.0, true, true),
        (129.9, false, true),
    ] {
        let mut robot = Robot::all([LegPlan::Lower(mm(120.0)), LegPlan::Stance]);
        robot.behaving = Behaving::new(Behaviours::ALL, geometry(nailed));
        robot.joint(B6).stroke_mm = mm(at);
        robot.run(2);
        let landed = robot.acts().landing[0] != Landing::Waiting;
        assert_eq!(landed, lands, "{at} {nailed}");
    }
    let mut robot = Robot::all([LegPlan::Reach, LegPlan::Stance]);
    robot.behaving = Behaving::new(Behaviours::ALL, geometry(true));
    robot.joint(B5).velocity_mm_s = VelocityMmS::from_int(100);
    assert_eq!(robot.run(60), [], "tips scratch the ground");
}

#[test]
fn b4_a_foot_searches_down_to_its_full_length() {
    let from = mm(140.0);
    let search = |enabled| {
        let mut robot = Robot::new([LegPlan::Lower(from), LegPlan::Stance], enabled);
        robot.touch([false, true]);
        let mut told = Vec::new();
        for _ in 0..100 {
            let reference = robot.reference(B6, 0.0);
            robot.joint(B6).stroke_mm = mm(reference.min(179.0));
            told.extend(robot.run(1));
        }
        (robot, told)
    };
    let (robot, told) = search(Behaviours::ALL);
    assert_eq!(robot.reference(B6, 0.0), 180.0);
    assert_eq!(told, [Act::NoGround(Side::Left)]);
    // From 178 mm on it is at full length: 38 cycles down, 62 at the end.
    assert_eq!(robot.acts().landing[0], Landing::Nothing(62));
    let (robot, told) = search(Behaviours::ALL.without(Behaviour::Search));
    assert_eq!(
        robot.reference(B6, 0.0),
        154.0,
        "4 mm beyond what was expected"
    );
    assert_eq!(told, []);
    assert_eq!(
        robot.acts().landing[0],
        Landing::Down(mm(150.0)),
        "stands on nothing"
    );
}

#[test]
fn b4_no_ground_is_told_after_200_ms() {
    let mut robot = Robot::all([LegPlan::Lower(mm(170.0)), LegPlan::Stance]);
    robot.touch([false, true]);
    robot.joint(B6).stroke_mm = mm(177.9);
    assert_eq!(robot.run(30), []);
    robot.joint(B6).stroke_mm = mm(178.0);
    assert_eq!(robot.run(19), []);
    assert_eq!(robot.run(1), [Act::NoGround(Side::Left)]);
}

/// A foot that is pressed against something from the start of its reach goes back after 0.1 s, because after 0.2 s of
/// pushing without motion its board takes this for a fault. A foot that gets away has its 250 ms.
#[test]
fn b5_a_reach_that_begins_pressed_against_something_is_told_before_its_board_gives_up() {
    let pressed = |velocity_mm_s: f64| {
        let mut robot = Robot::all([LegPlan::Reach, LegPlan::Stance]);
        robot.joint(B5).velocity_mm_s = VelocityMmS::from_f64(velocity_mm_s);
        robot
    };
    let mut robot = pressed(9.9);
    assert_eq!(robot.run(9), []);
    assert_eq!(robot.run(1), [Act::Bump(Side::Left)]);
    // A moving foot is reported a cycle later: b5 waits where it touches.
    assert_eq!(pressed(10.1).run(10), []);
}

#[test]
fn b5_a_reach_that_stalls_or_touches_has_met_something() {
    let reach = [LegPlan::Reach, LegPlan::Stance];
    let mut robot = Robot::all(reach);
    robot.touch([false, true]);
    robot.joint(B5).velocity_mm_s = VelocityMmS::from_f64(9.9);
    robot.joint(YAW).velocity_mm_s = VelocityMmS::from_f64(-9.9);
    robot.setpoints.joints[B5] = Some(JointSetpoint {
        reference_mm: mm(150.0),
        ..JointSetpoint::default()
    });
    assert_eq!(robot.run(25 + 9), []);
    assert_eq!(robot.reference(B5, 150.0), 150.0);
    assert_eq!(robot.run(1), [Act::Bump(Side::Left)]);
    assert_eq!(robot.acts().bumps, [1, 0]);
    assert_eq!(robot.reference(B5, 150.0), 85.0, "15 mm back");
    assert_eq!(robot.run(24), []);
    assert_eq!(robot.reference(B5, 150.0), 85.0);
    assert_eq!(robot.run(1), []);
    assert_eq!(robot.reference(B5, 150.0), 150.0);
    assert_eq!(robot.run(9), [], "it starts anew");
    assert_eq!(robot.run(1), [Act::Bump(Side::Left)]);
    for moving in [YAW, B5] {
        let mut robot = Robot::all(reach);
        robot.touch([false, true]);
        robot.joint(moving).velocity_mm_s = VelocityMmS::from_int(10);
        assert_eq!(robot.run(200), []);
        robot.touch([true; 2]);
        assert_eq!(robot.run(1), [Act::Bump(Side::Left)]);
    }
    // A foot that is leaving the ground still touches it: b5 waits there, over the ground, and the wheels slow down.
    let mut robot = Robot::all(reach);
    robot.setpoints.joints[B5] = Some(JointSetpoint {
        reference_mm: mm(150.0),
        ..JointSetpoint::default()
    });
    robot.joint(B5).velocity_mm_s = VelocityMmS::from_int(100);
    robot.run(1);
    assert_eq!(robot.reference(B5, 150.0), 100.0);
    for wheel in &mut robot.senses.wheels {
        wheel.travel_um += 4_000;
    }
    assert_eq!(robot.run(9), []);
    assert_eq!(robot.reference(B5, 150.0), 96.0);
    assert!(robot.acts().pace < 1);
    robot.touch([false, true]);
    assert_eq!(robot.run(1), []);
    assert_eq!(
        robot.reference(B5, 150.0),
        150.0,
        "and goes on when it is free"
    );
    // A foot that continues and touches has met something.
    robot.touch([true; 2]);
    assert_eq!(robot.run(10), []);
    assert_eq!(robot.run(1), [Act::Bump(Side::Left)]);
    assert_eq!(robot.reference(B5, 150.0), 85.0);
    for wheel in &mut robot.senses.wheels {
        wheel.travel_um += 10_000;
    }
    robot.run(1);
    assert_eq!(robot.reference(B5, 150.0), 75.0, "15 mm over the ground");
    assert_eq!(robot.run(24), []);
    assert_eq!(robot.run(1), [Act::Bump(Side::Left)], "as soon as it may");
}

#[test]
fn b6_a_foot_follows_lost_ground_by_20_mm_at_half_the_speed() {
    let mut robot = Robot::all(STAND);
    robot.touch([false, true]);
    assert_eq!(robot.run(5), [], "50 ms");
    assert_eq!(robot.run(1), [Act::LostGround(Side::Left)]);
    assert_eq!(robot.reference(B6, 100.0), 101.0);
    robot.run(18);
    assert!(!robot.acts().deep[0]);
    assert_eq!(robot.reference(B6, 100.0), 119.0);
    robot.run(10);
    assert_eq!(robot.reference(B6, 100.0), 120.0);
    assert_eq!(robot.reference(5, 100.0), 100.0, "the other leg holds");
    assert!(robot.acts().deep[0] && robot.acts().lost[0]);
    for _ in 0..60 {
        robot.lead(100.0, true);
    }
    assert_eq!(
        robot.lead(100.0, true).wheels[0].velocity_mm_s.to_f64(),
        50.0
    );
    // Its foothold is kept until the stance ends.
    robot.touch([true; 2]);
    robot.run(10);
    assert_eq!(robot.reference(B6, 100.0), 120.0);
    assert!(!robot.acts().lost[0]);
}

/// A robot whose wheels turn and whose legs follow with this slip, for `cycles` cycles.
fn slipping(slip: f64, cycles: u32, enabled: Behaviours) -> Robot {
    let mut robot = Robot::new(STAND, enabled);
    let (mut wheels, mut stroke) = (0.0, 170.0);
    for joint in [YAW, 3] {
        // Straight ahead.
        robot.joint(joint).stroke_mm = mm(90.0);
    }
    for _ in 0..cycles {
        wheels += 1.0;
        stroke -= 1.0 - slip;
        robot.senses.wheels = [WheelSense {
            travel_um: (1e3 * wheels) as i64,
            effort_percent: 20,
        }; 2];
        for joint in [B5, 4] {
            robot.joint(joint).stroke_mm = mm(stroke);
        }
        robot.run(1);
    }
    robot
}

#[test]
fn b7_wheels_that_slip_slow_down_and_the_legs_pull() {
    let b5 = |robot: &Robot| robot.reference(B5, 100.0);
    let robot = slipping(0.13, 160, Behaviours::ALL);
    assert_eq!((robot.told.len(), b5(&robot)), (0, 100.0));
    // The legs pull, by 30 mm at most; the wheels are at their best.
    for slip in [0.17, 0.73] {
        let robot = slipping(slip, 160, Behaviours::ALL);
        assert_eq!(robot.told, [Act::Slip]);
        assert_eq!((b5(&robot), robot.acts().pace.to_num()), (70.0, 1.0));
    }
    let robot = slipping(0.77, 160, Behaviours::ALL);
    assert_eq!(robot.told, [Act::Slip]);
    assert!(robot.acts().pace < 1);
    // A leg counts from 0.3 s of its stance on, and the slip must last for the same time.
    for (cycles, told) in [(55, 0), (70, 1)] {
        assert_eq!(slipping(0.5, cycles, Behaviours::ALL).told.len(), told);
    }
    let robot = slipping(0.77, 160, Behaviours::ALL.without(Behaviour::Slip));
    assert_eq!((robot.told.len(), b5(&robot)), (0, 100.0));
}

#[test]
fn b9_no_progress_for_3_s_or_a_blocked_wheel_is_stuck() {
    let mut robot = Robot::all(STAND);
    robot.run(300);
    assert_eq!(robot.acts().stuck, 0);
    robot.run(1);
    assert_eq!(robot.acts().stuck, 1);
    robot.run(300);
    assert_eq!(robot.acts().stuck, 1, "as patient as before");
    robot.run(1);
    assert_eq!(robot.acts().stuck, 2);
    // A leg that moves by 5 mm, with wheels that turn by 10 mm, makes progress.
    for (leg_mm, wheels_um, stuck) in [
        (5.1, 10_000, false),
        (4.9, 10_000, true),
        (5.1, 9_900, true),
    ] {
        let mut robot = Robot::all(STAND);
        robot.run(150);
        robot.joint(B5).stroke_mm = mm(100.0 + leg_mm);
        for wheel in &mut robot.senses.wheels {
            wheel.travel_um = wheels_um;
        }
        let mut found = false;
        for _ in 0..160 {
            robot.run(1);
            found |= robot.acts().stuck > 0;
        }
        assert_eq!(found, stuck, "{leg_mm} {wheels_um}");
    }
    // Maximum motor command, at less than a fifth of the speed.
    for (effort, way_um, stuck) in [(91, 190, true), (90, 190, false), (91, 210, false)] {
        let mut robot = Robot::all(STAND);
        robot.lead(100.0, true);
        let mut found = false;
        for _ in 0..110 {
            robot.senses.wheels[0].travel_um += way_um;
            robot.senses.wheels[0].effort_percent = effort;
            robot.run(1);
            found |= robot.acts().stuck > 0;
        }
        assert_eq!(found, stuck, "{effort} {way_um}");
    }
}

#[test]
fn b9_three_swings_in_a_row_that_run_against_something_are_stuck_and_then_two() {
    let mut robot = Robot::all(STAND);
    let mut swing = |bumps: bool, way_um: i64| {
        let before = robot.acts().stuck;
        for (leg, cycles) in [
            (LegPlan::Reach, 40),
            (LegPlan::Lower(mm(99.0)), 2),
            (LegPlan::Stance, 1),
        ] {
            robot.setpoints.walk = Some(WalkPlan {
                legs: [leg, LegPlan::Stance],
                driven: true,
            });
            let reaches = leg == LegPlan::Reach;
            robot.touch([!reaches, true]);
            robot.joint(B5).velocity_mm_s = VelocityMmS::from_int(if bumps { 0 } else { 100 });
            // Wheels and legs continue as if nothing had happened.
            for wheel in &mut robot.senses.wheels {
                wheel.travel_um += way_um;
            }
            let stroke = robot.joint(4).stroke_mm.to_f64();
            robot.joint(4).stroke_mm = mm(if stroke > 100.0 { 90.0 } else { 110.0 });
            for _ in 0..cycles {
                robot.run(1);
            }
        }
        robot.acts().stuck != before
    };
    let mut swings = |all: &[bool], way_um| {
        let each = all.iter().map(|bumps| swing(*bumps, way_um));
        each.collect::<Vec<_>>()
    };
    assert_eq!(swings(&[true; 3], 20_000), [false, false, true]);
    // Again before it has come half a metre further.
    assert_eq!(swings(&[true; 2], 20_000), [false, true]);
    assert_eq!(swings(&[true, false, true], 20_000), [false; 3]);
    assert_eq!(swings(&[false; 9], 20_000), [false; 9]);
    assert_eq!(swings(&[true; 3], 20_000), [false, false, true]);
}

#[test]
fn b10_the_leg_that_works_more_gives_way() {
    for (per_mille, told) in [(190, false), (230, true)] {
        let mut robot = Robot::all(STAND);
        robot.joint(B6).duty = Duty::from_per_mille(per_mille);
        assert_eq!(
            robot.run(200).contains(&Act::LoadShare),
            told,
            "{per_mille}"
        );
        let [left, right] = [B6, 5].map(|joint| robot.reference(joint, 100.0));
        let wanted = if told { [90.0, 110.0] } else { [100.0; 2] };
        assert_eq!([left, right], wanted);
    }
}

#[test]
fn what_is_switched_off_does_nothing_and_a_robot_that_does_not_walk_has_no_behaviours() {
    let mut robot = Robot::new(STAND, Behaviours::NONE);
    robot.touch([false; 2]);
    robot.joint(B5).saturated = true;
    robot.joint(B6).duty = Duty::from_per_mille(900);
    assert_eq!(robot.run(400), []);
    assert_eq!(robot.reference(B6, 100.0), 100.0);
    assert_eq!(robot.acts().pace, 1);
    let mut robot = Robot::all(STAND);
    robot.setpoints.walk = None;
    robot.touch([false; 2]);
    assert_eq!(robot.run(400), []);
    assert_eq!(robot.acts(), &Acts::default());
}
