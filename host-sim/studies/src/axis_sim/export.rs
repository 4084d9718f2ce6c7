//! Valve sequences and the plant's response to them, for another integrator.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use wheeleg_plant::axis::{Axis, AxisParams};
use wheeleg_plant::chamber::GasModel;

use super::suite::AxisSimError;
use super::{AxisSim, Firmware, Kind, Motion, Trace, design};

/// Length of each sequence \[ms\].
const TICKS: usize = 600;

/// Laws of the closed-loop sequences.
const LAWS: [Kind; 4] = [Kind::Predictive, Kind::FuzzyPd, Kind::PwmPid, Kind::OnOff];

/// The axis as in its file, and with every option of the model that the file leaves out. Per plant:
/// parameters, and per sequence the on-times of every tick (µs, fill A, vent A, fill B, vent B), stroke \[m\]
/// and pressures \[Pa\] at every tick's start.
///
/// # Errors
/// [`AxisSimError`].
pub fn sequences(name: &str, params: &AxisParams) -> Result<Value, AxisSimError> {
    let full = with_every_choice(params);
    let plants = [
        plant("as it is", params, 1..=4, &LAWS)?,
        plant("every choice", &full, 5..=6, &LAWS[..2])?,
    ];
    Ok(json!({ "axis": name, "plants": plants }))
}

/// Heat exchange, friction that grows with pressure, a load, unequal valves.
fn with_every_choice(params: &AxisParams) -> AxisParams {
    let mut p = params.clone();
    p.cylinder.gas_model = GasModel::Thermal {
        heat_transfer_w_m2_k: 60.0,
    };
    p.cylinder.friction.pressure_area_m2 = 1e-5;
    // An eighth of the force that the supply can push with.
    let area_m2 = std::f64::consts::FRAC_PI_4 * p.cylinder.bore_m.powi(2);
    p.load_n -= 0.125 * area_m2 * (p.supply.set_pressure_pa - p.gas.ambient_pressure_pa);
    p.cylinder.timing_spread = [1.3, 0.8, 1.0, 1.2];
    p
}

fn plant(
    name: &str,
    params: &AxisParams,
    seeds: std::ops::RangeInclusive<u64>,
    laws: &[Kind],
) -> Result<Value, AxisSimError> {
    let mut cases = Vec::new();
    for seed in seeds {
        cases.push(open_loop(params, seed)?);
    }
    for &kind in laws {
        cases.push(closed_loop(params, kind)?);
    }
    Ok(json!({ "name": name, "parameters": params, "cases": cases }))
}

/// Random modes of 10 to 60 ms, from a third of the stroke.
fn open_loop(params: &AxisParams, seed: u64) -> Result<Value, AxisSimError> {
    let mut p = params.clone();
    p.initial_stroke_m = 0.4 * p.cylinder.stroke_m;
    p.cylinder.initial_pressure_a_pa = 4e5;
    p.cylinder.initial_pressure_b_pa = 4.6e5;
    let axis = Axis::new(&p)?;
    let mut state = axis.initial_state(seed);
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let modes = wheeleg_control::valve::ValveMode::USEFUL;
    let (mut on, mut left) = ([0_u16; 4], 0);
    let (mut sent, mut rows) = (Vec::new(), Vec::new());
    for _ in 0..TICKS {
        if left == 0 {
            left = rng.random_range(10..60_u32);
            let mode = modes[rng.random_range(0..modes.len())];
            on = mode.open().map(|open| if open { 1000 } else { 0 });
        }
        left -= 1;
        let c = &state.core.cylinders[0];
        let stroke_m = state.core.motion.stroke_m;
        let [a, b] = axis.assembly.cylinders[0].pressures_pa(c, stroke_m);
        rows.push([stroke_m, a, b]);
        sent.push(on);
        axis.tick(&mut state, on)?;
    }
    Ok(json!({
        "name": format!("open loop, seed {seed}"),
        "start": { "stroke_m": p.initial_stroke_m, "pressure_pa": [4e5, 4.6e5] },
        "on_us": sent,
        "rows": rows,
    }))
}

fn closed_loop(params: &AxisParams, kind: Kind) -> Result<Value, AxisSimError> {
    let stroke_m = params.cylinder.stroke_m;
    let mut p = params.clone();
    p.initial_stroke_m = 0.25 * stroke_m;
    let board = Firmware::new(&design(&p, kind)).map_err(AxisSimError::Design)?;
    let mut bench = AxisSim::new(&p, 5, board)?;
    let step = Motion::Step {
        at_s: 0.02,
        from_m: 0.25 * stroke_m,
        to_m: 0.75 * stroke_m,
    };
    let Trace { rows, .. } = bench.run(&step, &[], TICKS as f64 * 1e-3)?;
    let c = &p.cylinder;
    Ok(json!({
        "name": format!("closed loop, {}", kind.name()),
        "start": {
            "stroke_m": p.initial_stroke_m,
            "pressure_pa": [c.initial_pressure_a_pa, c.initial_pressure_b_pa],
        },
        "on_us": rows.iter().map(|r| r.on_us).collect::<Vec<_>>(),
        "rows": rows
            .iter()
            .map(|r| [r.stroke_m, r.pressure_pa[0], r.pressure_pa[1]])
            .collect::<Vec<_>>(),
    }))
}
