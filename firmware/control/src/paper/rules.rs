//! The rule bases shipped with the joint law.
//!
//! The paper does not print its rules; these are ASSUMED, designed as described below. They are plain data and can be
//! replaced.
//!
//! Both are odd (reversing the sign of both inputs reverses the sign of the output) and give zero at zero, so the
//! correction alone can not cause an offset. The tables are non-decreasing in each input; between the vertices, AND =
//! minimum lets the surface dip by up to 1.6 % of full scale. Tests check all of this.
//!
//! Sets are NB NM NS ZE PS PM PB with vertices at ±1, ±0.5, ±0.2 and 0 of full scale: closer together near zero, where
//! the piston is to come to rest. Neighbours cross at half membership, so at most four rules fire.
//!
//! Evaluated in `paper/fuzzy`: w_r = min(μ_i(a), μ_j(b)), output = Σ w_r c_r / Σ w_r.

use crate::paper::fuzzy::{FuzzyError, GridRules, Partition};

/// Vertices of all joint inputs, full scale ±32 767.
pub const VERTICES: [i16; 7] = [-32_767, -16_384, -6_554, 0, 6_554, 16_384, 32_767];

/// PD-type correction, rows e, columns ė, per mille of full output.
///
/// A row shows the damping: ė = reference velocity − velocity is negative while the piston runs ahead of its reference,
/// and the output brakes. Near the target (ZE) the brake is strongest; far from it (PB) it is almost off, because there
/// the piston should be moving. The middle column shows that the correction stiffens small errors more than large ones,
/// which counters static friction without raising Kp.
pub const PD_PER_MILLE: [[i16; 7]; 7] = [
    [-1000, -1000, -600, -300, -150, 0, 100],
    [-1000, -900, -550, -250, 0, 250, 500],
    [-1000, -850, -500, -150, 200, 600, 900],
    [-1000, -800, -400, 0, 400, 800, 1000],
    [-900, -600, -200, 150, 500, 850, 1000],
    [-500, -250, 0, 250, 550, 900, 1000],
    [-100, 0, 150, 300, 600, 1000, 1000],
];

/// ID-type correction, rows ∫e, columns ė, per mille of full output.
///
/// Nearly the sum of an integral term (±1 at full scale) and a damping term (±0.6), limited to ±1. The integral must
/// stay close to linear, or the loop gain would change while it searches for the duty that balances load and friction.
pub const ID_PER_MILLE: [[i16; 7]; 7] = [
    [-1000, -1000, -1000, -1000, -760, -600, -400],
    [-1000, -900, -740, -500, -260, -100, 100],
    [-800, -600, -440, -200, 40, 200, 400],
    [-600, -400, -240, 0, 240, 400, 600],
    [-400, -200, -40, 200, 440, 600, 800],
    [-100, 100, 260, 500, 740, 900, 1000],
    [400, 600, 760, 1000, 1000, 1000, 1000],
];

/// The PD-type rule base: inputs e, ė.
pub const PD: GridRules<7, 7> = compiled(PD_PER_MILLE);

/// The ID-type rule base: inputs ∫e, ė.
pub const ID: GridRules<7, 7> = compiled(ID_PER_MILLE);

/// A rule base on [`VERTICES`] from per-mille consequents.
///
/// # Errors
/// None for this partition; the type is that of the functions used.
pub const fn from_per_mille(table: [[i16; 7]; 7]) -> Result<GridRules<7, 7>, FuzzyError> {
    let partition = match Partition::fan(VERTICES) {
        Ok(partition) => partition,
        Err(error) => return Err(error),
    };
    GridRules::new(partition, partition, full_scale(table))
}

/// Per mille to ±32 767, rounded to nearest, ties away from zero.
#[allow(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    reason = "evaluated at compile time for the shipped tables; i, j < 7 and |per mille × 32 767 + 500| < 2^31"
)]
const fn full_scale(table: [[i16; 7]; 7]) -> [[i16; 7]; 7] {
    let mut scaled = table;
    let mut i = 0;
    while i < 7 {
        let mut j = 0;
        while j < 7 {
            let wide = table[i][j] as i64 * 32_767;
            let biased = if wide < 0 { wide - 500 } else { wide + 500 };
            scaled[i][j] = wheeleg_units::saturate_i16(biased / 1000);
            j += 1;
        }
        i += 1;
    }
    scaled
}

/// For `const` items only: an invalid table stops the compilation.
#[allow(
    clippy::panic,
    reason = "called in `const` items alone: stops the compilation"
)]
const fn compiled(table: [[i16; 7]; 7]) -> GridRules<7, 7> {
    match from_per_mille(table) {
        Ok(rules) => rules,
        Err(_) => panic!("shipped rule base is faulty"),
    }
}
