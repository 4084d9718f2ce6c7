//! The delay over conductance, volume and bore.

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_plant::axis::AxisParams;

use super::ablation::conductance;
use super::trial::{Law, Outcome, Start, Trial};
use super::{mean_delay, run_all};
use crate::StudyError;
use crate::axis_sim::suite::{force_left_n, weaker_force_n};
use crate::compare::MARGIN;
use crate::study::{Ended, Progress};

/// Most seeds of a point.
pub(super) const SEEDS: u32 = 6;
/// Factors on the conductance of all valves.
pub(super) const FACTORS: [f64; 5] = [0.5, 0.7, 1.0, 1.4, 2.0];
/// Factors on the volume of the tubes.
pub(super) const TUBES: [f64; 5] = [0.0, 0.5, 1.0, 2.0, 3.0];
/// Bores with the rods that belong to them \[m\].
const BORES_M: [(f64, f64); 3] = [(0.016, 0.006), (0.020, 0.008), (0.025, 0.010)];

/// One point of the scaling study.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Scaled {
    /// Factor on the conductance.
    pub factor: f64,
    /// Factor on the volume of the tubes.
    pub tube: f64,
    /// Volume of the counter chamber with its tube \[m³\].
    pub volume_m3: f64,
    /// Volume over conductance of valve and tube in series \[s Pa\].
    pub ratio_s_pa: f64,
    /// Start delay \[s\].
    pub delay_s: f64,
}

/// One bore at the base's stroke time.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Bored {
    /// Bore \[m\].
    pub bore_m: f64,
    /// Whether tube, dead volume and friction grow with the area.
    pub scaled: bool,
    /// Conductance that gives the stroke time \[m³/(s Pa)\].
    pub conductance_m3_s_pa: f64,
    /// Stroke time, valves thrown open \[s\].
    pub stroke_s: f64,
    /// Start delay \[s\].
    pub delay_s: f64,
}

/// A straight line through points.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct Line {
    /// Value at zero.
    pub offset: f64,
    /// Slope.
    pub slope: f64,
    /// Coefficient of determination.
    pub r_squared: f64,
}

/// Least squares.
pub(super) fn fit(points: &[(f64, f64)]) -> Line {
    let n = points.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (mx, my) = (mean(&|p| p.0), mean(&|p| p.1));
    let xy = mean(&|p| (p.0 - mx) * (p.1 - my));
    let (xx, yy) = (mean(&|p| (p.0 - mx).powi(2)), mean(&|p| (p.1 - my).powi(2)));
    let slope = xy / xx;
    Line {
        offset: my - slope * mx,
        slope,
        r_squared: xy * xy / (xx * yy),
    }
}

/// Seeds of every point, and progress.
#[derive(Clone, Copy)]
pub(super) struct Work<'a> {
    pub(super) seeds: u32,
    pub(super) progress: &'a Progress,
}

pub(super) fn never() -> StudyError {
    StudyError::refused(
        "a start from home never came while testing a prediction",
        "the load may exceed what the cylinder can move; see --load",
    )
}

/// The cylinder of the study with another bore and rod; `scaled`: tube, dead volumes and friction grow
/// with the area.
fn bored(axis: &AxisParams, (bore_m, rod_m): (f64, f64), scaled: bool) -> AxisParams {
    let mut at = axis.clone();
    let c = &mut at.cylinder;
    let area = if scaled {
        (bore_m / c.bore_m).powi(2)
    } else {
        1.0
    };
    (c.bore_m, c.rod_m) = (bore_m, rod_m);
    for volume in [
        &mut c.line_volume_m3,
        &mut c.dead_volume_a_m3,
        &mut c.dead_volume_b_m3,
    ] {
        *volume *= area;
    }
    let f = &mut c.friction;
    for force in [
        &mut f.coulomb_n,
        &mut f.static_n,
        &mut f.viscous_n_s_m,
        &mut f.bristle_stiffness_n_m,
        &mut f.bristle_damping_n_s_m,
    ] {
        *force *= area;
    }
    at
}

/// The cylinder of the study with every tried bore, its own first.
pub(super) fn all_bores(axis: &AxisParams) -> Vec<AxisParams> {
    let mut all = vec![axis.clone()];
    for scaled in [false, true] {
        all.extend(BORES_M.map(|bore| bored(axis, bore, scaled)));
    }
    all
}

/// The largest load that every bore of the study starts against, with a margin \[N\].
pub(super) fn most_load_n(axis: &AxisParams) -> f64 {
    let left_n = all_bores(axis)
        .into_iter()
        .map(|bored| force_left_n(&bored));
    left_n.fold(f64::INFINITY, f64::min) / MARGIN
}

/// The largest friction of the robot's cylinder with which every bore of the study starts, with a margin, and
/// the bore that allows no more \[N, m\].
pub(super) fn most_friction_n(axis: &AxisParams) -> (f64, f64) {
    let own_n = axis.cylinder.friction.static_n;
    let most = |at: &AxisParams| {
        // Of a bore that scales its friction is a share of the robot's own.
        let share = at.cylinder.friction.static_n / own_n;
        (weaker_force_n(at) / share / MARGIN, at.cylinder.bore_m)
    };
    let all = all_bores(axis);
    let least = all.iter().map(most).min_by(|a, b| a.0.total_cmp(&b.0));
    least.unwrap_or((own_n, axis.cylinder.bore_m))
}

/// Mean delays of several trials, each under all seeds.
pub(super) fn delays(trials: &[Trial], work: Work<'_>) -> Result<Vec<f64>, Ended> {
    let seeded = |trial: &Trial, seed: u32| Trial {
        seed: u64::from(seed),
        ..trial.clone()
    };
    let all: Vec<Trial> = trials
        .iter()
        .flat_map(|trial| (1..=work.seeds).map(move |seed| seeded(trial, seed)))
        .collect();
    let outcomes = run_all("predictions", &all, work.progress)?;
    let means = outcomes.chunks(work.seeds as usize).map(mean_delay);
    let means: Option<Vec<f64>> = means.collect();
    Ok(means.ok_or_else(never)?)
}

pub(super) fn home(axis: &AxisParams) -> Trial {
    Trial::new(axis, Law::Paper, Start::HomeHeld, 1)
}

/// The whole stroke from the held home with the valves thrown open.
pub(super) fn thrown(axis: &AxisParams, progress: &Progress) -> Result<Outcome, Ended> {
    let trial = Trial {
        thrown: true,
        ..home(axis)
    };
    let outcomes = run_all("predictions", &[trial], progress)?;
    Ok(outcomes.into_iter().next().ok_or_else(never)?)
}

/// Delay against volume and conductance.
pub(super) fn scaling(axis: &AxisParams, work: Work<'_>) -> Result<Vec<Scaled>, Ended> {
    let mut points = Vec::new();
    let mut trials = Vec::new();
    for factor in FACTORS {
        for tube in TUBES {
            let mut trial = home(axis);
            conductance(&mut trial, factor);
            trial.axis.cylinder.line_volume_m3 *= tube;
            let c = &trial.axis.cylinder;
            let area_m2 = std::f64::consts::FRAC_PI_4 * c.bore_m * c.bore_m;
            let volume_m3 = area_m2 * c.stroke_m + c.dead_volume_a_m3 + c.line_volume_m3;
            let path = match &c.line_flow {
                Some(line) => line.in_series(&c.vent_valve.flow),
                None => c.vent_valve.flow,
            };
            let ratio = volume_m3 / path.conductance_m3_s_pa;
            points.push((factor, tube, volume_m3, ratio));
            trials.push(trial);
        }
    }
    let delays = delays(&trials, work)?;
    let rows = points.iter().zip(delays);
    Ok(rows
        .map(|(&(factor, tube, volume_m3, ratio_s_pa), delay_s)| Scaled {
            factor,
            tube,
            volume_m3,
            ratio_s_pa,
            delay_s,
        })
        .collect())
}

/// Delay of other bores whose valves give the same stroke time.
pub(super) fn bores(axis: &AxisParams, stroke_s: f64, work: Work<'_>) -> Result<Vec<Bored>, Ended> {
    let mut rows = Vec::new();
    for scaled in [false, true] {
        for (bore_m, rod_m) in BORES_M {
            let at = bored(axis, (bore_m, rod_m), scaled);
            let given = at.cylinder.vent_valve.flow.conductance_m3_s_pa;
            let with = |conductance_m3_s_pa: f64| {
                let mut p = at.clone();
                p.cylinder.fill_valve.flow.conductance_m3_s_pa = conductance_m3_s_pa;
                p.cylinder.vent_valve.flow.conductance_m3_s_pa = conductance_m3_s_pa;
                p
            };
            // Bisection: smaller valves make the stroke longer.
            let (mut low, mut high) = (0.3 * given, 4.0 * given);
            for _ in 0..12 {
                let middle = 0.5 * (low + high);
                let time_s = thrown(&with(middle), work.progress)?.travel_s;
                if time_s.is_none_or(|t| t > stroke_s) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            let fitted = with(0.5 * (low + high));
            let stroke_s = thrown(&fitted, work.progress)?.travel_s.ok_or_else(never)?;
            let delay = delays(&[home(&fitted)], work)?;
            rows.push(Bored {
                bore_m,
                scaled,
                conductance_m3_s_pa: fitted.cylinder.vent_valve.flow.conductance_m3_s_pa,
                stroke_s,
                delay_s: delay[0],
            });
        }
    }
    Ok(rows)
}

/// Largest over smallest delay of some bores, less one.
pub(super) fn spread(bores: &[Bored], scaled: bool) -> f64 {
    let list = bores.iter().filter(|b| b.scaled == scaled);
    let (least, most) = list.fold((f64::INFINITY, 0.0_f64), |(least, most), b| {
        (least.min(b.delay_s), most.max(b.delay_s))
    });
    most / least - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_again_and_scatter_shows() {
        let exact: Vec<(f64, f64)> = (0..10)
            .map(|i| (f64::from(i), 3.0 - 0.5 * f64::from(i)))
            .collect();
        let line = fit(&exact);
        assert!((line.slope + 0.5).abs() < 1e-12 && (line.offset - 3.0).abs() < 1e-12);
        assert!((line.r_squared - 1.0).abs() < 1e-12);
        let scattered: Vec<(f64, f64)> = (0..10)
            .map(|i| (f64::from(i), f64::from(i * i % 7)))
            .collect();
        assert!(fit(&scattered).r_squared < 0.5);
    }
}
