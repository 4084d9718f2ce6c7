//! The HTTP API answers as its OpenAPI document says.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;

use serde_json::{Value, json};
use wheeleg_console::client::http;

use crate::common::{TestRig, done, look};

/// The schema of an answer, with everything that it refers to.
fn schema(document: &Value, path: &str, method: &str, status: u16) -> jsonschema::Validator {
    let response = &document["paths"][path][method]["responses"][status.to_string()];
    let content = response["content"].as_object().expect("a content");
    let schema = &content.values().next().expect("a kind")["schema"];
    let whole = json!({ "$ref": schema["$ref"], "components": document["components"] });
    jsonschema::validator_for(&whole).expect("a schema")
}

#[test]
fn every_answer_is_as_the_document_says() {
    let rig = TestRig::new();
    let document: Value = serde_json::from_str(include_str!("../../openapi.json")).expect("JSON");
    let paths = document["paths"].as_object().expect("paths");
    // A robot that is driven, has a fault, and is recorded gives the longest answers.
    let mut driver = rig.driver("driver");
    done(&mut driver, "RecordStart");
    let fault = json!({ "fault": "pot-open:joint3" });
    driver.carry_out("Inject", &fault, 500).expect("sent");
    rig.until("held", |state| !state["hold"].is_null());
    let mut asked = 0;
    for (path, item) in paths {
        for method in item.as_object().expect("methods").keys() {
            let name = match path.as_str() {
                "/samples" => "samples?channel=/joint/3&seconds=2",
                other => other.trim_start_matches('/'),
            };
            let upper = method.to_uppercase();
            let (status, answer) = http(&rig.url, &upper, name, &rig.keys.view).expect("answered");
            assert_eq!(status, 200, "{path}: {answer}");
            let validator = schema(&document, path, method, 200);
            let told: Vec<String> = validator
                .iter_errors(&answer)
                .map(|e| format!("{} {e}", e.instance_path))
                .collect();
            assert!(told.is_empty(), "{path}: {told:?}");
            let other = if upper == "GET" { "POST" } else { "GET" };
            let (status, _) = http(&rig.url, other, name, &rig.keys.view).expect("answered");
            assert_eq!(status, 405, "{other} {path}");
            asked += 1;
        }
    }
    assert!(asked >= 9);
    let (status, answer) =
        http(&rig.url, "GET", "events?last=0", &rig.keys.view).expect("answered");
    assert_eq!(status, 400);
    assert!(
        schema(&document, "/events", "get", 400).is_valid(&answer),
        "{answer}"
    );
    let nobody = wheeleg_access::Key::new([0; 32]);
    let (status, answer) = http(&rig.url, "GET", "state", &nobody).expect("answered");
    assert_eq!(status, 401);
    assert!(
        schema(&document, "/state", "get", 401).is_valid(&answer),
        "{answer}"
    );
    look(&mut driver, "state");
    // The schema is strict: an extra or missing field is reported.
    let state = rig.state();
    let strict = schema(&document, "/state", "get", 200);
    for name in ["armed", "recording", "boards"] {
        let mut less = state.clone();
        less.as_object_mut().expect("an object").remove(name);
        assert!(!strict.is_valid(&less), "{name}");
    }
    let mut more = state;
    more["x"] = json!(1);
    assert!(!strict.is_valid(&more));
}

/// Asks for samples as a spreadsheet would.
fn csv(rig: &TestRig, query: &str) -> String {
    let address = rig.server.address();
    let mut stream = TcpStream::connect(address).expect("connected");
    let key = rig.keys.view.to_hex();
    let request = format!(
        "GET /api/v1/samples?{query} HTTP/1.0\r\nHost: {address}\r\nAuthorization: Bearer {key}\r\nAccept: text/csv\r\n\r\n"
    );
    stream.write_all(request.as_bytes()).expect("sent");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("an answer");
    let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
    assert!(
        head.starts_with("HTTP/1.0 200") && head.contains("text/csv"),
        "{head}"
    );
    body.to_owned()
}

#[test]
fn the_last_seconds_of_a_channel_are_told_as_json_and_csv() {
    let rig = TestRig::paced(Some(10.0));
    let get = |query: &str| {
        let path = format!("samples?{query}");
        http(&rig.url, "GET", &path, &rig.keys.view).expect("answered")
    };
    let now_us = || rig.state()["master_us"].as_u64().expect("a time");
    rig.until("told for so long", |state| {
        state["master_us"].as_u64() > Some(4_000_000)
    });
    let before_us = now_us();
    let (status, answer) = get("channel=/joint/3&seconds=2");
    assert_eq!(status, 200, "{answer}");
    let fields = answer["fields"].as_array().expect("a list");
    assert_eq!(
        fields[..3],
        [json!("t_ns"), json!("commanded_mm"), json!("reference_mm")]
    );
    let rows = answer["rows"].as_array().expect("a list");
    let times: Vec<u64> = rows.iter().filter_map(|row| row[0].as_u64()).collect();
    // 50 a second at most, and on a busy computer at this pace fewer.
    assert!((10..=101).contains(&times.len()), "{} rows", times.len());
    assert!(
        times.windows(2).all(|pair| pair[1] >= pair[0] + 1_000_000),
        "{times:?}"
    );
    assert!(times[0] >= (before_us - 2_000_000) * 1_000, "{times:?}");
    for row in rows {
        assert_eq!(row.as_array().map(Vec::len), Some(fields.len()));
        assert!(
            row[3]
                .as_f64()
                .is_some_and(|mm| (-1.0..181.0).contains(&mm)),
            "{row}"
        );
    }
    let table = csv(&rig, "channel=/joint/3&seconds=2");
    assert!(
        table.starts_with("t_ns,commanded_mm,reference_mm,"),
        "{table:.100}"
    );
    assert!((11..=102).contains(&table.lines().count()));
    // Every event, whenever it was within the minute.
    let (_, all) = get("channel=/events");
    let told = rig.events("command_accepted").len() + all["rows"].as_array().map_or(0, Vec::len);
    assert!(told > 0, "{all}");
    for wrong in [
        "",
        "channel=/joint/9",
        "channel=/joint/3&seconds=0",
        "channel=/joint/3&seconds=61",
        "channel=/joint/3&last=1",
    ] {
        let (status, problem) = get(wrong);
        assert_eq!((status, &problem["status"]), (400, &json!(400)), "{wrong}");
        assert!(problem["remedy"].is_string(), "{wrong}");
    }
}
