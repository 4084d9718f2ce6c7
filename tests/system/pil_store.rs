//! Parameters in the flash of the shipped joint image, on an emulated board: set and
//! saved by requests on the bus, back after a loss of power, and whole after a power
//! cut in any unit of the save; and set and saved in a whole run, equal to the host to the bit.
//! `cargo xtask pil` runs this.

use crate::bench::pil::{Board, edge};
use crate::bench::{delivery, numbered, power_up};
use crate::sil;
use crate::sil::{run_with, stand};
use wheeleg_config::EventAction;
use wheeleg_master::command::Command;
use wheeleg_master::event::Event as MasterEvent;
use wheeleg_protocol::param::{JointParam, WheelParam};
use wheeleg_protocol::{
    Address, Decoder, FaultRecord, FaultReport, Message, NackReason, ParamGet, ParamSave, ParamSet,
    ResetCause,
};
use wheeleg_remote_host::unicorn::image;
use wheeleg_remote_host::{NodeKind, Nodes};
use wheeleg_remote_link::{Hook, Power, Ran, Reply, Request};
use wheeleg_telemetry::{Cause, Recording};

const ADDRESS: u8 = 2;
const MS: u64 = 1_000_000;
/// Start-up with its self-test of ten readings, ms.
const START_MS: u64 = 40;
/// A page is erased in 22 ms, and then written, ms.
const SAVE_MS: u64 = 35;
const PARAMETER: JointParam = JointParam::FollowingError;

/// An emulated joint board and the master on its bus.
struct BoardBench {
    board: Board,
    now_ns: u64,
    sequence: u16,
    resets: u16,
    sent: Vec<Message>,
}

impl BoardBench {
    fn new() -> Self {
        let mut bench = Self {
            board: Board::new(image("joint").expect("an image")),
            now_ns: 0,
            sequence: 100,
            resets: 0,
            sent: Vec::new(),
        };
        bench.ran(&power_up(ADDRESS));
        bench.ticks(START_MS, Power::Good);
        bench
    }

    fn ran(&mut self, request: &Request) -> Ran {
        let ran = self.board.ran(request);
        self.resets = ran.figures.resets;
        assert_eq!(ran.outputs.valve_on_us, [0; 4], "never armed");
        for sent in &ran.sent {
            let mut decoder = Decoder::new();
            decoder.push_slice(&sent.bytes, |frame| {
                let frame = frame.expect("a sound frame");
                self.sent.push(Message::parse(&frame).expect("a message"));
            });
        }
        ran
    }

    fn ticks(&mut self, ms: u64, power: Power) {
        for _ in 0..ms {
            self.now_ns += MS;
            self.ran(&edge(self.now_ns, power));
        }
    }

    /// Sends a request in the middle of a tick; returns the answer.
    fn request(&mut self, message: Message) -> Message {
        self.sequence += 1;
        let address = Address::new(ADDRESS).expect("a joint");
        let bytes = numbered(self.sequence, address, &message);
        self.sent.clear();
        let until_ns = self.now_ns + MS / 2;
        self.ran(&delivery(&bytes, until_ns));
        self.ticks(2, Power::Good);
        *self.sent.first().expect("an answer")
    }

    fn set(&mut self, raw: i32) {
        let id = PARAMETER.id();
        let answer = self.request(ParamSet { id, value: raw }.into());
        assert!(
            matches!(answer, Message::ParamValue(value) if value.value == raw),
            "{answer:?}"
        );
    }

    fn get(&mut self) -> i32 {
        let id = PARAMETER.id();
        match self.request(ParamGet { id }.into()) {
            Message::ParamValue(value) => value.value,
            other => panic!("{other:?}"),
        }
    }

    /// Asks for a save and waits for it.
    fn save(&mut self) {
        let answer = self.request(ParamSave {}.into());
        assert!(
            matches!(answer, Message::Nack(nack) if nack.reason == NackReason::Busy),
            "{answer:?}"
        );
        self.ticks(SAVE_MS, Power::Good);
    }

    fn saved(&mut self) -> bool {
        matches!(self.request(ParamSave {}.into()), Message::Ack(_))
    }

    /// Switches the supply off and on; returns the reported reason of the start.
    fn restart(&mut self) -> FaultRecord {
        self.ticks(5, Power::BrownOut);
        self.ticks(START_MS, Power::Good);
        match self.request(FaultReport {}.into()) {
            Message::FaultRecord(record) => record,
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn parameters_that_were_saved_are_back_after_a_loss_of_power_and_others_are_not() {
    let default = PARAMETER.info().default;
    let mut bench = BoardBench::new();
    assert_eq!(bench.get(), default);
    bench.set(default + 1000);
    let record = bench.restart();
    assert_eq!(record.reset_cause, ResetCause::PowerUp);
    assert_eq!(bench.get(), default, "set, but not saved");
    for raw in [default + 2000, default + 3000] {
        bench.set(raw);
        let resets = bench.resets;
        bench.save();
        assert!(bench.saved());
        assert_eq!(bench.resets, resets, "no watchdog, no fault");
        let record = bench.restart();
        assert!(record.active.is_empty(), "{record:?}");
        assert_eq!(bench.get(), raw);
    }
}

#[test]
fn a_power_cut_in_any_unit_of_a_save_leaves_the_old_value_or_the_new_one_and_a_disarmed_board() {
    // An erased page, the head, one record, the word with the checksum.
    const UNITS: u16 = 4;
    let default = PARAMETER.info().default;
    let (old, new) = (default + 2000, default + 3000);
    let mut found = Vec::new();
    for after in 0..=UNITS {
        let mut bench = BoardBench::new();
        bench.set(old);
        bench.save();
        assert!(bench.saved());
        bench.set(new);
        let resets = bench.resets;
        assert_eq!(
            bench
                .board
                .ask(&Request::Hook(Hook::BrownOutInSave { after })),
            Reply::Done
        );
        bench.save();
        assert_eq!(bench.resets > resets, after < UNITS, "after {after} units");
        let record = bench.restart();
        assert!(record.active.is_empty(), "{record:?}");
        found.push(bench.get());
    }
    println!("found after a cut in each of the {UNITS} units: {found:?}");
    let expected: Vec<i32> = (0..=UNITS)
        .map(|n| if n < UNITS { old } else { new })
        .collect();
    assert_eq!(found, expected, "the word with the checksum decides");
}

fn write(node: u8, id: u16, raw: i32) -> EventAction {
    EventAction::Command(Command::WriteParameter { node, id, raw })
}

fn read(node: u8, id: u16) -> EventAction {
    EventAction::Command(Command::ReadParameter { node, id })
}

fn save(node: u8) -> EventAction {
    EventAction::Command(Command::SaveParameters { node })
}

/// Parameters that the master received in a run: board, number, raw value.
fn parameters(recording: &Recording) -> Vec<(u8, u16, i32)> {
    let events = recording.events.iter();
    events
        .filter_map(|row| match row.v.cause {
            Cause::Master(MasterEvent::Parameter { node, id, raw }) => Some((node, id, raw)),
            _ => None,
        })
        .collect()
}

#[test]
fn in_a_whole_run_parameters_are_set_and_saved_as_on_the_host() {
    // The law that takes longest to set up, and one value of a wheel.
    let (law, error) = (JointParam::Law.id(), WheelParam::FollowingError.id());
    let events = [
        (0.2, EventAction::Command(Command::Disarm)),
        (0.4, write(3, law, 5)),
        (0.6, write(8, error, 12_345)),
        (0.8, save(3)),
        (1.0, save(8)),
        (1.2, write(3, law, 1)),
        (1.4, read(3, law)),
        (1.6, read(8, error)),
    ];
    let scenario = stand(1.8, &events);
    let nodes = Nodes::new(&NodeKind::Pil, &[]).expect("one each");
    let (recording, pil) = run_with(&scenario, &nodes);
    assert_eq!(pil.differing_bits, 0, "{:?}", pil.first_difference);
    let expected = [
        (3, law, 5),
        (8, error, 12_345),
        (3, law, 1),
        (3, law, 1),
        (8, error, 12_345),
    ];
    assert_eq!(
        parameters(&recording),
        expected,
        "{}",
        sil::story(&recording)
    );
}

#[test]
fn in_a_whole_run_a_board_without_power_goes_on_with_what_it_had_saved_as_on_the_host() {
    let (own, error) = (PARAMETER.id(), WheelParam::FollowingError.id());
    let mm = |mm: f64| (mm * 65_536.0) as i32;
    let events = [
        (0.2, EventAction::Command(Command::Disarm)),
        (0.4, write(3, own, mm(55.0))),
        (0.5, write(8, error, 12_345)),
        (0.6, save(3)),
        (0.8, save(8)),
        // In force, and not saved.
        (1.0, write(3, own, mm(70.0))),
        (1.1, write(8, error, 777)),
        (1.3, read(3, own)),
        (1.4, read(8, error)),
        (2.2, read(3, own)),
        (2.3, read(8, error)),
    ];
    let mut scenario = stand(2.6, &events);
    scenario.faults = vec!["brown-out:joint3=30@1.5s".parse().expect("a fault")];
    let (recording, pil) = run_with(
        &scenario,
        &Nodes::new(&NodeKind::Pil, &[]).expect("one each"),
    );
    assert_eq!(pil.differing_bits, 0, "{:?}", pil.first_difference);
    let resets: Vec<u16> = pil.boards.iter().map(|board| board.resets).collect();
    assert_eq!(resets, [0, 0, 1, 0, 0, 0, 0, 0]);
    let expected = [
        (3, own, mm(55.0)),
        (8, error, 12_345),
        (3, own, mm(70.0)),
        (8, error, 777),
        (3, own, mm(70.0)),
        (8, error, 777),
        (3, own, mm(55.0)),
        (8, error, 777),
    ];
    assert_eq!(
        parameters(&recording),
        expected,
        "{}",
        sil::story(&recording)
    );
}
