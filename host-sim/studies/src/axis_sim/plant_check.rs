//! Checks of a plant that need no recording of the real one: balances, agreement with a model from the text
//! book, order of convergence, error of the step, continuity of the flow.
//!
//! A value beyond its limit has one of two causes: either the plant is wrong, or the step of the file is too
//! long. In the second case a shorter step brings the value into its limit, so shorter steps are tried.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use wheeleg_plant::PlantError;
use wheeleg_plant::axis::{Axis, AxisParams, AxisState};
use wheeleg_plant::chamber::GasModel;
use wheeleg_plant::flow::Restrictor;
use wheeleg_plant::supply::SupplyParams;

use super::error::AxisSimError;
use super::textbook::{Commands, Textbook};
use super::unphysical;

/// Checked quantities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Gas gained or lost in 10 s of random switching, share of what flowed \[-\].
    MassResidual,
    /// Worst energy residual of a chamber in these 10 s, share of its inflow \[-\].
    EnergyResidual,
    /// Largest difference in pressure from the text book, share of the change in pressure \[-\].
    Pressure,
    /// The same in stroke.
    Stroke,
    /// The same in pressure of the energy balance with heat exchange.
    ThermalPressure,
    /// Order of convergence in the stroke when the step is halved.
    OrderStroke,
    /// The same in the pressure.
    OrderPressure,
    /// Error of the stroke at the file's step \[m\].
    StepError,
    /// Largest jump of the flow function at its two borders \[-\].
    FlowJump,
}

/// Verdict on a quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "verdict")]
pub enum Verdict {
    /// It is within its limits.
    Holds,
    /// It is beyond them, and a shorter step does not help.
    Wrong,
    /// It is beyond them because the step is too long.
    StepTooLong {
        /// A step with which it holds, s.
        try_s: f64,
    },
    /// Errors are not of the form "constant × step to a power" at these steps, for instance because they are
    /// near rounding or the piston stops at once: no verdict is possible.
    NotAsymptotic,
}

/// One quantity with its limits and verdict.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Finding {
    /// The quantity.
    pub quantity: Quantity,
    /// Its value.
    pub value: f64,
    /// Smallest allowed value.
    pub min: f64,
    /// Largest allowed value.
    pub max: f64,
    /// Verdict.
    #[serde(flatten)]
    pub verdict: Verdict,
}

/// Result of the checks of one axis.
#[derive(Debug, Clone, Serialize)]
pub struct PlantCheck {
    /// Every quantity.
    pub findings: Vec<Finding>,
    /// Whether nothing is wrong. A quantity without a verdict is not wrong.
    pub passed: bool,
}

/// Largest mass and energy residual.
pub const BALANCE_LIMIT: f64 = 1e-9;
/// Largest difference from the text book, share of the change.
pub const TEXTBOOK_LIMIT: f64 = 1e-3;
/// Range of the order of a method of second order.
pub const ORDER_RANGE: [f64; 2] = [1.8, 2.2];
/// Largest jump of the flow function within 1e-9 of the pressure ratio.
pub const JUMP_LIMIT: f64 = 1e-6;
/// Largest error of the stroke from the step, m.
pub const STEP_LIMIT_M: f64 = 2e-6;

/// Where there is an order, those from neighbouring pairs of steps differ by less than this.
const ORDER_SPREAD: f64 = 0.15;
/// The shortest step tried, ns: the errors are relative to a run at 1.25 us.
const SHORTEST_NS: u64 = 2_000;
/// Share of the stroke before a stop within which the piston counts as arrived.
const MARGIN: f64 = 0.02;
/// Fewest ticks of 1 ms for judging an order; the valves take two of them to open.
const LEAST_TICKS: usize = 6;
/// Errors below this share of the value are rounding.
const ROUNDING: f64 = 1e-11;
/// Valves are open this long in the compared manoeuvre, ms.
const OPEN_MS: u64 = 20;
/// They are shut this long at its end, to show leaks and heat, ms.
const SHUT_MS: u64 = 150;
/// Heat transfer of the thermal manoeuvre \[W/(m² K)\].
const HEAT_TRANSFER_W_M2_K: f64 = 60.0;

/// Builds a plant from parameters, and acts on its state after each tick. For the real plant it does nothing;
/// tests insert errors here.
pub struct Made<'a> {
    /// Builds the plant.
    pub build: &'a dyn Fn(&AxisParams) -> Result<Axis, PlantError>,
    /// Acts on its state after each tick.
    pub after_tick: &'a dyn Fn(&mut AxisState),
}

impl Made<'_> {
    /// The unchanged plant.
    #[must_use]
    pub fn as_it_is() -> Self {
        Self {
            build: &Axis::new,
            after_tick: &|_| {},
        }
    }

    fn tick(&self, axis: &Axis, state: &mut AxisState, on: [u16; 4]) -> Result<(), AxisSimError> {
        unphysical::tick(axis, state, on)?;
        (self.after_tick)(state);
        Ok(())
    }
}

/// Checks an axis.
///
/// # Errors
/// [`AxisSimError`].
pub fn check(params: &AxisParams) -> Result<PlantCheck, AxisSimError> {
    check_made(params, &Made::as_it_is())
}

/// The same for a plant that is built in another way.
///
/// # Errors
/// [`AxisSimError`].
pub fn check_made(params: &AxisParams, made: &Made<'_>) -> Result<PlantCheck, AxisSimError> {
    let mut findings = balances(params, made)?.to_vec();
    findings.extend(textbook(params, made)?);
    findings.extend(convergence(params, made)?);
    let jump = jump(params);
    findings.push(Finding::at_most(Quantity::FlowJump, jump, JUMP_LIMIT));
    let passed = findings.iter().all(|f| f.verdict != Verdict::Wrong);
    Ok(PlantCheck { findings, passed })
}

impl Finding {
    fn within(quantity: Quantity, value: f64, [min, max]: [f64; 2]) -> Self {
        let verdict = match (min..=max).contains(&value) {
            true => Verdict::Holds,
            false => Verdict::Wrong,
        };
        Self {
            quantity,
            value,
            min,
            max,
            verdict,
        }
    }

    fn at_most(quantity: Quantity, value: f64, max: f64) -> Self {
        Self::within(quantity, value, [0.0, max])
    }
}

fn balances(params: &AxisParams, made: &Made<'_>) -> Result<[Finding; 2], AxisSimError> {
    let axis = (made.build)(params)?;
    let start = axis.initial_state(1);
    let mut state = start.clone();
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    let mut on = [0_u16; 4];
    for k in 0..10_000 {
        if k % 20 == 0 {
            on = std::array::from_fn(|_| [0, 350, 1000][rng.random_range(0..3_usize)]);
        }
        made.tick(&axis, &mut state, on)?;
    }
    let c = &state.core.cylinders[0];
    let flowed = c.supply_mass_kg.abs() + c.vented_mass_kg.abs();
    let mass =
        axis.assembly.mass_balance_kg(&state.core) - axis.assembly.mass_balance_kg(&start.core);
    let energy = axis.assembly.energy_residual_j(&start.core, &state.core);
    let inflow = c.chamber_a.ledger.inflow_j.abs() + c.chamber_b.ledger.work_j.abs();
    let shares = [mass.abs() / flowed.max(1e-12), energy / inflow.max(1e-9)];
    Ok([
        Finding::at_most(Quantity::MassResidual, shares[0], BALANCE_LIMIT),
        Finding::at_most(Quantity::EnergyResidual, shares[1], BALANCE_LIMIT),
    ])
}

/// An axis that the text book models completely: no leak, no dry friction, no cushions, a supply that does
/// not give way, and enough mass to keep the piston away from its stops.
fn plain(params: &AxisParams) -> AxisParams {
    let mut axis = params.clone();
    let cylinder = &mut axis.cylinder;
    (cylinder.piston_leak_m3_s_pa, cylinder.rod_leak_m3_s_pa) = (0.0, 0.0);
    cylinder.friction.static_n = 0.0;
    cylinder.friction.coulomb_n = 0.0;
    cylinder.friction.pressure_area_m2 = 0.0;
    // The cushions of a short stroke reach its middle.
    cylinder.end_stop.cushion_damping_n_s_m = 0.0;
    let ambient_pa = axis.gas.ambient_pressure_pa;
    cylinder.initial_pressure_a_pa = 1.5 * ambient_pa;
    cylinder.initial_pressure_b_pa = 3.0 * ambient_pa;
    axis.supply = SupplyParams {
        reservoir_m3: 1.0,
        initial_pressure_pa: axis.supply.set_pressure_pa,
        ..axis.supply
    };
    axis.initial_stroke_m = 0.5 * cylinder.stroke_m;
    axis.load_n = 0.0;
    let piston_m2 = 0.25 * std::f64::consts::PI * cylinder.bore_m * cylinder.bore_m;
    let force_n = piston_m2 * axis.supply.set_pressure_pa;
    let lasts_s = (2 * OPEN_MS + SHUT_MS) as f64 * 1e-3 + 4.0 * slowest_s(params);
    // A quarter of the stroke under full force all the time, unless the limit of the mass prevents it.
    let mass_kg = 2.0 * force_n * lasts_s * lasts_s / cylinder.stroke_m;
    axis.moving_mass_kg = mass_kg.clamp(params.moving_mass_kg, 1000.0);
    axis
}

/// The longest delay from a command to its effect in the chamber, s.
fn slowest_s(params: &AxisParams) -> f64 {
    let c = &params.cylinder;
    let valves = [c.fill_valve, c.vent_valve];
    let delay = valves
        .iter()
        .fold(0.0, |d: f64, v| d.max(v.t_on_s).max(v.t_off_s));
    let spread = c.timing_spread.iter().fold(0.0, |s: f64, x| s.max(*x));
    delay * spread + c.line_delay_s
}

/// A fills and B empties, then A empties and B fills, then all is shut.
struct Manoeuvre {
    commands: Commands,
    /// Valves that are on in each tick of 1 ms.
    ticks: Vec<[u16; 4]>,
}

impl Manoeuvre {
    fn new(params: &AxisParams) -> Self {
        let settle_ms = (2.0 * slowest_s(params) * 1e3).ceil() as u64;
        // Poppets are open for OPEN_MS whatever their delays.
        let on_ms = OPEN_MS + settle_ms;
        let second_ms = on_ms + settle_ms;
        let end_ms = second_ms + on_ms + settle_ms + SHUT_MS;
        let [first, second] =
            [0, second_ms].map(|at| vec![(at as f64 * 1e-3, (at + on_ms) as f64 * 1e-3)]);
        let ticks = (0..end_ms).map(|t| {
            let [a, b] = [0, second_ms].map(|at| u16::from((at..at + on_ms).contains(&t)) * 1000);
            [a, b, b, a]
        });
        Self {
            commands: [first.clone(), second.clone(), second, first],
            ticks: ticks.collect(),
        }
    }
}

/// Agreement with the text book, polytropic and with heat exchange.
fn textbook(params: &AxisParams, made: &Made<'_>) -> Result<Vec<Finding>, AxisSimError> {
    let mut polytropic = plain(params);
    let exponent = match params.cylinder.gas_model {
        GasModel::Polytropic { exponent } => exponent,
        GasModel::Thermal { .. } => params.gas.heat_capacity_ratio,
    };
    polytropic.cylinder.gas_model = GasModel::Polytropic { exponent };
    let mut thermal = polytropic.clone();
    thermal.cylinder.gas_model = GasModel::Thermal {
        heat_transfer_w_m2_k: HEAT_TRANSFER_W_M2_K,
    };
    let mut findings = Vec::new();
    let kinds = [
        (
            polytropic,
            [Quantity::Pressure, Quantity::Stroke].as_slice(),
        ),
        (thermal, [Quantity::ThermalPressure].as_slice()),
    ];
    for (axis, quantities) in kinds {
        let differences = difference(&axis, made)?;
        let finer = AxisParams {
            step_ns: (axis.step_ns / 4).max(1000),
            ..axis.clone()
        };
        let at_finer = difference(&finer, made)?;
        for (i, quantity) in quantities.iter().enumerate() {
            let mut finding = Finding::at_most(*quantity, differences[i], TEXTBOOK_LIMIT);
            if finding.verdict == Verdict::Wrong && at_finer[i] <= TEXTBOOK_LIMIT {
                let try_s = finer.step_ns as f64 * 1e-9;
                finding.verdict = Verdict::StepTooLong { try_s };
            }
            findings.push(finding);
        }
    }
    Ok(findings)
}

/// Largest difference of plant and text book in pressure and stroke, as shares of their changes.
fn difference(params: &AxisParams, made: &Made<'_>) -> Result<[f64; 2], AxisSimError> {
    let manoeuvre = Manoeuvre::new(params);
    let at_s: Vec<f64> = (1..=manoeuvre.ticks.len())
        .map(|k| k as f64 * 1e-3)
        .collect();
    let expected = Textbook::new(params).run(&manoeuvre.commands, &at_s);
    let axis = (made.build)(params)?;
    let mut state = axis.initial_state(1);
    let (mut worst, mut span) = ([0.0_f64; 3], [[f64::INFINITY, f64::NEG_INFINITY]; 3]);
    // The text book has no stops. If the largest mass is too small, the record ends at a stop.
    let stroke_m = 0.0..params.cylinder.stroke_m;
    let free = expected
        .iter()
        .take_while(|sample| stroke_m.contains(&sample.stroke_m));
    for (on, expected) in manoeuvre.ticks.iter().zip(free) {
        made.tick(&axis, &mut state, *on)?;
        let seen = axis.outputs(&state);
        let pairs = [
            (seen.pressure_pa[0], expected.pressure_pa[0]),
            (seen.pressure_pa[1], expected.pressure_pa[1]),
            (seen.stroke_m, expected.stroke_m),
        ];
        for (i, (seen, expected)) in pairs.into_iter().enumerate() {
            worst[i] = worst[i].max((seen - expected).abs());
            span[i] = [span[i][0].min(expected), span[i][1].max(expected)];
        }
    }
    let shares: [f64; 3] =
        std::array::from_fn(|i| worst[i] / (span[i][1] - span[i][0]).max(f64::MIN_POSITIVE));
    Ok([shares[0].max(shares[1]), shares[2]])
}

/// Order of convergence on a smooth stretch of sliding, with valves open throughout, and the error of the
/// file's step there.
fn convergence(params: &AxisParams, made: &Made<'_>) -> Result<[Finding; 3], AxisSimError> {
    let mut smooth = params.clone();
    // No start of a cushion, and no breaking bristle.
    smooth.initial_stroke_m = 0.25 * params.cylinder.stroke_m;
    smooth.cylinder.end_stop.cushion_damping_n_s_m = 0.0;
    smooth.cylinder.friction.static_n = 0.0;
    smooth.cylinder.friction.coulomb_n = 0.0;
    smooth.cylinder.friction.pressure_area_m2 = 0.0;
    // Exact within its smoothness: no edge between two grids.
    for valve in [
        &mut smooth.cylinder.fill_valve,
        &mut smooth.cylinder.vent_valve,
    ] {
        (valve.t_on_s, valve.t_off_s) = (2e-3, 2e-3);
    }
    smooth.cylinder.line_delay_s = 0.0;
    let run = |step_ns: u64| -> Result<Vec<[f64; 2]>, AxisSimError> {
        let mut p = smooth.clone();
        p.step_ns = step_ns;
        let axis = (made.build)(&p)?;
        let mut state = axis.initial_state(1);
        let mut rows = Vec::new();
        for _ in 0..40 {
            made.tick(&axis, &mut state, [1000, 0, 0, 1000])?;
            rows.push([
                state.core.motion.stroke_m,
                state.core.cylinders[0].chamber_a.pv_j,
            ]);
        }
        Ok(rows)
    };
    let mut fine = run(1_250)?;
    let last = fine.last().copied().unwrap_or_default();
    // A light piston on a short stroke arrives at its stop, where nothing is smooth.
    let stroke_m = params.cylinder.stroke_m;
    let free = (MARGIN * stroke_m)..((1.0 - MARGIN) * stroke_m);
    let is_stopped = |row: &[f64; 2]| !free.contains(&row[0]);
    fine.truncate(fine.iter().position(is_stopped).unwrap_or(fine.len()));
    let is_long = fine.len() >= LEAST_TICKS;
    // Root mean square over the ticks, of stroke and pressure.
    let errors = |step_ns: u64| -> Result<[f64; 2], AxisSimError> {
        let rows = run(step_ns)?;
        Ok(std::array::from_fn(|i| {
            let squares = rows.iter().zip(&fine).map(|(a, b)| (a[i] - b[i]).powi(2));
            (squares.sum::<f64>() / fine.len() as f64).sqrt()
        }))
    };
    let runs = [100_000, 50_000, 25_000, 12_500].map(errors);
    let [coarse, middle, short, shortest] = runs;
    let errors = [coarse?, middle?, short?, shortest?];
    let order = |quantity: Quantity, i: usize| {
        let order = |k: usize| (errors[k][i] / errors[k + 1][i]).log2();
        let orders = [order(0), order(1), order(2)];
        let mut finding = Finding::within(quantity, orders[1], ORDER_RANGE);
        let most = orders.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let spread = most - orders.into_iter().fold(f64::INFINITY, f64::min);
        let is_rounding = errors[3][i] < ROUNDING * last[i].abs();
        // Errors that fall faster than the method allows cancel each other here.
        let cancel = orders[1] > ORDER_RANGE[1];
        let is_asymptotic = is_long && spread < ORDER_SPREAD && !is_rounding && !cancel;
        if finding.verdict == Verdict::Wrong && !is_asymptotic {
            finding.verdict = Verdict::NotAsymptotic;
        }
        finding
    };
    let worst = |step_ns: u64| -> Result<f64, AxisSimError> {
        let rows = run(step_ns)?;
        let pairs = rows.iter().zip(&fine);
        Ok(pairs.map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f64::max))
    };
    let mut step_error =
        Finding::at_most(Quantity::StepError, worst(params.step_ns)?, STEP_LIMIT_M);
    if step_error.verdict == Verdict::Wrong {
        step_error.verdict = shorter_step(params.step_ns, step_error.value, worst)?;
    }
    Ok([
        order(Quantity::OrderStroke, 0),
        order(Quantity::OrderPressure, 1),
        step_error,
    ])
}

/// Finds by trial a step whose error is within its limit: errors do not always fall with the square.
fn shorter_step(
    mut step_ns: u64,
    mut error_m: f64,
    worst: impl Fn(u64) -> Result<f64, AxisSimError>,
) -> Result<Verdict, AxisSimError> {
    while step_ns > SHORTEST_NS {
        let share = (0.8 * STEP_LIMIT_M / error_m).sqrt().min(0.9);
        // In whole microseconds, as usual in files.
        step_ns = ((step_ns as f64 * share * 1e-3) as u64 * 1000).max(SHORTEST_NS);
        error_m = worst(step_ns)?;
        if error_m <= STEP_LIMIT_M {
            let try_s = step_ns as f64 * 1e-9;
            return Ok(Verdict::StepTooLong { try_s });
        }
    }
    Ok(Verdict::NotAsymptotic)
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
