//! What the boards of a robot are told of its cylinders that is far from so.
//!
//! A robot's file says what a cylinder is, and beside it, in `[node.*]`, what its board believes. They may
//! differ: a study of wrong data needs that. Where a robot does not get ready, this is where to look first.

use wheeleg_plant::axis::AxisParams;
use wheeleg_protocol::Node;
use wheeleg_protocol::param::JointParam;

use crate::RobotConfig;
use crate::board_value::{in_unit, stored_raw};
use crate::derived::DERIVED;
use crate::quantity::{brief, suffix};

/// By this factor a board's value may be off before it is worth a word.
const FAR: f64 = 1.5;

/// What decides how the air moves a piston.
const TOLD: [JointParam; 8] = [
    JointParam::ValveOn,
    JointParam::ValveOff,
    JointParam::Bore,
    JointParam::Rod,
    JointParam::DeadVolumeA,
    JointParam::DeadVolumeB,
    JointParam::Conductance,
    JointParam::SupplyPressure,
];

impl RobotConfig {
    /// A cylinder of the robot on a bench, by the index of its joint from 0: it begins vented, rod in.
    #[must_use]
    pub fn axis(&self, joint: usize, moving_mass_kg: f64, load_n: f64) -> AxisParams {
        let plant = &self.plant;
        let mut cylinder = plant.cylinders[joint].clone();
        // A bench begins vented; pressures come from the moves.
        cylinder.initial_pressure_a_pa = plant.gas.ambient_pressure_pa;
        cylinder.initial_pressure_b_pa = plant.gas.ambient_pressure_pa;
        AxisParams {
            gas: plant.gas,
            supply: plant.supply,
            cylinder,
            moving_mass_kg,
            load_n,
            initial_stroke_m: 0.0,
            potentiometer: plant.potentiometers[joint],
            adc: plant.adc,
            step_ns: plant.step_ns,
        }
    }

    /// Each parameter of any joint's board that is far from what its cylinder is, once, in words:
    /// `node.*.conductance` = … where `fill_valve.conductance`, … say ….
    #[must_use]
    pub fn told_otherwise(&self) -> Vec<String> {
        let axes = Node::JOINTS.map(|node| self.axis(node.index(), 1.0, 0.0));
        let mut all = Vec::new();
        for row in DERIVED.iter().filter(|row| TOLD.contains(&row.parameter)) {
            let info = row.parameter.info();
            let mut joints = axes.iter().zip(&self.node.joints);
            let off = joints.find_map(|(axis, stored)| {
                let told = in_unit(info, stored_raw(info, stored));
                let is = row.value(axis);
                let far = told > is * FAR || told * FAR < is;
                far.then_some((told, is))
            });
            let Some((told, is)) = off else {
                continue;
            };
            let unit = suffix(info.unit);
            let fields: Vec<String> = row
                .fields
                .iter()
                .map(|field| format!("`{field}`"))
                .collect();
            all.push(format!(
                "`node.*.{}` = {}{unit} where {} say {}{unit}",
                info.name,
                brief(told),
                fields.join(" and "),
                brief(is)
            ));
        }
        all
    }
}
