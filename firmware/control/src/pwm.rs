//! Valve PWM, sliced into control ticks.
//!
//! A hardware timer runs with a period of one control tick (1000 µs), and its compare values take effect at the next
//! tick edge. Here the pulse of the slower valve period (10…20 ms, more for slow valves) is spread over ticks: 7350 µs
//! become seven full ticks and one of 350 µs, always starting at the tick edge.
//!
//! **Switching delays.** A valve opens t_on after its coil is energised and shuts t_off after it is released. For an
//! opening `d` the coil is energised for `p`:
//!
//! ```text
//! d = p − t_on + t_off          p = d + t_on − t_off
//! ```
//!
//! except that:
//!
//! * a pulse below `t_on + margin` may not open the valve at all: it is not sent;
//! * a gap below `t_off + margin` may not shut it: the pulse becomes full.
//!
//! So the possible openings are 0, `t_off + margin` to about `period − t_on − margin`, and the whole period. The law
//! bridges the first gap with [`crate::joint::JointGains::dead_zone_duty`].
//!
//! **Phase.** There is no free-running period. The period of a valve starts with its pulse, so a command to an idle
//! valve takes effect at the next tick edge. While a pulse lasts, its length follows the command (natural sampling): it
//! may grow or end early, but a command that can open the valve does not cut it below the shortest effective pulse. A
//! command of zero ends it at the next tick edge, however short it is. Once ended, it does not start again within the
//! period. A valve switches at most twice per period, and a valve with nothing to do not at all.
//!
//! Source: pulse-width modulation of on/off valves in ticks, DERIVED (docs/decisions/0003-valve-timing.md).
//!
//! Assumes: delays that stay within the margin of the specified ones and are the same for every pulse.

use crate::valve::{VALVE_COUNT, ValveOpenings};
use core::hash::{Hash, Hasher};
use wheeleg_units::Micros;

/// On-time of each valve in the next tick, µs from the tick edge:
/// 0…tick, order `[fill A, vent A, fill B, vent B]`.
pub type OnTimes = [u16; VALVE_COUNT];

/// Why a PWM timing was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum PwmError {
    /// The tick is not in 100…2000 µs.
    Tick,
    /// The period is not a whole number of 2 or more ticks, or is above 1 s.
    Period,
    /// t_on + margin or t_off + margin exceeds half the period: no pulse would
    /// be left between the two.
    Delay,
}

/// Timing of the valves: what is needed to turn an opening into a pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PwmTiming {
    period: u32,
    tick: u32,
    on_delay: u32,
    off_delay: u32,
    shortest_pulse: u32,
    shortest_gap: u32,
}

impl PwmTiming {
    /// A timing with period, control tick, opening delay t_on, shutting delay
    /// t_off, and the margin by which pulses and gaps must exceed them.
    ///
    /// # Errors
    /// See [`PwmError`].
    pub const fn new(
        period: Micros,
        tick: Micros,
        on_delay: Micros,
        off_delay: Micros,
        margin: Micros,
    ) -> Result<Self, PwmError> {
        if tick.get() < 100 || tick.get() > 2000 {
            return Err(PwmError::Tick);
        }
        let whole = matches!(period.get().checked_rem(tick.get()), Some(0));
        if !whole || period.get() <= tick.get() || period.get() > 1_000_000 {
            return Err(PwmError::Period);
        }
        let half = period.get().wrapping_shr(1);
        let shortest_pulse = on_delay.saturating_add(margin).get();
        let shortest_gap = off_delay.saturating_add(margin).get();
        if shortest_pulse > half || shortest_gap > half {
            return Err(PwmError::Delay);
        }
        Ok(Self {
            period: period.get(),
            tick: tick.get(),
            on_delay: on_delay.get(),
            off_delay: off_delay.get(),
            shortest_pulse,
            shortest_gap,
        })
    }

    /// PWM period.
    #[must_use]
    pub const fn period(&self) -> Micros {
        Micros(self.period)
    }

    /// Shortest opening that a pulse can produce, t_off + margin or one microsecond: the smallest non-zero argument for
    /// which [`PwmTiming::pulse`] is not zero.
    #[must_use]
    pub const fn shortest_opening(&self) -> Micros {
        let opening = self
            .shortest_pulse
            .saturating_add(self.off_delay)
            .saturating_sub(self.on_delay);
        Micros(if opening == 0 { 1 } else { opening })
    }

    /// Time for which the coil is energised to get `opening`: 0 if that could not open the valve, the period if the
    /// valve could not shut in between.
    #[must_use]
    pub const fn pulse(&self, opening: Micros) -> Micros {
        if opening.get() >= self.period {
            return Micros(self.period);
        }
        // The sum is below 10^6 + 10^6, the difference saturates at zero; a gap is at most half the period.
        let wanted = opening
            .get()
            .wrapping_add(self.on_delay)
            .saturating_sub(self.off_delay);
        if opening.get() == 0 || wanted < self.shortest_pulse {
            Micros::ZERO
        } else if wanted > self.period.wrapping_sub(self.shortest_gap) {
            Micros(self.period)
        } else {
            Micros(wanted)
        }
    }
}

/// One valve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Channel {
    /// Time since the pulse began, at the next tick edge; 0 without a pulse.
    elapsed: u32,
    /// Length of the pulse that has ended; 0 before it ends. [`DIRECT`]: the PWM makes no pulses.
    ended_at: u32,
    /// Pulses begun since power-on, wrapping.
    pulses: u32,
}

/// Not the length of any pulse, nor a single bit away from one.
const DIRECT: u32 = u32::MAX;

impl Channel {
    const IDLE: Self = Self {
        elapsed: 0,
        ended_at: 0,
        pulses: 0,
    };

    /// On-time of the next tick for a pulse of length `pulse` ([`PwmTiming::pulse`]).
    #[inline]
    fn tick(&mut self, timing: &PwmTiming, pulse: u32) -> u16 {
        if self.ended_at != 0 {
            // A new pulse may begin once the valve has had time to shut.
            let off = self.elapsed.wrapping_sub(self.ended_at);
            if self.elapsed < timing.period || off < timing.shortest_gap {
                self.elapsed = self.elapsed.wrapping_add(timing.tick);
                return 0;
            }
            self.elapsed = 0;
            self.ended_at = 0;
        }
        if self.elapsed == 0 {
            if pulse == 0 {
                return 0;
            }
            self.pulses = self.pulses.wrapping_add(1);
        } else if self.elapsed >= timing.period && pulse > 0 {
            // A full pulse continues: the next period follows without a gap.
            self.elapsed = 0;
        }
        // Below twice the period, which is at most a second.
        let on = pulse.saturating_sub(self.elapsed).min(timing.tick);
        if on < timing.tick {
            // Not zero: a pulse that has begun has some length.
            self.ended_at = self.elapsed.wrapping_add(on);
        }
        self.elapsed = self.elapsed.wrapping_add(timing.tick);
        // At most the tick, 2000.
        on as u16
    }

    /// The same channel without the pulse under way.
    const fn freed(self) -> Self {
        Self {
            pulses: self.pulses,
            ..Self::IDLE
        }
    }
}

impl Hash for Channel {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Destructured, so that a new field cannot be forgotten here. The pulse count affects no output.
        let Self {
            elapsed,
            ended_at,
            pulses: _,
        } = self;
        state.write_u32(*elapsed);
        state.write_u32(*ended_at);
    }
}

/// The sliced PWM of the four valves of a cylinder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ValvePwm {
    timing: PwmTiming,
    channels: [Channel; VALVE_COUNT],
    /// Valves that were on in the last tick of [`ValvePwm::direct`], one bit each: 15, 31, 14, 30.
    given: u32,
}

impl ValvePwm {
    /// All valves shut and idle.
    #[must_use]
    pub const fn new(timing: PwmTiming) -> Self {
        Self {
            timing,
            channels: [Channel::IDLE; VALVE_COUNT],
            given: 0,
        }
    }

    /// The timing in use.
    #[must_use]
    pub const fn timing(&self) -> &PwmTiming {
        &self.timing
    }

    /// What a tick changes: everything but the timing, to be sealed separately from it.
    #[inline]
    #[must_use]
    pub const fn state(&self) -> State<'_> {
        State(self)
    }

    /// Changes the timing; periods under way end by the new one.
    pub const fn set_timing(&mut self, timing: PwmTiming) {
        self.timing = timing;
    }

    /// On-times of the next tick for the wanted openings per period. An opening of a whole period or more keeps a valve
    /// open without a gap. Never panics.
    #[must_use]
    pub fn tick(&mut self, openings: &ValveOpenings) -> OnTimes {
        if self.is_direct() {
            self.channels = self.channels.map(Channel::freed);
        }
        let mut on = [0; VALVE_COUNT];
        // Pulse of the last opening: usually two valves open for the same time.
        let (mut last, mut pulse) = (Micros::ZERO, 0);
        for ((on, channel), &opening) in on.iter_mut().zip(&mut self.channels).zip(&openings.0) {
            let pulse = if opening == Micros::ZERO {
                0
            } else {
                if opening != last {
                    (last, pulse) = (opening, self.timing.pulse(opening).get());
                }
                pulse
            };
            *on = channel.tick(&self.timing, pulse);
        }
        on
    }

    /// Shuts all valves at the next tick edge: hold, brake, fault. The same as [`ValvePwm::tick`] with
    /// [`ValveOpenings::SHUT`].
    #[must_use]
    pub fn shut(&mut self) -> OnTimes {
        self.tick(&ValveOpenings::SHUT)
    }

    /// On-times that a law has chosen itself, at most a tick each: passed through and counted. Afterwards the PWM
    /// starts with idle valves.
    #[must_use]
    pub fn direct(&mut self, on: OnTimes) -> OnTimes {
        if !self.is_direct() {
            self.channels = self.channels.map(Channel::freed);
            let [first, ..] = &mut self.channels;
            first.ended_at = DIRECT;
            self.given = 0;
        }
        // Two on-times per word; each is below 2^15 and carries into its sixteenth bit unless it is 0.
        let given = |low: u16, high: u16| {
            let both = u32::from(low) | u32::from(high).wrapping_shl(16);
            both.wrapping_add(0x7FFF_7FFF) & 0x8000_8000
        };
        debug_assert!(on.iter().all(|on| u32::from(*on) <= self.timing.tick));
        let [a, b, c, d] = on;
        let given = given(a, b) | given(c, d).wrapping_shr(1);
        let begun = given & !self.given;
        if begun != 0 {
            for (channel, bit) in self.channels.iter_mut().zip([15, 31, 14, 30]) {
                channel.pulses = channel.pulses.wrapping_add((begun >> bit) & 1);
            }
        }
        self.given = given;
        on
    }

    /// Whether the last tick was one of [`ValvePwm::direct`].
    #[inline]
    const fn is_direct(&self) -> bool {
        let [first, ..] = &self.channels;
        first.ended_at == DIRECT
    }

    /// Pulses begun per valve since power-on, wrapping: the switching count. Consecutive periods without a gap count as
    /// one pulse.
    #[must_use]
    pub fn pulses(&self) -> [u32; VALVE_COUNT] {
        self.channels.map(|channel| channel.pulses)
    }
}

/// See [`ValvePwm::state`].
#[derive(Clone, Copy, Debug)]
pub struct State<'a>(&'a ValvePwm);

impl Hash for State<'_> {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Destructured, so that a new field cannot be forgotten here.
        let ValvePwm {
            timing: _,
            channels: [first, rest @ ..],
            // Affects no output.
            given: _,
        } = self.0;
        first.hash(state);
        if first.ended_at != DIRECT {
            let [a, b, c] = rest;
            (a, b, c).hash(state);
        }
    }
}
