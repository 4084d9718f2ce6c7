//! NVIC and system control block: which exceptions are pending, which are active, and which comes next.

/// Number of exceptions below the interrupts.
pub(crate) const FIRST_IRQ: usize = 16;
/// Number of interrupt lines of an STM32G431.
pub(crate) const IRQS: usize = 102;
/// Non-maskable interrupt.
pub(crate) const NON_MASKABLE: usize = 2;
/// Hard fault.
pub(crate) const HARD_FAULT: usize = 3;
/// Supervisor call.
pub(crate) const SV_CALL: usize = 11;
/// Pendable service request.
const PEND_SV: usize = 14;
/// System timer.
const SYS_TICK: usize = 15;

/// Priority of thread mode, below every exception.
const THREAD: i16 = 256;

/// Interrupt controller, without fault escalation and sub-priorities.
#[derive(Debug, Clone)]
pub(crate) struct Nvic {
    enabled: u128,
    latched: u128,
    /// Lines that are currently high.
    pub(crate) lines: u128,
    system_pending: u32,
    priority: [u8; FIRST_IRQ + IRQS],
    active: Vec<usize>,
    vtor: u32,
    scr: u32,
    /// Control, region number, base and attributes of the memory protection unit.
    mpu: [u32; 4],
    /// The processor requested a system reset.
    pub(crate) reset_request: bool,
}

impl Default for Nvic {
    fn default() -> Self {
        Self {
            enabled: 0,
            latched: 0,
            lines: 0,
            system_pending: 0,
            priority: [0; FIRST_IRQ + IRQS],
            active: Vec::new(),
            vtor: 0,
            scr: 0,
            mpu: [0; 4],
            reset_request: false,
        }
    }
}

impl Nvic {
    /// Base of the vector table.
    pub(crate) fn vector_base(&self) -> u32 {
        if self.vtor == 0 {
            crate::image::FLASH_BASE
        } else {
            self.vtor
        }
    }

    fn pending(&self) -> u128 {
        let mut active = 0;
        for n in &self.active {
            if *n >= FIRST_IRQ {
                active |= 1_u128 << (n - FIRST_IRQ);
            }
        }
        (self.latched | self.lines & !active) & self.enabled
    }

    /// Whether anything is pending that would wake the processor.
    pub(crate) fn wakes(&self) -> bool {
        self.system_pending != 0 || self.pending() != 0
    }

    /// The exception to be taken, given PRIMASK and BASEPRI.
    pub(crate) fn next(&self, primask: bool, basepri: u8) -> Option<usize> {
        let (priority, number) = self.best()?;
        let mut limit = self.current_priority();
        if basepri != 0 {
            limit = limit.min(i16::from(basepri & 0xF0));
        }
        if primask {
            limit = limit.min(0);
        }
        (priority < limit).then_some(number)
    }

    fn best(&self) -> Option<(i16, usize)> {
        let mut best: Option<(i16, usize)> = None;
        let mut offer = |n: usize| {
            let candidate = (self.priority_of(n), n);
            if best.is_none_or(|b| candidate < b) {
                best = Some(candidate);
            }
        };
        let mut bits = self.pending();
        while bits != 0 {
            offer(FIRST_IRQ + bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
        let mut bits = self.system_pending;
        while bits != 0 {
            offer(bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
        best
    }

    fn priority_of(&self, n: usize) -> i16 {
        match n {
            NON_MASKABLE => -2,
            HARD_FAULT => -1,
            _ => i16::from(self.priority[n] & 0xF0),
        }
    }

    fn current_priority(&self) -> i16 {
        let lowest = self.active.iter().map(|n| self.priority_of(*n)).min();
        lowest.unwrap_or(THREAD)
    }

    /// Whether the processor is in a handler.
    pub(crate) fn in_handler(&self) -> bool {
        !self.active.is_empty()
    }

    /// Whether exception `n` is active.
    pub(crate) fn is_active(&self, n: usize) -> bool {
        self.active.contains(&n)
    }

    /// Enters exception `n`.
    pub(crate) fn enter(&mut self, n: usize) {
        if n >= FIRST_IRQ {
            self.latched &= !(1 << (n - FIRST_IRQ));
        } else {
            self.system_pending &= !(1 << n);
        }
        self.active.push(n);
    }

    /// Returns from the newest exception, and returns its number.
    pub(crate) fn leave(&mut self) -> Option<usize> {
        self.active.pop()
    }

    /// Makes a system exception pending.
    pub(crate) fn pend(&mut self, n: usize) {
        self.system_pending |= 1 << n;
    }

    /// Reads a register at `offset` from 0xE000_E000.
    ///
    /// # Errors
    /// `None` for a register that is not modelled.
    pub(crate) fn read(&self, offset: u32, size: usize) -> Option<u32> {
        let bits = |set: u128, base: u32| (set >> ((offset - base) * 8)) as u32;
        Some(match (offset, size) {
            (0x100..=0x10C, 4) => bits(self.enabled, 0x100),
            (0x180..=0x18C, 4) => bits(self.enabled, 0x180),
            (0x200..=0x20C, 4) => bits(self.latched | self.lines, 0x200),
            (0x280..=0x28C, 4) => bits(self.latched | self.lines, 0x280),
            (0x400..=0x465, 1) => u32::from(self.priority[FIRST_IRQ + (offset - 0x400) as usize]),
            (0xD00, 4) => 0x410F_C241,
            (0xD04, 4) => self.active.last().map_or(0, |n| *n as u32),
            (0xD08, 4) => self.vtor,
            (0xD0C, 4) => 0xFA05_0000,
            (0xD10, 4) => self.scr,
            (0xD18..=0xD23, 1) => u32::from(self.priority[4 + (offset - 0xD18) as usize]),
            // Eight regions; what they forbid is not mapped here anyway.
            (0xD90, 4) => 8 << 8,
            (0xD94..=0xDA0, 4) => self.mpu[(offset as usize - 0xD94) / 4],
            _ => return None,
        })
    }

    /// Writes a register at `offset` from 0xE000_E000.
    pub(crate) fn write(&mut self, offset: u32, size: usize, value: u32) -> Option<()> {
        let bits = |base: u32| u128::from(value) << ((offset - base) * 8);
        match (offset, size) {
            (0x100..=0x10C, 4) => self.enabled |= bits(0x100),
            (0x180..=0x18C, 4) => self.enabled &= !bits(0x180),
            (0x200..=0x20C, 4) => self.latched |= bits(0x200),
            (0x280..=0x28C, 4) => self.latched &= !bits(0x280),
            // Four priority bits are implemented.
            (0x400..=0x465, 1) => {
                self.priority[FIRST_IRQ + (offset - 0x400) as usize] = value as u8 & 0xF0;
            }
            (0xD04, 4) => {
                if value & 1 << 28 != 0 {
                    self.pend(PEND_SV);
                }
                if value & 1 << 26 != 0 {
                    self.pend(SYS_TICK);
                }
                if value & !(1 << 28 | 1 << 27 | 1 << 26 | 1 << 25) != 0 {
                    return None;
                }
            }
            (0xD08, 4) => self.vtor = value,
            (0xD0C, 4) if value >> 16 == 0x05FA => self.reset_request |= value & 4 != 0,
            (0xD10, 4) if value & !0x10 == 0 => self.scr = value,
            (0xD18..=0xD23, 1) => self.priority[4 + (offset - 0xD18) as usize] = value as u8 & 0xF0,
            (0xD94, 4) if value & !7 == 0 => self.mpu[0] = value,
            (0xD9C | 0xDA0, 4) => self.mpu[(offset as usize - 0xD94) / 4] = value,
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> Nvic {
        let mut nvic = Nvic::default();
        nvic.write(0x100, 4, 1 << 5 | 1 << 9);
        nvic.write(0x405, 1, 0x40);
        nvic.write(0x409, 1, 0x20);
        nvic
    }

    #[test]
    fn the_most_urgent_enabled_line_comes_first_and_lower_ones_wait() {
        let mut nvic = two();
        nvic.lines = 1 << 5 | 1 << 6;
        assert_eq!(nvic.next(false, 0), Some(21), "6 is not enabled");
        nvic.enter(21);
        assert_eq!(nvic.next(false, 0), None, "its own line does not nest");
        nvic.lines |= 1 << 9;
        assert_eq!(nvic.next(false, 0), Some(25), "a more urgent one does");
        nvic.enter(25);
        assert_eq!(nvic.leave(), Some(25));
        nvic.lines = 1 << 5;
        assert_eq!(nvic.next(false, 0), None);
        assert_eq!(nvic.leave(), Some(21));
        assert_eq!(
            nvic.next(false, 0),
            Some(21),
            "a line that stayed high comes again"
        );
    }

    #[test]
    fn masks_hold_back_and_still_wake() {
        let mut nvic = two();
        nvic.lines = 1 << 5;
        assert_eq!(nvic.next(true, 0), None);
        assert_eq!(nvic.next(false, 0x40), None);
        assert_eq!(nvic.next(false, 0x50), Some(21));
        assert!(nvic.wakes());
        nvic.write(0x180, 4, 1 << 5);
        assert!(!nvic.wakes());
        nvic.lines = 0;
        nvic.write(0x100, 4, 1 << 5);
        assert!(!nvic.wakes());
        nvic.write(0x200, 4, 1 << 5);
        assert!(nvic.wakes(), "software can pend");
        nvic.write(0x280, 4, 1 << 5);
        assert!(!nvic.wakes());
    }

    #[test]
    fn registers_that_no_image_uses_are_refused() {
        let mut nvic = Nvic::default();
        assert_eq!(nvic.read(0xD88, 4), None);
        assert_eq!(nvic.write(0x10, 4, 1), None);
        assert_eq!(nvic.write(0xD0C, 4, 4), None, "AIRCR without its key");
        assert!(!nvic.reset_request);
        assert_eq!(nvic.write(0xD0C, 4, 0x05FA_0004), Some(()));
        assert!(nvic.reset_request);
    }
}
