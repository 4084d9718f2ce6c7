//! What a board shows: outputs, inputs as its program read them, transmissions, measurements.

use wheeleg_remote_link::{Figures, Inputs, MAX_TRANSMISSIONS, Outputs, Ran, Sent, Switches};

use super::Board;
use crate::machine::Machine;
use crate::wiring;

/// Number of edges between two checks of the stack.
const STACK_EVERY: u32 = 64;

/// Maximum lead of the boards' microsecond clock over the tick [ns]. Both are started by consecutive stores
/// (firmware/board/src/g431/tick.rs), at most ten cycles apart in the compiler's layout.
const LEAD_NS: u64 = 60;

/// The microsecond that a start of the boards' clock stands for. A start that is off by more than the lead is
/// left as it is, and differs.
fn on_grid(ns: u64) -> u64 {
    let next = ns.next_multiple_of(1_000);
    if next - ns <= LEAD_NS { next } else { ns }
}

impl Board {
    pub(super) fn period_us(&self) -> u64 {
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

    /// What the board shows now: outputs, and the newest tick it has processed.
    pub(super) fn take_ran(&mut self) -> Ran {
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

    /// The board's outputs at an edge, with the rest of the reply as of now.
    pub(super) fn reply(&mut self, ran: Ran) -> Result<Ran, String> {
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
                tick_instructions: ran.figures.tick_instructions,
                ..self.figures
            },
            trip,
            ..ran
        })
    }

    /// Transmissions that are ready to go out and have not been announced yet. Whatever has gone out must
    /// match its announcement.
    fn sent(&mut self) -> Result<heapless::Vec<Sent, MAX_TRANSMISSIONS>, String> {
        let mut sent = heapless::Vec::new();
        let Some(machine) = &mut self.machine else {
            return Ok(sent);
        };
        let time = machine.state().soc.time;
        // Started since the last reply, or ready to start.
        let cycle = machine.state().cycle;
        let started = machine.state_mut().soc.started.take();
        let armed = machine.state().soc.armed(cycle);
        for (start, address, length) in started.into_iter().chain(armed) {
            if self.announced.back().is_some_and(|first| first.0 == start) {
                continue;
            }
            let mut bytes = vec![0; length as usize];
            machine.memory(address, &mut bytes)?;
            let copy = heapless::Vec::from_slice(&bytes)
                .map_err(|_| format!("a transmission of {length} bytes"))?;
            let frame = Sent {
                start_ns: on_grid(time.ns_of(start)),
                bytes: copy,
            };
            let _ = sent.push(frame);
            self.announced.push_back((start, bytes));
        }
        for frame in std::mem::take(&mut machine.state_mut().soc.gone) {
            // Announced before this frame: it was replaced, or cut off by the driver's time limit.
            while self
                .announced
                .front()
                .is_some_and(|first| first.0 < frame.0)
            {
                self.announced.pop_front();
            }
            let first = self.announced.front();
            if first != Some(&frame) {
                let text = |(start, bytes): &(u64, Vec<u8>)| {
                    format!("{} bytes at {} ns", bytes.len(), time.ns_of(*start))
                };
                return Err(format!(
                    "a frame left ({}) that did not stand ready in hardware like that ({})",
                    text(&frame),
                    first.map_or_else(|| "nothing".to_owned(), text)
                ));
            }
        }
        Ok(sent)
    }

    fn measure(&mut self) -> Result<(), String> {
        let Some(machine) = &mut self.machine else {
            return Ok(());
        };
        let state = machine.state();
        let retired = state.retired();
        self.figures.instructions = (retired - self.retired) as u32;
        self.figures.longest_awake = state.longest_awake as u32;
        self.figures.outputs_low_after = state.outputs_low_after.unwrap_or(0) as u32;
        self.figures.driver_timeouts = state.soc.driver_timeouts;
        self.figures.driver_on_us = state.soc.driver_on_us;
        self.retired = retired;
        if self.edges.is_multiple_of(STACK_EVERY) {
            let top = self.image.word(0);
            let bottom = self.image.stack_bottom;
            let low = machine.watermark(bottom, top)?;
            self.figures.stack_used = top - low;
            self.figures.stack_size = top - bottom;
            self.write_profile()?;
        }
        Ok(())
    }

    /// Writes where the worst tick spent its instructions, if profiles are requested and there has been a
    /// worse tick.
    fn write_profile(&mut self) -> Result<(), String> {
        let name = format!("{}-{}.txt", self.image.name, self.address);
        let (Some(folder), Some(machine)) = (&self.profiles, &mut self.machine) else {
            return Ok(());
        };
        let Some(blocks) = machine.state_mut().worst_tick() else {
            return Ok(());
        };
        let line = |(address, (instructions, times)): (&u32, &(u64, u32))| {
            format!("{address:#010x} {instructions} {times}\n")
        };
        let lines: String = blocks.iter().map(line).collect();
        let path = folder.join(name);
        std::fs::write(&path, lines).map_err(|e| format!("{}: {e}", path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::on_grid;

    #[test]
    fn only_the_lead_of_the_clock_is_taken_off_a_start() {
        assert_eq!(on_grid(2_979_988), 2_980_000, "two cycles early");
        assert_eq!(on_grid(2_980_000), 2_980_000);
        assert_eq!(on_grid(2_979_940), 2_980_000);
        assert_eq!(on_grid(2_979_939), 2_979_939, "more than the lead");
        assert_eq!(on_grid(2_980_006), 2_980_006, "late by a cycle");
    }
}
