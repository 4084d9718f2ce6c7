//! Restarts of master, boards and the user's program, in every order, while the robot walks: all return
//! within a second, disarmed, and nothing moves until the user commands it.

use crate::sil::{at, energised, gait, range, robot, run, stand, story, window};
use wheeleg_config::{EventAction, LegChoice};
use wheeleg_master::command::Command;
use wheeleg_master::event::Event as MasterEvent;
use wheeleg_remote_host::Nodes;
use wheeleg_telemetry::{Cause, JointSample, Recording, Row};

/// The wheels push, the horizontal cylinder moves.
const FIRST_S: f64 = 2.5;
/// Everybody is back, and the user may arm again.
const RECOVERED_S: f64 = 1.0;
const BOARDS: [&str; 8] = [
    "joint1", "joint2", "joint3", "joint4", "joint5", "joint6", "wheel7", "wheel8",
];
/// Armed and tracking.
const DRIVING: [u8; 2] = [2, 3];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Who {
    Master,
    Boards,
    Client,
}

impl Who {
    fn faults(self, at_s: f64) -> Vec<String> {
        match self {
            Self::Master => vec![format!("master-reset=30@{at_s}s")],
            Self::Boards => BOARDS.map(|b| format!("brown-out:{b}=30@{at_s}s")).to_vec(),
            Self::Client => vec![format!("client-reset@{at_s}s")],
        }
    }
}

fn orders() -> Vec<[Who; 3]> {
    let all = [Who::Master, Who::Boards, Who::Client];
    let mut orders = Vec::new();
    for a in all {
        for b in all {
            for c in all {
                if a != b && b != c && a != c {
                    orders.push([a, b, c]);
                }
            }
        }
    }
    orders
}

/// Restarts in `order`, `gap_s` apart; a second after the last the user clears and arms.
fn restart(order: [Who; 3], gap_s: f64) -> (Recording, f64) {
    let last_s = FIRST_S + 2.0 * gap_s;
    let armed_s = last_s + RECOVERED_S;
    let events = [
        (armed_s - 0.1, EventAction::ClearFault),
        (armed_s, EventAction::Command(Command::Arm)),
    ];
    let mut scenario = gait(LegChoice::Left, armed_s + 0.5, &events);
    for (i, who) in order.into_iter().enumerate() {
        for text in who.faults(FIRST_S + gap_s * i as f64) {
            scenario.faults.push(text.parse().expect("a fault"));
        }
    }
    wheeleg_sim::faults::check(&scenario, &robot(), &Nodes::default()).expect("faults that can be");
    (run(&scenario, &robot(), 1), last_s)
}

#[test]
fn every_order_of_restarts_recovers_disarmed_within_a_second() {
    assert_eq!(orders().len(), 6);
    for order in orders() {
        for gap_s in [0.0, 0.012, 0.2] {
            let (recording, last_s) = restart(order, gap_s);
            let told = story(&recording);
            let what = format!("{order:?}, {gap_s} s apart\n{told}");
            let armed_s = last_s + RECOVERED_S;

            // All walked before; then no one drives until the user arms.
            let safe_s = last_s + 0.1;
            for (i, rows) in recording.joints.iter().enumerate() {
                assert_eq!(at(rows, FIRST_S).mode, 3, "{what}");
                for row in window(rows, safe_s, armed_s) {
                    let still = !DRIVING.contains(&row.v.mode) && !energised(&row.v);
                    assert!(still, "joint {} at {} s; {what}", i + 1, row.t_s());
                }
            }
            for rows in &recording.wheels {
                assert_eq!(at(rows, FIRST_S).mode, 3, "{what}");
                let rest = window(rows, safe_s, armed_s);
                assert!(rest.iter().all(|r| !DRIVING.contains(&r.v.mode)), "{what}");
                let (low, high) = range(window(rows, last_s + 0.6, armed_s), |s| s.velocity_mm_s);
                assert!(
                    low > -5.0 && high < 5.0,
                    "a wheel turns: {low} … {high}; {what}"
                );
            }

            // A second later the robot arms where it stands, and stays there.
            let mut events = recording.events.iter();
            let armed = events
                .any(|e| e.t_s() >= armed_s && e.v.cause == Cause::Master(MasterEvent::Armed));
            assert!(armed, "{what}");
            for (i, rows) in recording.joints.iter().enumerate() {
                let after = window(rows, armed_s + 0.2, f64::INFINITY);
                let armed = after.iter().all(|r| r.v.mode == 2 && r.v.faults == 0);
                assert!(armed, "joint {}; {what}", i + 1);
                let (low, high) = range(after, |s| s.reference_mm - s.sensed_mm);
                assert!(
                    low > -3.0 && high < 3.0,
                    "joint {}: {low} … {high}; {what}",
                    i + 1
                );
            }
        }
    }
}

/// After five and a half minutes the counter of SYNC is past half of its range, and a new master
/// counts from 1.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn a_master_that_starts_again_after_minutes_is_noticed_as_well() {
    let mut scenario = stand(331.5, &[]);
    let fault = "master-reset=30@331s";
    scenario.faults.push(fault.parse().expect("a fault"));
    let recording = run(&scenario, &robot(), 1);
    let told = story(&recording);
    for rows in &recording.joints {
        assert!(DRIVING.contains(&at(rows, 330.9).mode), "{told}");
        let after = window(rows, 331.0 + 0.06 + 0.03, f64::INFINITY);
        let safe = |r: &Row<JointSample>| !DRIVING.contains(&r.v.mode) && !energised(&r.v);
        assert!(after.iter().all(safe), "{told}");
    }
    for rows in &recording.wheels {
        let after = window(rows, 331.0 + 0.06 + 0.03, f64::INFINITY);
        assert!(after.iter().all(|r| !DRIVING.contains(&r.v.mode)), "{told}");
    }
    assert!(told.contains("cycle counter does not advance"), "{told}");
}

/// The user's program may restart alone: the robot continues, and listens to it.
#[test]
fn a_client_that_comes_back_is_heard_and_nothing_else_happens() {
    let events = [(3.0, EventAction::Command(Command::Hold))];
    let mut scenario = gait(LegChoice::Left, 3.5, &events);
    scenario
        .faults
        .push("client-reset@2.5s".parse().expect("a fault"));
    let recording = run(&scenario, &robot(), 1);
    let told = story(&recording);
    assert!(told.contains("Hold: accepted"), "{told}");
    let walks = window(&recording.joints[1], 2.4, 3.0);
    assert!(walks.iter().all(|r| r.v.mode == 3), "{told}");
}
