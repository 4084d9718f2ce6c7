//! The robot's mechanism behind the pistons: joints, chassis, wheels with their motors, feet.
//!
//! Coordinates: `[s, p, b2L, b5L, b6L, b2R, b5R, b6R]`: chassis travel \[m\], pitch
//! about the wheel axle \[rad\] (nose up positive), joint lengths \[m\].

use super::contact::{ContactParams, ContactState, FlatGround};
use super::dynamics::{RobotDynamics, RobotSide};
use super::foot::FootKin;
use super::kin::RobotKin;
use wheeleg_plant::assembly::Mechanics;
use wheeleg_plant::motor::{MotorParams, MotorState};
use wheeleg_plant::{PlantError, PlantParams};

/// Number of generalised coordinates.
pub(crate) const COORDINATES: usize = 8;

const SIDES: [RobotSide; 2] = [RobotSide::Left, RobotSide::Right];

/// Motion of the whole robot.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BodyMotion {
    /// Coordinates `[s, p, b2L, b5L, b6L, b2R, b5R, b6R]` \[m, rad\].
    pub(crate) position: [f64; COORDINATES],
    /// Their rates.
    pub(crate) velocity: [f64; COORDINATES],
    /// Their accelerations as last evaluated.
    pub(crate) acceleration: [f64; COORDINATES],
    /// Left and right wheel motor.
    pub(crate) motors: [MotorState; 2],
    /// Left and right foot on the ground.
    pub(crate) contacts: [ContactState; 2],
    /// Sole centres as last evaluated, ground axes \[m\].
    pub(crate) sole_m: [[f64; 3]; 2],
}

impl BodyMotion {
    /// Robot at rest.
    #[must_use]
    pub(crate) fn at_rest(position: [f64; COORDINATES]) -> Self {
        Self {
            position,
            velocity: [0.0; COORDINATES],
            acceleration: [0.0; COORDINATES],
            motors: [MotorState::default(); 2],
            contacts: [ContactState::default(); 2],
            sole_m: [[0.0; 3]; 2],
        }
    }
}

/// Rigid-body model with motors and feet.
#[derive(Debug, Clone)]
pub(crate) struct BodyMechanics {
    /// The dynamics.
    pub(crate) dynamics: RobotDynamics,
    /// Sole on the ground.
    pub(crate) contact: ContactParams,
    /// Joint lengths at stroke 0 \[m\], joints 1..6.
    pub(crate) stroke_zero_m: [f64; 6],
    /// Wheel drives, left and right.
    pub(crate) motors: [MotorParams; 2],
    /// Force on each piston from outside \[N\], positive extends.
    pub(crate) load_n: [f64; 6],
}

impl BodyMechanics {
    /// On a level floor.
    pub(crate) fn new(params: &PlantParams) -> Self {
        Self {
            dynamics: RobotDynamics::new(&params.body).expect("robot"),
            contact: ContactParams::of(&params.contacts.foot.law),
            stroke_zero_m: params.stroke_zero_m,
            motors: params.motors,
            load_n: [0.0; 6],
        }
    }

    /// Rate of the wheels against the chassis `ahead_s` after the state \[rad/s\].
    #[must_use]
    pub(crate) fn wheel_rate_rad_s(&self, motion: &BodyMotion, ahead_s: f64) -> f64 {
        let rate = |i: usize| motion.velocity[i] + ahead_s * motion.acceleration[i];
        rate(0) / self.dynamics.params().wheel_radius_m + rate(1)
    }

    /// Pitch at which the robot stands at rest on its wheels and feet with its
    /// joints locked, put into `motion`.
    ///
    /// The moment about the axle that the feet lack falls steadily as the nose
    /// sinks into the ground, so bisection finds the one root.
    ///
    /// # Errors
    /// [`PlantError::Mechanics`] if the feet do not carry the robot within ±0.3 rad.
    pub(crate) fn settle_pitch(&self, motion: &mut BodyMotion) -> Result<(), PlantError> {
        let missing = |pitch: f64, motion: &BodyMotion| -> Result<f64, PlantError> {
            let mut q = motion.position;
            q[1] = pitch;
            let kin = self.dynamics.prepare(&q, &[0.0; COORDINATES])?;
            let mut force = [0.0; COORDINATES];
            let unstretched = [ContactState::default(); 2];
            self.add_ground_forces(&unstretched, &kin, &mut force);
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

    /// Torque of one wheel's motor `ahead_s` after the state \[N m\].
    #[must_use]
    pub(crate) fn wheel_torque_n_m(&self, motion: &BodyMotion, wheel: usize, ahead_s: f64) -> f64 {
        let rate = self.wheel_rate_rad_s(motion, ahead_s);
        self.motors[wheel].wheel_torque_n_m(motion.motors[wheel].current_a, rate)
    }

    /// Adds the ground's forces on both feet.
    fn add_ground_forces(
        &self,
        contacts: &[ContactState; 2],
        kin: &RobotKin,
        force: &mut [f64; COORDINATES],
    ) {
        for (i, side) in SIDES.into_iter().enumerate() {
            let ground = self.contact.force(&contacts[i], &kin.feet[i], &FlatGround);
            if ground.normal_n > 0.0 {
                kin.add_foot_force(side, &ground.force_n, force);
            }
        }
    }

    /// Stretches the bristles under the soles by what the soles really moved,
    /// so that a standing foot has no drift of its own.
    fn advance_contacts(&self, state: &mut BodyMotion, kin: &RobotKin, step_s: f64) {
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
                    .advance(&mut state.contacts[i], &moved, &FlatGround, step_s);
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
        let kin = self.dynamics.prepare(&state.position, &rate)?;
        self.advance_contacts(state, &kin, step_s);
        let mut force = [0.0; COORDINATES];
        for (force, (piston, load)) in force[2..].iter_mut().zip(piston_n.iter().zip(self.load_n)) {
            *force = piston + load;
        }
        for wheel in 0..2 {
            let torque = self.wheel_torque_n_m(state, wheel, ahead_s);
            self.dynamics.add_wheel_torque(torque, &mut force);
        }
        self.add_ground_forces(&state.contacts, &kin, &mut force);
        state.acceleration = kin.solve(&force)?;
        Ok(())
    }

    fn check(&self, _state: &BodyMotion) -> Result<(), PlantError> {
        Ok(())
    }
}
