//! The robot and its logs for other programs.

mod file;
mod folder;
pub mod layout;
pub mod parquet;
mod reading;
pub mod ros2;

pub use file::{make_room, write_new};
pub use folder::log_of;
