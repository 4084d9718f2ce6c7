//! A master and boards joined only by a line: as on a serial port, but with a clock of the test.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use wheeleg_config::{RobotConfig, Scenario, builtin};
use wheeleg_master::command::Command;
use wheeleg_master::dispatcher::Request;
use wheeleg_master::event::{Event, HoldReason};
use wheeleg_master::master::LOCAL_CLIENT;
use wheeleg_sim::{Boards, Line, LineBoards, LineMaster, Session};
use wheeleg_telemetry::event::Cause;
use wheeleg_telemetry::{Keep, Recorder};

const MS: u64 = 1_000_000;

/// The paper's three steps on its robot.
fn three_steps() -> (Scenario, RobotConfig) {
    let scenario = Scenario {
        duration_s: 12.0,
        ..builtin::scenario("three-step").expect("built in")
    };
    (scenario, builtin::robot("wheeleg-2003").expect("built in"))
}

/// A robot is built in one piece, on a stack that has room for it.
fn with_room(test: fn()) {
    let thread = std::thread::Builder::new().stack_size(16 << 20);
    let thread = thread.spawn(test).expect("a thread");
    if let Err(panic) = thread.join() {
        std::panic::resume_unwind(panic);
    }
}

/// A line that gives bytes late and in pieces, and can be cut. Its clock is that of the boards.
struct Pipe {
    boards: LineBoards,
    recorder: Recorder<'static>,
    rng: Pcg64,
    /// Bytes on their way to the boards, and from them, with the number that are due at the next look.
    there: (Vec<u8>, usize),
    back: (Vec<u8>, usize),
    cut: bool,
}

impl Pipe {
    fn new(scenario: &Scenario, robot: &RobotConfig, seed: u64) -> Self {
        Self {
            boards: LineBoards::new(scenario, robot, 1).expect("it starts"),
            recorder: Recorder::new(Keep::nothing()),
            rng: Pcg64::seed_from_u64(seed),
            there: (Vec::new(), 0),
            back: (Vec::new(), 0),
            cut: false,
        }
    }

    /// The rest of the piece before, and a part of what has come since.
    fn piece(rng: &mut Pcg64, from: &mut Vec<u8>, rest: &mut usize) -> Vec<u8> {
        let part = rng.random_range(*rest..=from.len());
        *rest = from.len() - part;
        from.drain(..part).collect()
    }
}

impl Line for Pipe {
    fn wait(&mut self, t_ns: u64, heard: &mut dyn FnMut(&[u8], u64)) -> u64 {
        while self.boards.now_ns() < t_ns {
            let to_ns = (self.boards.now_ns() + MS / 4).min(t_ns);
            let (bytes, rest) = &mut self.there;
            let piece = Self::piece(&mut self.rng, bytes, rest);
            self.boards.hear(&piece);
            let said = self.boards.step_to(to_ns, &mut self.recorder);
            let said = said.expect("it goes on");
            if !self.cut {
                let (bytes, rest) = &mut self.back;
                bytes.extend(said);
                heard(&Self::piece(&mut self.rng, bytes, rest), to_ns);
            }
        }
        t_ns
    }

    fn send(&mut self, bytes: &[u8]) {
        if !self.cut {
            self.there.0.extend_from_slice(bytes);
        }
    }

    fn broken(&self) -> Option<&str> {
        self.cut.then_some("cut by the test")
    }
}

/// A robot at the end of a line.
struct Robot {
    master: LineMaster<Pipe>,
    recorder: Recorder<'static>,
    ms: u64,
    events: Vec<(u64, Event)>,
    requests: u32,
}

impl Robot {
    fn new(scenario: &Scenario, robot: &RobotConfig, seed: u64) -> Self {
        let pipe = Pipe::new(scenario, robot, seed);
        Self {
            master: LineMaster::new(scenario, robot, seed as u16, pipe).expect("a master"),
            recorder: Recorder::in_memory(),
            ms: 0,
            events: Vec::new(),
            requests: 0,
        }
    }

    /// One millisecond.
    fn step(&mut self) {
        self.ms += 1;
        self.master.step_to(self.ms * MS, &mut self.recorder);
        while let Some(outcome) = self.master.take_outcome() {
            self.events.push(outcome);
        }
    }

    fn give(&mut self, command: Command) {
        self.requests += 1;
        let request = Request {
            client: LOCAL_CLIENT,
            id: self.requests,
            deadline_us: self.master.now_ns() / 1_000 + 500_000,
            command,
        };
        let answer = self.master.request(request, &mut self.recorder);
        answer.unwrap_or_else(|why| panic!("{command:?}: {why:?}"));
    }

    fn until(&mut self, what: &str, done: impl Fn(&LineMaster<Pipe>) -> bool) {
        let begin = self.ms;
        while !done(&self.master) {
            self.step();
            assert!(self.ms < begin + 20_000, "not {what} in 20 s");
        }
    }

    /// From power-up to the first cycle of the gait, as the simulator's operator does it.
    fn walk(&mut self, rest_s: f64) {
        self.until("ready", |m| m.master().is_ready());
        self.give(Command::Arm);
        self.until("armed", |m| m.master().is_armed());
        self.give(Command::Stand);
        let done = self.events.len();
        while self.events.len() == done {
            self.step();
        }
        for _ in 0..(rest_s * 1e3) as u32 {
            self.step();
        }
        self.give(Command::StartGait);
    }

    fn strokes_mm(&mut self) -> [f64; 6] {
        self.master.line().boards.strokes_mm()
    }
}

/// True strokes of the simulator's three steps, every millisecond from the start of the gait.
fn simulated(scenario: &Scenario, robot: &RobotConfig) -> Vec<[f64; 6]> {
    let mut recorder = Recorder::in_memory();
    let mut session = Session::new(Boards::default(), scenario, robot, 1).expect("it starts");
    while !session.is_over() {
        let to_ns = session.now_ns() + 10 * MS;
        session.step_to(to_ns, &mut recorder).expect("it goes on");
    }
    session.finish(false, &mut recorder);
    let recording = recorder.finish().expect("in memory");
    let joints = recording.joints.each_ref();
    let times = 0..joints[0].len();
    let strokes = times.map(|t| joints.map(|joint| joint[t].v.position_mm));
    strokes.collect()
}

/// Largest distance of two series of strokes, mm, the second `late` samples behind the first.
fn apart_mm(first: &[[f64; 6]], second: &[[f64; 6]], late: usize) -> f64 {
    let pairs = first.iter().zip(&second[late..]);
    let distances = pairs.flat_map(|(a, b)| (0..6).map(move |i| (a[i] - b[i]).abs()));
    distances.fold(0.0, f64::max)
}

#[test]
fn three_steps_over_a_line_are_those_of_the_simulator() {
    with_room(|| {
        let (scenario, robot) = three_steps();
        let expected = simulated(&scenario, &robot);
        let mut split = Robot::new(&scenario, &robot, 7);
        split.walk(robot.start_up.rest_s);
        let strokes: Vec<[f64; 6]> = expected
            .iter()
            .map(|_| {
                split.step();
                split.strokes_mm()
            })
            .collect();
        // The gait begins with a bus cycle; the two runs share only its period of 10 ms.
        let shifts = (0..=10).flat_map(|late| {
            [
                apart_mm(&expected, &strokes, late),
                apart_mm(&strokes, &expected, late),
            ]
        });
        let worst_mm = shifts.fold(f64::INFINITY, f64::min);
        assert!(worst_mm <= 2.0, "{worst_mm} mm apart");
        assert!(worst_mm > 0.0, "the bytes came at other times");
        let horizontal = strokes.iter().map(|strokes| strokes[1]);
        let least_mm = horizontal.clone().fold(f64::INFINITY, f64::min);
        let most_mm = horizontal.fold(0.0, f64::max);
        assert!(
            most_mm - least_mm > 100.0,
            "from {least_mm} to {most_mm} mm"
        );
        let told = &split.master.record().expect("cycles").counters;
        assert_eq!(told.link.errors(), 0, "{:?}", told.link);
        assert_eq!(told.missed, [0; 8]);
    });
}

#[test]
fn boards_whose_line_is_cut_in_mid_step_hold_and_wait_disarmed_when_it_is_there_again() {
    with_room(|| {
        let (scenario, robot) = three_steps();
        let mut cut = Robot::new(&scenario, &robot, 3);
        cut.walk(robot.start_up.rest_s);
        for _ in 0..600 {
            cut.step();
        }
        cut.master.line().cut = true;
        let cut_ns = cut.ms * MS;
        // They shut all valves. A leg in the air may be vented later: that is the phase's own choice.
        let shut = |cut: &mut Robot| cut.master.line().boards.valves_us() == [[0; 4]; 6];
        let mut shut_ms = 0;
        while shut_ms < 1_000 && !(shut_ms >= 20 && shut(&mut cut)) {
            cut.step();
            shut_ms += 1;
        }
        assert!((20..=60).contains(&shut_ms), "after {shut_ms} ms");
        for _ in shut_ms..1_000 {
            cut.step();
        }
        let held = cut.master.master().layer0().hold();
        assert!(matches!(held, Some(HoldReason::NodeLost(_))), "{held:?}");
        cut.master.line().cut = false;
        for _ in 0..3_000 {
            cut.step();
        }
        assert!(!cut.master.master().is_armed());
        assert!(shut(&mut cut));
        let recording = cut.recorder.finish().expect("in memory");
        let count = |wanted: fn(&Cause) -> bool| {
            let events = recording.events.iter();
            events.filter(|row| wanted(&row.v.cause)).count()
        };
        assert_eq!(count(|cause| matches!(cause, Cause::LineBroken(_))), 1);
        let mut events = recording.events.iter();
        let told = events.find(|row| matches!(row.v.cause, Cause::LineBroken(_)));
        let after_ns = told.map(|row| row.t_ns - cut_ns);
        assert!(after_ns <= Some(20 * MS), "told after {after_ns:?} ns");
        assert_eq!(count(|cause| matches!(cause, Cause::LineMended)), 1);
    });
}
