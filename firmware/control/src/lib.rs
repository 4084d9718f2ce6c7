//! Control laws of the robot's eight boards: pure functions of state and input,
//! in fixed point.
//!
//! * [`joint`]: proportional law with a fuzzy correction, rest detection,
//!   anti-windup; on [`fuzzy`] (the inference engine), [`rules`] (its tables)
//!   and [`velocity`] (the estimate of ė).
//! * [`valve`] and [`pwm`]: from a signed duty to the on-times of four on/off
//!   valves, with their switching delays compensated.
//! * [`axis`]: the cylinder as the predictive law knows it: pressures, motion and
//!   load without a pressure sensor.
//! * [`reference`]: second-order reference generator with a governor, ahead of the predictive law.
//! * [`wheel`]: the HCTL-1100's lead filter and its four modes.
//!
//! Cost on a Cortex-M4, as instructions in a linked image (opt-level 2, static
//! count; every loop but the four valves is unrolled, so a tick executes
//! fewer): rule base of 7 × 7 about 180, velocity 170, the whole joint tick 910, valve
//! PWM 140 per valve at most, wheel sample about 300. The tick of a change of law adds one 64-bit
//! division.
//!
//! Sign conventions, units and rounding are those of [`wheeleg_units`]. There
//! is no clock: the length of a tick enters a configuration once, and every
//! call is one tick. No function of this crate panics, allocates or loops more
//! than its arrays are long.
//!
//! # Glossary
//!
//! * **duty**: signed share of a PWM period, −1 to 1; positive extends the cylinder
//! * **correction**: what the fuzzy inference adds to the proportional term
//! * **PD, ID**: the two fuzzy corrections of the paper: of error and its rate, of error and its
//!   integral
//! * **valve delay**: from the command to the flow: on-delay t_on, off-delay t_off
//! * **chamber A, B**: extends the piston, retracts it
//! * **predictive law**: law 5: plans single valve pulses from estimated pressures, with no PWM
//! * **observer**: estimate of pressures, motion and load from the potentiometer and the valve
//!   commands
//! * **Q-format**: fixed point: I16F16 has 16 integer and 16 fractional bits
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

pub mod axis;
pub mod fuzzy;
pub mod joint;
pub mod pwm;
pub mod reference;
pub mod rules;
pub mod valve;
pub mod velocity;
pub mod wheel;
