//! Same scenario, robot and seed: the same telemetry, bit for bit; any difference in them changes it.

mod sil;

use std::sync::{Mutex, PoisonError};
use std::thread;

use sil::{gait, robot, run};
use wheeleg_config::{EventAction, LegChoice, RobotConfig, Scenario, builtin};
use wheeleg_master::command::Command;
use wheeleg_plant::robot::{Inputs, Plant, PlantParams, PlantState};

/// A run with everything in it that could be left to chance: motion, contact,
/// requests on the bus, a loss of the master, a staged exhaust.
fn eventful() -> Scenario {
    let events = [
        (
            0.4,
            EventAction::Command(Command::TransmitPosition { joint: 5 }),
        ),
        (4.0, EventAction::KillMaster),
    ];
    gait(LegChoice::Left, 5.0, &events)
}

fn hash(scenario: &Scenario, robot: &RobotConfig, seed: u64) -> String {
    let recording = run(scenario, robot, seed);
    assert!(
        recording.messages > 10_000,
        "{} messages",
        recording.messages
    );
    assert_eq!(recording.hash.len(), 64);
    recording.hash
}

#[test]
fn the_same_run_has_the_same_hash() {
    let (scenario, robot) = (eventful(), robot());
    let first = hash(&scenario, &robot, 7);
    assert_eq!(first, hash(&scenario, &robot, 7));
    // Files read again, not values kept.
    assert_eq!(first, hash(&eventful(), &sil::robot(), 7));
}

#[test]
fn another_seed_or_robot_or_event_has_another_hash() {
    let (scenario, robot) = (eventful(), robot());
    let mut seen = vec![hash(&scenario, &robot, 7)];
    let mut add = |what: &str, hash: String| {
        assert!(!seen.contains(&hash), "{what} makes no difference");
        seen.push(hash);
    };
    add("the seed", hash(&scenario, &robot, 8));
    // A parameter of a moving cylinder, changed by a millionth still shows, through the state's fingerprint.
    let mut other = robot.clone();
    other.plant.cylinders[2].friction.coulomb_n *= 1.0 + 1e-6;
    add("friction", hash(&scenario, &other, 7));
    let mut later = scenario.clone();
    later.events[1].at_s += 0.001;
    add("the time of an event", hash(&later, &robot, 7));
    let mut plain = scenario;
    plain.events.remove(0);
    add("a request", hash(&plain, &robot, 7));
}

/// One test at a time has another working directory.
static FOLDER: Mutex<()> = Mutex::new(());

/// Does something in an empty folder, which must stay empty.
fn in_another_folder<T>(work: impl FnOnce() -> T) -> T {
    let _alone = FOLDER.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let before = std::env::current_dir().expect("a working directory");
    // Nothing else in this program looks at the working directory.
    std::env::set_current_dir(folder.path()).expect("the folder exists");
    let done = work();
    std::env::set_current_dir(before).expect("the folder is still there");
    let left = std::fs::read_dir(folder.path()).expect("readable").count();
    assert_eq!(left, 0, "a run in memory writes no file");
    done
}

#[test]
fn thread_and_working_directory_make_no_difference() {
    let here = hash(&eventful(), &robot(), 7);
    let hashes = in_another_folder(|| {
        let threads: Vec<_> = (0..2)
            .map(|_| thread::spawn(|| hash(&eventful(), &robot(), 7)))
            .collect();
        let joined = threads.into_iter().map(|t| t.join().expect("the run ends"));
        joined.collect::<Vec<String>>()
    });
    assert_eq!(hashes, [here.clone(), here]);
}

/// A walk on rocks, where contacts come and go by the hundred: the same in two folders, on one
/// thread and on two at a time; other rocks make another run.
#[test]
fn a_walk_on_rocks_is_the_same_in_any_folder_on_one_thread_or_two() {
    let walk = |seed: u64| {
        let mut scenario = builtin::scenario_on_ground("rocks-20", seed).expect("built in");
        // The feet are on the rocks after 6 s, the wheels after 10 s.
        scenario.duration_s = 12.0;
        let robot = builtin::robot_of(&scenario, "rocks-20").expect("built in");
        hash(&scenario, &robot, 1)
    };
    let here = walk(1);
    let there = in_another_folder(|| {
        let threads: Vec<_> = (0..2).map(|_| thread::spawn(move || walk(1))).collect();
        threads
            .into_iter()
            .map(|t| t.join().expect("the run ends"))
            .collect::<Vec<String>>()
    });
    assert_eq!(there, [here.clone(), here.clone()]);
    assert_ne!(here, walk(2), "the seed of the rocks makes no difference");
}

/// Valve and motor commands for one tick, different in every tick.
fn commands(tick: u64) -> Inputs {
    // A linear congruential generator (Knuth, MMIX) on the tick number.
    let mut x = tick;
    let mut next = |below: u64| {
        x = x
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (x >> 33) % below
    };
    let mut inputs = Inputs {
        bridge_enabled: [true; 2],
        dump: tick % 701 > 650,
        ..Inputs::default()
    };
    for joint in &mut inputs.valve_on_us {
        for on_us in joint {
            *on_us = if next(4) == 0 { next(1001) as u16 } else { 0 };
        }
    }
    for duty in &mut inputs.bridge_duty {
        *duty = next(401) as f64 / 200.0 - 1.0;
    }
    inputs
}

/// The robot of the file in the pose in which the gait starts.
fn standing() -> PlantParams {
    let robot = robot();
    let gait = robot.gait;
    let mut plant = robot.plant;
    plant.initial_stroke_m = [
        gait.yaw_s2_m,
        0.0,
        gait.stroke_m,
        gait.yaw_s2_m,
        gait.held_leg_s5_m,
        gait.held_leg_s6_m,
    ];
    plant
}

fn go_on(plant: &Plant, state: &mut PlantState, ticks: std::ops::Range<u64>) -> Vec<[u8; 32]> {
    ticks
        .map(|tick| {
            let codes: u64 = (0..6)
                .map(|joint| u64::from(plant.read_position(state, joint)))
                .sum();
            assert!(codes > 0);
            plant.tick(state, &commands(tick)).expect("in range");
            plant.state_hash(state)
        })
        .collect()
}

/// A state saved in mid-motion, with the sensors' random streams in it, continues exactly as if it had never
/// been saved.
#[test]
fn a_saved_state_goes_on_identically() {
    let plant = Plant::new(&standing()).expect("valid");
    let mut state = plant.initial_state(3).expect("it stands");
    let before = go_on(&plant, &mut state, 0..300);
    let distinct: std::collections::BTreeSet<_> = before.iter().collect();
    assert_eq!(distinct.len(), before.len(), "every tick changes the state");
    assert!(
        plant.outputs(&state).velocity_m_s[0].abs() > 1e-4,
        "in motion"
    );

    let saved = state.clone();
    let unbroken = go_on(&plant, &mut state, 300..600);

    // By another model built from the same parameters.
    let again = Plant::new(&standing()).expect("valid");
    let mut restored = saved.clone();
    assert_eq!(again.state_hash(&restored), before[299]);
    assert_eq!(go_on(&again, &mut restored, 300..600), unbroken);
    assert_eq!(restored, state);

    // Without one of its parts it would not: the sensors' streams, …
    let mut other = saved.clone();
    let _ = again.read_position(&mut other, 4);
    assert_ne!(go_on(&again, &mut other, 300..301)[0], unbroken[0]);
    // … the air in a line, a valve on its way.
    let mut other = saved;
    other.core.cylinders.swap(0, 3);
    assert_ne!(go_on(&again, &mut other, 300..301)[0], unbroken[0]);
}
