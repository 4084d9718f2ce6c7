//! Data that layers 0 and 1 exchange once per bus cycle.

use fixed::types::I16F16;
use wheeleg_units::{PositionMm, VelocityMmS};

use crate::behaviour::Behaviours;
use crate::contact::{FootSwitches, Side};

/// Number of cylinder joints.
pub const JOINTS: usize = 6;
/// Number of wheels.
pub const WHEELS: usize = 2;
/// Number of nodes on the bus: joints 1–6, wheels 7 (left) and 8 (right).
pub const NODES: usize = 8;

/// Cylinder within a leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cylinder {
    /// b2: joints 1 and 4.
    Yaw,
    /// b5: joints 2 and 5.
    Horizontal,
    /// b6: joints 3 and 6.
    Vertical,
}

impl Side {
    /// The opposite side.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }

    /// Index of this side's wheel in arrays of wheels.
    #[must_use]
    pub const fn index(self) -> usize {
        match self {
            Self::Left => 0,
            Self::Right => 1,
        }
    }

    /// Index (0..6) of a joint of this side's leg in arrays of joints.
    #[must_use]
    pub const fn joint(self, cylinder: Cylinder) -> usize {
        let first: usize = match self {
            Self::Left => 0,
            Self::Right => 3,
        };
        first.saturating_add(match cylinder {
            Cylinder::Yaw => 0,
            Cylinder::Horizontal => 1,
            Cylinder::Vertical => 2,
        })
    }
}

/// State of the robot's motion; it is logged, and determines the link-loss action.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Phase {
    /// Layer 1 sends no references.
    #[default]
    Idle = 0,
    /// Slewing to the start pose.
    Homing = 1,
    /// At the start pose, settled.
    Ready = 2,
    /// Step: weight leaves the stepping foot, references unchanged.
    Unload = 3,
    /// Step: foot rises, b5 drawn back.
    Lift = 4,
    /// Step: foot in the air, b5 reaches ahead.
    Reach = 5,
    /// Step: foot goes down.
    Lower = 6,
    /// Step: wheels push, b5 of the standing leg follows.
    Push = 7,
    /// Step: push over, waiting for the next step.
    Rest = 8,
    /// Last reference of a finished motion held.
    Done = 9,
    /// Foot trajectory (MODEL.md §6.1).
    Trajectory = 10,
    /// All references frozen at the measured position.
    Hold = 11,
    /// Walking, both legs at their own times.
    Walk = 12,
}

impl Phase {
    /// Whether layer 1 changes references in this phase.
    #[must_use]
    pub const fn is_moving(self) -> bool {
        !matches!(self, Self::Idle | Self::Ready | Self::Done | Self::Hold)
    }

    /// Whether `StopGait` ends the robot's motion: a gait, a walk or a trajectory.
    #[must_use]
    pub const fn is_stepping(self) -> bool {
        self.is_moving() && !matches!(self, Self::Homing)
    }
}

/// Coming change of a reference, for control ahead of a known move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NextReference {
    /// Reference to which the next move leads, mm.
    pub reference_mm: PositionMm,
    /// Bus cycles until that move begins, 1..=254.
    pub cycles: u8,
}

/// A node's reaction if the bus falls silent in this phase, `docs/decisions/0010-safe-states.md`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnLinkLoss {
    /// Valves shut, air trapped: a loaded leg must not collapse.
    #[default]
    Hold,
    /// HOLD first, then exhaust at limited speed: the leg carries no load.
    HoldThenExhaust,
}

/// Leg–wheel co-operation and touchdown reflexes of layer 0 on one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reflex {
    /// The reference goes out unchanged.
    #[default]
    None,
    /// The reference is sent minus the wheel travel measured since layer 1 requested this reflex: a standing foot stays
    /// where it is on the ground.
    FollowTravel,
    /// The reference becomes the measured stroke once the foot's switches close.
    StopOnTouch,
}

/// Reference of one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointSetpoint {
    /// Stroke in mm, 0..=180.
    pub reference_mm: PositionMm,
    /// Speed of the reference in mm/s (feed-forward; 0 for a square wave).
    pub velocity_mm_s: VelocityMmS,
    /// Next change of the reference, if within the horizon.
    pub ahead: Option<NextReference>,
    /// Action on link loss.
    pub on_link_loss: OnLinkLoss,
    /// Reflex of layer 0.
    pub reflex: Reflex,
}

/// Reference of one wheel's travel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WheelTravel {
    /// Current distance in mm from the start of the motion.
    pub travel_mm: PositionMm,
    /// Distance in mm at the end of the motion; equal to `travel_mm` if no end is planned.
    pub target_mm: PositionMm,
    /// Speed of the reference, mm/s.
    pub velocity_mm_s: VelocityMmS,
}

/// References of the wheels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TravelSetpoint {
    /// Left and right.
    pub wheels: [WheelTravel; WHEELS],
    /// Changes whenever a new motion begins: layer 0 then takes the wheels' present references as the new origins.
    pub segment: u16,
}

impl TravelSetpoint {
    /// Both wheels alike.
    #[must_use]
    pub const fn common(wheel: WheelTravel, segment: u16) -> Self {
        Self {
            wheels: [wheel; WHEELS],
            segment,
        }
    }
}

/// A foot is lowered fast to this height above the expected ground, then slowly.
pub const APPROACH_MM: PositionMm = PositionMm::from_int(10);
/// A stance presses on by this much beyond where its foot has touched, so that it takes its share of the load (4 mm
/// against the stiffness of the air, about 2.7 N/mm).
pub const PRESS_MM: PositionMm = PositionMm::from_int(4);
/// Cycles at full length, without ground, after which this is reported and the nose goes down (200 ms).
pub const NO_GROUND: u16 = 20;

/// Task of a leg in a walk, as shown by its vertical cylinder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LegPlan {
    /// Foot on the ground.
    #[default]
    Stance,
    /// Foot rises.
    Lift,
    /// Foot on its way to the foothold.
    Reach,
    /// Foot being lowered: fast to this stroke, [`APPROACH_MM`] above the expected ground, then slowly.
    Lower(
        /// mm.
        PositionMm,
    ),
}

/// Plan of a walk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WalkPlan {
    /// Left and right leg.
    pub legs: [LegPlan; WHEELS],
    /// The robot should make progress.
    pub driven: bool,
}

impl WalkPlan {
    /// The plan of one leg.
    #[must_use]
    pub fn leg(&self, side: Side) -> LegPlan {
        self.legs.get(side.index()).copied().unwrap_or_default()
    }
}

/// Progress of a foot being lowered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Landing {
    /// It is not being lowered, or is still on its way.
    #[default]
    Waiting,
    /// It stands, b6 at this stroke, mm.
    Down(
        /// mm.
        PositionMm,
    ),
    /// The leg has been at full length for this many cycles and has found no ground.
    Nothing(
        /// Cycles.
        u16,
    ),
}

/// Reports of layer 0's behaviours to the walk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Acts {
    /// Those that may act.
    pub enabled: Behaviours,
    /// Progress of the feet being lowered.
    pub landing: [Landing; WHEELS],
    /// A standing foot has lost the ground and follows it.
    pub lost: [bool; WHEELS],
    /// It has followed as far as it may: the ground below counts as a separate foothold.
    pub deep: [bool; WHEELS],
    /// How far a standing leg's b6 is extended beyond its reference, mm.
    pub beyond_mm: [PositionMm; WHEELS],
    /// Axes that work at their limit, do not move, and are held in place.
    pub overload: [bool; JOINTS],
    /// How often a swinging foot has run against something (wraps); a count, because layer 1 may miss a cycle.
    pub bumps: [u8; WHEELS],
    /// How often the robot has made no progress for a long time (wraps).
    pub stuck: u8,
    /// Share of the walk's speed at which the wheels move, 0 to 1.
    pub pace: I16F16,
    /// Distance by which the wheels are moved back in a cycle, mm: they give way because their torque holds the nose
    /// up.
    pub back_mm: PositionMm,
}

impl Default for Acts {
    fn default() -> Self {
        Self {
            enabled: Behaviours::ALL,
            landing: [Landing::Waiting; WHEELS],
            lost: [false; WHEELS],
            deep: [false; WHEELS],
            beyond_mm: [PositionMm::ZERO; WHEELS],
            overload: [false; JOINTS],
            bumps: [0; WHEELS],
            stuck: 0,
            pace: I16F16::ONE,
            back_mm: PositionMm::ZERO,
        }
    }
}

/// One cycle's references, layer 1 to layer 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setpoints {
    /// Time for which they were computed, µs.
    pub time_us: u64,
    /// Phase of the motion.
    pub phase: Phase,
    /// Step of the gait, from 0.
    pub step: u16,
    /// Leg that steps, if any.
    pub stepping: Option<Side>,
    /// References of the joints; `None` withdraws the joint.
    pub joints: [Option<JointSetpoint>; JOINTS],
    /// Reference of the wheels; `None` withdraws them.
    pub travel: Option<TravelSetpoint>,
    /// Plan of the walk; `None`: none is under way, and no behaviour acts.
    pub walk: Option<WalkPlan>,
    /// Speed and acceleration of future pushes, for wheel boards that make their own profile; `None` leaves
    /// them unchanged.
    pub push: Option<PushProfile>,
    /// How often the user has frozen all axes (wraps): each time also ends directly commanded motions.
    pub holds: u8,
    /// Number of the permission to move ([`Feedback::permit`]) for which they were computed; set-points with another
    /// number are ignored.
    pub permit: u16,
}

/// Shape of a push of the wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PushProfile {
    /// Largest speed, mm/s.
    pub speed_mm_s: VelocityMmS,
    /// Acceleration, mm/s².
    pub acceleration_mm_s2: I16F16,
}

impl Setpoints {
    /// No references at all.
    #[must_use]
    pub const fn idle(time_us: u64) -> Self {
        Self {
            time_us,
            phase: Phase::Idle,
            step: 0,
            stepping: None,
            joints: [None; JOINTS],
            travel: None,
            walk: None,
            push: None,
            holds: 0,
            permit: 0,
        }
    }
}

/// One cycle's measurements, layer 0 to layer 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Feedback {
    /// Start of the cycle to which the replies belong, µs.
    pub time_us: u64,
    /// Measured strokes, mm; `None` if the node did not answer in this cycle.
    pub strokes_mm: [Option<PositionMm>; JOINTS],
    /// Switches of the left and right foot that count, without those that are found stuck closed; `None` if not heard.
    pub feet: [Option<FootSwitches>; WHEELS],
    /// Mean wheel travel since start-up, µm (positive forward).
    pub travel_um: i64,
    /// Travel of the left and the right wheel since start-up, µm (positive forward).
    pub wheels_um: [i64; WHEELS],
    /// State of layer 0's behaviours.
    pub acts: Acts,
    /// All nodes armed, alive and free of faults: motion may continue.
    pub motion_allowed: bool,
    /// Number of the permission to move (wraps). A stop, a clear or an arming ends a permission and with it every
    /// motion, even that of a layer 1 that has not noticed.
    pub permit: u16,
}
