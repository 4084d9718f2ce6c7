//! Tests of campaigns as a whole, with cases that cost nothing: what a case is computed from is
//! the real thing, its simulation is not.

mod bench;
mod cases;
mod common;
mod failures;
mod findings;
mod sharing;
