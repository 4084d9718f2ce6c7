//! Air supply shared by the cylinders: source, regulator, reservoir, dump valve, switch.
//!
//! ```text
//! source ──► regulator ──► [dump valve] ──► reservoir ──► fill valves
//! ```
//!
//! The pressure switch is a contact at the reservoir, which sees what the cylinders get and
//! whether a dump empties it; a second contact at the source's connection may be in series
//! with it, which sees a lost or sagging source before the reservoir is used up. Closed
//! contacts mean pressure, so a broken wire reads like none.
//!
//! The dump valve is a 3/2 valve: while it dumps, the source is cut off and
//! the reservoir is open to the atmosphere. The reservoir is isothermal (its
//! wall is large against its gas). Mass is the only state of the gas.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check, check_state};
use crate::flow::{GasParams, Iso6358, Restrictor};
use crate::hash::StateHasher;
use crate::valve::{ValveParams, ValveState, ValveTiming};

/// A heavy piston that runs against trapped air raises it above its supply: of sound axes the most
/// was 2.1 times the source (the combinations of the control bars). Beyond this the numbers are wrong.
const COMPRESSION: f64 = 4.0;
/// The pressures that a chamber or a reservoir can have with any supply \[Pa\].
pub const PRESSURES_PA: [f64; 2] = [1e3, 1e7];

/// The supply.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SupplyParams {
    /// Pressure before the regulator \[Pa absolute\], 1e5..3e7; 0 flow below the reservoir's.
    pub source_pressure_pa: f64,
    /// Regulator set pressure \[Pa absolute\], 1e5..2e6: held at no flow.
    pub set_pressure_pa: f64,
    /// Pressure drop below the set point at which the regulator is fully open \[Pa\],
    /// 100..1e6 (its droop).
    pub droop_pa: f64,
    /// Flow path of the fully open regulator.
    pub regulator_flow: Iso6358,
    /// Reservoir and manifold volume \[m³\], 1e-6..1.
    pub reservoir_m3: f64,
    /// Reservoir pressure at the start \[Pa absolute\], 5e4..2e6.
    pub initial_pressure_pa: f64,
    /// Dump valve: its flow to the atmosphere and its switching times.
    pub dump_valve: ValveParams,
    /// Pressure switch at the reservoir.
    pub switch: SwitchParams,
    /// Contact in series with it, before the regulator.
    pub source_switch: Option<SwitchParams>,
}

/// A pressure switch's contact.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SwitchParams {
    /// Closes above this \[Pa absolute\], 1e4..3e7.
    pub on_pa: f64,
    /// Opens below this \[Pa absolute\], 1e4..on.
    pub off_pa: f64,
}

impl SwitchParams {
    fn validate(&self, [on, off]: [&'static str; 2]) -> Result<(), PlantError> {
        check(on, self.on_pa, 1e4, 3e7)?;
        check(off, self.off_pa, 1e4, self.on_pa)
    }

    /// The contact at `pressure_pa`, which was `closed`.
    #[inline]
    fn closed(&self, closed: bool, pressure_pa: f64) -> bool {
        pressure_pa >= self.on_pa || (closed && pressure_pa >= self.off_pa)
    }
}

impl SupplyParams {
    /// Checks every field against its valid range.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the first field outside its range.
    pub fn validate(&self) -> Result<(), PlantError> {
        check(
            "supply.source_pressure_pa",
            self.source_pressure_pa,
            1e4,
            3e7,
        )?;
        check("supply.set_pressure_pa", self.set_pressure_pa, 1e5, 2e6)?;
        check("supply.droop_pa", self.droop_pa, 100.0, 1e6)?;
        check("supply.reservoir_m3", self.reservoir_m3, 1e-6, 1.0)?;
        check(
            "supply.initial_pressure_pa",
            self.initial_pressure_pa,
            5e4,
            2e6,
        )?;
        self.switch
            .validate(["supply.switch.on_pa", "supply.switch.off_pa"])?;
        if let Some(source_switch) = &self.source_switch {
            source_switch
                .validate(["supply.source_switch.on_pa", "supply.source_switch.off_pa"])?;
        }
        self.regulator_flow.validate()?;
        self.dump_valve.validate()
    }
}

/// State of the supply.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SupplyState {
    /// Gas in the reservoir \[kg\].
    pub mass_kg: f64,
    /// Drawn from the source so far \[kg\].
    pub source_mass_kg: f64,
    /// Dumped to the atmosphere so far \[kg\].
    pub dumped_mass_kg: f64,
    /// Dump valve; open means dumping.
    pub dump: ValveState,
    /// Contacts of the pressure switch at the reservoir and at the source; one that is not
    /// there is closed.
    pub contacts: [bool; 2],
    /// Pressure before the regulator \[Pa absolute\]; starts at the parameter's
    /// value, may be lowered to inject a lost supply.
    pub source_pressure_pa: f64,
}

impl SupplyState {
    /// Pressure switch as read: its contacts in series.
    #[must_use]
    pub fn pressure_switch(&self) -> bool {
        self.contacts == [true; 2]
    }

    /// Adds the state to a hash in declaration order.
    pub fn feed(&self, hasher: &mut StateHasher) {
        hasher.f64(self.mass_kg);
        hasher.f64(self.source_mass_kg);
        hasher.f64(self.dumped_mass_kg);
        self.dump.feed(hasher);
        // A contact at the source that is not there is closed: 0.
        let [reservoir, source] = self.contacts;
        hasher.bytes(&[u8::from(reservoir) | u8::from(!source) << 1]);
        hasher.f64(self.source_pressure_pa);
    }
}

/// Flows of the supply, without those to the cylinders \[kg/s\].
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SupplyRates {
    pub(crate) source_kg_s: f64,
    pub(crate) dump_kg_s: f64,
}

/// The supply with everything a step needs precomputed.
#[derive(Debug, Clone)]
pub struct SupplyModel {
    params: SupplyParams,
    regulator: Restrictor,
    dump: Restrictor,
    pub(crate) dump_timing: ValveTiming,
    ambient_pressure_pa: f64,
    sqrt_t: f64,
    /// R T / V \[Pa/kg\].
    pascal_per_kg: f64,
}

impl SupplyModel {
    /// Precomputes a supply.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] if a parameter is outside its range.
    pub fn new(params: &SupplyParams, gas: &GasParams) -> Result<Self, PlantError> {
        params.validate()?;
        Ok(Self {
            params: *params,
            regulator: Restrictor::new(&params.regulator_flow, gas),
            dump: Restrictor::new(&params.dump_valve.flow, gas),
            dump_timing: ValveTiming::new(&params.dump_valve, 1.0, 0.0),
            ambient_pressure_pa: gas.ambient_pressure_pa,
            sqrt_t: gas.ambient_temperature_k.sqrt(),
            pascal_per_kg: gas.gas_constant_j_kg_k * gas.ambient_temperature_k
                / params.reservoir_m3,
        })
    }

    /// Supply at its starting pressure, not dumping.
    #[must_use]
    pub fn initial_state(&self) -> SupplyState {
        let mut state = SupplyState {
            mass_kg: self.params.initial_pressure_pa / self.pascal_per_kg,
            source_mass_kg: 0.0,
            dumped_mass_kg: 0.0,
            dump: ValveState::default(),
            contacts: [false; 2],
            source_pressure_pa: self.params.source_pressure_pa,
        };
        self.update_switch(&mut state);
        state
    }

    /// Reservoir pressure \[Pa absolute\] for a gas mass.
    #[must_use]
    #[inline]
    pub fn pressure_pa(&self, mass_kg: f64) -> f64 {
        mass_kg * self.pascal_per_kg
    }

    #[inline]
    pub(crate) fn rates(&self, state: &SupplyState, mass_kg: f64) -> SupplyRates {
        let p = self.pressure_pa(mass_kg);
        if state.dump.is_open() {
            return SupplyRates {
                source_kg_s: 0.0,
                dump_kg_s: self.dump.mass_flow_kg_s(
                    p,
                    self.sqrt_t,
                    self.ambient_pressure_pa,
                    self.sqrt_t,
                ),
            };
        }
        let opening = ((self.params.set_pressure_pa - p) / self.params.droop_pa).clamp(0.0, 1.0);
        // A regulator has a check function: nothing runs back to a lost source.
        let source_kg_s = if opening > 0.0 && state.source_pressure_pa > p {
            opening
                * self.regulator.mass_flow_kg_s(
                    state.source_pressure_pa,
                    self.sqrt_t,
                    p,
                    self.sqrt_t,
                )
        } else {
            0.0
        };
        SupplyRates {
            source_kg_s,
            dump_kg_s: 0.0,
        }
    }

    /// Updates the contacts of the pressure switch.
    #[inline]
    pub(crate) fn update_switch(&self, state: &mut SupplyState) {
        let [reservoir, source] = state.contacts;
        let pressure_pa = self.pressure_pa(state.mass_kg);
        state.contacts = [
            self.params.switch.closed(reservoir, pressure_pa),
            self.params
                .source_switch
                .is_none_or(|switch| switch.closed(source, state.source_pressure_pa)),
        ];
    }

    /// The largest pressure that a chamber or the reservoir can have \[Pa\]: [`COMPRESSION`] times the highest of the
    /// supply, and the end of [`PRESSURES_PA`].
    #[must_use]
    pub fn most_pa(&self) -> f64 {
        let p = &self.params;
        let highest_pa = p.source_pressure_pa.max(p.set_pressure_pa);
        (COMPRESSION * highest_pa.max(p.initial_pressure_pa)).min(PRESSURES_PA[1])
    }

    /// Refuses a state that is not finite or has left the model's range.
    ///
    /// # Errors
    /// [`PlantError::NonFinite`] or [`PlantError::OutOfBounds`] with the name.
    pub fn check(&self, state: &SupplyState) -> Result<(), PlantError> {
        check_state(
            "supply_pressure_pa",
            0,
            self.pressure_pa(state.mass_kg),
            PRESSURES_PA[0],
            self.most_pa(),
        )
    }
}
