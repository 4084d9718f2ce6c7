//! The form of each study's `summary.json`, published as a JSON schema.

use schemars::{JsonSchema, generate::SchemaSettings};
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::Stopped;

/// What a study writes into `summary.json` and prints with `--json`.
pub trait Summary: Serialize + JsonSchema {
    /// Name and version of the form, as `wheeleg.run/1`. A change that a reader of the version
    /// before would trip over gets a new number.
    const SCHEMA: &'static str;
}

/// A summary with what is the same in all of them.
#[derive(Serialize, JsonSchema)]
struct Document<'a, T> {
    /// Name and version of this form.
    schema: &'static str,
    /// What stopped the study before its end; null if nothing did.
    stopped: Option<&'a Stopped>,
    #[serde(flatten)]
    body: &'a T,
}

/// Writes a seed as text: browsers and other readers of JSON hold no whole number above 2^53.
///
/// # Errors
/// None of its own.
pub fn seed_text<S: Serializer>(seed: &u64, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(seed)
}

/// A summary as indented JSON with a final newline.
#[must_use]
pub fn json<T: Summary>(body: &T, stopped: Option<&Stopped>) -> String {
    let document = Document {
        schema: T::SCHEMA,
        stopped,
        body,
    };
    // Structs of numbers and texts always serialise.
    let mut text = serde_json::to_string_pretty(&document).unwrap_or_default();
    text.push('\n');
    text
}

/// The schema of a summary, with its name.
#[must_use]
pub fn schema<T: Summary + 'static>() -> (&'static str, Value) {
    let generator = SchemaSettings::draft2020_12()
        .for_serialize()
        .into_generator();
    let mut schema = generator
        .into_root_schema_for::<Document<'static, T>>()
        .to_value();
    schema["title"] = T::SCHEMA.into();
    schema["properties"]["schema"]["const"] = T::SCHEMA.into();
    (T::SCHEMA, schema)
}
