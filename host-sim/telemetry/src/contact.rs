//! Contacts with the ground, for pictures.

/// One contact of the robot with one part of the terrain, as it physically is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Link of the robot that touches.
    pub body: ContactBody,
    /// Where on it: a side of the sole, a disc of the wheel, a corner of the chassis.
    pub place: &'static str,
    /// Point, world axes, m.
    pub point_m: [f64; 3],
    /// Outward unit normal of the ground.
    pub normal: [f64; 3],
    /// Force on the robot, world axes, N.
    pub force_n: [f64; 3],
    /// Penetration, or sinkage in soil, m.
    pub depth_m: f64,
    /// Speed along the ground, m/s.
    pub slip_m_s: f64,
    /// Static friction of the pair.
    pub friction: f64,
    /// Number of the part of the terrain, from 0.
    pub part: usize,
}

/// A link that can touch the ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactBody {
    /// Left foot.
    LeftFoot,
    /// Right foot.
    RightFoot,
    /// Left wheel.
    LeftWheel,
    /// Right wheel.
    RightWheel,
    /// Chassis.
    Chassis,
}

impl ContactBody {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::LeftFoot,
        Self::RightFoot,
        Self::LeftWheel,
        Self::RightWheel,
        Self::Chassis,
    ];

    /// Name of its link in the URDF.
    #[must_use]
    pub const fn link(self) -> &'static str {
        match self {
            Self::LeftFoot => "left_foot",
            Self::RightFoot => "right_foot",
            Self::LeftWheel => "left_wheel",
            Self::RightWheel => "right_wheel",
            Self::Chassis => "chassis",
        }
    }
}
