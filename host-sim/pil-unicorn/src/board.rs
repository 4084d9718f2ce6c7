//! One emulated board, which answers requests with replies.

mod outputs;
mod timeline;

use std::collections::VecDeque;
use std::path::PathBuf;
use std::rc::Rc;

use wheeleg_remote_link::{
    Figures, Halt, Hello, Hook, LINK_VERSION, Nonvolatile, Power, Ran, Reply, Request, Straps,
    Trip, text,
};

use crate::image::{Image, RAM_BASE, RAM_SIZE};
use crate::machine::blocks::Blocks;
use crate::machine::{Machine, Profile, Stop};
use crate::soc::Soc;
use crate::soc::flash::STORE_SIZE;
use crate::soc::rcc::{BROWN_OUT_RESET, PIN_RESET};
use crate::wiring;

/// Time allowed for the start-up code before the board is considered not to run its tick [ns].
const START_UP_NS: u64 = 100_000_000;
/// Environment variable with the folder for the boards' profiles. Each board writes `IMAGE-ADDRESS.txt` with
/// one line per block of its worst tick: address, instructions in one execution, and number of executions.
const PROFILE: &str = "WHEELEG_PIL_PROFILE";

/// A board that runs one image.
pub(crate) struct Board {
    image: Rc<Image>,
    blocks: Blocks,
    store: Vec<u8>,
    machine: Option<Machine>,
    halted: Option<Halt>,
    running: bool,
    edge_ns: u64,
    first_edge_ns: u64,
    grid_ns: u64,
    /// Wheel position at the two newest edges, newest first: time [ns] and quadrature edges.
    turned: [(u64, i32); 2],
    power: Power,
    /// Transmissions that were announced and have not gone out yet.
    announced: VecDeque<(u64, Vec<u8>)>,
    figures: Figures,
    retired: u64,
    edges: u32,
    trip: Option<Trip>,
    power_lost_in_save: bool,
    /// Whether received bytes remain to be processed.
    owes: bool,
    /// Address set by the straps.
    address: u8,
    /// Folder for the profile of the worst tick.
    profiles: Option<PathBuf>,
}

impl Board {
    /// A board without supply.
    pub(crate) fn new(image: Rc<Image>, blocks: Blocks) -> Self {
        Self {
            image,
            blocks,
            store: vec![0xFF; STORE_SIZE],
            machine: None,
            halted: None,
            running: false,
            edge_ns: 0,
            first_edge_ns: 0,
            grid_ns: 1_000_000,
            turned: [(0, 0); 2],
            power: Power::Good,
            announced: VecDeque::new(),
            figures: Figures::default(),
            retired: 0,
            edges: 0,
            trip: None,
            power_lost_in_save: false,
            owes: false,
            address: 0,
            profiles: std::env::var_os(PROFILE).map(PathBuf::from),
        }
    }

    /// Answers a request.
    pub(crate) fn answer(&mut self, request: Request) -> Reply {
        if let (Some(halt), false) = (&self.halted, matches!(request, Request::Bye)) {
            return Reply::Halted(halt.clone());
        }
        match request {
            Request::Hello { .. } => Reply::Hello(self.hello()),
            Request::Store(part) => self.set_store(&part),
            Request::PowerUp(straps) => self.attempt(|board| board.power_up(&straps)),
            Request::Run(run) => self.attempt(|board| board.run(&run)),
            Request::Hook(hook) => self.hook(&hook),
            Request::ReadStore { offset, length } => self.read_store(offset, length),
            Request::Bye => Reply::Done,
        }
    }

    fn hello(&self) -> Hello {
        let short = |s: &str| {
            let mut out = heapless::String::new();
            let _ = s.chars().try_for_each(|c| out.push(c));
            out
        };
        let host: heapless::String<48> = {
            let mut out = heapless::String::new();
            let _ = out.push_str("STM32G431CB, Unicorn 2.1.5");
            out
        };
        Hello {
            version: LINK_VERSION,
            image: wheeleg_remote_link::Image {
                name: short(&self.image.name),
                digest: self.image.digest,
                clock_hz: 170_000_000,
            },
            host,
            outputs_are_virtual: true,
        }
    }

    fn store(&mut self) -> &mut Vec<u8> {
        match &mut self.machine {
            Some(machine) => &mut machine.state_mut().soc.flash.store,
            None => &mut self.store,
        }
    }

    fn set_store(&mut self, part: &Nonvolatile) -> Reply {
        let start = part.offset as usize;
        match self.store().get_mut(start..start + part.bytes.len()) {
            Some(place) => {
                place.copy_from_slice(&part.bytes);
                Reply::Done
            }
            None => Reply::Refused(text("beyond the end of the store")),
        }
    }

    fn read_store(&mut self, offset: u32, length: u8) -> Reply {
        let start = offset as usize;
        let bytes = self.store().get(start..start + usize::from(length));
        match bytes.and_then(|b| heapless::Vec::from_slice(b).ok()) {
            Some(bytes) => Reply::Nonvolatile(Nonvolatile { offset, bytes }),
            None => Reply::Refused(text("beyond the end of the store, or too long")),
        }
    }

    fn hook(&mut self, hook: &Hook) -> Reply {
        if !matches!(
            hook,
            Hook::StopMainLoop
                | Hook::FlipBit { .. }
                | Hook::BrownOutInSave { .. }
                | Hook::StretchTransmission { .. }
        ) && self.machine.is_some()
            && let Err(what) = self.finish_tick()
        {
            return Reply::Refused(text(&what));
        }
        let Some(machine) = &mut self.machine else {
            return Reply::Refused(text("the board has no supply yet"));
        };
        match hook {
            Hook::StopMainLoop => machine.state_mut().stop_main_loop = true,
            Hook::StopProcessor => machine.state_mut().stop_processor = true,
            Hook::LockUp => machine.lock_up(),
            Hook::RamParityError => machine.ram_parity_error(),
            Hook::StopCrystal => machine.crystal_stops(),
            Hook::FaultProcessor => {
                if let Err(what) = machine.derail() {
                    return Reply::Refused(text(&what));
                }
            }
            Hook::StretchTransmission { times: 0 } => {
                return Reply::Refused(text("a byte takes some time: at least once its own"));
            }
            Hook::StretchTransmission { times } => {
                machine.state_mut().soc.usart.stretch = u64::from(*times);
            }
            Hook::BrownOutInSave { after } => {
                machine.state_mut().soc.flash.units_left = Some(*after);
            }
            Hook::FlipBit {
                address,
                bit,
                symbol,
            } => {
                let base = if symbol.is_empty() {
                    Some(0)
                } else {
                    self.image.symbol(symbol)
                };
                let Some(base) = base else {
                    return Reply::Refused(text(&format!("no symbol `{symbol}` in the image")));
                };
                let at = base.wrapping_add(*address);
                if !(RAM_BASE..RAM_BASE + RAM_SIZE).contains(&at) || *bit > 7 {
                    return Reply::Refused(text(&format!("{at:#010x} bit {bit} is not in RAM")));
                }
                let mut byte = [0];
                let flipped = machine
                    .memory(at, &mut byte)
                    .and_then(|()| machine.set_memory(at, &[byte[0] ^ 1 << bit]));
                if let Err(e) = flipped {
                    return Reply::Refused(text(&e));
                }
                machine.state_mut().tolerant = true;
            }
        }
        Reply::Done
    }

    /// Does something that may end the emulation.
    fn attempt(&mut self, f: impl FnOnce(&mut Self) -> Result<Ran, String>) -> Reply {
        match f(self) {
            Ok(ran) => Reply::Ran(ran),
            Err(what) => {
                let (pc, at_ns, reason) = match &self.machine {
                    Some(machine) => {
                        let (pc, where_) = machine.whereabouts(&self.image);
                        let state = machine.state();
                        let at_ns = state.soc.time.ns_of(state.cycle);
                        (pc, at_ns, format!("{what} ({where_})"))
                    }
                    None => (0, 0, what),
                };
                let halt = Halt {
                    at_ns,
                    pc,
                    reason: text(&reason),
                };
                self.halted = Some(halt.clone());
                Reply::Halted(halt)
            }
        }
    }

    fn power_up(&mut self, straps: &Straps) -> Result<Ran, String> {
        let store = std::mem::take(&mut self.store);
        let cause = BROWN_OUT_RESET | PIN_RESET;
        let mut soc = Soc::new(store, straps.unique_id, straps.crystal, cause);
        let bits = u32::from(straps.address);
        let mut closed = 0;
        for (bit, pin) in wiring::STRAPS.iter().enumerate() {
            closed |= (bits >> bit & 1) << pin;
        }
        // The parity strap makes the number of closed straps odd.
        closed |= u32::from(bits.count_ones().is_multiple_of(2)) << wiring::PARITY;
        soc.ports[1].driven = closed;
        soc.ports[0].driven = wiring::FOOT.iter().fold(0, |m, p| m | 1 << p)
            | 1 << wiring::SUPPLY
            | 1 << wiring::POWER_OK;
        soc.ports[0].outside = 1 << wiring::POWER_OK;
        self.machine = Some(Machine::new(&self.image, self.blocks.clone(), soc)?);
        self.address = straps.address;
        if self.profiles.is_some() {
            self.machine()?.state_mut().profile = Some(Profile::default());
        }
        self.running = false;
        let stop = self.start_up(START_UP_NS)?;
        if stop == Stop::TickStarted {
            // The rest of the start-up code runs on the way to the first edge, which brings its own inputs.
            self.align(0);
        }
        if let Stop::Reset(cause) = stop {
            return Err(format!("reset {cause:#x} in the start-up code"));
        }
        let ran = self.take_ran();
        self.reply(ran)
    }

    fn machine(&mut self) -> Result<&mut Machine, String> {
        self.machine
            .as_mut()
            .ok_or_else(|| "the board has no supply".to_owned())
    }
}
