//! The robot file as an open tree of bodies.
//!
//! # Frames
//!
//! Every link frame has Z up. A leg body's X lies along its cylinder (crank: from O3 to O4); the
//! wheels', the chassis's and the feet's X point forward. The right leg is the left one mirrored:
//! its yaw joints turn about −Z, so that the same joint positions give the mirrored pose.
//!
//! # Positions
//!
//! A cylinder's position is its stroke in metres (telemetry: `position_mm` / 1000). The yaw joints
//! count from the pose of the retracted yaw cylinder, so that the loop is closed with all positions
//! at zero.
//!
//! # The loop
//!
//! It is cut between crank and yaw carriage, which are one rigid assembly: the frames
//! `<side>_crank_end` and `<side>_yaw_carriage` coincide in the robot.

use std::f64::consts::{FRAC_PI_2, PI};

use wheeleg_kinematics::{KinematicsError, LegGeometry, LegLengths, LegPosture};
use wheeleg_plant::dynamics::BodyParams;
use wheeleg_protocol::param::JOINT_PARAMS;

use super::geometry::{Joint, Link, Motion, Shape, Solid, Source, Tree};
use crate::SceneError;
use wheeleg_config::{RobotConfig, stored_raw};
use wheeleg_telemetry::channels;

const SIDES: [&str; 2] = ["left", "right"];
/// Protocol name of the fastest reference that a board follows.
const SLEW_RATE: &str = "slew_rate";

/// The drives' names: the topics of the log.
fn topics(prefix: &str) -> impl Iterator<Item = &'static str> {
    channels()
        .iter()
        .map(|channel| channel.topic)
        .filter(move |topic| topic.starts_with(prefix))
}

/// Geometry of the left (0) or right (1) leg.
pub(super) fn geometry_of(
    robot: &RobotConfig,
    leg: usize,
) -> Result<LegGeometry<f64>, KinematicsError<f64>> {
    LegGeometry::new(robot.plant.leg_parameters(leg))
}

/// Turn of the joints `theta1`, `theta4` and `theta3` over the length of the yaw cylinder \[rad/m\].
pub(super) fn yaw_rates(leg: &LegPosture<f64>) -> [f64; 3] {
    [
        leg.theta1_prime,
        leg.phi_prime,
        leg.phi_prime - leg.theta1_prime,
    ]
}

/// Yaw of the barrel and of the carriage, and of the crank against the barrel (rad).
pub(super) fn yaws(leg: &LegPosture<f64>) -> [f64; 3] {
    let x = leg.joints();
    let (barrel, carriage) = (x.theta1_rad - FRAC_PI_2, x.theta4_rad - FRAC_PI_2);
    [barrel, carriage, x.theta3.rad() - FRAC_PI_2]
}

/// A leg body's mass, centre and inertia in axes (along, left, up), mirrored for the right side.
/// `axes`: link axis of MODEL.md section 1 and sign for each.
fn inertial(
    body: &BodyParams,
    axes: [(usize, f64); 3],
    side: f64,
    origin: [f64; 3],
) -> Option<(f64, [f64; 3], [f64; 3])> {
    let mirror = [1.0, side, 1.0];
    let com = std::array::from_fn(|k| {
        let (from, sign) = axes[k];
        mirror[k] * (sign * body.com_m[from]) + origin[k]
    });
    let inertia = axes.map(|(from, _)| body.inertia_kg_m2[from]);
    Some((body.mass_kg, com, inertia))
}

/// Builds the tree.
///
/// # Errors
/// [`SceneError::Leg`] if the leg's loop does not close over the whole stroke.
pub(super) fn build(robot: &RobotConfig) -> Result<Tree, SceneError> {
    let mut tree = Tree::default();
    chassis(robot, &mut tree);
    let wheels = topics("/wheel/").zip(SIDES).enumerate();
    for (i, (topic, side)) in wheels {
        wheel(robot, &mut tree, topic, side, i);
    }
    let names: Vec<&str> = topics("/joint/").collect();
    let legs = names.chunks(3).zip(SIDES).enumerate();
    for (i, (joints, side)) in legs {
        leg(robot, &mut tree, joints, side, i)?;
    }
    Ok(tree)
}

fn chassis(robot: &RobotConfig, tree: &mut Tree) {
    let (body, spatial) = (&robot.plant.body, &robot.spatial);
    let [cx, cz] = body.chassis_com_m;
    tree.links.push(Link {
        name: "base_link".to_owned(),
        inertial: None,
        shapes: Vec::new(),
    });
    tree.links.push(Link {
        name: "chassis".to_owned(),
        inertial: Some((
            body.chassis_mass_kg,
            [cx, 0.0, cz],
            [
                spatial.chassis_roll_inertia_kg_m2,
                body.chassis_pitch_inertia_kg_m2,
                spatial.chassis_yaw_inertia_kg_m2,
            ],
        )),
        shapes: vec![Shape {
            solid: Solid::Box(spatial.chassis_size_m),
            xyz: [cx, 0.0, cz],
            rpy: [0.0; 3],
            material: "frame",
            collides: true,
        }],
    });
    tree.joints.push(Joint {
        name: "base_to_chassis".to_owned(),
        parent: "base_link".to_owned(),
        child: "chassis".to_owned(),
        xyz: [0.0; 3],
        yaw: 0.0,
        axis: [0.0, 0.0, 1.0],
        motion: Motion::Fixed,
        source: Source::Fixed,
    });
}

fn wheel(robot: &RobotConfig, tree: &mut Tree, topic: &str, side: &str, i: usize) {
    let (body, spatial, motor) = (&robot.plant.body, &robot.spatial, &robot.plant.motors[i]);
    let across = spatial.wheel_transverse_inertia_kg_m2;
    let name = format!("{side}_wheel");
    tree.links.push(Link {
        name: name.clone(),
        inertial: Some((
            body.wheel_mass_kg,
            [0.0; 3],
            [across, body.wheel_inertia_kg_m2, across],
        )),
        shapes: vec![Shape {
            solid: Solid::Cylinder {
                radius: body.wheel_radius_m,
                length: spatial.wheel_width_m,
            },
            xyz: [0.0; 3],
            rpy: [FRAC_PI_2, 0.0, 0.0],
            material: "rubber",
            collides: true,
        }],
    });
    let stall_a = motor.supply_v / motor.resistance_ohm;
    let reduced = motor.torque_constant_n_m_a * motor.reduction;
    tree.joints.push(Joint {
        name: topic.to_owned(),
        parent: "chassis".to_owned(),
        child: name,
        xyz: [0.0, sign(i) * 0.5 * spatial.track_m, 0.0],
        yaw: 0.0,
        axis: [0.0, 1.0, 0.0],
        motion: Motion::Continuous {
            effort: stall_a * reduced * motor.efficiency,
            velocity: motor.supply_v / reduced,
            damping: robot.floating_params().wheel_viscous_n_m_s(),
        },
        source: Source::Wheel(i),
    });
}

fn sign(i: usize) -> f64 {
    if i == 0 { 1.0 } else { -1.0 }
}

/// Limits of a cylinder: the pressure force of its larger side, and the slew limit of its board.
fn cylinder(robot: &RobotConfig, i: usize) -> Motion {
    let c = &robot.plant.cylinders[i];
    let gauge = robot.plant.supply.set_pressure_pa - robot.plant.gas.ambient_pressure_pa;
    let slew = JOINT_PARAMS.iter().find(|p| p.name == SLEW_RATE);
    let velocity = slew.map_or(0.0, |p| {
        let raw = stored_raw(p, &robot.node.joints[i]);
        f64::from(raw) / f64::from(p.format.fraction_bits()).exp2() * 1e-3
    });
    Motion::Prismatic {
        stroke: c.stroke_m,
        effort: gauge * 0.25 * PI * c.bore_m * c.bore_m,
        velocity,
        damping: c.friction.viscous_n_s_m,
        friction: c.friction.coulomb_n,
    }
}

/// Angles of a joint over the stroke, against those of the retracted cylinder, and the fastest turn.
fn swing(
    geometry: &LegGeometry<f64>,
    zero: [f64; 3],
    stroke: f64,
    velocity: f64,
) -> Result<[Motion; 3], KinematicsError<f64>> {
    let p = geometry.parameters();
    let start = p.stroke_zero_m[0];
    // The barrel reverses its turn where the crank is across it (theta3 = 0): the only extreme inside.
    let reach = p.p4_m[0].hypot(p.p4_m[1]);
    let across = (reach * reach - p.crank_m * p.crank_m).sqrt();
    let mut points = vec![start, start + stroke];
    if (start..start + stroke).contains(&across) {
        points.push(across);
    }
    let mut range = [(0.0_f64, 0.0_f64); 3];
    let mut fastest = [0.0_f64; 3];
    for b2 in points {
        let leg = geometry.posture(&LegLengths::new(b2, 0.1, 0.1))?;
        let now = yaws(&leg);
        let rates = yaw_rates(&leg);
        for k in 0..3 {
            let angle = now[k] - zero[k];
            range[k] = (range[k].0.min(angle), range[k].1.max(angle));
            fastest[k] = fastest[k].max(rates[k].abs() * velocity);
        }
    }
    Ok(std::array::from_fn(|k| Motion::Revolute {
        lower: range[k].0,
        upper: range[k].1,
        velocity: fastest[k],
    }))
}

fn leg(
    robot: &RobotConfig,
    tree: &mut Tree,
    topics: &[&str],
    side: &'static str,
    i: usize,
) -> Result<(), SceneError> {
    let plant = &robot.plant;
    let body = &plant.body;
    let s = sign(i);
    let first = 3 * i;
    let zero = [0, 1, 2].map(|k| plant.stroke_zero_m[first + k]);
    let refused = |e: KinematicsError<f64>| SceneError::Leg {
        side,
        reason: e.to_string(),
    };
    let geometry = geometry_of(robot, i).map_err(refused)?;
    let retracted = geometry
        .posture(&LegLengths::new(zero[0], zero[1], zero[2]))
        .map_err(refused)?;
    let yaw = yaws(&retracted);
    let drives = [0, 1, 2].map(|k| cylinder(robot, first + k));
    let [yaw_stroke, yaw_velocity] = match drives[0] {
        Motion::Prismatic {
            stroke, velocity, ..
        } => [stroke, velocity],
        _ => [0.0; 2],
    };
    let [barrel_turn, carriage_turn, crank_turn] =
        swing(&geometry, yaw, yaw_stroke, yaw_velocity).map_err(refused)?;

    let o4 = [body.o4_m[0], s * body.o4_m[1], body.o4_m[2]];
    let o1 = [
        o4[0] - body.p4_m[0],
        s * (body.o4_m[1] - body.p4_m[1]),
        o4[2],
    ];
    let turn_axis = [0.0, 0.0, s];
    let ahead = [1.0, 0.0, 0.0];
    let link = |name: &str| format!("{side}_{name}");
    let joint =
        |name: String, [parent, child]: [&str; 2], xyz, yaw: f64, axis, motion, source| Joint {
            name,
            parent: if parent == "chassis" {
                parent.to_owned()
            } else {
                link(parent)
            },
            child: link(child),
            xyz,
            yaw: s * yaw,
            axis,
            motion,
            source,
        };
    let [b1, b2, b3, b4, b5, b6] = &body.leg_bodies;
    let (bore, rod) = (plant.cylinders[first].bore_m, plant.cylinders[first].rod_m);
    // Outside of the tube: a wall of a tenth of the bore, so that barrel and rod can be told apart.
    let tube = 0.6 * bore;
    let along = |from: f64, to: f64, radius: f64, material| Shape {
        solid: Solid::Cylinder {
            radius,
            length: (to - from).abs(),
        },
        xyz: [0.5 * (from + to), 0.0, 0.0],
        rpy: [0.0, FRAC_PI_2, 0.0],
        material,
        collides: false,
    };
    let upright = |at: [f64; 2], from: f64, to: f64, radius: f64, material| Shape {
        solid: Solid::Cylinder {
            radius,
            length: (to - from).abs(),
        },
        xyz: [at[0], at[1], 0.5 * (from + to)],
        rpy: [0.0; 3],
        material,
        collides: false,
    };
    let strokes = [0, 1, 2].map(|k| plant.cylinders[first + k].stroke_m);
    let sole = plant.contacts.foot.sole_radius_m;
    let mut body_link = |name: &str, inertial, shapes| {
        tree.links.push(Link {
            name: link(name),
            inertial,
            shapes,
        });
    };
    body_link(
        "yaw_barrel",
        inertial(b1, [(2, 1.0), (0, 1.0), (1, 1.0)], s, [0.0; 3]),
        vec![along(0.0, zero[0] - 0.5 * bore, tube, "barrel")],
    );
    body_link(
        "yaw_rod",
        inertial(b2, [(1, 1.0), (0, -1.0), (2, 1.0)], s, [0.0; 3]),
        vec![along(-strokes[0], 0.0, 0.5 * rod, "rod")],
    );
    body_link(
        "crank",
        inertial(
            b3,
            [(0, 1.0), (1, 1.0), (2, 1.0)],
            s,
            [body.crank_m, 0.0, 0.0],
        ),
        vec![Shape {
            solid: Solid::Box([body.crank_m, bore, bore]),
            xyz: [0.5 * body.crank_m, 0.0, 0.0],
            rpy: [0.0; 3],
            material: "frame",
            collides: false,
        }],
    );
    body_link("crank_end", None, Vec::new());
    body_link(
        "yaw_carriage",
        inertial(b4, [(2, 1.0), (0, 1.0), (1, 1.0)], s, [0.0; 3]),
        vec![
            along(-strokes[1], zero[1], tube, "barrel"),
            upright([0.0, 0.0], -2.0 * bore, 2.0 * bore, bore, "frame"),
        ],
    );
    body_link(
        "horizontal_carriage",
        inertial(b5, [(1, 1.0), (0, 1.0), (2, -1.0)], s, [0.0; 3]),
        vec![
            along(-strokes[1], 0.0, 0.5 * rod, "rod"),
            upright([0.0, 0.0], -zero[2], strokes[2], tube, "barrel"),
        ],
    );
    body_link(
        "vertical_rod",
        inertial(b6, [(1, 1.0), (0, 1.0), (2, -1.0)], s, [0.0; 3]),
        vec![
            upright([0.0, 0.0], -body.foot_pad_m, strokes[2], 0.5 * rod, "rod"),
            Shape {
                collides: true,
                ..upright(
                    [0.0, 0.0],
                    -body.foot_pad_m,
                    0.2 * sole - body.foot_pad_m,
                    sole,
                    "rubber",
                )
            },
        ],
    );
    body_link("foot", None, Vec::new());

    let passive = |name: &str| format!("{side}_{name}");
    let [yaw_drive, horizontal, vertical] = [0, 1, 2].map(|k| topics[k].to_owned());
    tree.joints.extend([
        joint(
            passive("theta1"),
            ["chassis", "yaw_barrel"],
            o1,
            yaw[0],
            turn_axis,
            barrel_turn,
            Source::Yaw(i, 0),
        ),
        joint(
            yaw_drive,
            ["yaw_barrel", "yaw_rod"],
            [zero[0], 0.0, 0.0],
            0.0,
            ahead,
            drives[0],
            Source::Cylinder(first),
        ),
        joint(
            passive("theta3"),
            ["yaw_rod", "crank"],
            [0.0; 3],
            yaw[2],
            turn_axis,
            crank_turn,
            Source::Yaw(i, 2),
        ),
        joint(
            passive("crank_to_end"),
            ["crank", "crank_end"],
            [body.crank_m, 0.0, 0.0],
            0.0,
            ahead,
            Motion::Fixed,
            Source::Fixed,
        ),
        joint(
            passive("theta4"),
            ["chassis", "yaw_carriage"],
            o4,
            yaw[1],
            turn_axis,
            carriage_turn,
            Source::Yaw(i, 1),
        ),
        joint(
            horizontal,
            ["yaw_carriage", "horizontal_carriage"],
            [zero[1], 0.0, 0.0],
            0.0,
            ahead,
            drives[1],
            Source::Cylinder(first + 1),
        ),
        joint(
            vertical,
            ["horizontal_carriage", "vertical_rod"],
            [0.0, 0.0, -zero[2]],
            0.0,
            [0.0, 0.0, -1.0],
            drives[2],
            Source::Cylinder(first + 2),
        ),
        joint(
            passive("rod_to_foot"),
            ["vertical_rod", "foot"],
            [0.0, 0.0, -body.foot_pad_m],
            0.0,
            ahead,
            Motion::Fixed,
            Source::Fixed,
        ),
    ]);
    Ok(())
}
