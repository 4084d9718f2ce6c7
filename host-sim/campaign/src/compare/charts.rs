//! The pictures of a comparison.

use wheeleg_report::number::listed;
use wheeleg_report::plot::Colour;

use super::{ComparedAxis, Comparison};
use wheeleg_report::plot::{Bars, Column, Content, Figure, Panel, Series, colour, line};
use wheeleg_studies::axis_sim::Kind;
use wheeleg_studies::axis_sim::suite::LEAD_S;
use wheeleg_studies::compare::{CONTACT_S, Move, Row, Sizes, panel};

type Points = Vec<(f64, f64)>;

/// One colour per controller.
fn colour_of(kind: Kind) -> Colour {
    match kind {
        Kind::OnOff => colour::RAW,
        Kind::PwmP => colour::AXES[4],
        Kind::PwmPid => colour::AXES[1],
        Kind::FuzzyPd => colour::SECOND,
        Kind::FuzzyId => colour::AXES[7],
        Kind::Sliding => colour::THIRD,
        Kind::Predictive => colour::AXES[2],
    }
}

/// All figures of the page; the first is the summary of the first axis.
pub(super) fn figures(comparison: &Comparison) -> Vec<Figure> {
    let mut list = Vec::new();
    if let Some(axis) = comparison.axes.first() {
        list.extend(overview(comparison, axis));
    }
    for axis in &comparison.axes {
        list.extend(steps(comparison, axis));
        list.extend(tracking(comparison, axis));
        list.extend(contact(comparison, axis));
        list.extend(spread(comparison, axis));
    }
    list
}

impl Comparison {
    /// The overlay of every controller for a move, as points of `value(reference,
    /// stroke)` over time.
    fn overlay(&self, axis: &str, motion: Move, value: fn(f64, f64) -> f64) -> Vec<Series> {
        self.overlays
            .iter()
            .filter(|o| o.axis == axis && o.motion == motion)
            .map(|o| {
                let width = if o.kind == Kind::Predictive { 3 } else { 2 };
                let points = o.points.iter().map(|[t, r, x]| (*t, value(*r, *x)));
                line(o.kind.name(), colour_of(o.kind), width, points.collect())
            })
            .collect()
    }

    fn reference(&self, axis: &str, motion: Move) -> Points {
        let found = self
            .overlays
            .iter()
            .find(|o| o.axis == axis && o.motion == motion);
        found.map_or_else(Points::new, |o| {
            o.points.iter().map(|[t, r, _]| (*t, *r)).collect()
        })
    }
}

/// End of the panels of a step \[s\], the range shown about its target \[mm\], and its last part, in which a
/// curve should be at rest \[s\].
const STEP_END_S: f64 = 1.5;
const ABOUT_MM: f64 = 4.0;
const AT_REST_S: f64 = 0.5;

/// Whether a curve leaves the panel about its target when it should be at rest.
fn is_beyond(series: &Series) -> bool {
    let at_rest = STEP_END_S - AT_REST_S..=STEP_END_S;
    let mut rest = series.points.iter().filter(|(t, _)| at_rest.contains(t));
    rest.any(|(_, mm)| mm.abs() > ABOUT_MM)
}

/// The large step, and its end enlarged: two panels.
fn step_panels(comparison: &Comparison, axis: &str) -> Option<Vec<Panel>> {
    let step = comparison.overlay(axis, Move::Step100, |_, x| x);
    if step.is_empty() {
        return None;
    }
    let error = comparison.overlay(axis, Move::Step100, |r, x| x - r);
    // A curve that swings through the panel to its end hides the others.
    let (error, swinging): (Vec<Series>, Vec<Series>) =
        error.into_iter().partition(|series| !is_beyond(series));
    let left_out: Vec<String> = swinging.into_iter().map(|series| series.label).collect();
    let title = match left_out.as_slice() {
        [] => "The same about its target".to_owned(),
        names => format!(
            "The same about its target, without what is beyond ±{ABOUT_MM} mm to the end ({})",
            listed(names)
        ),
    };
    let mut error = panel(
        &title,
        "[mm]; ±1 mm counts as settled",
        STEP_END_S,
        error,
        Some((-ABOUT_MM, ABOUT_MM)),
        &[-1.0, 1.0],
    );
    error.name_only(0..0);
    Some(vec![
        panel("Stroke", "[mm]", STEP_END_S, step, None, &[]),
        error,
    ])
}

/// The figure in the README: the step of the first axis, and bars.
fn overview(comparison: &Comparison, axis: &ComparedAxis) -> Option<Figure> {
    let name = axis.config.name.as_str();
    let mut panels = step_panels(comparison, name)?;
    let kinds = &comparison.options.kinds;
    let worst = |motion: Move, value: fn(&Row) -> Option<f64>| -> Vec<Option<f64>> {
        kinds
            .iter()
            .map(|kind| {
                let rows = comparison.nominal(name, *kind, motion);
                let all: Option<Vec<f64>> = rows.map(value).collect();
                all?.into_iter().reduce(f64::max)
            })
            .collect()
    };
    let column =
        |title: &str, full: f64, digits: usize, missing: &str, values: Vec<Option<f64>>| Column {
            title: title.to_owned(),
            texts: values
                .iter()
                .map(|v| v.map_or_else(|| missing.to_owned(), |v| format!("{v:.digits$}")))
                .collect(),
            // A bar without a value has full length.
            values: values.iter().map(|v| Some(v.unwrap_or(full))).collect(),
            full,
            limit: None,
        };
    let bars = Bars {
        rows: kinds
            .iter()
            .map(|k| (k.name().to_owned(), colour_of(*k)))
            .collect(),
        columns: vec![
            column(
                "settled ±1 mm [s]",
                2.5,
                2,
                "never",
                worst(Move::Step100, |r| r.figures.settle_s),
            ),
            column(
                "rest error [mm]",
                5.0,
                2,
                "",
                worst(Move::Step100, |r| r.figures.steady_error_mm.map(f64::abs)),
            ),
            column(
                "S-curve, worst [mm]",
                20.0,
                1,
                "",
                worst(Move::SCurve, |r| r.figures.worst_mm),
            ),
            column(
                "switches at rest",
                200.0,
                0,
                "",
                worst(Move::Hold, |r| r.figures.rest_switches.map(|n| n as f64)),
            ),
        ],
    };
    panels.push(Panel::new(
        "Worst of all seeds and both directions; switches of four valves in 10 s",
        (0.0, 1.0),
        bars.height(),
        Content::Bars(bars),
    ));
    Some(Figure {
        id: "comparison".to_owned(),
        title: format!("Overview: {name}, 100 mm step"),
        caption: format!(
            "{}. Every law runs on the joint board's own code, with one potentiometer and four on/off valves; gains are derived from the axis's data sheet.",
            axis.config.description
        ),
        panels,
    })
}

fn steps(comparison: &Comparison, axis: &ComparedAxis) -> Option<Figure> {
    let name = axis.config.name.as_str();
    let mut panels = step_panels(comparison, name).unwrap_or_default();
    let small = comparison.overlay(name, Move::Step20, |r, x| x - r);
    if !small.is_empty() {
        panels.push(panel(
            "Small step about its target",
            "[mm]",
            1.5,
            small,
            Some((-4.0, 4.0)),
            &[-1.0, 1.0],
        ));
    }
    if panels.is_empty() {
        return None;
    }
    Some(Figure {
        id: format!("steps-{name}"),
        title: format!("Steps on {name}"),
        caption: "The last measured move of the first seed, after the learning move. Errors are stroke less reference; limit lines at ±1 mm.".to_owned(),
        panels,
    })
}

fn tracking(comparison: &Comparison, axis: &ComparedAxis) -> Option<Figure> {
    let name = axis.config.name.as_str();
    let mut panels = Vec::new();
    for (motion, title, end_s) in [
        (Move::SCurve, "S-curve: error", 1.95),
        (Move::Sine, "Sinusoid: error", 4.95),
    ] {
        let series = comparison.overlay(name, motion, |r, x| x - r);
        if !series.is_empty() {
            panels.push((
                motion,
                panel(
                    title,
                    "[mm]",
                    end_s,
                    series,
                    Some((-15.0, 15.0)),
                    &[-1.5, 1.5],
                ),
            ));
        }
    }
    // One time axis for all panels: that of the longest.
    let end_s = panels.iter().map(|(_, p)| p.x_range.1).reduce(f64::max)?;
    let mut stacked = Vec::new();
    for (motion, mut p) in panels {
        p.x_range.1 = end_s;
        stacked.push(p);
        let reference = comparison.reference(name, motion);
        let reference = vec![line("", colour::INK, 2, reference)];
        let mut p = panel("Its reference", "[mm]", end_s, reference, None, &[]);
        p.height = 110;
        stacked.push(p);
    }
    Some(Figure {
        id: format!("tracking-{name}"),
        title: format!("Tracking on {name}"),
        caption: "Stroke less reference; limit lines at ±1.5 mm; errors beyond ±15 mm lie beyond the edge.".to_owned(),
        panels: stacked,
    })
}

fn contact(comparison: &Comparison, axis: &ComparedAxis) -> Option<Figure> {
    let name = axis.config.name.as_str();
    let mut panels = Vec::new();
    for (motion, title) in [
        (
            Move::Contact,
            "Load against the move lost and found: stroke",
        ),
        (
            Move::ContactHelped,
            "Load with the move lost and found: stroke",
        ),
    ] {
        let series = comparison.overlay(name, motion, |_, x| x);
        if !series.is_empty() {
            let mut p = panel(title, "[mm]", 1.5, series, None, &[]);
            // From the start of the motion, like the overlays.
            p.marks = CONTACT_S.map(|t| t - LEAD_S).to_vec();
            panels.push(p);
        }
    }
    let load_n = Sizes::of(&axis.config.axis).contact_n;
    (!panels.is_empty()).then(|| Figure {
        id: format!("contact-{name}"),
        title: format!("Contact on {name}"),
        caption: format!(
            "A load of {load_n} N goes at the first upright mark and is back at the second."
        ),
        panels,
    })
}

/// Errors and overshoots over the random combinations, sorted.
fn spread(comparison: &Comparison, axis: &ComparedAxis) -> Option<Figure> {
    let name = axis.config.name.as_str();
    let sorted = |value: fn(&Row) -> Option<f64>| -> Vec<Series> {
        let kinds = comparison.options.kinds.iter();
        kinds
            .map(|kind| {
                let mut values: Vec<f64> =
                    comparison.combined(name, *kind).filter_map(value).collect();
                values.sort_by(f64::total_cmp);
                let n = values.len() as f64;
                let points = values.iter().enumerate();
                let points = points.map(|(i, v)| (100.0 * (i as f64 + 1.0) / n, *v));
                line(kind.name(), colour_of(*kind), 2, points.collect())
            })
            .filter(|s| !s.points.is_empty())
            .collect()
    };
    let curves = |title: &str, series: Vec<Series>, limit: f64, top: f64| {
        let share = "share of the combinations [%]";
        let content = Content::curves(share, ("[mm]", (0.0, top)), series);
        Panel::new(title, (0.0, 100.0), 220, content.limited(&[limit]))
    };
    let errors = sorted(|r| r.figures.steady_error_mm.map(f64::abs));
    if errors.is_empty() {
        return None;
    }
    Some(Figure {
        id: format!("combinations-{name}"),
        title: format!("Combinations on {name}"),
        caption: "Load, mass, supply, friction and valve delay at random at once, one gain set; sorted, so that a curve shows what share stays below a value. Limit lines at 0.5 and 6 mm.".to_owned(),
        panels: vec![
            curves("Error at rest", errors, 0.5, 5.0),
            curves("Overshoot", sorted(|r| r.figures.overshoot_mm), 6.0, 20.0),
        ],
    })
}
