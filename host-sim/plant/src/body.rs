//! The robot's mechanism behind the pistons: joints, chassis, wheels with their motors, feet.
//!
//! Coordinates: `[s, p, b2L, b5L, b6L, b2R, b5R, b6R]`: chassis travel \[m\], pitch
//! about the wheel axle \[rad\] (nose up positive), joint lengths \[m\].

use serde::{Deserialize, Serialize};

use crate::assembly::Mechanics;
use crate::contact::{ContactForce, ContactParams, ContactState, SoleSwitches};
use crate::dynamics::{DynamicsError, FootKin, RobotDynamics, RobotKin, RobotSide};
use crate::error::{PlantError, check_state};
use crate::ground::{Ground, Support};
use crate::hash::StateHasher;
use crate::motor::{MotorParams, MotorState};

/// Number of generalised coordinates.
pub const COORDINATES: usize = 8;

const SIDES: [RobotSide; 2] = [RobotSide::Left, RobotSide::Right];

impl From<DynamicsError> for PlantError {
    fn from(error: DynamicsError) -> Self {
        match error {
            DynamicsError::NonFinite { name, index, value } => {
                Self::NonFinite { name, index, value }
            }
            other => Self::Mechanics(other.to_string()),
        }
    }
}

/// Motion of the whole robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BodyMotion {
    /// Coordinates `[s, p, b2L, b5L, b6L, b2R, b5R, b6R]` \[m, rad\].
    pub position: [f64; COORDINATES],
    /// Their rates.
    pub velocity: [f64; COORDINATES],
    /// Their accelerations as last evaluated.
    pub acceleration: [f64; COORDINATES],
    /// Left and right wheel motor.
    pub motors: [MotorState; 2],
    /// Left and right foot on the ground.
    pub contacts: [ContactState; 2],
    /// Sole centres as last evaluated, ground axes \[m\].
    pub sole_m: [[f64; 3]; 2],
}

impl BodyMotion {
    /// Robot at rest.
    #[must_use]
    pub fn at_rest(position: [f64; COORDINATES]) -> Self {
        Self {
            position,
            velocity: [0.0; COORDINATES],
            acceleration: [0.0; COORDINATES],
            motors: [MotorState::default(); 2],
            contacts: [ContactState::default(); 2],
            sole_m: [[0.0; 3]; 2],
        }
    }

    /// Adds the state to a hash in declaration order.
    pub fn feed(&self, hasher: &mut StateHasher) {
        for row in [&self.position, &self.velocity, &self.acceleration] {
            row.iter().for_each(|v| hasher.f64(*v));
        }
        for motor in &self.motors {
            hasher.f64(motor.current_a);
            hasher.f64(motor.duty);
            hasher.bytes(&[u8::from(motor.enabled)]);
        }
        self.contacts.iter().for_each(|c| c.feed(hasher));
        self.sole_m.iter().flatten().for_each(|v| hasher.f64(*v));
    }
}

/// One foot as seen from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootOutputs {
    /// Sole centre, ground axes x forward, y left, z up \[m\].
    pub sole_m: [f64; 3],
    /// Smallest height of the sole's centre and sides over the ground below \[m\].
    pub clearance_m: f64,
    /// Ground force on the foot.
    pub force: ContactForce,
    /// The four optical switches.
    pub switches: SoleSwitches,
}

impl FootOutputs {
    /// A foot whose pose cannot be evaluated: NaN, switches open.
    pub const UNKNOWN: Self = Self {
        sole_m: [f64::NAN; 3],
        clearance_m: f64::NAN,
        force: ContactForce {
            force_n: [f64::NAN; 3],
            normal_n: f64::NAN,
            penetration_m: f64::NAN,
            slipping: false,
        },
        switches: SoleSwitches {
            front: false,
            back: false,
            left: false,
            right: false,
        },
    };
}

/// Rigid-body model with motors and feet.
#[derive(Debug, Clone)]
pub struct BodyMechanics {
    /// The dynamics.
    pub dynamics: RobotDynamics,
    /// Sole on the ground.
    pub contact: ContactParams,
    /// Ground under the feet.
    pub ground: Ground,
    /// Joint lengths at stroke 0 \[m\], joints 1..6.
    pub stroke_zero_m: [f64; 6],
    /// Wheel drives, left and right.
    pub motors: [MotorParams; 2],
    /// Force on each piston from outside \[N\], positive extends.
    pub load_n: [f64; 6],
}

impl BodyMechanics {
    /// Angle of the wheels against the chassis \[rad\], what the encoders see:
    /// rolling forward and nose-up pitch both count positive.
    #[must_use]
    pub fn wheel_angle_rad(&self, motion: &BodyMotion) -> f64 {
        self.dynamics.wheel_angle_rad(&motion.position)
    }

    /// Rate of [`Self::wheel_angle_rad`] `ahead_s` after the state \[rad/s\].
    #[must_use]
    pub fn wheel_rate_rad_s(&self, motion: &BodyMotion, ahead_s: f64) -> f64 {
        let rate = |i: usize| motion.velocity[i] + ahead_s * motion.acceleration[i];
        rate(0) / self.dynamics.params().wheel_radius_m + rate(1)
    }

    /// Both feet with the state as it is.
    ///
    /// # Errors
    /// [`PlantError::Mechanics`] or [`PlantError::NonFinite`] if the pose cannot be.
    pub fn feet(&self, motion: &BodyMotion) -> Result<[FootOutputs; 2], PlantError> {
        let kin = self.dynamics.prepare(&motion.position, &motion.velocity)?;
        Ok(std::array::from_fn(|i| {
            let foot = &kin.feet[i];
            let support = self.support(foot);
            FootOutputs {
                sole_m: foot.position_m,
                clearance_m: self.ground.clearance_m(foot, self.contact.sole_radius_m),
                force: self.contact.force(&motion.contacts[i], foot, &support),
                switches: self.contact.switches(foot, &self.ground),
            }
        }))
    }

    /// Pitch at which the robot stands at rest on its wheels and feet with its
    /// joints locked, put into `motion`.
    ///
    /// The moment about the axle that the feet lack falls steadily as the nose
    /// sinks into the ground, so bisection finds the one root.
    ///
    /// # Errors
    /// [`PlantError::Mechanics`] if the feet do not carry the robot within ±0.3 rad.
    pub fn settle_pitch(&self, motion: &mut BodyMotion) -> Result<(), PlantError> {
        let missing = |pitch: f64, motion: &BodyMotion| -> Result<f64, PlantError> {
            let mut q = motion.position;
            q[1] = pitch;
            let mut kin = self.dynamics.prepare(&q, &[0.0; COORDINATES])?;
            let support = kin.feet.map(|foot| self.support(&foot));
            let mut force = [0.0; COORDINATES];
            let unstretched = [ContactState::default(); 2];
            self.add_ground_forces(&unstretched, &support, &q, &mut kin, &mut force);
            Ok(force[1] - kin.inverse(&[0.0; COORDINATES])[1])
        };
        let (mut low, mut high) = (-0.3, 0.3);
        if missing(low, motion)? <= 0.0 || missing(high, motion)? >= 0.0 {
            return Err(PlantError::Mechanics(
                "the robot does not stand on its feet in this pose".into(),
            ));
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if missing(middle, motion)? > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        motion.position[1] = 0.5 * (low + high);
        let kin = self.dynamics.prepare(&motion.position, &motion.velocity)?;
        motion.sole_m = [kin.feet[0].position_m, kin.feet[1].position_m];
        Ok(())
    }

    /// Piston forces that hold the robot at rest in its pose, with its feet
    /// loaded as they are \[N\].
    ///
    /// # Errors
    /// [`PlantError::Mechanics`] or [`PlantError::NonFinite`] if the pose cannot be.
    pub fn holding_forces_n(&self, motion: &BodyMotion) -> Result<[f64; 6], PlantError> {
        let rest = [0.0; COORDINATES];
        let mut kin = self.dynamics.prepare(&motion.position, &rest)?;
        let support = kin.feet.map(|foot| self.support(&foot));
        let mut ground = [0.0; COORDINATES];
        self.add_ground_forces(
            &motion.contacts,
            &support,
            &motion.position,
            &mut kin,
            &mut ground,
        );
        let needed = kin.inverse(&rest);
        Ok(std::array::from_fn(|i| needed[i + 2] - ground[i + 2]))
    }

    /// Torque of one wheel's motor `ahead_s` after the state \[N m\].
    #[must_use]
    pub fn wheel_torque_n_m(&self, motion: &BodyMotion, wheel: usize, ahead_s: f64) -> f64 {
        let rate = self.wheel_rate_rad_s(motion, ahead_s);
        self.motors[wheel].wheel_torque_n_m(motion.motors[wheel].current_a, rate)
    }

    fn support(&self, foot: &FootKin) -> Support {
        self.ground.support(foot, self.contact.sole_radius_m)
    }

    /// Adds the ground's forces on both feet, each at its centre of pressure; the feet's
    /// Jacobians in `kin` are moved there.
    fn add_ground_forces(
        &self,
        contacts: &[ContactState; 2],
        support: &[Support; 2],
        position: &[f64; COORDINATES],
        kin: &mut RobotKin,
        force: &mut [f64; COORDINATES],
    ) {
        for (i, side) in SIDES.into_iter().enumerate() {
            let foot = &kin.feet[i];
            let ground = self.contact.force(&contacts[i], foot, &support[i]);
            if ground.normal_n > 0.0 {
                kin.feet[i] = support[i].loaded(foot, position[3 + 3 * i]);
                kin.add_foot_force(side, &ground.force_n, force);
            }
        }
    }

    /// Stretches the bristles under the soles by what the soles really moved,
    /// so that a standing foot has no drift of its own.
    fn advance_contacts(
        &self,
        state: &mut BodyMotion,
        kin: &RobotKin,
        support: &[Support; 2],
        step_s: f64,
    ) {
        for (i, foot) in kin.feet.iter().enumerate() {
            if step_s > 0.0 {
                let before = state.sole_m[i];
                let moved = FootKin {
                    velocity_m_s: std::array::from_fn(|k| {
                        (foot.position_m[k] - before[k]) / step_s
                    }),
                    ..*foot
                };
                self.contact
                    .advance(&mut state.contacts[i], &moved, &support[i], step_s);
            }
            state.sole_m[i] = foot.position_m;
        }
    }
}

impl Mechanics<6> for BodyMechanics {
    type State = BodyMotion;

    fn strokes_m(&self, state: &BodyMotion) -> [f64; 6] {
        std::array::from_fn(|i| state.position[i + 2] - self.stroke_zero_m[i])
    }

    fn rates_m_s(&self, state: &BodyMotion, ahead_s: f64) -> [f64; 6] {
        std::array::from_fn(|i| state.velocity[i + 2] + ahead_s * state.acceleration[i + 2])
    }

    fn accelerations_m_s2(&self, state: &BodyMotion) -> [f64; 6] {
        std::array::from_fn(|i| state.acceleration[i + 2])
    }

    fn kick(&self, state: &mut BodyMotion, h: f64) {
        for (v, a) in state.velocity.iter_mut().zip(&state.acceleration) {
            *v += h * a;
        }
    }

    fn drift(&self, state: &mut BodyMotion, h: f64) {
        let wheel = self.wheel_rate_rad_s(state, 0.0);
        for (motor, params) in state.motors.iter_mut().zip(&self.motors) {
            motor.current_a = params.advance_current_a(motor, wheel, h);
        }
        for (q, v) in state.position.iter_mut().zip(&state.velocity) {
            *q += h * v;
        }
    }

    fn evaluate(
        &self,
        state: &mut BodyMotion,
        piston_n: &[f64; 6],
        step_s: f64,
    ) -> Result<(), PlantError> {
        let ahead_s = 0.5 * step_s;
        let rate: [f64; COORDINATES] =
            std::array::from_fn(|i| state.velocity[i] + ahead_s * state.acceleration[i]);
        let mut kin = self.dynamics.prepare(&state.position, &rate)?;
        let support = kin.feet.map(|foot| self.support(&foot));
        self.advance_contacts(state, &kin, &support, step_s);
        let mut force = [0.0; COORDINATES];
        for (force, (piston, load)) in force[2..].iter_mut().zip(piston_n.iter().zip(self.load_n)) {
            *force = piston + load;
        }
        for wheel in 0..2 {
            let torque = self.wheel_torque_n_m(state, wheel, ahead_s);
            self.dynamics.add_wheel_torque(torque, &mut force);
        }
        self.add_ground_forces(
            &state.contacts,
            &support,
            &state.position,
            &mut kin,
            &mut force,
        );
        state.acceleration = kin.solve(&force)?;
        Ok(())
    }

    fn check(&self, state: &BodyMotion) -> Result<(), PlantError> {
        for i in 0..COORDINATES {
            check_state("position", i, state.position[i], -1e5, 1e5)?;
            check_state("velocity", i, state.velocity[i], -100.0, 100.0)?;
            check_state("acceleration", i, state.acceleration[i], -1e5, 1e5)?;
        }
        check_state("pitch_rad", 0, state.position[1], -1.2, 1.2)?;
        for (i, motor) in state.motors.iter().enumerate() {
            check_state("motor_current_a", i, motor.current_a, -1e3, 1e3)?;
        }
        Ok(())
    }
}
