//! Studies with the simulator, one module per question.
//!
//! * [`run`]: one scenario with log, targets and report; [`analysis`] judges it;
//! * [`matrix`]: every fault, and the required response;
//! * [`compare`], [`tune`], [`delay`]: controllers on one cylinder ([`axis_sim`]);
//! * [`mod@bench`]: one cylinder off its data sheet, a case of a campaign;
//! * [`identify`]: a user's cylinder from measurements;
//! * [`figures`]: the paper's figures and misprints;
//! * [`study`]: the parts that all of them share;
//! * [`view`]: a log, or two, as a page;
//! * [`check`], [`export`]: the model against independent numbers, and for other programs.
//!
//! # Glossary
//!
//! * **target**: one number of a run with its allowed band, and whether it is required
//! * **row**: one fault of the matrix, with its instant and the required response
//! * **case**: one move of one controller on one cylinder
//! * **baseline**: the same run without the fault
//! * **job**: folder, progress and stop signal of a study

pub mod analysis;
pub mod axis_sim;
pub mod bench;
mod cause;
pub mod check;
pub mod compare;
pub mod delay;
mod error;
pub mod export;
pub mod figures;
pub mod identify;
pub mod matrix;
mod motion;
pub mod run;
mod schemas;
pub mod study;
pub mod tune;
pub mod view;

pub use error::StudyError;
pub use schemas::schemas;
