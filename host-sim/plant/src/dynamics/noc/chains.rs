//! The two open chains of a leg: R2P (bodies 4–6) and RPR (bodies 1–3).

use nalgebra::{Matrix3, SMatrix, Vector3, Vector6};

use super::{BodyBlock, K, O, Placement, SlideRates, System, body_mass, checked, com, spin, twist};
use crate::dynamics::error::DynamicsError;
use crate::dynamics::params::BodyParams;

/// R2P chain, bodies 4–6, q = [θ4, b5, b6] (rad, m, m).
///
/// # Errors
/// [`DynamicsError::NonFinite`].
pub fn r2p(
    bodies: &[BodyParams; 3],
    q: &Vector3<f64>,
    rates: &Vector3<f64>,
) -> Result<System<3, 3>, DynamicsError> {
    r2p_with(SlideRates::Included, bodies, q, rates)
}

pub(super) fn r2p_with(
    slides: SlideRates,
    bodies: &[BodyParams; 3],
    q: &Vector3<f64>,
    rates: &Vector3<f64>,
) -> Result<System<3, 3>, DynamicsError> {
    checked("position", *q)?;
    checked("velocity", *rates)?;
    let (sin4, cos4) = q.x.sin_cos();
    let f = Vector3::new(sin4, -cos4, 0.0);
    let omega = rates.x * K;
    let (slide5, slide6) = match slides {
        SlideRates::Included => (rates.y * f, -rates.z * K),
        SlideRates::Omitted => (O, O),
    };
    let [b4, b5, b6] = r2p_placements(bodies, q);
    let (rho4, rho5, r64) = (b4.com_m, b5.com_m, b6.com_m);
    let (r44_dot, r54_dot) = (omega.cross(&rho4), omega.cross(&rho5) + slide5);
    let r64_dot = omega.cross(&r64) + slide5 + slide6;
    let f_dot = omega.cross(&f);
    chain(
        rates,
        [
            block(
                &bodies[0],
                &b4.rotation,
                omega,
                [revolute(rho4), twist(O, O), twist(O, O)],
                [twist(O, K.cross(&r44_dot)), twist(O, O), twist(O, O)],
            ),
            block(
                &bodies[1],
                &b5.rotation,
                omega,
                [revolute(rho5), twist(O, f), twist(O, O)],
                [twist(O, K.cross(&r54_dot)), twist(O, f_dot), twist(O, O)],
            ),
            block(
                &bodies[2],
                &b6.rotation,
                omega,
                [revolute(r64), twist(O, f), twist(O, -K)],
                [twist(O, K.cross(&r64_dot)), twist(O, f_dot), twist(O, O)],
            ),
        ],
    )
}

/// Bodies 4–6 from O4.
pub(super) fn r2p_placements(bodies: &[BodyParams; 3], q: &Vector3<f64>) -> [Placement; 3] {
    let (sin4, cos4) = q.x.sin_cos();
    let n = Vector3::new(cos4, sin4, 0.0);
    let f = Vector3::new(sin4, -cos4, 0.0);
    let r5 = Matrix3::from_columns(&[n, K, f]);
    let r6 = Matrix3::from_columns(&[n, f, -K]);
    let a5 = q.y * f;
    [
        placed(&bodies[0], r5, O),
        placed(&bodies[1], r6, a5),
        placed(&bodies[2], r6, a5 - q.z * K),
    ]
}

/// RPR chain, bodies 1–3, open, q = [θ1, b2, θ3] (rad, m, rad; θ3 relative), crank ℓ (m).
///
/// # Errors
/// [`DynamicsError::NonFinite`].
pub fn rpr(
    crank_m: f64,
    bodies: &[BodyParams; 3],
    q: &Vector3<f64>,
    rates: &Vector3<f64>,
) -> Result<System<3, 3>, DynamicsError> {
    rpr_with(SlideRates::Included, crank_m, bodies, q, rates)
}

pub(super) fn rpr_with(
    slides: SlideRates,
    crank_m: f64,
    bodies: &[BodyParams; 3],
    q: &Vector3<f64>,
    rates: &Vector3<f64>,
) -> Result<System<3, 3>, DynamicsError> {
    checked("position", *q)?;
    checked("velocity", *rates)?;
    let (sin1, cos1) = q.x.sin_cos();
    let u = Vector3::new(sin1, -cos1, 0.0);
    let (omega1, omega3) = (rates.x * K, (rates.x + rates.z) * K);
    let slide2 = match slides {
        SlideRates::Included => rates.y * u,
        SlideRates::Omitted => O,
    };
    let [b1, b2, b3] = rpr_placements(crank_m, bodies, q);
    let (rho1, rho2, r31) = (b1.com_m, b2.com_m, b3.com_m);
    let a2 = q.y * u;
    let r33 = r31 - a2;
    let (r11_dot, r21_dot) = (omega1.cross(&rho1), omega1.cross(&rho2) + slide2);
    let r33_dot = omega3.cross(&r33);
    let r31_dot = omega1.cross(&a2) + slide2 + r33_dot;
    let u_dot = omega1.cross(&u);
    chain(
        rates,
        [
            block(
                &bodies[0],
                &b1.rotation,
                omega1,
                [revolute(rho1), twist(O, O), twist(O, O)],
                [twist(O, K.cross(&r11_dot)), twist(O, O), twist(O, O)],
            ),
            block(
                &bodies[1],
                &b2.rotation,
                omega1,
                [revolute(rho2), twist(O, u), twist(O, O)],
                [twist(O, K.cross(&r21_dot)), twist(O, u_dot), twist(O, O)],
            ),
            block(
                &bodies[2],
                &b3.rotation,
                omega3,
                [revolute(r31), twist(O, u), revolute(r33)],
                [
                    twist(O, K.cross(&r31_dot)),
                    twist(O, u_dot),
                    twist(O, K.cross(&r33_dot)),
                ],
            ),
        ],
    )
}

/// Bodies 1–3 from O1.
pub(super) fn rpr_placements(
    crank_m: f64,
    bodies: &[BodyParams; 3],
    q: &Vector3<f64>,
) -> [Placement; 3] {
    let (sin1, cos1) = q.x.sin_cos();
    let phi = q.x + q.z - std::f64::consts::PI;
    let w = Vector3::new(cos1, sin1, 0.0);
    let u = Vector3::new(sin1, -cos1, 0.0);
    let v = Vector3::new(phi.cos(), phi.sin(), 0.0);
    let r2 = Matrix3::from_columns(&[w, K, u]);
    let r3 = Matrix3::from_columns(&[-w, u, K]);
    let r4 = Matrix3::from_columns(&[v, K.cross(&v), K]);
    let a2 = q.y * u;
    [
        placed(&bodies[0], r2, O),
        placed(&bodies[1], r3, a2),
        placed(&bodies[2], r4, a2 + crank_m * v),
    ]
}

/// A body whose link frame has its origin at `origin`.
fn placed(body: &BodyParams, rotation: Matrix3<f64>, origin: Vector3<f64>) -> Placement {
    Placement {
        rotation,
        com_m: origin + rotation * com(body),
    }
}

fn chain(rates: &Vector3<f64>, bodies: [BodyBlock<3>; 3]) -> Result<System<3, 3>, DynamicsError> {
    System {
        bodies,
        rates: *rates,
        viscous: Vector3::zeros(),
        foot_jacobian: Matrix3::zeros(),
    }
    .finite()
}

fn block(
    body: &BodyParams,
    rotation: &Matrix3<f64>,
    omega: Vector3<f64>,
    t: [Vector6<f64>; 3],
    t_dot: [Vector6<f64>; 3],
) -> BodyBlock<3> {
    let principal = Matrix3::from_diagonal(&body.inertia_kg_m2.into());
    BodyBlock {
        m: body_mass(&(rotation * principal * rotation.transpose()), body.mass_kg),
        w: spin(&omega),
        t: SMatrix::from_columns(&t),
        t_dot: SMatrix::from_columns(&t_dot),
    }
}

/// Column \[k; k × r\] of a vertical revolute joint with its mass centre at r.
fn revolute(r: Vector3<f64>) -> Vector6<f64> {
    twist(K, K.cross(&r))
}
