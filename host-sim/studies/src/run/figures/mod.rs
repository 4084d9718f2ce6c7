//! The figures of a run, built from its recording.

mod event;
mod force;
mod walk;

use crate::analysis::{Analysis, ReferencePoint};
use wheeleg_config::{EventAction, LegChoice, RobotConfig, Scenario};
use wheeleg_report::plot::{Content, Figure, Panel, RasterRow, Series, colour, line, runs};
use wheeleg_telemetry::{JointSample, Recording, Row, SWITCHES};

type Points = Vec<(f64, f64)>;

/// Inputs of the figures.
pub(super) struct Source<'a> {
    pub(super) scenario: &'a Scenario,
    pub(super) robot: &'a RobotConfig,
    pub(super) recording: &'a Recording,
    pub(super) analysis: &'a Analysis,
}

/// Joint names for labels, joints 1 to 6.
const JOINTS: [&str; 6] = [
    "1 L yaw",
    "2 L horiz.",
    "3 L vert.",
    "4 R yaw",
    "5 R horiz.",
    "6 R vert.",
];

/// Most points of a curve of the reference model: two minutes at its 2 ms.
const MODEL_POINTS: f64 = 60_000.0;

/// The figures count time like the paper's; tables and messages are in scenario time.
const MOTION_TIME: &str = "time since the start of the motion [s]";

impl Source<'_> {
    /// Time axis: seconds since the motion began.
    pub(super) fn t(&self, t_s: f64) -> f64 {
        t_s - self.analysis.start_s
    }

    pub(super) fn x_range(&self) -> (f64, f64) {
        let rows = &self.recording.joints[0];
        let first = rows.first().map_or(0.0, Row::t_s);
        let last = rows.last().map_or(1.0, |r| r.t_s() + 1e-3);
        // Whole steps if the record is that long, so that axes match the paper's.
        let from = self.t(first).max(-0.5);
        (
            if from > -0.05 { 0.0 } else { from },
            (self.t(last) * 10.0).round() / 10.0,
        )
    }

    fn joint(&self, joint: usize, value: impl Fn(&JointSample) -> f64) -> Points {
        self.recording.joints[joint]
            .iter()
            .map(|r| (self.t(r.t_s()), value(&r.v)))
            .collect()
    }

    fn model(&self, delay_s: f64, value: impl Fn(&ReferencePoint) -> f64) -> Points {
        let Some(model) = &self.analysis.reference else {
            return Points::new();
        };
        let (from, to) = self.x_range();
        let n = ((to - from) / 0.002).clamp(1.0, MODEL_POINTS) as usize;
        (0..=n)
            .map(|i| {
                let t = from + (to - from) * i as f64 / n as f64;
                (t, value(&model.at(t - delay_s)))
            })
            .collect()
    }

    /// Period of the rows over the whole run, s: a short run keeps all of them.
    fn period_s(&self) -> f64 {
        self.recording.period_ms.max(1) as f64 * 1e-3
    }

    /// Whether a row is on that period, rather than near an event, where all are kept.
    fn regular<S>(&self, row: &Row<S>) -> bool {
        let period_ms = self.recording.period_ms.max(1);
        (row.t_ns / 1_000_000).is_multiple_of(period_ms)
    }

    fn marks(&self) -> Vec<f64> {
        self.scenario
            .events
            .iter()
            .filter(|e| !matches!(e.action, EventAction::Command(_)))
            .map(|e| self.t(e.at_s))
            .collect()
    }

    fn panel(&self, title: impl Into<String>, height: u32, content: Content) -> Panel {
        let mut panel = Panel::new(title, self.x_range(), height, content).over(MOTION_TIME);
        panel.marks = self.marks();
        panel.marked = "event";
        panel.on_clock = true;
        panel
    }
}

/// A range that holds the paper's axis and all data, with a small margin.
fn fitted(axis: (f64, f64), series: &[Series]) -> (f64, f64) {
    let (mut lo, mut hi) = axis;
    for (_, y) in series.iter().flat_map(|s| &s.points) {
        lo = lo.min(*y);
        hi = hi.max(*y);
    }
    if !(hi - lo).is_finite() || hi <= lo {
        return (lo - 1.0, lo + 1.0);
    }
    let air = 0.03 * (hi - lo);
    (
        if lo < axis.0 { lo - air } else { axis.0 },
        if hi > axis.1 { hi + air } else { axis.1 },
    )
}

/// All figures of the scenario.
pub(super) fn figures(s: &Source<'_>) -> Vec<Figure> {
    let side = s.analysis.leg.unwrap_or(LegChoice::Left);
    let first = if side == LegChoice::Left { 0 } else { 3 };
    let mut figures = Vec::new();
    if s.analysis.reference.is_some() {
        figures.extend(paper_figures(s, first + 1, first + 2));
    } else {
        figures.extend(walk::figures(s));
        figures.push(strokes(s));
    }
    if let Some(event) = s.marks().first() {
        figures.extend(event::figures(s, *event));
    }
    figures.push(pressures(s, first));
    let whole = (s.x_range(), s.period_s());
    figures.push(valves(s, whole, "valves", "Valves"));
    figures.push(feet(s));
    figures.push(body(s));
    figures
}

fn paper_figures(s: &Source<'_>, b5: usize, b6: usize) -> Vec<Figure> {
    let delay = s.robot.reference.delay_s;
    let delayed = format!("model, shifted by {delay} s");
    let stroke = |id: &str,
                  number: u8,
                  name: &str,
                  joint: usize,
                  model: fn(&ReferencePoint) -> f64| {
        let series = vec![
            line(
                "command",
                colour::COMMAND,
                1,
                s.joint(joint, |j| j.commanded_mm),
            ),
            line(&delayed, colour::DELAYED, 1, s.model(delay, model)),
            line("reference model", colour::MODEL, 2, s.model(0.0, model)),
            line(
                "simulated robot",
                colour::ROBOT,
                2,
                s.joint(joint, |j| j.position_mm),
            ),
        ];
        let range = fitted((0.0, 180.0), &series);
        Figure {
            id: id.into(),
            title: format!("Fig. {number}: {name}"),
            caption: format!(
                "Stroke of {name}. Command: as the node gets it from the bus, before its slew limit. \
                     The paper's axis is 0 to 180 mm over 10 s."
            ),
            panels: vec![s.panel(name, 300, Content::lines(("[mm]", range), series))],
        }
    };
    let pair = |id: &str,
                number: u8,
                what: &str,
                unit: &str,
                caption: &str,
                panels: Vec<(&str, (f64, f64), Vec<Series>)>| Figure {
        id: id.into(),
        title: format!("Fig. {number}: {what}"),
        caption: caption.into(),
        panels: panels
            .into_iter()
            .map(|(title, axis, series)| {
                let range = fitted(axis, &series);
                let content = Content::lines((unit, range), series);
                s.panel(title, 220, content.limited(&[axis.0, axis.1]))
            })
            .collect(),
    };
    let velocity = |joint: usize, model: fn(&ReferencePoint) -> f64| {
        vec![
            line(&delayed, colour::DELAYED, 1, s.model(delay, model)),
            line("reference model", colour::MODEL, 2, s.model(0.0, model)),
            line(
                "simulated robot",
                colour::ROBOT,
                1,
                s.joint(joint, |j| j.velocity_mm_s),
            ),
        ]
    };
    let acceleration = |joint: usize, model: fn(&ReferencePoint) -> f64| {
        vec![
            line("reference model", colour::MODEL, 2, s.model(0.0, model)),
            line(
                "simulated robot, 20 Hz low-pass",
                colour::ROBOT,
                1,
                s.joint(joint, |j| j.acceleration_m_s2),
            ),
        ]
    };
    vec![
        stroke("fig12-b5", 12, "horizontal cylinder b5", b5, |p| {
            p.s5_m * 1e3
        }),
        stroke("fig13-b6", 13, "vertical cylinder b6", b6, |p| p.s6_m * 1e3),
        pair(
            "fig14-velocity",
            14,
            "velocities V5 and V6",
            "[mm/s]",
            "Velocities, unfiltered. Limit lines: the paper's axis, ±400 mm/s.",
            vec![
                ("V5", (-400.0, 400.0), velocity(b5, |p| p.v5_m_s * 1e3)),
                ("V6", (-400.0, 400.0), velocity(b6, |p| p.v6_m_s * 1e3)),
            ],
        ),
        pair(
            "fig15-acceleration",
            15,
            "accelerations a5 and a6",
            "[m/s²]",
            "Accelerations after a 20 Hz low-pass. Limit lines: the paper's axes, read in m/s² (its mm/s² cannot be: MODEL.md §11).",
            vec![
                ("a5", (-5.0, 10.0), acceleration(b5, |p| p.a5_m_s2)),
                ("a6", (-10.0, 5.0), acceleration(b6, |p| p.a6_m_s2)),
            ],
        ),
        force::figure(s, b6),
    ]
}

/// Strokes of all joints, for scenarios without the reference model.
fn strokes(s: &Source<'_>) -> Figure {
    let panels = [0, 3].map(|first| {
        let series: Vec<Series> = (first..first + 3)
            .flat_map(|j| {
                // Grey: blue is used for a joint.
                let label = if j == first { "commands" } else { "" };
                [
                    line(label, colour::RAW, 1, s.joint(j, |v| v.commanded_mm)),
                    line(
                        JOINTS[j],
                        colour::AXES[j % 3],
                        2,
                        s.joint(j, |v| v.position_mm),
                    ),
                ]
            })
            .collect();
        let range = fitted((0.0, 180.0), &series);
        let title = if first == 0 { "left leg" } else { "right leg" };
        s.panel(title, 240, Content::lines(("[mm]", range), series))
    });
    Figure {
        id: "strokes".into(),
        title: "Strokes of all cylinders".into(),
        caption: "True strokes in colour, commands in grey.".into(),
        panels: panels.into(),
    }
}

fn pressures(s: &Source<'_>, first: usize) -> Figure {
    let supply: Points = s
        .recording
        .supply
        .iter()
        .map(|r| (s.t(r.t_s()), r.v.pressure_bar))
        .collect();
    let panels = (first..first + 3)
        .map(|j| {
            let series = vec![
                line("supply", colour::COMMAND, 1, supply.clone()),
                line(
                    "chamber A (extends)",
                    colour::ROBOT,
                    2,
                    s.joint(j, |v| v.pressure_a_bar),
                ),
                line(
                    "chamber B (retracts)",
                    colour::MODEL,
                    2,
                    s.joint(j, |v| v.pressure_b_bar),
                ),
            ];
            let range = fitted((0.0, 8.0), &series);
            s.panel(
                format!("joint {}", JOINTS[j]),
                150,
                Content::lines(("[bar abs]", range), series),
            )
        })
        .collect();
    Figure {
        id: "pressures".into(),
        title: "Chamber pressures of the stepping leg".into(),
        caption: "Absolute pressures in the six chambers of one leg. The robot has no sensor for them: this is what the simulation knows and the controller does not.".into(),
        panels,
    }
}

/// Valve raster of all joints over a window, from rows of a period in s.
fn valves(s: &Source<'_>, (window, period_s): ((f64, f64), f64), id: &str, title: &str) -> Figure {
    const VALVES: [&str; 4] = ["fill A", "vent A", "fill B", "vent B"];
    // Bins of whole PWM periods if a period is narrower than about a pixel, so that bins and pulses do not
    // beat.
    let bin = (((window.1 - window.0) / 450.0) / period_s).ceil().max(1.0) as usize;
    let bin = if bin > 5 {
        bin.next_multiple_of(20)
    } else {
        bin
    };
    let mut rows = Vec::new();
    for joint in 0..6 {
        let samples: Vec<&Row<JointSample>> = s.recording.joints[joint]
            .iter()
            .filter(|r| (window.0..window.1).contains(&s.t(r.t_s())))
            .filter(|r| period_s <= 1e-3 || s.regular(r))
            .collect();
        for (valve, name) in VALVES.iter().enumerate() {
            let commanded = samples.iter().map(|r| {
                let v = &r.v;
                let us = [v.fill_a_us, v.vent_a_us, v.fill_b_us, v.vent_b_us][valve];
                (s.t(r.t_s()), f64::from(us) * 1e-3)
            });
            let open = samples.iter().map(|r| {
                let open = r.v.valves_open >> valve & 1;
                (s.t(r.t_s()), f64::from(open))
            });
            rows.push(RasterRow {
                label: format!("{} {name}", joint + 1),
                colour: colour::AXES[2 - valve / 2],
                upper: runs(commanded, bin, period_s),
                lower: Some(runs(open, bin, period_s)),
            });
        }
    }
    let mut panel = s.panel(
        "joints 1 to 6; colour: commanded duty (A orange, B blue); dark: physically open",
        24 * 17,
        Content::Raster(rows),
    );
    panel.x_range = window;
    Figure {
        id: id.into(),
        title: title.into(),
        caption: "Each row is one valve. Upper half: duty commanded by the node; lower half: how much of the time the valve really was open. Paler means a smaller share of the time.".into(),
        panels: vec![panel],
    }
}

fn feet(s: &Source<'_>) -> Figure {
    let feet = &s.recording.feet;
    let load = |foot: usize| -> Points {
        feet[foot]
            .iter()
            .map(|r| (s.t(r.t_s()), r.v.normal_force_n))
            .collect()
    };
    let mut series = vec![
        line("left foot", colour::ROBOT, 2, load(0)),
        line("right foot", colour::SECOND, 1, load(1)),
    ];
    if s.analysis.reference.is_some() {
        series.push(line(
            "reference model",
            colour::MODEL,
            1,
            s.model(0.0, |p| p.load_n),
        ));
    }
    // Impacts are many times the static load; the table has the peaks.
    let (lo, hi) = fitted((0.0, 50.0), &series);
    let range = (lo.max(-5.0), hi.min(120.0));
    let mut rows = Vec::new();
    for (foot, name) in [(0, "L"), (1, "R")] {
        for (bit, side) in SWITCHES.iter().enumerate() {
            let samples = feet[foot]
                .iter()
                .filter(|r| s.regular(r))
                .map(|r| (s.t(r.t_s()), f64::from(r.v.switches >> bit & 1)));
            rows.push(RasterRow {
                label: format!("{name} {side}"),
                colour: if foot == 0 {
                    colour::ROBOT
                } else {
                    colour::SECOND
                },
                upper: runs(samples, 1, s.period_s()),
                lower: None,
            });
        }
    }
    Figure {
        id: "feet".into(),
        title: "Foot loads and switches".into(),
        caption: "Ground force normal to each sole (impacts cut off at 120 N), and the four optical switches of each foot as the node sees them.".into(),
        panels: vec![
            s.panel("normal force", 220, Content::lines(("[N]", range), series)),
            s.panel("foot switches closed", 150, Content::Raster(rows)),
        ],
    }
}

fn body(s: &Source<'_>) -> Figure {
    let body = &s.recording.body;
    let of = |value: fn(&wheeleg_telemetry::BodySample) -> f64| -> Points {
        body.iter().map(|r| (s.t(r.t_s()), value(&r.v))).collect()
    };
    let mut travel = vec![line("simulated robot", colour::ROBOT, 2, of(|b| b.x_mm))];
    if s.analysis.reference.is_some() {
        travel.insert(
            0,
            line(
                "reference model",
                colour::MODEL,
                2,
                s.model(0.0, |p| p.travel_m * 1e3),
            ),
        );
    }
    let speed = vec![line("chassis", colour::ROBOT, 1, of(|b| b.speed_mm_s))];
    let attitude = vec![
        line("roll, right down", colour::SECOND, 1, of(|b| b.roll_deg)),
        line("pitch, nose up", colour::THIRD, 1, of(|b| b.pitch_deg)),
        line("yaw, to the left", colour::ROBOT, 1, of(|b| b.yaw_deg)),
    ];
    let travel_range = fitted((0.0, 10.0), &travel);
    let speed_range = fitted((-10.0, 200.0), &speed);
    let attitude_range = fitted((-0.1, 0.1), &attitude);
    Figure {
        id: "body".into(),
        title: "Chassis".into(),
        caption: "Travel, speed and attitude of the chassis.".into(),
        panels: vec![
            s.panel(
                "travel",
                200,
                Content::lines(("[mm]", travel_range), travel),
            ),
            s.panel("speed", 140, Content::lines(("[mm/s]", speed_range), speed)),
            s.panel(
                "attitude",
                120,
                Content::lines(("[deg]", attitude_range), attitude),
            ),
        ],
    }
}
