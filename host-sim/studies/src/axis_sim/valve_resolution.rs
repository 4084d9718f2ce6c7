//! Whether the valves of an axis are fine enough for its cylinder.
//!
//! An on/off valve cannot open for less than its shutting time. The flow in that time gives the smallest step
//! of pressure, hence of force; friction holds a piston over a range of forces of twice its break-away force.
//! A step larger than that brings a piston to rest at its target only by luck, whatever the law.

use fixed::types::I8F24;
use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::chamber::GasModel;
use wheeleg_protocol::param::JointParam;

use super::design::axis_data;

/// Steps above this share of the friction's range are coarse. Measured on the 240 cylinders that `cargo xtask
/// deep cylinders` draws at random, with 1,920 combinations of load, mass, supply, friction and delay: up to
/// it 2.8 % of 1,688 missed their bars, none by a fault; above it 18 % of 232, 17 by a fault.
pub const COARSE: f64 = 0.5;
/// Friction below this does not hold anything \[N\].
const LEAST_N: f64 = 1e-3;

/// Smallest step of force, compared with the range that friction holds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct ValveResolution {
    /// Shortest opening of a valve \[ms\].
    pub shortest_opening_ms: f64,
    /// Change of force by it, from the supply into the piston side at mid stroke \[N\].
    pub force_step_n: f64,
    /// Range of forces in which friction holds the piston: twice the break-away force \[N\].
    pub friction_holds_n: f64,
    /// The first of these forces over the second; null if friction holds nothing.
    pub ratio: Option<f64>,
    /// Conductance of valve and line for which the ratio would be [`COARSE`] \[dm³/(s bar)\]; null if
    /// friction holds nothing.
    pub conductance_for_half_dm3_s_bar: Option<f64>,
}

/// A force in whole newtons, a small one in tenths.
fn tenths(force_n: f64) -> String {
    if force_n < 10.0 {
        format!("{force_n:.1}")
    } else {
        format!("{force_n:.0}")
    }
}

impl ValveResolution {
    /// For an axis, by its data sheet.
    #[must_use]
    pub fn of(axis: &AxisParams) -> Self {
        let c = &axis.cylinder;
        let data = axis_data(axis);
        let seconds = |us: u32| f64::from(us) * 1e-6;
        // The board's shortest pulse is t_on and a margin.
        let opening_s = seconds(data.valve_off.get()) + seconds(data.margin.get());
        let conductance = data.conductance.to_num::<f64>();
        let gas = &axis.gas;
        let flow_m3_s = conductance * 1e-8 * gas.choked_outflow_pa();
        let area_m2 = std::f64::consts::FRAC_PI_4 * c.bore_m * c.bore_m;
        let volume_m3 = c.dead_volume_a_m3 + c.line_volume_m3 + 0.5 * area_m2 * c.stroke_m;
        // Fast against the exchange of heat, where that is modelled.
        let exponent = match c.gas_model {
            GasModel::Polytropic { exponent, .. } => exponent,
            GasModel::Thermal { .. } => gas.heat_capacity_ratio,
        };
        // dp = n p C ρ0 R T / V dt, choked (ISO 6358).
        let step_pa = exponent * axis.supply.set_pressure_pa * flow_m3_s * opening_s / volume_m3;
        let force_step_n = step_pa * area_m2;
        let friction_holds_n = 2.0 * c.friction.static_n;
        let ratio = (friction_holds_n >= LEAST_N).then(|| force_step_n / friction_holds_n);
        Self {
            shortest_opening_ms: opening_s * 1e3,
            force_step_n,
            friction_holds_n,
            ratio,
            conductance_for_half_dm3_s_bar: ratio
                .map(|ratio| conductance * COARSE / ratio.max(1e-9)),
        }
    }

    /// Remedy for valves that are too coarse; `None` if they are not.
    #[must_use]
    pub fn advice(&self) -> Option<String> {
        let Some((ratio, conductance)) = self.ratio.zip(self.conductance_for_half_dm3_s_bar) else {
            return Some(
                "without break-away friction (`friction.static`) no valve is fine enough: the piston \
rests where its forces balance, and swings about it"
                    .to_owned(),
            );
        };
        (ratio > COARSE).then(|| {
            // Rounded down: the printed value must be enough.
            let throttled = (conductance * 1e3).floor() * 1e-3;
            let least = I8F24::from_bits(JointParam::Conductance.info().min).to_num::<f64>();
            let throttle = match throttled < least {
                true => format!(
                    "Throttled to the {least:.3} dm3/(s bar) that a board takes at least, they still are: take"
                ),
                false => format!(
                    "Throttle valve and line together to {throttled:.3} dm3/(s bar), take"
                ),
            };
            format!(
                "coarse valves: their shortest opening ({:.1} ms) changes the force by {} N, and friction \
holds no more than {} N: rest beside the target, swinging or fault 34 (following_error) may be met \
under a load. {throttle} valves that shut faster, or give the chambers more volume",
                self.shortest_opening_ms,
                tenths(self.force_step_n),
                tenths(self.friction_holds_n),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::AxisConfig;

    /// Values that a board does not accept are not advised.
    #[test]
    fn no_axis_is_throttled_below_what_a_board_takes() {
        let mut axis = AxisConfig::load("bench-vq110u").expect("built in").axis;
        axis.cylinder.friction.static_n = 0.1;
        axis.cylinder.friction.coulomb_n = 0.1;
        let text = ValveResolution::of(&axis).advice().expect("advice");
        for words in [
            "no more than 0.2 N",
            "the 0.005 dm3/(s bar) that a board takes",
        ] {
            assert!(text.contains(words), "{text}");
        }
    }

    #[test]
    fn axes_of_this_project_are_not_coarse_and_a_wide_valve_is() {
        for name in ["bench-vq110u", "small-12x50", "long-16x400", "heavy-40x250"] {
            let mut axis = AxisConfig::load(name).expect("built in").axis;
            let fine = ValveResolution::of(&axis);
            let share = fine.ratio.expect("there is friction");
            assert!((0.01..COARSE).contains(&share), "{name}: {fine:?}");
            assert_eq!(fine.advice(), None);
            // Valves so wide that advice is needed; following it mends them.
            let c = &mut axis.cylinder;
            c.line_flow = None;
            for valve in [&mut c.fill_valve, &mut c.vent_valve] {
                valve.flow.conductance_m3_s_pa *= 1.5 / share;
            }
            let coarse = ValveResolution::of(&axis);
            assert!(coarse.ratio > Some(1.0), "{name}: {coarse:?}");
            let half = coarse.conductance_for_half_dm3_s_bar.expect("as well");
            let text = coarse.advice().expect("advice");
            assert!(text.contains("coarse valves"), "{text}");
            let c = &mut axis.cylinder;
            for valve in [&mut c.fill_valve, &mut c.vent_valve] {
                valve.flow.conductance_m3_s_pa = half * 1e-8;
            }
            let mended = ValveResolution::of(&axis);
            let ratio = mended.ratio.expect("there is friction");
            assert!((ratio - COARSE).abs() < 1e-3, "{name}: {mended:?}");
        }
    }

    /// There is no division by zero friction.
    #[test]
    fn without_friction_there_is_no_ratio() {
        let mut axis = AxisConfig::load("bench-vq110u").expect("built in").axis;
        axis.cylinder.friction.static_n = 0.0;
        let resolution = ValveResolution::of(&axis);
        assert_eq!(
            (resolution.ratio, resolution.conductance_for_half_dm3_s_bar),
            (None, None)
        );
        let advice = resolution.advice().expect("advice");
        assert!(advice.contains("`friction.static`"), "{advice}");
    }

    /// By hand: 6 bar gauge, bore 20 × 180 mm, 3 cm³ beside the piston.
    #[test]
    fn the_step_is_that_of_choked_flow_into_the_chamber() {
        let axis = AxisConfig::load("bench-vq110u").expect("built in").axis;
        let resolution = ValveResolution::of(&axis);
        let data = axis_data(&axis);
        let volume_mm3 = data.dead_a.to_f64() * 1e3 + 314.159 * 90.0;
        let flow_mm3_s = data.conductance.to_num::<f64>() * 997_162.0;
        let bar = 7.01325 * 1.2 * flow_mm3_s * resolution.shortest_opening_ms * 1e-3 / volume_mm3;
        // A bar on 314 mm² are 31.4 N.
        assert!(
            (resolution.force_step_n / (bar * 31.4159) - 1.0).abs() < 0.02,
            "{resolution:?}"
        );
    }
}
