//! Wrenches of the ground on feet and wheels.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::dynamics::error::{DynamicsError, finite};

/// Moment and force on a body, world axes, at the body's contact reference point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    /// Moment about the reference point (N m).
    pub moment_n_m: Vector3<f64>,
    /// Force (N).
    pub force_n: Vector3<f64>,
}

impl Default for Wrench {
    fn default() -> Self {
        Self::ZERO
    }
}

impl Wrench {
    /// Nothing.
    pub const ZERO: Self = Self {
        moment_n_m: Vector3::new(0.0, 0.0, 0.0),
        force_n: Vector3::new(0.0, 0.0, 0.0),
    };

    /// A force (N) at the reference point itself.
    #[must_use]
    pub fn force(force_n: Vector3<f64>) -> Self {
        Self {
            force_n,
            ..Self::ZERO
        }
    }

    /// A force (N) at some point of the body, moved to the reference point (m, world axes).
    #[must_use]
    pub fn force_at(
        force_n: Vector3<f64>,
        point_m: &Vector3<f64>,
        reference_m: &Vector3<f64>,
    ) -> Self {
        Self {
            moment_n_m: (point_m - reference_m).cross(&force_n),
            force_n,
        }
    }
}

/// Ground on both feet, both wheels and the chassis; left first. Reference points: the sole's centre
/// (foot pad below P), the wheel's centre, the origin of B. The wheel's wrench acts on the turning wheel, so the driving
/// force of the ground, taken at the tread, brings its moment about the axle with it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Contacts {
    /// On the soles.
    pub feet: [Wrench; 2],
    /// On the wheels.
    pub wheels: [Wrench; 2],
    /// On the chassis.
    pub chassis: Wrench,
}

impl Contacts {
    /// Nothing touches.
    pub const NONE: Self = Self {
        feet: [Wrench::ZERO; 2],
        wheels: [Wrench::ZERO; 2],
        chassis: Wrench::ZERO,
    };

    /// In the order feet, wheels, chassis; left first.
    #[must_use]
    pub fn all(&self) -> [Wrench; 5] {
        let ([a, b], [c, d]) = (self.feet, self.wheels);
        [a, b, c, d, self.chassis]
    }

    /// Refuses NaN and infinity.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`], `contact`, index 6 × contact + entry of \[moment, force\].
    pub fn check(&self) -> Result<(), DynamicsError> {
        let all = self.all();
        let values: [f64; 30] = std::array::from_fn(|i| {
            let wrench = &all[i / 6];
            if i % 6 < 3 {
                wrench.moment_n_m[i % 3]
            } else {
                wrench.force_n[i % 3]
            }
        });
        finite("contact", &values)
    }
}
