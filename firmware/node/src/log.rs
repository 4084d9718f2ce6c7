//! The log stream of a board: sends records in left-over bandwidth while somebody reads.
//!
//! A reader holds a lease; without one nothing is recorded. A token bucket keeps a storm of events from crowding out
//! everything else: sixteen records at once, and one per millisecond on average. What exceeds this is counted as lost.
//!
//! A tick only notes what happened, in a few words. Whether that is recorded is decided between two ticks, so that a
//! fault costs its tick no more than its reaction. The result does not depend on when that is done.

use heapless::Deque;
use wheeleg_protocol::{LOG_ENTRIES, LogEntry, LogRecords};
use wheeleg_units::Micros;

/// Capacity for waiting records, and tokens of a full bucket.
const DEPTH: usize = 16;

/// Capacity for notes; a fault and the change of mode that it causes are two.
const NOTES: usize = 8;

/// Waiting records of one board.
#[derive(Clone, Debug, Default)]
pub struct Log {
    /// What happened and has not been processed yet, oldest first.
    noted: heapless::Vec<LogEntry, NOTES>,
    waiting: Deque<[u8; 8], DEPTH>,
    lost: u16,
    /// End of the lease, µs since reset; 0 when nobody reads.
    lease_end_us: u64,
    tokens: u8,
    /// Millisecond of the last record.
    filled_ms: u64,
}

impl Log {
    /// Notes what happened, to be processed by [`Self::settle`]; returns it if there is no room.
    #[inline]
    pub fn note(&mut self, entry: LogEntry) -> Result<(), LogEntry> {
        self.noted.push(entry)
    }

    /// Whether anything waits to be processed.
    #[inline]
    pub fn has_notes(&self) -> bool {
        !self.noted.is_empty()
    }

    /// Processes what was noted; `time_us` converts the time of an entry to the clock that does not wrap.
    pub fn settle(&mut self, time_us: impl Fn(Micros) -> u64) {
        let mut at = 0;
        while let Some(entry) = self.noted.get(at).copied() {
            self.push(entry, time_us(Micros(entry.time_us)));
            at = at.saturating_add(1);
        }
        self.noted.clear();
    }

    /// Takes an entry that happened at `now_us` on the clock that does not wrap.
    #[cold]
    fn push(&mut self, entry: LogEntry, now_us: u64) {
        if now_us >= self.lease_end_us {
            return;
        }
        let now_ms = now_us.wrapping_shr(10);
        let earned = now_ms.saturating_sub(self.filled_ms).min(DEPTH as u64);
        self.filled_ms = now_ms;
        self.tokens = self.tokens.saturating_add(earned as u8).min(DEPTH as u8);
        if self.tokens > 0 && self.waiting.push_back(entry.to_bytes()).is_ok() {
            self.tokens = self.tokens.saturating_sub(1);
        } else {
            self.lost = self.lost.saturating_add(1);
        }
    }

    /// Returns the oldest records and extends the lease; all notes have been processed before.
    #[cold]
    pub fn read(&mut self, lease_ms: u16, now_us: u64) -> LogRecords {
        if now_us >= self.lease_end_us {
            // A lease that has ended takes unfetched records with it.
            *self = Self {
                tokens: DEPTH as u8,
                filled_ms: now_us.wrapping_shr(10),
                ..Self::default()
            };
        }
        self.lease_end_us = now_us.saturating_add(u64::from(lease_ms).saturating_mul(1000));
        let mut entries = [0; 8 * LOG_ENTRIES];
        let (places, _) = entries.as_chunks_mut::<8>();
        for place in places {
            *place = self.waiting.pop_front().unwrap_or_default();
        }
        LogRecords {
            lost: core::mem::take(&mut self.lost),
            left: self.waiting.len() as u8,
            entries,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_protocol::LogEvent;

    fn entry(number: u16, time_us: u64) -> LogEntry {
        LogEntry {
            time_us: time_us as u32,
            event: LogEvent::Parameter,
            a: 0,
            b: number,
        }
    }

    fn push(log: &mut Log, number: u16, now_us: u64) {
        log.push(entry(number, now_us), now_us);
    }

    fn numbers(records: &LogRecords) -> Vec<u16> {
        records.iter().map(|entry| entry.b).collect()
    }

    #[test]
    fn nothing_is_recorded_without_a_lease_or_after_its_end() {
        let mut log = Log::default();
        push(&mut log, 1, 100);
        assert!(numbers(&log.read(20, 1000)).is_empty());
        push(&mut log, 2, 20_999);
        push(&mut log, 3, 21_000);
        assert_eq!(numbers(&log.read(0, 20_999)), [2]);
        push(&mut log, 4, 21_001);
        assert!(numbers(&log.read(20, 22_000)).is_empty());
        // What a dead reader left behind is not reported to the next one.
        push(&mut log, 5, 23_000);
        let late = log.read(20, 90_000);
        assert_eq!((numbers(&late), late.lost), (vec![], 0));
    }

    #[test]
    fn notes_are_recorded_by_their_own_times_whenever_they_are_worked_off() {
        // Processed at once, or all together before the records are read.
        let recorded = |at_once: bool| {
            let mut log = Log::default();
            let mut found = Vec::new();
            let clock = |at: Micros| u64::from(at.get());
            log.read(20, 0);
            // The sixth comes after the end of the lease.
            for (number, time_us) in [(1, 5), (2, 5), (3, 900), (4, 901), (5, 19_999), (6, 20_000)]
            {
                log.note(entry(number, time_us)).expect("room");
                if at_once {
                    log.settle(clock);
                }
            }
            log.settle(clock);
            assert!(!log.has_notes());
            for _ in 0..2 {
                found.extend(numbers(&log.read(20, 19_999)));
            }
            found
        };
        assert_eq!(recorded(true), [1, 2, 3, 4, 5]);
        assert_eq!(recorded(false), recorded(true));
        let mut log = Log::default();
        let full = (0..=NOTES as u16).map(|number| log.note(entry(number, 0)));
        assert_eq!(
            full.filter(Result::is_err).count(),
            1,
            "given back, not lost"
        );
    }

    #[test]
    fn records_come_in_order_and_losses_are_counted() {
        let mut log = Log::default();
        log.read(60_000, 0);
        for number in 0..20 {
            push(&mut log, number, 10);
        }
        let first = log.read(60_000, 11);
        assert_eq!(numbers(&first), [0, 1, 2, 3]);
        assert_eq!((first.lost, first.left), (4, 12));
        assert_eq!(numbers(&log.read(60_000, 12)), [4, 5, 6, 7]);
        // The bucket is empty, although there is room again.
        push(&mut log, 99, 13);
        assert_eq!(log.read(60_000, 14).lost, 1);
        // A millisecond earns at least one record, a pause at most sixteen.
        push(&mut log, 100, 2000);
        let records: Vec<u16> = (0..3)
            .flat_map(|_| numbers(&log.read(60_000, 2001)))
            .collect();
        assert_eq!(records, [12, 13, 14, 15, 100]);
    }
}
