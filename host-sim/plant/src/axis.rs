//! Single-axis test bench: one cylinder, a moving mass and a load force.

use serde::{Deserialize, Serialize};

use crate::assembly::{Assembly, AssemblyState, CylinderOutputs, Mechanics};
use crate::cylinder::{CylinderModel, CylinderParams};
use crate::error::{PlantError, check, check_state};
use crate::flow::GasParams;
use crate::hash::StateHasher;
use crate::sensors::{AdcParams, AdcState, PotentiometerParams};
use crate::supply::{SupplyModel, SupplyParams};

/// Length of a joint tick \[µs\] (design decision: 1 kHz).
pub const TICK_US: u16 = 1000;
/// Length of a joint tick \[ns\].
pub const TICK_NS: u64 = 1_000_000;
/// Loads that a bench may have \[N\].
pub const LOADS_N: [f64; 2] = [-1e4, 1e4];
/// Moving masses that a bench may have \[kg\].
pub const MASSES_KG: [f64; 2] = [0.01, 1000.0];

/// The bench.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AxisParams {
    /// Gas and atmosphere.
    pub gas: GasParams,
    /// Air supply.
    pub supply: SupplyParams,
    /// The cylinder.
    pub cylinder: CylinderParams,
    /// Everything that moves with the rod \[kg\], 0.01..1000.
    pub moving_mass_kg: f64,
    /// Force on the rod at the start \[N\], positive extends (a hanging weight on
    /// a rod pointing up is negative), −1e4..1e4.
    pub load_n: f64,
    /// Stroke at the start \[m\], 0..stroke.
    pub initial_stroke_m: f64,
    /// Position sensor.
    pub potentiometer: PotentiometerParams,
    /// Its converter.
    pub adc: AdcParams,
    /// Plant step \[ns\], 1 000..1 000 000.
    pub step_ns: u64,
}

/// Motion of the bench.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AxisMotion {
    /// Stroke \[m\].
    pub stroke_m: f64,
    /// Speed \[m/s\].
    pub velocity_m_s: f64,
    /// Acceleration \[m/s²\].
    pub acceleration_m_s2: f64,
    /// Force on the rod \[N\], positive extends. May be changed between ticks.
    pub load_n: f64,
    /// Moving mass \[kg\]. May be changed between ticks.
    pub mass_kg: f64,
}

/// The bench's mechanism: one mass.
#[derive(Debug, Clone, Copy)]
pub struct AxisMechanics;

impl Mechanics<1> for AxisMechanics {
    type State = AxisMotion;

    fn strokes_m(&self, state: &AxisMotion) -> [f64; 1] {
        [state.stroke_m]
    }
    fn rates_m_s(&self, state: &AxisMotion, ahead_s: f64) -> [f64; 1] {
        [state.velocity_m_s + ahead_s * state.acceleration_m_s2]
    }
    fn accelerations_m_s2(&self, state: &AxisMotion) -> [f64; 1] {
        [state.acceleration_m_s2]
    }
    fn kick(&self, state: &mut AxisMotion, h: f64) {
        state.velocity_m_s += h * state.acceleration_m_s2;
    }
    fn drift(&self, state: &mut AxisMotion, h: f64) {
        state.stroke_m += h * state.velocity_m_s;
    }
    fn evaluate(
        &self,
        state: &mut AxisMotion,
        piston_n: &[f64; 1],
        _: f64,
    ) -> Result<(), PlantError> {
        state.acceleration_m_s2 = (piston_n[0] + state.load_n) / state.mass_kg;
        Ok(())
    }
    fn check(&self, state: &AxisMotion) -> Result<(), PlantError> {
        check_state("velocity_m_s", 0, state.velocity_m_s, -100.0, 100.0)?;
        check_state("mass_kg", 0, state.mass_kg, 1e-3, 1e6)
    }
}

/// The bench's model.
#[derive(Debug, Clone)]
pub struct Axis {
    params: AxisParams,
    /// Cylinder, supply and mass.
    pub assembly: Assembly<AxisMechanics, 1>,
}

/// The bench's state; clone or serialise it to save it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AxisState {
    /// Gas, valves and motion.
    pub core: AssemblyState<AxisMotion>,
    /// Position sensor's converter.
    pub adc: AdcState,
}

impl Axis {
    /// Builds the bench.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names a parameter outside its range.
    pub fn new(params: &AxisParams) -> Result<Self, PlantError> {
        params.gas.validate()?;
        let [min, max] = MASSES_KG;
        check("moving_mass_kg", params.moving_mass_kg, min, max)?;
        let [min, max] = LOADS_N;
        check("load_n", params.load_n, min, max)?;
        check(
            "initial_stroke_m",
            params.initial_stroke_m,
            0.0,
            params.cylinder.stroke_m,
        )?;
        params.potentiometer.validate()?;
        params.adc.validate()?;
        check("step_ns", params.step_ns as f64, 1e3, 1e6)?;
        Ok(Self {
            params: params.clone(),
            assembly: Assembly {
                cylinders: [CylinderModel::new(&params.cylinder, &params.gas)?],
                supply: SupplyModel::new(&params.supply, &params.gas)?,
                mechanics: AxisMechanics,
                step_ns: params.step_ns,
            },
        })
    }

    /// Parameters the bench was built from.
    #[must_use]
    pub fn params(&self) -> &AxisParams {
        &self.params
    }

    /// Bench at rest at time 0.
    #[must_use]
    pub fn initial_state(&self, seed: u64) -> AxisState {
        AxisState {
            core: AssemblyState {
                time_ns: 0,
                cylinders: vec![
                    self.assembly.cylinders[0].initial_state(self.params.initial_stroke_m),
                ],
                supply: self.assembly.supply.initial_state(),
                motion: AxisMotion {
                    stroke_m: self.params.initial_stroke_m,
                    velocity_m_s: 0.0,
                    acceleration_m_s2: 0.0,
                    load_n: self.params.load_n,
                    mass_kg: self.params.moving_mass_kg,
                },
            },
            adc: AdcState::new(seed, "axis.potentiometer"),
        }
    }

    /// Latches the valve on-times of one tick at the state's time, then
    /// advances one tick of 1 ms.
    ///
    /// # Errors
    /// Any [`PlantError`]; after one the state is not usable any more.
    pub fn tick(&self, state: &mut AxisState, on_time_us: [u16; 4]) -> Result<(), PlantError> {
        for (i, us) in on_time_us.into_iter().enumerate() {
            if us > TICK_US {
                return Err(PlantError::Input {
                    name: "on_time_us",
                    index: i,
                    value: f64::from(us),
                    min: 0.0,
                    max: f64::from(TICK_US),
                });
            }
        }
        let now = state.core.time_ns;
        self.assembly.cylinders[0].command(&mut state.core.cylinders[0], now, on_time_us, TICK_US);
        // The load may have been changed.
        self.assembly.start(&mut state.core)?;
        self.assembly.advance_to(&mut state.core, now + TICK_NS)
    }

    /// Position reading, 16 bits left-aligned.
    #[must_use]
    pub fn read_position(&self, state: &mut AxisState) -> u16 {
        let ratio = self.params.potentiometer.ratio(state.core.motion.stroke_m);
        state.adc.read(&self.params.adc, ratio)
    }

    /// Everything that can be seen of the cylinder.
    #[must_use]
    pub fn outputs(&self, state: &AxisState) -> CylinderOutputs {
        self.assembly.outputs(&state.core)[0]
    }

    /// BLAKE3 of the whole state.
    #[must_use]
    pub fn state_hash(&self, state: &AxisState) -> [u8; 32] {
        let mut hasher = StateHasher::new();
        self.assembly.feed(&state.core, &mut hasher);
        let m = &state.core.motion;
        for v in [
            m.stroke_m,
            m.velocity_m_s,
            m.acceleration_m_s2,
            m.load_n,
            m.mass_kg,
        ] {
            hasher.f64(v);
        }
        state.adc.feed(&mut hasher);
        hasher.finish()
    }
}
