//! Who has stopped the robot, as shown to all clients.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;
use wheeleg_master::command::CommandCode;
use wheeleg_master::event::HoldReason;
use wheeleg_telemetry::event::hold_name;
use wheeleg_telemetry::{EventCode, EventSample};

use super::Inner;
use crate::live::{Signals, Status};
use wheeleg_access::desk::ClientId;

/// Time within which a stop is in SYNC, or never.
const TAKEN: Duration = Duration::from_secs(1);

/// The way in which a stop comes.
pub(crate) enum StopBy {
    /// A client of `/ws`.
    Client(ClientId),
    /// The HTTP API, with what the program calls itself.
    Api(Option<String>),
    /// Foxglove's protocol.
    Foxglove,
}

/// Requested stops that are not handled yet. This lock is held only for a moment, so a stop does not wait for
/// it.
#[derive(Clone, Default)]
pub(super) struct AskedStops(Arc<Mutex<Vec<(StopBy, u64)>>>);

impl AskedStops {
    /// Asks for a stop, and returns its number, under which its effect is traced back to `by`.
    pub(super) fn stop(&self, signals: &Signals, by: StopBy) -> u64 {
        let mut asked = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let number = signals.stop();
        asked.push((by, number));
        number
    }

    fn take(&self) -> Vec<(StopBy, u64)> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Sender of a stop, as shown to all clients.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "via", rename_all = "snake_case")]
enum Stopper {
    /// A client of `/ws`: a page, `wheeleg ctl`, a program.
    Console {
        /// The name it gave.
        name: String,
        /// Its session.
        session: String,
        /// What its key allows.
        role: &'static str,
    },
    /// Who uses the HTTP API.
    Api {
        /// As it calls itself, if it does.
        #[serde(skip_serializing_if = "Option::is_none")]
        name: Option<String>,
    },
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
    /// It was reported as a command.
    #[serde(skip)]
    told: bool,
}

impl Stopped {
    /// Whether an event is this stop: its command (later ones belong to others), or the hold of all axes,
    /// which a robot that already holds does not report.
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
    /// Adds the names of their senders to the requested stops.
    pub(super) fn name_stops(&mut self) {
        for (by, number) in self.asked_stops.take() {
            self.stopped_by(by, number);
        }
    }

    /// Remembers the first request for a stop.
    fn stopped_by(&mut self, by: StopBy, number: u64) {
        let first = self.stopped.as_ref();
        // While the clock stands, an accepted stop is not in any record yet.
        let status = self.status.as_ref();
        let waits = |first: &Stopped| {
            status.is_some_and(|status| status.pace.paused && status.stops >= first.number)
        };
        // A stop not accepted in this time never will be: the master was dead.
        if first
            .is_some_and(|first| first.latched || waits(first) || first.asked.elapsed() <= TAKEN)
        {
            return;
        }
        let by = match by {
            StopBy::Api(name) => Some(Stopper::Api { name }),
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

    /// Ends a stop that was latched and no longer is.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// However soon the robot accepts a stop, its sender is known.
    #[test]
    fn who_has_stopped_is_known_before_the_stop_is_seen() {
        const STOPS: u64 = 20_000;
        let (asked, signals) = (AskedStops::default(), Arc::new(Signals::default()));
        let stops = {
            let (asked, signals) = (asked.clone(), Arc::clone(&signals));
            std::thread::spawn(move || {
                (0..STOPS).for_each(|_| {
                    asked.stop(&signals, StopBy::Api(None));
                });
            })
        };
        let mut named = 0;
        while named < STOPS {
            let seen = signals.stops();
            named += asked.take().len() as u64;
            assert!(named >= seen, "{seen} seen, {named} named");
        }
        stops.join().expect("it ends");
    }
}
