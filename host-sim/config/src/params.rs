//! The declarative table of parameters.
//!
//! `params!` declares a section of a robot file once: from it come the Rust
//! struct in SI units, its documentation, the checks of the loader and the
//! listing of `wheeleg params`.

use super::quantity::Dimension;

/// Allowed values of one parameter.
#[derive(Debug, Clone, Copy)]
pub struct FieldSpec {
    /// Key in the TOML section.
    pub key: &'static str,
    /// Physical dimension, which decides the accepted units.
    pub dimension: Dimension,
    /// Smallest allowed value, SI.
    pub min: f64,
    /// Largest allowed value, SI.
    pub max: f64,
    /// Number of components: 1 for a scalar.
    pub components: usize,
    /// Whether only whole numbers are allowed.
    pub integer: bool,
    /// Meaning.
    pub doc: &'static str,
}

impl FieldSpec {
    /// One number, between `min` and `max` SI.
    pub(crate) const fn scalar(
        key: &'static str,
        dimension: Dimension,
        [min, max]: [f64; 2],
        doc: &'static str,
    ) -> Self {
        Self {
            key,
            dimension,
            min,
            max,
            components: 1,
            integer: false,
            doc,
        }
    }
}

/// A Rust type that a parameter can have.
pub trait ParamValue: Sized {
    /// Number of components.
    const COMPONENTS: usize;
    /// Whether only whole numbers are allowed.
    const INTEGER: bool;
    /// Builds the value from components in SI that have passed the range check.
    fn from_si(components: &[f64]) -> Self;
}

impl ParamValue for f64 {
    const COMPONENTS: usize = 1;
    const INTEGER: bool = false;
    fn from_si(components: &[f64]) -> Self {
        components[0]
    }
}

impl ParamValue for bool {
    const COMPONENTS: usize = 1;
    const INTEGER: bool = true;
    fn from_si(components: &[f64]) -> Self {
        components[0] != 0.0
    }
}

macro_rules! integer_params {
    ($($t:ty),*) => {$(
        impl ParamValue for $t {
            const COMPONENTS: usize = 1;
            const INTEGER: bool = true;
            fn from_si(components: &[f64]) -> Self {
                components[0] as $t
            }
        }
    )*};
}
integer_params!(u8, u16, u32, u64, i16, i32);

impl<const N: usize> ParamValue for [f64; N] {
    const COMPONENTS: usize = N;
    const INTEGER: bool = false;
    fn from_si(components: &[f64]) -> Self {
        std::array::from_fn(|i| components[i])
    }
}

/// A section of a robot file.
pub trait Params: Sized {
    /// Its fields.
    const FIELDS: &'static [FieldSpec];
    /// Builds the section; `next` yields the SI components of each field in
    /// the order of [`Params::FIELDS`].
    fn build(next: &mut dyn FnMut() -> Vec<f64>) -> Self;
}

/// One parameter as loaded, for listings.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterInfo {
    /// Dotted path in the file.
    pub path: String,
    /// Value as written in the file.
    pub value: Vec<f64>,
    /// Unit as written in the file.
    pub unit: String,
    /// Smallest allowed value in that unit.
    pub min: f64,
    /// Largest allowed value in that unit.
    pub max: f64,
    /// Source of the value.
    pub source: String,
    /// Physical dimension; `None` for a board's parameter, which has one unit.
    pub dimension: Option<Dimension>,
    /// Whether only whole numbers are allowed.
    pub whole: bool,
    /// Meaning.
    pub doc: &'static str,
}

impl ParameterInfo {
    /// The value as text.
    #[must_use]
    pub fn value_text(&self) -> String {
        let numbers: Vec<String> = self
            .value
            .iter()
            .map(|v| super::quantity::pretty(*v))
            .collect();
        match numbers.as_slice() {
            [one] if self.unit == "flag" => (if one == "0" { "false" } else { "true" }).to_owned(),
            [one] => one.clone(),
            many => format!("[{}]", many.join(", ")),
        }
    }

    /// Factor from a unit to that of the file; 1 if only one is accepted.
    pub(crate) fn factor_from(&self, unit: &str) -> f64 {
        let si = |unit: &str| self.dimension.and_then(|d| d.factor(unit));
        match (si(unit), si(&self.unit)) {
            (Some(from), Some(to)) if unit != self.unit => from / to,
            _ => 1.0,
        }
    }

    /// The allowed range as text.
    #[must_use]
    pub fn range_text(&self) -> String {
        format!(
            "{} to {}",
            super::quantity::pretty(self.min),
            super::quantity::pretty(self.max)
        )
    }
}

/// Declares a section: `field: type, "key", Dimension, min SI, max SI;`.
macro_rules! params {
    ($(
        $(#[doc = $sdoc:literal])*
        $name:ident {
            $( $(#[doc = $fdoc:literal])* $field:ident: $ty:ty, $key:literal, $dim:ident, $min:expr, $max:expr; )*
        }
    )*) => {$(
        $(#[doc = $sdoc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name {
            $(
                $(#[doc = $fdoc])*
                #[doc = concat!(" Allowed range (SI): ", stringify!($min), " to ", stringify!($max), ".")]
                pub $field: $ty,
            )*
        }

        impl $crate::params::Params for $name {
            const FIELDS: &'static [$crate::params::FieldSpec] = &[$(
                $crate::params::FieldSpec {
                    key: $key,
                    dimension: $crate::quantity::Dimension::$dim,
                    min: $min,
                    max: $max,
                    components: <$ty as $crate::params::ParamValue>::COMPONENTS,
                    integer: <$ty as $crate::params::ParamValue>::INTEGER,
                    doc: concat!($($fdoc),*).trim_ascii(),
                },
            )*];

            fn build(next: &mut dyn FnMut() -> Vec<f64>) -> Self {
                Self {
                    $( $field: <$ty as $crate::params::ParamValue>::from_si(&next()), )*
                }
            }
        }
    )*};
}
pub(crate) use params;
