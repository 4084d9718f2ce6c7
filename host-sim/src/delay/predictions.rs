//! What the explanation foretells, tested; and its rivals.
//!
//! If the delay is a pressure swap (the counter chamber must vent and the drive chamber
//! fill before the piston can move), then it must depend on pressures, volumes and
//! conductance in known ways. Each statement below was made before the plant existed;
//! its band is in the statement, and the verdict is the band's.

use indicatif::ProgressBar;
use serde::Serialize;
use wheeleg_plant::axis::AxisParams;

use super::ablation::conductance;
use super::notice::Notice;
use super::starts::Starts;
use super::trial::{Before, Law, Outcome, Start, Trial};
use super::{PAPER_BAND_S, PAPER_DELAY_S, mean_delay, run_all};
use crate::SimError;

/// Seeds of every point.
const SEEDS: u64 = 6;
/// Factors on the conductance of all valves.
const FACTORS: [f64; 5] = [0.5, 0.7, 1.0, 1.4, 2.0];
/// Factors on the volume of the tubes.
const TUBES: [f64; 5] = [0.0, 0.5, 1.0, 2.0, 3.0];
/// Bores with the rods that belong to them \[m\].
const BORES_M: [(f64, f64); 3] = [(0.016, 0.006), (0.020, 0.008), (0.025, 0.010)];

/// A statement and what became of it.
#[derive(Debug, Serialize)]
pub struct Prediction {
    /// Short name.
    pub id: &'static str,
    /// What is foretold, with its band.
    pub statement: String,
    /// What was measured.
    pub measured: String,
    /// The number that the verdict hangs on.
    pub value: f64,
    /// Smallest value that agrees.
    pub min: f64,
    /// Largest value that agrees.
    pub max: f64,
    /// Whether it does.
    pub holds: bool,
}

fn prediction(
    id: &'static str,
    statement: impl Into<String>,
    measured: String,
    value: f64,
    (min, max): (f64, f64),
) -> Prediction {
    Prediction {
        id,
        statement: statement.into(),
        measured,
        value,
        min,
        max,
        holds: (min..=max).contains(&value),
    }
}

/// One point of the scaling study.
#[derive(Debug, Clone, Serialize)]
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
#[derive(Debug, Clone, Serialize)]
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
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Line {
    /// Value at zero.
    pub offset: f64,
    /// Slope.
    pub slope: f64,
    /// Coefficient of determination.
    pub r_squared: f64,
}

/// Statements and the studies behind them.
#[derive(Debug, Serialize)]
pub struct Predictions {
    /// All statements.
    pub list: Vec<Prediction>,
    /// Conductance by volume.
    pub scaling: Vec<Scaled>,
    /// Delay over volume/conductance, all points.
    pub line: Line,
    /// Delay over volume/conductance with the robot's own tubes.
    pub own_line: Line,
    /// Bores.
    pub bores: Vec<Bored>,
    /// Stroke time from the held home, valves thrown open \[s\].
    pub stroke_s: f64,
}

/// Least squares.
fn fit(points: &[(f64, f64)]) -> Line {
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

/// Starts of `trial` under its seeds.
fn seeds(trial: &Trial) -> impl Iterator<Item = Trial> + '_ {
    (1..=SEEDS).map(|seed| Trial {
        seed,
        ..trial.clone()
    })
}

fn never() -> SimError {
    SimError::simulation(
        "a start from home never came while testing a prediction",
        "the load may exceed what the cylinder can move; see --load",
    )
}

/// Mean delays of several trials, each under all seeds.
fn delays(trials: &[Trial], bar: &ProgressBar) -> Result<Vec<f64>, SimError> {
    let all: Vec<Trial> = trials.iter().flat_map(seeds).collect();
    bar.inc_length(all.len() as u64);
    let outcomes = run_all(&all, bar)?;
    let means = outcomes.chunks(SEEDS as usize).map(mean_delay);
    means.collect::<Option<Vec<f64>>>().ok_or_else(never)
}

fn home(axis: &AxisParams) -> Trial {
    Trial::new(axis, Law::Paper, Start::HomeHeld, 1)
}

/// The whole stroke from the held home with the valves thrown open.
fn thrown(axis: &AxisParams) -> Result<Outcome, SimError> {
    let trial = Trial {
        thrown: true,
        ..home(axis)
    };
    let outcomes = run_all(&[trial], &ProgressBar::hidden())?;
    outcomes.into_iter().next().ok_or_else(never)
}

/// Delay against volume and conductance.
fn scaling(axis: &AxisParams, bar: &ProgressBar) -> Result<Vec<Scaled>, SimError> {
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
    let delays = delays(&trials, bar)?;
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
fn bores(axis: &AxisParams, stroke_s: f64, bar: &ProgressBar) -> Result<Vec<Bored>, SimError> {
    let base_m = axis.cylinder.bore_m;
    let mut rows = Vec::new();
    for scaled in [false, true] {
        for (bore_m, rod_m) in BORES_M {
            let mut at = axis.clone();
            let c = &mut at.cylinder;
            (c.bore_m, c.rod_m) = (bore_m, rod_m);
            if scaled {
                let area = (bore_m / base_m).powi(2);
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
            }
            let given = at.cylinder.vent_valve.flow.conductance_m3_s_pa;
            let with = |conductance_m3_s_pa: f64| {
                let mut p = at.clone();
                p.cylinder.fill_valve.flow.conductance_m3_s_pa = conductance_m3_s_pa;
                p.cylinder.vent_valve.flow.conductance_m3_s_pa = conductance_m3_s_pa;
                p
            };
            // Bisection: the stroke takes longer the smaller the valves.
            let (mut low, mut high) = (0.3 * given, 4.0 * given);
            for _ in 0..12 {
                let middle = 0.5 * (low + high);
                let time_s = thrown(&with(middle))?.travel_s;
                if time_s.is_none_or(|t| t > stroke_s) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            let fitted = with(0.5 * (low + high));
            let stroke_s = thrown(&fitted)?.travel_s.ok_or_else(never)?;
            let delay = delays(&[home(&fitted)], bar)?;
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
fn spread(bores: &[Bored], scaled: bool) -> f64 {
    let list = bores.iter().filter(|b| b.scaled == scaled);
    let (least, most) = list.fold((f64::INFINITY, 0.0_f64), |(least, most), b| {
        (least.min(b.delay_s), most.max(b.delay_s))
    });
    most / least - 1.0
}

/// Tests all of them.
///
/// # Errors
/// [`SimError::Simulation`] if the axis cannot be simulated or does not move.
pub fn measure(
    axis: &AxisParams,
    starts: &Starts,
    notice: &Notice,
    bar: &ProgressBar,
) -> Result<Predictions, SimError> {
    let prepared = |before: Before| Trial {
        before,
        ..home(axis)
    };
    let hands = delays(&[prepared(Before::Vented), prepared(Before::Balanced)], bar)?;
    let scaling = scaling(axis, bar)?;
    let points = |tubes: &[f64]| -> Vec<(f64, f64)> {
        let of = scaling.iter().filter(|s| tubes.contains(&s.tube));
        of.map(|s| (s.ratio_s_pa, s.delay_s)).collect()
    };
    let (line, own_line) = (fit(&points(&TUBES)), fit(&points(&[1.0])));
    let stroke_s = thrown(axis)?.travel_s.ok_or_else(never)?;
    let bores = bores(axis, stroke_s, bar)?;

    let of = |law, start| {
        starts
            .of(law, start)
            .map_or((f64::NAN, 0.0), |d| (d.median_s, d.peak_m_s))
    };
    let (home_s, peak_m_s) = of(Law::Paper, Start::HomeHeld);
    let rests = [Start::MidExtend, Start::MidRetract].map(|s| of(Law::Paper, s).0);
    let rest_s = 0.5 * (rests[0] + rests[1]);
    let reversal_s = of(Law::Paper, Start::Reversal).0;
    let at = |factor: f64, tube: f64| {
        let found = scaling
            .iter()
            .find(|s| s.factor == factor && s.tube == tube);
        found.map_or(f64::NAN, |s| s.delay_s)
    };
    let with_c = at(0.5, 1.0) / at(2.0, 1.0);
    let growing = FACTORS
        .iter()
        .all(|f| TUBES.windows(2).all(|w| at(*f, w[0]) < at(*f, w[1])));
    let announced = |notice_s: f64| {
        notice
            .of(Law::Default, Start::HomeHeld)
            .find(|r| r.notice_s == notice_s)
            .and_then(|r| r.median_s)
            .unwrap_or(f64::NAN)
    };
    let gain_s = announced(0.0) - announced(0.4);
    let list = vec![
        prediction(
            "explained",
            format!(
                "from the held home the paper's law starts after {PAPER_DELAY_S} ± {PAPER_BAND_S} s"
            ),
            format!("median {home_s:.3} s"),
            home_s,
            (PAPER_DELAY_S - PAPER_BAND_S, PAPER_DELAY_S + PAPER_BAND_S),
        ),
        prediction(
            "stroke time",
            "… with the same parameters the stroke takes about 1 s (0.85 to 1.15 s)",
            format!("{stroke_s:.3} s for 99 % of the stroke, valves thrown open"),
            stroke_s,
            (0.85, 1.15),
        ),
        prediction(
            "speed",
            "… and the speed stays below 0.4 m/s",
            format!("largest {peak_m_s:.3} m/s"),
            peak_m_s,
            (0.0, 0.4),
        ),
        prediction(
            "vented before",
            "with the counter chamber vented before, the delay falls to about 0.05 s (0.03 to 0.07 s)",
            format!("{:.3} s", hands[0]),
            hands[0],
            (0.03, 0.07),
        ),
        prediction(
            "balanced before",
            "with both chambers balanced before, the delay falls to about 0.05 s (0.03 to 0.07 s)",
            format!("{:.3} s", hands[1]),
            hands[1],
            (0.03, 0.07),
        ),
        prediction(
            "1/C",
            "the delay grows in proportion to 1/C: R² at least 0.98 over C × 0.5 to 2 …",
            format!("R² {:.4}", own_line.r_squared),
            own_line.r_squared,
            (0.98, 1.0),
        ),
        prediction(
            "offset",
            "… and what is left at 1/C = 0 is switching, wave and inertia: 0 to 0.05 s",
            format!("{:.3} s", own_line.offset),
            own_line.offset,
            (0.0, 0.05),
        ),
        prediction(
            "volume",
            "the delay grows with the volume of the tubes, at every C (1: yes)",
            format!(
                "tubes × 0, 1, 3: {:.3}, {:.3}, {:.3} s",
                at(1.0, 0.0),
                at(1.0, 1.0),
                at(1.0, 3.0)
            ),
            f64::from(u8::from(growing)),
            (1.0, 1.0),
        ),
        prediction(
            "V/C",
            "one straight line in (stroke volume + tube)/C holds for all of them: R² at least 0.98",
            format!(
                "R² {:.4} over {} points: a tube counts for more than its volume, for it adds to both chambers",
                line.r_squared,
                scaling.len()
            ),
            line.r_squared,
            (0.98, 1.0),
        ),
        prediction(
            "in-stroke",
            "moves from a rest inside the stroke start 2 to 4 times as fast as from the held home",
            format!(
                "{:.2} times ({rest_s:.3} s); reversals {:.1} times ({reversal_s:.3} s)",
                home_s / rest_s,
                home_s / reversal_s
            ),
            home_s / rest_s,
            (2.0, 4.0),
        ),
        prediction(
            "bore, tube as it is",
            "at a given stroke time the delay hardly depends on the bore: 16 to 25 mm within 20 %",
            bore_text(&bores, false),
            spread(&bores, false),
            (0.0, 0.2),
        ),
        prediction(
            "bore, scaled",
            "… within 20 % when tube, dead volume and friction grow with the area, as the formula supposes",
            bore_text(&bores, true),
            spread(&bores, true),
            (0.0, 0.2),
        ),
        prediction(
            "look-ahead",
            "venting ahead of an announced move gains 0.15 to 0.2 s from the held home (default law, notice 0.4 s)",
            format!(
                "{gain_s:.3} s: {:.3} s without, {:.3} s with notice, medians",
                announced(0.0),
                announced(0.4)
            ),
            gain_s,
            (0.15, 0.2),
        ),
        prediction(
            "rival: filter",
            "were it the latency of a filter, every kind of move would be delayed alike: largest over smallest median below 1.2",
            format!(
                "{:.1} ({home_s:.3} s from home, {reversal_s:.3} s in reversal)",
                home_s / reversal_s
            ),
            home_s / reversal_s,
            (1.0, 1.2),
        ),
        prediction(
            "rival: transport",
            "were it a transport delay, it would not depend on C: ratio of the delays at half and double C below 1.2",
            format!("{with_c:.2}"),
            with_c,
            (0.83, 1.2),
        ),
    ];
    Ok(Predictions {
        list,
        scaling,
        line,
        own_line,
        bores,
        stroke_s,
    })
}

fn bore_text(bores: &[Bored], scaled: bool) -> String {
    let parts: Vec<String> = bores
        .iter()
        .filter(|b| b.scaled == scaled)
        .map(|b| format!("{:.0} mm {:.3} s", b.bore_m * 1e3, b.delay_s))
        .collect();
    format!("{}: {:.0} %", parts.join(", "), 1e2 * spread(bores, scaled))
}

impl Predictions {
    /// A prediction by its name.
    #[must_use]
    pub fn of(&self, id: &str) -> Option<&Prediction> {
        self.list.iter().find(|p| p.id == id)
    }
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
