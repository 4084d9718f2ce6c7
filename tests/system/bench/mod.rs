//! One joint board on a bench: its cylinder, and a script in place of the master.
//!
//! Any endpoint of the board link can be the board, so the same closed loop runs with the application in this
//! process, on an emulator, or at the other end of a serial port.

// Every test program uses another part of this module.
#![allow(dead_code)]

#[cfg(feature = "pil")]
pub(crate) mod pil;

use heapless::Vec as Short;
use wheeleg_plant::axis::Axis;
use wheeleg_plant::testing::wheeleg_2003_axis;
use wheeleg_protocol::{
    Address, Arm, Envelope, JointSetpoint, LinkLossAction, MAX_ENCODED, Message, SCHEMA_HASH, Sync,
    SyncFlags, SyncSlots,
};
use wheeleg_remote::{JointPins, RemoteJoint, Session, Stopwatch};
use wheeleg_remote_link::{Figures, Inputs, Ran, Reply, Request, Run, Straps};
use wheeleg_units::{Micros, PositionMm, WireVelocity};

/// The board of the bench.
pub(crate) const ADDRESS: u8 = 1;
/// Set-points of the script: from the time in ms on, the stroke in mm.
pub(crate) const SCRIPT: [(u64, f64); 3] = [(0, 90.0), (200, 120.0), (1_200, 60.0)];
/// Length of the script, ms.
pub(crate) const SCRIPT_MS: u64 = 2_200;

const MS: u64 = 1_000_000;
const BYTE_NS: u64 = 10_000;

/// A stopwatch for code that takes no simulated time.
pub(crate) struct NoTime;

impl Stopwatch for NoTime {
    fn tick_begins(&mut self) {}

    fn tick_ended(&mut self) -> Micros {
        Micros::ZERO
    }
}

/// Everything that crossed the board's edge.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Trace {
    /// Every reply, without the measurements of the processor.
    pub replies: Vec<Ran>,
    /// Measured strokes at every tick, mm.
    pub stroke_mm: Vec<f64>,
}

/// Closes the loop with the board that `ask` reaches: it must follow its set-points, and
/// do so as the application in this process does, bit for bit.
pub(crate) fn closed_loop_as_the_host(ask: impl FnMut(&Request) -> Reply) -> Trace {
    let trace = closed_loop(SCRIPT_MS, ask);
    assert_follows(&trace);
    let pins = JointPins::default();
    let mut session = Session::<RemoteJoint<'_>>::new(&pins, "this process", 0);
    let here = closed_loop(SCRIPT_MS, |request| session.answer(request, &mut NoTime));
    assert_same(&trace, &here);
    trace
}

pub(crate) fn frame(destination: Address, message: &Message) -> Vec<u8> {
    numbered(1, destination, message)
}

/// A frame of the master with a number of its own: a board answers each once.
pub(crate) fn numbered(sequence: u16, destination: Address, message: &Message) -> Vec<u8> {
    let envelope = Envelope {
        source: Address::MASTER,
        destination,
        sequence,
    };
    let mut buffer = [0; MAX_ENCODED];
    message.emit(envelope, &mut buffer).expect("fits").to_vec()
}

fn sync(cycle: u64, script: &[(u64, f64)]) -> Vec<u8> {
    let address = Address::joint(ADDRESS).expect("a joint");
    let now_ms = 10 * cycle;
    let (_, stroke_mm) = script
        .iter()
        .rev()
        .find(|(from_ms, _)| *from_ms <= now_ms)
        .expect("begins at 0");
    let mut slots = SyncSlots::NONE;
    let set = slots.set_joint(
        address,
        JointSetpoint {
            reference: PositionMm::from_f64(*stroke_mm),
            velocity: WireVelocity::ZERO,
            next: None,
            on_link_loss: LinkLossAction::Hold,
            track: true,
        },
    );
    assert!(set);
    sync_frame(cycle, slots)
}

/// The SYNC of a cycle of 10 ms.
pub(crate) fn sync_frame(cycle: u64, slots: SyncSlots) -> Vec<u8> {
    let message = Message::Sync(Sync {
        cycle: cycle as u16,
        flags: SyncFlags::NONE,
        master_time_us: (cycle * 10_000) as u32,
        slots,
    });
    frame(Address::BROADCAST, &message)
}

/// Bytes that have come in by `until_ns`, without an edge.
pub(crate) fn delivery(bytes: &[u8], until_ns: u64) -> Request {
    Request::Run(Run {
        until_ns,
        received: Short::from_slice(bytes).expect("fits"),
        received_end_ns: until_ns,
        byte_ns: BYTE_NS as u32,
        ..Run::default()
    })
}

/// Power-up of the bench's board.
pub(crate) fn power_up(address: u8) -> Request {
    Request::PowerUp(Straps {
        address,
        unique_id: [address; 12],
        crystal: true,
    })
}

fn ran(reply: Reply) -> Ran {
    match reply {
        Reply::Ran(ran) => Ran {
            // How long the code took is the processor's affair.
            figures: Figures::default(),
            ..ran
        },
        other => panic!("{other:?}"),
    }
}

/// Runs the script for `duration_ms` with the board that `ask` reaches.
pub(crate) fn closed_loop(duration_ms: u64, ask: impl FnMut(&Request) -> Reply) -> Trace {
    script(&SCRIPT, duration_ms, ask)
}

/// Runs set-points, as in [`SCRIPT`], for `duration_ms` with the board that `ask`
/// reaches: power-up at mid-stroke, arming at 100 ms, then the set-points.
pub(crate) fn script(
    script: &[(u64, f64)],
    duration_ms: u64,
    mut ask: impl FnMut(&Request) -> Reply,
) -> Trace {
    let mut params = wheeleg_2003_axis();
    params.initial_stroke_m = 0.09;
    let axis = Axis::new(&params).expect("the bench");
    let mut state = axis.initial_state(7);
    let mut trace = Trace::default();
    let address = Address::joint(ADDRESS).expect("a joint");
    trace.replies.push(ran(ask(&power_up(ADDRESS))));
    for ms in 0..duration_ms {
        let inputs = Inputs {
            adc: axis.read_position(&mut state),
            ..Inputs::default()
        };
        let edge = Request::Run(Run {
            until_ns: ms * MS,
            edge: Some(inputs),
            ..Run::default()
        });
        let reply = ran(ask(&edge));
        axis.tick(&mut state, reply.outputs.valve_on_us)
            .expect("physical");
        trace.stroke_mm.push(axis.outputs(&state).stroke_m * 1e3);
        trace.replies.push(reply);
        if ms % 10 == 1 {
            // Begun at the last edge; 102 bytes end just behind this one.
            let bytes = sync(ms / 10, script);
            let end_ns = (ms - 1) * MS + bytes.len() as u64 * BYTE_NS;
            assert!((ms * MS..(ms + 1) * MS).contains(&end_ns), "{end_ns}");
            trace.replies.push(ran(ask(&delivery(&bytes, end_ns))));
        }
        if ms == 105 {
            let arm = Message::Arm(Arm {
                schema_hash: SCHEMA_HASH,
            });
            let bytes = frame(address, &arm);
            trace
                .replies
                .push(ran(ask(&delivery(&bytes, ms * MS + 500_000))));
        }
    }
    trace
}

/// The loop was closed: the cylinder came to rest at the set-points.
fn assert_follows(trace: &Trace) {
    for (from_ms, target_mm) in SCRIPT {
        let until = SCRIPT.iter().map(|(ms, _)| *ms).find(|ms| *ms > from_ms);
        let at = until.unwrap_or(SCRIPT_MS) as usize - 1;
        let error_mm = trace.stroke_mm[at] - target_mm;
        assert!(error_mm.abs() < 3.0, "at {at} ms: {error_mm:.2} mm");
    }
    let frames: usize = trace.replies.iter().map(|ran| ran.sent.len()).sum();
    // One reply per SYNC and one answer to the arming.
    assert_eq!(frames as u64, SCRIPT_MS / 10 + 1);
}

/// Both boards did the same; names the first reply that differs.
pub(crate) fn assert_same(ours: &Trace, theirs: &Trace) {
    let pairs = ours.replies.iter().zip(&theirs.replies).enumerate();
    for (i, (our, their)) in pairs {
        assert!(our == their, "reply {i}: {our:?}\nand {their:?}");
    }
    assert_eq!(ours.replies.len(), theirs.replies.len());
    assert!(
        ours.stroke_mm == theirs.stroke_mm,
        "the cylinder moved otherwise"
    );
}
