//! Tests of the explanation's predictions, and of its rivals.
//!
//! If the delay is a pressure swap (the counter chamber must vent and the drive chamber fill before the
//! piston can move), then it must depend on pressures, volumes and conductance in known ways. Each statement
//! below was made before the plant existed; it contains its band, and the band decides the verdict.

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_plant::axis::AxisParams;

use super::preview::Preview;
use super::scaling::{
    Bored, FACTORS, Line, SEEDS, Scaled, TUBES, Work, bores, delays, fit, home, never, scaling,
    spread, thrown,
};
use super::starts::Starts;
use super::trial::{Before, Law, Start, Trial};
use super::{PAPER_BAND_S, PAPER_DELAY_S};
use crate::study::{Ended, Progress};

/// A statement and its result.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Prediction {
    /// Short name.
    pub id: &'static str,
    /// The prediction, with its band.
    pub statement: String,
    /// The measurement.
    pub measured: String,
    /// The number that decides the verdict.
    pub value: f64,
    /// Smallest value that agrees.
    pub min: f64,
    /// Largest value that agrees.
    pub max: f64,
    /// Whether it does.
    pub holds: bool,
    /// Whether it predicts the effect of another cause: our explanation is right if it does not hold.
    #[serde(skip)]
    pub rival: bool,
}

impl Prediction {
    /// The same for another cause.
    fn of_a_rival(self) -> Self {
        Self {
            rival: true,
            ..self
        }
    }
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
        rival: false,
    }
}

/// Statements and the studies behind them.
#[derive(Debug, Serialize, JsonSchema)]
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

/// Tests all of them.
///
/// # Errors
/// [`Ended`] if the axis cannot be simulated or does not move, or the study is stopped.
pub fn measure(
    axis: &AxisParams,
    starts: &Starts,
    preview: &Preview,
    seeds: u32,
    progress: &Progress,
) -> Result<Predictions, Ended> {
    let work = Work {
        seeds: seeds.min(SEEDS),
        progress,
    };
    let prepared = |before: Before| Trial {
        before,
        ..home(axis)
    };
    let valve_override = delays(
        &[prepared(Before::Vented), prepared(Before::Balanced)],
        work,
    )?;
    let scaling = scaling(axis, work)?;
    let points = |tubes: &[f64]| -> Vec<(f64, f64)> {
        let of = scaling.iter().filter(|s| tubes.contains(&s.tube));
        of.map(|s| (s.ratio_s_pa, s.delay_s)).collect()
    };
    let (line, own_line) = (fit(&points(&TUBES)), fit(&points(&[1.0])));
    let stroke_s = thrown(axis, progress)?.travel_s.ok_or_else(never)?;
    let bores = bores(axis, stroke_s, work)?;

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
    let announced = |preview_s: f64| {
        preview
            .of(Law::Default, Start::HomeHeld)
            .find(|r| r.preview_s == preview_s)
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
            format!("{:.3} s", valve_override[0]),
            valve_override[0],
            (0.03, 0.07),
        ),
        prediction(
            "balanced before",
            "with both chambers balanced before, the delay falls to about 0.05 s (0.03 to 0.07 s)",
            format!("{:.3} s", valve_override[1]),
            valve_override[1],
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
            "venting ahead of an announced move gains 0.15 to 0.2 s from the held home (default law, preview 0.4 s)",
            format!(
                "{gain_s:.3} s: {:.3} s without, {:.3} s with preview, medians",
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
        )
        .of_a_rival(),
        prediction(
            "rival: transport",
            "were it a transport delay, it would not depend on C: ratio of the delays at half and double C below 1.2",
            format!("{with_c:.2}"),
            with_c,
            (0.83, 1.2),
        )
        .of_a_rival(),
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
