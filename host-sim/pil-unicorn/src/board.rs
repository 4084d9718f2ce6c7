//! One emulated board: requests in, replies out.

use std::collections::VecDeque;

use wheeleg_pil_link::{
    Figures, Halt, Hello, Hook, Inputs, LINK_VERSION, Nonvolatile, Outputs, Power, Ran, Reply,
    Request, Run, Sent, Straps, Switches, Trip, text,
};

use crate::image::{Image, RAM_BASE, RAM_SIZE};
use crate::machine::{Machine, Stop, Until};
use crate::soc::Soc;
use crate::soc::flash::STORE_SIZE;
use crate::soc::rcc::{BROWN_OUT_RESET, PIN_RESET};
use crate::wiring;

/// How far the board runs beyond an edge, so that what acts "at the edge" in
/// its interrupt has acted; below 1 µs, the grid of all bus times [ns].
const BEYOND_EDGE_NS: u64 = 900;
/// Longest work on received bytes before the board is taken for busy [ns].
const WORK_NS: u64 = 500_000;
/// Time for the start-up code before a board is taken for one that does not
/// run its tick [ns].
const START_UP_NS: u64 = 100_000_000;
/// From the voltage detector's threshold to the brown-out reset (ASSUMED: a
/// capacitor that lasts so long) [ns].
const FALL_NS: u64 = 20_000;
/// The byte between bus frames.
const DELIMITER: u8 = 0;
/// Edges between two looks at the stack.
const STACK_EVERY: u32 = 64;

/// A board of one image.
pub(crate) struct Board {
    image: Image,
    store: Vec<u8>,
    machine: Option<Machine>,
    halted: Option<Halt>,
    running: bool,
    edge_ns: u64,
    first_edge_ns: u64,
    grid_ns: u64,
    power: Power,
    /// Transmissions that were told and have not gone out yet.
    announced: VecDeque<(u64, Vec<u8>)>,
    figures: Figures,
    retired: u64,
    edges: u32,
    trip: Option<Trip>,
    power_lost_in_save: bool,
    /// Received bytes are not worked off.
    owes: bool,
}

impl Board {
    /// A board without supply.
    pub(crate) fn new(image: Image) -> Self {
        Self {
            image,
            store: vec![0xFF; STORE_SIZE],
            machine: None,
            halted: None,
            running: false,
            edge_ns: 0,
            first_edge_ns: 0,
            grid_ns: 1_000_000,
            power: Power::Good,
            announced: VecDeque::new(),
            figures: Figures::default(),
            retired: 0,
            edges: 0,
            trip: None,
            power_lost_in_save: false,
            owes: false,
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
            image: wheeleg_pil_link::Image {
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
        let Some(machine) = &mut self.machine else {
            return Reply::Refused(text("the board has no supply yet"));
        };
        match hook {
            Hook::StopMainLoop => machine.state_mut().stop_main_loop = true,
            Hook::StopProcessor => machine.state_mut().stop_processor = true,
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
        // The number of closed straps is odd.
        closed |= u32::from(bits.count_ones().is_multiple_of(2)) << wiring::PARITY;
        soc.ports[1].driven = closed;
        soc.ports[0].driven = wiring::FOOT.iter().fold(0, |m, p| m | 1 << p)
            | 1 << wiring::SUPPLY
            | 1 << wiring::POWER_OK;
        soc.ports[0].outside = 1 << wiring::POWER_OK;
        self.machine = Some(Machine::new(&self.image, soc)?);
        self.running = false;
        let stop = self.start_up(START_UP_NS)?;
        if stop == Stop::TickStarted {
            // The rest of the start-up code runs on the way to the first edge,
            // whose inputs come with it.
            self.align(0);
        }
        if let Stop::Reset(cause) = stop {
            return Err(format!("reset {cause:#x} in the start-up code"));
        }
        let shown = self.shown();
        self.reply(shown)
    }

    fn machine(&mut self) -> Result<&mut Machine, String> {
        self.machine
            .as_mut()
            .ok_or_else(|| "the board has no supply".to_owned())
    }

    /// Runs the start-up code until the tick timer runs.
    fn start_up(&mut self, until_ns: u64) -> Result<Stop, String> {
        self.machine()?.run(until_ns, Until::Cycle, false)
    }

    /// The tick timer has been started: its next edge is `edge_ns`. (The
    /// oscillators' start-up takes as long as it must for that.)
    fn align(&mut self, edge_ns: u64) {
        self.running = true;
        self.first_edge_ns = edge_ns;
        if let Some(machine) = &mut self.machine {
            let state = machine.state_mut();
            if let Some(edge) = state.soc.tick_timer().overflow_at() {
                let moved = state.soc.time.align(edge, edge_ns);
                state.soc.watchdog.shift(moved);
            }
            // The cycles before this edge count as up to one period.
            self.grid_ns = self.period_us().max(1) * 1000;
        }
    }

    fn period_us(&self) -> u64 {
        self.machine.as_ref().map_or(0, |machine| {
            let state = machine.state();
            let tim = state.soc.tick_timer();
            if tim.runs() && self.running {
                tim.period_cycles() * 1_000_000 / state.soc.time.hz()
            } else {
                0
            }
        })
    }

    fn run(&mut self, run: &Run) -> Result<Ran, String> {
        self.deliver(run)?;
        self.supply(run.power)?;
        // Only behind a delimiter is there anything to work off; before one, the
        // next byte of the frame would come late.
        self.owes |= run.received.last() == Some(&DELIMITER);
        if let Some(inputs) = run.edge {
            self.edge_ns = run.until_ns;
            if let Some(before) = run.until_ns.checked_sub(6) {
                self.advance(before, Until::Cycle)?;
            }
            self.latch(&inputs)?;
            self.advance(run.until_ns + BEYOND_EDGE_NS, Until::Cycle)?;
            self.edges = self.edges.wrapping_add(1);
            self.check_edge(run.until_ns)?;
            let shown = self.shown();
            self.work_off(run.until_ns)?;
            self.reply(shown)
        } else {
            let cap = self.before_next_edge()?;
            self.advance(cap.min(run.until_ns), Until::Cycle)?;
            self.work_off(run.until_ns)?;
            let shown = self.shown();
            self.reply(shown)
        }
    }

    /// Last instant before the next tick edge, whose inputs come with a run of
    /// its own.
    fn before_next_edge(&mut self) -> Result<u64, String> {
        let running = self.running;
        let soc = &self.machine()?.state().soc;
        let edge = soc.tick_timer().overflow_at().filter(|_| running);
        Ok(edge.map_or(u64::MAX, |cycle| soc.time.ns_of(cycle).saturating_sub(6)))
    }

    /// Runs on until all that was received is worked off, so that the
    /// transmissions it leads to are known in time. What a tick edge cuts short
    /// goes on in the next run.
    fn work_off(&mut self, now_ns: u64) -> Result<(), String> {
        if self.owes {
            let cap = self.before_next_edge()?;
            let longest = cap.min(now_ns + WORK_NS);
            self.advance(cap.min(now_ns), Until::Asleep(longest))?;
            self.owes = !self.machine()?.rests();
        }
        Ok(())
    }

    /// The board's tick timer keeps the simulator's time.
    fn check_edge(&mut self, edge_ns: u64) -> Result<(), String> {
        let runs = self.running && self.first_edge_ns <= edge_ns;
        let state = self.machine()?.state();
        let edge = state.soc.edge;
        if !runs || edge == Some(state.soc.time.cycle_of(edge_ns)) {
            return Ok(());
        }
        Err(format!(
            "the tick timer's newest edge is at {:?} ns, expected at {edge_ns} ns",
            edge.map(|cycle| state.soc.time.ns_of(cycle))
        ))
    }

    /// Puts the received bytes on the line at their times.
    fn deliver(&mut self, run: &Run) -> Result<(), String> {
        let mut late = 0;
        let state = self.machine()?.state_mut();
        let count = run.received.len() as u64;
        for (i, byte) in (1..).zip(&run.received) {
            let back = (count - i) * u64::from(run.byte_ns);
            let end = state
                .soc
                .time
                .cycle_of(run.received_end_ns.saturating_sub(back));
            late += u32::from(end < state.cycle);
            state.soc.usart.expect(end.max(state.cycle), *byte);
        }
        self.figures.late_bytes += late;
        Ok(())
    }

    fn supply(&mut self, power: Power) -> Result<(), String> {
        if power == self.power {
            return Ok(());
        }
        self.power = power;
        match power {
            Power::BrownOut => self.power_fails(),
            Power::Good => {
                self.power_lost_in_save = false;
                let machine = self.machine()?;
                machine.reset(BROWN_OUT_RESET | PIN_RESET, true)?;
                machine.state_mut().soc.ports[0].outside |= 1 << wiring::POWER_OK;
                Ok(())
            }
        }
    }

    /// The supply falls: first through the threshold of the voltage detector,
    /// [`FALL_NS`] later through that of the brown-out reset, which holds the
    /// processor until the supply is back.
    fn power_fails(&mut self) -> Result<(), String> {
        let soc = &mut self.machine()?.state_mut().soc;
        soc.ports[0].outside &= !(1 << wiring::POWER_OK);
        soc.break_inputs(false);
        soc.pwr.supply(true);
        soc.flash.power_failed = false;
        let time = soc.time;
        let fallen = time.ns_of(self.machine()?.state().cycle) + FALL_NS;
        self.machine()?.run(fallen, Until::Cycle, true)?;
        let machine = self.machine()?;
        machine.reset(BROWN_OUT_RESET | PIN_RESET, true)?;
        let state = machine.state_mut();
        state.stop_processor = true;
        let at_ns = state.soc.time.ns_of(state.cycle);
        self.tripped(at_ns, BROWN_OUT_RESET | PIN_RESET);
        Ok(())
    }

    fn tripped(&mut self, at_ns: u64, cause: u32) {
        self.running = false;
        self.owes = false;
        self.announced.clear();
        self.figures.resets = self.figures.resets.saturating_add(1);
        self.trip = Some(Trip {
            at_ns,
            running_ns: 0,
            cause,
        });
    }

    fn advance(&mut self, ns: u64, until: Until) -> Result<(), String> {
        loop {
            let running = self.running;
            match self.machine()?.run(ns, until, running)? {
                Stop::Time => return Ok(()),
                Stop::TickStarted => {
                    let state = self.machine()?.state();
                    let natural = state
                        .soc
                        .tick_timer()
                        .overflow_at()
                        .map_or(0, |cycle| state.soc.time.ns_of(cycle));
                    let periods = natural.saturating_sub(self.edge_ns).div_ceil(self.grid_ns);
                    let edge = self.edge_ns + periods * self.grid_ns;
                    self.align(edge);
                    if let Some(trip) = &mut self.trip {
                        trip.running_ns = edge;
                    }
                }
                Stop::Reset(cause) => {
                    let machine = self.machine()?;
                    let state = machine.state();
                    let at_ns = state.soc.time.ns_of(state.cycle);
                    machine.reset(cause | PIN_RESET, false)?;
                    self.tripped(at_ns, cause);
                }
                Stop::PowerFailed => {
                    self.power = Power::BrownOut;
                    self.power_lost_in_save = true;
                    self.power_fails()?;
                }
            }
        }
    }

    fn latch(&mut self, inputs: &Inputs) -> Result<(), String> {
        let soc = &mut self.machine()?.state_mut().soc;
        soc.wiper = inputs.adc;
        let mut levels = soc.ports[0].outside & 1 << wiring::POWER_OK;
        for (closed, pin) in inputs.switches.foot().iter().zip(wiring::FOOT) {
            levels |= u32::from(*closed) << pin;
        }
        levels |= u32::from(inputs.switches.supply()) << wiring::SUPPLY;
        soc.ports[0].outside = levels;
        soc.encoder_timer().turn(inputs.encoder);
        Ok(())
    }

    fn outputs(&self) -> Outputs {
        let Some(machine) = &self.machine else {
            return Outputs::default();
        };
        let soc = &machine.state().soc;
        let hz = soc.time.hz();
        let tick = soc.tick_timer();
        let mut outputs = Outputs::default();
        let valves = outputs.valve_on_us.iter_mut().zip(wiring::VALVES);
        for (channel, (on_us, (pin, function))) in valves.enumerate() {
            *on_us = if soc.ports[0].carries(pin, function) {
                let (high, _) = tick.high_counts(channel);
                tick.micros(high, hz) as u16
            } else if soc.ports[0].drives_high(pin) {
                1000
            } else {
                0
            };
        }
        if soc.ports[2].carries(wiring::PULSE, wiring::PULSE_FUNCTION) {
            let (high, period) = soc.bridge_timer().high_counts(0);
            outputs.bridge_percent = (high * 100 / period.max(1)) as u8;
        } else if soc.ports[2].drives_high(wiring::PULSE) {
            outputs.bridge_percent = 100;
        }
        outputs.bridge_backward = soc.ports[1].drives_high(wiring::DIRECTION);
        outputs.dump = soc.ports[1].drives_high(wiring::DUMP);
        outputs
    }

    fn seen(&mut self) -> (Inputs, u64) {
        let Some(machine) = &self.machine else {
            return (Inputs::default(), 0);
        };
        let state = machine.state();
        let seen = state.seen;
        let foot = wiring::FOOT.map(|pin| seen.port_a >> pin & 1 != 0);
        let supply = Switches::from_supply(seen.port_a >> wiring::SUPPLY & 1 != 0);
        let inputs = Inputs {
            adc: seen.adc,
            switches: Switches(Switches::from_foot(foot).0 | supply.0),
            encoder: i32::from(seen.count as u16 as i16),
        };
        (inputs, state.soc.time.ns_of(seen.edge))
    }

    /// What the board shows now: outputs, and the newest tick that was worked off.
    fn shown(&mut self) -> Ran {
        let (seen, seen_at_ns) = self.seen();
        let state = self.machine.as_ref().map(Machine::state);
        Ran {
            outputs: self.outputs(),
            seen,
            seen_at_ns,
            figures: Figures {
                tick_instructions: state.map_or(0, |state| state.tick_instructions as u32),
                ..Figures::default()
            },
            ..Ran::default()
        }
    }

    /// What the board has shown at an edge, and the rest of the reply as of now.
    fn reply(&mut self, shown: Ran) -> Result<Ran, String> {
        let sent = self.sent()?;
        let period_us = self.period_us() as u32;
        self.measure()?;
        let trip = self.trip;
        if trip.is_some_and(|t| t.running_ns > 0) || !self.power_lost_in_save {
            self.trip = self.trip.filter(|t| t.running_ns == 0);
        }
        Ok(Ran {
            period_us,
            sent,
            figures: Figures {
                tick_instructions: shown.figures.tick_instructions,
                ..self.figures
            },
            trip,
            ..shown
        })
    }

    /// What stands ready to go out and has not been told yet. What has gone
    /// out must be what was told.
    fn sent(
        &mut self,
    ) -> Result<heapless::Vec<Sent, { wheeleg_pil_link::MAX_TRANSMISSIONS }>, String> {
        let mut sent = heapless::Vec::new();
        let Some(machine) = &mut self.machine else {
            return Ok(sent);
        };
        let time = machine.state().soc.time;
        // Started since the last reply, or standing ready.
        let cycle = machine.state().cycle;
        let started = machine.state_mut().soc.started.take();
        let armed = machine.state().soc.armed(cycle);
        for (start, address, length) in started.into_iter().chain(armed) {
            if self.announced.back().is_some_and(|told| told.0 == start) {
                continue;
            }
            let mut bytes = vec![0; length as usize];
            machine.memory(address, &mut bytes)?;
            let copy = heapless::Vec::from_slice(&bytes)
                .map_err(|_| format!("a transmission of {length} bytes"))?;
            let frame = Sent {
                start_ns: time.ns_of(start),
                bytes: copy,
            };
            let _ = sent.push(frame);
            self.announced.push_back((start, bytes));
        }
        for frame in std::mem::take(&mut machine.state_mut().soc.gone) {
            // Told before it: replaced, or cut off by the driver's time limit.
            while self.announced.front().is_some_and(|told| told.0 < frame.0) {
                self.announced.pop_front();
            }
            let told = self.announced.front();
            if told != Some(&frame) {
                let text = |(start, bytes): &(u64, Vec<u8>)| {
                    format!("{} bytes at {} ns", bytes.len(), time.ns_of(*start))
                };
                return Err(format!(
                    "a frame left ({}) that did not stand ready in hardware like that ({})",
                    text(&frame),
                    told.map_or_else(|| "nothing".to_owned(), text)
                ));
            }
        }
        Ok(sent)
    }

    fn measure(&mut self) -> Result<(), String> {
        let Some(machine) = &self.machine else {
            return Ok(());
        };
        let state = machine.state();
        let retired = state.retired;
        self.figures.instructions = (retired - self.retired) as u32;
        self.figures.longest_awake = state.longest_awake as u32;
        self.figures.driver_timeouts = state.soc.driver_timeouts;
        self.retired = retired;
        if self.edges.is_multiple_of(STACK_EVERY) {
            let top = self.image.word(0);
            let bottom = self.image.stack_bottom;
            let low = machine.watermark(bottom, top)?;
            self.figures.stack_used = top - low;
            self.figures.stack_size = top - bottom;
        }
        Ok(())
    }
}
