//! Why a pose, rate or parameter was refused.

use core::fmt;

use crate::Scalar;

/// One of the three cylinders of a leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cylinder {
    /// Yaw cylinder, length b2.
    Yaw,
    /// Horizontal cylinder, length b5.
    Horizontal,
    /// Vertical cylinder, length b6.
    Vertical,
}

impl fmt::Display for Cylinder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Yaw => "yaw",
            Self::Horizontal => "horizontal",
            Self::Vertical => "vertical",
        })
    }
}

/// The quantity in which a non-finite or out-of-range value was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A joint coordinate (m or rad).
    Coordinate,
    /// A joint rate (m/s or rad/s).
    Rate,
    /// A joint acceleration (m/s² or rad/s²).
    Acceleration,
    /// A foot position (m).
    FootPosition,
    /// A foot velocity (m/s).
    FootVelocity,
    /// A foot acceleration (m/s²).
    FootAcceleration,
    /// A geometry parameter.
    Parameter,
    /// A result: finite arguments so large that the arithmetic overflowed.
    Result,
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Coordinate => "joint coordinate",
            Self::Rate => "joint rate",
            Self::Acceleration => "joint acceleration",
            Self::FootPosition => "foot position",
            Self::FootVelocity => "foot velocity",
            Self::FootAcceleration => "foot acceleration",
            Self::Parameter => "geometry parameter",
            Self::Result => "result",
        })
    }
}

/// Refusals of the kinematics. Each carries the value that was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KinematicsError<T> {
    /// NaN or infinity in an argument, or overflow in a result.
    NonFinite {
        /// Where it was found.
        quantity: Quantity,
        /// The value.
        value: T,
    },
    /// The foot is on, or closer to, the yaw axis than the geometry allows: θ4 is undefined there
    /// and the inverse rates grow without bound.
    FootOnYawAxis {
        /// Distance of the foot from the yaw axis (m); negative if b5 is.
        radius_m: T,
        /// Smallest distance accepted (m).
        minimum_m: T,
    },
    /// The loop O1–O3–O4 cannot close at this length of the yaw cylinder.
    LoopOpen {
        /// Yaw cylinder length b2 (m).
        b2_m: T,
        /// Lower end of the closing interval (exclusive), R − ℓ (m).
        min_m: T,
        /// Upper end of the closing interval (exclusive), R + ℓ (m).
        max_m: T,
    },
    /// The yaw cylinder has no, or a reversed, moment arm about O4: cos θ3 is too small.
    NoMomentArm {
        /// cos θ3 (dimensionless); negative in the mirrored assembly.
        cos_theta3: T,
        /// Smallest value accepted.
        minimum: T,
    },
    /// A cylinder length outside its stroke.
    OutsideStroke {
        /// Which cylinder.
        cylinder: Cylinder,
        /// Length asked for (m).
        length_m: T,
        /// Shortest length (m).
        min_m: T,
        /// Longest length (m).
        max_m: T,
    },
    /// A geometry parameter that makes no leg (not positive, or crank not shorter than O1–O4).
    BadParameter {
        /// The value.
        value: T,
    },
}

impl<T: Scalar> fmt::Display for KinematicsError<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NonFinite { quantity, value } => write!(f, "{quantity} is not finite: {value}"),
            Self::FootOnYawAxis {
                radius_m,
                minimum_m,
            } => write!(
                f,
                "foot {radius_m} m from the leg's yaw axis; at least {minimum_m} m is needed"
            ),
            Self::LoopOpen { b2_m, min_m, max_m } => write!(
                f,
                "yaw cylinder of {b2_m} m cannot close the loop; it closes between {min_m} and {max_m} m"
            ),
            Self::NoMomentArm {
                cos_theta3,
                minimum,
            } => write!(
                f,
                "yaw cylinder without moment arm: cos(theta3) = {cos_theta3}, at least {minimum} is needed"
            ),
            Self::OutsideStroke {
                cylinder,
                length_m,
                min_m,
                max_m,
            } => write!(
                f,
                "{cylinder} cylinder length {length_m} m outside {min_m} to {max_m} m"
            ),
            Self::BadParameter { value } => write!(f, "geometry parameter {value} makes no leg"),
        }
    }
}

impl<T: Scalar> core::error::Error for KinematicsError<T> {}

/// Passes a finite value, refuses NaN and infinity.
pub(crate) fn finite<T: Scalar>(quantity: Quantity, value: T) -> Result<T, KinematicsError<T>> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(KinematicsError::NonFinite { quantity, value })
    }
}

/// Checks every entry of a vector or matrix.
pub(crate) fn all_finite<'a, T: Scalar>(
    quantity: Quantity,
    values: impl IntoIterator<Item = &'a T>,
) -> Result<(), KinematicsError<T>> {
    for &value in values {
        finite(quantity, value)?;
    }
    Ok(())
}
