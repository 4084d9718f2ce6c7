//! A robot that lives long, is recorded and watched: its server does not grow. The clock runs as fast as
//! possible, so that an hour passes in minutes.

#![cfg(target_os = "linux")]

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use serde_json::json;
use wheeleg_console::client::{Incoming, Outcome};
use wheeleg_telemetry::{channels, parts};

#[path = "suite/common.rs"]
#[expect(
    dead_code,
    reason = "shared with the suite, whose other tests would grow this process"
)]
mod common;

use common::TestRig;

/// Clients that read every channel.
const CLIENTS: usize = 8;
/// Bar of the specification, MB.
const GROWS_MB: f64 = 16.0;
/// Share of the time before the first check of the memory: rings and buffers are full then.
const SETTLED: f64 = 0.1;

/// Memory of this process, server and clients, MB.
fn memory_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    let kilobytes = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
    kilobytes.expect("a number") / 1024.0
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn memory_does_not_grow_while_a_robot_lives_is_recorded_and_is_looked_at() {
    let seconds = std::env::var("WHEELEG_CONSOLE_S").ok();
    let seconds = seconds.and_then(|s| s.parse::<f64>().ok()).unwrap_or(120.0);
    let rig = TestRig::recorded(None);
    let (over, frames) = (AtomicBool::new(false), AtomicU64::new(0));
    let begin = Instant::now();
    let (first_mb, most_mb, state) = std::thread::scope(|threads| {
        for _ in 0..CLIENTS {
            threads.spawn(|| {
                let mut client = rig.view();
                let topics: Vec<&str> = channels().iter().map(|channel| channel.topic).collect();
                let all = json!({ "op": "subscribe", "channels": topics, "hz": 50 });
                let n = client.send(all).expect("sent");
                assert_eq!(client.outcome(n), Outcome::Done);
                while !over.load(Ordering::Relaxed) {
                    match client.read() {
                        Some(Incoming::Samples { .. }) => {
                            frames.fetch_add(1, Ordering::Relaxed);
                        }
                        Some(Incoming::Closed { code, .. }) => panic!("closed: {code}"),
                        _ => {}
                    }
                }
            });
        }
        let (mut first_mb, mut most_mb) = (None, 0.0_f64);
        let state = loop {
            std::thread::sleep(std::time::Duration::from_millis(200));
            let state = rig.state();
            let now_s = state["master_us"].as_f64().expect("a time") * 1e-6;
            if now_s > SETTLED * seconds {
                first_mb = first_mb.or_else(|| Some(memory_mb()));
                most_mb = most_mb.max(memory_mb());
            }
            if now_s > seconds {
                break state;
            }
        };
        over.store(true, Ordering::Relaxed);
        (first_mb.expect("looked at"), most_mb, state)
    });
    let log = rig.home.path().join("recordings/0001/log.mcap");
    let sizes = parts(&log).map(|part| std::fs::metadata(part).expect("a log").len());
    let sizes: Vec<u64> = sizes.collect();
    let log_mb = sizes.iter().sum::<u64>() as f64 / 1e6;
    let grew_mb = most_mb - first_mb;
    println!(
        "{seconds:.0} s lived in {:.0} s with {CLIENTS} clients, {} frames read, {} samples that the hub did not get; log of \
         {log_mb:.0} MB in {} parts, recording {}; memory {most_mb:.1} MB, {grew_mb:.1} MB more than at first (bar {GROWS_MB:.0})",
        begin.elapsed().as_secs_f64(),
        frames.load(Ordering::Relaxed),
        state["pace"]["dropped"],
        sizes.len(),
        state["recording"],
    );
    assert!(state["recording"]["failure"].is_null(), "{state}");
    assert!(log_mb > 1e-3 * seconds, "hardly anything was recorded");
    // Split every 10 minutes; the last part may have just begun.
    let whole = (seconds / 600.0) as usize;
    assert!((whole..=whole + 1).contains(&sizes.len()), "{sizes:?}");
    assert!(frames.load(Ordering::Relaxed) > 1_000);
    assert!(grew_mb <= GROWS_MB, "{first_mb:.1} to {most_mb:.1} MB");
}
