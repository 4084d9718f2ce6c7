//! Clients that send endless requests, with a key or without: they cost others neither time nor memory.

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::client::ClientRequestBuilder;
use tungstenite::{Message, WebSocket};
use wheeleg_console::client::{Outcome, http};
use wheeleg_console::foxglove::ITEMS_MAX;

use crate::common::{TestRig, look};

/// A viewer by the protocol of Foxglove, with the view key.
fn viewer(rig: &TestRig) -> WebSocket<TcpStream> {
    let (address, key) = (rig.server.address(), rig.keys.view.to_hex());
    let uri = format!("ws://{address}/foxglove?token={key}");
    let request = ClientRequestBuilder::new(uri.parse().expect("an address"));
    let request = request.with_sub_protocol("foxglove.sdk.v1");
    let stream = TcpStream::connect(address).expect("connected");
    let wait = stream.set_read_timeout(Some(Duration::from_secs(10)));
    wait.expect("set");
    tungstenite::client(request, stream).expect("let in").0
}

/// Level of a status about a request that was skipped because there were too many.
const WARNING: u64 = 1;

#[test]
fn a_short_request_has_no_endless_answer() {
    let rig = TestRig::new();
    let mut viewer = viewer(&rig);
    // Each answer would hold the robot's whole description.
    let names = vec!["/robot_description"; ITEMS_MAX];
    let asked = json!({ "op": "getParameters", "parameterNames": names, "id": "\"1\"" });
    viewer.send(Message::text(asked.to_string())).expect("sent");
    let told = heard(&mut viewer, "parameterValues");
    assert_eq!(told["id"], "\"1\"");
    assert_eq!(told["parameters"].as_array().expect("a list").len(), 1);
}

/// The next message of this kind.
fn heard(viewer: &mut WebSocket<TcpStream>, op: &str) -> Value {
    loop {
        match viewer.read().expect("not closed") {
            Message::Text(text) => {
                let told: Value = serde_json::from_str(&text).expect("JSON");
                if told["op"] == op {
                    return told;
                }
            }
            Message::Close(frame) => panic!("closed: {frame:?}"),
            _ => {}
        }
    }
}

#[test]
fn a_viewer_names_so_many_items_at_a_time_and_sends_so_many_bytes() {
    let rig = TestRig::new();
    let mut viewer = viewer(&rig);
    let ids: Vec<usize> = (0..=ITEMS_MAX).collect();
    for asked in [
        json!({ "op": "unsubscribe", "subscriptionIds": ids }),
        json!({ "op": "subscribeParameterUpdates", "parameterNames": vec!["x"; ids.len()] }),
    ] {
        viewer.send(Message::text(asked.to_string())).expect("sent");
        let told = heard(&mut viewer, "status");
        let text = told["message"].as_str().expect("a text");
        assert!(text.contains(&ITEMS_MAX.to_string()), "{text}");
    }
    // Few messages, each as long as allowed: 6 at once, and 3 a second.
    let name = "x".repeat(31_000);
    let asked = json!({ "op": "getParameters", "parameterNames": [name], "id": "long" });
    let begin = Instant::now();
    for _ in 0..40 {
        viewer.send(Message::text(asked.to_string())).expect("sent");
    }
    let mut answers = 0;
    let mut refused = 0;
    while answers + refused < 40 {
        match viewer.read().expect("not closed") {
            Message::Text(text) => {
                let told: Value = serde_json::from_str(&text).expect("JSON");
                match (told["op"].as_str(), told["level"].as_u64()) {
                    (Some("parameterValues"), _) => answers += 1,
                    (Some("status"), Some(WARNING)) => refused += 1,
                    _ => {}
                }
            }
            Message::Close(frame) => panic!("closed: {frame:?}"),
            _ => {}
        }
    }
    let most = 7 + 4 * (begin.elapsed().as_secs() + 1);
    assert!((4..=most).contains(&answers), "{answers} {refused}");
}

/// No other request is in front of the stop of a client that has proved a key: here, all threads for requests
/// and viewers are busy for seconds.
#[test]
fn a_stop_does_not_wait_for_what_others_ask() {
    let rig = TestRig::new();
    rig.until("ready", |state| state["ready"] == true);
    let mut client = rig.view();
    look(&mut client, "state");
    rig.server.block_requests_for(Duration::from_secs(8));
    let begin = Instant::now();
    let n = client.send(json!({ "op": "stop" })).expect("sent");
    assert_eq!(client.outcome(n), Outcome::Done);
    assert!(begin.elapsed() < Duration::from_secs(4), "it waited");
}

/// Many requests come in one piece; after the first refused one the connection ends.
#[test]
fn who_has_no_key_asks_once_on_a_connection() {
    let rig = TestRig::new();
    let address = rig.server.address();
    for (host, path) in [
        ("x", "/"),
        ("x", "/api/v1/state"),
        (&*address.to_string(), "/api/v1/state"),
        (&*address.to_string(), "/foxglove?token=00"),
    ] {
        let mut stream = TcpStream::connect(address).expect("connected");
        let wait = stream.set_read_timeout(Some(Duration::from_secs(2)));
        wait.expect("set");
        let all = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").repeat(20);
        stream.write_all(all.as_bytes()).expect("sent");
        let mut answers = Vec::new();
        // Unread bytes end the connection with an error.
        let _ = stream.read_to_end(&mut answers);
        let answers = String::from_utf8_lossy(&answers);
        assert_eq!(answers.matches("HTTP/1.1 4").count(), 1, "{answers}");
    }
    // A client with a key keeps sending requests.
    let key = rig.keys.view.to_hex();
    let mut stream = TcpStream::connect(address).expect("connected");
    let wait = stream.set_read_timeout(Some(Duration::from_secs(1)));
    wait.expect("set");
    let asked = format!(
        "GET /api/v1/faults HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {key}\r\n\r\n"
    );
    stream.write_all(asked.repeat(5).as_bytes()).expect("sent");
    let mut answers = Vec::new();
    let _ = stream.read_to_end(&mut answers);
    let answers = String::from_utf8_lossy(&answers);
    assert_eq!(answers.matches("HTTP/1.1 200").count(), 5, "{answers}");
}

/// Hundreds of questions come in one piece, over and over, on several connections.
#[test]
fn who_asks_without_end_holds_up_no_stop() {
    let rig = TestRig::new();
    rig.until("ready", |state| state["ready"] == true);
    let address = rig.server.address();
    let (host, key) = (address.to_string(), rig.keys.view.to_hex());
    let floods: Vec<_> = ["parameters", "events", "faults", "parameters"]
        .map(|path| {
            let request = format!(
                "GET /api/v1/{path} HTTP/1.1\r\nHost: {host}\r\nAuthorization: Bearer {key}\r\n\r\n"
            );
            let stream = TcpStream::connect(address).expect("connected");
            let asks = {
                let mut stream = stream.try_clone().expect("a handle");
                let all = request.repeat(100);
                std::thread::spawn(move || while stream.write_all(all.as_bytes()).is_ok() {})
            };
            let reads = {
                let mut stream = stream.try_clone().expect("a handle");
                let mut answers = vec![0; 1 << 16];
                std::thread::spawn(move || while stream.read(&mut answers).is_ok_and(|n| n > 0) {})
            };
            (stream, asks, reads)
        })
        .into_iter()
        .collect();
    std::thread::sleep(Duration::from_millis(300));
    let begin = Instant::now();
    for _ in 0..10 {
        let (status, answer) = http(&rig.url, "POST", "stop", &rig.keys.view).expect("answered");
        assert_eq!(status, 200, "{answer}");
        std::thread::sleep(Duration::from_millis(30));
    }
    assert!(begin.elapsed() < Duration::from_secs(5), "{begin:?}");
    for (stream, asks, reads) in floods {
        let _ = stream.shutdown(Shutdown::Both);
        asks.join().expect("it ends");
        reads.join().expect("it ends");
    }
}

/// Only some stops of a connection are under way at a time; all are answered, and others' too.
#[test]
fn who_stops_without_end_holds_up_nobody() {
    let rig = TestRig::new();
    rig.until("ready", |state| state["ready"] == true);
    let mut flooder = rig.view();
    // It may be closed as too slow meanwhile: it reads none of its answers.
    let sent = (0..1_000).map_while(|_| flooder.send(json!({ "op": "stop" })).ok());
    let last = sent.last().expect("some");
    let mut other = rig.control("other");
    look(&mut other, "state");
    let n = other.send(json!({ "op": "stop" })).expect("sent");
    assert_eq!(other.outcome(n), Outcome::Done);
    let end = flooder.outcome(last);
    assert!(matches!(end, Outcome::Done | Outcome::Lost), "{end:?}");
    assert_eq!(rig.state()["emergency_stop"], true);
}
