//! The simulated robot: pneumatics, motors, sensors, leg and body dynamics, contact.
//!
//! SI units throughout, in `f64`, with the unit in each name. The model (built once
//! from parameters) is separate from the state, which can be cloned,
//! serialised and hashed. Sensors give what the real parts give,
//! codes of a converter and edges of an encoder. Nothing else here knows machine units: fixed point,
//! ticks of a controller and frames of a bus belong to the simulator's board models.
//!
//! Determinism: no wall clock, no threads, no iteration over unordered maps, one random
//! stream per signal, and `exp`, `sin` and their kin from the crate `libm`, because the C library's
//! differ between systems. The same parameters, seed and inputs give the same bytes. A state saved as JSON comes back bit for bit only with a parser that
//! rounds correctly (`serde_json` feature `float_roundtrip`).
//!
//! # Glossary
//!
//! * **chamber**: one side of a cylinder, with pressure, temperature, volume
//! * **conductance C, critical ratio b**: flow capacity of a valve after ISO 6358
//! * **bristle**: spring between two surfaces that stick: friction with a memory of position
//! * **end stop**: cushion and stop at the ends of a stroke
//! * **edge**: an instant at which a valve changes; a step of the plant ends there
//! * **mechanics**: what turns forces on joints into motion

pub mod assembly;
pub mod axis;
pub mod body;
mod both;
pub mod chamber;
pub mod contact;
pub mod cylinder;
pub mod dynamics;
pub mod endstop;
pub mod error;
pub mod flow;
pub mod friction;
pub mod hash;
pub mod motor;
pub mod noise;
pub mod reference;
pub mod robot;
pub mod sensors;
pub mod soil;
pub mod supply;
pub mod terrain;
pub mod testing;
pub mod valve;

pub use error::PlantError;
pub use robot::{Inputs, Outputs, Plant, PlantParams, PlantState};
