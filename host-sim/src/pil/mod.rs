//! Processor in the loop: boards that run outside of this process.

mod channel;
pub mod choice;
mod compare;
mod cores;
mod figures;
mod images;
mod line;
mod outside;
mod partner;
pub mod qemu;
mod store;
pub mod unicorn;

pub use channel::{Channel, ChannelFigures, Count, Counts};
pub use choice::{NodeChoice, NodeKind, Nodes};
pub use compare::{Comparison, Difference};
pub use figures::{BoardFigures, PilSummary};
pub use images::ensure_same_sources;
pub use line::Line;
pub(crate) use outside::Outside;
pub use partner::{Partner, Stream};
