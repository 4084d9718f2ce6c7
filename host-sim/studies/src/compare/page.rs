//! The page: one self-contained file in the style of a run's report.

use minijinja::{Value, context};

use super::case::MARGIN;
use super::{Comparison, Move, Row, Variation};
use crate::StudyError;
use crate::bench::Kind;
use wheeleg_report::{page, pictures, plot::Figure, stats};

const TEMPLATE: &str = include_str!("page.html");

/// Bars that cells are coloured by: error at rest and overshoot of one factor at a
/// time, overshoot of combinations \[mm\].
const ERROR_MM: f64 = 0.5;
const OVERSHOOT_MM: f64 = 3.0;
const COMBINED_OVERSHOOT_MM: f64 = 6.0;

/// A number, or a dash.
pub fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(
        || "–".to_owned(),
        |v| {
            let text = format!("{v:.digits$}");
            // No minus sign on zero.
            if text
                .trim_start_matches('-')
                .chars()
                .all(|c| c == '0' || c == '.')
            {
                text.trim_start_matches('-').to_owned()
            } else {
                text.replace('-', "−")
            }
        },
    )
}

/// The largest of the values; `None` if one is missing or there is none.
fn largest<'a>(
    rows: impl Iterator<Item = &'a Row>,
    value: impl Fn(&Row) -> Option<f64>,
) -> Option<f64> {
    let all: Option<Vec<f64>> = rows.map(value).collect();
    all?.into_iter().reduce(f64::max)
}

fn median<'a>(
    rows: impl Iterator<Item = &'a Row>,
    value: impl Fn(&Row) -> Option<f64>,
) -> Option<f64> {
    let all: Option<Vec<f64>> = rows.map(value).collect();
    stats::median(&all?)
}

impl Comparison {
    /// The table of an axis as on its sheet: a name and its cells per controller.
    #[must_use]
    pub fn table(&self, axis: &str) -> Vec<(Kind, Vec<String>)> {
        self.options
            .kinds
            .iter()
            .map(|kind| {
                let rows = |motion| self.nominal(axis, *kind, motion);
                let error = |r: &Row| r.figures.steady_error_mm.map(f64::abs);
                let of = |motion, digits, value: fn(&Row) -> Option<f64>| {
                    number(largest(rows(motion), value), digits)
                };
                let cycles = self.rows.iter().filter(|r| {
                    r.case.axis == axis
                        && r.case.controller == *kind
                        && r.case.variation == "nominal"
                        && r.figures.limit_cycle == Some(true)
                });
                let large = Move::Step100;
                let settle = |r: &Row| r.figures.settle_s;
                let cells = vec![
                    number(largest(rows(large), error), 2),
                    number(largest(rows(Move::Step20), error), 2),
                    of(large, 2, |r| r.figures.overshoot_mm),
                    of(large, 3, |r| r.figures.rise_s),
                    number(median(rows(large), settle), 3),
                    number(largest(rows(large), settle), 3),
                    number(median(rows(large), |r| r.figures.ratio_to_bound), 2),
                    of(Move::SCurve, 2, |r| r.figures.worst_mm),
                    of(Move::SCurve, 2, |r| r.figures.rms_mm),
                    of(Move::Sine, 2, |r| r.figures.worst_mm),
                    of(large, 0, |r| r.figures.switches_per_s),
                    of(Move::Hold, 0, |r| r.figures.rest_switches.map(|n| n as f64)),
                    of(large, 2, |r| r.figures.air_nl),
                    of(Move::Contact, 2, |r| r.figures.recovery_s),
                    of(Move::ContactHelped, 2, |r| r.figures.recovery_s),
                    cycles.count().to_string(),
                ];
                (*kind, cells)
            })
            .collect()
    }

    /// Feasible cases in which the supervision latched a fault: no fault was put in,
    /// so each is a false alarm.
    pub fn false_alarms(&self) -> impl Iterator<Item = &Row> + Clone {
        self.rows.iter().filter(|r| !r.figures.faults.is_empty())
    }

    /// Scenes that are not feasible, each once: variation and margin.
    #[must_use]
    pub fn infeasible(&self) -> Vec<(&str, &str, f64)> {
        let mut list: Vec<(&str, &str, f64)> = Vec::new();
        for row in self.rows.iter().filter(|r| !r.case.feasible) {
            let entry = (
                row.case.axis.as_str(),
                row.case.variation.as_str(),
                row.case.static_margin,
            );
            if !list.contains(&entry) {
                list.push(entry);
            }
        }
        list
    }
}

/// Head of [`Comparison::table`].
pub(super) const COLUMNS: [&str; 16] = [
    "error 100 mm [mm]",
    "error 20 mm [mm]",
    "overshoot [mm]",
    "rise [s]",
    "settled, median [s]",
    "settled, worst [s]",
    "ratio to bound",
    "S-curve worst [mm]",
    "S-curve RMS [mm]",
    "sinusoid worst [mm]",
    "switches per s",
    "switches at rest, 10 s",
    "air per move [l ANR]",
    "recovery, against [s]",
    "recovery, helped [s]",
    "limit cycles",
];

/// A cell of the factor table: error and overshoot of a step, coloured by the bars.
fn cell(row: Option<&Row>, motion: Move) -> Value {
    let Some(row) = row else {
        return context! { text => "–", class => "" };
    };
    let f = &row.figures;
    if !row.case.feasible {
        return context! { text => "infeasible", class => "info" };
    }
    let cycle = f.limit_cycle == Some(true) || f.stopped == Some(true);
    let note = match (f.stopped, f.limit_cycle) {
        (Some(true), _) => " stopped",
        (_, Some(true)) => " cycle",
        _ => "",
    };
    let (text, good) = if motion == Move::SCurve {
        let good = f.worst_mm.is_some_and(|w| w <= 1.5);
        (number(f.worst_mm, 1), good)
    } else {
        let error = f.steady_error_mm.map(f64::abs);
        let good = error.is_some_and(|e| e <= ERROR_MM)
            && f.overshoot_mm.is_some_and(|o| o <= OVERSHOOT_MM);
        (
            format!("{} / {}", number(error, 2), number(f.overshoot_mm, 1)),
            good,
        )
    };
    context! {
        text => format!("{text}{note}"),
        class => if good && !cycle { "pass" } else { "fail" },
    }
}

pub(super) fn render(
    comparison: &Comparison,
    figures: &[(Figure, String)],
) -> Result<String, StudyError> {
    let options = &comparison.options;
    let kinds: Vec<&str> = options.kinds.iter().map(|k| k.name()).collect();
    let axes: Vec<Value> = comparison
        .axes
        .iter()
        .map(|axis| {
            let name = axis.config.name.as_str();
            let bound = |b: Option<[f64; 2]>| {
                b.map_or_else(
                    || "not searched".to_owned(),
                    |[back, out]| format!("{back:.3} s retracting, {out:.3} s extending"),
                )
            };
            let table: Vec<Value> = comparison
                .table(name)
                .into_iter()
                .map(|(kind, cells)| context! { name => kind.name(), cells => cells })
                .collect();
            context! {
                name => name,
                description => &*axis.config.description,
                bound_large => bound(axis.bound_s[0]),
                bound_small => bound(axis.bound_s[1]),
                table => table,
                factors => factors(comparison, name),
                combined => combined(comparison, name),
                hash => hash(axis),
            }
        })
        .collect();
    let alarms: Vec<Value> = comparison
        .false_alarms()
        .map(|r| context! { id => &*r.case.id, faults => &*r.figures.faults })
        .collect();
    let infeasible: Vec<Value> = comparison
        .infeasible()
        .into_iter()
        .map(|(axis, variation, margin)| {
            context! { axis => axis, variation => variation, margin => format!("{margin:.2}") }
        })
        .collect();
    let values = context! {
        stopped => comparison.stopped.as_ref().map(ToString::to_string),
        version => env!("CARGO_PKG_VERSION"),
        kinds => kinds,
        columns => COLUMNS,
        axes => axes,
        figures => pictures(figures),
        cases => comparison.rows.len(),
        played => comparison.rows.iter().filter(|r| r.case.feasible).count(),
        alarms => alarms,
        infeasible => infeasible,
        margin => MARGIN,
        seeds => options.seeds,
        seed => options.seed,
        last_seed => options.seed + options.seeds - 1,
        combinations => options.combinations,
    };
    Ok(page(TEMPLATE, values)?)
}

/// Fingerprint of an axis: name and parameters.
fn hash(axis: &super::ComparedAxis) -> String {
    let text = serde_json::to_string(&axis.config.axis).unwrap_or_default();
    blake3::hash(text.as_bytes()).to_hex().to_string()
}

/// One line per factor and move that was played, one cell per controller.
fn factors(comparison: &Comparison, axis: &str) -> Vec<Value> {
    let mut lines: Vec<(&str, Move)> = Vec::new();
    for row in comparison.rows.iter().filter(|r| r.case.axis == axis) {
        let c = &row.case;
        let shown = matches!(c.motion, Move::Step100 | Move::Step20 | Move::SCurve);
        let varied = !c.variation.starts_with("combination=") && c.variation != "nominal";
        if shown && varied && !lines.contains(&(c.variation.as_str(), c.motion)) {
            lines.push((c.variation.as_str(), c.motion));
        }
    }
    lines.sort_by_key(|(_, motion)| *motion);
    lines
        .into_iter()
        .map(|(variation, motion)| {
            let cells = comparison.options.kinds.iter().map(|kind| {
                let row = comparison.rows.iter().find(|r| {
                    let c = &r.case;
                    c.axis == axis
                        && c.variation == variation
                        && c.motion == motion
                        && c.controller == *kind
                });
                cell(row, motion)
            });
            context! {
                variation => with_unit(variation),
                motion => motion.name(),
                cells => cells.collect::<Vec<_>>(),
            }
        })
        .collect()
}

fn with_unit(variation: &str) -> String {
    match variation.parse() {
        Ok(Variation::Load(x)) => format!("load {:+.0} %", 100.0 * x).replace('-', "−"),
        Ok(Variation::Mass(x)) => format!("mass {x} kg"),
        Ok(Variation::Supply(x)) => format!("supply {x} bar"),
        Ok(Variation::Friction(x)) => format!("friction × {x}"),
        Ok(Variation::Delay(x)) => format!("valve delay × {x}"),
        Ok(Variation::Spread(x)) => format!("valves ± {:.0} %", 100.0 * x),
        Ok(Variation::Noise(x)) => format!("noise × {x}"),
        _ => variation.to_owned(),
    }
}

/// One line per controller: how many combinations keep the bars, and the worst.
fn combined(comparison: &Comparison, axis: &str) -> Vec<Value> {
    comparison
        .options
        .kinds
        .iter()
        .filter_map(|kind| {
            let rows = || comparison.combined(axis, *kind);
            let count = rows().count();
            let cycles = rows().filter(|r| r.figures.limit_cycle == Some(true)).count();
            let kept = rows().filter(|r| keeps(r)).count();
            (count > 0).then(|| {
                context! {
                    name => kind.name(),
                    kept => kept,
                    count => count,
                    class => if kept == count { "pass" } else { "fail" },
                    error => number(largest(rows(), |r| r.figures.steady_error_mm.map(f64::abs)), 2),
                    overshoot => number(largest(rows(), |r| r.figures.overshoot_mm), 1),
                    first => number(largest(rows(), |r| r.figures.first_overshoot_mm), 1),
                    cycles => cycles,
                    stopped => rows().filter(|r| r.figures.stopped == Some(true)).count(),
                }
            })
        })
        .collect()
}

fn keeps(row: &Row) -> bool {
    let f = &row.figures;
    f.steady_error_mm.is_some_and(|e| e.abs() <= ERROR_MM)
        && f.overshoot_mm.is_some_and(|o| o <= COMBINED_OVERSHOOT_MM)
        && f.limit_cycle == Some(false)
        && f.stopped == Some(false)
}
