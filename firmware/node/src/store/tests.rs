//! The store under power cuts at every word.

use super::*;
use core::cell::Cell;
use proptest::prelude::*;
use std::vec::Vec;

/// How far the operation hit by the power cut gets.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Torn {
    /// It has not begun.
    Nothing,
    /// A word reads as some of the new bits; half of a page is erased.
    Half,
    /// A word has a double error; half of a page does.
    Unreadable,
    /// It was just completed.
    All,
}

const TORN: [Torn; 4] = [Torn::Nothing, Torn::Half, Torn::Unreadable, Torn::All];

#[derive(Clone, Debug)]
struct Mock {
    pages: [Vec<Option<u64>>; PAGES],
    /// Operations until the power is cut, and what happens to the last one.
    cut: Option<(usize, Torn)>,
    erasures: usize,
    /// A word, the number of readings for which it lasts, and what it reads as afterwards.
    fades: Option<(usize, usize, Cell<u32>, Option<u64>)>,
}

impl Mock {
    fn new() -> Self {
        Self {
            pages: core::array::from_fn(|_| vec![Some(u64::MAX); WORDS]),
            cut: None,
            erasures: 0,
            fades: None,
        }
    }

    /// Whether the operation is done; `Err` with what the cut leaves of it.
    fn power(&mut self) -> Result<(), Torn> {
        match &mut self.cut {
            None => Ok(()),
            Some((0, torn)) => {
                let torn = *torn;
                // After the cut nothing has any effect.
                self.cut = Some((0, Torn::Nothing));
                Err(torn)
            }
            Some((left, _)) => {
                *left -= 1;
                Ok(())
            }
        }
    }
}

impl Flash for Mock {
    fn read(&self, page: usize, word: usize) -> Option<u64> {
        if let Some((fading_page, fading_word, left, then)) = &self.fades
            && (*fading_page, *fading_word) == (page, word)
        {
            match left.get() {
                0 => return *then,
                readings => left.set(readings - 1),
            }
        }
        *self.pages.get(page)?.get(word)?
    }

    fn erase(&mut self, page: usize) -> Result<(), FlashError> {
        let (reach, value) = match self.power() {
            Ok(()) | Err(Torn::All) => (WORDS, Some(u64::MAX)),
            Err(Torn::Nothing) => (0, None),
            Err(Torn::Half) => (WORDS / 2, Some(u64::MAX)),
            Err(Torn::Unreadable) => (WORDS / 2, None),
        };
        self.erasures += 1;
        self.pages[page][..reach].fill(value);
        Ok(())
    }

    fn write(&mut self, page: usize, word: usize, value: u64) -> Result<(), FlashError> {
        let power = self.power();
        let cell = &mut self.pages[page][word];
        let done = matches!(power, Ok(()) | Err(Torn::All));
        if done && value != 0 && *cell != Some(u64::MAX) {
            // A word may be written once per erasure, except with zeros (RM0440 §3.3.7).
            return Err(FlashError);
        }
        *cell = match power {
            Ok(()) | Err(Torn::All) => Some(value),
            Err(Torn::Nothing) => *cell,
            Err(Torn::Half) => Some(value | 0xAAAA_AAAA_AAAA_AAAA),
            Err(Torn::Unreadable) => None,
        };
        Ok(())
    }
}

fn set(seed: i32, count: usize) -> Vec<Record> {
    (0..count)
        .map(|n| Record {
            id: 0x0100 + n as u16,
            raw: seed.wrapping_mul(7919).wrapping_add(n as i32) ^ i32::MIN,
        })
        .collect()
}

fn loaded(flash: &Mock) -> (Option<u32>, Vec<Record>) {
    const NONE: Record = Record { id: 0, raw: 0 };
    let loaded = Store::new(flash.clone()).load((0, [NONE; WORDS]), |(count, set), record| {
        set[*count] = record;
        *count += 1;
    });
    match loaded {
        Some(((count, set), sequence)) => (Some(sequence), set[..count].to_vec()),
        None => (None, Vec::new()),
    }
}

/// A flash that has seen `saves` saves, and the newest set.
fn after(saves: i32) -> (Mock, Vec<Record>) {
    let mut store = Store::new(Mock::new());
    for seed in 0..saves {
        assert_eq!(store.save(&set(seed, 30)), Ok(seed as u32));
    }
    (store.flash, set(saves - 1, 30))
}

#[test]
fn an_erased_flash_holds_nothing() {
    assert_eq!(loaded(&Mock::new()), (None, Vec::new()));
}

#[test]
fn the_newest_set_is_loaded_and_pages_take_turns() {
    for saves in 1..=5 {
        let (flash, newest) = after(saves);
        assert_eq!(loaded(&flash), (Some(saves as u32 - 1), newest));
        assert_eq!(flash.erasures, saves as usize);
    }
    let (flash, _) = after(2);
    assert!(flash.pages.iter().all(|page| page[0] != Some(u64::MAX)));
}

#[test]
fn sequence_numbers_wrap() {
    let mut store = Store::new(Mock::new());
    store.save(&set(1, 3)).unwrap();
    // The first save had number 0; give it the last possible number.
    let page = &mut store.flash.pages[0];
    let header = page[0].unwrap() & 0xFFFF_FFFF | 0xFFFF_FFFF << 32;
    page[0] = Some(header);
    let mut digest = Checksum::default();
    for word in &page[..4] {
        digest.update(&word.unwrap().to_le_bytes());
    }
    let crc = digest.finalize();
    page[4] = Some(u64::from(crc) | u64::from(!crc) << 32);
    assert_eq!(loaded(&store.flash).0, Some(u32::MAX));
    assert_eq!(store.save(&set(2, 3)), Ok(0));
    assert_eq!(loaded(&store.flash), (Some(0), set(2, 3)));
}

#[test]
fn a_power_cut_at_any_word_leaves_the_old_set_or_the_new_one() {
    let new = set(99, 30);
    for saves in [0, 1, 2, 3] {
        // First word of the other page if there is no set, then erasure, header, 30 records, commit word.
        let operations = 33 + usize::from(saves == 0);
        let (before, old) = after(saves);
        let old = if saves > 0 { old } else { Default::default() };
        let (mut kept, mut replaced) = (0, 0);
        for at in 0..operations {
            for torn in TORN {
                let mut store = Store::new(before.clone());
                store.flash.cut = Some((at, torn));
                let result = store.save(&new);
                let flash = Mock {
                    cut: None,
                    ..store.flash
                };
                let (_, found) = loaded(&flash);
                let complete = at == operations - 1 && torn == Torn::All;
                assert_eq!(result.is_ok(), complete, "{saves} {at} {torn:?}");
                let expected = if complete { &new } else { &old };
                assert_eq!(&found, expected, "{saves} {at} {torn:?}");
                if complete {
                    replaced += 1;
                } else {
                    kept += 1;
                }
                // The board starts again and saves as if nothing had happened.
                let mut store = Store::new(flash);
                store.save(&new).unwrap();
                assert_eq!(loaded(&store.flash).1, new);
            }
        }
        assert_eq!((kept, replaced), (operations * 4 - 1, 1));
    }
}

#[test]
fn a_full_page_is_used_and_more_is_refused_untouched() {
    let (flash, old) = after(1);
    let mut store = Store::new(flash);
    assert_eq!(
        store.save(&set(5, RECORDS_MAX + 1)),
        Err(SaveError::TooMany)
    );
    assert_eq!((loaded(&store.flash).1, store.flash.erasures), (old, 1));
    store.save(&set(5, RECORDS_MAX)).unwrap();
    assert_eq!(loaded(&store.flash).1, set(5, RECORDS_MAX));
    store.save(&[]).unwrap();
    assert_eq!(loaded(&store.flash), (Some(2), Vec::new()));
}

#[test]
fn one_flipped_bit_anywhere_makes_the_copy_worthless() {
    let (flash, old) = after(2);
    // Page 1 holds the newest set; without it, the first one is used.
    let first = set(0, 30);
    assert_ne!(old, first);
    for word in 0..32 {
        for bit in 0..64 {
            let mut flash = flash.clone();
            flash.pages[1][word] = flash.pages[1][word].map(|w| w ^ 1 << bit);
            assert_eq!(loaded(&flash), (Some(0), first.clone()), "{word} {bit}");
        }
    }
}

/// Found by the fuzz target `store`: the new set got number 0, and the page that could not be read when it was saved
/// was newer again once it could be read.
#[test]
fn a_set_that_comes_back_from_the_dead_does_not_win_over_what_was_saved_since() {
    let (mut flash, _) = after(4);
    flash.pages[0] = vec![None; WORDS];
    flash.fades = Some((1, 5, Cell::new(0), None));
    let mut store = Store::new(flash);
    store.save(&set(99, 4)).unwrap();
    store.flash.fades = None;
    assert_eq!(loaded(&store.flash), (Some(0), set(99, 4)));
}

/// Once, the records before the word that had become unreadable were handed over and stayed, with defaults for the
/// rest.
#[test]
fn a_word_that_fades_while_it_is_read_leaves_no_part_of_a_set() {
    for saves in [1, 2] {
        let (flash, newest) = after(saves);
        let page = saves as usize - 1;
        let older = if saves == 2 { set(0, 30) } else { Vec::new() };
        for word in 0..32 {
            // Number of readings of this word until it cannot be read, or reads wrong.
            for readings in 0..3 {
                for then in [None, Some(0)] {
                    let mut flash = flash.clone();
                    flash.fades = Some((page, word, Cell::new(readings), then));
                    let (_, found) = loaded(&flash);
                    let sound = readings > 1;
                    let expected = if sound { &newest } else { &older };
                    assert_eq!(&found, expected, "{saves} {word} {readings} {then:?}");
                }
            }
        }
    }
}

proptest! {
    #[test]
    fn pages_full_of_anything_are_no_set(words in proptest::collection::vec(any::<u64>(), 2 * WORDS)) {
        let mut flash = Mock::new();
        for (page, chunk) in flash.pages.iter_mut().zip(words.chunks(WORDS)) {
            *page = chunk.iter().copied().map(Some).collect();
        }
        prop_assert_eq!(loaded(&flash), (None, Vec::new()));
    }
}

/// The processor stands still for each erasure: two of them take as long as the link may be silent.
#[test]
fn a_save_erases_one_page_whatever_the_store_holds() {
    let (whole, _) = after(2);
    let mut damaged = after(4).0;
    for page in &mut damaged.pages {
        page[5] = None;
    }
    let mut foreign = Mock::new();
    for page in &mut foreign.pages {
        page.fill(Some(0x0123_4567_89AB_CDEF));
    }
    for before in [Mock::new(), whole, damaged, foreign] {
        let mut store = Store::new(before);
        let erasures = store.flash.erasures;
        store.save(&set(99, 4)).unwrap();
        assert_eq!(store.flash.erasures, erasures + 1);
        assert_eq!(loaded(&store.flash).1, set(99, 4));
    }
}

#[test]
fn a_page_has_room_for_254_records_and_a_board_saves_every_parameter_that_it_has() {
    let full = set(3, 254);
    let mut store = Store::new(Mock::new());
    assert_eq!(store.save(&full), Ok(0));
    assert_eq!(loaded(&store.flash), (Some(0), full));
    assert_eq!(store.save(&set(4, 255)), Err(SaveError::TooMany));

    let ids = |ids: Vec<u16>| ids.into_iter().map(|id| (id, i32::from(id) - 300));
    let joint: Vec<u16> = JointParam::ALL.iter().map(|param| param.id()).collect();
    let wheel: Vec<u16> = WheelParam::ALL.iter().map(|param| param.id()).collect();
    for all in [joint, wheel] {
        let mut store = Store::new(Mock::new());
        ParameterStore::save(&mut store, ids(all.clone())).unwrap();
        let records: Vec<Record> = ids(all).map(|(id, raw)| Record { id, raw }).collect();
        assert_eq!(loaded(&store.flash), (Some(0), records));
    }
}

/// What a board makes of its memory: it accepts records with numbers below 0x0105; returns their count and their sum.
fn board(flash: &Mock) -> Option<(i32, i32)> {
    let with = |(count, sum): &(i32, i32), id: u16, raw: i32| {
        let known = id < 0x0105;
        known.then_some((count + 1, sum + raw)).ok_or(())
    };
    Store::new(flash.clone()).parameters((0, 0), with)
}

#[test]
fn a_board_tells_a_blank_memory_from_a_damaged_one() {
    let records: Vec<Record> = (0..4)
        .map(|n| Record {
            id: 0x0101 + n,
            raw: 7,
        })
        .collect();
    assert_eq!(board(&Mock::new()), Some((0, 0)), "blank: the defaults");
    let mut store = Store::new(Mock::new());
    store.save(&records).unwrap();
    assert_eq!(board(&store.flash), Some((4, 28)));
    // Every flipped bit and every torn word of the only set.
    for word in 0..=5 {
        let mut torn = store.flash.clone();
        torn.pages[0][word] = None;
        assert_eq!(board(&torn), None, "{word}");
        for bit in 0..64 {
            let mut damaged = store.flash.clone();
            damaged.pages[0][word] = damaged.pages[0][word].map(|value| value ^ (1 << bit));
            assert_eq!(board(&damaged), None, "{word} {bit}");
        }
    }
    // With an older complete set, that one is used.
    let older = store.flash.clone();
    store.save(&[records[0]]).unwrap();
    assert_eq!(board(&store.flash), Some((1, 7)));
    store.flash.pages[1][1] = None;
    assert_eq!(board(&store.flash), board(&older));
    // A set with a record that the board refuses is not a set of this board.
    store.save(&[Record { id: 0x0109, raw: 1 }]).unwrap();
    assert_eq!(board(&store.flash), None);
}

/// A page with these words and a matching checksum.
fn page(words: &[u64]) -> Mock {
    let mut flash = Mock::new();
    let mut digest = Checksum::default();
    for (index, word) in words.iter().enumerate() {
        digest.update(&word.to_le_bytes());
        flash.pages[0][index] = Some(*word);
    }
    let crc = digest.finalize();
    flash.pages[0][words.len()] = Some(u64::from(crc) | u64::from(!crc) << 32);
    flash
}

#[test]
fn a_page_that_is_not_of_this_format_is_none_whatever_its_checksum_says() {
    let header = u64::from(MAGIC) | 1 << 16 | 7 << 32;
    let record = 0x0102 | 5 << 32;
    let sound = loaded(&page(&[header, record]));
    assert_eq!(sound, (Some(7), vec![Record { id: 0x0102, raw: 5 }]));
    // Another magic number, and each of the bits between number and value.
    assert_eq!(loaded(&page(&[header ^ 0x100, record])).0, None);
    for bit in 16..32 {
        let found = loaded(&page(&[header, record | 1 << bit]));
        assert_eq!(found, (None, Vec::new()), "{bit}");
    }
}
