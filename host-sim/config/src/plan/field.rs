//! Values of factors in the texts of files.

use std::collections::BTreeMap;

use toml_edit::DocumentMut;

use super::Text;
use super::factor::Factor;
use super::value::Value;
use crate::LawChoice;
use crate::error::{ConfigError, Problem};
use crate::overlay;
use crate::params::ParameterInfo;
use crate::terrain::Data;

/// A file that factors change: its name, its text, and every quantity in it.
pub(super) struct Template {
    pub(super) file: String,
    pub(super) document: DocumentMut,
    pub(super) listing: Vec<ParameterInfo>,
    /// Data files of a scenario.
    pub(super) data: BTreeMap<String, Data>,
}

impl Template {
    pub(super) fn read(source: &Text, listing: Vec<ParameterInfo>) -> Result<Self, ConfigError> {
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

/// Puts one value into the text of a file.
pub(super) fn set(
    base: &Template,
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
    let number = number * info.factor_from(&unit);
    let mixed = each.map(|(i, v)| if at(i) { number } else { *v });
    (mixed.collect(), info.unit.clone())
}
