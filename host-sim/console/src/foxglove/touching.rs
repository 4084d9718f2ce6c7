//! Contacts with the ground on their way from the robot's thread to the hub, while a viewer wants them. If
//! the ring is full they are dropped: the next ones replace them anyway.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use wheeleg_telemetry::{Contact, Sink, Taken};

/// Instants that may wait for the hub: about one second.
const WAITING: usize = 32;

/// All contacts at one instant.
#[derive(Debug)]
pub(crate) struct Touching {
    /// Simulated time, ns.
    pub(crate) t_ns: u64,
    /// The contacts.
    pub(crate) contacts: Vec<Contact>,
}

/// The robot's side.
pub(crate) struct ContactSink {
    to: rtrb::Producer<Touching>,
    wanted: Arc<AtomicBool>,
}

/// The hub's side.
pub(crate) struct ContactSource {
    from: rtrb::Consumer<Touching>,
    wanted: Arc<AtomicBool>,
}

/// Both sides.
pub(crate) fn contacts() -> (ContactSink, ContactSource) {
    let (to, from) = rtrb::RingBuffer::new(WAITING);
    let wanted = Arc::new(AtomicBool::new(false));
    let sink = ContactSink {
        to,
        wanted: Arc::clone(&wanted),
    };
    (sink, ContactSource { from, wanted })
}

impl ContactSource {
    /// Turns contacts on or off.
    pub(crate) fn want(&self, wanted: bool) {
        self.wanted.store(wanted, Ordering::Relaxed);
    }

    /// The newest contacts received.
    pub(crate) fn newest(&mut self) -> Option<Touching> {
        let mut newest = None;
        while let Ok(touching) = self.from.pop() {
            newest = Some(touching);
        }
        newest
    }
}

impl Sink for ContactSink {
    fn take(&mut self, _taken: &Taken<'_>) {}

    fn wants_contacts(&self) -> bool {
        self.wanted.load(Ordering::Relaxed)
    }

    fn contacts(&mut self, t_ns: u64, contacts: &[Contact], _lost: bool) {
        let touching = Touching {
            t_ns,
            contacts: contacts.to_vec(),
        };
        let _ = self.to.push(touching);
    }
}
