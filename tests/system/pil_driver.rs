//! The time limit of the bus driver, on images of both kinds: a transmission that
//! takes too long loses its driver by hardware, when the frame that was asked for ought
//! to be over, and the board latches that. An image without the limit is found.
//! `cargo xtask pil` builds both and runs this.

use std::path::{Path, PathBuf};

use crate::bench::pil::{Board, edge};
use crate::bench::{delivery, numbered, power_up};
use wheeleg_protocol::{Address, Decoder, Fault, FaultRecord, FaultReport, MAX_ENCODED, Message};
use wheeleg_remote_host::unicorn::image;
use wheeleg_remote_link::{Figures, Hook, Power, Ran, Reply, Request};

/// Folder with one folder of images per mutation (firmware/board/src/g431/mutant.rs).
const MUTANTS: &str = "WHEELEG_MUTANTS";
/// Kinds of boards: image, an address, tick in ns.
type Kind = (&'static str, u8, u64);
const JOINT: Kind = ("joint", 2, 1_000_000);
const WHEEL: Kind = ("wheel", 7, 520_000);
/// Start-up with its self-test of ten readings, ticks.
const START: u64 = 40;
/// Time of a byte on the line, µs.
const BYTE_US: u32 = 10;
/// The driver is on this much longer than the frame: 1 µs before it, 2 µs behind
/// (BOARD.md, USART1).
const MARGIN_US: u32 = 3;

/// An emulated joint board on a bus of its own.
struct BoardBench {
    board: Board,
    kind: Kind,
    now_ns: u64,
    sequence: u16,
    sent: Vec<Vec<u8>>,
    figures: Figures,
}

impl BoardBench {
    fn new(image: PathBuf, kind: Kind) -> Self {
        let mut bench = Self {
            board: Board::new(image),
            kind,
            now_ns: 0,
            sequence: 100,
            sent: Vec::new(),
            figures: Figures::default(),
        };
        bench.ran(&power_up(kind.1));
        bench.ticks(START);
        bench
    }

    fn ran(&mut self, request: &Request) -> Ran {
        let ran = self.board.ran(request);
        self.figures = ran.figures;
        self.sent
            .extend(ran.sent.iter().map(|sent| sent.bytes.to_vec()));
        ran
    }

    fn ticks(&mut self, count: u64) {
        for _ in 0..count {
            self.now_ns += self.kind.2;
            self.ran(&edge(self.now_ns, Power::Good));
        }
    }

    fn stretch(&mut self, times: u8) {
        let hook = Request::Hook(Hook::StretchTransmission { times });
        assert_eq!(self.board.ask(&hook), Reply::Done);
    }

    /// Asks for the faults; returns the answer that the board wants to send.
    fn answer(&mut self) -> Vec<u8> {
        self.sequence += 1;
        let address = Address::new(self.kind.1).expect("a node");
        let bytes = numbered(self.sequence, address, &FaultReport {}.into());
        self.sent.clear();
        self.ran(&delivery(&bytes, self.now_ns + self.kind.2 / 2));
        // The longest frame, stretched, and a while.
        self.ticks(200);
        let [answer] = &self.sent[..] else {
            panic!("one answer, not {:?}", self.sent);
        };
        answer.clone()
    }

    fn faults(&mut self) -> FaultRecord {
        let answer = self.answer();
        let mut found = None;
        Decoder::new().push_slice(&answer, |frame| {
            let frame = frame.expect("a sound frame");
            found = Some(Message::parse(&frame).expect("a message"));
        });
        match found {
            Some(Message::FaultRecord(record)) => record,
            other => panic!("{other:?}"),
        }
    }
}

/// Whether the driver of an image ends with the frame that was asked for, and the board
/// says so, when its transmitter takes `times` as long; or what is wrong.
fn limit(image: &Path, kind: Kind, times: u8) -> Result<(), String> {
    let mut bench = BoardBench::new(image.to_path_buf(), kind);
    let length = bench.answer().len() as u32;
    let on_us = length * BYTE_US + MARGIN_US;
    let ensure = |bench: &BoardBench, timeouts: u16| {
        let figures = bench.figures;
        let found = (figures.driver_on_us, figures.driver_timeouts);
        if found == (on_us, timeouts) {
            Ok(())
        } else {
            Err(format!(
                "driver on for {} µs with {} time-outs, not {on_us} and {timeouts}",
                found.0, found.1
            ))
        }
    };
    ensure(&bench, 0)?;
    bench.stretch(times);
    // The whole answer is ready; only its beginning goes out.
    assert_eq!(bench.answer().len() as u32, length);
    ensure(&bench, 1)?;
    // The transmitter is sound again: the board can still send, and reports.
    bench.stretch(1);
    let record = bench.faults();
    ensure(&bench, 1)?;
    if !record.active.contains(Fault::SlotOverrun) {
        return Err(format!("no fault latched: {record:?}"));
    }
    Ok(())
}

#[test]
fn hardware_ends_the_drive_of_a_transmission_that_takes_too_long_and_the_board_latches_it() {
    for kind in [JOINT, WHEEL] {
        let image = image(kind.0).expect("an image");
        // Twice, more, and long enough that no byte is over when the driver goes.
        for times in [2, 3, 100] {
            let found = limit(&image, kind, times);
            assert_eq!(found, Ok(()), "{}, {times} times as long", kind.0);
        }
    }
}

#[test]
fn a_sound_transmission_is_no_fault() {
    for kind in [JOINT, WHEEL] {
        let mut bench = BoardBench::new(image(kind.0).expect("an image"), kind);
        for _ in 0..3 {
            let record = bench.faults();
            assert!(record.active.is_empty(), "{record:?}");
        }
        assert_eq!(bench.figures.driver_timeouts, 0);
        let longest_us = MAX_ENCODED as u32 * BYTE_US + MARGIN_US;
        assert!((1..longest_us).contains(&bench.figures.driver_on_us));
    }
}

#[test]
fn an_image_without_the_limit_is_found() {
    let folder = std::env::var_os(MUTANTS).expect("run `cargo xtask pil`");
    let image = Path::new(&folder).join("mutant-driver-limit/joint.elf");
    let found = limit(&image, JOINT, 2).expect_err("the driver stays on");
    println!("{found}");
    assert!(found.starts_with("driver on for"), "{found}");
}
