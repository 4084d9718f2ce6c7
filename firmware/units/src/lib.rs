//! Quantities that cross a function boundary in the firmware, as types.
//!
//! Every quantity is a newtype over a fixed-point number of the [`fixed`]
//! crate, or over an integer. The Q-format is part of the type and of the
//! first doc line. There is no arithmetic by operator: `+` on a fixed-point
//! number wraps silently in a release build, so each type offers the
//! saturating (or, for wheel counts, wrapping) operation by name.
//!
//! # Sign conventions
//!
//! Written here once, and kept by every crate:
//!
//! * **error = target − measured.** A positive error asks for a larger position.
//! * **Positive position, velocity, force and duty extend a cylinder.** Chamber A
//!   extends, chamber B retracts; a positive [`Duty`] fills A and vents B.
//! * **Stroke** is zero at the fully retracted piston and at most about 180 mm.
//! * **A positive wheel count** is forward motion of the robot.
//! * **Valve order** is `[fill A, vent A, fill B, vent B]` everywhere.
//!
//! # Rounding
//!
//! A conversion to fewer fractional bits rounds to nearest, ties away from
//! zero, so that it is odd-symmetric: converting `-x` gives the negative of
//! converting `x` (see [`shift_right_round`]). A conversion that cannot hold
//! its result saturates. Conversions to more fractional bits are exact or
//! saturate. All of it is exact integer arithmetic, identical on every machine.
//!
//! # Range table
//!
//! | type | format | unit | range | step |
//! |---|---|---|---|---|
//! | [`PositionMm`] | I16F16 | mm | ±32 768 | 15.3 nm |
//! | [`VelocityMmS`] | I16F16 | mm/s | ±32 768 | 15.3 nm/s |
//! | [`WirePosition`] | I10F6 | mm | ±512 | 1/64 mm |
//! | [`WireVelocity`] | I12F4 | mm/s | ±2 048 | 1/16 mm/s |
//! | [`Duty`] | I2F30 | 1 | −1…1 | 9.3e-10 |
//! | [`WireDuty`] | I2F14 | 1 | −2…2 | 6.1e-5 |
//! | [`Micros`] | u32 | µs | 0…71 min | 1 µs |
//! | [`Ticks`] | u32 | control ticks | 0…2^32−1 | 1 |
//! | [`AdcCode`] | U0F16 | of full scale | 0…1 | 1/65 536 |
//! | [`WheelCount`] | 24-bit, wraps | encoder counts | ±8 388 608 | 1 |
//!
//! # Glossary
//!
//! * **Q-format**: fixed point: I16F16 has 16 integer and 16 fractional bits, U0F16 none and 16
//! * **newtype**: a struct of one field that gives a number its meaning
//! * **saturating**: a result beyond the range becomes its end
//! * **wire**: a smaller format in which a quantity travels on the bus
#![no_std]
#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic
    )
)]

mod adc;
mod divide;
mod duty;
mod motion;
mod round;
mod time;
mod wheel;

pub use adc::AdcCode;
pub use divide::{divide, divide_signed};
pub use duty::{Duty, WireDuty};
pub use motion::{PositionMm, VelocityMmS, WirePosition, WireVelocity};
pub use round::{
    saturate_i16, saturate_i32, shift_right_round, shift_right_round_i32, shift_right_round_inner,
};
pub use time::{Micros, Ticks};
pub use wheel::WheelCount;
