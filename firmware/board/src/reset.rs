//! Why the processor started.

/// Cause of a reset, the most telling of the flags first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// The supply came up, or fell below the brown-out level.
    PowerOrBrownOut,
    /// The independent watchdog was not fed for 50 ms.
    Watchdog,
    /// The supply sagged below the warning level and came back.
    SupplySag,
    /// A processor fault or an unexpected interrupt.
    ProcessorFault,
    /// A panic.
    Panic,
    /// The crystal oscillator stopped.
    ClockLoss,
    /// Asked for by software, or by a debugger.
    Software,
    /// The reset pin.
    Pin,
    /// The option bytes were loaded.
    OptionBytes,
}

/// Bits of RCC_CSR (RM0440 §7.4.27).
mod csr {
    pub(super) const OBLRSTF: u32 = 1 << 25;
    pub(super) const PINRSTF: u32 = 1 << 26;
    pub(super) const BORRSTF: u32 = 1 << 27;
    pub(super) const SFTRSTF: u32 = 1 << 28;
    pub(super) const IWDGRSTF: u32 = 1 << 29;
}

/// What a handler leaves in a word of RAM before it resets the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Note {
    /// Supply below the warning level.
    SupplySag = 0x5341_4731,
    /// HardFault or an interrupt without a handler.
    ProcessorFault = 0x4641_4C54,
    /// Panic handler.
    Panic = 0x5041_4E31,
    /// Clock security system.
    ClockLoss = 0x434C_4F53,
}

impl ResetCause {
    /// From the flags of RCC_CSR and the word that a handler may have left. The
    /// word counts only after a reset by software: at power-up RAM is random.
    #[must_use]
    pub const fn decode(flags: u32, note: u32) -> Self {
        if flags & csr::IWDGRSTF != 0 {
            return Self::Watchdog;
        }
        if flags & csr::BORRSTF != 0 {
            return Self::PowerOrBrownOut;
        }
        if flags & csr::SFTRSTF != 0 {
            return match note {
                n if n == Note::SupplySag as u32 => Self::SupplySag,
                n if n == Note::ProcessorFault as u32 => Self::ProcessorFault,
                n if n == Note::Panic as u32 => Self::Panic,
                n if n == Note::ClockLoss as u32 => Self::ClockLoss,
                _ => Self::Software,
            };
        }
        if flags & csr::OBLRSTF != 0 {
            return Self::OptionBytes;
        }
        if flags & csr::PINRSTF != 0 {
            return Self::Pin;
        }
        Self::PowerOrBrownOut
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_watchdog_is_told_from_power_and_software() {
        // Every reset pulls the pin low as well, so its flag says least.
        let pin = csr::PINRSTF;
        let cause = |flags: u32, note: u32| ResetCause::decode(flags | pin, note);
        assert_eq!(cause(csr::IWDGRSTF, 0), ResetCause::Watchdog);
        assert_eq!(cause(csr::BORRSTF, 0), ResetCause::PowerOrBrownOut);
        assert_eq!(cause(csr::SFTRSTF, 0), ResetCause::Software);
        assert_eq!(cause(csr::OBLRSTF, 0), ResetCause::OptionBytes);
        assert_eq!(cause(0, 0), ResetCause::Pin);
        assert_eq!(ResetCause::decode(0, 0), ResetCause::PowerOrBrownOut);
    }

    #[test]
    fn a_note_counts_after_a_software_reset_alone() {
        let note = Note::SupplySag as u32;
        assert_eq!(
            ResetCause::decode(csr::SFTRSTF, note),
            ResetCause::SupplySag
        );
        assert_eq!(
            ResetCause::decode(csr::IWDGRSTF, note),
            ResetCause::Watchdog
        );
        assert_eq!(
            ResetCause::decode(csr::BORRSTF, note),
            ResetCause::PowerOrBrownOut
        );
    }
}
