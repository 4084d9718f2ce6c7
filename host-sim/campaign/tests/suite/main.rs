//! Tests of whole campaigns with cases that cost nothing: the inputs of a case are real, its simulation is
//! not.

mod bench;
mod cases;
mod common;
mod failures;
mod findings;
mod sharing;
