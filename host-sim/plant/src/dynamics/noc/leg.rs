//! The assembled leg: both chains joined through N.

use nalgebra::Vector3;
use wheeleg_kinematics::{KinematicsError, LegGeometry, LegLengths, LegParameters, LegPosture};

use super::chains::{r2p_placements, r2p_with, rpr_placements, rpr_with};
use super::{BodyBlock, Placement, SlideRates, System, checked};
use crate::dynamics::error::{DynamicsError, finite};
use crate::dynamics::params::LegBodies;

/// The assembled leg, q = [b2, b5, b6] (m): six bodies.
#[derive(Debug, Clone, PartialEq)]
pub struct Leg {
    geometry: LegGeometry<f64>,
    bodies: LegBodies,
    viscous: Vector3<f64>,
}

impl Leg {
    /// Dimensions, bodies and viscous friction of b2, b5, b6 (N s/m).
    ///
    /// # Errors
    /// [`DynamicsError::Leg`] for impossible dimensions; [`DynamicsError::NonFinite`] for friction
    /// and [`DynamicsError::Parameter`] for a body that is not finite.
    pub fn new(
        dimensions: LegParameters<f64>,
        bodies: &LegBodies,
        viscous_n_s_m: [f64; 3],
    ) -> Result<Self, DynamicsError> {
        finite("viscous", &viscous_n_s_m)?;
        for body in bodies {
            for (name, values) in [
                ("leg_bodies.mass_kg", &[body.mass_kg][..]),
                ("leg_bodies.com_m", &body.com_m),
                ("leg_bodies.inertia_kg_m2", &body.inertia_kg_m2),
            ] {
                if let Some(&value) = values.iter().find(|v| !v.is_finite()) {
                    return Err(DynamicsError::Parameter { name, value });
                }
            }
        }
        let geometry = LegGeometry::new(dimensions).map_err(refused)?;
        Ok(Self {
            geometry,
            bodies: *bodies,
            viscous: viscous_n_s_m.into(),
        })
    }

    /// The leg at lengths (m) and rates (m/s).
    ///
    /// # Errors
    /// [`DynamicsError::Leg`], [`DynamicsError::NonFinite`].
    pub fn at(
        &self,
        q: &Vector3<f64>,
        rates: &Vector3<f64>,
    ) -> Result<System<6, 3>, DynamicsError> {
        self.at_with(SlideRates::Included, q, rates)
    }

    /// The six bodies at lengths (m); mass centres from O4.
    ///
    /// # Errors
    /// [`DynamicsError::Leg`]; [`DynamicsError::NonFinite`] if a place overflows.
    pub fn placements(&self, q: &Vector3<f64>) -> Result<[Placement; 6], DynamicsError> {
        let posture = self.posture(q)?;
        let (yaw, foot) = chain_coordinates(&posture);
        let [b1, b2, b3, b4, b5, b6] = self.bodies;
        let p = self.geometry.parameters();
        let [c1, c2, c3] = rpr_placements(p.crank_m, &[b1, b2, b3], &yaw);
        let [c4, c5, c6] = r2p_placements(&[b4, b5, b6], &foot);
        let o1 = -self.geometry.o4_in_f1();
        let from_o4 = |c: Placement| Placement {
            com_m: o1 + c.com_m,
            ..c
        };
        let placements = [from_o4(c1), from_o4(c2), from_o4(c3), c4, c5, c6];
        for placement in &placements {
            checked("centre of mass", placement.com_m)?;
        }
        Ok(placements)
    }

    /// Foot point P from O4 (m).
    ///
    /// # Errors
    /// [`DynamicsError::Leg`].
    pub fn foot(&self, q: &Vector3<f64>) -> Result<Vector3<f64>, DynamicsError> {
        Ok(self.posture(q)?.foot())
    }

    fn posture(&self, q: &Vector3<f64>) -> Result<LegPosture<f64>, DynamicsError> {
        self.geometry
            .posture(&LegLengths::new(q.x, q.y, q.z))
            .map_err(refused)
    }

    pub(in crate::dynamics) fn at_with(
        &self,
        slides: SlideRates,
        q: &Vector3<f64>,
        rates: &Vector3<f64>,
    ) -> Result<System<6, 3>, DynamicsError> {
        checked("velocity", *rates)?;
        let posture = self.posture(q)?;
        let (yaw_q, foot_q) = chain_coordinates(&posture);
        let (n, n_dot) = (posture.n(), posture.n_dot(rates.x));
        let x_dot = n * rates;
        let [b1, b2, b3, b4, b5, b6] = self.bodies;
        let yaw = rpr_with(
            slides,
            self.geometry.parameters().crank_m,
            &[b1, b2, b3],
            &yaw_q,
            &x_dot.fixed_rows::<3>(0).into_owned(),
        )?;
        let foot = r2p_with(
            slides,
            &[b4, b5, b6],
            &foot_q,
            &x_dot.fixed_rows::<3>(3).into_owned(),
        )?;
        // T_leg = T N, Ṫ_leg = Ṫ N + T Ṅ, each chain with its own rows of N.
        let bodies = std::array::from_fn(|i| {
            let (body, row) = if i < 3 {
                (yaw.bodies[i], 0)
            } else {
                (foot.bodies[i - 3], 3)
            };
            let (n, n_dot) = (n.fixed_rows::<3>(row), n_dot.fixed_rows::<3>(row));
            BodyBlock {
                t: body.t * n,
                t_dot: body.t_dot * n + body.t * n_dot,
                ..body
            }
        });
        System {
            bodies,
            rates: *rates,
            viscous: self.viscous,
            foot_jacobian: posture.foot_jacobian(),
        }
        .finite()
    }
}

fn refused(source: KinematicsError<f64>) -> DynamicsError {
    DynamicsError::Leg { leg: 0, source }
}

/// [θ1, b2, θ3] and [θ4, b5, b6].
fn chain_coordinates(posture: &LegPosture<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let x = posture.joints();
    (
        Vector3::new(x.theta1_rad, x.b2_m, x.theta3.rad()),
        Vector3::new(x.theta4_rad, x.b5_m, x.b6_m),
    )
}
