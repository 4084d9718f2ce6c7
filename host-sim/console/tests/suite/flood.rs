//! Who has a key and asks without end: it costs others neither time nor memory.

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::client::ClientRequestBuilder;
use tungstenite::{Message, WebSocket};
use wheeleg_console::client::{Outcome, http};

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

#[test]
fn a_short_request_has_no_endless_answer() {
    let rig = TestRig::new();
    let mut viewer = viewer(&rig);
    // Each would be told with the robot's whole description.
    let names = vec!["/robot_description"; 1_300];
    let asked = json!({ "op": "getParameters", "parameterNames": names, "id": "\"1\"" });
    viewer.send(Message::text(asked.to_string())).expect("sent");
    let told = loop {
        match viewer.read().expect("not closed") {
            Message::Text(text) if text.contains("parameterValues") => break text,
            Message::Close(frame) => panic!("closed: {frame:?}"),
            _ => {}
        }
    };
    let told: Value = serde_json::from_str(&told).expect("JSON");
    assert_eq!(told["id"], "\"1\"");
    assert_eq!(told["parameters"].as_array().expect("a list").len(), 1);
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

/// Of stops only some of a connection are under way; all are answered, and others' too.
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
