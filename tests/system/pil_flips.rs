//! Flipped bits in the state of the firmware images on emulated boards: what a flip
//! changes is found within the ticks that the application promises, at whatever
//! instant it happens, on a joint and on a wheel. `cargo xtask pil` runs this,
//! `cargo xtask deep state-flips` runs many more.

use crate::bench;
use std::ops::Range;

use crate::bench::pil::{Board, edge};
use crate::bench::{closed_loop, delivery, frame, numbered, power_up, sync_frame};
use wheeleg_protocol::{
    Address, Arm, ClearFault, Decoder, Fault, FaultReport, LinkReport, Message, SCHEMA_HASH,
    SyncSlots, TransmitPosition, WheelSetpoint,
};
use wheeleg_remote_host::unicorn::image;
use wheeleg_remote_link::{Hook, Inputs, Outputs, Power, Ran, Reply, Request, Run, text};
use wheeleg_tests::{STEP, mix};
use wheeleg_units::WheelCount;

/// Times as many flips as in the suite.
const TIMES_VARIABLE: &str = "WHEELEG_FLIP_TIMES";
const BYTE_NS: u64 = 10_000;

/// Puts a request to the board.
type Ask<'a> = dyn FnMut(&Request) -> Reply + 'a;

/// One board and its motion while bits of it flip.
struct Subject {
    /// Its image.
    image: &'static str,
    address: u8,
    /// Runs it, with all requests through the function.
    timeline: fn(&mut Ask<'_>),
    /// Edges at which flips happen: from arming until there is too little left to see.
    flip_edges: Range<u64>,
    /// Its tick, ns.
    period_ns: u64,
    /// Ticks of a bus cycle, rounded up.
    cycle: usize,
    /// Ticks in which the watchdog resets it, with a margin.
    reset: usize,
    /// Flips in the suite.
    flips: u64,
    /// Share of the flips that hit sealed state which holds the board within two ticks, as
    /// `cargo xtask deep state-flips` has measured it; the rest of the bytes is copied, waits,
    /// or is sealed in parts.
    sealed: f64,
}

/// A joint that goes from one set-point to another, ticks of 1 ms.
const JOINT: Subject = Subject {
    image: "joint",
    address: bench::ADDRESS,
    timeline: |ask| drop(closed_loop(480, ask)),
    flip_edges: 120..330,
    period_ns: 1_000_000,
    cycle: 10,
    reset: 60,
    flips: 200,
    sealed: 0.24,
};

/// A wheel that follows a moving set-point, samples of 520 µs.
const WHEEL: Subject = Subject {
    image: "wheel",
    address: WHEEL_ADDRESS,
    timeline: follow,
    flip_edges: 240..680,
    period_ns: SAMPLE_NS,
    cycle: 20,
    reset: 120,
    flips: 320,
    sealed: 0.11,
};

/// The second wheel: it has no dump valve, which acts at once.
const WHEEL_ADDRESS: u8 = 8;
const SAMPLE_NS: u64 = 520_000;
/// Target speed of the wheel, counts/s.
const SPEED: f64 = 5_000.0;
/// Speed at full drive, counts/s, and the time in which it comes (ASSUMED: any motor
/// that the loop can hold will do).
const FULL_SPEED: f64 = 20_000.0;
const MOTOR_S: f64 = 0.05;

/// A wheel board with a motor of the first order: armed at 105 ms, set-points that move
/// from 150 ms on, until 420 ms.
fn follow(ask: &mut Ask<'_>) {
    let address = Address::wheel(WHEEL_ADDRESS).expect("a wheel");
    let arm = frame(
        address,
        &Message::Arm(Arm {
            schema_hash: SCHEMA_HASH,
        }),
    );
    let mut line: Vec<(u64, Vec<u8>)> = (0..42)
        .map(|cycle| (cycle * 10_000_000, set_point(cycle, address)))
        .chain([(105_000_000, arm)])
        .collect();
    line.sort();
    let mut line = line.into_iter().peekable();
    let (mut speed, mut angle) = (0.0_f64, 0.0_f64);
    ask(&power_up(WHEEL_ADDRESS));
    for edge_ns in (0..808).map(|sample| sample * SAMPLE_NS) {
        let end = |(start, bytes): &(u64, Vec<u8>)| start + bytes.len() as u64 * BYTE_NS;
        while let Some(sent) = line.next_if(|sent| end(sent) <= edge_ns) {
            ask(&delivery(&sent.1, end(&sent)));
        }
        let edge = Run {
            until_ns: edge_ns,
            edge: Some(Inputs {
                encoder: angle as i32,
                ..Inputs::default()
            }),
            ..Run::default()
        };
        if let Reply::Ran(ran) = ask(&Request::Run(edge)) {
            let drive = f64::from(ran.outputs.bridge_percent) / 100.0;
            let sign = if ran.outputs.bridge_backward {
                -1.0
            } else {
                1.0
            };
            let dt_s = SAMPLE_NS as f64 * 1e-9;
            speed += (sign * drive * FULL_SPEED - speed) * dt_s / MOTOR_S;
            angle += speed * dt_s;
        }
    }
}

/// The SYNC of a cycle.
fn set_point(cycle: u64, address: Address) -> Vec<u8> {
    let moving_s = (cycle as f64 * 0.01 - 0.150).max(0.0);
    let per_sample = SPEED * SAMPLE_NS as f64 * 1e-9;
    let velocity = if moving_s > 0.0 { per_sample } else { 0.0 };
    let mut slots = SyncSlots::NONE;
    let set = slots.set_wheel(
        address,
        WheelSetpoint {
            reference: WheelCount::wrapping_new((SPEED * moving_s) as i32),
            velocity_raw: (velocity * 16.0).round() as i16,
            track: true,
        },
    );
    assert!(set);
    sync_frame(cycle, slots)
}

/// A bit of the application's state and the edge before which it flips.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Flip {
    edge: u64,
    offset: u32,
    bit: u8,
}

impl Flip {
    fn new(number: u64, subject: &Subject, size: u32) -> Self {
        let random = mix(number.wrapping_add(1).wrapping_mul(STEP));
        let instants = subject.flip_edges.end - subject.flip_edges.start;
        Self {
            edge: subject.flip_edges.start + (random >> 40) % instants,
            offset: (random >> 8) as u32 % size,
            bit: (random & 7) as u8,
        }
    }
}

/// Result of a flip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Came {
    /// The outputs are off from the second tick after it on.
    Held,
    /// They are off in the second tick after the next SYNC, which did not fit.
    HeldBySync,
    /// The board did exactly the same as without the flip.
    Nothing,
    /// The processor was reset, and its outputs are off from then on.
    Reset,
    /// The board took the link for lost within two ticks, says so, and reacts as to a lost link: a wheel's
    /// drive falls, and turns nowhere.
    LinkLost,
    /// It hit the decoder of the bus: the board does exactly what it does when the
    /// next frame is lost on the line, and has counted that frame as a broken one.
    FrameLost,
    /// Anything else.
    Changed,
}

/// Driven outputs; a bridge at zero has no direction.
fn driven(outputs: &Outputs) -> [u16; 6] {
    let [a, b, c, d] = outputs.valve_on_us;
    let backward = outputs.bridge_backward && outputs.bridge_percent > 0;
    [a, b, c, d, outputs.bridge_percent.into(), backward.into()]
}

const OFF: [u16; 6] = [0; 6];

/// Event of a board in its timeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Incident {
    None,
    Flip(Flip),
    /// The delivery with this number, from 0, gets lost on the line.
    Lost(usize),
}

/// Record of a board's behaviour.
#[derive(Debug, Clone, PartialEq)]
struct Timeline {
    /// Its outputs from edge to edge.
    driving: Vec<[u16; 6]>,
    /// Edges before each delivery.
    delivered: Vec<usize>,
    reset: bool,
    /// Sound and broken frames that it reports as heard.
    heard: Option<[u32; 2]>,
    /// The first fault that it reports, and when it was found, ns.
    fault: Option<(Fault, u64)>,
}

fn run_timeline(subject: &Subject, incident: Incident) -> Timeline {
    let mut board = Board::new(image(subject.image).expect("an image"));
    let mut did = Timeline {
        driving: Vec::new(),
        delivered: Vec::new(),
        reset: false,
        heard: None,
        fault: None,
    };
    let mut now_ns = 0;
    (subject.timeline)(&mut |request| {
        let ticks = match request {
            Request::Run(run) => {
                now_ns = run.until_ns;
                if run.edge.is_none() {
                    did.delivered.push(did.driving.len());
                    if incident == Incident::Lost(did.delivered.len() - 1) {
                        return Reply::Ran(Ran::default());
                    }
                }
                run.edge.is_some()
            }
            _ => false,
        };
        if let (true, Incident::Flip(flip)) = (ticks, incident)
            && did.driving.len() as u64 == flip.edge
        {
            let hook = Hook::FlipBit {
                symbol: text("NODE"),
                address: flip.offset,
                bit: flip.bit,
            };
            assert_eq!(board.ask(&Request::Hook(hook)), Reply::Done);
        }
        let reply = board.ask(request);
        if let Reply::Ran(ran) = &reply {
            did.reset |= ran.trip.is_some();
            if ticks {
                did.driving.push(driven(&ran.outputs));
            }
        }
        reply
    });
    for answer in ask_both(&mut board, subject, now_ns) {
        match answer {
            Message::LinkRecord(link) => did.heard = Some([link.frames, link.errors()]),
            Message::FaultRecord(record) => {
                let first = record.first_fault.fault();
                did.fault = first.map(|fault| (fault, 1_000 * u64::from(record.first_time_us)));
            }
            _ => {}
        }
    }
    did
}

/// The board's answers after its last edge to questions about frames heard and faults.
fn ask_both(board: &mut Board, subject: &Subject, mut edge_ns: u64) -> Vec<Message> {
    let address = Address::new(subject.address).expect("a board");
    let mut answers = Vec::new();
    let questions: [Message; 2] = [LinkReport {}.into(), FaultReport {}.into()];
    for (number, question) in (2..).zip(&questions) {
        let request = numbered(number, address, question);
        let reply = board.ask(&delivery(&request, edge_ns + subject.period_ns / 2));
        if let Reply::Ran(ran) = reply {
            for sent in &ran.sent {
                Decoder::new().push_slice(&sent.bytes, |frame| {
                    answers.extend(Message::parse(&frame.expect("sound")));
                });
            }
        }
        // Until the answer is out.
        for _ in 0..2 {
            edge_ns += subject.period_ns;
            board.ask(&edge(edge_ns, Power::Good));
        }
    }
    answers
}

/// Whether the board took the link for lost at once and let its drive fall.
fn took_the_link_for_lost(subject: &Subject, flip: Flip, flipped: &Timeline) -> bool {
    let at = flip.edge as usize;
    let within = (flip.edge * subject.period_ns..=(flip.edge + 2) * subject.period_ns)
        .contains(&flipped.fault.map_or(0, |(_, at_ns)| at_ns));
    let named = matches!(
        flipped.fault,
        Some((Fault::LinkLost | Fault::StaleMaster, _))
    );
    let falls = |pair: &[[u16; 6]]| {
        let ([.., before, was], [.., after, is]) = (pair[0], pair[1]);
        after <= before && (is == was || after == 0)
    };
    let rest = &flipped.driving[at + 2..];
    // A wheel may ramp to its standstill; valves are shut at once.
    let shut = rest.iter().all(|driving| driving[..4] == OFF[..4]);
    within && named && shut && rest.windows(2).all(falls)
}

/// Whether the board did the same as when the first frame after the flip is lost, and counted that frame as
/// broken.
fn lost_one_frame(subject: &Subject, baseline: &Timeline, flip: Flip, flipped: &Timeline) -> bool {
    let next = baseline
        .delivered
        .iter()
        .position(|edges| *edges > flip.edge as usize);
    let Some((next, [frames, errors])) = next.zip(baseline.heard) else {
        return false;
    };
    flipped.heard == Some([frames - 1, errors + 1])
        && run_timeline(subject, Incident::Lost(next)).driving == flipped.driving
}

fn judge(subject: &Subject, baseline: &Timeline, flip: Flip) -> Came {
    let flipped = run_timeline(subject, Incident::Flip(flip));
    let at = flip.edge as usize;
    assert_eq!(
        baseline.driving[..at],
        flipped.driving[..at],
        "equal up to {flip:?}"
    );
    // An emulator that has stopped says nothing about the rest.
    let whole = flipped.driving.len() == baseline.driving.len();
    // The edge after the flip still shows outputs prepared before it.
    let off = |from: usize| whole && flipped.driving[from..].iter().all(|d| *d == OFF);
    match () {
        () if flipped.driving == baseline.driving => Came::Nothing,
        () if flipped.reset && off(at + subject.reset) => Came::Reset,
        () if off(at + 2) => Came::Held,
        () if off(at + 2 + subject.cycle) => Came::HeldBySync,
        () if whole && took_the_link_for_lost(subject, flip, &flipped) => Came::LinkLost,
        () if lost_one_frame(subject, baseline, flip, &flipped) => Came::FrameLost,
        () => Came::Changed,
    }
}

fn every_flip_is_found_or_does_nothing(subject: &Subject) {
    let baseline = run_timeline(subject, Incident::None);
    assert!(!baseline.reset);
    let [frames, errors] = baseline.heard.expect("an answer");
    assert_eq!((frames as usize, errors), (baseline.delivered.len() + 1, 0));
    for part in [
        subject.flip_edges.start as usize,
        subject.flip_edges.end as usize,
    ] {
        let busy = baseline.driving[part..]
            .iter()
            .filter(|driving| **driving != OFF);
        assert!(
            busy.count() > 20,
            "at work after {part}, or no flip could show"
        );
    }
    let times = std::env::var(TIMES_VARIABLE).map_or(1, |times| times.parse().expect("a number"));
    let flips = subject.flips * times;
    let size = object_size(subject.image, "NODE");
    let mut outcomes: Vec<(Flip, Came)> = in_two_halves(flips, |number| {
        let flip = Flip::new(number, subject, size);
        (flip, judge(subject, &baseline, flip))
    });
    outcomes.sort_by_key(|(flip, _)| (flip.edge, flip.offset, flip.bit));
    let count = |came: Came| outcomes.iter().filter(|(_, c)| *c == came).count() as u64;
    let changed: Vec<Flip> = outcomes
        .iter()
        .filter(|(_, came)| *came == Came::Changed)
        .map(|(flip, _)| *flip)
        .collect();
    let held = count(Came::Held);
    println!(
        "{}: {flips} flips in {size} bytes at edges {:?}: {held} held within 2 ticks, \
         {} by the next SYNC, {} without effect, {} reset, {} took the link for lost, {} lost a frame and counted it, \
         {} other {changed:?}",
        subject.image,
        subject.flip_edges,
        count(Came::HeldBySync),
        count(Came::Nothing),
        count(Came::Reset),
        count(Came::LinkLost),
        count(Came::FrameLost),
        changed.len()
    );
    // At most three standard deviations below this share of draws: the flips do hit sealed state.
    let (draws, share) = (flips as f64, subject.sealed);
    let spread = 3.0 * (draws * share * (1.0 - share)).sqrt();
    assert!(
        held as f64 > draws * share - spread,
        "{held} of {flips} held, expected are {:.0}, less {spread:.0} at most",
        draws * share
    );
    assert_eq!(changed, [], "neither found nor without effect");
}

#[test]
fn a_flipped_bit_in_a_joint_is_found_or_does_nothing() {
    every_flip_is_found_or_does_nothing(&JOINT);
}

#[test]
fn a_flipped_bit_in_a_wheel_is_found_or_does_nothing() {
    every_flip_is_found_or_does_nothing(&WHEEL);
}

/// Edges of a wheel at which its count is well beyond the 16 bits of its counter.
const TURNED: u64 = 60;
/// Counts of each sample until then.
const COUNTS: i32 = 5_000;

/// Error of a wheel's reported position once a flip of bit 17 of this word of its application has been found
/// and its fault cleared: its count less the true one. `None` without an answer: it was reset, or can no
/// longer be reached.
fn error_after_clear(word: u32) -> Option<i32> {
    let address = Address::wheel(WHEEL_ADDRESS).expect("a wheel");
    let mut board = Board::new(image("wheel").expect("an image"));
    board.ran(&power_up(WHEEL_ADDRESS));
    let (mut sample, mut reset) = (0, false);
    let mut turn = |board: &mut Board, samples: u64| {
        for _ in 0..samples {
            sample += 1;
            let run = Run {
                until_ns: sample * SAMPLE_NS,
                edge: Some(Inputs {
                    encoder: sample.min(TURNED) as i32 * COUNTS,
                    ..Inputs::default()
                }),
                ..Run::default()
            };
            match board.ask(&Request::Run(run)) {
                Reply::Ran(ran) => reset |= ran.trip.is_some(),
                _ => reset = true,
            }
        }
        (sample * SAMPLE_NS, reset)
    };
    turn(&mut board, TURNED + 4);
    let hook = Hook::FlipBit {
        symbol: text("NODE"),
        address: 4 * word + 2,
        bit: 1,
    };
    assert_eq!(board.ask(&Request::Hook(hook)), Reply::Done);
    let (mut edge_ns, mut was_reset) = turn(&mut board, 20);
    // The first question may be lost to a flip in the decoder.
    let questions: [Message; 3] = [
        ClearFault {}.into(),
        ClearFault {}.into(),
        TransmitPosition {}.into(),
    ];
    let mut found = None;
    for (number, question) in (2..).zip(&questions) {
        let request = numbered(number, address, question);
        let reply = board.ask(&delivery(&request, edge_ns + SAMPLE_NS / 2));
        if let Reply::Ran(ran) = reply {
            for sent in &ran.sent {
                Decoder::new().push_slice(&sent.bytes, |frame| {
                    if let Ok(Ok(Message::Position(position))) = frame.map(|f| Message::parse(&f)) {
                        found = Some(position.position_raw);
                    }
                });
            }
        }
        (edge_ns, was_reset) = turn(&mut board, 4);
    }
    let true_count = TURNED as i32 * COUNTS;
    found.filter(|_| !was_reset).map(|raw| raw - true_count)
}

#[test]
fn a_wheel_knows_its_position_when_the_fault_of_a_flipped_bit_is_cleared() {
    let words = object_size("wheel", "NODE") / 4;
    let errors = in_two_halves(u64::from(words), |word| {
        (word, error_after_clear(word as u32))
    });
    let wrong: Vec<_> = errors
        .iter()
        .filter(|(_, e)| e.is_some_and(|e| e != 0))
        .collect();
    let silent = errors.iter().filter(|(_, error)| error.is_none()).count();
    println!(
        "{words} words, {silent} without an answer, {} wrong: {wrong:?}",
        wrong.len()
    );
    assert!(wrong.is_empty(), "{wrong:?}");
    assert!(
        silent * 20 < words as usize,
        "{silent} of {words} without an answer"
    );
}

/// Results of `judge` for each number below `count`, on two boards at a time; which one takes a number
/// changes nothing.
fn in_two_halves<T: Send>(count: u64, judge: impl Fn(u64) -> T + Sync) -> Vec<T> {
    std::thread::scope(|scope| {
        let judge = &judge;
        let halves = [0, 1].map(|half| {
            let mine = (half..count).step_by(2);
            scope.spawn(move || mine.map(judge).collect::<Vec<_>>())
        });
        let joined = halves.map(|half| half.join().expect("a half"));
        joined.into_iter().flatten().collect()
    })
}

/// Size of a variable in an image, bytes.
fn object_size(of: &str, name: &str) -> u32 {
    use object::{Object as _, ObjectSymbol as _};
    let bytes = std::fs::read(image(of).expect("an image")).expect("read");
    let elf = object::File::parse(&*bytes).expect("ELF");
    let found = elf
        .symbols()
        .find(|symbol| symbol.name().is_ok_and(|n| n.contains(name)) && symbol.size() > 500);
    found.unwrap_or_else(|| panic!("no variable {name}")).size() as u32
}
