//! Clocks and result lines.

use std::env;

use rustix::time::{ClockId, clock_gettime};

/// What an interval took: processor time of this thread, and time on the wall (s).
#[derive(Clone, Copy)]
pub(crate) struct Took {
    pub(crate) cpu_s: f64,
    pub(crate) wall_s: f64,
}

fn clock_s(id: ClockId) -> f64 {
    let time = clock_gettime(id);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Runs and times.
pub(crate) fn timed(work: impl FnOnce()) -> Took {
    let (cpu, wall) = (clock_s(ClockId::ThreadCPUTime), clock_s(ClockId::Monotonic));
    work();
    Took {
        cpu_s: clock_s(ClockId::ThreadCPUTime) - cpu,
        wall_s: clock_s(ClockId::Monotonic) - wall,
    }
}

/// Repetitions: `full` times `PEERS_SCALE`, plus one, as in the C programs.
pub(crate) fn repetitions(full: f64) -> usize {
    let scale = env::var("PEERS_SCALE")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(1.0);
    (full * scale) as usize + 1
}

/// Prints nanoseconds per item.
pub(crate) fn put_ns(case: &str, detail: &str, took: Took, items: usize, check: &str) {
    let peer = env::var("PEERS_LABEL").unwrap_or_else(|_| "wheeleg".to_owned());
    let per = |seconds: f64| seconds * 1e9 / items as f64;
    println!(
        "RESULT\t{case}\t{peer}{detail}\tns\t{:.6}\t{:.6}\t{check}",
        per(took.cpu_s),
        per(took.wall_s)
    );
}
