//! Faults as they are done to the simulated robot.
//!
//! * [`line`]: errors of the bus line, and rubbish on it;
//! * [`interface`]: boards of another interface version;
//! * [`admission`]: which faults a run can have;
//! * [`schedule`]: begins and ends in order;
//! * [`injector`]: the faults under way, and what they do to signals.

mod admission;
mod injector;
mod interface;
mod line;
mod schedule;

pub use admission::{check, ensure_comparable};
pub(crate) use injector::Injector;
pub(crate) use schedule::Schedule;
