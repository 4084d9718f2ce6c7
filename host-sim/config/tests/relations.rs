//! Fields that contradict each other are reported like single fields: for every entry of the table of
//! relations, a file that is sound except for one value breaks it, and another value just satisfies it.

mod common;
#[path = "common/values.rs"]
mod values;

use std::collections::BTreeMap;
use std::panic::catch_unwind;

use common::{assert_all, report};
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use values::{SHORT, with};
use wheeleg_config::{
    Advised, AxisConfig, ConfigError, ParameterInfo, Problem, RELATIONS, Relation, RobotConfig,
};

const ROBOT: &str = include_str!("../../robots/wheeleg-2003.toml");
const WALKER: &str = include_str!("../../robots/wheeleg.toml");
const AXIS: &str = include_str!("../../axes/bench-vq110u.toml");

/// A path, its value as written, and its unit.
type Set = (&'static str, &'static str, &'static str);

/// A value that breaks a relation, and one for which it holds.
struct Example {
    relation: &'static str,
    file: &'static str,
    /// Other values of the file.
    beside: &'static [Set],
    /// The field, its value as written, with `{}` for the number, and its unit.
    field: Set,
    broken: f64,
    sound: f64,
    /// Fields, or sets of fields that work together, that are advised at `broken`; none where the limit is
    /// given in words.
    advised: &'static [&'static str],
}

const fn example(
    relation: &'static str,
    file: &'static str,
    beside: &'static [Set],
    field: Set,
    [broken, sound]: [f64; 2],
    advised: &'static [&'static str],
) -> Example {
    Example {
        relation,
        file,
        beside,
        field,
        broken,
        sound,
        advised,
    }
}

/// Little air, and the hardest possible end stop.
const TIGHT_A: &[Set] = &[
    ("line.volume", "0.0", "cm3"),
    ("end_stop.stiffness", "10000.0", "N/mm"),
    ("fill_valve.conductance", "1.0", "dm3/(s bar)"),
    ("line.conductance", "1.0", "dm3/(s bar)"),
    ("cylinder.dead_volume_b", "20.0", "cm3"),
];
const TIGHT_B: &[Set] = &[
    TIGHT_A[0],
    TIGHT_A[1],
    TIGHT_A[2],
    TIGHT_A[3],
    ("cylinder.dead_volume_a", "20.0", "cm3"),
];
const SOFT_STOP: &[Set] = &[
    ("end_stop.stiffness", "15.0", "N/mm"),
    ("end_stop.damping", "0.0", "s/m"),
    ("end_stop.cushion_damping", "0.0", "N s/m"),
    ("cylinder.dead_volume_a", "20.0", "cm3"),
    ("cylinder.dead_volume_b", "20.0", "cm3"),
];
/// A chassis far ahead, large enough for a large mass.
const HEAVY: &[Set] = &[
    ("body.chassis_com", "[0.3, 0.02]", "m"),
    ("spatial.chassis_roll_inertia", "10.0", "kg m2"),
    ("body.chassis_pitch_inertia", "10.0", "kg m2"),
    ("spatial.chassis_yaw_inertia", "10.0", "kg m2"),
];
/// Room for a piston that runs deep into a soft stop.
const ROOMY: &[Set] = &[
    ("cylinder.dead_volume_a", "20.0", "cm3"),
    ("cylinder.dead_volume_b", "20.0", "cm3"),
];
const SOFT_ROBOT: &[Set] = &[
    SOFT_STOP[0],
    SOFT_STOP[1],
    SOFT_STOP[2],
    SOFT_STOP[3],
    SOFT_STOP[4],
    ("contact.bristle_damping", "10.0", "N s/m"),
];
const SHORT_STEP: &[Set] = &[
    ("line.volume", "0.0", "cm3"),
    ("numerics.step", "1.0", "us"),
];
/// A push that takes almost no time in a long step.
const QUICK_PUSH: &[Set] = &[
    ("gait.period", "30.0", "s"),
    ("gait.stroke", "1.0", "mm"),
    ("gait.push_speed", "0.4", "m/s"),
    ("gait.push_acceleration", "5.0", "m/s2"),
    ("motor.reduction", "100.0", "1"),
];
/// Boards that press a piston against its stop.
const PRESSING: &[Set] = &[
    ("node.joint.law", "5", "1"),
    ("node.joint.precharge", "3.0", "bar"),
];
const SMALL_RESERVOIR: &[Set] = &[("supply.reservoir", "10.0", "cm3")];

#[rustfmt::skip]
const EXAMPLES: &[Example] = &[
    example("hysteresis of the supply's contact", AXIS, &[], ("supply.switch_off", "{}", "Pa"), [551_326.0, 551_325.0], &["supply.switch_off", "supply.switch_on"]),
    example("supply's contact", AXIS, &[], ("supply.switch_on", "{}", "Pa"), [701_325.0, 701_324.0], &["supply.switch_on", "supply.set_pressure"]),
    example("hysteresis of the source's contact", ROBOT, &[], ("source_switch.off", "{}", "Pa"), [821_326.0, 821_325.0], &["source_switch.off", "source_switch.on"]),
    example("source's contact", ROBOT, &[], ("source_switch.on", "{}", "bar"), [11.01326, 11.01325], &["source_switch.on", "supply.source_pressure"]),
    example("regulator", AXIS, &[], ("supply.set_pressure", "{}", "bar"), [11.01326, 11.01325], &["supply.set_pressure", "supply.source_pressure"]),
    example("filled reservoir", ROBOT, &[], ("supply.initial_pressure", "{}", "bar"), [11.01326, 11.01325], &["supply.initial_pressure", "supply.source_pressure"]),
    example("droop", AXIS, &[], ("supply.droop", "{}", "bar"), [6.0, 5.9999], &["supply.droop", "supply.set_pressure"]),
    example("trapped air A", AXIS, &[], ("start.pressure_a", "{}", "Pa"), [701_326.0, 701_325.0], &["start.pressure_a", "supply.set_pressure"]),
    example("trapped air B", AXIS, &[], ("start.pressure_b", "{}", "Pa"), [701_326.0, 701_325.0], &["start.pressure_b", "supply.set_pressure"]),
    example("trapped air A, yaw", ROBOT, &[], ("start.yaw.pressure_a", "{}", "Pa"), [701_326.0, 701_325.0], &["start.yaw.pressure_a", "supply.set_pressure"]),
    example("trapped air B, yaw", ROBOT, &[], ("start.yaw.pressure_b", "{}", "Pa"), [701_326.0, 701_325.0], &["start.yaw.pressure_b", "supply.set_pressure"]),
    example("trapped air A, horizontal", ROBOT, &[], ("start.horizontal.pressure_a", "{}", "Pa"), [701_326.0, 701_325.0], &["start.horizontal.pressure_a", "supply.set_pressure"]),
    example("trapped air B, horizontal", ROBOT, &[], ("start.horizontal.pressure_b", "{}", "Pa"), [701_326.0, 701_325.0], &["start.horizontal.pressure_b", "supply.set_pressure"]),
    example("trapped air A, vertical", ROBOT, &[], ("start.vertical.pressure_a", "{}", "Pa"), [701_326.0, 701_325.0], &["start.vertical.pressure_a", "supply.set_pressure"]),
    example("trapped air B, vertical", ROBOT, &[], ("start.vertical.pressure_b", "{}", "Pa"), [701_326.0, 701_325.0], &["start.vertical.pressure_b", "supply.set_pressure"]),
    example("density of the gas", AXIS, &[], ("gas.reference_density", "{}", "kg/m3"), [0.3, 1.185], &["gas.reference_density", "gas.gas_constant"]),
    example("exponent", AXIS, &[], ("cylinder.exponent", "{}", "1"), [1.401, 1.4], &["cylinder.exponent", "gas.heat_capacity_ratio"]),
    example("rod", AXIS, &[], ("cylinder.rod", "{}", "mm"), [18.001, 18.0], &["cylinder.rod", "cylinder.bore"]),
    example("cushion", AXIS, &[("cylinder.stroke", "45.0", "mm")], ("end_stop.cushion_length", "{}", "mm"), [45.001, 45.0], &["end_stop.cushion_length", "cylinder.stroke"]),
    example("break-away", AXIS, &[], ("friction.static", "{}", "N"), [9.999, 10.0], &["friction.static", "friction.coulomb"]),
    example("start", AXIS, &[], ("start.stroke", "{}", "mm"), [180.001, 180.0], &["start.stroke", "cylinder.stroke"]),
    example("start, yaw", ROBOT, SHORT, ("start.yaw.stroke", "{}", "mm"), [90.001, 90.0], &["start.yaw.stroke", "cylinder.stroke"]),
    example("start, horizontal", ROBOT, SHORT, ("start.horizontal.stroke", "{}", "mm"), [90.001, 90.0], &["start.horizontal.stroke", "cylinder.stroke"]),
    example("start, vertical", ROBOT, SHORT, ("start.vertical.stroke", "{}", "mm"), [90.001, 90.0], &["start.vertical.stroke", "cylinder.stroke"]),
    example("track of the sensor", AXIS, &[], ("sensor.potentiometer.electrical_stroke", "{}", "mm"), [180.0, 200.0], &["sensor.potentiometer.electrical_stroke", "cylinder.stroke"]),
    example("begin of the sensor", AXIS, &[], ("sensor.potentiometer.offset", "{}", "mm"), [1.999, 2.0], &["sensor.potentiometer.offset", "sensor.potentiometer.electrical_stroke"]),
    example("step and friction", AXIS, SOFT_STOP, ("moving.mass", "{}", "kg"), [0.054_24, 0.054_29], &["numerics.step", "moving.mass"]),
    example("step and friction, robot", ROBOT, SOFT_ROBOT, ("link.vertical_rod.mass", "{}", "kg"), [0.054_24, 0.054_29], &["numerics.step", "link.vertical_rod.mass"]),
    example("step and end stop", AXIS, &[], ("moving.mass", "{}", "kg"), [0.07, 1.5], &["numerics.step", "moving.mass"]),
    example("step and end stop, robot", ROBOT, &[], ("link.vertical_rod.mass", "{}", "kg"), [0.07, 0.8], &["numerics.step", "link.vertical_rod.mass"]),
    example("step and air A", AXIS, TIGHT_A, ("cylinder.dead_volume_a", "{}", "cm3"), [0.06, 4.0], &["numerics.step", "cylinder.dead_volume_a"]),
    example("step and air B", AXIS, TIGHT_B, ("cylinder.dead_volume_b", "{}", "cm3"), [0.06, 4.0], &["numerics.step", "cylinder.dead_volume_b"]),
    example("step and supply", AXIS, SMALL_RESERVOIR, ("regulator.conductance", "{}", "dm3/(s bar)"), [900.0, 1.0], &["supply.reservoir"]),
    example("depth of the stop", AXIS, ROOMY, ("end_stop.stiffness", "{}", "N/mm"), [14.0, 15.0], &["end_stop.stiffness"]),
    example("air in the stop A", AXIS, SHORT_STEP, ("cylinder.dead_volume_a", "{}", "cm3"), [0.06, 1.0], &["cylinder.dead_volume_a", "end_stop.stiffness"]),
    example("air in the stop B", AXIS, SHORT_STEP, ("cylinder.dead_volume_b", "{}", "cm3"), [0.06, 1.0], &["cylinder.dead_volume_b", "end_stop.stiffness"]),
    example("settling in time", ROBOT, &[], ("homing.timeout", "{}", "s"), [0.3, 0.300_1], &["homing.timeout", "homing.settle"]),
    example("ready in time", ROBOT, &[], ("start_up.limit", "{}", "s"), [1.3, 1.300_1], &["start_up.limit", "start_up.rest", "homing.settle"]),
    example("returning load", ROBOT, &[], ("reference.reload_start", "{}", "s"), [2.0, 1.999], &["reference.reload_start", "reference.reload_end"]),
    example("stroke of the gait", ROBOT, &[("cylinder.stroke", "175.0", "mm"), ("gait.held_leg_s6", "175.0", "mm"), ("start.vertical.stroke", "175.0", "mm")], ("gait.stroke", "{}", "mm"), [175.001, 175.0], &["gait.stroke", "cylinder.stroke"]),
    example("held leg, forward", ROBOT, SHORT, ("gait.held_leg_s5", "{}", "mm"), [90.001, 90.0], &["gait.held_leg_s5", "cylinder.stroke"]),
    example("held leg, down", ROBOT, SHORT, ("gait.held_leg_s6", "{}", "mm"), [90.001, 90.0], &["gait.held_leg_s6", "cylinder.stroke"]),
    example("yaw of the gait", ROBOT, SHORT, ("gait.yaw_s2", "{}", "mm"), [90.001, 90.0], &["gait.yaw_s2", "cylinder.stroke"]),
    example("lift before reach", ROBOT, &[], ("gait.lift", "{}", "s"), [0.5, 0.499], &["gait.reach", "gait.lift"]),
    example("lift before lower", ROBOT, &[("gait.reach", "1.5", "s")], ("gait.lift", "{}", "s"), [1.0, 0.999], &["gait.lower", "gait.lift"]),
    example("reach before push", ROBOT, &[], ("gait.reach", "{}", "s"), [2.0, 1.999], &["gait.push", "gait.reach"]),
    example("lower before push", ROBOT, &[], ("gait.lower", "{}", "s"), [2.0, 1.999], &["gait.push", "gait.lower"]),
    example("push before the end", ROBOT, QUICK_PUSH, ("gait.push", "{}", "s"), [30.0, 29.971], &["gait.period", "gait.push"]),
    example("time to touch down", ROBOT, &[], ("gait.touchdown_speed", "{}", "mm/s"), [15.0, 15.02], &["gait.touchdown_speed", "gait.touchdown_speed", "gait.push", "gait.lower"]),
    example("time to push", ROBOT, &[], ("gait.push_speed", "{}", "m/s"), [0.1, 0.18], &["gait.period", "gait.push", "gait.push_speed"]),
    example("current of a motor", ROBOT, &[], ("motor.resistance", "{}", "ohm"), [0.01, 1.2], &["motor.resistance"]),
    example("friction of a motor", ROBOT, &[], ("motor.friction", "{}", "mN m"), [300.0, 1.0], &["motor.friction", "motor.supply", "motor.torque_constant", "motor.resistance"]),
    example("speed of the wheels", ROBOT, &[], ("motor.reduction", "{}", "1"), [2000.0, 260.0], &["motor.supply", "motor.torque_constant", "motor.reduction"]),
    example("inertias of the chassis", ROBOT, &[], ("spatial.chassis_roll_inertia", "{}", "kg m2"), [0.1, 0.2], &[]),
    example("inertias of a wheel", ROBOT, &[], ("spatial.wheel_transverse_inertia", "{}", "kg m2"), [0.008, 0.0081], &[]),
    example("inertias of the yaw barrel", ROBOT, &[], ("link.yaw_barrel.inertia", "[{}, 1e-3, 1e-3]", "kg m2"), [2.001e-3, 2e-3], &[]),
    example("inertias of the yaw rod", ROBOT, &[], ("link.yaw_rod.inertia", "[1e-3, {}, 1e-3]", "kg m2"), [2.001e-3, 2e-3], &[]),
    example("inertias of the crank", ROBOT, &[], ("link.crank.inertia", "[1e-3, 1e-3, {}]", "kg m2"), [2.001e-3, 2e-3], &[]),
    example("inertias of the yaw carriage", ROBOT, &[], ("link.yaw_carriage.inertia", "[1e-3, {}, 1e-3]", "kg m2"), [2.001e-3, 2e-3], &[]),
    example("inertias of the horizontal carriage", ROBOT, &[], ("link.horizontal_carriage.inertia", "[{}, 1e-3, 1e-3]", "kg m2"), [2.001e-3, 2e-3], &[]),
    example("inertias of the vertical rod", ROBOT, &[], ("link.vertical_rod.inertia", "[1e-3, 1e-3, {}]", "kg m2"), [2.001e-3, 2e-3], &[]),
    example("size of the chassis", ROBOT, &[("body.chassis_pitch_inertia", "0.6", "kg m2"), ("spatial.chassis_yaw_inertia", "0.6", "kg m2")], ("spatial.chassis_roll_inertia", "{}", "kg m2"), [1e-3, 0.2], &[]),
    example("size of a wheel", ROBOT, &[], ("body.wheel_inertia", "{}", "kg m2"), [1e-5, 0.01], &[]),
    example("size of the yaw barrel", ROBOT, &[], ("link.yaw_barrel.inertia", "[{}, 1e-3, 1e-3]", "kg m2"), [1e-7, 1e-3], &[]),
    example("size of the yaw rod", ROBOT, &[], ("link.yaw_rod.inertia", "[1e-3, {}, 1e-3]", "kg m2"), [1e-7, 1e-3], &[]),
    example("size of the crank", ROBOT, &[], ("link.crank.inertia", "[1e-3, 1e-3, {}]", "kg m2"), [1e-7, 1e-3], &[]),
    example("size of the yaw carriage", ROBOT, &[], ("link.yaw_carriage.inertia", "[1e-3, {}, 1e-3]", "kg m2"), [1e-7, 1e-3], &[]),
    example("size of the horizontal carriage", ROBOT, &[], ("link.horizontal_carriage.inertia", "[{}, 1e-3, 1e-3]", "kg m2"), [1e-7, 1e-3], &[]),
    example("size of the vertical rod", ROBOT, &[], ("link.vertical_rod.inertia", "[1e-3, 1e-3, {}]", "kg m2"), [1e-7, 1e-3], &[]),
    example("friction of a sole", ROBOT, &[], ("contact.mu_kinetic", "{}", "1"), [0.801, 0.8], &["contact.mu_kinetic", "contact.mu_static"]),
    example("friction of a wheel", ROBOT, &[], ("wheel_contact.mu_kinetic", "{}", "1"), [0.801, 0.8], &["wheel_contact.mu_kinetic", "wheel_contact.mu_static"]),
    example("friction of the chassis", ROBOT, &[], ("chassis_contact.mu_kinetic", "{}", "1"), [0.401, 0.4], &["chassis_contact.mu_kinetic", "chassis_contact.mu_static"]),
    example("spheres of a sole", ROBOT, &[], ("contact.sphere_radius", "{}", "mm"), [30.01, 30.0], &["contact.sphere_radius", "contact.sole_radius"]),
    example("corners of the chassis", ROBOT, &[], ("chassis_contact.from", "[-0.433, -0.2, {}]", "m"), [0.120_1, 0.12], &[]),
    example("belly above the ground", ROBOT, &[], ("chassis_contact.from", "[-0.433, -0.2, {}]", "m"), [-0.15, -0.149_9], &[]),
    example("chassis between the wheels", ROBOT, &[], ("chassis_contact.to", "[0.167, {}, 0.12]", "m"), [0.255_1, 0.255], &["spatial.track", "spatial.wheel_width"]),
    example("drawn chassis between the wheels", ROBOT, &[], ("spatial.chassis_size", "[0.6, {}, 0.2]", "m"), [0.510_1, 0.51], &["spatial.track", "spatial.wheel_width"]),
    example("hips between the wheels", ROBOT, &[], ("body.o4", "[0.60, {}, 0.15]", "m"), [0.2801, 0.20], &["spatial.track"]),
    example("ground below", ROBOT, &[], ("body.gravity", "[0.0, 0.0, {}]", "m/s2"), [9.81, -9.81], &[]),
    example("codes of the sensor", ROBOT, &[], ("node.joint.sensor_code_max", "{}", "code"), [62_380.0, 62_400.0], &["sensor.adc.noise", "node.joint.sensor_code_max", "sensor.potentiometer.electrical_stroke", "sensor.potentiometer.offset"]),
    example("calibration", ROBOT, &[("homing.tolerance", "10.0", "mm")], ("node.joint.sensor_full_scale", "{}", "mm"), [206.0, 200.0], &["node.joint.sensor_full_scale + node.joint.sensor_zero"]),
    example("measured stroke", ROBOT, &[], ("node.joint.sensor_full_scale", "{}", "mm"), [190.0, 200.0], &["node.joint.sensor_full_scale + node.joint.sensor_zero"]),
    example("steps of the converter", ROBOT, &[], ("node.joint.settle_band", "{}", "mm"), [0.1, 0.5], &["sensor.adc.bits", "node.joint.settle_band"]),
    example("stop of a joint", ROBOT, PRESSING, ("node.joint.stroke_max", "{}", "mm"), [178.0, 178.6], &["node.joint.stroke_max", "gait.stroke"]),
    example("reach of the yaw boards", WALKER, &[], ("node.yaw.stroke_max", "{}", "mm"), [86.9, 87.1], &["node.yaw.stroke_max"]),
    example("reach of the horizontal boards", WALKER, &[], ("node.horizontal.stroke_min", "{}", "mm"), [3.1, 2.9], &["node.horizontal.stroke_min"]),
    example("reach of the vertical boards", WALKER, &[("node.joint.precharge", "0.0", "bar")], ("node.vertical.stroke_max", "{}", "mm"), [150.0, 178.0], &["node.vertical.stroke_max"]),
    example("speed of the yaw boards", WALKER, &[], ("node.yaw.sensor_rate", "{}", "mm/s"), [249.9, 250.0], &["node.yaw.sensor_rate", "node.joint.slew_rate"]),
    example("speed of the horizontal boards", WALKER, &[], ("node.horizontal.sensor_rate", "{}", "mm/s"), [349.9, 350.0], &["node.horizontal.sensor_rate", "node.horizontal.slew_rate"]),
    example("speed of the vertical boards", WALKER, &[], ("node.vertical.sensor_rate", "{}", "mm/s"), [249.9, 250.0], &["node.vertical.sensor_rate", "node.joint.slew_rate"]),
    example("samples of the wheel boards", ROBOT, &[], ("node.wheel.sample_timer", "{}", "16 clocks"), [14.0, 15.0], &["node.wheel.sample_timer"]),
    example("board's full scale", AXIS, &[("sensor.potentiometer.electrical_stroke", "1800.0", "mm"), ("sensor.potentiometer.offset", "20.0", "mm"), ("sensor.adc.bits", "16", "bit")], ("sensor.potentiometer.gain", "{}", "1"), [0.899, 0.9], &["sensor.potentiometer.electrical_stroke", "sensor.potentiometer.gain"]),
    example("board's volume A", AXIS, &[], ("cylinder.dead_volume_a", "{}", "cm3"), [499.0, 400.0], &["cylinder.dead_volume_a", "line.volume"]),
    example("board's volume B", AXIS, &[], ("cylinder.dead_volume_b", "{}", "cm3"), [499.0, 400.0], &["cylinder.dead_volume_b", "line.volume"]),
    example("board's conductance", AXIS, &[], ("fill_valve.conductance", "{}", "dm3/(s bar)"), [0.004_9, 0.005_1], &[]),
    example("board's band of rest", AXIS, &[("sensor.adc.bits", "8", "bit"), ("sensor.potentiometer.offset", "7.0", "mm")], ("sensor.potentiometer.electrical_stroke", "{}", "mm"), [512.01, 512.0], &[]),
    example("closed leg", ROBOT, &[], ("body.crank", "{}", "m"), [1.9, 0.29], &["body.crank"]),
    example("stiffness of the wheels", ROBOT, &[], ("wheel_contact.stiffness", "{}", "N/mm"), [0.06, 60.0], &["wheel_contact.stiffness"]),
    example("stiffness of the soles", ROBOT, &[], ("contact.stiffness", "{}", "N/mm"), [0.02, 20.0], &["contact.stiffness"]),
    example("feet ahead of the wheels", ROBOT, &[], ("body.o4", "[{}, 0.20, 0.15]", "m"), [-0.6, 0.6], &[]),
    example("standing", ROBOT, &[], ("body.chassis_com", "[{}, 0.02]", "m"), [-0.5, -0.133], &[]),
    example("carried by its air", ROBOT, HEAVY, ("body.chassis_mass", "{}", "kg"), [300.0, 15.4], &[]),
];

impl Example {
    fn text(&self, value: f64) -> String {
        let (path, pattern, unit) = self.field;
        let mut text = self.file.to_owned();
        for (path, value, unit) in self.beside {
            text = with(&text, path, value, unit);
        }
        with(
            &text,
            path,
            &pattern.replace("{}", &format!("{value:?}")),
            unit,
        )
    }

    fn read(&self, value: f64) -> Result<(), ConfigError> {
        let text = self.text(value);
        match self.file {
            AXIS => AxisConfig::parse("my.toml", &text).map(drop),
            _ => RobotConfig::parse("my.toml", &text).map(drop),
        }
    }
}

/// Line of a field of a file, from 1.
fn line(text: &str, path: &str) -> Option<usize> {
    let (section, key) = path.rsplit_once('.').expect("a section and a key");
    let begin = text.find(&format!("\n[{section}]\n"))?;
    let before = text[..begin].matches('\n').count() + 2;
    let lines = text[begin + 1..].lines().enumerate().skip(1);
    let mut own = lines.take_while(|(_, line)| !line.starts_with('['));
    own.find(|(_, line)| line.split('=').next().map(str::trim) == Some(key))
        .map(|(at, _)| before + at)
}

/// Only this relation is reported: with its place, every field with its value and line, and the allowed
/// values.
fn ensure_told(relation: &Relation, example: &Example, value: f64, error: &ConfigError) {
    let (name, text, said) = (relation.name, example.text(value), report(error));
    let broken: Vec<_> = error.problems().iter().map(Problem::relation).collect();
    assert_eq!(broken, [Some(name)], "{name} at {value}: {said}");
    assert!(said.contains(relation.broken), "{name} at {value}: {said}");
    let first = relation.fields.iter().find_map(|field| line(&text, field));
    let place = format!("my.toml:{}: ", first.expect("a field of the file"));
    assert!(said.starts_with(&place), "{name}, not at {place}: {said}");
    for field in relation.fields {
        let listed = match line(&text, field) {
            Some(line) => format!(" (line {line})"),
            // A board's parameter may be left at its default.
            None if field.starts_with("node.joint.") || field.starts_with("node.wheel.") => {
                String::new()
            }
            None => continue,
        };
        let (_, after) = said
            .split_once(&format!("`{field}` = "))
            .unwrap_or_else(|| panic!("{name}: no value of {field}: {said}"));
        assert!(after.contains(&listed), "{name}, {field}{listed}: {said}");
    }
    assert!(said.contains("allowed"), "{name}: {said}");
    assert!(said.len() < 1500, "{name}: {said}");
}

/// The advised fields are those that can mend the example, and no others.
fn ensure_advised(relation: &Relation, example: &Example, error: &ConfigError) {
    let paths = |set: &Vec<Advised>| {
        let each: Vec<&str> = set.iter().map(|advised| advised.path.as_str()).collect();
        each.join(" + ")
    };
    let advised: Vec<String> = error.problems()[0].advice().iter().map(paths).collect();
    assert_eq!(
        advised,
        example.advised,
        "{}: {}",
        relation.name,
        report(error)
    );
}

/// Narrows the example down to where the relation begins to hold: every refusal on the way is only for this
/// relation.
fn ensure_held(relation: &Relation, example: &Example) {
    let name = relation.name;
    let (mut broken, mut sound) = (example.broken, example.sound);
    let refused = example.read(broken);
    let error = refused.expect_err(&format!("{name} at {broken} is accepted"));
    ensure_told(relation, example, broken, &error);
    ensure_advised(relation, example, &error);
    if let Err(error) = example.read(sound) {
        panic!("{name} at {sound}: {}", report(&error));
    }
    // A timer counts whole clocks. For values on both sides of 0 the sign matters.
    let near = match example.field.2 {
        "16 clocks" => 1.0,
        _ => 1e-3,
    };
    while broken * sound > 0.0 && (broken - sound).abs() > near * sound.abs() {
        let middle = 0.5 * (broken + sound);
        match example.read(middle) {
            Ok(()) => sound = middle,
            Err(error) => {
                ensure_told(relation, example, middle, &error);
                broken = middle;
            }
        }
    }
    let (field, _, unit) = example.field;
    println!("{name}: {field}, {broken} {unit} is refused, {sound} {unit} accepted");
}

#[test]
fn every_relation_of_the_table_is_refused_where_it_is_broken_and_accepted_where_it_just_holds() {
    let mut examples: BTreeMap<&str, &Example> = BTreeMap::new();
    for example in EXAMPLES {
        let twice = examples.insert(example.relation, example);
        assert!(twice.is_none(), "{} twice", example.relation);
    }
    let mut wrong = Vec::new();
    for relation in RELATIONS {
        let example = examples.remove(relation.name);
        let held = catch_unwind(|| {
            let example = example.expect("an example of each relation, and names that differ");
            ensure_held(relation, example);
        });
        wrong.extend(held.is_err().then_some(relation.name));
    }
    assert!(wrong.is_empty(), "{wrong:?}");
    assert!(examples.is_empty(), "of no relation: {:?}", examples.keys());
}

/// A relation is seen beside an incomplete section, and all broken ones are reported at once.
#[test]
fn relations_are_told_together_and_beside_missing_fields() {
    let text = with(ROBOT, "gait.period", "1.0", "s");
    let flag = text
        .lines()
        .find(|line| line.starts_with("touchdown_reflex"));
    let text = text.replace(flag.expect("present"), "");
    let text = with(&text, "start.yaw.pressure_b", "1375403", "Pa");
    let said = report(&RobotConfig::parse("my.toml", &text).expect_err("wrong"));
    assert_all(
        &said,
        &[
            "[gait] lacks touchdown_reflex",
            "`gait.period` = 1 s",
            "`start.yaw.pressure_b` = 1375403 Pa",
        ],
    );
    assert_eq!(said.lines().count(), 3, "{said}");
}

/// A field outside a relation of the gait does not hide it, whether it is missing or unreadable.
#[test]
fn relations_of_the_gait_are_told_beside_fields_that_cannot_be_read() {
    let slow = with(ROBOT, "gait.touchdown_speed", "10.0", "mm/s");
    let slow = with(&slow, "gait.push_speed", "0.1", "m/s");
    for (key, value, told) in [
        ("steps", "1e9", 3),
        ("held_leg_s5", "\"x\"", 3),
        ("touchdown_reflex", "7", 3),
        // Each of these takes part in one of them.
        ("push_acceleration", "-1.0", 2),
        ("lower", "-1.0", 2),
        // And this in both.
        ("stroke", "-1.0", 1),
    ] {
        let text = with(&slow, &format!("gait.{key}"), value, "1");
        let error = RobotConfig::parse("my.toml", &text).expect_err("wrong");
        assert_eq!(error.problems().len(), told, "{key}: {}", report(&error));
    }
}

/// A body that moves has a size, and the sizes proposed by a refusal are accepted: another integrator refuses
/// a body without inertia.
#[test]
fn no_moving_body_is_without_inertia() {
    for (link, least) in [
        ("crank", 2.81e-5),
        ("vertical_rod", 1.441e-4),
        ("yaw_barrel", 4.54e-5),
    ] {
        let path = format!("link.{link}.inertia");
        let all = |value: f64| {
            with(
                ROBOT,
                &path,
                &format!("[{value:?}, {value:?}, {value:?}]"),
                "kg m2",
            )
        };
        for value in [0.0, 1e-15, 0.5 * least] {
            let error = RobotConfig::parse("my.toml", &all(value)).expect_err(link);
            let [problem] = error.problems() else {
                panic!("{}", report(&error))
            };
            let help = problem.help_text().expect("what is allowed");
            let words = help.split(' ').filter_map(|word| word.parse().ok());
            let told: Vec<f64> = words.collect();
            let [told] = told.as_slice() else {
                panic!("{help}")
            };
            assert!((told / least - 1.0).abs() < 0.01, "{link}: {help}");
            RobotConfig::parse("my.toml", &all(*told)).expect("the value that was told");
        }
    }
    let flat = with(ROBOT, "body.wheel_inertia", "0.0", "kg m2");
    let error = RobotConfig::parse("my.toml", &flat).expect_err("a wheel");
    let relations: Vec<_> = error.problems().iter().map(Problem::relation).collect();
    assert_eq!(relations, [Some("size of a wheel")], "{}", report(&error));
}

/// A sensor that a board reads at the edge of its codes is refused even if only noise takes it beyond, and
/// the proposal leaves room for the noise and for the nonlinearity.
#[test]
fn a_sensor_that_is_proposed_is_within_the_codes_with_its_noise() {
    let text = with(
        ROBOT,
        "sensor.potentiometer.electrical_stroke",
        "192.0",
        "mm",
    );
    let text = with(&text, "node.joint.sensor_full_scale", "192.0", "mm");
    let text = with(&text, "node.joint.sensor_zero", "3413", "code");
    let error = RobotConfig::parse("my.toml", &text).expect_err("too short");
    let [problem] = error.problems() else {
        panic!("{}", report(&error))
    };
    assert_eq!(problem.relation(), Some("codes of the sensor"));
    assert!(!problem.advice().is_empty(), "{}", report(&error));
    // 190 mm are at most 64880 of 65536 codes, with a margin of 129 codes.
    let least = 190.0 / (64_880.0 / 65_536.0 - 0.05e-2 - 6.0 / 4096.0);
    for set in problem.advice() {
        let mut mended = text.clone();
        for Advised { path, value, unit } in set {
            if path == "sensor.potentiometer.electrical_stroke" {
                assert!(
                    (least..least + 0.2).contains(value),
                    "{value} mm, not {least}"
                );
            }
            mended = with(&mended, path, &format!("{value:?}"), unit);
        }
        RobotConfig::parse("my.toml", &mended).expect("accepted");
    }
}

/// A step of 10 mm has no 15 mm to lower slowly: it is judged by its own 10 mm.
#[test]
fn a_short_step_is_judged_by_its_own_way_down() {
    let text = with(ROBOT, "gait.stroke", "10.0", "mm");
    let text = with(&text, "gait.touchdown_speed", "9.9", "mm/s");
    let error = RobotConfig::parse("my.toml", &text).expect_err("too slow");
    let slow = error.problems().iter();
    let mut slow = slow.filter(|problem| problem.relation() == Some("time to touch down"));
    let said = slow.next().expect("told").to_string();
    assert!(said.contains("the last 10 mm take"), "{said}");
    let text = with(&text, "gait.touchdown_speed", "10.1", "mm/s");
    let slow = match RobotConfig::parse("my.toml", &text) {
        Ok(_) => 0,
        Err(error) => {
            let relations = error.problems().iter().map(Problem::relation);
            relations
                .filter(|name| *name == Some("time to touch down"))
                .count()
        }
    };
    assert_eq!(slow, 0);
}

/// Fields that take part in relations.
fn fields_of_relations(listed: &[ParameterInfo]) -> Vec<&ParameterInfo> {
    let related = |p: &&ParameterInfo| {
        let mut fields = RELATIONS.iter().flat_map(|relation| relation.fields);
        p.value.len() == 1 && fields.any(|path| *path == p.path)
    };
    listed.iter().filter(related).collect()
}

/// A file in which one to three related fields are anywhere in their ranges.
fn random_file(rng: &mut Pcg64Mcg, text: &str, fields: &[&ParameterInfo]) -> String {
    let mut changed = text.to_owned();
    for _ in 0..rng.random_range(1..=3) {
        let field = fields[rng.random_range(0..fields.len())];
        let sound = field.value[0];
        // Most values are near the sound one: a distant one is out of range at once.
        let value = match rng.random_range(0..3) {
            0 => field.min + (field.max - field.min) * rng.random::<f64>(),
            _ => sound * 10_f64.powf(rng.random_range(-1.5..1.5)),
        };
        let value = match field.whole {
            true => value.round(),
            false => format!("{value:.4e}").parse().expect("a number"),
        };
        let value = value.clamp(field.min, field.max);
        changed = with(&changed, &field.path, &format!("{value:?}"), &field.unit);
    }
    changed
}

/// The limit for a field equals the printed value of the help, or is up to a thousandth beside it.
fn ensure_printed(help: &str, path: &str, value: f64) {
    let quoted = format!("`{path}`");
    let mut texts = help.split(&quoted).skip(1);
    let printed = |text: &str| {
        let number = text
            .split([' ', ',', ';'])
            .find_map(|word| word.parse::<f64>().ok());
        number.is_some_and(|limit| (limit - value).abs() <= 1.001e-3 * limit.abs())
    };
    assert!(texts.any(printed), "{path} = {value}: {help}");
}

/// For a crank that is too short or too long, an accepted value is proposed, in a few digits.
#[test]
fn a_crank_that_makes_no_leg_is_told_one_that_does() {
    for crank in [0.05, 0.6] {
        let text = with(ROBOT, "body.crank", &format!("{crank:?}"), "m");
        let error = RobotConfig::parse("my.toml", &text).expect_err("no leg");
        let said = report(&error);
        let digits = |word: &str| word.chars().filter(char::is_ascii_digit).count() > 8;
        assert!(!said.split(' ').any(digits), "{said}");
        let [problem] = error.problems() else {
            panic!("{said}")
        };
        assert_eq!(
            first_paths(problem),
            ["body.crank"],
            "{said}: {:?}",
            problem.help_text()
        );
        let Advised { path, value, unit } = &problem.advice()[0][0];
        let mended = with(&text, path, &format!("{value:?}"), unit);
        RobotConfig::parse("my.toml", &mended).expect("accepted");
    }
}

/// The advice of a refusal is accepted, for every relation: with its values in the file the relation holds,
/// and no other one is broken by them; if nothing else was wrong, the file is accepted.
fn ensure_advice_is_accepted(text: &str, read: &dyn Fn(&str) -> Result<(), ConfigError>) -> usize {
    let Err(error) = read(text) else { return 0 };
    let mut tried = 0;
    for problem in error.problems() {
        for set in problem.advice() {
            let mut mended = text.to_owned();
            for Advised { path, value, unit } in set {
                let help = problem.help_text().expect("a help");
                ensure_printed(help, path, *value);
                mended = with(&mended, path, &format!("{value:?}"), unit);
            }
            let told = format!("{set:?} of {problem} ({:?})", problem.help_text());
            let left = match read(&mended) {
                Ok(()) => Vec::new(),
                Err(error) => error.problems().to_vec(),
            };
            let alone = error.problems().len() == 1;
            // The plant is checked once all relations hold: its errors about other fields were there before.
            let by_advice = |p: &&Problem| {
                let said = p.to_string();
                p.relation().is_some() || set.iter().any(|advised| said.contains(&advised.path))
            };
            let left: Vec<&Problem> = left.iter().filter(by_advice).collect();
            assert!(!alone || left.is_empty(), "{told}: {left:?}");
            assert!(left.len() < error.problems().len(), "{told}: {left:?}");
            tried += 1;
        }
    }
    tried
}

#[test]
fn what_a_refusal_proposes_is_accepted_by_every_relation() {
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    let axis = |text: &str| AxisConfig::parse("my.toml", text).map(drop);
    let robot = |text: &str| RobotConfig::parse("my.toml", text).map(drop);
    let mut tried = 0;
    for (_, file, text) in wheeleg_config::axis::AXES {
        let listed = AxisConfig::parse(file, text).expect("built in").parameters;
        let fields = fields_of_relations(&listed);
        for _ in 0..60 {
            let text = random_file(&mut rng, text, &fields);
            tried += ensure_advice_is_accepted(&text, &axis);
        }
    }
    let listed = RobotConfig::parse("robot.toml", ROBOT).expect("built in");
    let fields = fields_of_relations(&listed.parameters);
    for _ in 0..25 {
        let text = random_file(&mut rng, ROBOT, &fields);
        tried += ensure_advice_is_accepted(&text, &robot);
    }
    // And the examples of the table, one by one.
    for example in EXAMPLES {
        let text = example.text(example.broken);
        let read: &dyn Fn(&str) -> Result<(), ConfigError> =
            if example.file == AXIS { &axis } else { &robot };
        tried += ensure_advice_is_accepted(&text, read);
    }
    println!("{tried} values tried");
    assert!(tried > 200, "{tried}");
}

/// Light mass on hard bristles and a hard stop: a step that suits only the bristles would be refused for the
/// stop.
#[test]
fn the_step_that_is_proposed_for_friction_does_for_the_end_stop_too() {
    let text = with(AXIS, "moving.mass", "0.02", "kg");
    let text = with(&text, "friction.bristle_damping", "900.0", "N s/m");
    let error = AxisConfig::parse("my.toml", &text).expect_err("too light");
    let [problem] = error.problems() else {
        panic!("{}", report(&error))
    };
    assert_eq!(problem.relation(), Some("step and friction"), "{problem}");
    let paths = first_paths(problem);
    assert_eq!(
        paths,
        ["numerics.step", "moving.mass"],
        "{}",
        report(&error)
    );
    let Advised { path, value, unit } = &problem.advice()[0][0];
    let mended = with(&text, path, &format!("{value:?}"), unit);
    AxisConfig::parse("my.toml", &mended).expect("accepted with that step");
}

/// The first field of each set of advised values.
fn first_paths(problem: &Problem) -> Vec<&str> {
    let sets = problem.advice().iter();
    sets.map(|set| set[0].path.as_str()).collect()
}

/// Each of two mistakes has its own remedy, though the file with one of them mended is still refused.
#[test]
fn advice_is_given_beside_an_independent_mistake_of_the_whole_robot() {
    let text = with(ROBOT, "body.chassis_com", "[-0.5, 0.02]", "m");
    let alone = RobotConfig::parse("my.toml", &text).expect_err("it does not stand");
    assert_all(&report(&alone), &["the robot does not stand"]);
    let text = with(&text, "gait.reach", "2.0", "s");
    let error = RobotConfig::parse("my.toml", &text).expect_err("both wrong");
    let [problem] = error.problems() else {
        panic!("{}", report(&error))
    };
    let paths = first_paths(problem);
    assert_eq!(paths, ["gait.push", "gait.reach"], "{}", report(&error));
}

/// The slowest push that its range of speed allows has a remedy: a faster one.
#[test]
fn a_push_that_is_far_too_slow_is_told_the_speed_that_does() {
    let text = with(ROBOT, "gait.push_speed", "0.001", "m/s");
    let error = RobotConfig::parse("my.toml", &text).expect_err("too slow");
    let [problem] = error.problems() else {
        panic!("{}", report(&error))
    };
    let paths = first_paths(problem);
    assert_eq!(paths, ["gait.push_speed"], "{}", report(&error));
}

/// With very many errors, the file is not read again and again for advice.
#[test]
fn no_advice_is_looked_for_where_very_much_is_wrong() {
    let advised = |unknown: usize| {
        let text = with(ROBOT, "gait.reach", "2.0", "s");
        let more: String = (0..unknown).map(|i| format!("unknown{i} = 1\n")).collect();
        let error = RobotConfig::parse("my.toml", &(more + &text)).expect_err("wrong");
        let order = error
            .problems()
            .iter()
            .find(|p| p.relation() == Some("reach before push"));
        let order = order.expect("the gait is told of");
        (
            order.advice().len(),
            order.help_text().unwrap_or_default().to_owned(),
        )
    };
    assert_eq!(advised(19).0, 2);
    let (count, help) = advised(20);
    assert_eq!(count, 0, "{help}");
    assert!(help.contains("correct the other errors first"), "{help}");
}

/// Errors that the plant finds itself are reported by field, in the unit of the file.
#[test]
fn what_the_plant_cannot_follow_is_told_in_the_unit_of_the_file() {
    let text = with(ROBOT, "contact.stiffness", "1000000.0", "N/mm");
    let said = report(&RobotConfig::parse("my.toml", &text).expect_err("wrong"));
    assert_all(
        &said,
        &[
            "`contact.stiffness` = 1000000 N/mm (line ",
            "`numerics.step` = ",
            "`link.vertical_rod.mass` = ",
            "is too much",
            "step of this file: 0.001 to ",
        ],
    );
    assert!(said.trim_end().ends_with(" N/mm"), "{said}");
}

/// Each limit advised for a stroke that is too long is accepted unchanged, and so is the sensor that measures
/// it.
#[test]
fn a_stroke_that_is_advised_is_accepted() {
    for stroke_mm in ["184.8", "185.0", "187.0", "188.0", "200.0"] {
        let text = with(ROBOT, "cylinder.stroke", stroke_mm, "mm");
        let error = RobotConfig::parse("my.toml", &text).expect_err("too long");
        let advised: Vec<&Advised> = error
            .problems()
            .iter()
            .flat_map(|problem| problem.advice().iter().flatten())
            .filter(|advised| advised.path == "cylinder.stroke")
            .collect();
        assert!(!advised.is_empty(), "{stroke_mm}: {}", report(&error));
        for advised in advised {
            assert!(advised.value >= 184.0, "{stroke_mm}: {advised:?}");
            let text = with(
                ROBOT,
                "cylinder.stroke",
                &format!("{:?}", advised.value),
                "mm",
            );
            let accepted = RobotConfig::parse("my.toml", &text);
            assert!(accepted.is_ok(), "{stroke_mm}: {advised:?}");
        }
    }
    let text = with(ROBOT, "cylinder.stroke", "184.0", "mm");
    assert!(RobotConfig::parse("my.toml", &text).is_ok());
}

/// A board whose sensor is right and whose travel is too short is advised the travel, and with it the
/// file is accepted, whatever else the wrong value breaks.
#[test]
fn a_travel_that_is_advised_is_accepted() {
    for (field, wrong_mm, [least, most]) in [
        ("node.joint.sensor_max", "-50.0", [180.0, 181.0]),
        ("node.joint.sensor_max", "100.0", [180.0, 181.0]),
        ("node.joint.sensor_min", "50.0", [-1.0, 0.0]),
    ] {
        let text = with(WALKER, field, wrong_mm, "mm");
        let error = RobotConfig::parse("my.toml", &text).expect_err("too short");
        let mut advised = error
            .problems()
            .iter()
            .filter(|problem| problem.relation() == Some("calibration"))
            .flat_map(|problem| problem.advice().iter().flatten());
        let advised = advised.find(|advised| advised.path == field);
        let value = advised
            .unwrap_or_else(|| panic!("{field}: {}", report(&error)))
            .value;
        assert!((least..=most).contains(&value), "{field} = {value}");
        let text = with(WALKER, field, &format!("{value:?}"), "mm");
        let accepted = RobotConfig::parse("my.toml", &text);
        assert!(accepted.is_ok(), "{field} = {value}");
    }
}
