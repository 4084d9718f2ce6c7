//! Commissioned parameters on their way into a board without flash memory.
//!
//! The image of the real part finds its parameters in its own flash pages. A
//! board here gets them as entries of [`ENTRY`] bytes: number (u16) and raw
//! value (i32), little-endian. The offset of a stretch is not used; entries may
//! be spread over stretches at any entry's boundary.

/// Bytes of one entry.
pub const ENTRY: usize = 6;

/// One entry.
pub fn entry(id: u16, raw: i32) -> [u8; ENTRY] {
    let [a, b] = id.to_le_bytes();
    let [c, d, e, f] = raw.to_le_bytes();
    [a, b, c, d, e, f]
}

/// The entries of a stretch as (number, raw value); `None` if it ends inside one.
pub fn entries(bytes: &[u8]) -> Option<impl Iterator<Item = (u16, i32)> + '_> {
    let (entries, rest) = bytes.as_chunks::<ENTRY>();
    let decode = |[a, b, c, d, e, f]: &[u8; ENTRY]| {
        (
            u16::from_le_bytes([*a, *b]),
            i32::from_le_bytes([*c, *d, *e, *f]),
        )
    };
    rest.is_empty().then(|| entries.iter().map(decode))
}

#[cfg(test)]
mod tests {
    use super::{entries, entry};

    #[test]
    fn entries_come_out_as_they_went_in_and_half_ones_are_refused() {
        let pairs = [(0x0102, -3), (0xFFFF, i32::MAX), (0, i32::MIN)];
        let bytes: Vec<u8> = pairs
            .iter()
            .flat_map(|(id, raw)| entry(*id, *raw))
            .collect();
        let found: Vec<_> = entries(&bytes).expect("whole").collect();
        assert_eq!(found, pairs);
        assert!(entries(&bytes[..7]).is_none());
        assert_eq!(entries(&[]).expect("whole").count(), 0);
    }
}
