//! System tests across crates; see the folder `system` beside this one.
//!
//! # Glossary
//!
//! * **bracket**: two bounds of a value, one from below and one from above
//! * **mutant**: an image or source with one mistake, which a check must find
//! * **baseline**: the same run without the fault

/// Numbers that look random and are the same every time: the last step of SplitMix64
/// (public domain), a bijection.
#[must_use]
pub const fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Step of the counter that SplitMix64 mixes: the golden ratio of 2^64.
pub const STEP: u64 = 0x9E37_79B9_7F4A_7C15;
