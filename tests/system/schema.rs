//! The output of a study or a campaign matches its published schema, and that schema is the one of the code.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use jsonschema::Validator;
use serde_json::Value;

/// The published schemas, by name.
fn published() -> &'static BTreeMap<String, Validator> {
    static SCHEMAS: OnceLock<BTreeMap<String, Validator>> = OnceLock::new();
    SCHEMAS.get_or_init(|| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reference/schema");
        let files = fs::read_dir(folder).expect("schemas").flatten();
        let schemas = files.map(|file| {
            let text = fs::read_to_string(file.path()).expect("schema");
            let schema: Value = serde_json::from_str(&text).expect("JSON");
            let name = schema["title"].as_str().expect("a title").to_owned();
            (name, jsonschema::validator_for(&schema).expect("a schema"))
        });
        schemas.collect()
    })
}

/// Set to anything, it has the files written instead of compared.
const WRITE: &str = "WHEELEG_WRITE_SCHEMAS";

#[test]
fn the_committed_schemas_are_the_generated_ones() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reference/schema");
    let mut expected = Vec::new();
    let campaigns = wheeleg_campaign::schemas();
    for (name, schema) in wheeleg_studies::schemas().into_iter().chain(campaigns) {
        let (form, version) = name
            .strip_prefix("wheeleg.")
            .and_then(|name| name.split_once('/'))
            .expect("wheeleg.FORM/VERSION");
        assert!(version.parse::<u32>().is_ok(), "{name}");
        let file = format!("{form}.json");
        // A key of both a study and all studies would appear twice in its summary.
        let required = schema["required"].as_array().expect("required keys");
        let keys: BTreeSet<&str> = required.iter().filter_map(|key| key.as_str()).collect();
        assert_eq!(keys.len(), required.len(), "{name}: {required:?}");
        let text = format!("{schema:#}\n");
        let path = folder.join(&file);
        if std::env::var_os(WRITE).is_some() {
            fs::write(&path, &text).expect("written");
        }
        let committed = fs::read_to_string(&path).unwrap_or_default();
        assert!(
            committed == text,
            "docs/reference/schema/{file} is not what the code writes. If readers of {name} still \
             understand it, write the file again with {WRITE}=1 cargo test -p wheeleg-tests --test \
             system schema; else give it the next number, too"
        );
        expected.push(file);
    }
    for entry in fs::read_dir(&folder).expect("folder").flatten() {
        let file = entry.file_name().to_string_lossy().into_owned();
        assert!(expected.contains(&file), "{file} is no form of ours");
    }
}

/// All that is wrong with a document by the schema of this name.
fn wrong(document: &Value, name: &str) -> Vec<String> {
    let schema = published().get(name).expect("a published schema");
    let errors = schema.iter_errors(document);
    errors
        .map(|e| format!("{}: {e}", e.instance_path))
        .collect()
}

/// Fails unless a document, which does not name its form, has this one.
pub(crate) fn assert_form(document: &Value, name: &str) {
    let wrong = wrong(document, name);
    assert!(wrong.is_empty(), "{name}: {wrong:#?}");
}

/// Fails unless a summary matches the schema that it names and is of this study.
pub(crate) fn assert_valid(summary: &Value, study: &str) {
    let name = summary["schema"].as_str().expect("a schema");
    let prefix = format!("wheeleg.{study}/");
    assert!(name.starts_with(&prefix), "{name} of {study}");
    assert_form(summary, name);
}

#[test]
fn a_summary_that_lacks_a_value_or_has_one_of_another_type_is_not_valid() {
    let schema = &published()["wheeleg.run/1"];
    assert!(!schema.is_valid(&serde_json::json!({ "schema": "wheeleg.run/1" })));
    let texts = serde_json::json!({ "schema": "wheeleg.run/1", "stopped": "yes" });
    assert!(!schema.is_valid(&texts));
}

/// Two cases, too short for the targets of their scenario.
#[test]
fn what_campaigns_write_is_as_published() {
    let home = tempfile::tempdir().expect("a folder");
    let plan = home.path().join("plan.toml");
    let text = "name = \"forms\"\nroot = 1\nblock = 2\n[base]\nscenario = \"stand\"\n\
                [factor.length]\nparameter = \"scenario.duration\"\ngrid = [0.2, 0.3]\nunit = \"s\"\n";
    fs::write(&plan, text).expect("written");
    let folder = home.path().join("out");
    let campaign = |arguments: &[&str], code: i32| -> String {
        let mut command = assert_cmd::Command::new(crate::program::path());
        let command = command.env("NO_COLOR", "1").current_dir(home.path());
        let assert = command.arg("campaign").args(arguments).assert().code(code);
        String::from_utf8(assert.get_output().stdout.clone()).expect("UTF-8")
    };
    let json = |text: &str| -> Value { serde_json::from_str(text).expect("JSON") };
    campaign(&["run", "plan.toml", "--out", "out", "--first", "1"], 0);
    let pilot = json(&campaign(&["status", "out", "--json"], 3));
    assert_valid(&pilot, "campaign-status");
    assert_eq!((&pilot["rows"], &pilot["cases"]), (&1.into(), &2.into()));
    campaign(&["run", "plan.toml", "--out", "out"], 0);
    let line = campaign(&["status", "out", "--json"], 0);
    assert_eq!(line.lines().count(), 1, "one line each time: {line}");
    let whole = json(&line);
    assert_valid(&whole, "campaign-status");
    assert_eq!((&whole["rows"], &whole["failed"]), (&2.into(), &2.into()));
    // Too short for the targets of `stand`: all of them count as missed.
    assert_eq!(whole["causes"][0]["cause"], "not-measured", "{whole}");

    let merged = json(&campaign(&["merge", "out", "--json"], 0));
    assert_valid(&merged, "campaign-merge");
    assert_eq!(
        (&merged["rows"], &merged["missing"]),
        (&2.into(), &0.into())
    );
    let report = ["report", "out/cases.parquet", "--json"];
    let against = ["--against", "out/cases.parquet"];
    for arguments in [report.to_vec(), [&report[..], &against[..]].concat()] {
        let report = json(&campaign(&arguments, 0));
        assert_valid(&report, "campaign-report");
        assert_eq!(report["findings"]["rows"], 2, "{report}");
        assert_eq!(report["against"].is_null(), arguments.len() == 3);
    }

    let mut plan = json(&fs::read_to_string(folder.join("plan.json")).expect("there"));
    assert_form(&plan, "wheeleg.campaign-plan/1");
    plan["format"] = 2.into();
    assert!(!wrong(&plan, "wheeleg.campaign-plan/1").is_empty());
}
