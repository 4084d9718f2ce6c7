//! All tests of the crate in one program, which is built and linked once: a mutant (`cargo xtask mutants`) takes a
//! third of the time that it would with a program per file.

mod answers;
mod arguments;
mod behaviours;
mod bus_cycle;
mod commands;
mod common;
mod direct;
mod foot;
mod motion;
mod operator;
mod orphan;
mod parameters;
mod questions;
mod references;
mod senses;
mod stops;
mod walk;
mod whole_gait;
