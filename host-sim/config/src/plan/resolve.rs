//! Turns values of all factors into a scenario and a robot, read and checked like files.

use std::collections::BTreeMap;

use serde_json::{Map, json};
use toml_edit::{DocumentMut, Item};

use super::factor::{Factor, Sets};
use super::value::Value;
use super::{Plan, Text};
use crate::error::{ConfigError, Problem};
use crate::overlay;
use crate::params::ParameterInfo;
use crate::quantity::Dimension;
use crate::terrain::{Data, Files};
use crate::{LawChoice, RobotConfig, Scenario};

/// A file that factors change: its name, its text, and every quantity in it.
pub(super) struct Base {
    pub(super) file: String,
    pub(super) document: DocumentMut,
    pub(super) listing: Vec<ParameterInfo>,
    /// Data files of a scenario.
    data: BTreeMap<String, Data>,
}

impl Base {
    fn read(source: &Text, listing: Vec<ParameterInfo>) -> Result<Self, ConfigError> {
        let document = source.text.parse().map_err(|e: toml_edit::TomlError| {
            // The reader of the file has accepted it.
            let problem = Problem::whole(&source.file, e.to_string(), None);
            ConfigError::new(format!("{} is not usable", source.file), vec![problem])
        })?;
        Ok(Self {
            file: source.file.clone(),
            document,
            listing,
            data: BTreeMap::new(),
        })
    }

    /// The quantity at a path, or a component of it if the path ends in an index.
    pub(super) fn listed(&self, path: &str) -> Option<(&ParameterInfo, Option<usize>)> {
        let of = |path: &str| self.listing.iter().find(|p| p.path == path);
        if let Some(info) = of(path) {
            return Some((info, None));
        }
        let (whole, component) = overlay::split_index(path)?;
        let info = of(whole).filter(|info| component < info.value.len())?;
        Some((info, Some(component)))
    }

    /// The quantity whose component a path names, even if it lacks that component.
    pub(super) fn around(&self, path: &str) -> Option<&ParameterInfo> {
        let (whole, _) = overlay::split_index(path)?;
        self.listing.iter().find(|p| p.path == whole)
    }

    /// Whether the path leads to a name rather than a number.
    pub(super) fn has_text(&self, path: &str) -> bool {
        is_law(path) || overlay::text(&self.document, path).is_some()
    }
}

/// Whether a path leads to the law of a joint board, which has names for its numbers.
pub(super) fn is_law(path: &str) -> bool {
    path.starts_with("node.") && path.ends_with(".law")
}

/// Makes cases of a plan; reads its files once.
pub struct Resolver<'a> {
    plan: &'a Plan,
    pub(super) scenarios: BTreeMap<&'a str, Base>,
    pub(super) robots: BTreeMap<&'a str, Base>,
}

/// A case: a scenario on a robot.
#[derive(Debug, Clone)]
pub struct Resolved {
    /// The scenario.
    pub scenario: Scenario,
    /// The robot.
    pub robot: RobotConfig,
    /// The scenario's text as JSON, without parts that have no effect on a run: description, sources, the
    /// robot's file, the seed.
    pub scenario_json: serde_json::Value,
    /// Name, parameters and commissioned boards of the robot as JSON.
    pub robot_json: serde_json::Value,
}

impl<'a> Resolver<'a> {
    /// Reads the files.
    ///
    /// # Errors
    /// [`ConfigError`] of the first file that is wrong before any change.
    pub fn new(plan: &'a Plan) -> Result<Self, ConfigError> {
        let (mut scenarios, mut robots) = (BTreeMap::new(), BTreeMap::new());
        for (name, source) in &plan.sources.scenarios {
            let data = plan.sources.data.get(name).cloned().unwrap_or_default();
            let files = Files::Held(&data);
            let (_, listing) = Scenario::parse_with(&source.file, &source.text, &files)?;
            let mut base = Base::read(source, listing)?;
            if let Some(bars) = &plan.bars {
                overlay::set_bars(&mut base.document, bars);
                let text = base.document.to_string();
                (_, base.listing) = Scenario::parse_with(&source.file, &text, &files)?;
            }
            scenarios.insert(name.as_str(), Base { data, ..base });
        }
        for (name, source) in &plan.sources.robots {
            let robot = RobotConfig::parse(&source.file, &source.text)?;
            robots.insert(name.as_str(), Base::read(source, robot.parameters)?);
        }
        Ok(Self {
            plan,
            scenarios,
            robots,
        })
    }

    /// The case of one value for each factor, in their order.
    ///
    /// # Errors
    /// [`ConfigError`] if the values do not make a valid scenario or robot.
    pub fn resolve(&self, values: &[Value]) -> Result<Resolved, ConfigError> {
        let all: Vec<_> = self.plan.factors.iter().zip(values).collect();
        self.resolve_only(&all)
    }

    /// The same for some factors, with the others' fields as in the files.
    pub(super) fn resolve_only(
        &self,
        factors: &[(&Factor, &Value)],
    ) -> Result<Resolved, ConfigError> {
        let chosen = |sets: &Sets| {
            let found = factors.iter().find(|(factor, _)| factor.sets == *sets);
            found.map(|(_, value)| value.to_string())
        };
        let base = &self.plan.base;
        let scenario_name = chosen(&Sets::Scenario).unwrap_or_else(|| base.scenario.clone());
        let robot_of = &self.plan.sources.robot_of;
        let robot_name = chosen(&Sets::Robot)
            .or_else(|| base.robot.clone())
            .or_else(|| robot_of.get(&scenario_name).cloned())
            .unwrap_or_default();
        let scenario = known(&self.scenarios, "scenario", &scenario_name)?;
        let robot = known(&self.robots, "robot", &robot_name)?;
        let mut scenario_text = scenario.document.clone();
        let mut robot_text = robot.document.clone();
        for (factor, value) in factors {
            match &factor.sets {
                Sets::Scenario | Sets::Robot => {}
                Sets::Fault(template) => {
                    let fault = template.replace("{}", &value.to_string());
                    overlay::add_fault(&mut scenario_text, &fault);
                }
                Sets::Fields {
                    scenario: of_scenario,
                    robot: of_robot,
                } => {
                    for path in of_scenario {
                        set(scenario, &mut scenario_text, factor, path, value)?;
                    }
                    for path in of_robot {
                        set(robot, &mut robot_text, factor, path, value)?;
                    }
                }
            }
        }
        let mut scenario_json = without_notes(&scenario_text);
        if !scenario.data.is_empty() {
            // Two maps of the same name may be different ground.
            let digests = scenario.data.iter().map(|(n, d)| (n.clone(), d.digest()));
            scenario_json["data"] = digests.collect::<BTreeMap<_, _>>().into_iter().collect();
        }
        let files = Files::Held(&scenario.data);
        let (scenario, _) =
            Scenario::parse_with(&scenario.file, &scenario_text.to_string(), &files)?;
        let robot = RobotConfig::parse(&robot.file, &robot_text.to_string())?;
        scenario.check_with(&robot)?;
        Ok(Resolved {
            robot_json: robot_json(&robot),
            scenario,
            robot,
            scenario_json,
        })
    }
}

fn known<'m>(
    files: &'m BTreeMap<&str, Base>,
    kind: &str,
    name: &str,
) -> Result<&'m Base, ConfigError> {
    files.get(name).ok_or_else(|| {
        let message = format!("the plan has no text of the {kind} `{name}`");
        ConfigError::new(
            "the plan is not complete",
            vec![Problem::whole(name, message, None)],
        )
    })
}

/// Puts one value into the text of a file.
fn set(
    base: &Base,
    document: &mut DocumentMut,
    factor: &Factor,
    path: &str,
    value: &Value,
) -> Result<(), ConfigError> {
    let nowhere = |message: String| {
        let problem = Problem::whole(&base.file, message, None);
        ConfigError::new(format!("factor `{}`", factor.name), vec![problem])
    };
    let law = match value {
        Value::Text(name) if is_law(path) => {
            let law = name.parse::<LawChoice>();
            Some(f64::from(law.map_err(nowhere)?.number()))
        }
        _ => None,
    };
    if let (Value::Text(text), None) = (value, law) {
        let done = overlay::set(document, path, text.as_str().into());
        return done
            .then_some(())
            .ok_or_else(|| nowhere(format!("there is no `{path}`")));
    }
    let number = law.unwrap_or(match value {
        Value::Number(number) => *number,
        Value::Flag(flag) => f64::from(u8::from(*flag)),
        Value::Text(_) => f64::NAN,
    });
    let Some((info, component)) = base.listed(path) else {
        return Err(nowhere(format!("there is no `{path}`")));
    };
    let (values, unit) = written(info, component, factor, number);
    let source = format!("factor {} of the plan", factor.name);
    let done = overlay::set_quantity(document, info, &values, &unit, &source);
    done.then_some(())
        .ok_or_else(|| nowhere(format!("there is no `{path}`")))
}

/// The text to write for a value of a factor, and its unit.
pub(super) fn written(
    info: &ParameterInfo,
    component: Option<usize>,
    factor: &Factor,
    number: f64,
) -> (Vec<f64>, String) {
    let at = |i: usize| component.is_none_or(|component| component == i);
    let each = info.value.iter().enumerate();
    if factor.scale {
        let scaled = each.map(|(i, v)| if at(i) { v * number } else { *v });
        return (scaled.collect(), info.unit.clone());
    }
    let unit = match factor.unit.as_str() {
        "" => info.unit.clone(),
        unit => unit.to_owned(),
    };
    if info.value.len() == 1 {
        return (vec![number], unit);
    }
    // The other components are in the file's unit.
    let number = number * factor_between(info, &unit);
    let mixed = each.map(|(i, v)| if at(i) { number } else { *v });
    (mixed.collect(), info.unit.clone())
}

/// Factor from a unit to that of the file; 1 if only one is accepted.
pub(super) fn factor_between(info: &ParameterInfo, unit: &str) -> f64 {
    let si = |unit: &str| info.dimension.and_then(|d: Dimension| d.factor(unit));
    match (si(unit), si(&info.unit)) {
        (Some(from), Some(to)) if unit != info.unit => from / to,
        _ => 1.0,
    }
}

fn robot_json(robot: &RobotConfig) -> serde_json::Value {
    let parameters: Map<String, serde_json::Value> = robot
        .parameters
        .iter()
        .map(|p| {
            let value = json!({ "value": p.value, "unit": p.unit });
            (p.path.clone(), value)
        })
        .collect();
    json!({
        "name": robot.name,
        "parameters": parameters,
        "commissioned": robot.commissioned,
    })
}

/// Largest whole number below which all are exact as floats.
const EXACT: u64 = 1 << f64::MANTISSA_DIGITS;

/// A scenario's text as JSON, with numbers as floats if they are exact, the others as text.
fn without_notes(document: &DocumentMut) -> serde_json::Value {
    let mut json = item_json(document.as_item());
    if let Some(top) = json.as_object_mut() {
        for key in ["description", "robot", "seed"] {
            top.remove(key);
        }
    }
    json
}

fn item_json(item: &Item) -> serde_json::Value {
    if let Some(table) = item.as_table_like() {
        let fields = table.iter().filter(|(key, _)| *key != "source");
        let fields = fields.map(|(key, item)| (key.to_owned(), item_json(item)));
        return serde_json::Value::Object(fields.collect());
    }
    if let Some(tables) = item.as_array_of_tables() {
        let tables = tables.iter().map(|t| item_json(&Item::Table(t.clone())));
        return tables.collect();
    }
    if let Some(list) = item.as_array() {
        let values = list.iter().map(|v| item_json(&Item::Value(v.clone())));
        return values.collect();
    }
    if let Some(flag) = item.as_bool() {
        return json!(flag);
    }
    match (item.as_float(), item.as_integer(), item.as_str()) {
        (Some(number), ..) => json!(number),
        // Beyond it two neighbours, such as seeds, are the same float.
        (_, Some(number), _) if number.unsigned_abs() > EXACT => json!(number.to_string()),
        (_, Some(number), _) => json!(number as f64),
        (.., text) => json!(text),
    }
}
