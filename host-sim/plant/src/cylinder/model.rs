//! Gas rates and forces of one cylinder, with everything a step needs precomputed.

use super::{CylinderParams, CylinderState};
use crate::both::Both;
use crate::chamber::{ChamberRates, ChamberState, Contents, GasModel};
use crate::error::{PlantError, check_state};
use crate::flow::{GasParams, Restrictor, leak_kg_s};
use crate::friction::FrictionParams;
use crate::supply::PRESSURES_PA;
use crate::valve::{NEVER_NS, ValveParams, ValveState, ValveTiming};

/// Net forces on one piston, all positive extending \[N\].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CylinderForces {
    /// pA AA − pB AB − p_atm A_rod.
    pub pressure_n: f64,
    /// Seal friction on the piston (against its motion).
    pub friction_n: f64,
    /// End stops and cushions.
    pub end_stop_n: f64,
}

impl CylinderForces {
    /// Net generalised force on the joint: pressure, seal friction and end stop.
    #[must_use]
    #[inline]
    pub fn net_n(&self) -> f64 {
        self.pressure_n + self.friction_n + self.end_stop_n
    }
}

/// Gas rates of a cylinder and the flows they take from its surroundings.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct CylinderRates {
    pub(crate) chambers: ChamberRates,
    /// From the supply \[kg/s\].
    pub(crate) supply_kg_s: f64,
    /// To the atmosphere \[kg/s\].
    pub(crate) vent_kg_s: f64,
}

/// What valves and leaks bring to chambers A and B.
#[derive(Debug, Clone, Copy, Default)]
struct Flows {
    mass_kg_s: [f64; 2],
    inflow_w: [f64; 2],
    supply_kg_s: f64,
    vent_kg_s: f64,
}

impl Flows {
    /// `m` kg/s into a chamber, each with a `warmth` of n R T upstream \[J/kg\].
    #[inline]
    fn exchange(&mut self, chamber: usize, m: f64, warmth: f64) {
        self.mass_kg_s[chamber] += m;
        self.inflow_w[chamber] += warmth * m;
    }
}

/// Constants of chambers A and B.
#[derive(Debug, Clone, Copy)]
struct BothChambers {
    /// Volume at stroke 0 \[m³\].
    volume0_m3: Both,
    /// How it grows with the stroke \[m²\].
    area_m2: Both,
    /// Wall area without the bore's \[m²\].
    wall_m2: Both,
}

/// One cylinder with everything a step needs precomputed.
#[derive(Debug, Clone)]
pub struct CylinderModel {
    pub(crate) params: CylinderParams,
    gas: GasParams,
    pub(crate) area_a_m2: f64,
    pub(crate) area_b_m2: f64,
    rod_area_m2: f64,
    volume_a0_m3: f64,
    volume_b0_m3: f64,
    both: BothChambers,
    restrictors: [Restrictor; 4],
    pub(crate) timing: [ValveTiming; 4],
    /// n of the gas balance.
    pub(crate) exponent: f64,
    /// n R.
    exponent_r: f64,
    sqrt_ambient_t: f64,
    thermal: Option<f64>,
    has_leak: bool,
}

impl CylinderModel {
    /// Precomputes a cylinder.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] if a parameter is outside its range.
    pub fn new(params: &CylinderParams, gas: &GasParams) -> Result<Self, PlantError> {
        params.validate()?;
        let circle = |d: f64| std::f64::consts::FRAC_PI_4 * d * d;
        let (bore, rod) = (circle(params.bore_m), circle(params.rod_m));
        let with_line = |valve: &ValveParams, filling: bool| {
            let path = match (&params.line_flow, filling) {
                (None, _) => valve.flow,
                (Some(line), true) => valve.flow.in_series(line),
                (Some(line), false) => line.in_series(&valve.flow),
            };
            Restrictor::new(&path, gas)
        };
        let fill = with_line(&params.fill_valve, true);
        let vent = with_line(&params.vent_valve, false);
        let timing = std::array::from_fn(|i| {
            let valve = if i % 2 == 0 {
                &params.fill_valve
            } else {
                &params.vent_valve
            };
            ValveTiming::new(valve, params.timing_spread[i], params.line_delay_s)
        });
        let (exponent, thermal) = match params.gas_model {
            GasModel::Polytropic { exponent } => (exponent, None),
            GasModel::Thermal {
                heat_transfer_w_m2_k,
            } => (gas.heat_capacity_ratio, Some(heat_transfer_w_m2_k)),
        };
        let volume_a0_m3 = params.dead_volume_a_m3 + params.line_volume_m3;
        let volume_b0_m3 =
            params.dead_volume_b_m3 + params.line_volume_m3 + (bore - rod) * params.stroke_m;
        Ok(Self {
            params: params.clone(),
            gas: *gas,
            area_a_m2: bore,
            area_b_m2: bore - rod,
            rod_area_m2: rod,
            volume_a0_m3,
            volume_b0_m3,
            both: BothChambers {
                volume0_m3: Both::new([volume_a0_m3, volume_b0_m3]),
                area_m2: Both::new([bore, -(bore - rod)]),
                wall_m2: Both::splat(params.dead_wall_area_m2 + 2.0 * bore),
            },
            restrictors: [fill, vent, fill, vent],
            timing,
            exponent,
            exponent_r: exponent * gas.gas_constant_j_kg_k,
            sqrt_ambient_t: gas.ambient_temperature_k.sqrt(),
            thermal,
            has_leak: params.piston_leak_m3_s_pa > 0.0 || params.rod_leak_m3_s_pa > 0.0,
        })
    }

    /// The fastest rate at which a chamber at its end fills or empties \[1/s\]: its pressure
    /// near that of the supply or the ambience, where the flow is linear and steepest.
    /// `chamber_b` chooses B.
    #[must_use]
    pub fn fastest_rate_1_s(&self, chamber_b: bool) -> f64 {
        let volume_m3 = match chamber_b {
            false => self.volume_a0_m3,
            true => self.volume_b_m3(self.params.stroke_m),
        };
        let steepest = self.restrictors[0]
            .steepest_kg_s_pa(self.sqrt_ambient_t)
            .max(self.restrictors[1].steepest_kg_s_pa(self.sqrt_ambient_t));
        self.exponent_r * self.gas.ambient_temperature_k * steepest / volume_m3
    }

    /// Parameters the model was built from.
    #[must_use]
    pub fn params(&self) -> &CylinderParams {
        &self.params
    }

    /// Volume of chamber A at a stroke \[m³\].
    #[must_use]
    #[inline]
    pub fn volume_a_m3(&self, stroke_m: f64) -> f64 {
        self.volume_a0_m3 + self.area_a_m2 * stroke_m
    }

    /// Volume of chamber B at a stroke \[m³\].
    #[must_use]
    #[inline]
    pub fn volume_b_m3(&self, stroke_m: f64) -> f64 {
        self.volume_b0_m3 - self.area_b_m2 * stroke_m
    }

    /// Absolute pressures of A and B \[Pa\] with the piston at `stroke_m`.
    #[must_use]
    #[inline]
    pub fn pressures_pa(&self, state: &CylinderState, stroke_m: f64) -> [f64; 2] {
        [
            state.chamber_a.pv_j / self.volume_a_m3(stroke_m),
            state.chamber_b.pv_j / self.volume_b_m3(stroke_m),
        ]
    }

    /// Gas temperatures of A and B \[K\]. The polytropic model has one
    /// temperature, the ambient.
    #[must_use]
    pub fn temperatures_k(&self, state: &CylinderState) -> [f64; 2] {
        match self.thermal {
            None => [self.gas.ambient_temperature_k; 2],
            Some(_) => [&state.chamber_a, &state.chamber_b]
                .map(|c| c.pv_j / (c.mass_kg * self.gas.gas_constant_j_kg_k)),
        }
    }

    /// Cylinder at rest at `stroke_m` with the starting pressures, valves shut.
    #[must_use]
    pub fn initial_state(&self, stroke_m: f64) -> CylinderState {
        CylinderState {
            chamber_a: ChamberState::filled(
                self.params.initial_pressure_a_pa,
                self.volume_a_m3(stroke_m),
                &self.gas,
            ),
            chamber_b: ChamberState::filled(
                self.params.initial_pressure_b_pa,
                self.volume_b_m3(stroke_m),
                &self.gas,
            ),
            valves: std::array::from_fn(|_| ValveState::default()),
            command_fall_ns: [NEVER_NS; 4],
            bristle_m: 0.0,
            supply_mass_kg: 0.0,
            vented_mass_kg: 0.0,
            next_event_ns: NEVER_NS,
            open_mask: 0,
        }
    }

    /// Replaces the gas by gas at given pressures and ambient temperature; the
    /// ledgers start again. For setting up experiments.
    pub fn set_pressures(&self, state: &mut CylinderState, stroke_m: f64, a_pa: f64, b_pa: f64) {
        state.chamber_a = ChamberState::filled(a_pa, self.volume_a_m3(stroke_m), &self.gas);
        state.chamber_b = ChamberState::filled(b_pa, self.volume_b_m3(stroke_m), &self.gas);
    }

    /// Latches one tick's commands: each driver is on from `now_ns` for
    /// `on_time_us` (0..=1000; 1000 stays on into the next tick).
    pub fn command(
        &self,
        state: &mut CylinderState,
        now_ns: u64,
        on_time_us: [u16; 4],
        tick_us: u16,
    ) {
        for (i, on_us) in on_time_us.into_iter().enumerate() {
            state.valves[i].command(on_us > 0, now_ns, &self.timing[i]);
            state.command_fall_ns[i] = if on_us > 0 && on_us < tick_us {
                now_ns.saturating_add(u64::from(on_us) * 1000)
            } else {
                NEVER_NS
            };
        }
        state.refresh();
    }

    /// Takes every command, poppet and effect edge due at `now_ns`.
    ///
    /// # Errors
    /// [`PlantError::EdgeQueueFull`] names the valve.
    pub fn settle(&self, state: &mut CylinderState, now_ns: u64) -> Result<(), PlantError> {
        for (i, valve) in state.valves.iter_mut().enumerate() {
            let timing = &self.timing[i];
            let settle = |v: &mut ValveState| {
                v.settle(now_ns, timing)
                    .map_err(|_| PlantError::EdgeQueueFull(i))
            };
            // A poppet that arrives at the very instant its command falls has arrived.
            settle(valve)?;
            if state.command_fall_ns[i] <= now_ns {
                valve.command(false, state.command_fall_ns[i], timing);
                state.command_fall_ns[i] = NEVER_NS;
                settle(valve)?;
            }
        }
        state.refresh();
        Ok(())
    }

    /// Pressure force on the piston \[N\], positive extending.
    #[must_use]
    #[inline]
    pub fn pressure_force_n(&self, a_pa: f64, b_pa: f64) -> f64 {
        a_pa * self.area_a_m2
            - b_pa * self.area_b_m2
            - self.gas.ambient_pressure_pa * self.rod_area_m2
    }

    /// Seal friction at the chamber pressures.
    #[must_use]
    #[inline]
    pub fn friction(&self, pressures_pa: [f64; 2]) -> FrictionParams {
        let [a, b] = pressures_pa;
        let gauge_pa = a.max(b) - self.gas.ambient_pressure_pa;
        self.params.friction.under_pressure(gauge_pa)
    }

    /// All forces on the piston at a position and speed.
    #[must_use]
    #[inline]
    pub fn forces(&self, state: &CylinderState, stroke_m: f64, v_m_s: f64) -> CylinderForces {
        let pressures_pa = self.pressures_pa(state, stroke_m);
        let friction = self.friction(pressures_pa);
        self.forces_with(&friction, pressures_pa, state.bristle_m, (stroke_m, v_m_s))
    }

    /// The same with known pressures \[Pa\] and friction.
    #[inline]
    pub(crate) fn forces_with(
        &self,
        friction: &FrictionParams,
        [a, b]: [f64; 2],
        bristle_m: f64,
        (stroke_m, v_m_s): (f64, f64),
    ) -> CylinderForces {
        CylinderForces {
            pressure_n: self.pressure_force_n(a, b),
            friction_n: -friction.force_n(bristle_m, v_m_s),
            end_stop_n: self
                .params
                .end_stop
                .force_n(stroke_m, self.params.stroke_m, v_m_s),
        }
    }

    /// Gas rates with the present valve states.
    #[inline]
    pub(crate) fn rates(
        &self,
        state: &CylinderState,
        contents: Contents,
        stroke_m: f64,
        v_m_s: f64,
        supply_pa: f64,
    ) -> CylinderRates {
        let gas = &self.gas;
        let ambient = (gas.ambient_pressure_pa, gas.ambient_temperature_k);
        let both = &self.both;
        let pressures_pa = contents.pv_j / (both.volume0_m3 + both.area_m2 * stroke_m);
        let mut out = CylinderRates::default();
        out.chambers.work_w = pressures_pa * both.area_m2 * v_m_s;
        if state.open_mask == 0 && !self.has_leak && self.thermal.is_none() {
            return out;
        }
        let (mut t, mut sqrt_t) = ([ambient.1; 2], [self.sqrt_ambient_t; 2]);
        if let Some(h) = self.thermal {
            let side = std::f64::consts::PI * self.params.bore_m;
            let open = Both::new([stroke_m, self.params.stroke_m - stroke_m]);
            let temperatures = contents.pv_j / (contents.mass_kg * gas.gas_constant_j_kg_k);
            let wall = both.wall_m2 + open * side;
            out.chambers.heat_w = wall * h * (Both::splat(ambient.1) - temperatures);
            t = temperatures.to_array();
            sqrt_t = temperatures.sqrt().to_array();
        }
        if state.open_mask == 0 && !self.has_leak {
            return out;
        }
        let p = pressures_pa.to_array();
        let mut flows = if state.open_mask == 0 {
            Flows::default()
        } else {
            self.through_valves(state.open_mask, p, t, sqrt_t, supply_pa)
        };
        if self.has_leak {
            self.leak(&mut flows, p, t);
        }
        out.chambers.mass_kg_s = Both::new(flows.mass_kg_s);
        out.chambers.inflow_w = Both::new(flows.inflow_w);
        out.supply_kg_s = flows.supply_kg_s;
        out.vent_kg_s = flows.vent_kg_s;
        out
    }

    /// The flows through the open valves at these pressures and temperatures, with the roots of these.
    #[inline(never)]
    fn through_valves(
        &self,
        open_mask: u8,
        p: [f64; 2],
        t: [f64; 2],
        sqrt_t: [f64; 2],
        supply_pa: f64,
    ) -> Flows {
        let gas = &self.gas;
        let ambient = (gas.ambient_pressure_pa, gas.ambient_temperature_k);
        let mut flows = Flows::default();
        for c in 0..2 {
            if open_mask >> (2 * c) & 1 == 1 {
                let m = self.restrictors[2 * c].mass_flow_kg_s(
                    supply_pa,
                    self.sqrt_ambient_t,
                    p[c],
                    sqrt_t[c],
                );
                flows.exchange(
                    c,
                    m,
                    self.exponent_r * if m >= 0.0 { ambient.1 } else { t[c] },
                );
                flows.supply_kg_s += m;
            }
            if open_mask >> (2 * c + 1) & 1 == 1 {
                let m = self.restrictors[2 * c + 1].mass_flow_kg_s(
                    p[c],
                    sqrt_t[c],
                    ambient.0,
                    self.sqrt_ambient_t,
                );
                flows.exchange(
                    c,
                    -m,
                    self.exponent_r * if m >= 0.0 { t[c] } else { ambient.1 },
                );
                flows.vent_kg_s += m;
            }
        }
        flows
    }

    /// Adds the leaks past piston and rod.
    #[inline]
    fn leak(&self, flows: &mut Flows, p: [f64; 2], t: [f64; 2]) {
        let gas = &self.gas;
        let (ambient_pa, ambient_k) = (gas.ambient_pressure_pa, gas.ambient_temperature_k);
        let piston = leak_kg_s(self.params.piston_leak_m3_s_pa, gas, p[0], p[1]);
        let warmth = self.exponent_r * if piston >= 0.0 { t[0] } else { t[1] };
        flows.exchange(0, -piston, warmth);
        flows.exchange(1, piston, warmth);
        let rod = leak_kg_s(self.params.rod_leak_m3_s_pa, gas, p[1], ambient_pa);
        flows.exchange(
            1,
            -rod,
            self.exponent_r * if rod >= 0.0 { t[1] } else { ambient_k },
        );
        flows.vent_kg_s += rod;
    }

    /// Refuses a state that is not finite or has left the model's range; `most_pa` is the largest
    /// pressure that a chamber can have.
    ///
    /// # Errors
    /// [`PlantError::NonFinite`] or [`PlantError::OutOfBounds`] with the name.
    pub fn check(
        &self,
        state: &CylinderState,
        index: usize,
        stroke_m: f64,
        most_pa: f64,
    ) -> Result<(), PlantError> {
        let margin = self.params.stop_margin_m();
        check_state(
            "stroke_m",
            index,
            stroke_m,
            -margin,
            self.params.stroke_m + margin,
        )?;
        let [a, b] = self.pressures_pa(state, stroke_m);
        check_state("pressure_a_pa", index, a, PRESSURES_PA[0], most_pa)?;
        check_state("pressure_b_pa", index, b, PRESSURES_PA[0], most_pa)?;
        // The polytropic law has one temperature and an exponent of its own, so
        // its pV is not m R T: the mass is a sum of flows, which many cycles of
        // filling and venting carry away from pV and may take below zero.
        let least_kg = if self.thermal.is_some() { 0.0 } else { -1.0 };
        check_state("mass_a_kg", index, state.chamber_a.mass_kg, least_kg, 1.0)?;
        check_state("mass_b_kg", index, state.chamber_b.mass_kg, least_kg, 1.0)?;
        check_state("bristle_m", index, state.bristle_m, -1.0, 1.0)
    }
}
