//! The list of threats names existing tests.

use std::path::Path;

const THREATS: &str = include_str!("../../../../docs/reference/threats.md");

#[test]
fn every_threat_has_a_test_that_is_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let rows = THREATS.lines().filter(|line| line.starts_with("| "));
    let rows: Vec<&str> = rows.filter(|line| !line.starts_with("| try |")).collect();
    assert!(rows.len() > 20, "{} threats", rows.len());
    for row in rows {
        let cells: Vec<&str> = row.trim_matches(['|', ' ']).split(" | ").collect();
        let [_, _, tests] = cells[..] else {
            panic!("{row}");
        };
        let names: Vec<&str> = tests.split('`').skip(1).step_by(2).collect();
        assert!(!names.is_empty(), "no test: {row}");
        let mut file = String::new();
        for name in names {
            if name.ends_with(".rs") || name.ends_with(".py") {
                let path = root.join(name);
                file = std::fs::read_to_string(&path).expect("a file of tests");
            } else if name.contains('_') {
                // In Rust, or in Python.
                let tests = [format!("fn {name}()"), format!("def {name}(")];
                let there = tests.iter().any(|test| file.contains(test));
                assert!(there, "{name} is nowhere: {row}");
            } else {
                // A row of the fault matrix, or a fuzz target.
                let fuzz = root
                    .join("tests/fuzz/fuzz_targets")
                    .join(format!("{name}.rs"));
                let matrix = root.join("host-sim/FAULTS.md");
                let matrix = std::fs::read_to_string(matrix).expect("the matrix");
                assert!(
                    fuzz.is_file() || matrix.contains(&format!("`{name}`")),
                    "{name}"
                );
            }
        }
    }
}
