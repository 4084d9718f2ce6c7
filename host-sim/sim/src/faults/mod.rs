//! Faults that are injected into the simulated robot.
//!
//! * [`line`]: errors of the bus line, and rubbish on it;
//! * [`interface`]: boards of another interface version;
//! * [`active`]: the faults under way, and the end of those that end by themselves;
//! * [`admission`]: which faults a run can have;
//! * [`schedule`]: begins and ends in order;
//! * [`injector`]: the effect of the faults under way on plant, signals and line.

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
