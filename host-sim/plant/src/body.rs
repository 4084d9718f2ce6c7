//! The robot's mechanism behind the pistons: chassis, joints, wheels with their motors, and all
//! that touches the ground.
//!
//! The chassis floats: fourteen velocities ([`crate::dynamics::floating`]). Wheels turn on their
//! own and roll, slip or leave the ground as the contacts have it.

mod bound;
mod contacts;
mod points;
mod soft;
mod stand;
mod sum;
mod touching;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::assembly::Mechanics;
use crate::dynamics::DynamicsError;
use crate::dynamics::floating::state::{LEG, WHEEL};
use crate::dynamics::floating::{FloatingKin, FloatingRobot, FloatingState, Velocity};
use crate::error::{PlantError, check_state};
use crate::hash::StateHasher;
use crate::motor::{MotorParams, MotorState};
pub use contacts::{
    ChassisContact, ContactStates, FootContact, Grip, Grips, RobotContacts, Rut, Ruts, Step, Steps,
    WheelContact,
};
pub use points::{ContactPoint, Toucher};
pub use touching::{FootLoad, Loads, Touching, WheelLoad};

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

/// Most current of a motor \[A\].
pub const MOTOR_CURRENT_A: f64 = 1e3;
/// How far from its start a robot may be \[m\]: further than it drives in the longest run.
const PLACE_M: f64 = 1e7;
/// How far its wheels may have turned by then \[rad\].
const TURNED_RAD: f64 = 1e9;

/// Motion of the whole robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BodyMotion {
    /// Position and velocity.
    pub state: FloatingState,
    /// Acceleration as last evaluated.
    pub acceleration: Velocity,
    /// Left and right wheel motor.
    pub motors: [MotorState; 2],
    /// Contacts with the ground.
    pub contacts: ContactStates,
}

impl BodyMotion {
    /// Robot at rest.
    #[must_use]
    pub fn at_rest(state: FloatingState) -> Self {
        Self {
            state,
            acceleration: Velocity::zeros(),
            motors: [MotorState::default(); 2],
            contacts: ContactStates::default(),
        }
    }

    /// Adds the state to a hash in declaration order.
    pub fn feed(&self, hasher: &mut StateHasher) {
        let s = &self.state;
        let position = s.position_m.iter().chain(s.orientation.coords.iter());
        let joints = s.lengths_m.iter().flatten().chain(&s.wheel_rad);
        let rates = s.velocity.iter().chain(self.acceleration.iter());
        for value in position.chain(joints).chain(rates) {
            hasher.f64(*value);
        }
        for motor in &self.motors {
            hasher.f64(motor.current_a);
            hasher.f64(motor.duty);
            hasher.bytes(&[u8::from(motor.enabled)]);
        }
        self.contacts.feed(hasher);
    }
}

/// Forces of the ground at one instant, and the robot's pose.
#[derive(Debug, Clone, Copy)]
pub struct Scene {
    /// Robot at that instant.
    pub kin: FloatingKin,
    /// Forces of the ground.
    pub loads: Loads,
}

/// Mechanical power by origin \[W\], positive into the robot.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Power {
    /// Pistons and outside loads on them.
    pub pistons_w: f64,
    /// Motors at the wheels.
    pub motors_w: f64,
    /// Ground.
    pub ground_w: f64,
    /// Viscous friction of the bearings, not positive.
    pub bearings_w: f64,
}

/// Rigid-body model with motors and contacts.
#[derive(Debug, Clone)]
pub struct BodyMechanics {
    /// The dynamics.
    pub dynamics: FloatingRobot,
    /// Robot on the ground.
    pub touching: Touching,
    /// Joint lengths at stroke 0 \[m\], joints 1..6.
    pub stroke_zero_m: [f64; 6],
    /// Wheel drives, left and right.
    pub motors: [MotorParams; 2],
    /// Force on each piston from outside \[N\], positive extends.
    pub load_n: [f64; 6],
    /// Gravity \[m/s²\], world axes.
    pub gravity_m_s2: Vector3<f64>,
}

/// Velocity `ahead_s` after a state, its acceleration held.
#[inline]
fn ahead(motion: &BodyMotion, ahead_s: f64) -> Velocity {
    motion.state.velocity + ahead_s * motion.acceleration
}

impl BodyMechanics {
    /// Angles of the wheels relative to the chassis \[rad\], as the encoders see them.
    #[must_use]
    pub fn wheel_angle_rad(&self, motion: &BodyMotion) -> [f64; 2] {
        motion.state.wheel_rad
    }

    /// Rates of [`Self::wheel_angle_rad`] \[rad/s\].
    #[must_use]
    pub fn wheel_rate_rad_s(&self, motion: &BodyMotion) -> [f64; 2] {
        motion.state.wheel_rates()
    }

    /// Torque of one wheel's motor at a wheel rate \[N m\].
    #[must_use]
    #[inline]
    pub fn wheel_torque_n_m(&self, motion: &BodyMotion, wheel: usize, rate_rad_s: f64) -> f64 {
        self.motors[wheel].wheel_torque_n_m(motion.motors[wheel].current_a, rate_rad_s)
    }

    /// The robot in its present state, with the forces of the ground.
    ///
    /// # Errors
    /// [`PlantError::Mechanics`] or [`PlantError::NonFinite`] if the pose cannot be.
    pub fn scene(&self, motion: &BodyMotion) -> Result<Scene, PlantError> {
        let kin = self.dynamics.prepare(&motion.state, &self.gravity_m_s2)?;
        let rate = &motion.state.velocity;
        let mut contacts = motion.contacts;
        let loads = self.touching.loads(&kin, rate, rate, 0.0, &mut contacts);
        Ok(Scene { kin, loads })
    }

    /// The contacts with the ground one by one.
    ///
    /// # Errors
    /// As [`Self::scene`].
    pub fn contact_points(&self, motion: &BodyMotion) -> Result<Vec<ContactPoint>, PlantError> {
        let kin = self.dynamics.prepare(&motion.state, &self.gravity_m_s2)?;
        let rate = &motion.state.velocity;
        Ok(self.touching.points(&kin, rate, &motion.contacts))
    }

    /// Mechanical power in the present state with these piston forces \[N\].
    ///
    /// # Errors
    /// As [`Self::scene`].
    pub fn power(&self, motion: &BodyMotion, piston_n: &[f64; 6]) -> Result<Power, PlantError> {
        let scene = self.scene(motion)?;
        let rate = &motion.state.velocity;
        let joint = |i: usize| (piston_n[i] + self.load_n[i]) * rate[LEG + i];
        let motor = |i: usize| self.wheel_torque_n_m(motion, i, rate[WHEEL + i]) * rate[WHEEL + i];
        Ok(Power {
            pistons_w: (0..6).map(joint).sum(),
            motors_w: (0..2).map(motor).sum(),
            ground_w: scene.kin.contact_force(&scene.loads.contacts).dot(rate),
            bearings_w: scene.kin.dissipation().dot(rate),
        })
    }

    /// Kinetic and potential energy \[J\].
    ///
    /// # Errors
    /// As [`Self::scene`].
    pub fn energy_j(&self, motion: &BodyMotion) -> Result<f64, PlantError> {
        let kin = self.dynamics.prepare(&motion.state, &self.gravity_m_s2)?;
        Ok(kin.kinetic_energy_j() + kin.potential_energy_j(&self.gravity_m_s2))
    }
}

impl Mechanics<6> for BodyMechanics {
    type State = BodyMotion;

    fn strokes_m(&self, state: &BodyMotion) -> [f64; 6] {
        let lengths = &state.state.lengths_m;
        std::array::from_fn(|i| lengths[i / 3][i % 3] - self.stroke_zero_m[i])
    }

    fn rates_m_s(&self, state: &BodyMotion, ahead_s: f64) -> [f64; 6] {
        std::array::from_fn(|i| {
            state.state.velocity[LEG + i] + ahead_s * state.acceleration[LEG + i]
        })
    }

    fn accelerations_m_s2(&self, state: &BodyMotion) -> [f64; 6] {
        std::array::from_fn(|i| state.acceleration[LEG + i])
    }

    fn kick(&self, state: &mut BodyMotion, h: f64) {
        state.state.velocity += h * state.acceleration;
    }

    fn drift(&self, state: &mut BodyMotion, h: f64) {
        let rates = state.state.wheel_rates();
        for ((motor, params), rate) in state.motors.iter_mut().zip(&self.motors).zip(rates) {
            motor.current_a = params.advance_current_a(motor, rate, h);
        }
        state.state = state.state.advanced(&state.state.velocity, h);
    }

    fn evaluate(
        &self,
        state: &mut BodyMotion,
        piston_n: &[f64; 6],
        step_s: f64,
    ) -> Result<(), PlantError> {
        let rate = ahead(state, 0.5 * step_s);
        let predicted = FloatingState {
            velocity: rate,
            ..state.state
        };
        let kin = self.dynamics.prepare(&predicted, &self.gravity_m_s2)?;
        let during = state.state.velocity;
        let contacts = &mut state.contacts;
        let loads = self.touching.loads(&kin, &rate, &during, step_s, contacts);
        let mut force = kin.contact_force(&loads.contacts);
        for i in 0..6 {
            force[LEG + i] += piston_n[i] + self.load_n[i];
        }
        for wheel in 0..2 {
            force[WHEEL + wheel] += self.wheel_torque_n_m(state, wheel, rate[WHEEL + wheel]);
        }
        state.acceleration = kin.solve(&force)?;
        Ok(())
    }

    fn check(&self, state: &BodyMotion) -> Result<(), PlantError> {
        for (i, value) in state.state.position_m.iter().enumerate() {
            check_state("position_m", i, *value, -PLACE_M, PLACE_M)?;
        }
        for (i, value) in state.state.wheel_rad.iter().enumerate() {
            check_state("wheel_rad", i, *value, -TURNED_RAD, TURNED_RAD)?;
        }
        for (i, value) in state.state.velocity.iter().enumerate() {
            check_state("velocity", i, *value, -100.0, 100.0)?;
        }
        for (i, value) in state.acceleration.iter().enumerate() {
            check_state("acceleration", i, *value, -1e5, 1e5)?;
        }
        for (i, motor) in state.motors.iter().enumerate() {
            check_state(
                "motor_current_a",
                i,
                motor.current_a,
                -MOTOR_CURRENT_A,
                MOTOR_CURRENT_A,
            )?;
        }
        Ok(())
    }
}
