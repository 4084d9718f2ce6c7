//! Flash interface and the two pages of the parameter store.
//!
//! The data cache is modelled for the store: data read through it stays as first read until the cache is
//! reset, whatever happens to the flash meanwhile (RM0440 §5.3.7). Error correction is modelled too: reading
//! a double word that a falling supply has torn raises the NMI, unless the flag of an earlier error is still
//! set (§5.7.7).

use std::collections::{BTreeMap, BTreeSet};

use super::Refusal;

/// First page of the store.
pub(crate) const STORE_BASE: u32 = 0x0801_F000;
/// Bytes of the store: pages 62 and 63.
pub(crate) const STORE_SIZE: usize = 4096;
const PAGE: usize = 2048;
const FIRST_PAGE: u32 = 62;

/// Typical erase time of a page (DATASHEET DS12589: 22.02 ms).
const ERASE_NS: u64 = 22_020_000;
/// Typical programming time of a double word (DATASHEET DS12589: 81.69 µs).
const PROGRAM_NS: u64 = 81_690;

/// FLASH_ACR: wait states, prefetch and caches, debugger access.
const LATENCY: u32 = 0xF;
const CACHES: u32 = 7 << 8;
const DCEN: u32 = 1 << 10;
const ICRST: u32 = 1 << 11;
const DCRST: u32 = 1 << 12;
const ICEN: u32 = 1 << 9;
const DEBUG: u32 = 1 << 18;

/// FLASH_ECCR: an error was corrected; an error was detected.
const ECCC: u32 = 1 << 30;
const ECCD: u32 = 1 << 31;
const ECC_ADDRESS: u32 = 0x7_FFFF;
/// Bytes of a double word.
const UNIT: usize = 8;

const PG: u32 = 1;
const PER: u32 = 1 << 1;
const STRT: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
const EOP: u32 = 1;
const PROGERR: u32 = 1 << 3;
const PGAERR: u32 = 1 << 5;
const PGSERR: u32 = 1 << 7;
const BSY: u32 = 1 << 16;

/// The interface and the contents of the store.
#[derive(Debug, Clone)]
pub(crate) struct Flash {
    acr: u32,
    cr: u32,
    sr: u32,
    key: u8,
    eccr: u32,
    /// Double words of the store in the data cache.
    cached: BTreeMap<usize, [u8; UNIT]>,
    /// Double words that a falling supply has left half written; they, too, survive resets.
    pub(crate) torn: BTreeSet<usize>,
    /// A double error was found since the last query.
    double_error: bool,
    /// Contents of the store; they survive resets and power loss.
    pub(crate) store: Vec<u8>,
    /// First half of a double word being written.
    half: Option<(usize, u32)>,
    /// End of the operation in progress.
    busy_until: u64,
    /// Time for which the processor stalls [ns]; the machine takes it from here.
    pub(crate) stall_ns: u64,
    /// Units that will still be completed before the supply fails.
    pub(crate) units_left: Option<u16>,
    /// The supply has failed during a save.
    pub(crate) power_failed: bool,
}

impl Flash {
    pub(crate) fn new(store: Vec<u8>) -> Self {
        Self {
            acr: 0x0004_0601,
            cr: LOCK | 1 << 30,
            sr: 0,
            key: 0,
            eccr: 0,
            cached: BTreeMap::new(),
            torn: BTreeSet::new(),
            double_error: false,
            store,
            half: None,
            busy_until: 0,
            stall_ns: 0,
            units_left: None,
            power_failed: false,
        }
    }

    /// Wait states of a read.
    pub(crate) fn wait_states(&self) -> u64 {
        u64::from(self.acr & LATENCY)
    }

    /// Counts one more unit; returns false if the supply fails during it.
    fn completes(&mut self) -> bool {
        match &mut self.units_left {
            Some(0) => {
                self.units_left = None;
                self.power_failed = true;
                false
            }
            Some(left) => {
                *left -= 1;
                true
            }
            None => true,
        }
    }

    /// Takes the stall caused by the last access, and notes its end.
    pub(crate) fn take_stall(&mut self, cycle: u64, cycles_of: impl Fn(u64) -> u64) -> u64 {
        let stall = cycles_of(std::mem::take(&mut self.stall_ns));
        if stall > 0 {
            self.busy_until = cycle + stall;
        }
        stall
    }

    pub(crate) fn read(&mut self, offset: usize, cycle: u64) -> Result<u32, Refusal> {
        Ok(match offset {
            0x00 => self.acr,
            0x10 => self.sr | if cycle < self.busy_until { BSY } else { 0 },
            0x14 => self.cr,
            0x18 => self.eccr,
            _ => return Err(Refusal::Register),
        })
    }

    /// Whether a double error, which raises the NMI, was found since the last call.
    pub(crate) fn take_double_error(&mut self) -> bool {
        std::mem::take(&mut self.double_error)
    }

    pub(crate) fn write(&mut self, offset: usize, value: u32) -> Result<(), Refusal> {
        match offset {
            0x00 => {
                Refusal::beyond(LATENCY | CACHES | DEBUG | ICRST | DCRST, value)?;
                // A cache can only be reset while it is off.
                let on = |reset: u32, enable: u32| value & reset != 0 && value & enable != 0;
                if on(DCRST, DCEN) || on(ICRST, ICEN) {
                    return Err(Refusal::Bits(value & (DCRST | ICRST)));
                }
                if value & DCRST != 0 {
                    self.cached.clear();
                }
                self.acr = value;
            }
            0x08 => {
                self.key = match (self.key, value) {
                    (0, 0x4567_0123) => 1,
                    (1, 0xCDEF_89AB) => {
                        self.cr &= !LOCK;
                        0
                    }
                    // A wrong key would lock the interface until reset.
                    _ => return Err(Refusal::Bits(value)),
                };
            }
            0x10 => self.sr &= !value,
            0x14 => {
                if self.cr & LOCK != 0 {
                    return Err(Refusal::Bits(value));
                }
                if value & !(LOCK | 1 << 30 | STRT | 0x3F8 | PER | PG | 1 << 24 | 1 << 25) != 0 {
                    return Err(Refusal::Bits(value));
                }
                self.cr = value & !STRT;
                if value & STRT != 0 && value & PER != 0 {
                    self.erase(value >> 3 & 0x7F)?;
                }
            }
            0x18 => {
                Refusal::beyond(ECCC | ECCD | ECC_ADDRESS, value)?;
                self.eccr &= !(value & (ECCC | ECCD));
            }
            _ => return Err(Refusal::Register),
        }
        Ok(())
    }

    fn erase(&mut self, page: u32) -> Result<(), Refusal> {
        let Some(index) = page.checked_sub(FIRST_PAGE) else {
            // The program would erase itself.
            return Err(Refusal::Bits(page << 3));
        };
        let start = index as usize * PAGE;
        let whole = self.completes();
        let end = if whole {
            start + PAGE
        } else {
            start + PAGE / 2
        };
        self.store[start..end].fill(0xFF);
        self.torn.retain(|at| !(start..end).contains(at));
        self.stall_ns = ERASE_NS;
        self.sr |= EOP;
        Ok(())
    }

    /// Reads the store, through the data cache if it is on.
    pub(crate) fn load(&mut self, offset: usize, size: usize) -> u32 {
        (0..size).fold(0, |value, i| {
            value | u32::from(self.load_byte(offset + i)) << (8 * i)
        })
    }

    fn load_byte(&mut self, offset: usize) -> u8 {
        let unit = offset - offset % UNIT;
        let caches = self.acr & DCEN != 0;
        if caches && let Some(bytes) = self.cached.get(&unit) {
            return bytes[offset % UNIT];
        }
        let Some(place) = self.store.get(unit..unit + UNIT) else {
            return 0xFF;
        };
        let mut bytes = [0; UNIT];
        bytes.copy_from_slice(place);
        if self.torn.contains(&unit) {
            if self.eccr & (ECCC | ECCD) == 0 {
                let address = FIRST_PAGE * PAGE as u32 + unit as u32;
                self.eccr = self.eccr & !ECC_ADDRESS | ECCD | address;
                self.double_error = true;
            }
        } else if caches {
            self.cached.insert(unit, bytes);
        }
        bytes[offset % UNIT]
    }

    /// Writes to the store; two words, low word first, make a unit.
    pub(crate) fn program(
        &mut self,
        offset: usize,
        size: usize,
        value: u32,
    ) -> Result<(), Refusal> {
        if self.cr & PG == 0 || size != 4 || !offset.is_multiple_of(4) {
            self.sr |= PGSERR | PGAERR;
            return Err(Refusal::Store);
        }
        match self.half.take() {
            None if offset.is_multiple_of(8) => self.half = Some((offset, value)),
            Some((first, low)) if offset == first + 4 => {
                let unit = u64::from(low) | u64::from(value) << 32;
                let place = &mut self.store[first..first + 8];
                if place.iter().any(|b| *b != 0xFF) && unit != 0 {
                    self.sr |= PROGERR;
                    return Ok(());
                }
                place.copy_from_slice(&unit.to_le_bytes());
                self.torn.remove(&first);
                if !self.completes() {
                    self.torn.insert(first);
                    // Torn: some bits have not been written.
                    for byte in &mut self.store[first..first + 8] {
                        *byte |= 0x5A;
                    }
                }
                self.stall_ns = PROGRAM_NS;
                self.sr |= EOP;
            }
            _ => {
                self.sr |= PGSERR;
                return Err(Refusal::Store);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open() -> Flash {
        let mut flash = Flash::new(vec![0xFF; STORE_SIZE]);
        flash.write(0x08, 0x4567_0123).expect("key");
        flash.write(0x08, 0xCDEF_89AB).expect("key");
        flash
    }

    #[test]
    fn a_double_word_is_written_once_and_stalls() {
        let mut flash = open();
        flash.write(0, 4).expect("no cache");
        flash.write(0x14, PG).expect("modelled");
        flash.program(16, 4, 0x1122_3344).expect("low");
        assert_eq!(flash.load(16, 4), u32::MAX);
        flash.program(20, 4, 0x5566_7788).expect("high");
        assert_eq!(flash.load(16, 4), 0x1122_3344);
        assert_eq!(flash.load(22, 2), 0x5566);
        let stall = flash.take_stall(100, |ns| ns * 17 / 100);
        assert_eq!(stall, 13_887);
        assert!(flash.read(0x10, 100).expect("modelled") & BSY != 0);
        assert!(flash.read(0x10, 14_000).expect("modelled") & BSY == 0);
        flash.program(16, 4, 0).expect("low");
        flash.program(20, 4, 1).expect("high");
        assert!(flash.read(0x10, 20_000).expect("modelled") & PROGERR != 0);
        assert_eq!(flash.load(16, 4), 0x1122_3344, "written only once");
    }

    #[test]
    fn the_program_cannot_be_erased_and_a_locked_interface_refuses() {
        let mut flash = Flash::new(vec![0xFF; STORE_SIZE]);
        assert!(flash.write(0x14, PG).is_err());
        let mut flash = open();
        assert!(flash.write(0x14, PER | 61 << 3 | STRT).is_err());
        flash.store.fill(0);
        flash.write(0x14, PER | 63 << 3 | STRT).expect("page 63");
        assert!(flash.store[..PAGE].iter().all(|b| *b == 0));
        assert!(flash.store[PAGE..].iter().all(|b| *b == 0xFF));
    }

    #[test]
    fn the_data_cache_holds_what_was_read_until_it_is_reset() {
        let mut flash = open();
        flash.write(0, 4 | DCEN).expect("modelled");
        assert_eq!(flash.load(16, 4), u32::MAX);
        flash.write(0x14, PG).expect("modelled");
        flash.program(16, 4, 0x1122_3344).expect("low");
        flash.program(20, 4, 0x5566_7788).expect("high");
        assert_eq!(flash.load(16, 4), u32::MAX, "stale");
        assert!(flash.write(0, 4 | DCEN | DCRST).is_err(), "it is on");
        flash.write(0, 4 | DCRST).expect("off");
        flash.write(0, 4 | DCEN).expect("modelled");
        assert_eq!(flash.load(16, 4), 0x1122_3344);
    }

    #[test]
    fn a_torn_word_is_a_double_error_unless_a_flag_stands() {
        let mut flash = open();
        flash.write(0x14, PG).expect("modelled");
        flash.units_left = Some(0);
        flash.program(24, 4, 1).expect("low");
        flash.program(28, 4, 2).expect("high");
        flash.load(16, 4);
        assert!(!flash.take_double_error(), "another word");
        flash.load(24, 4);
        assert!(flash.take_double_error());
        assert_eq!(flash.read(0x18, 0), Ok(ECCD | 0x1_F018));
        flash.load(24, 4);
        assert!(!flash.take_double_error(), "the flag stands");
        flash.write(0x18, ECCD | ECCC).expect("modelled");
        flash.load(28, 4);
        assert!(flash.take_double_error());
    }

    #[test]
    fn power_fails_after_the_units_asked_for() {
        let mut flash = open();
        flash.write(0x14, PG).expect("modelled");
        flash.units_left = Some(1);
        for offset in [0, 8] {
            flash.program(offset, 4, 0).expect("low");
            flash.program(offset + 4, 4, 0).expect("high");
        }
        assert!(flash.power_failed);
        assert_eq!(flash.load(0, 4), 0);
        assert_ne!(flash.load(8, 4), 0, "torn");
    }
}
