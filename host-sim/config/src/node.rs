//! Board parameters in a robot file, by the names of the protocol's tables.

use wheeleg_node::acceptance::accepts;
use wheeleg_protocol::Node;
use wheeleg_protocol::param::{JOINT_PARAMS, ParamInfo, WHEEL_PARAMS, params_at};

use super::board_value::{allowed_raw, allowed_values, in_unit, scale};
use super::params::ParameterInfo;
use super::quantity::{pretty, suffix};
use super::reader::{Entry, Reader, range};

/// Parameters that the master sends to the boards before arming, as raw
/// numbers of the wire format.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct NodeParams {
    /// Per joint 1 to 6: (number, raw value), ascending.
    pub joints: [Vec<(u16, i32)>; 6],
    /// Per wheel 7, 8.
    pub wheels: [Vec<(u16, i32)>; 2],
}

impl NodeParams {
    /// Parameters of a board.
    #[must_use]
    pub fn of(&self, node: Node) -> &[(u16, i32)] {
        let mut boards = self.joints.iter().chain(&self.wheels);
        boards.nth(node.index()).map_or(&[], Vec::as_slice)
    }
}

/// Names of the sections, and the joints (index from 0) that each sets. Later
/// sections replace what earlier ones set.
const JOINT_SECTIONS: [(&str, &[usize]); 4] = [
    ("joint", &[0, 1, 2, 3, 4, 5]),
    ("yaw", &[0, 3]),
    ("horizontal", &[1, 4]),
    ("vertical", &[2, 5]),
];

/// Reads `[node.joint]`, `[node.yaw]`, `[node.horizontal]`, `[node.vertical]` and `[node.wheel]`. Parameters
/// that are not set keep the board's default.
pub(super) fn read(r: &mut Reader) -> NodeParams {
    let mut params = NodeParams::default();
    let sections = ["joint", "yaw", "horizontal", "vertical", "wheel"];
    let Some(top) = r.optional_table("node", &sections) else {
        return params;
    };
    r.reject_unknown(&top, &sections);
    for (name, joints) in JOINT_SECTIONS {
        for (id, raw) in section(r, &format!("node.{name}"), JOINT_PARAMS) {
            for joint in joints {
                set(&mut params.joints[*joint], id, raw);
            }
        }
    }
    for (id, raw) in section(r, "node.wheel", WHEEL_PARAMS) {
        for wheel in &mut params.wheels {
            set(wheel, id, raw);
        }
    }
    list_defaults(r, "node.joint", JOINT_PARAMS);
    list_defaults(r, "node.wheel", WHEEL_PARAMS);
    contradictions(r, &params);
    params
}

/// Values that a board refuses together though each is within its own limits. The error names each parameter
/// that, left at its default, makes the board accept the others.
fn contradictions(r: &mut Reader, params: &NodeParams) {
    let stored = params.joints.iter().chain(&params.wheels);
    // One board is enough: others get the same from its section.
    let mut refused =
        (Node::ALL.into_iter().zip(stored)).filter(|(to, stored)| !accepts(to.address(), stored));
    let Some((node, stored)) = refused.next() else {
        return;
    };
    let address = node.address();
    let of_joint = |(_, joints): &&(_, &[usize])| node.joint().is_some_and(|i| joints.contains(&i));
    let sections: Vec<&str> = if node.is_joint() {
        let own = JOINT_SECTIONS.iter().rev().filter(of_joint);
        own.map(|(name, _)| *name).collect()
    } else {
        vec!["wheel"]
    };
    let mut named = false;
    for (place, (id, raw)) in stored.iter().enumerate() {
        let mut without = stored.clone();
        without.remove(place);
        let info = params_at(address.raw()).iter().find(|row| row.id == *id);
        let Some(info) = info.filter(|_| accepts(address, &without)) else {
            continue;
        };
        let found = sections.iter().find_map(|name| {
            let path = format!("node.{name}");
            let (span, _) = r.table(&path)?.get(info.name)?;
            Some((span, path))
        });
        let Some((span, path)) = found else { continue };
        let with = |info: &ParamInfo, raw: i32| {
            let mut stored = stored.clone();
            set(&mut stored, info.id, raw);
            accepts(address, &stored)
        };
        let shown = |raw: i32| format!("{}{}", pretty(in_unit(info, raw)), suffix(info.unit));
        let side = if *raw > info.default { "up to" } else { "from" };
        let limit = last_accepted(*raw, info.default, |raw| with(info, raw));
        // Far from it no single other value may be enough.
        let just_refused = limit + (*raw - limit).signum();
        // The printed number has fewer digits than a fine format: go a thousandth inwards.
        let limit = match scale(info.format) == 1.0 {
            true => limit,
            false => limit + (info.default - limit) / 1000,
        };
        let mends = |other: &ParamInfo, beside: i32| {
            [other.min, other.max].into_iter().any(|raw| {
                let mut stored = stored.clone();
                set(&mut stored, info.id, beside);
                set(&mut stored, other.id, raw);
                accepts(address, &stored)
            })
        };
        let all = params_at(address.raw()).iter();
        let others = all.filter(|other| {
            other.id != info.id && (mends(other, *raw) || mends(other, just_refused))
        });
        let section = if node.is_joint() { "joint" } else { "wheel" };
        let others: Vec<String> = others
            .map(|other| {
                let own = stored.iter().find(|(id, _)| *id == other.id);
                let raw = own.map_or(other.default, |(_, raw)| *raw);
                let value = pretty(in_unit(other, raw));
                format!(
                    "`node.{section}.{}` = {value}{}",
                    other.name,
                    suffix(other.unit)
                )
            })
            .collect();
        let contradicts = match others.as_slice() {
            [] => "other parameters".to_owned(),
            _ => others.join(", "),
        };
        r.problem(
            Some(span),
            format!(
                "`{path}.{}` = {} contradicts {contradicts}: the board of {address} refuses them together",
                info.name,
                shown(*raw)
            ),
            "not with the others",
            Some(format!(
                "`{path}.{}` is allowed {side} {} with the others as they are: {}",
                info.name,
                shown(limit),
                info.text
            )),
        );
        named = true;
    }
    if !named {
        r.problem(
            None,
            format!("the board of {address} refuses its parameters together"),
            "",
            Some(format!(
                "see the sections [node.{}]",
                sections.join("], [node.")
            )),
        );
    }
}

/// Searches between a refused and an accepted value for the last accepted one.
fn last_accepted(mut refused: i32, mut accepted: i32, is_accepted: impl Fn(i32) -> bool) -> i32 {
    while refused.abs_diff(accepted) > 1 {
        let middle = refused.midpoint(accepted);
        match is_accepted(middle) {
            true => accepted = middle,
            false => refused = middle,
        }
    }
    accepted
}

/// The board named by an event, if there is one with this number.
fn board(entry: &Entry) -> Option<u8> {
    let number = entry.get("board")?.1.as_integer()?;
    Node::new(u8::try_from(number).ok()?).map(Node::number)
}

/// Reads `parameter`, by its name in the table of the entry's `board`; nothing if there is no such board,
/// which is a problem of its own.
pub(super) fn parameter(r: &mut Reader, entry: &Entry) -> Option<&'static ParamInfo> {
    let table = params_at(board(entry)?).iter();
    let names: Vec<(&str, &'static ParamInfo)> = table.map(|p| (p.name, p)).collect();
    r.choice(entry, "parameter", &names)
}

/// Reads `value`, a number in the unit of the entry's `parameter`, as the raw number of its
/// format.
pub(super) fn value(r: &mut Reader, entry: &Entry) -> Option<i32> {
    let name = entry.get("parameter")?.1;
    let info = params_at(board(entry)?)
        .iter()
        .find(|p| name.as_str() == Some(p.name))?;
    let (span, item) = entry.get("value")?;
    let value = item.as_float().or(item.as_integer().map(|n| n as f64));
    let Some(value) = value.filter(|v| v.is_finite()) else {
        let (min, max) = (in_unit(info, info.min), in_unit(info, info.max));
        let message = format!(
            "`{}` = {} must be a number from {}",
            entry.field_path("value"),
            item.to_string().trim(),
            range(min, max, info.unit)
        );
        r.problem(Some(span), message, "not a number", None);
        return None;
    };
    let raw = allowed_raw(info, value);
    if raw.is_none() {
        let message = format!(
            "`{}` = {} is out of range: allowed {}",
            entry.field_path("value"),
            pretty(value),
            allowed_values(info)
        );
        r.problem(Some(span), message, "out of range", None);
    }
    raw
}

/// Lists parameters that the file leaves at the board's default, so that a listing of the robot is complete.
fn list_defaults(r: &mut Reader, path: &str, table: &'static [ParamInfo]) {
    let entry = r.table(path);
    let unset = table
        .iter()
        .filter(|p| entry.as_ref().is_none_or(|e| !e.has(p.name)));
    for info in unset {
        r.list(ParameterInfo {
            path: format!("{path}.{}", info.name),
            value: vec![in_unit(info, info.default)],
            unit: info.unit.to_owned(),
            min: in_unit(info, info.min),
            max: in_unit(info, info.max),
            source: "default of the board (protocol's parameter table)".to_owned(),
            dimension: None,
            whole: scale(info.format) == 1.0,
            doc: info.text,
        });
    }
}

/// Sets a parameter of a board.
pub(super) fn set(list: &mut Vec<(u16, i32)>, id: u16, raw: i32) {
    match list.binary_search_by_key(&id, |(id, _)| *id) {
        Ok(at) => list[at].1 = raw,
        Err(at) => list.insert(at, (id, raw)),
    }
}

fn section(r: &mut Reader, path: &str, table: &'static [ParamInfo]) -> Vec<(u16, i32)> {
    let names: Vec<&str> = table.iter().map(|p| p.name).collect();
    let Some(entry) = r.optional_table(path, &names) else {
        return Vec::new();
    };
    r.reject_unknown(&entry, &names);
    table
        .iter()
        .filter(|p| entry.has(p.name))
        .filter_map(|p| Some((p.id, one(r, &entry, p)?)))
        .collect()
}

fn one(r: &mut Reader, entry: &Entry, info: &'static ParamInfo) -> Option<i32> {
    let scale = scale(info.format);
    let (min, max) = (in_unit(info, info.min), in_unit(info, info.max));
    let range = range(min, max, info.unit);
    let stated = (info.unit, range.as_str());
    let (value, span, source) = r.table_quantity(entry, info.name, stated, info.text)?;
    let path = format!("{}.{}", entry.path, info.name);
    let raw = (value * scale).round();
    let written = format!("`{path}` = {}{}", pretty(value), suffix(info.unit));
    if !(f64::from(info.min)..=f64::from(info.max)).contains(&raw) {
        r.problem(
            Some(span),
            format!("{written} is out of range: allowed {range}"),
            "out of range",
            Some(format!("{path}: {}", info.text)),
        );
        return None;
    }
    if scale == 1.0 && value.fract() != 0.0 {
        let message = format!("{written} must be a whole number from {range}");
        r.problem(Some(span), message, "not whole", None);
        return None;
    }
    r.list(ParameterInfo {
        path,
        value: vec![value],
        unit: info.unit.to_owned(),
        min,
        max,
        source,
        dimension: None,
        whole: scale == 1.0,
        doc: info.text,
    });
    Some(raw as i32)
}
