//! Faults of a run: the catalogue, and one fault with target, value and time.

mod kind;
mod spec;

pub use kind::{FaultKind, KINDS, KindInfo, NOT_IMPLEMENTED, Place, ValueSpec};
pub use spec::{FaultSpec, FaultTarget, SpecError};
