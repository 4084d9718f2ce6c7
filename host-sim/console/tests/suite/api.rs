//! What the HTTP API answers is what its OpenAPI document says.

use serde_json::{Value, json};
use wheeleg_console::client::http;

use crate::common::{TestRig, done, look};

/// The schema of an answer, with all that it refers to.
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
    // A robot that is driven, has a fault, and is recorded has most to tell.
    let mut driver = rig.driver("driver");
    done(&mut driver, "RecordStart");
    let fault = json!({ "fault": "pot-open:joint3" });
    driver.carry_out("Inject", &fault, 500).expect("sent");
    rig.until("held", |state| !state["hold"].is_null());
    let mut asked = 0;
    for (path, item) in paths {
        for method in item.as_object().expect("methods").keys() {
            let name = path.trim_start_matches('/');
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
    assert!(asked >= 8);
    let (status, answer) =
        http(&rig.url, "GET", "events?last=0", &rig.keys.view).expect("answered");
    assert_eq!(status, 400);
    assert!(
        schema(&document, "/events", "get", 400).is_valid(&answer),
        "{answer}"
    );
    let nobody = wheeleg_console::Key::new([0; 32]);
    let (status, answer) = http(&rig.url, "GET", "state", &nobody).expect("answered");
    assert_eq!(status, 401);
    assert!(
        schema(&document, "/state", "get", 401).is_valid(&answer),
        "{answer}"
    );
    look(&mut driver, "state");
    // The schema is strict: a field more or less is told.
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
