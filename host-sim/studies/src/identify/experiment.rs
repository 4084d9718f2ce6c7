//! The next experiment: of some valve sequences, the one that reveals most of the unknowns.

use super::fit::{Point, Problem};
use super::intervals::{ignorance, information};
use super::lab::{Lab, Sample};

/// Length of a sequence \[ms\].
const TICKS: usize = 4000;
const OUT: [u16; 4] = [1000, 0, 0, 1000];
const BACK: [u16; 4] = [0, 1000, 1000, 0];
const SHUT: [u16; 4] = [0; 4];

/// A valve sequence, and its expected information.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// Name.
    pub name: &'static str,
    /// Description.
    pub words: &'static str,
    /// On-times of each ms \[µs\].
    pub on_us: Vec<[u16; 4]>,
    /// Mean of the logarithms of the remaining uncertainties, relative to the file.
    pub ignorance: f64,
}

type Valves = fn(usize) -> [u16; 4];

/// Sequences that a bench can play without a controller.
const SEQUENCES: [(&str, &str, Valves); 6] = [
    ("strokes", "whole strokes out and back, 1 s each", |t| {
        if t / 1000 % 2 == 0 { OUT } else { BACK }
    }),
    (
        "short-strokes",
        "strokes of 150 ms with a rest of 250 ms, out and back in turn",
        |t| match (t / 400 % 2, t % 400 < 150) {
            (0, true) => OUT,
            (_, true) => BACK,
            _ => SHUT,
        },
    ),
    (
        "pulses",
        "pulses of 4 to 12 ms, 100 ms apart, five out, five back",
        |t| {
            let length = 4 + 2 * (t / 100 % 5);
            match (t / 500 % 2, t % 100 < length) {
                (0, true) => OUT,
                (_, true) => BACK,
                _ => SHUT,
            }
        },
    ),
    (
        "one-chamber",
        "one chamber filled, then vented, the other shut; then the other way round",
        |t| match t / 500 % 4 {
            0 => [1000, 0, 0, 0],
            1 => [0, 1000, 0, 0],
            2 => [0, 0, 1000, 0],
            _ => [0, 0, 0, 1000],
        },
    ),
    (
        "free-fall",
        "both chambers filled for 400 ms, then one vented for 300 ms and the other for 300 ms",
        |t| match t % 1000 {
            0..400 => [1000, 0, 1000, 0],
            400..700 => [0, 0, 0, 1000],
            _ => [0, 1000, 0, 0],
        },
    ),
    (
        "half-duty",
        "out and back for 1 s each, valves driven for 6 of every 12 ms",
        |t| match (t / 1000 % 2, t % 12 < 6) {
            (0, true) => OUT,
            (_, true) => BACK,
            _ => SHUT,
        },
    ),
];

/// All sequences, the most informative first: each after the measurements so far, which have `known` as their
/// information. Positions are measured every ms, pressures if they were before. Its own unknowns are new.
#[must_use]
pub fn ranked(
    problem: &Problem<'_>,
    point: &Point,
    known: &nalgebra::DMatrix<f64>,
) -> Vec<Experiment> {
    let pressures = problem.lab.samples.first().and_then(|s| s.pressure_pa);
    let position_m = problem.lab.samples.first().map_or(0.0, |s| s.position_m);
    let tried = SEQUENCES.iter().filter_map(|(name, words, valves)| {
        let on_us: Vec<[u16; 4]> = (0..TICKS).map(valves).collect();
        let sample = |tick| Sample {
            tick,
            position_m,
            pressure_pa: pressures,
        };
        let lab = Lab {
            file: problem.lab.file.clone(),
            samples: (0..TICKS).map(sample).collect(),
            load_n: None,
            on_us: on_us.clone(),
        };
        let next = Problem {
            lab: &lab,
            ticks: TICKS,
            ..*problem
        };
        let more = information(&next.jacobian(point)?);
        Some(Experiment {
            name,
            words,
            on_us,
            ignorance: ignorance(&(known + more)),
        })
    });
    let mut all: Vec<Experiment> = tried.collect();
    all.sort_by(|a, b| a.ignorance.total_cmp(&b.ignorance));
    all
}

/// The sequence as a table that a bench can play.
#[must_use]
pub fn csv(experiment: &Experiment) -> String {
    let mut text = String::from("time_s,fill_a_us,vent_a_us,fill_b_us,vent_b_us\n");
    for (tick, [fill_a, vent_a, fill_b, vent_b]) in experiment.on_us.iter().enumerate() {
        let time_s = tick as f64 * 1e-3;
        text.push_str(&format!(
            "{time_s:.3},{fill_a},{vent_a},{fill_b},{vent_b}\n"
        ));
    }
    text
}
