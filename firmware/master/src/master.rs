//! The whole master: dispatcher, layers and FIFOs composed for one thread.

use heapless::Vec;

use crate::command::Command;
use crate::config::MasterConfig;
use crate::dispatcher::{Reject, Request, Ticket};
use crate::event::Event;
use crate::layer1::params::ParamError;
use crate::telemetry::Record;

/// Bytes to send, delimiters included; empty means nothing to send.
pub type TxBytes = Vec<u8, 200>;

/// The master.
#[derive(Debug)]
pub struct Master {}

impl Master {
    /// A disarmed master that has heard no node.
    ///
    /// # Errors
    /// The first limit that the gait parameters violate.
    pub fn new(config: MasterConfig) -> Result<Self, ParamError> {
        config.gait.validate()?;
        Ok(Self {})
    }

    /// Submits a command of the local user with a deadline of one second.
    ///
    /// # Errors
    /// See [`Reject`].
    pub fn submit(&mut self, command: Command, now_us: u64) -> Result<Ticket, Reject> {
        let _ = (command, now_us);
        Err(Reject::UnknownClient)
    }

    /// Submits a numbered command with a deadline.
    ///
    /// # Errors
    /// See [`Reject`].
    pub fn submit_request(&mut self, request: Request, now_us: u64) -> Result<Ticket, Reject> {
        let _ = (request, now_us);
        Err(Reject::UnknownClient)
    }

    /// Runs one bus cycle (every 10 ms): ends the last one (liveness, odometry,
    /// telemetry, feedback), runs layer 1, and returns the SYNC to send now.
    pub fn cycle(&mut self, now_us: u64) -> TxBytes {
        let _ = now_us;
        TxBytes::new()
    }

    /// Takes bytes received from the bus; `t_end_us` is the end of the last byte.
    pub fn on_bus_bytes(&mut self, bytes: &[u8], t_end_us: u64) {
        let _ = (bytes, t_end_us);
    }

    /// The next acyclic request to send at `now_us`, if one is due and fits the
    /// window. To be asked when the bus is silent after the last slot, and
    /// again when the answer came or timed out.
    pub fn next_acyclic(&mut self, now_us: u64) -> Option<TxBytes> {
        let _ = now_us;
        None
    }

    /// Takes the oldest telemetry record.
    pub fn take_telemetry(&mut self) -> Option<Record> {
        None
    }

    /// Takes the oldest event with its time in µs.
    pub fn take_event(&mut self) -> Option<(u64, Event)> {
        None
    }

    /// Stops or resumes layer 1 (test hook: a stalled layer 1).
    pub fn set_layer1_enabled(&mut self, enabled: bool) {
        let _ = enabled;
    }
}
