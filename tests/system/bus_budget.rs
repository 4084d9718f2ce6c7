//! The traffic on the simulated line against the budget that the protocol
//! computes at compile time.

use crate::sil::{gait, range, robot, run, stand, window};
use wheeleg_config::{EventAction, LegChoice};
use wheeleg_master::command::{Command, CommandCode};
use wheeleg_master::event::Event as MasterEvent;
use wheeleg_protocol::link::{BAUD, CYCLE_US, CYCLIC_SHARE_PERMILLE, GAP_US, TURNAROUND_US};
use wheeleg_protocol::{Message, MessageType, NODES};
use wheeleg_telemetry::event::{Answer, Cause};
use wheeleg_telemetry::{BusSample, Recording, Row};

/// Per mille of the cycle in which the line is silent between the cyclic frames,
/// because the budget keeps it free: the turnaround and a gap for each slot.
fn silent_permille() -> f64 {
    let silent_us = f64::from(TURNAROUND_US) + f64::from(GAP_US) * NODES as f64;
    1000.0 * silent_us / f64::from(CYCLE_US)
}

/// No two boards spoke at once, and none was late or silent: a collision destroys both frames, and then a
/// reply or its checksum is missing.
fn assert_orderly(recording: &Recording) {
    for row in &recording.bus {
        assert_eq!(usize::from(row.v.replies), NODES, "cycle {}", row.v.cycle);
        assert_eq!(row.v.errors, 0, "cycle {}", row.v.cycle);
        assert_eq!(row.v.collisions, 0, "cycle {}", row.v.cycle);
    }
    let last = &recording.master[recording.master.len() - 1].v;
    assert!(last.alive);
    assert_eq!(last.fifo_drops, 0);
    let faults = recording
        .joints
        .iter()
        .map(|rows| rows[rows.len() - 1].v.faults);
    assert_eq!(faults.sum::<u32>(), 0);
}

#[test]
fn robot_and_protocol_mean_the_same_line() {
    let bus = robot().bus;
    assert!((bus.baud_bit_s - f64::from(BAUD)).abs() < 1e-6);
    assert!((bus.cycle_s * 1e6 - f64::from(CYCLE_US)).abs() < 1e-6);
}

#[test]
fn cyclic_share_on_the_line_is_the_one_computed_at_compile_time() {
    // Standing: the only acyclic traffic is the master's own questions about the logs, at most one of them
    // and its answer in some cycles.
    let recording = run(&stand(2.0, &[]), &robot(), 1);
    assert_orderly(&recording);
    assert!(
        (199..=201).contains(&recording.bus.len()),
        "one sample per cycle"
    );
    let frames = Message::encoded_len(MessageType::Sync)
        + NODES * Message::encoded_len(MessageType::SlotReply);
    let budget = f64::from(CYCLIC_SHARE_PERMILLE);
    let (cyclic, asking): (Vec<_>, Vec<_>) =
        (recording.bus.iter()).partition(|row| row.v.bytes as usize == frames);
    assert!(
        (1..=20).contains(&asking.len()),
        "{} of {}",
        asking.len(),
        recording.bus.len()
    );
    for row in &asking {
        assert!(
            row.v.bytes as usize > frames && row.v.load < 0.45,
            "{row:?}"
        );
    }
    for row in cyclic {
        let share = 1000.0 * row.v.load + silent_permille();
        assert!(
            (share - budget).abs() < 0.01 * budget,
            "cycle {}: {share} against {budget} per mille",
            row.v.cycle
        );
    }
    // Cycle numbers follow each other, without a hole.
    for pair in recording.bus.windows(2) {
        assert_eq!(pair[1].v.cycle, pair[0].v.cycle + 1);
    }
}

#[test]
fn every_node_replies_in_every_cycle_of_the_gait() {
    let recording = run(&gait(LegChoice::Left, 10.0, &[]), &robot(), 1);
    assert_orderly(&recording);
    assert!((999..=1001).contains(&recording.bus.len()));
    let (low, high) = range(&recording.bus, |s| s.load);
    assert!(low > 0.33 && high < 0.70, "load {low} … {high}");
}

/// An operator who sends requests all the time: they fit beside the cyclic traffic, and nearly a third of the
/// line stays free.
#[test]
fn requests_leave_thirty_per_cent_free() {
    let events: Vec<_> = (0..200_u8)
        .map(|i| {
            let at_s = 0.5 + 0.005 * f64::from(i);
            (
                at_s,
                EventAction::Command(Command::TransmitPosition { joint: 1 + i % 6 }),
            )
        })
        .collect();
    let recording = run(&gait(LegChoice::Left, 2.0, &events), &robot(), 1);
    assert_orderly(&recording);
    let mean =
        |rows: &[Row<BusSample>]| rows.iter().map(|r| r.v.load).sum::<f64>() / rows.len() as f64;
    let quiet = mean(window(&recording.bus, 0.1, 0.45));
    let busy = window(&recording.bus, 0.6, 1.4);
    let mean = mean(busy);
    assert!(
        mean > quiet + 0.02,
        "requests cost line time: {mean} against {quiet}"
    );
    let most = range(busy, |s| s.load).1 + silent_permille() / 1000.0;
    assert!(most < 0.70, "busiest cycle {most}");
    let count = |is: fn(&Cause) -> bool| {
        let events = recording.events.iter();
        events.filter(|r| is(&r.v.cause)).count()
    };
    // Every request is answered, once.
    let accepted = count(|cause| {
        let (code, answer) = (CommandCode::TransmitPosition, Answer::Accepted);
        *cause == Cause::Command { code, answer }
    });
    assert_eq!(accepted, events.len());
    let told = count(|cause| matches!(cause, Cause::Master(MasterEvent::Position { .. })));
    assert_eq!(told, events.len());
    assert_eq!(count(Cause::is_refusal), 0);
}
