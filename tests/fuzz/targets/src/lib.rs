//! The fuzz targets. Each is a function from bytes to nothing that panics when a property of the protocol or
//! of the firmware is broken:
//!
//! | | property |
//! |---|---|
//! | P1 | no panic, no overflow, bounded work per byte, for any stream |
//! | P2 | decode(encode(x)) = x and encode(decode(b)) = b |
//! | P3 | behind any garbage and one delimiter the next valid frame is delivered |
//! | P4 | any chunking of the bytes gives the same frames |
//! | P5 | corrupted frames are rejected |
//! | P6 | no message sequence energises an output of a disarmed board; a stop is latched; the safe state comes within its deadline |
//! | P7 | two implementations agree (`tests/conformance`) |
//! | P8 | handlers behind a valid CRC hold P1 too |
//! | P9 | a saved parameter set is read whole, or an older one, or none; never a mix |
//!
//! libFuzzer (`cargo xtask fuzz`), bolero and the replay of the corpus
//! (`cargo test`) all call the same functions.
//!
//! # Glossary
//!
//! * **target**: a function that takes any bytes
//! * **corpus**: inputs that once reached something new

mod action;
mod chip;
#[cfg(feature = "sim")]
pub mod console;
pub mod decoder;
#[cfg(feature = "sim")]
pub mod files;
pub mod frames;
mod handler;
pub mod joint;
pub mod master;
mod observer;
pub mod parse;
#[cfg(feature = "sim")]
mod quoted;
pub mod reference;
pub mod remote;
#[cfg(feature = "sim")]
pub mod scenario;
pub mod store;
#[cfg(feature = "sim")]
pub mod tables;
pub mod wheel;
#[cfg(feature = "sim")]
pub mod written;

#[path = "../../../../firmware/node/tests/suite/common/mod.rs"]
mod boards;
#[path = "../../../../firmware/master/tests/suite/common/mod.rs"]
#[allow(unreachable_pub, reason = "shared with test programs")]
mod fakes;

/// A target by name.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Name of the program, of the corpus and of the regressions.
    pub name: &'static str,
    /// Runs one input; a broken property is a panic.
    pub run: fn(&[u8]),
}

/// All targets of this build.
pub const TARGETS: &[Target] = &[
    Target {
        name: "decoder",
        run: decoder::run,
    },
    Target {
        name: "frames",
        run: frames::run,
    },
    Target {
        name: "parse",
        run: parse::run,
    },
    Target {
        name: "joint",
        run: joint::run,
    },
    Target {
        name: "wheel",
        run: wheel::run,
    },
    Target {
        name: "master",
        run: master::run,
    },
    Target {
        name: "store",
        run: store::run,
    },
    Target {
        name: "remote",
        run: remote::run,
    },
    #[cfg(feature = "sim")]
    Target {
        name: "scenario",
        run: scenario::run,
    },
    #[cfg(feature = "sim")]
    Target {
        name: "files",
        run: files::run,
    },
    #[cfg(feature = "sim")]
    Target {
        name: "written",
        run: written::run,
    },
    #[cfg(feature = "sim")]
    Target {
        name: "tables",
        run: tables::run,
    },
    #[cfg(feature = "sim")]
    Target {
        name: "console",
        run: console::run,
    },
];
