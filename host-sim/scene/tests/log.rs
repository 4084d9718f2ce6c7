//! The derived channels of a log, against the plant and against the URDF.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde_json::Value;
use wheeleg_config::{RobotConfig, builtin};
use wheeleg_plant::robot::{Inputs, Outputs, Plant};
use wheeleg_scene::{Scene, urdf};
use wheeleg_telemetry::{
    BodySample, Contact, ContactBody, Derive, Derived, EventCode, EventKind, EventSample,
    JointSample, MasterSample, Taken, WheelSample, channels,
};

fn robot() -> RobotConfig {
    builtin::robot("wheeleg-2003").expect("built in")
}

fn scene(scenario: &str) -> Scene {
    let scenario = builtin::scenario(scenario).expect("built in");
    Scene::new(&robot(), &scenario).expect("a scene")
}

/// Messages of one instant.
#[derive(Default)]
struct Heard(BTreeMap<&'static str, Vec<(u64, Value)>>);

impl Heard {
    fn take(&mut self, channel: Derived, t_ns: u64, payload: &[u8]) {
        let value = serde_json::from_slice(payload).expect("JSON");
        let topic = channel.def().topic;
        self.0.entry(topic).or_default().push((t_ns, value));
    }

    fn newest(&self, topic: &str) -> &Value {
        &self.0[topic].last().expect("a message").1
    }

    fn count(&self, topic: &str) -> usize {
        self.0.get(topic).map_or(0, Vec::len)
    }
}

fn give(
    scene: &mut Scene,
    heard: &mut Heard,
    t_ns: u64,
    topic: &str,
    sample: wheeleg_telemetry::SampleRef<'_>,
) {
    let channel = channels().iter().position(|c| c.topic == topic);
    let taken = Taken {
        channel: channel.expect("a channel"),
        number: 0,
        t_ns,
        sample,
        due: true,
        lost: false,
    };
    scene.sample(&taken, &mut |channel, t_ns, payload| {
        heard.take(channel, t_ns, payload)
    });
}

/// The samples of a tick, as the loop's observer makes them.
fn observe(scene: &mut Scene, heard: &mut Heard, robot: &RobotConfig, out: &Outputs) {
    let t_ns = out.time_ns;
    for (i, c) in out.cylinders.iter().enumerate() {
        let sample = JointSample {
            position_mm: c.stroke_m * 1e3,
            velocity_mm_s: c.velocity_m_s * 1e3,
            force_pressure_n: c.forces.pressure_n,
            ..JointSample::default()
        };
        let topic = format!("/joint/{}", i + 1);
        give(scene, heard, t_ns, &topic, (&sample).into());
    }
    for i in 0..2 {
        let sample = WheelSample {
            position_mm: out.wheel_angle_rad[i] * robot.plant.body.wheel_radius_m * 1e3,
            ..WheelSample::default()
        };
        give(
            scene,
            heard,
            t_ns,
            ["/wheel/7", "/wheel/8"][i],
            (&sample).into(),
        );
    }
    let [roll, pitch, yaw] = out.attitude_rad.map(f64::to_degrees);
    let [x, y, z] = out.position_m.map(|m| m * 1e3);
    let sample = BodySample {
        x_mm: x,
        y_mm: y,
        z_mm: z,
        roll_deg: roll,
        pitch_deg: pitch,
        yaw_deg: yaw,
        ..BodySample::default()
    };
    give(scene, heard, t_ns, "/body", (&sample).into());
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from(["x", "y", "z"].map(|k| value[k].as_f64().expect("a number")))
}

/// Every child in the world.
fn poses(tf: &Value) -> BTreeMap<String, Isometry3<f64>> {
    let mut poses = BTreeMap::from([("world".to_owned(), Isometry3::identity())]);
    for transform in tf["transforms"].as_array().expect("transforms") {
        let name = |key: &str| transform[key].as_str().expect("a name").to_owned();
        let q = ["w", "x", "y", "z"].map(|k| transform["rotation"][k].as_f64().expect("a number"));
        let at = Isometry3::from_parts(
            Translation3::from(vector(&transform["translation"])),
            UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3])),
        );
        let parent = poses[&name("parent_frame_id")];
        poses.insert(name("child_frame_id"), parent * at);
    }
    poses
}

/// The robot thrashes about on rocks for two seconds; at every instant `/tf` puts its feet where the
/// plant has them, and the loop that the URDF cuts is closed.
#[test]
fn feet_are_where_the_plant_has_them() {
    let robot = robot();
    let scenario = builtin::scenario("rock-field").expect("built in");
    let gait = &robot.gait;
    let mut params = robot.plant.clone();
    params.initial_stroke_m = [
        gait.yaw_s2_m,
        0.0,
        gait.stroke_m,
        gait.yaw_s2_m,
        gait.held_leg_s5_m,
        gait.held_leg_s6_m,
    ];
    params.terrain = scenario.ground.terrain.clone();
    let plant = Plant::new(&params).expect("a plant");
    let mut state = plant.initial_state(1).expect("it stands");
    let (mut scene, mut heard) = (scene("rock-field"), Heard::default());
    let (mut worst, mut turned, mut seed) = (0.0_f64, 0.0_f64, 7_u64);
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        seed >> 33
    };
    let first = plant.outputs(&state).position_m[0];
    let mut strokes = [f64::INFINITY, f64::NEG_INFINITY];
    let mut inputs = Inputs {
        bridge_duty: [0.8, 0.6],
        bridge_enabled: [true; 2],
        ..Inputs::default()
    };
    for ms in 0..2_000 {
        let out = plant.outputs(&state);
        observe(&mut scene, &mut heard, &robot, &out);
        if ms % 20 == 0 {
            let poses = poses(heard.newest("/tf"));
            for (foot, sole) in ["left_foot", "right_foot"].iter().zip(out.sole_m) {
                let gap = poses[*foot].translation.vector - Vector3::from(sole);
                worst = worst.max(gap.norm());
            }
            for side in ["left", "right"] {
                let crank = poses[&format!("{side}_crank_end")];
                let gap = crank.inv_mul(&poses[&format!("{side}_yaw_carriage")]);
                worst = worst.max(gap.translation.vector.norm());
                assert!(gap.rotation.angle() < 1e-6, "{}", gap.rotation.angle());
            }
            let wheel = poses["base_link"].rotation.inverse() * poses["left_wheel"].rotation;
            turned = turned.max(wheel.angle());
        }
        strokes = [
            strokes[0].min(out.cylinders[0].stroke_m),
            strokes[1].max(out.cylinders[0].stroke_m),
        ];
        // Each cylinder goes out, comes in or rests for a while.
        if ms % 150 == 0 {
            inputs.valve_on_us = std::array::from_fn(|_| match random() % 3 {
                0 => [1000, 0, 0, 1000],
                1 => [0, 1000, 1000, 0],
                _ => [0; 4],
            });
        } else if ms % 150 == 30 {
            inputs.valve_on_us = [[0; 4]; 6];
        }
        plant.tick(&mut state, &inputs).expect("a tick");
    }
    assert!(worst < 1e-6, "{worst} m");
    // It has moved.
    let last = plant.outputs(&state).position_m[0];
    assert!(
        last - first > 0.05 && turned > 0.3,
        "{} {turned}",
        last - first
    );
    assert!(strokes[1] - strokes[0] > 0.005, "{strokes:?}");
    // 50 a second, and the ground once.
    assert_eq!(
        (heard.count("/tf"), heard.count("/joint_states")),
        (100, 100)
    );
    assert_eq!(heard.count("/scene"), 1);
}

/// Real boards report strokes and travel, but neither the robot's place nor its ground.
#[test]
fn real_boards_are_drawn_as_they_sense_themselves() {
    let robot = robot();
    let (mut simulated, mut wanted) = (scene("stand"), Heard::default());
    let (mut sensed, mut heard) = (scene("slope-10").of_boards(), Heard::default());
    let radius_mm = robot.plant.body.wheel_radius_m * 1e3;
    let mut sense = |t_ns: u64, stroke_mm: f64, travel_mm: f64| {
        for i in 1..=6 {
            let topic = format!("/joint/{i}");
            let sample = JointSample {
                position_mm: f64::NAN,
                velocity_mm_s: f64::NAN,
                force_pressure_n: f64::NAN,
                sensed_mm: stroke_mm,
                sensed_velocity_mm_s: 5.0,
                ..JointSample::default()
            };
            give(&mut sensed, &mut heard, t_ns, &topic, (&sample).into());
            let sample = JointSample {
                position_mm: stroke_mm,
                ..JointSample::default()
            };
            give(&mut simulated, &mut wanted, t_ns, &topic, (&sample).into());
        }
        for topic in ["/wheel/7", "/wheel/8"] {
            let sample = WheelSample {
                position_mm: f64::NAN,
                velocity_mm_s: f64::NAN,
                torque_n_m: f64::NAN,
                sensed_mm: travel_mm,
                ..WheelSample::default()
            };
            give(&mut sensed, &mut heard, t_ns, topic, (&sample).into());
            let sample = WheelSample {
                position_mm: travel_mm,
                ..WheelSample::default()
            };
            give(&mut simulated, &mut wanted, t_ns, topic, (&sample).into());
        }
        let sample = MasterSample::default();
        give(&mut sensed, &mut heard, t_ns, "/master", (&sample).into());
        let sample = BodySample {
            x_mm: travel_mm,
            z_mm: radius_mm,
            ..BodySample::default()
        };
        give(&mut simulated, &mut wanted, t_ns, "/body", (&sample).into());
    };
    sense(0, 90.0, 0.0);
    sense(20_000_000, 120.0, 40.0);
    assert_eq!(heard.count("/tf"), 2);
    for ((name, at), wanted) in poses(heard.newest("/tf"))
        .iter()
        .zip(poses(wanted.newest("/tf")).values())
    {
        let gap = at.inv_mul(wanted);
        let apart = gap.translation.vector.norm().max(gap.rotation.angle());
        assert!(apart < 1e-6, "{name}: {apart}");
    }
    let joints = heard.newest("/joint_states")["joints"].clone();
    for joint in joints.as_array().expect("a list") {
        let name = joint["name"].as_str().expect("a name");
        assert!(joint["position"].is_number() && joint["effort"].is_null());
        // No board reports the speed of a wheel.
        assert_eq!(
            joint["velocity"].is_null(),
            name.contains("wheel"),
            "{name}"
        );
    }
    // The scenario's slope is not theirs.
    let corner = vector(&heard.newest("/scene")["entities"][0]["triangles"][0]["points"][1]);
    assert_eq!(corner.z, 0.0);
}

#[test]
fn names_are_those_of_the_urdf_and_nothing_is_left_out() {
    let robot = robot();
    let urdf = urdf_rs::read_from_string(&urdf::write(&robot).expect("exported")).expect("URDF");
    let (mut scene, mut heard) = (scene("stand"), Heard::default());
    let attached = &scene.attached()[0];
    assert_eq!(attached.name, "robot.urdf");
    assert_eq!(
        attached.data,
        urdf::write(&robot).expect("exported").into_bytes()
    );
    let body = BodySample::default();
    give(&mut scene, &mut heard, 0, "/body", (&body).into());
    let names = |value: &Value, list: &str, key: &str| -> BTreeSet<String> {
        let all = value[list].as_array().expect("a list").iter();
        all.map(|item| item[key].as_str().expect("a name").to_owned())
            .collect()
    };
    let links: BTreeSet<String> = urdf.links.iter().map(|l| l.name.clone()).collect();
    assert_eq!(
        names(heard.newest("/tf"), "transforms", "child_frame_id"),
        links
    );
    let moving = urdf.joints.iter();
    let moving = moving.filter(|j| j.joint_type != urdf_rs::JointType::Fixed);
    let moving: BTreeSet<String> = moving.map(|j| j.name.clone()).collect();
    assert_eq!(moving.len(), 14);
    assert_eq!(
        names(heard.newest("/joint_states"), "joints", "name"),
        moving
    );
    // Each link that is seen in the URDF is seen in the scene, on its own frame.
    let seen = urdf.links.iter().filter(|l| !l.visual.is_empty());
    let mut seen: BTreeSet<String> = seen.map(|l| l.name.clone()).collect();
    seen.insert("world".to_owned());
    assert_eq!(names(heard.newest("/scene"), "entities", "frame_id"), seen);
}

#[test]
fn every_kind_of_ground_is_drawn_where_it_is() {
    let drawn = |name: &str| {
        let (mut scene, mut heard) = (scene(name), Heard::default());
        give(
            &mut scene,
            &mut heard,
            0,
            "/body",
            (&BodySample::default()).into(),
        );
        heard.newest("/scene")["entities"][0].clone()
    };
    let list = |entity: &Value, kind: &str| entity[kind].as_array().expect("a list").clone();
    let floor = drawn("stand");
    assert_eq!(list(&floor, "triangles").len(), 1);
    let slope = drawn("slope-10");
    let corner = vector(&slope["triangles"][0]["points"][1]);
    assert!(
        (corner.z - corner.x * 10.0_f64.to_radians().tan()).abs() < 1e-3,
        "{corner}"
    );
    let rocks = drawn("rock-field");
    let terrain = builtin::scenario("rock-field")
        .expect("built in")
        .ground
        .terrain;
    assert_eq!(list(&rocks, "spheres").len() + 1, terrain.parts.len());
    let map = drawn("height-map");
    let terrain = builtin::scenario("height-map")
        .expect("built in")
        .ground
        .terrain;
    let points = list(&map["triangles"][0], "points");
    assert!(
        points.len() > 100 && points.len() < 30_000,
        "{}",
        points.len()
    );
    for point in points.iter().map(vector).step_by(7) {
        let height = terrain.height_m(point.x, point.y).expect("ground");
        assert!((height - point.z).abs() < 1e-3, "{point} {height}");
    }
    let ledge = drawn("foot-side-front");
    let solids: Vec<Value> = list(&ledge, "triangles");
    assert_eq!(
        solids
            .iter()
            .filter(|t| list(t, "points").len() == 8)
            .count(),
        1
    );
}

#[test]
fn an_arrow_is_as_long_as_its_force_and_points_along_it() {
    let (mut scene, mut heard) = (scene("stand"), Heard::default());
    let contact = |body, force_n: [f64; 3]| Contact {
        body,
        place: "front",
        point_m: [0.3, 0.1, 0.0],
        normal: [0.0, 0.0, 1.0],
        force_n,
        depth_m: 1e-4,
        slip_m_s: 0.0,
        friction: 0.8,
        part: 0,
    };
    let contacts = [
        contact(ContactBody::LeftFoot, [30.0, 0.0, 40.0]),
        contact(ContactBody::RightWheel, [0.0, 0.0, 100.0]),
        contact(ContactBody::RightWheel, [0.0; 3]),
    ];
    scene.contacts(20_000_000, &contacts, &mut |c, t, p| heard.take(c, t, p));
    let entities = heard.newest("/scene/contacts")["entities"]
        .as_array()
        .expect("a list")
        .clone();
    let ids: Vec<&str> = entities.iter().filter_map(|e| e["id"].as_str()).collect();
    assert_eq!(
        ids,
        [
            "left_foot",
            "right_foot",
            "left_wheel",
            "right_wheel",
            "chassis"
        ]
    );
    let arrows: Vec<usize> = entities
        .iter()
        .map(|e| e["arrows"].as_array().map_or(0, Vec::len))
        .collect();
    assert_eq!(arrows, [1, 0, 0, 1, 0]);
    let arrow = &entities[0]["arrows"][0];
    let length =
        arrow["shaft_length"].as_f64().expect("m") + arrow["head_length"].as_f64().expect("m");
    assert!((length - 0.1).abs() < 1e-3, "{length}");
    let q =
        ["w", "x", "y", "z"].map(|k| arrow["pose"]["orientation"][k].as_f64().expect("a number"));
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
    assert!((turn * Vector3::x() - Vector3::new(0.6, 0.0, 0.8)).norm() < 1e-3);
    let told = entities[0]["metadata"].as_array().expect("a list");
    let said = |key: &str| {
        told.iter()
            .find(|t| t["key"] == key)
            .map(|t| t["value"].clone())
    };
    assert_eq!(said("1.front.force_n"), Some("50.00".into()));
    assert_eq!(said("1.front.depth_mm"), Some("0.100".into()));
    assert_eq!(said("1.front.material"), Some("rough".into()));
}

#[test]
fn an_event_has_the_level_of_what_it_means() {
    let (mut scene, mut heard) = (scene("stand"), Heard::default());
    for (kind, code, board, level, name) in [
        (EventKind::Fault, EventCode::FaultLatched, 3, 4, "joint 3"),
        (EventKind::Fault, EventCode::FaultsCleared, 3, 2, "joint 3"),
        (EventKind::Fault, EventCode::Finding, 0, 3, "fault"),
        (
            EventKind::Command,
            EventCode::CommandRefused,
            0,
            3,
            "command",
        ),
        (
            EventKind::Command,
            EventCode::ServiceRefused,
            8,
            3,
            "wheel 8",
        ),
        (EventKind::Command, EventCode::CommandDone, 0, 2, "command"),
        (EventKind::Info, EventCode::GaitDone, 0, 2, "info"),
    ] {
        let event = EventSample {
            kind,
            code,
            board,
            text: "a \"word\"\n".to_owned(),
            ..EventSample::default()
        };
        give(&mut scene, &mut heard, 5, "/events", (&event).into());
        let log = heard.newest("/log");
        assert_eq!(
            (log["level"].as_u64(), log["name"].as_str()),
            (Some(level), Some(name))
        );
        assert_eq!(log["message"], "a \"word\"\n");
        assert_eq!(log["timestamp"]["nsec"], 5);
    }
}
