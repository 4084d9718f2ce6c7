//! A file that is given as one of another kind.

mod common;

use std::collections::BTreeMap;

use common::{assert_all, report};
use wheeleg_config::plan::{Plan, Sources, Text};
use wheeleg_config::{AxisConfig, ConfigError, RobotConfig, Scenario};
use wheeleg_plant::sensors::AdcNoise;

const ROBOT: &str = include_str!("../../robots/wheeleg-2003.toml");
const SCENARIO: &str = include_str!("../../scenarios/three-step.toml");

/// A plan of this text, which names no other file.
fn plan_of(text: &str) -> Result<Plan, ConfigError> {
    let plan = Text {
        file: "my.toml".into(),
        text: text.into(),
    };
    Plan::of(Sources {
        plan,
        scenarios: BTreeMap::new(),
        robots: BTreeMap::new(),
        axes: BTreeMap::new(),
        robot_of: BTreeMap::new(),
        data: BTreeMap::new(),
    })
}

/// A file of one kind that is given as another is told so once, not line by line.
#[test]
fn a_file_of_another_kind_is_named() {
    let axis = include_str!("../../axes/bench-vq110u.toml");
    let plan = include_str!("../../campaigns/how-steep.toml");
    let texts = [
        ("a robot", ROBOT),
        ("an axis", axis),
        ("a scenario", SCENARIO),
        ("a plan", plan),
    ];
    for (found, text) in texts {
        let as_kinds = [
            ("a robot", RobotConfig::parse("my.toml", text).err()),
            ("an axis", AxisConfig::parse("my.toml", text).err()),
            ("a scenario", Scenario::parse("my.toml", text).err()),
            ("a plan", plan_of(text).err()),
        ];
        for (wanted, error) in as_kinds {
            if wanted == found {
                continue;
            }
            let error = error.unwrap_or_else(|| panic!("{found} is accepted as {wanted}"));
            assert_eq!(error.problems().len(), 1, "{found} as {wanted}");
            let said = report(&error);
            assert_all(
                &said,
                &[
                    &format!("this is {found}"),
                    &format!("{wanted} is wanted"),
                    "give this file to",
                ],
            );
        }
    }
}

/// The number of the converter's noise means another thing in each kind of file, and its description says both.
#[test]
fn the_noise_of_the_converter_is_described_as_it_is_read() {
    let axis = AxisConfig::load("bench-vq110u").expect("built in");
    let robot = RobotConfig::parse("wheeleg-2003.toml", ROBOT).expect("built in");
    let forms = (axis.axis.adc.noise, robot.plant.adc.noise);
    let (AdcNoise::Uniform { .. }, AdcNoise::Gaussian { .. }) = forms else {
        panic!("{forms:?}");
    };
    for parameters in [&axis.parameters, &robot.parameters] {
        let mut listed = parameters.iter();
        let noise = listed.find(|info| info.path == "sensor.adc.noise");
        let doc = noise.expect("listed").doc;
        assert!(
            doc.contains("of an axis the bound of a uniform one"),
            "{doc}"
        );
        assert!(
            doc.contains("of a robot the standard deviation of a normal"),
            "{doc}"
        );
    }
}
