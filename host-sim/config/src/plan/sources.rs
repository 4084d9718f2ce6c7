//! The texts that a plan is made from, so that a folder of results needs no other file.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml_edit::{Document, Item};

use crate::builtin::{self, Source};
use crate::error::{ConfigError, word};
use crate::reader::Reader;
use crate::terrain::{Data, named_files};
use crate::{AxisConfig, Scenario};

/// A file: its name for messages, and its contents.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Text {
    /// Name for messages.
    pub file: String,
    /// Contents.
    pub text: String,
}

/// A plan's own text and those of all scenarios, robots and axes named in it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Sources {
    /// The plan.
    pub plan: Text,
    /// Scenarios by their name in the plan.
    pub scenarios: BTreeMap<String, Text>,
    /// Robots by their name in the plan or scenario.
    pub robots: BTreeMap<String, Text>,
    /// Axes by their name in the plan.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub axes: BTreeMap<String, Text>,
    /// Robot of each scenario, by their names.
    pub robot_of: BTreeMap<String, String>,
    /// Data files of each scenario, by their name in it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schemars(with = "BTreeMap<String, BTreeMap<String, String>>")]
    pub data: BTreeMap<String, BTreeMap<String, Data>>,
}

impl Sources {
    /// Reads a plan, built in or from a file, and the files named in it. A relative path counts from the
    /// folder of the plan; a scenario's robot, from the folder of the scenario.
    ///
    /// # Errors
    /// [`ConfigError`] if one of the files cannot be read.
    pub fn load(name_or_path: &str) -> Result<Self, ConfigError> {
        let Source { file, text } = builtin::plan_source(name_or_path)?;
        let path = Path::new(name_or_path);
        Self::of(Text { file, text }, path.parent().unwrap_or(Path::new("")))
    }

    /// The same for a plan that is no file. A relative path in it counts from `folder`.
    ///
    /// # Errors
    /// As [`Sources::load`].
    pub fn of(plan: Text, folder: &Path) -> Result<Self, ConfigError> {
        let mut sources = Self {
            plan,
            scenarios: BTreeMap::new(),
            robots: BTreeMap::new(),
            axes: BTreeMap::new(),
            robot_of: BTreeMap::new(),
            data: BTreeMap::new(),
        };
        // A plan that is not TOML, or names nothing, is reported when it is read.
        let Ok(document) = Document::parse(sources.plan.text.clone()) else {
            return Ok(sources);
        };
        let mut wrong = Vec::new();
        for named in named(&document, "scenario") {
            if let Err(error) = sources.add_scenario(folder, &named.name) {
                wrong.push((named, error));
            }
        }
        for named in named(&document, "robot") {
            match builtin::robot_source(&placed(folder, &named.name)) {
                Ok(Source { file, text }) => {
                    let robots = &mut sources.robots;
                    robots.insert(named.name, Text { file, text });
                }
                Err(error) => wrong.push((named, error)),
            }
        }
        for named in named(&document, "axis") {
            match AxisConfig::source(&placed(folder, &named.name)) {
                Ok(Source { file, text }) => {
                    sources.axes.insert(named.name, Text { file, text });
                }
                Err(error) => wrong.push((named, error)),
            }
        }
        sources.without(wrong)
    }

    /// The same with the names of files without their folders, which depend on how a path was given.
    #[must_use]
    pub fn with_bare_names(mut self) -> Self {
        let texts = [&mut self.scenarios, &mut self.robots, &mut self.axes].into_iter();
        let texts = texts.flat_map(BTreeMap::values_mut);
        for text in texts.chain([&mut self.plan]) {
            if let Some(name) = Path::new(&text.file).file_name() {
                text.file = name.to_string_lossy().into_owned();
            }
        }
        self
    }

    /// Itself, if nothing named in the plan is `wrong`; otherwise the errors at their places in the plan.
    fn without(self, wrong: Vec<(Named, ConfigError)>) -> Result<Self, ConfigError> {
        if wrong.is_empty() {
            return Ok(self);
        }
        let Text { file, text } = &self.plan;
        let what = format!("the plan {file} is not usable");
        let mut r = Reader::parse(&what, file, text, false)?;
        for (named, error) in wrong {
            let name = word(&named.name);
            for problem in error.problems() {
                let help = problem.help_text().map(str::to_owned);
                let told = problem.summary();
                // For a name, the file is the name itself.
                let told = told.strip_prefix(&format!("{name}: ")).unwrap_or(&told);
                let message = format!("`{}` = \"{name}\": {told}", named.path);
                r.problem(named.span.clone(), message, "not usable", help);
            }
        }
        Err(r.refusal(&what))
    }

    fn add_scenario(&mut self, folder: &Path, name: &str) -> Result<(), ConfigError> {
        let place = placed(folder, name);
        let Source { file, text } = builtin::scenario_source(&place)?;
        let robot = Document::parse(text.as_str()).ok();
        let robot = robot.as_ref().and_then(|d| d.get("robot")?.as_str());
        if let Some(robot) = robot {
            let place = builtin::named_by(robot, &place);
            let Source { file, text } = builtin::robot_source(&place)?;
            self.robots.insert(place.clone(), Text { file, text });
            self.robot_of.insert(name.to_owned(), place);
        }
        let data = data_of(name, &file, &text)?;
        if !data.is_empty() {
            self.data.insert(name.to_owned(), data);
        }
        self.scenarios.insert(name.to_owned(), Text { file, text });
        Ok(())
    }
}

/// A scenario or a robot, and its place in a plan.
struct Named {
    name: String,
    path: String,
    span: Option<Range<usize>>,
}

/// The names that a plan has under `key`: in `[base]`, and in factors.
fn named(document: &Document<String>, key: &str) -> Vec<Named> {
    let base = document.get("base").and_then(|base| base.get(key));
    let mut named: Vec<Named> = base
        .and_then(|item| {
            Some(Named {
                name: item.as_str()?.to_owned(),
                path: format!("base.{key}"),
                span: item.span(),
            })
        })
        .into_iter()
        .collect();
    let factors = document.get("factor").and_then(Item::as_table_like);
    let factors = factors.into_iter().flat_map(|table| table.iter());
    let own =
        |(_, factor): &(&str, &Item)| factor.get("parameter").and_then(Item::as_str) == Some(key);
    for (factor, item) in factors.filter(own) {
        let grid = item.get("grid").and_then(Item::as_array);
        let names = grid.into_iter().flatten();
        named.extend(names.filter_map(|value| {
            Some(Named {
                name: value.as_str()?.to_owned(),
                path: format!("factor.{factor}.grid"),
                span: value.span(),
            })
        }));
    }
    named
}

/// The data files of a scenario.
///
/// # Errors
/// [`ConfigError`] of the scenario if one of them cannot be read.
fn data_of(name: &str, file: &str, text: &str) -> Result<BTreeMap<String, Data>, ConfigError> {
    let files = builtin::files_of(name, file);
    let mut data = BTreeMap::new();
    for named in named_files(text) {
        match files.read(&named) {
            Ok(bytes) => {
                data.insert(named, Data(bytes));
            }
            // The reader reports it with its line.
            Err(_) => {
                Scenario::parse_with(file, text, &files)?;
            }
        }
    }
    Ok(data)
}

/// A name unchanged; a relative path, from the folder.
fn placed(folder: &Path, name: &str) -> String {
    if builtin::is_path(name) && !Path::new(name).is_absolute() {
        return folder.join(name).to_string_lossy().into_owned();
    }
    name.to_owned()
}
