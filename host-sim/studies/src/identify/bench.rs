//! What of a measurement itself is not known: the zero of its sensor, and the state that the plant starts from.
//!
//! It is fitted together with the factors and not reported (a nuisance parameter: Cox, Hinkley: Theoretical
//! Statistics, 1974). Taken for known, its error would be a property of the cylinder: half a digit of the
//! position converter is 1 % of a dead volume.

use wheeleg_plant::axis::AxisParams;

use super::lab::{Lab, Sample};

/// Number of unknowns.
pub const UNKNOWNS: usize = 4;

/// The unknowns, each in standard deviations of what is known of it before: zero of the position sensor, stroke,
/// pressures of A and B at the start.
pub type Unknowns = [f64; UNKNOWNS];

/// Zero of the position sensor against the end stop \[m\] (ASSUMED: adjusted by hand).
pub const ZERO_M: f64 = 1e-4;
/// Stroke and pressures at the start beside the mean of what was measured at rest \[m, Pa\]. Far more than noise:
/// the samples at rest are data, and say how far it is.
const STROKE_M: f64 = 1e-3;
const PRESSURE_PA: f64 = 1e4;
/// Standard deviation of an even distribution, over its width.
const EVEN: f64 = 0.288_675;
/// Most standard deviations.
const MOST: f64 = 10.0;

/// Where the plant starts, and how the sensor shows it.
pub(super) struct Start {
    /// The axis with its start.
    pub(super) axis: AxisParams,
    /// Measured less true stroke \[m\].
    pub(super) zero_m: f64,
}

/// Samples before the first valve is driven.
fn at_rest(lab: &Lab) -> Vec<&Sample> {
    let until = lab.first_driven().unwrap_or(0).min(1000);
    lab.samples.iter().take_while(|s| s.tick <= until).collect()
}

/// Pressures of the chambers before they are measured: those of the file, or anything from the ambient to the
/// supply.
struct Unmeasured {
    file_pa: [f64; 2],
    range_pa: [f64; 2],
}

impl Unmeasured {
    fn of(axis: &AxisParams) -> Self {
        Self {
            file_pa: [
                axis.cylinder.initial_pressure_a_pa,
                axis.cylinder.initial_pressure_b_pa,
            ],
            range_pa: [axis.gas.ambient_pressure_pa, axis.supply.set_pressure_pa],
        }
    }

    fn deviation_pa(&self) -> f64 {
        EVEN * (self.range_pa[1] - self.range_pa[0]).abs()
    }
}

/// Whether the pressures are measured.
pub(super) fn has_pressures(lab: &Lab) -> bool {
    lab.samples
        .iter()
        .any(|sample| sample.pressure_pa.is_some())
}

/// Smallest and largest value of each unknown. `axis` is that of the file.
pub(super) fn limits(axis: &AxisParams, lab: &Lab) -> [[f64; 2]; UNKNOWNS] {
    let mut limits = [[-MOST, MOST]; UNKNOWNS];
    if !has_pressures(lab) {
        let before = Unmeasured::of(axis);
        for (limits, file_pa) in limits[2..].iter_mut().zip(before.file_pa) {
            let [low, high] = before
                .range_pa
                .map(|limit_pa| (limit_pa - file_pa) / before.deviation_pa().max(1.0));
            *limits = [low.min(0.0), high.max(0.0)];
        }
    }
    limits
}

/// The start of an axis with factors; `file` is that without.
pub(super) fn start(axis: AxisParams, file: &AxisParams, lab: &Lab, unknowns: &Unknowns) -> Start {
    let still = at_rest(lab);
    let mean = |value: &dyn Fn(&Sample) -> f64| {
        still.iter().map(|sample| value(sample)).sum::<f64>() / still.len().max(1) as f64
    };
    let [zero, stroke, a, b] = *unknowns;
    let zero_m = ZERO_M * zero;
    let mut axis = axis;
    axis.initial_stroke_m =
        (mean(&|s| s.position_m) - zero_m + STROKE_M * stroke).clamp(0.0, axis.cylinder.stroke_m);
    let [a_pa, b_pa] = if has_pressures(lab) {
        let of = |chamber: usize| mean(&|s| s.pressure_pa.map_or(0.0, |both| both[chamber]));
        [of(0) + PRESSURE_PA * a, of(1) + PRESSURE_PA * b]
    } else {
        let before = Unmeasured::of(file);
        let [file_a_pa, file_b_pa] = before.file_pa;
        [
            file_a_pa + before.deviation_pa() * a,
            file_b_pa + before.deviation_pa() * b,
        ]
    };
    axis.cylinder.initial_pressure_a_pa = a_pa;
    axis.cylinder.initial_pressure_b_pa = b_pa;
    Start { axis, zero_m }
}
