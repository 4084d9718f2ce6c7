//! Identity of a case: its content, and nothing else.
//!
//! Index, shard and order do not enter. Two programs that run the same content have the same case, so their
//! results can be compared case by case.
//!
//! The seed follows from the content, too, unless the plan counts seeds: then the seed is content instead of the
//! replicate's number.
//!
//! If a plan draws from lists alone, many of its samples would be the same case, run again with the same
//! noise. For such plans the sample number is part of the content.

use std::fmt;
use std::str::FromStr;

use serde_json::{Value as Json, json};
use wheeleg_config::plan::{Base, Part, Plan, Resolved, Sets, Setting, Value};

use crate::place::Place;

/// Version of the hashed content.
const FORMAT: u32 = 1;
/// Purpose string of the seed's key.
const SEED_KEY: &str = "wheeleg campaign seed v1";

/// Identity of a case: 128 bits of the hash of its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct CaseId(u128);

impl fmt::Display for CaseId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

/// Fewest characters of the beginning of an identity: shorter ones would name a case by chance.
const BEGINNING: usize = 4;
/// The same of one that has only decimal digits, and might be a place in a plan.
const BEGINNING_OF_DIGITS: usize = 8;

/// The beginning of an identity, as tables show a long text, with or without `…`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Beginning(String);

impl Beginning {
    /// A text as such a beginning; `None` if it is no beginning of an identity, or too short.
    pub(crate) fn of(text: &str) -> Option<Self> {
        let own = text.trim_end_matches('…').to_lowercase();
        let least = match own.bytes().all(|b| b.is_ascii_digit()) {
            true => BEGINNING_OF_DIGITS,
            false => BEGINNING,
        };
        let is_hexadecimal = own.bytes().all(|b| b.is_ascii_hexdigit());
        (is_hexadecimal && (least..=32).contains(&own.len())).then_some(Self(own))
    }

    /// Whether an identity begins with it.
    pub(crate) fn is_of(&self, case: CaseId) -> bool {
        case.to_string().starts_with(&self.0)
    }
}

impl FromStr for CaseId {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let digits = text.len() == 32 && text.bytes().all(|b| b.is_ascii_hexdigit());
        let number = digits.then(|| u128::from_str_radix(text, 16));
        match number {
            Some(Ok(number)) => Ok(Self(number)),
            _ => Err(format!(
                "`{text}` is not a case: that has 32 hexadecimal digits"
            )),
        }
    }
}

/// Identity and seed of a case.
pub(crate) fn identity(
    plan: &Plan,
    values: &[Value],
    place: Place,
    resolved: Option<&Resolved>,
) -> (CaseId, u64) {
    let mut content = content(plan, values, place.replicate, resolved);
    if plan.draws_from_lists_alone() {
        content["sample"] = json!(place.sample);
    }
    let counted = plan.seed(place.replicate);
    if let Some(seed) = counted {
        content["replicate"] = Json::Null;
        content["seed"] = json!(seed);
    }
    let mut whole = canonical(&content);
    let hash = blake3::hash(&whole);
    let (half, _) = hash.as_bytes().split_first_chunk().expect("32 bytes");
    let case = CaseId(u128::from_be_bytes(*half));
    if let Some(seed) = counted {
        return (case, seed);
    }
    let paired = || plan.factors.iter().zip(values).filter(|(f, _)| f.paired);
    for (factor, value) in paired() {
        remove(&mut content, &factor.name, &factor.sets, value);
    }
    if paired().next().is_some() {
        whole = canonical(&content);
    }
    let mut hasher = blake3::Hasher::new_derive_key(SEED_KEY);
    hasher.update(&plan.root.to_le_bytes());
    hasher.update(&whole);
    let hash = hasher.finalize();
    let (bits, _) = hash.as_bytes().split_first_chunk().expect("32 bytes");
    (case, u64::from_le_bytes(*bits) >> 1)
}

/// Canonical JSON: keys are sorted, and floats have the fewest digits that restore their value.
fn canonical(json: &Json) -> Vec<u8> {
    let mut text = Vec::new();
    write_canonical(json, &mut text);
    text
}

fn write_canonical(json: &Json, text: &mut Vec<u8>) {
    match json {
        Json::Object(fields) => {
            // Sort, whatever order the map keeps.
            let mut fields: Vec<_> = fields.iter().collect();
            fields.sort_by_key(|(key, _)| *key);
            text.push(b'{');
            for (k, (key, value)) in fields.into_iter().enumerate() {
                if k > 0 {
                    text.push(b',');
                }
                serde_json::to_writer(&mut *text, key).expect("memory takes it");
                text.push(b':');
                write_canonical(value, text);
            }
            text.push(b'}');
        }
        Json::Array(list) => {
            text.push(b'[');
            for (k, value) in list.iter().enumerate() {
                if k > 0 {
                    text.push(b',');
                }
                write_canonical(value, text);
            }
            text.push(b']');
        }
        plain => serde_json::to_writer(text, plain).expect("memory takes it"),
    }
}

fn content(plan: &Plan, values: &[Value], replicate: u64, resolved: Option<&Resolved>) -> Json {
    let factors = plan.factors.iter().zip(values);
    let factors: serde_json::Map<String, Json> = factors
        .map(|(factor, value)| {
            // One number in two units makes two different contents; a plan uses only one of them.
            let value = json!({ "value": value, "unit": factor.unit });
            (factor.name.clone(), value)
        })
        .collect();
    let mut content = json!({
        "format": FORMAT,
        "factors": factors,
        "replicate": replicate,
    });
    match (resolved, &plan.base) {
        (Some(Resolved::Robot(case)), _) => {
            content["scenario"] = case.scenario_json.clone();
            content["robot"] = case.robot_json.clone();
        }
        (Some(Resolved::Axis(case)), _) => content["bench"] = case.bench_json.clone(),
        (None, Base::Robot { .. }) => {
            content["scenario"] = Json::Null;
            content["robot"] = Json::Null;
        }
        (None, Base::Axis(_)) => content["bench"] = Json::Null,
    }
    content
}

/// Removes a paired factor, and what it sets, from the content.
fn remove(content: &mut Json, name: &str, sets: &Sets, value: &Value) {
    if let Some(factors) = content["factors"].as_object_mut() {
        factors.remove(name);
    }
    match sets {
        Sets::Base(Setting::Scenario) => content["scenario"] = Json::Null,
        Sets::Base(Setting::Robot) => content["robot"] = Json::Null,
        Sets::Base(Setting::Axis) => {
            for key in ["name", "axis", "plant"] {
                content["bench"][key] = Json::Null;
            }
        }
        Sets::Base(setting) => content["bench"][setting.name()] = Json::Null,
        Sets::Fault(template) => {
            let fault = template.replace("{}", &value.to_string());
            if let Some(list) = content["scenario"]["faults"].as_array_mut() {
                list.retain(|listed| listed.as_str() != Some(&fault));
            }
        }
        Sets::Fields(fields) => {
            for field in fields {
                let path = field.path.as_str();
                match field.part {
                    Part::Scenario => remove_field(&mut content["scenario"], path),
                    Part::Robot => remove_parameter(&mut content["robot"]["parameters"], path),
                    Part::Axis => {
                        remove_parameter(&mut content["bench"]["axis"], path);
                        remove_parameter(&mut content["bench"]["plant"], path);
                    }
                    Part::Plant => remove_parameter(&mut content["bench"]["plant"], path),
                }
            }
        }
    }
}

/// Removes every listed parameter that a path names or leads into.
fn remove_parameter(parameters: &mut Json, path: &str) {
    if let Some(parameters) = parameters.as_object_mut() {
        parameters.retain(|listed, _| !is_or_holds(listed, path));
    }
}

/// Whether a path names a parameter or one of its components.
fn is_or_holds(listed: &str, path: &str) -> bool {
    let rest = path.strip_prefix(listed);
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('['))
}

/// Removes the field at a path such as `events[0].at`.
fn remove_field(json: &mut Json, path: &str) {
    let (above, last) = path.rsplit_once('.').unwrap_or(("", path));
    let mut item = json;
    for part in above.split('.').filter(|part| !part.is_empty()) {
        let (key, index) = match part.strip_suffix(']').and_then(|p| p.rsplit_once('[')) {
            Some((key, index)) => (key, index.parse::<usize>().ok()),
            None => (part, None),
        };
        item = &mut item[key];
        if let Some(index) = index {
            item = &mut item[index];
        }
    }
    let key = last.split('[').next().unwrap_or(last);
    if let Some(fields) = item.as_object_mut() {
        fields.remove(key);
    }
}
