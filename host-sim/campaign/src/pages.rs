//! Pages of a Parquet file that claim more than a page of so many bytes can hold are found before
//! anything is unpacked: the library makes room for what they claim.
//!
//! A page begins with its header, a struct of Thrift's compact protocol.

use parquet::errors::ParquetError;
use parquet::file::metadata::ParquetMetaData;
use parquet::file::reader::ChunkReader;

/// Rows of a row group in a table of many parts; a part has no more.
pub(crate) const GROUP_ROWS: usize = 65_536;
/// Snappy packs 64 bytes in 3 at best.
const MOST_PACKED: u64 = 22;
/// Longest header, bytes: it has the least and the greatest value of its page.
const HEADER_MOST: u64 = 1 << 16;
/// Deepest struct in a header.
const DEEPEST: u8 = 8;

fn damaged(what: &str) -> ParquetError {
    ParquetError::General(format!("it is damaged: {what}"))
}

/// Whether all pages of a file are of a size that their bytes can have.
///
/// # Errors
/// What is claimed and cannot be.
pub(crate) fn check<R: ChunkReader>(
    from: &R,
    metadata: &ParquetMetaData,
) -> Result<(), ParquetError> {
    let length = from.len();
    let mut all_rows = 0_u64;
    for group in metadata.row_groups() {
        let rows = u64::try_from(group.num_rows()).unwrap_or(u64::MAX);
        // Each row has the name of its case, or the time that it took, which do not pack.
        all_rows = all_rows.saturating_add(rows);
        if rows > GROUP_ROWS as u64 || all_rows > length {
            return Err(damaged("it claims more rows than it can hold"));
        }
        for column in group.columns() {
            let begin = column
                .dictionary_page_offset()
                .unwrap_or_else(|| column.data_page_offset());
            let range = u64::try_from(begin)
                .ok()
                .zip(u64::try_from(column.compressed_size()).ok());
            let end = range.and_then(|(begin, size)| begin.checked_add(size));
            let (Some((begin, _)), Some(end)) = (range, end.filter(|end| *end <= length)) else {
                return Err(damaged("a column ends behind its end"));
            };
            check_column(from, begin, end, rows)?;
        }
    }
    Ok(())
}

fn check_column<R: ChunkReader>(
    from: &R,
    mut at: u64,
    end: u64,
    rows: u64,
) -> Result<(), ParquetError> {
    while at < end {
        let window = (end - at).min(HEADER_MOST);
        let bytes = from.get_bytes(at, usize::try_from(window)?)?;
        let header = Header::read(&bytes).ok_or_else(|| damaged("a page has no header"))?;
        let most = MOST_PACKED
            .saturating_mul(header.packed)
            .saturating_add(MOST_PACKED);
        if header.unpacked > most {
            return Err(damaged("a page claims more bytes than it can hold"));
        }
        if header.values > rows || header.entries > header.unpacked {
            return Err(damaged("a page claims more values than it can hold"));
        }
        at = at
            .saturating_add(header.length)
            .saturating_add(header.packed);
    }
    Ok(())
}

/// What the header of a page says.
#[derive(Debug, Default, PartialEq)]
struct Header {
    /// Bytes of itself.
    length: u64,
    /// Bytes of the page, unpacked.
    unpacked: u64,
    /// Bytes of the page as they stand behind the header.
    packed: u64,
    /// Values of a page of data.
    values: u64,
    /// Values of a dictionary.
    entries: u64,
}

impl Header {
    /// `None` for bytes that are none.
    fn read(bytes: &[u8]) -> Option<Self> {
        let mut header = Self::default();
        let mut reader = Compact { bytes, at: 0 };
        let mut found = [false; 2];
        reader.fields(0, &mut |path, value| {
            let place = match path {
                [2, 0] => {
                    found[0] = true;
                    &mut header.unpacked
                }
                [3, 0] => {
                    found[1] = true;
                    &mut header.packed
                }
                // Pages of data of both versions.
                [5 | 8, 1] => &mut header.values,
                [7, 1] => &mut header.entries,
                _ => return Some(()),
            };
            *place = u64::try_from(value).ok()?;
            Some(())
        })?;
        header.length = reader.at as u64;
        (found == [true; 2]).then_some(header)
    }
}

/// Sees a whole number, with the numbers of its field and of the field that it is in.
type See<'a> = dyn FnMut([u64; 2], i64) -> Option<()> + 'a;

/// Reads Thrift's compact protocol.
struct Compact<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Compact<'_> {
    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn skip(&mut self, count: u64) -> Option<()> {
        let at = self.at.checked_add(usize::try_from(count).ok()?)?;
        (at <= self.bytes.len()).then(|| self.at = at)
    }

    /// A number in groups of seven bits, the lowest first.
    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    fn signed(&mut self) -> Option<i64> {
        let zigzag = self.varint()?;
        Some((zigzag >> 1) as i64 ^ -((zigzag & 1) as i64))
    }

    /// The fields of the struct that the header is.
    fn fields(&mut self, outer: u64, see: &mut See<'_>) -> Option<()> {
        self.fields_at(outer, see, 0)
    }

    fn fields_at(&mut self, outer: u64, see: &mut See<'_>, depth: u8) -> Option<()> {
        if depth > DEEPEST {
            return None;
        }
        let mut number = 0_u64;
        loop {
            let head = self.byte()?;
            let (step, kind) = (u64::from(head >> 4), head & 0x0f);
            if kind == 0 {
                return Some(());
            }
            number = match step {
                0 => u64::try_from(self.signed()?).ok()?,
                step => number.checked_add(step)?,
            };
            let path = match depth {
                0 => [number, 0],
                1 => [outer, number],
                // Deeper fields are nobody's.
                _ => [u64::MAX, number],
            };
            match kind {
                // A flag stands in the head.
                1 | 2 => {}
                4..=6 => {
                    let value = self.signed()?;
                    see(path, value)?;
                }
                12 => self.fields_at(number, see, depth + 1)?,
                kind => self.value(kind, depth)?,
            }
        }
    }

    /// Goes over a value that nobody asks for.
    fn value(&mut self, kind: u8, depth: u8) -> Option<()> {
        match kind {
            1..=3 => self.skip(1),
            4..=6 => self.varint().map(drop),
            7 => self.skip(8),
            8 => {
                let length = self.varint()?;
                self.skip(length)
            }
            9 | 10 => {
                let head = self.byte()?;
                let count = match head >> 4 {
                    15 => self.varint()?,
                    count => u64::from(count),
                };
                self.list(head & 0x0f, count, depth)
            }
            12 => self.fields_at(0, &mut |_, _| Some(()), depth + 1),
            // No header has a map.
            _ => None,
        }
    }

    fn list(&mut self, kind: u8, count: u64, depth: u8) -> Option<()> {
        if depth > DEEPEST {
            return None;
        }
        // Each value has a byte at least, so that the end of the bytes ends this.
        (0..count).try_for_each(|_| self.value(kind, depth + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Type 0, 300 bytes, 20 packed, 7 values in a page of data.
    const DATA: [u8; 13] = [
        0x15, 0x00, 0x15, 0xd8, 0x04, 0x15, 0x28, 0x2c, 0x15, 0x0e, 0x00, 0x00, 0xff,
    ];

    #[test]
    fn a_header_is_read_and_a_cut_one_is_none() {
        let header = Header::read(&DATA).expect("a header");
        let expected = Header {
            length: 12,
            unpacked: 300,
            packed: 20,
            values: 7,
            entries: 0,
        };
        assert_eq!(header, expected);
        for end in 0..12 {
            assert_eq!(Header::read(&DATA[..end]), None, "{end}");
        }
    }

    /// A list of lists of lists, each of which claims very many.
    #[test]
    fn what_is_deep_or_long_is_no_header() {
        assert_eq!(Header::read(&[0x19; 4000]), None);
        assert_eq!(Header::read(&[0x1c; 4000]), None);
        assert_eq!(
            Header::read(&[0x19, 0xf8, 0xff, 0xff, 0xff, 0xff, 0x0f]),
            None
        );
    }
}
