//! Faults: what can go wrong with the robot, how a run is told of it, and how
//! it is done to the simulated robot.
//!
//! * [`kind`]: the catalogue;
//! * [`spec`]: one fault of a run, with target, value and time;
//! * [`line`]: errors of the bus line, and rubbish on it;
//! * [`interface`]: boards of another interface version;
//! * [`admission`]: which faults a run can have;
//! * [`schedule`]: begins and ends in order;
//! * [`matrix`]: every fault with what must come of it, measured;
//! * [`injector`]: the faults under way, and what they do to signals.

mod admission;
mod injector;
mod interface;
mod kind;
mod line;
pub mod matrix;
mod schedule;
mod spec;

pub use admission::{check, ensure_comparable};
pub(crate) use injector::Injector;
pub use kind::{FaultKind, KINDS, KindInfo, Place, ValueSpec};
pub(crate) use schedule::Schedule;
pub use spec::{FaultSpec, SpecError, Victim};
