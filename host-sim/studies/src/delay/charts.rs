//! The pictures.

use wheeleg_report::plot::Colour;

use super::preview::Previewed;
use super::trial::{LEAD_S, Law, Outcome, Start};
use super::{EARLY_LIMIT_MM, PAPER_BAND_S, PAPER_DELAY_S, PREVIEW_LIMIT_S, Study};
use wheeleg_report::plot::{Axis, Content, Figure, Panel, RasterRow, Series, colour, line};

type Points = Vec<(f64, f64)>;

fn curves(
    title: &str,
    (x_label, x_range): Axis<'_>,
    y: Axis<'_>,
    series: Vec<Series>,
    limits: &[f64],
) -> Panel {
    let content = Content::curves(x_label, y, series).limited(limits);
    Panel::new(title, x_range, 210, content)
}

/// One colour per kind of start.
fn colours(start: Start) -> Colour {
    match start {
        Start::HomeHeld => colour::ROBOT,
        Start::HomeRest => colour::RAW,
        Start::StopHeld => colour::MODEL,
        Start::StopRest => colour::DELAYED,
        Start::MidExtend => colour::SECOND,
        Start::MidRetract => colour::THIRD,
        Start::Reversal => colour::COMMAND,
    }
}

/// All figures of the page.
pub(super) fn figures(study: &Study) -> Vec<Figure> {
    vec![
        starts(study),
        home(study),
        ablation(study),
        scaling(study),
        preview(study),
    ]
}

/// End of the abscissa of the starts \[s\].
const END_S: f64 = 0.35;

/// Shares of starts so far, over time.
fn starts(study: &Study) -> Figure {
    let panel = |law: Law| {
        let series = Start::ALL.map(|start| {
            let mut delays = study
                .starts
                .of(law, start)
                .map_or_else(Vec::new, |d| d.delay_s.clone());
            delays.sort_by(f64::total_cmp);
            let n = delays.len().max(1) as f64;
            let mut points = vec![(0.0, 0.0)];
            for (i, d) in delays.iter().enumerate() {
                points.push((*d, 100.0 * i as f64 / n));
                points.push((*d, 100.0 * (i + 1) as f64 / n));
            }
            points.push((END_S, 100.0));
            line(start.name(), colours(start), 2, points)
        });
        let mut panel = curves(
            match law {
                Law::Paper => "paper's law: share of starts that have come",
                Law::Default => "default law: share of starts that have come",
            },
            (
                "time since the set-point reached the board [s]",
                (0.0, END_S),
            ),
            ("[%]", (0.0, 102.0)),
            series.into(),
            &[],
        );
        panel.marks = [-PAPER_BAND_S, 0.0, PAPER_BAND_S]
            .map(|off_s| PAPER_DELAY_S + off_s)
            .to_vec();
        panel.marked = "the paper's 0.25 s, and ±0.05 s";
        panel
    };
    let mut panels = vec![panel(Law::Paper), panel(Law::Default)];
    // The legend of seven lines is too long for one picture: four and three.
    for (i, panel) in panels.iter_mut().enumerate() {
        panel.name_only(if i == 0 { 0..4 } else { 4..7 });
    }
    Figure {
        id: "starts".to_owned(),
        title: "Start delays by kind of move".to_owned(),
        caption: format!(
            "Share of {} seeded starts whose piston has moved 1 mm. Upright lines: the paper's 0.25 s, and 0.05 s less and more.",
            study.seeds
        ),
        panels,
    }
}

/// Stroke and pressures of the move from the held home.
fn home(study: &Study) -> Figure {
    let runs: [(&str, &Outcome); 3] = [
        ("paper's law", &study.starts.home[0]),
        ("default law", &study.starts.home[1]),
        ("default law, 0.4 s preview", &study.preview.home),
    ];
    let time = ("time since the command [s]", (-0.45, 0.8));
    let points = |o: &Outcome, y: &dyn Fn(&crate::axis_sim::Row) -> f64| -> Points {
        let at = |(k, r): (usize, &crate::axis_sim::Row)| (k as f64 * 1e-3 - LEAD_S, y(r));
        o.rows.iter().enumerate().map(at).collect()
    };
    let strokes = runs
        .iter()
        .zip([colour::ROBOT, colour::MODEL, colour::SECOND])
        .map(|((name, o), c)| line(name, c, 2, points(o, &|r| r.stroke_m * 1e3)))
        .collect();
    let mut panels = vec![curves("stroke", time, ("[mm]", (0.0, 190.0)), strokes, &[])];
    for (name, o) in runs {
        panels.push(curves(
            &format!("{name}: pressure"),
            time,
            ("[bar abs]", (0.0, 8.0)),
            vec![
                line(
                    "counter chamber A",
                    colour::ROBOT,
                    2,
                    points(o, &|r| r.pressure_pa[0] * 1e-5),
                ),
                line(
                    "drive chamber B",
                    colour::MODEL,
                    2,
                    points(o, &|r| r.pressure_pa[1] * 1e-5),
                ),
            ],
            &[],
        ));
    }
    for (panel, delay) in panels[1..].iter_mut().zip(runs.map(|(_, o)| o.delay_s)) {
        panel.height = 130;
        panel.marks = delay.into_iter().collect();
        panel.marked = "first millimetre";
    }
    Figure {
        id: "home".to_owned(),
        title: "The move from the held home".to_owned(),
        caption: "Retracting from the extended stop, first seed. The piston cannot move before chamber A has vented and B has filled; an announced move does that before the command. Upright line: the first millimetre.".to_owned(),
        panels,
    }
}

/// Bars of the ablation.
fn ablation(study: &Study) -> Figure {
    let a = &study.ablation;
    let end = (a.base_s * 1.15 * 100.0).ceil() / 100.0;
    let alone = a
        .rows
        .iter()
        .map(|r| RasterRow {
            label: r.id.to_owned(),
            colour: colour::MODEL,
            upper: vec![(0.0, r.alone_s, 1.0)],
            lower: None,
        })
        .collect();
    let mut before = a.base_s;
    let series = a
        .rows
        .iter()
        .map(|r| {
            // A step the wrong way is drawn from the smaller to the larger.
            let (low, high) = (r.series_s.min(before), r.series_s.max(before));
            before = r.series_s;
            RasterRow {
                label: r.id.to_owned(),
                colour: colour::ROBOT,
                upper: vec![(low, high.max(low + 4e-4), 1.0)],
                lower: None,
            }
        })
        .collect();
    let panel = |title: &str, rows, mark| {
        let panel = Panel::new(title, (0.0, end), 300, Content::Raster(rows));
        let mut panel = panel.over("time since the command [s]");
        panel.marks = vec![mark];
        panel
    };
    let words = a.rows.iter().map(|r| format!("{}: {}", r.id, r.text));
    let words: Vec<String> = words.collect();
    Figure {
        id: "ablation".to_owned(),
        title: "What the delay is made of".to_owned(),
        caption: format!(
            "Move from the held home, paper's law, mean of {} seeds. Above: the start delay without one contribution; upright line: with all of them ({:.3} s). Below: contributions taken away one after the other, from the command on; upright line: what is left ({:.3} s). What is taken away: {}.",
            a.seeds,
            a.base_s,
            a.residual_s,
            words.join("; ")
        ),
        panels: vec![
            panel("delay without one contribution", alone, a.base_s),
            panel("one after the other", series, a.residual_s),
        ],
    }
}

/// Delay against volume over conductance.
fn scaling(study: &Study) -> Figure {
    let p = &study.predictions;
    let most = p.scaling.iter().map(|s| s.ratio_s_pa).fold(0.0, f64::max);
    let top = p.scaling.iter().map(|s| s.delay_s).fold(0.0, f64::max);
    // s·Pa/1e5 per m³ reads best as s·bar.
    let to_bar = 1e-5;
    let five = [
        colour::LIMIT,
        colour::ROBOT,
        colour::SECOND,
        colour::MODEL,
        colour::THIRD,
    ];
    let mut tubes: Vec<f64> = p.scaling.iter().map(|s| s.tube).collect();
    tubes.sort_by(f64::total_cmp);
    tubes.dedup();
    let series: Vec<Series> = tubes
        .iter()
        .zip(five)
        .map(|(tube, c)| {
            let points = p.scaling.iter().filter(|s| s.tube == *tube);
            let points = points.map(|s| (s.ratio_s_pa * to_bar, s.delay_s)).collect();
            line(&format!("tubes × {tube}"), c, 2, points)
        })
        .collect();
    Figure {
        id: "scaling".to_owned(),
        title: "Delay over volume by conductance".to_owned(),
        caption: format!(
            "Held home, paper's law, C × 0.5 to 2 along each line. With the robot's own tubes: R² = {:.4}, {:.3} s at the origin. A transport delay or a filter would give horizontal lines.",
            p.own_line.r_squared, p.own_line.offset
        ),
        panels: vec![curves(
            "start delay",
            (
                "volume of the counter chamber over sonic conductance [s bar]",
                (0.0, most * to_bar * 1.02),
            ),
            ("[s]", (0.0, top * 1.1)),
            series,
            &[],
        )],
    }
}

/// Delay and early motion over preview.
fn preview(study: &Study) -> Figure {
    let rows = |start: Start, load_n: f64, y: fn(&Previewed) -> Option<f64>| -> Points {
        let list = study.preview.rows.iter();
        let of = list.filter(|r| r.law == Law::Default && r.start == start && r.load_n == load_n);
        of.filter_map(|r| Some((r.preview_s, y(r)?))).collect()
    };
    let kinds = [
        (Start::HomeHeld, 0.0, "home, held", colour::ROBOT),
        (Start::HomeRest, 0.0, "home, at rest", colour::RAW),
        (Start::HomeHeld, 30.0, "30 N opposing", colour::LIMIT),
        (Start::HomeHeld, -30.0, "30 N assisting", colour::MODEL),
        (Start::StopHeld, 0.0, "stop, held", colour::DELAYED),
        (Start::MidRetract, 0.0, "mid-stroke", colour::SECOND),
    ];
    let series = |y: fn(&Previewed) -> Option<f64>| {
        let kinds = kinds.iter();
        let lines = kinds.map(|(start, load, name, c)| line(name, *c, 2, rows(*start, *load, y)));
        lines.collect()
    };
    let x = ("preview [s]", (0.0, 0.4));
    let mut early = curves(
        "motion before the command",
        x,
        ("[mm]", (0.0, 1.5)),
        series(|r| Some(r.early_mm)),
        &[EARLY_LIMIT_MM],
    );
    early.name_only(0..0);
    Figure {
        id: "preview".to_owned(),
        title: "What an announced move gains".to_owned(),
        caption: format!(
            "Default law, worst of {} seeds. Level lines: at most {PREVIEW_LIMIT_S} s, and at most {EARLY_LIMIT_MM} mm before the command.",
            study.preview.seeds
        ),
        panels: vec![
            curves(
                "start delay",
                x,
                ("[s]", (0.0, 0.35)),
                series(|r| r.delay_s),
                &[PREVIEW_LIMIT_S],
            ),
            early,
        ],
    }
}
