//! Time of a command from the tick at which the robot's thread takes it to the SYNC frame that carries it,
//! and to its board: in simulated time, at every place of the bus cycle.

use serde_json::json;
use wheeleg_access::request::{Order, Spoken};
use wheeleg_config::builtin;
use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::Request;
use wheeleg_master::layer0::operator::{OPERATOR_CLIENT, STOP_CLIENT};
use wheeleg_protocol::{Address, NodeMode};
use wheeleg_sim::{Boards, Session};
use wheeleg_telemetry::{Recorder, Recording};

const MS: u64 = 1_000_000;
/// Length of a bus cycle.
const CYCLE_MS: u64 = 10;
/// Bars of the specification.
const IN_SYNC_MS: u64 = 11;
const LATCHED_MS: u64 = 13;

/// A robot with somebody in control.
struct Driven {
    session: Session,
    recorder: Recorder<'static>,
    requests: u32,
}

impl Driven {
    /// Armed, in the middle of its cylinders' strokes.
    fn new() -> Self {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let scenario = builtin::scenario("three-step").expect("built in");
        let session = Session::live(Boards::default(), &scenario, &robot, 1).expect("it starts");
        let mut driven = Self {
            session,
            recorder: Recorder::in_memory(),
            requests: 0,
        };
        driven.pass(1_000);
        driven.ask(OPERATOR_CLIENT, Command::TakeControl);
        driven.pass(50);
        driven.ask(OPERATOR_CLIENT, Command::Arm);
        driven.pass(500);
        assert!(driven.session.master().is_armed());
        driven
    }

    fn ask(&mut self, client: u8, command: Command) {
        self.requests += 1;
        let request = Request {
            client,
            id: self.requests,
            deadline_us: self.session.now_ns() / 1_000 + 500_000,
            command,
        };
        let answer = self.session.request(request, &mut self.recorder);
        assert!(answer.expect("it lives").is_ok(), "{command:?}");
    }

    /// Runs ticks of the robot's thread.
    fn pass(&mut self, ms: u64) {
        for _ in 0..ms {
            self.session.beat(self.session.now_ns() / 1_000);
            let to_ns = self.session.now_ns() + MS;
            let stepped = self.session.step_to(to_ns, &mut self.recorder);
            stepped.expect("it runs");
        }
    }

    /// Runs until the condition holds; returns the time of the SYNC frame of that cycle, ns.
    fn sync_ns(&mut self, there: impl Fn(&Session) -> bool) -> u64 {
        for _ in 0..100 {
            if there(&self.session) {
                let record = self.session.record().expect("a cycle");
                return record.time_us * 1_000;
            }
            self.pass(1);
        }
        panic!("never in SYNC");
    }

    fn finish(self) -> Recording {
        self.recorder.finish().expect("in memory")
    }
}

/// As a client writes it.
fn joint_reference(stroke_mm: f64) -> Command {
    let args = json!({ "joint": 3, "stroke": stroke_mm });
    let spoken = Spoken {
        cmd: "JointReference".to_owned(),
        args: args.as_object().expect("an object").clone(),
    };
    match spoken.order() {
        Ok(Order::Robot(command)) => command,
        other => panic!("{other:?}"),
    }
}

/// Simulated ms from one time to a later one, rounded up.
fn took_ms(from_ns: u64, to_ns: u64) -> u64 {
    to_ns.checked_sub(from_ns).expect("later").div_ceil(MS)
}

#[test]
fn a_reference_is_in_sync_within_11_ms_and_latched_within_13_wherever_the_cycle_is() {
    let mut driven = Driven::new();
    let board = Address::new(3).expect("a board");
    let mut given = Vec::new();
    for place_ms in 0..CYCLE_MS {
        let stroke_mm = 100.0 + place_ms as f64;
        let taken_ns = driven.session.now_ns();
        driven.ask(OPERATOR_CLIENT, joint_reference(stroke_mm));
        let sync_ns = driven.sync_ns(|session| {
            let slots = session.record().map(|record| record.slots);
            let setpoint = slots.and_then(|slots| slots.joint(board));
            setpoint.is_some_and(|s| (s.reference.to_f64() - stroke_mm).abs() < 0.01)
        });
        given.push((taken_ns, sync_ns, stroke_mm));
        // The next one is taken a millisecond later in the cycle.
        let next_ns = taken_ns + 50 * MS + MS;
        driven.pass((next_ns - driven.session.now_ns()) / MS);
    }
    let recording = driven.finish();
    let (mut in_sync_ms, mut latched_ms) = (Vec::new(), Vec::new());
    for (taken_ns, sync_ns, stroke_mm) in given {
        let mut after = recording.joints[2]
            .iter()
            .filter(|row| row.t_ns >= taken_ns);
        let latched = after.find(|row| (row.v.commanded_mm - stroke_mm).abs() < 0.01);
        in_sync_ms.push(took_ms(taken_ns, sync_ns));
        latched_ms.push(took_ms(taken_ns, latched.expect("latched").t_ns));
    }
    println!("taken to SYNC {in_sync_ms:?} ms, to the board {latched_ms:?} ms");
    assert!(
        in_sync_ms.iter().all(|ms| *ms <= IN_SYNC_MS),
        "{in_sync_ms:?}"
    );
    assert!(
        latched_ms.iter().all(|ms| *ms <= LATCHED_MS),
        "{latched_ms:?}"
    );
    // Every place of the cycle was tried: a command that just misses a frame waits for the next one.
    let spread = in_sync_ms.iter().max().zip(in_sync_ms.iter().min());
    assert!(
        spread.is_some_and(|(max, min)| max - min >= 8),
        "{in_sync_ms:?}"
    );
    assert!(
        in_sync_ms
            .iter()
            .zip(&latched_ms)
            .all(|(sync, board)| board >= sync)
    );
}

#[test]
fn a_stop_is_in_sync_within_11_ms_and_holds_within_13_wherever_the_cycle_is() {
    let (mut in_sync_ms, mut held_ms) = (Vec::new(), Vec::new());
    for place_ms in 0..CYCLE_MS {
        let mut driven = Driven::new();
        driven.pass(place_ms);
        let taken_ns = driven.session.now_ns();
        driven.ask(STOP_CLIENT, Command::EmergencyStop);
        // The first record with the stop is that of the cycle in which it came, made as the next one begins:
        // the SYNC of that one has the bit.
        let before_ns = driven.sync_ns(|s| s.record().is_some_and(|record| record.emergency_stop));
        let sync_ns = before_ns + CYCLE_MS * MS;
        driven.pass(20);
        let recording = driven.finish();
        let hold = NodeMode::Hold.code();
        let held = recording.joints.iter().map(|rows| {
            let mut after = rows.iter().filter(|row| row.t_ns >= taken_ns);
            after.find(|row| row.v.mode == hold).expect("held").t_ns
        });
        in_sync_ms.push(took_ms(taken_ns, sync_ns));
        held_ms.push(took_ms(taken_ns, held.max().expect("six joints")));
    }
    println!("stop to SYNC {in_sync_ms:?} ms, to the last board {held_ms:?} ms");
    assert!(
        in_sync_ms.iter().all(|ms| *ms <= IN_SYNC_MS),
        "{in_sync_ms:?}"
    );
    assert!(held_ms.iter().all(|ms| *ms <= LATCHED_MS), "{held_ms:?}");
}
