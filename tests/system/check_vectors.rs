//! `wheeleg check vectors` as a user meets it.

use crate::program;
use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use predicates::str::contains;
use serde_json::{Value, json};

fn vectors(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("vectors")
        .join(name)
}

fn check(file: &Path) -> Command {
    let mut command = Command::new(program::path());
    command
        .env("NO_COLOR", "1")
        .args(["check", "vectors"])
        .arg(file);
    command
}

/// The reference file, another seed, and another robot, each to the tolerances of the file's schema.
#[test]
fn every_file_of_vectors_agrees() {
    for (name, seed, cases) in [
        ("model-7.json", 7, 50),
        ("model-11.json", 11, 20),
        ("other-robot-12.json", 12, 12),
    ] {
        let assert = check(&vectors(name)).arg("--json").assert().success();
        let json: Value = serde_json::from_slice(&assert.get_output().stdout).expect("JSON");
        assert_eq!(json["passed"], true, "{name}");
        assert_eq!(
            (&json["seed"], &json["cases"]),
            (&json!(seed), &json!(cases))
        );
        let quantities = json["quantities"].as_array().expect("a list");
        assert_eq!(quantities.len(), 56, "{name}");
        for q in quantities {
            let name_of = q["name"].as_str().expect("text");
            let force = ["I", "C", "C_qd"].contains(&name_of.rsplit('.').next().expect("key"))
                || name_of.contains(".tau");
            let tolerance = if force { 1e-10 } else { 1e-12 };
            assert_eq!(q["tolerance"], tolerance, "{name_of}");
            assert!(
                q["worst_error"].as_f64().expect("a number") <= tolerance,
                "{q}"
            );
            assert!(q["values"].as_u64().expect("a number") > 0, "{q}");
        }
    }
}

#[test]
fn a_wrong_number_ends_with_code_1_and_its_name() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let text = fs::read_to_string(vectors("model-11.json")).expect("vectors");
    let mut file: Value = serde_json::from_str(&text).expect("JSON");
    let number = &mut file["cases"][5]["half_robot"]["tau_a"][2];
    *number = json!(number.as_f64().expect("a number") + 2e-10);
    let path = dir.path().join("bad.json");
    fs::write(&path, file.to_string()).expect("written");
    check(&path)
        .assert()
        .code(1)
        .stdout(contains("FAIL     half_robot.tau_a"))
        .stdout(contains("case 5 [2]"))
        .stdout(contains("55 of 56 quantities within tolerance"));
}

#[test]
fn what_cannot_be_compared_ends_with_code_2_and_its_path() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let text = fs::read_to_string(vectors("model-11.json")).expect("vectors");
    let good: Value = serde_json::from_str(&text).expect("JSON");
    let refused = |file: &Value, words: &str| {
        let path = dir.path().join("bad.json");
        fs::write(&path, file.to_string()).expect("written");
        check(&path)
            .assert()
            .code(2)
            .stderr(contains(words))
            .stdout("");
    };
    let mut empty = good.clone();
    empty["cases"] = json!([]);
    refused(&empty, "at least one case");
    let mut text_for_number = good.clone();
    text_for_number["cases"][1]["leg"]["q"][2] = json!("long");
    refused(&text_for_number, "cases[1].leg.q[2]");
    let mut unknown = good;
    unknown["params"]["colour"] = json!(1);
    refused(&unknown, "params.colour");
    check(Path::new("missing.json"))
        .assert()
        .code(2)
        .stderr(contains("missing.json"));
}
