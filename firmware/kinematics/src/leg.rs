//! The assembled leg: three cylinder lengths to foot and joints, and back.

use nalgebra::{Matrix3, Matrix6x3, Vector3, Vector6};

use crate::error::all_finite;
use crate::r2p::R2p;
use crate::{KinematicsError, LegGeometry, LegLengths, Phi, Quantity, Scalar, Theta3, wrap_two_pi};

/// The six joint coordinates of the leg's tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointAngles<T> {
    /// Yaw cylinder angle θ1 (rad), in [0, 2π).
    pub theta1_rad: T,
    /// Yaw cylinder length b2 (m).
    pub b2_m: T,
    /// Relative crank angle.
    pub theta3: Theta3<T>,
    /// Leg yaw θ4 (rad).
    pub theta4_rad: T,
    /// Horizontal cylinder length b5 (m).
    pub b5_m: T,
    /// Vertical cylinder length b6 (m).
    pub b6_m: T,
}

/// Foot position, velocity and acceleration in F4 (m, m/s, m/s²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootState<T> {
    /// Position (m).
    pub position: Vector3<T>,
    /// Velocity (m/s).
    pub velocity: Vector3<T>,
    /// Acceleration (m/s²).
    pub acceleration: Vector3<T>,
}

/// Cylinder lengths with their rates (m/s) and accelerations (m/s²), order [b2, b5, b6].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegRates<T> {
    /// Lengths.
    pub lengths: LegLengths<T>,
    /// Rates.
    pub rates: Vector3<T>,
    /// Accelerations.
    pub accelerations: Vector3<T>,
}

/// A leg at one set of lengths, with every direction the other quantities need.
///
/// Built with one square root and no trigonometric function; the fields are public because the
/// dynamics reads them each step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegPosture<T> {
    /// The lengths.
    pub lengths: LegLengths<T>,
    /// sin and cos of the leg yaw θ4. In the chassis, n = [cos θ4, sin θ4, 0] is the carriage's
    /// lateral axis and f = [sin θ4, −cos θ4, 0] its forward axis (e5).
    pub sin4: T,
    /// See `sin4`.
    pub cos4: T,
    /// sin and cos of the yaw cylinder angle θ1: u = [sin θ1, −cos θ1, 0] along the cylinder.
    pub sin1: T,
    /// See `sin1`.
    pub cos1: T,
    /// sin and cos of the relative crank angle θ3.
    pub sin3: T,
    /// See `sin3`.
    pub cos3: T,
    /// φ' = dφ/db2 = dθ4/db2 = −1/(ℓ cos θ3) (rad/m).
    pub phi_prime: T,
    /// θ1' = dθ1/db2 = tan θ3 / b2 (rad/m).
    pub theta1_prime: T,
    /// d(θ1')/db2 and d(φ')/db2 (rad/m²): Ṅ is these times ḃ2.
    pub theta1_second: T,
    /// See `theta1_second`.
    pub phi_second: T,
}

impl<T: Scalar> LegGeometry<T> {
    /// The leg at these lengths, home branch of the loop.
    ///
    /// Lengths beyond the strokes are accepted as long as the loop closes (end stops give way a
    /// little); see [`LegGeometry::check_strokes`].
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`], [`KinematicsError::LoopOpen`],
    /// [`KinematicsError::NoMomentArm`].
    pub fn posture(&self, lengths: &LegLengths<T>) -> Result<LegPosture<T>, KinematicsError<T>> {
        all_finite(Quantity::Coordinate, &lengths.to_array())?;
        let (cos_arc, sin_arc) = self.arc_from_b2(lengths.b2_m)?;
        // φ = β − arc
        let cos_phi = self.cos_beta * cos_arc + self.sin_beta * sin_arc;
        let sin_phi = self.sin_beta * cos_arc - self.cos_beta * sin_arc;
        self.assemble(lengths, sin_phi, cos_phi)
    }

    fn assemble(
        &self,
        lengths: &LegLengths<T>,
        sin_phi: T,
        cos_phi: T,
    ) -> Result<LegPosture<T>, KinematicsError<T>> {
        let crank = self.parameters().crank_m;
        let [xt, yt] = self.parameters().p4_m;
        let inv_b2 = T::one() / lengths.b2_m;
        // O3 = p4 − ℓ [cos φ, sin φ] = b2 u,  u = [sin θ1, −cos θ1]
        let sin1 = (xt - crank * cos_phi) * inv_b2;
        let cos1 = -(yt - crank * sin_phi) * inv_b2;
        // θ3 = φ + π − θ1
        let cos3 = -(cos_phi * cos1 + sin_phi * sin1);
        let sin3 = cos_phi * sin1 - sin_phi * cos1;
        self.check_arm(cos3)?;
        let inv_cos3 = T::one() / cos3;
        let tan3 = sin3 * inv_cos3;
        let phi_prime = -inv_cos3 / crank;
        let theta1_prime = tan3 * inv_b2;
        let theta3_prime = phi_prime - theta1_prime;
        let posture = LegPosture {
            lengths: *lengths,
            sin4: cos_phi,
            cos4: -sin_phi,
            sin1,
            cos1,
            sin3,
            cos3,
            phi_prime,
            theta1_prime,
            theta1_second: inv_b2 * (theta3_prime * inv_cos3 * inv_cos3 - theta1_prime),
            phi_second: tan3 * theta3_prime * phi_prime,
        };
        // Factors that the accessors multiply without being able to refuse: N, Ṅ and the foot Jacobian.
        let yaw_arm = lengths.b5_m * phi_prime;
        let terms = [
            theta1_prime,
            theta3_prime,
            yaw_arm,
            posture.theta1_second,
            posture.phi_second,
            posture.phi_second - posture.theta1_second,
        ];
        all_finite(Quantity::Result, &terms)?;
        Ok(posture)
    }

    /// The leg with its foot at a position in F4 (m): (7*), then (A1).
    ///
    /// Strokes are not checked; see [`LegGeometry::check_strokes`].
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`], [`KinematicsError::FootOnYawAxis`],
    /// [`KinematicsError::NoMomentArm`].
    pub fn inverse(&self, foot: &Vector3<T>) -> Result<LegPosture<T>, KinematicsError<T>> {
        let chain = R2p::from_foot(foot, self.parameters().min_foot_radius_m)?;
        let (sin4, cos4) = chain.sin_cos_theta4();
        let (sin_phi, cos_phi) = (-cos4, sin4);
        let crank = self.parameters().crank_m;
        let [xt, yt] = self.parameters().p4_m;
        // |O3| ≥ R − ℓ > 0
        let b2_m = (xt - crank * cos_phi).hypot(yt - crank * sin_phi);
        let q = chain.coordinates();
        self.assemble(&LegLengths::new(b2_m, q.y, q.z), sin_phi, cos_phi)
    }

    /// Lengths, rates and accelerations of the cylinders for a foot motion: (7*), (A1)–(A3).
    ///
    /// # Errors
    /// As [`LegGeometry::inverse`].
    pub fn inverse_motion(&self, foot: &FootState<T>) -> Result<LegRates<T>, KinematicsError<T>> {
        let leg = self.inverse(&foot.position)?;
        let chain = leg.chain();
        let rates = chain.rates(&foot.velocity)?;
        let accelerations = chain.accelerations(&rates, &foot.acceleration)?;
        // ḃ2 = φ̇/φ', φ̈ = φ' b̈2 + φ'' ḃ2²
        let b2_dot = rates.x / leg.phi_prime;
        let b2_ddot = (accelerations.x - leg.phi_second * b2_dot * b2_dot) / leg.phi_prime;
        let result = LegRates {
            lengths: leg.lengths,
            rates: Vector3::new(b2_dot, rates.y, rates.z),
            accelerations: Vector3::new(b2_ddot, accelerations.y, accelerations.z),
        };
        all_finite(Quantity::Result, result.rates.iter())?;
        all_finite(Quantity::Result, result.accelerations.iter())?;
        Ok(result)
    }
}

impl<T: Scalar> LegPosture<T> {
    fn chain(&self) -> R2p<T> {
        R2p::from_direction(self.sin4, self.cos4, self.lengths.b5_m, self.lengths.b6_m)
    }

    /// Absolute crank angle φ.
    pub fn phi(&self) -> Phi<T> {
        Phi::new((-self.cos4).atan2(self.sin4))
    }

    /// x = [θ1, b2, θ3, θ4, b5, b6].
    pub fn joints(&self) -> JointAngles<T> {
        JointAngles {
            theta1_rad: wrap_two_pi(self.sin1.atan2(self.cos1)),
            b2_m: self.lengths.b2_m,
            theta3: Theta3::new(self.sin3.atan2(self.cos3)),
            theta4_rad: self.phi().theta4_rad(),
            b5_m: self.lengths.b5_m,
            b6_m: self.lengths.b6_m,
        }
    }

    /// N of ẋ = N q̇, x = [θ1, b2, θ3, θ4, b5, b6], q = [b2, b5, b6].
    pub fn n(&self) -> Matrix6x3<T> {
        let (o, l) = (T::zero(), T::one());
        #[rustfmt::skip]
        let n = Matrix6x3::new(
            self.theta1_prime,                  o, o,
            l,                                  o, o,
            self.phi_prime - self.theta1_prime, o, o,
            self.phi_prime,                     o, o,
            o,                                  l, o,
            o,                                  o, l,
        );
        n
    }

    /// Ṅ at a yaw cylinder rate ḃ2 (m/s).
    pub fn n_dot(&self, b2_dot_m_s: T) -> Matrix6x3<T> {
        let o = T::zero();
        let theta1 = self.theta1_second * b2_dot_m_s;
        let phi = self.phi_second * b2_dot_m_s;
        let column = Vector6::new(theta1, o, phi - theta1, phi, o, o);
        Matrix6x3::from_columns(&[column, Vector6::zeros(), Vector6::zeros()])
    }

    /// Joint rates ẋ (rad/s, m/s) for cylinder rates [ḃ2, ḃ5, ḃ6].
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`].
    pub fn joint_rates(&self, rates: &Vector3<T>) -> Result<Vector6<T>, KinematicsError<T>> {
        all_finite(Quantity::Rate, rates.iter())?;
        let result = self.n() * rates;
        all_finite(Quantity::Result, result.iter())?;
        Ok(result)
    }

    /// Joint accelerations ẍ = N q̈ + Ṅ q̇.
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`].
    pub fn joint_accelerations(
        &self,
        rates: &Vector3<T>,
        accelerations: &Vector3<T>,
    ) -> Result<Vector6<T>, KinematicsError<T>> {
        all_finite(Quantity::Rate, rates.iter())?;
        all_finite(Quantity::Acceleration, accelerations.iter())?;
        let result = self.n() * accelerations + self.n_dot(rates.x) * rates;
        all_finite(Quantity::Result, result.iter())?;
        Ok(result)
    }

    /// Foot position in F4 (m), (6).
    pub fn foot(&self) -> Vector3<T> {
        self.chain().foot()
    }

    /// Foot Jacobian in F4: columns b2, b5, b6 (dimensionless).
    pub fn foot_jacobian(&self) -> Matrix3<T> {
        let o = T::zero();
        let arm = self.lengths.b5_m * self.phi_prime;
        #[rustfmt::skip]
        let j = Matrix3::new(
            arm * self.cos4, self.sin4,  o,
            arm * self.sin4, -self.cos4, o,
            o,               o,          -T::one(),
        );
        j
    }

    /// Foot position, velocity and acceleration for cylinder rates and accelerations.
    ///
    /// # Errors
    /// [`KinematicsError::NonFinite`].
    pub fn foot_state(
        &self,
        rates: &Vector3<T>,
        accelerations: &Vector3<T>,
    ) -> Result<FootState<T>, KinematicsError<T>> {
        all_finite(Quantity::Rate, rates.iter())?;
        all_finite(Quantity::Acceleration, accelerations.iter())?;
        let yaw_rate = self.phi_prime * rates.x;
        let yaw_acceleration =
            self.phi_prime * accelerations.x + self.phi_second * rates.x * rates.x;
        let chain_rates = Vector3::new(yaw_rate, rates.y, rates.z);
        let chain_accelerations = Vector3::new(yaw_acceleration, accelerations.y, accelerations.z);
        let chain = self.chain();
        let twist = chain.twist(&chain_rates)?;
        let twist_dot = chain.twist_dot(&chain_rates, &chain_accelerations)?;
        Ok(FootState {
            position: self.foot(),
            velocity: twist.fixed_rows::<3>(3).into_owned(),
            acceleration: twist_dot.fixed_rows::<3>(3).into_owned(),
        })
    }
}
