//! What clients see that only look, however slowly.

use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use serde_json::json;
use wheeleg_console::client::{Client, Incoming, Url, http};
use wheeleg_telemetry::{Wire, Written, channels};

use crate::common::{RELAY, TestRig, done, look};

/// Bytes a second of a slow line on an idle computer.
const SLOW: usize = 2_000;
/// Most bytes that wait for a slow client: the server's buffer and the line's, which the system doubles.
const WAITING: f64 = 24e3;

/// A server whose port is free at the relay's address as well: a client names the port that the
/// server listens on, and another program may have taken the same one there.
fn rig_and_listener() -> (TestRig, TcpListener) {
    let mut tries = (0..10).map(|_| {
        let rig = TestRig::new();
        let listener = TcpListener::bind((RELAY, rig.server.address().port()));
        (rig, listener)
    });
    tries
        .find_map(|(rig, listener)| Some((rig, listener.ok()?)))
        .expect("a free port")
}

/// A line to the server that becomes slow on demand, and counts its bytes from then on.
fn relay(rig: &TestRig, listener: TcpListener) -> (Url, Arc<AtomicBool>, Arc<AtomicUsize>) {
    let server = rig.server.address();
    let slow = Arc::new(AtomicBool::new(false));
    let is_slow = Arc::clone(&slow);
    let passed = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&passed);
    std::thread::spawn(move || {
        let (mut client, _) = listener.accept().expect("a client");
        // Little waits at the end of a slow line.
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build();
        let server = runtime.expect("a runtime").block_on(async {
            let socket = tokio::net::TcpSocket::new_v4()?;
            socket.set_recv_buffer_size(2_048)?;
            socket.connect(server).await?.into_std()
        });
        let mut server = server.expect("connected");
        server.set_nonblocking(false).expect("set");
        let (mut from, mut to) = (
            client.try_clone().expect("a socket"),
            server.try_clone().expect("a socket"),
        );
        std::thread::spawn(move || std::io::copy(&mut from, &mut to));
        let mut bytes = [0; SLOW / 10];
        while let Ok(count @ 1..) = server.read(&mut bytes) {
            if client.write_all(&bytes[..count]).is_err() {
                break;
            }
            if is_slow.load(Ordering::Relaxed) {
                counted.fetch_add(count, Ordering::Relaxed);
                std::thread::sleep(Duration::from_millis(100));
            }
        }
    });
    let url = format!("{RELAY}:{}", server.port());
    (Url::parse(&url).expect("an address"), slow, passed)
}

/// Bytes of the sample at the start of `body`, using only the list of channels.
fn length(channel: u16, body: &[u8]) -> usize {
    let fields = channels()[usize::from(channel)].fields;
    fields.iter().fold(8, |at, field| {
        at + match field.wire {
            Wire::F32 | Wire::U32 | Wire::I32 => 4,
            Wire::U64 => 8,
            Wire::Bool => 1,
            Wire::Text => 2 + usize::from(u16::from_le_bytes([body[at], body[at + 1]])),
        }
    })
}

#[test]
fn every_sample_of_every_channel_comes_once_and_in_order() {
    let rig = TestRig::new();
    let mut viewer = rig.view();
    let topics: Vec<&str> = channels().iter().map(|c| c.topic).collect();
    let all = json!({ "op": "subscribe", "channels": topics, "hz": "all" });
    viewer.send(all).expect("sent");
    let mut last = vec![None; channels().len()];
    let mut counts = vec![0_usize; channels().len()];
    let begin = Instant::now();
    // Every board reports now and then what it has heard.
    let silent = |counts: &[usize]| {
        let mut all = channels().iter().zip(counts);
        all.any(|(channel, count)| channel.written == Written::OnChange && *count == 0)
    };
    while counts[0] < 1_500 || silent(&counts) {
        assert!(begin.elapsed() < Duration::from_secs(15), "{counts:?}");
        let Some(Incoming::Samples {
            channel,
            missed,
            body,
        }) = viewer.read()
        else {
            continue;
        };
        assert_eq!(missed, 0);
        let mut rest = &body[..];
        while !rest.is_empty() {
            let t_ns = u64::from_le_bytes(rest[..8].try_into().expect("a time"));
            let before = last[usize::from(channel)].replace(t_ns);
            if channels()[usize::from(channel)].rate_hz == 500 {
                assert!(
                    before.is_none_or(|t| t + 1_000_000 == t_ns),
                    "{channel}: {before:?} {t_ns}"
                );
            }
            counts[usize::from(channel)] += 1;
            rest = &rest[length(channel, rest)..];
        }
    }
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn the_newest_wins_for_a_client_that_reads_slowly_and_others_see_nothing() {
    let (rig, listener) = rig_and_listener();
    let subscribe = |client: &mut Client| {
        let topics = ["/joint/1", "/joint/2", "/body", "/master"];
        let frame = json!({ "op": "subscribe", "channels": topics, "hz": 50 });
        client.send(frame).expect("sent");
    };
    let mut quick = rig.view();
    subscribe(&mut quick);
    let (url, is_slow, passed) = relay(&rig, listener);
    let mut slow = Client::connect(&url, "view", "slow", &rig.keys.view).expect("let in");
    is_slow.store(true, Ordering::Relaxed);
    subscribe(&mut slow);
    let lasting = Duration::from_secs(30);
    let reads_slowly = std::thread::spawn(move || {
        let (mut count, mut missed_in_all, begin) = (0, 0, Instant::now());
        while begin.elapsed() < lasting {
            match slow.read() {
                Some(Incoming::Samples { missed, .. }) => {
                    count += 1;
                    missed_in_all += missed;
                }
                Some(Incoming::Closed { code, reason }) => panic!("closed: {code} {reason}"),
                _ => {}
            }
        }
        (count, missed_in_all, slow.seen_us())
    });
    let (mut seen, mut missed_by_quick) = (0, 0);
    let begin = Instant::now();
    while begin.elapsed() < lasting {
        if let Some(Incoming::Samples { missed, .. }) = quick.read() {
            seen += 1;
            missed_by_quick += missed;
        }
    }
    let (count, missed, seen_us) = reads_slowly.join().expect("it stays");
    // 4 channels, 50 Hz, 30 s; a busy computer's wall time is not judged.
    assert!(seen > 3_000, "{seen}");
    assert_eq!(missed_by_quick, 0);
    // Its view is new: it lags by the bytes that wait on its line, at the line's true pace, and not by
    // everything that it missed, which would be four fifths of the time.
    let lag_us = quick.seen_us() - seen_us;
    let pace_s = passed.load(Ordering::Relaxed) as f64 / lasting.as_secs_f64();
    assert!(
        (lag_us as f64) < 1e6 * WAITING / pace_s,
        "{lag_us} us at {pace_s} bytes a second"
    );
    assert!(count > 0 && missed > 2 * count, "{missed} beside {count}");
}

/// It receives much, and sends nothing but its answers to pings.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn who_only_looks_is_not_taken_for_gone() {
    let rig = TestRig::new();
    let mut viewer = rig.view();
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(25) {
        if let Some(Incoming::Closed { code, reason }) = viewer.read() {
            panic!("closed after {:?}: {code} {reason}", begin.elapsed());
        }
    }
}

#[test]
fn clients_that_never_read_cost_the_holder_nothing() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let topics: Vec<&str> = channels().iter().map(|c| c.topic).collect();
    let mut idle = Vec::new();
    for _ in 0..100 {
        match Client::connect(&rig.url, "view", "idle", &rig.keys.view) {
            Ok(mut client) => {
                let all = json!({ "op": "subscribe", "channels": topics, "hz": "all" });
                client.send(all).expect("sent");
                idle.push(client);
            }
            Err(e) => {
                let text = e.to_string();
                assert!(text.contains("503") || text.contains("slots"), "{text}");
            }
        }
    }
    assert_eq!(
        idle.len(),
        30,
        "32 places: the driver, and one kept for control"
    );
    let mut second = rig.control("second");
    look(&mut second, "state");
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(3) {
        let _ = driver.read();
    }
    done(&mut driver, "Stand");
    let state = rig.state();
    assert_eq!(
        (&state["armed"], &state["hold"]),
        (&json!(true), &json!(null))
    );
    // A stop needs no place.
    let (status, _) = http(&rig.url, "POST", "stop", &rig.keys.view).expect("an answer");
    assert_eq!(status, 200);
}

#[test]
fn the_lists_are_those_of_the_hashes() {
    let rig = TestRig::new();
    let get = |path| {
        let (status, body) = http(&rig.url, "GET", path, &rig.keys.view).expect("an answer");
        assert_eq!(status, 200, "{path}");
        body
    };
    let list = get("channels");
    assert_eq!(
        list["channels"].as_array().map(Vec::len),
        Some(channels().len())
    );
    assert_eq!(list["channels"][2]["fields"][0]["wire"], "f32");
    let commands = get("commands");
    let names = commands["commands"].as_array().expect("a list").iter();
    assert!(
        names
            .into_iter()
            .any(|c| c["name"] == "TakeControl" && c["code"] == 0x0125)
    );
    assert!(
        get("faults")["injectable"]
            .as_array()
            .is_some_and(|l| l.len() > 20)
    );
    let (status, problem) =
        http(&rig.url, "GET", "events?last=0", &rig.keys.view).expect("an answer");
    assert_eq!((status, &problem["status"]), (400, &json!(400)));
    let (status, _) = http(&rig.url, "GET", "nothing", &rig.keys.view).expect("an answer");
    assert_eq!(status, 404);
}
