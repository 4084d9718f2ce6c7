//! `wheeleg export urdf`, read by a third-party parser.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::process::{Command, Output};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use urdf_rs::{JointType, Robot};
use wheeleg_config::{RobotConfig, builtin};
use wheeleg_scene::urdf;
use wheeleg_telemetry::channels;

const FILE: &str = include_str!("../../robots/wheeleg-2003.toml");

fn robot() -> RobotConfig {
    builtin::robot("wheeleg-2003").expect("built in")
}

fn parsed(robot: &RobotConfig) -> Robot {
    urdf_rs::read_from_string(&urdf::write(robot).expect("exported")).expect("URDF")
}

fn isometry(pose: &urdf_rs::Pose) -> Isometry3<f64> {
    let ([x, y, z], [roll, pitch, yaw]) = (pose.xyz.0, pose.rpy.0);
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

/// Frame of a link relative to the root.
fn frame(urdf: &Robot, positions: &BTreeMap<String, f64>, link: &str) -> Isometry3<f64> {
    let Some(joint) = urdf.joints.iter().find(|j| j.child.link == link) else {
        return Isometry3::identity();
    };
    let position = positions.get(&joint.name).copied().unwrap_or(0.0);
    let axis = Vector3::from(joint.axis.xyz.0);
    let motion = match joint.joint_type {
        JointType::Prismatic => Isometry3::from(axis * position),
        JointType::Revolute | JointType::Continuous => {
            Isometry3::new(Vector3::zeros(), axis * position)
        }
        _ => Isometry3::identity(),
    };
    frame(urdf, positions, &joint.parent.link) * isometry(&joint.origin) * motion
}

fn gap(urdf: &Robot, positions: &BTreeMap<String, f64>, side: &str) -> (f64, f64) {
    let crank = frame(urdf, positions, &format!("{side}_crank_end"));
    let carriage = frame(urdf, positions, &format!("{side}_yaw_carriage"));
    let between = crank.inv_mul(&carriage);
    (between.translation.vector.norm(), between.rotation.angle())
}

#[test]
fn driven_joints_are_the_topics_of_the_log() {
    let urdf = parsed(&robot());
    let driven: BTreeSet<&str> = urdf
        .joints
        .iter()
        .map(|j| j.name.as_str())
        .filter(|name| name.starts_with('/'))
        .collect();
    let topics: BTreeSet<&str> = channels()
        .iter()
        .map(|c| c.topic)
        .filter(|t| t.starts_with("/joint/") || t.starts_with("/wheel/"))
        .collect();
    assert_eq!(driven.len(), 8);
    assert_eq!(driven, topics);
    let names: BTreeSet<&str> = urdf.joints.iter().map(|j| j.name.as_str()).collect();
    assert_eq!(names.len(), urdf.joints.len(), "a name twice");
}

#[test]
fn it_is_one_tree_with_every_body_once() {
    let robot = robot();
    let urdf = parsed(&robot);
    let links: BTreeSet<&str> = urdf.links.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(links.len(), urdf.links.len());
    let children: BTreeSet<&str> = urdf.joints.iter().map(|j| j.child.link.as_str()).collect();
    assert_eq!(children.len(), urdf.joints.len(), "a link with two parents");
    let roots: Vec<_> = links.difference(&children).collect();
    assert_eq!(roots, [&"base_link"]);
    let heavy = urdf.links.iter().filter(|l| l.inertial.mass.value > 0.0);
    assert_eq!(heavy.count(), 15);
    let mass: f64 = urdf.links.iter().map(|l| l.inertial.mass.value).sum();
    assert!(
        (mass - robot.plant.body.total_mass_kg()).abs() < 1e-12,
        "{mass}"
    );
}

#[test]
fn numbers_are_those_of_the_robot_file_to_the_last_bit() {
    let robot = robot();
    let urdf = parsed(&robot);
    let link = |name: &str| urdf.links.iter().find(|l| l.name == name).expect("link");
    let body = &robot.plant.body;
    for (side, sign) in [("left", 1.0), ("right", -1.0)] {
        let barrel = &link(&format!("{side}_yaw_barrel")).inertial;
        let [m, com, i] = [
            [body.leg_bodies[0].mass_kg; 3],
            body.leg_bodies[0].com_m,
            body.leg_bodies[0].inertia_kg_m2,
        ];
        // F2 is w, up, u; the link's axes are u, w, up.
        assert_eq!(barrel.mass.value, m[0]);
        assert_eq!(barrel.origin.xyz.0, [com[2], sign * com[0], com[1]]);
        let [ixx, iyy, izz] = [barrel.inertia.ixx, barrel.inertia.iyy, barrel.inertia.izz];
        assert_eq!([ixx, iyy, izz], [i[2], i[0], i[1]]);
        // F7 is n, f, down; the link's axes are f, n, up.
        let rod = &link(&format!("{side}_vertical_rod")).inertial;
        let com = body.leg_bodies[5].com_m;
        assert_eq!(rod.origin.xyz.0, [com[1], sign * com[0], -com[2]]);
    }
    let chassis = &link("chassis").inertial;
    assert_eq!(chassis.inertia.iyy, body.chassis_pitch_inertia_kg_m2);
    assert_eq!(
        chassis.inertia.ixx,
        robot.spatial.chassis_roll_inertia_kg_m2
    );
    let joint = |name: &str| urdf.joints.iter().find(|j| j.name == name).expect("joint");
    for (i, name) in (1..=6).map(|n| format!("/joint/{n}")).enumerate() {
        let limit = &joint(&name).limit;
        let cylinder = &robot.plant.cylinders[i];
        assert_eq!((limit.lower, limit.upper), (0.0, cylinder.stroke_m));
        // 6 bar gauge on 20 mm; the board's slew limit of 300 mm/s.
        assert!((limit.effort - 188.496).abs() < 1e-3, "{}", limit.effort);
        assert!((limit.velocity - 0.3).abs() < 1e-9, "{}", limit.velocity);
    }
    let wheel = &joint("/wheel/8");
    assert_eq!(wheel.origin.xyz.0, [0.0, -0.28, 0.0]);
    assert_eq!(wheel.axis.xyz.0, [0.0, 1.0, 0.0]);
}

#[test]
fn the_loop_closes_at_zero_and_over_the_stroke_and_nowhere_else() {
    use wheeleg_kinematics::{LegGeometry, LegLengths};
    let robot = robot();
    let urdf = parsed(&robot);
    let geometry = LegGeometry::new(robot.plant.body.leg_parameters()).expect("leg");
    let zero = robot.plant.stroke_zero_m;
    let joints = |s2: f64| {
        let leg = geometry
            .posture(&LegLengths::new(zero[0] + s2, 0.1, 0.1))
            .expect("closes");
        leg.joints()
    };
    let start = joints(0.0);
    for (side, yaw) in [("left", "/joint/1"), ("right", "/joint/4")] {
        let (place, turn) = gap(&urdf, &BTreeMap::new(), side);
        assert!(
            place < 1e-15 && turn < 1e-7,
            "{side}: {place:e} m, {turn:e} rad"
        );
        for step in 0..=18 {
            let s2 = 0.01 * f64::from(step);
            let now = joints(s2);
            let angles = [
                ("theta1", now.theta1_rad - start.theta1_rad),
                ("theta3", now.theta3.rad() - start.theta3.rad()),
                ("theta4", now.theta4_rad - start.theta4_rad),
            ];
            let mut positions = BTreeMap::from([(yaw.to_owned(), s2)]);
            for (name, angle) in angles {
                let joint = format!("{side}_{name}");
                let limit = &urdf
                    .joints
                    .iter()
                    .find(|j| j.name == joint)
                    .expect("joint")
                    .limit;
                let within = limit.lower - 1e-12..=limit.upper + 1e-12;
                assert!(within.contains(&angle), "{joint}: {angle} at {s2}");
                positions.insert(joint, angle);
            }
            let (place, turn) = gap(&urdf, &positions, side);
            assert!(
                place < 1e-14 && turn < 1e-7,
                "{side} {s2}: {place:e} {turn:e}"
            );
            positions.insert(yaw.to_owned(), s2 + 1e-3);
            assert!(gap(&urdf, &positions, side).0 > 9e-4);
        }
    }
}

#[test]
fn right_is_the_mirror_of_left() {
    let robot = robot();
    let urdf = parsed(&robot);
    let strokes = [0.05, 0.12, 0.03];
    let mut positions = BTreeMap::new();
    for (i, stroke) in strokes.iter().enumerate() {
        for first in [1, 4] {
            positions.insert(format!("/joint/{}", first + i), *stroke);
        }
    }
    for side in ["left", "right"] {
        positions.insert(format!("{side}_theta4"), -0.2);
    }
    let left = frame(&urdf, &positions, "left_foot").translation.vector;
    let right = frame(&urdf, &positions, "right_foot").translation.vector;
    assert!(left.y > 0.1 && left.x > 0.6);
    assert!((left - Vector3::new(right.x, -right.y, right.z)).norm() < 1e-15);
}

fn wheeleg(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_wheeleg"))
        .args(arguments)
        .env("NO_COLOR", "1")
        .output()
        .expect("started")
}

#[test]
fn the_program_writes_it_and_keeps_what_was_there() {
    let folder = tempfile::tempdir().expect("folder");
    let out = folder.path().join("robot.urdf");
    let path = out.to_str().expect("UTF-8");
    fs::write(&out, "mine").expect("written");
    let done = wheeleg(&["export", "urdf", "wheeleg-2003", "--out", path]);
    assert!(done.status.success(), "{done:?}");
    let text = urdf::write(&robot()).expect("exported");
    assert_eq!(fs::read_to_string(&out).expect("read"), text);
    let previous = folder.path().join("robot.urdf.previous");
    assert_eq!(fs::read_to_string(previous).expect("kept"), "mine");
    let stdout = wheeleg(&["export", "urdf"]).stdout;
    assert_eq!(String::from_utf8(stdout).expect("UTF-8"), text);
}

#[test]
fn a_bad_robot_is_an_answer() {
    let folder = tempfile::tempdir().expect("folder");
    let file = folder.path().join("short.toml");
    let out = folder.path().join("never.urdf");
    let changed = FILE.replace(
        "crank                 = { value = 0.29,",
        "crank                 = { value = 0.05,",
    );
    assert_ne!(changed, FILE);
    for (robot, text, expected) in [
        (
            file.to_str().expect("UTF-8"),
            changed.as_str(),
            "`body.crank` = 0.05 m",
        ),
        (file.to_str().expect("UTF-8"), "name = 3", "not usable"),
        ("wheeleg-2033", "", "did you mean `wheeleg-2003`"),
    ] {
        fs::write(&file, text).expect("written");
        let done = wheeleg(&[
            "export",
            "urdf",
            robot,
            "--out",
            out.to_str().expect("UTF-8"),
        ]);
        assert_eq!(done.status.code(), Some(2), "{done:?}");
        let message = String::from_utf8(done.stderr).expect("UTF-8");
        assert!(message.contains(expected), "{message}");
        assert!(!out.exists());
    }
}
