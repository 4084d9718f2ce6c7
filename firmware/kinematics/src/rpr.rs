//! The RPR chain, open: yaw cylinder angle θ1, its length b2, relative crank angle θ3.
//!
//! Coordinate vectors are in the order [θ1, b2, θ3] (rad, m, rad). The tip is the crank's end in
//! F1; on the closed leg it is O4 and does not move.

use nalgebra::{Matrix6x3, Vector3, Vector6};

use crate::error::{all_finite, finite};
use crate::{KinematicsError, Quantity, Scalar, Theta3};

/// The open chain at one position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rpr<T> {
    crank_m: T,
    b2_m: T,
    sin1: T,
    cos1: T,
    sin_phi: T,
    cos_phi: T,
}

impl<T: Scalar> Rpr<T> {
    /// Takes the crank ℓ (m), θ1 (rad), b2 (m) and the relative crank angle.
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`].
    pub fn new(
        crank_m: T,
        theta1_rad: T,
        b2_m: T,
        theta3: Theta3<T>,
    ) -> Result<Self, KinematicsError<T>> {
        finite(Quantity::Parameter, crank_m)?;
        all_finite(Quantity::Coordinate, &[theta1_rad, b2_m, theta3.rad()])?;
        let (sin1, cos1) = theta1_rad.sin_cos();
        // φ = θ1 + θ3 − π: both functions change sign.
        let (sin13, cos13) = (theta1_rad + theta3.rad()).sin_cos();
        let chain = Self {
            crank_m,
            b2_m,
            sin1,
            cos1,
            sin_phi: -sin13,
            cos_phi: -cos13,
        };
        all_finite(Quantity::Result, chain.tip().iter())?;
        Ok(chain)
    }

    /// Tip position in F1 (m), (23).
    pub fn tip(&self) -> Vector3<T> {
        Vector3::new(
            self.b2_m * self.sin1 + self.crank_m * self.cos_phi,
            -self.b2_m * self.cos1 + self.crank_m * self.sin_phi,
            T::zero(),
        )
    }

    /// Jacobian of the tip twist [ω; ṗ] (31*).
    pub fn jacobian(&self) -> Matrix6x3<T> {
        let (o, l) = (T::zero(), T::one());
        let tip = self.tip();
        #[rustfmt::skip]
        let j = Matrix6x3::new(
            o,      o,          o,
            o,      o,          o,
            l,      o,          l,
            -tip.y, self.sin1,  -self.crank_m * self.sin_phi,
            tip.x,  -self.cos1, self.crank_m * self.cos_phi,
            o,      o,          o,
        );
        j
    }

    /// Tip twist [ω; ṗ] (rad/s, m/s), (32*).
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`].
    pub fn twist(&self, rates: &Vector3<T>) -> Result<Vector6<T>, KinematicsError<T>> {
        all_finite(Quantity::Rate, rates.iter())?;
        let twist = self.jacobian() * rates;
        all_finite(Quantity::Result, twist.iter())?;
        Ok(twist)
    }

    /// Time derivative of the tip twist (rad/s², m/s²), (38*).
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
        let (w1, v2, w3) = (rates.x, rates.y, rates.z);
        let phi_dot = w1 + w3;
        let along = -self.b2_m * w1 * w1;
        let across = v2 * w1 + v2 * w1;
        let centripetal = self.crank_m * phi_dot * phi_dot;
        let mut result = self.jacobian() * accelerations;
        result += Vector6::new(
            T::zero(),
            T::zero(),
            T::zero(),
            along * self.sin1 + across * self.cos1 - centripetal * self.cos_phi,
            -along * self.cos1 + across * self.sin1 - centripetal * self.sin_phi,
            T::zero(),
        );
        all_finite(Quantity::Result, result.iter())?;
        Ok(result)
    }
}
