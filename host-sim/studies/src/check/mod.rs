//! Checks of the model against numbers that others computed.

pub mod vectors;
