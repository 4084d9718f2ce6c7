//! What shuts the valves of an emulated board that drives its cylinder when the processor, its memory, its
//! clock or its supply fails, and how soon.

use wheeleg_remote_host::unicorn::image;
use wheeleg_remote_link::{Hook, Power, Reply, Request, SOFTWARE_RESET, Trip, WATCHDOG_RESET};

use crate::bench::pil::Board;
use crate::bench::script;

/// RCC_CSR: brown-out or power-on.
const BROWN_OUT: u32 = 1 << 27;
/// The reference moves away here, so that the valves are at work some milliseconds later.
const AWAY_MS: u64 = 200;
const LASTS_MS: u64 = 320;

/// The failure.
#[derive(Debug, Clone)]
#[expect(clippy::large_enum_variant, reason = "a handful of them")]
enum Failure {
    Hook(Hook),
    Supply,
}

/// Its result.
#[derive(Debug)]
struct Outcome {
    /// Ticks from the failure on in which a valve was still energised.
    driven_ticks: u64,
    /// The first reset, and its time since the failure, ns.
    reset: (Trip, i64),
    /// Valves were energised again after it.
    driven_after_reset: bool,
}

/// Lets a board drive its cylinder, and something fail when two ticks in a row were driven.
fn outcome(failure: &Failure) -> Outcome {
    let mut board = Board::new(image("joint").expect("an image"));
    let (mut driven_in_row, mut failed_ns) = (0, None);
    let (mut driven_ticks, mut reset, mut driven_after_reset) = (0, None, false);
    let moves = [(0, 90.0), (AWAY_MS, 150.0)];
    script(&moves, LASTS_MS, |request| {
        let mut request = request.clone();
        if let Request::Run(run) = &mut request
            && run.edge.is_some()
        {
            let now_ns = run.until_ns;
            if failed_ns.is_none() && driven_in_row >= 2 && now_ns > (AWAY_MS + 5) * 1_000_000 {
                failed_ns = Some(now_ns);
                if let Failure::Hook(hook) = failure {
                    let done = board.ask(&Request::Hook(hook.clone()));
                    assert_eq!(done, Reply::Done, "{failure:?}");
                }
            }
            // The supply is back 20 ms later.
            let low = failed_ns.is_some_and(|ns| (ns..ns + 20_000_000).contains(&now_ns));
            if matches!(failure, Failure::Supply) && low {
                run.power = Power::BrownOut;
            }
        }
        let reply = board.ask(&request);
        if let (Request::Run(run), Reply::Ran(ran)) = (&request, &reply) {
            let driven = ran.outputs.valve_on_us != [0; 4];
            if run.edge.is_some() {
                driven_in_row = if driven { driven_in_row + 1 } else { 0 };
                if failed_ns.is_some() {
                    driven_ticks += u64::from(driven && reset.is_none());
                    driven_after_reset |= driven && reset.is_some();
                }
            }
            if let (Some(failed_ns), Some(trip)) = (failed_ns, ran.trip) {
                let after_ns = trip.at_ns as i64 - failed_ns as i64;
                reset.get_or_insert((trip, after_ns));
            }
        }
        reply
    });
    assert!(failed_ns.is_some(), "the board did not drive");
    Outcome {
        driven_ticks,
        reset: reset.unwrap_or_else(|| panic!("{failure:?}: no reset")),
        driven_after_reset,
    }
}

/// Each failure, for how many ticks a valve may stay energised, within how many ms the board is reset, and
/// the flag of that reset.
#[test]
fn what_fails_shuts_the_valves_in_time() {
    let hook = Failure::Hook;
    let table = [
        // A break of the timers: at once, and the watchdog starts the board again.
        (hook(Hook::LockUp), 0, 51, WATCHDOG_RESET),
        // The break, and the handler of the NMI.
        (hook(Hook::RamParityError), 0, 1, SOFTWARE_RESET),
        (hook(Hook::StopCrystal), 0, 1, SOFTWARE_RESET),
        // The handler of the fault.
        (hook(Hook::FaultProcessor), 0, 1, SOFTWARE_RESET),
        // The break by the voltage detector, before the brown-out reset.
        (Failure::Supply, 0, 1, BROWN_OUT),
        // Nothing but the watchdog knows.
        (hook(Hook::StopMainLoop), 51, 51, WATCHDOG_RESET),
        (hook(Hook::StopProcessor), 51, 51, WATCHDOG_RESET),
    ];
    for (failure, ticks, within_ms, flag) in table {
        let outcome = outcome(&failure);
        let (trip, after_ns) = outcome.reset;
        println!(
            "{failure:?}: energised for {} ticks, reset after {:.2} ms, flags {:#x}",
            outcome.driven_ticks,
            after_ns as f64 * 1e-6,
            trip.cause
        );
        assert!(outcome.driven_ticks <= ticks, "{failure:?}: {outcome:?}");
        assert!(
            after_ns <= within_ms * 1_000_000,
            "{failure:?}: {outcome:?}"
        );
        assert!(trip.cause & flag != 0, "{failure:?}: {outcome:?}");
        assert!(!outcome.driven_after_reset, "{failure:?}: {outcome:?}");
    }
}
