//! Delay between reference model and simulated robot.

use serde::Serialize;

use super::{ReferenceModel, within};
use wheeleg_config::GaitParams;
use wheeleg_telemetry::{JointSample, Row};

/// Delay of one move.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StartDelay {
    /// Step, from 1.
    pub step: u16,
    /// Which move.
    pub move_name: &'static str,
    /// Time at which the node latched the step of the command, s on the recording's clock.
    pub at_s: f64,
    /// From the step of the command at the node to the first millimetre in the new direction, s; `None` if it
    /// never moved.
    pub delay_s: Option<f64>,
}

/// A move has started once the piston is this far from its turning point, mm.
const STARTED_MM: f64 = 1.0;
/// How long before its time in the gait the search for a step of the command begins, s: two bus cycles.
const BEFORE_S: f64 = 0.02;
/// A step of the command is a jump of more than this, mm.
const STEP_MM: f64 = 5.0;

/// One move whose delay is being measured.
#[derive(Debug)]
struct Move {
    /// Place in the list of delays.
    place: usize,
    /// Whether it is a move of b5.
    is_b5: bool,
    /// Window in which the command steps and the piston starts, s.
    window_s: (f64, f64),
    /// Direction, +1 extends.
    sign: f64,
    /// Command at the begin of the window, mm.
    before_mm: Option<f64>,
    /// Smallest stroke in the direction since the step, mm: the move before may still be ending.
    turned_mm: f64,
}

/// Measures the delays of all square-wave moves while the samples come in. The clock starts when the node
/// latches the commanded step: the delay excludes bus and gait latency, and includes the effect of the
/// board's slew limit and controller.
#[derive(Debug)]
pub(super) struct DelayMeter {
    gait: GaitParams,
    start_s: f64,
    /// Steps whose moves have been set up.
    steps: u16,
    moves: Vec<Move>,
    /// Three per step; `None` if the command does not jump.
    delays: Vec<Option<StartDelay>>,
}

const MOVES: [&str; 3] = ["b6 retracts", "b5 extends", "b6 extends"];

impl DelayMeter {
    pub(super) fn new(gait: GaitParams, start_s: f64) -> Self {
        Self {
            gait,
            start_s,
            steps: 0,
            moves: Vec::new(),
            delays: Vec::new(),
        }
    }

    fn set_up_steps(&mut self, t_s: f64) {
        let gait = &self.gait;
        while self.steps < gait.steps {
            let t = self.start_s + f64::from(self.steps) * gait.period_s;
            if t_s < t - 2.0 * BEFORE_S {
                break;
            }
            self.steps += 1;
            let windows = [
                (gait.lift_s, gait.lower_s, -1.0),
                (gait.reach_s, gait.push_s, 1.0),
                (gait.lower_s, gait.push_s, 1.0),
            ];
            for (i, (from, to, sign)) in windows.into_iter().enumerate() {
                self.moves.push(Move {
                    place: self.delays.len(),
                    is_b5: i == 1,
                    window_s: (t + from - BEFORE_S, t + to),
                    sign,
                    before_mm: None,
                    turned_mm: f64::INFINITY,
                });
                self.delays.push(None);
            }
        }
    }

    pub(super) fn joint(&mut self, is_b5: bool, row: &Row<JointSample>) {
        self.set_up_steps(row.t_s());
        let delays = &mut self.delays;
        let over = |m: &Move| row.t_s() >= m.window_s.1;
        self.moves
            .retain_mut(|m| m.is_b5 != is_b5 || !(over(m) || m.starts(row, &mut delays[m.place])));
    }

    pub(super) fn into_delays(self) -> Vec<StartDelay> {
        self.delays.into_iter().flatten().collect()
    }
}

impl Move {
    /// Takes a sample; true once the move has started.
    fn starts(&mut self, row: &Row<JointSample>, delay: &mut Option<StartDelay>) -> bool {
        if !within(row, self.window_s.0, self.window_s.1) {
            return false;
        }
        let before_mm = *self.before_mm.get_or_insert(row.v.commanded_mm);
        let jumps = self.sign * (row.v.commanded_mm - before_mm) > STEP_MM;
        if delay.is_none() && !jumps {
            return false;
        }
        let delay = delay.get_or_insert_with(|| StartDelay {
            step: (self.place / MOVES.len()) as u16 + 1,
            move_name: MOVES[self.place % MOVES.len()],
            at_s: row.t_s(),
            delay_s: None,
        });
        let x = self.sign * row.v.position_mm;
        self.turned_mm = self.turned_mm.min(x);
        if x - self.turned_mm < STARTED_MM {
            return false;
        }
        delay.delay_s = Some(row.t_s() - delay.at_s);
        true
    }
}

/// Samples per bin of the correlation; one bin is 4 ms.
const BIN: usize = 4;
/// Largest shift tried, s.
const MAX_SHIFT_S: f64 = 1.0;
/// Most bins of a joint: ten minutes, the part of the record that the shift is fitted to.
const MAX_BINS: usize = 150_000;

/// Means over a bin.
#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    /// Time since the start, s.
    t_s: f64,
    speed_mm_s: f64,
    stroke_mm: f64,
}

/// Speed and stroke of one joint in bins.
#[derive(Debug, Default)]
struct Bins {
    /// Samples of the bin that is being filled, and their sums.
    filling: (usize, Bin),
    means: Vec<Bin>,
}

impl Bins {
    fn add(&mut self, row: &Row<JointSample>, start_s: f64) {
        if self.means.len() == MAX_BINS || !within(row, start_s, f64::INFINITY) {
            return;
        }
        let (n, sum) = &mut self.filling;
        *n += 1;
        sum.t_s += row.t_s();
        sum.speed_mm_s += row.v.velocity_mm_s;
        sum.stroke_mm += row.v.position_mm;
        if *n == BIN {
            let count = BIN as f64;
            self.means.push(Bin {
                t_s: sum.t_s / count - start_s,
                speed_mm_s: sum.speed_mm_s / count,
                stroke_mm: sum.stroke_mm / count,
            });
            self.filling = Default::default();
        }
    }
}

/// Strokes of b5 and b6 compared with those of the reference model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Shift of the velocities of b5 and b6 (together) at the maximum of the normalised
    /// cross-correlation, s; positive when the robot is late.
    pub shift_s: f64,
    /// Residual of the strokes of b5 and b6 against the model shifted by that, RMS, mm.
    pub residual_mm: [f64; 2],
}

/// Compares b5 and b6 with the reference model, from samples as they come in.
#[derive(Debug)]
pub(super) struct ShiftMeter {
    start_s: f64,
    bins: [Bins; 2],
}

impl ShiftMeter {
    pub(super) fn new(start_s: f64) -> Self {
        Self {
            start_s,
            bins: Default::default(),
        }
    }

    pub(super) fn joint(&mut self, is_b5: bool, row: &Row<JointSample>) {
        self.bins[usize::from(!is_b5)].add(row, self.start_s);
    }

    /// `None` for records too short to compare.
    pub(super) fn fit(self, model: &ReferenceModel) -> Option<Fit> {
        let signals = self.bins.map(|bins| bins.means);
        let shift_s = velocity_shift_s(&signals, model)?;
        let residual_mm = [0, 1].map(|joint: usize| {
            let squares = signals[joint].iter().map(|bin| {
                let p = model.at(bin.t_s - shift_s);
                let modelled_m = [p.s5_m, p.s6_m][joint];
                (bin.stroke_mm - 1e3 * modelled_m).powi(2)
            });
            (squares.sum::<f64>() / signals[joint].len().max(1) as f64).sqrt()
        });
        Some(Fit {
            shift_s,
            residual_mm,
        })
    }
}

fn velocity_shift_s(signals: &[Vec<Bin>; 2], model: &ReferenceModel) -> Option<f64> {
    let bin_s = signals[0].get(1)?.t_s - signals[0].first()?.t_s;
    let modelled = [0, 1].map(|i| {
        signals[i]
            .iter()
            .map(|bin| {
                let p = model.at(bin.t_s);
                1e3 * if i == 0 { p.v5_m_s } else { p.v6_m_s }
            })
            .collect::<Vec<_>>()
    });
    let max_lag = (MAX_SHIFT_S / bin_s) as i64;
    if signals[0].len() < 4 * max_lag as usize {
        return None;
    }
    let correlation = |lag: i64| -> f64 {
        let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
        for (signal, modelled) in signals.iter().zip(&modelled) {
            for (k, bin) in signal.iter().enumerate() {
                let Ok(j) = usize::try_from(k as i64 - lag) else {
                    continue;
                };
                let Some(x) = modelled.get(j) else { continue };
                xy += x * bin.speed_mm_s;
                xx += x * x;
                yy += bin.speed_mm_s * bin.speed_mm_s;
            }
        }
        if xx * yy > 0.0 {
            xy / (xx * yy).sqrt()
        } else {
            0.0
        }
    };
    let lags: Vec<f64> = (-max_lag / 4..=max_lag).map(correlation).collect();
    let best = (0..lags.len()).max_by(|a, b| lags[*a].total_cmp(&lags[*b]))?;
    if lags[best] <= 0.0 {
        return None;
    }
    // A parabola through the peak and its neighbours gives the fraction of a bin.
    let fraction = match (best.checked_sub(1).map(|i| lags[i]), lags.get(best + 1)) {
        (Some(left), Some(right)) => {
            let curve = left - 2.0 * lags[best] + right;
            if curve < 0.0 {
                0.5 * (left - right) / curve
            } else {
                0.0
            }
        }
        _ => 0.0,
    };
    Some((best as f64 + fraction - (max_lag / 4) as f64) * bin_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::testing;
    use wheeleg_config::builtin;

    #[test]
    fn a_known_delay_is_found_again_and_what_is_left_is_what_was_added() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let model = ReferenceModel::new(robot.reference, robot.gait);
        for delay_s in [0.0, 0.0637, 0.25] {
            let mut recording = testing::from_reference(&robot, delay_s, 0.0);
            // b6 is 3 mm off the model, which no shift removes.
            for row in &mut recording.joints[2] {
                row.v.position_mm += 3.0;
            }
            let mut meter = ShiftMeter::new(0.0);
            for (is_b5, joint) in [(true, 1), (false, 2)] {
                let rows = recording.joints[joint].iter();
                rows.for_each(|row| meter.joint(is_b5, row));
            }
            let fit = meter.fit(&model).expect("long enough");
            assert!((fit.shift_s - delay_s).abs() < 2e-3, "{delay_s}: {fit:?}");
            // 2 ms at 400 mm/s are 0.8 mm at most.
            let [b5, b6] = fit.residual_mm;
            assert!(b5 < 0.5 && (b6 - 3.0).abs() < 0.1, "{delay_s}: {fit:?}");
        }
    }

    /// A board that slews its reference starts later than its command; the
    /// delay is that of the command.
    #[test]
    fn a_slewed_reference_does_not_hide_the_delay() {
        let rows: Vec<Row<JointSample>> = (0..1000_u64)
            .map(|ms| {
                let since = ms.saturating_sub(100) as f64;
                let v = JointSample {
                    commanded_mm: if ms < 100 { 0.0 } else { 180.0 },
                    reference_mm: (0.3 * since).min(180.0),
                    // Moves 80 ms after the command, at 0.5 mm/ms.
                    position_mm: (0.5 * (since - 80.0)).clamp(0.0, 180.0),
                    ..JointSample::default()
                };
                let t_ns = ms * 1_000_000;
                Row { t_ns, v }
            })
            .collect();
        let mut one = Move {
            place: 1,
            is_b5: true,
            window_s: (0.0, f64::INFINITY),
            sign: 1.0,
            before_mm: None,
            turned_mm: f64::INFINITY,
        };
        let mut found = None;
        assert!(rows.iter().any(|row| one.starts(row, &mut found)));
        let StartDelay { at_s, delay_s, .. } = found.expect("a step");
        assert!((at_s - 0.100).abs() < 1e-9, "{at_s}");
        let delay_s = delay_s.expect("it moves");
        assert!((delay_s - 0.082).abs() < 1e-9, "{delay_s}");
    }

    #[test]
    fn start_delay_is_the_delay_plus_the_first_millimetre() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let recording = testing::from_reference(&robot, 0.25, 0.5);
        let mut meter = DelayMeter::new(robot.gait, 0.5);
        for (b5, b6) in recording.joints[1].iter().zip(&recording.joints[2]) {
            meter.joint(true, b5);
            meter.joint(false, b6);
        }
        let delays = meter.into_delays();
        assert_eq!(delays.len(), 9);
        for d in &delays {
            // 1 mm from rest at S/tau^2 (4.5 to 5.9 m/s2) takes 19 to 22 ms; b6 first ends its way up before
            // it turns to come down.
            let unloading = match d.move_name {
                "b6 retracts" => robot.reference.unload_s,
                _ => 0.0,
            };
            let delay = d.delay_s.expect("it moves") - unloading;
            assert!((0.26..0.29).contains(&delay), "{} {delay}", d.move_name);
        }
    }
}
