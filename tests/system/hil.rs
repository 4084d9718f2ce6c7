//! Hardware in the loop through a pair of pseudo-terminals: the board is the
//! session of the hardware-in-the-loop images, in a thread of this program.
#![cfg(unix)]

mod bench;

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serialport::{SerialPort as _, TTYPort};
use wheeleg_remote::{JointPins, RemoteJoint, RemoteWheel, Session, Stream, WheelPins, serve};
use wheeleg_remote_host::RemoteError;
use wheeleg_remote_host::Transport;
use wheeleg_remote_host::serial::{HilOptions, SerialLine, connect};
use wheeleg_remote_link::frame::MAX_FRAME;
use wheeleg_remote_link::{Hello, Image, LINK_VERSION, Reply, Request, encode};

use bench::{NoTime, assert_same, closed_loop, closed_loop_as_the_host};

/// The board's end of the line. It goes silent or vanishes after a number of requests.
struct BoardEnd {
    port: TTYPort,
    requests_left: Arc<AtomicU64>,
}

impl Stream for BoardEnd {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        loop {
            match self.port.read(buffer) {
                Ok(count) => return count,
                // No request for a while: the test is over if it has let go.
                Err(e) if e.kind() == std::io::ErrorKind::TimedOut => {
                    if self.requests_left.load(Ordering::Relaxed) == 0 {
                        return 0;
                    }
                }
                Err(_) => return 0,
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> bool {
        let left = self.requests_left.load(Ordering::Relaxed);
        self.requests_left
            .store(left.saturating_sub(1), Ordering::Relaxed);
        // The board's end is closed in mid-run: the port has vanished.
        left > 0 && self.port.write_all(bytes).is_ok()
    }
}

/// A board on a pseudo-terminal of its own.
struct BoardBench {
    options: HilOptions,
    requests_left: Arc<AtomicU64>,
    board: Option<JoinHandle<()>>,
}

impl BoardBench {
    /// What `run` makes of the board's end; it answers `requests` requests
    /// before its port vanishes.
    fn new(requests: u64, run: impl FnOnce(BoardEnd) + Send + 'static) -> Self {
        let (mut port, other) = TTYPort::pair().expect("a pair of pseudo-terminals");
        let path = other.name().expect("has a name");
        // The simulator opens it by name, and locks it; this handle, which has no
        // lock, keeps it alive before and after.
        let keep = File::options().read(true).write(true).open(&path);
        let keep = keep.expect("opens by name");
        drop(other);
        port.set_timeout(Duration::from_millis(50)).expect("set");
        let requests_left = Arc::new(AtomicU64::new(requests));
        let end = BoardEnd {
            port,
            requests_left: Arc::clone(&requests_left),
        };
        let board = thread::spawn(move || {
            run(end);
            drop(keep);
        });
        let options = HilOptions::parse(&path).expect("a port");
        Self {
            options: HilOptions {
                patience: Duration::from_millis(500),
                ..options
            },
            requests_left,
            board: Some(board),
        }
    }
}

impl Drop for BoardBench {
    fn drop(&mut self) {
        self.requests_left.store(0, Ordering::Relaxed);
        if let Some(board) = self.board.take() {
            let ended = board.join();
            assert!(ended.is_ok() || thread::panicking(), "the board panicked");
        }
    }
}

fn joint_board(mut end: BoardEnd) {
    let pins = JointPins::default();
    let mut session = Session::<RemoteJoint<'_>>::new(&pins, "bench", 0);
    serve(&mut session, &mut end, &mut NoTime);
}

fn wheel_board(mut end: BoardEnd) {
    let pins = WheelPins::default();
    let mut session = Session::<RemoteWheel<'_>>::new(&pins, "bench", 0);
    serve(&mut session, &mut end, &mut NoTime);
}

fn ask(partner: &mut Transport<SerialLine>, request: &Request) -> Reply {
    partner.ask(request).expect("the board answers")
}

/// Message and advice of an error.
fn said(error: &RemoteError) -> String {
    let RemoteError { what, help } = error;
    format!("{what} | {help}")
}

#[test]
fn the_loop_over_the_port_gives_the_bits_of_the_loop_without_it() {
    let bench = BoardBench::new(u64::MAX, joint_board);
    let (mut partner, hello) = connect(&bench.options, "joint").expect("a joint board");
    assert!(hello.outputs_are_virtual);
    let trace = closed_loop_as_the_host(|request| ask(&mut partner, request));
    // Every request of the loop and the first call were timed.
    let statistics = partner.into_stream().statistics();
    assert_eq!(statistics.exchanges, trace.replies.len() as u64 + 1);
    assert!(statistics.longest <= statistics.waited);
}

#[test]
fn a_board_can_be_asked_anew_after_its_partner_has_gone() {
    let bench = BoardBench::new(u64::MAX, joint_board);
    let first = {
        let (mut partner, _) = connect(&bench.options, "joint").expect("a joint board");
        closed_loop(50, |request| ask(&mut partner, request))
    };
    {
        // A partner that dies in the middle of a message.
        let (mut partner, _) = connect(&bench.options, "joint").expect("a joint board");
        ask(&mut partner, &bench::power_up(1));
        let mut frame = [0; MAX_FRAME];
        let whole = encode(0, &bench::power_up(1), &mut frame).expect("fits");
        let mut line = partner.into_stream();
        wheeleg_remote_host::Stream::send(&mut line, &whole[..whole.len() / 2]).expect("sent");
    }
    let (mut partner, _) = connect(&bench.options, "joint").expect("a joint board");
    let second = closed_loop(50, |request| ask(&mut partner, request));
    // Nothing is left of the sessions before.
    assert_same(&first, &second);
}

#[test]
fn a_port_that_vanishes_in_mid_run_ends_it_with_an_error_that_names_it() {
    let bench = BoardBench::new(100, joint_board);
    let (mut partner, _) = connect(&bench.options, "joint").expect("a joint board");
    let mut answered = 0;
    let error = loop {
        match partner.ask(&bench::power_up(1)) {
            Ok(reply) => {
                assert!(matches!(reply, Reply::Ran(_)), "{reply:?}");
                answered += 1;
            }
            Err(error) => break said(&error),
        }
    };
    assert_eq!(answered, 99, "one request was the call");
    assert!(error.contains(&bench.options.port), "{error}");
    for words in [
        "cable and power",
        "start the run again",
        "logged up to here is complete",
    ] {
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn a_board_that_falls_silent_is_given_up_after_the_patience() {
    let bench = BoardBench::new(u64::MAX, |mut end| {
        let pins = JointPins::default();
        let mut session = Session::<RemoteJoint<'_>>::new(&pins, "bench", 0);
        let mut some = Few {
            end: &mut end,
            answers: 10,
        };
        serve(&mut session, &mut some, &mut NoTime);
    });
    let (mut partner, _) = connect(&bench.options, "joint").expect("a joint board");
    for _ in 1..10 {
        ask(&mut partner, &bench::power_up(1));
    }
    let error = partner.ask(&bench::power_up(1)).expect_err("silence");
    let error = said(&error);
    assert!(error.contains("has not answered for 0.5 s"), "{error}");
    assert!(error.contains("power and its cable"), "{error}");
    assert!(error.contains(&bench.options.port), "{error}");
}

/// A board that takes every request and answers the first few.
struct Few<'e> {
    end: &'e mut BoardEnd,
    answers: u32,
}

impl Stream for Few<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        self.end.read(buffer)
    }

    fn write(&mut self, bytes: &[u8]) -> bool {
        if self.answers == 0 {
            return true;
        }
        self.answers -= 1;
        self.end.write(bytes)
    }
}

#[test]
fn other_images_are_refused_by_the_handshake() {
    // Another application.
    let bench = BoardBench::new(u64::MAX, wheel_board);
    let error = said(&connect(&bench.options, "joint").expect_err("a wheel"));
    assert!(
        error.contains("`wheel`") && error.contains("joint-hil"),
        "{error}"
    );
    drop(bench);

    // A plain image: nothing listens on this port.
    let bench = BoardBench::new(u64::MAX, |mut end| {
        let mut swallowed = [0; 64];
        while end.read(&mut swallowed) > 0 {}
    });
    let error = said(&connect(&bench.options, "joint").expect_err("silence"));
    assert!(error.contains("no hardware-in-the-loop image"), "{error}");
    assert!(error.contains("joint-hil"), "{error}");
    drop(bench);

    // A talking device that is no board.
    let bench = BoardBench::new(u64::MAX, |mut end| {
        let mut swallowed = [0; 64];
        while end.read(&mut swallowed) > 0 && end.write(b"login: \0\0") {}
    });
    let error = said(&connect(&bench.options, "joint").expect_err("rubbish"));
    assert!(error.contains("not a message of the board link"), "{error}");
    drop(bench);

    // The same image of another version, and one that drives real outputs.
    for (version, virtual_outputs, expected) in [
        (LINK_VERSION + 1, true, "version"),
        (LINK_VERSION, false, "drives real outputs"),
    ] {
        let bench = BoardBench::new(u64::MAX, move |end| {
            answer_hello(end, version, virtual_outputs);
        });
        let error = said(&connect(&bench.options, "joint").expect_err(expected));
        assert!(error.contains(expected), "{error}");
    }
}

/// A board that answers anything with the same introduction.
fn answer_hello(mut end: BoardEnd, version: u16, outputs_are_virtual: bool) {
    let hello = Reply::Hello(Hello {
        version,
        image: Image {
            name: "joint".try_into().expect("fits"),
            digest: [0; 16],
            clock_hz: 0,
        },
        host: "a stranger".try_into().expect("fits"),
        outputs_are_virtual,
    });
    let mut frame = [0; MAX_FRAME];
    let frame = encode(0, &hello, &mut frame).expect("fits").to_vec();
    let mut request = [0; MAX_FRAME];
    loop {
        let count = end.read(&mut request);
        // The end of a frame, but for the zero that ends a former partner's.
        let asked = count > 1 && request[..count].ends_with(&[0]);
        if count == 0 || (asked && !end.write(&frame)) {
            return;
        }
    }
}

#[test]
fn a_port_that_does_not_exist_is_named() {
    let options = HilOptions::parse("/dev/no-such-port").expect("a port");
    let error = said(&connect(&options, "joint").expect_err("missing"));
    assert!(error.contains("/dev/no-such-port"), "{error}");
    assert!(error.contains("plugged in"), "{error}");
}
