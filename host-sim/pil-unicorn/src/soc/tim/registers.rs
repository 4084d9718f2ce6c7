//! The registers, as a program reads and writes them.

use super::{BKE, BKP, Kind, MOE, Tim};
use crate::soc::Refusal;

pub(super) const CR1: usize = 0x00;
pub(super) const CR2: usize = 0x04;
pub(super) const SMCR: usize = 0x08;
pub(super) const DIER: usize = 0x0C;
pub(super) const SR: usize = 0x10;
pub(super) const EGR: usize = 0x14;
pub(super) const CCMR1: usize = 0x18;
pub(super) const CCMR2: usize = 0x1C;
pub(super) const CCER: usize = 0x20;
pub(super) const CNT: usize = 0x24;
pub(super) const PSC: usize = 0x28;
pub(super) const ARR: usize = 0x2C;
pub(super) const RCR: usize = 0x30;
pub(super) const CCR1: usize = 0x34;
pub(super) const CCR4: usize = 0x40;
pub(super) const BDTR: usize = 0x44;
pub(super) const AF1: usize = 0x60;

/// AF1: the break pin is a source of the break.
const BKINE: u32 = 1;
/// SR: a break has come from a pin, or from within the system.
const BIF: u32 = 1 << 7;
pub(super) const SBIF: u32 = 1 << 13;

/// CCER: the second signal is inverted.
const SECOND_INVERTED: u32 = 1 << 5;

impl Tim {
    pub(crate) fn read(&mut self, offset: usize, cycle: u64) -> Result<u32, Refusal> {
        Ok(match offset {
            CR1 => self.cr1,
            CR2 => self.cr2,
            SMCR => self.smcr,
            DIER => self.dier,
            SR => self.sr,
            CCMR1 => self.ccmr[0],
            CCMR2 if self.kind != Kind::Small => self.ccmr[1],
            CCER => self.ccer,
            CNT => {
                self.counted = self.count(cycle);
                self.counted
            }
            PSC => self.psc,
            ARR => self.arr,
            RCR => 0,
            CCR1..=CCR4 if offset.is_multiple_of(4) => {
                let channel = (offset - CCR1) / 4;
                if self.ccmr_of(channel) & 3 != 0 {
                    // Reading a capture clears its flag.
                    self.sr &= !(2 << channel);
                }
                self.ccr[channel]
            }
            BDTR if matches!(self.kind, Kind::Advanced | Kind::Small) => self.bdtr,
            AF1 if matches!(self.kind, Kind::Advanced | Kind::Small) => self.af1,
            _ => return Err(Refusal::Register),
        })
    }

    pub(crate) fn write(&mut self, offset: usize, value: u32, cycle: u64) -> Result<(), Refusal> {
        let only = |mask: u32| Refusal::beyond(mask, value);
        match offset {
            CR1 => {
                only(0x8D)?;
                let starts = value & 1 != 0 && !self.runs();
                let stops = value & 1 == 0 && self.runs();
                if stops {
                    let count = self.count(cycle);
                    self.set_count(count, cycle);
                }
                self.cr1 = value;
                if starts {
                    self.since = cycle;
                    self.seen = cycle;
                }
            }
            // An idle state other than low would be an output that is on without MOE.
            CR2 => {
                only(0x70)?;
                if !matches!(value >> 4 & 7, 0 | 2 | 3) {
                    return Err(Refusal::Bits(value));
                }
                self.cr2 = value;
            }
            SMCR => {
                only(0x77)?;
                let known = match value & 7 {
                    0 | 6 => true,
                    3 => self.ccer & SECOND_INVERTED == 0,
                    _ => false,
                };
                if !known {
                    return Err(Refusal::Bits(value));
                }
                // A counter of the clock keeps its value, and so does a one-shot.
                if self.encoder_mode() || value & 7 == 3 {
                    let count = self.count(cycle);
                    self.set_count(count, cycle);
                }
                self.smcr = value;
            }
            DIER => {
                only(0x1F1F)?;
                self.dier = value;
            }
            SR => self.sr &= value,
            EGR => {
                only(1)?;
                if value & 1 != 0 {
                    self.set_count(0, cycle);
                    self.seen = cycle;
                    let quiet = self.cr1 & 4 != 0;
                    let flag = self.sr & 1;
                    self.update();
                    if quiet {
                        self.sr = self.sr & !1 | flag;
                    }
                }
            }
            CCMR1 => self.set_modes(0, value)?,
            CCMR2 if self.kind != Kind::Small => self.set_modes(1, value)?,
            CCER => {
                // In encoder mode, only the first signal's polarity may reverse the direction.
                let inverted = if self.encoder_mode() {
                    SECOND_INVERTED
                } else {
                    0
                };
                only(0x3333 & !inverted)?;
                if self.encoder_mode() {
                    let count = self.count(cycle);
                    self.set_count(count, cycle);
                }
                self.ccer = value;
            }
            CNT => {
                self.set_count(value, cycle);
                self.seen = cycle;
            }
            PSC => {
                only(0xFFFF)?;
                self.psc = value;
            }
            ARR => {
                self.arr = value & self.top();
                if self.cr1 & 0x80 == 0 {
                    self.arr_now = self.arr;
                }
            }
            RCR => only(0)?,
            CCR1..=CCR4 if offset.is_multiple_of(4) => {
                let channel = (offset - CCR1) / 4;
                self.ccr[channel] = value & self.top();
                let preload = self.ccmr_of(channel) & 8 != 0;
                // Updates that nothing listens to are not events here; they come within one period, 50 µs on
                // the motor's bridge.
                if !preload || !self.listens_to_update() {
                    self.ccr_now[channel] = self.ccr[channel];
                }
                // A value already passed is not reached again before the next round.
                self.seen = self.seen.max(cycle);
            }
            BDTR if matches!(self.kind, Kind::Advanced | Kind::Small) => {
                only(0xFFFF)?;
                let broken = self.sr & (BIF | SBIF) != 0 && self.bdtr & BKE != 0;
                // Without a pin the input is low, which is a break if low is active.
                let pulled = self.af1 & BKINE == 0 && value & (BKE | BKP) == BKE;
                let off = broken || pulled;
                self.bdtr = if off { value & !MOE } else { value };
            }
            AF1 if matches!(self.kind, Kind::Advanced | Kind::Small) => {
                only(BKINE)?;
                self.af1 = value;
            }
            _ => return Err(Refusal::Register),
        }
        Ok(())
    }

    /// Sets the modes of two channels. An output must have one of the modes that [`Self::high_counts`]
    /// supports.
    fn set_modes(&mut self, half: usize, value: u32) -> Result<(), Refusal> {
        self.ccmr[half] = value;
        for channel in [2 * half, 2 * half + 1] {
            let output = self.ccmr_of(channel) & 3 == 0;
            if output && !matches!(self.mode_of(channel), 0 | 5..=7) {
                return Err(Refusal::Bits(value));
            }
        }
        Ok(())
    }
}
