//! What a board must have heard: a second view of the line, from the reference decoder and the text of
//! `SPEC.md` §4, to compare the board with.

use wheeleg_protocol::{
    Address, Envelope, Frame, Header, LinkLossAction, Message, SCHEMA_HASH, Sync,
};

use crate::reference::{self, Sound};

/// Time of a byte on the line, µs.
const BYTE_US: u32 = 10;
/// A bus cycle, µs.
pub(crate) const CYCLE_US: u32 = 10_000;

/// A frame that concerns the board under test.
#[derive(Clone, Debug)]
pub(crate) enum Heard {
    /// SYNC, whether its counter advanced or not.
    Sync(Sync),
    /// A frame of the master to this board; the message if it is one.
    Request(Sound, Option<Message>),
    /// A frame that claims to come from this board.
    AddressConflict,
}

/// Link supervision as the specification has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Link {
    /// No advancing counter yet.
    Waiting,
    /// Alive.
    Up,
    /// Lost until cleared.
    Lost,
}

/// The second view.
#[derive(Debug)]
pub(crate) struct Observer {
    address: Address,
    unfinished: Vec<u8>,
    counter: Option<u16>,
    /// Whether the exhaust is allowed by the newest fresh SYNC.
    pub(crate) exhaust_allowed: bool,
    /// State of the link.
    pub(crate) link: Link,
    advanced_at: Option<u32>,
    watchdog_us: u32,
}

impl Observer {
    pub(crate) fn new(address: Address) -> Self {
        Self {
            address,
            unfinished: Vec::new(),
            counter: None,
            exhaust_allowed: false,
            link: Link::Waiting,
            advanced_at: None,
            watchdog_us: 5 * CYCLE_US,
        }
    }

    /// Takes bytes whose last ended at `end`; gives what the board must make of
    /// them, each with the time at which it ended.
    pub(crate) fn hear(&mut self, bytes: &[u8], end: u32) -> Vec<(u32, Heard)> {
        let mut heard = Vec::new();
        for (index, byte) in bytes.iter().enumerate() {
            self.unfinished.push(*byte);
            if *byte != 0 {
                continue;
            }
            let behind = (bytes.len() - 1 - index) as u32;
            let at = end.wrapping_sub(BYTE_US * behind);
            let stretch = core::mem::take(&mut self.unfinished);
            for sound in reference::decode(&stretch).into_iter().flatten() {
                heard.extend(self.meaning(sound, at).map(|heard| (at, heard)));
            }
        }
        heard
    }

    fn meaning(&mut self, sound: Sound, at: u32) -> Option<Heard> {
        if sound.source == self.address.raw() {
            return Some(Heard::AddressConflict);
        }
        if sound.source != 0 {
            return None;
        }
        let message = parse(&sound);
        match (sound.destination, message) {
            (255, Some(Message::Sync(sync))) => {
                self.sync(&sync, at);
                Some(Heard::Sync(sync))
            }
            (to, message) if to == self.address.raw() => Some(Heard::Request(sound, message)),
            _ => None,
        }
    }

    fn sync(&mut self, sync: &Sync, at: u32) {
        let step = self.counter.map(|last| sync.cycle.wrapping_sub(last));
        let advanced = step.is_some_and(|step| (1..=11).contains(&step));
        // A living link keeps to its counter; otherwise any stream is followed.
        if advanced || self.link != Link::Up {
            self.counter = Some(sync.cycle);
        }
        if advanced {
            self.advanced_at = Some(at);
            if self.link == Link::Waiting {
                self.link = Link::Up;
            }
            let slot = sync.slots.joint(self.address);
            self.exhaust_allowed =
                slot.is_some_and(|slot| slot.on_link_loss == LinkLossAction::HoldThenExhaust);
        }
    }

    fn is_fresh(&self, now: u32) -> bool {
        self.advanced_at.is_some_and(|at| {
            let age = now.wrapping_sub(at);
            age <= self.watchdog_us || age > u32::MAX / 2
        })
    }

    /// A tick that begins at `now`; true if the link is lost in it.
    pub(crate) fn tick(&mut self, now: u32, watchdog_cycles: i32) -> bool {
        self.watchdog_us = CYCLE_US * u32::try_from(watchdog_cycles).expect("1 to 10");
        let lost = self.link == Link::Up && !self.is_fresh(now);
        if lost {
            self.link = Link::Lost;
            self.counter = None;
            self.advanced_at = None;
        }
        lost
    }

    /// ClearFault was carried out at `at`.
    pub(crate) fn cleared(&mut self, at: u32) {
        if self.link == Link::Lost {
            assert!(self.is_fresh(at), "cleared without a living link");
            self.link = Link::Up;
        }
    }
}

/// The message in a sound frame.
pub(crate) fn parse(sound: &Sound) -> Option<Message> {
    let header = Header {
        version: sound.version,
        message_type: sound.message_type,
        source: Address::new(sound.source)?,
        destination: Address::new(sound.destination)?,
        sequence: sound.sequence,
    };
    let payload = sound.payload.as_slice();
    Message::parse(&Frame { header, payload }).ok()
}

/// The one message in the bytes that a board sends.
pub(crate) fn sent(bytes: &[u8], own: Address) -> (Envelope, Message) {
    let found = reference::decode(bytes);
    let [Ok(sound)] = found.as_slice() else {
        panic!("a board sends one sound frame at a time, not {found:?}");
    };
    assert_eq!((sound.source, sound.destination), (own.raw(), 0));
    let message = parse(sound).expect("a board sends known messages");
    let envelope = Envelope {
        source: own,
        destination: Address::MASTER,
        sequence: sound.sequence,
    };
    (envelope, message)
}

/// Whether a request arms this board.
pub(crate) fn arms(message: Option<&Message>) -> bool {
    matches!(message, Some(Message::Arm(arm)) if arm.schema_hash == SCHEMA_HASH)
}
