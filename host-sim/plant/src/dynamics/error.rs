//! Why the dynamics refused a state or a parameter.

use wheeleg_kinematics::KinematicsError;

/// Failure of the rigid-body dynamics.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum DynamicsError {
    /// A leg in a pose it cannot take.
    #[error("leg {leg}: {source}")]
    Leg {
        /// 0 left, 1 right.
        leg: usize,
        /// The error of the kinematics.
        source: KinematicsError<f64>,
    },
    /// A coordinate, rate or force that is NaN or infinite.
    #[error("{name}[{index}] = {value} is not finite")]
    NonFinite {
        /// `position`, `velocity`, `force`, `acceleration`, or the overflowed quantity.
        name: &'static str,
        /// Coordinate number; body or leg number of an overflow there, column of a mass matrix.
        index: usize,
        /// The value.
        value: f64,
    },
    /// A quaternion that is no rotation.
    #[error("orientation has norm {norm}, not 1")]
    NotUnit {
        /// The norm.
        norm: f64,
    },
    /// The mass matrix is not positive definite.
    #[error("mass matrix is not positive definite: pivot {pivot}")]
    Singular {
        /// The pivot (kg, kg m or kg m²).
        pivot: f64,
    },
    /// A parameter outside its range.
    #[error("parameter {name} = {value} is outside its range")]
    Parameter {
        /// Field of the parameters: of a robot, a half robot, a floating robot or a link.
        name: &'static str,
        /// The value.
        value: f64,
    },
}

/// Passes a finite array, refuses the first value that is not.
///
/// # Errors
/// [`DynamicsError::NonFinite`] with that value.
pub fn finite<const N: usize>(name: &'static str, values: &[f64; N]) -> Result<(), DynamicsError> {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(index) => Err(DynamicsError::NonFinite {
            name,
            index,
            value: values[index],
        }),
    }
}
