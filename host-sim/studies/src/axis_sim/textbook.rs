//! A separate model of one cylinder from the text book, to compare the plant with.
//!
//! ```text
//! d(p V)/dt = n R T_up mdot − (n − 1) p dV/dt + (n − 1) h A (T_amb − T)
//! dm/dt     = mdot
//! mdot      = C ρ0 p1 √(T0/T1) ψ(p2/p1)                 (ISO 6358-1)
//! m x''     = p_A A_A − p_B A_B − p_amb A_rod − σ2 x' + load
//! ```
//!
//! Polytropic: n as in the file, T = T_amb, h = 0. Thermal: n = γ, T = p V / (m R). No leak, no dry friction,
//! a supply that does not give way, a piston away from its stops. Integrated by the classic Runge–Kutta
//! method with a fixed, short step that restarts at every edge.

use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::chamber::GasModel;
use wheeleg_plant::flow::{GasParams, Iso6358};

/// Longest step of the integration, s.
const STEP_S: f64 = 1e-5;

/// p V of A and B \[J\], masses of A and B \[kg\], stroke \[m\], speed \[m/s\].
type State = [f64; 6];

/// Values to compare with the plant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Pressures of A and B, Pa.
    pub(super) pressure_pa: [f64; 2],
    /// Stroke, m.
    pub(super) stroke_m: f64,
}

/// Commands of a manoeuvre: when each valve is energised, from and to, s, in the order fill A, vent A, fill
/// B, vent B.
pub(super) type Commands = [Vec<(f64, f64)>; 4];

/// The cylinder.
pub(super) struct Textbook<'a> {
    axis: &'a AxisParams,
    areas_m2: [f64; 2],
    paths: [Iso6358; 4],
}

impl<'a> Textbook<'a> {
    pub(super) fn new(axis: &'a AxisParams) -> Self {
        let c = &axis.cylinder;
        let circle = |d: f64| 0.25 * std::f64::consts::PI * d * d;
        let (fill, vent) = (c.fill_valve.flow, c.vent_valve.flow);
        let (fill, vent) = match &c.line_flow {
            Some(line) => (fill.in_series(line), line.in_series(&vent)),
            None => (fill, vent),
        };
        Self {
            axis,
            areas_m2: [circle(c.bore_m), circle(c.bore_m) - circle(c.rod_m)],
            paths: [fill, vent, fill, vent],
        }
    }

    fn volumes_m3(&self, stroke_m: f64) -> [f64; 2] {
        let c = &self.axis.cylinder;
        [
            c.dead_volume_a_m3 + c.line_volume_m3 + self.areas_m2[0] * stroke_m,
            c.dead_volume_b_m3 + c.line_volume_m3 + self.areas_m2[1] * (c.stroke_m - stroke_m),
        ]
    }

    /// Samples at each of `at_s`, which rise from above 0.
    pub(super) fn run(&self, commands: &Commands, at_s: &[f64]) -> Vec<Sample> {
        let effects = self.effects(commands);
        let mut stops: Vec<f64> = effects.iter().flatten().flat_map(|e| [e.0, e.1]).collect();
        stops.extend(at_s);
        stops.sort_by(f64::total_cmp);
        stops.dedup();
        let mut state = self.start();
        let mut samples = Vec::new();
        let mut now_s = 0.0;
        for stop_s in stops {
            let middle_s = 0.5 * (now_s + stop_s);
            let open = [0, 1, 2, 3].map(|i| {
                effects[i]
                    .iter()
                    .any(|(from, to)| (*from..*to).contains(&middle_s))
            });
            let steps = ((stop_s - now_s) / STEP_S).ceil().max(1.0);
            let h = (stop_s - now_s) / steps;
            for _ in 0..steps as usize {
                state = self.runge_kutta(&state, open, h);
            }
            now_s = stop_s;
            if at_s.contains(&stop_s) {
                samples.push(self.sample(&state));
            }
        }
        samples
    }

    /// When each valve is open, as seen from the chamber.
    fn effects(&self, commands: &Commands) -> [Vec<(f64, f64)>; 4] {
        let c = &self.axis.cylinder;
        std::array::from_fn(|i| {
            let valve = [&c.fill_valve, &c.vent_valve][i % 2];
            let spread = c.timing_spread[i];
            let commands = commands[i].iter();
            commands
                .map(|(on_s, off_s)| {
                    (
                        on_s + valve.t_on_s * spread + c.line_delay_s,
                        off_s + valve.t_off_s * spread + c.line_delay_s,
                    )
                })
                .collect()
        })
    }

    fn start(&self) -> State {
        let (c, gas) = (&self.axis.cylinder, &self.axis.gas);
        let volumes = self.volumes_m3(self.axis.initial_stroke_m);
        let pv = [
            c.initial_pressure_a_pa * volumes[0],
            c.initial_pressure_b_pa * volumes[1],
        ];
        let mass = pv.map(|pv| pv / (gas.gas_constant_j_kg_k * gas.ambient_temperature_k));
        [
            pv[0],
            pv[1],
            mass[0],
            mass[1],
            self.axis.initial_stroke_m,
            0.0,
        ]
    }

    fn sample(&self, state: &State) -> Sample {
        let volumes = self.volumes_m3(state[4]);
        Sample {
            pressure_pa: [state[0] / volumes[0], state[1] / volumes[1]],
            stroke_m: state[4],
        }
    }

    fn runge_kutta(&self, y: &State, open: [bool; 4], h: f64) -> State {
        let ahead = |k: &State, h: f64| -> State { std::array::from_fn(|i| y[i] + h * k[i]) };
        let k1 = self.derivative(y, open);
        let k2 = self.derivative(&ahead(&k1, 0.5 * h), open);
        let k3 = self.derivative(&ahead(&k2, 0.5 * h), open);
        let k4 = self.derivative(&ahead(&k3, h), open);
        std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
    }

    fn derivative(&self, y: &State, open: [bool; 4]) -> State {
        let (axis, gas) = (self.axis, &self.axis.gas);
        let volumes = self.volumes_m3(y[4]);
        let supply = (axis.supply.set_pressure_pa, gas.ambient_temperature_k);
        let ambient = (gas.ambient_pressure_pa, gas.ambient_temperature_k);
        let volume_rates = [self.areas_m2[0] * y[5], -self.areas_m2[1] * y[5]];
        let mut dy = [0.0; 6];
        let mut pressures = [0.0; 2];
        for c in 0..2 {
            let p = y[c] / volumes[c];
            pressures[c] = p;
            let (n, temperature_k, heat_w) = match axis.cylinder.gas_model {
                GasModel::Polytropic { exponent } => (exponent, gas.ambient_temperature_k, 0.0),
                GasModel::Thermal {
                    heat_transfer_w_m2_k,
                } => {
                    let t = y[c] / (y[2 + c] * gas.gas_constant_j_kg_k);
                    let wall = heat_transfer_w_m2_k * self.wall_m2(c, y[4]);
                    (
                        gas.heat_capacity_ratio,
                        t,
                        wall * (gas.ambient_temperature_k - t),
                    )
                }
            };
            let chamber = (p, temperature_k);
            let mut flows = Vec::with_capacity(2);
            if open[2 * c] {
                flows.push(flow(&self.paths[2 * c], gas, supply, chamber));
            }
            if open[2 * c + 1] {
                let (m, t) = flow(&self.paths[2 * c + 1], gas, chamber, ambient);
                flows.push((-m, t));
            }
            let carried: f64 = flows.iter().map(|(m, t)| m * t).sum();
            dy[c] =
                n * gas.gas_constant_j_kg_k * carried + (n - 1.0) * (heat_w - p * volume_rates[c]);
            dy[2 + c] = flows.iter().map(|(m, _)| m).sum();
        }
        let rod_m2 = self.areas_m2[0] - self.areas_m2[1];
        let force = pressures[0] * self.areas_m2[0]
            - pressures[1] * self.areas_m2[1]
            - gas.ambient_pressure_pa * rod_m2
            - axis.cylinder.friction.viscous_n_s_m * y[5]
            + axis.load_n;
        dy[4] = y[5];
        dy[5] = force / axis.moving_mass_kg;
        dy
    }

    /// Wall of a chamber: dead volume, both ends, the tube up to the piston.
    fn wall_m2(&self, chamber: usize, stroke_m: f64) -> f64 {
        let c = &self.axis.cylinder;
        let length_m = [stroke_m, c.stroke_m - stroke_m][chamber];
        c.dead_wall_area_m2 + 2.0 * self.areas_m2[0] + std::f64::consts::PI * c.bore_m * length_m
    }
}

/// Mass flow from the first place to the second, each with pressure \[Pa\] and temperature \[K\],
/// and the temperature that it brings.
fn flow(path: &Iso6358, gas: &GasParams, from: (f64, f64), to: (f64, f64)) -> (f64, f64) {
    if from.0 < to.0 {
        let (m, t) = flow(path, gas, to, from);
        return (-m, t);
    }
    let (b, m) = (path.critical_ratio, path.subsonic_exponent);
    let subsonic = |ratio: f64| (1.0 - ((ratio - b) / (1.0 - b)).powi(2)).powf(m);
    let ratio = to.0 / from.0;
    let psi = if ratio <= b {
        1.0
    } else if ratio <= path.linear_ratio {
        subsonic(ratio)
    } else {
        subsonic(path.linear_ratio) * (1.0 - ratio) / (1.0 - path.linear_ratio)
    };
    let warm = (gas.reference_temperature_k / from.1).sqrt();
    let mass = path.conductance_m3_s_pa * gas.reference_density_kg_m3 * from.0 * warm * psi;
    (mass, from.1)
}
