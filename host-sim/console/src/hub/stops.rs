//! Who has stopped the robot, as everybody is told.

use std::time::{Duration, Instant};

use serde::Serialize;
use wheeleg_master::command::CommandCode;
use wheeleg_master::event::HoldReason;
use wheeleg_telemetry::event::hold_name;
use wheeleg_telemetry::{EventCode, EventSample};

use super::Inner;
use crate::live::Status;
use wheeleg_access::desk::ClientId;

/// A stop is in SYNC after so long, or never.
const TAKEN: Duration = Duration::from_secs(1);

/// By which way a stop comes.
pub(crate) enum StopBy {
    /// A client of `/ws`.
    Client(ClientId),
    /// The HTTP API.
    Api,
    /// Foxglove's protocol.
    Foxglove,
}

/// Who asks for a stop, as everybody is told.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "via", rename_all = "snake_case")]
enum Stopper {
    /// A client of `/ws`: a page, `wheeleg ctl`, a program.
    Console {
        /// As it calls itself.
        name: String,
        /// Its session.
        session: String,
        /// What its key allows.
        role: &'static str,
    },
    /// Who uses the HTTP API.
    Api,
    /// A viewer by Foxglove's protocol.
    Foxglove,
}

/// A stop.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Stopped {
    #[serde(flatten)]
    by: Stopper,
    /// Master time at which it was asked for, µs.
    at_us: u64,
    /// Its number.
    #[serde(skip)]
    number: u64,
    /// It was seen in SYNC.
    #[serde(skip)]
    latched: bool,
    #[serde(skip)]
    asked: Instant,
    /// It was told as a command.
    #[serde(skip)]
    told: bool,
}

impl Stopped {
    /// Whether an event is this stop: its command, of which later ones are those of others, or
    /// that all axes hold for it, which a robot that holds already does not tell.
    pub(super) fn is(&mut self, event: &EventSample) -> bool {
        match event.code {
            EventCode::Hold => event.detail == hold_name(&HoldReason::EmergencyStop),
            EventCode::CommandAccepted => {
                let stops = event.command == CommandCode::EmergencyStop as u16;
                let first = stops && !self.told;
                self.told |= stops;
                first
            }
            _ => false,
        }
    }
}

impl Inner {
    /// Somebody has asked for a stop: remembers the first.
    pub(super) fn stopped_by(&mut self, by: StopBy, number: u64) {
        let first = self.stopped.as_ref();
        // While the clock stands, one that was taken is in no record yet.
        let status = self.status.as_ref();
        let waits = |first: &Stopped| {
            status.is_some_and(|status| status.pace.paused && status.stops >= first.number)
        };
        // One that was not taken in this time is none: the master was dead.
        if first
            .is_some_and(|first| first.latched || waits(first) || first.asked.elapsed() <= TAKEN)
        {
            return;
        }
        let by = match by {
            StopBy::Api => Some(Stopper::Api),
            StopBy::Foxglove => Some(Stopper::Foxglove),
            StopBy::Client(id) => self.clients.get(&id).map(|client| Stopper::Console {
                name: client.name.clone(),
                session: client.session.clone(),
                role: client.role.name(),
            }),
        };
        self.stopped = by.map(|by| Stopped {
            by,
            at_us: self.now_us(),
            number,
            latched: false,
            asked: Instant::now(),
            told: false,
        });
    }

    /// A stop that was latched and is no more is over.
    pub(super) fn look_at_stops(&mut self, status: &Status) {
        let over = self.stopped.as_mut().is_some_and(|stopped| {
            stopped.latched |= status.emergency_stop && status.stops >= stopped.number;
            stopped.latched && !status.emergency_stop
        });
        if over {
            self.stopped = None;
        }
    }
}
