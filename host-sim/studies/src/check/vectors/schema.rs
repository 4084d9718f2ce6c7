//! The schema `wheeleg-reference-vectors/1` as a table, and reading a file by it.

use std::cell::RefCell;

use serde_json::Value;
use wheeleg_plant::dynamics::{BodyParams, LegBodies};

use super::reader::Node;
use super::{Problem, VectorsError};

const SCHEMA: &str = "wheeleg-reference-vectors/1";
const UNITS: &str = "SI, rad";

/// Use of a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// State or load: read, not compared.
    Input,
    /// Compared with the kinematic tolerance.
    Kinematics,
    /// Compared with the tolerance of forces.
    Force,
}

/// One array of a section.
#[derive(Debug, Clone, Copy)]
pub(super) struct Key {
    pub(super) name: &'static str,
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) role: Role,
}

impl Key {
    pub(super) fn len(&self) -> usize {
        self.rows * self.columns
    }
}

/// One section of a case.
#[derive(Debug, Clone, Copy)]
pub(super) struct Section {
    pub(super) name: &'static str,
    pub(super) keys: &'static [Key],
}

const fn key(name: &'static str, rows: usize, columns: usize, role: Role) -> Key {
    Key {
        name,
        rows,
        columns,
        role,
    }
}

use Role::{Force, Input, Kinematics};

const R2P: [Key; 16] = [
    key("q", 3, 1, Input),
    key("qd", 3, 1, Input),
    key("qdd", 3, 1, Input),
    key("p", 3, 1, Kinematics),
    key("J", 6, 3, Kinematics),
    key("twist", 6, 1, Kinematics),
    key("twist_dot", 6, 1, Kinematics),
    key("twist_printed_13", 6, 1, Kinematics),
    key("twist_dot_printed_16", 6, 1, Kinematics),
    key("T", 18, 3, Kinematics),
    key("Tdot", 18, 3, Kinematics),
    key("I", 3, 3, Force),
    key("C", 3, 3, Force),
    key("C_qd", 3, 1, Force),
    key("tau_g", 3, 1, Force),
    key("tau", 3, 1, Force),
];

const RPR: [Key; 16] = [
    key("q", 3, 1, Input),
    key("qd", 3, 1, Input),
    key("qdd", 3, 1, Input),
    key("p", 3, 1, Kinematics),
    key("J", 6, 3, Kinematics),
    key("twist", 6, 1, Kinematics),
    key("twist_dot", 6, 1, Kinematics),
    key("twist_printed_32", 6, 1, Kinematics),
    key("twist_dot_printed_38", 6, 1, Kinematics),
    key("T", 18, 3, Kinematics),
    key("Tdot", 18, 3, Kinematics),
    key("I", 3, 3, Force),
    key("C", 3, 3, Force),
    key("C_qd", 3, 1, Force),
    key("tau_g", 3, 1, Force),
    key("tau", 3, 1, Force),
];

const LEG: [Key; 22] = [
    key("q", 3, 1, Input),
    key("qd", 3, 1, Input),
    key("qdd", 3, 1, Input),
    key("contact_force", 3, 1, Input),
    key("joints", 6, 1, Kinematics),
    key("joints_d", 6, 1, Kinematics),
    key("joints_dd", 6, 1, Kinematics),
    key("foot_p", 3, 1, Kinematics),
    key("foot_v", 3, 1, Kinematics),
    key("foot_a", 3, 1, Kinematics),
    key("foot_p_f1", 3, 1, Kinematics),
    key("N", 6, 3, Kinematics),
    key("Ndot", 6, 3, Kinematics),
    key("theta1_roots", 2, 2, Kinematics),
    key("I", 3, 3, Force),
    key("C", 3, 3, Force),
    key("C_qd", 3, 1, Force),
    key("tau_g", 3, 1, Force),
    key("tau_d", 3, 1, Force),
    key("tau_l", 3, 1, Force),
    key("tau_l_printed_58_64", 3, 1, Force),
    key("tau_a", 3, 1, Force),
];

const HALF_ROBOT: [Key; 9] = [
    key("q", 4, 1, Input),
    key("qd", 4, 1, Input),
    key("qdd", 4, 1, Input),
    key("contact_force", 3, 1, Input),
    key("I", 4, 4, Force),
    key("C", 4, 4, Force),
    key("C_qd", 4, 1, Force),
    key("tau_g", 4, 1, Force),
    key("tau_a", 4, 1, Force),
];

/// The sections of a case, in their order.
pub(super) const SECTIONS: [Section; 4] = [
    Section {
        name: "r2p",
        keys: &R2P,
    },
    Section {
        name: "rpr",
        keys: &RPR,
    },
    Section {
        name: "leg",
        keys: &LEG,
    },
    Section {
        name: "half_robot",
        keys: &HALF_ROBOT,
    },
];

/// Parameters that the quantities depend on.
const REQUIRED: [&str; 12] = [
    "crank",
    "p4",
    "viscous",
    "chassis_mass",
    "wheel_mass",
    "wheel_radius",
    "wheel_inertia",
    "rotor_inertia",
    "gear_motor",
    "gear_chain",
    "wheel_viscous",
    "bodies",
];
/// Constants that a file may repeat; compared with those computed from the others.
pub(super) const DERIVED: [&str; 7] = [
    "R",
    "beta",
    "k1",
    "k4",
    "gear",
    "half_wheel_inertia",
    "mass_total",
];
/// Parameters of other parts of the model, which a file may hold.
const UNUSED: [&str; 9] = [
    "b5_home",
    "b6_home",
    "stroke",
    "o4_x",
    "o4_y",
    "foot_pad",
    "track",
    "chassis_com_x",
    "com_height",
];
const UNUSED_VECTOR: &str = "gravity";

/// Dimensions and masses of a file, SI.
pub(super) struct Params {
    pub(super) crank_m: f64,
    pub(super) p4_m: [f64; 2],
    pub(super) viscous_n_s_m: [f64; 3],
    pub(super) chassis_mass_kg: f64,
    pub(super) wheel_mass_kg: f64,
    pub(super) wheel_radius_m: f64,
    pub(super) wheel_inertia_kg_m2: f64,
    pub(super) rotor_inertia_kg_m2: f64,
    pub(super) gear_motor: f64,
    pub(super) gear_chain: f64,
    pub(super) wheel_viscous_n_s_m: f64,
    pub(super) bodies: LegBodies,
    /// Derived constants that the file states.
    pub(super) derived: Vec<(&'static str, f64)>,
    /// Parameters in the file on which no quantity depends.
    pub(super) unused: Vec<String>,
}

/// The numbers of a section, in the order of its keys.
pub(super) struct Numbers {
    keys: &'static [Key],
    values: Vec<Vec<f64>>,
}

impl Numbers {
    /// The numbers of a key of the section.
    pub(super) fn get(&self, name: &str) -> &[f64] {
        let found = self.keys.iter().position(|k| k.name == name);
        found.map_or(&[], |i| &self.values[i])
    }

    /// The same, as an array; zeros if the section has no such key.
    pub(super) fn array<const N: usize>(&self, name: &str) -> [f64; N] {
        let values = self.get(name);
        std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
    }
}

/// One state.
pub(super) struct Case {
    pub(super) id: u64,
    pub(super) gravity: [f64; 3],
    pub(super) sections: Vec<Numbers>,
}

/// A whole file.
pub(super) struct VectorFile {
    pub(super) seed: u64,
    pub(super) params: Params,
    pub(super) cases: Vec<Case>,
}

/// Reads a file by the schema.
pub(super) fn read(file: &str, value: &Value) -> Result<VectorFile, VectorsError> {
    let problems = RefCell::new(Vec::<Problem>::new());
    let root = Node::root(value, &problems);
    let keys = ["schema", "seed", "units", "params", "cases"];
    root.keys(&keys, &keys);
    if let Some(schema) = root.get("schema") {
        schema.exactly(SCHEMA);
    }
    if let Some(units) = root.get("units") {
        units.exactly(UNITS);
    }
    let seed = root.get("seed").map_or(0, |n| n.whole());
    let params = root.get("params").map(|node| params(&node));
    let cases: Vec<Case> = root.get("cases").map_or_else(Vec::new, |node| {
        let elements = node.elements();
        if value["cases"].is_array() && elements.is_empty() {
            node.refuse("at least one case: a file without cases shows nothing");
        }
        elements.iter().map(case).collect()
    });
    let problems = problems.into_inner();
    match params {
        Some(params) if problems.is_empty() => Ok(VectorFile {
            seed,
            params,
            cases,
        }),
        _ => Err(VectorsError::malformed(file, problems)),
    }
}

fn case(node: &Node<'_>) -> Case {
    let mut keys = vec!["id", "gravity"];
    keys.extend(SECTIONS.iter().map(|s| s.name));
    node.keys(&keys, &keys);
    Case {
        id: node.get("id").map_or(0, |n| n.whole()),
        gravity: node.get("gravity").map_or([0.0; 3], |n| n.array()),
        sections: SECTIONS
            .iter()
            .map(|section| numbers(node.get(section.name), section))
            .collect(),
    }
}

fn numbers(node: Option<Node<'_>>, section: &Section) -> Numbers {
    let names: Vec<&str> = section.keys.iter().map(|k| k.name).collect();
    if let Some(node) = &node {
        node.keys(&names, &names);
    }
    let values = section
        .keys
        .iter()
        .map(|key| {
            let array = node.as_ref().and_then(|n| n.get(key.name));
            array.map_or_else(Vec::new, |a| a.numbers(key.rows, key.columns))
        })
        .collect();
    Numbers {
        keys: section.keys,
        values,
    }
}

fn params(node: &Node<'_>) -> Params {
    let mut known: Vec<&str> = REQUIRED.to_vec();
    known.extend(DERIVED);
    known.extend(UNUSED);
    known.push(UNUSED_VECTOR);
    node.keys(&known, &REQUIRED);
    let positive = |key: &str| {
        let child = node.get(key);
        child.map_or(1.0, |n| n.number_that("a number above 0", |v| v > 0.0))
    };
    let not_negative = |key: &str| {
        let child = node.get(key);
        child.map_or(0.0, |n| n.number_that("a number from 0", |v| v >= 0.0))
    };
    let p4_m: [f64; 2] = node.get("p4").map_or([0.0; 2], |n| n.array());
    let crank_m = positive("crank");
    if let Some(crank) = node.get("crank").filter(|_| node.get("p4").is_some()) {
        let reach = p4_m[0].hypot(p4_m[1]);
        crank.number_that(&format!("a crank shorter than |p4| = {reach} m"), |c| {
            c < reach
        });
    }
    let mut unused = Vec::new();
    for key in UNUSED {
        if let Some(child) = node.get(key) {
            child.number();
            unused.push(key.to_owned());
        }
    }
    if let Some(child) = node.get(UNUSED_VECTOR) {
        child.array::<3>();
        unused.push(UNUSED_VECTOR.to_owned());
    }
    Params {
        crank_m,
        p4_m,
        viscous_n_s_m: node.get("viscous").map_or([0.0; 3], |n| n.array()),
        chassis_mass_kg: positive("chassis_mass"),
        wheel_mass_kg: positive("wheel_mass"),
        wheel_radius_m: positive("wheel_radius"),
        wheel_inertia_kg_m2: not_negative("wheel_inertia"),
        rotor_inertia_kg_m2: not_negative("rotor_inertia"),
        gear_motor: positive("gear_motor"),
        gear_chain: positive("gear_chain"),
        wheel_viscous_n_s_m: not_negative("wheel_viscous"),
        bodies: bodies(node.get("bodies")),
        derived: DERIVED
            .into_iter()
            .filter_map(|key| Some((key, node.get(key)?.number())))
            .collect(),
        unused,
    }
}

fn bodies(node: Option<Node<'_>>) -> LegBodies {
    let mut out = [BodyParams {
        mass_kg: 1.0,
        com_m: [0.0; 3],
        inertia_kg_m2: [0.0; 3],
    }; 6];
    let Some(node) = node else { return out };
    let elements = node.elements();
    if !elements.is_empty() && elements.len() != out.len() {
        node.refuse(format!("six bodies, not {}", elements.len()));
    }
    for (body, element) in out.iter_mut().zip(&elements) {
        let keys = ["m", "com", "inertia_diag"];
        element.keys(&keys, &keys);
        if let Some(m) = element.get("m") {
            body.mass_kg = m.number_that("a number above 0", |v| v > 0.0);
        }
        body.com_m = element.get("com").map_or([0.0; 3], |n| n.array());
        if let Some(inertia) = element.get("inertia_diag") {
            body.inertia_kg_m2 = inertia.array();
            if body.inertia_kg_m2.iter().any(|v| *v < 0.0) {
                inertia.refuse("three numbers from 0");
            }
        }
    }
    out
}
