//! The experiments of the comparison: moves, start-up, delays.
//!
//! Every experiment is a function of an axis's data sheet, a controller and a seed. The controller's gains
//! come only from the data sheet; a factor changes only the plant. [`identify`] may find the valves' delays
//! before the first move, as on a board at start-up.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
pub use wheeleg_config::bench::{Factors, StartUp, force_left_n, weaker_force_n};
use wheeleg_plant::axis::AxisParams;

pub use super::error::AxisSimError;
use super::{AxisSim, Design, Firmware, Kind, LoadEvent, Motion, Node, Trace};
use super::{Delays, design, design_with, identify};

/// Draws the unknowns of a board at power-up by a number: both chamber pressures between the atmosphere
/// and the supply, such that with the load the piston stands within half of its friction. Returns the
/// tick of the law's period in which the first move falls, 0…3.
///
/// # Errors
/// [`AxisSimError::Start`] if there are no such pressures.
pub fn draw_start(plant: &mut AxisParams, number: u64) -> Result<u64, AxisSimError> {
    let mut rng = Pcg64Mcg::seed_from_u64(number ^ 0x57A2_7000);
    let (low, high) = (
        plant.gas.ambient_pressure_pa,
        plant.supply.initial_pressure_pa,
    );
    let load_n = plant.load_n;
    let cylinder = &mut plant.cylinder;
    let circle = |d_m: f64| std::f64::consts::FRAC_PI_4 * d_m * d_m;
    let (bore, rod) = (circle(cylinder.bore_m), circle(cylinder.rod_m));
    let none = AxisSimError::Start {
        ambient_pa: low,
        supply_pa: high,
        load_n,
    };
    if low >= high {
        return Err(none);
    }
    for _ in 0..1000 {
        let a_pa = rng.random_range(low..high);
        let net_n = 0.5 * cylinder.friction.coulomb_n * rng.random_range(-1.0..1.0);
        let b_pa = (a_pa * bore - low * rod + load_n - net_n) / (bore - rod);
        if (low..=high).contains(&b_pa) {
            cylinder.initial_pressure_a_pa = a_pa;
            cylinder.initial_pressure_b_pa = b_pa;
            return Ok(rng.random_range(0..4));
        }
    }
    Err(none)
}

/// The design of a controller that knows the sheet of its plant and, after [`StartUp::Identified`], the
/// valves' delays.
///
/// # Errors
/// [`AxisSimError`].
pub fn designed(
    sheet: &AxisParams,
    plant: &AxisParams,
    kind: Kind,
    start: StartUp,
    seed: u64,
) -> Result<Design, AxisSimError> {
    Ok(designed_with(
        sheet,
        searched(sheet, plant, start, seed)?,
        kind,
        start,
    ))
}

/// The valves' delays that a board has found at start-up; none if it did not search for them, or found none.
///
/// # Errors
/// [`AxisSimError`].
pub fn searched(
    sheet: &AxisParams,
    plant: &AxisParams,
    start: StartUp,
    seed: u64,
) -> Result<Option<Delays>, AxisSimError> {
    match start {
        StartUp::Sheet => Ok(None),
        StartUp::Identified => identify(plant, sheet, seed),
    }
}

/// The design of a controller whose board has [`searched`] for the valves' delays.
#[must_use]
pub fn designed_with(
    sheet: &AxisParams,
    found: Option<Delays>,
    kind: Kind,
    start: StartUp,
) -> Design {
    match start {
        StartUp::Sheet => design(sheet, kind),
        StartUp::Identified => design_with(sheet, found, kind),
    }
}

/// A supervised board on its plant, moved from place to place.
pub struct TestRig {
    bench: AxisSim<Node>,
    at_m: f64,
}

impl TestRig {
    /// Powers up a board with a design, on a plant at rest.
    ///
    /// # Errors
    /// [`AxisSimError`].
    pub fn new(plant: &AxisParams, design: &Design, seed: u64) -> Result<Self, AxisSimError> {
        Ok(Self {
            bench: AxisSim::new(plant, seed, Node::new(design)?)?,
            at_m: plant.initial_stroke_m,
        })
    }

    /// Plant and board.
    #[must_use]
    pub fn bench(&self) -> &AxisSim<Node> {
        &self.bench
    }

    /// The current reference \[m\].
    #[must_use]
    pub const fn at_m(&self) -> f64 {
        self.at_m
    }

    /// Waits for `ms` milliseconds at the reference.
    ///
    /// # Errors
    /// [`AxisSimError`].
    pub fn wait(&mut self, ms: u64) -> Result<(), AxisSimError> {
        if ms > 0 {
            let stand = Motion::Step {
                at_s: 0.0,
                from_m: self.at_m,
                to_m: self.at_m,
            };
            self.run(&stand, &[], ms as f64 * 1e-3)?;
        }
        Ok(())
    }

    /// A step of the reference, recorded from 0.05 s before it.
    ///
    /// # Errors
    /// [`AxisSimError`].
    pub fn step(&mut self, to_m: f64, seconds: f64) -> Result<Trace, AxisSimError> {
        self.step_with(to_m, &[], seconds)
    }

    /// A step with loads that change.
    ///
    /// # Errors
    /// [`AxisSimError`].
    pub fn step_with(
        &mut self,
        to_m: f64,
        loads: &[LoadEvent],
        seconds: f64,
    ) -> Result<Trace, AxisSimError> {
        let motion = Motion::Step {
            at_s: LEAD_S,
            from_m: self.at_m,
            to_m,
        };
        self.run(&motion, loads, seconds)
    }

    /// Any motion; it must begin at the current reference.
    ///
    /// # Errors
    /// [`AxisSimError`].
    pub fn run(
        &mut self,
        motion: &Motion,
        loads: &[LoadEvent],
        seconds: f64,
    ) -> Result<Trace, AxisSimError> {
        self.at_m = motion.to_m();
        self.bench.run(motion, loads, seconds)
    }
}

/// Recording before a motion begins \[s\].
pub const LEAD_S: f64 = 0.05;

/// Steps to one place after the other, from power-up: the first is the learning
/// move.
///
/// # Errors
/// [`AxisSimError`].
pub fn steps(
    sheet: &AxisParams,
    factors: &Factors,
    kind: Kind,
    start: StartUp,
    seed: u64,
    targets_m: &[f64],
    seconds: f64,
) -> Result<Vec<Trace>, AxisSimError> {
    let plant = factors.plant(sheet);
    let design = designed(sheet, &plant, kind, start, seed)?;
    let mut rig = TestRig::new(&plant, &design, seed)?;
    targets_m
        .iter()
        .map(|to_m| rig.step(*to_m, seconds))
        .collect()
}

/// The retract move from the extended end stop, after the controller has pushed against the stop for 3 s: the
/// start from home of the paper's test. Chamber pressures come from the simulation alone. The board gets the
/// move `preview_s` ahead.
///
/// # Errors
/// [`AxisSimError`].
pub fn home_retract(
    plant: &AxisParams,
    design: &Design,
    seed: u64,
    preview_s: f64,
) -> Result<Trace, AxisSimError> {
    let board = Firmware::new(design).map_err(AxisSimError::Design)?;
    let mut start = plant.clone();
    let stroke_m = plant.cylinder.stroke_m;
    start.initial_stroke_m = 0.9 * stroke_m;
    let mut bench = AxisSim::new(&start, seed, board)?;
    // A little beyond the stop, so that a law without a settle band keeps pushing.
    let home_m = stroke_m + 1e-3;
    bench.run(
        &Motion::Step {
            at_s: 0.05,
            from_m: start.initial_stroke_m,
            to_m: home_m,
        },
        &[],
        3.0,
    )?;
    bench.preview_s = preview_s;
    let motion = Motion::Step {
        at_s: 0.7,
        from_m: home_m,
        to_m: 0.1 * stroke_m,
    };
    bench.run(&motion, &[], 3.0)
}
