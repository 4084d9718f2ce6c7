//! One double-acting cylinder with its four valves: parameters, state, gas rates.
//!
//! Valve order everywhere: `[fill A, vent A, fill B, vent B]`. Chamber A is on
//! the bore side and extends the cylinder (positive force, positive velocity).

use serde::{Deserialize, Serialize};

use crate::chamber::{ChamberRates, ChamberState, Content, GasModel};
use crate::endstop::EndStopParams;
use crate::error::{PlantError, check, check_state};
use crate::flow::{GasParams, Iso6358, Restrictor, leak_kg_s};
use crate::friction::FrictionParams;
use crate::hash::StateHasher;
use crate::valve::{NEVER_NS, ValveParams, ValveState, ValveTiming};

/// Longest line delay the valve model can hold \[s\].
const MAX_LINE_DELAY_S: f64 = 7e-3;

/// One cylinder, its line and its valves. SI units; ranges as checked by
/// [`CylinderParams::validate`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CylinderParams {
    /// Bore \[m\], 0.004..0.2.
    pub bore_m: f64,
    /// Rod diameter \[m\], 0..bore.
    pub rod_m: f64,
    /// Stroke between the stops \[m\], 0.001..2.
    pub stroke_m: f64,
    /// Dead volume at the end of chamber A: port, fitting, valve \[m³\], 1e-8..1e-3.
    pub dead_volume_a_m3: f64,
    /// Dead volume of chamber B \[m³\], 1e-8..1e-3.
    pub dead_volume_b_m3: f64,
    /// Volume of the tube of each chamber \[m³\], 0..1e-3.
    pub line_volume_m3: f64,
    /// Flow path of the tube of each chamber, in series with each of its valves.
    /// `None` leaves the tube out of the flow (its volume still counts).
    pub line_flow: Option<Iso6358>,
    /// Travel time of the pressure wave in the tube, L/c \[s\], 0..0.007.
    pub line_delay_s: f64,
    /// Wall area of dead volume and tube for heat exchange \[m²\], 0..1.
    pub dead_wall_area_m2: f64,
    /// Leak past the piston seal, G at the reference atmosphere \[m³/(s Pa)\], 0..1e-9.
    pub piston_leak_m3_s_pa: f64,
    /// Leak past the rod seal from chamber B \[m³/(s Pa)\], 0..1e-9.
    pub rod_leak_m3_s_pa: f64,
    /// Valves from the supply.
    pub fill_valve: ValveParams,
    /// Valves to the atmosphere.
    pub vent_valve: ValveParams,
    /// Factor on the switching times of each valve \[-\], 0.1..10.
    pub timing_spread: [f64; 4],
    /// Heat exchange model of both chambers.
    pub gas_model: GasModel,
    /// Seal friction.
    pub friction: FrictionParams,
    /// End stops.
    pub end_stop: EndStopParams,
    /// Pressure of chamber A at the start \[Pa absolute\], 1e4..2e6.
    pub initial_pressure_a_pa: f64,
    /// Pressure of chamber B at the start \[Pa absolute\], 1e4..2e6.
    pub initial_pressure_b_pa: f64,
}

impl CylinderParams {
    /// Checks every field against its valid range.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the first field outside its range.
    pub fn validate(&self) -> Result<(), PlantError> {
        check("cylinder.bore_m", self.bore_m, 0.004, 0.2)?;
        check("cylinder.rod_m", self.rod_m, 0.0, self.bore_m * 0.9)?;
        check("cylinder.stroke_m", self.stroke_m, 0.001, 2.0)?;
        check(
            "cylinder.dead_volume_a_m3",
            self.dead_volume_a_m3,
            1e-8,
            1e-3,
        )?;
        check(
            "cylinder.dead_volume_b_m3",
            self.dead_volume_b_m3,
            1e-8,
            1e-3,
        )?;
        check("cylinder.line_volume_m3", self.line_volume_m3, 0.0, 1e-3)?;
        check(
            "cylinder.line_delay_s",
            self.line_delay_s,
            0.0,
            MAX_LINE_DELAY_S,
        )?;
        check(
            "cylinder.dead_wall_area_m2",
            self.dead_wall_area_m2,
            0.0,
            1.0,
        )?;
        check(
            "cylinder.piston_leak_m3_s_pa",
            self.piston_leak_m3_s_pa,
            0.0,
            1e-9,
        )?;
        check(
            "cylinder.rod_leak_m3_s_pa",
            self.rod_leak_m3_s_pa,
            0.0,
            1e-9,
        )?;
        for spread in self.timing_spread {
            check("cylinder.timing_spread", spread, 0.1, 10.0)?;
        }
        check(
            "cylinder.initial_pressure_a_pa",
            self.initial_pressure_a_pa,
            1e4,
            2e6,
        )?;
        check(
            "cylinder.initial_pressure_b_pa",
            self.initial_pressure_b_pa,
            1e4,
            2e6,
        )?;
        if let Some(line) = &self.line_flow {
            line.validate()?;
        }
        self.fill_valve.validate()?;
        self.vent_valve.validate()?;
        self.gas_model.validate()?;
        self.friction.validate()?;
        self.end_stop.validate()
    }
}

/// State of one cylinder. The piston's position and speed belong to the mechanics.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CylinderState {
    /// Bore-side chamber, extends.
    pub chamber_a: ChamberState,
    /// Rod-side chamber, retracts.
    pub chamber_b: ChamberState,
    /// The four valves.
    pub valves: [ValveState; 4],
    /// When each driver's level falls in this tick \[ns\], [`NEVER_NS`] if it does not.
    pub command_fall_ns: [u64; 4],
    /// Seal bristle deflection \[m\].
    pub bristle_m: f64,
    /// Mass taken from the supply so far \[kg\], back flow subtracted.
    pub supply_mass_kg: f64,
    /// Mass vented to the atmosphere so far \[kg\], leaks included.
    pub vented_mass_kg: f64,
    /// Next time at which a command, poppet or effect changes \[ns\].
    next_event_ns: u64,
    /// Which effects are open, bit per valve.
    open_mask: u8,
}

impl CylinderState {
    /// Adds the state to a hash in declaration order.
    pub fn feed(&self, hasher: &mut StateHasher) {
        self.chamber_a.feed(hasher);
        self.chamber_b.feed(hasher);
        for (valve, fall) in self.valves.iter().zip(self.command_fall_ns) {
            valve.feed(hasher);
            hasher.u64(fall);
        }
        hasher.f64(self.bristle_m);
        hasher.f64(self.supply_mass_kg);
        hasher.f64(self.vented_mass_kg);
    }

    /// Next time at which a command, poppet or effect changes \[ns\].
    #[must_use]
    #[inline]
    pub fn next_event_ns(&self) -> u64 {
        self.next_event_ns
    }

    /// Recomputes what is cached; call after changing a valve or a fault by hand.
    pub fn refresh(&mut self) {
        self.next_event_ns = NEVER_NS;
        self.open_mask = 0;
        for (i, valve) in self.valves.iter().enumerate() {
            self.next_event_ns = self
                .next_event_ns
                .min(valve.next_edge_ns())
                .min(self.command_fall_ns[i]);
            self.open_mask |= u8::from(valve.is_open()) << i;
        }
    }
}

/// Net forces on one piston, all positive extending \[N\].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CylinderForces {
    /// pA AA − pB AB − p_atm A_rod.
    pub pressure_n: f64,
    /// Seal friction as it acts on the piston (against its motion).
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

/// Gas rates of a cylinder and what they take from its surroundings.
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

    /// All forces on the piston at a position and speed.
    #[must_use]
    #[inline]
    pub fn forces(&self, state: &CylinderState, stroke_m: f64, v_m_s: f64) -> CylinderForces {
        let [a, b] = self.pressures_pa(state, stroke_m);
        CylinderForces {
            pressure_n: self.pressure_force_n(a, b),
            friction_n: -self.params.friction.force_n(state.bristle_m, v_m_s),
            end_stop_n: self
                .params
                .end_stop
                .force_n(stroke_m, self.params.stroke_m, v_m_s),
        }
    }

    /// Gas rates with the valves as they stand.
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

    /// Refuses a state that is not finite or has left the model's range.
    ///
    /// # Errors
    /// [`PlantError::NonFinite`] or [`PlantError::OutOfBounds`] with the name.
    pub fn check(
        &self,
        state: &CylinderState,
        index: usize,
        stroke_m: f64,
    ) -> Result<(), PlantError> {
        // A tenth of the stroke past a stop means the stop did not hold.
        let margin = 0.1 * self.params.stroke_m;
        check_state(
            "stroke_m",
            index,
            stroke_m,
            -margin,
            self.params.stroke_m + margin,
        )?;
        let [a, b] = self.pressures_pa(state, stroke_m);
        check_state("pressure_a_pa", index, a, 1e3, 1e7)?;
        check_state("pressure_b_pa", index, b, 1e3, 1e7)?;
        check_state("mass_a_kg", index, state.chamber_a.mass_kg, 0.0, 1.0)?;
        check_state("mass_b_kg", index, state.chamber_b.mass_kg, 0.0, 1.0)?;
        check_state("bristle_m", index, state.bristle_m, -1.0, 1.0)
    }
}
