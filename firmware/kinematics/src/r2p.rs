//! The R2P chain: leg yaw θ4, horizontal cylinder b5, vertical cylinder b6.
//!
//! Coordinate vectors, their rates and accelerations are in the order [θ4, b5, b6], in (rad, m, m)
//! and derivatives. Foot vectors are in F4.

use nalgebra::{Matrix6x3, Vector3, Vector6};

use crate::error::{all_finite, finite};
use crate::{KinematicsError, Quantity, Scalar};

/// The chain at one position, with the sine and cosine of θ4 computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct R2p<T> {
    sin4: T,
    cos4: T,
    b5_m: T,
    b6_m: T,
}

impl<T: Scalar> R2p<T> {
    /// Takes θ4 (rad), b5 and b6 (m).
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`].
    pub fn new(theta4_rad: T, b5_m: T, b6_m: T) -> Result<Self, KinematicsError<T>> {
        all_finite(Quantity::Coordinate, &[theta4_rad, b5_m, b6_m])?;
        let (sin4, cos4) = theta4_rad.sin_cos();
        Ok(Self {
            sin4,
            cos4,
            b5_m,
            b6_m,
        })
    }

    /// The chain from a known direction of the leg; `sin4² + cos4² = 1` is the caller's.
    pub(crate) fn from_direction(sin4: T, cos4: T, b5_m: T, b6_m: T) -> Self {
        Self {
            sin4,
            cos4,
            b5_m,
            b6_m,
        }
    }

    /// Inverse position (7*), branch b5 > 0. No trigonometric function is evaluated.
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`]; [`KinematicsError::FootOnYawAxis`] if the foot is closer to
    /// the axis than `minimum_m` (less a few roundings, so that the limit itself is accepted).
    pub fn from_foot(foot: &Vector3<T>, minimum_m: T) -> Result<Self, KinematicsError<T>> {
        all_finite(Quantity::FootPosition, foot.iter())?;
        finite(Quantity::Parameter, minimum_m)?;
        let radius_m = finite(Quantity::Result, foot.x.hypot(foot.y))?;
        let rounding = minimum_m * T::default_epsilon() * crate::lit(16.0);
        if radius_m <= T::zero() || radius_m < minimum_m - rounding {
            return Err(KinematicsError::FootOnYawAxis {
                radius_m,
                minimum_m,
            });
        }
        Ok(Self {
            sin4: foot.x / radius_m,
            cos4: -foot.y / radius_m,
            b5_m: radius_m,
            b6_m: -foot.z,
        })
    }

    /// [θ4, b5, b6] (rad, m, m), θ4 in (−π, π].
    pub fn coordinates(&self) -> Vector3<T> {
        Vector3::new(self.sin4.atan2(self.cos4), self.b5_m, self.b6_m)
    }

    /// (sin θ4, cos θ4).
    pub fn sin_cos_theta4(&self) -> (T, T) {
        (self.sin4, self.cos4)
    }

    /// Foot position (m), (6).
    pub fn foot(&self) -> Vector3<T> {
        Vector3::new(self.b5_m * self.sin4, -self.b5_m * self.cos4, -self.b6_m)
    }

    /// Jacobian of the foot twist [ω; ṗ] (11*); prismatic columns are [0; e].
    pub fn jacobian(&self) -> Matrix6x3<T> {
        let (s, c, b, o, l) = (self.sin4, self.cos4, self.b5_m, T::zero(), T::one());
        #[rustfmt::skip]
        let j = Matrix6x3::new(
            o,     o,  o,
            o,     o,  o,
            l,     o,  o,
            b * c, s,  o,
            b * s, -c, o,
            o,     o,  -l,
        );
        j
    }

    /// Twist [ω; ṗ] (rad/s, m/s), (13*).
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`].
    pub fn twist(&self, rates: &Vector3<T>) -> Result<Vector6<T>, KinematicsError<T>> {
        all_finite(Quantity::Rate, rates.iter())?;
        let twist = self.jacobian() * rates;
        all_finite(Quantity::Result, twist.iter())?;
        Ok(twist)
    }

    /// Time derivative of the twist (rad/s², m/s²), (16*).
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`].
    pub fn twist_dot(
        &self,
        rates: &Vector3<T>,
        accelerations: &Vector3<T>,
    ) -> Result<Vector6<T>, KinematicsError<T>> {
        all_finite(Quantity::Rate, rates.iter())?;
        all_finite(Quantity::Acceleration, accelerations.iter())?;
        let (s, c, b) = (self.sin4, self.cos4, self.b5_m);
        let (w, v) = (rates.x, rates.y);
        let coriolis = w * v + w * v;
        let centripetal = b * w * w;
        let mut result = self.jacobian() * accelerations;
        result += Vector6::new(
            T::zero(),
            T::zero(),
            T::zero(),
            coriolis * c - centripetal * s,
            coriolis * s + centripetal * c,
            T::zero(),
        );
        all_finite(Quantity::Result, result.iter())?;
        Ok(result)
    }

    /// Rates [θ̇4, ḃ5, ḃ6] from a foot velocity (m/s).
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`]; [`KinematicsError::FootOnYawAxis`] if b5 is not positive.
    pub fn rates(&self, velocity: &Vector3<T>) -> Result<Vector3<T>, KinematicsError<T>> {
        all_finite(Quantity::FootVelocity, velocity.iter())?;
        self.check_off_axis()?;
        let (s, c) = (self.sin4, self.cos4);
        let rates = Vector3::new(
            (velocity.x * c + velocity.y * s) / self.b5_m,
            velocity.x * s - velocity.y * c,
            -velocity.z,
        );
        all_finite(Quantity::Result, rates.iter())?;
        Ok(rates)
    }

    /// Accelerations [θ̈4, b̈5, b̈6] from rates [θ̇4, ḃ5, ḃ6] and a foot acceleration (m/s²).
    ///
    /// # Errors
    /// As [`R2p::rates`].
    pub fn accelerations(
        &self,
        rates: &Vector3<T>,
        acceleration: &Vector3<T>,
    ) -> Result<Vector3<T>, KinematicsError<T>> {
        all_finite(Quantity::Rate, rates.iter())?;
        all_finite(Quantity::FootAcceleration, acceleration.iter())?;
        self.check_off_axis()?;
        let (s, c, b) = (self.sin4, self.cos4, self.b5_m);
        let (w, v) = (rates.x, rates.y);
        let result = Vector3::new(
            (acceleration.x * c + acceleration.y * s - (w * v + w * v)) / b,
            acceleration.x * s - acceleration.y * c + b * w * w,
            -acceleration.z,
        );
        all_finite(Quantity::Result, result.iter())?;
        Ok(result)
    }

    fn check_off_axis(&self) -> Result<(), KinematicsError<T>> {
        if self.b5_m > T::zero() {
            return Ok(());
        }
        Err(KinematicsError::FootOnYawAxis {
            radius_m: self.b5_m,
            minimum_m: T::zero(),
        })
    }
}
