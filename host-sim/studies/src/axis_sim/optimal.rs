//! The bound for perfect knowledge: bang-bang control with the plant itself as its model.
//!
//! Each chamber is filled and vented by a list of switching times; the list is searched on the plant, without
//! noise, from the very state in which a controller begins its move. The time counts until the piston stays
//! within 1 mm of the target. It is an upper bound of the true optimum (the search is a pattern search from
//! many starts), and lower than what any controller without that knowledge can be expected to reach.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use wheeleg_plant::PlantError;
use wheeleg_plant::axis::{Axis, AxisState, TICK_NS};

use super::metrics::SETTLED_BAND_M;

/// Times of the switchings \[s\]: drive chamber filled until 0, then vented
/// until 1, filled until 2, shut; counter chamber vented until 3, filled until
/// 4, vented until 5, shut. Each is a duration.
type Schedule = [f64; 6];

/// Horizon of the search \[s\].
pub const HORIZON_S: f64 = 0.9;

/// Result of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// Time until the piston stays within 1 mm of the target \[s\].
    pub settle_s: f64,
    /// Durations found \[s\].
    pub schedule: Schedule,
    /// Simulations made.
    pub runs: u32,
}

/// Searches the fastest move of `axis` from `state` to `target_m`.
///
/// # Errors
/// Any [`PlantError`].
pub fn fastest(
    axis: &Axis,
    state: &AxisState,
    target_m: f64,
    seed: u64,
    runs: u32,
) -> Result<Bound, PlantError> {
    fastest_while(axis, state, target_m, seed, runs, &|| true)
}

/// As [`fastest`]; a search that is stopped returns the best so far, which is not a bound.
///
/// # Errors
/// Any [`PlantError`].
pub fn fastest_while(
    axis: &Axis,
    state: &AxisState,
    target_m: f64,
    seed: u64,
    runs: u32,
    go_on: &dyn Fn() -> bool,
) -> Result<Bound, PlantError> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut best = ([0.0; 6], f64::INFINITY);
    let distance_m = (target_m - state.core.motion.stroke_m).abs();
    let starts = 24_u32;
    let mut used = 0;
    for _ in 0..starts {
        if !go_on() {
            break;
        }
        // A guess: full drive for the time at 0.5 m/s, then brake for a part of it.
        let base = distance_m / 0.5;
        let mut unit = || rng.random_range(0.0..1.0_f64);
        let mut at: Schedule = [
            base * (0.5 + unit()),
            0.08 * unit(),
            0.03 * unit(),
            base * (0.3 + unit()),
            0.08 * unit(),
            0.03 * unit(),
        ];
        let mut cost = cost(axis, state, target_m, &at)?;
        let mut step = 0.02;
        let share = runs / starts;
        let mut spent = 1;
        while spent < share && step > 5e-5 {
            let mut improved = false;
            for i in 0..at.len() {
                for sign in [1.0, -1.0] {
                    let mut trial = at;
                    trial[i] = (trial[i] + sign * step).max(0.0);
                    if trial == at {
                        continue;
                    }
                    let c = self::cost(axis, state, target_m, &trial)?;
                    spent += 1;
                    if c < cost {
                        (at, cost, improved) = (trial, c, true);
                        break;
                    }
                }
            }
            if !improved {
                step *= 0.5;
            }
        }
        used += spent;
        if cost < best.1 {
            best = (at, cost);
        }
    }
    let settle_s = settle(axis, state, target_m, &best.0)?.0;
    Ok(Bound {
        settle_s,
        schedule: best.0,
        runs: used,
    })
}

/// Settling time, with a slope if the move does not settle: the worst error at the end counts.
fn cost(axis: &Axis, state: &AxisState, target_m: f64, s: &Schedule) -> Result<f64, PlantError> {
    let (settle_s, end_m) = settle(axis, state, target_m, s)?;
    Ok(if settle_s < HORIZON_S - 0.1 {
        settle_s + end_m
    } else {
        HORIZON_S + 100.0 * end_m
    })
}

/// Time until the piston stays in the band, and the error at the end \[m\].
fn settle(
    axis: &Axis,
    state: &AxisState,
    target_m: f64,
    schedule: &Schedule,
) -> Result<(f64, f64), PlantError> {
    let mut state = state.clone();
    let out = target_m > state.core.motion.stroke_m;
    let valve = &axis.params().cylinder.fill_valve;
    let lag_s = valve.t_on_s - valve.t_off_s;
    // On and off times of the four coils from the durations.
    let [a, b, c, d, e, f] = *schedule;
    let drive_fill = [(0.0, a), (a + b, a + b + c)];
    let drive_vent = [(a, a + b), (0.0, 0.0)];
    let counter_vent = [(0.0, d), (d + e, d + e + f)];
    let counter_fill = [(d, d + e), (0.0, 0.0)];
    let coils = if out {
        [drive_fill, drive_vent, counter_fill, counter_vent]
    } else {
        [counter_fill, counter_vent, drive_fill, drive_vent]
    };
    let ticks = (HORIZON_S * 1e9) as u64 / TICK_NS;
    let mut last_outside = 0.0;
    for k in 0..ticks {
        let t0 = k as f64 * 1e-3;
        let on = coils.map(|spans| {
            // The coil is on for the opening time plus the difference of its delays.
            let on = spans.iter().find_map(|(from, to)| {
                let to = if to > from { to + lag_s } else { *from };
                (*from < t0 + 1e-3 && to > t0).then(|| {
                    // A tick's pulse begins at its edge: a later start waits.
                    if *from > t0 + 5e-4 {
                        0.0
                    } else {
                        (to - t0).min(1e-3)
                    }
                })
            });
            (on.unwrap_or(0.0) * 1e6).round().clamp(0.0, 1000.0) as u16
        });
        axis.tick(&mut state, on)?;
        if (state.core.motion.stroke_m - target_m).abs() > SETTLED_BAND_M {
            last_outside = t0 + 1e-3;
        }
    }
    let error_m = (state.core.motion.stroke_m - target_m).abs();
    Ok((last_outside, error_m))
}
