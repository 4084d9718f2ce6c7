//! What the controller is told of its axis, and the coefficients made of it.

mod data;
mod model;

pub use data::{AxisData, AxisField};
pub use model::{AxisModel, PERIOD_TICKS};
