//! The ground: bodies that do not move, each with its material.
//!
//! The touching shape is a point (the centre of a sphere, the corner of a box) or a disc (a slice of a
//! wheel). A [`Surface`] answers both with its closest place: distance, outward normal, point. World axes: X
//! and Y horizontal, Z up, gravity vertical on any slope.

mod ellipsoid;
mod height_map;
mod index;
mod overlap;
mod plane;
mod rim;
mod rocks;
mod solid;
mod surface;

use std::sync::Arc;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};
use crate::hash::StateHasher;
use crate::soil::Soil;
pub use ellipsoid::Ellipsoid;
pub use height_map::{HeightMap, HeightMapError, MOST as MOST_VALUES, STEEPEST_DEG};
pub use index::Index;
pub use overlap::{Heap, MOST_OVER_A_PLACE, heap};
pub use plane::Plane;
pub use rim::{Rim, RimTouch};
pub use rocks::{MOST_ROCKS, RockError, RockField};
pub use solid::Solid;
pub use surface::{Bounds, Disc, Near, Surface};

/// A kind of surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Shape {
    /// Everything below a plane.
    Plane(Plane),
    /// A convex body with flat faces.
    Solid(Solid),
    /// A rock.
    Ellipsoid(Ellipsoid),
    /// Everything below a surface of measured heights.
    HeightMap(Arc<HeightMap>),
}

impl Shape {
    #[inline]
    fn surface(&self) -> &dyn Surface {
        match self {
            Self::Plane(s) => s,
            Self::Solid(s) => s,
            Self::Ellipsoid(s) => s,
            Self::HeightMap(s) => &**s,
        }
    }
}

impl Surface for Shape {
    #[inline]
    fn to_point(&self, point_m: &Vector3<f64>) -> Near {
        match self {
            Self::Plane(s) => s.to_point(point_m),
            Self::Solid(s) => s.to_point(point_m),
            Self::Ellipsoid(s) => s.to_point(point_m),
            Self::HeightMap(s) => s.to_point(point_m),
        }
    }

    #[inline]
    fn to_disc(&self, disc: &Disc) -> Option<Near> {
        match self {
            Self::Plane(s) => s.to_disc(disc),
            Self::Solid(s) => s.to_disc(disc),
            Self::Ellipsoid(s) => s.to_disc(disc),
            Self::HeightMap(s) => s.to_disc(disc),
        }
    }

    #[inline]
    fn is_clear_of_ball(&self, centre_m: &Vector3<f64>, radius_m: f64) -> bool {
        match self {
            Self::Solid(s) => s.is_clear_of_ball(centre_m, radius_m),
            Self::Ellipsoid(s) => s.is_clear_of_ball(centre_m, radius_m),
            Self::Plane(_) | Self::HeightMap(_) => false,
        }
    }

    #[inline]
    fn is_clear_of_wheel(&self, disc: &Disc, to_a_side_m: f64) -> bool {
        match self {
            Self::Solid(s) => s.is_clear_of_wheel(disc, to_a_side_m),
            Self::Ellipsoid(s) => s.is_clear_of_wheel(disc, to_a_side_m),
            Self::Plane(_) | Self::HeightMap(_) => false,
        }
    }

    fn top_m(&self) -> f64 {
        self.surface().top_m()
    }

    fn height_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        self.surface().height_m(x_m, y_m)
    }

    fn top_near_m(&self, x_m: f64, y_m: f64, reach_m: f64) -> f64 {
        self.surface().top_near_m(x_m, y_m, reach_m)
    }

    fn bounds(&self) -> Option<Bounds> {
        self.surface().bounds()
    }

    fn feed(&self, hasher: &mut StateHasher) {
        self.surface().feed(hasher);
    }
}

/// Material of a surface. Friction is that of the pair: the smaller of body and ground.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Highest static friction that it gives.
    pub mu_static: f64,
    /// Highest kinetic friction that it gives, at most the static one.
    pub mu_kinetic: f64,
    /// Soft soil; steep faces of it, and what of the robot is neither wheel nor foot, have the
    /// frictions above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub soil: Option<Soil>,
}

impl Material {
    /// Rough rock or floor: friction is that of the robot's soles and tyres.
    pub const ROUGH: Self = Self {
        mu_static: 10.0,
        mu_kinetic: 10.0,
        soil: None,
    };

    /// Soft soil.
    #[must_use]
    pub fn soft(soil: Soil) -> Self {
        Self {
            mu_static: soil.friction(),
            mu_kinetic: soil.friction(),
            soil: Some(soil),
        }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the field.
    pub fn validate(&self) -> Result<(), PlantError> {
        check("terrain.mu_static", self.mu_static, 0.0, 10.0)?;
        check("terrain.mu_kinetic", self.mu_kinetic, 0.0, self.mu_static)?;
        self.soil.iter().try_for_each(Soil::validate)
    }
}

/// A surface and its material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// The surface.
    pub shape: Shape,
    /// Its material.
    pub material: Material,
}

/// The whole ground.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Terrain {
    /// Its parts; a body touches each on its own.
    pub parts: Vec<Part>,
}

impl Default for Terrain {
    /// A level floor at height 0.
    fn default() -> Self {
        Self {
            parts: vec![Part {
                shape: Shape::Plane(Plane::level(0.0)),
                material: Material::ROUGH,
            }],
        }
    }
}

impl Terrain {
    /// Checks every part.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the field.
    pub fn validate(&self) -> Result<(), PlantError> {
        self.parts.iter().try_for_each(|p| p.material.validate())
    }

    /// The same without rocks.
    #[must_use]
    pub fn height_below_rocks_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        let others = self.parts.iter().map(|p| &p.shape);
        let others = others.filter(|shape| !matches!(shape, Shape::Ellipsoid(_)));
        let heights = others.map(|shape| shape.height_m(x_m, y_m));
        heights.flatten().reduce(f64::max)
    }

    /// BLAKE3 of every part and its material.
    #[must_use]
    pub fn digest(&self) -> [u8; 32] {
        let mut hasher = StateHasher::new();
        for part in &self.parts {
            part.shape.feed(&mut hasher);
            hasher.f64(part.material.mu_static);
            hasher.f64(part.material.mu_kinetic);
            part.material.soil.iter().for_each(|s| s.feed(&mut hasher));
        }
        hasher.finish()
    }

    /// Height that no part of it exceeds \[m\].
    #[must_use]
    pub fn top_m(&self) -> f64 {
        let tops = self.parts.iter().map(|p| p.shape.top_m());
        tops.fold(f64::NEG_INFINITY, f64::max)
    }

    /// Height of the ground at a place \[m\]; `None` where there is none.
    #[must_use]
    pub fn height_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        let heights = self.parts.iter().map(|p| p.shape.height_m(x_m, y_m));
        heights.flatten().reduce(f64::max)
    }
}
