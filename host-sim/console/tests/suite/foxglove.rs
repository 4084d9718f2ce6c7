//! Viewers by the protocol of Foxglove and Lichtblick.

use std::collections::{BTreeMap, BTreeSet};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::client::ClientRequestBuilder;
use tungstenite::{Message, WebSocket};
use wheeleg_access::Key;
use wheeleg_console::client::{Outcome, http};

use crate::common::{PAGE, TestRig, done, look, refusal};

/// A message to a viewer.
#[derive(Debug)]
enum Heard {
    Json(Value),
    Data {
        subscription: u32,
        t_ns: u64,
        payload: Vec<u8>,
    },
    Time(u64),
    Called(u32, Value),
    Asset(u8, String, Vec<u8>),
    Closed(u16),
}

struct Viewer {
    socket: WebSocket<TcpStream>,
    channels: Vec<Value>,
    info: Value,
}

/// A viewer's opening request.
struct Ask<'a> {
    token: String,
    protocol: Option<&'a str>,
    origin: Option<&'a str>,
}

impl<'a> Ask<'a> {
    fn with(key: &Key) -> Self {
        Self {
            token: key.to_hex(),
            protocol: Some("foxglove.sdk.v1"),
            origin: None,
        }
    }
}

impl Viewer {
    /// Connects, or returns the status of the refusal.
    fn open(rig: &TestRig, ask: &Ask<'_>) -> Result<Self, u16> {
        let address = rig.server.address();
        let uri = format!("ws://{address}/foxglove?token={}", ask.token);
        let mut request = ClientRequestBuilder::new(uri.parse().expect("an address"));
        if let Some(protocol) = ask.protocol {
            request = request.with_sub_protocol(protocol);
        }
        if let Some(origin) = ask.origin {
            request = request.with_header("Origin", origin);
        }
        let stream = TcpStream::connect(address).expect("connected");
        let (socket, response) = match tungstenite::client(request, stream) {
            Ok(open) => open,
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(refused))) => {
                return Err(refused.status().as_u16());
            }
            Err(other) => panic!("{other}"),
        };
        let chosen = response.headers().get("sec-websocket-protocol");
        assert_eq!(chosen.and_then(|c| c.to_str().ok()), ask.protocol);
        let wait = Some(Duration::from_millis(20));
        socket.get_ref().set_read_timeout(wait).expect("set");
        let mut viewer = Self {
            socket,
            channels: Vec::new(),
            info: Value::Null,
        };
        viewer.info = viewer.json("serverInfo");
        let offered = viewer.json("advertise");
        viewer.channels = offered["channels"].as_array().expect("a list").clone();
        Ok(viewer)
    }

    fn view(rig: &TestRig) -> Self {
        Self::open(rig, &Ask::with(&rig.keys.view)).expect("let in")
    }

    fn send(&mut self, message: Value) {
        self.socket
            .send(Message::Text(message.to_string().into()))
            .expect("sent");
    }

    fn read(&mut self) -> Option<Heard> {
        let number = |bytes: &[u8]| u32::from_le_bytes(bytes[..4].try_into().expect("four bytes"));
        let time = |bytes: &[u8]| u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes"));
        match self.socket.read() {
            Ok(Message::Text(text)) => Some(Heard::Json(
                serde_json::from_str(&text).expect("a JSON object"),
            )),
            Ok(Message::Binary(bytes)) => Some(match bytes[0] {
                1 => Heard::Data {
                    subscription: number(&bytes[1..]),
                    t_ns: time(&bytes[5..]),
                    payload: bytes[13..].to_vec(),
                },
                2 => Heard::Time(time(&bytes[1..])),
                3 => {
                    let encoding = number(&bytes[9..]) as usize;
                    assert_eq!(&bytes[13..13 + encoding], b"json");
                    let answer = serde_json::from_slice(&bytes[13 + encoding..]);
                    Heard::Called(number(&bytes[5..]), answer.expect("JSON"))
                }
                4 => {
                    let (head, rest) = bytes.split_at(10);
                    let (why, file) = rest.split_at(number(&head[6..]) as usize);
                    let why = String::from_utf8(why.to_vec()).expect("a text");
                    Heard::Asset(head[5], why, file.to_vec())
                }
                op => panic!("unknown message {op}"),
            }),
            Ok(Message::Close(frame)) => Some(Heard::Closed(frame.map_or(1000, |f| f.code.into()))),
            Ok(_) => None,
            Err(tungstenite::Error::Io(e)) if is_wait(&e) => None,
            Err(_) => Some(Heard::Closed(1006)),
        }
    }

    fn until<T>(&mut self, what: &str, mut found: impl FnMut(Heard) -> Option<T>) -> T {
        let begin = Instant::now();
        loop {
            if let Some(wanted) = self.read().and_then(&mut found) {
                return wanted;
            }
            assert!(begin.elapsed() < Duration::from_secs(10), "no {what}");
        }
    }

    fn json(&mut self, op: &str) -> Value {
        self.until(op, |heard| match heard {
            Heard::Json(value) if value["op"] == op => Some(value),
            _ => None,
        })
    }

    fn closed(&mut self) -> u16 {
        self.until("close", |heard| match heard {
            Heard::Closed(code) => Some(code),
            _ => None,
        })
    }

    /// Subscribes to all channels, with numbers 100 above theirs.
    fn subscribe_all(&mut self) {
        let wanted = self.channels.iter().map(|c| {
            let id = c["id"].as_u64().expect("a number");
            json!({ "id": id + 100, "channelId": id })
        });
        let wanted: Vec<Value> = wanted.collect();
        self.send(json!({ "op": "subscribe", "subscriptions": wanted }));
    }

    fn asset(&mut self, uri: &str) -> (u8, String, Vec<u8>) {
        self.send(json!({ "op": "fetchAsset", "uri": uri, "requestId": 7 }));
        self.until("asset", |heard| match heard {
            Heard::Asset(status, why, file) => Some((status, why, file)),
            _ => None,
        })
    }

    fn call(&mut self, service: u32) {
        let mut message = vec![2];
        message.extend_from_slice(&service.to_le_bytes());
        message.extend_from_slice(&9_u32.to_le_bytes());
        message.extend_from_slice(&4_u32.to_le_bytes());
        message.extend_from_slice(b"json{}");
        self.socket
            .send(Message::Binary(message.into()))
            .expect("sent");
    }

    /// Values of parameters in the answer to a request.
    fn values(&mut self, request: Value) -> Value {
        let id = request["id"].clone();
        self.send(request);
        self.until("values", |heard| match heard {
            Heard::Json(v) if v["op"] == "parameterValues" && v["id"] == id => {
                Some(v["parameters"].clone())
            }
            _ => None,
        })
    }
}

fn is_wait(e: &std::io::Error) -> bool {
    matches!(
        e.kind(),
        std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut
    )
}

/// Names of elements of a URDF.
fn names(urdf: &str, element: &str) -> BTreeSet<String> {
    let begin = format!("<{element} name=\"");
    let rest = urdf.split(&begin).skip(1);
    rest.filter_map(|rest| Some(rest.split_once('"')?.0.to_owned()))
        .collect()
}

#[test]
fn every_channel_fits_its_schema_and_every_frame_is_a_link_of_the_robot() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let mut viewer = Viewer::view(&rig);
    for capability in [
        "time",
        "parameters",
        "parametersSubscribe",
        "services",
        "assets",
    ] {
        let list = viewer.info["capabilities"].as_array().expect("a list");
        assert!(list.iter().any(|c| c == capability), "{}", viewer.info);
    }
    let (status, why, urdf) = viewer.asset("package://wheeleg/wheeleg.urdf");
    assert_eq!((status, why.as_str()), (0, ""));
    let urdf = String::from_utf8(urdf).expect("a text");
    let links = names(&urdf, "link");
    assert!(links.contains("base_link") && links.len() > 10, "{links:?}");
    for other in ["package://wheeleg/../control.key", "file:///etc/passwd", ""] {
        let (status, why, file) = viewer.asset(other);
        assert!(status == 1 && file.is_empty(), "{other}");
        assert!(why.contains("wheeleg.urdf"), "{why}");
    }
    viewer.subscribe_all();
    let topics: BTreeMap<u64, Value> = viewer
        .channels
        .iter()
        .map(|c| (c["id"].as_u64().expect("a number"), c.clone()))
        .collect();
    let schema = |channel: &Value| {
        let text = channel["schema"].as_str().expect("a text");
        let schema: Value = serde_json::from_str(text).expect("JSON");
        jsonschema::validator_for(&schema).expect("a schema")
    };
    let validators: BTreeMap<u64, _> = topics.iter().map(|(id, c)| (*id, schema(c))).collect();
    // Channels that only a walk has.
    let mut missing: BTreeSet<&str> = topics
        .values()
        .filter_map(|c| c["topic"].as_str())
        .collect();
    missing.remove("/behaviours");
    let mut moved = false;
    let (mut last_ns, mut newest_ns) = (0, 0);
    let begin = Instant::now();
    while !missing.is_empty() || newest_ns == 0 {
        assert!(begin.elapsed() < Duration::from_secs(40), "no {missing:?}");
        if !moved {
            // It is gone afterwards, and the robot holds.
            let _ = driver.read();
            moved = true;
            let args = json!({ "joint": 2, "stroke": 60.0 });
            driver.give("JointReference", &args, 500).expect("sent");
        }
        match viewer.read() {
            Some(Heard::Time(t_ns)) => {
                assert!(t_ns >= last_ns, "time goes back");
                last_ns = t_ns;
            }
            Some(Heard::Data {
                subscription,
                t_ns,
                payload,
            }) => {
                let id = u64::from(subscription) - 100;
                let topic = topics[&id]["topic"].as_str().expect("a text");
                let message: Value = serde_json::from_slice(&payload).expect("JSON");
                let judged = validators[&id].validate(&message);
                assert!(judged.is_ok(), "{topic}: {judged:?} {message}");
                newest_ns = newest_ns.max(t_ns);
                if topic == "/tf" {
                    for at in message["transforms"].as_array().expect("a list") {
                        for (frame, root) in [("child_frame_id", false), ("parent_frame_id", true)]
                        {
                            let name = at[frame].as_str().expect("a text");
                            assert!(links.contains(name) || (root && name == "world"), "{name}");
                        }
                    }
                }
                if topic == "/joint_states" {
                    let joints = names(&urdf, "joint");
                    for joint in message["joints"].as_array().expect("a list") {
                        let name = joint["name"].as_str().expect("a text");
                        assert!(joints.contains(name), "{name}");
                    }
                }
                if topic == "/robot_description" {
                    assert_eq!(message["data"], urdf);
                }
                missing.remove(topic);
            }
            Some(Heard::Closed(code)) => panic!("closed: {code}"),
            _ => {}
        }
    }
}

/// Also if somebody at the console wants the newest of them.
#[test]
fn a_viewer_is_told_an_event_once() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let mut looker = rig.view();
    let newest = json!({ "op": "subscribe", "channels": ["/events"], "hz": 50 });
    let n = looker.send(newest).expect("sent");
    assert_eq!(looker.outcome(n), Outcome::Done);
    let mut viewer = Viewer::view(&rig);
    viewer.subscribe_all();
    let events = viewer.channels.iter().find(|c| c["topic"] == "/events");
    let events = events.and_then(|c| c["id"].as_u64()).expect("a channel") + 100;
    // It gets what it asks for from now on.
    viewer.until("samples", |heard| {
        matches!(heard, Heard::Data { .. }).then_some(())
    });
    done(&mut driver, "Disarm");
    let mut told = Vec::new();
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(1) {
        if let Some(Heard::Data {
            subscription,
            t_ns,
            payload,
        }) = viewer.read()
            && u64::from(subscription) == events
        {
            told.push((t_ns, String::from_utf8(payload).expect("JSON")));
        }
    }
    assert!(!told.is_empty(), "no event");
    let different: BTreeSet<&(u64, String)> = told.iter().collect();
    assert_eq!(different.len(), told.len(), "{told:?}");
}

#[test]
fn without_a_key_or_from_a_foreign_page_nobody_looks() {
    let rig = TestRig::new();
    let status = |ask: &Ask<'_>| Viewer::open(&rig, ask).err();
    let right = || Ask::with(&rig.keys.view);
    for token in ["", "0", &"0".repeat(64), &"9".repeat(64), "%00"] {
        let ask = Ask {
            token: token.to_owned(),
            ..right()
        };
        assert_eq!(status(&ask), Some(401), "{token}");
    }
    for protocol in [
        None,
        Some("wheeleg.console.v1"),
        Some("foxglove.websocket.v2"),
    ] {
        let ask = Ask {
            protocol,
            ..right()
        };
        assert_eq!(status(&ask), Some(400), "{protocol:?}");
    }
    for origin in [
        "https://evil.example",
        "null",
        "https://viewer.example.evil",
        "http://viewer.example",
    ] {
        let ask = Ask {
            origin: Some(origin),
            ..right()
        };
        assert_eq!(status(&ask), Some(403), "{origin}");
    }
    for (protocol, origin) in [
        ("foxglove.sdk.v1", None),
        ("foxglove.websocket.v1", None),
        ("foxglove.websocket.v1", Some(PAGE)),
    ] {
        let ask = Ask {
            protocol: Some(protocol),
            origin,
            ..right()
        };
        assert_eq!(status(&ask), None, "{protocol} {origin:?}");
    }
    // Too many wrong keys; a right one is never locked out.
    let wrong = Ask {
        token: "9".repeat(64),
        ..right()
    };
    let statuses: Vec<Option<u16>> = (0..12).map(|_| status(&wrong)).collect();
    assert_eq!(statuses[11], Some(429), "{statuses:?}");
    assert_eq!(status(&right()), None);
}

#[test]
fn what_is_not_of_the_protocol_ends_the_connection_and_nothing_else() {
    let rig = TestRig::new();
    let mut seed = 1_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 33) as u8
    };
    let mut messages = vec![
        Message::Text("{".into()),
        Message::Text("[]".into()),
        Message::Text(r#"{"op":"subscribe","subscriptions":7}"#.into()),
        Message::Text("[".repeat(30_000).into()),
        Message::Binary(Vec::new().into()),
        Message::Binary(vec![2, 1, 0, 0, 0, 9, 0, 0, 0, 255, 255, 255, 255].into()),
    ];
    for _ in 0..20 {
        let length = usize::from(random()) + 1;
        // Not 1 or 2, which could be sound by chance.
        let bytes: Vec<u8> = (0..length).map(|_| random() | 4).collect();
        messages.push(Message::Binary(bytes.into()));
    }
    for message in messages {
        let mut viewer = Viewer::view(&rig);
        viewer.socket.send(message.clone()).expect("sent");
        assert_eq!(viewer.closed(), 4003, "{message:?}");
    }
    for size in [40_000, 400_000] {
        let mut viewer = Viewer::view(&rig);
        let _ = viewer.socket.send(Message::Text(" ".repeat(size).into()));
        assert_ne!(viewer.closed(), 1000, "{size}");
    }
    let state = rig.until("alone", |state| state["clients"] == 0);
    assert_eq!(
        (&state["alive"], &state["emergency_stop"]),
        (&json!(true), &json!(false))
    );
}

#[test]
fn a_viewer_may_stop_and_give_nothing_else() {
    let rig = TestRig::new();
    let mut driver = rig.driver("driver");
    let mut viewer = Viewer::view(&rig);
    viewer.call(2);
    let failure = viewer.json("serviceCallFailure");
    assert_eq!(
        (&failure["serviceId"], &failure["callId"]),
        (&json!(2), &json!(9))
    );
    // Publishing, and the rest of the protocol.
    let mut publish = vec![1, 0, 0, 0, 0];
    publish.extend_from_slice(b"{}");
    viewer
        .socket
        .send(Message::Binary(publish.into()))
        .expect("sent");
    assert_eq!(viewer.json("status")["level"], 2);
    let channels = json!([{ "id": 1, "topic": "/cmd_vel", "encoding": "json", "schemaName": "" }]);
    viewer.send(json!({ "op": "advertise", "channels": channels }));
    assert_eq!(viewer.json("status")["level"], 2);
    let state = rig.state();
    assert_eq!(
        (&state["armed"], &state["emergency_stop"]),
        (&json!(true), &json!(false))
    );
    viewer.call(1);
    let answer = viewer.until("answer", |heard| match heard {
        Heard::Called(9, answer) => Some(answer),
        _ => None,
    });
    assert_eq!(answer["stopped"], true);
    assert_eq!(rig.state()["emergency_stop"], true);
    assert_eq!(rig.state()["stopped"]["via"], "foxglove");
    look(&mut driver, "state");
}

#[test]
fn parameters_are_read_by_all_and_written_disarmed_with_the_control_key_alone() {
    const GAIN: &str = "/joint/3/error_scale";
    let rig = TestRig::new();
    rig.until("ready", |state| state["ready"] == true);
    let get = |id: &str| json!({ "op": "getParameters", "parameterNames": [GAIN], "id": id });
    let set = |value: Value, id: &str| {
        let parameters = json!([{ "name": GAIN, "value": value }]);
        json!({ "op": "setParameters", "parameters": parameters, "id": id })
    };
    let mut viewer = Viewer::view(&rig);
    let all = viewer.values(json!({ "op": "getParameters", "parameterNames": [], "id": "all" }));
    let all = all.as_array().expect("a list");
    assert!(all.len() > 200, "{}", all.len());
    assert!(all.iter().any(|p| p["name"] == "/robot_description"));
    let before = viewer.values(get("r"))[0]["value"].clone();
    let other = before.as_f64().expect("a number") + 1.0;
    viewer.send(json!({ "op": "subscribeParameterUpdates", "parameterNames": [GAIN] }));
    assert_eq!(viewer.values(set(json!(other), "v"))[0]["value"], before);
    // With the other key, and within the range.
    let mut writer = Viewer::open(&rig, &Ask::with(&rig.keys.control)).expect("let in");
    for wrong in [json!(1e6), json!("7"), json!(null), json!([1])] {
        assert_eq!(
            writer.values(set(wrong.clone(), "w"))[0]["value"],
            before,
            "{wrong}"
        );
    }
    assert_eq!(writer.values(set(json!(other), "w"))[0]["value"], other);
    let told = viewer.until("change", |heard| match heard {
        Heard::Json(v) if v["op"] == "parameterValues" && v["id"].is_null() => Some(v),
        _ => None,
    });
    assert_eq!(told["parameters"][0]["value"], other);
    rig.until("free", |state| state["control"].is_null());
    // The board has it: the master has read it back.
    let mut driver = rig.control("driver");
    look(&mut driver, "state");
    done(&mut driver, "TakeControl");
    driver.keep_control(true);
    let read = json!({ "board": 3, "parameter": "error_scale" });
    let outcome = driver
        .carry_out("ReadParameter", &read, 5000)
        .expect("sent");
    assert_eq!(outcome, Outcome::Done);
    // Held by somebody, then armed: nothing is written.
    assert_eq!(writer.values(set(before.clone(), "h"))[0]["value"], other);
    done(&mut driver, "Arm");
    done(&mut driver, "ReleaseControl");
    rig.until("free", |state| state["control"].is_null());
    assert_eq!(writer.values(set(before.clone(), "a"))[0]["value"], other);
    // Viewers also see writes from the console.
    done(&mut driver, "TakeControl");
    done(&mut driver, "Disarm");
    let args = json!({ "board": 3, "parameter": "error_scale", "value": before });
    let outcome = driver
        .carry_out("WriteParameter", &args, 5000)
        .expect("sent");
    assert_eq!(outcome, Outcome::Done);
    assert_eq!(viewer.values(get("e"))[0]["value"], before);
    let other_board = json!({ "board": 9, "parameter": "error_scale", "value": before });
    assert_eq!(
        refusal(&mut driver, "WriteParameter", &other_board),
        "bad_argument"
    );
}

/// A viewer that writes on and on makes room for a client that wants to drive.
#[test]
fn a_viewer_that_writes_hands_the_control_over_to_who_asks_for_it() {
    let rig = TestRig::new();
    rig.until("ready", |state| state["ready"] == true);
    let mut writer = Viewer::open(&rig, &Ask::with(&rig.keys.control)).expect("let in");
    let all = writer.values(json!({ "op": "getParameters", "parameterNames": [], "id": "all" }));
    let of_boards = |p: &&Value| {
        let name = p["name"].as_str().unwrap_or_default();
        name.starts_with("/joint/") || name.starts_with("/wheel/")
    };
    let all: Vec<&Value> = all
        .as_array()
        .expect("a list")
        .iter()
        .filter(of_boards)
        .collect();
    assert!(all.len() > 100, "{}", all.len());
    let set = json!({ "op": "setParameters", "parameters": all, "id": "all" });
    writer.send(set);
    let name = |state: &Value| state["control"]["holder"].clone();
    rig.until("written", |state| name(state) == "foxglove");
    let mut driver = rig.control("driver");
    look(&mut driver, "state");
    let why = refusal(&mut driver, "TakeControl", &json!({}));
    assert_eq!(why, "control_held");
    assert_eq!(look(&mut driver, "offered")["by"], "foxglove");
    // The writer waits for the client that was offered control.
    let one = json!({ "op": "setParameters", "parameters": all[..1], "id": "one" });
    writer.send(one);
    done(&mut driver, "TakeControl");
    driver.keep_control(true);
    rig.until("driven", |state| name(state) == "driver");
    let told = writer.until("end", |heard| match heard {
        Heard::Json(v) if v["op"] == "status" && v["level"] == 2 => Some(v),
        _ => None,
    });
    let text = told["message"].as_str().expect("a text");
    assert!(text.contains("driver"), "{text}");
}

#[test]
fn viewers_that_never_read_cost_nobody_anything_and_take_no_place_of_control() {
    let rig = TestRig::new();
    let mut quick = Viewer::view(&rig);
    quick.subscribe_all();
    let mut idle = Vec::new();
    let mut refused = 0;
    for _ in 0..40 {
        match Viewer::open(&rig, &Ask::with(&rig.keys.view)) {
            Ok(mut viewer) => {
                viewer.subscribe_all();
                idle.push(viewer);
            }
            Err(status) => {
                assert_eq!(status, 503);
                refused += 1;
            }
        }
        // The last place is closed after the upgrade: it is kept for a client that may control.
        if idle.len() + 1 >= 31 {
            break;
        }
    }
    assert_eq!((idle.len(), refused), (30, 0));
    let mut driver = rig.control("driver");
    look(&mut driver, "state");
    done(&mut driver, "TakeControl");
    let begin = Instant::now();
    let (mut samples, mut newest_ns) = (0, 0);
    while begin.elapsed() < Duration::from_secs(3) {
        if let Some(Heard::Data { t_ns, .. }) = quick.read() {
            samples += 1;
            newest_ns = t_ns;
        }
    }
    // A busy computer's wall time is not judged: 32 channels at 100 Hz would be 9,000.
    assert!(samples > 500, "{samples}");
    let now_us = rig.state()["master_us"].as_u64().expect("a time");
    assert!(
        now_us - newest_ns / 1_000 < 1_000_000,
        "stale: {now_us} {newest_ns}"
    );
    let (status, _) = http(&rig.url, "POST", "stop", &rig.keys.view).expect("an answer");
    assert_eq!(status, 200);
}
