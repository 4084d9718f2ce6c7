//! Files of numbers that others wrote: reference vectors (JSON), as `wheeleg check
//! vectors` reads them, and axes (TOML). No panic; what is refused is explained,
//! and what passes passes twice and with every number compared. The simulator
//! reads no log back, so these stand for recorded data.

use wheeleg_config::AxisConfig;
use wheeleg_studies::check::vectors::check_text;

/// Longest text.
const LENGTH_MAX: usize = 64 * 1024;

/// The text of a file of vectors if it begins like JSON, of an axis otherwise.
pub fn run(data: &[u8]) {
    let text = String::from_utf8_lossy(&data[..data.len().min(LENGTH_MAX)]);
    if text.trim_start().starts_with(['{', '[']) {
        vectors(&text);
    } else {
        axis(&text);
    }
}

fn vectors(text: &str) {
    let first = check_text("fuzz.json", text);
    let second = check_text("fuzz.json", text);
    match (first, second) {
        (Ok(first), Ok(second)) => {
            assert_eq!(format!("{first:?}"), format!("{second:?}"));
            assert!(first.cases > 0, "a comparison of nothing");
            assert!(!first.quantities.is_empty());
            for quantity in &first.quantities {
                let name = &quantity.name;
                let within = quantity.worst_error <= quantity.tolerance;
                assert_eq!(quantity.pass, within, "{name}");
                assert!(
                    !first.passed || (quantity.pass && quantity.values > 0),
                    "{name}"
                );
            }
        }
        (Err(first), Err(second)) => {
            assert_eq!(first.to_string(), second.to_string());
            assert!(
                miette::Diagnostic::help(&first).is_some(),
                "no remedy: {first}"
            );
            explained(first);
        }
        (first, second) => panic!("not the same twice: {first:?} and {second:?}"),
    }
}

fn axis(text: &str) {
    let first = AxisConfig::parse("fuzz.toml", text);
    let again = AxisConfig::parse("fuzz.toml", text);
    assert_eq!(first.is_ok(), again.is_ok(), "not the same twice");
    match first {
        Ok(config) => assert_eq!(format!("{config:?}"), format!("{:?}", again.ok().unwrap())),
        Err(error) => {
            assert!(!error.problems().is_empty(), "refused without a problem");
            explained(error);
        }
    }
}

/// What a user sees: the places are in the text, or this panics.
fn explained(error: impl miette::Diagnostic + Send + Sync + 'static) {
    assert!(error.to_string().len() > 10);
    let shown = format!("{:?}", miette::Report::new(error));
    assert!(shown.len() > 20);
}
