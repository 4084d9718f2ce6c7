//! Cylinders, supply and a mechanism advanced together in time.
//!
//! One step of length h, valve states constant over it:
//!
//! 1. half kick: v += h/2 a
//! 2. drift: positions with that mid-step speed; bristles and windings likewise
//! 3. gas: Heun's method, piston positions known at both ends
//! 4. forces at the new positions and pressures and at the predicted speed → a
//! 5. half kick: v += h/2 a
//!
//! This is velocity Verlet with a staggered gas update: second order in h for smooth
//! motion, first order across an impact or a stick–slip change. Steps lie on a
//! fixed grid of absolute time and are cut at every edge of a command, a poppet
//! or a valve's effect, so that no edge is ever rounded to the grid.

use serde::{Deserialize, Serialize};

use crate::chamber::Contents;
use crate::cylinder::{CylinderForces, CylinderModel, CylinderRates, CylinderState};
use crate::error::PlantError;
use crate::hash::StateHasher;
use crate::supply::{SupplyModel, SupplyState};
use crate::valve::NEVER_NS;

/// The parts that the pistons drive: C cylinders and everything else that moves.
pub trait Mechanics<const C: usize> {
    /// Positions, speeds, accelerations and everything else carried from step to step.
    type State;

    /// Piston strokes \[m\], 0 retracted.
    fn strokes_m(&self, state: &Self::State) -> [f64; C];

    /// Piston speeds \[m/s\] `ahead_s` after the state, with its accelerations held.
    fn rates_m_s(&self, state: &Self::State, ahead_s: f64) -> [f64; C];

    /// Piston accelerations as last evaluated \[m/s²\].
    fn accelerations_m_s2(&self, state: &Self::State) -> [f64; C];

    /// Speeds change by `h` seconds of the accelerations held.
    fn kick(&self, state: &mut Self::State, h: f64);

    /// Positions (and inner states such as currents) advance by `h` seconds at
    /// the speeds held.
    fn drift(&self, state: &mut Self::State, h: f64);

    /// New accelerations from the forces of the pistons \[N\], at the end of a
    /// step of `step_s` seconds that has been drifted and half kicked: speeds
    /// are those predicted half a step ahead. A step of 0 evaluates the state as it is.
    ///
    /// # Errors
    /// [`PlantError::Mechanics`] or [`PlantError::NonFinite`] if they cannot be found.
    fn evaluate(
        &self,
        state: &mut Self::State,
        piston_n: &[f64; C],
        step_s: f64,
    ) -> Result<(), PlantError>;

    /// Refuses a state that is not finite or has left the model's range.
    ///
    /// # Errors
    /// [`PlantError::NonFinite`] or [`PlantError::OutOfBounds`] with the name.
    fn check(&self, state: &Self::State) -> Result<(), PlantError>;
}

/// State of an assembly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AssemblyState<S> {
    /// Time of the state \[ns\].
    pub time_ns: u64,
    /// The cylinders; as many as the model has.
    pub cylinders: Vec<CylinderState>,
    /// The supply.
    pub supply: SupplyState,
    /// State of the mechanics.
    pub motion: S,
}

/// Cylinders, supply and mechanics.
#[derive(Debug, Clone)]
pub struct Assembly<M, const C: usize> {
    /// The cylinders.
    pub cylinders: [CylinderModel; C],
    /// The supply.
    pub supply: SupplyModel,
    /// The mechanism.
    pub mechanics: M,
    /// Length of a full step \[ns\].
    pub step_ns: u64,
}

impl<M: Mechanics<C>, const C: usize> Assembly<M, C> {
    /// Forces on each piston in the present state.
    #[must_use]
    pub fn forces(&self, state: &AssemblyState<M::State>) -> [CylinderForces; C] {
        let strokes = self.mechanics.strokes_m(&state.motion);
        let rates = self.mechanics.rates_m_s(&state.motion, 0.0);
        std::array::from_fn(|i| self.cylinders[i].forces(&state.cylinders[i], strokes[i], rates[i]))
    }

    /// Evaluates the accelerations of the present state: before the first step, and after outside changes of
    /// forces that the next step must feel from its start.
    ///
    /// # Errors
    /// As [`Mechanics::evaluate`].
    pub fn start(&self, state: &mut AssemblyState<M::State>) -> Result<(), PlantError> {
        let net = self.forces(state).map(|f| f.net_n());
        self.mechanics.evaluate(&mut state.motion, &net, 0.0)
    }

    /// Advances to `to_ns` with the commands latched so far, from a state whose accelerations
    /// are known ([`Self::start`]).
    ///
    /// # Errors
    /// Any [`PlantError`]; the state is then not usable any more.
    pub fn advance_to(
        &self,
        state: &mut AssemblyState<M::State>,
        to_ns: u64,
    ) -> Result<(), PlantError> {
        if to_ns < state.time_ns {
            return Err(PlantError::Time {
                state_ns: state.time_ns,
                from_ns: state.time_ns,
                to_ns,
            });
        }
        // Faults may have been set from outside since the last call.
        state.cylinders.iter_mut().for_each(CylinderState::refresh);
        while state.time_ns < to_ns {
            let mut edge_ns = state.supply.dump.next_edge_ns();
            for cylinder in &state.cylinders {
                edge_ns = edge_ns.min(cylinder.next_event_ns());
            }
            if edge_ns <= state.time_ns {
                self.settle(state, state.time_ns)?;
                continue;
            }
            let grid_ns = (state.time_ns / self.step_ns + 1).saturating_mul(self.step_ns);
            let end_ns = grid_ns.min(edge_ns).min(to_ns);
            let h = (end_ns - state.time_ns) as f64 * 1e-9;
            self.step(state, h)?;
            state.time_ns = end_ns;
        }
        self.settle(state, to_ns)?;
        self.check(state)
    }

    /// Takes every edge due at `now_ns`.
    fn settle(&self, state: &mut AssemblyState<M::State>, now_ns: u64) -> Result<(), PlantError> {
        for (model, cylinder) in self.cylinders.iter().zip(&mut state.cylinders) {
            if cylinder.next_event_ns() <= now_ns {
                model.settle(cylinder, now_ns)?;
            }
        }
        if state.supply.dump.next_edge_ns() != NEVER_NS {
            state.supply.dump.settle(now_ns, &self.supply.dump_timing)?;
        }
        Ok(())
    }

    /// One step of `h` seconds without an edge inside.
    fn step(&self, state: &mut AssemblyState<M::State>, h: f64) -> Result<(), PlantError> {
        let mechanics = &self.mechanics;
        let before = mechanics.strokes_m(&state.motion);
        mechanics.kick(&mut state.motion, 0.5 * h);
        let middle = mechanics.rates_m_s(&state.motion, 0.0);
        mechanics.drift(&mut state.motion, h);
        let after = mechanics.strokes_m(&state.motion);
        self.step_gas(state, &before, &after, &middle, h);
        let predicted = mechanics.rates_m_s(&state.motion, 0.5 * h);
        let mut net = [0.0; C];
        for i in 0..C {
            let model = &self.cylinders[i];
            let cylinder = &mut state.cylinders[i];
            let pressures_pa = model.pressures_pa(cylinder, after[i]);
            let friction = model.friction(pressures_pa);
            let bristle_m = friction.advance_bristle_m(cylinder.bristle_m, middle[i], h);
            cylinder.bristle_m = bristle_m;
            let motion = (after[i], predicted[i]);
            let forces = model.forces_with(&friction, pressures_pa, bristle_m, motion);
            net[i] = forces.net_n();
        }
        mechanics.evaluate(&mut state.motion, &net, h)?;
        mechanics.kick(&mut state.motion, 0.5 * h);
        Ok(())
    }

    /// Heun's method on all gas masses and energies.
    fn step_gas(
        &self,
        state: &mut AssemblyState<M::State>,
        before: &[f64; C],
        after: &[f64; C],
        rate: &[f64; C],
        h: f64,
    ) {
        let supply_pa = self.supply.pressure_pa(state.supply.mass_kg);
        let first: [CylinderRates; C] = std::array::from_fn(|i| {
            let c = &state.cylinders[i];
            let contents = Contents::of(&c.chamber_a, &c.chamber_b);
            self.cylinders[i].rates(c, contents, before[i], rate[i], supply_pa)
        });
        let source = self.supply.rates(&state.supply, state.supply.mass_kg);
        let taken: f64 = first.iter().map(|r| r.supply_kg_s).sum();
        let net = source.source_kg_s - source.dump_kg_s - taken;
        let predicted_mass = state.supply.mass_kg + h * net;
        let supply_pa = self.supply.pressure_pa(predicted_mass);

        let mut taken_kg = 0.0;
        for i in 0..C {
            let (model, one) = (&self.cylinders[i], &first[i]);
            let c = &mut state.cylinders[i];
            let (rates, exponent) = (&one.chambers, model.exponent);
            let contents = Contents::of(&c.chamber_a, &c.chamber_b);
            let predicted = contents.predicted(rates, exponent, h);
            let two = model.rates(c, predicted, after[i], rate[i], supply_pa);
            let chambers = [&mut c.chamber_a, &mut c.chamber_b];
            rates.mean(&two.chambers).advance(chambers, exponent, h);
            let from_supply = 0.5 * h * (one.supply_kg_s + two.supply_kg_s);
            c.supply_mass_kg += from_supply;
            c.vented_mass_kg += 0.5 * h * (one.vent_kg_s + two.vent_kg_s);
            taken_kg += from_supply;
        }
        let then = self.supply.rates(&state.supply, predicted_mass);
        let drawn = 0.5 * h * (source.source_kg_s + then.source_kg_s);
        let dumped = 0.5 * h * (source.dump_kg_s + then.dump_kg_s);
        state.supply.source_mass_kg += drawn;
        state.supply.dumped_mass_kg += dumped;
        state.supply.mass_kg += drawn - dumped - taken_kg;
        self.supply.update_switch(&mut state.supply);
    }

    /// Refuses a state that is not finite or has left the model's range.
    ///
    /// # Errors
    /// [`PlantError::NonFinite`] or [`PlantError::OutOfBounds`] with the name.
    pub fn check(&self, state: &AssemblyState<M::State>) -> Result<(), PlantError> {
        self.mechanics.check(&state.motion)?;
        let strokes = self.mechanics.strokes_m(&state.motion);
        let most_pa = self.supply.most_pa();
        for (i, (model, stroke)) in self.cylinders.iter().zip(strokes).enumerate() {
            model.check(&state.cylinders[i], i, stroke, most_pa)?;
        }
        self.supply.check(&state.supply)
    }

    /// Gas in the assembly minus inflow plus outflow \[kg\]: constant but for rounding.
    #[must_use]
    pub fn mass_balance_kg(&self, state: &AssemblyState<M::State>) -> f64 {
        let mut sum =
            state.supply.mass_kg + state.supply.dumped_mass_kg - state.supply.source_mass_kg;
        for c in &state.cylinders {
            sum += c.chamber_a.mass_kg + c.chamber_b.mass_kg + c.vented_mass_kg;
        }
        sum
    }

    /// Worst energy balance residual of all chambers since `start` \[J\]:
    /// change of pV minus inflow, work and heat as booked.
    #[must_use]
    pub fn energy_residual_j(
        &self,
        start: &AssemblyState<M::State>,
        state: &AssemblyState<M::State>,
    ) -> f64 {
        let mut worst = 0.0_f64;
        for i in 0..C {
            let n1 = self.cylinders[i].exponent - 1.0;
            let (c0, c1) = (&start.cylinders[i], &state.cylinders[i]);
            for (x0, x1) in [(c0.chamber_a, c1.chamber_a), (c0.chamber_b, c1.chamber_b)] {
                let booked = |x: &crate::chamber::Ledger| x.inflow_j + n1 * (x.heat_j - x.work_j);
                let residual = (x1.pv_j - x0.pv_j) - (booked(&x1.ledger) - booked(&x0.ledger));
                worst = worst.max(residual.abs());
            }
        }
        worst
    }

    /// Adds everything but the motion to a hash.
    pub fn feed(&self, state: &AssemblyState<M::State>, hasher: &mut StateHasher) {
        hasher.u64(state.time_ns);
        for cylinder in &state.cylinders {
            cylinder.feed(hasher);
        }
        state.supply.feed(hasher);
    }
}

/// Observable values of one cylinder.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CylinderOutputs {
    /// Stroke \[m\], 0 retracted.
    pub stroke_m: f64,
    /// Speed \[m/s\], positive extending.
    pub velocity_m_s: f64,
    /// Acceleration \[m/s²\], positive extending.
    pub acceleration_m_s2: f64,
    /// Absolute pressures of A and B \[Pa\].
    pub pressure_pa: [f64; 2],
    /// Gas temperatures of A and B \[K\].
    pub temperature_k: [f64; 2],
    /// Driver levels, `[fill A, vent A, fill B, vent B]`.
    pub valve_commanded: [bool; 4],
    /// Poppets physically open.
    pub poppet_open: [bool; 4],
    /// Valves as the chamber sees them (line delay and faults included).
    pub valve_open: [bool; 4],
    /// Poppet movements so far.
    pub valve_switches: [u64; 4],
    /// Forces on the piston by origin; `net_n()` is the F of the paper's plots.
    pub forces: CylinderForces,
}

impl<M: Mechanics<C>, const C: usize> Assembly<M, C> {
    /// Everything that can be seen of the cylinders.
    #[must_use]
    pub fn outputs(&self, state: &AssemblyState<M::State>) -> [CylinderOutputs; C] {
        let strokes = self.mechanics.strokes_m(&state.motion);
        let rates = self.mechanics.rates_m_s(&state.motion, 0.0);
        let accelerations = self.mechanics.accelerations_m_s2(&state.motion);
        let forces = self.forces(state);
        std::array::from_fn(|i| {
            let (model, c) = (&self.cylinders[i], &state.cylinders[i]);
            CylinderOutputs {
                stroke_m: strokes[i],
                velocity_m_s: rates[i],
                acceleration_m_s2: accelerations[i],
                pressure_pa: model.pressures_pa(c, strokes[i]),
                temperature_k: model.temperatures_k(c),
                valve_commanded: std::array::from_fn(|k| c.valves[k].commanded()),
                poppet_open: std::array::from_fn(|k| c.valves[k].poppet_open()),
                valve_open: std::array::from_fn(|k| c.valves[k].is_open()),
                valve_switches: std::array::from_fn(|k| c.valves[k].switches()),
                forces: forces[i],
            }
        })
    }
}
