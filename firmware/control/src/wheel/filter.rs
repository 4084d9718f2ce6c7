//! The lead filter.

use super::types::LeadFilter;
use wheeleg_units::shift_right_round;

/// Fractional bits of the internal motor command.
const FRACTION: u32 = 10;
/// Range of the 8-bit port, with the fraction.
const PORT_MAX: i64 = 127 << FRACTION;
const PORT_MIN: i64 = -(128 << FRACTION);

/// Old samples of the filter, cleared in idle.
///
/// ```text
/// MC_n = (K/4) X_n − (A/256)(K/4) X_{n−1} − (B/256) MC_{n−1}
/// ```
///
/// in units of 1/1024: K (256 X_n − A X_{n−1}) is exact, only the feedback is
/// rounded. The fed-back MC is the one limited to the port. The data sheet
/// does not say; with the unlimited one, a large step (K/4 = 16 on 1000 counts)
/// would come back a quarter as large with the opposite sign, and throw the
/// motor into full reverse in the sample after.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct FilterMemory {
    error: i32,
    command: i32,
}

/// A motor command for the port, and whether it was cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MotorCommand {
    pub(super) value: i8,
    pub(super) saturated: bool,
}

impl FilterMemory {
    /// One sample of the full filter; `error` is a 24-bit difference.
    #[inline]
    pub(super) fn update(&mut self, filter: LeadFilter, error: i32) -> MotorCommand {
        // |256 X + A X'| < 2^32 and K < 2^8: below 2^40.
        let lead = i64::from(error)
            .wrapping_mul(256)
            .wrapping_sub(i64::from(filter.zero).wrapping_mul(i64::from(self.error)));
        let forward = lead.wrapping_mul(i64::from(filter.gain));
        let feedback = i64::from(filter.pole).wrapping_mul(i64::from(self.command));
        let command = forward.wrapping_sub(shift_right_round(feedback, 8));
        let limited = command.clamp(PORT_MIN, PORT_MAX);
        self.error = error;
        self.command = limited as i32;
        MotorCommand {
            value: to_port(shift_right_round(limited, FRACTION)),
            saturated: limited != command,
        }
    }

    /// The gain alone, on a velocity error in sixteenths of a count per sample.
    #[inline]
    pub(super) fn gain_only(filter: LeadFilter, error_sixteenths: i32) -> MotorCommand {
        // (K/4) × Y/16.
        let scaled = i64::from(filter.gain).wrapping_mul(i64::from(error_sixteenths));
        let command = shift_right_round(scaled, 6);
        MotorCommand {
            value: to_port(command),
            saturated: !(-128..=127).contains(&command),
        }
    }
}

/// To the 8-bit port, saturating.
#[inline]
fn to_port(command: i64) -> i8 {
    command.clamp(-128, 127) as i8
}
