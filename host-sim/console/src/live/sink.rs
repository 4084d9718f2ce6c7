//! The sink of a live robot: samples go into a ring to the hub. If it is full, they are dropped and counted.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use wheeleg_telemetry::{SampleRef, Sink, Taken, channels};

use super::{Moving, Signals};

/// Puts every sample into a ring.
pub(super) struct RingSink {
    to: rtrb::Producer<Moving>,
    numbers: Vec<u64>,
    signals: Arc<Signals>,
}

impl RingSink {
    pub(super) fn new(to: rtrb::Producer<Moving>, signals: Arc<Signals>) -> Self {
        Self {
            to,
            numbers: vec![0; channels().len()],
            signals,
        }
    }
}

impl Sink for RingSink {
    fn take(&mut self, taken: &Taken<'_>) {
        // The inputs of a run are requested, not sent.
        if matches!(taken.sample, SampleRef::Provenance(_)) {
            return;
        }
        let number = &mut self.numbers[taken.channel];
        *number += 1;
        let moving = Moving {
            channel: taken.channel as u16,
            number: *number,
            t_ns: taken.t_ns,
            sample: taken.sample.to_owned(),
        };
        if self.to.push(moving).is_err() {
            self.signals.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}
