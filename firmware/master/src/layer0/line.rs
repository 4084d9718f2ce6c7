//! Frames on the line that nobody requested, and who sends them.
//!
//! A board that babbles within its driver-enable time limit spoils only its own slot, which
//! identifies it. If the board in the slot before is not received either, the replies of the two
//! collide: the clock of one of them is wrong. Without the time limit a babbling board spoils all
//! slots, and no board can be received. When the line is quiet again, the boards' own counters tell
//! which one it was: a board whose driver is on receives nothing, so the one that has counted no
//! errors has caused them.

use wheeleg_protocol::link::SlotTiming;
use wheeleg_protocol::{Address, LinkRecord, Message, MessageType};

use crate::setpoint::NODES;

const TIMING: SlotTiming = SlotTiming::DEFAULT;
/// A reply on the line, delimiters included.
const REPLY_BYTES: usize = Message::encoded_len(MessageType::SlotReply);
/// Rubbish in a slot that cannot be accidental: half a reply, bytes.
const SPOILT_SLOT: u32 = REPLY_BYTES as u32 / 2;
/// Number of consecutive cycles in which a slot is spoilt before its board is named; as many as make a board lost.
const SPOILT_CYCLES: u8 = 3;
/// Rubbish in a cycle that cannot be explained by damaged traffic: 40 % of the line. All replies and the longest answer
/// are less than 500 bytes, 232 of them replies in slots, and an answer is not repeated in the same cycle.
const BABBLE_BYTES: u32 = 400;
/// Number of consecutive cycles with this much rubbish.
const BABBLE_CYCLES: u8 = 2;
/// Number of cycles without it after which the line is quiet.
const QUIET_CYCLES: u8 = 10;
/// Bytes of a cycle in unrequested frames: 30 % of the line.
const FLOOD_BYTES: u32 = 300;
/// Number of consecutive cycles with that many bytes.
const FLOOD_CYCLES: u8 = 10;
/// Fewest errors that babble leaves in the counters of a board that hears it.
const HEARD_ERRORS: u32 = 4;

/// State of a lasting condition: reported when it begins, and again after it has ended.
#[derive(Clone, Copy, Debug, Default)]
struct Lasting {
    cycles: u8,
    quiet: u8,
    told: bool,
}

/// Effect of a cycle on a condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Edge {
    None,
    Begins,
    Ends,
}

impl Lasting {
    fn cycle(&mut self, now: bool, begin: u8) -> Edge {
        if now {
            self.quiet = 0;
            self.cycles = self.cycles.saturating_add(1);
            if self.cycles >= begin && !self.told {
                self.told = true;
                return Edge::Begins;
            }
            return Edge::None;
        }
        self.cycles = 0;
        self.quiet = self.quiet.saturating_add(1);
        if self.told && self.quiet >= QUIET_CYCLES {
            self.told = false;
            return Edge::Ends;
        }
        Edge::None
    }
}

/// Finding of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// The line is full of rubbish.
    Babble,
    /// It is over.
    BabbleOver,
    /// This node sends unrequested frames.
    Flood(Address),
}

/// Cause of the rubbish in the slot of a board that is not heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spoilt {
    /// Its own reply alone.
    Own,
    /// Its own reply, and that of the board in the slot before.
    WithTheSlotBefore,
}

/// Watch over the line.
#[derive(Clone, Copy, Debug, Default)]
pub struct Line {
    /// Bytes since the last valid frame.
    open: u32,
    /// Bytes of this cycle that belong to no valid frame.
    rubbish: u32,
    /// The same per slot.
    slots: [u32; NODES],
    /// Bytes of this cycle in unrequested frames, per node.
    unasked: [u32; NODES],
    spoilt: [u8; NODES],
    /// Number of consecutive cycles in which each node was not heard.
    silent: [u8; NODES],
    babble: Lasting,
    floods: [Lasting; NODES],
    /// Errors that each node had counted before the babble, and after it.
    before: [Option<u32>; NODES],
    after: [Option<u32>; NODES],
    asks: bool,
}

impl Line {
    /// A byte was received.
    #[inline]
    pub fn byte(&mut self) {
        self.open = self.open.saturating_add(1);
    }

    /// This byte ended a valid frame of `encoded` bytes, delimiters included.
    pub fn sound(&mut self, encoded: usize) {
        // Its first delimiter may also have been the last one of the frame before it.
        let own = u32::try_from(encoded).unwrap_or(u32::MAX);
        self.rubbish = self.rubbish.saturating_add(self.open.saturating_sub(own));
        self.open = 0;
    }

    /// A stretch of bytes without a valid frame ended `into_us` after the start of SYNC. A stretch with the shape of a
    /// reply is a damaged reply, or those of two boards at once.
    pub fn stretch(&mut self, bytes: &[u8], into_us: u64) {
        let whole = bytes.len().abs_diff(REPLY_BYTES) <= 1;
        if whole && bytes.first() == Some(&0) && bytes.last() == Some(&0) {
            return;
        }
        let (Some(first), Some(second)) = (Address::of_slot(0), Address::of_slot(1)) else {
            return;
        };
        let begin = |address| TIMING.slot_start_us(address).unwrap_or(0);
        let pitch = begin(second).saturating_sub(begin(first));
        let sync = TIMING
            .frame_us(MessageType::Sync)
            .saturating_add(begin(first));
        // A stretch that ends with its slot is still within it.
        let into = into_us.saturating_sub(u64::from(sync).saturating_add(1));
        let slot = into.checked_div(u64::from(pitch));
        let slot = slot.and_then(|slot| usize::try_from(slot).ok());
        if let Some(rubbish) = slot.and_then(|slot| self.slots.get_mut(slot)) {
            *rubbish = rubbish.saturating_add(u32::try_from(bytes.len()).unwrap_or(u32::MAX));
        }
    }

    /// A valid frame that was not requested.
    pub fn unasked(&mut self, from: Address, encoded: usize) {
        if let Some(bytes) = from.slot().and_then(|index| self.unasked.get_mut(index)) {
            *bytes = bytes.saturating_add(u32::try_from(encoded).unwrap_or(u32::MAX));
        }
    }

    /// Ends a cycle; `replied` returns which nodes were heard in it. Calls `found` for each condition that begins or
    /// ends.
    pub fn end_cycle(&mut self, replied: impl Fn(usize) -> bool, mut found: impl FnMut(Found)) {
        let rubbish = self.rubbish.saturating_add(core::mem::take(&mut self.open));
        self.rubbish = 0;
        match self.babble.cycle(rubbish >= BABBLE_BYTES, BABBLE_CYCLES) {
            Edge::Begins => {
                self.asks = false;
                found(Found::Babble);
            }
            Edge::Ends => {
                self.asks = true;
                self.after = [None; NODES];
                found(Found::BabbleOver);
            }
            Edge::None => {}
        }
        let slots = self.spoilt.iter_mut().zip(&mut self.slots);
        for (index, (spoilt, bytes)) in slots.enumerate() {
            let now = core::mem::take(bytes) >= SPOILT_SLOT && !replied(index);
            *spoilt = if now { spoilt.saturating_add(1) } else { 0 };
        }
        for (index, silent) in self.silent.iter_mut().enumerate() {
            *silent = if replied(index) {
                0
            } else {
                silent.saturating_add(1)
            };
        }
        let floods = self.floods.iter_mut().zip(&mut self.unasked);
        for (index, (flood, bytes)) in floods.enumerate() {
            let now = core::mem::take(bytes) >= FLOOD_BYTES;
            if flood.cycle(now, FLOOD_CYCLES) == Edge::Begins
                && let Some(address) = Address::of_slot(index)
            {
                found(Found::Flood(address));
            }
        }
    }

    /// The cause, if only the slot of node index 0..8 has been spoilt, and for as long as it takes until a board counts
    /// as lost.
    #[must_use]
    pub fn spoilt(&self, index: usize) -> Option<Spoilt> {
        let lasts = |cycles: &u8| *cycles >= SPOILT_CYCLES;
        let alone = self.spoilt.iter().filter(|slot| lasts(slot)).count() == 1;
        if self.babble.told || !alone || !self.spoilt.get(index).is_some_and(lasts) {
            return None;
        }
        let before = index.checked_sub(1).and_then(|i| self.silent.get(i));
        Some(if before.is_some_and(lasts) {
            Spoilt::WithTheSlotBefore
        } else {
            Spoilt::Own
        })
    }

    /// Takes the link record of node index 0..8. Returns the board that babbled, once, when all others have counted
    /// rubbish since the babble began and it has not.
    pub fn heard(&mut self, index: usize, record: &LinkRecord) -> Option<Address> {
        let errors = record.errors();
        if self.babble.told {
            // Not over, or not known to be: the counts are neither from before nor from after.
            return None;
        }
        if !self.asks {
            if let Some(before) = self.before.get_mut(index) {
                *before = Some(errors);
            }
            return None;
        }
        if let Some(after) = self.after.get_mut(index) {
            *after = Some(errors);
        }
        let mut deaf = None;
        for (index, (before, after)) in self.before.iter().zip(&self.after).enumerate() {
            // A board that was reset meanwhile has restarted its count and proves nothing.
            let grown = (*after)?.checked_sub(before.unwrap_or(0))?;
            if grown < HEARD_ERRORS {
                if deaf.is_some() {
                    self.asks = false;
                    return None;
                }
                deaf = Some(index);
            }
        }
        self.asks = false;
        self.before = self.after;
        deaf.and_then(Address::of_slot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(errors: u16) -> LinkRecord {
        LinkRecord {
            frames: 1000,
            overflow: 0,
            truncated: errors / 2,
            short: 0,
            crc: errors - errors / 2,
            version: 0,
            length: 0,
            address: 0,
            unsent: 0,
            drift_ppm: 0,
            parameters: 0,
        }
    }

    fn cycles(line: &mut Line, count: usize, bytes: u32) -> Vec<Found> {
        let mut found = Vec::new();
        for _ in 0..count {
            (0..bytes).for_each(|_| line.byte());
            line.end_cycle(|_| false, |f| found.push(f));
        }
        found
    }

    #[test]
    fn broken_replies_and_answers_are_no_babble() {
        let mut line = Line::default();
        assert_eq!(cycles(&mut line, 50, 8 * 29 + 60), []);
        for _ in 0..50 {
            (0..232).for_each(|_| line.byte());
            line.sound(232);
            assert_eq!(cycles(&mut line, 1, 300), []);
        }
    }

    #[test]
    fn who_heard_nothing_of_it_has_babbled() {
        for guilty in 0..NODES {
            let mut line = Line::default();
            for index in 0..NODES {
                assert_eq!(line.heard(index, &record(7)), None);
            }
            assert_eq!(cycles(&mut line, 30, 1000), [Found::Babble]);
            assert_eq!(cycles(&mut line, 20, 0), [Found::BabbleOver]);
            for index in 0..NODES {
                // 3 more than before, and the smallest number that counts as heard.
                let errors = if index == guilty { 10 } else { 11 };
                let told = line.heard(index, &record(errors));
                let last = index + 1 == NODES;
                assert_eq!(told, last.then(|| Address::of_slot(guilty)).flatten());
            }
            assert_eq!(line.heard(0, &record(60)), None, "told once");
        }
    }

    #[test]
    fn nobody_is_accused_when_all_or_two_are_deaf_or_one_was_reset() {
        let after: [[u16; NODES]; 4] = [
            [60; NODES],
            [7; NODES],
            [60, 60, 7, 60, 60, 7, 60, 60],
            [60, 60, 7, 60, 60, 0, 60, 60],
        ];
        for counts in after {
            let mut line = Line::default();
            for index in 0..NODES {
                line.heard(index, &record(7));
            }
            cycles(&mut line, 30, 1000);
            cycles(&mut line, 20, 0);
            for (index, errors) in counts.iter().enumerate() {
                assert_eq!(line.heard(index, &record(*errors)), None, "{counts:?}");
            }
        }
    }

    #[test]
    fn a_spoilt_slot_names_its_board_unless_others_are_spoilt_too() {
        let slot_end = |slot: u64| 1020 + 120 + slot * 310 + 310;
        let mut line = Line::default();
        let mut garbled = [7; REPLY_BYTES];
        [garbled[0], garbled[REPLY_BYTES - 1]] = [0; 2];
        for _ in 0..5 {
            line.stretch(&garbled, slot_end(4));
            line.end_cycle(|index| index != 4, |_| {});
            assert_eq!(line.spoilt(4), None, "two replies at once");
        }
        for cycle in 0..3 {
            assert_eq!(line.spoilt(4), None, "{cycle}");
            line.stretch(&[7; 31], slot_end(4));
            line.end_cycle(|index| index != 4, |_| {});
        }
        let named: Vec<usize> = (0..NODES).filter(|i| line.spoilt(*i).is_some()).collect();
        assert_eq!(named, [4]);
        assert_eq!(line.spoilt(4), Some(Spoilt::Own));
        for _ in 0..3 {
            line.stretch(&[7; 31], slot_end(4));
            line.stretch(&[7; 31], slot_end(5));
            line.end_cycle(|_| false, |_| {});
        }
        assert!((0..NODES).all(|i| line.spoilt(i).is_none()));
        line.end_cycle(|_| true, |_| {});
        line.stretch(&[7; 31], slot_end(4));
        line.end_cycle(|index| index != 4, |_| {});
        assert_eq!(line.spoilt(4), None, "begins anew");
    }

    #[test]
    fn two_boards_in_a_row_that_are_not_heard_have_spoilt_the_slot_of_the_second_together() {
        let slot_end = |slot: u64| 1020 + 120 + slot * 310 + 310;
        let spoilt = |silent: [usize; 2]| {
            let mut line = Line::default();
            for _ in 0..SPOILT_CYCLES {
                line.stretch(&[7; 45], slot_end(4));
                line.end_cycle(|index| !silent.contains(&index), |_| {});
            }
            line.spoilt(4)
        };
        assert_eq!(spoilt([3, 4]), Some(Spoilt::WithTheSlotBefore));
        // The tail of a reply never reaches the slot before, or skips a slot.
        assert_eq!(spoilt([4, 5]), Some(Spoilt::Own));
        assert_eq!(spoilt([2, 4]), Some(Spoilt::Own));
    }

    #[test]
    fn a_condition_is_told_in_the_cycle_in_which_it_has_lasted_and_is_over_after_ten() {
        let mut lasting = Lasting::default();
        for _ in 0..3 {
            assert_eq!(lasting.cycle(true, 4), Edge::None);
        }
        assert_eq!(lasting.cycle(false, 4), Edge::None, "not in a row");
        let edges: [Edge; 6] = core::array::from_fn(|_| lasting.cycle(true, 4));
        assert_eq!(edges[3], Edge::Begins);
        assert!(edges.iter().filter(|edge| **edge != Edge::None).count() == 1);
        for _ in 1..QUIET_CYCLES {
            assert_eq!(lasting.cycle(false, 4), Edge::None);
        }
        assert_eq!(lasting.cycle(false, 4), Edge::Ends);
        assert_eq!(lasting.cycle(false, 4), Edge::None, "told once");
    }

    #[test]
    fn rubbish_of_half_a_reply_spoils_a_slot_and_only_the_shape_of_a_reply_is_excused() {
        let spoils = |bytes: &[u8]| {
            let mut line = Line::default();
            for _ in 0..SPOILT_CYCLES {
                line.stretch(bytes, 1020 + 120 + 3 * 310);
                line.end_cycle(|index| index != 2, |_| {});
            }
            line.spoilt(2).is_some()
        };
        let half = REPLY_BYTES / 2;
        assert!(!spoils(&[7; REPLY_BYTES][..half - 1]) && spoils(&[7; REPLY_BYTES][..half]));
        let shaped = |length: usize, first: u8, last: u8| {
            let mut bytes = vec![7; length];
            (bytes[0], bytes[length - 1]) = (first, last);
            bytes
        };
        for (length, first, last, excused) in [
            (REPLY_BYTES, 0, 0, true),
            (REPLY_BYTES + 1, 0, 0, true),
            (REPLY_BYTES - 1, 0, 0, true),
            (REPLY_BYTES + 2, 0, 0, false),
            (REPLY_BYTES - 2, 0, 0, false),
            (REPLY_BYTES, 7, 0, false),
            (REPLY_BYTES, 0, 7, false),
        ] {
            let bytes = shaped(length, first, last);
            assert_eq!(spoils(&bytes), !excused, "{length} {first} {last}");
        }
    }

    #[test]
    fn who_fills_the_line_is_named_once() {
        let mut line = Line::default();
        let mut found = Vec::new();
        let wheel = Address::wheel(8).unwrap();
        for _ in 0..30 {
            line.unasked(wheel, 200);
            line.unasked(wheel, 200);
            line.unasked(Address::joint(1).unwrap(), 200);
            line.end_cycle(|_| true, |f| found.push(f));
        }
        assert_eq!(found, [Found::Flood(wheel)]);
    }
}
