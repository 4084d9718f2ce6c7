//! The table of relations.

use wheeleg_plant::cylinder::ROD_MOST;
use wheeleg_protocol::param::JointParam;

use super::{Facts, Relation, Rule, laws, moved, reading, standing};

type Fields = &'static [&'static str];

const fn relation(
    name: &'static str,
    fields: Fields,
    broken: &'static str,
    rule: Rule,
) -> Relation {
    Relation {
        name,
        fields,
        broken,
        rule,
    }
}

const fn at_most(name: &'static str, fields: Fields, broken: &'static str) -> Relation {
    relation(name, fields, broken, Rule::AtMost(1.0))
}

const fn below(name: &'static str, fields: Fields, broken: &'static str) -> Relation {
    relation(name, fields, broken, Rule::Below)
}

const fn above(name: &'static str, fields: Fields, broken: &'static str) -> Relation {
    relation(name, fields, broken, Rule::Above)
}

const fn law(
    name: &'static str,
    fields: Fields,
    broken: &'static str,
    law: fn(&Facts<'_>, &Relation) -> Option<super::Broken>,
) -> Relation {
    relation(name, fields, broken, Rule::Law(law))
}

const fn board_limits(name: &'static str, fields: Fields, parameter: JointParam) -> Relation {
    relation(
        name,
        fields,
        "a joint board cannot be configured for this axis",
        Rule::BoardLimits(parameter),
    )
}

const HYSTERESIS: &str = "a contact opens at a lower pressure than it closes";
const NO_CONTACT: &str = "a contact that never closes: the supply would be considered lost";
const REGULATOR: &str = "a regulator lowers the pressure of its source, and raises none";
const PRESSURE: &str = "a chamber has more pressure than its supply";
const START: &str = "the piston starts beyond its stop";
const IN_STOP: &str = "the gait would drive a piston into its stop";
const TOO_SOFT: &str = "with so soft a contact the robot does not stand on its wheels and feet in its start pose, on level ground";
const IN_ORDER: &str = "the gait is out of order";
const SLIDES: &str = "what slides would hold more than what sticks";
const NO_BODY: &str = "no body has these inertias";
const TOO_SMALL: &str = "no body of this mass is so small";
const FRICTION: &str = "the step is too long for so much friction on so little mass";
const STOP: &str = "the step is too long for this end stop and this mass";
const FLOW: &str = "the step is too long for so much flow into so little volume";
const REACH: &str = "a board would not let its piston go where the gait needs it";
const TOO_FAST: &str = "a board would take its own reference for a fault of the sensor: it moves faster than its piston is told to be able to";
const VOLUME: &str = "the piston would press the air before it to nothing in its stop";

/// Every relation between fields of robot and axis files.
#[rustfmt::skip]
pub const RELATIONS: &[Relation] = &[
    // Pressures fall from the source through the regulator to the surroundings.
    at_most("hysteresis of the supply's contact", &["supply.switch_off", "supply.switch_on"], HYSTERESIS),
    below("supply's contact", &["supply.switch_on", "supply.set_pressure"], NO_CONTACT),
    at_most("hysteresis of the source's contact", &["source_switch.off", "source_switch.on"], HYSTERESIS),
    at_most("source's contact", &["source_switch.on", "supply.source_pressure"], NO_CONTACT),
    at_most("regulator", &["supply.set_pressure", "supply.source_pressure"], REGULATOR),
    at_most("filled reservoir", &["supply.initial_pressure", "supply.source_pressure"], REGULATOR),
    law("droop", &["supply.droop", "supply.set_pressure", "gas.ambient_pressure"], "a regulator that would be fully open below the surroundings alone", laws::droop),
    at_most("trapped air A", &["start.pressure_a", "supply.set_pressure"], PRESSURE),
    at_most("trapped air B", &["start.pressure_b", "supply.set_pressure"], PRESSURE),
    at_most("trapped air A, yaw", &["start.yaw.pressure_a", "supply.set_pressure"], PRESSURE),
    at_most("trapped air B, yaw", &["start.yaw.pressure_b", "supply.set_pressure"], PRESSURE),
    at_most("trapped air A, horizontal", &["start.horizontal.pressure_a", "supply.set_pressure"], PRESSURE),
    at_most("trapped air B, horizontal", &["start.horizontal.pressure_b", "supply.set_pressure"], PRESSURE),
    at_most("trapped air A, vertical", &["start.vertical.pressure_a", "supply.set_pressure"], PRESSURE),
    at_most("trapped air B, vertical", &["start.vertical.pressure_b", "supply.set_pressure"], PRESSURE),
    law("density of the gas", &["gas.reference_density", "gas.reference_pressure", "gas.gas_constant", "gas.reference_temperature"], "no gas has this density at this pressure and temperature", laws::density),
    // A cylinder and its sensor.
    at_most("exponent", &["cylinder.exponent", "gas.heat_capacity_ratio"], "air that is compressed would give more heat to the wall than it gets, or take it from a colder one"),
    relation("rod", &["cylinder.rod", "cylinder.bore"], "the air of chamber B acts on what the rod leaves of the piston", Rule::AtMost(ROD_MOST)),
    at_most("cushion", &["end_stop.cushion_length", "cylinder.stroke"], "a piston that begins in both cushions is braked everywhere"),
    relation("break-away", &["friction.static", "friction.coulomb"], "the force to break away is below that of sliding", Rule::AtLeast),
    at_most("start", &["start.stroke", "cylinder.stroke"], START),
    at_most("start, yaw", &["start.yaw.stroke", "cylinder.stroke"], START),
    at_most("start, horizontal", &["start.horizontal.stroke", "cylinder.stroke"], START),
    at_most("start, vertical", &["start.vertical.stroke", "cylinder.stroke"], START),
    law("track of the sensor", &["sensor.potentiometer.electrical_stroke", "cylinder.stroke", "sensor.potentiometer.offset", "sensor.potentiometer.gain"], "the wiper would leave 99 % of its track, which a board takes for a broken wire", laws::track),
    law("begin of the sensor", &["sensor.potentiometer.offset", "sensor.potentiometer.electrical_stroke"], "the wiper would stand below 1 % of its track with the rod in, which a board takes for a short circuit", laws::begin),
    // The step can follow stiff parts.
    law("step and friction", &["friction.bristle_damping", "friction.viscous", "friction.bristle_stiffness", "numerics.step", "moving.mass"], FRICTION, moved::friction),
    law("step and friction, robot", &["friction.bristle_damping", "friction.viscous", "friction.bristle_stiffness", "numerics.step", "link.vertical_rod.mass"], FRICTION, moved::friction),
    law("step and end stop", &["end_stop.stiffness", "end_stop.damping", "end_stop.cushion_damping", "friction.bristle_damping", "numerics.step", "moving.load", "moving.mass"], STOP, moved::end_stop),
    law("step and end stop, robot", &["end_stop.stiffness", "end_stop.damping", "end_stop.cushion_damping", "friction.bristle_damping", "numerics.step", "link.vertical_rod.mass"], STOP, moved::end_stop),
    law("step and air A", &["cylinder.dead_volume_a", "line.volume", "fill_valve.conductance", "vent_valve.conductance", "line.conductance", "numerics.step"], FLOW, moved::gas_a),
    law("step and air B", &["cylinder.dead_volume_b", "line.volume", "fill_valve.conductance", "vent_valve.conductance", "line.conductance", "numerics.step"], FLOW, moved::gas_b),
    law("step and supply", &["supply.reservoir", "supply.droop", "supply.source_pressure", "regulator.conductance", "numerics.step"], "the step is too long for a reservoir that fills so fast", moved::supply),
    law("depth of the stop", &["end_stop.stiffness", "cylinder.stroke", "cylinder.bore", "supply.set_pressure", "moving.load"], "the stop does not hold the piston", moved::depth),
    law("air in the stop A", &["cylinder.dead_volume_a", "line.volume", "cylinder.bore", "end_stop.stiffness", "supply.set_pressure", "moving.load"], VOLUME, moved::volume_a),
    law("air in the stop B", &["cylinder.dead_volume_b", "line.volume", "cylinder.bore", "end_stop.stiffness", "supply.set_pressure", "moving.load"], VOLUME, moved::volume_b),
    // Before and during the gait.
    above("settling in time", &["homing.timeout", "homing.settle"], "no joint would be taken to be settled in time"),
    above("ready in time", &["start_up.limit", "start_up.rest", "homing.settle"], "the robot would never get ready in time"),
    below("returning load", &["reference.reload_start", "reference.reload_end"], "the foot's load would be back before it begins to return"),
    at_most("stroke of the gait", &["gait.stroke", "cylinder.stroke"], IN_STOP),
    at_most("held leg, forward", &["gait.held_leg_s5", "cylinder.stroke"], IN_STOP),
    at_most("held leg, down", &["gait.held_leg_s6", "cylinder.stroke"], IN_STOP),
    at_most("yaw of the gait", &["gait.yaw_s2", "cylinder.stroke"], IN_STOP),
    above("lift before reach", &["gait.reach", "gait.lift"], IN_ORDER),
    above("lift before lower", &["gait.lower", "gait.lift"], IN_ORDER),
    above("reach before push", &["gait.push", "gait.reach"], IN_ORDER),
    above("lower before push", &["gait.push", "gait.lower"], IN_ORDER),
    above("push before the end", &["gait.period", "gait.push"], IN_ORDER),
    law("time to touch down", &["gait.touchdown_speed", "gait.lower", "gait.push", "gait.stroke"], "a foot would still be coming down slowly when the push begins", laws::touchdown),
    law("time to push", &["gait.period", "gait.push", "gait.stroke", "gait.push_speed", "gait.push_acceleration"], "the push does not end within its step", laws::push),
    // Motors and wheels.
    law("current of a motor", &["motor.resistance", "motor.supply"], "a winding would carry more current than its model is valid for", laws::current),
    law("friction of a motor", &["motor.friction", "motor.supply", "motor.torque_constant", "motor.resistance"], "a motor would never turn", laws::stall),
    law("speed of the wheels", &["gait.push_speed", "motor.supply", "motor.torque_constant", "motor.reduction", "body.wheel_radius"], "the wheels would not roll as fast as the gait pushes", laws::rolling),
    // Bodies and their contacts.
    law("inertias of the chassis", &["spatial.chassis_roll_inertia", "body.chassis_pitch_inertia", "spatial.chassis_yaw_inertia"], NO_BODY, laws::chassis_inertias),
    law("inertias of a wheel", &["body.wheel_inertia", "spatial.wheel_transverse_inertia"], NO_BODY, laws::wheel_inertias),
    law("inertias of the yaw barrel", &["link.yaw_barrel.inertia"], NO_BODY, laws::link_inertias),
    law("inertias of the yaw rod", &["link.yaw_rod.inertia"], NO_BODY, laws::link_inertias),
    law("inertias of the crank", &["link.crank.inertia"], NO_BODY, laws::link_inertias),
    law("inertias of the yaw carriage", &["link.yaw_carriage.inertia"], NO_BODY, laws::link_inertias),
    law("inertias of the horizontal carriage", &["link.horizontal_carriage.inertia"], NO_BODY, laws::link_inertias),
    law("inertias of the vertical rod", &["link.vertical_rod.inertia"], NO_BODY, laws::link_inertias),
    law("size of the chassis", &["spatial.chassis_roll_inertia", "body.chassis_pitch_inertia", "spatial.chassis_yaw_inertia", "body.chassis_mass"], TOO_SMALL, laws::chassis_size),
    law("size of a wheel", &["body.wheel_inertia", "spatial.wheel_transverse_inertia", "body.wheel_mass"], TOO_SMALL, laws::wheel_size),
    law("size of the yaw barrel", &["link.yaw_barrel.inertia", "link.yaw_barrel.mass"], TOO_SMALL, laws::link_size),
    law("size of the yaw rod", &["link.yaw_rod.inertia", "link.yaw_rod.mass"], TOO_SMALL, laws::link_size),
    law("size of the crank", &["link.crank.inertia", "link.crank.mass"], TOO_SMALL, laws::link_size),
    law("size of the yaw carriage", &["link.yaw_carriage.inertia", "link.yaw_carriage.mass"], TOO_SMALL, laws::link_size),
    law("size of the horizontal carriage", &["link.horizontal_carriage.inertia", "link.horizontal_carriage.mass"], TOO_SMALL, laws::link_size),
    law("size of the vertical rod", &["link.vertical_rod.inertia", "link.vertical_rod.mass"], TOO_SMALL, laws::link_size),
    at_most("friction of a sole", &["contact.mu_kinetic", "contact.mu_static"], SLIDES),
    at_most("friction of a wheel", &["wheel_contact.mu_kinetic", "wheel_contact.mu_static"], SLIDES),
    at_most("friction of the chassis", &["chassis_contact.mu_kinetic", "chassis_contact.mu_static"], SLIDES),
    at_most("spheres of a sole", &["contact.sphere_radius", "contact.sole_radius"], "the spheres reach beyond the sole that they are part of"),
    law("corners of the chassis", &["chassis_contact.from", "chassis_contact.to"], "the corners make no box", laws::corners),
    law("belly above the ground", &["chassis_contact.from", "body.wheel_radius"], "the chassis would begin below the ground that the wheels stand on", laws::belly),
    law("chassis between the wheels", &["spatial.track", "spatial.wheel_width", "chassis_contact.from", "chassis_contact.to", "body.wheel_radius"], "the wheels would be in the chassis", laws::between),
    law("drawn chassis between the wheels", &["spatial.track", "spatial.wheel_width", "spatial.chassis_size"], "the wheels would be in the chassis as it is drawn", laws::drawn),
    law("hips between the wheels", &["body.o4", "spatial.track"], "a hip is on the other side, or farther out than the wheel of its side", laws::hips),
    law("ground below", &["body.gravity"], "the robot does not stand: its weight must point to the ground, at less than 45° from its normal", laws::gravity),
    // Readings of the boards.
    law("codes of the sensor", &["sensor.potentiometer.electrical_stroke", "sensor.potentiometer.offset", "sensor.potentiometer.gain", "cylinder.stroke", "node.joint.sensor_code_min", "node.joint.sensor_code_max", "sensor.potentiometer.nonlinearity", "sensor.adc.noise", "sensor.adc.bits"], "a joint board would take a piston in its stop for a broken wire", reading::codes),
    law("calibration", &["sensor.potentiometer.electrical_stroke", "sensor.potentiometer.offset", "sensor.potentiometer.gain", "cylinder.stroke", "node.joint.sensor_full_scale", "node.joint.sensor_zero", "node.joint.sensor_min", "node.joint.sensor_max", "sensor.potentiometer.nonlinearity", "sensor.adc.noise", "sensor.adc.bits"], "a joint board would take a piston in its stop for a fault of the sensor", reading::calibration),
    law("measured stroke", &["sensor.potentiometer.electrical_stroke", "sensor.potentiometer.offset", "sensor.potentiometer.gain", "cylinder.stroke", "node.joint.sensor_full_scale", "node.joint.sensor_zero", "gait.held_leg_s6", "homing.tolerance"], "a joint board would wait for a stroke that it never measures", reading::measured),
    law("steps of the converter", &["sensor.adc.bits", "sensor.potentiometer.electrical_stroke", "node.joint.settle_band"], "a joint board would never come to rest: its band is a step of the converter, or little more", reading::converter),
    law("stop of a joint", &["cylinder.stroke", "node.joint.stroke_max", "gait.stroke", "node.joint.precharge", "node.joint.law"], "a joint board would press its piston beyond the stroke that it is told, and never take it for settled", laws::seat),
    law("reach of the yaw boards", &["node.yaw.stroke_max", "node.yaw.stroke_min", "node.joint.stroke_max", "node.joint.stroke_min", "homing.tolerance", "gait.yaw_s2"], REACH, laws::reach),
    law("reach of the horizontal boards", &["node.horizontal.stroke_max", "node.horizontal.stroke_min", "node.joint.stroke_max", "node.joint.stroke_min", "homing.tolerance", "gait.held_leg_s5", "gait.stroke"], REACH, laws::reach_from_home),
    law("reach of the vertical boards", &["node.vertical.stroke_max", "node.vertical.stroke_min", "node.joint.stroke_max", "node.joint.stroke_min", "homing.tolerance", "gait.held_leg_s6", "gait.stroke"], REACH, laws::reach),
    law("speed of the yaw boards", &["node.yaw.sensor_rate", "node.joint.sensor_rate", "node.yaw.slew_rate", "node.joint.slew_rate"], TOO_FAST, laws::credible),
    law("speed of the horizontal boards", &["node.horizontal.sensor_rate", "node.joint.sensor_rate", "node.horizontal.slew_rate", "node.joint.slew_rate"], TOO_FAST, laws::credible),
    law("speed of the vertical boards", &["node.vertical.sensor_rate", "node.joint.sensor_rate", "node.vertical.slew_rate", "node.joint.slew_rate"], TOO_FAST, laws::credible),
    law("samples of the wheel boards", &["node.wheel.sample_timer", "gait.stream_wheels"], "wheels that are not led by the master follow profiles of their own, for which a board needs more time between its samples", laws::profiles),
    // Data of an axis that its board can hold; a single field has this as its own range.
    board_limits("board's full scale", &["sensor.potentiometer.electrical_stroke", "sensor.potentiometer.gain"], JointParam::SensorFullScale),
    board_limits("board's volume A", &["cylinder.dead_volume_a", "line.volume"], JointParam::DeadVolumeA),
    board_limits("board's volume B", &["cylinder.dead_volume_b", "line.volume"], JointParam::DeadVolumeB),
    board_limits("board's conductance", &["fill_valve.conductance", "line.conductance"], JointParam::Conductance),
    board_limits("board's band of rest", &["sensor.potentiometer.electrical_stroke", "sensor.adc.bits"], JointParam::RestBand),
    // The whole robot.
    relation("closed leg", &["body.crank", "body.p4", "body.stroke_zero", "start.yaw.stroke", "cylinder.stroke", "body.min_cos_theta3"], "they make no leg", Rule::Whole(standing::closes)),
    relation("stiffness of the wheels", &["wheel_contact.stiffness", "chassis_contact.from", "body.wheel_radius", "body.chassis_mass", "body.gravity"], TOO_SOFT, Rule::AtRest(standing::wheels_hard_enough)),
    relation("stiffness of the soles", &["contact.stiffness", "body.chassis_mass", "body.chassis_com", "body.gravity"], TOO_SOFT, Rule::AtRest(standing::soles_hard_enough)),
    relation("feet ahead of the wheels", &["body.o4", "body.stroke_zero", "gait.held_leg_s5", "body.chassis_com"], "the robot does not stand in its start pose, on level ground", Rule::AtRest(standing::feet_ahead)),
    relation("standing", &["body.chassis_com", "body.chassis_mass", "body.o4", "body.foot_pad", "body.wheel_radius", "body.stroke_zero", "gait.stroke", "gait.held_leg_s5", "gait.held_leg_s6", "body.gravity", "contact.stiffness", "wheel_contact.stiffness"], "the robot does not stand on its wheels and feet in its start pose, on level ground", Rule::AtRest(standing::stands)),
    relation("carried by its air", &["supply.set_pressure", "cylinder.bore", "cylinder.rod", "body.chassis_mass", "body.chassis_com", "body.gravity"], "the cylinders cannot carry the robot", Rule::AtRest(standing::carried)),
];
