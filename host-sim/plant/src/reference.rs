//! The published benchmark cylinder: bore 32 mm, 4 kg, four valves of first-order
//! lag, tanh friction, a three-state loop of 1 kHz, RK4.
//!
//! It is simpler than this crate's plant, and other programs have integrated it: its check
//! values are 386 switches and 6.487 mm RMS error over 10 s. So it serves as a
//! yardstick twice: the flow function of [`crate::flow`] must give these numbers, and
//! the time it takes stands beside that of the C program it comes from.
//!
//! [`bench_axis`] is this crate's whole plant at the same parameters.

use crate::axis::AxisParams;
use crate::chamber::GasModel;
use crate::flow::{GasParams, Iso6358, Restrictor};
use crate::testing::{air, vq110u_axis};

const SUPPLY_PA: f64 = 7.0e5;
const AREA_A_M2: f64 = 8.042_477_2e-4;
const AREA_B_M2: f64 = 6.911_503_8e-4;
const DEAD_M3: f64 = 1.0e-5;
const STROKE_M: f64 = 0.2;
const LOAD_N: f64 = 40.0;
const MASS_KG: f64 = 4.0;
const EXPONENT: f64 = 1.2;
const COULOMB_N: f64 = 20.0;
const STATIC_N: f64 = 30.0;
const VISCOUS_N_S_M: f64 = 50.0;
const STRIBECK_M_S: f64 = 0.05;
/// Speed over which the friction changes its sign \[m/s\].
const SIGN_M_S: f64 = 0.002;
/// Beyond this multiple of that speed tanh is 1 to the last bit of a double.
const SIGN_FULL: f64 = 20.0;
const STOP_N_M: f64 = 1e6;
const STOP_N_S_M: f64 = 500.0;
/// Lag of a valve \[s\].
const LAG_S: f64 = 1e-3;

/// x \[m\], v \[m/s\], pA, pB \[Pa\], and the openings fill A, vent A, fill B, vent B.
pub type State = [f64; 8];

/// The state at the start.
pub const START: State = [0.1, 0.0, 3.5e5, 3.5e5, 0.0, 0.0, 0.0, 0.0];

/// Openings commanded by a decision: 1 extends, −1 retracts.
#[must_use]
pub const fn command(decision: i32) -> [f64; 4] {
    match decision {
        1 => [1.0, 0.0, 0.0, 1.0],
        -1 => [0.0, 1.0, 1.0, 0.0],
        _ => [0.0; 4],
    }
}

/// Decision of the three-state loop at tick `k`, and the error \[m\].
#[must_use]
pub fn decide(k: usize, x_m: f64, v_m_s: f64) -> (f64, i32) {
    let w = std::f64::consts::PI;
    let t = 1e-3 * k as f64;
    let error = 0.1 + 0.05 * (w * t).sin() - x_m;
    let c = error + 0.02 * (0.05 * w * (w * t).cos() - v_m_s);
    (error, i32::from(c > 0.003) - i32::from(c < -0.003))
}

/// Each valve's flow path.
#[must_use]
pub fn path() -> Iso6358 {
    Iso6358 {
        conductance_m3_s_pa: 3.0e-9,
        critical_ratio: 0.35,
        subsonic_exponent: 0.5,
        linear_ratio: 0.995,
    }
}

/// Result of a loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Looped {
    /// Root mean square of the error \[mm\].
    pub rms_mm: f64,
    /// Changes of the decision.
    pub switches: u32,
}

/// Runs the three-state loop for `ticks` of 1 ms: `step` advances one tick under the
/// decision of two ticks ago and gives position and speed.
///
/// # Errors
/// The errors of `step`.
pub fn three_state_loop<E>(
    ticks: usize,
    (mut x_m, mut v_m_s): (f64, f64),
    mut step: impl FnMut(i32) -> Result<(f64, f64), E>,
) -> Result<Looped, E> {
    let (mut ring, mut squares, mut switches) = ([0; 3], 0.0, 0);
    for k in 0..ticks {
        let (error, decision) = decide(k, x_m, v_m_s);
        ring[k % 3] = decision;
        squares += error * error;
        if k > 0 && decision != ring[(k + 2) % 3] {
            switches += 1;
        }
        let late = if k >= 2 { ring[(k + 1) % 3] } else { 0 };
        (x_m, v_m_s) = step(late)?;
    }
    Ok(Looped {
        rms_mm: (squares / ticks as f64).sqrt() * 1e3,
        switches,
    })
}

/// The model.
#[derive(Debug, Clone)]
pub struct Reference {
    valve: Restrictor,
    gas: GasParams,
    /// Mass flow of a choked valve over its upstream pressure \[kg/(s Pa)\].
    choked: f64,
}

impl Default for Reference {
    fn default() -> Self {
        Self::new()
    }
}

impl Reference {
    /// With the flow function of this crate.
    #[must_use]
    pub fn new() -> Self {
        let gas = air();
        let path = path();
        Self {
            valve: Restrictor::new(&path, &gas),
            choked: path.conductance_m3_s_pa * gas.reference_density_kg_m3,
            gas,
        }
    }

    /// Mass flow through a whole opening \[kg/s\], negative when gas runs back. The
    /// gas has the temperature of the reference.
    #[inline]
    fn flow(&self, from_pa: f64, to_pa: f64) -> f64 {
        if from_pa >= to_pa {
            self.choked * self.valve.throughput_pa(from_pa, to_pa)
        } else {
            -self.choked * self.valve.throughput_pa(to_pa, from_pa)
        }
    }

    /// d/dt of the state.
    #[must_use]
    // Four copies in a step, held in registers: a third faster than calls.
    #[inline(always)]
    pub fn rates(&self, y: &State, u: &[f64; 4]) -> State {
        let [x, v, pa, pb, s0, s1, s2, s3] = *y;
        let atmosphere = self.gas.ambient_pressure_pa;
        let ma = s0 * self.flow(SUPPLY_PA, pa) - s1 * self.flow(pa, atmosphere);
        let mb = s2 * self.flow(SUPPLY_PA, pb) - s3 * self.flow(pb, atmosphere);
        let (va, vb) = (
            DEAD_M3 + AREA_A_M2 * x,
            DEAD_M3 + AREA_B_M2 * (STROKE_M - x),
        );
        let slide = v * (1.0 / STRIBECK_M_S);
        let stribeck = (-slide * slide).exp();
        let turn = v * (1.0 / SIGN_M_S);
        let sign = if turn.abs() > SIGN_FULL {
            turn.signum()
        } else {
            turn.tanh()
        };
        let friction = (COULOMB_N + (STATIC_N - COULOMB_N) * stribeck) * sign + VISCOUS_N_S_M * v;
        let over = if x > STROKE_M {
            x - STROKE_M
        } else {
            x.min(0.0)
        };
        let stop = if over == 0.0 {
            0.0
        } else {
            STOP_N_M * over + STOP_N_S_M * v
        };
        let force = AREA_A_M2 * (pa - atmosphere) - AREA_B_M2 * (pb - atmosphere);
        let rt = self.gas.gas_constant_j_kg_k * self.gas.ambient_temperature_k;
        let lag = |i: usize| (u[i] - y[4 + i]) * (1.0 / LAG_S);
        [
            v,
            (force - LOAD_N - friction - stop) * (1.0 / MASS_KG),
            EXPONENT / va * (rt * ma - pa * AREA_A_M2 * v),
            EXPONENT / vb * (rt * mb + pb * AREA_B_M2 * v),
            lag(0),
            lag(1),
            lag(2),
            lag(3),
        ]
    }

    /// One classical Runge-Kutta step of `h` seconds.
    #[inline]
    pub fn rk4(&self, y: &mut State, u: &[f64; 4], h: f64) {
        let at =
            |y: &State, k: &State, h: f64| -> State { std::array::from_fn(|i| y[i] + h * k[i]) };
        let k1 = self.rates(y, u);
        let k2 = self.rates(&at(y, &k1, 0.5 * h), u);
        let k3 = self.rates(&at(y, &k2, 0.5 * h), u);
        let k4 = self.rates(&at(y, &k3, h), u);
        for i in 0..8 {
            y[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
    }

    /// The closed loop over `ticks` of 1 ms with `steps` steps in each.
    #[must_use]
    pub fn closed_loop(&self, ticks: usize, steps: u32) -> Looped {
        let mut y = START;
        let h = 1e-3 / f64::from(steps);
        let looped = three_state_loop(ticks, (y[0], y[1]), |decision| {
            let u = command(decision);
            for _ in 0..steps {
                self.rk4(&mut y, &u, h);
            }
            Ok::<_, std::convert::Infallible>((y[0], y[1]))
        });
        match looped {
            Ok(looped) => looped,
            Err(never) => match never {},
        }
    }

    /// The state after an open-loop sequence of 200 ms: extend 40 ms, shut 40 ms, retract 40 ms, shut
    /// 80 ms; `steps` steps in each millisecond.
    #[must_use]
    pub fn open_loop(&self, steps: u32) -> State {
        let mut y = START;
        for k in 0..200 {
            let u = command(match k {
                0..40 => 1,
                80..120 => -1,
                _ => 0,
            });
            for _ in 0..steps {
                self.rk4(&mut y, &u, 1e-3 / f64::from(steps));
            }
        }
        y
    }

    /// Error of [`Reference::open_loop`] against 2 µs steps, as a share of 50 mm,
    /// 0.3 m/s and 3 bar; the largest of the four.
    #[must_use]
    pub fn open_loop_error(&self, steps: u32) -> f64 {
        let (y, exact) = (self.open_loop(steps), self.open_loop(500));
        [0.05, 0.3, 3e5, 3e5]
            .iter()
            .enumerate()
            .map(|(i, scale)| (y[i] - exact[i]).abs() / scale)
            .fold(0.0, f64::max)
    }
}

/// This crate's whole plant at the reference's parameters: friction that sticks, valves with dead
/// times, leaks off, a supply that does not sag.
#[must_use]
pub fn bench_axis() -> AxisParams {
    let mut p = vq110u_axis();
    p.moving_mass_kg = MASS_KG;
    p.load_n = -LOAD_N;
    p.initial_stroke_m = START[0];
    p.supply.set_pressure_pa = SUPPLY_PA;
    p.supply.initial_pressure_pa = SUPPLY_PA;
    p.supply.reservoir_m3 = 1.0;
    let c = &mut p.cylinder;
    (c.bore_m, c.rod_m, c.stroke_m) = (0.032, 0.012, STROKE_M);
    (c.dead_volume_a_m3, c.dead_volume_b_m3) = (DEAD_M3, DEAD_M3);
    (c.line_volume_m3, c.line_flow, c.line_delay_s) = (0.0, None, 0.0);
    (c.piston_leak_m3_s_pa, c.rod_leak_m3_s_pa) = (0.0, 0.0);
    c.gas_model = GasModel::Polytropic { exponent: EXPONENT };
    for valve in [&mut c.fill_valve, &mut c.vent_valve] {
        valve.flow = path();
        // A lag of 1 ms passes as much as a dead time of 1 ms.
        (valve.t_on_s, valve.t_off_s) = (LAG_S, LAG_S);
    }
    let f = &mut c.friction;
    (f.coulomb_n, f.static_n, f.viscous_n_s_m) = (COULOMB_N, STATIC_N, VISCOUS_N_S_M);
    f.stribeck_m_s = STRIBECK_M_S;
    c.end_stop.cushion_length_m = 0.0;
    (c.initial_pressure_a_pa, c.initial_pressure_b_pa) = (START[2], START[3]);
    p
}
