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

/// Contents of a chamber, without its ledger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Content {
    pub(crate) pv_j: f64,
    pub(crate) mass_kg: f64,
}

/// Time derivatives of a chamber, by origin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ChamberRates {
    /// Net mass flow in \[kg/s\].
    pub mass_kg_s: f64,
    /// n R Σ T mdot \[W\].
    pub inflow_w: f64,
    /// p dV/dt \[W\].
    pub work_w: f64,
    /// Heat from the wall \[W\].
    pub heat_w: f64,
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

    /// The present contents of the chamber.
    #[inline]
    pub(crate) fn content(&self) -> Content {
        Content {
            pv_j: self.pv_j,
            mass_kg: self.mass_kg,
        }
    }

    /// The contents of the chamber `h` seconds later.
    #[inline]
    pub(crate) fn predicted(&self, rates: &ChamberRates, exponent: f64, h: f64) -> Content {
        Content {
            pv_j: self.pv_j + h * rates.pv_w(exponent),
            mass_kg: self.mass_kg + h * rates.mass_kg_s,
        }
    }

    /// Advances by `h` seconds with rates constant over it.
    #[inline]
    pub fn apply(&mut self, rates: &ChamberRates, exponent: f64, h: f64) {
        self.mass_kg += h * rates.mass_kg_s;
        self.pv_j += h * rates.pv_w(exponent);
        self.ledger.mass_in_kg += h * rates.mass_kg_s;
        self.ledger.inflow_j += h * rates.inflow_w;
        self.ledger.work_j += h * rates.work_w;
        self.ledger.heat_j += h * rates.heat_w;
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

impl ChamberRates {
    /// dY/dt \[W\].
    #[inline]
    fn pv_w(&self, exponent: f64) -> f64 {
        self.inflow_w + (exponent - 1.0) * (self.heat_w - self.work_w)
    }

    /// Mean of two rates, for Heun's corrector.
    #[must_use]
    #[inline]
    pub fn mean(&self, other: &Self) -> Self {
        Self {
            mass_kg_s: 0.5 * (self.mass_kg_s + other.mass_kg_s),
            inflow_w: 0.5 * (self.inflow_w + other.inflow_w),
            work_w: 0.5 * (self.work_w + other.work_w),
            heat_w: 0.5 * (self.heat_w + other.heat_w),
        }
    }
}
