//! One axis on the bench: any joint law against the single-cylinder plant.
//!
//! The controller is the firmware's own code ([`Firmware`]: converter code → stroke →
//! [`wheeleg_control::joint::JointController`] → valve PWM → on-times of a tick); its gains follow from the
//! axis's data ([`design`]). The plant is [`wheeleg_plant::axis::Axis`]. Outputs act one tick after the
//! inputs from which they were computed, as on the board. A run is a pure function of axis, design, seed,
//! motion and loads; a second of it takes about 2 ms.
//!
//! ```
//! use wheeleg_studies::axis_sim::{AxisSim, Firmware, Kind, Metrics, Motion, design};
//! use wheeleg_config::AxisConfig;
//!
//! let axis = AxisConfig::load("bench-vq110u")?.axis;
//! let board = Firmware::new(&design(&axis, Kind::Predictive)).expect("a valid design");
//! let mut bench = AxisSim::new(&axis, 1, board)?;
//! let step = Motion::Step { at_s: 0.05, from_m: 0.04, to_m: 0.14 };
//! let first = Metrics::of(&bench.run(&step, &[], 1.5)?);
//! assert!(first.steady_error_mm.abs() < 0.2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! * [`AxisSim::run`] keeps chamber pressures, noise and the board's learnt values from one motion to the
//!   next; so a learning move is simply an earlier motion.
//! * [`Metrics::of`] computes the figures; [`suite`] has the experiments of the comparison;
//!   [`valve_resolution`] says whether valves are fine enough for a cylinder; [`optimal`] gives the bound for
//!   perfect knowledge; [`identify`] finds the valves' delays at start-up, as a board would.

pub mod commission;
mod delay_probe;
mod design;
mod error;
pub mod export;
mod firmware;
mod identify;
mod metrics;
mod motion;
mod node;
pub mod optimal;
pub mod plant_check;
mod refusal;
mod run;
pub mod suite;
mod textbook;
mod unphysical;
pub mod valve_resolution;

pub use design::{axis_data, design};
pub use firmware::{Design, Firmware, Supervision, TICK};
pub use identify::{Delays, Probe, design_with, identify};
pub use metrics::{LIMIT_CYCLE, Metrics, SETTLED_BAND_M};
pub use motion::{LoadEvent, Motion};
pub use node::Node;
pub use run::{Action, AxisSim, Board, Latched, REFERENCES_M, Row, SPEEDS_M_S, Sample, Trace};
pub use valve_resolution::ValveResolution;
pub use wheeleg_config::bench::Kind;
