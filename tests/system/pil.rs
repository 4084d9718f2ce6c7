//! Firmware images on emulated boards: start-up, faults of the processor and of
//! its supply, determinism. `cargo xtask pil` builds what they need and runs
//! them; the bit-for-bit comparison of a whole run is a step of its own there.

use crate::bench::pil::{Board, edge};
use crate::bench::{delivery, numbered};
use wheeleg_protocol::link::TURNAROUND_US;
use wheeleg_protocol::{Address, FaultReport};
use wheeleg_remote_host::unicorn::image;
use wheeleg_remote_link::{
    Figures, Hook, Outputs, Power, Ran, Reply, Request, Run, SOFTWARE_RESET, Straps, WATCHDOG_RESET,
};
use wheeleg_sim::BOARD_START_UP_NS;

/// RCC_CSR: brown-out or power-on.
const BROWN_OUT: u32 = 1 << 27;
const TICK_NS: u64 = 1_000_000;
/// Sample of a wheel.
const SAMPLE_NS: u64 = 520_000;

/// One emulated joint board, alone on its bus.
struct BoardBench {
    board: Board,
    now_ns: u64,
    /// Every reply so far, to compare sessions.
    replies: Vec<Reply>,
}

impl BoardBench {
    fn new(address: u8) -> Self {
        Self::with_crystal(address, true)
    }

    fn with_crystal(address: u8, crystal: bool) -> Self {
        let image = image(if address <= 6 { "joint" } else { "wheel" }).expect("an image");
        let mut bench = Self {
            board: Board::new(image),
            now_ns: 0,
            replies: Vec::new(),
        };
        let straps = Straps {
            address,
            unique_id: [address; 12],
            crystal,
        };
        let up = bench.ran(&Request::PowerUp(straps));
        assert_eq!(up.outputs, Outputs::default(), "off at power-up");
        bench
    }

    fn ask(&mut self, request: &Request) -> Reply {
        let reply = self.board.ask(request);
        self.replies.push(reply.clone());
        reply
    }

    fn ran(&mut self, request: &Request) -> Ran {
        match self.ask(request) {
            Reply::Ran(ran) => ran,
            other => panic!("{other:?}"),
        }
    }

    fn tick(&mut self, power: Power) -> Ran {
        self.tick_of(TICK_NS, power)
    }

    fn tick_of(&mut self, period_ns: u64, power: Power) -> Ran {
        let edge = edge(self.now_ns, power);
        self.now_ns += period_ns;
        self.ran(&edge)
    }

    /// Runs until the board reports a reset; returns its time since this call and its cause.
    fn until_reset(&mut self, ticks: u32) -> Option<(u64, u32)> {
        let since_ns = self.now_ns;
        (0..ticks).find_map(|_| {
            let ran = self.tick(Power::Good);
            assert_eq!(ran.outputs, Outputs::default());
            ran.trip
                .map(|trip| (trip.at_ns.wrapping_sub(since_ns), trip.cause))
        })
    }
}

#[test]
fn a_board_comes_up_ticks_and_sees_what_is_latched() {
    let mut bench = BoardBench::new(2);
    let mut last = Ran::default();
    for _ in 0..100 {
        last = bench.tick(Power::Good);
    }
    assert_eq!(last.period_us, 1000);
    assert_eq!(last.seen.adc, 30_000);
    assert_eq!(
        last.seen_at_ns,
        98 * TICK_NS,
        "the tick before the newest edge"
    );
    assert_eq!(last.figures.resets, 0);
    assert!(last.figures.tick_instructions > 100);
    let figures = last.figures;
    assert!(
        (1..figures.stack_size).contains(&figures.stack_used),
        "{figures:?}"
    );
}

#[test]
fn outputs_are_driven_low_within_the_first_instructions_after_every_reset() {
    for (address, period_ns) in [(2, TICK_NS), (7, SAMPLE_NS)] {
        let mut bench = BoardBench::new(address);
        let low_after = |bench: &mut BoardBench| {
            let last = (0..50)
                .map(|_| bench.tick_of(period_ns, Power::Good))
                .last();
            last.expect("a reply").figures.outputs_low_after
        };
        // Before memory is set up, which takes thousands; two clocks and three ports
        // take about forty.
        let at_power_up = low_after(&mut bench);
        assert!((10..=64).contains(&at_power_up), "{at_power_up}");
        bench.tick_of(period_ns, Power::BrownOut);
        assert_eq!(low_after(&mut bench), at_power_up, "after a brown-out");
        assert_eq!(bench.ask(&Request::Hook(Hook::StopProcessor)), Reply::Done);
        let bitten = (0..150).any(|_| bench.tick_of(period_ns, Power::Good).trip.is_some());
        assert!(bitten);
        assert_eq!(low_after(&mut bench), at_power_up, "after a watchdog reset");
    }
}

#[test]
fn the_watchdog_bites_when_the_main_loop_or_the_processor_stops_and_only_then() {
    let mut bench = BoardBench::new(1);
    assert_eq!(bench.until_reset(200), None, "a sound board");
    for hook in [Hook::StopMainLoop, Hook::StopProcessor] {
        assert_eq!(bench.ask(&Request::Hook(hook)), Reply::Done);
        let (after_ns, cause) = bench.until_reset(80).expect("a reset");
        assert!(cause & WATCHDOG_RESET != 0, "{cause:#x}");
        // Fed at the end of the last tick, within the millisecond before.
        assert!(
            (48_000_000..=50_100_000).contains(&after_ns),
            "{after_ns} ns"
        );
        // It comes up again and stays up.
        for _ in 0..20 {
            bench.tick(Power::Good);
        }
        assert_eq!(bench.until_reset(200), None, "after the reset");
    }
}

#[test]
fn a_processor_that_faults_is_reset_by_its_handler_at_once() {
    let mut bench = BoardBench::new(1);
    assert_eq!(bench.until_reset(200), None, "a sound board");
    let hook = Request::Hook(Hook::FaultProcessor);
    assert_eq!(bench.ask(&hook), Reply::Done);
    let (after_ns, cause) = bench.until_reset(5).expect("a reset");
    assert!(
        cause & SOFTWARE_RESET != 0 && cause & WATCHDOG_RESET == 0,
        "{cause:#x}"
    );
    // It faults while asleep, less than a tick before the bench's time.
    assert!((after_ns as i64).abs() < TICK_NS as i64, "{after_ns} ns");
    // It comes up again and stays up.
    for _ in 0..20 {
        bench.tick(Power::Good);
    }
    assert_eq!(bench.until_reset(200), None, "after the reset");
}

#[test]
fn a_brown_out_resets_with_outputs_off_and_the_board_returns_with_the_supply() {
    let mut bench = BoardBench::new(3);
    for _ in 0..50 {
        bench.tick(Power::Good);
    }
    let down = bench.tick(Power::BrownOut);
    let trip = down.trip.expect("a reset");
    assert!(trip.cause & BROWN_OUT != 0 && trip.cause & WATCHDOG_RESET == 0);
    for _ in 0..100 {
        let ran = bench.tick(Power::BrownOut);
        assert_eq!((ran.outputs, ran.period_us), (Outputs::default(), 0));
    }
    for _ in 0..100 {
        bench.tick(Power::Good);
    }
    let up = bench.tick(Power::Good);
    assert_eq!(up.period_us, 1000);
    assert_eq!(up.seen.adc, 30_000);
}

/// Periods from a tick edge to the first edge of a board whose supply comes back `later_ns` after it.
fn periods_until_it_runs(address: u8, period_ns: u64, later_ns: u64) -> u64 {
    let mut bench = BoardBench::new(address);
    for _ in 0..50 {
        bench.tick_of(period_ns, Power::Good);
    }
    bench.tick_of(period_ns, Power::BrownOut);
    let edge_ns = bench.now_ns;
    bench.tick_of(period_ns, Power::BrownOut);
    let back = Run {
        until_ns: edge_ns + later_ns,
        ..Run::default()
    };
    bench.ran(&Request::Run(back));
    let trip = (0..60).find_map(|_| {
        let trip = bench.tick_of(period_ns, Power::Good).trip;
        trip.filter(|trip| trip.running_ns > 0)
    });
    let since_ns = trip.expect("it comes back").running_ns - edge_ns;
    assert_eq!(since_ns % period_ns, 0, "board {address}");
    since_ns / period_ns
}

#[test]
fn a_board_starts_in_the_time_that_the_simulator_takes_it_for() {
    const RESOLUTION_NS: u64 = 1_000;
    for (address, period_ns, start_up_ns) in [
        (3, TICK_NS, BOARD_START_UP_NS[0]),
        (8, SAMPLE_NS, BOARD_START_UP_NS[1]),
    ] {
        // A supply that comes back later and later after an edge misses one more edge from one instant on.
        let soonest = periods_until_it_runs(address, period_ns, 0);
        let (mut in_time_ns, mut too_late_ns) = (0, period_ns);
        while too_late_ns - in_time_ns > RESOLUTION_NS {
            let middle_ns = in_time_ns.midpoint(too_late_ns);
            if periods_until_it_runs(address, period_ns, middle_ns) == soonest {
                in_time_ns = middle_ns;
            } else {
                too_late_ns = middle_ns;
            }
        }
        let measured_ns = soonest * period_ns - in_time_ns;
        assert!(
            measured_ns.abs_diff(start_up_ns) <= 10_000,
            "board {address} starts in {measured_ns} ns, the simulator takes {start_up_ns} ns"
        );
    }
}

/// Polls before a board gives its crystal up (firmware/board/src/g431/clock.rs), each of
/// some instructions.
const CRYSTAL_POLLS: u32 = 40_000;

#[test]
fn without_its_crystal_a_board_runs_on_the_internal_oscillator_at_the_same_speed() {
    for (address, period_us) in [(2, 1000), (8, 520)] {
        let run = |crystal: bool| {
            let mut bench = BoardBench::with_crystal(address, crystal);
            for _ in 0..100 {
                bench.tick_of(u64::from(period_us) * 1_000, Power::Good);
            }
            let start_up = match bench.replies.first() {
                Some(Reply::Ran(ran)) => ran.figures.instructions,
                other => panic!("{other:?}"),
            };
            // All but how long the code took: an instruction is a cycle at either clock.
            let seen: Vec<Ran> = bench.replies.iter().map(without_figures).collect();
            (start_up, seen)
        };
        let (with, without) = (run(true), run(false));
        let longer = without.0.saturating_sub(with.0);
        assert!(
            (3 * CRYSTAL_POLLS..20 * CRYSTAL_POLLS).contains(&longer),
            "the crystal is waited for and given up: {longer} instructions more"
        );
        assert_eq!(without.1, with.1, "and nothing else differs");
        let last = without.1.last().expect("ticks");
        assert_eq!(last.period_us, period_us);
        assert!(last.seen_at_ns > 0, "ticks are worked off");
    }
}

fn without_figures(reply: &Reply) -> Ran {
    match reply {
        Reply::Ran(ran) => Ran {
            figures: Figures::default(),
            ..ran.clone()
        },
        other => panic!("{other:?}"),
    }
}

/// The answer begins a turnaround later: a simulator that runs on to the next edge before it sees the answer puts
/// it on the line too late.
#[test]
fn the_answer_to_a_request_that_ends_with_a_tick_edge_is_told_with_that_edge() {
    for (address, tick_ns) in [(2, TICK_NS), (7, SAMPLE_NS)] {
        let mut bench = BoardBench::new(address);
        let mut at_ns = 0;
        for _ in 0..60 {
            at_ns += tick_ns;
            bench.ran(&edge(at_ns, Power::Good));
        }
        at_ns += tick_ns;
        let node = Address::new(address).expect("a node");
        let request = numbered(100, node, &FaultReport {}.into());
        let heard = bench.ran(&delivery(&request, at_ns));
        assert!(heard.sent.is_empty(), "it has not heard the end");
        let sent = bench.ran(&edge(at_ns, Power::Good)).sent;
        let [answer] = &sent[..] else {
            panic!("{address}: one answer with the edge, not {sent:?}");
        };
        assert_eq!(answer.start_ns, at_ns + u64::from(TURNAROUND_US) * 1_000);
    }
}

#[test]
fn straps_of_another_kind_of_board_leave_it_silent() {
    let mut board = Board::new(image("joint").expect("an image"));
    let straps = Straps {
        address: 7,
        unique_id: [7; 12],
        crystal: true,
    };
    let ran = board.ran(&Request::PowerUp(straps));
    assert_eq!((ran.period_us, ran.outputs), (0, Outputs::default()));
    assert!(ran.sent.is_empty());
}

#[test]
fn equal_sessions_give_equal_replies_to_the_bit() {
    let session = || {
        let mut bench = BoardBench::new(5);
        for _ in 0..150 {
            bench.tick(Power::Good);
        }
        bench.ask(&Request::Hook(Hook::StopMainLoop));
        bench.until_reset(80).expect("a reset");
        bench.replies
    };
    let first = session();
    assert_eq!(first.len(), session().len());
    assert_eq!(first, session());
}
