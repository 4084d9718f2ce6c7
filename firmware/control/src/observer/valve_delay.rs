//! Valve-delay model: from the current in a coil to the flow at the chamber.
//!
//! ```text
//! coil on at t       the valve opens at t + t_on, the chamber sees it at t + t_on + t_line
//! coil off at t      it shuts at t + t_off, the chamber sees it at t + t_off + t_line
//! on for < t_on      it never opens          off for < t_off    it never shuts
//! opening            = on-time − t_on + t_off
//! ```
//!
//! A pure dead time for each direction, plus the wave's travel time through the line at the speed of sound. Source:
//! data sheets of on/off valves, "response time" (SMC series VQ100, Festo series MHE2). Whole µs, applied to the
//! on-times that are sent.
//!
//! Assumes: delays as specified, the same in every pulse, at every pressure and voltage; the margin of the axis data
//! covers their variation. A valve is either open or shut, and at most four changes of one valve are under way. A
//! falling supply changes nothing here: times are counted, not air.
//!
//! Nothing here measures a delay: it is axis data. A search at start-up
//! (`host-sim/studies/src/axis_sim/delay_probe.rs`, in `wheeleg compare` and `tune`) sends a fill valve pulses that
//! grow by 50 µs until the piston moves: the shortest pulse that moves it is t_on. t_off cannot be seen in this way; it
//! is assumed to differ from its data sheet by the same factor. If the piston does not move, even in a second search
//! with empty chambers, the data-sheet values are kept.
//!
//! Config [`ValveTimes`], state [`ValveTrack`], updates [`ValveTrack::energise`] and [`ValveTrack::passes`].

/// Changes of one valve that can be under way at once.
const EDGES: usize = 4;

/// Timing of the valves, µs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ValveTimes {
    /// Control tick.
    pub tick: i32,
    /// Period between two computations of the law.
    pub period: i32,
    /// Coil on to open, 0…50 000.
    pub on: i32,
    /// Coil off to shut, 0…50 000.
    pub off: i32,
    /// Travel time of the wave through the line, 0…20 000.
    pub line: i32,
    /// Shortest pulse that is sent: t_on plus a margin.
    pub shortest_pulse: i32,
    /// Shortest gap that is left: t_off plus a margin.
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

/// One valve, tracked from its coil. Times are moments of a clock in µs that wraps after 71 minutes. A valve that has
/// been shut for exactly that long (35 minutes from its start) begins its next pulse late, by the shortest gap at most;
/// one energised for exactly that long stays on for the shortest pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ValveTrack {
    /// The coil is on at the end of what has been decided.
    coil: bool,
    /// The chamber sees the valve open.
    open: bool,
    /// Number of changes that the chamber has not seen yet.
    pending: u8,
    /// The moment of each, oldest first; entries beyond `pending` have no meaning.
    edges: [u32; EDGES],
    /// When the coil last changed.
    changed: u32,
}

impl Default for ValveTrack {
    fn default() -> Self {
        Self::new()
    }
}

impl ValveTrack {
    /// Shut for a long time, on a clock that starts at 0.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            coil: false,
            open: false,
            pending: 0,
            edges: [0; EDGES],
            changed: 1 << 31,
        }
    }

    /// Whether the coil is on at the end of what has been decided.
    #[must_use]
    pub const fn coil(&self) -> bool {
        self.coil
    }

    /// How long the coil has been in its present state at the moment `at`, µs.
    #[inline]
    #[must_use]
    pub const fn elapsed(&self, at: u32) -> u32 {
        at.wrapping_sub(self.changed)
    }

    /// Switches the coil at the moment `at`.
    fn change(&mut self, at: u32, times: &ValveTimes) {
        let elapsed = self.elapsed(at);
        let (took, delay) = if self.coil {
            (times.on, times.off)
        } else {
            (times.off, times.on)
        };
        self.coil = !self.coil;
        self.changed = at;
        if elapsed < took as u32 && self.pending > 0 {
            // Reversed before the valve moved: the change under way does not happen.
            self.pending = self.pending.wrapping_sub(1);
        } else if let Some(next) = self.edges.get_mut(usize::from(self.pending)) {
            *next = at.wrapping_add(delay.wrapping_add(times.line) as u32);
            self.pending = self.pending.wrapping_add(1);
        } else {
            // More changes than can be stored: only the final state is known.
            self.pending = 0;
            self.open = self.coil;
        }
    }

    /// Takes the on-time for the `span` µs that begin at `now`: on for `on` µs from there.
    #[inline]
    pub fn energise(&mut self, now: u32, on: i32, span: i32, times: &ValveTimes) {
        if on > 0 && !self.coil {
            self.change(now, times);
        }
        if on < span && self.coil {
            self.change(now.wrapping_add(on as u32), times);
        }
    }

    /// Its coil, which somebody else has driven, is off from the moment `at` on.
    #[inline]
    pub(crate) const fn shuts(&mut self, at: u32) {
        self.changed = at;
    }

    /// How long the chamber sees the valve open within `span` µs from the moment `from`, up to which all changes have
    /// been processed.
    #[inline]
    pub fn passes(&mut self, from: u32, span: i32) -> i32 {
        let (mut seen, mut since) = (0_i32, 0_i32);
        for edge in self.edges {
            let at = edge.wrapping_sub(from) as i32;
            if self.pending == 0 || at > span {
                break;
            }
            if self.open {
                seen = seen.wrapping_add(at.wrapping_sub(since));
            }
            since = at;
            self.open = !self.open;
            self.pending = self.pending.wrapping_sub(1);
            let [first, second, third, fourth] = self.edges;
            self.edges = [second, third, fourth, first];
        }
        if self.open {
            seen = seen.wrapping_add(span.wrapping_sub(since));
        }
        seen
    }

    /// How long, µs, the chamber will still see the valve open after the moment `from`, up to which all changes have
    /// been processed. The coil has been decided up to `next`, and goes off as soon after that as the shortest pulse
    /// allows.
    #[inline]
    #[must_use]
    pub fn committed(&self, from: u32, next: u32, times: &ValveTimes) -> i32 {
        let mut valve = *self;
        if valve.coil {
            let left = (times.shortest_pulse as u32).saturating_sub(valve.elapsed(next));
            valve.change(next.wrapping_add(left), times);
        }
        // Everything under way passes within twice the longest delays.
        valve.passes(from, 1 << 18)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TIMES: ValveTimes = ValveTimes {
        tick: 1000,
        period: 4000,
        on: 3500,
        off: 2000,
        line: 900,
        shortest_pulse: 3850,
        shortest_gap: 2350,
    };

    /// A tick with an on-time; returns how long the valve was open in it.
    fn tick(track: &mut ValveTrack, now: u32, on: i32) -> i32 {
        track.energise(now, on, 1000, &TIMES);
        track.passes(now, 1000)
    }

    fn pulse(length: i32) -> [i32; 20] {
        let mut track = ValveTrack::new();
        let mut left = length;
        core::array::from_fn(|k| {
            let on = left.clamp(0, 1000);
            left -= on;
            tick(&mut track, 1000 * k as u32, on)
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
            tick(&mut track, now, on);
        }
        assert!(!track.open && track.pending == 0);
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
        for (on, k) in on.into_iter().zip(0_u32..) {
            opened += tick(&mut track, start.wrapping_add(1000 * k), on);
        }
        assert_eq!(opened, 11_000 - 4400);
    }

    /// On-time, in the 4 ms from `next`, for the rest of the shortest pulse.
    fn rest_of_pulse(track: &ValveTrack, next: u32) -> i32 {
        if !track.coil {
            return 0;
        }
        let left = i64::from(TIMES.shortest_pulse) - i64::from(track.elapsed(next));
        left.clamp(0, 4000) as i32
    }

    /// How long it is seen open from `now` on if nothing more is demanded.
    fn rest_of(track: &mut ValveTrack, mut now: u32) -> i32 {
        let mut seen = 0;
        for _ in 0..20 {
            let on = rest_of_pulse(track, now);
            track.energise(now, on, 4000, &TIMES);
            seen += track.passes(now, 4000);
            now += 4000;
        }
        seen
    }

    proptest! {
        /// Whatever is sent, the final state follows the coil, and the chamber then sees what was committed.
        #[test]
        fn commitment_is_kept(
            ticks in proptest::collection::vec(0_i32..=1000, 1..80),
        ) {
            let mut track = ValveTrack::new();
            let mut now = 0;
            for on in ticks {
                tick(&mut track, now, on);
                now += 1000;
            }
            let committed = track.committed(now, now, &TIMES);
            let seen = rest_of(&mut track, now);
            prop_assert_eq!(seen, committed);
            prop_assert!(!track.coil && !track.open);
        }

        /// The same for a law that decides a period ahead and looks from before the period begins.
        #[test]
        fn commitment_of_periods_is_kept(
            periods in proptest::collection::vec(0_i32..=6000, 1..40), before in 0_u32..=3000,
        ) {
            let mut track = ValveTrack::new();
            let mut next = 1 << 20;
            let mut from = next - before;
            for need in periods {
                let on = if track.coil || need >= TIMES.shortest_pulse {
                    rest_of_pulse(&track, next).max(need).min(4000)
                } else {
                    0
                };
                track.energise(next, on, 4000, &TIMES);
                track.passes(from, 4000);
                next += 4000;
                from += 4000;
            }
            let committed = track.committed(from, next, &TIMES);
            let mut seen = 0;
            for _ in 0..20 {
                let on = rest_of_pulse(&track, next);
                track.energise(next, on, 4000, &TIMES);
                seen += track.passes(from, 4000);
                next += 4000;
                from += 4000;
            }
            prop_assert_eq!(seen, committed);
            prop_assert!(!track.coil && !track.open);
        }
    }
}
