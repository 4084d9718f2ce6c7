//! What a board tells about itself: why it started, what it heard, what it keeps,
//! who else has its address.

use crate::common::joint::{JointRig, setpoint};
use crate::common::mock::Memory;
use crate::common::{ARM, decode, frame, refusal};
use wheeleg_node::mode::Mode;
use wheeleg_node::parameters::JointParameters;
use wheeleg_node::store::{Flash, FlashError, PAGES, Record, Store, WORDS};
use wheeleg_protocol::LinkLossAction::Hold;
use wheeleg_protocol::link::{SlotTiming, TURNAROUND_US};
use wheeleg_protocol::param::JointParam;
use wheeleg_protocol::{
    Address, Disarm, Discover, Fault, FaultReport, Limit, LinkReport, LogEvent, LogRead, Message,
    NackReason, NodeMode, ParamSave, ParamSet, ResetCause, SlotReply, Sync, SyncFlags, SyncSlots,
};
use wheeleg_units::Micros;

fn record(rig: &mut JointRig) -> wheeleg_protocol::FaultRecord {
    match rig.request(&Message::FaultReport(FaultReport {})) {
        Message::FaultRecord(record) => record,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_reset_in_operation_is_a_fault_and_every_reset_has_its_cause() {
    for cause in ResetCause::ALL {
        let mut rig = JointRig::new();
        rig.node.started_by(*cause);
        rig.run_cycles(3, None);
        let told = record(&mut rig);
        assert_eq!(told.reset_cause, *cause);
        let failed = matches!(
            cause,
            ResetCause::Watchdog
                | ResetCause::BrownOut
                | ResetCause::ProcessorFault
                | ResetCause::Panic
                | ResetCause::ClockLoss
        );
        assert_eq!(
            told.first_fault.fault(),
            failed.then_some(Fault::UnexpectedReset)
        );
        assert_eq!(
            rig.node.mode(),
            Mode::Idle,
            "the self-test runs all the same"
        );
        let refused = refusal(&rig.request(&ARM));
        assert_eq!(
            refused,
            failed.then_some(NackReason::FaultLatched),
            "{cause:?}"
        );
        if failed {
            assert!(matches!(rig.clear(), Message::Ack(_)));
            assert!(matches!(rig.request(&ARM), Message::Ack(_)));
            assert_eq!(
                record(&mut rig).reset_cause,
                *cause,
                "told until the next start"
            );
        }
    }
}

const SAVE: Message = Message::ParamSave(ParamSave {});

fn set(id: JointParam, value: i32) -> Message {
    Message::ParamSet(ParamSet { id: id.id(), value })
}

/// Sends the request again until it is no longer Busy; the main loop of the board
/// runs in between.
fn save(rig: &mut JointRig, memory: &mut Memory) -> Message {
    rig.sequence += 1;
    let sequence = rig.sequence;
    for _ in 0..3 {
        let (_, answer) = decode(&rig.send(&SAVE, sequence).expect("answered"));
        if refusal(&answer) != Some(NackReason::Busy) {
            return answer;
        }
        rig.tick();
        if rig.node.save_is_due() {
            rig.node.save(memory, Micros(rig.now));
            // The processor stood still for the erasure of a page.
            rig.now += 22_000;
        }
    }
    panic!("busy for ever");
}

#[test]
fn parameters_are_stored_when_disarmed_and_told_how_it_went() {
    let mut memory = Memory::default();
    let mut rig = JointRig::new();
    rig.run_cycles(3, None);
    let error_scale = 30 << 16;
    rig.request(&set(JointParam::ErrorScale, error_scale));
    assert!(matches!(save(&mut rig, &mut memory), Message::Ack(_)));
    assert_eq!(memory.set, [(JointParam::ErrorScale.id(), error_scale)]);
    assert_eq!(memory.saves, 1, "once, although it was asked three times");
    rig.run_cycles(3, None);
    assert!(rig.node.faults().is_empty(), "no overrun, no lost link");

    // Asked anew: stored anew.
    assert!(matches!(save(&mut rig, &mut memory), Message::Ack(_)));
    assert_eq!(memory.saves, 2);

    memory.broken = true;
    assert_eq!(
        refusal(&save(&mut rig, &mut memory)),
        Some(NackReason::StoreFailed)
    );
    assert_eq!(memory.set.len(), 1, "the old set is still there");

    rig.run_cycles(1, None);
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    assert_eq!(refusal(&rig.request(&SAVE)), Some(NackReason::Armed));
    assert!(!rig.node.save_is_due());
}

/// Two blank pages, and the time that was spent on them.
struct Chip {
    words: [[u64; WORDS]; PAGES],
    took_ns: u32,
}

impl Flash for &mut Chip {
    fn read(&self, page: usize, word: usize) -> Option<u64> {
        Some(self.words[page][word])
    }

    fn erase(&mut self, page: usize) -> Result<(), FlashError> {
        // The most that the part's data sheet allows.
        self.took_ns += 24_500_000;
        self.words[page] = [u64::MAX; WORDS];
        Ok(())
    }

    fn write(&mut self, page: usize, word: usize, value: u64) -> Result<(), FlashError> {
        self.took_ns += 83_000;
        self.words[page][word] = value;
        Ok(())
    }
}

/// µs that the first save of every parameter takes, in which the processor stands still.
fn first_save_us() -> u32 {
    let mut chip = Chip {
        words: [[u64::MAX; WORDS]; PAGES],
        took_ns: 0,
    };
    let records: Vec<Record> = JointParam::ALL
        .iter()
        .map(|param| Record {
            id: param.id(),
            raw: param.info().max,
        })
        .collect();
    let mut store = Store::new(&mut chip);
    store.save(&records).unwrap();
    chip.took_ns / 1000
}

#[test]
fn the_first_save_of_a_blank_store_does_not_cost_the_link_whenever_it_is_asked_for() {
    let stall_us = first_save_us();
    for asked_ms in 0..10 {
        let mut rig = JointRig::new();
        rig.run_cycles(3, None);
        let mut sync_at = rig.now;
        for ms in 0..200 {
            // What comes while the processor stands still is lost.
            while sync_at < rig.now {
                sync_at += 10_000;
                rig.cycle += 1;
            }
            if sync_at == rig.now {
                rig.sync(None, false);
                sync_at += 10_000;
            }
            if ms == asked_ms {
                assert_eq!(refusal(&rig.request(&SAVE)), Some(NackReason::Busy));
            }
            rig.tick();
            if rig.node.save_is_due() {
                rig.node.save(&mut Memory::default(), Micros(rig.now));
                rig.now += stall_us.next_multiple_of(1000);
            }
        }
        assert!(rig.node.faults().is_empty(), "asked after {asked_ms} ms");
        assert!(matches!(rig.request(&SAVE), Message::Ack(_)));
    }
}

#[test]
fn nothing_is_stored_by_a_board_that_was_armed_meanwhile() {
    let mut memory = Memory::default();
    let mut rig = JointRig::new();
    rig.run_cycles(3, None);
    assert_eq!(refusal(&rig.request(&SAVE)), Some(NackReason::Busy));
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    assert!(rig.node.save_is_due());
    rig.node.save(&mut memory, Micros(rig.now));
    assert_eq!((memory.saves, rig.node.save_is_due()), (0, false));
}

#[test]
fn a_stored_set_that_is_damaged_or_contradicts_itself_gives_defaults_and_a_fault() {
    // The stroke ends before it begins; each value alone is permitted.
    let crossed = JointParameters::default()
        .with(JointParam::StrokeMin.id(), 150 << 16, true)
        .and_then(|p| p.with(JointParam::StrokeMax.id(), 20 << 16, true))
        .unwrap();
    for mut rig in [JointRig::stored(crossed), JointRig::damaged()] {
        rig.run_cycles(3, None);
        assert_eq!(*rig.node.parameters(), JointParameters::default());
        assert!(rig.node.faults().contains(Fault::ParameterCorrupt));
        assert_eq!(refusal(&rig.request(&ARM)), Some(NackReason::FaultLatched));
        assert!(matches!(rig.clear(), Message::Ack(_)));
        assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    }

    let sound = JointParameters::default()
        .with(JointParam::StrokeMax.id(), 120 << 16, true)
        .unwrap();
    let mut rig = JointRig::stored(sound);
    rig.run_cycles(3, None);
    assert_eq!(
        (*rig.node.parameters(), rig.node.faults().is_empty()),
        (sound, true)
    );
}

#[test]
fn boards_of_one_address_answer_discovery_apart_and_hear_each_other() {
    let mut one = JointRig::new();
    let mut other = JointRig::with_id([0xFC; 12]);
    let discover = Message::Discover(Discover {});
    let identity_us = 400;
    let (mut apart, tries) = (0, 32);
    for sequence in 0..tries {
        for rig in [&mut one, &mut other] {
            rig.run_cycles(1, None);
        }
        let now = one.now;
        assert_eq!(now, other.now);
        let answers =
            [&mut one, &mut other].map(|rig| rig.send(&discover, 1000 + sequence).unwrap());
        let [first, second] = [&answers[0], &answers[1]];
        for answer in [first, second] {
            let delay = answer.start_at.get() - now;
            assert!((TURNAROUND_US..=TURNAROUND_US + 7 * 420).contains(&delay));
            let (_, Message::Identity(identity)) = decode(answer) else {
                panic!();
            };
            assert_eq!(identity.address, one.address);
        }
        if first.start_at.get().abs_diff(second.start_at.get()) < identity_us {
            continue;
        }
        apart += 1;
        let end = |t: &wheeleg_node::Transmission| Micros(t.start_at.get() + identity_us);
        one.node.on_bus_bytes(&second.bytes, end(second));
        other.node.on_bus_bytes(&first.bytes, end(first));
        for rig in [&mut one, &mut other] {
            assert!(rig.node.faults().contains(Fault::DuplicateAddress));
            assert_eq!(refusal(&rig.request(&ARM)), Some(NackReason::FaultLatched));
        }
    }
    assert!((tries * 3 / 4..tries).contains(&apart), "{apart}");
}

#[test]
fn errors_of_the_link_are_counted_by_kind() {
    let mut rig = JointRig::new();
    rig.run_cycles(3, None);
    let good = frame(rig.address, 1, &Message::Discover(Discover {}));
    let mut flipped = good.clone();
    flipped[3] ^= 0x40;
    for bytes in [
        &flipped[..],
        &flipped[..],
        &[0, 3, 1, 1, 0][..],
        &[0, 9, 1, 1, 0][..],
    ] {
        rig.node.on_bus_bytes(bytes, Micros(rig.now));
    }
    let Message::LinkRecord(link) = rig.request(&Message::LinkReport(LinkReport {})) else {
        panic!();
    };
    assert_eq!(link.parameters, rig.node.parameters().sum());
    assert_eq!((link.crc, link.short, link.truncated), (2, 1, 1));
    assert_eq!(
        (link.overflow, link.version, link.length, link.address),
        (0, 0, 0, 0)
    );
    // Three SYNC and the request itself.
    assert_eq!(link.frames, 4);
}

fn read(rig: &mut JointRig, lease_ms: u16) -> Vec<(LogEvent, u8, u16)> {
    match rig.request(&Message::LogRead(LogRead { lease_ms })) {
        Message::LogRecords(records) => records.iter().map(|e| (e.event, e.a, e.b)).collect(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_log_tells_modes_faults_and_parameters_while_somebody_listens() {
    let mut rig = JointRig::new();
    rig.run_cycles(3, None);
    assert_eq!(
        read(&mut rig, 1000),
        [],
        "what went before was not recorded"
    );
    rig.request(&set(JointParam::ErrorScale, 30 << 16));
    rig.request(&ARM);
    rig.run_cycles(1, Some(setpoint(100.0, Hold)));
    let mode = |mode: NodeMode| mode.code();
    assert_eq!(
        read(&mut rig, 1000),
        [
            (LogEvent::Parameter, 0, JointParam::ErrorScale.id()),
            (
                LogEvent::Mode,
                mode(NodeMode::Idle),
                u16::from(mode(NodeMode::Armed))
            ),
            (
                LogEvent::Mode,
                mode(NodeMode::Armed),
                u16::from(mode(NodeMode::Tracking))
            ),
        ]
    );
    // The master dies, and with it the reader.
    rig.run(100);
    let tracking = u16::from(mode(NodeMode::Tracking));
    let lost = read(&mut rig, 1000);
    assert_eq!(lost[0], (LogEvent::Fault, Fault::LinkLost.code(), tracking));
    rig.run(1100);
    rig.run_cycles(2, None);
    rig.clear();
    assert_eq!(read(&mut rig, 1000), [], "the lease had ended");
}

#[test]
fn a_clock_that_runs_wrong_is_a_fault_and_the_offset_gives_master_time() {
    for (per_cycle_us, wrong) in [(10_002, false), (10_050, true)] {
        let mut rig = JointRig::new();
        let mut master_us = 5_000_000_u32;
        for nth in 0..350 {
            rig.cycle += 1;
            let sync = Message::Sync(Sync {
                cycle: rig.cycle,
                master_time_us: master_us,
                flags: SyncFlags::NONE,
                slots: SyncSlots::NONE,
            });
            rig.node
                .on_bus_bytes(&frame(Address::BROADCAST, 0, &sync), Micros(rig.now));
            let reply = rig.node.take_transmission().unwrap();
            let (_, Message::SlotReply(SlotReply { sync_echo, .. })) = decode(&reply) else {
                panic!();
            };
            assert_eq!(sync_echo, rig.cycle as u8, "the counter both ways");
            let latched = rig.now;
            rig.run(10);
            master_us += per_cycle_us;
            let told = record(&mut rig);
            let sync_us = SlotTiming::DEFAULT.bytes_us(102);
            // The first SYNC alone shows no counter that advances.
            let expected = latched.wrapping_add(told.clock_offset_us);
            assert!(nth == 0 || expected == master_us - per_cycle_us + sync_us);
        }
        assert_eq!(rig.node.faults().contains(Fault::SlotOverrun), wrong);
        let Message::LinkRecord(link) = rig.request(&Message::LinkReport(LinkReport {})) else {
            panic!();
        };
        let slow = if wrong { -5000 } else { -200 };
        assert!((link.drift_ppm - slow).abs() <= 30, "{}", link.drift_ppm);
    }
}

#[test]
fn a_driver_that_was_cut_off_is_a_fault() {
    let mut rig = JointRig::tracking(Hold);
    rig.node.driver_cut_off(Micros(rig.now));
    rig.tick();
    assert_eq!(rig.node.mode(), Mode::Hold);
    assert!(rig.node.faults().contains(Fault::SlotOverrun));
}

#[test]
fn a_fault_record_tells_the_limits_in_force() {
    let mut rig = JointRig::tracking(Hold);
    rig.run_cycles(10, Some(setpoint(150.0, Hold)));
    assert!(!record(&mut rig).limits.contains(Limit::SettledShut));
    rig.run_cycles(50, Some(setpoint(100.2, Hold)));
    assert!(record(&mut rig).limits.contains(Limit::SettledShut));
}

/// Asked for, armed before it was done, disarmed: asked again it is done, not told to have failed.
#[test]
fn a_save_that_arming_has_prevented_is_forgotten() {
    let mut memory = Memory::default();
    let mut rig = JointRig::new();
    rig.run_cycles(3, None);
    assert_eq!(refusal(&rig.request(&SAVE)), Some(NackReason::Busy));
    assert!(matches!(rig.request(&ARM), Message::Ack(_)));
    rig.node.save(&mut memory, Micros(rig.now));
    rig.run_cycles(1, None);
    assert!(matches!(
        rig.request(&Message::Disarm(Disarm {})),
        Message::Ack(_)
    ));
    assert!(matches!(save(&mut rig, &mut memory), Message::Ack(_)));
    assert_eq!(memory.saves, 1);
}

#[test]
fn a_slot_that_was_missed_is_told_with_the_frames_that_were_not_sent() {
    let mut rig = JointRig::new();
    rig.run_cycles(3, None);
    let unsent = |rig: &mut JointRig| match rig.request(&Message::LinkReport(LinkReport {})) {
        Message::LinkRecord(record) => record.unsent,
        other => panic!("{other:?}"),
    };
    assert_eq!(unsent(&mut rig), 0);
    rig.node.missed_slot();
    assert_eq!(unsent(&mut rig), 1);
    let sync = Message::Sync(Sync {
        cycle: rig.cycle + 1,
        master_time_us: 0,
        flags: SyncFlags::NONE,
        slots: SyncSlots::NONE,
    });
    let bytes = frame(Address::BROADCAST, 0, &sync);
    rig.node.on_bus_bytes(&bytes, Micros(rig.now));
    assert!(rig.node.take_transmission().unwrap().in_slot);
    let answer = rig.send(&Message::LinkReport(LinkReport {}), 900).unwrap();
    assert!(!answer.in_slot);
}
