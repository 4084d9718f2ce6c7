//! Scenario and robot files with any content: no panic; accepted values are in range, and refusals are
//! explained.

use wheeleg_config::{ConfigError, RobotConfig, Scenario};

/// Longest text; the robot file has 30 KiB.
const LENGTH_MAX: usize = 64 * 1024;

fn explained(error: &ConfigError, text: &str) {
    assert!(!error.to_string().is_empty());
    assert!(!error.problems().is_empty(), "refused without a problem");
    for problem in error.problems() {
        assert!(!problem.summary().is_empty());
    }
    // The message that a user sees: rendering it panics if a span lies outside the text.
    let shown = format!("{:?}", miette::Report::new(error.clone()));
    assert!(shown.len() > 20 || text.is_empty());
}

/// The text of a scenario, or of a robot if it has a section of one.
pub fn run(data: &[u8]) {
    let text = String::from_utf8_lossy(&data[..data.len().min(LENGTH_MAX)]);
    let again = |ok: bool, second: bool| assert_eq!(ok, second, "not the same twice");
    if text.contains("[plant") || text.contains("[bus]") {
        let robot = RobotConfig::parse("fuzz.toml", &text);
        again(
            robot.is_ok(),
            RobotConfig::parse("fuzz.toml", &text).is_ok(),
        );
        match robot {
            Ok(robot) => {
                assert!(robot.parameters.iter().all(|p| !p.value_text().is_empty()));
                assert_eq!(robot.fingerprint().len(), 64);
            }
            Err(error) => explained(&error, &text),
        }
        return;
    }
    match Scenario::parse("fuzz.toml", &text) {
        Ok(scenario) => {
            assert!((0.01..=9.0e6).contains(&scenario.duration_s));
            for event in &scenario.events {
                assert!(event.at_s.is_finite() && event.at_s >= 0.0);
            }
            let times: Vec<f64> = scenario.events.iter().map(|event| event.at_s).collect();
            assert!(times.is_sorted());
            again(true, Scenario::parse("fuzz.toml", &text).is_ok());
        }
        Err(error) => explained(&error, &text),
    }
}
