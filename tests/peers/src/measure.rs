//! Clocks and result lines.

use std::env;

use rustix::time::{ClockId, clock_gettime};

/// Duration of an interval: processor time of this thread, and wall time (s).
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

/// The work's multiple, `PEERS_SCALE`.
pub(crate) fn scale() -> f64 {
    let text = env::var("PEERS_SCALE").ok();
    text.and_then(|text| text.parse().ok()).unwrap_or(1.0)
}

/// Repetitions: `full` times `PEERS_SCALE`, plus one, as in the C programs.
pub(crate) fn repetitions(full: f64) -> usize {
    (full * scale()) as usize + 1
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

/// Prints simulated seconds per second of processor and wall time.
pub(crate) fn put_realtime(case: &str, detail: &str, took: Took, simulated_s: f64, check: &str) {
    let peer = env::var("PEERS_LABEL").unwrap_or_else(|_| "wheeleg".to_owned());
    println!(
        "RESULT\t{case}\t{peer}{detail}\tx_realtime\t{:.6}\t{:.6}\t{check}",
        simulated_s / took.cpu_s,
        simulated_s / took.wall_s
    );
}
