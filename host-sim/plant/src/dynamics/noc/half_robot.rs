//! Half robot: one leg, half the chassis, one wheel.

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector};

use super::{BodyBlock, I, J, Leg, O, System, body_mass, checked, spin, twist};
use crate::dynamics::error::{DynamicsError, finite};
use crate::dynamics::params::HalfRobotParams;

/// Half robot, q = [s, b2, b5, b6] (m): one leg, half the chassis, one wheel; no pitch.
#[derive(Debug, Clone, PartialEq)]
pub struct HalfRobot {
    params: HalfRobotParams,
    leg: Leg,
}

impl HalfRobot {
    /// The half robot.
    ///
    /// # Errors
    /// As [`Leg::new`]; [`DynamicsError::Parameter`] for a wheel radius that is not positive, or a
    /// mass, inertia or ratio that is not finite.
    pub fn new(params: &HalfRobotParams) -> Result<Self, DynamicsError> {
        let p = params;
        for (name, value, fits) in [
            ("wheel_radius_m", p.wheel_radius_m, p.wheel_radius_m > 0.0),
            ("chassis_mass_kg", p.chassis_mass_kg, true),
            ("wheel_mass_kg", p.wheel_mass_kg, true),
            ("wheel_inertia_kg_m2", p.wheel_inertia_kg_m2, true),
            ("rotor_inertia_kg_m2", p.rotor_inertia_kg_m2, true),
            ("gear_ratio", p.gear_ratio, true),
        ] {
            if !(fits && value.is_finite()) {
                return Err(DynamicsError::Parameter { name, value });
            }
        }
        let [_, v2, v5, v6] = params.viscous_n_s_m;
        finite("viscous", &params.viscous_n_s_m)?;
        Ok(Self {
            leg: Leg::new(params.leg_parameters(), &params.leg_bodies, [v2, v5, v6])?,
            params: params.clone(),
        })
    }

    /// The half robot at lengths (m) and rates (m/s). The force on s is the wheel torque over r_w.
    ///
    /// # Errors
    /// As [`Leg::at`].
    pub fn at(
        &self,
        q: &SVector<f64, 4>,
        rates: &SVector<f64, 4>,
    ) -> Result<System<8, 4>, DynamicsError> {
        checked("position", *q)?;
        checked("velocity", *rates)?;
        let p = &self.params;
        let leg = self.leg.at(
            &q.fixed_rows::<3>(1).into_owned(),
            &rates.fixed_rows::<3>(1).into_owned(),
        )?;
        let carried = twist(O, I);
        let rolling = twist(J / p.wheel_radius_m, I);
        let still = SMatrix::zeros();
        let axle = p.wheel_inertia_kg_m2 + p.rotor_inertia_kg_m2 * p.gear_ratio.powi(2);
        let bodies = std::array::from_fn(|i| match i {
            0..6 => BodyBlock {
                m: leg.bodies[i].m,
                w: leg.bodies[i].w,
                t: beside(&carried, &leg.bodies[i].t),
                t_dot: beside(&twist(O, O), &leg.bodies[i].t_dot),
            },
            6 => BodyBlock {
                m: body_mass(&Matrix3::zeros(), p.chassis_mass_kg),
                w: Matrix6::zeros(),
                t: beside(&carried, &still),
                t_dot: SMatrix::zeros(),
            },
            _ => BodyBlock {
                m: body_mass(&Matrix3::from_diagonal(&(axle * J)), p.wheel_mass_kg),
                w: spin(&(J * rates[0] / p.wheel_radius_m)),
                t: beside(&rolling, &still),
                t_dot: SMatrix::zeros(),
            },
        });
        System {
            bodies,
            rates: *rates,
            viscous: p.viscous_n_s_m.into(),
            foot_jacobian: beside(&I, &leg.foot_jacobian),
        }
        .finite()
    }
}

/// A column and three more.
fn beside<const R: usize>(
    first: &SVector<f64, R>,
    rest: &SMatrix<f64, R, 3>,
) -> SMatrix<f64, R, 4> {
    SMatrix::from_fn(|row, column| {
        if column == 0 {
            first[row]
        } else {
            rest[(row, column - 1)]
        }
    })
}
