//! Address straps: four bits of address and one of parity.

use wheeleg_protocol::Address;

/// Straps of a board: bits 0–3 the address, bit 4 the parity.
const MASK: u8 = 0b1_1111;

/// The address that the closed straps name (bit n = strap n, 1 = closed).
///
/// The number of closed straps is odd, so that one strap that is broken or
/// shorted never names another board. `None` for even parity and for an address
/// that is no node's.
#[must_use]
pub fn address(closed: u8) -> Option<Address> {
    if closed & !MASK != 0 || closed.count_ones() & 1 == 0 {
        return None;
    }
    Address::new(closed & 0x0F).filter(|address| address.is_joint() || address.is_wheel())
}

#[cfg(test)]
mod tests {
    use super::address;

    /// The table of BOARD.md.
    const TABLE: [(u8, u8); 8] = [
        (1, 0b00001),
        (2, 0b00010),
        (3, 0b10011),
        (4, 0b00100),
        (5, 0b10101),
        (6, 0b10110),
        (7, 0b00111),
        (8, 0b01000),
    ];

    #[test]
    fn every_node_has_one_pattern_and_every_other_pattern_none() {
        for closed in 0..=u8::MAX {
            let expected = TABLE.iter().find(|(_, straps)| *straps == closed);
            assert_eq!(
                address(closed).map(|address| address.raw()),
                expected.map(|(address, _)| *address),
                "{closed:#07b}"
            );
        }
    }

    #[test]
    fn one_wrong_strap_names_no_board() {
        for (_, straps) in TABLE {
            for bit in 0..5 {
                assert_eq!(address(straps ^ 1 << bit), None, "{straps:#07b} bit {bit}");
            }
        }
    }
}
