//! The pose in which the robot stands at rest, with its joints and wheels held.
//!
//! First the height, roll and pitch at which the normal forces carry it, then the whole pose, with
//! the bristles of the contacts stretched by what it shifts: on a slope they hold it. The unknown
//! is a small twist of the chassis, the equations its six equations of motion at rest. Newton's
//! method, with the step bounded by a stiffness of its own that fades with the error: |error| over
//! the longest step. It goes down at that pace while nothing touches, and converges quadratically
//! in the end.

use nalgebra::{DMatrix, DVector};

use super::contacts::ContactStates;
use super::{BodyMechanics, BodyMotion};
use crate::dynamics::floating::Velocity;
use crate::dynamics::floating::state::LEG;
use crate::error::PlantError;

/// Longest step \[m, rad\].
const STEP: f64 = 2e-3;
/// Steps before the search gives up; 0.3 m of fall.
const STEPS: usize = 400;
/// Residual that counts as zero \[N, N m\].
const NOTHING: f64 = 1e-9;
/// Far from the origin a coordinate is no finer than its rounding: search steps no longer than this many
/// roundings have reached the end.
const ROUNDINGS: f64 = 64.0;
/// For the slope of the forces \[m, rad\].
const DIFFERENCE: f64 = 1e-8;

/// Roll, pitch, up.
const UPRIGHT: [usize; 3] = [0, 1, 5];
/// All directions of a twist.
const ALL: [usize; 6] = [0, 1, 2, 3, 4, 5];

impl BodyMechanics {
    /// Puts the robot into its standing pose, starting from the present one.
    ///
    /// # Errors
    /// [`PlantError::NotStanding`] if it does not stand on its feet in this pose,
    /// [`PlantError::OnChassis`] if its chassis lies on the ground where its wheels should stand.
    pub fn stand(&self, motion: &mut BodyMotion) -> Result<(), PlantError> {
        motion.contacts = ContactStates::default();
        self.balance(motion, &UPRIGHT, false)?;
        self.balance(motion, &ALL, true)?;
        let loads = self.scene(motion)?.loads;
        if loads.feet.iter().all(|foot| foot.normal_n <= 0.0) {
            return Err(PlantError::NotStanding);
        }
        let lies = loads.chassis_n > 0.0;
        if lies && loads.wheels.iter().all(|wheel| wheel.normal_n <= 0.0) {
            return Err(PlantError::OnChassis {
                chassis_n: loads.chassis_n,
                feet_n: loads.feet.iter().map(|foot| foot.normal_n).sum(),
            });
        }
        Ok(())
    }

    /// Piston forces that hold the robot at rest in its pose, with its present contacts \[N\].
    ///
    /// # Errors
    /// [`PlantError::Mechanics`] or [`PlantError::NonFinite`] if the pose cannot be.
    pub fn holding_forces_n(&self, motion: &BodyMotion) -> Result<[f64; 6], PlantError> {
        let scene = self.scene(motion)?;
        let needed = scene.kin.bias() - scene.kin.contact_force(&scene.loads.contacts);
        Ok(std::array::from_fn(|i| needed[LEG + i]))
    }

    /// Moves the chassis along some directions until nothing pushes it that way.
    fn balance(
        &self,
        motion: &mut BodyMotion,
        along: &[usize],
        grips: bool,
    ) -> Result<(), PlantError> {
        let n = along.len();
        let mut last = f64::INFINITY;
        for _ in 0..STEPS {
            let (error, here) = self.unbalanced(motion, &Velocity::zeros(), along, grips)?;
            let size = error.amax();
            if size < NOTHING {
                *motion = here;
                return Ok(());
            }
            let mut slope = DMatrix::zeros(n, n);
            for (column, direction) in along.iter().enumerate() {
                let mut shift = Velocity::zeros();
                shift[*direction] = DIFFERENCE;
                let moved = self.unbalanced(motion, &shift, along, grips)?.0;
                slope.set_column(column, &((&error - moved) / DIFFERENCE));
                slope[(column, column)] += size / STEP;
            }
            let step = slope.lu().solve(&error).ok_or(PlantError::NotStanding)?;
            let longest = step.amax();
            let step = step * (STEP / longest.max(STEP));
            let mut shift = Velocity::zeros();
            for (direction, value) in along.iter().zip(step.iter()) {
                shift[*direction] = *value;
            }
            let (_, moved) = self.unbalanced(motion, &shift, along, grips)?;
            *motion = moved;
            if longest < 1e-15 {
                return Ok(());
            }
            last = longest;
        }
        // On ground 1500 m high a rounding of the height is 2e-13 m, and its force is not nothing.
        let finest = ROUNDINGS * f64::EPSILON * motion.state.position_m.amax();
        if last < finest {
            Ok(())
        } else {
            Err(PlantError::NotStanding)
        }
    }

    /// The net force on the chassis after a small shift, and the robot there.
    fn unbalanced(
        &self,
        motion: &BodyMotion,
        shift: &Velocity,
        along: &[usize],
        grips: bool,
    ) -> Result<(DVector<f64>, BodyMotion), PlantError> {
        let mut moved = motion.clone();
        moved.state = motion.state.advanced(shift, 1.0);
        let rest = Velocity::zeros();
        moved.state.velocity = rest;
        let kin = self.dynamics.prepare(&moved.state, &self.gravity_m_s2)?;
        let mut contacts = motion.contacts;
        // Soil that had been pressed down once would be stiff upward and soft downward, and
        // Newton's method would find no slope.
        contacts.press_soil_anew();
        let loads = self.touching.loads(&kin, &rest, shift, 1.0, &mut contacts);
        let force = kin.contact_force(&loads.contacts) - kin.bias();
        if grips {
            moved.contacts = contacts;
        } else {
            moved.contacts = ContactStates::default();
        }
        let error = DVector::from_iterator(along.len(), along.iter().map(|i| force[*i]));
        Ok((error, moved))
    }
}
