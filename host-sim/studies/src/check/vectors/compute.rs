//! Computes the same quantities with this implementation.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{SMatrix, SVector, Vector3, Vector4};
use wheeleg_kinematics::r2p::R2p;
use wheeleg_kinematics::rpr::Rpr;
use wheeleg_kinematics::{
    KinematicsError, LegGeometry, LegLengths, LegParameters, Theta3, printed,
};
use wheeleg_plant::dynamics::noc::{self, HalfRobot, Leg, System};
use wheeleg_plant::dynamics::printed::tau_l_printed_58_64;
use wheeleg_plant::dynamics::{DynamicsError, HalfRobotParams};

use super::schema::{Case, Numbers, Params, VectorFile};
use super::{Problem, VectorsError};

/// The kinematics refuses poses whose yaw cylinder has no moment arm. The limit of the paper's leg
/// (ASSUMED 0.05) is not a limit of the equations, so files may go closer to the singularity.
const MIN_COS_THETA3: f64 = 1e-6;

/// Names of quantities with their numbers.
pub(super) type Computed = Vec<(&'static str, Vec<f64>)>;

/// Why a state was refused.
#[derive(Debug, thiserror::Error)]
pub(super) enum Refused {
    #[error("{0}")]
    Kinematics(#[from] KinematicsError<f64>),
    #[error("{0}")]
    Dynamics(#[from] DynamicsError),
}

/// Constants derived from the parameters.
pub(super) fn derived(p: &Params) -> [(&'static str, f64); 7] {
    let [x, y] = p.p4_m;
    let beta = y.atan2(x);
    // The paper's k1 and k4, (24*).
    let k = -(FRAC_PI_2 + beta);
    let gear = p.gear_motor * p.gear_chain;
    let leg: f64 = p.bodies.iter().map(|b| b.mass_kg).sum();
    [
        ("R", x.hypot(y)),
        ("beta", beta),
        ("k1", k),
        ("k4", k),
        ("gear", gear),
        (
            "half_wheel_inertia",
            p.wheel_inertia_kg_m2 + p.rotor_inertia_kg_m2 * gear * gear,
        ),
        (
            "mass_total",
            p.chassis_mass_kg + 2.0 * (leg + p.wheel_mass_kg),
        ),
    ]
}

/// The model with the file's parameters.
pub(super) struct Model {
    geometry: LegGeometry<f64>,
    params: HalfRobotParams,
    leg: Leg,
    half_robot: HalfRobot,
}

impl Model {
    pub(super) fn new(file: &str, vectors: &VectorFile) -> Result<Self, VectorsError> {
        Self::build(&vectors.params).map_err(|why| {
            VectorsError::malformed(
                file,
                vec![Problem {
                    path: "params".to_owned(),
                    value: "a set of parameters".to_owned(),
                    expected: format!("one that makes a robot: {why}"),
                }],
            )
        })
    }

    fn build(p: &Params) -> Result<Self, Refused> {
        let [v2, v5, v6] = p.viscous_n_s_m;
        let params = HalfRobotParams {
            crank_m: p.crank_m,
            p4_m: p.p4_m,
            min_cos_theta3: MIN_COS_THETA3,
            leg_bodies: p.bodies,
            chassis_mass_kg: 0.5 * p.chassis_mass_kg,
            wheel_mass_kg: p.wheel_mass_kg,
            wheel_radius_m: p.wheel_radius_m,
            wheel_inertia_kg_m2: p.wheel_inertia_kg_m2,
            rotor_inertia_kg_m2: p.rotor_inertia_kg_m2,
            gear_ratio: p.gear_motor * p.gear_chain,
            viscous_n_s_m: [p.wheel_viscous_n_s_m, v2, v5, v6],
        };
        let dimensions: LegParameters<f64> = params.leg_parameters();
        Ok(Self {
            geometry: LegGeometry::new(dimensions)?,
            leg: Leg::new(dimensions, &params.leg_bodies, p.viscous_n_s_m)?,
            half_robot: HalfRobot::new(&params)?,
            params,
        })
    }

    /// Every compared quantity of a section.
    pub(super) fn section(
        &self,
        name: &str,
        case: &Case,
        numbers: &Numbers,
    ) -> Result<Computed, Refused> {
        match name {
            "r2p" => self.r2p(case, numbers),
            "rpr" => self.rpr(case, numbers),
            "leg" => self.leg(case, numbers),
            _ => self.half_robot(case, numbers),
        }
    }

    fn r2p(&self, case: &Case, numbers: &Numbers) -> Result<Computed, Refused> {
        let [q, qd, qdd] = state(numbers);
        let chain = R2p::new(q.x, q.y, q.z)?;
        let [_, _, _, b4, b5, b6] = self.params.leg_bodies;
        let system = noc::r2p(&[b4, b5, b6], &q, &qd)?;
        let mut out = vec![
            ("p", flat(&chain.foot())),
            ("J", flat(&chain.jacobian())),
            ("twist", flat(&chain.twist(&qd)?)),
            ("twist_dot", flat(&chain.twist_dot(&qd, &qdd)?)),
            ("twist_printed_13", flat(&printed::twist_13(&qd))),
            (
                "twist_dot_printed_16",
                flat(&printed::twist_dot_16(&qd, &qdd)),
            ),
        ];
        out.extend(chain_dynamics(&system, case, &qdd)?);
        Ok(out)
    }

    fn rpr(&self, case: &Case, numbers: &Numbers) -> Result<Computed, Refused> {
        let [q, qd, qdd] = state(numbers);
        let (crank_m, theta3) = (self.params.crank_m, Theta3::new(q.z));
        let chain = Rpr::new(crank_m, q.x, q.y, theta3)?;
        let [b1, b2, b3, ..] = self.params.leg_bodies;
        let system = noc::rpr(crank_m, &[b1, b2, b3], &q, &qd)?;
        let mut out = vec![
            ("p", flat(&chain.tip())),
            ("J", flat(&chain.jacobian())),
            ("twist", flat(&chain.twist(&qd)?)),
            ("twist_dot", flat(&chain.twist_dot(&qd, &qdd)?)),
            (
                "twist_printed_32",
                flat(&printed::twist_32(crank_m, theta3, &qd)),
            ),
            (
                "twist_dot_printed_38",
                flat(&printed::twist_dot_38(crank_m, theta3, &qd, &qdd)),
            ),
        ];
        out.extend(chain_dynamics(&system, case, &qdd)?);
        Ok(out)
    }

    fn leg(&self, case: &Case, numbers: &Numbers) -> Result<Computed, Refused> {
        let [q, qd, qdd] = state(numbers);
        let (gravity, contact) = loads(case, numbers);
        let posture = self.geometry.posture(&LegLengths::new(q.x, q.y, q.z))?;
        let x = posture.joints();
        let foot = posture.foot_state(&qd, &qdd)?;
        let roots = self.geometry.closures_from_theta3(x.theta3)?;
        let system = self.leg.at(&q, &qd)?;
        let joints = [
            x.theta1_rad,
            x.b2_m,
            x.theta3.rad(),
            x.theta4_rad,
            x.b5_m,
            x.b6_m,
        ];
        let printed = tau_l_printed_58_64(&self.leg, &q, &qd, &qdd)?;
        Ok(vec![
            ("joints", joints.to_vec()),
            ("joints_d", flat(&posture.joint_rates(&qd)?)),
            ("joints_dd", flat(&posture.joint_accelerations(&qd, &qdd)?)),
            ("foot_p", flat(&foot.position)),
            ("foot_v", flat(&foot.velocity)),
            ("foot_a", flat(&foot.acceleration)),
            (
                "foot_p_f1",
                flat(&(foot.position + self.geometry.o4_in_f1())),
            ),
            ("N", flat(&posture.n())),
            ("Ndot", flat(&posture.n_dot(qd.x))),
            (
                "theta1_roots",
                roots.map(|r| [r.theta1_rad, r.b2_m]).concat(),
            ),
            ("I", flat(&system.inertia())),
            ("C", flat(&system.coriolis())),
            ("C_qd", flat(&(system.coriolis() * qd))),
            ("tau_g", flat(&system.gravity_force(&gravity))),
            ("tau_d", flat(&system.dissipation())),
            ("tau_l", flat(&system.inertial_force(&qdd))),
            ("tau_l_printed_58_64", flat(&printed)),
            ("tau_a", flat(&system.inverse(&qdd, &gravity, &contact)?)),
        ])
    }

    fn half_robot(&self, case: &Case, numbers: &Numbers) -> Result<Computed, Refused> {
        let [q, qd, qdd] = ["q", "qd", "qdd"].map(|key| Vector4::from(numbers.array::<4>(key)));
        let (gravity, contact) = loads(case, numbers);
        let system = self.half_robot.at(&q, &qd)?;
        Ok(vec![
            ("I", flat(&system.inertia())),
            ("C", flat(&system.coriolis())),
            ("C_qd", flat(&(system.coriolis() * qd))),
            ("tau_g", flat(&system.gravity_force(&gravity))),
            ("tau_a", flat(&system.inverse(&qdd, &gravity, &contact)?)),
        ])
    }
}

fn state(numbers: &Numbers) -> [Vector3<f64>; 3] {
    ["q", "qd", "qdd"].map(|key| Vector3::from(numbers.array::<3>(key)))
}

fn loads(case: &Case, numbers: &Numbers) -> (Vector3<f64>, Vector3<f64>) {
    let contact = numbers.array::<3>("contact_force");
    (Vector3::from(case.gravity), Vector3::from(contact))
}

/// The quantities that both chains share.
fn chain_dynamics(
    system: &System<3, 3>,
    case: &Case,
    qdd: &SVector<f64, 3>,
) -> Result<Computed, Refused> {
    let gravity = Vector3::from(case.gravity);
    let stacked = |blocks: [SMatrix<f64, 6, 3>; 3]| blocks.iter().flat_map(flat).collect();
    Ok(vec![
        ("T", stacked(system.bodies.map(|b| b.t))),
        ("Tdot", stacked(system.bodies.map(|b| b.t_dot))),
        ("I", flat(&system.inertia())),
        ("C", flat(&system.coriolis())),
        ("C_qd", flat(&(system.coriolis() * system.rates))),
        ("tau_g", flat(&system.gravity_force(&gravity))),
        (
            "tau",
            flat(&system.inverse(qdd, &gravity, &Vector3::zeros())?),
        ),
    ])
}

/// Row by row.
fn flat<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> Vec<f64> {
    m.transpose().iter().copied().collect()
}
