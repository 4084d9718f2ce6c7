//! One factor of a plan: its target, and its values.

use super::base::Setting;
use super::distribution::{self, Choice, Distribution};
use super::value::{Value, list};
use crate::axis::{AXES, AxisConfig};
use crate::builtin;
use crate::reader::{Entry, NAME_LENGTH, Reader};
use crate::suggest::closest;

/// The target of a factor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Sets {
    /// A key of `[base]`.
    Base(Setting),
    /// Fields of files.
    Fields(Vec<Field>),
    /// A fault, with the value in place of its `{}`.
    Fault(String),
}

impl Sets {
    /// What it sets, in the words of a plan.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        match self {
            Self::Base(setting) => vec![setting.name().to_owned()],
            Self::Fields(fields) => fields.iter().map(ToString::to_string).collect(),
            Self::Fault(template) => vec![format!("fault {template}")],
        }
    }
}

/// A file of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// The scenario.
    Scenario,
    /// The robot.
    Robot,
    /// The axis: its data sheet, and with it the plant.
    Axis,
    /// The plant of the axis alone: it then differs from its data sheet.
    Plant,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Scenario, Self::Robot, Self::Axis, Self::Plant];

    /// Prefix of a path into it.
    #[must_use]
    pub const fn prefix(self) -> &'static str {
        match self {
            Self::Scenario => "scenario.",
            Self::Robot => "robot.",
            Self::Axis => "axis.",
            Self::Plant => "plant.",
        }
    }

    /// Whether it is of a cylinder on the bench.
    #[must_use]
    pub const fn is_of_bench(self) -> bool {
        matches!(self, Self::Axis | Self::Plant)
    }
}

/// A field of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// The file.
    pub part: Part,
    /// Path in it.
    pub path: String,
}

impl std::fmt::Display for Field {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{}", self.part.prefix(), self.path)
    }
}

/// Origin of the values.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Each value of a list, with all samples.
    Grid(Vec<Value>),
    /// One for each sample.
    Drawn(Distribution),
}

/// A factor.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// Name: column `f.NAME` of the table.
    pub name: String,
    /// Its target.
    pub sets: Sets,
    /// Its values.
    pub values: Values,
    /// Unit of the values; empty if they have none.
    pub unit: String,
    /// Whether the file's value is multiplied by this one.
    pub scale: bool,
    /// Whether it keeps the seed, so that all its values meet the same noise.
    pub paired: bool,
}

impl Factor {
    /// Number of values of its list; 1 if drawn.
    #[must_use]
    pub fn grid_len(&self) -> u64 {
        match &self.values {
            Values::Grid(list) => list.len() as u64,
            Values::Drawn(_) => 1,
        }
    }

    /// Whether all of its values are numbers.
    #[must_use]
    pub fn is_number(&self) -> bool {
        self.listed().all(|value| matches!(value, Value::Number(_)))
    }

    /// Whether its values are names.
    #[must_use]
    pub fn is_text(&self) -> bool {
        self.listed().any(|value| matches!(value, Value::Text(_)))
    }

    /// The names among its values.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.listed().filter_map(|value| match value {
            Value::Text(name) => Some(name.as_str()),
            Value::Number(_) | Value::Flag(_) => None,
        })
    }

    /// The values that the plan lists; none of a distribution of numbers.
    fn listed(&self) -> impl Iterator<Item = &Value> {
        let (grid, choices): (&[Value], &[Choice]) = match &self.values {
            Values::Grid(list) => (list, &[]),
            Values::Drawn(Distribution::Choice(list)) => (&[], list),
            Values::Drawn(_) => (&[], &[]),
        };
        grid.iter()
            .chain(choices.iter().map(|choice| &choice.value))
    }
}

const OWN: [&str; 6] = ["parameter", "fault", "scale", "paired", "grid", "unit"];

/// Reads all of `[factor.NAME]`.
pub(super) fn read_all(r: &mut Reader) -> Option<Vec<Factor>> {
    let Some(top) = r.optional_table("factor", &["a section for each factor"]) else {
        return Some(Vec::new());
    };
    let names: Vec<_> = top.keys().map(|(k, span)| (k.to_owned(), span)).collect();
    let mut factors = Vec::new();
    let mut ok = true;
    for (name, span) in names {
        let plain = |c: char| c.is_ascii_alphanumeric() || "_-".contains(c);
        if !(1..=NAME_LENGTH).contains(&name.len()) || !name.chars().all(plain) {
            let shown: String = name.chars().take(NAME_LENGTH).collect();
            let more = if shown.len() < name.len() { "…" } else { "" };
            r.problem(
                Some(span),
                format!(
                    "`factor.{shown}{more}` is not a name: allowed are 1 to {NAME_LENGTH} of the \
                     characters A-Z, a-z, 0-9, `_` and `-`"
                ),
                "not a name",
                Some("a column of the table is named after it".into()),
            );
            ok = false;
            continue;
        }
        match read(r, &name) {
            Some(factor) => factors.push(factor),
            None => ok = false,
        }
    }
    ok.then_some(factors)
}

fn read(r: &mut Reader, name: &str) -> Option<Factor> {
    let path = format!("factor.{name}");
    let known = [&OWN[..], &distribution::NAMES].concat();
    let entry = r.optional_table(&path, &known)?;
    r.reject_unknown(&entry, &known);
    let mut flag = |key: &str| match entry.get(key) {
        None => Some(false),
        Some((span, item)) => {
            let flag = item.as_bool();
            if flag.is_none() {
                let message = format!(
                    "`{path}.{key}` = {} must be true or false",
                    item.to_string().trim()
                );
                r.problem(item.span().or(Some(span)), message, "wrong type", None);
            }
            flag
        }
    };
    let (scale, paired) = (flag("scale"), flag("paired"));
    let sets = sets(r, &entry);
    let (values, unit) = values(r, &entry)?;
    let factor = Factor {
        name: name.to_owned(),
        sets: sets?,
        values,
        unit,
        scale: scale?,
        paired: paired?,
    };
    fits(r, &entry, &factor).then_some(factor)
}

/// Whether its target, `scale` and the kind of its values fit together.
fn fits(r: &mut Reader, entry: &Entry, factor: &Factor) -> bool {
    let path = &entry.path;
    let why = match &factor.sets {
        Sets::Base(Setting::LoadShare) if !factor.is_number() || !factor.unit.is_empty() => {
            "a share of the force left is a number without a unit"
        }
        Sets::Base(setting) if setting.is_file() && !matches!(factor.values, Values::Grid(_)) => {
            "scenarios, robots and axes are given as `grid = [\"NAME\", …]`"
        }
        Sets::Base(setting) if *setting != Setting::LoadShare && !factor.is_text() => {
            "its values must be names"
        }
        Sets::Fields(_) if factor.scale && factor.is_text() => {
            "a name scales nothing: `scale` needs numbers"
        }
        Sets::Fields(_) if factor.scale && !factor.unit.is_empty() => {
            "a factor that scales has no unit"
        }
        Sets::Base(_) | Sets::Fault(_) if factor.scale => "`scale` is for parameters",
        Sets::Fault(template) if template.matches("{}").count() != 1 => {
            "a fault has `{}` once, where its value goes, as in \"pot-open:joint3@{}s\""
        }
        _ => return true,
    };
    let help = match &factor.sets {
        Sets::Base(setting) if setting.names().is_empty() => None,
        Sets::Base(setting) => Some(format!("allowed are {}", setting.names().join(", "))),
        Sets::Fields(_) if factor.scale => {
            Some("leave `scale` out, or give numbers without a unit".to_owned())
        }
        Sets::Fields(_) | Sets::Fault(_) => None,
    };
    r.problem(
        Some(entry.span.clone()),
        format!("`{path}`: {why}"),
        "does not go together",
        help,
    );
    false
}

fn sets(r: &mut Reader, entry: &Entry) -> Option<Sets> {
    let path = &entry.path;
    match (entry.get("parameter"), entry.get("fault")) {
        (None, Some(_)) => r.text(entry, "fault").map(Sets::Fault),
        (Some((span, item)), None) => {
            let listed = item.as_array().is_some();
            let texts = if listed {
                r.texts(entry, "parameter", |text| Ok(text.to_owned()))
            } else {
                vec![r.text(entry, "parameter")?]
            };
            if let [one] = texts.as_slice()
                && let Some(setting) = Setting::ALL.into_iter().find(|s| s.name() == one)
            {
                return Some(Sets::Base(setting));
            }
            let mut fields = Vec::new();
            let mut ok = !texts.is_empty();
            for text in texts {
                let field = Part::ALL.into_iter().find_map(|part| {
                    let path = text.strip_prefix(part.prefix())?.to_owned();
                    Some(Field { part, path })
                });
                if let Some(field) = field {
                    fields.push(field);
                    continue;
                }
                ok = false;
                let settings = Setting::ALL.map(|setting| format!("`{}`", setting.name()));
                r.problem(
                    item.span().or(Some(span.clone())),
                    format!(
                        "`{path}.parameter` = \"{text}\" must begin with `robot.`, `scenario.`, `axis.` or \
                         `plant.`, or be one of {} alone",
                        settings.join(", ")
                    ),
                    "not a path",
                    Some(meant(r, &text)),
                );
            }
            ok.then_some(Sets::Fields(fields))
        }
        (found, _) => {
            let how = if found.is_some() { "both" } else { "neither" };
            r.problem(
                Some(entry.span.clone()),
                format!("`{path}` has {how} of `parameter` and `fault`: it needs one"),
                "sets what?",
                Some("write `parameter = \"robot.supply.set_pressure\"`".into()),
            );
            None
        }
    }
}

/// What may be meant by a parameter that begins with no part of a case.
fn meant(r: &Reader, text: &str) -> String {
    let on_bench = r.table("base").is_some_and(|base| base.has("axis"));
    let settings = Setting::ALL.into_iter();
    let settings = settings.filter(|setting| setting.is_of_bench() == on_bench);
    let parts = Part::ALL.into_iter();
    let mut parts = parts.filter(|part| part.is_of_bench() == on_bench);
    let parameters = match on_bench {
        true => AxisConfig::load(AXES[0].0).map(|axis| axis.parameters),
        false => builtin::robot(builtin::ROBOTS[0].0).map(|robot| robot.parameters),
    };
    let parameters = parameters.unwrap_or_default();
    let [of_file, example] = match on_bench {
        true => [Part::Plant.prefix(), "plant.moving.mass"],
        false => [Part::Robot.prefix(), "robot.supply.set_pressure"],
    };
    let meant = match text.split_once('.') {
        None => closest(text, settings.map(Setting::name)).map(str::to_owned),
        Some((first, rest)) => parts
            .find(|part| closest(&format!("{first}."), [part.prefix()]).is_some())
            .map(|part| format!("{}{rest}", part.prefix()))
            .or_else(|| {
                let paths = parameters.iter().map(|parameter| parameter.path.as_str());
                closest(text, paths).map(|path| format!("{of_file}{path}"))
            }),
    };
    match meant {
        Some(meant) => format!("did you mean \"{meant}\"?"),
        None => format!("for example \"{example}\""),
    }
}

fn values(r: &mut Reader, entry: &Entry) -> Option<(Values, String)> {
    let path = &entry.path;
    let mut given: Vec<&str> = distribution::NAMES.to_vec();
    given.push("grid");
    given.retain(|key| entry.has(key));
    let [key] = given[..] else {
        r.problem(
            Some(entry.span.clone()),
            format!(
                "`{path}` has {} of {} and grid: it needs one",
                given.len(),
                distribution::NAMES.join(", ")
            ),
            "which values?",
            Some("write `uniform = { min = …, max = …, unit = \"…\" }` or `grid = […]`".into()),
        );
        return None;
    };
    if key != "grid" {
        if let Some((span, _)) = entry.get("unit") {
            let message = format!("`{path}.unit` belongs into `{path}.{key}`");
            let help = format!("write `{key} = {{ …, unit = \"…\" }}`");
            r.problem(Some(span), message, "not here", Some(help));
        }
        let (distribution, unit) = distribution::read(r, entry, key)?;
        return Some((Values::Drawn(distribution), unit));
    }
    let unit = match entry.get("unit") {
        Some(_) => r.text(entry, "unit")?,
        None => String::new(),
    };
    Some((Values::Grid(list(r, entry, "grid")?), unit))
}
