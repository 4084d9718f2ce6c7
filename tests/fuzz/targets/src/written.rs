//! Files that this program writes and reads again: a plan as its folder of results keeps it, and the
//! scenario and robot that its values are written into; tables and pages. Names and texts of any
//! content come back as they were; what is written is never broken TOML.

use std::collections::BTreeMap;

use wheeleg_config::builtin::{self, Source};
use wheeleg_config::plan::{
    Distribution, Factor, Part, Plan, Resolver, Sets, Sources, Text, Value, Values,
};
use wheeleg_config::{AxisConfig, ConfigError};

/// Longest text.
const LENGTH_MAX: usize = 16 * 1024;

fn text(source: Source) -> Text {
    Text {
        file: source.file,
        text: source.text,
    }
}

/// A plan on built-in files, whatever it names.
fn sources(plan: &str) -> Sources {
    let scenario = builtin::scenario_source("stand").expect("built in");
    let robot = builtin::robot_source("wheeleg-2003").expect("built in");
    let axis = AxisConfig::source("bench-vq110u").expect("built in");
    let one = |name: &str, source: Source| [(name.to_owned(), text(source))].into();
    Sources {
        plan: Text {
            file: "fuzz.toml".to_owned(),
            text: plan.to_owned(),
        },
        scenarios: one("stand", scenario),
        robots: one("wheeleg-2003", robot),
        axes: one("bench-vq110u", axis),
        robot_of: [("stand".to_owned(), "wheeleg-2003".to_owned())].into(),
        data: BTreeMap::new(),
    }
}

/// First and last value of a factor.
fn values(factor: &Factor) -> [Option<Value>; 2] {
    match &factor.values {
        Values::Grid(list) => [list.first().cloned(), list.last().cloned()],
        Values::Drawn(Distribution::Choice(list)) => {
            [list.first(), list.last()].map(|choice| choice.map(|c| c.value.clone()))
        }
        Values::Drawn(drawn) => match drawn.ends() {
            Some(ends) => ends.map(|end| Some(Value::Number(end))),
            None => [Some(drawn.middle()), None],
        },
    }
}

/// The text of a plan.
pub fn run(data: &[u8]) {
    let plan = String::from_utf8_lossy(&data[..data.len().min(LENGTH_MAX)]);
    crate::quoted::check(&plan);
    let sources = sources(&plan);
    let kept = serde_json::to_string(&sources).expect("it can be written");
    let read: Sources = serde_json::from_str(&kept).expect("what was written can be read");
    assert_eq!(read, sources);
    let plan = match (Plan::of(sources), Plan::of(read)) {
        (Ok(plan), Ok(again)) => {
            assert_eq!((&plan.name, &plan.factors), (&again.name, &again.factors));
            plan
        }
        (Err(error), Err(again)) => {
            assert_eq!(explained(error), explained(again));
            return;
        }
        _ => panic!("not the same once it was written"),
    };
    let resolver = Resolver::new(&plan).expect("its files are built in");
    for end in 0..2 {
        let chosen: Option<Vec<Value>> = plan
            .factors
            .iter()
            .map(|f| values(f)[end].clone())
            .collect();
        let Some(chosen) = chosen else { continue };
        match resolver.resolve(&chosen) {
            Ok(resolved) => {
                let Some(case) = resolved.on_robot() else {
                    continue;
                };
                for (factor, value) in plan.factors.iter().zip(&chosen) {
                    arrived(factor, value, &case.robot.parameters);
                }
            }
            // Values that do not fit together; but the file was TOML.
            Err(error) => {
                let said = explained(error);
                assert!(!said.contains("not valid TOML"), "{said}");
            }
        }
    }
}

/// A value without a unit of its own reaches the robot unchanged.
fn arrived(factor: &Factor, value: &Value, parameters: &[wheeleg_config::ParameterInfo]) {
    let (Sets::Fields(fields), Value::Number(number)) = (&factor.sets, value) else {
        return;
    };
    if factor.scale || !factor.unit.is_empty() {
        return;
    }
    for field in fields.iter().filter(|field| field.part == Part::Robot) {
        if let Some(info) = parameters.iter().find(|p| p.path == field.path) {
            assert_eq!(info.value, [*number], "{field}");
        }
    }
}

fn explained(error: ConfigError) -> String {
    assert!(!error.problems().is_empty(), "refused without a problem");
    let problems = error
        .problems()
        .iter()
        .map(wheeleg_config::Problem::summary);
    let said = problems.collect::<Vec<_>>().join("\n");
    // The message that a user sees: rendering it panics if a span lies outside the text.
    assert!(format!("{:?}", miette::Report::new(error)).len() > 20);
    said
}
