//! The robot's scene for a log.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use wheeleg_config::{RobotConfig, Scenario};
use wheeleg_plant::terrain::Terrain;
use wheeleg_telemetry::{
    Attached, BodySample, Contact, ContactBody, DERIVED_HZ, Derive, Derived, JointSample, Put,
    SampleRef, Taken, WheelSample, channels,
};

use super::frames::{Frames, JointState, Pose};
use super::geometry::Tree;
use super::json::{Colour, Entity, OFTEN, put, scene_update};
use super::messages::WORLD;
use super::{SceneError, ground, messages, shapes, tree, urdf};

const PERIOD_NS: u64 = 1_000_000_000 / DERIVED_HZ as u64;
/// Length of an arrow, m/N: the load of a foot is about as long as its lower leg.
const ARROW_M_N: f64 = 0.002;
/// Forces below are not drawn, N.
const LEAST_N: f64 = 0.01;
/// A contact that is faster along the ground slides, m/s.
const SLIDES_M_S: f64 = 0.002;

const HOLDS: Colour = [0.16, 0.62, 0.33, 1.0];
const SLIDES: Colour = [0.90, 0.45, 0.10, 1.0];
const CONE: Colour = [0.25, 0.45, 0.85, 0.18];

/// The robot and its ground, for the derived channels of one log.
#[derive(Debug, Clone)]
pub struct Scene {
    urdf: String,
    tree: Tree,
    terrain: Terrain,
    materials: Vec<String>,
    wheel_radius_m: f64,
    frames: Frames,
    pose: Pose,
    next_ns: u64,
    shown: bool,
    /// Only the boards' reports of the robot are known.
    sensed: bool,
    entity: Entity,
    payload: Vec<u8>,
}

impl Scene {
    /// Prepares the picture of a robot on a scenario's ground.
    ///
    /// # Errors
    /// [`SceneError::Leg`] if the robot's loop does not close over its stroke.
    pub fn new(robot: &RobotConfig, scenario: &Scenario) -> Result<Self, SceneError> {
        let tree = tree::build(robot)?;
        let terrain = scenario.ground.terrain.clone();
        Ok(Self {
            urdf: urdf::write(robot)?,
            frames: Frames::new(robot, &tree)?,
            materials: terrain.parts.iter().map(ground::material).collect(),
            wheel_radius_m: robot.plant.body.wheel_radius_m,
            tree,
            terrain,
            pose: Pose::default(),
            next_ns: 0,
            shown: false,
            sensed: false,
            entity: Entity::new(OFTEN),
            payload: Vec::new(),
        })
    }

    /// The same for real boards: the robot as they sense it. Nobody measures its place, nor the ground: it is
    /// drawn on a level floor, where its wheels have brought it.
    #[must_use]
    pub fn of_boards(mut self) -> Self {
        self.sensed = true;
        self.terrain = Terrain::default();
        self.materials = self.terrain.parts.iter().map(ground::material).collect();
        self
    }

    /// The robot as URDF, whose links and joints the channels name.
    #[must_use]
    pub fn urdf(&self) -> &str {
        &self.urdf
    }

    /// Ground and shapes: once, so that a viewer that opens the log in its middle finds them as the newest
    /// message of their channel.
    fn show(&mut self, t_ns: u64, give: Put<'_>) {
        self.payload.clear();
        scene_update(&mut self.payload, |out| {
            ground::write(out, t_ns, &self.terrain, WORLD);
            shapes::write(out, t_ns, &self.tree);
        });
        give(Derived::Scene, t_ns, &self.payload);
    }

    /// The last sample of an instant has come.
    fn come(&mut self, t_ns: u64, base: Isometry3<f64>, give: Put<'_>) {
        if !self.shown {
            self.shown = true;
            self.show(t_ns, give);
        }
        self.move_to(t_ns, base, give);
    }

    fn move_to(&mut self, t_ns: u64, base: Isometry3<f64>, give: Put<'_>) {
        if t_ns < self.next_ns {
            return;
        }
        self.next_ns = (t_ns / PERIOD_NS + 1) * PERIOD_NS;
        self.pose.base = base;
        if !self
            .pose
            .base
            .translation
            .vector
            .iter()
            .all(|v| v.is_finite())
        {
            return;
        }
        self.frames.follow(&self.pose);
        self.payload.clear();
        messages::transforms(&mut self.payload, t_ns, &self.frames, &self.pose);
        give(Derived::Tf, t_ns, &self.payload);
        self.payload.clear();
        messages::joint_states(&mut self.payload, t_ns, &self.frames, &self.pose);
        give(Derived::JointStates, t_ns, &self.payload);
    }

    /// Draws a contact, the `number`th of its body.
    fn draw(&mut self, number: usize, contact: &Contact) {
        let force = Vector3::from(contact.force_n);
        if force.norm() < LEAST_N {
            return;
        }
        let (point, normal) = (
            Vector3::from(contact.point_m),
            Vector3::from(contact.normal),
        );
        let slides = contact.slip_m_s > SLIDES_M_S;
        let colour = if slides { SLIDES } else { HOLDS };
        self.entity.arrow(&point, &(ARROW_M_N * force), colour);
        // The force stays within it while the contact holds.
        let high = ARROW_M_N * force.dot(&normal);
        if high > ARROW_M_N && contact.friction < 2.0 {
            let wide = 2.0 * contact.friction * high;
            let turn = UnitQuaternion::rotation_between(&Vector3::z(), &normal).unwrap_or_default();
            let at = Isometry3::from_parts((point + 0.5 * high * normal).into(), turn);
            self.entity.cone(&at, &Vector3::new(wide, wide, high), CONE);
        }
        // One place can touch two things.
        let place = format!("{number}.{}", contact.place);
        let mut tell = |what: &str, value: String| {
            self.entity.tell(&format!("{place}.{what}"), &value);
        };
        tell("force_n", format!("{:.2}", force.norm()));
        tell("depth_mm", format!("{:.3}", contact.depth_m * 1e3));
        tell("slip_mm_s", format!("{:.2}", contact.slip_m_s * 1e3));
        let material = self.materials.get(contact.part).cloned();
        self.entity
            .tell(&format!("{place}.material"), &material.unwrap_or_default());
    }
}

/// `base_link` in the world.
fn base(body: &BodySample) -> Isometry3<f64> {
    let at = Vector3::new(body.x_mm, body.y_mm, body.z_mm) * 1e-3;
    let [roll, pitch, yaw] = [body.roll_deg, body.pitch_deg, body.yaw_deg].map(f64::to_radians);
    // Nose up turns about −Y.
    let turn = UnitQuaternion::from_euler_angles(roll, -pitch, yaw);
    Isometry3::from_parts(Translation3::from(at), turn)
}

impl Derive for Scene {
    fn attached(&self) -> Vec<Attached> {
        vec![Attached {
            name: "robot.urdf".to_owned(),
            media_type: "application/xml".to_owned(),
            data: self.urdf.clone().into_bytes(),
        }]
    }

    fn sample(&mut self, taken: &Taken<'_>, give: Put<'_>) {
        match taken.sample {
            SampleRef::Joint(sample) => {
                if let Some(joint) = place(taken.channel, "/joint/1", 6) {
                    self.pose.cylinders[joint] = self.cylinder(sample);
                }
            }
            SampleRef::Wheel(sample) => {
                if let Some(wheel) = place(taken.channel, "/wheel/7", 2) {
                    self.pose.wheels[wheel] = self.wheel(sample);
                }
            }
            // The last of them at an instant, of a simulated robot and of real boards.
            SampleRef::Body(sample) if !self.sensed => self.come(taken.t_ns, base(sample), give),
            SampleRef::Master(_) if self.sensed => {
                self.come(taken.t_ns, self.on_its_wheels(), give);
            }
            SampleRef::Event(sample) => {
                self.payload.clear();
                messages::log(&mut self.payload, taken.t_ns, sample);
                give(Derived::Log, taken.t_ns, &self.payload);
            }
            _ => {}
        }
    }

    fn contacts(&mut self, t_ns: u64, contacts: &[Contact], give: Put<'_>) {
        let mut out = std::mem::take(&mut self.payload);
        out.clear();
        scene_update(&mut out, |out| {
            for (i, body) in ContactBody::ALL.into_iter().enumerate() {
                self.entity.clear();
                let own = contacts.iter().filter(|c| c.body == body);
                for (number, contact) in (1..).zip(own) {
                    self.draw(number, contact);
                }
                put(out, if i > 0 { "," } else { "" });
                self.entity.write(out, t_ns, WORLD, body.link());
            }
        });
        give(Derived::Contacts, t_ns, &out);
        self.payload = out;
    }
}

impl Scene {
    fn cylinder(&self, sample: &JointSample) -> JointState {
        let [position_mm, velocity_mm_s] = match self.sensed {
            true => [sample.sensed_mm, sample.sensed_velocity_mm_s],
            false => [sample.position_mm, sample.velocity_mm_s],
        };
        JointState {
            position: position_mm * 1e-3,
            velocity: Some(velocity_mm_s * 1e-3),
            effort: (!self.sensed).then_some(sample.force_pressure_n),
        }
    }

    fn wheel(&self, sample: &WheelSample) -> JointState {
        let per_mm = 1e-3 / self.wheel_radius_m;
        if self.sensed {
            return JointState {
                position: sample.sensed_mm * per_mm,
                velocity: None,
                effort: None,
            };
        }
        JointState {
            position: sample.position_mm * per_mm,
            velocity: Some(sample.velocity_mm_s * per_mm),
            effort: Some(sample.torque_n_m),
        }
    }

    /// `base_link`, the middle of the axle, where the wheels have brought it.
    fn on_its_wheels(&self) -> Isometry3<f64> {
        let [left, right] = self.pose.wheels.map(|wheel| wheel.position);
        let x_m = 0.5 * (left + right) * self.wheel_radius_m;
        Translation3::new(x_m, 0.0, self.wheel_radius_m).into()
    }
}

/// Number of a channel among `count` alike, of which the first has this topic.
fn place(channel: usize, first: &str, count: usize) -> Option<usize> {
    let begin = channels().iter().position(|c| c.topic == first)?;
    channel.checked_sub(begin).filter(|n| *n < count)
}
