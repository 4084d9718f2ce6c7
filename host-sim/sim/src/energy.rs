//! Account of the mechanical energy of a run: the work of actuators, ground and bearings against the energy
//! that the robot has gained.

use wheeleg_plant::PlantError;
use wheeleg_plant::body::Power;
use wheeleg_plant::robot::{Plant, PlantState};

/// Longest stretch over which the power is taken as straight, ns: the plant's own step.
const STRETCH_NS: u64 = 100_000;

/// The balance since the account was opened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyBalance {
    /// Kinetic and potential energy gained \[J\].
    pub gained_j: f64,
    /// Work of pistons, motors, ground and bearings on the robot \[J\].
    pub work_j: f64,
    /// Work of pistons and motors, whatever its sign \[J\].
    pub actuators_j: f64,
}

impl EnergyBalance {
    /// Energy gained without any work \[J\]: 0 except for the error of the integration.
    #[must_use]
    pub fn residual_j(&self) -> f64 {
        self.gained_j - self.work_j
    }
}

/// The account while it is kept.
#[derive(Debug, Clone)]
pub(crate) struct EnergyMeter {
    begun_j: f64,
    work_j: f64,
    actuators_j: f64,
}

impl EnergyMeter {
    /// # Errors
    /// As [`Plant::advance_to`].
    pub(crate) fn new(plant: &Plant, state: &PlantState) -> Result<Self, PlantError> {
        Ok(Self {
            begun_j: stored_j(plant, state)?,
            work_j: 0.0,
            actuators_j: 0.0,
        })
    }

    /// Advances the plant to `to_ns`, in the steps that it would take without the account.
    ///
    /// # Errors
    /// As [`Plant::advance_to`].
    pub(crate) fn advance(
        &mut self,
        plant: &Plant,
        state: &mut PlantState,
        to_ns: u64,
    ) -> Result<(), PlantError> {
        // Boards, faults and the ground may have changed since the last time.
        let mut before = power(plant, state)?;
        while state.core.time_ns < to_ns {
            let from_ns = state.core.time_ns;
            let grid_ns = (from_ns / STRETCH_NS + 1) * STRETCH_NS;
            plant.advance_to(state, grid_ns.min(to_ns))?;
            let now = power(plant, state)?;
            let half_s = 0.5e-9 * (state.core.time_ns - from_ns) as f64;
            let over = |of: fn(&Power) -> f64| half_s * (of(&before) + of(&now));
            self.work_j += over(|p| p.pistons_w + p.motors_w + p.ground_w + p.bearings_w);
            self.actuators_j += over(|p| p.pistons_w.abs() + p.motors_w.abs());
            before = now;
        }
        plant.advance_to(state, to_ns)
    }

    /// # Errors
    /// As [`Plant::advance_to`].
    pub(crate) fn balance(
        &self,
        plant: &Plant,
        state: &PlantState,
    ) -> Result<EnergyBalance, PlantError> {
        Ok(EnergyBalance {
            gained_j: stored_j(plant, state)? - self.begun_j,
            work_j: self.work_j,
            actuators_j: self.actuators_j,
        })
    }
}

fn stored_j(plant: &Plant, state: &PlantState) -> Result<f64, PlantError> {
    plant.assembly.mechanics.energy_j(&state.core.motion)
}

fn power(plant: &Plant, state: &PlantState) -> Result<Power, PlantError> {
    let net = plant.assembly.forces(&state.core).map(|f| f.net_n());
    plant.assembly.mechanics.power(&state.core.motion, &net)
}
