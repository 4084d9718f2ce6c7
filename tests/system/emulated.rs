//! The system tests with emulated boards, in one program: `cargo xtask pil`.

mod bench;
mod program;
mod sil;

mod pil;
mod pil_breaks;
mod pil_driver;
mod pil_faults;
mod pil_flips;
mod pil_images;
mod pil_memory;
mod pil_mutants;
mod pil_store;
mod pil_walks;
