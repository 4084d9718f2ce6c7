//! Compares what a Parquet file claims with its bytes before anything is decompressed, because the library
//! allocates memory for whatever is claimed. Work and memory then stay within a fixed multiple of the file's
//! size.
//!
//! A page begins with its header, a struct of Thrift's compact protocol.

use parquet::errors::ParquetError;
use parquet::file::metadata::ParquetMetaData;
use parquet::file::reader::ChunkReader;
use wheeleg_config::plan::MOST_IN_BLOCK;

/// Most rows of a row group that this program writes.
pub(crate) const GROUP_ROWS: usize = 65_536;
/// Most rows of a row group that this program reads: earlier programs ended a group only after the block that
/// filled it.
const MOST_ROWS: u64 = GROUP_ROWS as u64 - 1 + MOST_IN_BLOCK;
/// Most cells per byte of a file.
const CELLS_PER_BYTE: u64 = 32;
/// Bytes of a row that do not compress: its case identity, with its length.
const ROW_BYTES: u64 = 32;
/// Most columns of a table: even if all other cells are empty, it stays within [`CELLS_PER_BYTE`].
pub(crate) const MOST_COLUMNS: usize = (CELLS_PER_BYTE * ROW_BYTES) as usize;
/// Most bytes of names that a plan puts into one row.
pub(crate) const NAMES_MOST: usize = 1500;
/// Snappy compresses 64 bytes into 3 at best.
const MOST_PACKED: usize = 22;
/// Plain, the two names of dictionary encoding, and run lengths: no value depends on another.
const ENCODINGS: [usize; 4] = [0, 2, 3, 8];

/// Describes what is wrong with a table, without the library's own wording.
pub(crate) fn in_words(error: &ParquetError) -> String {
    match error {
        ParquetError::General(what) => what.clone(),
        ParquetError::EOF(what) => format!("it ends early: {what}"),
        ParquetError::NYI(what) => format!("this program cannot read all of it: {what}"),
        ParquetError::External(error) => error.to_string(),
        other => other.to_string(),
    }
}

fn damaged(what: &str) -> ParquetError {
    ParquetError::General(format!("it is damaged: {what}"))
}

/// Checks that everything a file claims has a size that its bytes can hold.
///
/// # Errors
/// The claim that cannot be true.
pub(crate) fn check<R: ChunkReader>(
    from: &R,
    metadata: &ParquetMetaData,
) -> Result<(), ParquetError> {
    let length = from.len();
    let (mut all_rows, mut all_cells, mut all_bytes) = (0_u64, 0_u64, 0_u64);
    for group in metadata.row_groups() {
        let rows = u64::try_from(group.num_rows()).unwrap_or(u64::MAX);
        let columns = group.columns().len() as u64;
        // Each row has the identity of its case, or the time that it took; neither compresses.
        all_rows = all_rows.saturating_add(rows);
        all_cells = all_cells.saturating_add(rows.saturating_mul(columns));
        if rows > MOST_ROWS || all_rows > length || all_cells / CELLS_PER_BYTE > length {
            return Err(damaged("it claims more rows than it can hold"));
        }
        if rows == 0 {
            return Err(damaged("it has a group without rows"));
        }
        for column in group.columns() {
            let begin = column
                .dictionary_page_offset()
                .unwrap_or_else(|| column.data_page_offset());
            let range = u64::try_from(begin)
                .ok()
                .zip(u64::try_from(column.compressed_size()).ok());
            let range = range.filter(|(begin, size)| {
                let end = begin.checked_add(*size);
                end.is_some_and(|end| end <= length)
            });
            let Some((begin, size)) = range else {
                return Err(damaged("a column reaches beyond the end of the file"));
            };
            // Columns that share their bytes would be read again and again.
            all_bytes = all_bytes.saturating_add(size);
            if all_bytes > length {
                return Err(damaged("its columns have more bytes than the file"));
            }
            check_pages(&from.get_bytes(begin, usize::try_from(size)?)?, rows)?;
        }
    }
    Ok(())
}

/// Checks that the pages of a column of this many rows have sizes that their bytes can hold.
fn check_pages(mut pages: &[u8], rows: u64) -> Result<(), ParquetError> {
    while !pages.is_empty() {
        let header = Header::read(pages).ok_or_else(|| damaged("a page has no header"))?;
        let page = &pages[header.length..];
        pages = page
            .get(header.packed..)
            .ok_or_else(|| damaged("a page reaches beyond the end of its column"))?;
        if header.unpacked > MOST_PACKED.saturating_mul(header.packed.saturating_add(1)) {
            return Err(damaged("a page claims more bytes than it can hold"));
        }
        if header.values as u64 > rows || header.entries > header.unpacked {
            return Err(damaged("a page claims more values than it can hold"));
        }
        if !ENCODINGS.contains(&header.encoding) {
            return Err(damaged("a page has an encoding that no table has"));
        }
    }
    Ok(())
}

/// Contents of a page header.
#[derive(Debug, Default, PartialEq)]
struct Header {
    /// Bytes of the header itself.
    length: usize,
    /// Bytes of the page, decompressed.
    unpacked: usize,
    /// Bytes of the page as stored after the header.
    packed: usize,
    /// Number of values of a data page.
    values: usize,
    /// Encoding of these values.
    encoding: usize,
    /// Number of values of a dictionary page.
    entries: usize,
}

/// Kind of a 32-bit field.
const WHOLE: u8 = 5;
const STRUCT: u8 = 12;

impl Header {
    /// Returns `None` for bytes that are not a header. The library identifies a field by its number and
    /// ignores its kind. A field of an unexpected kind is therefore refused; otherwise the two would read
    /// different pages.
    fn read(bytes: &[u8]) -> Option<Self> {
        let mut header = Self::default();
        let mut reader = Compact { bytes, at: 0 };
        let (mut unpacked, mut packed) = (None, None);
        let mut number = 0;
        while let Some(kind) = reader.field(&mut number)? {
            match (number, kind) {
                (2, WHOLE) => unpacked = Some(reader.size()?),
                (3, WHOLE) => packed = Some(reader.size()?),
                // Type and checksum.
                (1 | 4, WHOLE) => drop(reader.varint()?),
                (5 | 7 | 8, STRUCT) => header.read_inner(&mut reader, number)?,
                _ => return None,
            }
        }
        (header.unpacked, header.packed) = (unpacked?, packed?);
        header.length = reader.at;
        Some(header)
    }

    /// Reads the inner header: of data (5 or 8, by version) or of a dictionary (7).
    fn read_inner(&mut self, reader: &mut Compact<'_>, outer: i64) -> Option<()> {
        let mut number = 0;
        while let Some(kind) = reader.field(&mut number)? {
            match (outer, number, kind) {
                (5 | 8, 1, WHOLE) => self.values = reader.size()?,
                (7, 1, WHOLE) => self.entries = reader.size()?,
                (5, 2, WHOLE) | (8, 4, WHOLE) => self.encoding = reader.size()?,
                (5, 3..=4, WHOLE) | (7, 2, WHOLE) | (8, 2..=6, WHOLE) => drop(reader.size()?),
                // The value of a flag is in the field's head.
                (7, 3, 1..=2) | (8, 7, 1..=2) => {}
                (5, 5, STRUCT) | (8, 8, STRUCT) => reader.skip_statistics()?,
                _ => return None,
            }
        }
        Some(())
    }
}

/// A reader of Thrift's compact protocol.
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

    /// Reads a number in groups of seven bits, lowest first.
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

    /// Reads a number from 0 that fits in 32 bits; the library ignores all others.
    fn size(&mut self) -> Option<usize> {
        let size = i32::try_from(self.signed()?).ok()?;
        usize::try_from(size).ok()
    }

    /// Reads the kind of the next field, and updates its number from that of the last one; the inner `None`
    /// marks the end of the struct.
    fn field(&mut self, number: &mut i64) -> Option<Option<u8>> {
        let head = self.byte()?;
        let (step, kind) = (i64::from(head >> 4), head & 0x0f);
        if kind == 0 {
            return Some(None);
        }
        *number = match step {
            0 => self.signed()?,
            step => number.checked_add(step)?,
        };
        Some(Some(kind))
    }

    /// Skips the smallest and largest values of a page, and their counts.
    fn skip_statistics(&mut self) -> Option<()> {
        let mut number = 0;
        while let Some(kind) = self.field(&mut number)? {
            match kind {
                1 | 2 => {}
                4..=6 => drop(self.varint()?),
                8 => {
                    let length = usize::try_from(self.varint()?).ok()?;
                    let left = self.bytes.len() - self.at;
                    self.at += Some(length).filter(|length| *length <= left)?;
                }
                _ => return None,
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Type 0, 300 bytes, 20 compressed, 7 values in a data page.
    const DATA: [u8; 13] = [
        0x15, 0x00, 0x15, 0xd8, 0x04, 0x15, 0x28, 0x2c, 0x15, 0x0e, 0x00, 0x00, 0xff,
    ];

    /// A page of this many bytes whose header claims these sizes, given as varints.
    fn page(unpacked: &[u8], packed: &[u8], bytes: usize) -> Vec<u8> {
        let mut page = [&[0x15, 0x00, 0x15], unpacked, &[0x15], packed].concat();
        page.extend([0x2c, 0x15, 0x0e, 0x00, 0x00]);
        page.extend(vec![0; bytes]);
        page
    }

    #[test]
    fn a_header_is_read_and_a_cut_one_is_none() {
        let header = Header::read(&DATA).expect("a header");
        let expected = Header {
            length: 12,
            unpacked: 300,
            packed: 20,
            values: 7,
            ..Header::default()
        };
        assert_eq!(header, expected);
        for end in 0..12 {
            assert_eq!(Header::read(&DATA[..end]), None, "{end}");
        }
    }

    /// The library would see different fields, or read different bytes as their values.
    #[test]
    fn what_the_library_reads_otherwise_is_no_header() {
        let other = |at: usize, bytes: &[u8]| {
            let mut header = DATA.to_vec();
            header.splice(at..=at, bytes.iter().copied());
            header
        };
        assert!(Header::read(&other(12, &[])).is_some());
        for (at, bytes) in [
            // Fields of another kind.
            (2, &[0x13][..]),
            (5, &[0x18]),
            (8, &[0x1c]),
            // The field 65,539, which is 3 in 16 bits.
            (5, &[0x05, 0x86, 0x80, 0x08]),
            // An unknown field: a very long list.
            (11, &[0x49, 0xf8, 0xff, 0xff, 0xff, 0xff, 0x0f]),
        ] {
            assert_eq!(Header::read(&other(at, bytes)), None, "{at} {bytes:x?}");
        }
    }

    #[test]
    fn a_page_has_no_more_than_its_bytes_can_hold() {
        let told = |page: &[u8]| check_pages(page, 7).expect_err("refused").to_string();
        let whole = page(&[0xd8, 0x04], &[0x28], 20);
        assert!(check_pages(&whole, 7).is_ok());
        assert!(check_pages(&[whole.clone(), whole.clone()].concat(), 7).is_ok());
        assert!(told(&whole[..whole.len() - 1]).contains("beyond the end of its column"));
        // 2^31 - 1 bytes from 2^32 + 5 compressed ones, which are 5 in 32 bits.
        let most = [0xfe, 0xff, 0xff, 0xff, 0x0f];
        let hidden = page(&most, &[0x8a, 0x80, 0x80, 0x80, 0x20], 5);
        assert!(told(&hidden).contains("no header"));
        assert!(told(&page(&most, &[0x0a], 5)).contains("more bytes"));
        // Each value depends on the one before it.
        let mut delta = whole;
        delta.splice(10..10, [0x15, 0x0e]);
        assert!(told(&delta).contains("encoding"));
        assert!(
            check_pages(&page(&[0xd8, 0x04], &[0x28], 20), 6)
                .is_err_and(|e| e.to_string().contains("more values"))
        );
    }
}
