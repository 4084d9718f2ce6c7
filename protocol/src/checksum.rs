//! CRC-32C, in one of two ways with the same result.
//!
//! A board looks up half a byte at a time: 64 bytes of flash and about a dozen
//! instructions a byte, where one byte takes 10 µs on the line. A host (feature
//! `wide-crc`) looks up sixteen bytes at a time in 16 KiB of tables.

#[cfg(feature = "wide-crc")]
mod wide {
    use crc::{CRC_32_ISCSI, Crc, Digest, Table};

    static CRC: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISCSI);

    /// CRC-32C piece by piece.
    #[derive(Clone)]
    pub struct Checksum(Digest<'static, u32, Table<16>>);

    impl Default for Checksum {
        fn default() -> Self {
            Self(CRC.digest())
        }
    }

    impl Checksum {
        /// Takes the next bytes.
        pub fn update(&mut self, bytes: &[u8]) {
            self.0.update(bytes);
        }

        /// The checksum of all bytes so far.
        #[must_use]
        pub fn finalize(self) -> u32 {
            self.0.finalize()
        }
    }
}

#[cfg(any(not(feature = "wide-crc"), test))]
#[cfg_attr(
    feature = "wide-crc",
    allow(unreachable_pub, reason = "of a host, only the test sees it")
)]
mod narrow {
    /// The polynomial 0x1EDC6F41, reflected.
    const POLYNOMIAL: u32 = 0x82F6_3B78;

    /// Effect of the lower four bits of the sum on the rest of it.
    const TABLE: [u32; 16] = {
        let mut table = [0; 16];
        let mut rest: &mut [u32] = &mut table;
        let mut bits = 0_u32;
        while let [place, behind @ ..] = rest {
            let mut sum = bits;
            let mut step = 0_u32;
            while step < 4 {
                let carry = if sum & 1 == 0 { 0 } else { POLYNOMIAL };
                sum = sum.wrapping_shr(1) ^ carry;
                step = step.wrapping_add(1);
            }
            *place = sum;
            bits = bits.wrapping_add(1);
            rest = behind;
        }
        table
    };

    /// CRC-32C piece by piece.
    #[derive(Clone)]
    pub struct Checksum(u32);

    impl Default for Checksum {
        fn default() -> Self {
            Self(u32::MAX)
        }
    }

    impl Checksum {
        /// Takes the next bytes.
        #[inline(never)]
        pub fn update(&mut self, bytes: &[u8]) {
            let step = |sum: u32| {
                let low = TABLE.get((sum & 15) as usize).copied().unwrap_or(0);
                low ^ sum.wrapping_shr(4)
            };
            for byte in bytes {
                self.0 = step(step(self.0 ^ u32::from(*byte)));
            }
        }

        /// The checksum of all bytes so far.
        #[must_use]
        pub fn finalize(self) -> u32 {
            !self.0
        }
    }
}

#[cfg(not(feature = "wide-crc"))]
pub use narrow::Checksum;
#[cfg(feature = "wide-crc")]
pub use wide::Checksum;

impl core::fmt::Debug for Checksum {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Checksum")
    }
}

/// CRC-32C of a byte string.
#[must_use]
pub fn checksum(bytes: &[u8]) -> u32 {
    let mut sum = Checksum::default();
    sum.update(bytes);
    sum.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crc::{CRC_32_ISCSI, Crc, NoTable};
    use proptest::prelude::*;

    #[test]
    fn the_check_value_is_the_published_one() {
        assert_eq!(checksum(b"123456789"), 0xE306_9283);
    }

    proptest! {
        #[test]
        fn both_ways_are_the_crc_of_the_catalogue_in_any_pieces(
            bytes in prop::collection::vec(any::<u8>(), 0..300),
            cut in 0_usize..300,
        ) {
            let catalogue = Crc::<u32, NoTable>::new(&CRC_32_ISCSI).checksum(&bytes);
            let (first, rest) = bytes.split_at(cut.min(bytes.len()));
            let mut narrow = narrow::Checksum::default();
            narrow.update(first);
            narrow.update(rest);
            prop_assert_eq!(narrow.finalize(), catalogue);
            let mut used = Checksum::default();
            used.update(first);
            used.update(rest);
            prop_assert_eq!(used.finalize(), catalogue);
        }
    }
}
