//! Fuzzy inference as the ST52E301 did it, in integers.
//!
//! Zero-order Takagi–Sugeno ("Mamdani with crisp consequents"): triangular
//! sets given by a vertex and two semi-bases, AND = minimum, and the weighted
//! mean of singletons `y = Σ ωᵢ yᵢ / Σ ωᵢ` (ST52T441 data sheet p. 26,
//! ST52F510 data sheet p. 56–58; DATASHEET). Up to 4 inputs, up to 16 sets per
//! input.
//!
//! * [`Partition`]: the sets of one input, with slopes computed at compile time.
//! * [`GridRules`]: two inputs and a full table of rules. If at most two neighbouring sets of each input are active at
//!   a time, which is determined at compile time, only the four rules that can fire are evaluated; otherwise all are.
//!   The result is the same, bit for bit.
//! * [`RuleList`]: up to four inputs and a free list of rules.
//!
//! Tables are plain `const` data that a user can replace. An invalid table is reported by a `Result`, which a `const`
//! item turns into a compilation error.
//!
//! ```
//! use wheeleg_control::paper::fuzzy::{GridRules, Partition};
//!
//! const RULES: GridRules<3, 3> = {
//!     let Ok(error) = Partition::even(-1000, 1000) else { panic!() };
//!     let Ok(rate) = Partition::fan([-400, 0, 400]) else { panic!() };
//!     let table = [[-90, -60, 0], [-60, 0, 60], [0, 60, 90]];
//!     let Ok(rules) = GridRules::new(error, rate, table) else { panic!() };
//!     rules
//! };
//! // Half way between (0, 0) and (0, 1): the mean of 0 and 60.
//! assert_eq!(RULES.infer(0, 200), 30);
//! assert_eq!(RULES.infer(0, -200), -30);
//! ```
//!
//! Sets that leave a gap do not compile:
//!
//! ```compile_fail
//! use wheeleg_control::paper::fuzzy::{Partition, Triangle};
//!
//! const GAP: Partition<2> = {
//!     let low = Triangle { vertex: -10, left: 0, right: 10 };
//!     let high = Triangle { vertex: 10, left: 10, right: 0 };
//!     let Ok(sets) = Partition::new(-10, 10, [low, high]) else { panic!() };
//!     sets
//! };
//! assert_eq!(GAP.len(), 2);
//! ```
//!
//! One unit more on either side closes it:
//!
//! ```
//! use wheeleg_control::paper::fuzzy::{Partition, Triangle};
//!
//! const TOUCHING: Partition<2> = {
//!     let low = Triangle { vertex: -10, left: 0, right: 11 };
//!     let high = Triangle { vertex: 10, left: 10, right: 0 };
//!     let Ok(sets) = Partition::new(-10, 10, [low, high]) else { panic!() };
//!     sets
//! };
//! assert_eq!(TOUCHING.len(), 2);
//! ```
//!
//! # Numbers
//!
//! Inputs, vertices and consequents are `i16` in a domain that the table chooses (8-bit tables use −128…127 or 0…255).
//! Membership is an integer 0…`levels`; [`FULL_LEVELS`] by default, [`CHIP_LEVELS`] for the 4 bits of the chip. A
//! membership is rounded to nearest and is within ±1 level of the exact value. The weighted mean is rounded to nearest,
//! ties away from zero, so a table with odd symmetry gives an output with odd symmetry. `Σ ωᵢ = 0` gives 0.

mod grid;
mod list;
mod partition;

pub use grid::GridRules;
pub use list::{ANY, MAX_INPUTS, MAX_RULES, Rule, RuleList};
pub use partition::{CHIP_LEVELS, FULL_LEVELS, MAX_SETS, Partition, Triangle};

/// Why a table was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FuzzyError {
    /// No set, or more than [`MAX_SETS`].
    SetCount,
    /// The lower end of the domain is not below the upper end.
    Domain,
    /// A vertex is outside the domain.
    VertexOutsideDomain,
    /// Vertices do not increase strictly.
    VertexOrder,
    /// Some value of the domain belongs to no set.
    Gap,
    /// The number of membership levels is zero, above [`FULL_LEVELS`], or not the
    /// same for all inputs.
    Levels,
    /// No input, or more than [`MAX_INPUTS`].
    InputCount,
    /// No rule, or more than [`MAX_RULES`].
    RuleCount,
    /// A rule names a set that its input does not have.
    UnknownSet,
}

/// `numerator / denominator`, to nearest, ties away from zero; 0 when the
/// denominator is not positive.
const fn mean_i32(numerator: i32, denominator: i32) -> i16 {
    if denominator <= 0 {
        return 0;
    }
    let half = denominator.wrapping_shr(1);
    let biased = if numerator < 0 {
        numerator.saturating_sub(half)
    } else {
        numerator.saturating_add(half)
    };
    match biased.checked_div(denominator) {
        // A mean of 16-bit numbers fits 16 bits.
        Some(mean) => mean as i16,
        None => 0,
    }
}

/// As [`mean_i32`], with 64 bits.
const fn mean_i64(numerator: i64, denominator: i64) -> i16 {
    if denominator <= 0 {
        return 0;
    }
    let half = denominator.wrapping_shr(1);
    let biased = if numerator < 0 {
        numerator.saturating_sub(half)
    } else {
        numerator.saturating_add(half)
    };
    match biased.checked_div(denominator) {
        Some(mean) => wheeleg_units::saturate_i16(mean),
        None => 0,
    }
}
