//! Faults as they are done to the simulated robot.
//!
//! * [`line`]: errors of the bus line, and rubbish on it;
//! * [`interface`]: boards of another interface version;
//! * [`active`]: the faults under way, and when those that end by themselves are over;
//! * [`admission`]: which faults a run can have;
//! * [`schedule`]: begins and ends in order;
//! * [`injector`]: what the faults under way do to plant, signals and line.

mod active;
mod admission;
mod injector;
mod interface;
mod line;
mod schedule;

pub(crate) use active::ActiveFaults;
pub use admission::{check, ensure_comparable};
pub(crate) use injector::Injector;
pub(crate) use schedule::Schedule;
