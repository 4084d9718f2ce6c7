//! State accessible to the engine's hooks: peripherals, interrupts, and the count of time.

use std::collections::BTreeMap;

use super::TRACE;
use super::blocks::Blocks;
use crate::nvic::Nvic;
use crate::soc::Soc;

/// Interrupts that begin a tick; all others only bring bytes.
const TICK_LINES: [usize; 2] = [16 + 18, 16 + 28];

/// A period between two sleeps.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Awake {
    /// Instructions executed before this period.
    since: u64,
    ticks: u32,
    others: u32,
}

/// Inputs as the program read them.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Seen {
    /// Tick edge.
    pub(crate) edge: u64,
    /// Converter result.
    pub(crate) adc: u16,
    /// Levels of port A.
    pub(crate) port_a: u32,
    /// Quadrature counter, 16 bits.
    pub(crate) count: u32,
}

/// The blocks of the tick that took the most instructions.
#[derive(Debug, Default)]
pub(crate) struct Profile {
    /// Address and size of each block since the processor woke.
    pub(super) trace: Vec<(u32, u32)>,
    /// The same for the worst tick.
    worst: Vec<(u32, u32)>,
    /// Number of instructions of the worst tick.
    instructions: u64,
    /// The worst tick has not been reported yet.
    fresh: bool,
}

impl Profile {
    fn tick(&mut self, instructions: u64) {
        if instructions > self.instructions {
            self.instructions = instructions;
            self.worst.clone_from(&self.trace);
            self.fresh = true;
        }
    }
}

/// Everything that the hooks can access.
pub(crate) struct State {
    pub(crate) soc: Soc,
    pub(crate) nvic: Nvic,
    pub(crate) cycle: u64,
    pub(super) due: u64,
    /// Cycles in which nothing was executed.
    pub(super) idle: u64,
    pub(super) refused: Option<String>,
    pub(super) returns: bool,
    pub(super) service_call: bool,
    /// An exception of the engine for which there is no handler here.
    pub(super) fault: Option<u32>,
    /// The last access that nothing answered.
    pub(super) unanswered: String,
    /// Faults have been injected, so the program must handle a hard fault.
    pub(crate) tolerant: bool,
    /// No pin that drives something may ever leave its idle state.
    pub(crate) outputs_forbidden: bool,
    /// What the program read in the newest processed tick.
    pub(crate) seen: Seen,
    /// Stop as soon as the tick timer runs.
    pub(super) await_tick: bool,
    pub(super) trace: [u32; TRACE],
    pub(super) trace_at: usize,
    pub(super) blocks: Blocks,
    pub(super) awake: Awake,
    /// Instructions of the newest uninterrupted tick, from waking at its edge until the watchdog is fed.
    pub(crate) tick_instructions: u64,
    /// The longest waking period so far.
    pub(crate) longest_awake: u64,
    /// Instructions from the newest reset until all outputs were driven low.
    pub(crate) outputs_low_after: Option<u64>,
    /// Instructions at the newest reset.
    reset_at: u64,
    /// Kept if profiles are requested.
    pub(crate) profile: Option<Profile>,
    /// The main loop is stopped.
    pub(crate) stop_main_loop: bool,
    /// The processor is stopped.
    pub(crate) stop_processor: bool,
}

impl State {
    /// State at power-up.
    pub(super) fn new(soc: Soc, blocks: Blocks) -> Self {
        Self {
            soc,
            nvic: Nvic::default(),
            cycle: 0,
            due: 0,
            idle: 0,
            refused: None,
            returns: false,
            service_call: false,
            fault: None,
            unanswered: String::new(),
            tolerant: false,
            outputs_forbidden: false,
            seen: Seen::default(),
            await_tick: false,
            trace: [0; TRACE],
            trace_at: 0,
            blocks,
            awake: Awake::default(),
            tick_instructions: 0,
            longest_awake: 0,
            outputs_low_after: None,
            reset_at: 0,
            profile: None,
            stop_main_loop: false,
            stop_processor: false,
        }
    }

    /// Resets peripherals and interrupts, and clears all injected stops.
    pub(super) fn reset(&mut self, soc: Soc) {
        self.soc = soc;
        self.nvic = Nvic::default();
        self.stop_main_loop = false;
        self.stop_processor = false;
        self.reset_at = self.retired();
        self.outputs_low_after = None;
        self.awake = Awake {
            since: self.retired(),
            ..Awake::default()
        };
    }

    /// Instructions executed since power-up.
    pub(crate) fn retired(&self) -> u64 {
        self.cycle - self.idle
    }

    /// Address, instructions in one execution and number of executions of every block of the worst tick, by
    /// address; `None` if profiles are off or the tick is not new.
    pub(crate) fn worst_tick(&mut self) -> Option<BTreeMap<u32, (u64, u32)>> {
        let profile = self.profile.as_mut()?;
        if !std::mem::take(&mut profile.fresh) {
            return None;
        }
        let mut counts = BTreeMap::new();
        for (address, size) in &profile.worst {
            let instructions = self.blocks.instructions(*address, *size);
            counts.entry(*address).or_insert((instructions, 0)).1 += 1;
        }
        Some(counts)
    }

    /// Instructions since the processor woke.
    fn awake_instructions(&self) -> u64 {
        self.retired() - self.awake.since
    }

    /// Lets time pass without instructions.
    pub(super) fn pass(&mut self, cycles: u64) {
        self.cycle += cycles;
        self.idle += cycles;
    }

    pub(super) fn refuse(&mut self, what: String) {
        self.refused.get_or_insert(what);
        self.due = 0;
    }

    /// After an access to a peripheral, determines what is due, and when.
    pub(super) fn touched(&mut self) {
        if self.outputs_forbidden
            && let Some(pin) = self.soc.power_pin_in_use()
        {
            self.refuse(format!("the program drives {pin}, which it must never do"));
        }
        if self.outputs_low_after.is_none() && self.soc.outputs_are_low() {
            self.outputs_low_after = Some(self.retired() - self.reset_at);
        }
        // Bytes may be processed before the next sleep; they are not part of the tick.
        if self.soc.watchdog.take_fed() && self.awake.ticks == 1 && self.awake.others == 0 {
            self.tick_instructions = self.awake_instructions();
            if let Some(profile) = &mut self.profile {
                profile.tick(self.tick_instructions);
            }
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

    pub(super) fn sleep(&mut self) {
        self.longest_awake = self.longest_awake.max(self.awake_instructions());
        if let Some(profile) = &mut self.profile {
            profile.trace.clear();
        }
        let since = self.retired();
        let fresh = Awake {
            since,
            ..Awake::default()
        };
        let awake = std::mem::replace(&mut self.awake, fresh);
        if awake.ticks > 0 {
            self.seen = Seen {
                edge: self.soc.edge.unwrap_or(0),
                adc: self.soc.adc.read,
                port_a: self.soc.ports[0].read,
                count: self.soc.encoder_timer().counted,
            };
        }
    }

    pub(super) fn woken_by(&mut self, exception: usize) {
        if TICK_LINES.contains(&exception) {
            self.awake.ticks += 1;
        } else {
            self.awake.others += 1;
        }
    }
}
