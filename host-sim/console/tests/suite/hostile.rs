//! Clients without a key, with a wrong one, or with messages outside the contract.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::json;
use wheeleg_access::Key;
use wheeleg_console::client::{Client, Outcome, Url, http};

use crate::common::{TestRig, closed, done, look};

fn raw(rig: &TestRig, request: &str) -> String {
    let mut stream = TcpStream::connect(rig.server.address()).expect("connected");
    stream
        .set_read_timeout(Some(Duration::from_secs(6)))
        .expect("set");
    stream.write_all(request.as_bytes()).expect("sent");
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

fn get(rig: &TestRig, path: &str, headers: &str) -> String {
    let host = rig.server.address();
    raw(
        rig,
        &format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{headers}\r\n"),
    )
}

#[test]
fn wrong_keys_open_nothing_and_a_right_one_is_never_locked_out() {
    let rig = TestRig::new();
    let wrong = [Key::new([0; 32]), Key::new([9; 32]), rig.keys.view.clone()];
    for key in &wrong {
        let error = Client::connect(&rig.url, "control", "thief", key)
            .err()
            .expect("refused");
        assert!(error.to_string().contains("key is wrong"), "{error}");
    }
    assert!(Client::connect(&rig.url, "king", "thief", &rig.keys.control).is_err());
    assert!(Client::connect(&rig.url, "control", "<b>thief", &rig.keys.control).is_err());
    let statuses: Vec<u16> = (0..12)
        .map(|_| {
            http(&rig.url, "GET", "state", &Key::new([9; 32]))
                .expect("an answer")
                .0
        })
        .collect();
    assert!(statuses[..3].iter().all(|s| *s == 401), "{statuses:?}");
    assert_eq!(statuses[11], 429, "{statuses:?}");
    rig.state();
    let mut client = rig.control("owner");
    look(&mut client, "state");
    for header in [
        "",
        "Authorization: Bearer \r\n",
        "Authorization: Basic eA==\r\n",
    ] {
        let answer = get(&rig, "/api/v1/state", header);
        assert!(answer.starts_with("HTTP/1.1 4"), "{answer}");
        assert!(answer.contains("application/problem+json"), "{answer}");
    }
}

#[test]
fn foreign_hosts_and_origins_are_refused_everywhere() {
    let rig = TestRig::new();
    let address = rig.server.address();
    for path in ["/", "/ws", "/api/v1/state"] {
        for (host, origin) in [
            ("evil.example".to_owned(), String::new()),
            (
                address.to_string(),
                "Origin: http://evil.example\r\n".to_owned(),
            ),
            (address.to_string(), "Origin: null\r\n".to_owned()),
        ] {
            let request =
                format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n{origin}Connection: close\r\n\r\n");
            let answer = raw(&rig, &request);
            assert!(
                answer.starts_with("HTTP/1.1 403"),
                "{path} {host} {origin}: {answer}"
            );
        }
        // One of our names in one place, and a stranger's in another.
        let request = format!(
            "GET http://evil.example{path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n"
        );
        let answer = raw(&rig, &request);
        assert!(answer.starts_with("HTTP/1.1 403"), "{path}: {answer}");
    }
}

#[test]
fn the_page_comes_with_its_policy_and_no_name_leads_out_of_it() {
    let rig = TestRig::new();
    let page = get(&rig, "/", "");
    assert!(page.starts_with("HTTP/1.1 200"), "{page}");
    for header in [
        "content-type: text/html; charset=utf-8",
        "default-src 'none'",
        "frame-ancestors 'none'",
        "x-content-type-options: nosniff",
        "cache-control: no-store",
        "referrer-policy: no-referrer",
        "cross-origin-opener-policy: same-origin",
    ] {
        assert!(
            page.to_ascii_lowercase().contains(header),
            "{header}: {page}"
        );
    }
    for path in [
        "/../Cargo.toml",
        "/%2e%2e/Cargo.toml",
        "/..%2f..%2fCargo.toml",
        "/index.html%00",
        "//etc/passwd",
        "/control.key",
        "/x",
    ] {
        let answer = get(&rig, path, "");
        assert!(answer.starts_with("HTTP/1.1 4"), "{path}: {answer}");
    }
}

#[test]
fn forged_repeated_and_reordered_frames_close_and_do_nothing() {
    let rig = TestRig::new();
    let stop = br#"{"n":1,"op":"stop"}"#;
    let mut frames: Vec<Vec<u8>> = vec![
        Vec::new(),
        vec![0; 15],
        [&[0; 16][..], stop].concat(),
        vec![0x7B; 4000],
    ];
    frames.push(vec![0; 10_000]);
    for frame in frames {
        let mut client = rig.control("forger");
        client.send_raw(frame.clone()).expect("sent");
        let code = closed(&mut client);
        // A message that is too large ends the connection before it becomes a frame.
        assert!(
            code == 4003 || (frame.len() > 4096 && code != 1000),
            "{code}"
        );
    }
    // A frame of another session: the first of each.
    let mut other = rig.control("other");
    let of_other = other.sealed(json!({ "op": "stop" }));
    let mut client = rig.control("forger");
    client.send_raw(of_other.clone()).expect("sent");
    assert_eq!(closed(&mut client), 4003);
    // One bit of it flipped, by its owner.
    for bit in (0..8 * of_other.len()).step_by(7) {
        let mut client = rig.control("forger");
        let mut frame = client.sealed(json!({ "op": "stop" }));
        frame[bit / 8] ^= 1 << (bit % 8);
        client.send_raw(frame).expect("sent");
        assert_eq!(closed(&mut client), 4003, "bit {bit}");
    }
    // The session's own frame, once more.
    let mut client = rig.control("forger");
    let frame = client.sealed(json!({ "op": "unsubscribe", "channels": [] }));
    client.send_raw(frame.clone()).expect("sent");
    assert_eq!(client.outcome(1), Outcome::Done);
    client.send_raw(frame).expect("sent");
    assert_eq!(closed(&mut client), 4003);
    // The session's own frame, out of order: `n` of the client below is one ahead.
    let mut client = rig.control("forger");
    look(&mut client, "state");
    let n = client
        .send(json!({ "op": "unsubscribe", "channels": [] }))
        .expect("sent");
    assert_eq!(client.outcome(n), Outcome::Done);
    client.skip();
    client.send(json!({ "op": "stop" })).expect("sent");
    assert_eq!(closed(&mut client), 4003);
    assert_eq!(rig.state()["emergency_stop"], false);
    // The person at the server sees its name and address.
    let told = rig.server.notices();
    let named = told
        .iter()
        .all(|line| line.contains("\"forger\" at 127.0.0.1"));
    assert!(named && !told.is_empty(), "{told:?}");
    // The next session works.
    let mut client = rig.control("owner");
    look(&mut client, "state");
    done(&mut client, "TakeControl");
}

#[test]
fn a_flood_is_answered_busy_and_beats_and_stops_are_not() {
    let rig = TestRig::new();
    let mut driver = rig.driver("flooder");
    let mut busy = 0;
    for _ in 0..400 {
        let frame = json!({ "op": "unsubscribe", "channels": [] });
        let n = driver.send(frame).expect("sent");
        if let Outcome::Refused { reason, .. } = driver.outcome(n) {
            assert_eq!(reason, "busy");
            busy += 1;
        }
    }
    assert!(busy > 50, "{busy}");
    let state = rig.state();
    assert_eq!(
        (&state["armed"], &state["control"]["holder"]),
        (&json!(true), &json!("flooder"))
    );
    let n = driver.send(json!({ "op": "stop" })).expect("sent");
    assert_eq!(driver.outcome(n), Outcome::Done);
}

#[test]
fn half_requests_and_half_handshakes_lose_their_place() {
    let rig = TestRig::new();
    let address = rig.server.address();
    let upgrade = format!(
        "GET /ws HTTP/1.1\r\nHost: {address}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Protocol: wheeleg.console.v1\r\n\r\n"
    );
    // A thousand, with as many open as a program may have.
    for _ in 0..4 {
        let mut open = Vec::new();
        for i in 0..250 {
            let Ok(mut stream) = TcpStream::connect(address) else {
                continue;
            };
            let text = if i % 2 == 0 { "GET / HT" } else { &upgrade };
            let _ = stream.write_all(text.as_bytes());
            open.push(stream);
        }
        gets_in(&rig);
    }
    let state = rig.state();
    assert_eq!(state["alive"], true, "{state}");
}

/// Waits until somebody with the right key gets in.
fn gets_in(rig: &TestRig) {
    let begin = Instant::now();
    while Client::connect(&rig.url, "control", "owner", &rig.keys.control).is_err() {
        assert!(begin.elapsed() < Duration::from_secs(15), "locked out");
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn requests_without_an_end_and_idle_connections_lose_their_place() {
    let rig = TestRig::new();
    let address = rig.server.address();
    let body = format!(
        "POST /api/v1/stop HTTP/1.1\r\nHost: {address}\r\nContent-Length: 1000000\r\n\r\nx"
    );
    let idle = format!("GET / HTTP/1.1\r\nHost: {address}\r\n\r\n");
    for request in [body, idle] {
        let mut open = Vec::new();
        for _ in 0..200 {
            let Ok(mut stream) = TcpStream::connect(address) else {
                continue;
            };
            let _ = stream.write_all(request.as_bytes());
            open.push(stream);
        }
        gets_in(&rig);
    }
    assert_eq!(
        rig.state()["emergency_stop"],
        false,
        "no key, no stop over HTTP"
    );
}

/// Each asks for hundreds of files, and reads none.
#[test]
fn who_asks_and_never_reads_loses_its_place() {
    let rig = TestRig::new();
    let address = rig.server.address();
    let request = format!("GET /openapi.json HTTP/1.1\r\nHost: {address}\r\n\r\n").repeat(300);
    let mut open = Vec::new();
    for _ in 0..150 {
        let Ok(mut stream) = TcpStream::connect(address) else {
            continue;
        };
        let waits = stream.set_write_timeout(Some(Duration::from_millis(20)));
        waits.expect("set");
        let _ = stream.write_all(request.as_bytes());
        open.push(stream);
    }
    gets_in(&rig);
}

/// Sockets without a proved key take places, too: no more of them are open at a time.
#[test]
fn half_handshakes_take_no_more_places_than_others() {
    let rig = TestRig::new();
    let address = rig.server.address();
    let uri = format!("ws://{address}/ws");
    let begin = Instant::now();
    let open: Vec<_> = (0..200)
        .filter_map(|_| {
            let uri = uri.parse().expect("an address");
            let request = tungstenite::client::ClientRequestBuilder::new(uri);
            let request = request.with_sub_protocol("wheeleg.console.v1");
            let stream = TcpStream::connect(address).ok()?;
            tungstenite::client(request, stream).ok()
        })
        .collect();
    // Every newcomer gets a place; the oldest have lost theirs.
    let still = open
        .iter()
        .filter(|(socket, _)| is_open(socket.get_ref()))
        .count();
    assert!(still <= 96, "{still} of {}", open.len());
    // The last were there for less than the allowed time of a handshake.
    let quick = begin.elapsed() < Duration::from_secs(1);
    assert!(still >= 90 || !quick, "{still} of {}", open.len());
    assert!(open.len() >= 190, "{}", open.len());
    gets_in(&rig);
}

/// Whether the server has kept a connection open.
fn is_open(stream: &TcpStream) -> bool {
    let mut stream = stream;
    stream.set_nonblocking(true).expect("set");
    let mut bytes = [0; 4096];
    loop {
        match stream.read(&mut bytes) {
            Ok(0) => return false,
            Ok(_) => {}
            Err(e) => return e.kind() == std::io::ErrorKind::WouldBlock,
        }
    }
}

/// All places are taken from two addresses, and taken again as soon as one is lost: a client from a third one
/// can still stop the robot at once.
#[test]
fn whoever_takes_all_places_keeps_nobody_from_a_stop() {
    let rig = TestRig::new();
    rig.until("ready", |state| state["ready"] == true);
    let address = rig.server.address();
    let over = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let attackers = [("127.0.0.2", 96), ("127.0.0.3", 96)].map(|(from, count)| {
        let over = std::sync::Arc::clone(&over);
        std::thread::spawn(move || {
            let mut open = Vec::new();
            while !over.load(std::sync::atomic::Ordering::Relaxed) {
                open.retain(is_open);
                while open.len() < count {
                    let Some(stream) = connected_from(from, address) else {
                        break;
                    };
                    open.push(stream);
                }
                std::thread::sleep(Duration::from_millis(20));
            }
        })
    });
    std::thread::sleep(Duration::from_millis(500));
    for _ in 0..5 {
        let (status, answer) = http(&rig.url, "POST", "stop", &rig.keys.view).expect("a place");
        assert_eq!(status, 200, "{answer}");
    }
    over.store(true, std::sync::atomic::Ordering::Relaxed);
    for attacker in attackers {
        attacker.join().expect("it ends");
    }
}

/// A connection from this address.
fn connected_from(from: &str, to: std::net::SocketAddr) -> Option<TcpStream> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build();
    runtime.ok()?.block_on(async {
        let socket = tokio::net::TcpSocket::new_v4().ok()?;
        socket.bind(format!("{from}:0").parse().ok()?).ok()?;
        socket.connect(to).await.ok()?.into_std().ok()
    })
}

/// Clients that ask for `localhost` would take another user's program for the server.
#[test]
fn nobody_else_listens_where_localhost_leads() {
    let Ok(foreign) = std::net::TcpListener::bind("[::1]:0") else {
        // This computer has no such address, for nobody.
        assert!(std::net::TcpListener::bind("127.0.0.1:0").is_ok());
        return;
    };
    let rig = TestRig::new();
    let port = rig.server.address().port();
    let refused = std::net::TcpListener::bind(("::1", port)).expect_err("it is the server's");
    assert_eq!(refused.kind(), std::io::ErrorKind::AddrInUse);
    let url = Url::parse(&format!("localhost:{port}")).expect("an address");
    let (status, _) = http(&url, "GET", "state", &rig.keys.view).expect("an answer");
    assert_eq!(status, 200);
    // If somebody already listens there, a server does not start.
    let listen = format!("127.0.0.1:{}", foreign.local_addr().expect("bound").port());
    let refused = listens_at(&rig, &listen).to_string();
    assert!(
        refused.contains("[::1]") && refused.contains("localhost"),
        "{refused}"
    );
}

/// Why a server that should listen there does not start.
fn listens_at(rig: &TestRig, listen: &str) -> wheeleg_console::ConsoleError {
    let live = wheeleg_console::Live::load("stand", None).expect("built in");
    let refused = wheeleg_console::Server::start(wheeleg_console::Options {
        live,
        recordings: rig.home.path().join("recordings"),
        record: false,
        listen: listen.parse().expect("an address"),
        keys: rig.keys.clone(),
        page: None,
        names: Vec::new(),
        protection: wheeleg_console::Protection::AsNeeded,
        viewer_pages: Vec::new(),
        viewers_write: false,
    });
    refused.expect_err("refused")
}

#[test]
fn who_takes_all_places_of_an_address_leaves_those_of_others() {
    let rig = TestRig::new();
    let address = rig.server.address();
    // Over and over, as fast as possible.
    let over = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let attacker = std::thread::spawn({
        let over = std::sync::Arc::clone(&over);
        move || {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build();
            runtime.expect("a runtime").block_on(async move {
                let mut open = std::collections::VecDeque::new();
                while !over.load(std::sync::atomic::Ordering::Relaxed) {
                    let socket = tokio::net::TcpSocket::new_v4().expect("a socket");
                    socket
                        .bind("127.0.0.2:0".parse().expect("an address"))
                        .expect("bound");
                    if let Ok(stream) = socket.connect(address).await {
                        open.push_back(stream);
                    }
                    if open.len() > 400 {
                        open.pop_front();
                    }
                }
            });
        }
    });
    std::thread::sleep(Duration::from_millis(500));
    gets_in(&rig);
    over.store(true, std::sync::atomic::Ordering::Relaxed);
    attacker.join().expect("it ends");
}

#[test]
fn each_connection_has_a_nonce_of_its_own() {
    let rig = TestRig::new();
    let nonce = || {
        let uri = format!("ws://{}/ws", rig.server.address());
        let request =
            tungstenite::client::ClientRequestBuilder::new(uri.parse().expect("an address"));
        let request = request.with_sub_protocol("wheeleg.console.v1");
        let stream = TcpStream::connect(rig.server.address()).expect("connected");
        let (mut socket, _) = tungstenite::client(request, stream).expect("upgraded");
        let hello = socket.read().expect("hello").into_text().expect("a text");
        let hello: serde_json::Value = serde_json::from_str(&hello).expect("JSON");
        hello["nonce"].as_str().expect("digits").to_owned()
    };
    let mut nonces: Vec<String> = (0..20).map(|_| nonce()).collect();
    nonces.sort();
    nonces.dedup();
    assert_eq!(nonces.len(), 20);
    assert!(
        nonces.iter().all(
            |n| n.len() == 64 && n.chars().collect::<std::collections::BTreeSet<_>>().len() > 4
        )
    );
}

#[test]
fn no_key_is_told_to_anybody_or_written_anywhere() {
    let rig = TestRig::recorded(1.0);
    let mut driver = rig.driver("driver");
    done(&mut driver, "Disarm");
    done(&mut driver, "RecordStop");
    let keys = [rig.keys.control.to_hex(), rig.keys.view.to_hex()];
    let host = rig.server.address();
    let key = format!("Authorization: Bearer {}\r\n", rig.keys.view.to_hex());
    let told = [
        "state",
        "robot",
        "channels",
        "commands",
        "events",
        "faults",
        "recordings",
    ];
    let told = told.map(|path| get(&rig, &format!("/api/v1/{path}"), &key));
    let wrong = get(&rig, &format!("/foxglove?token={}x", keys[1]), "");
    for text in told
        .iter()
        .chain([&wrong, &get(&rig, "/", ""), &host.to_string()])
    {
        assert!(keys.iter().all(|key| !text.contains(key)), "{text}");
    }
    let mut files = 0;
    let folder = rig.home.path().join("recordings/0001");
    for file in std::fs::read_dir(folder).expect("a recording") {
        let path = file.expect("a file").path();
        let bytes = std::fs::read(&path).expect("read");
        files += 1;
        for key in &keys {
            assert!(
                !bytes.windows(64).any(|at| at == key.as_bytes()),
                "{}",
                path.display()
            );
        }
    }
    assert!(files >= 4, "{files}");
}

#[test]
fn rubbish_of_any_kind_ends_the_connection_and_nothing_else() {
    let rig = TestRig::new();
    let mut seed = 1_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 33) as u8
    };
    for _ in 0..30 {
        let mut client = rig.control("rubbish");
        let length = usize::from(random()) * 8;
        client
            .send_raw((0..length).map(|_| random()).collect())
            .expect("sent");
        assert_eq!(closed(&mut client), 4003);
    }
    for _ in 0..30 {
        let bytes: Vec<u8> = (0..500).map(|_| random()).collect();
        raw(&rig, &String::from_utf8_lossy(&bytes));
    }
    let state = rig.until("alive", |state| state["clients"] == 0);
    assert_eq!(state["alive"], true);
}

#[test]
fn an_address_without_a_name_and_one_in_use_are_refused_with_a_remedy() {
    let rig = TestRig::new();
    for (listen, word) in [
        ("0.0.0.0:0", "--name"),
        (&rig.server.address().to_string(), "--listen"),
    ] {
        let error = listens_at(&rig, listen);
        let help = miette::Diagnostic::help(&error)
            .expect("a remedy")
            .to_string();
        assert!(help.contains(word), "{help}");
    }
}
