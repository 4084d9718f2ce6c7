//! The format of gains.

use fixed::FixedI32;
use fixed::types::extra::U24;

/// Gain format: I8F24, ±128, step 6.0e-8.
pub type Gain = FixedI32<U24>;
