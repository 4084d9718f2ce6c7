//! The page: one self-contained file in the style of a run's report.

use serde::Serialize;

use super::Comparison;
use wheeleg_report::number::{DASH, counted, fixed, listed, or_dash, p_value, signed};
use wheeleg_report::{Picture, page, pictures, plot::Figure, stats};
use wheeleg_studies::StudyError;
use wheeleg_studies::axis_sim::Kind;
use wheeleg_studies::compare::{
    ERROR_MM, Judged, MARGIN, Move, Quantile, Row, Variation, fault_names, judging_root,
};

const TEMPLATE: &str = include_str!("page.html");

/// Bar for cells: overshoot with one factor at a time \[mm\].
const OVERSHOOT_MM: f64 = 3.0;

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
                    or_dash(largest(rows(motion), value), digits)
                };
                let cycles = self.rows.iter().filter(|r| {
                    r.case.axis == axis
                        && r.case.controller == *kind
                        && r.case.variation == Variation::Nominal
                        && r.figures.limit_cycle == Some(true)
                });
                let large = Move::Step100;
                let settle = |r: &Row| r.figures.settle_s;
                let cells = vec![
                    or_dash(largest(rows(large), error), 2),
                    or_dash(largest(rows(Move::Step20), error), 2),
                    of(large, 2, |r| r.figures.overshoot_mm),
                    of(large, 3, |r| r.figures.rise_s),
                    or_dash(median(rows(large), settle), 3),
                    or_dash(largest(rows(large), settle), 3),
                    or_dash(median(rows(large), |r| r.figures.ratio_to_bound), 2),
                    of(Move::SCurve, 2, |r| r.figures.worst_mm),
                    of(Move::SCurve, 2, |r| r.figures.rms_mm),
                    of(Move::Sine, 2, |r| r.figures.worst_mm),
                    of(large, 0, |r| r.figures.switches_per_s),
                    of(Move::Hold, 0, |r| r.figures.rest_switches.map(|n| n as f64)),
                    of(large, 2, |r| r.figures.air_nl),
                    of(Move::Contact, 2, |r| r.figures.recovery_s),
                    of(Move::ContactHelped, 2, |r| r.figures.recovery_s),
                    cycles.count().to_string(),
                    or_dash(largest(rows(Move::FirstStep), error), 2),
                    of(Move::FirstStep, 2, |r| r.figures.overshoot_mm),
                    or_dash(median(rows(Move::FirstStep), settle), 3),
                ];
                (*kind, cells)
            })
            .collect()
    }

    /// The result, in a sentence: which controller is best, and on what grounds.
    #[must_use]
    pub fn verdict(&self) -> String {
        best(self, &self.judged()).unwrap_or_else(|| supervised(self))
    }

    /// Feasible cases in which the supervision latched a fault: no fault was injected, so each is a false
    /// alarm.
    pub fn false_alarms(&self) -> impl Iterator<Item = &Row> + Clone {
        self.rows.iter().filter(|r| !r.figures.faults.is_empty())
    }

    /// Cases beyond the force available, each once: variation and margin.
    #[must_use]
    pub fn beyond_force(&self) -> Vec<(&str, Variation, f64)> {
        let mut list: Vec<(&str, Variation, f64)> = Vec::new();
        for row in self.rows.iter().filter(|r| !r.case.feasible) {
            let entry = (
                row.case.axis.as_str(),
                row.case.variation,
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
const COLUMNS: [&str; 19] = [
    "error 100 mm [mm]",
    "error 20 mm [mm]",
    "overshoot 100 mm [mm]",
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
    "first step, error [mm]",
    "first step, overshoot [mm]",
    "first step, settled, median [s]",
];

/// Values of the template.
#[derive(Serialize)]
struct Page<'a> {
    /// Why the comparison stopped.
    stopped: Option<String>,
    version: &'static str,
    verdict: String,
    supervised: String,
    kinds: Vec<&'static str>,
    columns: Vec<&'static str>,
    judged_move: Option<&'static str>,
    axes: Vec<Axis<'a>>,
    figures: Vec<Picture<'a>>,
    cases: usize,
    played: usize,
    alarms: Vec<Alarm<'a>>,
    beyond_force: Vec<BeyondForce<'a>>,
    left_out: Vec<String>,
    margin: f64,
    seed: u64,
    last_seed: u64,
    combinations: u64,
    root: u64,
    judges: bool,
}

#[derive(Serialize)]
struct Axis<'a> {
    name: &'a str,
    description: &'a str,
    bound_large: String,
    bound_small: String,
    table: Vec<(&'static str, Vec<String>)>,
    factors: Vec<Factor>,
    combined: Vec<Combined>,
    hash: String,
}

#[derive(Serialize)]
struct Alarm<'a> {
    id: &'a str,
    faults: String,
}

#[derive(Serialize)]
struct BeyondForce<'a> {
    axis: &'a str,
    variation: Variation,
    margin: f64,
}

/// A line of the factor table.
#[derive(Serialize)]
struct Factor {
    variation: String,
    motion: &'static str,
    cells: Vec<Cell>,
}

#[derive(Serialize)]
struct Cell {
    text: String,
    class: &'static str,
}

/// A controller in the table of combinations; each quantile with its bound.
#[derive(Serialize)]
struct Combined {
    name: &'static str,
    kept: u64,
    count: u64,
    /// Upper bound of the probability to miss, one-sided 95 %, per cent.
    missed_at_most: f64,
    error_mm: [String; 2],
    overshoot_mm: [String; 2],
    settle_s: [String; 2],
    first_mm: String,
    cycles: usize,
    stopped: usize,
    paired: Option<String>,
}

impl Combined {
    fn of(comparison: &Comparison, judged: &Judged) -> Self {
        let rows = || comparison.combined(&judged.axis, judged.controller);
        let [_, first] = judged.first_overshoot_mm;
        Self {
            name: judged.controller.name(),
            kept: judged.combinations - judged.missed,
            count: judged.combinations,
            missed_at_most: 100.0 * judged.missed_at_most,
            error_mm: judged.steady_error_mm.map(|q| bounded(q, 2)),
            overshoot_mm: judged.overshoot_mm.map(|q| bounded(q, 1)),
            settle_s: judged.settle_s.map(|q| bounded(q, 2)),
            first_mm: bounded(first, 1),
            cycles: rows()
                .filter(|r| r.figures.limit_cycle == Some(true))
                .count(),
            stopped: rows().filter(|r| r.figures.stopped == Some(true)).count(),
            paired: judged.paired.map(|paired| {
                format!(
                    "{} worse, {} better of {}; p {}",
                    paired.worse,
                    paired.better,
                    paired.pairs,
                    p_value(paired.p)
                )
            }),
        }
    }
}

/// A quantile and its bound, if they exist.
fn bounded(quantile: Quantile, digits: usize) -> String {
    let value = or_dash(quantile.value, digits);
    match quantile.at_most {
        Some(at_most) => format!("{value} ≤ {}", fixed(at_most, digits)),
        None => value,
    }
}

/// A cell of the factor table: error and overshoot of a step, judged by the bars.
fn cell(row: Option<&Row>, motion: Move) -> Cell {
    let cell = |text: &str, class| Cell {
        text: text.to_owned(),
        class,
    };
    let Some(row) = row else {
        return cell(DASH, "");
    };
    let f = &row.figures;
    if !row.case.feasible {
        return cell("beyond the force", "info");
    }
    let cycle = f.limit_cycle == Some(true) || f.stopped == Some(true);
    let note = match (f.stopped, f.limit_cycle) {
        (Some(true), _) => " stopped",
        (_, Some(true)) => " cycle",
        _ => "",
    };
    let (text, good) = if motion == Move::SCurve {
        let good = f.worst_mm.is_some_and(|w| w <= 1.5);
        (or_dash(f.worst_mm, 1), good)
    } else {
        let error = f.steady_error_mm.map(f64::abs);
        let good = error.is_some_and(|e| e <= ERROR_MM)
            && f.overshoot_mm.is_some_and(|o| o <= OVERSHOOT_MM);
        (
            format!("{} / {}", or_dash(error, 2), or_dash(f.overshoot_mm, 1)),
            good,
        )
    };
    let class = if good && !cycle { "pass" } else { "fail" };
    cell(&format!("{text}{note}"), class)
}

pub(super) fn render(
    comparison: &Comparison,
    figures: &[(Figure, String)],
) -> Result<String, StudyError> {
    let options = &comparison.options;
    let bound = |b: Option<[f64; 2]>| {
        b.map_or_else(
            || "not searched".to_owned(),
            |[back, out]| format!("{back:.3} s retracting, {out:.3} s extending"),
        )
    };
    let judged = comparison.judged();
    // Only columns of moves that were played.
    let tables: Vec<_> = (comparison.axes.iter())
        .map(|axis| comparison.table(&axis.config.name))
        .collect();
    let shown: Vec<usize> = (0..COLUMNS.len())
        .filter(|place| {
            let mut lines = tables.iter().flatten();
            lines.any(|(_, cells)| cells[*place] != DASH)
        })
        .collect();
    let axes = comparison.axes.iter().zip(&tables).map(|(axis, table)| {
        let name = axis.config.name.as_str();
        let table = table.iter().map(|(kind, cells)| {
            let cells = shown.iter().map(|place| cells[*place].clone());
            (kind.name(), cells.collect())
        });
        Axis {
            name,
            description: &axis.config.description,
            bound_large: bound(axis.bound_s[0]),
            bound_small: bound(axis.bound_s[1]),
            table: table.collect(),
            factors: factors(comparison, name),
            combined: judged
                .iter()
                .filter(|j| j.axis == name)
                .map(|j| Combined::of(comparison, j))
                .collect(),
            hash: hash(axis),
        }
    });
    let alarms = comparison.false_alarms().map(|r| Alarm {
        id: &r.case.id,
        faults: fault_names(r.figures.faults),
    });
    let beyond_force = comparison.beyond_force().into_iter();
    let beyond_force = beyond_force.map(|(axis, variation, margin)| BeyondForce {
        axis,
        variation,
        margin,
    });
    let played = comparison.rows.iter().filter(|r| r.case.feasible).count();
    let values = Page {
        stopped: comparison.stopped.as_ref().map(ToString::to_string),
        version: env!("CARGO_PKG_VERSION"),
        verdict: comparison.verdict(),
        supervised: supervised(comparison),
        kinds: options.kinds.iter().map(|k| k.name()).collect(),
        columns: shown.iter().map(|place| COLUMNS[*place]).collect(),
        judged_move: options.judged_move().map(Move::name),
        axes: axes.collect(),
        figures: pictures(figures),
        cases: comparison.rows.len(),
        played,
        alarms: alarms.collect(),
        beyond_force: beyond_force.collect(),
        left_out: comparison
            .left_out
            .iter()
            .map(ToString::to_string)
            .collect(),
        margin: MARGIN,
        seed: options.seed,
        last_seed: options.seed + options.seeds - 1,
        combinations: options.combinations,
        root: options.root,
        judges: options.root == judging_root(),
    };
    Ok(page(TEMPLATE, values)?)
}

/// Summary of a controller on all axes.
struct Standing {
    kind: Kind,
    /// Missed random combinations, and played ones.
    missed: u64,
    combinations: u64,
    /// Axes on which the large step of the sheet never settles, and those on which it was played.
    never: usize,
    played: usize,
    /// Its worst settling time on each of the others \[s\].
    settled_s: Vec<f64>,
}

impl Standing {
    fn of(comparison: &Comparison, judged: &[Judged], kind: Kind) -> Self {
        let mut standing = Self {
            kind,
            missed: 0,
            combinations: 0,
            never: 0,
            played: 0,
            settled_s: Vec::new(),
        };
        for one in judged.iter().filter(|one| one.controller == kind) {
            standing.missed += one.missed;
            standing.combinations += one.combinations;
        }
        for axis in &comparison.axes {
            let rows = comparison.nominal(&axis.config.name, kind, Move::Step100);
            let mut rows = rows.filter(|row| row.case.feasible);
            let Some(first) = rows.next() else {
                continue;
            };
            standing.played += 1;
            let all = std::iter::once(first).chain(rows);
            match largest(all, |row| row.figures.settle_s) {
                Some(settled_s) => standing.settled_s.push(settled_s),
                None => standing.never += 1,
            }
        }
        standing
    }

    /// Misses, then steps that never settle, then the time of those that do.
    fn is_better_than(&self, other: &Self) -> bool {
        let sum = |one: &Self| one.settled_s.iter().sum::<f64>();
        let counts = |one: &Self| (one.missed, one.never);
        counts(self) < counts(other) || counts(self) == counts(other) && sum(self) < sum(other)
    }

    /// Its share of missed random combinations, and that of the others; the duration of its step.
    fn grounds(&self, others: &str) -> String {
        let mut grounds = Vec::new();
        if self.combinations > 0 {
            let (missed, all) = (self.missed, self.combinations);
            grounds.push(format!(
                "misses {missed} of {all} random combinations{others}"
            ));
        }
        let least = self.settled_s.iter().copied().reduce(f64::min);
        let most = self.settled_s.iter().copied().reduce(f64::max);
        grounds.extend(least.zip(most).map(|(least, most)| {
            let [least, most] = [least, most].map(|s| fixed(s, 2));
            if least == most {
                format!("settles the large step in {most} s")
            } else {
                format!("settles the large step in {least} to {most} s")
            }
        }));
        grounds.join(" and ")
    }
}

/// The page's first sentence: which controller is best, on what grounds, and which never settle. None if the
/// played cases do not show it, or some controllers have played fewer than others.
fn best(comparison: &Comparison, judged: &[Judged]) -> Option<String> {
    if comparison.stopped.is_some() {
        return None;
    }
    let kinds = comparison.options.kinds.iter();
    let all: Vec<Standing> = kinds
        .map(|kind| Standing::of(comparison, judged, *kind))
        .filter(|standing| standing.played > 0)
        .collect();
    let mut best = all.first()?;
    for standing in &all {
        if standing.is_better_than(best) {
            best = standing;
        }
    }
    let others = all.iter().filter(|standing| standing.kind != best.kind);
    let missed = others.clone().map(|standing| standing.missed);
    let others = match (missed.clone().min(), missed.max()) {
        (Some(least), Some(_)) if all.len() == 2 => format!(" (the other misses {least})"),
        (Some(least), Some(most)) if least == most => format!(" (the others miss {least})"),
        (Some(least), Some(most)) => format!(" (the others miss {least} to {most})"),
        _ => String::new(),
    };
    let grounds = Some(best.grounds(&others)).filter(|grounds| !grounds.is_empty())?;
    let axes = comparison.axes.len();
    let never = all.iter().filter(|standing| standing.never > 0);
    let never: Vec<String> = never
        .map(|standing| match axes {
            1 => standing.kind.name().to_owned(),
            _ => format!(
                "{} on {} of {axes} axes",
                standing.kind.name(),
                standing.never
            ),
        })
        .collect();
    let never = match never.len() {
        0 => String::new(),
        1 if axes == 1 => format!("; {} never settles", listed(&never)),
        _ if axes == 1 => format!("; {} never settle", listed(&never)),
        _ => format!("; never settle: {}", listed(&never)),
    };
    let name = best.kind.name();
    Some(if all.len() == 1 {
        format!("The law {name} {grounds}{never}.")
    } else {
        format!("Best is {name}: it {grounds}{never}.")
    })
}

/// Faults that the supervision latched.
fn supervised(comparison: &Comparison) -> String {
    let played = comparison.rows.iter().filter(|r| r.case.feasible).count();
    let controllers = comparison.options.kinds.len();
    let what = format!(
        "{} of {} on {}",
        counted(played, "case", "cases"),
        counted(controllers, "controller", "controllers"),
        counted(comparison.axes.len(), "axis", "axes"),
    );
    match comparison.false_alarms().count() {
        0 => format!("In {what} the supervision raised no false alarm."),
        n => format!(
            "In {what} the supervision raised {}.",
            counted(n, "false alarm", "false alarms")
        ),
    }
}

/// Fingerprint of an axis: name and parameters.
fn hash(axis: &super::ComparedAxis) -> String {
    let text = serde_json::to_string(&axis.config.axis).unwrap_or_default();
    blake3::hash(text.as_bytes()).to_hex().to_string()
}

/// One line per factor and move that was played, one cell per controller.
fn factors(comparison: &Comparison, axis: &str) -> Vec<Factor> {
    let mut lines: Vec<(Variation, Move)> = Vec::new();
    for row in comparison.rows.iter().filter(|r| r.case.axis == axis) {
        let c = &row.case;
        let shown = matches!(c.motion, Move::Step100 | Move::Step20 | Move::SCurve);
        let varied = !matches!(
            c.variation,
            Variation::Nominal | Variation::Combination(_) | Variation::Drawn(_)
        );
        if shown && varied && !lines.contains(&(c.variation, c.motion)) {
            lines.push((c.variation, c.motion));
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
            Factor {
                variation: with_unit(variation),
                motion: motion.name(),
                cells: cells.collect(),
            }
        })
        .collect()
}

fn with_unit(variation: Variation) -> String {
    match variation {
        Variation::Load(x) => format!("load {} %", signed(100.0 * x, 0)),
        Variation::Mass(x) => format!("mass × {x}"),
        Variation::Supply(x) => format!("supply {} bar", signed(x, 0)),
        Variation::Friction(x) => format!("friction × {x}"),
        Variation::Delay(x) => format!("valve delay × {x}"),
        Variation::Spread(x) => format!("valves ± {:.0} %", 100.0 * x),
        Variation::Noise(x) => format!("noise × {x}"),
        Variation::Nominal | Variation::Combination(_) | Variation::Drawn(_) => {
            variation.to_string()
        }
    }
}
