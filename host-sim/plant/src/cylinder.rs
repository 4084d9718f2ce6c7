//! One double-acting cylinder with its four valves: parameters, state, gas rates.
//!
//! Valve order everywhere: `[fill A, vent A, fill B, vent B]`. Chamber A is on
//! the bore side and extends the cylinder (positive force, positive velocity).

use serde::{Deserialize, Serialize};

mod model;

pub(crate) use model::CylinderRates;
pub use model::{CylinderForces, CylinderModel};

use crate::chamber::{ChamberState, GasModel};
use crate::endstop::EndStopParams;
use crate::error::{PlantError, check};
use crate::flow::Iso6358;
use crate::friction::FrictionParams;
use crate::hash::StateHasher;
use crate::valve::{NEVER_NS, ValveParams, ValveState};

/// Longest line delay the valve model can hold \[s\].
const MAX_LINE_DELAY_S: f64 = 7e-3;

/// The thickest rod, over the bore: it leaves an annulus for the air of chamber B.
pub const ROD_MOST: f64 = 0.9;

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

/// Least stop margin for any stroke \[m\]: as far as a soft stop yields to a large bore.
const STOP_MARGIN_M: f64 = 5e-3;

impl CylinderParams {
    /// How far a piston may be past its stop before the stop counts as broken \[m\].
    #[must_use]
    pub fn stop_margin_m(&self) -> f64 {
        (0.1 * self.stroke_m).max(STOP_MARGIN_M)
    }

    /// Checks every field against its valid range.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the first field outside its range.
    pub fn validate(&self) -> Result<(), PlantError> {
        check("cylinder.bore_m", self.bore_m, 0.004, 0.2)?;
        check("cylinder.rod_m", self.rod_m, 0.0, self.bore_m * ROD_MOST)?;
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

    /// Recomputes cached values; call after changing a valve or a fault by hand.
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
