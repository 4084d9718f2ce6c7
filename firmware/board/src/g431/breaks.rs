//! Hardware that takes the outputs away when the processor cannot: breaks of the timers, and a
//! guard below the stack.
//!
//! The break of TIM1 and TIM8 is raised, besides by their pins, by sources that the system configuration
//! connects to it (RM0440 §10.2.8). It clears MOE: the pins go to their idle level, low, in a few nanoseconds
//! and without an instruction. These connections last until a reset.
//!
//! | connection | raised by | without it |
//! |---|---|---|
//! | CLL | a locked-up processor | the valves keep their duty until the watchdog, 54 ms |
//! | PVDL | the supply below the detector's level | the interrupt, if the processor still runs |
//! | SPL | a parity error of SRAM1 or CCM, where the option SRAM_PE is programmed | the NMI |
//!
//! The double-error connection (ECCL) is left out: a torn word of the parameter store raises it
//! in a normal start.

use super::pac;

/// The last 32 KiB below the RAM, where the stack would go when it overflows. No memory that a program uses
/// is there: the unique id and the option bytes are below it.
const GUARD: u32 = 0x1FFF_8000;
/// Size field of a region: 2^(n + 1) bytes.
const GUARD_SIZE: u32 = 14;
/// Bits of MPU_RBAR, MPU_RASR and MPU_CTRL (ARMv7-M B3.5).
const VALID: u32 = 1 << 4;
const EXECUTE_NEVER: u32 = 1 << 28;
const ENABLE: u32 = 1;
const DEFAULT_MAP: u32 = 1 << 2;

/// Connects the breaks; the clock of the system configuration is on.
#[cfg(feature = "outputs")]
pub(super) fn connect() {
    pac::SYSCFG.cfgr2().write(|r| {
        r.set_cll(true);
        r.set_pvdl(true);
        r.set_spl(true);
    });
}

/// Whether RAM has a parity error. This is unknown until the clock of the system configuration is on.
pub(super) fn ram_is_damaged() -> bool {
    pac::RCC.apb2enr().read().syscfgen() && pac::SYSCFG.cfgr2().read().spf()
}

/// Guards the memory below the stack: an access there is a processor fault. The fault's handler runs without
/// the guard.
pub(super) fn guard_stack() {
    // SAFETY: before the main loop, and nothing else uses the unit; no memory of the program
    // lies in the region.
    unsafe {
        let mpu = &cortex_m::Peripherals::steal().MPU;
        mpu.rbar.write(GUARD | VALID);
        mpu.rasr.write(EXECUTE_NEVER | GUARD_SIZE << 1 | ENABLE);
        mpu.ctrl.write(ENABLE | DEFAULT_MAP);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}
