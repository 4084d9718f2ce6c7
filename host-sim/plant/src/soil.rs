//! Soft ground: a wheel that sinks in and slips, a sole with nails.
//!
//! # Wheel
//!
//! Wong and Reece (1967), with the rear end of the patch at the lowest point. Bekker's pressure under
//! the rim, Janosi and Hanamoto's shear along it, integrated over the patch ([`wheel`]). A run
//! reads those integrals from a table ([`table`]), which is built once.
//!
//! The textbook's slip is a quotient of speeds and has no value at rest. Here it is a state
//! ([`rolling`]) that follows the motion over the length of the patch: the textbook's slip in steady
//! rolling, a spring at rest.
//!
//! # Sole
//!
//! Bekker's pressure under a flat pad, friction mobilised by sliding, and nails after the
//! resistive force theory of Li, Zhang and Goldman (2013) ([`sole`]).
//!
//! # Not modelled
//!
//! Ruts that a second wheel would find, soil pushed up before a wheel, grousers one by one, cohesion
//! under nails, nails on hard ground. What a wheel resists to being turned about the vertical is left to
//! the distance between the wheels.

mod curve;
mod params;
pub mod rolling;
pub mod sole;
pub mod table;
pub mod wheel;

pub use params::Soil;
