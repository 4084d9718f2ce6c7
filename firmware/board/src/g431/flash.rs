//! The two parameter pages of the internal flash.

use super::pac;
use crate::store::{Flash, FlashError};
use core::sync::atomic::{AtomicBool, Ordering};

/// First of the two pages.
const FIRST: u32 = 62;
/// Bytes of a page.
const PAGE: u32 = 2048;
const BASE: u32 = 0x0800_0000;
/// Keys that unlock the control register (RM0440 §3.7.2).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Pages 62 and 63.
#[derive(Debug)]
pub struct ParameterPages {
    _one: (),
}

impl ParameterPages {
    /// # Safety
    /// At most one may exist at a time.
    #[must_use]
    pub unsafe fn steal() -> Self {
        Self { _one: () }
    }

    fn address(page: usize, word: usize) -> Option<u32> {
        let (page, word) = (u32::try_from(page).ok()?, u32::try_from(word).ok()?);
        if page >= 2 || word >= PAGE / 8 {
            return None;
        }
        let offset = FIRST.saturating_add(page).saturating_mul(PAGE);
        Some(
            BASE.saturating_add(offset)
                .saturating_add(word.saturating_mul(8)),
        )
    }

    /// One operation. One copy in flash serves both kinds, without a call through a
    /// pointer, whose stack would have no bound.
    #[inline(never)]
    fn change(change: Change) -> Result<(), FlashError> {
        let flash = pac::FLASH;
        wait();
        for key in KEYS {
            flash.keyr().write_value(key);
        }
        // Flags of an earlier operation are cleared by writing them.
        flash.sr().write_value(flash.sr().read());
        // The data cache would keep the old contents; it can be emptied only while it is off (RM0440 §5.3.7).
        flash.acr().modify(|r| r.set_dcen(false));
        match change {
            Change::Erase { page } => {
                flash.cr().write(|r| {
                    r.set_per(true);
                    r.set_pnb(page);
                });
                flash.cr().modify(|r| r.set_strt(true));
            }
            Change::Write { address, value } => {
                flash.cr().write(|r| r.set_pg(true));
                let (low, high) = (value as u32, (value >> 32) as u32);
                // SAFETY: an aligned double word of a page that holds no code, erased or
                // overwritten with zeros; written as two words in the order that RM0440 §3.3.7 asks.
                unsafe {
                    core::ptr::write_volatile(address as *mut u32, low);
                    cortex_m::asm::isb();
                    core::ptr::write_volatile(address.wrapping_add(4) as *mut u32, high);
                }
            }
        }
        let result = outcome();
        flash.acr().modify(|r| r.set_dcrst(true));
        flash.acr().modify(|r| r.set_dcrst(false));
        flash.acr().modify(|r| r.set_dcen(true));
        flash.cr().write(|r| r.set_lock(true));
        result
    }
}

/// An operation on the flash: erase a page, or write a double word at an address of
/// [`ParameterPages::address`].
#[derive(Clone, Copy)]
enum Change {
    Erase { page: u8 },
    Write { address: u32, value: u64 },
}

fn wait() {
    while pac::FLASH.sr().read().bsy() {}
}

/// The outcome of the operation that has just ended.
fn outcome() -> Result<(), FlashError> {
    wait();
    let sr = pac::FLASH.sr().read();
    let failed = sr.progerr() | sr.wrperr() | sr.pgaerr() | sr.sizerr() | sr.pgserr();
    if failed { Err(FlashError) } else { Ok(()) }
}

impl Flash for ParameterPages {
    fn read(&self, page: usize, word: usize) -> Option<u64> {
        let address = Self::address(page, word)?;
        // A set flag would hide the errors after it (RM0440 §5.7.7).
        clear_ecc_flags();
        // SAFETY: an aligned address inside the flash. A word that a power cut left half-written
        // has a double error, which the NMI handler turns into a note.
        let value = unsafe { core::ptr::read_volatile(address as *const u64) };
        // The interrupt of this read has come before its note is looked for.
        cortex_m::asm::dsb();
        cortex_m::asm::isb();
        (!take_ecc_error()).then_some(value)
    }

    fn erase(&mut self, page: usize) -> Result<(), FlashError> {
        let number = FIRST.saturating_add(u32::try_from(page).map_err(|_| FlashError)?);
        if page >= 2 {
            return Err(FlashError);
        }
        Self::change(Change::Erase { page: number as u8 })
    }

    fn write(&mut self, page: usize, word: usize, value: u64) -> Result<(), FlashError> {
        let address = Self::address(page, word).ok_or(FlashError)?;
        Self::change(Change::Write { address, value })
    }
}

static ECC_ERROR: AtomicBool = AtomicBool::new(false);

/// Whether a word with a double error was read since the last call.
fn take_ecc_error() -> bool {
    let error = ECC_ERROR.load(Ordering::Acquire);
    ECC_ERROR.store(false, Ordering::Relaxed);
    error
}

/// First address of the parameter store, counted from the beginning of the flash.
const STORE: u32 = FIRST * PAGE;

fn clear_ecc_flags() {
    pac::FLASH.eccr().modify(|r| {
        r.set_eccc(true);
        r.set_eccd(true);
    });
}

/// The part of the non-maskable interrupt that is the flash's: true if it was a double error in
/// the parameter store, which its reader survives. One in the program is not survived.
pub(super) fn on_nmi() -> bool {
    let eccr = pac::FLASH.eccr().read();
    let in_store = eccr.eccd() && !eccr.sysf_ecc() && eccr.addr_ecc() >= STORE;
    if in_store {
        clear_ecc_flags();
        ECC_ERROR.store(true, Ordering::Release);
    }
    in_store
}
