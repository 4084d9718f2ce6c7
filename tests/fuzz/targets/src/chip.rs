//! Two pages of flash as they misbehave: a power cut tears the operation under
//! way, words rot, and a torn word may read differently each time.

use std::cell::Cell;

use arbitrary::Arbitrary;
use wheeleg_board::store::{Flash, FlashError, PAGES, WORDS};

/// A 64-bit word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Word {
    /// Reads the same each time.
    Steady(u64),
    /// Two wrong bits: the hardware refuses to read it.
    Unreadable,
    /// Reads as one of three values, at random.
    Unsteady(u64, u64),
}

/// What remains of the operation that a power cut or an error hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Arbitrary)]
pub(crate) enum Torn {
    /// It has not begun.
    Nothing,
    /// It was just complete.
    All,
    /// Some of the bits have changed, drawn from this.
    Some(u32),
    /// Nothing that can be read.
    Unreadable,
    /// Some bits are on the edge.
    Unsteady(u32),
}

/// When a power cut or an error comes: the number of operations before it, what remains of the one it hits,
/// and whether the power stays off.
#[derive(Clone, Copy, Debug, Arbitrary)]
pub(crate) struct Mishap {
    pub(crate) after: u8,
    pub(crate) torn: Torn,
    pub(crate) cut: bool,
}

/// The flash.
#[derive(Debug)]
pub(crate) struct Chip {
    pages: [[Word; WORDS]; PAGES],
    mishap: Option<Mishap>,
    dead: bool,
    dice: Cell<u32>,
    /// Operations so far, including refused ones.
    pub(crate) operations: usize,
    /// Erasures of each page that have begun.
    pub(crate) erased: [u32; PAGES],
    /// Writes to each page that have begun.
    pub(crate) written: [u32; PAGES],
    /// First words of each page whose overwriting with zeros has begun.
    pub(crate) voided: [u32; PAGES],
}

/// A separate generator, independent of everything else.
pub(crate) const fn draw(state: u32) -> u32 {
    // Numerical Recipes' constants; the high bits are the good ones.
    let next = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    next ^ next >> 15
}

fn draw64(state: u32) -> u64 {
    u64::from(draw(state)) << 32 | u64::from(draw(state ^ 0x5555_AAAA))
}

impl Chip {
    /// Erased, or with anything in its words.
    pub(crate) fn new(content: Option<u32>) -> Self {
        let mut seed = content.unwrap_or_default();
        let mut word = || match content {
            None => Word::Steady(u64::MAX),
            Some(_) => {
                seed = draw(seed);
                Word::Steady(draw64(seed))
            }
        };
        Self {
            pages: core::array::from_fn(|_| core::array::from_fn(|_| word())),
            mishap: None,
            dead: false,
            dice: Cell::new(1),
            operations: 0,
            erased: [0; PAGES],
            written: [0; PAGES],
            voided: [0; PAGES],
        }
    }

    /// Power is on until the given mishap.
    pub(crate) fn power(&mut self, mishap: Option<Mishap>) {
        self.mishap = mishap;
        self.dead = false;
    }

    /// Whether the given mishap has happened.
    pub(crate) const fn mishap_over(&self) -> bool {
        self.mishap.is_none()
    }

    /// Flips bits of a word, at most three.
    pub(crate) fn rot(&mut self, page: usize, word: usize, bits: [u8; 3]) {
        if let Word::Steady(value) = &mut self.pages[page][word] {
            for bit in bits {
                *value ^= 1 << (bit % 64);
            }
        }
    }

    /// A word that can no longer be read, or not always.
    pub(crate) fn fade(&mut self, page: usize, word: usize, unsteady: Option<u8>) {
        let place = &mut self.pages[page][word];
        *place = match (*place, unsteady) {
            (Word::Steady(value), Some(bit)) => Word::Unsteady(value, value ^ 1 << (bit % 64)),
            _ => Word::Unreadable,
        };
    }

    /// Whether the operation completes; otherwise what remains of it.
    fn begins(&mut self) -> Result<(), Torn> {
        self.operations += 1;
        if self.dead {
            return Err(Torn::Nothing);
        }
        match &mut self.mishap {
            None => Ok(()),
            Some(Mishap {
                after: 0,
                torn,
                cut,
            }) => {
                let (torn, cut) = (*torn, *cut);
                self.mishap = None;
                self.dead = cut;
                Err(torn)
            }
            Some(mishap) => {
                mishap.after -= 1;
                Ok(())
            }
        }
    }

    fn erase(&mut self, page: usize) -> Result<(), FlashError> {
        let done = self.begins();
        if done == Err(Torn::Nothing) {
            return Err(FlashError);
        }
        self.erased[page] += 1;
        let mut state = match done {
            Err(Torn::Some(seed) | Torn::Unsteady(seed)) => seed,
            _ => 0,
        };
        for word in &mut self.pages[page] {
            state = draw(state);
            // Bits go to one in any order.
            let half = |word| match word {
                Word::Steady(value) => value | draw64(state),
                _ => draw64(state),
            };
            *word = match (done, state % 4) {
                (Ok(()) | Err(Torn::All), _) => Word::Steady(u64::MAX),
                (_, 0) => *word,
                (_, 1) => Word::Steady(u64::MAX),
                (Err(Torn::Unreadable), _) => Word::Unreadable,
                (Err(Torn::Unsteady(_)), _) => Word::Unsteady(half(*word), u64::MAX),
                _ => Word::Steady(half(*word)),
            };
        }
        done.map_err(|_| FlashError)
    }

    fn write(&mut self, page: usize, word: usize, value: u64) -> Result<(), FlashError> {
        let place = self.pages[page][word];
        let done = self.begins();
        if done == Err(Torn::Nothing) {
            return Err(FlashError);
        }
        // A word may be written once per erasure, but with zeros (RM0440 §3.3.7).
        if value == 0 && word == 0 {
            self.voided[page] += 1;
        } else if place == Word::Steady(u64::MAX) {
            self.written[page] += 1;
        } else {
            return Err(FlashError);
        }
        // Bits go to zero in any order.
        let left = |seed| match place {
            Word::Steady(old) => value | old & draw64(seed),
            _ => value | draw64(seed),
        };
        self.pages[page][word] = match done {
            Ok(()) | Err(Torn::All) => Word::Steady(value),
            Err(Torn::Nothing) => place,
            Err(Torn::Some(seed)) => Word::Steady(left(seed)),
            Err(Torn::Unreadable) => Word::Unreadable,
            Err(Torn::Unsteady(seed)) => Word::Unsteady(value, left(seed)),
        };
        done.map_err(|_| FlashError)
    }

    pub(crate) fn read(&self, page: usize, word: usize) -> Option<u64> {
        match *self.pages.get(page)?.get(word)? {
            Word::Steady(value) => Some(value),
            Word::Unreadable => None,
            Word::Unsteady(one, other) => {
                let dice = draw(self.dice.get());
                self.dice.set(dice);
                match dice >> 28 {
                    0 => None,
                    1..=8 => Some(one),
                    _ => Some(other),
                }
            }
        }
    }
}

/// The flash as the store sees it.
#[derive(Debug)]
pub(crate) struct Port<'a>(pub(crate) &'a mut Chip);

impl Flash for Port<'_> {
    fn read(&self, page: usize, word: usize) -> Option<u64> {
        self.0.read(page, word)
    }

    fn erase(&mut self, page: usize) -> Result<(), FlashError> {
        self.0.erase(page)
    }

    fn write(&mut self, page: usize, word: usize, value: u64) -> Result<(), FlashError> {
        self.0.write(page, word, value)
    }
}
