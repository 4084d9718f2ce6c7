//! Fits the sonic conductance of the `wheeleg-2003` valves to a full stroke of
//! 1.0 s, and reports the start delay that follows. Nothing is fitted to the delay.
//!
//! Open loop: from rest at one end with the opposing chamber at supply pressure and
//! the drive chamber vented, the valves are thrown over and held. Stroke time
//! runs from the command to 99 % of the stroke, as a set-point step would see it.

use wheeleg_plant::axis::{Axis, TICK_US};
use wheeleg_plant::testing::{DM3_S_BAR, wheeleg_2003_axis};

/// One open-loop stroke.
struct Stroke {
    /// Command to 99 % of the stroke \[s\].
    time_s: f64,
    /// Command to the first millimetre \[s\].
    delay_s: f64,
    /// Largest speed \[m/s\].
    peak_m_s: f64,
}

/// Runs one stroke with conductance `c` in dm³/(s·bar) against `load_n`
/// (positive extends).
fn stroke(c: f64, extend: bool, mass_kg: f64, load_n: f64) -> Option<Stroke> {
    let mut params = wheeleg_2003_axis();
    params.cylinder.fill_valve.flow.conductance_m3_s_pa = c * DM3_S_BAR;
    params.cylinder.vent_valve.flow.conductance_m3_s_pa = c * DM3_S_BAR;
    params.moving_mass_kg = mass_kg;
    params.load_n = load_n;
    let full = params.cylinder.stroke_m;
    let supply = params.supply.initial_pressure_pa;
    let ambient = params.gas.ambient_pressure_pa;
    params.initial_stroke_m = if extend { 0.0 } else { full };
    (
        params.cylinder.initial_pressure_a_pa,
        params.cylinder.initial_pressure_b_pa,
    ) = if extend {
        (ambient, supply)
    } else {
        (supply, ambient)
    };
    let axis = Axis::new(&params).ok()?;
    let mut state = axis.initial_state(0);
    // Settle against the stop first, so that the deflected stop is not counted as motion.
    for _ in 0..200 {
        axis.tick(&mut state, [0; 4]).ok()?;
    }
    let on = if extend {
        [TICK_US, 0, 0, TICK_US]
    } else {
        [0, TICK_US, TICK_US, 0]
    };
    let x0 = state.core.motion.stroke_m;
    let (mut delay_s, mut peak_m_s) = (None, 0.0_f64);
    for ms in 1..=20_000_u32 {
        axis.tick(&mut state, on).ok()?;
        let moved = (state.core.motion.stroke_m - x0).abs();
        peak_m_s = peak_m_s.max(state.core.motion.velocity_m_s.abs());
        let now_s = f64::from(ms) * 1e-3;
        if moved >= 1e-3 && delay_s.is_none() {
            delay_s = Some(now_s);
        }
        if moved >= 0.99 * full {
            return Some(Stroke {
                time_s: now_s,
                delay_s: delay_s?,
                peak_m_s,
            });
        }
    }
    None
}

/// Conductance at which `time` of it is 1.0 s, by bisection.
fn fit(time: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.02, 0.3);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if time(middle) > 1.0 {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high)
}

fn main() {
    let time =
        |c, extend, mass, load| stroke(c, extend, mass, load).map_or(f64::INFINITY, |s| s.time_s);
    // Vertical cylinder of a swinging leg: rod and foot, 0.8 kg; weight extends it.
    let weight = 0.8 * 9.81;
    let cases = [
        ("vertical, retract", false, 0.8, weight),
        ("vertical, extend", true, 0.8, weight),
        ("horizontal, extend", true, 1.7, 0.0),
        ("horizontal, retract", false, 1.7, 0.0),
    ];
    for (name, extend, mass, load) in cases {
        let c = fit(|c| time(c, extend, mass, load));
        if let Some(s) = stroke(c, extend, mass, load) {
            println!(
                "{name:20} C = {c:.4} dm3/(s bar): stroke {:.3} s, start delay {:.3} s, peak {:.3} m/s",
                s.time_s, s.delay_s, s.peak_m_s
            );
        }
    }
    let mean = fit(|c| 0.5 * (time(c, false, 0.8, weight) + time(c, true, 0.8, weight)));
    println!("mean of both vertical strokes = 1.0 s: C = {mean:.4} dm3/(s bar)");
    for (name, extend, mass, load) in cases {
        if let Some(s) = stroke(mean, extend, mass, load) {
            println!(
                "  {name:20} stroke {:.3} s, start delay {:.3} s, peak {:.3} m/s",
                s.time_s, s.delay_s, s.peak_m_s
            );
        }
    }
}
