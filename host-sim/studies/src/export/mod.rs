//! The robot for other programs.

mod file;
mod geometry;
mod tree;
pub mod urdf;

pub use file::write_new;
