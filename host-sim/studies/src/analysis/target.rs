//! One target with its measured value and verdict.

use schemars::JsonSchema;
use serde::Serialize;

use wheeleg_telemetry::messages::within;

/// Judgement of a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Judgement {
    /// Required, and in its band.
    Met,
    /// Required, and not in its band.
    Missed,
    /// In its band, and not required.
    Within,
    /// Not in its band, and not required.
    Outside,
    /// A value without a band.
    Value,
}

impl Judgement {
    /// As shown in the terminal.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Met => "PASS",
            Self::Missed => "FAIL",
            Self::Within => "info: within",
            Self::Outside => "info: outside",
            Self::Value => "info",
        }
    }
}

/// A target: what was measured, what was asked, and whether it holds.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Target {
    /// Identifier, from MODEL.md §11 where there is one.
    pub id: String,
    /// What is measured and how.
    pub description: String,
    /// Measured value; null when it could not be measured.
    pub value: Option<f64>,
    /// Unit of value and band.
    pub unit: &'static str,
    /// Lower end of the band, if there is one.
    pub min: Option<f64>,
    /// Upper end of the band, if there is one.
    pub max: Option<f64>,
    /// Whether the value lies in the band (both ends included).
    pub pass: bool,
    /// Whether the run counts as failed if this is not met; the others inform.
    pub required: bool,
}

/// A band as shown on every page and in the terminal.
#[must_use]
pub fn band_text(min: Option<f64>, max: Option<f64>) -> String {
    match (min, max) {
        (Some(a), Some(b)) if a == b => format!("= {a}"),
        (Some(a), Some(b)) => format!("{a} … {b}"),
        (Some(a), None) => format!("≥ {a}"),
        (None, Some(b)) => format!("≤ {b}"),
        (None, None) => "–".into(),
    }
}

/// A measured value with its unit.
pub(crate) fn measured_text(value: Option<f64>, unit: &str) -> String {
    let unit = value.map_or("", |_| unit_text(unit));
    let value = value_text(value);
    format!("{value} {unit}").trim_end().to_owned()
}

/// A requirement, with the unit.
pub(crate) fn asked_text(min: Option<f64>, max: Option<f64>, unit: &str) -> String {
    let band = band_text(min, max);
    let band = band.strip_prefix("= ").unwrap_or(&band);
    format!("{band} {}", unit_text(unit)).trim_end().to_owned()
}

/// The unit for use after a value: empty for a count or a share.
fn unit_text(unit: &str) -> &str {
    if unit == "1" { "" } else { unit }
}

/// A value as text, four significant digits.
fn value_text(value: Option<f64>) -> String {
    let Some(v) = value else {
        return "not measured".into();
    };
    if v.fract() == 0.0 && v.abs() < 1e6 {
        return format!("{v:.0}");
    }
    let decimals = (3 - v.abs().log10().floor() as i32).clamp(0, 4) as usize;
    format!("{v:.decimals$}")
}

impl Target {
    /// A required target. A value that could not be measured, or is not a
    /// number, fails.
    pub(crate) fn new(
        id: impl Into<String>,
        description: impl Into<String>,
        value: Option<f64>,
        unit: &'static str,
        min: Option<f64>,
        max: Option<f64>,
    ) -> Self {
        let value = value.filter(|v| v.is_finite());
        let pass = value.is_some_and(|v| min.is_none_or(|m| v >= m) && max.is_none_or(|m| v <= m));
        Self {
            id: id.into(),
            description: description.into(),
            value,
            unit,
            min,
            max,
            pass,
            required: true,
        }
    }

    /// The same, for information only.
    pub(crate) fn info(self) -> Self {
        Self {
            required: false,
            ..self
        }
    }

    /// The unit for use after a value: empty for a count or a share.
    #[must_use]
    pub fn unit_text(&self) -> &'static str {
        unit_text(self.unit)
    }

    /// The value with its unit.
    #[must_use]
    pub fn measured_text(&self) -> String {
        measured_text(self.value, self.unit)
    }

    /// The requirement, with the unit.
    #[must_use]
    pub fn asked_text(&self) -> String {
        asked_text(self.min, self.max, self.unit)
    }

    /// The measured quantity, as used in a sentence: without the explanation in brackets.
    #[must_use]
    pub fn name_text(&self) -> String {
        let name = self.description.split(" (").next().unwrap_or_default();
        within(name)
    }

    /// The band as text.
    #[must_use]
    pub fn band_text(&self) -> String {
        band_text(self.min, self.max)
    }

    /// The value as text, four significant digits.
    #[must_use]
    pub fn value_text(&self) -> String {
        value_text(self.value)
    }

    /// Its judgement.
    #[must_use]
    pub fn judgement(&self) -> Judgement {
        match (self.pass, self.required) {
            _ if self.min.is_none() && self.max.is_none() => Judgement::Value,
            (true, true) => Judgement::Met,
            (true, false) => Judgement::Within,
            (false, true) => Judgement::Missed,
            (false, false) => Judgement::Outside,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_has_no_unit_and_a_band_has_that_of_its_value() {
        let three = Target::new("X", "Steps (all)", Some(1.0), "1", Some(3.0), Some(3.0));
        let told = [three.measured_text(), three.asked_text(), three.name_text()];
        assert_eq!(told, ["1", "3", "steps"]);
        let late = Target::new("X", "b5 moves", Some(26.34), "s", None, Some(20.0));
        let told = [late.measured_text(), late.asked_text(), late.name_text()];
        assert_eq!(told, ["26.34 s", "≤ 20 s", "b5 moves"]);
        let never = Target::new("X", "x", None, "s", None, Some(20.0));
        assert_eq!(never.measured_text(), "not measured");
    }

    #[test]
    fn bands_include_their_ends_and_an_unmeasured_value_fails() {
        let t = |v: Option<f64>| Target::new("X", "x", v, "mm", Some(1.0), Some(2.0)).pass;
        assert!(t(Some(1.0)) && t(Some(2.0)));
        assert!(!t(Some(0.999)) && !t(Some(2.001)) && !t(None) && !t(Some(f64::NAN)));
    }
}
