//! The observer: pressures, motion and load of an axis without a pressure sensor.

pub mod flow;
pub mod mass;
pub mod motion;
pub mod pressure;
pub mod valve_delay;
