//! What a study writes is what its published schema says.

use std::collections::BTreeMap;
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

/// Fails unless a summary is as the schema says that it names, and it is of this study.
pub(crate) fn assert_valid(summary: &Value, study: &str) {
    let name = summary["schema"].as_str().expect("a schema");
    let prefix = format!("wheeleg.{study}/");
    assert!(name.starts_with(&prefix), "{name} of {study}");
    let schema = published().get(name).expect("a published schema");
    let wrong: Vec<String> = schema
        .iter_errors(summary)
        .map(|e| format!("{}: {e}", e.instance_path))
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_summary_that_lacks_a_value_or_has_one_of_another_type_is_not_valid() {
    let schema = &published()["wheeleg.run/1"];
    assert!(!schema.is_valid(&serde_json::json!({ "schema": "wheeleg.run/1" })));
    let texts = serde_json::json!({ "schema": "wheeleg.run/1", "stopped": "yes" });
    assert!(!schema.is_valid(&texts));
}
