//! The figures of a walk: when each foot stands, what the behaviours do, and how the wheels slip.

use super::Source;
use wheeleg_master::behaviour::{Act, Behaviour};
use wheeleg_master::contact::Side;
use wheeleg_master::event::Event as MasterEvent;
use wheeleg_report::plot::{Colour, Content, Figure, Panel, RasterRow, colour, line, runs};
use wheeleg_telemetry::{BehaviourSample, Cause, Row};

/// Code of a standing leg in the log.
const STANCE: u8 = 1;
/// A foot is loaded above this force, N.
const LOADED_N: f64 = 1.0;
/// Period of the rows of behaviours, s: a bus cycle.
const CYCLE_S: f64 = 0.01;
/// Drawn width of an instant, as a share of the whole, so that it is visible.
const TICK: f64 = 1.0 / 400.0;
/// Height of a row, pixels.
const ROW: u32 = 20;
/// Samples of 1 ms in a mean of the slip.
const SLIP_SAMPLES: usize = 200;
/// Slower rims have no meaningful slip, mm/s.
const SLOW_MM_S: f64 = 5.0;

/// The figures of a walk; none if the robot did not walk.
pub(super) fn figures(s: &Source<'_>) -> Vec<Figure> {
    if s.recording.behaviours.is_empty() {
        return Vec::new();
    }
    let mut figures = vec![foot_fall(s), behaviours(s)];
    figures.extend(slip(s));
    figures
}

/// Ticks at these times, s of the page's clock.
fn ticks(s: &Source<'_>, at_s: impl Iterator<Item = f64>) -> Vec<(f64, f64, f64)> {
    let (from, to) = s.x_range();
    let half = 0.5 * TICK * (to - from);
    at_s.map(|t| (t - half, t + half, 1.0)).collect()
}

fn row(label: &str, colour: Colour, upper: Vec<(f64, f64, f64)>) -> RasterRow {
    RasterRow {
        label: label.to_owned(),
        colour,
        upper,
        lower: None,
    }
}

/// Times at which a leg did this, s of the page's clock.
fn acts<'a>(s: &'a Source<'_>, side: Side, act: fn(Side) -> Act) -> impl Iterator<Item = f64> + 'a {
    let wanted = act(side);
    let events = s.recording.events.iter();
    let found = events.filter(move |r| match r.v.cause {
        Cause::Master(MasterEvent::Behaviour(act)) => act == wanted,
        _ => false,
    });
    found.map(|r| s.t(r.t_s()))
}

fn foot_fall(s: &Source<'_>) -> Figure {
    let mut rows = Vec::new();
    for (foot, (name, side)) in [("L", Side::Left), ("R", Side::Right)]
        .into_iter()
        .enumerate()
    {
        let code = |v: &BehaviourSample| [v.left, v.right][foot];
        let planned = s.recording.behaviours.iter();
        let planned = planned.map(|r| (s.t(r.t_s()), f64::from(u8::from(code(&r.v) == STANCE))));
        let loaded = s.recording.feet[foot].iter().filter(|r| s.regular(r));
        let loaded = loaded.map(|r| {
            let loaded = r.v.normal_force_n > LOADED_N;
            (s.t(r.t_s()), f64::from(u8::from(loaded)))
        });
        rows.push(RasterRow {
            label: format!("{name} stands"),
            colour: colour::COMMAND,
            upper: runs(planned, 1, CYCLE_S),
            lower: Some(runs(loaded, 1, s.period_s())),
        });
        let early = ticks(s, acts(s, side, Act::EarlyGround));
        let late = ticks(s, acts(s, side, Act::LateGround));
        rows.push(row(&format!("{name} early"), colour::LIMIT, early));
        rows.push(row(&format!("{name} late"), colour::LIMIT, late));
    }
    let height = ROW * rows.len() as u32;
    Figure {
        id: "foot-fall".into(),
        title: "Foot-fall".into(),
        caption: "When each foot stands: above in blue as planned by the walk, below as loaded by the ground (more than 1 N). \
                  Ticks: ground that a foot met 20 mm and more before its plan (early) or after it (late)."
            .into(),
        panels: vec![s.panel("left and right foot", height, Content::Raster(rows))],
    }
}

/// Count of a behaviour in a row of the log.
fn count(v: &BehaviourSample, one: Behaviour) -> u32 {
    match one {
        Behaviour::Overload => v.overload,
        Behaviour::TipGuard => v.tip_guard,
        Behaviour::Touchdown => v.touchdown,
        Behaviour::Search => v.search,
        Behaviour::Bump => v.bump,
        Behaviour::LostContact => v.lost_contact,
        Behaviour::Slip => v.slip,
        Behaviour::Hook => v.hook,
        Behaviour::Stuck => v.stuck,
        Behaviour::LoadShare => v.load_share,
        Behaviour::StrokeGovernor => v.stroke_governor,
    }
}

/// Whether the user should look at it first: the robot stops, or nearly so.
fn is_grave(one: Behaviour) -> bool {
    matches!(
        one,
        Behaviour::Overload | Behaviour::TipGuard | Behaviour::Stuck
    )
}

fn behaviours(s: &Source<'_>) -> Figure {
    let all = &s.recording.behaviours;
    let pairs = || all.iter().zip(all.iter().skip(1));
    let acted = |one: Behaviour| -> Vec<f64> {
        let first = all.first().filter(|r| count(&r.v, one) > 0);
        let later = pairs().filter(|(a, b)| count(&b.v, one) > count(&a.v, one));
        let later = later.map(|(_, b)| b);
        let rows: Vec<&Row<BehaviourSample>> = first.into_iter().chain(later).collect();
        rows.into_iter().map(|r| s.t(r.t_s())).collect()
    };
    let rows: Vec<RasterRow> = Behaviour::ALL
        .into_iter()
        .map(|one| {
            let label = match one {
                // The margin is narrow.
                Behaviour::StrokeGovernor => "governor",
                other => other.name(),
            };
            let colour = if is_grave(one) {
                colour::LIMIT
            } else {
                colour::ROBOT
            };
            row(label, colour, ticks(s, acted(one).into_iter()))
        })
        .collect();
    let pace = all.iter().map(|r| (s.t(r.t_s()), r.v.pace)).collect();
    let pace = vec![line("", colour::ROBOT, 1, pace)];
    let height = ROW * rows.len() as u32;
    Figure {
        id: "behaviours".into(),
        title: "Behaviours".into(),
        caption: "Each tick is an act of a behaviour; in the colour of alarms those that stop the robot or hold an axis. \
                  Below, the share of the walk's speed at which the wheels go."
            .into(),
        panels: vec![
            s.panel("acts", height, Content::Raster(rows)),
            s.panel(
                "pace of the wheels",
                90,
                Content::lines(("[1]", (0.0, 1.1)), pace),
            ),
        ],
    }
}

/// Slip of a wheel as means over stretches: speed of the tread over the ground, by speed of the rim.
fn slip_of(s: &Source<'_>, wheel: usize) -> Vec<(f64, f64)> {
    let samples: Vec<_> = s.recording.wheels[wheel]
        .iter()
        .filter(|r| s.regular(r))
        .collect();
    let stretch = (SLIP_SAMPLES as f64 * 1e-3 / s.period_s()).max(1.0) as usize;
    let means = samples.chunks(stretch).filter_map(|part| {
        let (first, last) = (part.first()?, part.last()?);
        let sum = |of: fn(&wheeleg_telemetry::WheelSample) -> f64| -> f64 {
            part.iter().map(|r| of(&r.v)).sum::<f64>() / part.len() as f64
        };
        let rim_mm_s = sum(|v| v.velocity_mm_s);
        let share = sum(|v| v.slip_mm_s) / rim_mm_s;
        let slip = if rim_mm_s.abs() > SLOW_MM_S {
            share
        } else {
            f64::NAN
        };
        Some((s.t(0.5 * (first.t_s() + last.t_s())), slip))
    });
    means.collect()
}

fn slip(s: &Source<'_>) -> Option<Figure> {
    if s.recording.wheels.iter().all(Vec::is_empty) {
        return None;
    }
    let series = vec![
        line("left wheel", colour::ROBOT, 2, slip_of(s, 0)),
        line("right wheel", colour::SECOND, 1, slip_of(s, 1)),
    ];
    let content = Content::lines(("[1]", (-0.5, 1.0)), series).limited(&[0.15]);
    let panel: Panel = s.panel("slip", 160, content);
    Some(Figure {
        id: "slip".into(),
        title: "Slip of the wheels".into(),
        caption: "Share of the rim's way that is not the robot's, as it truly is, means over 0.2 s; a gap where the rim stands. \
                  The line is where the behaviour of slip begins to act; its own estimate, from legs and wheels, is not in the log."
            .into(),
        panels: vec![panel],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::analyse;
    use wheeleg_config::builtin;
    use wheeleg_telemetry::{Recorder, Recording, WheelSample};

    fn raster(panel: &Panel) -> &[RasterRow] {
        match &panel.content {
            Content::Raster(rows) => rows,
            _ => panic!("a raster"),
        }
    }

    /// Ten seconds: the left leg swings from 2 to 3 s and lands late; a governor and a tip guard act.
    fn walk() -> Recording {
        let mut recorder = Recorder::in_memory();
        for ms in 0..10_000_u64 {
            let t_ns = ms * 1_000_000;
            let swings = (2_000..3_000).contains(&ms);
            let foot = |loaded: bool| wheeleg_telemetry::FootSample {
                normal_force_n: if loaded { 15.0 } else { 0.0 },
                ..Default::default()
            };
            recorder.joint(t_ns, 0, Default::default());
            recorder.foot(t_ns, 0, foot(!swings));
            recorder.foot(t_ns, 1, foot(true));
            for wheel in 0..2 {
                // A quarter of the left rim's travel is slip; the right one stands.
                let v = WheelSample {
                    velocity_mm_s: if wheel == 0 { 100.0 } else { 0.0 },
                    slip_mm_s: if wheel == 0 { 25.0 } else { 1.0 },
                    ..WheelSample::default()
                };
                recorder.wheel(t_ns, wheel, v);
            }
            if ms % 10 == 0 {
                let v = BehaviourSample {
                    left: if swings { 3 } else { STANCE },
                    right: STANCE,
                    pace: 1.0,
                    tip_guard: u32::from(ms >= 5_000),
                    stroke_governor: u32::from(ms >= 4_000) + u32::from(ms >= 6_000),
                    ..BehaviourSample::default()
                };
                recorder.behaviours(t_ns, v);
            }
            if ms == 3_000 {
                let late = Act::LateGround(Side::Left);
                recorder.event(t_ns, Cause::Master(MasterEvent::Behaviour(late)));
            }
        }
        recorder.finish().expect("in memory")
    }

    #[test]
    fn a_walk_shows_its_feet_its_behaviours_and_its_slip() {
        let scenario = builtin::scenario("walk").expect("built in");
        let robot = builtin::robot("wheeleg").expect("built in");
        let recording = walk();
        let analysis = analyse(&scenario, &robot, &recording);
        let source = Source {
            scenario: &scenario,
            robot: &robot,
            recording: &recording,
            analysis: &analysis,
        };
        let figures = figures(&source);
        let ids: Vec<&str> = figures.iter().map(|f| f.id.as_str()).collect();
        assert_eq!(ids, ["foot-fall", "behaviours", "slip"]);

        let feet = raster(&figures[0].panels[0]);
        let labels: Vec<&str> = feet.iter().map(|r| r.label.as_str()).collect();
        let expected = [
            "L stands", "L early", "L late", "R stands", "R early", "R late",
        ];
        assert_eq!(labels, expected);
        let near = |a: f64, b: f64| (a - b).abs() < 0.011;
        for stands in [&feet[0].upper, feet[0].lower.as_ref().expect("loads")] {
            assert_eq!(stands.len(), 2, "{stands:?}");
            assert!(
                near(stands[0].1, 2.0) && near(stands[1].0, 3.0),
                "{stands:?}"
            );
        }
        assert_eq!(feet[3].upper.len(), 1, "the right foot stands all the time");
        let ticks = |row: &RasterRow| row.upper.len();
        assert_eq!(
            feet.iter().map(ticks).collect::<Vec<_>>(),
            [2, 0, 1, 1, 0, 0]
        );
        let (from, to, _) = feet[2].upper[0];
        assert!(near(0.5 * (from + to), 3.0), "{from} {to}");

        let acts = raster(&figures[1].panels[0]);
        let of = |one: Behaviour| ticks(&acts[one.index()]);
        assert_eq!(acts.len(), Behaviour::ALL.len());
        assert_eq!(
            (of(Behaviour::TipGuard), of(Behaviour::StrokeGovernor)),
            (1, 2)
        );
        assert_eq!(acts.iter().map(ticks).sum::<usize>(), 3);
        assert_eq!(acts[Behaviour::TipGuard.index()].colour, colour::LIMIT);

        let left = slip_of(&source, 0);
        assert!(left.len() > 40 && left.iter().all(|(_, slip)| (slip - 0.25).abs() < 1e-12));
        assert!(slip_of(&source, 1).iter().all(|(_, slip)| slip.is_nan()));
    }
}
