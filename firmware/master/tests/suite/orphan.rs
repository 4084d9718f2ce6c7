//! A walk whose layer 1 has stopped, with eight boards on the bus: what continues, how it ends, and what can never
//! start again.

use crate::common::{CYCLE_US, TestRig, leg};
use wheeleg_master::MasterConfig;
use wheeleg_master::behaviour::{Act, Behaviour, Behaviours};
use wheeleg_master::command::Command;
use wheeleg_master::config::WheelDrive;
use wheeleg_master::contact::Side;
use wheeleg_master::dispatcher::{Refusal, Request};
use wheeleg_master::event::{Event, HoldReason};
use wheeleg_master::layer0::operator::OPERATOR_CLIENT;
use wheeleg_master::layer1::walk::WalkOrder;
use wheeleg_master::mirror::foot_of_strokes;
use wheeleg_master::setpoint::{LegPlan, Phase};
use wheeleg_protocol::{Address, FaultBits, InputBits, NodeMode, Sync};
use wheeleg_units::{PositionMm, VelocityMmS};

/// Stroke of a leg that reaches the ground, mm.
const GROUND_MM: f64 = 155.0;
/// Cycles after which layer 1 is given up, and after which the behaviours of its walk end.
const GIVEN_UP: usize = 10;
const ENDS: usize = 500;

/// A robot on ground that each foot can lose.
struct Walker {
    rig: TestRig,
    /// Depth of the ground below each foot, mm.
    ground_mm: [f64; 2],
}

fn order(speed_mm_s: i16, turn_rad_s: &str) -> WalkOrder {
    WalkOrder {
        speed_mm_s: VelocityMmS::from_int(speed_mm_s),
        turn_rad_s: turn_rad_s.parse().expect("a number"),
        ..WalkOrder::default()
    }
}

impl Walker {
    /// A robot that has walked for `cycles` cycles.
    fn new(order: WalkOrder, cycles: usize) -> Self {
        let mut walker = Self {
            rig: TestRig::new(MasterConfig {
                wheel_drive: WheelDrive::Stream,
                // All pistons are as fast as the fake ones.
                behaviours: Behaviours::ALL.without(Behaviour::Stuck),
                ..MasterConfig::default()
            }),
            ground_mm: [GROUND_MM; 2],
        };
        walker.rig.stand();
        walker.run(5);
        walker.rig.submit(Command::Walk(order));
        walker.run(cycles);
        assert_eq!(walker.rig.last_record.unwrap().phase, Phase::Walk);
        walker
    }

    fn sense(&mut self) {
        for (node, depth_mm) in [3, 6].into_iter().zip(self.ground_mm) {
            let node = self.rig.node(node);
            node.inputs = if node.stroke_mm() >= depth_mm {
                InputBits::FOOT
            } else {
                InputBits::NONE
            };
        }
    }

    fn cycle(&mut self) -> Sync {
        let sync = self.rig.cycle();
        self.sense();
        sync
    }

    fn run(&mut self, cycles: usize) {
        for _ in 0..cycles {
            self.cycle();
        }
    }

    /// Layer 1 stops from now on.
    fn stall(&mut self, cycles: usize) {
        self.rig.master.set_layer1_enabled(false);
        self.run(cycles);
    }

    fn wake(&mut self) {
        self.rig.master.set_layer1_enabled(true);
    }

    fn strokes_mm(&self) -> Vec<f64> {
        let joints = self.rig.nodes.iter().take(6);
        joints.map(|node| node.stroke_mm()).collect()
    }

    fn wheels(&self) -> Vec<i64> {
        let wheels = self.rig.nodes.iter().skip(6);
        wheels.map(|node| node.position).collect()
    }

    /// Checks that for `cycles` cycles nothing moves and nothing is armed that could move.
    fn stays(&mut self, cycles: usize, why: &str) {
        let (strokes, wheels) = (self.strokes_mm(), self.wheels());
        for cycle in 0..cycles {
            self.cycle();
            assert_eq!(self.strokes_mm(), strokes, "{why}: cycle {cycle}");
            assert_eq!(self.wheels(), wheels, "{why}: cycle {cycle}");
        }
        assert!(!self.rig.master.is_armed(), "{why}");
    }

    fn held(&self, reason: HoldReason) -> bool {
        self.rig.saw(|event| *event == Event::Hold(reason))
    }
}

#[test]
fn a_layer_1_that_wakes_after_it_was_given_up_is_not_followed_and_its_feet_are_still_led() {
    for wakes_after in [GIVEN_UP + 1, GIVEN_UP + 5, 40] {
        let mut walker = Walker::new(order(120, "0"), 303);
        walker.stall(wakes_after);
        assert!(walker.held(HoldReason::LayerOneStalled));
        walker.wake();
        walker.run(150);
        let record = walker.rig.last_record.unwrap();
        let plan = record.walk.expect("its behaviours go on");
        assert_eq!(plan.legs, [LegPlan::Stance; 2], "{wakes_after}");
        assert!(!plan.driven);
        let strokes = walker.strokes_mm();
        assert!(
            strokes[2] >= GROUND_MM && strokes[5] >= GROUND_MM,
            "{strokes:?}"
        );
        // The ground below a foot gives way, and the leg follows.
        walker.ground_mm[0] = strokes[2] + 5.0;
        walker.run(20);
        let followed = walker.strokes_mm()[2] - strokes[2];
        assert!((5.0..8.0).contains(&followed), "{wakes_after}: {followed}");
        assert!(!walker.rig.master.is_armed());
    }
}

#[test]
fn standing_feet_of_a_stalled_walk_go_with_the_ground_in_a_turn_too() {
    for after in [250, 287, 305, 330] {
        let mut walker = Walker::new(order(60, "0.07"), after);
        let feet = |walker: &Walker| {
            let strokes = walker.strokes_mm();
            [Side::Left, Side::Right].map(|side| {
                let first = side.index() * 3;
                let m = [0, 1, 2].map(|i| (1e-3 * strokes[first + i]) as f32);
                let [x, y, _] = foot_of_strokes(&leg(), side, m).unwrap();
                let y_hip = if side == Side::Left { 0.2 } else { -0.2 };
                [0.6 + f64::from(x), y_hip + f64::from(y)]
            })
        };
        // Pose of the robot, from its wheels.
        let mut pose = [0.0_f64; 3];
        let mut wheels = walker.wheels();
        walker.rig.master.set_layer1_enabled(false);
        let stood = walker.rig.last_record.unwrap().walk.unwrap().legs;
        let mut begun = None;
        for cycle in 0..80 {
            walker.cycle();
            let now = walker.wheels();
            let um_per_count = 942_478.0 / 104_000.0;
            let way = |i: usize| 1e-6 * um_per_count * (now[i] - wheels[i]) as f64;
            let (left, right) = (way(0), way(1));
            wheels.clone_from(&now);
            pose[2] += (right - left) / 0.56;
            pose[0] += 0.5 * (left + right) * pose[2].cos();
            pose[1] += 0.5 * (left + right) * pose[2].sin();
            let [x, y, yaw] = pose;
            let world = feet(&walker).map(|[fx, fy]| {
                [
                    x + fx * yaw.cos() - fy * yaw.sin(),
                    y + fx * yaw.sin() + fy * yaw.cos(),
                ]
            });
            if cycle == 3 {
                begun = Some(world);
            }
            let Some(begun) = begun else { continue };
            for (leg, plan) in stood.iter().enumerate() {
                if *plan == LegPlan::Stance {
                    let off = (world[leg][0] - begun[leg][0]).hypot(world[leg][1] - begun[leg][1]);
                    assert!(off < 2.5e-3, "{after}, leg {leg}, cycle {cycle}: {off}");
                }
            }
        }
        assert!(pose[2] > 0.01, "it went on to turn: {pose:?}");
    }
}

#[test]
fn a_stalled_walk_answers_the_ground_for_5_s_and_then_nothing_moves() {
    for wakes in [false, true] {
        let mut walker = Walker::new(order(120, "0"), 317);
        walker.stall(GIVEN_UP + 1);
        assert!(walker.held(HoldReason::LayerOneStalled));
        if wakes {
            walker.wake();
        }
        walker.run(ENDS - 30);
        assert!(!walker.held(HoldReason::LayerOneGone));
        walker.ground_mm = [GROUND_MM + 12.0; 2];
        walker.run(20);
        let follows = walker.strokes_mm()[2];
        assert!(follows > GROUND_MM + 5.0, "to the last: {follows}");
        walker.run(20);
        assert!(walker.held(HoldReason::LayerOneGone));
        let modes: Vec<NodeMode> = walker.rig.nodes.iter().map(|node| node.mode).collect();
        assert_eq!(modes, [NodeMode::Hold; 8]);
        walker.ground_mm = [179.0; 2];
        walker.stays(200, "afterwards");
    }
}

#[test]
fn no_walk_goes_on_after_a_clear_and_an_arming() {
    // Layer 1 misses a stop, the clear and the arming, and wakes before it is given up.
    for later in 0..4 {
        let mut walker = Walker::new(order(120, "0"), 300);
        walker.stall(1);
        walker.rig.submit(Command::EmergencyStop);
        walker.run(1);
        let clear = walker.rig.submit(Command::ClearFault);
        while !walker.rig.done(clear) {
            walker.run(1);
        }
        let arm = walker.rig.submit(Command::Arm);
        while !walker.rig.done(arm) {
            walker.run(1);
        }
        assert!(!walker.held(HoldReason::LayerOneStalled), "quick enough");
        let (strokes, wheels) = (walker.strokes_mm(), walker.wheels());
        walker.run(later);
        walker.wake();
        walker.run(60);
        assert_eq!(walker.strokes_mm(), strokes, "{later}");
        assert_eq!(walker.wheels(), wheels, "{later}");
        let record = walker.rig.last_record.unwrap();
        assert_eq!((record.phase, record.walk), (Phase::Idle, None));
        assert!(walker.rig.master.is_armed(), "{later}");
        // And it can be ordered again.
        walker.rig.submit(Command::Walk(order(120, "0")));
        walker.run(60);
        assert!(walker.wheels()[0] > wheels[0] + 1000);
    }
}

fn asks(walker: &mut Walker, command: Command) {
    walker.rig.submit(command);
}

/// A stop: its name, its trigger, and the reported reason.
type Stop = (&'static str, fn(&mut Walker), Option<HoldReason>);

/// Causes that can stop a robot whose layer 1 has stopped.
const STOPS: [Stop; 8] = [
    (
        "E-stop",
        |w| asks(w, Command::EmergencyStop),
        Some(HoldReason::EmergencyStop),
    ),
    ("disarm", |w| asks(w, Command::Disarm), None),
    (
        "link loss",
        |w| w.rig.node(2).silent = true,
        Some(HoldReason::NodeLost(2)),
    ),
    (
        "fault of a board",
        |w| w.rig.node(5).faults = FaultBits::from_raw(1 << 8),
        Some(HoldReason::NodeFault {
            node: 5,
            faults: 1 << 8,
        }),
    ),
    (
        "restart of a board",
        |w| w.rig.node(4).mode = NodeMode::Idle,
        Some(HoldReason::NodeDisarmed(4)),
    ),
    (
        "air lost",
        |w| w.rig.node(7).inputs = InputBits::NONE,
        Some(HoldReason::SupplyLost),
    ),
    (
        "brake of an axis",
        |w| asks(w, Command::EmergencyBrake { joint: 3 }),
        None,
    ),
    (
        "hold",
        |w| asks(w, Command::Hold),
        Some(HoldReason::LayerOneGone),
    ),
];

#[test]
fn every_stop_stops_a_walk_without_layer_1_and_a_layer_1_that_wakes_moves_nothing() {
    for (name, stop, reason) in STOPS {
        // Before layer 1 is given up, while slowing down, and when the robot stands.
        for cycles in [4, GIVEN_UP + 12, 130] {
            for wakes in [false, true] {
                let why = format!("{name} {cycles} cycles after the stall, wakes {wakes}");
                let mut walker = Walker::new(order(120, "0.03"), 311);
                walker.stall(cycles);
                stop(&mut walker);
                // Three cycles until a board counts as missing, and some until the request for a hold is found.
                walker.run(GIVEN_UP + 2);
                if wakes {
                    walker.wake();
                }
                let reason_told = reason.is_none_or(|reason| walker.held(reason));
                assert!(reason_told, "{why}: {:?}", walker.rig.events);
                walker.run(10);
                walker.ground_mm = [179.0; 2];
                walker.stays(60, &why);
            }
        }
    }
}

#[test]
fn the_operators_absence_stops_a_walk_without_layer_1() {
    for cycles in [4, GIVEN_UP + 12, 130] {
        let mut walker = Walker::new(order(120, "0"), 311);
        let take = Request {
            client: OPERATOR_CLIENT,
            id: 1,
            deadline_us: walker.rig.now_us + 1_000_000,
            command: Command::TakeControl,
        };
        let now_us = walker.rig.now_us;
        walker
            .rig
            .master
            .submit_request(take, now_us)
            .expect("free");
        walker.run(2);
        for _ in 0..cycles {
            walker.rig.master.set_layer1_enabled(false);
            let now_us = walker.rig.now_us;
            walker.rig.master.beat(now_us - CYCLE_US, now_us);
            walker.run(1);
        }
        walker.run(60);
        assert!(walker.held(HoldReason::OperatorLost), "{cycles}");
        walker.ground_mm = [179.0; 2];
        walker.stays(60, "operator");
    }
}

#[test]
fn a_walk_that_stops_or_backs_off_when_layer_1_stalls_comes_to_its_stand() {
    for stuck in [false, true] {
        for after in [5, 20, 40] {
            let mut walker = Walker::new(order(120, "0"), 305);
            if stuck {
                walker.rig.submit(Command::SetBehaviours(Behaviours::ALL));
                // A wheel at full torque that does not turn.
                for wheel in [7, 8] {
                    walker.rig.node(wheel).rate = 0;
                }
                walker.run(330);
                let backs_off = Event::Behaviour(Act::BackOff);
                assert!(walker.rig.saw(|event| *event == backs_off));
                for wheel in [7, 8] {
                    walker.rig.node(wheel).rate = 5_000;
                }
            } else {
                walker.rig.submit(Command::StopGait);
            }
            walker.run(after);
            if walker.rig.last_record.unwrap().walk.is_none() {
                continue;
            }
            walker.stall(GIVEN_UP + 2);
            walker.wake();
            walker.run(150);
            assert!(walker.held(HoldReason::LayerOneStalled));
            let wheels = walker.wheels();
            walker.run(50);
            assert_eq!(walker.wheels(), wheels, "stuck {stuck}, {after}");
            let strokes = walker.strokes_mm();
            assert!(strokes[2] >= GROUND_MM && strokes[5] >= GROUND_MM);
        }
    }
}

#[test]
fn commands_to_a_layer_1_that_was_given_up_are_answered() {
    let mut walker = Walker::new(order(120, "0"), 300);
    walker.stall(5);
    // It waits for a layer 1 that never takes it, and is answered when layer 1 is given up.
    let before = walker.rig.submit(Command::StopGait);
    walker.run(10);
    assert_eq!(walker.rig.refusal(before), Some(Refusal::Latched));
    let after = walker.rig.submit(Command::Walk(order(60, "0")));
    walker.run(2);
    assert_eq!(walker.rig.refusal(after), Some(Refusal::Latched));
    let hold = walker.rig.submit(Command::Hold);
    walker.run(2);
    assert!(walker.rig.done(hold));
    walker.stays(20, "held");
}

/// Reference of the left wheel, counts.
fn led(sync: &Sync) -> i32 {
    let wheel = sync.slots.wheel(Address::wheel(7).unwrap()).unwrap();
    wheel.reference.get()
}

#[test]
fn wheels_go_on_evenly_when_layer_1_comes_back_after_missing_some_cycles() {
    for missed in 0..GIVEN_UP {
        let mut walker = Walker::new(order(100, "0"), 305);
        let mut before = led(&walker.cycle());
        // 100 mm/s are 110.3 counts in a cycle.
        let mut step = |walker: &mut Walker, what: &str| {
            let now = led(&walker.cycle());
            let step = now - before;
            before = now;
            assert!(
                (106..=115).contains(&step),
                "{missed} missed, {what}: {step}"
            );
        };
        walker.rig.master.set_layer1_enabled(false);
        for _ in 0..missed {
            step(&mut walker, "without");
        }
        walker.wake();
        for _ in 0..30 {
            step(&mut walker, "back");
        }
        assert!(walker.rig.master.is_armed());
    }
}

#[test]
fn feet_lose_nothing_when_layer_1_misses_the_cycle_of_an_act() {
    // The foot of a reach runs against something in a cycle that layer 1 misses.
    for missed in 1..GIVEN_UP {
        let mut walker = Walker::new(order(85, "0"), 300);
        let reaches = |walker: &Walker| {
            let legs = walker.rig.last_record.unwrap().walk.unwrap().legs;
            legs[0] == LegPlan::Reach
        };
        // A reach that makes hardly any progress.
        while !reaches(&walker) {
            walker.run(1);
        }
        for joint in [1, 2] {
            walker.rig.node(joint).rate = 0;
        }
        let lift_mm = |walker: &mut Walker| {
            let sync = walker.cycle();
            let slot = sync.slots.joint(Address::joint(3).unwrap()).unwrap();
            PositionMm::to_f64(slot.reference)
        };
        let before = lift_mm(&mut walker);
        let bump = Event::Behaviour(Act::Bump(Side::Left));
        let mut cycles = 0;
        while !walker.rig.saw(|event| *event == bump) {
            // Layer 1 is absent in the cycle of the bump, whenever that is.
            walker
                .rig
                .master
                .set_layer1_enabled(cycles % missed == 0 && cycles < 30);
            if cycles >= 30 {
                walker.rig.master.set_layer1_enabled(false);
            }
            walker.run(1);
            cycles += 1;
            assert!(cycles < 60, "it runs against something");
        }
        walker.wake();
        assert!(walker.rig.master.is_armed(), "{missed}");
        walker.run(2);
        let after = lift_mm(&mut walker);
        assert!(
            before - after > 39.0,
            "{missed}: lifted from {before} to {after}"
        );
    }
}

#[test]
fn a_landing_that_layer_1_misses_is_kept() {
    for missed in 1..GIVEN_UP {
        let mut walker = Walker::new(order(100, "0"), 300);
        let lowers = |walker: &Walker| {
            let legs = walker.rig.last_record.unwrap().walk.unwrap().legs;
            matches!(legs[0], LegPlan::Lower(_)) && walker.strokes_mm()[2] > GROUND_MM - 3.0
        };
        while !lowers(&walker) {
            walker.run(1);
        }
        walker.stall(missed);
        walker.wake();
        let mut least = 180.0_f64;
        for _ in 0..12 {
            walker.run(1);
            least = least.min(walker.strokes_mm()[2]);
        }
        assert!(least > GROUND_MM - 3.0, "{missed}: back up to {least}");
    }
}

#[test]
fn a_leg_whose_reply_is_missed_goes_with_the_ground_all_the_same() {
    let reference = |silent: bool| {
        let mut walker = Walker::new(order(100, "0"), 305);
        let stands = |walker: &Walker| {
            walker.rig.last_record.unwrap().walk.unwrap().legs == [LegPlan::Stance; 2]
        };
        while !stands(&walker) {
            walker.run(1);
        }
        walker.rig.node(2).silent = silent;
        walker.run(2);
        walker.rig.node(2).silent = false;
        let sync = walker.cycle();
        let slot = sync.slots.joint(Address::joint(2).unwrap()).unwrap();
        PositionMm::to_f64(slot.reference)
    };
    let off = reference(true) - reference(false);
    assert!(off.abs() < 0.1, "two cycles of 1 mm missed: {off}");
}
