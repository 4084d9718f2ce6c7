//! Dynamics with the paper's printed (58) and (64), for diagnostics only.
//!
//! They leave the slides' own rates out of ṙ. The Coriolis moments about the yaw axes come out
//! halved and energy is not conserved; b5 and b6 are not affected.

use nalgebra::Vector3;

use super::error::DynamicsError;
use super::noc::{Leg, SlideRates, checked};

/// τ_l = I q̈ + C q̇ of the leg (N) with Ṫ from the printed (58) and (64): lengths (m), rates
/// (m/s), accelerations (m/s²) of b2, b5, b6.
///
/// # Errors
/// As [`Leg::at`].
pub fn tau_l_printed_58_64(
    leg: &Leg,
    q: &Vector3<f64>,
    rates: &Vector3<f64>,
    accelerations: &Vector3<f64>,
) -> Result<Vector3<f64>, DynamicsError> {
    let system = leg.at_with(SlideRates::Omitted, q, rates)?;
    checked("acceleration", *accelerations)?;
    checked("force", system.inertial_force(accelerations))
}
