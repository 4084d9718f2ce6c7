//! The board's clock relative to the master's.
//!
//! SYNC carries the master's time at its start. The board keeps the difference at the latch of the newest SYNC, and the
//! drift over the last second, which is how far the difference has moved. A jump of more than 100 ms means another
//! master, not a drift.

use crate::overrun::elapsed;
use wheeleg_protocol::MessageType;
use wheeleg_protocol::link::SlotTiming;
use wheeleg_units::{Micros, divide_signed};

/// Time from the master's stamp to the latch: the duration of a SYNC on the line, µs.
const SYNC_US: u32 = SlotTiming::DEFAULT.frame_us(MessageType::Sync);

/// Time over which a drift is measured: in it, 1 µs is 1 ppm.
const WINDOW: Micros = Micros::from_millis(1000);

/// Largest step of the difference that counts as drift, µs.
const JUMP_US: i32 = 100_000;

/// Drift beyond which a board does not keep to its slot, ppm. From the latch of SYNC to the end of the last slot it
/// makes 5 µs, out of a gap of 20 µs between two slots, and the neighbour may be equally wrong in the other direction.
///
/// A board on its internal oscillator, accurate to about 2 %, exceeds it like any other whose clock is wrong: it would
/// cut off the replies of its neighbours, and sound boards would be blamed. It answers and gives the reason; it must
/// not be driven before its crystal is replaced.
pub const DRIFT_LIMIT_PPM: i16 = 2000;

/// Offset and drift.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TimeSync {
    offset_us: u32,
    /// Latch and offset at the start of the window.
    start: Option<(Micros, u32)>,
    drift_ppm: i16,
}

impl TimeSync {
    /// Takes the stamp of a SYNC latched at `at`. Returns true if the drift exceeded its limit in two consecutive
    /// windows in the same direction: late frames do not mean that the clock is wrong.
    pub fn sync(&mut self, master_time_us: u32, at: Micros) -> bool {
        self.offset_us = master_time_us.wrapping_add(SYNC_US).wrapping_sub(at.get());
        let Some((from, offset_us)) = self.start else {
            self.start = Some((at, self.offset_us));
            return false;
        };
        let moved = offset_us.wrapping_sub(self.offset_us) as i32;
        if !(-JUMP_US..=JUMP_US).contains(&moved) {
            self.start = None;
            return false;
        }
        let took = elapsed(from, at).get();
        if took < WINDOW.get() {
            return false;
        }
        self.start = Some((at, self.offset_us));
        let ppm = divide_signed(
            i64::from(moved).saturating_mul(i64::from(WINDOW.get())),
            i64::from(took),
        );
        let limit = |ppm: i16| i32::from(ppm / DRIFT_LIMIT_PPM).signum();
        let before = limit(self.drift_ppm);
        self.drift_ppm = ppm.clamp(i16::MIN.into(), i16::MAX.into()) as i16;
        before != 0 && before == limit(self.drift_ppm)
    }

    /// Master time minus board time, µs, modulo 2^32; 0 before the first SYNC.
    #[must_use]
    pub const fn offset_us(&self) -> u32 {
        self.offset_us
    }

    /// How much faster the board's clock runs than the master's, ppm.
    #[must_use]
    pub const fn drift_ppm(&self) -> i16 {
        self.drift_ppm
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_protocol::Address;
    use wheeleg_protocol::link::GAP_US;

    /// Seconds, out of ten, after which a clock that is wrong by `ppm` is a fault.
    fn fault_after(ppm: i64, late_us: impl Fn(i64) -> i64) -> (Option<i64>, TimeSync) {
        let mut clock = TimeSync::default();
        let mut fault = None;
        for cycle in 0..1000_i64 {
            let master = cycle * 10_000 + 4_294_000_000;
            let latched = master + 1020 + late_us(cycle);
            let board = latched + latched * ppm / 1_000_000 + 77_000;
            if clock.sync(master as u32, Micros(board as u32)) {
                fault = fault.or(Some(cycle / 100));
            }
        }
        (fault, clock)
    }

    #[test]
    fn drift_is_measured_within_a_ppm_and_only_a_wrong_clock_is_a_fault() {
        for ppm in [0, 35, -35, 200, -200, 1990] {
            let (fault, clock) = fault_after(ppm, |_| 0);
            assert_eq!(fault, None, "{ppm}");
            assert!(
                (i64::from(clock.drift_ppm()) - ppm).abs() <= 4,
                "{ppm} {clock:?}"
            );
        }
        for ppm in [2100, -2100, 10_000, 16_000, -19_000, 40_000, -50_000] {
            let (fault, _) = fault_after(ppm, |_| 0);
            assert!(matches!(fault, Some(1 | 2)), "{ppm} {fault:?}");
        }
    }

    #[test]
    fn within_the_limit_no_slot_reaches_the_next_one_and_on_the_internal_oscillator_some_do() {
        let timing = SlotTiming::DEFAULT;
        let last = Address::nodes()
            .last()
            .and_then(|a| timing.slot_start_us(a));
        let end_us = last.unwrap() + timing.frame_us(MessageType::SlotReply);
        let off_us = |ppm: u32| end_us * ppm / 1_000_000;
        // Two neighbours that are equally wrong, one in each direction.
        assert!(2 * off_us(DRIFT_LIMIT_PPM.unsigned_abs().into()) < GAP_US);
        // The oscillator over 0 to 85 °C (DATASHEET), next to a sound neighbour.
        assert!(off_us(10_000) > GAP_US && off_us(19_000) > 2 * GAP_US);
    }

    #[test]
    fn a_window_ends_with_its_time_and_drift_beyond_its_word_is_the_most_it_holds() {
        let mut clock = TimeSync::default();
        assert!(!clock.sync(0, Micros(0)));
        assert!(!clock.sync(WINDOW.get() - 101, Micros(WINDOW.get() - 1)));
        assert_eq!(clock.drift_ppm(), 0, "not yet");
        assert!(!clock.sync(WINDOW.get() - 100, Micros(WINDOW.get())));
        assert_eq!(clock.drift_ppm(), 100);
        for (ppm, told) in [(40_000, i16::MAX), (-50_000, i16::MIN)] {
            let (_, clock) = fault_after(ppm, |_| 0);
            assert_eq!(clock.drift_ppm(), told);
        }
    }

    #[test]
    fn the_offset_turns_board_time_into_master_time() {
        let (_, clock) = fault_after(0, |_| 0);
        let board: u32 = 12_345;
        let master = board.wrapping_add(clock.offset_us());
        assert_eq!(board, master.wrapping_add(77_000));
    }

    #[test]
    fn late_frames_and_a_new_master_are_no_drift() {
        // Late by up to 5 ms, in no particular order.
        let (fault, _) = fault_after(0, |cycle| cycle * 7919 % 5000);
        assert_eq!(fault, None);
        let mut clock = TimeSync::default();
        for cycle in 0..300_u32 {
            let restarted = if cycle < 150 { 0 } else { 3_000_000_000 };
            let master = restarted + cycle * 10_000;
            assert!(!clock.sync(master, Micros(cycle * 10_000 + 1020)));
        }
        assert_eq!(clock.drift_ppm(), 0);
    }
}
