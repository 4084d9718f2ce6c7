//! The first half of a board's start, common to all images.

use super::{breaks, clock, fatal, identity, pins, power, watchdog};
use crate::led::Status;
use crate::straps;
use wheeleg_node::NodeIdentity;
use wheeleg_protocol::ResetCause;
use wheeleg_units::Micros;

/// A board before it has an application.
#[derive(Debug)]
pub struct Start {
    pub(super) source: clock::Source,
    /// Why the processor started.
    pub cause: ResetCause,
    /// Address by the straps and unique id.
    pub identity: Option<NodeIdentity>,
}

/// First steps of both kinds of board: reset cause, watchdog, clock, straps.
pub fn start() -> Start {
    #[cfg(feature = "mutant")]
    super::mutant::mark();
    let cause = fatal::take_cause();
    watchdog::start();
    let source = clock::start();
    breaks::guard_stack();
    clock::enable_common();
    power::start();
    breaks::connect();
    pins::configure_common();
    let identity = straps::address(pins::straps()).map(|address| NodeIdentity {
        address,
        unique_id: identity::unique_id(),
    });
    watchdog::feed();
    Start {
        source,
        cause,
        identity,
    }
}

impl Start {
    /// The board has no business here: outputs off, off the bus, LED code 3, for ever.
    pub fn halt(&self) -> ! {
        pins::force_outputs_off();
        let mut time = Micros::ZERO;
        loop {
            // About a millisecond; the clock of the application does not run.
            cortex_m::asm::delay(clock::CLOCK_HZ / 1000);
            time = Micros(time.get().wrapping_add(1000));
            pins::set_led(Status::NoAddress.is_lit(time, false));
            watchdog::feed();
        }
    }
}
