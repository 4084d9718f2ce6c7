//! The parameter store as commissioning leaves it in a board's flash memory.
//!
//! Format of a page (`firmware/node/src/store`): 64-bit words, little-endian:
//! magic, count, sequence; the records; CRC-32C of all that and its complement.

use crc::{CRC_32_ISCSI, Crc};
use wheeleg_remote_link::{MAX_NONVOLATILE, Nonvolatile};

const MAGIC: u16 = 0x5757;

/// The first page with these parameters (number, raw value); empty without any.
fn page(records: &[(u16, i32)]) -> Vec<u8> {
    if records.is_empty() {
        return Vec::new();
    }
    let mut bytes = Vec::new();
    bytes.extend_from_slice(&MAGIC.to_le_bytes());
    bytes.extend_from_slice(&(records.len() as u16).to_le_bytes());
    bytes.extend_from_slice(&0_u32.to_le_bytes());
    for (id, raw) in records {
        bytes.extend_from_slice(&id.to_le_bytes());
        bytes.extend_from_slice(&[0, 0]);
        bytes.extend_from_slice(&raw.to_le_bytes());
    }
    let crc = Crc::<u32>::new(&CRC_32_ISCSI).checksum(&bytes);
    bytes.extend_from_slice(&crc.to_le_bytes());
    bytes.extend_from_slice(&(!crc).to_le_bytes());
    bytes
}

/// The store in stretches that fit a message.
pub(crate) fn stretches(records: &[(u16, i32)]) -> Vec<Nonvolatile> {
    let page = page(records);
    let parts = page.chunks(MAX_NONVOLATILE).enumerate();
    parts
        .map(|(i, part)| Nonvolatile {
            offset: (i * MAX_NONVOLATILE) as u32,
            bytes: part.iter().copied().collect(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_its_head_records_and_checksum() {
        let page = page(&[(0x0102, -2)]);
        let crc = Crc::<u32>::new(&CRC_32_ISCSI).checksum(&page[..16]);
        assert_eq!(page.len(), 24);
        assert_eq!(page[..8], [0x57, 0x57, 1, 0, 0, 0, 0, 0]);
        assert_eq!(page[8..16], [2, 1, 0, 0, 0xFE, 0xFF, 0xFF, 0xFF]);
        assert_eq!(page[16..20], crc.to_le_bytes());
        assert_eq!(page[20..], (!crc).to_le_bytes());
        assert!(stretches(&[]).is_empty(), "a blank store");
        let many: Vec<_> = (0..40).map(|i| (i, i32::from(i))).collect();
        let joined: Vec<u8> = stretches(&many).into_iter().flat_map(|s| s.bytes).collect();
        assert_eq!(joined.len(), 42 * 8);
    }
}
