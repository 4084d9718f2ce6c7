//! The lead filter.
//!
//! ```text
//! D(z) = K (z − A/256) / (4 (z + B/256))
//! MC_n = (K/4) X_n − (A/256)(K/4) X_{n−1} − (B/256) MC_{n−1}
//! ```
//!
//! X is the position error in counts, MC the motor command, limited to 8 bits.
//!
//! Source: HCTL-1100 data sheet, filter equations (DATASHEET). Feeding back the limited command is ASSUMED, for the
//! reason given at `FilterMemory`.

use super::types::LeadFilter;
use wheeleg_units::{saturate_i32, shift_right_round, shift_right_round_i32};

/// Fractional bits of the internal motor command.
const FRACTION: u32 = 10;
/// Range of the 8-bit port, with the fraction.
const PORT_MAX: i32 = 127 << FRACTION;
const PORT_MIN: i32 = -(128 << FRACTION);

/// Old samples of the filter, cleared in idle.
///
/// ```text
/// MC_n = (K/4) X_n − (A/256)(K/4) X_{n−1} − (B/256) MC_{n−1}
/// ```
///
/// in units of 1/1024: K (256 X_n − A X_{n−1}) is exact, only the feedback is rounded. The MC that is fed back is
/// limited to the port. The data sheet does not specify this; with the unlimited one, a large step (K/4 = 16 on 1000
/// counts) would come back a quarter as large with the opposite sign, and drive the motor into full reverse in the next
/// sample.
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
        let [zero, pole, gain] = [filter.zero, filter.pole, filter.gain].map(i32::from);
        // Two products of 32 bits: errors have 24 bits, factors 16.
        let newest = i64::from(error).wrapping_mul(i64::from(gain.wrapping_shl(8)));
        let last = i64::from(self.error).wrapping_mul(i64::from(zero.wrapping_mul(gain)));
        // The command is within the port's range, 2^17, and its factor below 2^8.
        let feedback = shift_right_round_i32(pole.wrapping_mul(self.command), 8);
        let command = newest.wrapping_sub(last).wrapping_sub(i64::from(feedback));
        let limited = if command > i64::from(PORT_MAX) {
            PORT_MAX
        } else if command < i64::from(PORT_MIN) {
            PORT_MIN
        } else {
            command as i32
        };
        self.error = error;
        self.command = limited;
        MotorCommand {
            value: to_port(shift_right_round_i32(limited, FRACTION)),
            saturated: i64::from(limited) != command,
        }
    }

    /// The gain alone, on a velocity error in sixteenths of a count per sample.
    #[inline]
    pub(super) fn gain_only(filter: LeadFilter, error_sixteenths: i32) -> MotorCommand {
        // (K/4) × Y/16.
        let scaled = i64::from(filter.gain).wrapping_mul(i64::from(error_sixteenths));
        let command = shift_right_round(scaled, 6);
        MotorCommand {
            value: to_port(saturate_i32(command)),
            saturated: !(-128..=127).contains(&command),
        }
    }
}

/// Limits to the 8-bit port, saturating.
#[inline]
fn to_port(command: i32) -> i8 {
    command.clamp(-128, 127) as i8
}
