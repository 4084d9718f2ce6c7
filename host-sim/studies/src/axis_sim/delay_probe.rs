//! Finds the valves' opening delay at start-up, using only the potentiometer.
//!
//! A pulse shorter than t_on lets nothing through, however often it is sent; a longer one lets at least
//! t_off's worth through, and a few of those move the piston. So pulses of growing length are sent to one
//! fill valve until the piston moves: first in coarse steps, which brings the chamber to the edge of
//! slipping, then in fine ones from a little below. The pulse that moves it then exceeds t_on by a step or
//! two. If neither chamber moves the piston, there is no result.
//!
//! Motion counts only if it follows a pulse at once and in its direction: under a load that has moved the
//! piston until a shut chamber carries it, leakage lets it creep on by itself. If that brings it to its end
//! stop, the side is given up, its chamber vented, and the search starts again from the other one.
//!
//! If a chamber is full at the start, no pulse moves the piston. A search without a result is repeated once,
//! from a known state: each side then begins with both chambers open to the atmosphere for two seconds.
//!
//! This does not show t_off. Both delays of a valve come from one coil and one spring: t_off is assumed to
//! differ from its data sheet by the same factor.

use wheeleg_control::pwm::OnTimes;
use wheeleg_units::{Micros, PositionMm};

/// Time between the starts of two pulses, ticks.
const PERIOD: u16 = 30;
/// Standing still before pulses begin, ticks: a loaded, vented piston first runs
/// to its end stop.
const PAUSE: u16 = 200;
/// Time for which both chambers are vented before a side of the second search, ticks (2 s).
const EMPTIES: u16 = 2000;
/// Coarse and fine steps, µs.
const COARSE: u16 = 200;
const FINE: u16 = 50;
/// Fine steps begin this far below the coarse result, µs.
const BACK: u16 = 3000;
/// Longest pulse, µs: valves slower than 20 ms are not for this use.
const LONGEST: u16 = 20_000;
/// A side that takes pulses longer by this than the last one that moved it, µs, has come to its end stop.
const BEYOND: u16 = 1000;
/// Shortest pulse, µs.
const SHORTEST: u16 = 200;
/// Motion that counts, raw mm (0.2 mm: four steps of a 12-bit converter).
const MOVED: i32 = 13_107;
/// Number of fine results; the smallest counts.
const ROUNDS: u8 = 3;

/// State of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Phase {
    Pause,
    Pulses,
    Done,
}

/// The search; feed it one position per tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DelayProbe {
    phase: Phase,
    /// Fine steps: the chamber is at the edge of slipping.
    fine: bool,
    /// Chamber B instead of A.
    rod_side: bool,
    pulse: u16,
    /// Pulse at which this side is given up.
    longest: u16,
    /// Remaining ticks with both chambers open to the atmosphere; `None` in the first search.
    empties: Option<u16>,
    /// Ticks since the pulse began, or of the pause.
    at: u16,
    /// Stroke at the start of the pause, or of the pulse before this one.
    base: Option<i32>,
    /// Stroke at the start of this pulse.
    begun: i32,
    rounds: u8,
    found: Option<u16>,
}

impl Default for DelayProbe {
    fn default() -> Self {
        Self::new()
    }
}

impl DelayProbe {
    /// The start. The joint is at rest; its other chamber should be vented.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            phase: Phase::Pause,
            fine: false,
            rod_side: false,
            pulse: SHORTEST,
            longest: LONGEST,
            empties: None,
            at: 0,
            base: None,
            begun: 0,
            rounds: 0,
            found: None,
        }
    }

    /// Whether the search has ended.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        matches!(self.phase, Phase::Done)
    }

    /// The opening delay, once the search has ended with one.
    #[must_use]
    pub fn t_on(&self) -> Option<Micros> {
        let found = if self.is_done() { self.found } else { None };
        // On average, the piston moves with the second pulse that opens.
        found.map(|pulse| Micros(u32::from(pulse.saturating_sub(FINE))))
    }

    /// One tick: on-times of the next, µs. A tick is 1 ms.
    pub fn tick(&mut self, measured: PositionMm) -> OnTimes {
        let position = measured.raw();
        let base = *self.base.get_or_insert(position);
        let travel = position.saturating_sub(base);
        match self.phase {
            Phase::Done => [0; 4],
            Phase::Pause if self.empties.is_some_and(|left| left > 0) => {
                self.empties = self.empties.map(|left| left.saturating_sub(1));
                self.base = None;
                [0, 1000, 0, 1000]
            }
            Phase::Pause => {
                self.at = self.at.saturating_add(1);
                if travel.saturating_abs() > MOVED >> 2 {
                    self.base = None;
                    self.at = 0;
                } else if self.at >= PAUSE {
                    self.at = 0;
                    self.begun = position;
                    self.base = Some(position);
                    self.phase = Phase::Pulses;
                }
                // Air left in A by the pulses would hold the piston.
                [0, if self.rod_side { 1000 } else { 0 }, 0, 0]
            }
            Phase::Pulses => {
                let along = if self.rod_side {
                    travel.saturating_neg()
                } else {
                    travel
                };
                if along > MOVED {
                    return self.seen();
                }
                let on = self
                    .pulse
                    .saturating_sub(self.at.saturating_mul(1000))
                    .min(1000);
                self.at = self.at.saturating_add(1);
                if self.at >= PERIOD {
                    self.base = Some(self.begun);
                    self.begun = position;
                    self.next_pulse();
                }
                if self.rod_side {
                    [0, 0, on, 0]
                } else {
                    [on, 0, 0, 0]
                }
            }
        }
    }

    /// The piston has moved.
    fn seen(&mut self) -> OnTimes {
        if self.fine {
            let best = self.found.map_or(self.pulse, |found| found.min(self.pulse));
            self.found = Some(best);
            self.rounds = self.rounds.saturating_add(1);
        }
        self.fine = true;
        self.longest = self.pulse.saturating_add(BEYOND).min(LONGEST);
        self.pulse = self.pulse.saturating_sub(BACK).max(SHORTEST);
        if self.rounds >= ROUNDS {
            self.phase = Phase::Done;
        } else {
            self.pause();
        }
        [0; 4]
    }

    fn pause(&mut self) {
        self.phase = Phase::Pause;
        self.base = None;
        self.at = 0;
    }

    fn next_pulse(&mut self) {
        self.at = 0;
        let step = if self.fine { FINE } else { COARSE };
        self.pulse = self.pulse.saturating_add(step);
        if self.pulse <= self.longest {
            return;
        }
        if !self.rod_side {
            // Against an end stop, or the load: try the other way.
            self.empties = self.empties.map(|_| EMPTIES);
            self.begin(true);
        } else if self.found.is_none() && self.empties.is_none() {
            self.empties = Some(EMPTIES);
            self.begin(false);
        } else {
            self.phase = Phase::Done;
        }
    }

    /// The search from one side, in coarse steps.
    fn begin(&mut self, rod_side: bool) {
        self.rod_side = rod_side;
        self.fine = false;
        self.pulse = SHORTEST;
        self.longest = LONGEST;
        self.pause();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A valve of `t_on` µs, and a piston that jumps 0.4 mm with every third opening.
    fn probe(t_on: u32, works: bool) -> Option<Micros> {
        let mut search = DelayProbe::new();
        let (mut position, mut on_us, mut openings) = (40.0, 0_u32, 0_u32);
        let mut opened = false;
        for _ in 0..60_000 {
            if search.is_done() {
                break;
            }
            let on = search.tick(PositionMm::from_f64(position));
            let coil = u32::from(on[0]);
            on_us = if coil == 0 { 0 } else { on_us + coil };
            if coil == 0 {
                opened = false;
            } else if on_us > t_on && !opened && works {
                opened = true;
                openings += 1;
                if openings % 3 == 0 {
                    position += 0.4;
                }
            }
        }
        search.t_on()
    }

    /// Full chambers let no pulse move the piston until both have been vented for a second.
    #[test]
    fn chambers_that_are_full_at_first_are_emptied() {
        let t_on = 3_500;
        let mut search = DelayProbe::new();
        let (mut left, mut position, mut on_us) = ([1_000_u32; 2], 40.0, 0);
        for _ in 0..60_000 {
            let [fill_a, vent_a, _, vent_b] = search.tick(PositionMm::from_f64(position));
            for (left, vent) in left.iter_mut().zip([vent_a, vent_b]) {
                *left = left.saturating_sub(u32::from(vent / 1000));
            }
            on_us = if fill_a == 0 {
                0
            } else {
                on_us + u32::from(fill_a)
            };
            if on_us > t_on && left == [0; 2] {
                position += 0.3;
                on_us = 0;
            }
        }
        let found = search.t_on().expect("moves").get();
        assert!(found.abs_diff(t_on) <= 300, "{found}");
    }

    #[test]
    fn the_probe_finds_the_opening_delay() {
        for t_on in [1_750, 3_500, 7_000, 12_000] {
            let found = probe(t_on, true).expect("moves").get();
            assert!(found.abs_diff(t_on) <= 300, "{t_on}: {found}");
        }
        assert_eq!(probe(3_500, false), None, "a piston that never moves");
    }
}
