//! The fields of one part of the terrain.

use crate::params::FieldSpec;
use crate::quantity::Dimension;
use crate::reader::{Entry, Reader};

/// A field in degrees.
pub(super) const fn angle(key: &'static str, degrees: [f64; 2], doc: &'static str) -> FieldSpec {
    let [min, max] = [degrees[0].to_radians(), degrees[1].to_radians()];
    FieldSpec::scalar(key, Dimension::Angle, [min, max], doc)
}

/// A length in metres.
pub(super) const fn length(key: &'static str, range_m: [f64; 2], doc: &'static str) -> FieldSpec {
    FieldSpec::scalar(key, Dimension::Length, range_m, doc)
}

/// A pure number.
pub(super) const fn number(key: &'static str, range: [f64; 2], doc: &'static str) -> FieldSpec {
    FieldSpec::scalar(key, Dimension::Number, range, doc)
}

/// A part that is being read; fields that nobody asked for are reported in the end.
pub(super) struct Fields<'a> {
    pub(super) entry: &'a Entry,
    /// Fields at the top of the file.
    top: &'a [&'a str],
    known: Vec<&'static str>,
}

impl<'a> Fields<'a> {
    pub(super) fn new(entry: &'a Entry, top: &'a [&'a str]) -> Self {
        Self {
            entry,
            top,
            known: vec!["kind"],
        }
    }

    /// Whether the part has this optional field.
    pub(super) fn has(&mut self, key: &'static str) -> bool {
        if !self.known.contains(&key) {
            self.known.push(key);
        }
        self.entry.has(key)
    }

    /// A required quantity of the part, SI.
    pub(super) fn required(&mut self, r: &mut Reader, spec: &FieldSpec) -> Option<f64> {
        self.has(spec.key);
        r.required(self.entry, spec)
    }

    /// An optional quantity of the part, SI.
    pub(super) fn or(&mut self, r: &mut Reader, spec: &FieldSpec, default: f64) -> Option<f64> {
        if self.has(spec.key) {
            return r.required(self.entry, spec);
        }
        Some(default)
    }

    /// A required pair of values of one quantity, SI.
    pub(super) fn pair(&mut self, r: &mut Reader, spec: &FieldSpec) -> Option<[f64; 2]> {
        let spec = FieldSpec {
            components: 2,
            ..*spec
        };
        if !self.has(spec.key) {
            r.required(self.entry, &spec);
            return None;
        }
        let values = r.quantity(self.entry, &spec)?;
        Some([values[0], values[1]])
    }

    /// As [`Self::pair`], from the smaller to the larger value.
    pub(super) fn range(&mut self, r: &mut Reader, spec: &FieldSpec) -> Option<[f64; 2]> {
        let [from, to] = self.ordered(r, spec)?;
        if from < to {
            return Some([from, to]);
        }
        self.not_ordered(r, spec)
    }

    /// As [`Self::pair`], the first not larger than the second.
    pub(super) fn ordered(&mut self, r: &mut Reader, spec: &FieldSpec) -> Option<[f64; 2]> {
        let [from, to] = self.pair(r, spec)?;
        if from <= to {
            return Some([from, to]);
        }
        self.not_ordered(r, spec)
    }

    fn not_ordered<T>(&self, r: &mut Reader, spec: &FieldSpec) -> Option<T> {
        let span = self.entry.get(spec.key);
        let span = span.and_then(|(k, i)| i.span().or(Some(k)));
        let message = format!(
            "`{}` must run from the smaller to the larger value",
            self.entry.field_path(spec.key)
        );
        r.problem(span, message, "empty", None);
        None
    }

    /// A required whole number of the part.
    pub(super) fn whole(
        &mut self,
        r: &mut Reader,
        key: &'static str,
        allowed: std::ops::RangeInclusive<u64>,
    ) -> Option<u64> {
        if self.has(key) {
            return r.whole(self.entry, key, allowed);
        }
        r.problem(
            Some(self.entry.span.clone()),
            format!("`{}` is missing", self.entry.field_path(key)),
            "expected here",
            Some(format!(
                "write `{key} = …`, a whole number from {} to {}",
                allowed.start(),
                allowed.end()
            )),
        );
        None
    }

    /// Reports fields that this kind of part does not have.
    pub(super) fn reject_others(&self, r: &mut Reader) {
        r.reject_misplaced(self.entry, &self.known, self.top);
    }
}
