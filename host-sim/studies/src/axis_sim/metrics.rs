//! Figures of merit of a recording.

use serde::Serialize;

use super::run::Trace;

/// Density of air at the reference atmosphere (ISO 8778) \[kg/m³\].
const ANR_DENSITY_KG_M3: f64 = 1.185;

/// Width of the band that counts as settled \[m\].
pub const SETTLED_BAND_M: f64 = 1e-3;

/// Reversals in the last second from which on the end is a limit cycle.
pub const LIMIT_CYCLE: u32 = 3;

/// Figures of one move. True positions, not measured ones. Times count from the
/// start of the motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Metrics {
    /// Mean error over the last 0.2 s, reference − stroke \[mm\].
    pub steady_error_mm: f64,
    /// Largest excursion past the target, in the direction of the move \[mm\].
    pub overshoot_mm: f64,
    /// From 10 to 90 % of the move \[s\]; `None` if it never gets there.
    pub rise_s: Option<f64>,
    /// Until the stroke stays within 1 mm of the target \[s\]; `None` if it ends
    /// outside.
    pub settle_s: Option<f64>,
    /// Root mean square of the error from the start of the motion \[mm\].
    pub rms_mm: f64,
    /// Largest error from the start of the motion \[mm\].
    pub worst_mm: f64,
    /// First motion of 1 mm in the direction of the move \[s\].
    pub start_delay_s: Option<f64>,
    /// Largest motion before the start, either way \[mm\].
    pub early_mm: f64,
    /// Largest speed \[mm/s\].
    pub peak_speed_mm_s: f64,
    /// Poppet movements per second, all four valves.
    pub switches_per_s: f64,
    /// Time of the last poppet movement \[s\], 0 if none.
    pub last_switch_s: f64,
    /// Air taken from the supply \[dm³ ANR\].
    pub air_dm3: f64,
    /// Reversals of more than 0.2 mm in the last second: 3 or more are a limit
    /// cycle.
    pub reversals: u32,
}

impl Metrics {
    /// Computes the figures.
    #[must_use]
    pub fn of(trace: &Trace) -> Self {
        let rows = &trace.rows;
        let first = ((trace.motion.start_s() * 1000.0).round() as usize).min(rows.len());
        let (before, after) = rows.split_at(first);
        let (from, to) = (trace.motion.from_m(), trace.motion.to_m());
        let sign = if to >= from { 1.0 } else { -1.0 };
        let span = (to - from).abs();
        let time = |k: usize| k as f64 * 1e-3;
        let tail = &after[after.len().saturating_sub(200)..];
        let mean_error =
            tail.iter().map(|r| r.reference_m - r.stroke_m).sum::<f64>() / tail.len().max(1) as f64;
        let begun_at = after.first().map_or(from, |r| r.stroke_m);
        let progress = |share: f64| {
            after
                .iter()
                .position(|r| sign * (r.stroke_m - from) >= share * span)
        };
        let rise = match (progress(0.1), progress(0.9)) {
            (Some(a), Some(b)) if span > 0.0 => Some(time(b.saturating_sub(a))),
            _ => None,
        };
        let outside = after
            .iter()
            .rposition(|r| (r.stroke_m - to).abs() > SETTLED_BAND_M);
        let settle = match outside {
            Some(k) if k + 1 >= after.len() => None,
            Some(k) => Some(time(k + 1)),
            None => Some(0.0),
        };
        let fold = |f: &dyn Fn(&super::run::Row) -> f64| after.iter().map(f).fold(0.0, f64::max);
        let squares: f64 = after
            .iter()
            .map(|r| (r.reference_m - r.stroke_m).powi(2))
            .sum();
        let last_switch = after
            .windows(2)
            .rposition(|w| w[1].switches != w[0].switches)
            .map_or(0.0, |k| time(k + 1));
        let counted = |list: &[super::run::Row]| match (list.first(), list.last()) {
            (Some(a), Some(b)) => (
                (b.switches - a.switches) as f64,
                (b.air_kg - a.air_kg) / ANR_DENSITY_KG_M3 * 1e3,
            ),
            _ => (0.0, 0.0),
        };
        let (switches, air) = counted(after);
        Self {
            steady_error_mm: mean_error * 1e3,
            overshoot_mm: fold(&|r| sign * (r.stroke_m - to)) * 1e3,
            rise_s: rise,
            settle_s: settle,
            rms_mm: (squares / after.len().max(1) as f64).sqrt() * 1e3,
            worst_mm: fold(&|r| (r.reference_m - r.stroke_m).abs()) * 1e3,
            start_delay_s: after
                .iter()
                .position(|r| sign * (r.stroke_m - begun_at) >= 1e-3)
                .map(time),
            early_mm: before
                .iter()
                .map(|r| (r.stroke_m - before[0].stroke_m).abs())
                .fold(0.0, f64::max)
                * 1e3,
            peak_speed_mm_s: fold(&|r| r.velocity_m_s.abs()) * 1e3,
            switches_per_s: switches / time(after.len()).max(1e-3),
            last_switch_s: last_switch,
            air_dm3: air,
            reversals: reversals(&after[after.len().saturating_sub(1000)..]),
        }
    }

    /// Whether the end of the recording is a limit cycle.
    #[must_use]
    pub fn limit_cycle(&self) -> bool {
        self.reversals >= LIMIT_CYCLE
    }
}

/// Turns of the stroke by more than 0.2 mm.
fn reversals(rows: &[super::run::Row]) -> u32 {
    const HYSTERESIS_M: f64 = 0.2e-3;
    let Some(first) = rows.first() else { return 0 };
    // The extreme since the last turn, and the direction towards it.
    let (mut extreme, mut direction, mut turns) = (first.stroke_m, 0.0, 0);
    for row in rows {
        let travel = row.stroke_m - extreme;
        if travel * direction > 0.0 {
            extreme = row.stroke_m;
        } else if travel.abs() > HYSTERESIS_M {
            turns += u32::from(direction != 0.0);
            direction = travel.signum();
            extreme = row.stroke_m;
        }
    }
    turns
}

#[cfg(test)]
mod tests {
    use super::super::motion::Motion;
    use super::super::run::{Row, Trace};
    use super::*;

    fn trace(f: impl Fn(f64) -> f64) -> Trace {
        let motion = Motion::Step {
            at_s: 0.1,
            from_m: 0.04,
            to_m: 0.14,
        };
        let rows = (0..2100)
            .map(|k| {
                let t = f64::from(k) * 1e-3;
                Row {
                    reference_m: motion.at(t).0,
                    stroke_m: f(t - 0.1),
                    ..Row::default()
                }
            })
            .collect();
        Trace {
            motion,
            rows,
            faults: wheeleg_protocol::FaultBits::NONE,
            latched: Vec::new(),
            drove: true,
        }
    }

    #[test]
    fn a_first_order_step_gives_its_own_figures() {
        let m = Metrics::of(&trace(|t| {
            0.14 - 0.1 * if t < 0.0 { 1.0 } else { (-t / 0.1).exp() }
        }));
        // ln 9 time constants; within 1 % of the step after ln 100.
        assert!((m.rise_s.unwrap() - 0.2197).abs() < 0.002);
        assert!((m.settle_s.unwrap() - 0.4605).abs() < 0.002);
        assert!(m.overshoot_mm == 0.0 && m.early_mm == 0.0);
        assert!((m.start_delay_s.unwrap() - 0.001_005).abs() < 0.0011);
        assert_eq!(m.reversals, 0);
    }

    #[test]
    fn a_ringing_end_is_a_limit_cycle_and_a_quiet_one_is_not() {
        let ring = |amplitude: f64| {
            Metrics::of(&trace(move |t| {
                let x = if t < 0.3 { 0.0 } else { (30.0 * t).sin() };
                0.14 + amplitude * x - if t < 0.0 { 0.1 } else { 0.0 }
            }))
        };
        let (large, small) = (ring(0.5e-3), ring(0.05e-3));
        // 30 rad/s for a second turns 9.5 times.
        assert!((8..=11).contains(&large.reversals), "{}", large.reversals);
        assert!(large.limit_cycle() && !small.limit_cycle());
        assert!((large.overshoot_mm - 0.5).abs() < 0.01);
    }
}
