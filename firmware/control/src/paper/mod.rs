//! The paper's law: fuzzy inference, its rules, and the velocity estimate that they need.

pub mod fuzzy;
pub mod rules;
pub mod velocity;
