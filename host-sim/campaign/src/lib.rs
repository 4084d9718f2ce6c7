//! Campaigns: one scenario, or one cylinder on the bench, simulated many times, on as many computers as are
//! available.
//!
//! A plan ([`wheeleg_config::plan`]) states what varies. [`Cases`] builds any case from its index, [`run`]
//! computes a shard of them into a folder of part files ([`Store`]), [`merge`] combines the parts into one
//! table, [`report`] writes a page, and [`replay`] repeats one case in full.
//!
//! The [`field`] tests and the comparison of controllers ([`compare`]) are such campaigns, with pages of their own.
//!
//! There is no scheduler here. A shard is a process that anybody may start, kill and start again.
//!
//! # Glossary
//!
//! * **case**: one run: a scenario and a robot, or a cylinder and a move, with a value of each factor, and a seed
//! * **sample**: values of the factors that are drawn; the same in every cell of the grid
//! * **cell**: one combination of values of the factors that have a list
//! * **replicate**: the same values with different noise
//! * **block**: cases with successive indices, the contents of one part file
//! * **shard**: every n-th block, the share of one process
//! * **part**: the file of a block; written as a whole or not at all
//! * **attempt**: a case that a process has begun
//! * **figure**: the measured value of a target

mod attempts;
mod cases;
mod causes;
mod columns;
pub mod compare;
mod compute;
mod draw;
mod error;
pub mod field;
mod forms;
mod host;
mod identity;
mod isolate;
mod leftovers;
mod merge;
mod pages;
mod panics;
mod part;
mod place;
mod program;
mod reasons;
mod replay;
pub mod report;
mod row;
mod run;
mod shard;
mod simulate;
mod status;
mod store;
mod submit;
mod table;
mod work;

pub use cases::{Case, Cases, Setup, work_s};
pub use causes::{Cause, Causes};
pub use columns::{Column, Columns, Kind};
pub use compute::Simulate;
pub use draw::Draws;
pub use draw::quantile::quantile;
pub use error::CampaignError;
pub use forms::{CAUSES, MergeForm, ReportForm, StatusForm, schemas};
pub use identity::CaseId;
pub use isolate::isolated;
pub use merge::{Merged, merge, merge_partial};
pub use place::Place;
pub use program::program;
pub use replay::{Files, Recording, Replayed, replay};
pub use row::{Figure, Row, Status};
pub use run::{Options, Ran, SAVE_EVERY, run};
pub use shard::Shard;
pub use simulate::{Outcome, simulate};
pub use status::{State, status};
pub use store::{PlanFile, Store};
pub use submit::Submission;
pub use table::{Data, Table};
