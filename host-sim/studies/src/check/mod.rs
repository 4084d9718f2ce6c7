//! Checks of the model against independently computed numbers.

pub mod vectors;
