//! Single axes: cylinder, valves, load and sensor of a test bench.
//!
//! An axis file has the sections of a robot file that concern one cylinder,
//! with the same units and ranges, and three of its own: `[moving]`, `[chamber]`
//! and `[start]`.

use std::path::Path;

use toml_edit::DocumentMut;
use wheeleg_plant::axis::{Axis, AxisParams};
use wheeleg_plant::chamber::GasModel;
use wheeleg_plant::sensors::AdcNoise;

use super::builtin;
use super::error::{ConfigError, Problem};
use super::overlay;
use super::params::{ParameterInfo, params};
use super::plant::pneumatics::{self, Pneumatics, Sensing};
use super::plant::sections::{MASS, STROKE};
use super::reader::{FileKind, Reader};
use super::relations::{self, Advised, Moved, Tried};
use super::suggest::closest;

params! {
    /// Load that moves with the rod.
    MovingSection {
        /// Mass of rod, carriage and payload.
        mass: f64, "mass", Mass, MASS[0], MASS[1];
        /// Force on the rod, positive extends.
        load: f64, "load", Force, -10_000.0, 10_000.0;
    }

    /// Choices of the chamber and friction model.
    ChamberSection {
        /// Energy balance with heat exchange instead of the polytropic law.
        thermal: bool, "thermal", Flag, 0.0, 1.0;
        /// Heat transfer coefficient of the energy balance.
        heat_transfer: f64, "heat_transfer", HeatTransfer, 0.0, 1000.0;
        /// Growth of the Coulomb force with the higher chamber pressure; 0: none.
        friction_area: f64, "friction_area", Area, 0.0, 1e-3;
    }

    /// State at the start.
    AxisStartSection {
        /// Stroke.
        stroke: f64, "stroke", Length, 0.0, STROKE[1];
        /// Pressure of chamber A, absolute.
        pressure_a: f64, "pressure_a", Pressure, 1e4, 2e6;
        /// Pressure of chamber B, absolute.
        pressure_b: f64, "pressure_b", Pressure, 1e4, 2e6;
    }
}

/// Built-in axes: name, file name for messages, text.
pub const AXES: &[(&str, &str, &str)] = &[
    (
        "bench-vq110u",
        "axes/bench-vq110u.toml",
        include_str!("../../axes/bench-vq110u.toml"),
    ),
    (
        "small-12x50",
        "axes/small-12x50.toml",
        include_str!("../../axes/small-12x50.toml"),
    ),
    (
        "long-16x400",
        "axes/long-16x400.toml",
        include_str!("../../axes/long-16x400.toml"),
    ),
    (
        "heavy-40x250",
        "axes/heavy-40x250.toml",
        include_str!("../../axes/heavy-40x250.toml"),
    ),
];

/// An axis file, checked and converted to SI.
#[derive(Debug, Clone)]
pub struct AxisConfig {
    /// Name of the axis.
    pub name: String,
    /// One-line description.
    pub description: String,
    /// The plant.
    pub axis: AxisParams,
    /// Every parameter as written, for listings and reports.
    pub parameters: Vec<ParameterInfo>,
    /// The file.
    pub source: builtin::Source,
}

/// Fields of a sound file that do not allow a requested use.
#[derive(Debug, Clone)]
pub struct Unfit {
    /// Paths of the fields; the message points at the first.
    pub fields: Vec<&'static str>,
    /// Why, with figures.
    pub why: String,
    /// What is allowed.
    pub allowed: String,
}

/// Another value for a parameter of an axis file.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Dotted path, as `moving.mass`.
    pub path: String,
    /// Value, or the values of a list, in `unit`.
    pub values: Vec<f64>,
    /// Unit.
    pub unit: String,
    /// Source of the value.
    pub source: String,
}

impl AxisConfig {
    /// An axis by built-in name, or by path to a TOML file.
    ///
    /// # Errors
    /// [`ConfigError`] if there is no such axis or file, or if it is wrong.
    pub fn load(name_or_path: &str) -> Result<Self, ConfigError> {
        let (file, text) = builtin::find("axis", name_or_path, AXES)?;
        Self::parse(&file, &text)
    }

    /// The text of an axis, by built-in name or path.
    ///
    /// # Errors
    /// [`ConfigError`] if there is no such axis or file.
    pub fn source(name_or_path: &str) -> Result<builtin::Source, ConfigError> {
        let (file, text) = builtin::find("axis", name_or_path, AXES)?;
        Ok(builtin::Source { file, text })
    }

    /// An axis from a file.
    ///
    /// # Errors
    /// As [`AxisConfig::load`].
    pub fn from_path(path: &Path) -> Result<Self, ConfigError> {
        Self::load(&path.to_string_lossy())
    }

    /// The text of an axis file with other values in it, which are checked like the file's own when the text
    /// is read again.
    ///
    /// # Errors
    /// [`ConfigError`] if the file is wrong as it is, or has no such parameter.
    pub fn rewritten(file: &str, text: &str, changes: &[Change]) -> Result<String, ConfigError> {
        let what = format!("the axis file {file} cannot be changed");
        let listing = Self::parse(file, text)?.parameters;
        let mut document: DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| {
            // The reader of the file has accepted it.
            ConfigError::new(&what, vec![Problem::whole(file, e.to_string(), None)])
        })?;
        let mut problems = Vec::new();
        for change in changes {
            let info = listing.iter().find(|info| info.path == change.path);
            let fits = info.filter(|info| info.value.len() == change.values.len());
            let done = fits.is_some_and(|info| {
                let Change { unit, source, .. } = change;
                overlay::set_quantity(&mut document, info, &change.values, unit, source)
            });
            if !done {
                let paths = listing.iter().map(|info| info.path.as_str());
                let message = match info {
                    Some(info) => format!(
                        "`{}` has {} values, not {}",
                        change.path,
                        info.value.len(),
                        change.values.len()
                    ),
                    None => format!("there is no parameter `{}`", change.path),
                };
                let near = closest(&change.path, paths).map(|near| format!("did you mean {near}?"));
                problems.push(Problem::whole(file, message, near));
            }
        }
        if problems.is_empty() {
            Ok(document.to_string())
        } else {
            Err(ConfigError::new(what, problems))
        }
    }

    /// The error for a request that the axis cannot meet: `what` cannot be done, and each reason with file,
    /// line, fields and allowed values.
    #[must_use]
    pub fn unfit(&self, what: &str, reasons: &[Unfit]) -> ConfigError {
        let builtin::Source { file, text } = &self.source;
        let what = format!("the axis file {file} is not usable: {what}");
        let mut r = match Reader::parse(&what, file, text, true) {
            Ok(r) => r,
            Err(error) => return error,
        };
        for info in &self.parameters {
            r.list(info.clone());
        }
        for Unfit {
            fields,
            why,
            allowed,
        } in reasons
        {
            r.contradiction(fields, why, allowed, Vec::new());
        }
        r.refusal(&what)
    }

    /// Reads an axis from TOML text; `file` is the name for messages.
    ///
    /// # Errors
    /// [`ConfigError`] with every problem found: file, line, field, value,
    /// accepted units or range.
    pub fn parse(file: &str, text: &str) -> Result<Self, ConfigError> {
        Self::parse_as(&format!("the axis file {file} is not usable"), file, text)
    }

    /// The same axis with other values, which are checked like the file's own; if one of them is wrong,
    /// `what` says what cannot be done.
    ///
    /// # Errors
    /// [`ConfigError`] with every field that is out of its range or does not fit the others.
    pub fn with(&self, what: &str, changes: &[Change]) -> Result<Self, ConfigError> {
        let builtin::Source { file, text } = &self.source;
        let text = Self::rewritten(file, text, changes)?;
        Self::parse_as(what, file, &text)
    }

    fn parse_as(what: &str, file: &str, text: &str) -> Result<Self, ConfigError> {
        let mut r = Reader::parse(what, file, text, true)?;
        r.ensure_kind(what, FileKind::Axis)?;
        let Parts {
            name,
            description,
            axis,
        } = Parts::read(&mut r);
        relations::check(&mut r, &facts(axis.as_ref()), &|values| {
            tried(file, text, values)
        });
        if let (true, Some(axis)) = (r.is_clean(), &axis) {
            relations::check_plant(&mut r, Axis::new(axis).map(drop));
        }
        let config = (|| {
            Some(Self {
                name: name?,
                description: description?,
                axis: axis?,
                parameters: Vec::new(),
                source: builtin::Source {
                    file: file.to_owned(),
                    text: text.to_owned(),
                },
            })
        })();
        let (mut config, parameters) = r.finish(what, config)?;
        config.parameters = parameters;
        Ok(config)
    }
}

/// Names at the top of an axis file in addition to those of [`pneumatics`].
const OWN: [&str; 5] = ["name", "description", "chamber", "moving", "start"];

/// Parts of an axis file, as far as they could be read.
struct Parts {
    name: Option<String>,
    description: Option<String>,
    axis: Option<AxisParams>,
}

impl Parts {
    fn read(r: &mut Reader) -> Self {
        let top = r.table("");
        if let Some(top) = &top {
            r.reject_unknown(top, &[&OWN[..], &pneumatics::SECTIONS].concat());
        }
        Self {
            name: top.as_ref().and_then(|t| r.name(t, "name")),
            description: top.as_ref().and_then(|t| r.text(t, "description")),
            axis: read(r),
        }
    }
}

fn facts(axis: Option<&AxisParams>) -> relations::Read<'_> {
    relations::Read {
        moved: axis.map(Moved::of),
        axis,
        robot: None,
    }
}

/// Tries the file with other values, and returns its errors.
fn tried(file: &str, text: &str, values: &[Advised]) -> Option<Tried> {
    let mut r = Reader::with(file, text, values)?;
    let axis = Parts::read(&mut r).axis;
    let built = || {
        axis.as_ref()
            .map_or(Ok(()), |axis| Axis::new(axis).map(drop))
    };
    Some(relations::tried(&r, &facts(axis.as_ref()), built))
}

fn read(r: &mut Reader) -> Option<AxisParams> {
    let pneumatics = Pneumatics::read(r);
    let chamber = r.section::<ChamberSection>("chamber");
    let moving = r.section::<MovingSection>("moving");
    let start = r.section::<AxisStartSection>("start");
    // On a bench the noise is stated as a bound: uniform within ± that many LSB.
    let sensing = Sensing::read(r, |half_width_lsb| AdcNoise::Uniform { half_width_lsb });

    let (chamber, moving, start) = (chamber?, moving?, start?);
    let (pneumatics, sensing) = (pneumatics?, sensing?);
    let mut cylinder = pneumatics.cylinder;
    cylinder.initial_pressure_a_pa = start.pressure_a;
    cylinder.initial_pressure_b_pa = start.pressure_b;
    cylinder.friction.pressure_area_m2 = chamber.friction_area;
    if chamber.thermal {
        cylinder.gas_model = GasModel::Thermal {
            heat_transfer_w_m2_k: chamber.heat_transfer,
        };
    }
    let axis = AxisParams {
        gas: pneumatics.gas,
        supply: pneumatics.supply,
        cylinder,
        moving_mass_kg: moving.mass,
        load_n: moving.load,
        initial_stroke_m: start.stroke,
        potentiometer: sensing.potentiometer,
        adc: sensing.adc,
        step_ns: sensing.step_ns,
    };
    Some(axis)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_axis_is_a_plant() {
        for (name, _, _) in AXES {
            let config = AxisConfig::load(name).expect("built in");
            assert_eq!(config.name, *name);
            assert!(wheeleg_plant::axis::Axis::new(&config.axis).is_ok());
            assert!(config.parameters.len() > 60);
        }
    }

    /// The plant's own tests have a copy that needs no file.
    #[test]
    fn the_bench_file_and_the_plant_tests_use_the_same_cylinder() {
        let file = AxisConfig::load("bench-vq110u").expect("built in").axis;
        let copy = wheeleg_plant::testing::vq110u_axis();
        let mut cylinder = copy.cylinder.clone();
        cylinder.initial_pressure_a_pa = file.cylinder.initial_pressure_a_pa;
        cylinder.initial_pressure_b_pa = file.cylinder.initial_pressure_b_pa;
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * a.abs().max(b.abs());
        let (a, b) = (&file.cylinder, &cylinder);
        assert!(near(a.bore_m, b.bore_m) && near(a.rod_m, b.rod_m) && near(a.stroke_m, b.stroke_m));
        assert!(near(
            a.fill_valve.flow.conductance_m3_s_pa,
            b.fill_valve.flow.conductance_m3_s_pa
        ));
        assert!(near(a.fill_valve.t_on_s, b.fill_valve.t_on_s));
        assert!(near(a.vent_valve.t_off_s, b.vent_valve.t_off_s));
        assert!(near(a.dead_volume_a_m3, b.dead_volume_a_m3));
        assert!(near(a.line_volume_m3, b.line_volume_m3) && near(a.line_delay_s, b.line_delay_s));
        assert!(near(a.friction.static_n, b.friction.static_n));
        assert_eq!(file.moving_mass_kg, copy.moving_mass_kg);
    }

    #[test]
    fn a_rewritten_axis_has_the_new_value_and_its_source_and_an_unknown_one_is_refused() {
        let (_, file, text) = AXES[0];
        let change = |path: &str, value: f64, unit: &str| Change {
            path: path.to_owned(),
            values: vec![value],
            unit: unit.to_owned(),
            source: "IDENTIFIED".to_owned(),
        };
        let text_of = |change| AxisConfig::rewritten(file, text, &[change]);
        let lighter = text_of(change("moving.mass", 900.0, "g")).expect("a parameter");
        let axis = AxisConfig::parse(file, &lighter).expect("an axis");
        assert_eq!(axis.axis.moving_mass_kg, 0.9);
        let listed = axis.parameters.iter().find(|p| p.path == "moving.mass");
        assert_eq!(listed.expect("listed").source, "IDENTIFIED");
        // Range and unit are the reader's business.
        let heavy = text_of(change("moving.mass", 5000.0, "kg")).expect("a parameter");
        assert!(AxisConfig::parse(file, &heavy).is_err());
        let error = text_of(change("moving.mas", 1.0, "kg")).expect_err("no such parameter");
        let told = error.problems()[0].summary();
        assert!(told.contains("moving.mas"), "{told}");
    }

    #[test]
    fn a_wrong_axis_names_field_value_and_range() {
        let (_, file, text) = AXES[0];
        let bad = text.replace(
            "bore          = { value = 20.0",
            "bore          = { value = 2000.0",
        );
        assert_ne!(bad, text);
        let error = AxisConfig::parse(file, &bad).expect_err("out of range");
        let summary = error.problems()[0].summary();
        assert!(
            summary.contains("cylinder.bore") && summary.contains("2000"),
            "{summary}"
        );
    }
}
