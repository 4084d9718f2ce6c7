//! A plant of one axis that leaves the range of its model: when, the likely cause, and its last known values.

use wheeleg_plant::PlantError;
use wheeleg_plant::axis::{Axis, AxisState};

use super::error::AxisSimError;

/// One tick of an axis with the on-times of its valves, µs.
///
/// # Errors
/// [`AxisSimError::Unphysical`] if it leaves the range of its model, [`AxisSimError::Plant`] if it
/// refuses the on-times.
pub(super) fn tick(
    axis: &Axis,
    state: &mut AxisState,
    on_us: [u16; 4],
) -> Result<(), AxisSimError> {
    let (time_ns, motion) = (state.core.time_ns, state.core.motion);
    let pressure_pa =
        axis.assembly.cylinders[0].pressures_pa(&state.core.cylinders[0], motion.stroke_m);
    axis.tick(state, on_us).map_err(|error| match &error {
        PlantError::NonFinite { name, .. } | PlantError::OutOfBounds { name, .. } => {
            let [a_bar, b_bar] = pressure_pa.map(|p| p * 1e-5);
            AxisSimError::Unphysical {
                what: format!(
                    "the axis left the range of its model within 1 ms of {:.3} s: {error}; last \
                     valid values: stroke {:.2} mm, speed {:.1} mm/s, pressures {a_bar:.3} and \
                     {b_bar:.3} bar",
                    time_ns as f64 * 1e-9,
                    motion.stroke_m * 1e3,
                    motion.velocity_m_s * 1e3,
                ),
                help: format!(
                    "most likely {}, or a `numerics.step` that is too long for them",
                    likely(name)
                ),
            }
        }
        _ => AxisSimError::Plant(error),
    })
}

/// Parameters of the axis file that are the likely cause if a state variable explodes.
fn likely(name: &str) -> &'static str {
    match name {
        "bristle_m" => "`friction.bristle_damping`, `friction.bristle_stiffness`",
        // The load is too heavy for its stop, or for the air in front of the piston.
        "stroke_m" => "`moving.mass`, `end_stop.stiffness`, `end_stop.damping`",
        "pressure_a_pa" | "mass_a_kg" => {
            "`moving.mass`, `cylinder.dead_volume_a`, `line.volume`, `fill_valve.conductance`"
        }
        "pressure_b_pa" | "mass_b_kg" => {
            "`moving.mass`, `cylinder.dead_volume_b`, `line.volume`, `fill_valve.conductance`"
        }
        "supply_pressure_pa" => "`supply.reservoir`, `regulator.conductance`",
        _ => "`friction.bristle_damping`, `end_stop.stiffness`, `moving.mass`",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::AxisConfig;

    /// A quantity that leaves its range is reported by fields that an axis file has.
    #[test]
    fn every_state_of_an_axis_has_fields_of_the_file_to_blame() {
        let axis = AxisConfig::load("bench-vq110u").expect("built in");
        let plant = concat!(env!("CARGO_MANIFEST_DIR"), "/../plant/src/");
        let mut names = 0;
        for file in ["cylinder/model.rs", "supply.rs", "axis.rs"] {
            let text = std::fs::read_to_string(format!("{plant}{file}")).expect("a source");
            for call in text.split("check_state(").skip(1) {
                let Some(call) = call.trim_start().strip_prefix('"') else {
                    continue;
                };
                let name = call.split('"').next().expect("a name");
                let told = likely(name);
                for path in told.split('`').skip(1).step_by(2) {
                    let known = axis.parameters.iter().any(|p| p.path == path);
                    assert!(known, "{name}: no field `{path}`");
                }
                assert!(told.contains('`'), "{name}: {told}");
                names += 1;
            }
        }
        assert!(names >= 8, "{names}");
    }
}
