//! Why the processor started.

use wheeleg_protocol::ResetCause;

/// Bits of RCC_CSR (RM0440 §7.4.27).
mod csr {
    pub(super) const OBLRSTF: u32 = 1 << 25;
    pub(super) const PINRSTF: u32 = 1 << 26;
    pub(super) const BORRSTF: u32 = 1 << 27;
    pub(super) const SFTRSTF: u32 = 1 << 28;
    pub(super) const IWDGRSTF: u32 = 1 << 29;
}

/// Note that a handler leaves in a word of RAM before it resets the processor.
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

/// Whether these flags of RCC_CSR are those of a reset by software, before which a handler may
/// have left a note.
#[must_use]
pub const fn may_have_note(flags: u32) -> bool {
    flags & csr::SFTRSTF != 0
}

/// From the flags of RCC_CSR and the word that a handler may have left, the most
/// telling flag first. The word counts only after a reset by software: at power-up
/// RAM is random.
#[must_use]
pub const fn decode(flags: u32, note: u32) -> ResetCause {
    if flags & csr::IWDGRSTF != 0 {
        return ResetCause::Watchdog;
    }
    if flags & csr::BORRSTF != 0 {
        return ResetCause::PowerUp;
    }
    if flags & csr::SFTRSTF != 0 {
        return match note {
            n if n == Note::SupplySag as u32 => ResetCause::BrownOut,
            n if n == Note::ProcessorFault as u32 => ResetCause::ProcessorFault,
            n if n == Note::Panic as u32 => ResetCause::Panic,
            n if n == Note::ClockLoss as u32 => ResetCause::ClockLoss,
            _ => ResetCause::Software,
        };
    }
    if flags & csr::OBLRSTF != 0 {
        return ResetCause::OptionBytes;
    }
    if flags & csr::PINRSTF != 0 {
        return ResetCause::Pin;
    }
    ResetCause::PowerUp
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_watchdog_is_told_from_power_and_software() {
        // Every reset pulls the pin low as well, so its flag means least.
        let pin = csr::PINRSTF;
        let cause = |flags: u32, note: u32| decode(flags | pin, note);
        assert_eq!(cause(csr::IWDGRSTF, 0), ResetCause::Watchdog);
        assert_eq!(cause(csr::BORRSTF, 0), ResetCause::PowerUp);
        assert_eq!(cause(csr::SFTRSTF, 0), ResetCause::Software);
        assert_eq!(cause(csr::OBLRSTF, 0), ResetCause::OptionBytes);
        assert_eq!(cause(0, 0), ResetCause::Pin);
        assert_eq!(decode(0, 0), ResetCause::PowerUp);
    }

    #[test]
    fn a_note_counts_after_a_software_reset_alone() {
        let note = Note::SupplySag as u32;
        assert_eq!(decode(csr::SFTRSTF, note), ResetCause::BrownOut);
        assert_eq!(decode(csr::IWDGRSTF, note), ResetCause::Watchdog);
        assert_eq!(decode(csr::BORRSTF, note), ResetCause::PowerUp);
    }
}
