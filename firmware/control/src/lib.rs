//! Control laws of the robot's eight boards: pure functions of configuration, state and input, in fixed point.
//!
//! | folder | what |
//! |---|---|
//! | [`observer`] | estimates without a pressure sensor: valves, chamber pressures, motion, load, mass |
//! | [`law`] | the predictive law on top of it: reference, prediction, switching curve, allocation, pulses, standstill |
//! | [`tuning`] | all gains and thresholds of these two, each with its unit, reason and the test that guards it |
//! | [`ablation`] | parts of these two that a study can remove, in a build of its own |
//! | [`axis`] | the axis data of a board, and the coefficients computed from them |
//! | [`paper`] | the paper's fuzzy inference with its rules, and the estimate of ė |
//! | [`joint`] | the controller of a joint board: one of six laws, by default the paper's (with one of two corrections) |
//! | [`valve`], [`pwm`] | from a signed duty to the on-times of four on/off valves, for the laws that do not plan pulses themselves |
//! | [`wheel`] | the HCTL-1100's lead filter and its four modes |
//!
//! Sign conventions, units and rounding are those of [`wheeleg_units`]. There is no clock: the length of a tick enters
//! a configuration once, and every call is one tick. No function of this crate panics, allocates or loops longer than
//! its arrays. Memory is not protected here: a board seals what it keeps by its `Hash`.
//!
//! # Glossary
//!
//! * **duty**: signed share of a PWM period, −1 to 1; positive extends the cylinder
//! * **correction**: what the fuzzy inference adds to the proportional term
//! * **PD, ID**: the two fuzzy corrections of the paper: from the error and its rate, and from the error and its
//!   integral
//! * **valve delay**: from the command to the flow: on-delay t_on, off-delay t_off
//! * **chamber A, B**: A extends the piston, B retracts it
//! * **predictive law**: law 5: plans single valve pulses from estimated pressures, without PWM
//! * **observer**: estimates pressures, motion and load from the potentiometer and the valve commands
//! * **told**: given by the axis data, not learnt
//! * **external**: of valve commands: sent by the board and not by the law, as in exhaust, precharge and hold
//! * **choked speed**: C ρ0 R T0 / A: piston speed at which an open outlet holds the pressure of its chamber
//! * **power**: in the observer, of a valve or of the piston, per piston area: pressure times speed
//! * **law period**, in [`law`] and [`observer`] **period**: four ticks; in the last one the observer and the
//!   predictive law work, and plan the pulses of the next period. In [`pwm`] a period is that of the valve PWM
//! * **moment**: the instant in a law period at which the observer's estimates hold
//! * **dead time**: from the moment until a pulse of the next law period takes effect at its chamber
//! * **nimble mass**: the heaviest mass that the valves can still move as fast as the dead time would allow
//! * **pressure swap**: the drive chamber compensates for a counter chamber that cannot vent any faster
//! * **patience**: time for which the law acts near a target before it accepts a wider rest band
//! * **break-away ramp**: a force that grows while the piston sticks: the integral term of this law
//! * **committed**: of openings: can no longer be taken back, because the pulse is under way
//! * **expected**: at the end of the dead time, including the pulses under way
//! * **oscillation**: of the mass on the air of both chambers, with the valves shut
//! * **band**: error within which a piston rests
//! * **seat**: a piston pressed against the end stop that is its target
//! * **preload**: a force at the edge of slipping, ahead of an announced move
//! * **Q-format**: fixed point: I16F16 has 16 integer and 16 fractional bits; "raw" is such a number as an integer
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

pub mod ablation;
pub mod axis;
mod gain;
pub mod joint;
pub mod law;
mod math;
pub mod observer;
pub mod paper;
pub mod pwm;
pub mod tuning;
pub mod valve;
pub mod wheel;
