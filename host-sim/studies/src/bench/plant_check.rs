//! What can be said of a plant without a reference: balances, order, continuity.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use wheeleg_plant::PlantError;
use wheeleg_plant::axis::{Axis, AxisParams};
use wheeleg_plant::flow::Restrictor;

/// Result of the checks of one axis.
#[derive(Debug, Clone, Serialize)]
pub struct PlantCheck {
    /// Gas gained or lost in 10 s of random switching, share of what flowed \[-\].
    pub mass_residual: f64,
    /// Worst energy residual of a chamber, share of its inflow \[-\].
    pub energy_residual: f64,
    /// Order of convergence when the step is halved: of stroke and of pressure.
    pub order: [f64; 2],
    /// Error of the stroke at the file's step, against a step 32 times shorter \[m\].
    pub step_error_m: f64,
    /// Largest relative jump of the flow at the choked border and at that of the
    /// linear zone \[-\].
    pub flow_jump: f64,
    /// The limits above are kept.
    pub passed: bool,
}

/// Largest mass and energy residual.
pub const BALANCE_LIMIT: f64 = 1e-9;
/// Range of the order of a method of second order.
pub const ORDER_RANGE: [f64; 2] = [1.8, 2.2];
/// Largest jump of the flow function within 1e-9 of the pressure ratio.
pub const JUMP_LIMIT: f64 = 1e-6;
/// Largest error of the stroke from the step, m.
pub const STEP_LIMIT_M: f64 = 2e-6;

/// Checks an axis.
///
/// # Errors
/// Any [`PlantError`].
pub fn check(params: &AxisParams) -> Result<PlantCheck, PlantError> {
    let (mass_residual, energy_residual) = balances(params)?;
    let (order, step_error_m) = convergence(params)?;
    let flow_jump = jump(params);
    let between = |x: f64| (ORDER_RANGE[0]..=ORDER_RANGE[1]).contains(&x);
    Ok(PlantCheck {
        mass_residual,
        energy_residual,
        order,
        step_error_m,
        flow_jump,
        passed: mass_residual <= BALANCE_LIMIT
            && energy_residual <= BALANCE_LIMIT
            && order.iter().all(|o| between(*o))
            && step_error_m <= STEP_LIMIT_M
            && flow_jump <= JUMP_LIMIT,
    })
}

fn balances(params: &AxisParams) -> Result<(f64, f64), PlantError> {
    let axis = Axis::new(params)?;
    let start = axis.initial_state(1);
    let mut state = start.clone();
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    let mut on = [0_u16; 4];
    for k in 0..10_000 {
        if k % 20 == 0 {
            on = std::array::from_fn(|_| [0, 350, 1000][rng.random_range(0..3_usize)]);
        }
        axis.tick(&mut state, on)?;
    }
    let c = &state.core.cylinders[0];
    let flowed = c.supply_mass_kg.abs() + c.vented_mass_kg.abs();
    let mass =
        axis.assembly.mass_balance_kg(&state.core) - axis.assembly.mass_balance_kg(&start.core);
    let energy = axis.assembly.energy_residual_j(&start.core, &state.core);
    let inflow = c.chamber_a.ledger.inflow_j.abs() + c.chamber_b.ledger.work_j.abs();
    Ok((mass.abs() / flowed.max(1e-12), energy / inflow.max(1e-9)))
}

/// A smooth stretch of sliding, valves open throughout: root mean square of the
/// errors over its ticks at steps of 400 µs, and at an eighth of it.
fn convergence(params: &AxisParams) -> Result<([f64; 2], f64), PlantError> {
    let mut smooth = params.clone();
    // Away from the stops' cushions, and no bristle that breaks.
    smooth.initial_stroke_m = 0.25 * params.cylinder.stroke_m;
    smooth.cylinder.friction.static_n = 0.0;
    smooth.cylinder.friction.coulomb_n = 0.0;
    // Exact within its smoothness: no edge between two grids.
    for valve in [
        &mut smooth.cylinder.fill_valve,
        &mut smooth.cylinder.vent_valve,
    ] {
        (valve.t_on_s, valve.t_off_s) = (2e-3, 2e-3);
    }
    smooth.cylinder.line_delay_s = 0.0;
    let run = |step_ns: u64| -> Result<Vec<[f64; 2]>, PlantError> {
        let mut p = smooth.clone();
        p.step_ns = step_ns;
        let axis = Axis::new(&p)?;
        let mut state = axis.initial_state(1);
        let mut rows = Vec::new();
        for _ in 0..40 {
            axis.tick(&mut state, [1000, 0, 0, 1000])?;
            rows.push([
                state.core.motion.stroke_m,
                state.core.cylinders[0].chamber_a.pv_j,
            ]);
        }
        Ok(rows)
    };
    let fine = run(2_500)?;
    let errors = |rows: &[[f64; 2]]| -> [f64; 2] {
        std::array::from_fn(|i| {
            let squares = rows.iter().zip(&fine).map(|(a, b)| (a[i] - b[i]).powi(2));
            squares.sum::<f64>().sqrt()
        })
    };
    let (coarse, half) = (errors(&run(400_000)?), errors(&run(50_000)?));
    let order = std::array::from_fn(|i| (coarse[i] / half[i].max(1e-300)).log2() / 3.0);
    let worst = run(params.step_ns)?
        .iter()
        .zip(&fine)
        .map(|(a, b)| (a[0] - b[0]).abs())
        .fold(0.0, f64::max);
    Ok((order, worst))
}

fn jump(params: &AxisParams) -> f64 {
    let c = &params.cylinder;
    [&c.fill_valve.flow, &c.vent_valve.flow]
        .into_iter()
        .chain(&c.line_flow)
        .flat_map(|path| {
            let r = Restrictor::new(path, &params.gas);
            [path.critical_ratio, path.linear_ratio]
                .map(|border| (r.psi(border + 1e-9) - r.psi(border - 1e-9)).abs())
        })
        .fold(0.0, f64::max)
}
