//! The form of each study's `summary.json`, and of other JSON output of the program, published as JSON
//! schemas.

use schemars::{JsonSchema, generate::SchemaSettings};
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::Stopped;

/// Data that a study writes into `summary.json` and prints with `--json`.
pub trait Summary: Serialize + JsonSchema {
    /// Name and version of the form, as `wheeleg.run/1`. A change that breaks readers of the earlier version
    /// gets a new number.
    const SCHEMA: &'static str;
}

/// A summary with the parts common to all.
#[derive(Serialize, JsonSchema)]
struct Document<'a, T> {
    /// Name and version of this form.
    schema: &'static str,
    /// Why the study stopped early; null if it did not.
    stopped: Option<&'a Stopped>,
    #[serde(flatten)]
    body: &'a T,
}

/// Writes a seed as text: browsers and other JSON readers cannot hold whole numbers above 2^53.
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

/// JSON that a command prints, in a published form.
pub trait Form: Serialize + JsonSchema {
    /// Name and version of the form, as of [`Summary::SCHEMA`].
    const SCHEMA: &'static str;
}

/// JSON of a command with the name of its form.
#[derive(Serialize, JsonSchema)]
struct Printed<'a, T> {
    /// Name and version of this form.
    schema: &'static str,
    #[serde(flatten)]
    body: &'a T,
}

/// The output of a command, as a line of JSON.
#[must_use]
pub fn line<T: Form>(body: &T) -> String {
    let schema = T::SCHEMA;
    let mut text = serde_json::to_string(&Printed { schema, body }).unwrap_or_default();
    text.push('\n');
    text
}

/// The same, indented.
#[must_use]
pub fn indented<T: Form>(body: &T) -> String {
    let schema = T::SCHEMA;
    let mut text = serde_json::to_string_pretty(&Printed { schema, body }).unwrap_or_default();
    text.push('\n');
    text
}

/// The schema of a summary, with its name.
#[must_use]
pub fn schema<T: Summary + 'static>() -> (&'static str, Value) {
    named(of_file::<Document<'static, T>>(T::SCHEMA))
}

/// The schema of a command's output, with its name.
#[must_use]
pub fn of_form<T: Form + 'static>() -> (&'static str, Value) {
    named(of_file::<Printed<'static, T>>(T::SCHEMA))
}

/// The schema of a file that does not contain the name of its form.
#[must_use]
pub fn of_file<T: JsonSchema>(name: &'static str) -> (&'static str, Value) {
    let generator = SchemaSettings::draft2020_12()
        .for_serialize()
        .into_generator();
    let mut schema = generator.into_root_schema_for::<T>().to_value();
    schema["title"] = name.into();
    (name, schema)
}

/// A schema in which the field `schema` has the name.
fn named((name, mut schema): (&'static str, Value)) -> (&'static str, Value) {
    schema["properties"]["schema"]["const"] = name.into();
    (name, schema)
}
