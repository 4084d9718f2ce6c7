//! The experiments of the comparison: moves, factors, combinations, delays.
//!
//! Every experiment is a function of an axis's data sheet, a controller and a
//! seed. The controller's gains come from the data sheet alone; what a factor
//! changes is changed in the plant only. [`identify`] may find the valves'
//! delays before the first move, as on a board at start-up.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use wheeleg_control::joint::ConfigError;
use wheeleg_plant::PlantError;
use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::sensors::AdcNoise;

use super::{Bench, Design, Firmware, Kind, LoadEvent, Metrics, Motion, Node, Trace};
use super::{design, design_with, identify};

/// An experiment could not be made.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum BenchError {
    /// The plant refused its parameters or left its range.
    #[error("the plant of the axis: {0}")]
    #[diagnostic(
        code(wheeleg::bench::plant),
        help("check the axis file against the ranges in its messages")
    )]
    Plant(#[from] PlantError),
    /// The design is not one the board accepts.
    #[error("the board refuses the design for this axis: {0:?}")]
    #[diagnostic(
        code(wheeleg::bench::design),
        help(
            "the axis's data lie outside what the joint board supports; see the parameter table in SPEC.md"
        )
    )]
    Design(ConfigError),
    /// A value that the board's parameter table does not hold.
    #[error(
        "the design needs `{name}` = {value} {unit}; a joint board allows {min} to {max} {unit}"
    )]
    #[diagnostic(
        code(wheeleg::bench::parameter),
        help(
            "the axis's data lie outside what the joint board supports; see the parameter table in SPEC.md"
        )
    )]
    Parameter {
        /// Name in the table.
        name: &'static str,
        /// What the design needs.
        value: f64,
        /// Smallest value of the table.
        min: f64,
        /// Largest value of the table.
        max: f64,
        /// Unit.
        unit: &'static str,
    },
    /// The board refuses the set of parameters.
    #[error("{0}")]
    #[diagnostic(
        code(wheeleg::bench::board),
        help("please report this with the axis file")
    )]
    Board(String),
}

/// What differs from the data sheet.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Factors {
    /// Force on the rod as a share of the force left at the actual supply on the
    /// weaker side, −0.8…0.8; positive extends.
    pub load_share: f64,
    /// Moving mass \[kg\]; `None` leaves the sheet's.
    pub mass_kg: Option<f64>,
    /// Supply pressure \[Pa gauge\]; `None` leaves the sheet's.
    pub supply_pa: Option<f64>,
    /// Factor on all friction forces.
    pub friction: f64,
    /// Factor on the valves' switching times.
    pub valve_delay: f64,
    /// Spread between the valves: fill A and vent B switch slower by this share,
    /// vent A and fill B faster.
    pub valve_spread: f64,
    /// Factor on the converter's noise.
    pub noise: f64,
}

impl Factors {
    /// Nothing differs.
    pub const NONE: Self = Self {
        load_share: 0.0,
        mass_kg: None,
        supply_pa: None,
        friction: 1.0,
        valve_delay: 1.0,
        valve_spread: 0.0,
        noise: 1.0,
    };

    /// One combination of the random suite: load ±0.8, mass 1…8 kg, supply 4…7 bar
    /// gauge, friction and valve delay 0.5…2; mass, friction and delay uniform in
    /// their logarithm.
    #[must_use]
    pub fn random(seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut unit = || rng.random_range(0.0..1.0_f64);
        Self {
            load_share: 0.8 * (2.0 * unit() - 1.0),
            mass_kg: Some(8.0_f64.powf(unit())),
            supply_pa: Some(1e5 * (4.0 + 3.0 * unit())),
            friction: 2.0_f64.powf(2.0 * unit() - 1.0),
            valve_delay: 2.0_f64.powf(2.0 * unit() - 1.0),
            ..Self::NONE
        }
    }

    /// The plant with these factors.
    #[must_use]
    pub fn plant(&self, sheet: &AxisParams) -> AxisParams {
        let mut p = sheet.clone();
        if let Some(mass) = self.mass_kg {
            p.moving_mass_kg = mass;
        }
        if let Some(gauge) = self.supply_pa {
            let absolute = gauge + p.gas.ambient_pressure_pa;
            p.supply.set_pressure_pa = absolute;
            p.supply.initial_pressure_pa = absolute;
            p.supply.source_pressure_pa = p.supply.source_pressure_pa.max(absolute + 1e5);
        }
        let f = &mut p.cylinder.friction;
        f.coulomb_n *= self.friction;
        f.static_n *= self.friction;
        f.viscous_n_s_m *= self.friction;
        for (spread, sign) in p
            .cylinder
            .timing_spread
            .iter_mut()
            .zip([1.0, -1.0, -1.0, 1.0])
        {
            *spread *= self.valve_delay * (1.0 + sign * self.valve_spread);
        }
        match &mut p.adc.noise {
            AdcNoise::Uniform {
                half_width_lsb: width,
            }
            | AdcNoise::Gaussian { sigma_lsb: width } => {
                *width *= self.noise;
            }
            AdcNoise::None => {}
        }
        p.load_n += self.load_share * force_left_n(&p);
        p
    }

    /// Force left over the load: 1.25 means a quarter more than the load needs.
    #[must_use]
    pub fn static_margin(&self, sheet: &AxisParams) -> f64 {
        let p = self.plant(sheet);
        force_left_n(&p) / p.load_n.abs().max(1e-9)
    }
}

/// Force at the supply of a plant on the weaker side, less break-away friction \[N\].
#[must_use]
pub fn force_left_n(p: &AxisParams) -> f64 {
    let c = &p.cylinder;
    let area = std::f64::consts::FRAC_PI_4 * (c.bore_m * c.bore_m - c.rod_m * c.rod_m);
    let gauge = p.supply.set_pressure_pa - p.gas.ambient_pressure_pa;
    gauge * area - c.friction.static_n
}

/// Whether a controller finds the valves' delays before its first move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StartUp {
    /// The data sheet's delays are used.
    Sheet,
    /// They are found by [`identify`].
    Identified,
}

/// A board for the plant of `factors`, designed from the sheet.
///
/// # Errors
/// [`BenchError`].
pub fn board(
    sheet: &AxisParams,
    plant: &AxisParams,
    kind: Kind,
    start: StartUp,
    seed: u64,
) -> Result<Node, BenchError> {
    let design: Design = match start {
        StartUp::Sheet => design(sheet, kind),
        StartUp::Identified => design_with(sheet, identify(plant, sheet, seed)?, kind),
    };
    Node::new(&design)
}

/// Steps between two shares of the stroke, one after the other, from power-up:
/// the first is the learning move.
///
/// # Errors
/// [`BenchError`].
pub fn steps(
    sheet: &AxisParams,
    factors: &Factors,
    kind: Kind,
    start: StartUp,
    seed: u64,
    targets_m: &[f64],
    seconds: f64,
) -> Result<Vec<Trace>, BenchError> {
    let plant = factors.plant(sheet);
    let board = board(sheet, &plant, kind, start, seed)?;
    let mut bench = Bench::new(&plant, seed, board)?;
    let mut from_m = plant.initial_stroke_m;
    let mut traces = Vec::with_capacity(targets_m.len());
    for &to_m in targets_m {
        let step = Motion::Step {
            at_s: 0.05,
            from_m,
            to_m,
        };
        traces.push(bench.run(&step, &[], seconds)?);
        from_m = to_m;
    }
    Ok(traces)
}

/// An S-curve after a learning step there and back, extending and retracting.
///
/// # Errors
/// [`BenchError`].
pub fn s_curves(
    sheet: &AxisParams,
    kind: Kind,
    seed: u64,
    from_m: f64,
    to_m: f64,
    duration_s: f64,
) -> Result<[Metrics; 2], BenchError> {
    let board = board(sheet, sheet, kind, StartUp::Sheet, seed)?;
    let mut bench = Bench::new(sheet, seed, board)?;
    let mut at_m = sheet.initial_stroke_m;
    for target_m in [to_m, from_m] {
        let step = Motion::Step {
            at_s: 0.05,
            from_m: at_m,
            to_m: target_m,
        };
        bench.run(&step, &[], 2.0)?;
        at_m = target_m;
    }
    let mut curve = |from_m: f64, to_m: f64| {
        let motion = Motion::SCurve {
            at_s: 0.05,
            duration_s,
            from_m,
            to_m,
        };
        bench
            .run(&motion, &[], duration_s + 1.0)
            .map(|t| Metrics::of(&t))
    };
    Ok([curve(from_m, to_m)?, curve(to_m, from_m)?])
}

/// Loss of contact: a force of `load_n` is taken away in mid-move and comes back
/// 0.4 s later. Gives the trace and the largest error from 0.5 s after the
/// return on \[mm\].
///
/// # Errors
/// [`BenchError`].
pub fn contact_loss(
    sheet: &AxisParams,
    kind: Kind,
    seed: u64,
    load_n: f64,
) -> Result<(Trace, f64), BenchError> {
    let mut loaded = sheet.clone();
    loaded.load_n = load_n;
    let stroke_m = sheet.cylinder.stroke_m;
    let (low_m, high_m) = (0.22 * stroke_m, 0.78 * stroke_m);
    let board = board(sheet, &loaded, kind, StartUp::Sheet, seed)?;
    let mut bench = Bench::new(&loaded, seed, board)?;
    let mut at_m = loaded.initial_stroke_m;
    for to_m in [high_m, low_m] {
        bench.run(
            &Motion::Step {
                at_s: 0.05,
                from_m: at_m,
                to_m,
            },
            &[],
            2.0,
        )?;
        at_m = to_m;
    }
    let events = [
        LoadEvent {
            at_s: 0.15,
            load_n: 0.0,
        },
        LoadEvent { at_s: 0.55, load_n },
    ];
    let motion = Motion::Step {
        at_s: 0.05,
        from_m: low_m,
        to_m: high_m,
    };
    let trace = bench.run(&motion, &events, 2.5)?;
    let worst = trace.rows[1050..]
        .iter()
        .map(|r| (r.stroke_m - high_m).abs())
        .fold(0.0, f64::max);
    Ok((trace, worst * 1e3))
}

/// The retract move from the extended end stop, after the controller has pushed
/// against the stop for 3 s: the start from home of the paper's test. Chamber
/// pressures come from the simulation alone. `notice_s` is how long before the
/// move the board is told of it.
///
/// # Errors
/// [`BenchError`].
pub fn home_retract(
    plant: &AxisParams,
    design: &Design,
    seed: u64,
    notice_s: f64,
) -> Result<Trace, BenchError> {
    let board = Firmware::new(design).map_err(BenchError::Design)?;
    let mut start = plant.clone();
    let stroke_m = plant.cylinder.stroke_m;
    start.initial_stroke_m = 0.9 * stroke_m;
    let mut bench = Bench::new(&start, seed, board)?;
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
    bench.notice_s = notice_s;
    let motion = Motion::Step {
        at_s: 0.7,
        from_m: home_m,
        to_m: 0.1 * stroke_m,
    };
    Ok(bench.run(&motion, &[], 3.0)?)
}
