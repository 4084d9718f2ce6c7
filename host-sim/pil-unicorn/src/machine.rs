//! The processor: Unicorn executes instructions; exceptions, sleep and time
//! are here.
//!
//! Time is counted in processor cycles, one per instruction. Events of the
//! peripherals and interrupts are taken between basic blocks: an interrupt
//! comes some tens of cycles late at most, and every run is the same to the bit.

mod exceptions;

use unicorn_engine::{
    Arch, ArmCpuModel, HookType, MemType, Mode, Prot, RegisterARM as R, TlbEntry, TlbType, Unicorn,
    uc_error,
};

use crate::image::{FLASH_BASE, FLASH_SIZE, Image, RAM_BASE, RAM_SIZE};
use crate::nvic::{HARD_FAULT, Nvic, SV_CALL};
use crate::soc::flash::{STORE_BASE, STORE_SIZE};
use crate::soc::{Soc, Transfer};

/// Interrupt numbers of the engine for ARM (`EXCP_…` of QEMU).
const EXCP_SWI: u32 = 2;
const EXCP_EXCEPTION_EXIT: u32 = 8;

/// Interrupts that begin a tick and those that only bring bytes.
const TICK_LINES: [usize; 2] = [16 + 18, 16 + 28];

/// Blocks kept for messages.
const TRACE: usize = 16;

/// EPSR outside of an IT block.
const THUMB: u64 = 1 << 24;

/// Address at which no block begins: run until stopped. The engine looks it up
/// at every stop, so it is executable memory, of a page that the part lacks.
const NOWHERE_PAGE: u64 = 0x1000_0000;
const NOWHERE: u64 = NOWHERE_PAGE + 0x800;

/// How far to run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Until {
    /// To the instant, whatever the processor does.
    Cycle,
    /// To the instant, then on until the processor sleeps, at most to this
    /// one [ns].
    Asleep(u64),
}

/// Why the machine stopped before its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stop {
    /// It did not.
    Time,
    /// A system reset was asked for, with the flag in RCC_CSR.
    Reset(u32),
    /// The supply failed in a save.
    PowerFailed,
    /// The tick timer has been started.
    TickStarted,
}

/// Instruction counts of one stretch between two sleeps.
#[derive(Debug, Clone, Copy, Default)]
struct Awake {
    instructions: u64,
    ticks: u32,
    others: u32,
}

/// Inputs as the program read them.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Seen {
    /// Edge of the tick.
    pub(crate) edge: u64,
    /// Converter.
    pub(crate) adc: u16,
    /// Levels of port A.
    pub(crate) port_a: u32,
    /// Quadrature counter, 16 bits.
    pub(crate) count: u32,
}

/// All that hooks reach.
pub(crate) struct State {
    pub(crate) soc: Soc,
    pub(crate) nvic: Nvic,
    pub(crate) cycle: u64,
    due: u64,
    /// Instructions executed since power-up.
    pub(crate) retired: u64,
    refused: Option<String>,
    returns: bool,
    service_call: bool,
    /// An exception of the engine that no handler here knows.
    fault: Option<u32>,
    /// The last access that nothing answered.
    unanswered: String,
    /// Faults have been injected: a hard fault is the program's to handle.
    pub(crate) tolerant: bool,
    /// What the program read in the last tick that was worked off.
    pub(crate) seen: Seen,
    /// Stop as soon as the tick timer runs.
    await_tick: bool,
    trace: [u32; TRACE],
    trace_at: usize,
    /// (bytes, instructions) of the block at each half-word of flash.
    blocks: Vec<(u32, u32)>,
    flash: Vec<u8>,
    awake: Awake,
    /// Instructions of the newest tick that nothing interrupted: from waking at its
    /// edge until the watchdog is fed.
    pub(crate) tick_instructions: u64,
    /// Longest stretch so far.
    pub(crate) longest_awake: u64,
    /// The main loop stands still.
    pub(crate) stop_main_loop: bool,
    /// The processor stands still.
    pub(crate) stop_processor: bool,
}

impl State {
    /// Instructions in a block; blocks in flash are counted once.
    fn instructions(&mut self, address: u32, size: u32) -> u32 {
        let offset = address.wrapping_sub(FLASH_BASE);
        let index = (offset / 2) as usize;
        let Some(known) = self.blocks.get(index).copied() else {
            // In RAM: not cached, and its bytes are not at hand; two bytes each.
            return size / 2;
        };
        if known.0 == size {
            return known.1;
        }
        let mut at = offset as usize;
        let end = at + size as usize;
        let mut count = 0;
        while at < end {
            let half = u16::from_le_bytes([self.flash[at], self.flash[at + 1]]);
            at += if half >> 11 >= 0b1_1101 { 4 } else { 2 };
            count += 1;
        }
        self.blocks[index] = (size, count);
        count
    }

    fn refuse(&mut self, what: String) {
        self.refused.get_or_insert(what);
        self.due = 0;
    }

    /// After an access to a peripheral: what is due, and when.
    fn touched(&mut self) {
        // Bytes may be worked off before the next sleep; they are no part of the tick.
        if self.soc.watchdog.take_fed() && self.awake.ticks == 1 && self.awake.others == 0 {
            self.tick_instructions = self.awake.instructions;
        }
        self.nvic.lines = self.soc.lines();
        let attention = self.nvic.reset_request
            || self.soc.flash.stall_ns > 0
            || self.soc.flash.power_failed
            || self.await_tick && self.soc.tick_timer().runs()
            || self.nvic.next(false, 0).is_some();
        self.due = if attention {
            0
        } else {
            self.due.min(self.soc.next_at())
        };
    }

    fn sleep(&mut self) {
        let awake = std::mem::take(&mut self.awake);
        self.longest_awake = self.longest_awake.max(awake.instructions);
        if awake.ticks > 0 {
            self.seen = Seen {
                edge: self.soc.edge.unwrap_or(0),
                adc: self.soc.adc.read,
                port_a: self.soc.ports[0].read,
                count: self.soc.encoder_timer().counted,
            };
        }
    }

    fn woken_by(&mut self, exception: usize) {
        if TICK_LINES.contains(&exception) {
            self.awake.ticks += 1;
        } else {
            self.awake.others += 1;
        }
    }
}

type Engine = Unicorn<'static, State>;

/// A processor with its memory and peripherals.
pub(crate) struct Machine {
    uc: Engine,
    asleep: bool,
}

/// Pattern that RAM holds at power-up, and that the start-up code of the images
/// paints their stack with; the watermark looks for it.
const PAINT: u8 = 0xCC;

fn engine(error: uc_error) -> String {
    format!("the engine refuses: {error:?}")
}

impl Machine {
    /// A machine with `image` in flash, in reset.
    ///
    /// # Errors
    /// A sentence of the engine.
    pub(crate) fn new(image: &Image, soc: Soc) -> Result<Self, String> {
        let state = State {
            soc,
            nvic: Nvic::default(),
            cycle: 0,
            due: 0,
            retired: 0,
            refused: None,
            returns: false,
            service_call: false,
            fault: None,
            unanswered: String::new(),
            tolerant: false,
            seen: Seen::default(),
            await_tick: false,
            trace: [0; TRACE],
            trace_at: 0,
            blocks: vec![(0, 0); (FLASH_SIZE / 2) as usize],
            flash: image.flash.clone(),
            awake: Awake::default(),
            tick_instructions: 0,
            longest_awake: 0,
            stop_main_loop: false,
            stop_processor: false,
        };
        // The mode for M-class processors would override the model with an M33.
        let mut uc = Unicorn::new_with_data(Arch::ARM, Mode::THUMB, state).map_err(engine)?;
        uc.ctl_set_cpu_model(ArmCpuModel::CORTEX_M4 as i32)
            .map_err(engine)?;
        let code = FLASH_SIZE as usize - STORE_SIZE;
        uc.mem_map(u64::from(FLASH_BASE), code as u64, Prot::READ | Prot::EXEC)
            .map_err(engine)?;
        uc.mem_write(u64::from(FLASH_BASE), &image.flash[..code])
            .map_err(engine)?;
        uc.mem_map(NOWHERE_PAGE, 0x1000, Prot::READ | Prot::EXEC)
            .map_err(engine)?;
        // Nothing of an image is executed from RAM; the engine stores faster to
        // where no code can be.
        let data = Prot::READ | Prot::WRITE;
        uc.mem_map(u64::from(RAM_BASE), u64::from(RAM_SIZE), data)
            .map_err(engine)?;
        let mut machine = Self { uc, asleep: false };
        machine.hooks().map_err(engine)?;
        machine.paint()?;
        machine.start()?;
        Ok(machine)
    }

    fn hooks(&mut self) -> Result<(), uc_error> {
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
                                // A read takes flags away at most: nothing is due sooner.
                                state.nvic.lines = state.soc.lines();
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
                u64::from(uc.get_data().soc.flash.load(offset as usize, size))
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
            let count = u64::from(state.instructions(address as u32, size));
            state.cycle += count;
            state.retired += count;
            state.awake.instructions += count;
            state.trace[state.trace_at % TRACE] = address as u32;
            state.trace_at += 1;
        })?;
        // Around RAM: where a hook of memory stands, every store takes the slow way.
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
        // Addresses are what they are. Of the default memory map this leaves out
        // that RAM can be executed: the engine would look for code at every store.
        uc.ctl_set_tlb_type(TlbType::VIRTUAL)?;
        uc.add_tlb_hook(0, u64::from(u32::MAX), move |uc, address, kind| {
            if kind != MemType::FETCH {
                // Before it asks, the engine has put the IT state of the instruction
                // back into the registers, where it is zero within a block; left
                // there, the next block would be taken for conditional.
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

    fn paint(&mut self) -> Result<(), String> {
        let ram = vec![PAINT; RAM_SIZE as usize];
        self.uc.mem_write(u64::from(RAM_BASE), &ram).map_err(engine)
    }

    /// Registers as after reset.
    fn start(&mut self) -> Result<(), String> {
        let mut vectors = [0; 8];
        let base = u64::from(FLASH_BASE);
        self.uc.mem_read(base, &mut vectors).map_err(engine)?;
        let word = |i: usize| {
            u32::from_le_bytes([vectors[i], vectors[i + 1], vectors[i + 2], vectors[i + 3]])
        };
        for register in [
            R::PRIMASK,
            R::BASEPRI,
            R::FAULTMASK,
            R::CONTROL,
            R::IPSR,
            R::APSR_NZCV,
        ] {
            self.set(register, 0)?;
        }
        self.set(R::SP, word(0))?;
        self.set(R::LR, u32::MAX)?;
        self.set(R::PC, word(4) | 1)?;
        self.asleep = false;
        Ok(())
    }

    fn get(&self, register: R) -> Result<u32, String> {
        let value = self.uc.reg_read(register).map_err(engine)?;
        Ok(value as u32)
    }

    fn set(&mut self, register: R, value: u32) -> Result<(), String> {
        self.uc
            .reg_write(register, u64::from(value))
            .map_err(engine)
    }

    /// What hooks and peripherals hold.
    pub(crate) fn state(&self) -> &State {
        self.uc.get_data()
    }

    /// What hooks and peripherals hold, to be changed.
    pub(crate) fn state_mut(&mut self) -> &mut State {
        self.uc.get_data_mut()
    }

    /// A system reset: processor and peripherals start anew, RAM keeps its
    /// contents unless the power was away.
    ///
    /// # Errors
    /// A sentence of the engine.
    pub(crate) fn reset(&mut self, cause: u32, power_was_away: bool) -> Result<(), String> {
        let state = self.uc.get_data_mut();
        let mut soc = Soc::new(
            std::mem::take(&mut state.soc.flash.store),
            state.soc.unique_id,
            state.soc.rcc.crystal,
            cause,
        );
        soc.time = state.soc.time;
        soc.time.clock(state.cycle, soc.rcc.hclk_hz());
        for (fresh, old) in soc.ports.iter_mut().zip(&state.soc.ports) {
            fresh.outside = old.outside;
            fresh.driven = old.driven;
        }
        soc.driver_timeouts = state.soc.driver_timeouts;
        soc.wiper = state.soc.wiper;
        state.soc = soc;
        state.nvic = Nvic::default();
        state.stop_main_loop = false;
        state.stop_processor = false;
        state.awake = Awake::default();
        if power_was_away {
            self.paint()?;
        }
        self.start()
    }

    /// Reads memory.
    ///
    /// # Errors
    /// A sentence of the engine.
    pub(crate) fn memory(&self, address: u32, bytes: &mut [u8]) -> Result<(), String> {
        self.uc.mem_read(u64::from(address), bytes).map_err(engine)
    }

    /// Writes memory.
    ///
    /// # Errors
    /// A sentence of the engine.
    pub(crate) fn set_memory(&mut self, address: u32, bytes: &[u8]) -> Result<(), String> {
        self.uc.mem_write(u64::from(address), bytes).map_err(engine)
    }

    /// Lowest address in `bottom..top` that is not painted any more.
    pub(crate) fn watermark(&self, bottom: u32, top: u32) -> Result<u32, String> {
        let mut stack = vec![0; (top - bottom) as usize];
        self.memory(bottom, &mut stack)?;
        let free = stack.iter().take_while(|b| **b == PAINT).count();
        Ok((bottom + free as u32) & !3)
    }

    /// Whether the processor sleeps, or was stopped for good.
    pub(crate) fn rests(&self) -> bool {
        let state = self.state();
        self.asleep || state.stop_processor || state.stop_main_loop
    }

    /// Runs to `ns`. Unless `started`, stops as soon as the tick timer runs.
    ///
    /// # Errors
    /// A sentence that says what stopped the emulation for good.
    pub(crate) fn run(&mut self, ns: u64, until: Until, started: bool) -> Result<Stop, String> {
        self.uc.get_data_mut().await_tick = !started;
        loop {
            // Anew each time: the clock may have changed.
            let time = self.uc.get_data().soc.time;
            let target = time.cycle_of(ns);
            let until = match until {
                Until::Cycle => target,
                Until::Asleep(ns) => time.cycle_of(ns),
            };
            if let Some(stop) = self.service(until)? {
                return Ok(stop);
            }
            let state = self.uc.get_data();
            if !started && state.soc.tick_timer().runs() {
                return Ok(Stop::TickStarted);
            }
            if self.take_exception()? {
                self.asleep = false;
                continue;
            }
            let state = self.uc.get_data();
            let idle = self.asleep
                || state.stop_processor
                || state.stop_main_loop && !state.nvic.in_handler();
            let limit = if idle { target } else { until };
            if state.cycle >= limit {
                return Ok(Stop::Time);
            }
            let next = state.soc.next_at().min(self.watchdog_cycle());
            if idle {
                self.uc.get_data_mut().cycle = next.min(limit).max(state.cycle);
                continue;
            }
            self.execute(limit.min(next))?;
        }
    }

    fn watchdog_cycle(&self) -> u64 {
        let soc = &self.uc.get_data().soc;
        soc.watchdog
            .bites_at_ns()
            .map_or(u64::MAX, |ns| soc.time.cycle_of(ns))
    }

    /// Carries out all events that are due, none beyond `horizon`.
    fn service(&mut self, horizon: u64) -> Result<Option<Stop>, String> {
        loop {
            let state = self.uc.get_data_mut();
            if let Some(what) = state.refused.take() {
                return Err(what);
            }
            if state.nvic.reset_request {
                return Ok(Some(Stop::Reset(crate::soc::rcc::SOFTWARE_RESET)));
            }
            if state.soc.flash.power_failed {
                return Ok(Some(Stop::PowerFailed));
            }
            // The flash memory is being written: nothing can be fetched.
            let time = state.soc.time;
            state.cycle += state
                .soc
                .flash
                .take_stall(state.cycle, |ns| time.cycles(ns));
            let cycle = state.cycle.min(horizon);
            let stepped = state.soc.step(cycle);
            if let Some(at) = stepped {
                while let Some(transfer) = self.uc.get_data_mut().soc.transfer() {
                    self.carry(transfer, at)?;
                }
                continue;
            }
            if self.watchdog_cycle() <= cycle {
                return Ok(Some(Stop::Reset(crate::soc::rcc::WATCHDOG_RESET)));
            }
            // A request that software has just enabled.
            let Some(transfer) = self.uc.get_data_mut().soc.transfer() else {
                return Ok(None);
            };
            self.carry(transfer, cycle)?;
        }
    }

    fn carry(&mut self, transfer: Transfer, at: u64) -> Result<(), String> {
        match transfer {
            Transfer::Store { address, byte } => self.set_memory(address, &[byte]),
            Transfer::Load {
                channel,
                address,
                peripheral,
            } => {
                let soc = &self.uc.get_data().soc;
                let unit = soc.dma.channels[channel].unit() as usize;
                let mut bytes = [0; 4];
                self.memory(address, &mut bytes[..unit]).map_err(|e| {
                    format!("DMA1 channel {} from {address:#010x}: {e}", channel + 1)
                })?;
                let value = u32::from_le_bytes(bytes);
                let soc = &mut self.uc.get_data_mut().soc;
                soc.write(
                    peripheral,
                    unit.max(if peripheral & 0x3FF == 0x28 { 1 } else { 4 }),
                    value,
                    at,
                )
            }
        }
    }

    /// Executes instructions until cycle `due` or something happens.
    fn execute(&mut self, due: u64) -> Result<(), String> {
        let state = self.uc.get_data_mut();
        // While an exception waits behind PRIMASK, look after every block.
        let masked = state.nvic.next(false, 0).is_some();
        state.due = if masked { state.cycle + 1 } else { due };
        let pc = u64::from(self.get(R::PC)? | 1);
        let result = self.uc.emu_start(pc, NOWHERE, 0, 0);
        let pc = self.get(R::PC)?;
        let state = self.uc.get_data_mut();
        if std::mem::take(&mut state.service_call) {
            state.nvic.pend(SV_CALL);
            return Ok(());
        }
        if std::mem::take(&mut state.returns) || pc >= 0xFFFF_FFE0 {
            return self.leave();
        }
        if state.refused.is_some() {
            return Ok(());
        }
        if let Some(number) = state.fault.take() {
            return self.hard_fault(&format!("exception {number} of the engine"), pc);
        }
        match result {
            Ok(()) => {
                if state.cycle < state.due {
                    state.sleep();
                    self.asleep = true;
                }
                Ok(())
            }
            Err(error) => {
                let what = format!("{error:?}, {}", std::mem::take(&mut state.unanswered));
                self.hard_fault(&what, pc)
            }
        }
    }

    /// An access that nothing answers, or an instruction that does not exist.
    /// After an injected fault the program handles it; otherwise the image, or
    /// the emulation, is wrong.
    fn hard_fault(&mut self, what: &str, pc: u32) -> Result<(), String> {
        let state = self.uc.get_data();
        if !state.tolerant {
            return Err(format!("{what} at {pc:#010x}"));
        }
        if state.nvic.is_active(HARD_FAULT) {
            // Lock-up: only a reset helps.
            self.uc.get_data_mut().stop_processor = true;
            return Ok(());
        }
        self.enter(HARD_FAULT)
    }

    /// Program counter, and where the processor came by last.
    pub(crate) fn whereabouts(&self, image: &Image) -> (u32, String) {
        let pc = self.get(R::PC).unwrap_or(0);
        let state = self.state();
        let newest = state.trace_at.min(TRACE);
        let blocks: Vec<String> = (1..=newest.min(4))
            .map(|back| image.function(state.trace[(state.trace_at - back) % TRACE]))
            .collect();
        (
            pc,
            format!("in {}, after {}", image.function(pc), blocks.join(" < ")),
        )
    }
}

#[cfg(test)]
mod tests;
