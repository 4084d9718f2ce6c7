//! Parameters in two flash pages, of which one is always complete.
//!
//! # Format of a page
//!
//! 64-bit words, little-endian:
//!
//! | word | content |
//! |---|---|
//! | 0 | magic `0x5757`, number of records (16 bit), sequence number (32 bit), from the low end |
//! | 1…n | one record: parameter number (16 bit), zero (16 bit), raw value (32 bit, signed) |
//! | n + 1 | CRC-32C of the words before it, and its complement |
//!
//! A save goes to the page that does not hold the newest set: erase, then the records, and last the word with the CRC.
//! So a power cut at any instant leaves either the old set or the new one; during the first save of a blank store,
//! which has no old set, it leaves one that counts as damaged. A save erases only one page, because erasing stalls the
//! processor for most of the time after which a link counts as lost. Words torn by the cut are unreadable or contain
//! anything; the CRC decides.

#[cfg(test)]
mod tests;

use crate::hardware::{ParameterStore, StoreError};
use heapless::Vec;
use wheeleg_protocol::frame::Checksum;
use wheeleg_protocol::param::{JointParam, WheelParam};

/// Pages of the store.
pub const PAGES: usize = 2;
/// 64-bit words of a page.
pub const WORDS: usize = 256;
/// Number of records that fit a page.
pub const RECORDS_MAX: usize = WORDS - 2;

/// Records of the largest set that a board saves: all its parameters.
const SET_MAX: usize = if JointParam::COUNT > WheelParam::COUNT {
    JointParam::COUNT
} else {
    WheelParam::COUNT
};
const _: () = assert!(SET_MAX <= RECORDS_MAX);

const MAGIC: u16 = 0x5757;

/// The flash did not carry out an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashError;

/// Two pages of flash with 64-bit words that can be written once per erasure.
pub trait Flash {
    /// A word; `None` if it cannot be read (torn by a power cut) or does not exist.
    fn read(&self, page: usize, word: usize) -> Option<u64>;

    /// Erases a page: all words read as all ones.
    ///
    /// # Errors
    /// [`FlashError`] if the hardware reports one.
    fn erase(&mut self, page: usize) -> Result<(), FlashError>;

    /// Writes an erased word, or zero over any word, which needs no erasure (RM0440 §3.3.7).
    ///
    /// # Errors
    /// [`FlashError`] if the hardware reports one.
    fn write(&mut self, page: usize, word: usize, value: u64) -> Result<(), FlashError>;
}

/// One stored parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Number of the parameter.
    pub id: u16,
    /// Its raw value.
    pub raw: i32,
}

impl Record {
    const fn to_word(self) -> u64 {
        self.id as u64 | (self.raw as u32 as u64) << 32
    }

    const fn from_word(word: u64) -> Option<Self> {
        if word >> 16 & 0xFFFF != 0 {
            return None;
        }
        Some(Self {
            id: word as u16,
            raw: (word >> 32) as i32,
        })
    }
}

/// Why a set was not saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveError {
    /// More than [`RECORDS_MAX`] records.
    TooMany,
    /// The flash failed; the old set is still there.
    Flash,
}

impl From<FlashError> for SaveError {
    fn from(_: FlashError) -> Self {
        Self::Flash
    }
}

/// A complete set in one of the pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Whole {
    page: usize,
    sequence: u32,
}

/// The parameter store.
#[derive(Debug)]
pub struct Store<F> {
    flash: F,
}

impl<F: Flash> ParameterStore for Store<F> {
    #[inline(never)]
    fn save(&mut self, records: impl Iterator<Item = (u16, i32)>) -> Result<(), StoreError> {
        let mut set: Vec<Record, SET_MAX> = Vec::new();
        for (id, raw) in records {
            set.push(Record { id, raw }).map_err(|_| StoreError)?;
        }
        Self::save(self, &set).map(|_| ()).map_err(|_| StoreError)
    }
}

impl<F: Flash> Store<F> {
    /// A store in these pages, whatever their content.
    pub const fn new(flash: F) -> Self {
        Self { flash }
    }

    /// Applies every record of the newest complete set to `defaults`, in the order in which they were saved. Returns
    /// the result and the set's sequence number, or `None` if there is no complete set.
    ///
    /// A word torn by a power cut may read differently each time. So the records count only if the checksum matches
    /// what `put` was actually given; otherwise the other page is tried. The result is never part of a set.
    pub fn load<T: Copy>(
        &self,
        defaults: T,
        mut put: impl FnMut(&mut T, Record),
    ) -> Option<(T, u32)> {
        let newest = self.newest()?.page;
        let other = 1_usize.saturating_sub(newest);
        [newest, other].into_iter().find_map(|page| {
            let mut set = defaults;
            let whole = self.read(page, |record| put(&mut set, record))?;
            Some((set, whole.sequence))
        })
    }

    /// The parameters of a board: the newest complete set applied to `defaults`, or the defaults for a blank store.
    /// `None` if the content is damaged, or if `with` refuses a record.
    ///
    /// A newest set that was damaged later cannot be distinguished from one whose save was ended by a power cut: the
    /// older set is used.
    pub fn parameters<T: Copy, R>(
        &self,
        defaults: T,
        with: impl Fn(&T, u16, i32) -> Result<T, R>,
    ) -> Option<T> {
        let put = |set: &mut Option<T>, record: Record| {
            *set = set.and_then(|set| with(&set, record.id, record.raw).ok());
        };
        match self.load(Some(defaults), put) {
            Some((set, _)) => set,
            None => self.is_blank().then_some(defaults),
        }
    }

    /// Whether no save was ever started.
    fn is_blank(&self) -> bool {
        (0..PAGES).all(|page| self.flash.read(page, 0) == Some(u64::MAX))
    }

    /// Saves a set. Erasing takes about 22 ms on the board's part, during which the processor stands still.
    ///
    /// # Errors
    /// [`SaveError::TooMany`] before anything is erased, [`SaveError::Flash`] with the old set still in place.
    pub fn save(&mut self, records: &[Record]) -> Result<u32, SaveError> {
        if records.len() > RECORDS_MAX {
            return Err(SaveError::TooMany);
        }
        let newest = self.newest();
        let page = newest.map_or(0, |copy| 1_usize.saturating_sub(copy.page));
        let sequence = newest.map_or(0, |copy| copy.sequence.wrapping_add(1));
        if newest.is_none() {
            // A page that can hardly be read may look complete some day, with any number; without its first word it
            // never does.
            self.flash.write(1, 0, 0)?;
        }
        self.flash.erase(page)?;
        let mut digest = Checksum::default();
        let header = u64::from(MAGIC) | (records.len() as u64) << 16 | u64::from(sequence) << 32;
        self.put(&mut digest, page, 0, header)?;
        for (index, record) in (1..).zip(records) {
            self.put(&mut digest, page, index, record.to_word())?;
        }
        let crc = digest.finalize();
        let commit = u64::from(crc) | u64::from(!crc) << 32;
        self.flash
            .write(page, records.len().saturating_add(1), commit)?;
        // What the hardware reports is trusted only if it can be read back.
        match self.whole(page) {
            Some(copy) if copy.sequence == sequence => Ok(sequence),
            _ => Err(SaveError::Flash),
        }
    }

    /// Writes a word that the checksum covers.
    #[inline(never)]
    fn put(
        &mut self,
        digest: &mut Checksum,
        page: usize,
        index: usize,
        word: u64,
    ) -> Result<(), FlashError> {
        digest.update(&word.to_le_bytes());
        self.flash.write(page, index, word)
    }

    fn newest(&self) -> Option<Whole> {
        match (self.whole(0), self.whole(1)) {
            (Some(first), Some(second)) => {
                // Consecutive numbers, compared modulo 2^32.
                let ahead = second.sequence.wrapping_sub(first.sequence) as i32;
                Some(if ahead > 0 { second } else { first })
            }
            (first, second) => first.or(second),
        }
    }

    /// The set in a page, if it is complete.
    fn whole(&self, page: usize) -> Option<Whole> {
        self.read(page, |_| {})
    }

    /// Passes the records of a page to `take`; returns the set if it was complete. There is a copy for each caller,
    /// because with a call through a pointer the stack has no bound.
    fn read(&self, page: usize, mut take: impl FnMut(Record)) -> Option<Whole> {
        let header = self.flash.read(page, 0)?;
        let count = usize::from((header >> 16) as u16);
        if header as u16 != MAGIC || count > RECORDS_MAX {
            return None;
        }
        let mut digest = Checksum::default();
        digest.update(&header.to_le_bytes());
        for index in 1..=count {
            let word = self.flash.read(page, index)?;
            digest.update(&word.to_le_bytes());
            take(Record::from_word(word)?);
        }
        let crc = digest.finalize();
        let commit = self.flash.read(page, count.saturating_add(1))?;
        let agrees = commit as u32 == crc && (commit >> 32) as u32 == !crc;
        agrees.then_some(Whole {
            page,
            sequence: (header >> 32) as u32,
        })
    }
}
