//! Estimates the air in the chambers, and the force that it should produce.
//!
//! A board has no pressure sensor, but it knows every on-time it has commanded and every stroke it has read. From these
//! [`Air`] estimates both chambers, for supervision only, whatever law drives. It is cheap rather than exact: each
//! chamber is updated in every third tick. Volumes are lengths, volume over piston area, and with n = 1.2 a chamber of
//! length L obeys
//!
//! ```text
//! Δp = n (C' t_fill ψ_s − C' t_vent ψ_v p − p Δx) / L        C' = C ρ0 R T / area
//! ```
//!
//! Flow is choked up to a pressure ratio b and falls off beyond it; the chord `min(1, 3 (1 − r)/(1 − b))` approximates
//! the ellipse of ISO 6358, and is at most 0.2 off it. Switching delays are neglected while the piston moves: a pulse
//! of a control law opens a valve for nearly as long as it lasts, and the remaining error is learnt together with the
//! load.
//!
//! During rest nothing corrects the estimate. If a valve is slower than specified, a short pulse may have no effect at
//! all, and pulse after pulse the estimate would gain force that does not exist. So at rest only what is certain
//! counts: a valve is certainly open once it has been energised for nearly twice its specified opening time
//! ([`SLOWER_FIFTHS`]).
//!
//! The content of the chambers at power-up is unknown. It no longer matters once both have certainly been vented for a
//! while, so that time is counted, too.

use core::hash::{Hash, Hasher};
use wheeleg_control::axis::AxisModel;
use wheeleg_control::pwm::OnTimes;
use wheeleg_units::{Micros, PositionMm, divide_signed};

/// Supply pressure in the unit of [`Air`].
pub(super) const SUPPLY: i32 = 1 << 17;
/// Highest pressure that is tracked: four times the supply.
const MOST: i32 = 4 * SUPPLY;
/// Ticks of a round: one for each chamber, one to evaluate them.
pub(super) const ROUND: u16 = 3;
/// Largest motion and flow of a round, raw mm (4 mm): keeps every product within its bounds.
const STEP: i32 = 4 << 16;
/// Polytropic exponent × 2^8 (ASSUMED: 1.2, usual for small cylinders).
const EXPONENT: i32 = 307;
/// Time of a valve that is energised throughout a round, µs.
const WHOLE: u32 = 1000 * ROUND as u32;
/// Bits for a valve's time in a round, and above them for the number of whole rounds before it …
const TIME: u32 = 0xFFF;
const ROUNDS: u32 = 0xF000;
/// … of which this is one.
const ONE: u32 = 0x1000;
const _: () = assert!(WHOLE <= TIME, "a round fits its bits");
/// Longest opening time of a valve as a multiple of the specified one, in fifths (ASSUMED: small direct-acting valves
/// of one type differ by about twice with age, temperature and supply voltage; with exactly twice, faults after the
/// first motions are found much later: FAULTS.md).
const SLOWER_FIFTHS: u32 = 9;
/// Pressure that a chamber with shut valves may lose in a round.
const LEAK: i32 = 4 * ROUND as i32;
/// Vented times are counted in units of 64 µs.
const VENTED_SHIFT: u32 = 6;

/// One chamber, from the axis data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
struct Chamber {
    /// Length of its dead volume, 1/256 mm.
    lead: i32,
    /// n C', mm × 2^24 per µs of opening.
    flow: i32,
    /// Force at the supply pressure, mN.
    force: i32,
}

impl Chamber {
    /// From a dead length in raw mm, a flow in raw mm/s and a force in mN per 1/256 Pa × 2^32.
    #[inline(never)]
    fn new(axis: &AxisModel, lead: i32, flow: i32, force: i32) -> Self {
        // Raw mm/s to mm × 2^24 per µs: × 2^8 / 10^6; `EXPONENT` provides the 2^8.
        let flow = i64::from(flow).wrapping_mul(i64::from(EXPONENT));
        let flow = divide_signed(flow, 1_000_000);
        Self {
            lead: lead >> 8,
            flow: clipped(flow).clamp(1, 1 << 19),
            force: clipped(i64::from(axis.supply).wrapping_mul(i64::from(force)) >> 32),
        }
    }
}

/// `value` as a coefficient, saturating.
fn clipped(value: i64) -> i32 {
    i32::try_from(value).unwrap_or(i32::MAX)
}

/// Time that a chamber of `length` takes at the speed `flow`, µs.
#[inline(never)]
fn time(length: i32, flow: i32) -> i64 {
    if flow == 0 {
        return i64::MAX;
    }
    divide_signed(i64::from(length).wrapping_mul(1_000_000), i64::from(flow))
}

/// Parameters of the air of an axis.
///
/// For valves with a specified opening time above 25 ms (`valve_t_on`; up to 50 ms are allowed) nothing is ever
/// certain: no chamber counts as vented, nothing is learnt, and missing motion (fault 44) is not detected. Nine fifths
/// of 25 ms are the 15 rounds that are counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct AirModel {
    a: Chamber,
    b: Chamber,
    /// Full stroke, raw mm.
    stroke: i32,
    /// Ambient pressure, in the unit of [`Air`].
    ambient: i32,
    /// 3/(1 − b), × 2^8.
    fall: i32,
    /// Force of the atmosphere on the rod, mN.
    rod: i32,
    /// Time after which a vented chamber is known, in units of 64 µs.
    known: u16,
    /// Whole rounds after which an energised valve is certainly open, in [`ONE`]; never, if they are more than can be
    /// counted.
    slow: u32,
}

impl AirModel {
    /// From the axis's coefficients and the specified opening time of its valves.
    #[inline(never)]
    pub(super) fn new(axis: &AxisModel, valve_on: Micros) -> Self {
        let share = i64::from(axis.ambient).wrapping_shl(17);
        // 18/16 of the time for both chambers together.
        let both = time(
            axis.dead_length_a.saturating_add(axis.stroke),
            axis.choked_speed_a,
        )
        .saturating_add(time(axis.dead_length_b, axis.choked_speed_b));
        let slow = valve_on.get().saturating_mul(SLOWER_FIFTHS) / 5;
        let known = both.saturating_mul(18) >> (4_u32.wrapping_add(VENTED_SHIFT));
        Self {
            a: Chamber::new(axis, axis.dead_length_a, axis.choked_speed_a, axis.force_a),
            b: Chamber::new(axis, axis.dead_length_b, axis.choked_speed_b, axis.force_b),
            stroke: axis.stroke,
            ambient: clipped(divide_signed(share, i64::from(axis.supply))),
            fall: clipped(i64::from(axis.curve.stretch).wrapping_mul(3) >> 11),
            rod: axis.force_rod,
            known: u16::try_from(known).unwrap_or(u16::MAX),
            slow: slow.div_ceil(WHOLE).saturating_mul(ONE),
        }
    }

    /// Largest forces of this supply, extending and retracting, mN, both positive.
    pub(super) const fn largest(&self) -> [i32; 2] {
        let left = SUPPLY.wrapping_sub(self.ambient) as i64;
        [
            (left.wrapping_mul(self.a.force as i64) >> 17) as i32,
            (left.wrapping_mul(self.b.force as i64) >> 17) as i32,
        ]
    }

    /// Absolute pressure of the atmosphere, 2^-17 of the supply pressure.
    pub(super) const fn ambient(&self) -> i32 {
        self.ambient
    }

    /// A pulse of the inlet of B or A with the piston at `position`. Returns its opening, which fills a 64th of the
    /// supply pressure in choked flow and is limited to `shortest` and `longest`, and its force, mN.
    #[inline(never)]
    pub(super) fn pulse(
        &self,
        b: bool,
        position: PositionMm,
        shortest: Micros,
        longest: Micros,
    ) -> (Micros, i32) {
        let (chamber, length) = if b {
            (&self.b, self.stroke.wrapping_sub(position.raw()))
        } else {
            (&self.a, position.raw())
        };
        // Share of the supply = time · flow / (length · 2^16), with lengths in 1/256 mm.
        let length = (length >> 8).wrapping_add(chamber.lead).max(0);
        let time = length.cast_unsigned().saturating_mul(1 << 10);
        let time = time.checked_div(chamber.flow.cast_unsigned()).unwrap_or(0);
        let opening = time.max(shortest.get()).min(longest.get());
        // How many 64ths the opening gives, in sixteenths, at most all of them.
        let parts = opening.saturating_mul(16).checked_div(time);
        let parts = parts.unwrap_or(u32::MAX).min(16 * 64).cast_signed();
        (Micros(opening), (chamber.force >> 10).wrapping_mul(parts))
    }

    /// What a valve that is open for `on` µs lets into a chamber: the equivalent piston travel, raw mm, times the
    /// driving pressure, which falls off to zero as `drop` does.
    #[inline(always)]
    fn through(&self, chamber: &Chamber, on: u32, drop: i32, [least, most]: [i32; 2]) -> i64 {
        // At most a round, and flows of at most 2^19: below 2^31.
        let way = ((on as i32).wrapping_mul(chamber.flow) >> 8).min(STEP);
        let chord = drop.wrapping_mul(self.fall) >> 8;
        i64::from(chord.max(least).min(most)).wrapping_mul(i64::from(way))
    }

    /// Pressure of a chamber of `length` (1/256 mm) at `p` after gaining `sum`, pressure × raw mm.
    #[inline(always)]
    fn after(&self, p: i32, length: i32, sum: i64) -> i32 {
        // Converted to pressure × mm × 2^8, below 2^31; the length is at least a millimetre.
        let change = ((sum >> 8) as i32)
            .checked_div(length.max(256))
            .unwrap_or(0);
        // Not `clamp`: bounds in the wrong order would panic.
        p.saturating_add(change).max(self.ambient >> 1).min(MOST)
    }
}

/// Air in one chamber.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Content {
    /// Pressure in 2^-17 of the supply pressure, absolute.
    p: i32,
    /// Length, without the dead length, at which the pressure holds, raw mm.
    length: i32,
    /// How long its valves have been energised since then, µs, plus × 2^12 the number of whole rounds before, at most
    /// 15: fill, and vent × 2^16.
    open: u32,
    /// How long it has certainly been vented since it was last unknown, in units of 64 µs.
    vented: u16,
}

impl Hash for Content {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Destructured, so that a new field cannot be forgotten here. A flipped bit of pressure or time flips a bit of
        // the word.
        let Self {
            p,
            length,
            open,
            vented,
        } = self;
        state.write_i32(*p ^ i32::from(*vented).wrapping_shl(16));
        state.write_i32(*length);
        state.write_u32(*open);
    }
}

impl Content {
    /// At this pressure and length, with unknown history.
    const fn at(p: i32, length: i32) -> Self {
        Self {
            p,
            length,
            open: 0,
            vented: 0,
        }
    }

    /// A tick in which its valves are energised for `fill` and `vent` µs.
    #[inline]
    fn opens(&mut self, fill: u16, vent: u16) {
        // Over a round of ticks each stays below 2^12.
        let open = u32::from(fill) | u32::from(vent).wrapping_shl(16);
        self.open = self.open.wrapping_add(open);
    }

    /// Updates to `length`; the full time of its valves counts, or only the certain part.
    #[inline(never)]
    fn follow(&mut self, length: i32, chamber: &Chamber, model: &AirModel, certain: bool) {
        let moved = length.wrapping_sub(self.length);
        let open = self.open;
        // Noise of a reading at rest moves no air.
        if open == 0 && moved.wrapping_abs() < 1 << 13 {
            return;
        }
        let p = self.p;
        // No piston moves that far: it is another calibration, or the first reading.
        let shrinks = if moved.wrapping_abs() > STEP {
            0
        } else {
            moved.wrapping_mul(EXPONENT.wrapping_neg()) >> 8
        };
        // Pressures are below 2^19, lengths of a round up to 2^18: sums below 2^39.
        let mut sum = i64::from(p).wrapping_mul(i64::from(shrinks));
        // For a valve of which nothing is ever certain, the count of rounds restarts after 15.
        let mut next = 0;
        if open & 0xFFFF != 0 {
            let (time, sure, rounds) = taken(open, model.slow);
            let on = if certain { sure } else { time };
            let drop = SUPPLY.wrapping_sub(p);
            sum = sum.wrapping_add(model.through(chamber, on, drop, [i32::MIN, SUPPLY]));
            next = rounds & 0xFFFF;
        }
        if open > 0xFFFF {
            let (time, sure, rounds) = taken(open.wrapping_shr(16), model.slow);
            let on = if certain { sure } else { time };
            let drop = model.ambient.wrapping_sub(p);
            let most = [p.wrapping_neg(), i32::MAX];
            sum = sum.wrapping_add(model.through(chamber, on, drop, most));
            next |= rounds.wrapping_shl(16);
            // Below 2^16.
            self.vented = self.vented.saturating_add((sure >> VENTED_SHIFT) as u16);
        }
        self.open = next;
        self.length = length;
        let length = (length >> 8).wrapping_add(chamber.lead);
        self.p = model.after(p, length, sum);
    }
}

/// For one valve: how long it was energised in this round, µs, how long of that it was certainly open, and the count
/// with which the next round starts.
///
/// Only the sum of a round is known. If a valve that is certainly open is shut and energised again within one round,
/// the second pulse also counts as certain: at most 2 ms of air that may not be there, and only in this round, because
/// after a round that is not whole the count restarts.
#[inline(always)]
fn taken(open: u32, slow: u32) -> (u32, u32, u32) {
    let time = open & TIME;
    let whole = open & ROUNDS;
    let (sure, next) = if whole < slow {
        (0, whole.wrapping_add(ONE))
    } else {
        (time, whole)
    };
    (time, sure, if time < WHOLE { 0 } else { next })
}

/// Air in both chambers, tracked in rounds of [`ROUND`] ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Air {
    a: Content,
    b: Content,
    /// Index in its round of the tick that comes next.
    turn: u8,
}

impl Air {
    /// At atmospheric pressure, as far as the board knows.
    pub(super) const fn unknown(model: &AirModel, position: PositionMm) -> Self {
        let stroke = position.raw();
        Self {
            a: Content::at(model.ambient, stroke),
            b: Content::at(model.ambient, model.stroke.wrapping_sub(stroke)),
            turn: 0,
        }
    }

    /// Whether the coming tick is the third of a round, in which no chamber is updated.
    #[inline]
    pub(super) const fn ends_round(&self) -> bool {
        self.turn >= 2
    }

    /// A tick that ends at `position`, with these on-times; with `certain`, for a piston that stands, only their
    /// certain part counts. A's pressure is updated in the first tick of a round, B's in the second. Returns true in
    /// the third, which has room for the evaluation.
    #[inline]
    pub(super) fn follow(
        &mut self,
        on: &OnTimes,
        position: PositionMm,
        model: &AirModel,
        certain: bool,
    ) -> bool {
        let [fill_a, vent_a, fill_b, vent_b] = *on;
        self.a.opens(fill_a, vent_a);
        self.b.opens(fill_b, vent_b);
        let stroke = position.raw();
        let (content, chamber, length) = match self.turn {
            0 => (&mut self.a, &model.a, stroke),
            1 => (&mut self.b, &model.b, model.stroke.wrapping_sub(stroke)),
            _ => {
                self.turn = 0;
                return true;
            }
        };
        content.follow(length, chamber, model, certain);
        self.turn = self.turn.wrapping_add(1);
        false
    }

    /// Force of both pressures, mN, positive extends.
    #[inline(never)]
    pub(super) fn force(&self, model: &AirModel) -> i32 {
        let part = |p: i32, force: i32| (i64::from(p).wrapping_mul(i64::from(force)) >> 17) as i32;
        part(self.a.p, model.a.force)
            .saturating_sub(part(self.b.p, model.b.force))
            .saturating_sub(model.rod)
    }

    /// Pressures in A and B, 2^-17 of the supply pressure.
    pub(super) const fn pressures(&self) -> [i32; 2] {
        [self.a.p, self.b.p]
    }

    /// The content of the chambers is no longer known: air has had time to leak.
    pub(super) const fn forget(&mut self) {
        self.a.vented = 0;
        self.b.vented = 0;
    }

    /// This many rounds with all valves shut: a chamber may have lost air. It is a bar in 4.7 s for a supply of 7 bar
    /// (ASSUMED: twice what the seals of this project's cylinders leak where the chamber is smallest; if this is too
    /// much, the air is refilled at the next arming; if too little, it would be missing).
    #[inline]
    pub(super) fn leak(&mut self, model: &AirModel, rounds: u16) {
        // At most a few bar per minute: it fits.
        let lost = LEAK.wrapping_mul(i32::from(rounds));
        for content in [&mut self.a, &mut self.b] {
            if content.p > model.ambient {
                content.p = content.p.wrapping_sub(lost).max(model.ambient);
            }
        }
    }

    /// Whether both chambers have been vented for long enough to compare forces with the learnt one: certainly for a
    /// sixteenth of the time after which they are known, which takes pulses of several times as much in total.
    #[inline]
    pub(super) fn is_comparable(&self, model: &AirModel) -> bool {
        self.a.vented.min(self.b.vented) >= model.known >> 4
    }

    /// Whether the opposing chamber is known to have been emptied.
    #[inline]
    pub(super) fn is_known(&self, extends: bool, model: &AirModel) -> bool {
        let opposing = if extends { &self.b } else { &self.a };
        opposing.vented >= model.known
    }

    /// Whether a chamber should hold more than eleven eighths of the supply: then a valve or a seal has let out air
    /// that should be in it.
    #[inline]
    pub(super) fn is_impossible(&self) -> bool {
        self.a.p.max(self.b.p) > SUPPLY + SUPPLY * 3 / 8
    }
}

#[cfg(test)]
mod tests;
