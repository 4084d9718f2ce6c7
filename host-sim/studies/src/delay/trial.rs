//! One start: a history that ends at rest or in motion, a command, and the time
//! until the piston has moved a millimetre.
//!
//! Chamber pressures at the command come only from the simulated history: every trial begins with both
//! chambers at atmospheric pressure and reaches its start by moves.

use std::collections::VecDeque;

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_plant::axis::AxisParams;
use wheeleg_units::{Duty, PositionMm};

pub use super::kinds::{Law, Start};
use super::valve_override::ValveOverride;
use crate::axis_sim::suite::AxisSimError;
use crate::axis_sim::{AxisSim, Design, Firmware, Motion, Row, design};

/// The first motion that counts as a start, from where the piston turned \[m\].
pub const STARTED_M: f64 = 1e-3;
/// Reference of a law that holds an end stop, beyond the stop \[m\].
const BEYOND_M: f64 = 1e-3;
/// Time for the move to the place of the start and for holding there \[s\].
const HISTORY_S: f64 = 3.0;
/// An end stop is held for at most this many more seconds, until the pressures are steady.
const HOLD_MORE: u32 = 6;
/// Pressures are steady if a second changes them by less than this \[Pa\].
const STANDS_PA: f64 = 500.0;
/// From the end of the history to the command, without the seed's part \[s\].
const WAIT_S: f64 = 0.5;
/// Time after the command to wait for a start \[s\].
const WATCH_S: f64 = 1.5;
/// A valve on for a whole tick.
const FULL: u16 = 1000;

/// Preparation between the history and the command, besides the law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Before {
    /// Nothing.
    Nothing,
    /// The counter chamber is vented by hand to atmospheric pressure.
    Vented,
    /// Both chambers are brought to a force balance by hand, the drive chamber to
    /// half of the supply's gauge pressure.
    Balanced,
}

/// One start.
#[derive(Debug, Clone)]
pub struct Trial {
    /// The axis.
    pub axis: AxisParams,
    /// Data sheet from which the law's gains follow.
    pub sheet: AxisParams,
    /// The law.
    pub law: Law,
    /// Start of the move.
    pub start: Start,
    /// Noise, time of the command, place in mid-stroke.
    pub seed: u64,
    /// How long before the command the board knows of it \[s\].
    pub preview_s: f64,
    /// Whether the command waits for the next bus cycle and its SYNC frame, drawn
    /// from the seed. `None` counts from the set-point in the board.
    pub bus: Option<BusPath>,
    /// Preparation before it.
    pub before: Before,
    /// The command opens both valves of the move fully, without law and PWM.
    pub thrown: bool,
    /// Instead of a step: duration of an S-curve \[s\].
    pub s_curve_s: Option<f64>,
    /// Largest duty of the law, per mille.
    pub duty_permille: i16,
    /// Ticks of the law's velocity window; `None` keeps the design's.
    pub window: Option<u8>,
}

/// Time from a command in the master to the board.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct BusPath {
    /// Bus cycle; the wait for the next one is uniform within it \[s\].
    pub cycle_s: f64,
    /// SYNC on the line \[s\].
    pub frame_s: f64,
}

impl Trial {
    /// An ordinary start of `axis`.
    #[must_use]
    pub fn new(axis: &AxisParams, law: Law, start: Start, seed: u64) -> Self {
        Self {
            axis: axis.clone(),
            sheet: axis.clone(),
            law,
            start,
            seed,
            preview_s: 0.0,
            bus: None,
            before: Before::Nothing,
            thrown: false,
            s_curve_s: None,
            duty_permille: 1000,
            window: None,
        }
    }

    fn design(&self) -> Design {
        let mut design = design(&self.sheet, self.law.kind());
        let g = &mut design.gains;
        if self.start.held() {
            g.stroke_max = g.stroke_max.saturating_add(PositionMm::from_int(5));
            g.stroke_min = g.stroke_min.saturating_sub(PositionMm::from_int(5));
            if self.law == Law::Paper {
                // Without a settle band the law keeps pushing against the stop.
                g.settle_band = PositionMm::ZERO;
                g.minimum_duty = Duty::ZERO;
            }
        }
        if self.duty_permille < 1000 {
            g.duty_limit = Duty::from_per_mille(self.duty_permille);
        }
        if let Some(window) = self.window {
            g.velocity_window = window;
        }
        design
    }
}

/// Its result.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Outcome {
    /// Command to the first millimetre in its direction \[s\]; `None` if it never moved.
    pub delay_s: Option<f64>,
    /// Largest motion between the announcement and the command \[mm\].
    pub early_mm: f64,
    /// Chamber pressures A, B at the command, absolute \[Pa\].
    pub pressure_pa: [f64; 2],
    /// Stroke at the command \[m\].
    pub stroke_m: f64,
    /// Largest speed after the command \[m/s\].
    pub peak_m_s: f64,
    /// Command to 99 % of the stroke \[s\], if the move is that long.
    pub travel_s: Option<f64>,
    /// Every millisecond from [`LEAD_S`] before the command on.
    #[serde(skip)]
    pub rows: Vec<Row>,
}

/// Time before the command in an outcome's rows \[s\].
pub const LEAD_S: f64 = 0.5;

/// True pressures of the chambers \[Pa\].
fn pressures(bench: &AxisSim<ValveOverride>) -> [f64; 2] {
    let model = &bench.axis().assembly.cylinders[0];
    let stroke_m = bench.state.core.motion.stroke_m;
    model.pressures_pa(&bench.state.core.cylinders[0], stroke_m)
}

/// Values drawn by the seed.
struct Draw {
    /// Time of the command beyond the wait \[ms\]: its phase against pulses and drift.
    phase_ms: u32,
    /// Place in the stroke, as a share.
    share: f64,
    /// Part of a bus cycle until the next SYNC.
    wait: f64,
    /// When a move under way is reversed \[s\].
    reversed_s: f64,
}

impl Draw {
    fn new(seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed ^ 0x0064_656C_6179);
        Self {
            phase_ms: rng.random_range(0..40),
            share: rng.random_range(0.3..0.7),
            wait: rng.random_range(0.0..1.0),
            reversed_s: rng.random_range(0.25..0.45),
        }
    }
}

impl Trial {
    /// Runs it.
    ///
    /// # Errors
    /// [`AxisSimError`].
    pub fn run(&self) -> Result<Outcome, AxisSimError> {
        let draw = Draw::new(self.seed);
        let stroke_m = self.axis.cylinder.stroke_m;
        let beyond_m = if self.start.held() { BEYOND_M } else { 0.0 };
        // Begin of the history, its end, and the target of the move.
        let (begin, from_m, to_m) = match self.start {
            Start::HomeHeld | Start::HomeRest => (0.9, stroke_m + beyond_m, 0.1 * stroke_m),
            Start::StopHeld | Start::StopRest => (0.1, -beyond_m, 0.9 * stroke_m),
            Start::MidExtend => (0.5, draw.share * stroke_m, stroke_m * (draw.share + 0.25)),
            Start::MidRetract => (0.5, draw.share * stroke_m, stroke_m * (draw.share - 0.25)),
            Start::Reversal => (0.15, 0.15 * stroke_m, 0.15 * stroke_m),
        };
        let mut params = self.axis.clone();
        let atmosphere_pa = params.gas.ambient_pressure_pa;
        params.initial_stroke_m = begin * stroke_m;
        params.cylinder.initial_pressure_a_pa = atmosphere_pa;
        params.cylinder.initial_pressure_b_pa = atmosphere_pa;
        let board = ValveOverride {
            firmware: Firmware::new(&self.design()).map_err(AxisSimError::Design)?,
            forced: None,
            then: None,
            under_way: VecDeque::new(),
            late: 0,
        };
        let mut bench = AxisSim::new(&params, self.seed, board)?;
        self.history(&mut bench, params.initial_stroke_m, from_m)?;
        self.overridden(&mut bench, from_m)?;

        let bus_s = self.bus.map_or(0.0, |b| b.cycle_s * draw.wait + b.frame_s);
        bench.board.late = (bus_s * 1e3).round() as usize;
        bench.preview_s = self.preview_s;
        let at_ms = (WAIT_S * 1e3) as u32 + draw.phase_ms;
        let at_s = f64::from(at_ms) * 1e-3;
        let open = if self.start.sign() > 0.0 {
            [FULL, 0, 0, FULL]
        } else {
            [0, FULL, FULL, 0]
        };
        let command = at_ms + bench.board.late as u32;
        bench.board.then = Some((command, self.thrown.then_some(open)));
        let motion = match self.s_curve_s {
            Some(duration_s) => Motion::SCurve {
                at_s,
                duration_s,
                from_m,
                to_m,
            },
            None => Motion::Step { at_s, from_m, to_m },
        };
        let rows = if self.start == Start::Reversal {
            self.reversal(&mut bench, &draw)?
        } else {
            bench.run(&motion, &[], at_s + WATCH_S)?.rows
        };
        let lead = (LEAD_S * 1e3) as usize;
        let command = rows.len().saturating_sub((WATCH_S * 1e3) as usize);
        Ok(self.outcome(&rows[command.saturating_sub(lead)..], lead.min(command)))
    }

    /// Moves to the place of the start, and rests or holds there.
    fn history(
        &self,
        bench: &mut AxisSim<ValveOverride>,
        begin_m: f64,
        from_m: f64,
    ) -> Result<(), AxisSimError> {
        let mut at_m = begin_m;
        let stroke_m = self.axis.cylinder.stroke_m;
        let inside = matches!(self.start, Start::MidExtend | Start::MidRetract);
        // A rest inside the stroke is reached from either side, by a separate move.
        let side = if self.seed.is_multiple_of(2) {
            0.1
        } else {
            0.9
        };
        let stations = inside.then_some((side * stroke_m, 1.5)).into_iter();
        for (to_m, seconds) in stations.chain([(from_m, HISTORY_S)]) {
            let step = Motion::Step {
                at_s: 0.05,
                from_m: at_m,
                to_m,
            };
            bench.run(&step, &[], seconds)?;
            at_m = to_m;
        }
        let mut last = pressures(bench);
        for _ in 0..if self.start.held() { HOLD_MORE } else { 0 } {
            bench.run(&Motion::hold(at_m), &[], 1.0)?;
            let now = pressures(bench);
            if (0..2).all(|i| (now[i] - last[i]).abs() < STANDS_PA) {
                break;
            }
            last = now;
        }
        Ok(())
    }

    /// Valves opened by hand before the command.
    fn overridden(
        &self,
        bench: &mut AxisSim<ValveOverride>,
        at_m: f64,
    ) -> Result<(), AxisSimError> {
        if self.before == Before::Nothing {
            return Ok(());
        }
        let gas = self.axis.gas;
        let c = &self.axis.cylinder;
        let areas = [c.bore_m * c.bore_m, c.bore_m * c.bore_m - c.rod_m * c.rod_m];
        // Chamber B retracts: it is the drive chamber of a move from home.
        let (counter, drive) = if self.start.sign() > 0.0 {
            (1, 0)
        } else {
            (0, 1)
        };
        let half_pa = 0.5 * (self.axis.supply.set_pressure_pa - gas.ambient_pressure_pa);
        let wanted_pa = match self.before {
            Before::Vented | Before::Nothing => [gas.ambient_pressure_pa; 2],
            Before::Balanced => {
                let mut p = [gas.ambient_pressure_pa + half_pa; 2];
                p[counter] = gas.ambient_pressure_pa + half_pa * areas[drive] / areas[counter];
                p
            }
        };
        for _ in 0..2000 {
            let p = pressures(bench);
            let mut on = [0; 4];
            // Within 2 kPa is enough: the effect of a short pulse.
            for i in 0..2 {
                if self.before == Before::Vented && i == drive {
                    continue;
                }
                on[2 * i] = FULL * u16::from(p[i] < wanted_pa[i] - 2e3);
                on[2 * i + 1] = FULL * u16::from(p[i] > wanted_pa[i] + 2e3);
            }
            bench.board.forced = Some(on);
            bench.run(&Motion::hold(at_m), &[], 1e-3)?;
        }
        // Shut until the command.
        bench.board.forced = Some([0; 4]);
        Ok(())
    }

    /// An extending move whose reference jumps back while the piston is on its way.
    fn reversal(
        &self,
        bench: &mut AxisSim<ValveOverride>,
        draw: &Draw,
    ) -> Result<Vec<Row>, AxisSimError> {
        let stroke_m = self.axis.cylinder.stroke_m;
        let (low_m, high_m) = (0.15 * stroke_m, 0.85 * stroke_m);
        let out = Motion::Step {
            at_s: 0.0,
            from_m: low_m,
            to_m: high_m,
        };
        let mut rows = bench.run(&Motion::hold(low_m), &[], WAIT_S)?.rows;
        rows.extend(bench.run(&out, &[], draw.reversed_s)?.rows);
        let back = Motion::Step {
            at_s: 0.0,
            from_m: high_m,
            to_m: low_m,
        };
        rows.extend(bench.run(&back, &[], WATCH_S)?.rows);
        Ok(rows)
    }

    fn outcome(&self, rows: &[Row], command: usize) -> Outcome {
        let sign = self.start.sign();
        let (before, after) = rows.split_at(command);
        let announced = before
            .len()
            .saturating_sub((self.preview_s * 1e3).round() as usize);
        let stood_m = before
            .get(announced)
            .or(after.first())
            .map_or(0.0, |r| r.stroke_m);
        let early = before[announced..]
            .iter()
            .map(|r| (r.stroke_m - stood_m).abs())
            .fold(0.0, f64::max);
        let first = after.first().copied().unwrap_or_default();
        let full_m = 0.99 * self.axis.cylinder.stroke_m;
        let travelled = after
            .iter()
            .position(|r| sign * (r.stroke_m - first.stroke_m) >= full_m);
        Outcome {
            delay_s: started_s(after, sign),
            early_mm: early * 1e3,
            pressure_pa: first.pressure_pa,
            stroke_m: first.stroke_m,
            peak_m_s: after
                .iter()
                .map(|r| r.velocity_m_s.abs())
                .fold(0.0, f64::max),
            travel_s: travelled.map(|k| k as f64 * 1e-3),
            rows: rows.to_vec(),
        }
    }
}

/// Time until the stroke is [`STARTED_M`] from its turning point, interpolated between rows of a millisecond
/// \[s\].
fn started_s(rows: &[Row], sign: f64) -> Option<f64> {
    let mut turned = f64::INFINITY;
    let mut last = f64::NAN;
    for (k, row) in rows.iter().enumerate() {
        let x = sign * row.stroke_m;
        turned = turned.min(x);
        let travel = x - turned;
        if travel >= STARTED_M {
            // The row before was still short of it, from the same turning point.
            let before = last - turned;
            let part = (STARTED_M - before) / (travel - before);
            return Some((k as f64 - 1.0 + part) * 1e-3);
        }
        last = x;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(stroke_m: impl Fn(f64) -> f64) -> Vec<Row> {
        let row = |k: u32| Row {
            stroke_m: stroke_m(f64::from(k) * 1e-3),
            ..Row::default()
        };
        (0..500).map(row).collect()
    }

    #[test]
    fn a_start_is_found_between_two_rows() {
        // It stands still for 82.3 ms, then moves at 0.1 m/s: a millimetre takes 10 ms.
        let out = rows(|t| 0.05 + (0.1 * (t - 0.0823)).max(0.0));
        let found = started_s(&out, 1.0).expect("moves");
        assert!((found - 0.0923).abs() < 1e-9, "{found}");
        assert_eq!(started_s(&out, -1.0), None);
    }

    #[test]
    fn a_start_counts_from_where_the_piston_turned() {
        // It continues for 50 ms, and comes back at the same speed.
        let back = rows(|t| 0.05 + 0.2 * (0.05 - (t - 0.05).abs()));
        let found = started_s(&back, -1.0).expect("turns");
        assert!((found - 0.055).abs() < 1e-9, "{found}");
    }
}
