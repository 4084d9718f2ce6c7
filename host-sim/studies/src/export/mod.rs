//! The robot and its logs for other programs.

mod file;

pub use file::write_new;
