//! A board's timeline: edges, received bytes, supply, resets.

use wheeleg_remote_link::{Inputs, Power, Ran, Run, Trip};

use super::Board;
use crate::machine::{Stop, Until};
use crate::soc::rcc::{BROWN_OUT_RESET, PIN_RESET};
use crate::wiring;

/// How far the board runs beyond an edge, so that whatever acts "at the edge" in its interrupt has acted;
/// below 1 µs, the grid of all bus times [ns].
const BEYOND_EDGE_NS: u64 = 900;
/// Longest processing of received bytes before the board counts as busy [ns].
const WORK_NS: u64 = 500_000;
/// Time from the voltage detector's threshold to the brown-out reset [ns] (ASSUMED: a capacitor that lasts
/// this long).
const FALL_NS: u64 = 20_000;
/// Error for an image that is meant for a bench board.
const WAITS: &str = "the program waits for its second serial port, which nothing is connected to";
/// The byte between bus frames.
const DELIMITER: u8 = 0;

impl Board {
    /// Runs the start-up code until the tick timer runs.
    pub(super) fn start_up(&mut self, until_ns: u64) -> Result<Stop, String> {
        match self.machine()?.run(until_ns, Until::Cycle, false)? {
            Stop::Waits => Err(WAITS.to_owned()),
            stop => Ok(stop),
        }
    }

    /// Records that the tick timer has been started and that its next edge is `edge_ns`. (The start-up of the
    /// oscillators takes as long as this requires.)
    pub(super) fn align(&mut self, edge_ns: u64) {
        self.running = true;
        self.first_edge_ns = edge_ns;
        if let Some(machine) = &mut self.machine {
            let state = machine.state_mut();
            if let Some(edge) = state.soc.tick_timer().overflow_at() {
                let now = state.cycle;
                state.soc.align(edge, edge_ns, now);
            }
            // The cycles before this edge count as at most one period.
            self.grid_ns = self.period_us().max(1) * 1000;
        }
        for (at_ns, edges) in self.turned.into_iter().rev() {
            self.start_counter(at_ns, edges);
        }
    }

    /// Starts the encoder's counter. The program does this just before it starts the tick timer, which is one
    /// period before the first edge; what the wheel has turned by an earlier edge is not counted.
    fn start_counter(&mut self, at_ns: u64, edges: i32) {
        if self.running
            && at_ns + 2 * self.grid_ns <= self.first_edge_ns
            && let Some(machine) = &mut self.machine
        {
            machine.state_mut().soc.encoder_timer().count_from(edges);
        }
    }

    pub(super) fn run(&mut self, run: &Run) -> Result<Ran, String> {
        self.deliver(run)?;
        if self.power == Power::BrownOut && run.power == Power::Good {
            // The supply returns at the end of this run.
            self.advance(run.until_ns, Until::Cycle)?;
        }
        self.supply(run.power)?;
        // Only after a delimiter is there anything to process; before one, the next byte of the frame would
        // be delayed. Bytes that arrive with an edge are not answered before the next run, and waiting for
        // them would delay the next bytes.
        self.owes |= run.edge.is_none() && run.received.last() == Some(&DELIMITER);
        if let Some(inputs) = run.edge {
            self.edge_ns = run.until_ns;
            if let Some(before) = run.until_ns.checked_sub(6) {
                self.advance(before, Until::Cycle)?;
            }
            self.latch(&inputs)?;
            self.turned = [(run.until_ns, inputs.encoder), self.turned[0]];
            self.start_counter(run.until_ns, inputs.encoder);
            self.advance(run.until_ns + BEYOND_EDGE_NS, Until::Cycle)?;
            self.edges = self.edges.wrapping_add(1);
            self.check_edge(run.until_ns)?;
            let ran = self.take_ran();
            self.work_off(run.until_ns)?;
            self.reply(ran)
        } else {
            let cap = self.before_next_edge()?;
            self.advance(cap.min(run.until_ns), Until::Cycle)?;
            self.work_off(run.until_ns)?;
            let ran = self.take_ran();
            self.reply(ran)
        }
    }

    /// Last instant before the next tick edge, whose inputs come with a separate run.
    fn before_next_edge(&mut self) -> Result<u64, String> {
        let running = self.running;
        let soc = &self.machine()?.state().soc;
        let edge = soc.tick_timer().overflow_at().filter(|_| running);
        Ok(edge.map_or(u64::MAX, |cycle| soc.time.ns_of(cycle).saturating_sub(6)))
    }

    /// Runs on until all received bytes are processed, so that the resulting transmissions are known in time.
    /// Work that a tick edge interrupts continues in the next run.
    fn work_off(&mut self, now_ns: u64) -> Result<(), String> {
        if self.owes {
            let cap = self.before_next_edge()?;
            let longest = cap.min(now_ns + WORK_NS);
            self.advance(cap.min(now_ns), Until::Asleep(longest))?;
            // (A byte that ends at a tick edge arrives after this run, which ends before it.)
            let machine = self.machine()?;
            self.owes = !machine.rests() || machine.state().soc.expects();
        }
        Ok(())
    }

    /// Runs on until the current tick is finished. A program that stops at an instant has finished its newest
    /// tick, like the one on the host, although the board answered earlier.
    pub(super) fn finish_tick(&mut self) -> Result<(), String> {
        if !self.running {
            return Ok(());
        }
        let cap = self.before_next_edge()?;
        let state = self.machine()?.state();
        let now_ns = state.soc.time.ns_of(state.cycle);
        let longest = cap.min(now_ns + WORK_NS);
        self.advance(cap.min(now_ns), Until::Asleep(longest))
    }

    /// Checks that the board's tick timer keeps the simulator's time.
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

    /// Puts the received bytes on the line at their times. A board that has just started hears nothing that
    /// ended before its tick timer started, because its start-up code was executed ahead of these bytes.
    fn deliver(&mut self, run: &Run) -> Result<(), String> {
        let mut late = 0;
        let hears_from_ns = if self.running {
            self.first_edge_ns.saturating_sub(self.grid_ns)
        } else {
            0
        };
        let state = self.machine()?.state_mut();
        let count = run.received.len() as u64;
        for (i, byte) in (1..).zip(&run.received) {
            let back = (count - i) * u64::from(run.byte_ns);
            let end_ns = run.received_end_ns.saturating_sub(back);
            if end_ns <= hears_from_ns {
                continue;
            }
            let end = state.soc.time.cycle_of(end_ns);
            late += u32::from(end < state.cycle);
            state.soc.expect(end.max(state.cycle), *byte);
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
                let soc = &mut machine.state_mut().soc;
                soc.ports[0].outside |= 1 << wiring::POWER_OK;
                Ok(())
            }
        }
    }

    /// The supply falls: first through the threshold of the voltage detector, then, [`FALL_NS`] later,
    /// through that of the brown-out reset, which holds the processor until the supply returns.
    fn power_fails(&mut self) -> Result<(), String> {
        let soc = &mut self.machine()?.state_mut().soc;
        soc.ports[0].outside &= !(1 << wiring::POWER_OK);
        soc.break_inputs(false);
        soc.supply_sags();
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
                Stop::Waits => return Err(WAITS.to_owned()),
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
        soc.turn(inputs.encoder);
        Ok(())
    }
}
