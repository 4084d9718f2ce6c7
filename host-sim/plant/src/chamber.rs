//! One gas volume: its contents and how they change.
//!
//! The state is the gas mass m and the product Y = pV, not the pressure:
//!
//! ```text
//! dm/dt = Σ mdot
//! dY/dt = n R Σ (T_up mdot) − (n−1) p dV/dt + (n−1) Q
//! ```
//!
//! With n = γ, T_up the upstream temperature and Q = h A (T_wall − T) this is the
//! energy balance of an ideal gas (Y = (γ−1) U). With constant T and Q = 0 it is
//! the polytropic law dp/dt = (n/V)(R T mdot − p dV/dt). Both right-hand sides
//! are sums of fluxes, so mass and energy close to rounding whatever the step,
//! and neither needs a power function.

use serde::{Deserialize, Serialize};

use crate::both::Both;
use crate::error::{PlantError, check};
use crate::flow::GasParams;
use crate::hash::StateHasher;

/// How the gas in a chamber exchanges heat.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum GasModel {
    /// Constant temperature in the flow terms, one exponent for everything.
    Polytropic {
        /// Exponent n \[-\]: 1 isothermal, γ adiabatic; 1.2 is usual for small cylinders.
        exponent: f64,
    },
    /// Energy balance with heat exchange to a wall at ambient temperature.
    Thermal {
        /// Heat transfer coefficient h \[W/(m² K)\], 0..1000; 0 is adiabatic.
        heat_transfer_w_m2_k: f64,
    },
}

impl GasModel {
    /// Checks the field of the model against its valid range.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the field.
    pub fn validate(&self) -> Result<(), PlantError> {
        match *self {
            Self::Polytropic { exponent } => check("gas_model.exponent", exponent, 1.0, 1.7),
            Self::Thermal {
                heat_transfer_w_m2_k,
            } => check(
                "gas_model.heat_transfer_w_m2_k",
                heat_transfer_w_m2_k,
                0.0,
                1000.0,
            ),
        }
    }
}

/// Sums of everything that crossed a chamber's border since the start.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Ledger {
    /// Net mass in \[kg\].
    pub mass_in_kg: f64,
    /// n R Σ T mdot dt \[J\]: (γ−1) times the enthalpy carried in.
    pub inflow_j: f64,
    /// Work done by the gas on the piston ∫ p dV \[J\].
    pub work_j: f64,
    /// Heat received from the wall \[J\].
    pub heat_j: f64,
}

/// Gas in one chamber.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ChamberState {
    /// Y = pV \[J\].
    pub pv_j: f64,
    /// Gas mass \[kg\].
    pub mass_kg: f64,
    /// Flows across the border so far.
    pub ledger: Ledger,
}

/// Contents of both chambers, without their ledgers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Contents {
    pub(crate) pv_j: Both,
    pub(crate) mass_kg: Both,
}

/// Time derivatives of both chambers, by origin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ChamberRates {
    /// Net mass flow in \[kg/s\].
    pub(crate) mass_kg_s: Both,
    /// n R Σ T mdot \[W\].
    pub(crate) inflow_w: Both,
    /// p dV/dt \[W\].
    pub(crate) work_w: Both,
    /// Heat from the wall \[W\].
    pub(crate) heat_w: Both,
}

impl ChamberState {
    /// Gas at `pressure_pa` absolute and ambient temperature in `volume_m3`.
    #[must_use]
    pub fn filled(pressure_pa: f64, volume_m3: f64, gas: &GasParams) -> Self {
        let pv_j = pressure_pa * volume_m3;
        Self {
            pv_j,
            mass_kg: pv_j / (gas.gas_constant_j_kg_k * gas.ambient_temperature_k),
            ledger: Ledger::default(),
        }
    }

    /// Adds the state to a hash in declaration order.
    pub fn feed(&self, hasher: &mut StateHasher) {
        for value in [
            self.pv_j,
            self.mass_kg,
            self.ledger.mass_in_kg,
            self.ledger.inflow_j,
            self.ledger.work_j,
            self.ledger.heat_j,
        ] {
            hasher.f64(value);
        }
    }
}

impl Contents {
    /// The present contents of chambers A and B.
    #[inline]
    pub(crate) fn of(a: &ChamberState, b: &ChamberState) -> Self {
        Self {
            pv_j: Both::new([a.pv_j, b.pv_j]),
            mass_kg: Both::new([a.mass_kg, b.mass_kg]),
        }
    }

    /// The contents `h` seconds later.
    #[inline]
    pub(crate) fn predicted(&self, rates: &ChamberRates, exponent: f64, h: f64) -> Self {
        Self {
            pv_j: self.pv_j + rates.pv_w(exponent) * h,
            mass_kg: self.mass_kg + rates.mass_kg_s * h,
        }
    }
}

impl ChamberRates {
    /// dY/dt \[W\].
    #[inline]
    fn pv_w(&self, exponent: f64) -> Both {
        self.inflow_w + (self.heat_w - self.work_w) * (exponent - 1.0)
    }

    /// Mean of two rates, for Heun's corrector.
    #[inline]
    pub(crate) fn mean(&self, other: &Self) -> Self {
        Self {
            mass_kg_s: (self.mass_kg_s + other.mass_kg_s) * 0.5,
            inflow_w: (self.inflow_w + other.inflow_w) * 0.5,
            work_w: (self.work_w + other.work_w) * 0.5,
            heat_w: (self.heat_w + other.heat_w) * 0.5,
        }
    }

    /// Advances chambers A and B by `h` seconds with rates constant over it.
    #[inline]
    pub(crate) fn advance(&self, chambers: [&mut ChamberState; 2], exponent: f64, h: f64) {
        let mass_kg = (self.mass_kg_s * h).to_array();
        let pv_j = (self.pv_w(exponent) * h).to_array();
        let inflow_j = (self.inflow_w * h).to_array();
        let work_j = (self.work_w * h).to_array();
        let heat_j = (self.heat_w * h).to_array();
        for (i, chamber) in chambers.into_iter().enumerate() {
            chamber.mass_kg += mass_kg[i];
            chamber.pv_j += pv_j[i];
            chamber.ledger.mass_in_kg += mass_kg[i];
            chamber.ledger.inflow_j += inflow_j[i];
            chamber.ledger.work_j += work_j[i];
            chamber.ledger.heat_j += heat_j[i];
        }
    }
}
