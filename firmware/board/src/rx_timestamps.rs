//! Time stamps of received bytes, from the interrupt handler to the main loop.

use crate::same_core::Announce;
use core::sync::atomic::{AtomicU32, Ordering};
use wheeleg_units::Micros;

/// RxTimestamps that fit; a power of two. Two delimiters a frame and at most four
/// frames a millisecond leave more than a tick of time to the main loop.
const CAPACITY: usize = 16;

/// Everything in the receive buffer before `position` had arrived at `time`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RxTimestamp {
    /// Index of the next byte in the receive buffer.
    pub position: u16,
    /// End of the byte before it.
    pub time: Micros,
}

/// Queue with one producer and one consumer.
///
/// When full, a new stamp is dropped and counted: its bytes are passed on with the next stamp, and the frame
/// check decides about them.
#[derive(Debug)]
pub struct RxTimestamps {
    times: [AtomicU32; CAPACITY],
    positions: [AtomicU32; CAPACITY],
    head: AtomicU32,
    tail: AtomicU32,
    lost: AtomicU32,
}

impl Default for RxTimestamps {
    fn default() -> Self {
        Self::new()
    }
}

impl RxTimestamps {
    /// An empty queue.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            times: [const { AtomicU32::new(0) }; CAPACITY],
            positions: [const { AtomicU32::new(0) }; CAPACITY],
            head: AtomicU32::new(0),
            tail: AtomicU32::new(0),
            lost: AtomicU32::new(0),
        }
    }

    fn index(counter: u32) -> usize {
        counter as usize % CAPACITY
    }

    /// Adds a stamp; only the interrupt handler calls this.
    pub fn push(&self, stamp: RxTimestamp) {
        let head = self.head.load(Ordering::Relaxed);
        if head.wrapping_sub(self.tail.seen()) >= CAPACITY as u32 {
            let lost = self.lost.load(Ordering::Relaxed);
            self.lost.store(lost.saturating_add(1), Ordering::Relaxed);
            return;
        }
        let index = Self::index(head);
        if let (Some(time), Some(position)) = (self.times.get(index), self.positions.get(index)) {
            time.store(stamp.time.get(), Ordering::Relaxed);
            position.store(u32::from(stamp.position), Ordering::Relaxed);
        }
        self.head.announce(head.wrapping_add(1));
    }

    /// The oldest stamp; only the main loop calls this and [`RxTimestamps::pop`].
    #[must_use]
    pub fn peek(&self) -> Option<RxTimestamp> {
        let tail = self.tail.load(Ordering::Relaxed);
        if tail == self.head.seen() {
            return None;
        }
        let index = Self::index(tail);
        let time = self.times.get(index)?.load(Ordering::Relaxed);
        let position = self.positions.get(index)?.load(Ordering::Relaxed);
        Some(RxTimestamp {
            position: position as u16,
            time: Micros(time),
        })
    }

    /// Takes the oldest stamp.
    pub fn pop(&self) -> Option<RxTimestamp> {
        let stamp = self.peek()?;
        let tail = self.tail.load(Ordering::Relaxed);
        self.tail.announce(tail.wrapping_add(1));
        Some(stamp)
    }

    /// Forgets all stamps.
    pub fn clear(&self) {
        self.tail.announce(self.head.seen());
    }

    /// RxTimestamps that found the queue full.
    #[must_use]
    pub fn lost(&self) -> u32 {
        self.lost.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamp(n: u32) -> RxTimestamp {
        RxTimestamp {
            position: (n % 256) as u16,
            time: Micros(n.wrapping_mul(0x0101_0101)),
        }
    }

    #[test]
    fn first_in_first_out_over_many_laps() {
        let stamps = RxTimestamps::new();
        assert_eq!(stamps.pop(), None);
        let (mut pushed, mut popped) = (0, 0);
        for round in 0..1000_u32 {
            for _ in 0..=round % CAPACITY as u32 {
                stamps.push(stamp(pushed));
                pushed += 1;
            }
            while let Some(seen) = stamps.peek() {
                assert_eq!(seen, stamp(popped));
                assert_eq!(stamps.pop(), Some(seen));
                popped += 1;
            }
        }
        assert_eq!((pushed, stamps.lost()), (popped, 0));
        stamps.push(stamp(1));
        stamps.push(stamp(2));
        stamps.clear();
        assert_eq!(stamps.pop(), None);
        stamps.push(stamp(3));
        assert_eq!(stamps.pop(), Some(stamp(3)));
    }

    #[test]
    fn a_full_queue_keeps_the_old_and_counts_the_new() {
        let stamps = RxTimestamps::new();
        for n in 0..CAPACITY as u32 + 3 {
            stamps.push(stamp(n));
        }
        assert_eq!(stamps.lost(), 3);
        let kept: Vec<RxTimestamp> = std::iter::from_fn(|| stamps.pop()).collect();
        assert_eq!(kept, (0..CAPACITY as u32).map(stamp).collect::<Vec<_>>());
    }
}
