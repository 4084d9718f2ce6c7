//! The parameter store under power cuts, flash errors, rotting and unsteady
//! words: whatever happened, the reader gives one of the sets that were saved,
//! whole, or none, and none only if no page is sound; a set that was saved is
//! not given up before the next one stands (P1, P9).

use arbitrary::{Arbitrary, Unstructured};
use wheeleg_board::store::{PAGES, RECORDS_MAX, Record, SaveError, Store, WORDS};
use wheeleg_node::parameters::JointParameters;
use wheeleg_protocol::param::{JOINT_PARAMS, JointParam};

use crate::chip::{Chip, Mishap, Port, Torn, draw};

/// Most saves of a run.
const SAVES_MAX: u32 = 24;

/// The parameter that tells the sets of a run apart.
const OWN: JointParam = JointParam::SensorZero;

type Set = Vec<Record>;

#[derive(Clone, Copy, Debug, Arbitrary)]
enum Action {
    /// A set of as many records is saved, and all goes well.
    Save(u8),
    /// The same, and it does not.
    Mishap(u8, Mishap),
    /// The power goes at the last word, on which all depends.
    Commit(u8, Torn),
    /// More records than a page holds.
    TooMany,
    /// Up to three bits of a word have flipped.
    Rot(bool, u8, [u8; 3]),
    /// A word can no longer be read, or not always.
    Fade(bool, u8, Option<u8>),
}

/// Possible contents of a page.
#[derive(Debug, Default)]
struct Page {
    /// Sets that may still be read from it.
    possible: Vec<Set>,
    /// The set that it holds without any damage.
    sound: Option<Set>,
    /// Parts of it may read differently each time.
    unsteady: bool,
}

struct Play {
    chip: Chip,
    pages: [Page; PAGES],
    /// The page with the newest set, if that is sound.
    newest: Option<usize>,
    saves: u32,
}

/// The first bytes give the initial flash content; the rest are actions.
pub fn run(data: &[u8]) {
    let mut u = Unstructured::new(data);
    let Ok(content) = u.arbitrary() else {
        return;
    };
    let mut play = Play {
        chip: Chip::new(content),
        pages: Default::default(),
        newest: None,
        saves: 0,
    };
    play.load();
    while play.saves < SAVES_MAX
        && !u.is_empty()
        && let Ok(action) = u.arbitrary::<Action>()
    {
        play.act(action);
        play.load();
    }
}

impl Play {
    fn act(&mut self, action: Action) {
        let place = |second, word: u8| (usize::from(second), usize::from(word % 32));
        match action {
            Action::Save(size) => self.save(size, None),
            Action::Mishap(size, mishap) => self.save(size, Some(mishap)),
            Action::Commit(size, torn) => {
                // Behind the erasure, the header and the records.
                let mishap = Mishap {
                    after: (size % 24).max(1) + 2,
                    torn,
                    cut: true,
                };
                self.save(size % 24, Some(mishap));
            }
            Action::TooMany => {
                let set = vec![Record { id: 1, raw: 2 }; RECORDS_MAX + 1];
                let before = self.chip.operations;
                let saved = Store::new(Port(&mut self.chip)).save(&set);
                assert_eq!(saved, Err(SaveError::TooMany));
                assert_eq!(self.chip.operations, before, "refused, and touched");
            }
            Action::Rot(second, word, bits) => {
                let (page, word) = place(second, word);
                self.chip.rot(page, word, bits);
                self.damaged(page);
            }
            Action::Fade(second, word, unsteady) => {
                let (page, word) = place(second, word);
                self.chip.fade(page, word, unsteady);
                self.damaged(page);
                self.pages[page].unsteady |= unsteady.is_some();
            }
        }
    }

    fn damaged(&mut self, page: usize) {
        self.pages[page].sound = None;
        if self.newest == Some(page) {
            self.newest = None;
        }
    }

    /// A set like no other of this run: every other one of parameters that a board permits, the
    /// rest with records among them that it refuses.
    fn set(&self, size: u8) -> Set {
        let mut state = draw(self.saves);
        let permitted = self.saves.is_multiple_of(2);
        let own = Record {
            id: OWN.id(),
            raw: self.saves as i32,
        };
        // Small ones mostly, and a full page now and then.
        let size = match size {
            0xF8.. => RECORDS_MAX,
            _ => usize::from(size % 24),
        };
        let others = (1..size).map(|index| {
            state = draw(state);
            let row = &JOINT_PARAMS[index % JOINT_PARAMS.len()];
            let span = row.max.abs_diff(row.min).max(1);
            let (id, raw) = match state >> 30 {
                _ if row.id == own.id => (own.id, own.raw),
                0 if !permitted => (state as u16, state as i32),
                1 if !permitted => (row.id, state as i32),
                _ => (row.id, row.min.saturating_add_unsigned(state % span)),
            };
            Record { id, raw }
        });
        core::iter::once(own).chain(others).collect()
    }

    fn save(&mut self, size: u8, mishap: Option<Mishap>) {
        self.saves += 1;
        let set = self.set(size);
        let (erased, written) = (self.chip.erased, self.chip.written);
        let voided = self.chip.voided;
        let unsteady = self.pages.iter().any(|page| page.unsteady);
        self.chip.power(mishap);
        let saved = Store::new(Port(&mut self.chip)).save(&set);
        let mishap = mishap.filter(|_| self.chip.mishap_over());
        let unsteady_now = mishap.is_some_and(|m| matches!(m.torn, Torn::Unsteady(_)));
        let erasures = |chip: &Chip| chip.erased.iter().sum::<u32>();
        let begun = erasures(&self.chip) - erased.iter().sum::<u32>();
        assert!(
            begun <= 1,
            "the processor stands still for {begun} erasures"
        );
        for page in 0..PAGES {
            if self.chip.voided[page] != voided[page] {
                assert!(
                    unsteady || self.newest != Some(page),
                    "the newest set is given up before the next one stands"
                );
                self.damaged(page);
                self.pages[page].unsteady |= unsteady_now;
                if mishap.is_none() {
                    self.pages[page] = Page::default();
                }
            }
            let writes = (self.chip.written[page] - written[page]) as usize;
            if self.chip.erased[page] == erased[page] {
                assert_eq!(writes, 0, "written and not erased");
                continue;
            }
            // A page that reads differently each time may look newer than it is.
            assert!(
                unsteady || self.newest != Some(page),
                "the newest set is erased before the next one stands"
            );
            self.damaged(page);
            // A torn erasure may have left the old content.
            if writes > 0 {
                self.pages[page] = Page::default();
            }
            let whole = writes == set.len() + 2;
            if whole {
                self.pages[page].possible.push(set.clone());
            }
            self.pages[page].unsteady |= unsteady_now;
            if whole && saved.is_ok() {
                self.pages[page].sound = Some(set.clone());
                self.newest = Some(page);
            }
        }
        match saved {
            Ok(_) => assert_eq!(self.loaded().as_ref(), Some(&set), "saved, it says"),
            Err(error) => {
                assert_eq!(error, SaveError::Flash);
                assert!(mishap.is_some() || unsteady, "failed for no reason");
            }
        }
    }

    fn loaded(&mut self) -> Option<Set> {
        const NONE: Record = Record { id: 0, raw: 0 };
        let store = Store::new(Port(&mut self.chip));
        let loaded = store.load((0, [NONE; WORDS]), |(count, set), record| {
            set[*count] = record;
            *count += 1;
        });
        loaded.map(|((count, set), _)| set[..count].to_vec())
    }

    /// Loads a set and checks that the reader may return it.
    fn load(&mut self) {
        self.chip.power(None);
        let loaded = self.loaded();
        match &loaded {
            None => {
                let sound = self.pages.iter().any(|page| page.sound.is_some());
                assert!(!sound, "a sound page is passed over");
            }
            Some(set) => {
                let known = self.pages.iter().any(|page| page.possible.contains(set));
                assert!(known, "never saved: {set:?}");
            }
        }
        if let Some(newest) = self.newest
            && loaded != self.pages[newest].sound
        {
            // The save behind it got as far as its last word.
            let other = &self.pages[1 - newest];
            let newer = loaded
                .as_ref()
                .is_some_and(|set| other.possible.last() == Some(set));
            assert!(newer, "the newest set is not the one that is read");
            if !other.unsteady {
                self.newest = Some(1 - newest);
                self.pages[1 - newest].sound = loaded.clone();
            }
        }
        self.parameters(loaded.as_deref());
    }

    /// The same as the board reads it: the whole set, or defaults of a store that is blank, or
    /// nothing, which is a fault; every value keeps to its limits.
    fn parameters(&mut self, set: Option<&[Record]>) {
        let with = |held: &JointParameters, id, raw| held.with(id, raw, true);
        let defaults = JointParameters::default();
        let blank = (0..PAGES).all(|page| self.chip.read(page, 0) == Some(u64::MAX));
        let held = Store::new(Port(&mut self.chip)).parameters(defaults, with);
        for row in JOINT_PARAMS {
            let raw = held.map_or(row.default, |held| held.by_id(row.id).expect("a row"));
            assert!(row.permits(raw), "{}: {raw}", row.name);
        }
        if !self.pages.iter().any(|page| page.unsteady) {
            let expected = match set {
                Some(set) => set
                    .iter()
                    .try_fold(defaults, |held, record| with(&held, record.id, record.raw))
                    .ok(),
                None => blank.then_some(defaults),
            };
            assert_eq!(held, expected);
        }
    }
}
