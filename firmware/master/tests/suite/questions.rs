//! The master's own questions, and its reports about boards and line: causes of faults and restarts, link
//! counters, logs, commissioned boards, babble.

use crate::common::{NO_LOG, TestRig, emit};
use wheeleg_master::MasterConfig;
use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::Refusal;
use wheeleg_master::event::Event;
use wheeleg_master::finding::Finding;
use wheeleg_protocol::{
    Address, Fault, FaultCode, FaultRecord, LinkRecord, LogEntry, LogEvent, LogRecords, Message,
    NodeMode, ResetCause,
};

/// Cycles of a full round of questions: link and log of eight boards.
const ROUND: usize = 160;

/// The master receives a broken frame.
fn noise(rig: &mut TestRig) {
    let broken = [0, 5, 9, 9, 9, 9, 9, 0];
    rig.master.on_bus_bytes(&broken, rig.now_us);
}

fn diagnoses(rig: &TestRig) -> Vec<(u8, FaultRecord)> {
    let events = rig.events.iter();
    let diagnosis = |(_, event): &(u64, Event)| match *event {
        Event::Diagnosis { node, record, .. } => Some((node, record)),
        _ => None,
    };
    events.filter_map(diagnosis).collect()
}

fn found(rig: &TestRig, wanted: Finding) -> Vec<Option<u8>> {
    let events = rig.events.iter();
    let of = |(_, event): &(u64, Event)| match *event {
        Event::Found { node, finding } if finding == wanted => Some(node),
        _ => None,
    };
    events.filter_map(of).collect()
}

#[test]
fn a_board_with_a_new_fault_is_asked_why_in_the_same_cycle_and_once() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    assert_eq!(diagnoses(&rig), [], "nothing has happened");
    let node = rig.node(5);
    node.faults.insert(Fault::NoMotion);
    node.fault_record.first_fault = FaultCode::new(Fault::NoMotion);
    node.fault_record.first_time_us = 4_321;
    rig.cycle();
    let told = diagnoses(&rig);
    assert_eq!(told.len(), 1);
    let (node, record) = told[0];
    assert_eq!(
        (node, record.first_fault.fault()),
        (5, Some(Fault::NoMotion))
    );
    rig.run(2 * ROUND);
    assert_eq!(diagnoses(&rig).len(), 1, "once");
}

/// A new master controls boards that have not yet reported their fault to anybody.
#[test]
fn a_fault_from_before_this_master_is_told_by_its_age() {
    const AGE_US: u64 = 3_000_000;
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    let latched_us = (rig.now_us as u32).wrapping_sub(AGE_US as u32);
    let record = &mut rig.node(5).fault_record;
    record.first_fault = FaultCode::new(Fault::LinkLost);
    record.clock_offset_us = 1_000;
    record.first_time_us = latched_us.wrapping_sub(1_000);
    rig.node(5).faults.insert(Fault::LinkLost);
    assert!(rig.now_us < AGE_US, "before the master's time");
    rig.cycle();
    let ages = rig.events.iter().filter_map(|(_, event)| match event {
        Event::Diagnosis { ago_us, .. } => Some(u64::from(*ago_us)),
        _ => None,
    });
    let ages: Vec<_> = ages.collect();
    assert_eq!(ages.len(), 1);
    assert!((AGE_US..AGE_US + 20_000).contains(&ages[0]), "{ages:?}");
}

#[test]
fn a_board_that_restarted_is_asked_why_whether_it_was_missed_or_not() {
    // Within a cycle: detected by its mode, armed or not.
    for armed in [true, false] {
        let mut rig = TestRig::new(MasterConfig::default());
        rig.arm();
        if !armed {
            rig.submit(Command::Disarm);
            rig.run(20);
        }
        rig.node(2).mode = NodeMode::Boot;
        rig.node(2).fault_record.reset_cause = ResetCause::Watchdog;
        rig.run(2);
        rig.node(2).mode = NodeMode::Idle;
        rig.run(10);
        let causes: Vec<_> = diagnoses(&rig)
            .iter()
            .map(|(n, r)| (*n, r.reset_cause))
            .collect();
        assert_eq!(
            causes.first(),
            Some(&(2, ResetCause::Watchdog)),
            "armed: {armed}"
        );
    }
    // Missing for long: asked when it is heard again.
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    rig.node(7).silent = true;
    rig.run(30);
    assert_eq!(diagnoses(&rig), [], "nobody to ask");
    rig.node(7).silent = false;
    rig.node(7).mode = NodeMode::Idle;
    rig.run(10);
    assert_eq!(
        diagnoses(&rig).iter().map(|(n, _)| *n).collect::<Vec<_>>(),
        [7]
    );
}

#[test]
fn a_restart_that_nobody_saw_shows_in_the_count_of_frames() {
    let mut rig = TestRig::new(MasterConfig::default());
    for node in &mut rig.nodes {
        node.link.frames = 5_000;
    }
    noise(&mut rig);
    rig.run(2 * ROUND);
    assert_eq!(diagnoses(&rig), []);
    rig.node(4).link.frames = 120;
    noise(&mut rig);
    rig.run(2 * ROUND);
    assert_eq!(
        diagnoses(&rig).iter().map(|(n, _)| *n).collect::<Vec<_>>(),
        [4]
    );
}

#[test]
fn counters_and_logs_of_every_board_arrive_within_a_round_of_questions() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(20);
    for (n, node) in (1..).zip(&mut rig.nodes) {
        node.link.crc = n;
        let entry = LogEntry {
            time_us: u32::from(n),
            event: LogEvent::Parameter,
            a: 0,
            b: n,
        };
        let mut log = LogRecords { lost: n, ..NO_LOG };
        log.entries[..8].copy_from_slice(&entry.to_bytes());
        node.log = log;
    }
    rig.events.clear();
    noise(&mut rig);
    rig.run(2 * ROUND);
    for n in 1..=8_u8 {
        let count = |wanted: &dyn Fn(&Event) -> bool| {
            rig.events.iter().filter(|(_, event)| wanted(event)).count()
        };
        let heard = |e: &Event| matches!(e, Event::Link { node, record } if *node == n && record.crc == u16::from(n));
        let logged = |e: &Event| matches!(e, Event::Log { node, entry } if *node == n && entry.b == u16::from(n));
        let lost = |e: &Event| {
            *e == Event::LogLost {
                node: n,
                records: u16::from(n),
            }
        };
        assert!(count(&heard) >= 1, "{n}");
        assert_eq!((count(&logged), count(&lost)), (1, 1), "{n}");
    }
    let lost = |(_, event): &&(u64, Event)| matches!(event, Event::LogLost { .. });
    assert_eq!(
        rig.events.iter().filter(lost).count(),
        8,
        "none of no records"
    );
    // One exchange in ten cycles, and nothing more while all is well.
    let requests = |rig: &TestRig| rig.nodes.iter().map(|n| n.requests.len()).sum::<usize>();
    let before = requests(&rig);
    rig.run(ROUND);
    assert_eq!(requests(&rig) - before, ROUND / 10);
}

#[test]
fn a_board_with_other_parameters_than_wanted_is_named_whenever_they_change() {
    let mut parameters = [None; 8];
    parameters[2] = Some(1234);
    let mut rig = TestRig::new(MasterConfig {
        parameters,
        ..MasterConfig::default()
    });
    rig.node(3).link.parameters = 1234;
    rig.node(4).link.parameters = 99;
    rig.run(5 * ROUND);
    assert_eq!(found(&rig, Finding::OtherParameters), []);
    rig.node(3).link.parameters = 1235;
    rig.run(5 * ROUND);
    assert_eq!(found(&rig, Finding::OtherParameters), [Some(3)], "once");
    rig.node(3).link.parameters = 1236;
    rig.run(5 * ROUND);
    assert_eq!(found(&rig, Finding::OtherParameters), [Some(3), Some(3)]);
}

#[test]
fn on_a_sound_line_links_are_asked_for_in_every_eighth_round() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(300);
    let asked = |rig: &TestRig, node: usize| {
        let asked = rig.nodes[node].requests.iter();
        asked
            .filter(|m| matches!(m, Message::LinkReport(_)))
            .count()
    };
    let before: Vec<usize> = (0..8).map(|node| asked(&rig, node)).collect();
    // One round of sixteen questions and seven of eight, ten cycles each.
    rig.run(3 * (160 + 7 * 80));
    for (node, before) in before.into_iter().enumerate() {
        assert_eq!(asked(&rig, node) - before, 3, "{node}");
    }
}

#[test]
fn the_rest_of_a_log_is_asked_for_at_once() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(20);
    let asked = |rig: &mut TestRig| {
        let asked = rig.node(5).requests.iter();
        asked.filter(|m| matches!(m, Message::LogRead(_))).count()
    };
    rig.node(5).log = LogRecords { left: 3, ..NO_LOG };
    let before = asked(&mut rig);
    while asked(&mut rig) == before {
        rig.cycle();
    }
    rig.run(20);
    assert_eq!(asked(&mut rig) - before, 2, "and nothing more behind it");
}

#[test]
fn another_board_than_the_commissioned_one_bars_arming_and_both_ids_are_named() {
    let mut commissioned: [_; 8] = std::array::from_fn(|i| Some([i as u8 + 1; 12]));
    // Joint 3 and joint 4 were swapped; nothing was commissioned for wheel 8.
    commissioned[7] = None;
    let mut rig = TestRig::new(MasterConfig {
        commissioned,
        ..MasterConfig::default()
    });
    rig.node(3).unique_id = [4; 12];
    rig.node(4).unique_id = [0xEE; 12];
    rig.run(20);
    let ticket = rig.submit(Command::Arm);
    rig.run(5);
    assert_eq!(rig.refusal(ticket), Some(Refusal::ForeignBoard { node: 3 }));
    let foreign = |node, found: u8, belongs| Event::ForeignBoard {
        node,
        commissioned: [node; 12],
        found: [found; 12],
        belongs,
    };
    for told in [foreign(3, 4, Some(4)), foreign(4, 0xEE, None)] {
        assert!(rig.saw(|event| *event == told), "{told:?}");
    }
    // Once accepted, they arm.
    let ticket = rig.submit(Command::Commission);
    rig.run(2);
    assert!(rig.done(ticket), "{:?}", rig.refusal(ticket));
    let taken = Event::Commissioned {
        node: 4,
        unique_id: [0xEE; 12],
    };
    assert!(rig.saw(|event| *event == taken));
    let ticket = rig.submit(Command::Arm);
    rig.run(20);
    assert!(rig.done(ticket), "{:?}", rig.refusal(ticket));
    let ticket = rig.submit(Command::Commission);
    rig.run(2);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NotDisarmed));
}

#[test]
fn boards_are_not_commissioned_while_one_is_missing_or_of_another_version() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.node(6).schema_hash ^= 1;
    rig.run(20);
    let ticket = rig.submit(Command::Commission);
    rig.run(2);
    assert!(matches!(
        rig.refusal(ticket),
        Some(Refusal::SchemaMismatch { node: 6, .. })
    ));
    assert!(!rig.saw(|event| matches!(event, Event::Commissioned { .. })));
}

#[test]
fn parameters_are_read_written_and_saved_and_a_save_is_no_loss() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(20);
    let ticket = rig.submit(Command::WriteParameter {
        node: 3,
        id: 0x0101,
        raw: -77,
    });
    rig.run(2);
    assert!(rig.done(ticket));
    let ticket = rig.submit(Command::ReadParameter {
        node: 3,
        id: 0x0101,
    });
    rig.run(2);
    let value = Event::Parameter {
        node: 3,
        id: 0x0101,
        raw: -77,
    };
    assert!(rig.done(ticket) && rig.saw(|event| *event == value));
    // Two erased pages: five cycles of silence.
    rig.node(3).save_cycles = 5;
    rig.node(3).link.frames = 900;
    let ticket = rig.submit(Command::SaveParameters { node: 3 });
    rig.run(20);
    assert!(rig.done(ticket), "{:?}", rig.refusal(ticket));
    assert!(!rig.saw(|event| matches!(event, Event::NodeLost(_))));
    assert!(rig.master.is_ready());
    let ticket = rig.submit(Command::SaveParameters { node: 9 });
    rig.run(2);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NoSuchBoard { node: 9 }));
    rig.arm();
    let ticket = rig.submit(Command::SaveParameters { node: 3 });
    rig.run(2);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NotDisarmed));
}

/// Only the board that saves is not counted as missing meanwhile.
#[test]
fn another_board_that_falls_silent_during_a_save_is_missed_at_once() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(20);
    rig.node(3).save_cycles = 30;
    rig.submit(Command::SaveParameters { node: 3 });
    rig.run(4);
    rig.node(5).silent = true;
    rig.run(4);
    let lost = |node| rig.saw(|event| *event == Event::NodeLost(node));
    assert!(lost(5) && !lost(3));
}

#[test]
fn a_board_reset_in_mid_save_has_not_saved_whatever_it_says_afterwards() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(20);
    rig.node(3).link.frames = 900;
    rig.node(3).save_cycles = 5;
    let ticket = rig.submit(Command::SaveParameters { node: 3 });
    rig.run(3);
    rig.node(3).link.frames = 12;
    rig.node(3).fault_record.reset_cause = ResetCause::PowerUp;
    rig.run(20);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NodeReset { node: 3 }));
    assert_eq!(
        diagnoses(&rig).iter().map(|(n, _)| *n).collect::<Vec<_>>(),
        [3]
    );
    // A board that never comes back is finally reported as lost.
    rig.node(5).save_cycles = 200;
    let ticket = rig.submit(Command::SaveParameters { node: 5 });
    rig.run(40);
    assert_eq!(rig.refusal(ticket), Some(Refusal::NodeBusy { node: 5 }));
    assert!(rig.saw(|event| *event == Event::NodeLost(5)));
}

#[test]
fn a_board_that_babbles_in_its_slot_is_named_and_one_that_is_silent_is_not_accused() {
    for rubbish in [true, false] {
        let mut rig = TestRig::new(MasterConfig::default());
        rig.arm();
        rig.node(5).silent = true;
        for _ in 0..6 {
            let start = rig.now_us;
            rig.cycle();
            if rubbish {
                // The guard cuts it off at the end of its slot.
                let end = start + 1_020 + 120 + 4 * 310 + 310;
                rig.master.on_bus_bytes(&[0x5A; 31], end);
            }
        }
        assert!(rig.saw(|event| *event == Event::NodeLost(5)));
        let named = found(&rig, Finding::SlotBabble);
        assert_eq!(named, if rubbish { vec![Some(5)] } else { vec![] });
    }
}

#[test]
fn babble_without_a_guard_is_told_and_its_source_when_the_line_is_quiet_again() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.run(2 * ROUND);
    for node in &mut rig.nodes {
        node.silent = true;
    }
    for _ in 0..20 {
        let start = rig.now_us;
        rig.cycle();
        for ms in 1..10 {
            rig.master.on_bus_bytes(&[0x5A; 100], start + ms * 1000);
        }
    }
    assert_eq!(found(&rig, Finding::BusBabble), [None]);
    assert_eq!(found(&rig, Finding::SlotBabble), []);
    for node in &mut rig.nodes {
        node.silent = false;
        node.link.overflow = if node.address.raw() == 6 { 0 } else { 9 };
    }
    rig.run(40);
    assert_eq!(found(&rig, Finding::Babbler), [Some(6)]);
    assert_eq!(found(&rig, Finding::BusBabble), [None], "told once");
}

#[test]
fn who_fills_the_line_is_named() {
    let mut rig = TestRig::new(MasterConfig::default());
    rig.arm();
    let record = LinkRecord {
        frames: 1,
        ..rig.nodes[0].link
    };
    let answer = emit(&Message::from(record), Address::wheel(8).unwrap(), 9);
    for _ in 0..30 {
        let start = rig.now_us;
        rig.cycle();
        for i in 0..12 {
            rig.master.on_bus_bytes(&answer, start + 5_000 + 350 * i);
        }
    }
    // Unrequested answers, twelve per cycle.
    assert_eq!(found(&rig, Finding::LineFull), [Some(8)]);
    assert!(rig.master.is_armed(), "and goes on");
}
