//! The processor: Unicorn executes the instructions; exceptions, sleep and time are modelled here.
//!
//! Time is counted in processor cycles, one per instruction. Events of the peripherals and interrupts are
//! taken between basic blocks. An interrupt is thus at most some tens of cycles late, and every run is the
//! same to the bit.

pub(crate) mod blocks;
mod exceptions;
mod hooks;
mod state;

use unicorn_engine::{Arch, ArmCpuModel, Mode, Prot, RegisterARM as R, Unicorn, uc_error};

use self::blocks::Blocks;
pub(crate) use self::state::Profile;
use self::state::State;
use crate::image::{FLASH_BASE, FLASH_SIZE, Image, RAM_BASE, RAM_SIZE};
use crate::nvic::{HARD_FAULT, NON_MASKABLE, SV_CALL};
use crate::soc::flash::STORE_SIZE;
use crate::soc::syscfg::BreakSource;
use crate::soc::{Soc, Transfer};

/// Number of blocks kept for messages.
const TRACE: usize = 4;

/// EPSR outside an IT block.
const THUMB: u64 = 1 << 24;

/// How far to run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Until {
    /// To the instant, whatever the processor does.
    Cycle,
    /// To the instant, then on until the processor sleeps, but no further than this time [ns].
    Asleep(u64),
}

/// Why the machine stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stop {
    /// It reached its time.
    Time,
    /// A system reset was requested; with its flag in RCC_CSR.
    Reset(u32),
    /// The supply failed during a save.
    PowerFailed,
    /// The tick timer has been started.
    TickStarted,
    /// The program polls its second serial line for bytes, and none are on their way.
    Waits,
}

/// An address where no memory answers.
const NOWHERE: u32 = 0xA000_0000;

type Engine = Unicorn<'static, State>;

/// A processor with its memory and peripherals.
pub(crate) struct Machine {
    uc: Engine,
    asleep: bool,
    /// Bytes stored by DMA that memory does not hold yet: address of the first byte, and consecutive bytes.
    /// Writing single bytes to the engine is slow.
    stored: (u32, Vec<u8>),
}

/// Pattern that RAM holds at power-up, and with which the images' start-up code paints their stack; the
/// watermark looks for it.
const PAINT: u8 = 0xCC;

fn engine(error: uc_error) -> String {
    format!("the engine refuses: {error:?}")
}

impl Machine {
    /// Creates a machine with `image` in flash, in reset.
    ///
    /// # Errors
    /// A sentence from the engine.
    pub(crate) fn new(image: &Image, blocks: Blocks, soc: Soc) -> Result<Self, String> {
        let state = State::new(soc, blocks);
        // The mode for M-class processors would override the model with an M33.
        let mut uc = Unicorn::new_with_data(Arch::ARM, Mode::THUMB, state).map_err(engine)?;
        uc.ctl_set_cpu_model(ArmCpuModel::CORTEX_M4 as i32)
            .map_err(engine)?;
        let code = FLASH_SIZE as usize - STORE_SIZE;
        uc.mem_map(u64::from(FLASH_BASE), code as u64, Prot::READ | Prot::EXEC)
            .map_err(engine)?;
        uc.mem_write(u64::from(FLASH_BASE), &image.flash[..code])
            .map_err(engine)?;
        // Run until stopped: an exit address would be looked up at every stop.
        uc.ctl_exits_enable().map_err(engine)?;
        // Images execute nothing from RAM, and the engine stores faster where there can be no code.
        let data = Prot::READ | Prot::WRITE;
        uc.mem_map(u64::from(RAM_BASE), u64::from(RAM_SIZE), data)
            .map_err(engine)?;
        let mut machine = Self {
            uc,
            asleep: false,
            stored: (0, Vec::new()),
        };
        machine.hooks().map_err(engine)?;
        machine.paint()?;
        machine.start()?;
        Ok(machine)
    }

    fn paint(&mut self) -> Result<(), String> {
        let ram = vec![PAINT; RAM_SIZE as usize];
        self.uc.mem_write(u64::from(RAM_BASE), &ram).map_err(engine)
    }

    /// Sets the registers as after a reset.
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

    /// State shared with hooks and peripherals.
    pub(crate) fn state(&self) -> &State {
        self.uc.get_data()
    }

    /// Mutable state shared with hooks and peripherals.
    pub(crate) fn state_mut(&mut self) -> &mut State {
        self.uc.get_data_mut()
    }

    /// Lets the processor continue where no memory answers, so that it faults and its program handles the
    /// fault.
    ///
    /// # Errors
    /// A sentence from the engine.
    pub(crate) fn derail(&mut self) -> Result<(), String> {
        self.asleep = false;
        self.state_mut().tolerant = true;
        self.set(R::PC, NOWHERE)
    }

    /// A system reset: processor and peripherals restart; RAM keeps its contents unless power was lost.
    ///
    /// # Errors
    /// A sentence from the engine.
    pub(crate) fn reset(&mut self, cause: u32, power_was_away: bool) -> Result<(), String> {
        let state = self.uc.get_data_mut();
        let mut soc = Soc::new(
            std::mem::take(&mut state.soc.flash.store),
            state.soc.unique_id,
            state.soc.rcc.crystal,
            cause,
        );
        soc.flash.torn = std::mem::take(&mut state.soc.flash.torn);
        soc.time = state.soc.time;
        soc.time.clock(state.cycle, soc.rcc.hclk_hz());
        for (fresh, old) in soc.ports.iter_mut().zip(&state.soc.ports) {
            fresh.outside = old.outside;
            fresh.driven = old.driven;
        }
        soc.driver_timeouts = state.soc.driver_timeouts;
        soc.driver_on_us = state.soc.driver_on_us;
        soc.wiper = state.soc.wiper;
        soc.encoder_timer().keep_wheel(state.soc.encoder_timer());
        state.reset(soc);
        self.settle()?;
        if power_was_away {
            self.paint()?;
        }
        self.start()
    }

    /// Reads memory.
    ///
    /// # Errors
    /// A sentence from the engine.
    pub(crate) fn memory(&mut self, address: u32, bytes: &mut [u8]) -> Result<(), String> {
        self.settle()?;
        self.uc.mem_read(u64::from(address), bytes).map_err(engine)
    }

    /// Writes memory.
    ///
    /// # Errors
    /// A sentence from the engine.
    pub(crate) fn set_memory(&mut self, address: u32, bytes: &[u8]) -> Result<(), String> {
        self.settle()?;
        self.uc.mem_write(u64::from(address), bytes).map_err(engine)
    }

    /// Stores a byte for DMA; memory is updated before anything reads it.
    fn store(&mut self, address: u32, byte: u8) -> Result<(), String> {
        let (first, bytes) = &self.stored;
        if address != first.wrapping_add(bytes.len() as u32) {
            self.settle()?;
            self.stored.0 = address;
        }
        self.stored.1.push(byte);
        Ok(())
    }

    /// Writes the bytes stored by DMA to memory.
    fn settle(&mut self) -> Result<(), String> {
        let (first, bytes) = &mut self.stored;
        if bytes.is_empty() {
            return Ok(());
        }
        let written = self.uc.mem_write(u64::from(*first), bytes);
        bytes.clear();
        written.map_err(|e| format!("DMA1 to {first:#010x}: {}", engine(e)))
    }

    /// Lowest address in `bottom..top` that is no longer painted.
    pub(crate) fn watermark(&mut self, bottom: u32, top: u32) -> Result<u32, String> {
        let mut stack = vec![0; (top - bottom) as usize];
        self.memory(bottom, &mut stack)?;
        let free = stack.iter().take_while(|b| **b == PAINT).count();
        Ok((bottom + free as u32) & !3)
    }

    /// Whether the processor sleeps and nothing that it waits for is in progress, or it was stopped for good.
    /// (A tick begins when its inputs are converted; bytes received after its edge wait until then.)
    pub(crate) fn rests(&self) -> bool {
        let state = self.state();
        let waits = state.soc.converts();
        self.asleep && !waits || state.stop_processor || state.stop_main_loop
    }

    /// Runs to `ns`. Unless `started`, stops as soon as the tick timer runs.
    ///
    /// # Errors
    /// A sentence that states what stopped the emulation for good.
    pub(crate) fn run(&mut self, ns: u64, until: Until, started: bool) -> Result<Stop, String> {
        self.uc.get_data_mut().await_tick = !started;
        loop {
            // Recompute each time, because the clock may have changed.
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
            let limit = if idle && self.rests() { target } else { until };
            if state.cycle >= limit {
                return Ok(Stop::Time);
            }
            let next = state.soc.next_at().min(state.soc.bites_at());
            if idle {
                let state = self.uc.get_data_mut();
                state.pass(next.min(limit).saturating_sub(state.cycle));
                continue;
            }
            self.execute(limit.min(next))?;
        }
    }

    /// Carries out all due events, up to `horizon`.
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
            // While the flash memory is being written, nothing can be fetched.
            if state.soc.flash.stall_ns > 0 {
                let (time, cycle) = (state.soc.time, state.cycle);
                let stall = state.soc.flash.take_stall(cycle, |ns| time.cycles(ns));
                state.pass(stall);
            }
            let cycle = state.cycle.min(horizon);
            let stepped = state.soc.step(cycle);
            if let Some(at) = stepped {
                while let Some(transfer) = self.uc.get_data_mut().soc.transfer() {
                    self.carry(transfer, at)?;
                }
                continue;
            }
            if state.soc.bites_at() <= cycle {
                return Ok(Some(Stop::Reset(crate::soc::rcc::WATCHDOG_RESET)));
            }
            // A request that software has just enabled.
            if let Some(transfer) = self.uc.get_data_mut().soc.transfer() {
                self.carry(transfer, cycle)?;
                continue;
            }
            let state = self.uc.get_data_mut();
            if !state.soc.serial.take_wait() {
                return Ok(None);
            }
            // A polling program finds nothing new before the next byte has arrived or left.
            match state.soc.serial.next() {
                None => return Ok(Some(Stop::Waits)),
                Some(at) => state.pass(at.min(horizon).saturating_sub(state.cycle)),
            }
        }
    }

    fn carry(&mut self, transfer: Transfer, at: u64) -> Result<(), String> {
        match transfer {
            Transfer::Store { address, byte } => self.store(address, byte),
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

    /// Executes instructions until cycle `due`, or until something happens.
    fn execute(&mut self, due: u64) -> Result<(), String> {
        self.settle()?;
        let state = self.uc.get_data_mut();
        // While PRIMASK holds back an exception, check after every block.
        let masked = state.nvic.next(false, 0).is_some();
        state.due = if masked { state.cycle + 1 } else { due };
        let pc = u64::from(self.get(R::PC)? | 1);
        let result = self.uc.emu_start(pc, 0, 0, 0);
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

    /// Handles an access that nothing answers, or an instruction that does not exist. After an injected
    /// fault, the program handles it; otherwise the image or the emulation is wrong.
    fn hard_fault(&mut self, what: &str, pc: u32) -> Result<(), String> {
        let state = self.uc.get_data();
        if !state.tolerant {
            return Err(format!("{what} at {pc:#010x}"));
        }
        if state.nvic.is_active(HARD_FAULT) {
            self.lock_up();
            return Ok(());
        }
        self.enter(HARD_FAULT)
    }

    /// The processor faults in its fault handler: it executes nothing more, and only a reset helps.
    pub(crate) fn lock_up(&mut self) {
        let state = self.uc.get_data_mut();
        state.stop_processor = true;
        state.soc.raise_break(BreakSource::LockUp);
    }

    /// Causes a parity error in RAM, in a bit that nobody reads.
    pub(crate) fn ram_parity_error(&mut self) {
        let state = self.uc.get_data_mut();
        state.soc.raise_break(BreakSource::RamParity);
        state.nvic.pend(NON_MASKABLE);
    }

    /// Stops the crystal.
    pub(crate) fn crystal_stops(&mut self) {
        let state = self.uc.get_data_mut();
        if state.soc.crystal_stops(state.cycle) {
            state.nvic.pend(NON_MASKABLE);
        }
    }

    /// Program counter, and the last blocks the processor executed.
    pub(crate) fn whereabouts(&self, image: &Image) -> (u32, String) {
        let pc = self.get(R::PC).unwrap_or(0);
        let state = self.state();
        let blocks: Vec<String> = (1..=state.trace_at.min(TRACE))
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
