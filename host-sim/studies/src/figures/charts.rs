//! The pictures.

use super::Results;
use super::section6::{AxisCheck, Instant, Reading};
use wheeleg_report::number::short;
use wheeleg_report::plot::{Axis, Content, Figure, Heat, Panel, Series, colour, line};

type Points = Vec<(f64, f64)>;

/// A panel (its words without dotted letters, which the pictures' font lacks) of one curve or more, with the paper's axis as lines where the data goes beyond it.
fn curves(
    title: &str,
    (x_label, x_range): Axis<'_>,
    (y_label, axis): Axis<'_>,
    series: Vec<Series>,
) -> Panel {
    let (mut lo, mut hi) = axis;
    for (_, y) in series.iter().flat_map(|s| &s.points) {
        lo = lo.min(*y);
        hi = hi.max(*y);
    }
    let air = 0.04 * (hi - lo);
    let below = if lo < axis.0 { lo - air } else { lo };
    let above = if hi > axis.1 { hi + air } else { hi };
    let mut content = Content::curves(x_label, (y_label, (below, above)), series);
    if lo < axis.0 {
        content = content.limited(&[axis.0]);
    }
    if hi > axis.1 {
        content = content.limited(&[axis.1]);
    }
    Panel::new(title, x_range, 190, content)
}

/// The caption's text about the axes of a figure.
fn compared(checks: &[AxisCheck], figure: u8, reading: &str) -> String {
    let parts: Vec<String> = checks
        .iter()
        .filter(|c| c.figure == figure && c.reading == reading && c.quantity != "abscissa")
        .map(|c| {
            format!(
                "{} {} to {} {} on an axis of {} to {}: {}",
                c.quantity,
                short(c.min),
                short(c.max),
                c.unit,
                short(c.axis_min),
                short(c.axis_max),
                if c.fits { "fits" } else { "◆ does not fit" },
            )
        })
        .collect();
    parts.join("; ")
}

fn reading_figures(reading: &Reading, motion: &[Instant], checks: &[AxisCheck]) -> Vec<Figure> {
    let points = |y: fn(&Instant) -> f64| -> Points {
        motion.iter().map(|i| (i.abscissa, 1e3 * y(i))).collect()
    };
    let over_x = |y: fn(&Instant) -> f64| -> Points {
        let at = |i: &Instant| (1e3 * i.foot_m[0], 1e3 * y(i));
        motion.iter().map(at).collect()
    };
    let (blue, orange) = (colour::MODEL, colour::ROBOT);
    let time = (reading.abscissa, (0.0, 3.5));
    let pair = |number: u8, title: &str, panels: Vec<Panel>, paper: &str| Figure {
        id: format!("fig{number}-{}", reading.name),
        title: format!("Fig. {number}, {} reading: {title}", reading.name),
        caption: format!(
            "{paper} Here {}. Computed: {}.",
            reading.text,
            compared(checks, number, reading.name)
        ),
        panels,
    };
    let two = |unit: &str, names: [&str; 2], axes: [(f64, f64); 2], points: [Points; 2]| {
        let [a, b] = points;
        vec![
            curves(names[0], time, (unit, axes[0]), vec![line("", blue, 2, a)]),
            curves(
                names[1],
                time,
                (unit, axes[1]),
                vec![line("", orange, 2, b)],
            ),
        ]
    };
    let x = ("x [mm]", (0.0, 250.0));
    vec![
        pair(
            5,
            "trajectory of the foot",
            vec![
                curves(
                    "z",
                    x,
                    ("[mm]", (0.0, 200.0)),
                    vec![line("", blue, 2, over_x(|i| i.foot_m[2]))],
                ),
                curves(
                    "y",
                    x,
                    ("[mm]", (-1.0, 1.0)),
                    vec![line("", orange, 2, over_x(|i| i.foot_m[1]))],
                ),
            ],
            "The paper draws the path of P in space, x 0 to 250, y −1 to 1, z 0 to 200 mm.",
        ),
        pair(
            6,
            "lengths of the cylinders",
            two(
                "[mm]",
                ["b5", "b6"],
                [(-100.0, 300.0), (0.0, 200.0)],
                [points(|i| i.length_m[0]), points(|i| i.length_m[1])],
            ),
            "The paper's axes: b5 −100 to 300, b6 0 to 200 mm, abscissa 0 to 3.5.",
        ),
        pair(
            7,
            "velocities of the cylinders",
            two(
                "[mm/s]",
                ["rate of b5", "rate of b6"],
                [(-10.0, 10.0), (-40.0, 40.0)],
                [points(|i| i.rate_m_s[0]), points(|i| i.rate_m_s[1])],
            ),
            "The paper's axes: ḃ5 ±10, ḃ6 ±40 mm/s.",
        ),
        pair(
            8,
            "accelerations of the cylinders",
            two(
                "[mm/s²]",
                ["acceleration of b5", "acceleration of b6"],
                [(-1.0, 1.0), (-10.0, 10.0)],
                [
                    points(|i| i.acceleration_m_s2[0]),
                    points(|i| i.acceleration_m_s2[1]),
                ],
            ),
            "The paper's axes: b̈5 ±1, b̈6 ±10 mm/s².",
        ),
    ]
}

/// All pictures, in the order of the page.
pub(super) fn figures(results: &Results) -> Vec<Figure> {
    let mut all = Vec::new();
    for (reading, motion) in &results.readings {
        all.extend(reading_figures(reading, motion, &results.checks));
    }
    let force = &results.force;
    let points = |f: fn(&super::force::Instant) -> f64| -> Points {
        force.instants.iter().map(|i| (i.t_s, f(i))).collect()
    };
    all.push(Figure {
        id: "fig9".to_owned(),
        title: "Fig. 9: force on the vertical cylinder".to_owned(),
        caption: format!(
            "The paper draws F6 within ±30 N over 0 to 10 s, with its positive maximum at the start. \
             Computed by row 3 of (54) from the square-wave motion of MODEL.md §6.2: {}; it \
             starts at {} N and its largest value stands at {} s; the full inverse dynamics and m6 (b̈6 − g) + d6 ḃ6 + N differ by at \
             most {} N.",
            compared(&results.checks, 9, "model"),
            short(force.instants.first().map_or(0.0, |i| i.f6_n)),
            short(force.maximum_at_s),
            short(force.worst_difference_n),
        ),
        panels: vec![
            curves(
                "F6",
                ("time [s]", (0.0, 10.0)),
                ("[N]", (-30.0, 30.0)),
                vec![line("inverse dynamics", colour::MODEL, 2, points(|i| i.f6_n))],
            ),
            curves(
                "Load on the foot",
                ("time [s]", (0.0, 10.0)),
                ("[N]", (0.0, 40.0)),
                vec![line("", colour::SECOND, 2, points(|i| i.load_n))],
            ),
        ],
    });
    let map = &results.precision;
    let heat = |id: &str, title: &str, values: &[f64], worst_m: f64, what: &str| {
        let (columns, cells) = map.reduced(values, CELLS);
        let to_mm = |m: &f64| 1e3 * m;
        let range = |v: &[f64]| (0.0, v.last().map_or(1.0, to_mm));
        Figure {
            id: id.to_owned(),
            title: title.to_owned(),
            caption: format!(
                "{what} in single precision, as on the master, against double precision: worst over \
                 {} poses {} mm; allowed 0.02 mm. Each cell shows its worst pose over all vertical \
                 strokes.",
                map.poses,
                short(1e3 * worst_m),
            ),
            panels: vec![Panel::new(
                "s5 [mm] over s2",
                range(&map.strokes_m),
                330,
                Content::Heat(Heat {
                    columns,
                    values: cells,
                    y_range: range(&map.strokes_m),
                    x_label: "s2 [mm]".to_owned(),
                    legend: format!("light 0, dark {} nm", short(1e9 * worst_m)),
                }),
            )],
        }
    };
    all.push(heat(
        "precision-forward",
        "Foot from strokes: single precision",
        &map.forward_m,
        map.worst_forward_m,
        "Foot position",
    ));
    all.push(heat(
        "precision-inverse",
        "Strokes from foot: single precision",
        &map.inverse_m,
        map.worst_inverse_m,
        "Strokes",
    ));
    all
}

/// Cells of a map along one side.
const CELLS: usize = 61;
