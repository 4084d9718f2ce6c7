//! Following a valve from its coil to the chamber.
//!
//! The plant's valves open t_on after the coil rises and shut t_off after it
//! falls; a pulse shorter than t_on never opens one, a gap shorter than t_off
//! never shuts it. What the chamber sees comes later by the wave's way through
//! the line. The same rules are followed here, in whole microseconds, on the
//! on-times that are sent, a whole period of the law at once.

use super::mix;

/// A change of a coil is decided no longer ahead than this, µs: a period of 2 ms ticks.
const LONGEST_PLAN: i32 = 8000;
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
    /// Ticks of one computation of the law, all its strokes.
    pub period: i32,
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

    /// Adds itself to a sum. Fields share a word such that a flipped bit of any flips one bit
    /// of it.
    #[inline]
    pub(super) fn sum(&self, sum: u32) -> u32 {
        // Taken apart, so that a new field cannot be forgotten here.
        let Self {
            state,
            edges: [first, second, third, fourth],
            changed,
        } = *self;
        let mut sum = mix(sum, (changed ^ state).cast_signed());
        let pending = state & PENDING;
        if pending > 0 {
            sum = mix(sum, first.cast_signed());
            sum = mix(sum, second.cast_signed());
            if pending > 2 {
                sum = mix(sum, third.cast_signed());
                sum = mix(sum, fourth.cast_signed());
            }
        }
        sum
    }

    /// Whether the coil is on at the end of what has been decided.
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

    /// Takes the on-time of the `span` µs that begin `now`: `on` µs from there.
    #[inline]
    pub fn energise(&mut self, now: u32, on: i32, span: i32, times: &ValveTimes) {
        if on > 0 && !self.coil() {
            self.change(now, times);
        }
        if on < span && self.coil() {
            self.change(now.wrapping_add(on as u32), times);
        }
    }

    /// The coil falls at the moment `at`, or did before.
    #[inline(never)]
    pub(super) fn end(&mut self, at: u32, times: &ValveTimes) {
        if self.coil() {
            self.change(at, times);
        } else {
            self.cut(at, times);
        }
    }

    /// Its coil, which somebody else has driven, is off from the moment `at` on.
    #[inline]
    pub(super) const fn shuts(&mut self, at: u32) {
        self.changed = at;
    }

    /// A coil whose fall was planned for a moment after `at` falls there, because somebody
    /// else decides from then on.
    #[inline]
    pub fn cut(&mut self, at: u32, times: &ValveTimes) {
        let late = self.changed.wrapping_sub(at) as i32;
        if self.coil() || late <= 0 || late > LONGEST_PLAN {
            return;
        }
        let falls = times.off.wrapping_add(times.line) as u32;
        let rises = times.on.wrapping_add(times.line) as u32;
        let planned = self.changed.wrapping_add(falls);
        self.changed = at;
        let pending = self.pending();
        let [first, second, third, fourth] = self.edges;
        let (last, before) = match pending {
            1 => (first, None),
            2 => (second, Some(first)),
            3 => (third, Some(second)),
            _ => (fourth, Some(third)),
        };
        if pending == 0 || last != planned {
            // It does not open the valve.
            return;
        }
        let risen = before.map(|before| before.wrapping_sub(rises));
        if risen.is_some_and(|risen| (at.wrapping_sub(risen) as i32) < times.on) {
            // Nor does one so short.
            self.state = self.state.wrapping_sub(2);
        } else if let Some(last) = self.edges.get_mut(pending.wrapping_sub(1) as usize) {
            *last = at.wrapping_add(falls);
        }
    }

    /// For how long the chamber sees the valve open within `span` µs from the moment `from`,
    /// up to which all changes have passed.
    #[inline]
    pub fn passes(&mut self, from: u32, span: i32) -> i32 {
        if self.pending() > 0 {
            let [first, ..] = self.edges;
            if first.wrapping_sub(from) as i32 <= span {
                return self.pass(from, span);
            }
        }
        if self.open() { span } else { 0 }
    }

    /// Takes the changes within `span` µs from `now`, at least one; gives the time open.
    ///
    /// Without a loop: the time open is that to the end of the span, if the valve is open then,
    /// less the moments of opening, plus those of closing.
    #[inline(never)]
    fn pass(&mut self, now: u32, span: i32) -> i32 {
        let [first, second, third, fourth] = self.edges;
        let [one, two, three, four] = self.edges.map(|edge| edge.wrapping_sub(now) as i32);
        let pending = self.pending();
        let opened = if pending < 2 || two > span {
            self.edges = [second, third, fourth, first];
            self.state = self.state.wrapping_sub(1) ^ OPEN;
            one
        } else if pending < 3 || three > span {
            self.edges = [third, fourth, first, second];
            self.state = self.state.wrapping_sub(2);
            two.wrapping_sub(one)
        } else if pending < 4 || four > span {
            self.edges = [fourth, first, second, third];
            self.state = self.state.wrapping_sub(3) ^ OPEN;
            three.wrapping_sub(two).wrapping_add(one)
        } else {
            self.state = self.state.wrapping_sub(4);
            four.wrapping_sub(three).wrapping_add(two).wrapping_sub(one)
        };
        if self.open() {
            span.wrapping_sub(opened)
        } else {
            opened
        }
    }

    /// What is left at `next` of the shortest pulse under way, µs.
    #[inline]
    fn left(&self, next: u32, times: &ValveTimes) -> i32 {
        let since = next.wrapping_sub(self.changed);
        (times.shortest_pulse as u32).saturating_sub(since) as i32
    }

    /// For how long the chamber will still see the valve open after the moment `from`, up to
    /// which all changes have passed, if its coil falls as soon after `next`, up to which it
    /// is decided, as the shortest pulse allows, µs.
    ///
    /// The time open is the sum of the times of closing less the sum of those of
    /// opening: changes alternate, and the last closes.
    #[inline]
    #[must_use]
    pub fn committed(&self, from: u32, next: u32, times: &ValveTimes) -> i32 {
        let [first, second, ..] = self.edges;
        let pending = self.pending();
        if !self.coil() {
            return match pending {
                0 => 0,
                1 => first.wrapping_sub(from) as i32,
                2 => second.wrapping_sub(first) as i32,
                _ => self.under_way(from),
            };
        }
        // The moments of an even number of changes need no present to be told from.
        let sum = match pending {
            0 => 0,
            1 => first.wrapping_sub(from) as i32,
            _ => self.under_way(from),
        };
        if pending as usize >= EDGES {
            return 0;
        }
        // The fall is the last change, and closes.
        let decided = next.wrapping_sub(from) as i32;
        decided
            .wrapping_add(self.left(next, times))
            .wrapping_add(times.off)
            .wrapping_add(times.line)
            .wrapping_sub(sum)
    }

    /// The last moment under way less the one before it, and so on.
    #[cold]
    #[inline(never)]
    fn under_way(&self, from: u32) -> i32 {
        let [first, second, third, fourth] = self.edges;
        match self.pending() {
            2 => second.wrapping_sub(first) as i32,
            3 => third
                .wrapping_sub(second)
                .wrapping_add(first)
                .wrapping_sub(from) as i32,
            _ => fourth
                .wrapping_sub(third)
                .wrapping_add(second)
                .wrapping_sub(first) as i32,
        }
    }

    /// What it can do in the period that begins `next`, up to which the coil is decided.
    #[inline]
    pub(super) fn ready(&self, next: u32, times: &ValveTimes) -> Ready {
        if self.coil() {
            return Ready(self.left(next, times));
        }
        let since = next.wrapping_sub(self.changed);
        if since < times.shortest_gap as u32 {
            Ready::SHUTS
        } else {
            Ready::SHUT
        }
    }
}

/// What a valve can do in the next period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ready(
    /// What is left of the shortest pulse under way, µs; negative if the coil is off.
    i32,
);

impl Default for Ready {
    fn default() -> Self {
        Self::SHUT
    }
}

impl Ready {
    /// Shut for long enough to begin a pulse.
    const SHUT: Self = Self(-1);
    /// It would not shut in between.
    const SHUTS: Self = Self(-2);

    /// As a word to be sealed.
    #[inline]
    pub(super) const fn word(self) -> i32 {
        self.0
    }

    /// Whether the coil is on at the begin of the period.
    #[inline]
    pub(super) const fn coil(self) -> bool {
        self.0 >= 0
    }

    /// On-time of the period for no opening beyond what is [`ValveTrack::committed`].
    #[inline]
    pub(super) fn rest(self, times: &ValveTimes) -> i32 {
        self.0.max(0).min(times.period)
    }

    /// On-time of the period for `need` µs of opening beyond what is
    /// [`ValveTrack::committed`]; `rival` says that the chamber's other valve is on.
    #[inline]
    pub(super) fn on_time(self, need: i32, rival: bool, times: &ValveTimes) -> i32 {
        let pulse = if self.coil() {
            // A few microseconds are not worth a tick.
            let need = if need < 20 { 0 } else { need };
            self.0.saturating_add(need)
        } else {
            let shortest = times.shortest_opening();
            if rival || self == Self::SHUTS || need <= shortest >> 1 {
                return 0;
            }
            need.max(shortest)
                .saturating_add(times.on)
                .saturating_sub(times.off)
        };
        pulse.min(times.period)
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

    /// A tick with an on-time; gives for how long the valve was open in it.
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
        for (on, k) in on.into_iter().zip(0_u32..) {
            opened += tick(&mut track, start.wrapping_add(1000 * k), on);
        }
        assert_eq!(opened, 11_000 - 4400);
    }

    /// What is seen open from `now` on if nothing is asked for any more.
    fn rest_of(track: &mut ValveTrack, mut now: u32) -> i32 {
        let mut seen = 0;
        for _ in 0..20 {
            let on = track.ready(now, &TIMES).on_time(0, false, &TIMES);
            track.energise(now, on, 4000, &TIMES);
            seen += track.passes(now, 4000);
            now += 4000;
        }
        seen
    }

    #[test]
    fn a_planned_fall_that_is_cut_is_as_one_that_was_sent() {
        // From an idle valve, and from one that opened long ago.
        for before in [0, 10] {
            for cut in 0..4 {
                let mut planned = ValveTrack::new();
                let mut sent = ValveTrack::new();
                let mut now = 0;
                for _ in 0..before {
                    tick(&mut planned, now, 1000);
                    tick(&mut sent, now, 1000);
                    now += 1000;
                }
                planned.energise(now, 3950, 4000, &TIMES);
                planned.cut(now + 1000 * cut, &TIMES);
                for k in 0..4 {
                    sent.energise(now + 1000 * k, if k < cut { 1000 } else { 0 }, 1000, &TIMES);
                }
                let open = |track: &mut ValveTrack| track.passes(now, 30_000);
                assert_eq!(open(&mut planned), open(&mut sent), "{before} {cut}");
                assert!(!planned.coil() && planned.pending() == 0);
            }
        }
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
                tick(&mut track, now, on);
                now += 1000;
            }
            let committed = track.committed(now, now, &TIMES);
            let seen = rest_of(&mut track, now);
            prop_assert_eq!(seen, committed);
            prop_assert!(!track.coil() && !track.open());
        }

        /// The same for a law that decides a period ahead and looks from before its begin.
        #[test]
        fn commitment_of_periods_is_kept(
            periods in proptest::collection::vec(0_i32..=6000, 1..40), before in 0_u32..=3000,
        ) {
            let mut track = ValveTrack::new();
            let mut next = 1 << 20;
            let mut from = next - before;
            for need in periods {
                let on = track.ready(next, &TIMES).on_time(need, false, &TIMES);
                track.energise(next, on, 4000, &TIMES);
                track.passes(from, 4000);
                next += 4000;
                from += 4000;
            }
            let committed = track.committed(from, next, &TIMES);
            let mut seen = 0;
            for _ in 0..20 {
                let on = track.ready(next, &TIMES).on_time(0, false, &TIMES);
                track.energise(next, on, 4000, &TIMES);
                seen += track.passes(from, 4000);
                next += 4000;
                from += 4000;
            }
            prop_assert_eq!(seen, committed);
            prop_assert!(!track.coil() && !track.open());
        }
    }
}
