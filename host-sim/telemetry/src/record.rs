//! Parses one record of a log, which may come from anybody: a length in it is checked against the data before
//! memory is reserved for it.

use mcap::records::{Record, op};

/// The record; `None`: it is damaged.
pub(crate) fn parse(opcode: u8, data: &[u8]) -> Option<Record<'_>> {
    let sound = match opcode {
        op::SCHEMA => data.get(2..).and_then(|rest| parts(rest, 3)).is_some(),
        op::CHANNEL => data.get(4..).and_then(channel).is_some(),
        op::ATTACHMENT => data.get(16..).and_then(|rest| parts(rest, 2)).is_some(),
        _ => true,
    };
    sound.then(|| mcap::parse_record(opcode, data).ok())?
}

/// Topic, encoding, and a list of texts, all of which are there.
fn channel(rest: &[u8]) -> Option<()> {
    let (mut list, _) = part(parts(rest, 2)?)?;
    while !list.is_empty() {
        list = parts(list, 2)?;
    }
    Some(())
}

/// Skips `count` parts.
fn parts(rest: &[u8], count: usize) -> Option<&[u8]> {
    (0..count).try_fold(rest, |rest, _| Some(part(rest)?.1))
}

/// A part that begins with its length, and the data after it.
fn part(rest: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = rest.split_first_chunk()?;
    rest.split_at_checked(u32::from_le_bytes(*length) as usize)
}

/// Bytes that a log may always swell to, whatever its size.
const FREE: u64 = 64 << 20;
/// Largest growth beyond that, as a multiple of its size. Our logs swell to 10 times their size, zeros to
/// 10,000 times: a small file would be read for hours.
const MOST: u64 = 500;

/// How much a log grows when decompressed.
#[derive(Debug, Default)]
pub(crate) struct Swelling {
    read: u64,
    given: u64,
}

impl Swelling {
    /// Bytes of the file.
    pub(crate) fn read(&mut self, bytes: usize) {
        self.read += bytes as u64;
    }

    /// Counts a record of `bytes` bytes; false: it is too much for a file of that size.
    pub(crate) fn give(&mut self, bytes: usize) -> bool {
        const HEAD: u64 = 9;
        self.given += HEAD + bytes as u64;
        self.given <= FREE + self.read * MOST
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Vec<u8> {
        let length = (text.len() as u32).to_le_bytes();
        [&length[..], text.as_bytes()].concat()
    }

    #[test]
    fn a_length_is_not_believed_before_it_was_compared() {
        let list = [text("a"), text("b")].concat();
        let list = [&(list.len() as u32).to_le_bytes()[..], &list].concat();
        let sound = [vec![7, 0, 0, 0], text("/joint/1"), text("json"), list].concat();
        let read = parse(op::CHANNEL, &sound);
        assert!(matches!(read, Some(Record::Channel(c)) if c.id == 7 && c.metadata.len() == 1));
        // Each length of it, as large as possible; in the list before the whole list as well.
        for at in [4, 16, 24, 28, 33] {
            let mut long = sound.clone();
            long[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
            assert!(parse(op::CHANNEL, &long).is_none(), "{at}");
        }
        for end in 0..sound.len() {
            assert!(parse(op::CHANNEL, &sound[..end]).is_none(), "{end}");
        }
        let schema = [vec![1, 0], text("n"), text("jsonschema"), text("{}")].concat();
        assert!(matches!(
            parse(op::SCHEMA, &schema),
            Some(Record::Schema { .. })
        ));
        assert!(parse(op::SCHEMA, &[&schema[..2], &[0xFF; 4]].concat()).is_none());
        assert!(parse(op::ATTACHMENT, &[&[0; 16][..], &[0xFF; 4]].concat()).is_none());
    }

    #[test]
    fn a_log_swells_so_much_and_no_further() {
        let mut swelling = Swelling::default();
        swelling.read(1_000);
        let records = (0..).take_while(|_| swelling.give(9_991)).count();
        assert_eq!(records as u64, (FREE + 1_000 * MOST) / 10_000);
        swelling.read(1_000_000);
        assert!(swelling.give(9_991));
    }
}
