//! Gas rates and forces of one cylinder, with everything a step needs precomputed.

use super::{CylinderParams, CylinderState};
use crate::chamber::{ChamberRates, ChamberState, Content, GasModel};
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
    pub(crate) a: ChamberRates,
    pub(crate) b: ChamberRates,
    /// From the supply \[kg/s\].
    pub(crate) supply_kg_s: f64,
    /// To the atmosphere \[kg/s\].
    pub(crate) vent_kg_s: f64,
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
        Ok(Self {
            params: params.clone(),
            gas: *gas,
            area_a_m2: bore,
            area_b_m2: bore - rod,
            rod_area_m2: rod,
            volume_a0_m3: params.dead_volume_a_m3 + params.line_volume_m3,
            volume_b0_m3: params.dead_volume_b_m3
                + params.line_volume_m3
                + (bore - rod) * params.stroke_m,
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
        chambers: [Content; 2],
        stroke_m: f64,
        v_m_s: f64,
        supply_pa: f64,
    ) -> CylinderRates {
        let gas = &self.gas;
        let ambient = (gas.ambient_pressure_pa, gas.ambient_temperature_k);
        let p = [
            chambers[0].pv_j / self.volume_a_m3(stroke_m),
            chambers[1].pv_j / self.volume_b_m3(stroke_m),
        ];
        let mut out = CylinderRates::default();
        out.a.work_w = p[0] * self.area_a_m2 * v_m_s;
        out.b.work_w = -p[1] * self.area_b_m2 * v_m_s;
        if state.open_mask == 0 && !self.has_leak && self.thermal.is_none() {
            return out;
        }
        let (mut t, mut sqrt_t) = ([ambient.1; 2], [self.sqrt_ambient_t; 2]);
        if let Some(h) = self.thermal {
            let bore = self.params.bore_m;
            let ends = 2.0 * self.area_a_m2;
            let wall = self.params.dead_wall_area_m2;
            let side = std::f64::consts::PI * bore;
            let areas = [
                wall + ends + side * stroke_m,
                wall + ends + side * (self.params.stroke_m - stroke_m),
            ];
            for i in 0..2 {
                t[i] = chambers[i].pv_j / (chambers[i].mass_kg * gas.gas_constant_j_kg_k);
                sqrt_t[i] = t[i].sqrt();
            }
            out.a.heat_w = h * areas[0] * (ambient.1 - t[0]);
            out.b.heat_w = h * areas[1] * (ambient.1 - t[1]);
        }
        let mut exchange = |chamber: usize, m: f64, t_up: f64| {
            let side = if chamber == 0 { &mut out.a } else { &mut out.b };
            side.mass_kg_s += m;
            side.inflow_w += self.exponent_r * t_up * m;
        };
        let (mut supply, mut vent) = (0.0, 0.0);
        for c in 0..2 {
            if state.open_mask >> (2 * c) & 1 == 1 {
                let m = self.restrictors[2 * c].mass_flow_kg_s(
                    supply_pa,
                    self.sqrt_ambient_t,
                    p[c],
                    sqrt_t[c],
                );
                exchange(c, m, if m >= 0.0 { ambient.1 } else { t[c] });
                supply += m;
            }
            if state.open_mask >> (2 * c + 1) & 1 == 1 {
                let m = self.restrictors[2 * c + 1].mass_flow_kg_s(
                    p[c],
                    sqrt_t[c],
                    ambient.0,
                    self.sqrt_ambient_t,
                );
                exchange(c, -m, if m >= 0.0 { t[c] } else { ambient.1 });
                vent += m;
            }
        }
        if self.has_leak {
            let piston = leak_kg_s(self.params.piston_leak_m3_s_pa, gas, p[0], p[1]);
            let t_up = if piston >= 0.0 { t[0] } else { t[1] };
            exchange(0, -piston, t_up);
            exchange(1, piston, t_up);
            let rod = leak_kg_s(self.params.rod_leak_m3_s_pa, gas, p[1], ambient.0);
            exchange(1, -rod, if rod >= 0.0 { t[1] } else { ambient.1 });
            vent += rod;
        }
        out.supply_kg_s = supply;
        out.vent_kg_s = vent;
        out
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
