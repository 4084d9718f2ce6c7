//! Wheel control as in the HCTL-1100, behind a typed interface.
//!
//! What a user of the chip relies on is kept (HCTL-1100 data sheet pp. 14–35, DATASHEET; [`WheelController`] lists it).
//! Registers, commutator, bus timing and multi-chip synchronisation are left out. Positions have 24 bits and wrap.
//!
//! * [`LeadFilter`] and its arithmetic: `wheel/filter.rs`.
//! * Trapezoidal profile and velocity ramp: `wheel/profile.rs`.
//! * Modes, flags, output port: `wheel/controller.rs`.
//!
//! The chip's word lengths and rounding are not in its data sheet. Those used here:
//!
//! | quantity | format | rounding |
//! |---|---|---|
//! | filter output before the port | 1/1024 | feedback term to nearest |
//! | motor command | 8 bit | to nearest, then −128…127 |
//! | PWM | per cent | −100…100 |
//! | profile position | 24.8, wraps | exact |
//! | profile velocity | 7.8 with sign | exact |
//!
//! "Nearest" means ties away from zero throughout.

mod controller;
mod filter;
mod profile;
mod types;

pub use controller::WheelController;
pub use profile::{Profile, Ramp};
pub use types::{
    LeadFilter, SampleTimer, WheelAcceleration, WheelCommand, WheelError, WheelInput, WheelMode,
    WheelOutput, WheelStatus, WheelVelocity,
};
