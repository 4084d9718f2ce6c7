//! Speed over the seeds.

use wheeleg_report::plot::{Content, Figure, Panel, colour, line};

use wheeleg_config::Measure;

use super::{SCENARIOS, Summary, Tried};

const HEIGHT: u32 = 130;

/// A panel for each scenario with a bar on its speed. With one seed there is no curve to draw.
pub(super) fn figures(summary: &Summary) -> Vec<Figure> {
    if summary.seeds < 2 {
        return Vec::new();
    }
    let panels: Vec<Panel> = summary
        .scenarios
        .iter()
        .filter_map(|tried| panel(summary, tried))
        .collect();
    if panels.is_empty() {
        return Vec::new();
    }
    vec![Figure {
        id: "speed".into(),
        title: "Speed over the seeds".into(),
        caption: "Mean forward speed of each run from 3 s on; the lines are the bar. A seed is that of the noise and, on rocks, of the field.".into(),
        panels,
    }]
}

fn panel(summary: &Summary, tried: &Tried) -> Option<Panel> {
    let bar = tried
        .measured
        .iter()
        .find(|m| m.measure == Measure::Speed.name())?;
    let points: Vec<(f64, f64)> = summary
        .runs
        .iter()
        .filter(|run| run.scenario == tried.scenario)
        .filter_map(|run| {
            let speed = run
                .bars
                .iter()
                .find(|b| b.id == Measure::Speed.name())?
                .value?;
            Some((run.seed as f64, speed))
        })
        .collect();
    let limits: Vec<f64> = [bar.min, bar.max].into_iter().flatten().collect();
    let all = points.iter().map(|(_, y)| *y).chain(limits.iter().copied());
    let (low, high) = all.fold((0.0_f64, 1.0_f64), |(low, high), y| {
        (low.min(y), high.max(y))
    });
    let place = SCENARIOS.iter().position(|s| *s == tried.scenario)?;
    let colour = colour::AXES[place % colour::AXES.len()];
    let content = Content::curves(
        "seed",
        ("speed [mm/s]", (low, 1.1 * high)),
        vec![line(tried.scenario, colour, 2, points)],
    );
    let x_range = (1.0, f64::from(summary.seeds));
    Some(Panel::new(
        tried.scenario,
        x_range,
        HEIGHT,
        content.limited(&limits),
    ))
}
