//! The plant's response to the valve commands of a measurement.

use wheeleg_plant::PlantError;
use wheeleg_plant::axis::{Axis, AxisParams};

use super::lab::{Lab, Sample};

/// State of the plant at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Predicted {
    /// Stroke \[m\].
    pub position_m: f64,
    /// Absolute pressures of A and B \[Pa\].
    pub pressure_pa: [f64; 2],
}

/// State of the piston before the first valve is driven: the mean of the measurements until then, so that the
/// noise of one sample is not taken for the start.
fn start(lab: &Lab, axis: &AxisParams) -> AxisParams {
    let driven = lab.on_us.iter().position(|on| *on != [0; 4]);
    let until = driven.unwrap_or(0).min(1000);
    let still: Vec<&Sample> = lab.samples.iter().take_while(|s| s.tick <= until).collect();
    let mean = |value: &dyn Fn(&Sample) -> f64| {
        still.iter().map(|sample| value(sample)).sum::<f64>() / still.len().max(1) as f64
    };
    let mut start = axis.clone();
    start.initial_stroke_m = mean(&|s| s.position_m).clamp(0.0, axis.cylinder.stroke_m);
    if still.iter().any(|s| s.pressure_pa.is_some()) {
        let of = |chamber: usize| mean(&|s| s.pressure_pa.map_or(0.0, |both| both[chamber]));
        start.cylinder.initial_pressure_a_pa = of(0);
        start.cylinder.initial_pressure_b_pa = of(1);
    }
    start
}

/// The plant at every sample of the first `ticks` ticks.
///
/// # Errors
/// Any [`PlantError`]: the parameters are invalid, or the plant leaves its range.
pub(super) fn predict(
    axis: &AxisParams,
    lab: &Lab,
    ticks: usize,
) -> Result<Vec<Predicted>, PlantError> {
    let start = start(lab, axis);
    let plant = Axis::new(&start)?;
    let mut state = plant.initial_state(0);
    let mut samples = lab.samples.iter().peekable();
    let mut predicted = Vec::with_capacity(lab.samples.len());
    for (tick, on_us) in lab.on_us.iter().enumerate().take(ticks) {
        if let Some(load_n) = &lab.load_n {
            state.core.motion.load_n = load_n[tick];
        }
        if samples.next_if(|s| s.tick == tick).is_some() {
            let position_m = state.core.motion.stroke_m;
            let cylinder = &plant.assembly.cylinders[0];
            predicted.push(Predicted {
                position_m,
                pressure_pa: cylinder.pressures_pa(&state.core.cylinders[0], position_m),
            });
        }
        plant.tick(&mut state, *on_us)?;
    }
    Ok(predicted)
}
