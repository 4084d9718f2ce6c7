//! Callbacks of the engine: accesses to peripherals, every block, and accesses that nothing answers.

use unicorn_engine::{
    HookType, MemType, Prot, RegisterARM as R, TlbEntry, TlbType, Unicorn, uc_error,
};

use super::state::State;
use super::{Machine, THUMB, TRACE};
use crate::image::{RAM_BASE, RAM_SIZE};
use crate::nvic::NON_MASKABLE;
use crate::soc::flash::{STORE_BASE, STORE_SIZE};

/// The engine's exception numbers for ARM (`EXCP_…` of QEMU).
const EXCP_SWI: u32 = 2;
const EXCP_EXCEPTION_EXIT: u32 = 8;

impl Machine {
    pub(super) fn hooks(&mut self) -> Result<(), uc_error> {
        let uc = &mut self.uc;
        for (base, size) in [
            (0x1FFF_7000_u32, 0x1000),
            (0x4000_0000, 0x3_0000),
            (0x4800_0000, 0x2000),
            (0x5000_0000, 0x1000),
        ] {
            uc.mmio_map(
                u64::from(base),
                size,
                Some(
                    move |uc: &mut Unicorn<'_, State>, offset: u64, size: usize| {
                        let state = uc.get_data_mut();
                        let cycle = state.cycle;
                        match state.soc.read(base + offset as u32, size, cycle) {
                            Ok(value) => {
                                // A read can only clear flags, so nothing becomes due sooner.
                                state.nvic.lines = state.soc.lines();
                                if state.soc.serial.waits() {
                                    state.due = 0;
                                }
                                u64::from(value)
                            }
                            Err(what) => {
                                state.refuse(what);
                                0
                            }
                        }
                    },
                ),
                Some(
                    move |uc: &mut Unicorn<'_, State>, offset: u64, size: usize, value: u64| {
                        let state = uc.get_data_mut();
                        let cycle = state.cycle;
                        let address = base + offset as u32;
                        match state.soc.write(address, size, value as u32, cycle) {
                            Ok(()) => state.touched(),
                            Err(what) => state.refuse(what),
                        }
                    },
                ),
            )?;
        }
        uc.mmio_map(
            u64::from(STORE_BASE),
            STORE_SIZE as u64,
            Some(|uc: &mut Unicorn<'_, State>, offset: u64, size: usize| {
                let state = uc.get_data_mut();
                let value = state.soc.flash.load(offset as usize, size);
                if state.soc.flash.take_double_error() {
                    state.nvic.pend(NON_MASKABLE);
                    state.touched();
                }
                u64::from(value)
            }),
            Some(
                |uc: &mut Unicorn<'_, State>, offset: u64, size: usize, value: u64| {
                    let state = uc.get_data_mut();
                    let done = state.soc.flash.program(offset as usize, size, value as u32);
                    match done {
                        Ok(()) => state.touched(),
                        Err(_) => state.refuse(format!(
                            "write to the flash memory at {:#010x} out of order",
                            u64::from(STORE_BASE) + offset
                        )),
                    }
                },
            ),
        )?;
        uc.mmio_map(
            0xE000_E000,
            0x1000,
            Some(|uc: &mut Unicorn<'_, State>, offset: u64, size: usize| {
                let state = uc.get_data_mut();
                match state.nvic.read(offset as u32, size) {
                    Some(value) => u64::from(value),
                    None => {
                        state.refuse(format!("read of PPB {:#010x}", 0xE000_E000 + offset));
                        0
                    }
                }
            }),
            Some(
                |uc: &mut Unicorn<'_, State>, offset: u64, size: usize, value: u64| {
                    let state = uc.get_data_mut();
                    match state.nvic.write(offset as u32, size, value as u32) {
                        Some(()) => state.touched(),
                        None => state.refuse(format!(
                            "write of {value:#x} to PPB {:#010x}",
                            0xE000_E000 + offset
                        )),
                    }
                },
            ),
        )?;
        uc.add_block_hook(1, 0, |uc, address, size| {
            let state = uc.get_data_mut();
            if state.cycle >= state.due {
                // Stopped before the block is executed.
                let _ = uc.emu_stop();
                return;
            }
            state.cycle += state.blocks.instructions(address as u32, size);
            state.trace[state.trace_at % TRACE] = address as u32;
            state.trace_at = state.trace_at.wrapping_add(1);
            if let Some(profile) = &mut state.profile {
                profile.trace.push((address as u32, size));
            }
        })?;
        // Cover everything but RAM: where there is a memory hook, every store takes the slow path.
        let ram_end = u64::from(RAM_BASE + RAM_SIZE);
        for (begin, end) in [(0, u64::from(RAM_BASE) - 1), (ram_end, u64::from(u32::MAX))] {
            uc.add_mem_hook(
                HookType::MEM_INVALID,
                begin,
                end,
                |uc, kind, address, size, value| {
                    uc.get_data_mut().unanswered =
                        format!("{kind:?} of {size} bytes at {address:#010x} (value {value:#x})");
                    false
                },
            )?;
        }
        // Virtual addresses are physical ones. Unlike in the default memory map, RAM is not executable;
        // otherwise the engine would look for code at every store.
        uc.ctl_set_tlb_type(TlbType::VIRTUAL)?;
        uc.add_tlb_hook(0, u64::from(u32::MAX), move |uc, address, kind| {
            if kind != MemType::FETCH {
                // Before this call, the engine has put the instruction's IT state back into the registers,
                // where it is zero within a block. If it stayed there, the next block would be treated as
                // conditional.
                let _ = uc.reg_write(R::EPSR, THUMB);
            }
            let ram = (u64::from(RAM_BASE)..ram_end).contains(&address);
            let perms = if ram {
                Prot::READ | Prot::WRITE
            } else {
                Prot::ALL
            };
            Some(TlbEntry {
                paddr: address,
                perms,
            })
        })?;
        uc.add_intr_hook(|uc, number| {
            let state = uc.get_data_mut();
            match number {
                EXCP_EXCEPTION_EXIT => state.returns = true,
                EXCP_SWI => state.service_call = true,
                _ => state.fault = Some(number),
            }
            let _ = uc.emu_stop();
        })?;
        Ok(())
    }
}
