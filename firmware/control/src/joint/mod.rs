//! The joint law: u = Kp·e + fuzzy correction.
//!
//! ```text
//! e = reference − measured              ė = reference velocity − velocity
//! u = Kp e + C · rules(e, ė)  [PD]   or   Kp e + C · rules(∫e, ė)  [ID]
//!     + Kf · reference velocity + fade
//! duty = 0                                   at rest, or |u| < minimum
//!      = limit(u + sign(u) · dead zone)      driving: u towards a reference outside
//!                                            the settle band, or along its motion
//!      = limit(u)                            otherwise: braking
//! ```
//!
//! * **Velocity** is a regression over a window ([`crate::paper::velocity`]).
//! * **Anti-windup**: the integral advances only inside the integral zone, and not while the duty is limited and the
//!   error pushes further. It is bounded by its own scale, and zero under the PD correction.
//! * **Bumpless**: after a change of correction or gains the output continues from its last value, and the difference
//!   fades out linearly.
//! * **Dead zone.** Static friction and the shortest opening of a valve are bridged when the piston is to be driven,
//!   not when it is to be braked. Friction brakes by itself, and a bridged brake pulse turns a slow approach into a
//!   reversal, and that into a limit cycle.
//! * **At rest**, that is slow and inside the settle band, all valves are shut at once. After a dwell there the joint
//!   is *settled*, and no valve opens until the error has been outside the wider release band for its dwell, or the
//!   reference moves. Meanwhile nothing switches, whatever the noise.
//! * **Limits** that shaped an output are reported with it.
//!
//! The law is odd: inputs of opposite sign give exactly the opposite duty. A tick makes one 32-bit division (the
//! weighted mean); only the tick of a change of law makes another. It reads no clock and never panics; every
//! intermediate value is bounded as noted beside it.
//!
//! The other laws of [`Law`] share the input, the rest detection and the shaping of the duty. On/off, P and PID replace
//! Kp e + correction; the sliding law replaces the duty by one of seven valve modes. The predictive law
//! ([`crate::law`]) shares only the input and times each pulse itself.
//!
//! The term Kf · reference velocity belongs to both forms of u.
//!
//! Source: PAPER §8 for P with a fuzzy correction of PD or ID type. Anti-windup (conditional integration), the fade
//! after a change, dead zone and rest are ASSUMED: the paper does not describe them.
//!
//! Assumes: a supply that keeps its pressure, and valves whose delays are as specified, within the margin.

mod config;
mod controller;
mod modes;
mod settle;
mod types;

pub use crate::gain::Gain;
pub use config::{ConfigError, JointConfig, JointGains, JointParameter, JointRules};
pub use controller::JointController;
pub use types::{Announced, Correction, JointInput, JointLimits, JointOutput, Law};
