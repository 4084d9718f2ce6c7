//! The half-duplex RS-485 line, at byte time.
//!
//! A transmission occupies the line from its start for ten bit times a byte (start bit, eight data bits, stop
//! bit). Everybody but the sender receives it, whole, at the end of its last byte; a board's receiver
//! time-stamps that instant. Two drivers active at once corrupt each other's overlapping bytes (a wired AND
//! of the two bytes) and are counted; such bytes are on the line once, and a node that drives at the same
//! time hears nothing, because a transceiver's receiver is off while its driver is on.
//!
//! Not modelled here: propagation (10 ns on two metres of cable, a thousandth
//! of a byte), reflections, noise.

use std::borrow::Cow;
use std::collections::VecDeque;

/// Bits on the line for one byte: start, eight data, stop.
const BITS_PER_BYTE: u64 = 10;

/// The driver of the line: a bus address (0 master, 1–8 nodes), or another device on it
/// ([`super::rogue_nodes`]).
pub(super) type Driver = u8;

/// How long the end of a transmission is remembered, ns: longer than any
/// transmission lasts.
const MEMORY_NS: u64 = 10_000_000;

/// One stretch of bytes by one driver.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Delivery {
    /// Sender's address.
    pub from: Driver,
    /// First bit on the line \[ns\].
    pub start_ns: u64,
    /// End of the last byte \[ns\]; the instant of delivery.
    pub end_ns: u64,
    /// The bytes as received, after any collision.
    pub bytes: Vec<u8>,
    /// Bytes that another delivery has already, where there was a collision.
    shared: Option<Vec<bool>>,
}

/// Counters of the line, for telemetry and for the bandwidth budget.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct BusCounters {
    /// Bytes put on the line by all drivers.
    pub bytes: u64,
    /// Transmissions.
    pub frames: u64,
    /// Transmissions that overlapped another one.
    pub collisions: u64,
    /// Time the line was driven \[ns\], overlaps counted once per driver.
    pub busy_ns: u64,
}

/// The line: transmissions under way, in order of their end.
#[derive(Debug)]
pub(super) struct Bus {
    byte_ns: u64,
    under_way: VecDeque<Delivery>,
    counters: BusCounters,
    /// Drivers with the begin and end of their transmissions, ns: the newest ones.
    driven: VecDeque<(Driver, u64, u64)>,
    /// Deliveries that boards outside of this process still have to hear, if there are any.
    delivered: Option<Vec<Delivery>>,
}

impl Bus {
    /// A line at `baud` bit/s. The byte time is rounded to whole nanoseconds
    /// (exact for 1 Mbit/s and every divisor of it).
    #[must_use]
    pub(super) fn new(baud: u32) -> Self {
        Self {
            byte_ns: BITS_PER_BYTE * 1_000_000_000 / u64::from(baud.max(1)),
            under_way: VecDeque::new(),
            counters: BusCounters::default(),
            driven: VecDeque::new(),
            delivered: None,
        }
    }

    /// Duration of `bytes` bytes on the line \[ns\].
    #[must_use]
    pub(super) fn duration_ns(&self, bytes: usize) -> u64 {
        self.byte_ns * bytes as u64
    }

    /// Puts `bytes` on the line from `start_ns` on.
    pub(super) fn transmit(&mut self, from: Driver, start_ns: u64, mut bytes: Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let end_ns = start_ns + self.duration_ns(bytes.len());
        self.counters.bytes += bytes.len() as u64;
        self.counters.frames += 1;
        self.counters.busy_ns += end_ns - start_ns;
        let mut shared = None;
        for other in &mut self.under_way {
            if other.start_ns < end_ns && start_ns < other.end_ns {
                // Marked on both sides: neither driver hears the other.
                other
                    .shared
                    .get_or_insert_with(|| vec![false; other.bytes.len()]);
                let shared = shared.get_or_insert_with(|| vec![false; bytes.len()]);
                corrupt_overlap(self.byte_ns, other, start_ns, &mut bytes, shared);
            }
        }
        self.counters.collisions += u64::from(shared.is_some());
        while self
            .driven
            .front()
            .is_some_and(|(_, _, end)| end + MEMORY_NS < start_ns)
        {
            self.driven.pop_front();
        }
        self.driven.push_back((from, start_ns, end_ns));
        let at = self.under_way.partition_point(|d| d.end_ns <= end_ns);
        self.under_way.insert(
            at,
            Delivery {
                from,
                start_ns,
                end_ns,
                bytes,
                shared,
            },
        );
    }

    /// The part of a delivery that `listener` hears, and the end of its last byte, ns; none of its own bytes.
    #[must_use]
    pub(super) fn heard_by<'a>(
        &self,
        listener: Driver,
        delivery: &'a Delivery,
    ) -> Option<(Cow<'a, [u8]>, u64)> {
        if delivery.from == listener {
            return None;
        }
        let Some(shared) = &delivery.shared else {
            return Some((Cow::Borrowed(&delivery.bytes), delivery.end_ns));
        };
        let drives = |begin_ns: u64, end_ns: u64| {
            let mut driven = self.driven.iter();
            driven.any(|(from, begin, end)| *from == listener && *begin < end_ns && begin_ns < *end)
        };
        let (mut heard, mut last_ns) = (Vec::new(), delivery.start_ns);
        let mut begin_ns = delivery.start_ns;
        for (byte, shared) in delivery.bytes.iter().zip(shared) {
            let end_ns = begin_ns + self.byte_ns;
            if !shared && !drives(begin_ns, end_ns) {
                heard.push(*byte);
                last_ns = end_ns;
            }
            begin_ns = end_ns;
        }
        (!heard.is_empty()).then_some((Cow::Owned(heard), last_ns))
    }

    /// Instant of the next delivery \[ns\].
    #[must_use]
    pub(super) fn next_delivery_ns(&self) -> Option<u64> {
        self.under_way.front().map(|d| d.end_ns)
    }

    /// Whether `from` has a transmission under way or scheduled.
    #[must_use]
    pub(super) fn is_driven_by(&self, from: Driver) -> bool {
        self.under_way.iter().any(|d| d.from == from)
    }

    /// Takes the delivery due at or before `now_ns`, earliest first.
    pub(super) fn take_due(&mut self, now_ns: u64) -> Option<Delivery> {
        if self.next_delivery_ns()? > now_ns {
            return None;
        }
        let delivery = self.under_way.pop_front();
        if let (Some(replayed), Some(delivery)) = (&mut self.delivered, &delivery) {
            replayed.push(delivery.clone());
        }
        delivery
    }

    /// Keeps deliveries until [`Self::forget_delivered`], for [`Self::heard`].
    pub(super) fn keep_delivered(&mut self) {
        self.delivered.get_or_insert_default();
    }

    /// All boards have heard the deliveries that ended at or before `heard_ns`.
    pub(super) fn forget_delivered(&mut self, heard_ns: u64) {
        if let Some(replayed) = &mut self.delivered {
            replayed.retain(|delivery| delivery.end_ns > heard_ns);
        }
    }

    /// Duration of a byte \[ns\].
    #[must_use]
    pub(super) fn byte_ns(&self) -> u64 {
        self.byte_ns
    }

    /// Bytes that a receiver other than `listener`'s own driver has heard since
    /// `after_ns`, up to `until_ns`: end of each, and the byte.
    #[must_use]
    pub(super) fn heard(&self, listener: Driver, after_ns: u64, until_ns: u64) -> Vec<(u64, u8)> {
        let mut heard = Vec::new();
        let replayed = self.delivered.iter().flatten();
        for delivery in replayed
            .chain(&self.under_way)
            .filter(|d| d.from != listener)
        {
            let shared = |i: usize| delivery.shared.as_ref().is_some_and(|shared| shared[i]);
            for (i, byte) in delivery.bytes.iter().enumerate() {
                let end_ns = delivery.start_ns + (i as u64 + 1) * self.byte_ns;
                if !shared(i) && (after_ns + 1..=until_ns).contains(&end_ns) {
                    heard.push((end_ns, *byte));
                }
            }
        }
        heard.sort_by_key(|(end_ns, _)| *end_ns);
        heard
    }

    /// Counters since the start.
    #[must_use]
    pub(super) fn counters(&self) -> BusCounters {
        self.counters
    }
}

/// Wired AND of every pair of bytes that share line time; `shared` marks those of `bytes`.
fn corrupt_overlap(
    byte_ns: u64,
    earlier: &mut Delivery,
    start_ns: u64,
    bytes: &mut [u8],
    shared: &mut [bool],
) {
    for (i, a) in earlier.bytes.iter_mut().enumerate() {
        let a_start = earlier.start_ns + i as u64 * byte_ns;
        for (j, (b, shared)) in bytes.iter_mut().zip(shared.iter_mut()).enumerate() {
            let b_start = start_ns + j as u64 * byte_ns;
            if a_start < b_start + byte_ns && b_start < a_start + byte_ns {
                let both = *a & *b;
                *a = both;
                *b = both;
                *shared = true;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_takes_ten_bits() {
        let mut bus = Bus::new(1_000_000);
        bus.transmit(0, 5_000, vec![1, 2, 3]);
        assert_eq!(bus.next_delivery_ns(), Some(5_000 + 30_000));
        assert!(bus.take_due(34_999).is_none());
        let d = bus.take_due(35_000).expect("due");
        assert_eq!((d.from, d.bytes.as_slice()), (0, &[1u8, 2, 3][..]));
    }

    #[test]
    fn deliveries_come_in_order_of_their_end() {
        let mut bus = Bus::new(1_000_000);
        bus.transmit(1, 100_000, vec![0xAA; 10]);
        bus.transmit(2, 10_000, vec![0xBB; 2]);
        assert_eq!(bus.take_due(u64::MAX).map(|d| d.from), Some(2));
        assert_eq!(bus.take_due(u64::MAX).map(|d| d.from), Some(1));
        assert_eq!(bus.counters().collisions, 0);
    }

    #[test]
    fn overlapping_drivers_corrupt_only_what_overlaps() {
        let mut bus = Bus::new(1_000_000);
        bus.transmit(1, 0, vec![0xF0; 3]);
        bus.transmit(2, 20_000, vec![0x0F; 3]);
        assert_eq!(bus.counters().collisions, 1);
        let a = bus.take_due(u64::MAX).expect("first");
        let b = bus.take_due(u64::MAX).expect("second");
        assert_eq!(a.bytes, vec![0xF0, 0xF0, 0x00]);
        assert_eq!(b.bytes, vec![0x00, 0x0F, 0x0F]);
    }

    /// A third party hears the shared byte once; each driver hears what the other sent while it was silent
    /// itself.
    #[test]
    fn who_drives_hears_nothing_and_a_shared_byte_is_heard_once() {
        let mut bus = Bus::new(1_000_000);
        bus.transmit(1, 0, vec![0xF1; 3]);
        bus.transmit(2, 20_000, vec![0x1F; 3]);
        let heard = |bus: &Bus, listener, delivery: &Delivery| {
            let heard = bus.heard_by(listener, delivery);
            heard.map(|(bytes, end_ns)| (bytes.into_owned(), end_ns))
        };
        let a = bus.take_due(u64::MAX).expect("first");
        let b = bus.take_due(u64::MAX).expect("second");
        assert_eq!(heard(&bus, 0, &a), Some((vec![0xF1, 0xF1, 0x11], 30_000)));
        assert_eq!(heard(&bus, 0, &b), Some((vec![0x1F, 0x1F], 50_000)));
        assert_eq!(heard(&bus, 1, &a), None);
        assert_eq!(heard(&bus, 1, &b), Some((vec![0x1F, 0x1F], 50_000)));
        assert_eq!(heard(&bus, 2, &a), Some((vec![0xF1, 0xF1], 20_000)));
        // Two at the same time: neither hears anything.
        bus.transmit(1, 100_000, vec![7; 2]);
        bus.transmit(2, 100_000, vec![9; 2]);
        let a = bus.take_due(u64::MAX).expect("first");
        let b = bus.take_due(u64::MAX).expect("second");
        assert_eq!((heard(&bus, 1, &b), heard(&bus, 2, &a)), (None, None));
        assert_eq!(heard(&bus, 0, &a), Some((vec![1, 1], 120_000)));
        assert_eq!(heard(&bus, 0, &b), None);
    }

    #[test]
    fn a_byte_is_heard_once_by_all_but_its_sender() {
        let mut bus = Bus::new(1_000_000);
        bus.keep_delivered();
        bus.transmit(1, 0, vec![7, 8, 9]);
        assert_eq!(bus.heard(2, 0, 20_000), vec![(10_000, 7), (20_000, 8)]);
        assert_eq!(bus.heard(1, 0, 20_000), Vec::new());
        assert!(bus.take_due(30_000).is_some());
        assert_eq!(bus.heard(2, 20_000, 30_000), vec![(30_000, 9)]);
        bus.forget_delivered(29_999);
        assert_eq!(bus.heard(2, 20_000, 30_000), vec![(30_000, 9)], "kept");
        bus.forget_delivered(30_000);
        assert_eq!(bus.heard(2, 20_000, 30_000), Vec::new());
    }

    #[test]
    fn back_to_back_is_no_collision() {
        let mut bus = Bus::new(1_000_000);
        bus.transmit(1, 0, vec![0x11; 4]);
        bus.transmit(2, 40_000, vec![0x22; 4]);
        assert_eq!(bus.counters().collisions, 0);
        assert_eq!(bus.take_due(u64::MAX).map(|d| d.bytes), Some(vec![0x11; 4]));
    }
}
