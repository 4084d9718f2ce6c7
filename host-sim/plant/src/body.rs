//! The robot's mechanism behind the pistons: joints, chassis, wheels and their motors.
//!
//! Coordinates: `[s, p, b2L, b5L, b6L, b2R, b5R, b6R]`: chassis travel \[m\], pitch
//! about the wheel axle \[rad\] (nose up positive), joint lengths \[m\].

use serde::{Deserialize, Serialize};

use crate::assembly::Mechanics;
use crate::error::{PlantError, check_state};
use crate::hash::StateHasher;
use crate::motor::{MotorParams, MotorState};

/// Joint length at stroke 0 for joints 1..6 \[m\] comes from [`BodyMechanics::stroke_zero_m`].
pub const COORDINATES: usize = 8;

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
}

impl BodyMotion {
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
    }
}

/// Rigid-body model with the motors on it.
#[derive(Debug, Clone)]
pub struct BodyMechanics {
    /// Joint lengths at stroke 0 \[m\], joints 1..6.
    pub stroke_zero_m: [f64; 6],
    /// Wheel radius \[m\].
    pub wheel_radius_m: f64,
    /// Wheel drives, left and right.
    pub motors: [MotorParams; 2],
}

impl BodyMechanics {
    /// Angle of the wheels against the chassis \[rad\], what the encoders see:
    /// rolling forward and nose-up pitch both count positive.
    #[must_use]
    pub fn wheel_angle_rad(&self, motion: &BodyMotion) -> f64 {
        motion.position[0] / self.wheel_radius_m + motion.position[1]
    }

    /// Rate of [`Self::wheel_angle_rad`] `ahead_s` after the state \[rad/s\].
    #[must_use]
    pub fn wheel_rate_rad_s(&self, motion: &BodyMotion, ahead_s: f64) -> f64 {
        let rate = |i: usize| motion.velocity[i] + ahead_s * motion.acceleration[i];
        rate(0) / self.wheel_radius_m + rate(1)
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

    fn drift(&self, state: &mut BodyMotion, h: f64) -> Result<(), PlantError> {
        let wheel = self.wheel_rate_rad_s(state, 0.0);
        for (motor, params) in state.motors.iter_mut().zip(&self.motors) {
            motor.current_a = params.advance_current_a(motor, wheel, h);
        }
        for (q, v) in state.position.iter_mut().zip(&state.velocity) {
            *q += h * v;
        }
        Ok(())
    }

    fn evaluate(
        &self,
        state: &mut BodyMotion,
        piston_n: &[f64; 6],
        ahead_s: f64,
    ) -> Result<(), PlantError> {
        let wheel = self.wheel_rate_rad_s(state, ahead_s);
        let torque: f64 = (0..2)
            .map(|i| self.motors[i].wheel_torque_n_m(state.motors[i].current_a, wheel))
            .sum();
        let _ = torque;
        state.acceleration[2..].copy_from_slice(piston_n);
        Ok(())
    }

    fn check(&self, state: &BodyMotion) -> Result<(), PlantError> {
        for i in 0..COORDINATES {
            check_state("position", i, state.position[i], -1e5, 1e5)?;
            check_state("velocity", i, state.velocity[i], -100.0, 100.0)?;
            check_state("acceleration", i, state.acceleration[i], -1e5, 1e5)?;
        }
        for (i, motor) in state.motors.iter().enumerate() {
            check_state("motor_current_a", i, motor.current_a, -1e3, 1e3)?;
        }
        Ok(())
    }
}
