//! Reference vectors: a file of states with kinematics and dynamics computed by somebody else, compared
//! number by number with this implementation.
//!
//! The schema is `wheeleg-reference-vectors/1` (MODEL.md section 13). Dimensions and masses are
//! taken from the file, so that users can check a robot of their own. Every number of every key is
//! compared; a missing key, an unknown key or a file without cases is an error, never a pass.

mod compute;
mod error;
mod reader;
mod schema;

pub use error::{Problem, VectorsError};

use std::path::Path;

use serde::Serialize;

use schema::{Role, SECTIONS, VectorFile};

/// Tolerance of kinematic quantities, absolute, in their SI unit. MODEL.md section 13.
pub const KINEMATICS_TOLERANCE: f64 = 1e-12;
/// Tolerance of inertias and forces, absolute, in their SI unit. MODEL.md section 13.
pub const FORCE_TOLERANCE: f64 = 1e-10;

/// One quantity of the file and how well it agrees.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantity {
    /// Section and key, such as `leg.tau_a`.
    pub name: String,
    /// Numbers compared.
    pub values: usize,
    /// Largest absolute difference, in the quantity's SI unit.
    pub worst_error: f64,
    /// Largest difference allowed.
    pub tolerance: f64,
    /// `id` of the case with the largest difference; none for parameters.
    pub case: Option<u64>,
    /// Place in the flattened array (row by row) of the largest difference.
    pub index: usize,
    /// The file's number there.
    pub expected: f64,
    /// This implementation's number there.
    pub computed: f64,
    /// Whether the largest difference is within the tolerance.
    pub pass: bool,
}

/// Outcome of the comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// The file.
    pub file: String,
    /// Seed named in the file.
    pub seed: u64,
    /// Number of cases, at least one.
    pub cases: usize,
    /// Every quantity, in the order of the schema.
    pub quantities: Vec<Quantity>,
    /// Parameters in the file on which no quantity depends.
    pub unused_parameters: Vec<String>,
    /// Whether every quantity is within its tolerance.
    pub passed: bool,
}

impl Quantity {
    fn new(name: String, tolerance: f64) -> Self {
        Self {
            name,
            values: 0,
            worst_error: 0.0,
            tolerance,
            case: None,
            index: 0,
            expected: 0.0,
            computed: 0.0,
            pass: true,
        }
    }

    fn add(&mut self, case: Option<u64>, expected: &[f64], computed: &[f64]) {
        for (index, (&e, &c)) in expected.iter().zip(computed).enumerate() {
            let error = (e - c).abs();
            // The first number is always in the table; NaN is the worst of all.
            if self.values == 0 || error > self.worst_error || error.is_nan() {
                self.worst_error = if error.is_nan() { f64::INFINITY } else { error };
                self.case = case;
                self.index = index;
                self.expected = e;
                self.computed = c;
            }
            self.values += 1;
        }
        self.pass = self.worst_error <= self.tolerance;
    }
}

/// Reads a file and compares it.
///
/// # Errors
/// [`VectorsError`] for a file that cannot be read or does not follow the schema (with key path, value and
/// expected value), or with a state that no leg can take.
pub fn check(path: &Path) -> Result<Comparison, VectorsError> {
    let text = wheeleg_config::builtin::text_of(path).map_err(|reason| VectorsError::Read {
        file: path.display().to_string(),
        reason,
    })?;
    check_text(&path.display().to_string(), &text)
}

/// As [`check`], from text; `file` is its name in messages.
///
/// # Errors
/// As [`check`].
pub fn check_text(file: &str, text: &str) -> Result<Comparison, VectorsError> {
    let value: serde_json::Value =
        serde_json::from_str(text).map_err(|reason| VectorsError::Json {
            file: file.to_owned(),
            reason,
        })?;
    let vectors = schema::read(file, &value)?;
    let mut quantities = parameters(&vectors);
    let first = quantities.len();
    for section in &SECTIONS {
        for key in section.keys {
            let tolerance = match key.role {
                Role::Input => continue,
                Role::Kinematics => KINEMATICS_TOLERANCE,
                Role::Force => FORCE_TOLERANCE,
            };
            let name = format!("{}.{}", section.name, key.name);
            quantities.push(Quantity::new(name, tolerance));
        }
    }
    let model = compute::Model::new(file, &vectors)?;
    for (i, case) in vectors.cases.iter().enumerate() {
        let mut sheet = quantities[first..].iter_mut();
        for (section, numbers) in SECTIONS.iter().zip(&case.sections) {
            let computed = model.section(section.name, case, numbers).map_err(|why| {
                VectorsError::malformed(
                    file,
                    vec![Problem {
                        path: format!("cases[{i}].{}.q", section.name),
                        value: format!("{:?}", numbers.get("q")),
                        expected: format!("a state that the model can take: {why}"),
                    }],
                )
            })?;
            for key in section.keys.iter().filter(|k| k.role != Role::Input) {
                let got = computed.iter().find(|(name, _)| *name == key.name);
                let got = got.map_or(&[][..], |(_, numbers)| numbers);
                if let Some(quantity) = sheet.next() {
                    // A zip would hide a missing number.
                    let mut padded = got.to_vec();
                    padded.resize(key.len(), f64::NAN);
                    quantity.add(Some(case.id), numbers.get(key.name), &padded);
                }
            }
        }
    }
    Ok(Comparison {
        file: file.to_owned(),
        seed: vectors.seed,
        cases: vectors.cases.len(),
        passed: quantities.iter().all(|q| q.pass && q.values > 0),
        unused_parameters: vectors.params.unused.clone(),
        quantities,
    })
}

/// The constants that the file derives from its own parameters.
fn parameters(vectors: &VectorFile) -> Vec<Quantity> {
    let derived = compute::derived(&vectors.params);
    let mut quantities = Vec::new();
    for (name, expected) in &vectors.params.derived {
        let computed = derived.iter().find(|(n, _)| n == name);
        let mut quantity = Quantity::new(format!("params.{name}"), KINEMATICS_TOLERANCE);
        quantity.add(None, &[*expected], &[computed.map_or(f64::NAN, |c| c.1)]);
        quantities.push(quantity);
    }
    quantities
}

#[cfg(test)]
mod tests;
