//! Board parameters in a robot file, by the names of the protocol's tables.

use wheeleg_protocol::Node;
use wheeleg_protocol::param::{JOINT_PARAMS, ParamInfo, WHEEL_PARAMS, params_at};

use super::board_value::{allowed_raw, allowed_values, in_unit, scale};
use super::contradictions::{self, Board};
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
    let board = |node| Board {
        node,
        stored: params.of(node),
        sections: sections_of(node),
    };
    contradictions::report(r, &Node::ALL.map(board));
    params
}

/// The sections that set parameters of a board, the last word first.
fn sections_of(node: Node) -> Vec<&'static str> {
    if !node.is_joint() {
        return vec!["wheel"];
    }
    let own = |(_, joints): &&(_, &[usize])| node.joint().is_some_and(|i| joints.contains(&i));
    let sections = JOINT_SECTIONS.iter().rev().filter(own);
    sections.map(|(name, _)| *name).collect()
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
