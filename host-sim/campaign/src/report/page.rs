//! The report page.

use serde::Serialize;
use wheeleg_report::number::{counted, fixed};
use wheeleg_report::plot::{Colour, Content, Figure, Panel, colour, line};
use wheeleg_report::{page, pictures};

use super::Merged;
use super::cells;
use super::findings::{Findings, Rate};
use super::pairs::Pairs;
use super::shares;
use crate::CampaignError;
use crate::columns::Column;

const TEMPLATE: &str = include_str!("page.html");
/// Colours of the curves, one per cell.
const COLOURS: [Colour; 3] = [colour::ROBOT, colour::MODEL, colour::THIRD];
/// Most points of a curve.
const POINTS: usize = 400;

#[derive(Serialize)]
struct Page<'a> {
    stopped: Option<String>,
    name: &'a str,
    verdict: String,
    program: &'a str,
    file: String,
    cases: u64,
    findings: &'a Findings,
    pairs: Option<&'a Pairs>,
    figures: Vec<wheeleg_report::Picture<'a>>,
}

pub(super) fn render(
    merged: &Merged,
    findings: &Findings,
    pairs: Option<&Pairs>,
) -> Result<String, CampaignError> {
    let plan = merged.plan.plan()?;
    let cells = cells::cells(&merged.table, &plan);
    let shares = shares::figure(merged, &plan, &cells);
    let figures: Vec<(Figure, String)> = shares
        .into_iter()
        .chain(distributions(merged, &cells))
        .map(|figure| {
            let svg = figure.svg();
            (figure, svg)
        })
        .collect();
    let values = Page {
        stopped: None,
        name: &plan.name,
        verdict: verdict(findings),
        program: &merged.program,
        file: merged.path.display().to_string(),
        cases: merged.plan.cases,
        findings,
        pairs,
        figures: pictures(&figures),
    };
    Ok(page(TEMPLATE, values)?)
}

/// The first sentence of the page: how many cases met everything, and which cell has the fewest.
fn verdict(findings: &Findings) -> String {
    let rates = || findings.passed.iter().map(|(_, rate)| rate);
    let all = Rate::of(rates().map(|r| r.met).sum(), rates().map(|r| r.of).sum());
    if all.of == 0 {
        return "No case has a result.".to_owned();
    }
    let percent = |share: f64| fixed(1e2 * share, 1);
    let [low, high] = all.exact;
    let share = |rate: &Rate| rate.met as f64 / rate.of.max(1) as f64;
    let cells = findings.passed.iter();
    let fewest = cells.min_by(|(_, a), (_, b)| share(a).total_cmp(&share(b)));
    let fewest = fewest.filter(|_| findings.passed.len() > 1 && all.met < all.of);
    let fewest =
        fewest.map(|(name, rate)| format!("; the fewest with {name}: {} of {}", rate.met, rate.of));
    format!(
        "All required targets are met in {} of {}: {} % (95 % interval {} to {} %){}.",
        all.met,
        counted(all.of as usize, "case", "cases"),
        percent(share(&all)),
        percent(low),
        percent(high),
        fewest.unwrap_or_default()
    )
}

/// For each target, the share of cases below a value, with one curve per cell and the limits marked.
fn distributions(merged: &Merged, cells: &[cells::Cell]) -> Vec<Figure> {
    let columns = merged.columns.all.iter();
    let targets = columns.filter(|column| merged.columns.targets.contains(&column.name));
    let figures = targets.filter_map(|column| {
        let values = merged.table.numbers(&column.name);
        let mut series = Vec::new();
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (place, cell) in cells.iter().enumerate().take(COLOURS.len()) {
            let there = cell.rows.iter().filter_map(|row| values[*row]);
            let mut sorted: Vec<f64> = there.collect();
            sorted.sort_by(f64::total_cmp);
            let (Some(first), Some(last)) = (sorted.first(), sorted.last()) else {
                continue;
            };
            (low, high) = (low.min(*first), high.max(*last));
            series.push(line(&cell.name, COLOURS[place], 2, steps(&sorted)));
        }
        if series.is_empty() {
            return None;
        }
        let limits: Vec<f64> = [column.min, column.max].into_iter().flatten().collect();
        // Limits close to the values belong in the figure.
        let span = (high - low).max(1e-9 * high.abs()).max(1e-12);
        for limit in &limits {
            if (low - 2.0 * span..=high + 2.0 * span).contains(limit) {
                (low, high) = (low.min(*limit), high.max(*limit));
            }
        }
        let margin = 0.05 * (high - low).max(1e-12);
        let unit = format!("{} [{}]", column.name, column.unit);
        let content = Content::curves(&unit, ("[share of cases below]", (0.0, 1.0)), series);
        let x_range = (low - margin, high + margin);
        let mut panel = Panel::new("", x_range, 180, content);
        let seen = limits
            .iter()
            .filter(|limit| (x_range.0..=x_range.1).contains(*limit));
        let caption = caption(column, seen.count() == limits.len());
        panel.marks = limits;
        Some(Figure {
            id: format!("distribution-{}", column.name.to_lowercase()),
            title: format!("{}: {}", column.name, column.meaning),
            caption,
            panels: vec![panel],
        })
    });
    figures.collect()
}

/// Explains how to read a distribution, with the target's limits.
fn caption(column: &Column, all_seen: bool) -> String {
    let read = "The curve is the share of cases with a smaller value.";
    match column.limits().strip_prefix(", ") {
        None => format!("{read} This quantity has no limits."),
        Some(allowed) if all_seen => format!("{read} A vertical line is a limit: {allowed}."),
        Some(allowed) => {
            format!(
                "{read} A vertical line is a limit, one far from all values is left out: {allowed}."
            )
        }
    }
}

/// Share of values below each value.
fn steps(sorted: &[f64]) -> Vec<(f64, f64)> {
    let n = sorted.len();
    let every = n.div_ceil(POINTS).max(1);
    let mut points = vec![(sorted[0], 0.0)];
    for (i, value) in sorted.iter().enumerate() {
        if i % every == 0 || i + 1 == n {
            points.push((*value, i as f64 / n as f64));
            points.push((*value, (i + 1) as f64 / n as f64));
        }
    }
    points
}
