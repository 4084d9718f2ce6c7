//! Tests of whole campaigns. Most have cases that cost nothing: the inputs of a case are real, its simulation
//! is not.

mod bench;
mod cases;
mod common;
mod failures;
mod field;
mod findings;
mod sharing;
