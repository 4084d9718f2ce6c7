//! The published forms of the summaries are those that the studies write.

use std::collections::BTreeSet;
use std::path::Path;

use wheeleg_studies::schemas;

/// Set to anything, it has the files written instead of compared.
const WRITE: &str = "WHEELEG_WRITE_SCHEMAS";

#[test]
fn the_committed_schemas_are_the_generated_ones() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/schema");
    let mut expected = Vec::new();
    for (name, schema) in schemas() {
        let (study, version) = name
            .strip_prefix("wheeleg.")
            .and_then(|name| name.split_once('/'))
            .expect("wheeleg.STUDY/VERSION");
        assert!(version.parse::<u32>().is_ok(), "{name}");
        let file = format!("{study}.json");
        // A key of a study that is also one of all studies would stand twice in its summary.
        let required = schema["required"].as_array().expect("required keys");
        let keys: BTreeSet<&str> = required.iter().filter_map(|key| key.as_str()).collect();
        assert_eq!(keys.len(), required.len(), "{name}: {required:?}");
        let text = format!("{schema:#}\n");
        let path = folder.join(&file);
        if std::env::var_os(WRITE).is_some() {
            std::fs::write(&path, &text).expect("written");
        }
        let committed = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(
            committed == text,
            "docs/reference/schema/{file} is not what the code writes. If readers of {name} still \
             understand it, write it anew with {WRITE}=1 cargo test -p wheeleg-studies --test \
             schema; else give it the next number, too"
        );
        expected.push(file);
    }
    for entry in std::fs::read_dir(&folder).expect("folder").flatten() {
        let file = entry.file_name().to_string_lossy().into_owned();
        assert!(expected.contains(&file), "{file} is no study's");
    }
}
