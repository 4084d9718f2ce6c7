//! How stiff contacts may be for the step.
//!
//! A mass m on a spring k moves at ω = √(k/m). The kick–drift–kick step holds it for ω dt < 2;
//! ω dt ≤ 0.2 keeps its error below half a per cent. A bristle's damping σ1 may take a tenth of the
//! speed away in a step. What moves with a contact is the inverse of J M⁻¹ Jᵀ there, in the
//! lightest of three directions.

use nalgebra::Vector3;

use super::BodyMechanics;
use crate::contact::ContactLaw;
use crate::dynamics::floating::{Contacts, FloatingState, Wrench};
use crate::error::{PlantError, check};

/// Most ω dt.
const TURN: f64 = 0.2;
/// Most σ1 dt/m.
const SHARE: f64 = 0.1;

/// Names of a contact's stiffness, bristle stiffness and bristle damping.
type Names = [&'static str; 3];

const FOOT: Names = [
    "contact.stiffness_n_m",
    "contact.bristle_stiffness_n_m",
    "contact.bristle_damping_n_s_m",
];
const WHEEL: Names = [
    "wheel_contact.stiffness_n_m",
    "wheel_contact.bristle_stiffness_n_m",
    "wheel_contact.bristle_damping_n_s_m",
];
const CHASSIS: Names = [
    "chassis_contact.stiffness_n_m",
    "chassis_contact.bristle_stiffness_n_m",
    "chassis_contact.bristle_damping_n_s_m",
];

impl BodyMechanics {
    /// Refuses contacts too stiff for a step of `step_s` seconds.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the value; [`PlantError::Mechanics`] if the pose cannot be.
    pub fn check_contacts(&self, lengths_m: [[f64; 3]; 2], step_s: f64) -> Result<(), PlantError> {
        let state = FloatingState::at_rest(lengths_m);
        let kin = self.dynamics.prepare(&state, &Vector3::zeros())?;
        let radius_m = self.touching.wheel_radius_m();
        let params = self.touching.params();
        let lightest_kg = |body: usize, arm: Vector3<f64>| -> Result<f64, PlantError> {
            let mut least = f64::INFINITY;
            for direction in [Vector3::x(), Vector3::y(), Vector3::z()] {
                let push = Wrench::force_at(direction, &arm, &Vector3::zeros());
                let mut contacts = Contacts::NONE;
                match body {
                    0 | 1 => contacts.feet[body] = push,
                    2 | 3 => contacts.wheels[body - 2] = push,
                    _ => contacts.chassis = push,
                }
                let gained = kin.solve(&kin.contact_force(&contacts))?;
                let [turning, moving] = kin.twist(body, &gained);
                let per_newton = (moving + turning.cross(&arm)).dot(&direction);
                least = least.min(1.0 / per_newton);
            }
            Ok(least)
        };
        let tread = -radius_m * Vector3::z();
        for leg in 0..2 {
            let law = &params.foot.law;
            check_law(law, FOOT, lightest_kg(leg, Vector3::zeros())?, step_s)?;
            let law = &params.wheel.law;
            check_law(law, WHEEL, lightest_kg(2 + leg, tread)?, step_s)?;
        }
        // A whole sole on soil that rises.
        let area_m2 = std::f64::consts::PI * params.foot.sole_radius_m * params.foot.sole_radius_m;
        let mass_kg = lightest_kg(0, Vector3::zeros())?;
        let stiffest = mass_kg * (TURN / step_s) * (TURN / step_s) / area_m2;
        let parts = self.touching.terrain().parts.iter();
        for soil in parts.filter_map(|p| p.material.soil.as_ref()) {
            let stiffness = soil.stiffness_most_pa_m;
            check("soil.stiffness_most_pa_m", stiffness, 0.0, stiffest)?;
        }
        for point in params.chassis.points_m() {
            let law = &params.chassis.law;
            check_law(law, CHASSIS, lightest_kg(4, point)?, step_s)?;
        }
        Ok(())
    }
}

fn check_law(
    law: &ContactLaw,
    [stiffness, bristle, damping]: Names,
    mass_kg: f64,
    step_s: f64,
) -> Result<(), PlantError> {
    let stiffest = mass_kg * (TURN / step_s) * (TURN / step_s);
    check(stiffness, law.stiffness_n_m, 1.0, stiffest)?;
    check(bristle, law.bristle_stiffness_n_m, 1.0, stiffest)?;
    let most = SHARE * mass_kg / step_s;
    check(damping, law.bristle_damping_n_s_m, 0.0, most)
}
