//! A plane: level floor or slope.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::hash::StateHasher;

use super::surface::{Disc, Near, Surface};

/// Everything below a plane.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// Outward unit normal.
    normal: Vector3<f64>,
    /// Distance of the plane from the origin along the normal \[m\].
    offset_m: f64,
}

impl Plane {
    /// Level, at a height \[m\].
    #[must_use]
    pub fn level(height_m: f64) -> Self {
        Self {
            normal: Vector3::z(),
            offset_m: height_m,
        }
    }

    /// Through the origin, rising by `slope_rad` in the direction `azimuth_rad` from X to Y.
    #[must_use]
    pub fn sloping(slope_rad: f64, azimuth_rad: f64) -> Self {
        let ((sin, cos), (up_y, up_x)) = (libm::sincos(slope_rad), libm::sincos(azimuth_rad));
        Self {
            normal: Vector3::new(-sin * up_x, -sin * up_y, cos),
            offset_m: 0.0,
        }
    }

    /// The same plane, higher by `height_m` \[m\].
    #[must_use]
    pub fn raised(self, height_m: f64) -> Self {
        Self {
            offset_m: self.offset_m + self.normal.z * height_m,
            ..self
        }
    }

    /// Outward unit normal.
    #[must_use]
    pub fn normal(&self) -> Vector3<f64> {
        self.normal
    }
}

impl Surface for Plane {
    #[inline]
    fn to_point(&self, point_m: &Vector3<f64>) -> Near {
        Near {
            distance_m: self.normal.dot(point_m) - self.offset_m,
            normal: self.normal,
            point_m: *point_m,
        }
    }

    #[inline]
    fn to_disc(&self, disc: &Disc) -> Option<Near> {
        let n = &self.normal;
        // Down the plane within the disc; a disc that lies on its side has no lowest point.
        let within = n - n.dot(&disc.axis) * disc.axis;
        let size = within.norm();
        let reach = if size > 1e-9 {
            (-disc.radius_m / size) * within
        } else {
            Vector3::zeros()
        };
        Some(self.to_point(&(disc.centre_m + reach)))
    }

    fn top_m(&self) -> f64 {
        if self.normal.z >= 1.0 {
            self.offset_m
        } else {
            f64::INFINITY
        }
    }

    fn top_near_m(&self, x_m: f64, y_m: f64, reach_m: f64) -> f64 {
        let n = &self.normal;
        let rise = (n.x.abs() + n.y.abs()) * reach_m;
        (self.offset_m - n.x * x_m - n.y * y_m + rise) / n.z
    }

    fn height_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        let n = &self.normal;
        Some((self.offset_m - n.x * x_m - n.y * y_m) / n.z)
    }

    fn feed(&self, hasher: &mut StateHasher) {
        hasher.bytes(b"plane");
        let values = self.normal.iter().chain([&self.offset_m]);
        values.for_each(|v| hasher.f64(*v));
    }
}
