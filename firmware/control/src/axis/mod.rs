//! The axis data of a controller, and the coefficients computed from them.

mod data;
mod model;

pub use data::{AxisData, AxisField};
pub use model::{AxisModel, PERIOD_TICKS};
