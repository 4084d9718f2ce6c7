//! The free parameters of an identification: factors on parameters of the axis file.

use wheeleg_config::AxisConfig;
use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::chamber::GasModel;

/// A factor on one or more parameters of the file.
#[derive(Debug, Clone, Copy)]
pub struct Free {
    /// Name.
    pub name: &'static str,
    /// In words.
    pub words: &'static str,
    /// Parameters that it multiplies.
    pub paths: &'static [&'static str],
    /// Trust in the file: its value is right within this factor, 19 times out of 20.
    pub trust: f64,
    /// Applies the factor.
    pub(super) apply: fn(&mut AxisParams, f64),
}

/// All of them.
pub const FREE: [Free; 12] = [
    Free {
        name: "fill_conductance",
        words: "conductance of the fill valves",
        paths: &["fill_valve.conductance"],
        trust: 3.0,
        apply: |p, f| p.cylinder.fill_valve.flow.conductance_m3_s_pa *= f,
    },
    Free {
        name: "vent_conductance",
        words: "conductance of the vent valves",
        paths: &["vent_valve.conductance"],
        trust: 3.0,
        apply: |p, f| p.cylinder.vent_valve.flow.conductance_m3_s_pa *= f,
    },
    Free {
        name: "critical_ratio",
        words: "critical ratio of the valves",
        paths: &["fill_valve.critical_ratio", "vent_valve.critical_ratio"],
        trust: 1.6,
        apply: |p, f| {
            p.cylinder.fill_valve.flow.critical_ratio *= f;
            p.cylinder.vent_valve.flow.critical_ratio *= f;
        },
    },
    Free {
        name: "opening_delay",
        words: "opening delay of the valves",
        paths: &["fill_valve.t_on", "vent_valve.t_on"],
        trust: 3.0,
        apply: |p, f| {
            p.cylinder.fill_valve.t_on_s *= f;
            p.cylinder.vent_valve.t_on_s *= f;
        },
    },
    Free {
        name: "closing_delay",
        words: "closing delay of the valves",
        paths: &["fill_valve.t_off", "vent_valve.t_off"],
        trust: 3.0,
        apply: |p, f| {
            p.cylinder.fill_valve.t_off_s *= f;
            p.cylinder.vent_valve.t_off_s *= f;
        },
    },
    Free {
        name: "dead_volume_a",
        words: "dead volume of A",
        paths: &["cylinder.dead_volume_a"],
        trust: 5.0,
        apply: |p, f| p.cylinder.dead_volume_a_m3 *= f,
    },
    Free {
        name: "dead_volume_b",
        words: "dead volume of B",
        paths: &["cylinder.dead_volume_b"],
        trust: 5.0,
        apply: |p, f| p.cylinder.dead_volume_b_m3 *= f,
    },
    Free {
        name: "friction",
        words: "sliding and break-away friction",
        paths: &["friction.coulomb", "friction.static"],
        trust: 3.0,
        apply: |p, f| {
            p.cylinder.friction.coulomb_n *= f;
            p.cylinder.friction.static_n *= f;
        },
    },
    Free {
        name: "viscous_friction",
        words: "viscous friction",
        paths: &["friction.viscous"],
        trust: 5.0,
        apply: |p, f| p.cylinder.friction.viscous_n_s_m *= f,
    },
    Free {
        name: "mass",
        words: "moving mass",
        paths: &["moving.mass"],
        trust: 3.0,
        apply: |p, f| p.moving_mass_kg *= f,
    },
    Free {
        name: "supply_pressure",
        words: "supply pressure",
        paths: &["supply.set_pressure", "supply.initial_pressure"],
        trust: 1.3,
        apply: |p, f| {
            p.supply.set_pressure_pa *= f;
            p.supply.initial_pressure_pa *= f;
        },
    },
    Free {
        name: "exponent",
        words: "polytropic exponent",
        paths: &["cylinder.exponent"],
        trust: 1.15,
        apply: |p, f| {
            if let GasModel::Polytropic { exponent } = &mut p.cylinder.gas_model {
                *exponent *= f;
            }
        },
    },
];

/// Number of them.
pub const COUNT: usize = FREE.len();

/// Logarithms of the factors.
pub type Logs = [f64; COUNT];

/// The axis with these factors.
#[must_use]
pub fn applied(axis: &AxisParams, logs: &Logs) -> AxisParams {
    let mut changed = axis.clone();
    for (free, log) in FREE.iter().zip(logs) {
        (free.apply)(&mut changed, log.exp());
    }
    changed
}

/// Smallest and largest logarithm of each factor that the ranges of the file allow.
#[must_use]
pub fn limits(config: &AxisConfig) -> [[f64; 2]; COUNT] {
    FREE.map(|free| {
        let parameters = config.parameters.iter();
        let of = parameters.filter(|p| free.paths.contains(&p.path.as_str()));
        of.fold([-4.0_f64, 4.0_f64], |[low, high], p| match p.value[..] {
            [value] if value > 0.0 => {
                let log = |limit: f64| (limit.max(1e-12 * value) / value).ln();
                [low.max(log(p.min)), high.min(log(p.max))]
            }
            // A value of zero has no factor.
            _ => [0.0, 0.0],
        })
    })
}
