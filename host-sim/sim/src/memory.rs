//! The parameter memory of a board: two pages of flash that keep their contents without power, take time to
//! write, and stop when the power does.

use std::convert::Infallible;

use wheeleg_node::hardware::ParameterStore;
use wheeleg_node::store::{Flash, FlashError, PAGES, RECORDS_MAX, Store, WORDS};

/// Erasure of a page, typical, ns (DATASHEET DS12589: 22.02 ms).
const ERASE_NS: u64 = 22_020_000;
/// Programming of a double word, typical, ns (DATASHEET DS12589: 81.69 µs).
const PROGRAM_NS: u64 = 81_690;
/// An erased word.
const BLANK: Option<u64> = Some(u64::MAX);

/// Two pages; a word torn by a power cut cannot be read.
#[derive(Debug, Clone)]
struct Pages {
    words: [[Option<u64>; WORDS]; PAGES],
    /// Time that the operations so far have taken, ns.
    took_ns: u64,
    /// When the power fails, on the same clock.
    fails_ns: u64,
}

impl Pages {
    /// An operation of `ns`; false if the power fails in it.
    fn completes(&mut self, ns: u64) -> bool {
        self.took_ns = self.took_ns.saturating_add(ns);
        self.took_ns <= self.fails_ns
    }
}

impl Flash for &mut Pages {
    fn read(&self, page: usize, word: usize) -> Option<u64> {
        *self.words.get(page)?.get(word)?
    }

    fn erase(&mut self, page: usize) -> Result<(), FlashError> {
        if self.took_ns > self.fails_ns {
            return Err(FlashError);
        }
        let whole = self.completes(ERASE_NS);
        let words = &mut self.words[page];
        let end = if whole { WORDS } else { WORDS / 2 };
        words[..end].fill(BLANK);
        whole.then_some(()).ok_or(FlashError)
    }

    fn write(&mut self, page: usize, word: usize, value: u64) -> Result<(), FlashError> {
        // Zeros can be written over anything (RM0440 §3.3.7).
        let writable = value == 0 || self.words[page][word] == BLANK;
        if self.took_ns > self.fails_ns || !writable {
            return Err(FlashError);
        }
        let whole = self.completes(PROGRAM_NS);
        self.words[page][word] = whole.then_some(value);
        whole.then_some(()).ok_or(FlashError)
    }
}

/// A save under way.
#[derive(Debug, Clone)]
struct Save {
    begin_ns: u64,
    records: Vec<(u16, i32)>,
    before: Pages,
}

/// The memory of one board.
#[derive(Debug, Clone)]
pub(super) struct Memory {
    pages: Pages,
    save: Option<Save>,
}

impl Memory {
    /// As commissioning left it; blank without records.
    pub(super) fn new(records: &[(u16, i32)]) -> Self {
        let pages = Pages {
            words: [[BLANK; WORDS]; PAGES],
            took_ns: 0,
            fails_ns: u64::MAX,
        };
        let mut memory = Self { pages, save: None };
        if !records.is_empty() {
            memory.write(records, u64::MAX);
        }
        memory
    }

    /// The newest complete set, in the order in which it was stored, or that of a blank memory; `None` if the
    /// contents are damaged.
    pub(super) fn records(&self) -> Option<Vec<(u16, i32)>> {
        let mut pages = self.pages.clone();
        let store = Store::new(&mut pages);
        let begin = ([None; RECORDS_MAX], 0_usize);
        let set = store.parameters(begin, |(records, count), id, raw| {
            let mut records = *records;
            records[*count] = Some((id, raw));
            Ok::<_, Infallible>((records, count + 1))
        });
        set.map(|(records, _)| records.into_iter().flatten().collect())
    }

    /// Writes a set; the power fails after `left_ns`. Returns the time it took, ns.
    fn write(&mut self, records: &[(u16, i32)], left_ns: u64) -> u64 {
        self.pages.took_ns = 0;
        self.pages.fails_ns = left_ns;
        // The pages show whether it succeeded.
        let _ = ParameterStore::save(&mut Store::new(&mut self.pages), records.iter().copied());
        self.pages.took_ns
    }

    /// Begins a save; the processor stands still until the returned time, ns.
    pub(super) fn begin(&mut self, records: Vec<(u16, i32)>, begin_ns: u64) -> u64 {
        let before = self.pages.clone();
        let took_ns = self.write(&records, u64::MAX);
        self.save = Some(Save {
            begin_ns,
            records,
            before,
        });
        begin_ns.saturating_add(took_ns)
    }

    /// The power fails at `now_ns`: a save under way gets no further.
    pub(super) fn power_fails(&mut self, now_ns: u64) {
        if let Some(save) = self.save.take() {
            self.pages = save.before;
            self.write(&save.records, now_ns.saturating_sub(save.begin_ns));
        }
    }

    /// The save is over.
    pub(super) fn end(&mut self) {
        self.save = None;
    }
}

/// Takes the parameters that a board stores, before the time for it has passed.
#[derive(Debug, Default)]
pub(super) struct Taken(pub(super) Option<Vec<(u16, i32)>>);

impl ParameterStore for Taken {
    fn save(
        &mut self,
        records: impl Iterator<Item = (u16, i32)>,
    ) -> Result<(), wheeleg_node::hardware::StoreError> {
        self.0 = Some(records.collect());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(first: i32) -> Vec<(u16, i32)> {
        (1..=20).map(|id| (id, first + i32::from(id))).collect()
    }

    #[test]
    fn a_set_is_kept_and_a_blank_memory_has_none() {
        assert_eq!(Memory::new(&[]).records(), Some(Vec::new()));
        assert_eq!(Memory::new(&set(7)).records(), Some(set(7)));
        let mut memory = Memory::new(&set(7));
        let end_ns = memory.begin(set(100), 5_000);
        memory.end();
        // One page, the head, the records, the checksum.
        assert_eq!(end_ns, 5_000 + ERASE_NS + 22 * PROGRAM_NS);
        memory.power_fails(end_ns + 1);
        assert_eq!(memory.records(), Some(set(100)));
    }

    /// A cut in every unit and between all of them: the old set or the new one.
    #[test]
    fn a_power_cut_at_any_instant_leaves_the_old_set_or_the_new_one() {
        let mut ends = vec![0, ERASE_NS / 2];
        ends.extend((0..=22).flat_map(|n| {
            let end = ERASE_NS + n * PROGRAM_NS;
            [end - 1, end, end + PROGRAM_NS / 2]
        }));
        let mut news = 0;
        for cut_ns in ends {
            let mut memory = Memory::new(&set(7));
            memory.begin(set(100), 0);
            memory.power_fails(cut_ns);
            let found = memory.records().expect("a whole set");
            let new = found == set(100);
            assert!(new || found == set(7), "after {cut_ns} ns: {found:?}");
            assert_eq!(new, cut_ns >= ERASE_NS + 22 * PROGRAM_NS, "{cut_ns}");
            news += u32::from(new);
            // The remains of the cut save do not spoil the next one.
            memory.begin(set(300), 0);
            memory.end();
            assert_eq!(memory.records(), Some(set(300)), "after {cut_ns} ns");
        }
        assert!(news > 0);
    }

    /// Without an old set there is nothing to go back to: a cut save leaves a damaged memory, from its first
    /// word on, which voids the other page.
    #[test]
    fn a_power_cut_in_the_first_save_leaves_a_damaged_memory_or_the_set() {
        let mut left = [0; 3];
        for n in 0..=24 {
            let cut_ns = ERASE_NS + n * PROGRAM_NS - PROGRAM_NS / 2;
            let mut memory = Memory::new(&[]);
            memory.begin(set(100), 0);
            memory.power_fails(cut_ns);
            match memory.records() {
                Some(records) if records.is_empty() => left[0] += 1,
                None => left[1] += 1,
                records => {
                    assert_eq!(records, Some(set(100)));
                    left[2] += 1;
                }
            }
        }
        // Before the save, while the page is erased and the 23 words are written, after them.
        assert_eq!(left, [0, 24, 1]);
    }
}
