//! Commissioned parameters on their way into a board without flash memory.
//!
//! The simulator sends the parameter store as it is in the flash of a real board (`firmware/node/src/store`):
//! 64-bit words, little-endian. Word 0 holds a magic number (16 bits), the number of records (16 bits) and a
//! sequence number; then follow the records: parameter number (16 bits), zero (16 bits), raw value (32 bits).
//! Checksum and second page are passed over: the link has a checksum of its own.

/// Low 16 bits of word 0.
const MAGIC: u16 = 0x5757;
/// Bytes of a word.
const WORD: u32 = 8;

/// Reads the stretches of a store in the order of their offsets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StoreReader {
    records: u32,
}

/// Why a stretch was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadStore {
    /// It begins or ends inside a word.
    Alignment,
    /// Word 0 is no head of a store, and not blank either.
    Head,
}

impl BadStore {
    /// In words.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Alignment => "a stretch of the parameter store ends inside a word",
            Self::Head => "the parameter store does not begin like one",
        }
    }
}

impl StoreReader {
    /// The records in a stretch as (number, raw value).
    ///
    /// # Errors
    /// [`BadStore`].
    pub fn records<'a>(
        &mut self,
        offset: u32,
        bytes: &'a [u8],
    ) -> Result<impl Iterator<Item = (u16, i32)> + use<'a>, BadStore> {
        let (words, rest) = bytes.as_chunks::<8>();
        if !rest.is_empty() || !offset.is_multiple_of(WORD) {
            return Err(BadStore::Alignment);
        }
        let first = offset.wrapping_div(WORD);
        if first == 0
            && let Some([m0, m1, n0, n1, ..]) = words.first()
        {
            let blank = words.first() == Some(&[0xFF; 8]);
            if !blank && u16::from_le_bytes([*m0, *m1]) != MAGIC {
                return Err(BadStore::Head);
            }
            self.records = if blank {
                0
            } else {
                u32::from(u16::from_le_bytes([*n0, *n1]))
            };
        }
        let last = self.records;
        let numbered = (first..).zip(words);
        Ok(numbered
            .filter(move |(index, _)| (1..=last).contains(index))
            .map(|(_, [a, b, _, _, c, d, e, f])| {
                (
                    u16::from_le_bytes([*a, *b]),
                    i32::from_le_bytes([*c, *d, *e, *f]),
                )
            }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(records: &[(u16, i32)]) -> Vec<u8> {
        let mut bytes = vec![0x57, 0x57, records.len() as u8, 0, 1, 0, 0, 0];
        for (id, raw) in records {
            bytes.extend_from_slice(&id.to_le_bytes());
            bytes.extend_from_slice(&[0, 0]);
            bytes.extend_from_slice(&raw.to_le_bytes());
        }
        bytes.extend_from_slice(&[0xA5; 8]); // checksum
        bytes.resize(bytes.len() + 64, 0xFF);
        bytes
    }

    #[test]
    fn records_are_found_in_any_division_into_stretches_and_nothing_else_is() {
        let records = [(0x0102, -3), (0xFFFE, i32::MAX), (7, i32::MIN)];
        let page = page(&records);
        for stretch in [8, 16, 24, 128] {
            let mut reader = StoreReader::default();
            let mut found = Vec::new();
            for (i, part) in page.chunks(stretch).enumerate() {
                let offset = (i * stretch) as u32;
                found.extend(reader.records(offset, part).expect("sound"));
            }
            assert_eq!(found, records, "stretches of {stretch}");
        }
    }

    #[test]
    fn blank_is_empty_and_rubbish_is_refused() {
        let mut reader = StoreReader::default();
        assert_eq!(reader.records(0, &[0xFF; 64]).expect("blank").count(), 0);
        let refused = reader.records(0, &[0x11; 16]).err();
        assert_eq!(refused, Some(BadStore::Head));
        let refused = reader.records(0, &[0xFF; 12]).err();
        assert_eq!(refused, Some(BadStore::Alignment));
        assert!(reader.records(4, &[0xFF; 8]).is_err());
    }
}
