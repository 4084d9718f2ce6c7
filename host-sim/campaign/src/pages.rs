//! What a Parquet file claims is compared with its bytes before anything is unpacked: the library makes
//! room for what is claimed. Work and memory are then within a fixed multiple of the file's size.
//!
//! A page begins with its header, a struct of Thrift's compact protocol.

use parquet::errors::ParquetError;
use parquet::file::metadata::ParquetMetaData;
use parquet::file::reader::ChunkReader;
use wheeleg_config::plan::MOST_IN_BLOCK;

/// Most rows of a row group that is written.
pub(crate) const GROUP_ROWS: usize = 65_536;
/// Most rows of a row group that is read: earlier programs ended a group after the block that filled it.
const MOST_ROWS: u64 = GROUP_ROWS as u64 - 1 + MOST_IN_BLOCK;
/// Cells for each byte of a file.
const CELLS_PER_BYTE: u64 = 32;
/// Bytes of a row that do not pack: its case, with its length.
const ROW_BYTES: u64 = 32;
/// Most columns of a table: one of empty cells has as many for each byte as can be read.
pub(crate) const MOST_COLUMNS: usize = (CELLS_PER_BYTE * ROW_BYTES) as usize;
/// Most bytes of the names that a plan puts into one row.
pub(crate) const NAMES_MOST: usize = 1500;
/// Snappy packs 64 bytes in 3 at best.
const MOST_PACKED: usize = 22;
/// Plain, two names of a dictionary, and runs: no value is made of others.
const ENCODINGS: [usize; 4] = [0, 2, 3, 8];

/// What is wrong with a table, without the words of the library that reads it.
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

/// Whether all that a file claims is of a size that its bytes can have.
///
/// # Errors
/// What is claimed and cannot be.
pub(crate) fn check<R: ChunkReader>(
    from: &R,
    metadata: &ParquetMetaData,
) -> Result<(), ParquetError> {
    let length = from.len();
    let (mut all_rows, mut all_cells, mut all_bytes) = (0_u64, 0_u64, 0_u64);
    for group in metadata.row_groups() {
        let rows = u64::try_from(group.num_rows()).unwrap_or(u64::MAX);
        let columns = group.columns().len() as u64;
        // Each row has the name of its case, or the time that it took, which do not pack.
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

/// Whether the pages of a column of so many rows are of a size that their bytes can have.
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

/// What the header of a page says.
#[derive(Debug, Default, PartialEq)]
struct Header {
    /// Bytes of itself.
    length: usize,
    /// Bytes of the page, unpacked.
    unpacked: usize,
    /// Bytes of the page as they stand behind the header.
    packed: usize,
    /// Values of a page of data.
    values: usize,
    /// How these are written.
    encoding: usize,
    /// Values of a dictionary.
    entries: usize,
}

/// A field of 32 bits.
const WHOLE: u8 = 5;
const STRUCT: u8 = 12;

impl Header {
    /// `None` for bytes that are none. The library goes by the number of a field and not by its kind:
    /// a field of another kind than it expects is refused, or the two would read different pages.
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

    /// That of data, 5 and 8 by version, or of a dictionary, 7.
    fn read_inner(&mut self, reader: &mut Compact<'_>, outer: i64) -> Option<()> {
        let mut number = 0;
        while let Some(kind) = reader.field(&mut number)? {
            match (outer, number, kind) {
                (5 | 8, 1, WHOLE) => self.values = reader.size()?,
                (7, 1, WHOLE) => self.entries = reader.size()?,
                (5, 2, WHOLE) | (8, 4, WHOLE) => self.encoding = reader.size()?,
                (5, 3..=4, WHOLE) | (7, 2, WHOLE) | (8, 2..=6, WHOLE) => drop(reader.size()?),
                // A flag stands in the head.
                (7, 3, 1..=2) | (8, 7, 1..=2) => {}
                (5, 5, STRUCT) | (8, 8, STRUCT) => reader.skip_statistics()?,
                _ => return None,
            }
        }
        Some(())
    }
}

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

    /// A number from 0 that 32 bits hold: the library leaves out all others.
    fn size(&mut self) -> Option<usize> {
        let size = i32::try_from(self.signed()?).ok()?;
        usize::try_from(size).ok()
    }

    /// The kind of the next field, and its number after that of the last one; the inner `None` at the
    /// end of the struct.
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

    /// Goes over the least and the greatest value of a page, and how many there are.
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

    /// Type 0, 300 bytes, 20 packed, 7 values in a page of data.
    const DATA: [u8; 13] = [
        0x15, 0x00, 0x15, 0xd8, 0x04, 0x15, 0x28, 0x2c, 0x15, 0x0e, 0x00, 0x00, 0xff,
    ];

    /// A page of so many bytes whose header claims these sizes, as their varints.
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

    /// The library would see other fields, or others of their bytes.
    #[test]
    fn what_the_library_reads_otherwise_is_no_header() {
        let other = |at: usize, bytes: &[u8]| {
            let mut header = DATA.to_vec();
            header.splice(at..=at, bytes.iter().copied());
            header
        };
        assert!(Header::read(&other(12, &[])).is_some());
        for (at, bytes) in [
            // Another kind of field.
            (2, &[0x13][..]),
            (5, &[0x18]),
            (8, &[0x1c]),
            // The field 65,539, which is 3 in 16 bits.
            (5, &[0x05, 0x86, 0x80, 0x08]),
            // An unknown field: a list of very many.
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
        // 2^31 - 1 bytes, of 2^32 + 5 packed ones, which are 5 in 32 bits.
        let most = [0xfe, 0xff, 0xff, 0xff, 0x0f];
        let hidden = page(&most, &[0x8a, 0x80, 0x80, 0x80, 0x20], 5);
        assert!(told(&hidden).contains("no header"));
        assert!(told(&page(&most, &[0x0a], 5)).contains("more bytes"));
        // Each value made of the one before it.
        let mut delta = whole;
        delta.splice(10..10, [0x15, 0x0e]);
        assert!(told(&delta).contains("encoding"));
        assert!(
            check_pages(&page(&[0xd8, 0x04], &[0x28], 20), 6)
                .is_err_and(|e| e.to_string().contains("more values"))
        );
    }
}
