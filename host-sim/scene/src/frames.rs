//! Poses of all links, and positions of all joints.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use wheeleg_config::RobotConfig;
use wheeleg_kinematics::{LegGeometry, LegLengths};

use super::SceneError;
use super::geometry::{Joint, Motion, Source, Tree};
use super::tree::{geometry_of, yaw_rates, yaws};

/// The robot at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pose {
    /// `base_link` in the world.
    pub(super) base: Isometry3<f64>,
    pub(super) cylinders: [JointState; 6],
    pub(super) wheels: [JointState; 2],
}

/// A joint at one instant: m, m/s, N, or rad, rad/s, N m.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct JointState {
    pub(super) position: f64,
    /// None if it is not measured.
    pub(super) velocity: Option<f64>,
    /// Force or torque of the drive; none without a drive.
    pub(super) effort: Option<f64>,
}

impl Default for Pose {
    fn default() -> Self {
        Self {
            base: Isometry3::identity(),
            cylinders: Default::default(),
            wheels: Default::default(),
        }
    }
}

/// A link against its parent.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Frame {
    pub(super) parent: String,
    pub(super) child: String,
    /// Name of the joint between them.
    pub(super) joint: String,
    origin: Isometry3<f64>,
    axis: Unit<Vector3<f64>>,
    turns: bool,
    source: Source,
}

/// A leg's mechanism.
#[derive(Debug, Clone)]
struct Leg {
    geometry: LegGeometry<f64>,
    /// Length of the yaw cylinder at stroke 0, m.
    zero_m: f64,
    /// Angles of the yaw mechanism there.
    retracted: [f64; 3],
    /// As it was seen last.
    last: [JointState; 3],
}

/// All links of a robot, parents first.
#[derive(Debug, Clone)]
pub(super) struct Frames {
    pub(super) frames: Vec<Frame>,
    legs: [Leg; 2],
}

/// Length of the two other cylinders when they do not matter, m.
const ANY_M: f64 = 0.1;

impl Leg {
    fn new(robot: &RobotConfig, leg: usize) -> Result<Self, SceneError> {
        let refused = |reason: String| SceneError::Leg {
            side: ["left", "right"][leg],
            reason,
        };
        let geometry = geometry_of(robot, leg).map_err(|e| refused(e.to_string()))?;
        let zero_m = robot.plant.stroke_zero_m[3 * leg];
        let posture = geometry.posture(&LegLengths::new(zero_m, ANY_M, ANY_M));
        let retracted = yaws(&posture.map_err(|e| refused(e.to_string()))?);
        Ok(Self {
            geometry,
            zero_m,
            retracted,
            last: [JointState::default(); 3],
        })
    }

    /// The yaw mechanism at a stroke; unchanged if its loop does not close.
    fn follow(&mut self, yaw: &JointState) {
        let lengths = LegLengths::new(self.zero_m + yaw.position, ANY_M, ANY_M);
        let Ok(posture) = self.geometry.posture(&lengths) else {
            return;
        };
        let (now, rates) = (yaws(&posture), yaw_rates(&posture));
        self.last = std::array::from_fn(|k| JointState {
            position: now[k] - self.retracted[k],
            velocity: yaw.velocity.map(|velocity| rates[k] * velocity),
            effort: None,
        });
    }
}

impl Frame {
    fn new(joint: &Joint) -> Self {
        let [x, y, z] = joint.xyz;
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), joint.yaw);
        Self {
            parent: joint.parent.clone(),
            child: joint.child.clone(),
            joint: joint.name.clone(),
            origin: Isometry3::from_parts(Translation3::new(x, y, z), turned),
            axis: Unit::new_normalize(Vector3::from(joint.axis)),
            turns: !matches!(joint.motion, Motion::Prismatic { .. }),
            source: joint.source,
        }
    }

    /// Whether it can move.
    pub(super) fn moves(&self) -> bool {
        self.source != Source::Fixed
    }

    /// Child in parent with the joint at a position.
    pub(super) fn transform(&self, position: f64) -> Isometry3<f64> {
        if self.turns {
            self.origin * UnitQuaternion::from_axis_angle(&self.axis, position)
        } else {
            self.origin * Translation3::from(self.axis.into_inner() * position)
        }
    }
}

impl Frames {
    pub(super) fn new(robot: &RobotConfig, tree: &Tree) -> Result<Self, SceneError> {
        Ok(Self {
            frames: tree.joints.iter().map(Frame::new).collect(),
            legs: [Leg::new(robot, 0)?, Leg::new(robot, 1)?],
        })
    }

    /// Takes the yaw mechanisms to a pose.
    pub(super) fn follow(&mut self, pose: &Pose) {
        for (leg, yaw) in self.legs.iter_mut().zip([0, 3]) {
            leg.follow(&pose.cylinders[yaw]);
        }
    }

    /// Each frame with the state of its joint, at the pose that was followed last.
    pub(super) fn states(&self, pose: &Pose) -> impl Iterator<Item = (&Frame, JointState)> {
        self.frames.iter().map(|frame| {
            let state = match frame.source {
                Source::Fixed => JointState::default(),
                Source::Cylinder(i) => pose.cylinders[i],
                Source::Wheel(i) => pose.wheels[i],
                Source::Yaw(leg, k) => self.legs[leg].last[k],
            };
            (frame, state)
        })
    }
}
