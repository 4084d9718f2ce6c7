//! What a measurement lacks: reasons to doubt it before the bench.

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_plant::axis::AxisParams;

use super::bench::has_pressures;
use super::lab::Lab;

/// Rest that a measurement needs before its first valve opens \[s\].
const REST_S: f64 = 0.2;
/// A piston that has moved less than this stands, in standard deviations of the sensor's noise and \[m\].
const STILL: f64 = 6.0;
const STILL_M: f64 = 2e-4;
/// A position this close to an end of the stroke is at its stop \[m\].
const AT_STOP_M: f64 = 1e-3;

/// One thing that a measurement lacks.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Doubt {
    /// The first valve opens too soon, or the piston moves before.
    ShortRest {
        /// Rest before that, s.
        rest_s: f64,
        /// Rest that is needed, s.
        needed_s: f64,
    },
    /// Neither end stop is reached, which would show the zero of the sensor.
    NoEndStop {
        /// Smallest and largest position, mm.
        positions_mm: [f64; 2],
        /// Stroke of the cylinder, mm.
        stroke_mm: f64,
    },
    /// The pressures at the start are unknown.
    NoPressures,
}

impl std::fmt::Display for Doubt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::ShortRest { rest_s, needed_s } => write!(
                f,
                "the measurement begins with {rest_s:.3} s of rest; {needed_s} s are needed"
            ),
            Self::NoEndStop {
                positions_mm: [low_mm, high_mm],
                stroke_mm,
            } => write!(
                f,
                "the piston moves between {low_mm:.1} and {high_mm:.1} mm; an end stop, 0 or {stroke_mm} mm, \
                 would show the zero of the sensor"
            ),
            Self::NoPressures => f.write_str(
                "the pressures at the start are unknown; measure them, or vent both chambers before the measurement",
            ),
        }
    }
}

/// Time at rest before the first valve opens, s.
fn rest_s(lab: &Lab, noise_m: f64) -> f64 {
    let from_m = lab.samples.first().map_or(0.0, |s| s.position_m);
    let still_m = (STILL * noise_m).max(STILL_M);
    let moved = lab
        .samples
        .iter()
        .find(|s| (s.position_m - from_m).abs() > still_m);
    let end = lab.on_us.len();
    let ticks = lab
        .first_driven()
        .unwrap_or(end)
        .min(moved.map_or(end, |s| s.tick));
    ticks as f64 * 1e-3
}

/// What a measurement of an axis lacks. `noise_m` is that of the position sensor.
pub(super) fn doubts(lab: &Lab, axis: &AxisParams, noise_m: f64) -> Vec<Doubt> {
    let mut doubts = Vec::new();
    let rest_s = rest_s(lab, noise_m);
    if rest_s < REST_S {
        doubts.push(Doubt::ShortRest {
            rest_s,
            needed_s: REST_S,
        });
    }
    let positions = lab.samples.iter().map(|s| s.position_m);
    let (low_m, high_m) = positions.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
    let stroke_m = axis.cylinder.stroke_m;
    if low_m > AT_STOP_M && high_m < stroke_m - AT_STOP_M {
        doubts.push(Doubt::NoEndStop {
            positions_mm: [low_m, high_m].map(|m| m * 1e3),
            stroke_mm: stroke_m * 1e3,
        });
    }
    if !has_pressures(lab) {
        doubts.push(Doubt::NoPressures);
    }
    doubts
}
