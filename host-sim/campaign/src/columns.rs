//! Columns of a campaign's table. They are known before the first case, so that every part has the same
//! columns.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use wheeleg_config::plan::{
    Distribution, Factor, Plan, Resolved, Resolver, Sets, Setting, Value, Values,
};
use wheeleg_studies::analysis::{Analyser, Target};
use wheeleg_studies::bench;

use crate::CampaignError;
use crate::pages::{MOST_COLUMNS, NAMES_MOST};

/// Key of the columns in the metadata of a file.
pub(crate) const FACT: &str = "wheeleg.columns";

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Whole numbers.
    Whole,
    /// Numbers.
    Number,
    /// Yes or no.
    Flag,
    /// Texts.
    Text,
}

/// A column: its name, what it holds, and what that means.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Column {
    /// Name.
    pub name: String,
    /// What it holds.
    pub kind: Kind,
    /// Unit of its numbers; empty where they have none.
    pub unit: String,
    /// What it means.
    pub meaning: String,
    /// Lower limit of a target.
    pub min: Option<f64>,
    /// Upper limit of a target.
    pub max: Option<f64>,
    /// Whether it is a target that a case must meet to pass.
    #[serde(default)]
    pub required: bool,
}

impl Column {
    pub(crate) fn new(name: &str, kind: Kind, unit: &str, meaning: &str) -> Self {
        Self {
            name: name.to_owned(),
            kind,
            unit: unit.to_owned(),
            meaning: meaning.to_owned(),
            min: None,
            max: None,
            required: false,
        }
    }

    /// Joins the same target of another scenario or move: one may require what another only reports, and each
    /// may have limits of its own.
    fn join(&mut self, other: &Target) {
        if other.required && !self.required {
            self.required = true;
            (self.min, self.max) = (other.min, other.max);
        } else if other.required == self.required
            && self.has_limits()
            && (other.min.is_some() || other.max.is_some())
            && (self.min, self.max) != (other.min, other.max)
        {
            (self.min, self.max) = (None, None);
            self.meaning
                .push_str(" (each scenario or move has limits of its own)");
        }
    }

    /// Whether the column is a target with a limit. For other targets, the verdict only says whether there is
    /// a value.
    pub(crate) fn has_limits(&self) -> bool {
        self.min.is_some() || self.max.is_some()
    }

    /// The middle of a target's limits, if it has both: for such a target neither more nor less is better.
    pub(crate) fn middle(&self) -> Option<f64> {
        Some(self.min?.midpoint(self.max?))
    }

    /// The limits of a target in words, after a comma; empty if it has none.
    pub(crate) fn limits(&self) -> String {
        let unit = match self.unit.as_str() {
            // A dimensionless number.
            "" | "1" => String::new(),
            unit => format!(" {unit}"),
        };
        match (self.min, self.max) {
            (Some(min), Some(max)) => format!(", allowed {min} to {max}{unit}"),
            (Some(min), None) => format!(", allowed from {min}{unit}"),
            (None, Some(max)) => format!(", allowed up to {max}{unit}"),
            (None, None) => String::new(),
        }
    }
}

/// All columns, and the roles of some of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    /// In the order of the table.
    pub all: Vec<Column>,
    /// Names of the factors, without the `f.` prefix of their columns.
    pub factors: Vec<String>,
    /// Names of the targets. Each has one column for its value and one for its verdict.
    pub targets: Vec<String>,
}

/// Columns before the factors, and columns between the factors and the targets.
const BEFORE: [(&str, Kind, &str, &str); 6] = [
    (
        "case",
        Kind::Text,
        "",
        "identity of the case, by its content",
    ),
    ("index", Kind::Whole, "", "place in the plan"),
    ("block", Kind::Whole, "", "part file that it was in"),
    ("sample", Kind::Whole, "", "sample of the drawn factors"),
    (
        "replicate",
        Kind::Whole,
        "",
        "which of the cases that differ in their noise alone",
    ),
    (
        "seed",
        Kind::Whole,
        "",
        "seed of all noise; with `first_seed`, of rocks too",
    ),
];
const BETWEEN: [(&str, Kind, &str, &str); 5] = [
    (
        "status",
        Kind::Text,
        "",
        "ok, error, panic, crashed or limit",
    ),
    ("error", Kind::Text, "", "what went wrong"),
    (
        "log_hash",
        Kind::Text,
        "",
        "hash of the log; on the bench, of the recorded moves",
    ),
    (
        "simulated_s",
        Kind::Number,
        "s",
        "simulated time, start-up included",
    ),
    (
        "passed",
        Kind::Flag,
        "",
        "whether all required targets are met; NULL of a case without a result, which has not met them",
    ),
];

fn plain(list: &[(&str, Kind, &str, &str)]) -> Vec<Column> {
    let columns = list.iter();
    columns
        .map(|(name, kind, unit, meaning)| Column::new(name, *kind, unit, meaning))
        .collect()
}

impl Columns {
    /// Columns of every table: those before the factors, and those between the factors and the targets.
    #[must_use]
    pub fn of_every_table() -> [Vec<Column>; 2] {
        [plain(&BEFORE), plain(&BETWEEN)]
    }

    /// Columns of a plan. The targets are those of all its scenarios or moves.
    ///
    /// # Errors
    /// [`CampaignError::Config`] if a scenario or robot is wrong; [`CampaignError::Refused`] if there are too
    /// many columns, or names are too long.
    pub fn of(plan: &Plan, resolver: &Resolver<'_>) -> Result<Self, CampaignError> {
        let mut all = plain(&BEFORE);
        all.extend(plan.factors.iter().map(factor_column));
        all.extend(plain(&BETWEEN));
        let mut targets: Vec<String> = Vec::new();
        for values in probes(plan) {
            for target in targets_of(&resolver.resolve(&values)?) {
                if targets.contains(&target.id) {
                    let known = all.iter_mut().find(|column| column.name == target.id);
                    if let Some(known) = known {
                        known.join(&target);
                    }
                    continue;
                }
                let verdict = format!("{}.pass", target.id);
                let meaning = format!(
                    "whether {} lies within its limits; without limits, whether it could be measured",
                    target.id
                );
                all.push(Column {
                    min: target.min,
                    max: target.max,
                    required: target.required,
                    ..Column::new(&target.id, Kind::Number, target.unit, &target.description)
                });
                all.push(Column::new(&verdict, Kind::Flag, "", &meaning));
                targets.push(target.id);
            }
        }
        let factors = plan.factors.iter().map(|f| f.name.clone()).collect();
        let columns = Self {
            all,
            factors,
            targets,
        };
        columns.ensure_readable(plan)?;
        Ok(columns)
    }

    /// Refuses to begin a table that could not be read back.
    fn ensure_readable(&self, plan: &Plan) -> Result<(), CampaignError> {
        let file = &plan.sources.plan.file;
        let count = self.all.len();
        if count > MOST_COLUMNS {
            return Err(CampaignError::refused(
                format!(
                    "the plan {file} makes a table of {count} columns, for {} factors and {} targets with \
                     two each: allowed are up to {MOST_COLUMNS}",
                    self.factors.len(),
                    self.targets.len()
                ),
                "leave out factors, or share them out to several plans",
            ));
        }
        let names: usize = plan.factors.iter().map(longest_name).sum();
        if names > NAMES_MOST {
            return Err(CampaignError::refused(
                format!(
                    "the plan {file} puts names of up to {names} bytes into one row of its table: allowed \
                     are up to {NAMES_MOST}"
                ),
                "give its names and paths in fewer characters: a path may begin in the folder of the plan",
            ));
        }
        Ok(())
    }

    /// Columns of a file, in their order.
    #[must_use]
    pub fn read(all: Vec<Column>) -> Self {
        let names = || all.iter().map(|c| c.name.as_str());
        let factors = names().filter_map(|name| name.strip_prefix("f."));
        let factors = factors.map(str::to_owned).collect();
        let targets = names().filter_map(|name| name.strip_suffix(".pass"));
        let targets = targets.map(str::to_owned).collect();
        Self {
            all,
            factors,
            targets,
        }
    }
}

fn factor_column(factor: &Factor) -> Column {
    let name = format!("f.{}", factor.name);
    let kind = match &factor.values {
        _ if factor.is_text() => Kind::Text,
        Values::Grid(list) if matches!(list[0], Value::Flag(_)) => Kind::Flag,
        _ => Kind::Number,
    };
    let how = if factor.scale {
        "times the file's "
    } else {
        ""
    };
    let meaning = format!("{how}{}", factor.sets.names().join(", "));
    Column::new(&name, kind, &factor.unit, &meaning)
}

/// Length in bytes of the longest name that a factor puts into a row; 0 if its values are not names.
fn longest_name(factor: &Factor) -> usize {
    let name = |value: &Value| match value {
        Value::Text(name) => name.len(),
        Value::Number(_) | Value::Flag(_) => 0,
    };
    let longest = match &factor.values {
        Values::Grid(list) => list.iter().map(name).max(),
        Values::Drawn(Distribution::Choice(list)) => list.iter().map(|c| name(&c.value)).max(),
        Values::Drawn(_) => None,
    };
    longest.unwrap_or(0)
}

/// The targets, without values.
fn targets_of(case: &Resolved) -> Vec<Target> {
    match case {
        Resolved::Robot(case) => Analyser::new(&case.scenario, &case.robot).finish().targets,
        Resolved::Axis(case) => bench::unmeasured(case.bench.motion),
    }
}

/// Whether the targets depend on this setting.
fn is_judged_by(setting: Setting) -> bool {
    matches!(setting, Setting::Scenario | Setting::Robot | Setting::Move)
}

/// Values that cover each scenario, robot and move once, with the other factors at their middle.
fn probes(plan: &Plan) -> Vec<Vec<Value>> {
    let mut probes = vec![Vec::new()];
    for factor in &plan.factors {
        let values = match (&factor.sets, &factor.values) {
            (Sets::Base(setting), Values::Grid(list)) if is_judged_by(*setting) => list.clone(),
            (Sets::Base(setting), Values::Drawn(Distribution::Choice(list)))
                if is_judged_by(*setting) =>
            {
                list.iter().map(|choice| choice.value.clone()).collect()
            }
            (_, Values::Grid(list)) => vec![list[0].clone()],
            (_, Values::Drawn(distribution)) => vec![distribution.middle()],
        };
        probes = probes
            .into_iter()
            .flat_map(|probe: Vec<Value>| {
                values.iter().map(move |value| {
                    let mut probe = probe.clone();
                    probe.push(value.clone());
                    probe
                })
            })
            .collect();
    }
    probes
}
