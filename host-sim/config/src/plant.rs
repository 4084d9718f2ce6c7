//! The plant's parameters: sections of a robot file, and their conversion.

pub(super) mod pneumatics;
pub mod sections;

use wheeleg_plant::PlantParams;
use wheeleg_plant::body::{ChassisContact, FootContact, RobotContacts, WheelContact};
use wheeleg_plant::contact::ContactLaw;
use wheeleg_plant::cylinder::CylinderParams;
use wheeleg_plant::dynamics::{BodyParams, RobotDynamicsParams};
use wheeleg_plant::motor::MotorParams;
use wheeleg_plant::robot::SpatialParams as PlantSpatial;
use wheeleg_plant::sensors::AdcNoise;
use wheeleg_plant::soil::sole::Nails;
use wheeleg_plant::terrain::Terrain;

use self::pneumatics::{Pneumatics, Sensing};
use self::sections::{
    BodySection, ChassisContactSection, ContactSection, LinkSection, MotorSection,
    SoftGroundSection, SpatialParams, StartSection, WheelContactSection,
};
use super::reader::Reader;
use super::relations::Moved;

/// Names of the plant's sections without those of one cylinder.
pub(super) const SECTIONS: [&str; 9] = [
    "start",
    "motor",
    "body",
    "spatial",
    "link",
    "contact",
    "wheel_contact",
    "chassis_contact",
    "soft_ground",
];

/// Default force of soil that closes a switch, N.
const PLAIN_SWITCH_N: f64 = 0.25;

/// The six bodies of a leg, in the order of the chain.
const LINKS: [&str; 6] = [
    "yaw_barrel",
    "yaw_rod",
    "crank",
    "yaw_carriage",
    "horizontal_carriage",
    "vertical_rod",
];

/// Reads all sections of the plant, and separately the sizes that only its drawing needs.
pub(super) fn read(r: &mut Reader) -> Option<(PlantParams, SpatialParams)> {
    let pneumatics = Pneumatics::read(r);
    if let Some(start) = r.table("start") {
        r.reject_unknown(&start, &["yaw", "horizontal", "vertical"]);
    }
    let yaw = r.section::<StartSection>("start.yaw");
    let horizontal = r.section::<StartSection>("start.horizontal");
    let vertical = r.section::<StartSection>("start.vertical");
    let motor = r.section::<MotorSection>("motor");
    let sensing = Sensing::read(r, |sigma_lsb| AdcNoise::Gaussian { sigma_lsb });

    let body = r.section::<BodySection>("body");
    if let Some(link) = r.table("link") {
        r.reject_unknown(&link, &LINKS);
    }
    let links = LINKS.map(|name| r.section::<LinkSection>(&format!("link.{name}")));
    let spatial = r.section::<SpatialParams>("spatial");
    let contact = r.section::<ContactSection>("contact");
    let wheel_contact = r.section::<WheelContactSection>("wheel_contact");
    let chassis_contact = r.section::<ChassisContactSection>("chassis_contact");
    let soft_ground = r.optional_section::<SoftGroundSection>("soft_ground");

    let starts = [yaw?, horizontal?, vertical?];
    let (pneumatics, sensing) = (pneumatics?, sensing?);
    let (body, motor) = (body?, motor?);
    let [l1, l2, l3, l4, l5, l6] = links;
    let links = [l1?, l2?, l3?, l4?, l5?, l6?];
    let spatial = spatial?;
    let mut contacts = contacts(&contact?, &wheel_contact?, &chassis_contact?, &spatial);
    if let Some(soft) = soft_ground? {
        contacts.wheel.lug_m = soft.lugs;
        contacts.foot.switch_force_n = soft.switch_force;
        contacts.foot.nails = Nails {
            count: soft.nails,
            diameter_m: soft.nail_diameter,
            length_m: soft.nail_length,
            shear_m: soft.nail_shear,
        };
    }
    let plant = PlantParams {
        gas: pneumatics.gas,
        supply: pneumatics.supply,
        cylinders: std::array::from_fn(|i| CylinderParams {
            initial_pressure_a_pa: starts[i % 3].pressure_a,
            initial_pressure_b_pa: starts[i % 3].pressure_b,
            ..pneumatics.cylinder.clone()
        }),
        initial_stroke_m: std::array::from_fn(|i| starts[i % 3].stroke),
        stroke_zero_m: std::array::from_fn(|i| body.stroke_zero[i % 3]),
        body: dynamics_params(&body, &links, motor.reduction),
        spatial: PlantSpatial {
            chassis_roll_inertia_kg_m2: spatial.chassis_roll_inertia_kg_m2,
            chassis_yaw_inertia_kg_m2: spatial.chassis_yaw_inertia_kg_m2,
            wheel_transverse_inertia_kg_m2: spatial.wheel_transverse_inertia_kg_m2,
            track_m: spatial.track_m,
        },
        contacts,
        // The scenario gives the ground.
        terrain: Terrain::default(),
        motors: [motor_params(&motor); 2],
        potentiometers: [sensing.potentiometer; 6],
        adc: sensing.adc,
        step_ns: sensing.step_ns,
    };
    Some((plant, spatial))
}

/// The cylinder that moves the smallest mass, the vertical one, with its rod.
pub(super) fn moved(plant: &PlantParams) -> Moved<'_> {
    Moved {
        cylinder: &plant.cylinders[2],
        gas: &plant.gas,
        supply: &plant.supply,
        mass_kg: plant.body.leg_bodies[5].mass_kg,
        load_n: 0.0,
        step_s: plant.step_ns as f64 * 1e-9,
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

fn contacts(
    sole: &ContactSection,
    wheel: &WheelContactSection,
    chassis: &ChassisContactSection,
    spatial: &SpatialParams,
) -> RobotContacts {
    let law = ContactLaw {
        stiffness_n_m: sole.stiffness,
        damping_s_m: sole.damping,
        mu_static: sole.mu_static,
        mu_kinetic: sole.mu_kinetic,
        stribeck_m_s: sole.stribeck,
        bristle_stiffness_n_m: sole.bristle_stiffness,
        bristle_damping_n_s_m: sole.bristle_damping,
    };
    RobotContacts {
        foot: FootContact {
            law,
            sole_radius_m: sole.sole_radius,
            sphere_radius_m: sole.sphere_radius,
            switch_threshold_m: sole.switch_threshold,
            switch_force_n: PLAIN_SWITCH_N,
            nails: Nails::NONE,
        },
        wheel: WheelContact {
            law: ContactLaw {
                stiffness_n_m: wheel.stiffness,
                mu_static: wheel.mu_static,
                mu_kinetic: wheel.mu_kinetic,
                bristle_stiffness_n_m: wheel.bristle_stiffness,
                bristle_damping_n_s_m: wheel.bristle_damping,
                ..law
            },
            width_m: spatial.wheel_width_m,
            lug_m: 0.0,
            rolling_resistance: wheel.rolling_resistance,
            rolling_blend_rad_s: wheel.rolling_blend,
        },
        chassis: ChassisContact {
            law: ContactLaw {
                stiffness_n_m: chassis.stiffness,
                mu_static: chassis.mu_static,
                mu_kinetic: chassis.mu_kinetic,
                bristle_stiffness_n_m: chassis.bristle_stiffness,
                bristle_damping_n_s_m: chassis.bristle_damping,
                ..law
            },
            from_m: chassis.from,
            to_m: chassis.to,
        },
    }
}

#[cfg(test)]
mod tests {
    use crate::builtin;
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
        use wheeleg_plant::testing::{wheeleg_2003, wheeleg_field};
        for (name, copy) in [
            ("wheeleg-2003", wheeleg_2003()),
            ("wheeleg-field", wheeleg_field()),
        ] {
            let robot = builtin::robot(name).expect("built in");
            let file = serde_json::to_value(&robot.plant).expect("serialises");
            let copy = serde_json::to_value(copy).expect("serialises");
            compare(name, &file, &copy);
        }
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
