//! The plant's response to the valve commands of a measurement.

use wheeleg_plant::PlantError;
use wheeleg_plant::axis::{Axis, AxisParams};

use super::bench::{Start, start};
use super::free::applied;
use super::lab::Lab;
use super::point::Point;

/// What the sensors show of the plant at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Predicted {
    /// Stroke \[m\].
    pub position_m: f64,
    /// Absolute pressures of A and B \[Pa\].
    pub pressure_pa: [f64; 2],
}

/// The plant of a file with factors, at every sample of the first `ticks` ticks.
///
/// # Errors
/// Any [`PlantError`]: the parameters are invalid, or the plant leaves its range.
pub(super) fn predict(
    file: &AxisParams,
    lab: &Lab,
    point: &Point,
    ticks: usize,
) -> Result<Vec<Predicted>, PlantError> {
    let Start { axis, zero_m } = start(applied(file, &point.logs), file, lab, &point.unknowns);
    let plant = Axis::new(&axis)?;
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
                position_m: position_m + zero_m,
                pressure_pa: cylinder.pressures_pa(&state.core.cylinders[0], position_m),
            });
        }
        plant.tick(&mut state, *on_us)?;
    }
    Ok(predicted)
}
