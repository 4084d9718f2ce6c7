//! Converter codes.

/// Analogue-to-digital code, left-aligned: U0F16 of full scale, 0…65 535.
///
/// Left-aligned, so that the scale does not depend on the converter: a 12-bit
/// conversion sits in bits 15…4, a 16-fold oversampled one fills all 16.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct AdcCode(u16);

impl AdcCode {
    /// Bottom of the range.
    pub const MIN: Self = Self(0);
    /// Top of the range.
    pub const MAX: Self = Self(u16::MAX);

    /// From a left-aligned code.
    #[must_use]
    pub const fn new(left_aligned: u16) -> Self {
        Self(left_aligned)
    }

    /// From a right-aligned code of `bits` bits (1…16; others are taken as the
    /// nearest). A code too large for `bits` saturates.
    #[must_use]
    pub const fn from_right_aligned(code: u16, bits: u32) -> Self {
        let bits = if bits == 0 {
            1
        } else if bits > 16 {
            16
        } else {
            bits
        };
        let shift = 16_u32.saturating_sub(bits);
        let top = u16::MAX.wrapping_shr(shift);
        let code = if code > top { top } else { code };
        Self(code.wrapping_shl(shift))
    }

    /// The left-aligned code, 0…65 535.
    #[must_use]
    pub const fn get(self) -> u16 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::AdcCode;

    #[test]
    fn twelve_bits_sit_at_the_top() {
        assert_eq!(AdcCode::from_right_aligned(0, 12).get(), 0);
        assert_eq!(AdcCode::from_right_aligned(1, 12).get(), 16);
        assert_eq!(AdcCode::from_right_aligned(4095, 12).get(), 65_520);
        assert_eq!(AdcCode::from_right_aligned(4096, 12).get(), 65_520);
        assert_eq!(AdcCode::from_right_aligned(u16::MAX, 16).get(), 65_535);
        assert_eq!(AdcCode::from_right_aligned(u16::MAX, 99).get(), 65_535);
        assert_eq!(AdcCode::from_right_aligned(1, 0).get(), 32_768);
    }
}
