//! Who may send when, and what share of the line the cyclic traffic takes.
//!
//! All of it follows from message sizes at compile time: COBS costs one byte for every frame, so a frame's
//! time on the line depends only on its type.

use crate::address::{Address, NODES};
use crate::message::{Message, MessageType};

/// Line rate, bit/s (assumed; RS-485).
pub const BAUD: u32 = 1_000_000;
/// Bits on the line per byte: start, eight data, stop.
const BITS_PER_BYTE: u32 = 10;
/// Bus cycle, µs.
pub const CYCLE_US: u32 = 10_000;
/// From the end of a frame to the start of the answer to it, µs: driver switching, and the work of the board.
/// The worst case is the SYNC, which ends 20 µs after a tick edge: the conversion of that edge (23 µs), its
/// tick and the SYNC itself come first, then the answer must be ready in hardware.
pub const TURNAROUND_US: u32 = 120;
/// The same to the answer to [`MessageType::ParamSet`], µs: the board first recalculates everything that
/// follows from its parameters, which takes up to a third of it.
pub const SETTING_US: u32 = 1000;
/// Idle line between slots, µs.
pub const GAP_US: u32 = 20;
/// Largest share of the cycle for cyclic traffic, per mille.
const MAX_SHARE_PERMILLE: u32 = 400;
/// A motion command may lie at most this many bus cycles ahead of its deadline.
pub const MAX_DEADLINE_CYCLES: u16 = 200;
/// A repeated request is recognized for this long, µs.
pub const DUPLICATE_WINDOW_US: u64 = 500_000;

/// Slots for the answers to [`MessageType::Discover`]; a power of two.
pub const DISCOVERY_SLOTS: u32 = 8;

/// Slots of one bus cycle at a line rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlotTiming {
    baud: u32,
}

impl SlotTiming {
    /// The timing at [`BAUD`].
    pub const DEFAULT: Self = Self { baud: BAUD };

    /// At another line rate; `None` if the cyclic traffic would not fit its share.
    #[must_use]
    pub const fn new(baud: u32) -> Option<Self> {
        let timing = Self { baud };
        if baud > 0 && timing.cyclic_share_permille() <= MAX_SHARE_PERMILLE {
            Some(timing)
        } else {
            None
        }
    }

    /// Time of `bytes` on the line, µs, rounded up.
    #[must_use]
    pub const fn bytes_us(self, bytes: usize) -> u32 {
        let bits = (bytes as u64).saturating_mul(BITS_PER_BYTE as u64);
        let micros = bits
            .saturating_mul(1_000_000)
            .saturating_add((self.baud as u64).saturating_sub(1));
        match micros.checked_div(self.baud as u64) {
            Some(micros) if micros <= u32::MAX as u64 => micros as u32,
            _ => u32::MAX,
        }
    }

    /// Time of a frame of this type on the line, µs, delimiters included.
    #[must_use]
    pub const fn frame_us(self, message_type: MessageType) -> u32 {
        self.bytes_us(Message::encoded_len(message_type))
    }

    /// Start of a node's slot, µs after the end of the last byte of SYNC;
    /// `None` for master and broadcast.
    #[must_use]
    pub const fn slot_start_us(self, address: Address) -> Option<u32> {
        match address.slot() {
            Some(index) => Some(self.offset_us(index)),
            None => None,
        }
    }

    const fn offset_us(self, index: usize) -> u32 {
        let pitch = self.frame_us(MessageType::SlotReply).saturating_add(GAP_US);
        TURNAROUND_US.saturating_add(pitch.saturating_mul(index as u32))
    }

    /// Longest time for which a node's driver-enable may be on for a reply, µs:
    /// the frame and 10 %. A hardware timer on the board enforces it.
    #[must_use]
    pub const fn driver_limit_us(self) -> u32 {
        let frame = self.frame_us(MessageType::SlotReply);
        frame.saturating_add(frame.div_ceil(10))
    }

    /// SYNC, all slots and the gaps: from the start of SYNC to the start of the
    /// acyclic part of the cycle, µs.
    #[must_use]
    pub const fn cyclic_us(self) -> u32 {
        self.frame_us(MessageType::Sync)
            .saturating_add(self.offset_us(NODES))
    }

    /// Share of the cyclic traffic in the bus cycle, per mille, rounded up.
    #[must_use]
    pub const fn cyclic_share_permille(self) -> u32 {
        self.cyclic_us().saturating_mul(1000).div_ceil(CYCLE_US)
    }

    /// Start of a board's answer to [`MessageType::Discover`], µs after the end of the request: one of
    /// [`DISCOVERY_SLOTS`] slots, chosen by the unique id and the newest bus cycle. Two boards meet in one
    /// slot in one of eight cycles, and choose again in the next.
    #[must_use]
    pub fn discovery_us(self, unique_id: &[u8; 12], cycle: u16) -> u32 {
        // FNV-1a, 32 bit, over the cycle's low byte and the id; its upper bits. (With a
        // CRC, which is linear, two ids would meet in all cycles or in none.)
        let [low, _] = cycle.to_le_bytes();
        let hash = core::iter::once(&low)
            .chain(unique_id)
            .fold(0x811C_9DC5_u32, |hash, byte| {
                (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193)
            });
        let slot = hash.wrapping_shr(16) & DISCOVERY_SLOTS.wrapping_sub(1);
        let pitch = self.frame_us(MessageType::Identity).saturating_add(GAP_US);
        TURNAROUND_US.saturating_add(pitch.saturating_mul(slot))
    }

    /// From the end of a request to the start of the answer to it, µs, but for
    /// [`MessageType::Discover`] ([`Self::discovery_us`]).
    #[must_use]
    pub const fn turnaround_us(request: MessageType) -> u32 {
        match request {
            MessageType::ParamSet => SETTING_US,
            _ => TURNAROUND_US,
        }
    }

    /// Time that a request and its longest answer occupy the line, turnaround and
    /// gap included, µs; `None` if the type is no request.
    #[must_use]
    pub const fn exchange_us(self, request: MessageType) -> Option<u32> {
        let Some(answer) = request.answer() else {
            return None;
        };
        let answer = self.frame_us(answer);
        let nack = self.frame_us(MessageType::Nack);
        let longest = if answer > nack { answer } else { nack };
        let longest = if matches!(request, MessageType::Discover) {
            longest
                .saturating_add(GAP_US)
                .saturating_mul(DISCOVERY_SLOTS)
        } else {
            longest
        };
        Some(
            self.frame_us(request)
                .saturating_add(Self::turnaround_us(request))
                .saturating_add(longest)
                .saturating_add(GAP_US),
        )
    }

    /// Whether a request started `into_cycle_us` after the start of SYNC is
    /// answered before the next SYNC, and does not disturb the slots.
    #[must_use]
    pub const fn exchange_fits(self, request: MessageType, into_cycle_us: u32) -> bool {
        match self.exchange_us(request) {
            Some(exchange) => {
                into_cycle_us >= self.cyclic_us()
                    && into_cycle_us.saturating_add(exchange) <= CYCLE_US
            }
            None => false,
        }
    }
}

/// Share of the cyclic traffic in the bus cycle at [`BAUD`], per mille.
pub const CYCLIC_SHARE_PERMILLE: u32 = SlotTiming::DEFAULT.cyclic_share_permille();

const _: () = assert!(
    CYCLIC_SHARE_PERMILLE <= MAX_SHARE_PERMILLE,
    "cyclic traffic takes more than its share of the bus cycle"
);

// Every exchange fits into the acyclic part of one cycle.
const _: () = {
    let mut types = MessageType::ALL;
    while let [request, tail @ ..] = types {
        let start = SlotTiming::DEFAULT.cyclic_us();
        assert!(
            request.answer().is_none() || SlotTiming::DEFAULT.exchange_fits(*request, start),
            "an exchange does not fit into the acyclic part of a cycle"
        );
        types = tail;
    }
};

/// Whether a motion command may still take effect: `deadline_cycle` is the present cycle or at most
/// [`MAX_DEADLINE_CYCLES`] ahead of it, modulo 2^16. So a command that was kept in a queue over a broken link
/// is refused.
#[must_use]
pub const fn deadline_is_live(deadline_cycle: u16, present_cycle: u16) -> bool {
    deadline_cycle.wrapping_sub(present_cycle) <= MAX_DEADLINE_CYCLES
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budget_is_the_sum_of_its_parts() {
        // SYNC 102 bytes, reply 29 bytes, 10 µs a byte.
        let timing = SlotTiming::DEFAULT;
        assert_eq!(timing.frame_us(MessageType::Sync), 1020);
        assert_eq!(timing.frame_us(MessageType::SlotReply), 290);
        assert_eq!(timing.cyclic_us(), 1020 + 120 + 8 * (290 + 20));
        assert_eq!(CYCLIC_SHARE_PERMILLE, 362);
        assert_eq!(timing.driver_limit_us(), 319);
    }

    #[test]
    fn slots_follow_each_other_with_the_gap() {
        let timing = SlotTiming::DEFAULT;
        let mut end_of_last = 0;
        for address in Address::nodes() {
            let start = timing.slot_start_us(address).unwrap();
            assert!(start >= end_of_last + GAP_US.min(TURNAROUND_US));
            end_of_last = start + timing.frame_us(MessageType::SlotReply);
            // 200 ppm of clock error over the whole cyclic part stays inside the gap.
            assert!(f64::from(end_of_last) * 200e-6 * 2.0 < f64::from(GAP_US) / 2.0);
        }
        assert_eq!(timing.slot_start_us(Address::MASTER), None);
        assert_eq!(timing.slot_start_us(Address::BROADCAST), None);
        assert_eq!(
            end_of_last + GAP_US + timing.frame_us(MessageType::Sync),
            timing.cyclic_us()
        );
    }

    #[test]
    fn slow_lines_are_refused() {
        assert_eq!(SlotTiming::new(0), None);
        assert_eq!(SlotTiming::new(115_200), None);
        assert_eq!(SlotTiming::new(800_000), None);
        assert!(SlotTiming::new(2_000_000).is_some());
        assert_eq!(SlotTiming::DEFAULT.bytes_us(usize::MAX), u32::MAX);
    }

    #[test]
    fn exchanges_keep_to_the_acyclic_part() {
        let timing = SlotTiming::DEFAULT;
        let start = timing.cyclic_us();
        assert!(!timing.exchange_fits(MessageType::Identify, start - 1));
        assert!(timing.exchange_fits(MessageType::Identify, start));
        // Identify 15 bytes, Identity 40 bytes.
        let exchange = 150 + 120 + 400 + 20;
        assert_eq!(timing.exchange_us(MessageType::Identify), Some(exchange));
        assert!(timing.exchange_fits(MessageType::Identify, CYCLE_US - exchange));
        assert!(!timing.exchange_fits(MessageType::Identify, CYCLE_US - exchange + 1));
        assert!(!timing.exchange_fits(MessageType::Sync, start));
        // A parameter takes longer to set than to read; the answer is the same.
        let [get, set] = [MessageType::ParamGet, MessageType::ParamSet]
            .map(|request| timing.exchange_us(request).expect("a request"));
        let longer =
            timing.frame_us(MessageType::ParamSet) - timing.frame_us(MessageType::ParamGet);
        assert_eq!(set - get, longer + 880);
    }

    #[test]
    fn boards_at_one_address_part_within_a_few_cycles() {
        let timing = SlotTiming::DEFAULT;
        let ids: [[u8; 12]; 2] = [[3; 12], [0xFC; 12]];
        let mut apart = 0;
        for cycle in 0..256_u16 {
            let [a, b] = ids.map(|id| timing.discovery_us(&id, cycle));
            assert!(a >= TURNAROUND_US && b <= TURNAROUND_US + 7 * 420);
            assert_eq!(a, timing.discovery_us(&ids[0], cycle + 256));
            apart += u32::from(a.abs_diff(b) >= 420);
        }
        // Seven of eight cycles.
        assert!((205..=243).contains(&apart), "{apart}");
        assert_eq!(
            timing.exchange_us(MessageType::Discover),
            Some(150 + 120 + 8 * 420 + 20)
        );
    }

    #[test]
    fn deadlines_wrap_and_expire() {
        assert!(deadline_is_live(10, 10));
        assert!(!deadline_is_live(9, 10));
        assert!(deadline_is_live(5, 65_500));
        assert!(deadline_is_live(210, 10));
        assert!(!deadline_is_live(211, 10));
    }
}
