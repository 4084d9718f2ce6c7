//! Every axis around an event, on commanded, sensed and physical signals.

use super::{JOINTS, Points, Source, fitted, valves};
use wheeleg_config::EventAction;
use wheeleg_report::plot::{Content, Figure, Panel, Series, colour, line};
use wheeleg_telemetry::{JointSample, Row, WheelSample};

/// Time shown before and after the event, s: the reaction, the stop of the wheels and the start of a staged
/// exhaust.
const BEFORE_S: f64 = 0.15;
const AFTER_S: f64 = 0.85;

const WHEELS: [&str; 2] = ["7 left wheel", "8 right wheel"];

/// A signal of a joint since the event, in mm.
fn change(s: &Source<'_>, event: f64, joint: usize, value: fn(&JointSample) -> f64) -> Points {
    let points = s.joint(joint, value);
    let at = points.partition_point(|p| p.0 < event);
    let base = points.get(at).map_or(0.0, |p| p.1);
    points.into_iter().map(|(t, y)| (t, y - base)).collect()
}

fn wheel(s: &Source<'_>, wheel: usize, value: fn(&WheelSample) -> f64) -> Points {
    let rows = s.recording.wheels[wheel].iter();
    rows.map(|r| (s.t(r.t_s()), value(&r.v))).collect()
}

/// Speed of a counted position, as a mean over 10 ms, which makes one count
/// 0.9 mm/s.
fn speed(points: &[(f64, f64)]) -> Points {
    const SPAN: usize = 10;
    let pairs = points.iter().zip(points.iter().skip(SPAN));
    pairs
        .map(|(a, b)| (b.0, (b.1 - a.1) / (b.0 - a.0)))
        .collect()
}

/// Range of the data in the window, at least ±`span`.
fn near(window: (f64, f64), series: &[Series], span: f64) -> (f64, f64) {
    let inside: Vec<Series> = series
        .iter()
        .map(|l| {
            let points = l.points.iter().copied();
            let points = points.filter(|p| (window.0..window.1).contains(&p.0));
            line("", l.colour, 1, points.collect())
        })
        .collect();
    fitted((-span, span), &inside)
}

fn joints(s: &Source<'_>, event: f64, value: fn(&JointSample) -> f64) -> Vec<Series> {
    (0..6)
        .map(|j| line("", colour::AXES[j], 2, change(s, event, j, value)))
        .collect()
}

fn modes(s: &Source<'_>) -> Vec<Series> {
    // A small offset keeps equal modes apart.
    let apart = |points: Points, axis: usize| -> Points {
        let offset = 0.06 * (axis as f64 - 3.5);
        points.into_iter().map(|(t, y)| (t, y + offset)).collect()
    };
    let joints = (0..6).map(|j| (JOINTS[j], s.joint(j, |v| f64::from(v.mode))));
    let wheels = (0..2).map(|w| {
        (
            ["7 L wheel", "8 R wheel"][w],
            wheel(s, w, |v| f64::from(v.mode)),
        )
    });
    joints
        .chain(wheels)
        .enumerate()
        .map(|(axis, (label, points))| line(label, colour::AXES[axis], 1, apart(points, axis)))
        .collect()
}

/// Rim speeds: commanded (the profile's), counted by the board, and true.
fn rims(s: &Source<'_>) -> [Vec<Series>; 3] {
    let set = |points: &dyn Fn(usize) -> Points| -> Vec<Series> {
        (0..2)
            .map(|w| line(WHEELS[w], colour::AXES[6 + w], 4 - 3 * w as u32, points(w)))
            .collect()
    };
    [
        set(&|w| speed(&wheel(s, w, |v| v.reference_mm))),
        set(&|w| speed(&wheel(s, w, |v| v.sensed_mm))),
        set(&|w| wheel(s, w, |v| v.velocity_mm_s)),
    ]
}

/// Supply pressure, and the dump valve as commanded and in truth.
fn supply(s: &Source<'_>, window: (f64, f64)) -> [Panel; 2] {
    let rows = &s.recording.supply;
    let of = |value: &dyn Fn(&wheeleg_telemetry::SupplySample) -> f64| -> Points {
        let value = |r: &Row<wheeleg_telemetry::SupplySample>| (s.t(r.t_s()), value(&r.v));
        rows.iter().map(value).collect()
    };
    let pressure = vec![line("", colour::MODEL, 2, of(&|v| v.pressure_bar))];
    let dump = vec![
        line(
            "commanded",
            colour::COMMAND,
            2,
            of(&|v| f64::from(u8::from(v.dump_commanded))),
        ),
        line(
            "physically open",
            colour::ROBOT,
            1,
            of(&|v| f64::from(u8::from(v.dump_open))),
        ),
        line(
            "pressure switch",
            colour::SECOND,
            1,
            of(&|v| f64::from(u8::from(v.pressure_switch))),
        ),
    ];
    let range = near(window, &pressure, 0.0);
    let range = (range.0.min(0.0), range.1.max(8.0));
    [
        s.panel(
            "supply pressure",
            110,
            Content::lines(("[bar abs]", range), pressure),
        ),
        s.panel("dump valve", 80, Content::lines(("", (-0.2, 1.2)), dump)),
    ]
}

/// The figures of the first event of the scenario, at `event` s.
pub(super) fn figures(s: &Source<'_>, event: f64) -> Vec<Figure> {
    let (_, end) = s.x_range();
    let window = (event - BEFORE_S, (event + AFTER_S).min(end));
    let movement = |title: &str, value: fn(&JointSample) -> f64| {
        let series = joints(s, event, value);
        let range = near(window, &series, 1.0);
        s.panel(title, 130, Content::lines(("[mm]", range), series))
    };
    let mut panels = vec![
        s.panel("mode", 150, Content::lines(("", (-0.5, 6.5)), modes(s))),
        movement(
            "reference of the control law, change since the event",
            |v| v.reference_mm,
        ),
        movement("sensed stroke, change since the event", |v| v.sensed_mm),
        movement("true stroke, change since the event", |v| v.position_mm),
    ];
    let titles = [
        "wheels: commanded rim speed",
        "wheels: rim speed as counted",
        "wheels: true rim speed",
    ];
    for (title, series) in titles.into_iter().zip(rims(s)) {
        let range = near(window, &series, 20.0);
        panels.push(s.panel(title, 100, Content::lines(("[mm/s]", range), series)));
    }
    let dumps = s
        .scenario
        .events
        .iter()
        .any(|e| matches!(e.action, EventAction::EStop));
    if dumps {
        panels.extend(supply(s, window));
    }
    for (i, panel) in panels.iter_mut().enumerate() {
        panel.x_range = window;
        if (5..7).contains(&i) {
            // The panel above has the legend.
            panel.name_only(0..0);
        }
    }
    vec![
        Figure {
            id: "event".into(),
            title: "All axes around the event".into(),
            caption: "Dashed line: the event. Modes: 0 boot, 1 idle, 2 armed, 3 tracking, 4 hold, 5 exhaust, 6 fault (lines set apart slightly); their colours hold for the joints below. \
                      While a joint does not drive, its reference is its measured stroke; while a wheel ramps down in hold, its commanded position follows its count. Commanded and counted rim speeds are means over 10 ms."
                .into(),
            panels,
        },
        valves(s, (window, 1e-3), "event-valves", "Valves around the event"),
    ]
}
