//! `modelDescription.xml` of FMI 2.0.4 and 3.0.1.

use std::collections::BTreeMap;
use std::ffi::CStr;
use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};

use wheeleg_studies::view::plain;

use crate::kind::Kind;
use crate::model::{IDENTIFIER, Model};
use crate::units::exponents;
use crate::value::ValueType;
use crate::variable::{Role, Variable};

/// Version of the interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fmi {
    /// 2.0.
    Two,
    /// 3.0.
    Three,
}

/// Categories of an instance's log.
pub(crate) const LOG_ERROR: &CStr = c"logStatusError";
pub(crate) const LOG_FATAL: &CStr = c"logStatusFatal";

type Xml = Writer<Vec<u8>>;
type Attributes<'a> = Vec<(&'a str, &'a str)>;

/// The description of a model.
///
/// # Errors
/// None from a writer into memory.
pub fn write(model: &Model, fmi: Fmi) -> io::Result<Vec<u8>> {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let name = format!("wheeleg {}", model.config.name);
    // XML has no way to write most control characters.
    let lines = model.config.description.split_whitespace();
    let description = plain(&lines.collect::<Vec<_>>().join(" "));
    let tool = format!("wheeleg {}", env!("CARGO_PKG_VERSION"));
    let (version, token) = match fmi {
        Fmi::Two => ("2.0", "guid"),
        Fmi::Three => ("3.0", "instantiationToken"),
    };
    let mut head: Attributes<'_> = vec![
        ("fmiVersion", version),
        ("modelName", &name),
        (token, &model.token),
        ("description", &description),
        ("generationTool", &tool),
        ("license", env!("CARGO_PKG_LICENSE")),
        ("variableNamingConvention", "structured"),
    ];
    if fmi == Fmi::Two {
        head.push(("numberOfEventIndicators", "0"));
    }
    xml.create_element("fmiModelDescription")
        .with_attributes(head)
        .write_inner_content(|xml| {
            co_simulation(xml, model, fmi)?;
            unit_definitions(xml, model)?;
            xml.create_element("LogCategories")
                .write_inner_content(|xml| {
                    let mut names = [LOG_ERROR, LOG_FATAL].into_iter();
                    names.try_for_each(|name| {
                        empty(xml, "Category", &[("name", &*name.to_string_lossy())])
                    })
                })?;
            empty(
                xml,
                "DefaultExperiment",
                &[("startTime", "0"), ("stopTime", "1"), ("stepSize", "0.001")],
            )?;
            xml.create_element("ModelVariables")
                .write_inner_content(|xml| {
                    let list = model.variables.iter().enumerate();
                    list.into_iter()
                        .try_for_each(|(reference, variable)| match fmi {
                            Fmi::Two => variable_2(xml, reference, variable),
                            Fmi::Three => variable_3(xml, reference, variable),
                        })
                })?;
            structure(xml, model, fmi)
        })?;
    let mut bytes = xml.into_inner();
    bytes.push(b'\n');
    Ok(bytes)
}

fn empty(xml: &mut Xml, name: &str, attributes: &[(&str, &str)]) -> io::Result<()> {
    xml.create_element(name)
        .with_attributes(attributes.iter().copied())
        .write_empty()?;
    Ok(())
}

fn co_simulation(xml: &mut Xml, model: &Model, fmi: Fmi) -> io::Result<()> {
    // A board's state has no written form.
    let written = if model.kind == Kind::Plant {
        "true"
    } else {
        "false"
    };
    let (state, serialize) = match fmi {
        Fmi::Two => ("canGetAndSetFMUstate", "canSerializeFMUstate"),
        Fmi::Three => ("canGetAndSetFMUState", "canSerializeFMUState"),
    };
    let mut attributes = vec![
        ("modelIdentifier", IDENTIFIER),
        ("canHandleVariableCommunicationStepSize", "true"),
        (state, "true"),
        (serialize, written),
    ];
    match fmi {
        Fmi::Two => attributes.push(("canNotUseMemoryManagementFunctions", "true")),
        Fmi::Three => attributes.push(("fixedInternalStepSize", "0.001")),
    }
    empty(xml, "CoSimulation", &attributes)
}

fn unit_definitions(xml: &mut Xml, model: &Model) -> io::Result<()> {
    let used = model.variables.iter().filter(|v| !v.unit.is_empty());
    let units: BTreeMap<&str, _> = used.map(|v| (v.unit.as_str(), v.dimension)).collect();
    xml.create_element("UnitDefinitions")
        .write_inner_content(|xml| {
            for (unit, dimension) in units {
                let factor = dimension.factor(unit).unwrap_or(1.0).to_string();
                let mut base = exponents(dimension).to_vec();
                if factor != "1" {
                    base.push(("factor", &factor));
                }
                xml.create_element("Unit")
                    .with_attribute(("name", unit))
                    .write_inner_content(|xml| empty(xml, "BaseUnit", &base))?;
            }
            Ok(())
        })?;
    Ok(())
}

/// Causality, variability, initial; FMI 3 says `initial` of an input itself.
fn nature(
    variable: &Variable,
    of: ValueType,
) -> (&'static str, &'static str, Option<&'static str>) {
    match (variable.role, of) {
        (Role::Time, _) => ("independent", "continuous", None),
        (Role::Seed | Role::Parameter { .. }, _) => ("parameter", "fixed", Some("exact")),
        (Role::Input, ValueType::Real) => ("input", "continuous", None),
        (Role::Input, _) => ("input", "discrete", None),
        (Role::Output(_), ValueType::Real) => ("output", "continuous", Some("calculated")),
        (Role::Output(_), _) => ("output", "discrete", Some("calculated")),
    }
}

/// Unit, range and start: of the variable's type.
fn values(variable: &Variable) -> Vec<(&'static str, String)> {
    let of = variable.start.value_type();
    let mut list = Vec::new();
    if of == ValueType::Real && !variable.unit.is_empty() {
        list.push(("unit", variable.unit.clone()));
    }
    if let Some([min, max]) = variable.range {
        list.push(("min", min.to_string()));
        list.push(("max", max.to_string()));
    }
    if !matches!(variable.role, Role::Time | Role::Output(_)) {
        list.push(("start", variable.start.to_string()));
    }
    list
}

fn variable_2(xml: &mut Xml, reference: usize, variable: &Variable) -> io::Result<()> {
    let of = variable.start.value_type();
    let (causality, variability, initial) = nature(variable, of);
    let reference = reference.to_string();
    let mut attributes: Attributes<'_> = vec![
        ("name", &variable.name),
        ("valueReference", &reference),
        ("description", &variable.description),
        ("causality", causality),
        ("variability", variability),
    ];
    attributes.extend(initial.map(|initial| ("initial", initial)));
    let name = match of {
        ValueType::Real => "Real",
        ValueType::Integer => "Integer",
        ValueType::Boolean => "Boolean",
    };
    let values = values(variable);
    let values: Vec<(&str, &str)> = values.iter().map(|(k, v)| (*k, v.as_str())).collect();
    xml.create_element("ScalarVariable")
        .with_attributes(attributes)
        .write_inner_content(|xml| empty(xml, name, &values))?;
    Ok(())
}

fn variable_3(xml: &mut Xml, reference: usize, variable: &Variable) -> io::Result<()> {
    let of = variable.start.value_type();
    let (causality, variability, initial) = nature(variable, of);
    let reference = reference.to_string();
    let values = values(variable);
    let mut attributes: Attributes<'_> = vec![
        ("name", &variable.name),
        ("valueReference", &reference),
        ("description", &variable.description),
        ("causality", causality),
        ("variability", variability),
    ];
    attributes.extend(initial.map(|initial| ("initial", initial)));
    attributes.extend(values.iter().map(|(k, v)| (*k, v.as_str())));
    let name = match of {
        ValueType::Real => "Float64",
        ValueType::Integer => "Int32",
        ValueType::Boolean => "Boolean",
    };
    empty(xml, name, &attributes)
}

fn structure(xml: &mut Xml, model: &Model, fmi: Fmi) -> io::Result<()> {
    let list = model.variables.iter().enumerate();
    let outputs = list.filter(|(_, v)| matches!(v.role, Role::Output(_)));
    // FMI 2 counts variables from 1; FMI 3 names value references.
    let outputs: Vec<String> = outputs
        .map(|(reference, _)| match fmi {
            Fmi::Two => reference + 1,
            Fmi::Three => reference,
        })
        .map(|number| number.to_string())
        .collect();
    let unknowns = |xml: &mut Xml| {
        let mut numbers = outputs.iter();
        numbers.try_for_each(|number| empty(xml, "Unknown", &[("index", number)]))
    };
    xml.create_element("ModelStructure")
        .write_inner_content(|xml| {
            match fmi {
                Fmi::Two => {
                    xml.create_element("Outputs")
                        .write_inner_content(unknowns)?;
                    xml.create_element("InitialUnknowns")
                        .write_inner_content(unknowns)?;
                }
                Fmi::Three => {
                    for name in ["Output", "InitialUnknown"] {
                        for number in &outputs {
                            empty(xml, name, &[("valueReference", number)])?;
                        }
                    }
                }
            }
            Ok(())
        })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::AxisConfig;
    use wheeleg_studies::axis_sim;

    /// XML 1.0, production `Char`, of what is not beyond the first plane.
    fn is_xml(c: char) -> bool {
        matches!(c, '\t' | '\n' | '\r' | '\u{20}'..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..)
    }

    #[test]
    fn a_description_with_control_characters_is_well_formed_all_the_same() {
        let source = AxisConfig::source("bench-vq110u").expect("built in");
        let kinds = [Kind::Plant, Kind::Controlled];
        for (kind, fmi) in kinds.into_iter().zip([Fmi::Two, Fmi::Three]) {
            let law = axis_sim::Kind::Predictive;
            let model = Model::new(kind, law, &source.file, &source.text);
            let mut model = model.expect("a model");
            model.config.description = "</x><b a='\"&\u{0}\u{1}\u{1b}\u{202e}\tend".to_owned();
            let xml = write(&model, fmi).expect("written");
            let xml = String::from_utf8(xml).expect("UTF-8");
            assert!(xml.chars().all(is_xml), "{fmi:?}");
            assert!(
                !xml.contains(['\u{202e}', '\u{1b}']) && !xml.contains("<b a="),
                "{fmi:?}"
            );
            let shown = "&lt;/x&gt;&lt;b a=&apos;&quot;&amp;\u{fffd}\u{fffd}\u{fffd}\u{fffd} end";
            assert!(xml.contains(shown), "{fmi:?}");
        }
    }
}
