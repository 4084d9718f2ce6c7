//! The contacts one by one, for callers that inspect them. The loop itself needs only their sums.

use std::cell::RefCell;

use nalgebra::Vector3;

/// The part of the robot that touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Toucher {
    /// A sphere of a foot: 0 left, 1 right; 0 centre, 1 front, 2 left, 3 back, 4 right.
    Foot(usize, usize),
    /// A disc of a wheel: 0 left, 1 right; 0 left, 1 middle, 2 right. In soil the wheel is one contact, 1.
    Wheel(usize, usize),
    /// A point of the chassis, in the order of [`ChassisContact::points_m`](super::ChassisContact::points_m).
    Chassis(usize),
}

/// One contact with one part of the terrain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactPoint {
    /// The touching part.
    pub toucher: Toucher,
    /// Where \[m\], world axes.
    pub point_m: Vector3<f64>,
    /// Outward unit normal of the ground.
    pub normal: Vector3<f64>,
    /// Force on the robot \[N\], world axes.
    pub force_n: Vector3<f64>,
    /// Penetration, or sinkage in soil \[m\].
    pub depth_m: f64,
    /// Speed along the ground \[m/s\]; of a wheel in soil, of its lugs' tips.
    pub slip_m_s: f64,
    /// Static friction of the pair; in soil, of the soil.
    pub friction: f64,
    /// Number of the part of the terrain, from 0.
    pub part: usize,
    /// The part is soft.
    pub soft: bool,
}

/// Where contacts are noted, if a caller wants them.
pub(super) type Notes<'a> = Option<&'a RefCell<Vec<ContactPoint>>>;
