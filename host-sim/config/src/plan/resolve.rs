//! Turns values of all factors into a scenario and a robot, or a cylinder on the bench, read and checked like files.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Map, Value as Json, json};
use toml_edit::{DocumentMut, Item};

use super::Plan;
use super::base::{AxisBase, Base, Setting, ensure_load_share};
use super::factor::{Factor, Part, Sets};
use super::field::{Template, set};
use super::value::Value;
use crate::bench::{
    Air, Bench, Deviation, Kind, Move, StartUp, UnknownVariation, Variation, Varied,
};
use crate::error::{ConfigError, Problem};
use crate::overlay;
use crate::params::ParameterInfo;
use crate::suggest::closest;
use crate::terrain::Files;
use crate::{AxisConfig, RobotConfig, Scenario};

/// Makes cases of a plan; reads its files once.
pub struct Resolver<'a> {
    plan: &'a Plan,
    templates: BTreeMap<Kept, BTreeMap<&'a str, Template>>,
    /// The axes as their files state them.
    axes: BTreeMap<&'a str, AxisConfig>,
}

/// Kind of a file that a plan holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kept {
    Scenario,
    Robot,
    Axis,
}

/// A case: a scenario on a robot, or a cylinder on the bench.
#[derive(Debug, Clone)]
pub enum Resolved {
    /// A robot in a scenario.
    Robot(Box<OnRobot>),
    /// A cylinder on the bench.
    Axis(Box<OnBench>),
}

/// A scenario on a robot.
#[derive(Debug, Clone)]
pub struct OnRobot {
    /// The scenario.
    pub scenario: Scenario,
    /// The robot.
    pub robot: RobotConfig,
    /// The scenario's text as JSON, without parts that have no effect on a run: description, sources, the
    /// robot's file, the seed.
    pub scenario_json: Json,
    /// Name, parameters and commissioned boards of the robot as JSON.
    pub robot_json: Json,
}

/// A cylinder on the bench.
#[derive(Debug, Clone)]
pub struct OnBench {
    /// The cylinder, and what is played on it.
    pub bench: Bench,
    /// Name and parameters of the axis, parameters of the plant, and the settings, as JSON.
    pub bench_json: Json,
}

impl Resolved {
    /// The robot in its scenario; none of a cylinder.
    #[must_use]
    pub fn on_robot(self) -> Option<OnRobot> {
        match self {
            Self::Robot(case) => Some(*case),
            Self::Axis(_) => None,
        }
    }

    /// The cylinder; none of a robot.
    #[must_use]
    pub fn on_bench(self) -> Option<OnBench> {
        match self {
            Self::Robot(_) => None,
            Self::Axis(case) => Some(*case),
        }
    }
}

impl<'a> Resolver<'a> {
    /// Reads the files.
    ///
    /// # Errors
    /// [`ConfigError`] of the first file that is wrong before any change.
    pub fn new(plan: &'a Plan) -> Result<Self, ConfigError> {
        let mut templates: BTreeMap<Kept, BTreeMap<&str, Template>> = BTreeMap::new();
        let mut keep = |kept, name: &'a String, template| {
            templates.entry(kept).or_default().insert(name, template);
        };
        for (name, source) in &plan.sources.scenarios {
            let data = plan.sources.data.get(name).cloned().unwrap_or_default();
            let files = Files::Held(&data);
            let (_, listing) = Scenario::parse_with(&source.file, &source.text, &files)?;
            let mut base = Template::read(source, listing)?;
            if let Some(bars) = &plan.bars {
                overlay::set_bars(&mut base.document, bars);
                let text = base.document.to_string();
                (_, base.listing) = Scenario::parse_with(&source.file, &text, &files)?;
            }
            keep(Kept::Scenario, name, Template { data, ..base });
        }
        for (name, source) in &plan.sources.robots {
            let robot = RobotConfig::parse(&source.file, &source.text)?;
            let template = Template::read(source, robot.parameters)?;
            keep(Kept::Robot, name, template);
        }
        let mut axes = BTreeMap::new();
        for (name, source) in &plan.sources.axes {
            let axis = AxisConfig::parse(&source.file, &source.text)?;
            let template = Template::read(source, axis.parameters.clone())?;
            keep(Kept::Axis, name, template);
            axes.insert(name.as_str(), axis);
        }
        Ok(Self {
            plan,
            templates,
            axes,
        })
    }

    /// The files that a path may lead into: those that a case can have.
    pub(super) fn files_of(&self, part: Part) -> impl Iterator<Item = &Template> {
        let kept = match part {
            Part::Scenario => Kept::Scenario,
            Part::Robot => Kept::Robot,
            Part::Axis | Part::Plant => Kept::Axis,
        };
        let names = self.names_of(kept).into_iter();
        names.filter_map(move |name| self.templates.get(&kept)?.get(name))
    }

    /// Names of the files of a kind that a case can have: a factor's, or else the base's.
    fn names_of(&self, kept: Kept) -> BTreeSet<&'a str> {
        let setting = match kept {
            Kept::Scenario => Setting::Scenario,
            Kept::Robot => Setting::Robot,
            Kept::Axis => Setting::Axis,
        };
        let mut factors = self.plan.factors.iter();
        if let Some(factor) = factors.find(|factor| factor.sets == Sets::Base(setting)) {
            return factor.names().collect();
        }
        match (&self.plan.base, kept) {
            (Base::Axis(base), Kept::Axis) => [base.axis.as_str()].into(),
            (Base::Robot { scenario, .. }, Kept::Scenario) => [scenario.as_str()].into(),
            (Base::Robot { robot, .. }, Kept::Robot) => match robot {
                Some(robot) => [robot.as_str()].into(),
                None => {
                    let scenarios = self.names_of(Kept::Scenario).into_iter();
                    let robots = scenarios.filter_map(|name| self.plan.sources.robot_of.get(name));
                    robots.map(String::as_str).collect()
                }
            },
            _ => BTreeSet::new(),
        }
    }

    /// The case of one value for each factor, in their order.
    ///
    /// # Errors
    /// [`ConfigError`] if the values do not make a valid scenario or robot, or a valid axis.
    pub fn resolve(&self, values: &[Value]) -> Result<Resolved, ConfigError> {
        self.resolve_on_ground(values, None)
    }

    /// The same on other ground: a seed replaces that of each of the scenario's fields of rocks.
    ///
    /// # Errors
    /// As [`Resolver::resolve`].
    pub fn resolve_on_ground(
        &self,
        values: &[Value],
        seed: Option<u64>,
    ) -> Result<Resolved, ConfigError> {
        let all: Vec<_> = self.plan.factors.iter().zip(values).collect();
        self.resolve_only(&all, seed)
    }

    /// The same for some factors, with the others' fields as in the files.
    pub(super) fn resolve_only(
        &self,
        factors: &[(&Factor, &Value)],
        seed: Option<u64>,
    ) -> Result<Resolved, ConfigError> {
        Ok(match &self.plan.base {
            Base::Robot { scenario, robot } => {
                let case = self.on_robot(factors, scenario, robot.as_ref(), seed)?;
                Resolved::Robot(Box::new(case))
            }
            Base::Axis(base) => Resolved::Axis(Box::new(self.on_bench(factors, base)?)),
        })
    }

    fn on_robot(
        &self,
        factors: &[(&Factor, &Value)],
        scenario: &str,
        robot: Option<&String>,
        seed: Option<u64>,
    ) -> Result<OnRobot, ConfigError> {
        let chosen = |setting| chosen(factors, setting).map(ToString::to_string);
        let scenario_name = chosen(Setting::Scenario).unwrap_or_else(|| scenario.to_owned());
        let robot_of = &self.plan.sources.robot_of;
        let robot_name = chosen(Setting::Robot)
            .or_else(|| robot.cloned())
            .or_else(|| robot_of.get(&scenario_name).cloned())
            .unwrap_or_default();
        let scenario = self.known(Kept::Scenario, &scenario_name)?;
        let robot = self.known(Kept::Robot, &robot_name)?;
        let mut scenario_text = scenario.document.clone();
        let robot_text = changed(robot, factors, Part::Robot)?;
        if let Some(seed) = seed {
            overlay::set_ground_seed(&mut scenario_text, seed);
        }
        for (factor, value) in factors {
            if let Sets::Fault(template) = &factor.sets {
                let fault = template.replace("{}", &value.to_string());
                overlay::add_fault(&mut scenario_text, &fault);
            }
        }
        change(scenario, &mut scenario_text, factors, Part::Scenario)?;
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
        Ok(OnRobot {
            robot_json: robot_json(&robot),
            scenario,
            robot,
            scenario_json,
        })
    }

    fn on_bench(
        &self,
        factors: &[(&Factor, &Value)],
        base: &AxisBase,
    ) -> Result<OnBench, ConfigError> {
        let chosen = |setting| chosen(factors, setting);
        let any = |part| factors.iter().any(|(factor, _)| sets(factor, part));
        let name = chosen(Setting::Axis).map_or_else(|| base.axis.clone(), ToString::to_string);
        let mut template = self.known(Kept::Axis, &name)?;
        let unchanged = self.axes.get(name.as_str()).filter(|_| !any(Part::Axis));
        // The plant is off its data sheet, whatever that says.
        let stated;
        let sheet = match unchanged {
            Some(sheet) => Cow::Borrowed(sheet),
            None => {
                let document = changed(template, factors, Part::Axis)?;
                let sheet = AxisConfig::parse(&template.file, &document.to_string())?;
                stated = Template {
                    file: template.file.clone(),
                    document,
                    listing: sheet.parameters.clone(),
                    data: BTreeMap::new(),
                };
                template = &stated;
                Cow::Owned(sheet)
            }
        };
        let plant = if any(Part::Plant) {
            let text = changed(template, factors, Part::Plant)?;
            Cow::Owned(AxisConfig::parse(&template.file, &text.to_string())?)
        } else {
            Cow::Borrowed(&*sheet)
        };
        let load_share = match chosen(Setting::LoadShare) {
            Some(Value::Number(share)) => *share,
            _ => base.load_share,
        };
        ensure_load_share(load_share).map_err(|told| not_possible("load_share", told, None))?;
        let variation = match chosen(Setting::Variation) {
            Some(word) => varied(&word.to_string())?,
            None => base.variation,
        };
        if let Varied::Always(variation) = variation {
            variation.ensure_possible(&plant)?;
        }
        let bench = Bench {
            axis: sheet.name.clone(),
            motion: named(factors, Setting::Move, base.motion, Move::of_name)?,
            controller: named(factors, Setting::Controller, base.controller, Kind::of_name)?,
            delays: named(factors, Setting::Delays, base.delays, StartUp::of_name)?,
            air: named(factors, Setting::Air, base.air, Air::of_name)?,
            sheet: sheet.axis.clone(),
            plant: plant.axis.clone(),
            without_variation: Deviation::all(&sheet.parameters, &plant.parameters),
            variation,
            load_share,
        };
        let mut bench_json = json!({
                "name": sheet.name,
                "axis": parameters_json(&sheet.parameters),
                "plant": parameters_json(&plant.parameters),
                "move": bench.motion.name(),
                "controller": bench.controller.name(),
                "delays": bench.delays.name(),
                "air": bench.air.name(),
                "load_share": load_share,
        });
        // Cases that have none keep the identities that they had before there were any.
        if bench.variation != Varied::Always(Variation::Nominal) {
            bench_json["variation"] = json!(bench.variation.to_string());
        }
        Ok(OnBench { bench, bench_json })
    }

    fn known(&self, kept: Kept, name: &str) -> Result<&Template, ConfigError> {
        let found = self.templates.get(&kept).and_then(|own| own.get(name));
        found.ok_or_else(|| {
            let kind = match kept {
                Kept::Scenario => "scenario",
                Kept::Robot => "robot",
                Kept::Axis => "axis",
            };
            let message = format!("the plan has no text of the {kind} `{name}`");
            ConfigError::new(
                "the plan is not complete",
                vec![Problem::whole(name, message, None)],
            )
        })
    }
}

/// The value of the factor that sets a key of `[base]`.
fn chosen<'v>(factors: &[(&Factor, &'v Value)], setting: Setting) -> Option<&'v Value> {
    let found = factors
        .iter()
        .find(|(factor, _)| factor.sets == Sets::Base(setting));
    found.map(|(_, value)| *value)
}

/// Whether a factor sets a field of a file.
fn sets(factor: &Factor, part: Part) -> bool {
    match &factor.sets {
        Sets::Fields(fields) => fields.iter().any(|field| field.part == part),
        Sets::Base(_) | Sets::Fault(_) => false,
    }
}

/// The text of a file with the values of factors.
fn changed(
    template: &Template,
    factors: &[(&Factor, &Value)],
    part: Part,
) -> Result<DocumentMut, ConfigError> {
    let mut text = template.document.clone();
    change(template, &mut text, factors, part)?;
    Ok(text)
}

fn change(
    template: &Template,
    text: &mut DocumentMut,
    factors: &[(&Factor, &Value)],
    part: Part,
) -> Result<(), ConfigError> {
    for (factor, value) in factors {
        let Sets::Fields(fields) = &factor.sets else {
            continue;
        };
        for field in fields.iter().filter(|field| field.part == part) {
            set(template, text, factor, &field.path, value)?;
        }
    }
    Ok(())
}

/// The setting of a name; without one, that of the base.
fn named<T>(
    factors: &[(&Factor, &Value)],
    setting: Setting,
    base: T,
    of_name: fn(&str) -> Option<T>,
) -> Result<T, ConfigError> {
    let Some(value) = chosen(factors, setting) else {
        return Ok(base);
    };
    let name = value.to_string();
    of_name(&name).ok_or_else(|| {
        let names = setting.names();
        let help = closest(&name, names.iter().copied());
        not_possible(
            setting.name(),
            // Who asked names the value.
            format!(
                "no such {}: allowed are {}",
                setting.name(),
                names.join(", ")
            ),
            help.map(|word| format!("did you mean \"{word}\"?")),
        )
    })
}

/// The variation of a word.
fn varied(word: &str) -> Result<Varied, ConfigError> {
    let unknown = |e: UnknownVariation| not_possible("variation", e.to_string(), None);
    word.parse().map_err(unknown)
}

fn not_possible(key: &str, told: String, help: Option<String>) -> ConfigError {
    let problem = Problem::whole(&format!("base.{key}"), told, help);
    ConfigError::new("the case is not possible", vec![problem])
}

fn parameters_json(parameters: &[ParameterInfo]) -> Map<String, Json> {
    let each = parameters.iter().map(|p| {
        let value = json!({ "value": p.value, "unit": p.unit });
        (p.path.clone(), value)
    });
    each.collect()
}

fn robot_json(robot: &RobotConfig) -> Json {
    json!({
        "name": robot.name,
        "parameters": parameters_json(&robot.parameters),
        "commissioned": robot.commissioned,
    })
}

/// Largest whole number below which all are exact as floats.
const EXACT: u64 = 1 << f64::MANTISSA_DIGITS;

/// A scenario's text as JSON, with numbers as floats if they are exact, the others as text.
fn without_notes(document: &DocumentMut) -> Json {
    let mut json = item_json(document.as_item());
    if let Some(top) = json.as_object_mut() {
        for key in ["description", "robot", "seed"] {
            top.remove(key);
        }
    }
    json
}

fn item_json(item: &Item) -> Json {
    if let Some(table) = item.as_table_like() {
        let fields = table.iter().filter(|(key, _)| *key != "source");
        let fields = fields.map(|(key, item)| (key.to_owned(), item_json(item)));
        return Json::Object(fields.collect());
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
