//! The model of a unit.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use wheeleg_config::AxisConfig;
use wheeleg_studies::axis_sim;

use crate::error::FmuError;
use crate::kind::Kind;
use crate::simulation::Simulation;
use crate::variable::{self, Variable};

/// Name of the shared library in a unit, and of the identifiers in its description.
pub const IDENTIFIER: &str = "wheeleg";
/// Name of the axis file in a unit's resources.
pub const AXIS_FILE: &str = "axis.toml";
/// Name of the file beside it with the other data.
pub const UNIT_FILE: &str = "unit.json";

/// Data in the resources besides the axis file.
#[derive(Debug, Serialize, Deserialize)]
struct About {
    kind: Kind,
    /// Name of the control law; none for a plant.
    law: Option<String>,
    /// Program that exported it.
    version: String,
}

/// The model of a unit, with the variables that follow from it.
#[derive(Debug)]
pub struct Model {
    /// Contents of the unit.
    pub kind: Kind,
    /// Control law of a controlled unit.
    pub law: axis_sim::Kind,
    /// Axis file, for messages.
    pub file: String,
    /// Text of the axis file.
    pub text: String,
    /// The axis.
    pub config: AxisConfig,
    /// Every variable; its value reference is its index.
    pub variables: Vec<Variable>,
    /// Name of the model for the importer.
    pub token: String,
}

impl Model {
    /// A model of an axis file. Reports an axis for which no board can be designed.
    ///
    /// # Errors
    /// [`FmuError`] if the file is wrong or its plant or board cannot be built.
    pub fn new(kind: Kind, law: axis_sim::Kind, file: &str, text: &str) -> Result<Self, FmuError> {
        let config = AxisConfig::parse(file, text)?;
        Simulation::new(kind, law, &config.axis, 1)?;
        let mut model = Self {
            kind,
            law,
            file: file.to_owned(),
            text: text.to_owned(),
            variables: variable::list(kind, &config),
            config,
            token: String::new(),
        };
        let mut hasher = blake3::Hasher::new();
        hasher.update(format!("{}\n{text}", model.about()).as_bytes());
        // A library with other variables is another model, whatever its version says.
        for v in &model.variables {
            hasher.update(format!("\n{} {} {}", v.name, v.unit, v.start).as_bytes());
        }
        model.token = format!("{{{}}}", uuid(hasher.finalize().as_bytes()));
        Ok(model)
    }

    /// Contents of [`UNIT_FILE`].
    pub(crate) fn about(&self) -> String {
        let controlled = self.kind == Kind::Controlled;
        let about = About {
            kind: self.kind,
            law: controlled.then(|| self.law.name().to_owned()),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        // Three texts.
        serde_json::to_string_pretty(&about).unwrap_or_default()
    }

    /// The model in a folder of resources.
    ///
    /// # Errors
    /// [`FmuError::Resources`] if a file is missing or wrong, and as [`Model::new`].
    pub fn read(folder: &Path) -> Result<Self, FmuError> {
        let path = folder.join(UNIT_FILE);
        let about: About =
            serde_json::from_str(&text(&path)?).map_err(|e| wrong(path.clone(), &e))?;
        let law = match &about.law {
            None => axis_sim::Kind::Predictive,
            Some(name) => axis_sim::Kind::of_name(name)
                .ok_or_else(|| wrong(path, &format!("there is no law \"{name}\"")))?,
        };
        let path = folder.join(AXIS_FILE);
        Self::new(about.kind, law, AXIS_FILE, &text(&path)?)
    }
}

fn text(path: &Path) -> Result<String, FmuError> {
    std::fs::read_to_string(path).map_err(|e| wrong(path.to_owned(), &e))
}

fn wrong(path: PathBuf, reason: &dyn std::fmt::Display) -> FmuError {
    FmuError::Resources {
        path,
        reason: reason.to_string(),
    }
}

/// The first 16 bytes as a UUID is written, which FMI 2 expects of its `guid`.
fn uuid(bytes: &[u8; 32]) -> String {
    let digits: String = bytes[..16].iter().map(|b| format!("{b:02x}")).collect();
    [
        &digits[..8],
        &digits[8..12],
        &digits[12..16],
        &digits[16..20],
        &digits[20..],
    ]
    .join("-")
}
