//! The paper's law: fuzzy inference, its rules, and the velocity that they need.

pub mod fuzzy;
pub mod rules;
pub mod velocity;
