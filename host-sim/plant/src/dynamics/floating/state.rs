//! Position and velocity of the floating robot.

use nalgebra::{Quaternion, SVector, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::dynamics::error::{DynamicsError, finite};

/// Independent velocities.
pub const DOF: usize = 14;

/// First entry of the left leg in a velocity; the right leg's is three further.
pub const LEG: usize = 6;

/// First entry of the wheels.
pub const WHEEL: usize = 12;

/// Largest deviation of the quaternion's norm from 1 that is accepted as rounding.
pub const NORM_TOLERANCE: f64 = 1e-9;

/// Generalised velocity, acceleration or force: see [`super`] for the order.
pub type Velocity = SVector<f64, DOF>;

/// Position and velocity. Conventions: [`super`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FloatingState {
    /// Middle of the wheel axle in the world (m).
    pub position_m: Vector3<f64>,
    /// Chassis to world.
    pub orientation: UnitQuaternion<f64>,
    /// Cylinder lengths \[b2, b5, b6\] (m) of the left and the right leg.
    pub lengths_m: [[f64; 3]; 2],
    /// Left and right wheel against the chassis (rad).
    pub wheel_rad: [f64; 2],
    /// ν.
    pub velocity: Velocity,
}

impl FloatingState {
    /// At rest, upright, axle at the origin of the world.
    #[must_use]
    pub fn at_rest(lengths_m: [[f64; 3]; 2]) -> Self {
        Self {
            position_m: Vector3::zeros(),
            orientation: UnitQuaternion::identity(),
            lengths_m,
            wheel_rad: [0.0; 2],
            velocity: Velocity::zeros(),
        }
    }

    /// Angular velocity of the chassis (rad/s, chassis axes).
    #[must_use]
    pub fn angular_velocity(&self) -> Vector3<f64> {
        self.velocity.fixed_rows::<3>(0).into_owned()
    }

    /// Velocity of the middle of the axle (m/s, chassis axes).
    #[must_use]
    pub fn linear_velocity(&self) -> Vector3<f64> {
        self.velocity.fixed_rows::<3>(3).into_owned()
    }

    /// Rates of b2, b5, b6 (m/s) of leg 0 (left) or 1.
    #[must_use]
    pub fn leg_rates(&self, leg: usize) -> Vector3<f64> {
        self.velocity.fixed_rows::<3>(LEG + 3 * leg).into_owned()
    }

    /// Rates of the wheels against the chassis (rad/s).
    #[must_use]
    pub fn wheel_rates(&self) -> [f64; 2] {
        [self.velocity[WHEEL], self.velocity[WHEEL + 1]]
    }

    /// Refuses NaN, infinity and a quaternion that is not a rotation.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`] with `position`, `orientation` (i, j, k, w), `length`
    /// (left b2, b5, b6, right b2, b5, b6), `wheel angle` or `velocity`;
    /// [`DynamicsError::NotUnit`].
    pub fn check(&self) -> Result<(), DynamicsError> {
        finite("position", &self.position_m.into())?;
        finite("orientation", &self.orientation.coords.into())?;
        let [[a, b, c], [d, e, f]] = self.lengths_m;
        finite("length", &[a, b, c, d, e, f])?;
        finite("wheel angle", &self.wheel_rad)?;
        finite("velocity", &self.velocity.into())?;
        let norm = self.orientation.coords.norm();
        if (norm - 1.0).abs() > NORM_TOLERANCE {
            return Err(DynamicsError::NotUnit { norm });
        }
        Ok(())
    }

    /// The position after `dt_s` at constant velocity `velocity`: the chassis moves along a screw.
    /// The state's own velocity is kept. The quaternion is normalised.
    #[must_use]
    pub fn advanced(&self, velocity: &Velocity, dt_s: f64) -> Self {
        let turn = velocity.fixed_rows::<3>(0) * dt_s;
        let shift = velocity.fixed_rows::<3>(3) * dt_s;
        let angle_squared = turn.norm_squared();
        // (1 − cos a)/a² and (a − sin a)/a³; series where the quotients lose digits.
        let (first, second) = if angle_squared < 1e-4 {
            (
                0.5 - angle_squared / 24.0 * (1.0 - angle_squared / 30.0),
                1.0 / 6.0 - angle_squared / 120.0 * (1.0 - angle_squared / 42.0),
            )
        } else {
            let angle = angle_squared.sqrt();
            (
                (1.0 - libm::cos(angle)) / angle_squared,
                (angle - libm::sin(angle)) / (angle_squared * angle),
            )
        };
        let across = turn.cross(&shift);
        let chord = shift + first * across + second * turn.cross(&across);
        let turned = self.orientation * UnitQuaternion::from_scaled_axis(turn);
        let leg = |l: usize| {
            std::array::from_fn(|k| self.lengths_m[l][k] + dt_s * velocity[LEG + 3 * l + k])
        };
        Self {
            position_m: self.position_m + self.orientation * chord,
            orientation: UnitQuaternion::new_normalize(turned.into_inner()),
            lengths_m: [leg(0), leg(1)],
            wheel_rad: std::array::from_fn(|w| self.wheel_rad[w] + dt_s * velocity[WHEEL + w]),
            velocity: self.velocity,
        }
    }

    /// Derivative of position, quaternion components (i, j, k, w), lengths and wheel angles.
    #[must_use]
    pub fn position_rate(&self) -> SVector<f64, 15> {
        let spin = Quaternion::from_parts(0.0, 0.5 * self.angular_velocity());
        let q_dot = self.orientation.into_inner() * spin;
        let p_dot = self.orientation * self.linear_velocity();
        SVector::from_fn(|i, _| match i {
            0..3 => p_dot[i],
            3..7 => q_dot.coords[i - 3],
            _ => self.velocity[i - 1],
        })
    }

    /// The state with `change` added to the coordinates of [`FloatingState::position_rate`], the
    /// quaternion normalised, and `velocity_change` to the velocity.
    #[must_use]
    pub fn moved(&self, change: &SVector<f64, 15>, velocity_change: &Velocity) -> Self {
        let q = self.orientation.coords + change.fixed_rows::<4>(3);
        let leg = |l: usize| std::array::from_fn(|k| self.lengths_m[l][k] + change[7 + 3 * l + k]);
        Self {
            position_m: self.position_m + change.fixed_rows::<3>(0),
            orientation: UnitQuaternion::new_normalize(Quaternion::from(q)),
            lengths_m: [leg(0), leg(1)],
            wheel_rad: std::array::from_fn(|w| self.wheel_rad[w] + change[13 + w]),
            velocity: self.velocity + velocity_change,
        }
    }
}
