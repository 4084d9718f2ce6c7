//! A rock: an ellipsoid, upright, most of it buried.
//!
//! # Closest place to a point
//!
//! With the semi-axes aᵢ and the point p in the rock's own axes, the closest place is
//! qᵢ = aᵢ² pᵢ/(t + aᵢ²), where t is the root of Σ (aᵢ pᵢ/(t + aᵢ²))² = 1; the distance is t|w|
//! with wᵢ = pᵢ/(t + aᵢ²), which is along the normal (Eberly, *Distance from a Point to an
//! Ellipsoid*, 2013). The root is found on the reciprocal of the left side's square root, which
//! is nearly straight, and straight for a sphere.
//!
//! # Closest place to a disc
//!
//! The rim's angle θ and t together solve that equation and the condition that the rim runs along
//! the surface, w · dp/dθ = 0: Newton's method in two unknowns. Where the distance still falls
//! from the rim inwards, the rock touches the wheel's side, and the disc's plane decides.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::surface::{Bounds, Disc, Near, Surface};
use crate::hash::StateHasher;

/// Relative accuracy of the roots.
const CLOSE: f64 = 1e-13;
/// Steps of Newton's method this small, relative, are the last: the error squares at each.
const LAST: f64 = 1e-7;
/// More than the relative rounding of a comparison.
const ROUNDING: f64 = 1e-9;
/// Steps to a root that only begins a search.
const FIRST: usize = 1;
/// Most steps to a root.
const STEPS: usize = 40;
/// Rim angles tried where Newton's method does not settle.
const TRIES: usize = 48;

/// An ellipsoid with one vertical axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Ellipsoid {
    centre_m: Vector3<f64>,
    /// Semi-axes: along its heading, across, up.
    radii_m: Vector3<f64>,
    /// Of its heading from X to Y.
    cos: f64,
    sin: f64,
}

/// Distance and unit normal, in the rock's axes.
type Found = (f64, Vector3<f64>);

impl Ellipsoid {
    /// About a centre \[m\], with the semi-axes along its heading, across and up \[m\], above 0;
    /// the heading turns from X to Y \[rad\].
    #[must_use]
    pub fn new(centre_m: Vector3<f64>, radii_m: Vector3<f64>, heading_rad: f64) -> Self {
        let (sin, cos) = libm::sincos(heading_rad);
        Self {
            centre_m,
            radii_m,
            cos,
            sin,
        }
    }

    /// Centre \[m\].
    #[must_use]
    pub fn centre_m(&self) -> Vector3<f64> {
        self.centre_m
    }

    /// Semi-axes along its heading, across and up \[m\].
    #[must_use]
    pub fn radii_m(&self) -> Vector3<f64> {
        self.radii_m
    }

    /// Heading from X to Y \[rad\].
    #[must_use]
    pub fn heading_rad(&self) -> f64 {
        libm::atan2(self.sin, self.cos)
    }

    #[inline]
    fn own(&self, v: &Vector3<f64>) -> Vector3<f64> {
        let (c, s) = (self.cos, self.sin);
        Vector3::new(c * v.x + s * v.y, c * v.y - s * v.x, v.z)
    }

    #[inline]
    fn world(&self, v: &Vector3<f64>) -> Vector3<f64> {
        let (c, s) = (self.cos, self.sin);
        Vector3::new(c * v.x - s * v.y, s * v.x + c * v.y, v.z)
    }

    #[inline]
    fn squares(&self) -> Vector3<f64> {
        self.radii_m.component_mul(&self.radii_m)
    }

    /// The root t for a point in the rock's axes; `None` at its centre.
    #[inline]
    fn root(&self, p: &Vector3<f64>, squares: &Vector3<f64>, steps: usize) -> Option<f64> {
        let least = -squares.min() * (1.0 - 1e-9);
        let mut t = 0.0_f64;
        for _ in 0..steps {
            let per = squares.map(|square| 1.0 / (t + square));
            let w = p.component_mul(&per);
            let shares = squares.component_mul(&w.component_mul(&w));
            let sum = shares.sum();
            let slope = 2.0 * shares.dot(&per);
            if slope < 1e-30 {
                return None;
            }
            let step = (sum.sqrt() - 1.0) * 2.0 * sum / slope;
            t = (t + step).max(least);
            if step.abs() <= CLOSE * (squares.min() + t.abs()) {
                break;
            }
        }
        Some(t)
    }

    /// Distance and normal at a root.
    #[inline]
    fn at_root(p: &Vector3<f64>, squares: &Vector3<f64>, t: f64) -> Found {
        let w = p.component_div(&squares.add_scalar(t));
        let size = w.norm();
        (t * size, w / size)
    }

    /// Of a point in the rock's axes.
    #[inline]
    fn closest(&self, p: &Vector3<f64>) -> Found {
        let squares = self.squares();
        self.root(p, &squares, STEPS).map_or_else(
            || (-self.radii_m.z, Vector3::z()),
            |t| Self::at_root(p, &squares, t),
        )
    }

    /// Newton's method for the rim; also returns the point of the rim. `None` if it does not settle at a
    /// least distance.
    fn on_rim(&self, rim: &Rim, start: Vector3<f64>) -> Option<(Found, Vector3<f64>)> {
        let squares = self.squares();
        let r = rim.radius_m;
        let mut out = start;
        let mut t = self.root(&(rim.centre + r * out), &squares, FIRST)?;
        for _ in 0..STEPS {
            let along = rim.axis.cross(&out);
            let p = rim.centre + r * out;
            let per = squares.map(|square| 1.0 / (t + square));
            let w = p.component_mul(&per);
            let shares = squares.component_mul(&w);
            let flat = along.component_mul(&per);
            // On the surface, and along it; derivatives by θ and t.
            let g = shares.dot(&w) - 1.0;
            let h = w.dot(&along);
            let g_by_angle = 2.0 * r * shares.dot(&flat);
            let g_by_t = -2.0 * shares.dot(&w.component_mul(&per));
            let h_by_angle = r * flat.dot(&along) - w.dot(&out);
            let h_by_t = -w.dot(&flat);
            let per_det = 1.0 / (g_by_angle * h_by_t - g_by_t * h_by_angle);
            let turn = (g_by_t * h - h_by_t * g) * per_det;
            let step = (h_by_angle * g - g_by_angle * h) * per_det;
            if !(turn.abs() < 1.0 && t + step > -squares.min()) {
                return None;
            }
            let is_last = turn.abs() < LAST && step.abs() <= LAST * (squares.min() + t.abs());
            out = (out + turn * along) * (1.0 / (1.0 + turn * turn).sqrt());
            t += step;
            if is_last {
                let least = h_by_angle - h_by_t * g_by_angle / g_by_t > 0.0;
                let p = rim.centre + r * out;
                return least.then(|| (Self::at_root(&p, &squares, t), p));
            }
        }
        None
    }

    /// The rim tried all round, then halved down.
    fn round_rim(&self, rim: &Rim) -> (Found, Vector3<f64>) {
        let across = rim.axis.cross(&rim.down);
        let at = |angle: f64| {
            let (s, c) = libm::sincos(angle);
            rim.centre + rim.radius_m * (c * rim.down + s * across)
        };
        let far = |angle: f64| self.closest(&at(angle)).0;
        let mut width = std::f64::consts::TAU / TRIES as f64;
        let mut best = (f64::INFINITY, 0.0);
        for k in 0..TRIES {
            let angle = k as f64 * width;
            let distance = far(angle);
            if distance < best.0 {
                best = (distance, angle);
            }
        }
        while width > 1e-9 {
            width *= 0.5;
            for angle in [best.1 - width, best.1 + width] {
                let distance = far(angle);
                if distance < best.0 {
                    best = (distance, angle);
                }
            }
        }
        let p = at(best.1);
        (self.closest(&p), p)
    }
}

/// A disc in the rock's axes.
struct Rim {
    centre: Vector3<f64>,
    axis: Vector3<f64>,
    /// Unit vector of the disc's plane.
    down: Vector3<f64>,
    radius_m: f64,
}

impl Surface for Ellipsoid {
    #[inline]
    fn to_point(&self, point_m: &Vector3<f64>) -> Near {
        let (distance_m, normal) = self.closest(&self.own(&(point_m - self.centre_m)));
        Near {
            distance_m,
            normal: self.world(&normal),
            point_m: *point_m,
        }
    }

    /// Whether a plane square to the rock's surface towards the ball's centre separates the two: each reaches so
    /// far along its normal, the rock by the root of the centre's place on it. Most rocks near a body need no
    /// more than this.
    #[inline]
    fn is_clear_of_ball(&self, centre_m: &Vector3<f64>, radius_m: f64) -> bool {
        let centre = self.own(&(centre_m - self.centre_m));
        let normal = centre.component_div(&self.squares());
        let along = normal.dot(&centre);
        along - radius_m * normal.norm() > along.sqrt() * (1.0 + ROUNDING)
    }

    #[inline]
    fn is_clear_of_wheel(&self, disc: &Disc, to_a_side_m: f64) -> bool {
        let centre = self.own(&(disc.centre_m - self.centre_m));
        let axis = self.own(&disc.axis);
        let normal = centre.component_div(&self.squares());
        let aside = normal.dot(&axis);
        let across = (normal.norm_squared() - aside * aside).max(0.0).sqrt();
        let wheel = disc.radius_m * across + to_a_side_m * aside.abs();
        let along = normal.dot(&centre);
        along - wheel > along.sqrt() * (1.0 + ROUNDING)
    }

    fn to_disc(&self, disc: &Disc) -> Option<Near> {
        let centre = self.own(&(disc.centre_m - self.centre_m));
        let axis = self.own(&disc.axis);
        // Towards the rock, within the disc's plane.
        let aside = axis.dot(&centre);
        let inward = aside * axis - centre;
        let towards = inward.try_normalize(1e-9).or_else(|| {
            let down = -Vector3::z() + axis.z * axis;
            down.try_normalize(1e-9)
        })?;
        let rim = Rim {
            centre,
            axis,
            down: towards,
            radius_m: disc.radius_m,
        };
        let ((distance_m, normal), point) = self
            .on_rim(&rim, towards)
            .unwrap_or_else(|| self.round_rim(&rim));
        let (distance_m, normal, point) = if normal.dot(&(point - centre)) <= 0.0 {
            (distance_m, normal, point)
        } else {
            let squares = self.squares();
            let high = squares.dot(&axis.component_mul(&axis)).sqrt();
            let side = 1.0_f64.copysign(aside);
            let touching = squares.component_mul(&axis) * (side / high);
            let in_plane = touching + (aside - axis.dot(&touching)) * axis;
            (aside.abs() - high, side * axis, in_plane)
        };
        Some(Near {
            distance_m,
            normal: self.world(&normal),
            point_m: self.centre_m + self.world(&point),
        })
    }

    fn top_m(&self) -> f64 {
        self.centre_m.z + self.radii_m.z
    }

    fn height_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        let from = Vector3::new(x_m - self.centre_m.x, y_m - self.centre_m.y, 0.0);
        let p = self.own(&from).component_div(&self.radii_m);
        let left = 1.0 - p.norm_squared();
        (left >= 0.0).then(|| self.centre_m.z + self.radii_m.z * left.sqrt())
    }

    fn bounds(&self) -> Option<Bounds> {
        let (a, b) = (self.radii_m.x, self.radii_m.y);
        let wide = libm::hypot(a * self.cos, b * self.sin);
        let long = libm::hypot(a * self.sin, b * self.cos);
        let (c, half) = (&self.centre_m, [wide, long, self.radii_m.z]);
        Some(Bounds {
            low_m: std::array::from_fn(|i| c[i] - half[i]),
            high_m: std::array::from_fn(|i| c[i] + half[i]),
        })
    }

    fn feed(&self, hasher: &mut StateHasher) {
        hasher.bytes(b"ellipsoid");
        let values = self.centre_m.iter().chain(self.radii_m.iter());
        values
            .chain([&self.cos, &self.sin])
            .for_each(|v| hasher.f64(*v));
    }
}
