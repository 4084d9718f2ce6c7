//! The plant's parameters: sections of a robot file, and their conversion.

pub mod sections;

use wheeleg_plant::PlantParams;
use wheeleg_plant::chamber::GasModel;
use wheeleg_plant::contact::ContactParams;
use wheeleg_plant::cylinder::CylinderParams;
use wheeleg_plant::dynamics::{BodyParams, RobotDynamicsParams};
use wheeleg_plant::endstop::EndStopParams;
use wheeleg_plant::flow::{GasParams, Iso6358};
use wheeleg_plant::friction::FrictionParams;
use wheeleg_plant::ground::Ground;
use wheeleg_plant::motor::MotorParams;
use wheeleg_plant::sensors::{AdcNoise, AdcParams, PotentiometerParams};
use wheeleg_plant::supply::SupplyParams;
use wheeleg_plant::valve::ValveParams;

use self::sections::{
    AdcSection, BodySection, ContactSection, CylinderSection, EndStopSection, FlowSection,
    FrictionSection, GasSection, LineSection, LinkSection, MotorSection, NumericsSection,
    PotentiometerSection, StartSection, SupplySection, ValveSection,
};
use super::reader::Reader;

/// Names of the plant's sections.
pub(super) const SECTIONS: [&str; 17] = [
    "gas",
    "supply",
    "regulator",
    "dump_valve",
    "fill_valve",
    "vent_valve",
    "line",
    "cylinder",
    "friction",
    "end_stop",
    "start",
    "motor",
    "sensor",
    "numerics",
    "body",
    "link",
    "contact",
];

/// The six bodies of a leg, in the order of the chain.
const LINKS: [&str; 6] = [
    "yaw_barrel",
    "yaw_rod",
    "crank",
    "yaw_carriage",
    "horizontal_carriage",
    "vertical_rod",
];

pub(super) fn iso(c: f64, b: f64, m: f64, linear: f64) -> Iso6358 {
    Iso6358 {
        conductance_m3_s_pa: c,
        critical_ratio: b,
        subsonic_exponent: m,
        linear_ratio: linear,
    }
}

fn valve(v: &ValveSection) -> ValveParams {
    ValveParams {
        flow: iso(
            v.conductance,
            v.critical_ratio,
            v.subsonic_exponent,
            v.linear_ratio,
        ),
        t_on_s: v.t_on,
        t_off_s: v.t_off,
    }
}

/// Reads all sections of the plant.
pub(super) fn read(r: &mut Reader) -> Option<PlantParams> {
    let gas = r.section::<GasSection>("gas");
    let supply = r.section::<SupplySection>("supply");
    let regulator = r.section::<FlowSection>("regulator");
    let dump_valve = r.section::<ValveSection>("dump_valve");
    let fill_valve = r.section::<ValveSection>("fill_valve");
    let vent_valve = r.section::<ValveSection>("vent_valve");
    let line = r.section::<LineSection>("line");
    let cylinder = r.section::<CylinderSection>("cylinder");
    let friction = r.section::<FrictionSection>("friction");
    let end_stop = r.section::<EndStopSection>("end_stop");
    if let Some(start) = r.table("start") {
        r.reject_unknown(&start, &["yaw", "horizontal", "vertical"]);
    }
    let yaw = r.section::<StartSection>("start.yaw");
    let horizontal = r.section::<StartSection>("start.horizontal");
    let vertical = r.section::<StartSection>("start.vertical");
    let motor = r.section::<MotorSection>("motor");
    if let Some(sensor) = r.table("sensor") {
        r.reject_unknown(&sensor, &["potentiometer", "adc"]);
    }
    let potentiometer = r.section::<PotentiometerSection>("sensor.potentiometer");
    let adc = r.section::<AdcSection>("sensor.adc");
    let numerics = r.section::<NumericsSection>("numerics");

    let body = r.section::<BodySection>("body");
    if let Some(link) = r.table("link") {
        r.reject_unknown(&link, &LINKS);
    }
    let links = LINKS.map(|name| r.section::<LinkSection>(&format!("link.{name}")));
    let contact = r.section::<ContactSection>("contact");

    let base = cylinder_params(
        &cylinder?,
        &line?,
        &fill_valve?,
        &vent_valve?,
        &friction?,
        &end_stop?,
    );
    let starts = [yaw?, horizontal?, vertical?];
    let (body, motor) = (body?, motor?);
    let [l1, l2, l3, l4, l5, l6] = links;
    let links = [l1?, l2?, l3?, l4?, l5?, l6?];
    Some(PlantParams {
        gas: gas_params(&gas?),
        supply: supply_params(&supply?, &regulator?, &dump_valve?),
        cylinders: std::array::from_fn(|i| CylinderParams {
            initial_pressure_a_pa: starts[i % 3].pressure_a,
            initial_pressure_b_pa: starts[i % 3].pressure_b,
            ..base.clone()
        }),
        initial_stroke_m: std::array::from_fn(|i| starts[i % 3].stroke),
        stroke_zero_m: std::array::from_fn(|i| body.stroke_zero[i % 3]),
        body: dynamics_params(&body, &links, motor.reduction),
        contact: contact_params(&contact?),
        // The ground is the scenario's.
        ground: Ground::default(),
        motors: [motor_params(&motor); 2],
        potentiometers: [potentiometer_params(&potentiometer?); 6],
        adc: adc_params(&adc?),
        step_ns: (numerics?.step * 1e9).round() as u64,
    })
}

pub(super) fn gas_params(s: &GasSection) -> GasParams {
    GasParams {
        gas_constant_j_kg_k: s.gas_constant,
        heat_capacity_ratio: s.heat_capacity_ratio,
        reference_density_kg_m3: s.reference_density,
        reference_temperature_k: s.reference_temperature,
        reference_pressure_pa: s.reference_pressure,
        ambient_pressure_pa: s.ambient_pressure,
        ambient_temperature_k: s.ambient_temperature,
    }
}

pub(super) fn supply_params(
    s: &SupplySection,
    regulator: &FlowSection,
    dump: &ValveSection,
) -> SupplyParams {
    SupplyParams {
        source_pressure_pa: s.source_pressure,
        set_pressure_pa: s.set_pressure,
        droop_pa: s.droop,
        regulator_flow: iso(
            regulator.conductance,
            regulator.critical_ratio,
            regulator.subsonic_exponent,
            regulator.linear_ratio,
        ),
        reservoir_m3: s.reservoir,
        initial_pressure_pa: s.initial_pressure,
        dump_valve: valve(dump),
        switch_on_pa: s.switch_on,
        switch_off_pa: s.switch_off,
    }
}

pub(super) fn cylinder_params(
    c: &CylinderSection,
    line: &LineSection,
    fill: &ValveSection,
    vent: &ValveSection,
    f: &FrictionSection,
    e: &EndStopSection,
) -> CylinderParams {
    CylinderParams {
        bore_m: c.bore,
        rod_m: c.rod,
        stroke_m: c.stroke,
        dead_volume_a_m3: c.dead_volume_a,
        dead_volume_b_m3: c.dead_volume_b,
        line_volume_m3: line.volume,
        line_flow: Some(iso(
            line.conductance,
            line.critical_ratio,
            line.subsonic_exponent,
            line.linear_ratio,
        )),
        line_delay_s: line.delay,
        dead_wall_area_m2: line.wall_area,
        piston_leak_m3_s_pa: c.piston_leak,
        rod_leak_m3_s_pa: c.rod_leak,
        fill_valve: valve(fill),
        vent_valve: valve(vent),
        timing_spread: c.timing_spread,
        gas_model: GasModel::Polytropic {
            exponent: c.exponent,
        },
        friction: FrictionParams {
            coulomb_n: f.coulomb,
            static_n: f.static_force,
            stribeck_m_s: f.stribeck,
            viscous_n_s_m: f.viscous,
            bristle_stiffness_n_m: f.bristle_stiffness,
            bristle_damping_n_s_m: f.bristle_damping,
            elastic_share: f.elastic_share,
            // Not selected for the robot.
            pressure_area_m2: 0.0,
        },
        end_stop: EndStopParams {
            stiffness_n_m: e.stiffness,
            damping_s_m: e.damping,
            cushion_length_m: e.cushion_length,
            cushion_damping_n_s_m: e.cushion_damping,
        },
        // Replaced per cylinder from [start].
        initial_pressure_a_pa: 0.0,
        initial_pressure_b_pa: 0.0,
    }
}

fn motor_params(s: &MotorSection) -> MotorParams {
    MotorParams {
        supply_v: s.supply,
        resistance_ohm: s.resistance,
        inductance_h: s.inductance,
        torque_constant_n_m_a: s.torque_constant,
        reduction: s.reduction,
        efficiency: s.efficiency,
        efficiency_blend_rad_s: s.efficiency_blend,
        friction_n_m: s.friction,
        friction_blend_rad_s: s.friction_blend,
        encoder_lines: s.encoder_lines,
    }
}

fn dynamics_params(
    s: &BodySection,
    links: &[LinkSection; 6],
    gear_ratio: f64,
) -> RobotDynamicsParams {
    RobotDynamicsParams {
        crank_m: s.crank,
        p4_m: s.p4,
        min_cos_theta3: s.min_cos_theta3,
        leg_bodies: links.map(|l| BodyParams {
            mass_kg: l.mass,
            com_m: l.com,
            inertia_kg_m2: l.inertia,
        }),
        chassis_mass_kg: s.chassis_mass,
        chassis_com_m: s.chassis_com,
        chassis_pitch_inertia_kg_m2: s.chassis_pitch_inertia,
        o4_m: s.o4,
        foot_pad_m: s.foot_pad,
        wheel_mass_kg: s.wheel_mass,
        wheel_radius_m: s.wheel_radius,
        wheel_inertia_kg_m2: s.wheel_inertia,
        rotor_inertia_kg_m2: s.rotor_inertia,
        gear_ratio,
        // Friction of the cylinders is in the pneumatic model.
        viscous: [s.chassis_viscous, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        gravity_m_s2: s.gravity,
    }
}

fn contact_params(s: &ContactSection) -> ContactParams {
    ContactParams {
        stiffness_n_m: s.stiffness,
        damping_s_m: s.damping,
        mu_static: s.mu_static,
        mu_kinetic: s.mu_kinetic,
        stribeck_m_s: s.stribeck,
        bristle_stiffness_n_m: s.bristle_stiffness,
        bristle_damping_n_s_m: s.bristle_damping,
        sole_radius_m: s.sole_radius,
        switch_threshold_m: s.switch_threshold,
    }
}

pub(super) fn potentiometer_params(s: &PotentiometerSection) -> PotentiometerParams {
    PotentiometerParams {
        electrical_stroke_m: s.electrical_stroke,
        offset_m: s.offset,
        gain: s.gain,
        nonlinearity: s.nonlinearity,
    }
}

pub(super) fn adc_params(s: &AdcSection) -> AdcParams {
    AdcParams {
        bits: s.bits,
        oversampling: s.oversampling,
        noise: if s.noise > 0.0 {
            AdcNoise::Gaussian { sigma_lsb: s.noise }
        } else {
            AdcNoise::None
        },
    }
}

#[cfg(test)]
mod tests {
    use crate::config::builtin;
    use serde_json::Value;

    fn compare(path: &str, a: &Value, b: &Value) {
        match (a, b) {
            (Value::Number(x), Value::Number(y)) => {
                let (x, y) = (x.as_f64().unwrap_or(0.0), y.as_f64().unwrap_or(1.0));
                let scale = x.abs().max(y.abs());
                assert!((x - y).abs() <= 1e-9 * scale, "{path}: {x} and {y}");
            }
            (Value::Object(x), Value::Object(y)) => {
                assert_eq!(x.len(), y.len(), "{path}");
                for (key, value) in x {
                    compare(&format!("{path}.{key}"), value, &y[key]);
                }
            }
            (Value::Array(x), Value::Array(y)) => {
                assert_eq!(x.len(), y.len(), "{path}");
                for (i, (x, y)) in x.iter().zip(y).enumerate() {
                    compare(&format!("{path}[{i}]"), x, y);
                }
            }
            _ => assert_eq!(a, b, "{path}"),
        }
    }

    /// The plant's own tests run on a copy of these values that needs no file;
    /// the two must not drift apart.
    #[test]
    fn robot_file_and_plant_tests_use_the_same_robot() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let file = serde_json::to_value(&robot.plant).expect("serialises");
        let copy =
            serde_json::to_value(wheeleg_plant::testing::wheeleg_2003()).expect("serialises");
        compare("plant", &file, &copy);
    }

    /// The reference model's foot load rests on three numbers derived from
    /// the masses; they must follow when the masses change.
    #[test]
    fn load_of_the_reference_model_follows_from_the_masses() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let body = &robot.plant.body;
        let (leg, r) = (&body.leg_bodies, &robot.reference);
        let b5_zero = robot.plant.stroke_zero_m[1];
        let slide = leg[4].mass_kg + leg[5].mass_kg;
        // First moments about the axle at the home yaw (theta1 = pi, theta4 =
        // pi/2), frames as in MODEL.md; O1 is p4 behind O4.
        let o1 = body.o4_m[0] - body.p4_m[0];
        let fixed = leg[0].mass_kg * (o1 - leg[0].com_m[0])
            + leg[1].mass_kg * (o1 + leg[1].com_m[0])
            + leg[2].mass_kg * (body.o4_m[0] + leg[2].com_m[0])
            + leg[3].mass_kg * (body.o4_m[0] + leg[3].com_m[2])
            + leg[4].mass_kg * (body.o4_m[0] + leg[4].com_m[1])
            + leg[5].mass_kg * (body.o4_m[0] + leg[5].com_m[1]);
        let other = b5_zero + robot.gait.held_leg_s5_m;
        let moment =
            body.chassis_mass_kg * body.chassis_com_m[0] + 2.0 * fixed + slide * (b5_zero + other);
        assert!((moment - r.load_moment_kg_m).abs() < 1e-9, "{moment}");
        assert!((slide - r.slide_mass_kg).abs() < 1e-12);
        assert!((body.o4_m[0] + b5_zero - r.load_arm_m).abs() < 1e-12);
        assert!((leg[5].mass_kg - r.m6_kg).abs() < 1e-12);
    }

    #[test]
    fn the_plant_accepts_the_robot() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        assert!(wheeleg_plant::Plant::new(&robot.plant).is_ok());
    }
}
