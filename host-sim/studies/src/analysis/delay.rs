//! Delay between reference model and simulated robot.

use serde::Serialize;

use super::{Leg, ReferenceModel, window};
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
    /// From the step of the command at the node to the first millimetre in the
    /// new direction, s; `None` if it never moved.
    pub delay_s: Option<f64>,
}

/// A move has started once the piston is this far from where it turned, mm.
const STARTED_MM: f64 = 1.0;
/// How long before its time in the gait a step of the command is looked for, s:
/// two bus cycles.
const BEFORE_S: f64 = 0.02;
/// A step of the command is a jump of more than this, mm.
const STEP_MM: f64 = 5.0;

/// Delays of all square-wave moves. The clock starts when the node latches the
/// commanded step, so bus and gait latency are not in it, and what the board's
/// slew limit and controller make of the step is.
pub(crate) fn start_delays(leg: &Leg<'_>, gait: &GaitParams, start_s: f64) -> Vec<StartDelay> {
    let mut delays = Vec::new();
    for step in 0..gait.steps {
        let t = start_s + f64::from(step) * gait.period_s;
        let moves = [
            ("b6 retracts", leg.b6, gait.lift_s, gait.lower_s, -1.0),
            ("b5 extends", leg.b5, gait.reach_s, gait.push_s, 1.0),
            ("b6 extends", leg.b6, gait.lower_s, gait.push_s, 1.0),
        ];
        for (move_name, rows, from, to, sign) in moves {
            let rows = window(rows, t + from - BEFORE_S, t + to);
            if let Some((at_s, delay_s)) = one_delay(rows, sign) {
                delays.push(StartDelay {
                    step: step + 1,
                    move_name,
                    at_s,
                    delay_s,
                });
            }
        }
    }
    delays
}

/// Time of the commanded step and delay to the first millimetre in the
/// direction `sign`; `None` if the command does not jump in this window.
fn one_delay(rows: &[Row<JointSample>], sign: f64) -> Option<(f64, Option<f64>)> {
    let before = rows.first()?.v.commanded_mm;
    let jump = rows
        .iter()
        .position(|r| sign * (r.v.commanded_mm - before) > STEP_MM)?;
    let at_s = rows[jump].t_s();
    // Measured from the turning point: the move before may still be ending.
    let mut turned = f64::INFINITY;
    let started = rows[jump..].iter().find(|r| {
        let x = sign * r.v.position_mm;
        turned = turned.min(x);
        x - turned >= STARTED_MM
    });
    Some((at_s, started.map(|r| r.t_s() - at_s)))
}

/// Samples per bin of the correlation; one bin is 4 ms.
const BIN: usize = 4;
/// Largest shift looked at, s.
const MAX_SHIFT_S: f64 = 1.0;

/// Shift of the simulated velocities of b5 and b6 (together) against those of
/// the reference model, by the maximum of their normalised cross-correlation;
/// positive when the robot is late. `None` for records too short to compare.
pub(crate) fn velocity_shift_s(leg: &Leg<'_>, model: &ReferenceModel, start_s: f64) -> Option<f64> {
    let signals = [leg.b5, leg.b6].map(|rows| {
        let rows = window(rows, start_s, f64::INFINITY);
        rows.chunks_exact(BIN)
            .map(|c| {
                let v = c.iter().map(|r| r.v.velocity_mm_s).sum::<f64>() / BIN as f64;
                let t = c.iter().map(Row::t_s).sum::<f64>() / BIN as f64;
                (t - start_s, v)
            })
            .collect::<Vec<_>>()
    });
    let bin_s = signals[0].get(1)?.0 - signals[0].first()?.0;
    let modelled = [0, 1].map(|i| {
        signals[i]
            .iter()
            .map(|(t, _)| {
                let p = model.at(*t);
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
            for (k, (_, y)) in signal.iter().enumerate() {
                let Ok(j) = usize::try_from(k as i64 - lag) else {
                    continue;
                };
                let Some(x) = modelled.get(j) else { continue };
                xy += x * y;
                xx += x * x;
                yy += y * y;
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
    use wheeleg_config::{LegChoice, builtin};

    #[test]
    fn a_known_delay_is_found_again() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let model = ReferenceModel::new(robot.reference, robot.gait);
        for delay_s in [0.0, 0.0637, 0.25] {
            let recording = testing::from_reference(&robot, delay_s, 0.0);
            let leg = super::super::leg(&recording, LegChoice::Left);
            let shift = velocity_shift_s(&leg, &model, 0.0).expect("long enough");
            assert!((shift - delay_s).abs() < 2e-3, "{delay_s}: {shift}");
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
        let (at_s, delay_s) = one_delay(&rows, 1.0).expect("a step");
        assert!((at_s - 0.100).abs() < 1e-9, "{at_s}");
        let delay_s = delay_s.expect("it moves");
        assert!((delay_s - 0.082).abs() < 1e-9, "{delay_s}");
    }

    #[test]
    fn start_delay_is_the_delay_plus_the_first_millimetre() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let recording = testing::from_reference(&robot, 0.25, 0.5);
        let leg = super::super::leg(&recording, LegChoice::Left);
        let delays = start_delays(&leg, &robot.gait, 0.5);
        assert_eq!(delays.len(), 9);
        for d in &delays {
            // 1 mm from rest at S/tau^2 (4.5 to 5.9 m/s2) takes 19 to 22 ms; b6
            // first ends its way up when it turns to come down.
            let unloading = match d.move_name {
                "b6 retracts" => robot.reference.unload_s,
                _ => 0.0,
            };
            let delay = d.delay_s.expect("it moves") - unloading;
            assert!((0.26..0.29).contains(&delay), "{} {delay}", d.move_name);
        }
    }
}
