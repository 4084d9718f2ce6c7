//! What a person asks of the simulator, one module a question.
//!
//! * [`run`]: one scenario with log, targets and report; [`analysis`] judges it;
//! * [`matrix`]: every fault, and what must come of it;
//! * [`compare`], [`tune`], [`delay`]: controllers on one cylinder ([`bench`]);
//! * [`figures`]: the paper's figures and misprints;
//! * [`study`]: what all of them do in the same way;
//! * [`check`], [`export`]: the model against others' numbers, and for others' programs.

pub mod analysis;
pub mod bench;
pub mod check;
pub mod compare;
pub mod delay;
mod error;
pub mod export;
pub mod figures;
pub mod matrix;
pub mod run;
mod schemas;
pub mod study;
pub mod tune;

pub use error::StudyError;
pub use schemas::schemas;
