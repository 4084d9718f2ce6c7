//! Queries that every kind of ground answers.

use nalgebra::Vector3;

use crate::hash::StateHasher;

/// The closest place of a surface, seen from a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Near {
    /// From the body to the surface \[m\]; negative: the body is in it by that depth.
    pub distance_m: f64,
    /// Outward unit normal of the surface there.
    pub normal: Vector3<f64>,
    /// Point of the body that is closest or deepest \[m\].
    pub point_m: Vector3<f64>,
}

/// A circular slice of a wheel: its rim touches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Centre \[m\].
    pub centre_m: Vector3<f64>,
    /// Unit vector along the axle.
    pub axis: Vector3<f64>,
    /// Radius \[m\], above 0.
    pub radius_m: f64,
}

/// A box around a body of limited size, along the axes of the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Its least coordinates \[m\].
    pub low_m: [f64; 3],
    /// Its largest coordinates \[m\].
    pub high_m: [f64; 3],
}

/// Something that carries robots.
pub trait Surface {
    /// Closest place to a point.
    fn to_point(&self, point_m: &Vector3<f64>) -> Near;

    /// Closest place to a disc; `None` if its plane does not meet the body.
    fn to_disc(&self, disc: &Disc) -> Option<Near>;

    /// Whether a quick look tells that a ball does not touch; where it is false, they may still be apart.
    fn is_clear_of_ball(&self, _centre_m: &Vector3<f64>, _radius_m: f64) -> bool {
        false
    }

    /// The same of a wheel: a disc that reaches so far to both sides.
    fn is_clear_of_wheel(&self, _disc: &Disc, _to_a_side_m: f64) -> bool {
        false
    }

    /// Height that no part of it exceeds \[m\].
    fn top_m(&self) -> f64;

    /// Height that no part of it within this distance along X and Y exceeds \[m\].
    fn top_near_m(&self, _x_m: f64, _y_m: f64, _reach_m: f64) -> f64 {
        self.top_m()
    }

    /// Height of the surface above a place \[m\]; `None` where it has none.
    fn height_m(&self, x_m: f64, y_m: f64) -> Option<f64>;

    /// A box around the body; `None`: it has no limits.
    fn bounds(&self) -> Option<Bounds> {
        None
    }

    /// Adds the surface to a hash.
    fn feed(&self, hasher: &mut StateHasher);
}
