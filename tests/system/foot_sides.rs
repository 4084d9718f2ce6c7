//! One side of a foot on a ledge: the same side on the ground, in the node and in the master.

use std::ops::ControlFlow;

use wheeleg_config::{Scenario, builtin};
use wheeleg_master::contact::{Sector, Side};
use wheeleg_master::event::Event as MasterEvent;
use wheeleg_plant::terrain::{Shape, Solid, Surface, Terrain};
use wheeleg_sim as sil;
use wheeleg_telemetry::{Cause, Recorder, Recording};

/// A side of a foot: its name in scenarios, its bit in the log, and the master's name for it.
type FootSide = (&'static str, u8, Sector);

/// All sides, in the order of their bits.
const SIDES: [FootSide; 4] = [
    ("front", 1, Sector::Front),
    ("back", 2, Sector::Rear),
    ("left", 4, Sector::Left),
    ("right", 8, Sector::Right),
];

/// A foot that is longer off the ground than this has been lifted, not shaken.
const LIFTED_NS: u64 = 200_000_000;

/// From the first to the last of the three samples that a node's debounce asks for.
const DEBOUNCE_NS: u64 = 2_000_000;

fn run(scenario: &Scenario) -> Recording {
    let robot = builtin::robot(&scenario.robot).expect("the robot is built in");
    let mut recorder = Recorder::in_memory();
    let go_on = &mut |_| ControlFlow::Continue(());
    let outcome = sil::run(scenario, &robot, scenario.seed, &mut recorder, go_on);
    let outcome = outcome.expect("the run is within the plant's range");
    assert!((outcome.recorded_s - scenario.duration_s).abs() < 1e-6);
    recorder.finish().expect("nothing is written")
}

fn scenario(side: &str) -> Scenario {
    builtin::scenario(&format!("foot-side-{side}")).expect("the scenario is built in")
}

/// Time and switches of a foot's first sensed contact after a lift.
fn touchdown(recording: &Recording, foot: usize) -> (u64, u8) {
    let mut open_since = None;
    for row in &recording.feet[foot] {
        match (row.v.switches, open_since) {
            (0, None) => open_since = Some(row.t_ns),
            (0, Some(_)) => {}
            (switches, Some(since)) if row.t_ns - since > LIFTED_NS => {
                return (row.t_ns, switches);
            }
            _ => open_since = None,
        }
    }
    panic!("the foot is not lifted and put down");
}

/// The first touch of a foot at or after a time as the ground makes it: time and switches closed,
/// in the order front, left, back, right.
fn ground_touch(recording: &Recording, foot: Side, from_ns: u64) -> (u64, [bool; 4]) {
    let later = recording.events.iter().filter(|e| e.t_ns >= from_ns);
    let mut touches = later.filter_map(|e| match e.v.cause {
        Cause::Contact { side, switches } if side == foot && switches.contains(&true) => {
            Some((e.t_ns, switches))
        }
        _ => None,
    });
    touches.next().expect("the foot touches the ground")
}

/// The first touch of a foot at or after a time as the master reports it.
fn reported_touch(recording: &Recording, foot: Side, from_ns: u64) -> (u64, Option<Sector>) {
    let later = recording.events.iter().filter(|e| e.t_ns >= from_ns);
    let mut touches = later.filter_map(|e| match e.v.cause {
        Cause::Master(MasterEvent::TouchDown { side, sector }) if side == foot => {
            Some((e.t_ns, sector))
        }
        _ => None,
    });
    touches.next().expect("the master reports a touch")
}

/// The same blocks on the other foot's track, 0.40 m to the right.
fn beside(terrain: &Terrain) -> Terrain {
    let mut terrain = terrain.clone();
    for part in &mut terrain.parts {
        if let Shape::Solid(block) = &part.shape {
            let [[x1, y1], _, [x0, y0], _] = block.outline_m();
            let middle = [0.5 * (x0 + x1), 0.5 * (y0 + y1) - 0.40];
            let half = [0.5 * (x1 - x0), 0.5 * (y1 - y0)];
            let upright = [-1.0, block.top_m()];
            part.shape = Shape::Solid(Solid::block(middle, half, 0.0, upright));
        }
    }
    terrain
}

/// Holds one run against the side on which its foot must touch.
fn assert_side(recording: &Recording, foot: usize, (side, bit, sector): FootSide) {
    let leg = [Side::Left, Side::Right][foot];
    let (sensed_ns, switches) = touchdown(recording, foot);
    assert_eq!(
        switches, bit,
        "{leg:?} foot, {side}: sensed at first contact"
    );

    // The physical truth: the node follows when the level has been stable for its debounce, of which the last
    // sample counts.
    let (ground_ns, closed) = ground_touch(recording, leg, sensed_ns - 5_000_000);
    let alone = ["front", "left", "back", "right"].map(|name| name == side);
    assert_eq!(closed, alone, "{leg:?} foot, {side}");
    let lag_ns = sensed_ns.abs_diff(ground_ns);
    assert_eq!(lag_ns, DEBOUNCE_NS, "{leg:?} foot, {side}");

    // The master's conclusion from the replies of the next cycles.
    let (master_ns, reported) = reported_touch(recording, leg, sensed_ns);
    assert_eq!(reported, Some(sector), "{leg:?} foot, {side}");
    let late_ns = master_ns - sensed_ns;
    assert!(late_ns <= 30_000_000, "{side}: reported {late_ns} ns late");

    // The foot is carried there, and the side across from the ledge stays in the air.
    let across = if bit & 0b0011 != 0 {
        bit ^ 0b0011
    } else {
        bit ^ 0b1100
    };
    let after =
        |row: &&wheeleg_telemetry::Row<_>| (sensed_ns..sensed_ns + 100_000_000).contains(&row.t_ns);
    let rows: Vec<_> = recording.feet[foot].iter().filter(after).collect();
    assert!(
        rows.iter().all(|row| row.v.switches & across == 0),
        "{side}"
    );
    let heaviest = rows
        .iter()
        .map(|row| row.v.normal_force_n)
        .fold(0.0, f64::max);
    assert!(heaviest > 5.0, "{side}: {heaviest} N");
    assert!(rows.iter().all(|row| row.v.clearance_mm < 1.0), "{side}");
}

#[test]
fn each_side_of_the_left_foot_is_felt_as_that_side() {
    for side in SIDES {
        let scenario = scenario(side.0);
        let recording = run(&scenario);
        assert_side(&recording, 0, side);
    }
}

/// The right leg is the mirror image of the left, its board's inputs are not: left and right
/// must not change places on the way.
#[test]
fn each_side_of_the_right_foot_is_felt_as_that_side() {
    for side in SIDES {
        let mut scenario = scenario(side.0);
        scenario.motion = wheeleg_config::Motion::SquareWave {
            leg: wheeleg_config::LegChoice::Right,
        };
        // The right foot comes down where the left one would, less the track of the feet.
        scenario.ground.terrain = beside(&scenario.ground.terrain);
        let recording = run(&scenario);
        assert_side(&recording, 1, side);
    }
}

/// Without the ledge the same foot comes down later, and on its whole sole.
#[test]
fn without_the_ledge_the_foot_comes_down_flat_and_later() {
    let mut scenario = scenario("left");
    let (ledge_ns, _) = touchdown(&run(&scenario), 0);
    scenario.ground = wheeleg_config::terrain::Ground::default();
    let recording = run(&scenario);
    let (flat_ns, _) = touchdown(&recording, 0);
    assert!(flat_ns > ledge_ns + 30_000_000, "{flat_ns} {ledge_ns}");
    let flat = recording.feet[0]
        .iter()
        .find(|row| row.t_ns >= flat_ns && row.v.switches == 15)
        .map(|row| row.t_ns - flat_ns);
    let soon = flat.is_some_and(|ns| ns < 100_000_000);
    assert!(soon, "four switches {flat:?} ns after touchdown");
}
