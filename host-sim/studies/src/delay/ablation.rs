//! The causes of the delay: each contribution removed in turn.
//!
//! The base is the start from home, held against the stop by the paper's law, with the bus before it. A
//! contribution is removed alone, and in a second series together with all before it; the second adds up to
//! the whole by construction, the first does not, and the rest is the interaction. Every row runs with the
//! same seeds and the same gains: contributions are removed from the plant.

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::chamber::GasModel;
use wheeleg_plant::flow::Iso6358;
use wheeleg_plant::sensors::AdcNoise;

use super::trial::{Before, BusPath, Law, Start, Trial};
use super::{mean_delay, run_all};
use crate::StudyError;
use crate::study::{Ended, Progress};

/// Most seeds of a row: wait for SYNC, phase of the command and noise.
const SEEDS: u32 = 20;
/// A valve this many times larger hardly restricts the flow.
const WIDE_OPEN: f64 = 10.0;
/// Smallest dead volume \[m³\]: without any, a chamber at its stop would have no volume.
const LEAST_DEAD_M3: f64 = 1e-6;
/// Slope of the flow function where two pressures are nearly equal, over its choked value: the shortest time
/// constant of a chamber is this many times shorter.
const STEEPEST: f64 = 53.0;

/// Change of a trial for a row.
type Change = fn(&mut Trial);

/// A contribution that can be removed.
struct Cause {
    id: &'static str,
    text: &'static str,
    remove: Change,
}

const fn cause(id: &'static str, text: &'static str, remove: Change) -> Cause {
    Cause { id, text, remove }
}

/// In the order in which the second series removes them: from the command on.
const CAUSES: [Cause; 15] = [
    cause(
        "bus",
        "wait for the next bus cycle, SYNC on the line",
        |t| t.bus = None,
    ),
    cause(
        "sensor",
        "converter's steps and noise, bow of the potentiometer, velocity window",
        |t| {
            t.axis.adc.bits = 16;
            t.axis.adc.noise = AdcNoise::None;
            t.axis.potentiometer.nonlinearity = 0.0;
            t.window = Some(2);
        },
    ),
    cause(
        "PWM",
        "law and valve PWM: both valves thrown open by the command",
        |t| t.thrown = true,
    ),
    cause("t_on", "switching time of the valves", |t| {
        for valve in [
            &mut t.axis.cylinder.fill_valve,
            &mut t.axis.cylinder.vent_valve,
        ] {
            (valve.t_on_s, valve.t_off_s) = (0.0, 0.0);
        }
    }),
    cause("wave", "travel of the pressure wave in the tube", |t| {
        t.axis.cylinder.line_delay_s = 0.0;
    }),
    cause("tube", "resistance of the tube", |t| {
        t.axis.cylinder.line_flow = None;
    }),
    cause("supply", "sag of the supply, leaks", |t| {
        t.axis.supply.reservoir_m3 = 1.0;
        t.axis.cylinder.piston_leak_m3_s_pa = 0.0;
        t.axis.cylinder.rod_leak_m3_s_pa = 0.0;
    }),
    cause("stop", "cushion and elastic end stop", |t| {
        t.axis.cylinder.end_stop.cushion_length_m = 0.0;
        t.axis.cylinder.end_stop.stiffness_n_m = 1e7;
    }),
    cause("stiction", "break-away above the sliding friction", |t| {
        t.axis.cylinder.friction.static_n = t.axis.cylinder.friction.coulomb_n
    }),
    cause("friction", "all friction of the seals", |t| {
        let f = &mut t.axis.cylinder.friction;
        (f.coulomb_n, f.static_n, f.viscous_n_s_m) = (0.01, 0.01, 0.0);
    }),
    cause("line", "volume of the tubes", |t| {
        t.axis.cylinder.line_volume_m3 = 0.0;
    }),
    cause(
        "dead",
        "dead volume of ports and valves, all but 1 cm³",
        |t| {
            let c = &mut t.axis.cylinder;
            c.dead_volume_a_m3 = c.dead_volume_a_m3.min(LEAST_DEAD_M3);
            c.dead_volume_b_m3 = c.dead_volume_b_m3.min(LEAST_DEAD_M3);
        },
    ),
    cause(
        "charging",
        "filling of the drive chamber: fill valves ten times as large",
        |t| t.axis.cylinder.fill_valve.flow.conductance_m3_s_pa *= WIDE_OPEN,
    ),
    cause(
        "venting",
        "venting of the counter chamber: vent valves ten times as large",
        |t| t.axis.cylinder.vent_valve.flow.conductance_m3_s_pa *= WIDE_OPEN,
    ),
    cause("mass", "inertia: a tenth of the mass", |t| {
        t.axis.moving_mass_kg = (0.1 * t.axis.moving_mass_kg).max(0.01);
    }),
];

/// Changes outside the chain: other histories, other commands, other data.
const VARIATIONS: [Cause; 26] = [
    cause(
        "settle band on",
        "the law has come to rest at home instead of pushing",
        |t| t.start = Start::HomeRest,
    ),
    cause(
        "counter chamber vented before",
        "by hand, piston standing",
        |t| t.before = Before::Vented,
    ),
    cause(
        "chambers balanced before",
        "by hand, drive chamber at half of the supply's gauge pressure",
        |t| t.before = Before::Balanced,
    ),
    cause("S-curve of 1 s", "instead of a step", |t| {
        t.s_curve_s = Some(1.0);
    }),
    cause("S-curve of 0.5 s", "instead of a step", |t| {
        t.s_curve_s = Some(0.5);
    }),
    cause("duty at most 50 %", "of the PWM", |t| t.duty_permille = 500),
    cause("duty at most 30 %", "of the PWM", |t| t.duty_permille = 300),
    cause("t_on 3.5 ms", "of both valves", |t| t_on(t, 3.5e-3)),
    cause("t_on 8 ms", "of both valves", |t| t_on(t, 8e-3)),
    cause("break-away 40 N", "sliding friction unchanged", |t| {
        t.axis.cylinder.friction.static_n = 40.0;
    }),
    cause(
        "tube of 3 m",
        "three times volume and delay, Eckersten's C",
        |t| {
            tube(t, 3.0, 4e-3);
        },
    ),
    cause("tube of 2.5 mm bore", "1 m, Eckersten's C", |t| {
        tube(t, 1.0, 2.5e-3)
    }),
    cause("8 cm³ more dead volume", "in each chamber", |t| {
        t.axis.cylinder.dead_volume_a_m3 += 8e-6;
        t.axis.cylinder.dead_volume_b_m3 += 8e-6;
    }),
    cause("exponent 1.0", "of the polytropic law: isothermal", |t| {
        t.axis.cylinder.gas_model = GasModel::Polytropic { exponent: 1.0 };
    }),
    cause("exponent 1.4", "of the polytropic law: adiabatic", |t| {
        t.axis.cylinder.gas_model = GasModel::Polytropic { exponent: 1.4 };
    }),
    cause("heat exchange", "energy balance, 60 W/(m² K)", |t| {
        t.axis.cylinder.gas_model = GasModel::Thermal {
            heat_transfer_w_m2_k: 60.0,
        };
    }),
    cause("4 bar supply", "gauge", |t| supply(t, 4e5)),
    cause("5 bar supply", "gauge", |t| supply(t, 5e5)),
    cause("7 bar supply", "gauge", |t| supply(t, 7e5)),
    cause("30 N opposing", "force on the rod", |t| {
        t.axis.load_n += 30.0
    }),
    cause("15 N opposing", "force on the rod", |t| {
        t.axis.load_n += 15.0
    }),
    cause("15 N assisting", "force on the rod", |t| {
        t.axis.load_n -= 15.0
    }),
    cause("30 N assisting", "force on the rod", |t| {
        t.axis.load_n -= 30.0
    }),
    cause("C smaller by a fifth", "of all four valves", |t| {
        conductance(t, 0.8)
    }),
    cause("C larger by a quarter", "of all four valves", |t| {
        conductance(t, 1.25);
    }),
    cause("default law", "instead of the paper's", |t| {
        t.law = Law::Default
    }),
];

fn t_on(trial: &mut Trial, t_on_s: f64) {
    trial.axis.cylinder.fill_valve.t_on_s = t_on_s;
    trial.axis.cylinder.vent_valve.t_on_s = t_on_s;
}

pub(super) fn conductance(trial: &mut Trial, factor: f64) {
    let c = &mut trial.axis.cylinder;
    c.fill_valve.flow.conductance_m3_s_pa *= factor;
    c.vent_valve.flow.conductance_m3_s_pa *= factor;
}

fn supply(trial: &mut Trial, gauge_pa: f64) {
    let absolute_pa = gauge_pa + trial.axis.gas.ambient_pressure_pa;
    trial.axis.supply.set_pressure_pa = absolute_pa;
    trial.axis.supply.initial_pressure_pa = absolute_pa;
}

/// A plant step for a small chamber behind a large valve: a third of its shortest time constant, V/(C ρ₀ R
/// T₀) over the steepest flow.
fn fine_step(trial: &mut Trial) {
    let (c, gas) = (&trial.axis.cylinder, &trial.axis.gas);
    let volume_m3 = c.line_volume_m3 + c.dead_volume_a_m3.min(c.dead_volume_b_m3);
    let (fill, vent) = (&c.fill_valve.flow, &c.vent_valve.flow);
    let largest = fill.conductance_m3_s_pa.max(vent.conductance_m3_s_pa);
    let rate = largest * gas.choked_outflow_pa();
    let shortest_ns = volume_m3 / (gas.heat_capacity_ratio * rate * STEEPEST) * 1e9;
    trial.axis.step_ns = trial
        .axis
        .step_ns
        .min((shortest_ns / 3.0) as u64)
        .max(1_000);
}

/// Another tube: volume, wave at 343 m/s, and Eckersten's conductance and
/// critical ratio (C = 0.029 d²/√(L/d^1.25 + 510), b = 474 C/d², SI).
fn tube(trial: &mut Trial, length_m: f64, bore_m: f64) {
    let c = &mut trial.axis.cylinder;
    c.line_volume_m3 = std::f64::consts::FRAC_PI_4 * bore_m * bore_m * length_m;
    c.line_delay_s = (length_m / 343.0).min(7e-3);
    let root = (length_m / bore_m.powf(1.25) + 510.0).sqrt();
    let flow = 0.029 * bore_m * bore_m / root;
    let critical = 474.0 * 0.029 / root;
    let old = c.line_flow;
    c.line_flow = Some(Iso6358 {
        conductance_m3_s_pa: flow,
        critical_ratio: critical,
        ..old.unwrap_or(c.fill_valve.flow)
    });
}

/// One contribution.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Row {
    /// Short name.
    pub id: &'static str,
    /// Description of what is removed.
    pub text: &'static str,
    /// Start delay without only this one \[s\].
    pub alone_s: f64,
    /// Its contribution by that: base less `alone_s` \[s\].
    pub contribution_s: f64,
    /// Start delay without this one and all before it \[s\].
    pub series_s: f64,
    /// Its contribution in the series \[s\].
    pub step_s: f64,
}

/// Another variation.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Variation {
    /// Short name.
    pub id: &'static str,
    /// Description.
    pub text: &'static str,
    /// Start delay \[s\]; `None` if a start never came.
    pub delay_s: Option<f64>,
    /// Against the base \[s\].
    pub difference_s: Option<f64>,
}

/// Contributions, sum and interaction.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Ablation {
    /// Seeds that each row is the mean of.
    pub seeds: u64,
    /// Start delay with everything \[s\].
    pub base_s: f64,
    /// The contributions, in the order of the series.
    pub rows: Vec<Row>,
    /// Start delay without any of them \[s\].
    pub residual_s: f64,
    /// Sum of the contributions taken alone \[s\].
    pub sum_s: f64,
    /// Base less residual less the sum \[s\].
    pub interaction_s: f64,
    /// Without filling and venting: the pressure swap, alone \[s\].
    pub without_swap_s: f64,
    /// Share of the pressure swap in the base \[-\].
    pub swap_share: f64,
    /// Other changes.
    pub variations: Vec<Variation>,
}

/// Measures all rows, each with `seeds` seeds or 20, whichever is less.
///
/// # Errors
/// [`Ended`] if the axis cannot be simulated or does not start in the base case, or the study is stopped.
pub fn measure(
    axis: &AxisParams,
    bus: BusPath,
    weight_n: f64,
    seeds: u32,
    progress: &Progress,
) -> Result<Ablation, Ended> {
    let seeds = u64::from(seeds.min(SEEDS));
    let base: Vec<Trial> = (1..=seeds)
        .map(|seed| Trial {
            bus: Some(bus),
            ..Trial::new(axis, Law::Paper, Start::HomeHeld, seed)
        })
        .collect();
    let swap: [Change; 2] = [CAUSES[12].remove, CAUSES[13].remove];
    let mut cases: Vec<Vec<Change>> = vec![Vec::new(), swap.to_vec()];
    cases.extend(CAUSES.iter().map(|c| vec![c.remove]));
    cases.extend((1..=CAUSES.len()).map(|n| CAUSES[..n].iter().map(|c| c.remove).collect()));
    cases.extend(VARIATIONS.iter().map(|v| vec![v.remove]));
    let trials: Vec<Trial> = cases
        .iter()
        .flat_map(|changes| base.iter().map(move |trial| (changes, trial.clone())))
        .map(|(changes, mut trial)| {
            changes.iter().for_each(|change| change(&mut trial));
            fine_step(&mut trial);
            trial
        })
        .chain(base.iter().map(|trial| {
            let mut own = trial.clone();
            own.axis.load_n += weight_n;
            own
        }))
        .collect();
    let outcomes = run_all("ablation", &trials, progress)?;
    let delays: Vec<Option<f64>> = outcomes.chunks(base.len()).map(mean_delay).collect();
    let at = |i: usize| delays.get(i).copied().flatten();
    let needed = |i: usize, what: &str| {
        at(i).ok_or_else(|| {
            StudyError::refused(
                format!("the move from home never starts: {what}"),
                "the load may exceed what the cylinder can move; see --load",
            )
        })
    };
    let base_s = needed(0, "everything as it is")?;
    let without_swap_s = needed(1, "without filling and venting")?;
    let n = CAUSES.len();
    let mut rows = Vec::with_capacity(n);
    let mut before_s = base_s;
    for (i, cause) in CAUSES.iter().enumerate() {
        let alone_s = needed(2 + i, cause.text)?;
        let series_s = needed(2 + n + i, cause.text)?;
        rows.push(Row {
            id: cause.id,
            text: cause.text,
            alone_s,
            contribution_s: base_s - alone_s,
            series_s,
            step_s: before_s - series_s,
        });
        before_s = series_s;
    }
    let sum_s = rows.iter().map(|r| r.contribution_s).sum();
    let own = ("own weight", "of the vertical rod and foot, opposing");
    let names = VARIATIONS.iter().map(|v| (v.id, v.text)).chain([own]);
    let variations = names
        .enumerate()
        .map(|(i, (id, text))| {
            let delay_s = at(2 + 2 * n + i);
            Variation {
                id,
                text,
                delay_s,
                difference_s: delay_s.map(|d| d - base_s),
            }
        })
        .collect();
    Ok(Ablation {
        seeds,
        base_s,
        rows,
        residual_s: before_s,
        sum_s,
        interaction_s: base_s - before_s - sum_s,
        without_swap_s,
        swap_share: 1.0 - without_swap_s / base_s,
        variations,
    })
}

impl Ablation {
    /// The row of a contribution.
    #[must_use]
    pub fn row(&self, id: &str) -> Option<&Row> {
        self.rows.iter().find(|r| r.id == id)
    }

    /// The delay with a variation \[s\].
    #[must_use]
    pub fn varied_s(&self, id: &str) -> Option<f64> {
        self.variations.iter().find(|v| v.id == id)?.delay_s
    }
}
