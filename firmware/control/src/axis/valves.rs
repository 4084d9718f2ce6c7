//! Following a valve from its coil to the chamber.
//!
//! The plant's valves open t_on after the coil rises and shut t_off after it
//! falls; a pulse shorter than t_on never opens one, a gap shorter than t_off
//! never shuts it. What the chamber sees comes later by the wave's way through
//! the line. The same rules are followed here, in whole microseconds, on the
//! on-times that were really sent.

use core::hash::{Hash, Hasher};

/// Changes that can be under way at once.
const EDGES: usize = 4;
/// Bits of a track's state: changes under way, the coil is on, the valve is open.
const PENDING: u32 = 0xFF;
const COIL: u32 = 1 << 8;
const OPEN: u32 = 1 << 9;

/// Timing of the valves, µs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ValveTimes {
    /// Control tick.
    pub tick: i32,
    /// Coil on to open, 0…50 000.
    pub on: i32,
    /// Coil off to shut, 0…50 000.
    pub off: i32,
    /// Wave's way through the line, 0…20 000.
    pub line: i32,
    /// Shortest pulse that is sent: t_on and a margin.
    pub shortest_pulse: i32,
    /// Shortest gap that is left: t_off and a margin.
    pub shortest_gap: i32,
}

impl ValveTimes {
    /// Opening of the shortest pulse, µs.
    #[must_use]
    pub const fn shortest_opening(&self) -> i32 {
        self.shortest_pulse
            .wrapping_sub(self.on)
            .wrapping_add(self.off)
    }
}

/// One valve as followed from its coil. Times are moments of a clock in µs that wraps
/// after 71 minutes: a valve that has been shut for just that long (35 minutes from its
/// start) begins its next pulse late, by the shortest gap at most; one energised for just that
/// long stays so for the shortest pulse.
#[derive(Clone, Copy, Debug)]
pub struct ValveTrack {
    /// How many changes of the effect are under way ([`PENDING`]), and whether the coil is
    /// on ([`COIL`]) and the valve open ([`OPEN`]): one word, which is sealed as it is.
    state: u32,
    /// Moment of each change under way, oldest first; beyond those without meaning.
    edges: [u32; EDGES],
    /// When the coil changed.
    changed: u32,
}

impl Default for ValveTrack {
    fn default() -> Self {
        Self::new()
    }
}

impl Hash for ValveTrack {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Taken apart, so that a new field cannot be forgotten here. Fields share a
        // word such that a flipped bit of any flips one bit of it.
        let Self {
            state: own,
            edges: [first, second, third, fourth],
            changed,
        } = self;
        state.write_u32(changed ^ own);
        let pending = own & PENDING;
        if pending > 0 {
            state.write_u32(*first);
            state.write_u32(*second);
            if pending > 2 {
                state.write_u32(*third);
                state.write_u32(*fourth);
            }
        }
    }
}

impl ValveTrack {
    /// Shut for a long time, on a clock that begins at 0.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            state: 0,
            edges: [0; EDGES],
            changed: 1 << 31,
        }
    }

    /// Whether the coil is on at the end of the ticks taken so far.
    #[must_use]
    pub const fn coil(&self) -> bool {
        self.state & COIL != 0
    }

    /// Changes under way.
    #[inline]
    const fn pending(&self) -> u32 {
        self.state & PENDING
    }

    /// Whether the chamber sees the valve open.
    #[inline]
    const fn open(&self) -> bool {
        self.state & OPEN != 0
    }

    /// The coil changes at the moment `at`.
    #[inline(never)]
    fn change(&mut self, at: u32, times: &ValveTimes) {
        let lasted = at.wrapping_sub(self.changed);
        let (took, delay) = if self.coil() {
            (times.on, times.off)
        } else {
            (times.off, times.on)
        };
        self.state ^= COIL;
        self.changed = at;
        let pending = self.pending();
        if lasted < took as u32 && pending > 0 {
            // Called back before it moved: the change under way does not happen.
            self.state = self.state.wrapping_sub(1);
        } else if let Some(next) = self.edges.get_mut(pending as usize) {
            *next = at.wrapping_add(delay.wrapping_add(times.line) as u32);
            self.state = self.state.wrapping_add(1);
        } else {
            // More changes than a line can hold: only the end is known.
            self.state = if self.coil() { COIL | OPEN } else { 0 };
        }
    }

    /// Takes the on-time of the tick that begins `now`, 0…tick µs from its edge; gives for
    /// how long the chamber sees the valve open in that tick, µs.
    #[inline]
    pub fn advance(&mut self, now: u32, on: i32, times: &ValveTimes) -> i32 {
        if on > 0 && !self.coil() {
            self.change(now, times);
        }
        if on < times.tick && self.coil() {
            self.change(now.wrapping_add(on as u32), times);
        }
        if self.pending() > 0 {
            let [first, ..] = self.edges;
            if first.wrapping_sub(now) as i32 <= times.tick {
                return self.pass(now, times.tick);
            }
        }
        if self.open() { times.tick } else { 0 }
    }

    /// Takes the changes within `span` µs from `now`; gives the time open.
    #[inline(never)]
    fn pass(&mut self, now: u32, span: i32) -> i32 {
        // The time open is that to the end of the span, if the valve is open then, less the
        // moments of opening, plus those of closing.
        let mut opened = 0_i32;
        while self.pending() > 0 {
            let [first, second, third, fourth] = self.edges;
            let moment = first.wrapping_sub(now) as i32;
            if moment > span {
                break;
            }
            opened = moment.wrapping_sub(opened);
            // One change less, and the other way.
            self.state = self.state.wrapping_sub(1) ^ OPEN;
            self.edges = [second, third, fourth, first];
        }
        if self.open() {
            span.wrapping_sub(opened)
        } else {
            opened
        }
    }

    /// What is left at `now` of the shortest pulse under way, µs.
    #[inline]
    fn left(&self, now: u32, times: &ValveTimes) -> i32 {
        let since = now.wrapping_sub(self.changed);
        (times.shortest_pulse as u32).saturating_sub(since) as i32
    }

    /// For how long the chamber will still see the valve open after `now`, the end of the
    /// ticks taken so far, if its coil falls as soon as the shortest pulse allows, µs.
    ///
    /// The time open is the sum of the times of closing less the sum of those of
    /// opening: changes alternate, and the last closes.
    #[inline]
    #[must_use]
    pub fn committed(&self, now: u32, times: &ValveTimes) -> i32 {
        if self.state & (COIL | PENDING) == 0 {
            return 0;
        }
        self.under_way(now, times)
    }

    #[inline(never)]
    fn under_way(&self, now: u32, times: &ValveTimes) -> i32 {
        let [first, second, third, fourth] = self.edges;
        // Without a loop: how many changes there are decides all that is to be done. The
        // moments of an even number of changes need no present to be told from.
        let sum = match self.pending() {
            0 => 0,
            1 => first.wrapping_sub(now),
            2 => second.wrapping_sub(first),
            3 => third
                .wrapping_sub(second)
                .wrapping_add(first)
                .wrapping_sub(now),
            _ => fourth
                .wrapping_sub(third)
                .wrapping_add(second)
                .wrapping_sub(first),
        } as i32;
        if !self.coil() {
            return sum;
        }
        if self.pending() as usize >= EDGES {
            return 0;
        }
        // The fall is the last change, and closes.
        let fall = self.left(now, times);
        fall.wrapping_add(times.off)
            .wrapping_add(times.line)
            .wrapping_sub(sum)
    }

    /// On-time of the tick that begins `now`, at the end of those taken so far, for `need`
    /// µs of opening beyond what is [`ValveTrack::committed`]; `rival` says that the
    /// chamber's other valve is on.
    #[inline]
    #[must_use]
    pub fn on_time(&self, now: u32, need: i32, rival: bool, times: &ValveTimes) -> i32 {
        let pulse = if self.coil() {
            // A few microseconds are not worth a tick.
            let need = if need < 20 { 0 } else { need };
            self.left(now, times).saturating_add(need)
        } else if need > 0 && !rival {
            let shortest = times.shortest_opening();
            let since = now.wrapping_sub(self.changed);
            if since < times.shortest_gap as u32 || need <= shortest.wrapping_mul(5) >> 3 {
                return 0;
            }
            need.max(shortest)
                .saturating_add(times.on)
                .saturating_sub(times.off)
                .max(times.shortest_pulse)
        } else {
            0
        };
        pulse.min(times.tick)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TIMES: ValveTimes = ValveTimes {
        tick: 1000,
        on: 3500,
        off: 2000,
        line: 900,
        shortest_pulse: 3850,
        shortest_gap: 2350,
    };

    fn pulse(length: i32) -> [i32; 20] {
        let mut track = ValveTrack::new();
        let mut left = length;
        core::array::from_fn(|tick| {
            let on = left.clamp(0, 1000);
            left -= on;
            track.advance(1000 * tick as u32, on, &TIMES)
        })
    }

    #[test]
    fn a_pulse_opens_for_its_length_less_on_plus_off_after_the_delay() {
        let opened = pulse(5000);
        assert_eq!(opened.iter().sum::<i32>(), 5000 - 3500 + 2000);
        // Opens at 4.4 ms, shuts at 7.9 ms.
        assert_eq!(opened[3], 0);
        assert_eq!(opened[4], 600);
        assert_eq!(opened[7], 900);
    }

    #[test]
    fn a_pulse_below_t_on_opens_nothing_and_leaves_nothing_behind() {
        assert_eq!(pulse(3400).iter().sum::<i32>(), 0);
        let mut track = ValveTrack::new();
        let on = [
            1000, 1000, 0, 0, 0, 0, 1000, 1000, 1000, 1000, 0, 0, 0, 0, 0, 0,
        ];
        for (on, now) in on.into_iter().zip((0..).step_by(1000)) {
            track.advance(now, on, &TIMES);
        }
        assert!(!track.open() && track.pending() == 0);
    }

    #[test]
    fn a_gap_below_t_off_does_not_shut() {
        let mut track = ValveTrack::new();
        let mut opened = 0;
        let on = [
            1000, 1000, 1000, 1000, 1000, 1000, 500, 1000, 1000, 1000, 1000,
        ];
        // The clock may wrap meanwhile.
        let start = 4000_u32.wrapping_neg();
        track.changed = start.wrapping_sub(1 << 30);
        for (on, tick) in on.into_iter().zip(0_u32..) {
            opened += track.advance(start.wrapping_add(1000 * tick), on, &TIMES);
        }
        assert_eq!(opened, 11_000 - 4400);
    }

    proptest! {
        /// Whatever is sent, the end state follows the coil, and what was
        /// committed is what the chamber then sees.
        #[test]
        fn commitment_is_kept(
            ticks in proptest::collection::vec(0_i32..=1000, 1..80),
        ) {
            let mut track = ValveTrack::new();
            let mut now = 0;
            for on in ticks {
                track.advance(now, on, &TIMES);
                now += 1000;
            }
            let committed = track.committed(now, &TIMES);
            let mut seen = 0;
            for _ in 0..40 {
                let on = track.on_time(now, 0, false, &TIMES);
                seen += track.advance(now, on, &TIMES);
                now += 1000;
            }
            prop_assert_eq!(seen, committed);
            prop_assert!(!track.coil() && !track.open());
        }
    }
}
