//! Files of numbers that others wrote: reference vectors (JSON), as `wheeleg check
//! vectors` reads them, axes (TOML), and logs (MCAP), as `wheeleg view` reads them. No
//! panic; what is refused is explained, and what passes passes twice and with every
//! number compared.

use std::ops::ControlFlow;
use std::path::Path;

use wheeleg_config::AxisConfig;
use wheeleg_studies::check::vectors::check_text;
use wheeleg_telemetry::read_from;

/// Longest text.
const LENGTH_MAX: usize = 64 * 1024;

/// A log if it begins like one, a text of a file of vectors if it begins like JSON, of an axis
/// otherwise.
pub fn run(data: &[u8]) {
    if data.starts_with(b"\x89MCAP") {
        log(data);
        return;
    }
    let text = String::from_utf8_lossy(&data[..data.len().min(LENGTH_MAX)]);
    if text.trim_start().starts_with(['{', '[']) {
        vectors(&text);
    } else {
        axis(&text);
    }
}

fn log(data: &[u8]) {
    let read = || {
        let mut sum = (0_u64, 0.0_f64);
        let end = read_from(data, Path::new("fuzz.mcap"), &mut |logged| {
            sum.0 += 1;
            for name in ["sensed_mm", "x_mm", "fault"] {
                sum.1 += logged.number(name).unwrap_or_default();
            }
            ControlFlow::Continue(())
        });
        (end.map_err(explained_log), sum)
    };
    let (first, second) = (read(), read());
    assert_eq!(format!("{first:?}"), format!("{second:?}"));
    if let (Ok(end), (messages, _)) = first {
        assert_eq!(end.messages, messages);
    }
}

fn explained_log(error: wheeleg_telemetry::LogError) -> String {
    assert!(
        miette::Diagnostic::help(&error).is_some(),
        "no remedy: {error}"
    );
    error.to_string()
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

/// The message that a user sees: rendering it panics if a span lies outside the text.
fn explained(error: impl miette::Diagnostic + Send + Sync + 'static) {
    assert!(error.to_string().len() > 10);
    let shown = format!("{:?}", miette::Report::new(error));
    assert!(shown.len() > 20);
}
