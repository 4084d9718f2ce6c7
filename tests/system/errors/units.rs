//! Errors of Functional Mock-up Units: an importer's log has them, and `wheeleg export fmu`.

use wheeleg_config::Scenario;
use wheeleg_fmu::FmuError;
use wheeleg_fmu::value::{Value, ValueType};
use wheeleg_plant::PlantError;
use wheeleg_studies::axis_sim::suite::AxisSimError;

use super::{Driven, path};

/// One of each variant, under the name `FmuError::Variant`.
pub(super) fn driven() -> Vec<Driven> {
    let wrong = Scenario::parse("my.toml", "nme = \"x\"").expect_err("wrong");
    let text = || "it".to_owned();
    let list: Vec<(&'static str, FmuError, Vec<&'static str>)> = vec![
        ("FmuError::Config", FmuError::from(wrong), vec!["my.toml"]),
        (
            "FmuError::Plant",
            FmuError::from(PlantError::EdgeQueueFull(2)),
            vec!["valve 2"],
        ),
        (
            "FmuError::Axis",
            FmuError::from(AxisSimError::Board("the board refuses it".to_owned())),
            vec!["the board"],
        ),
        (
            "FmuError::Resources",
            FmuError::Resources {
                path: path(),
                reason: text(),
            },
            vec!["a/file"],
        ),
        (
            "FmuError::Token",
            FmuError::Token {
                given: "12".to_owned(),
                expected: "34".to_owned(),
            },
            vec!["12", "34"],
        ),
        (
            "FmuError::Interface",
            FmuError::Interface("model exchange"),
            vec!["model exchange"],
        ),
        (
            "FmuError::Reference",
            FmuError::Reference {
                reference: 77,
                expected: ValueType::Real,
            },
            vec!["77", "real"],
        ),
        (
            "FmuError::Count",
            FmuError::Count {
                references: 3,
                values: 2,
            },
            vec!["3", "2"],
        ),
        (
            "FmuError::Range",
            FmuError::Range {
                name: "load".to_owned(),
                value: Value::Real(9.5),
                min: 0.0,
                max: 1.0,
                unit: "N".to_owned(),
            },
            vec!["load = 9.5", "0 to 1 N"],
        ),
        (
            "FmuError::Fixed",
            FmuError::Fixed {
                name: "load".to_owned(),
                when: " while it runs",
            },
            vec!["load", "while it runs"],
        ),
        (
            "FmuError::Order",
            FmuError::Order {
                call: "doStep",
                when: "before it is set up",
            },
            vec!["doStep", "before it is set up"],
        ),
        (
            "FmuError::Step",
            FmuError::Step { step_s: 0.0015 },
            vec!["0.0015 s"],
        ),
        (
            "FmuError::Time",
            FmuError::Time {
                given_s: 2.0,
                own_s: 1.5,
            },
            vec!["2 s", "1.5 s"],
        ),
        (
            "FmuError::State",
            FmuError::State("of another unit".to_owned()),
            vec!["another unit"],
        ),
        (
            "FmuError::Absent",
            FmuError::Absent("events"),
            vec!["events"],
        ),
        (
            "FmuError::Archive",
            FmuError::Archive {
                path: path(),
                reason: text(),
            },
            vec!["a/file"],
        ),
        (
            "FmuError::Library",
            FmuError::Library {
                path: path(),
                reason: "it is not a file".into(),
            },
            vec!["a/file", "not a file"],
        ),
    ];
    list.into_iter()
        .map(|(name, error, words)| -> Driven { (name, Box::new(error), words) })
        .collect()
}
