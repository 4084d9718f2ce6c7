//! The floating robot by the natural orthogonal complement, as the paper does the leg.
//!
//! Twists, inertias and wrenches in world axes, which are inertial, so that
//! M_i ṫ_i = −W_i M_i t_i + w_i holds as it stands. With R the chassis's rotation, e_j = R ê_j, and ρ from the origin of B
//! to the mass centre, the columns of a body and their derivatives are
//!
//! | velocity | T_i | Ṫ_i |
//! |---|---|---|
//! | ω_j | \[e_j; e_j × ρ\] | \[ω × e_j; (ω × e_j) × ρ + e_j × ρ̇\] |
//! | v_j | \[0; e_j\] | \[0; ω × e_j\] |
//! | cylinder | R T_leg | ω × (R T_leg) + R Ṫ_leg |
//! | wheel | \[e_y; 0\] | \[ω × e_y; 0\] |
//!
//! T_leg = T N of [`crate::dynamics::noc::Leg`], in chassis axes, mirrored for the right leg.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector6};

use super::contact::Contacts;
use super::kin::Momentum;
use super::mirror;
use super::params::FloatingParams;
use super::state::{DOF, FloatingState, LEG, Velocity, WHEEL};
use crate::dynamics::error::{DynamicsError, finite};
use crate::dynamics::noc::{
    BodyBlock, J, Leg, O, Placement, System, body_mass, checked, spin, twist,
};

/// Chassis, two legs of six, two wheels, two rotors.
pub const BODIES: usize = 17;

type Block = BodyBlock<DOF>;

/// The readable model.
#[derive(Debug, Clone, PartialEq)]
pub struct FloatingReference {
    params: FloatingParams,
    leg: Leg,
}

/// Blocks of all bodies at one state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FloatingSystem {
    /// Bodies (chassis, left 1–6, right 1–6, wheels, rotors), world axes. Its foot Jacobian is
    /// zero: contacts are below.
    pub blocks: System<BODIES, DOF>,
    /// Rotation and mass centre of every body in the world. The link axes of the right leg are
    /// mirrored ones (left-handed).
    pub placements: [Placement; BODIES],
    /// Twist of soles and wheels per velocity, at [`FloatingSystem::points_m`]: left foot, right
    /// foot, left wheel, right wheel.
    pub contact_jacobians: [SMatrix<f64, 6, DOF>; 5],
    /// Contact reference points in the world (m).
    pub points_m: [Vector3<f64>; 5],
}

/// Pose and velocity of the chassis while the columns are built.
struct Base {
    rotation: Matrix3<f64>,
    omega: Vector3<f64>,
}

impl Base {
    /// Columns ω and v of a point of the robot at `rho` (m, world axes, from the origin of B), and
    /// their derivatives less the part that the point's velocity brings.
    fn columns(&self, rho: &Vector3<f64>) -> SMatrix<f64, 6, DOF> {
        let mut t = SMatrix::<f64, 6, DOF>::zeros();
        for j in 0..3 {
            let e = self.rotation.column(j).into_owned();
            t.set_column(j, &twist(e, e.cross(rho)));
            t.set_column(3 + j, &twist(O, e));
        }
        t
    }

    fn column_rates(&self, rho: &Vector3<f64>, rho_dot: &Vector3<f64>) -> SMatrix<f64, 6, DOF> {
        let mut t_dot = SMatrix::<f64, 6, DOF>::zeros();
        for j in 0..3 {
            let e = self.rotation.column(j).into_owned();
            let e_dot = self.omega.cross(&e);
            t_dot.set_column(j, &twist(e_dot, e_dot.cross(rho) + e.cross(rho_dot)));
            t_dot.set_column(3 + j, &twist(O, e_dot));
        }
        t_dot
    }

    /// A column that is constant in chassis axes apart from its own derivative there.
    fn carried(&self, column: &Vector6<f64>, rate: &Vector6<f64>) -> (Vector6<f64>, Vector6<f64>) {
        let (upper, lower) = halves(column);
        let (upper_dot, lower_dot) = halves(rate);
        let (a, b) = (self.rotation * upper, self.rotation * lower);
        (
            twist(a, b),
            twist(
                self.omega.cross(&a) + self.rotation * upper_dot,
                self.omega.cross(&b) + self.rotation * lower_dot,
            ),
        )
    }

    /// A body fixed to the chassis, with additional columns of its own.
    fn body(
        &self,
        velocity: &Velocity,
        inertia: &Matrix3<f64>,
        mass_kg: f64,
        placement: &Placement,
        own: &[(usize, Vector6<f64>, Vector6<f64>)],
    ) -> Block {
        let rho = self.rotation * placement.com_m;
        let mut t = self.columns(&rho);
        for (column, value, rate) in own {
            t.set_column(*column, &self.carried(value, rate).0);
        }
        // ρ̇ = ċ − ṙ_B, and the linear columns give ṙ_B.
        let moving = t * velocity;
        let (omega, c_dot) = halves(&moving);
        let base: Vector3<f64> = self.rotation * velocity.fixed_rows::<3>(3);
        let mut t_dot = self.column_rates(&rho, &(c_dot - base));
        for (column, value, rate) in own {
            t_dot.set_column(*column, &self.carried(value, rate).1);
        }
        let turned = self.rotation * inertia * self.rotation.transpose();
        BodyBlock {
            m: body_mass(&turned, mass_kg),
            w: spin(&omega),
            t,
            t_dot,
        }
    }
}

fn halves(t: &Vector6<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (
        t.fixed_rows::<3>(0).into_owned(),
        t.fixed_rows::<3>(3).into_owned(),
    )
}

impl FloatingReference {
    /// Checks the parameters.
    ///
    /// # Errors
    /// [`DynamicsError::Parameter`], [`DynamicsError::Leg`].
    pub fn new(params: &FloatingParams) -> Result<Self, DynamicsError> {
        params.validate()?;
        Ok(Self {
            leg: Leg::new(
                params.robot.leg_parameters(),
                &params.robot.leg_bodies,
                [0.0; 3],
            )?,
            params: params.clone(),
        })
    }

    /// The blocks at a state.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`] (also for blocks that overflow), [`DynamicsError::NotUnit`],
    /// [`DynamicsError::Leg`].
    pub fn at(&self, state: &FloatingState) -> Result<FloatingSystem, DynamicsError> {
        state.check()?;
        let p = &self.params.robot;
        let rotation = state.orientation.to_rotation_matrix().into_inner();
        let base = Base {
            rotation,
            omega: rotation * state.angular_velocity(),
        };
        let nu = &state.velocity;
        let fixed = |com_m: Vector3<f64>| Placement {
            rotation: Matrix3::identity(),
            com_m,
        };
        let [cx, cz] = p.chassis_com_m;
        let mut local = [fixed(Vector3::new(cx, 0.0, cz)); BODIES];
        let chassis = Matrix3::from_diagonal(&Vector3::new(
            self.params.chassis_roll_inertia_kg_m2,
            p.chassis_pitch_inertia_kg_m2,
            self.params.chassis_yaw_inertia_kg_m2,
        ));
        let first = base.body(nu, &chassis, p.chassis_mass_kg, &local[0], &[]);
        let mut bodies = [first; BODIES];
        let mut contact_jacobians = [base.columns(&O); 5];
        let mut points = [Vector3::zeros(); 5];

        for leg in 0..2 {
            let of_leg = |e| on_leg(e, leg);
            let s = mirror::sign(leg);
            let lengths = Vector3::from(state.lengths_m[leg]);
            let own = self
                .leg
                .at(&lengths, &state.leg_rates(leg))
                .map_err(of_leg)?;
            let placements = self.leg.placements(&lengths).map_err(of_leg)?;
            let o4 = Vector3::from(p.o4_m);
            let mirrored = |t: Vector6<f64>| {
                let (angular, linear) = halves(&t);
                twist(mirror::axial(s, &angular), mirror::vector(s, &linear))
            };
            for (i, block) in own.bodies.iter().enumerate() {
                let at = 1 + 6 * leg + i;
                local[at] = Placement {
                    rotation: mirror::matrix(s) * placements[i].rotation,
                    com_m: mirror::vector(s, &(o4 + placements[i].com_m)),
                };
                let inertia = block.m.fixed_view::<3, 3>(0, 0).into_owned();
                let columns: [_; 3] = std::array::from_fn(|k| {
                    (
                        LEG + 3 * leg + k,
                        mirrored(block.t.column(k).into_owned()),
                        mirrored(block.t_dot.column(k).into_owned()),
                    )
                });
                bodies[at] = base.body(
                    nu,
                    &(mirror::matrix(s) * inertia * mirror::matrix(s)),
                    p.leg_bodies[i].mass_kg,
                    &local[at],
                    &columns,
                );
            }
            let pad = Vector3::new(0.0, 0.0, -p.foot_pad_m);
            let foot = self.leg.foot(&lengths).map_err(of_leg)?;
            points[leg] = mirror::vector(s, &(o4 + foot + pad));
            let mut jacobian = base.columns(&(rotation * points[leg]));
            for k in 0..3 {
                // The sole turns with body 6 and its centre moves as P does.
                let angular = own.bodies[5].t.fixed_view::<3, 1>(0, k).into_owned();
                let linear = own.foot_jacobian.column(k).into_owned();
                let column = mirrored(twist(angular, linear));
                let (column, _) = base.carried(&column, &Vector6::zeros());
                jacobian.set_column(LEG + 3 * leg + k, &column);
            }
            contact_jacobians[leg] = jacobian;
        }

        let across = self.params.wheel_transverse_inertia_kg_m2;
        let wheel = Matrix3::from_diagonal(&Vector3::new(across, p.wheel_inertia_kg_m2, across));
        let rotor = Matrix3::from_diagonal(&(p.rotor_inertia_kg_m2 * J));
        for side in 0..2 {
            let column = WHEEL + side;
            let (turning, still) = (twist(J, O), Vector6::zeros());
            let (wheel_at, rotor_at) = (13 + side, 15 + side);
            let centre = Vector3::new(0.0, mirror::sign(side) * 0.5 * self.params.track_m, 0.0);
            local[wheel_at] = Placement {
                rotation: nalgebra::Rotation3::from_axis_angle(
                    &Vector3::y_axis(),
                    state.wheel_rad[side],
                )
                .into_inner(),
                com_m: centre,
            };
            bodies[wheel_at] = base.body(
                nu,
                &wheel,
                p.wheel_mass_kg,
                &local[wheel_at],
                &[(column, turning, still)],
            );
            local[rotor_at] = fixed(O);
            bodies[rotor_at] = base.body(
                nu,
                &rotor,
                0.0,
                &local[rotor_at],
                &[(column, p.gear_ratio * turning, still)],
            );
            points[2 + side] = centre;
            contact_jacobians[2 + side] = bodies[wheel_at].t;
        }

        Ok(FloatingSystem {
            blocks: System {
                bodies,
                rates: *nu,
                viscous: SVector::from(self.params.viscous()),
                foot_jacobian: SMatrix::zeros(),
            }
            .finite()?,
            placements: local.map(|l| Placement {
                rotation: rotation * l.rotation,
                com_m: state.position_m + rotation * l.com_m,
            }),
            contact_jacobians,
            points_m: points.map(|r| state.position_m + rotation * r),
        })
    }
}

/// The leg model knows no side.
fn on_leg(error: DynamicsError, leg: usize) -> DynamicsError {
    match error {
        DynamicsError::Leg { source, .. } => DynamicsError::Leg { leg, source },
        other => other,
    }
}

impl FloatingSystem {
    /// J_cᵀ w summed over the contacts.
    #[must_use]
    pub fn contact_force(&self, contacts: &Contacts) -> Velocity {
        let wrenches = contacts.all();
        let of = |(j, w): (&SMatrix<f64, 6, DOF>, &super::Wrench)| {
            j.transpose() * twist(w.moment_n_m, w.force_n)
        };
        self.contact_jacobians.iter().zip(&wrenches).map(of).sum()
    }

    /// C ν − τ_g: the force that holds ν̇ at zero, friction and contact apart.
    #[must_use]
    pub fn bias(&self, gravity_m_s2: &Vector3<f64>) -> Velocity {
        self.blocks.coriolis() * self.blocks.rates - self.blocks.gravity_force(gravity_m_s2)
    }

    /// Generalised force for an acceleration.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`].
    pub fn inverse(
        &self,
        acceleration: &Velocity,
        gravity_m_s2: &Vector3<f64>,
        contacts: &Contacts,
    ) -> Result<Velocity, DynamicsError> {
        check_inputs(acceleration, "acceleration", gravity_m_s2, contacts)?;
        let force = self.blocks.inverse(acceleration, gravity_m_s2, &O)?;
        checked("force", force - self.contact_force(contacts))
    }

    /// Acceleration for a generalised force.
    ///
    /// # Errors
    /// [`DynamicsError::NonFinite`], [`DynamicsError::Singular`].
    pub fn forward(
        &self,
        force: &Velocity,
        gravity_m_s2: &Vector3<f64>,
        contacts: &Contacts,
    ) -> Result<Velocity, DynamicsError> {
        check_inputs(force, "force", gravity_m_s2, contacts)?;
        let total = force + self.contact_force(contacts);
        self.blocks.forward(&total, gravity_m_s2, &O)
    }

    /// Mass centre of the robot in the world (m).
    #[must_use]
    pub fn com_m(&self) -> Vector3<f64> {
        let weighted: Vector3<f64> = self
            .each()
            .map(|(m, placement, _)| m * placement.com_m)
            .sum();
        let mass: f64 = self.each().map(|(m, ..)| m).sum();
        weighted / mass
    }

    /// Momentum, body by body.
    #[must_use]
    pub fn momentum(&self) -> Momentum {
        let com = self.com_m();
        let mut total = Momentum {
            linear_kg_m_s: Vector3::zeros(),
            angular_kg_m2_s: Vector3::zeros(),
        };
        for (_, placement, block) in self.each() {
            let (spin, linear) = halves(&(block.m * block.t * self.blocks.rates));
            total.linear_kg_m_s += linear;
            total.angular_kg_m2_s += spin + (placement.com_m - com).cross(&linear);
        }
        total
    }

    /// Potential energy (J), zero with the mass centre at the origin of the world.
    #[must_use]
    pub fn potential_energy_j(&self, gravity_m_s2: &Vector3<f64>) -> f64 {
        -self
            .each()
            .map(|(m, placement, _)| m * gravity_m_s2.dot(&placement.com_m))
            .sum::<f64>()
    }

    fn each(&self) -> impl Iterator<Item = (f64, &Placement, &Block)> {
        let bodies = self.blocks.bodies.iter().zip(&self.placements);
        bodies.map(|(block, placement)| (block.m[(5, 5)], placement, block))
    }
}

pub(super) fn check_inputs(
    vector: &Velocity,
    name: &'static str,
    gravity_m_s2: &Vector3<f64>,
    contacts: &Contacts,
) -> Result<(), DynamicsError> {
    let values: [f64; DOF] = (*vector).into();
    finite(name, &values)?;
    finite("gravity", &(*gravity_m_s2).into())?;
    contacts.check()
}
