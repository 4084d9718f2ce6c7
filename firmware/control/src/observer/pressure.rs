//! Pressure observer: ISO 6358 flow into a polytropic chamber, with bounds on the pressure.
//!
//! ```text
//! Δp = n (K p_s ψ(p̄/p_s) t_fill − K p̄ ψ(p_a/p̄) t_vent − p v T) / L         K = C ρ0 R T0 / A
//! p̄  = (p + p expected a period ago) / 2           for p, and for p expected, too
//! Δp⁻, Δp⁺: the same with p⁻, p⁺ for both p and p̄
//! ```
//!
//! | | unit | |
//! |---|---|---|
//! | p, p_s, p_a | Pa | pressure of the chamber at the last moment, of the supply, of the atmosphere, absolute |
//! | p⁻, p⁺ | Pa | bounds of p: at first p_a and p_s |
//! | p expected | Pa | pressure at the end of the dead time |
//! | t_fill, t_vent | s | how long each valve was open in the period, as seen by the chamber |
//! | T | s | the period |
//! | v | mm/s | speed of the piston, positive where the chamber grows |
//! | L | mm | volume of the chamber with its line over its area A |
//! | K | mm/s | choked speed: the piston speed at which an open outlet holds the pressure; T0 = 293 K, C and ρ0 as in [`super::flow`] |
//! | ψ | 1 | flow over choked flow, [`super::flow`] |
//! | n | 1 | polytropic exponent, 1.2: between isothermal (1) and adiabatic (1.4) |
//!
//! Source: chamber of Bobrow and McDonell 1998 and Pandian et al. 2002; flow of ISO 6358-1.
//!
//! The observer is open loop: there is no pressure sensor. Errors die out by themselves: a filling chamber ends at the
//! supply and a venting one at the atmosphere, whatever was assumed before. The flow is monotone in p, so both bounds
//! keep their order, and their distance says how far the estimate can be off. The estimate itself is not held within
//! them: its flow is that at p̄, so it may lie outside them by the error of a step. The bounds are used only
//! after a move: their distance by [`super::mass`], both by `identification`. They hold as long as the assumptions do.
//!
//! Assumes: supply and atmosphere as specified, tight seals, no flow except through the valves. If the supply is lower,
//! a chamber that is filled ends below the estimate, and below p⁻, too: the bounds no longer hold. Venting makes
//! estimate and bounds right again.
//!
//! Per period and chamber there is one explicit step from moment to moment, with the mean length and speed of that
//! time; then one over the dead time, with the pulses under way and the speed at the moment, for the expected pressure;
//! and one for each bound. No step goes beyond what valves and motion can do: up to the supply while a fill valve is
//! open or about to open, down to the atmosphere while a vent valve is, and otherwise half the atmosphere and 2.1 MPa.
//! So even the smallest chamber is stable.
//!
//! Config [`AxisModel`], state [`Chamber`], update [`Chamber::update`].

use super::flow::power;
use super::valve_delay::ValveTrack;
use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat};
use crate::tuning::{AIR_LEFT_SHIFT, CHAMBER_LENGTH_MIN, PRESSURE_MAX, VACUUM_SHIFT};

/// Pressures of A and B in 1/256 Pa absolute.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Pressures {
    /// Bore side.
    pub a: i32,
    /// Rod side.
    pub b: i32,
}

/// The present period on the clock of the valves, µs; wraps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Period {
    /// When it begins.
    pub(crate) begin: u32,
    /// When the next one begins, up to which the coils have been decided.
    pub(crate) next: u32,
    /// The moment at which pressures and motion are estimated: [`AxisModel::moment`] after the beginning.
    pub(crate) moment: u32,
}

/// A chamber's geometry, and how the piston changes it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ChamberMotion {
    /// Choked speed K, raw mm/s.
    pub(crate) choked_speed: i32,
    /// Length of the chamber in the middle of the period that ends at the moment, and at the end of the dead time, raw
    /// mm.
    pub(crate) lengths: [i32; 2],
    /// Speed at which the chamber shrinks, in that period and in the dead time, raw mm/s.
    pub(crate) speeds: [i32; 2],
}

/// What was sent to the valves of a chamber, and how long something else had them open.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sent {
    /// On-times of the period from its beginning, µs: fill, vent.
    pub(crate) plan: [u16; 2],
    /// Openings that others made in it, without their delays, µs: fill, vent.
    pub(crate) external: [u16; 2],
}

/// Pressure and pulses under way of one chamber.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Chamber {
    pub(crate) fill: ValveTrack,
    pub(crate) vent: ValveTrack,
    /// Pressure at the moment, 1/256 Pa.
    pub(crate) pressure: i32,
    /// The same at the end of the dead time, including what has been committed by then.
    pub(crate) expected: i32,
    /// Bounds p⁻ and p⁺ of the pressure at the moment.
    pub(crate) bounds: [i32; 2],
}

impl Chamber {
    /// Valves shut, at `pressure`, which lies somewhere within `bounds` (1/256 Pa absolute).
    pub(crate) const fn new(pressure: i32, bounds: [i32; 2]) -> Self {
        Self {
            fill: ValveTrack::new(),
            vent: ValveTrack::new(),
            pressure,
            expected: pressure,
            bounds,
        }
    }

    /// One period: pressures at its moment and at the end of the dead time.
    pub(crate) fn update(
        &mut self,
        model: &AxisModel,
        period: &Period,
        motion: &ChamberMotion,
        sent: Sent,
    ) {
        let times = &model.times;
        let from = period.moment.wrapping_sub(times.period as u32);
        let mut open = [0; 2];
        let mut committed = [0; 2];
        let tracks = [&mut self.fill, &mut self.vent];
        for (valve, track) in tracks.into_iter().enumerate() {
            let (plan, external) = (sent.plan.get(valve), sent.external.get(valve));
            let external = external.map_or(0, |on| i32::from(*on));
            track.energise(
                period.begin,
                plan.map_or(0, |on| i32::from(*on)),
                times.period,
                times,
            );
            if external > 0 {
                // It is not known when its coil went off.
                track.shuts(period.next);
            }
            let seen = track.passes(from, times.period).wrapping_add(external);
            let later = track.committed(period.moment, period.next, times);
            if let (Some(open), Some(committed)) = (open.get_mut(valve), committed.get_mut(valve)) {
                *open = seen;
                *committed = later;
            }
        }

        let [length, length_ahead] = motion.lengths;
        let [speed, speed_ahead] = motion.speeds;
        let n_per_length = model.exponent_per_length(length);
        let both = [open[0] | committed[0], open[1] | committed[1]];
        let limits = limits(model, both);
        // At the mean pressure of the two steps; the end of the second was predicted a period ago.
        let mean = self.pressure.saturating_add(self.expected) >> 1;
        let powers = Powers::at(model, motion.choked_speed, mean, both);
        let step = |p: i32, powers: &Powers, open, speed, span, n_per_length| {
            within_limits(
                p.saturating_add(powers.change(open, power(p, speed), span, n_per_length)),
                limits,
            )
        };
        self.pressure = step(
            self.pressure,
            &powers,
            open,
            speed,
            times.period,
            n_per_length,
        );
        self.expected = step(
            self.pressure,
            &powers,
            committed,
            speed_ahead,
            model.dead_time_us,
            model.exponent_per_length(length_ahead),
        );
        self.bounds = self.bounds.map(|p| {
            let powers = Powers::at(model, motion.choked_speed, p, open);
            step(p, &powers, open, speed, times.period, n_per_length)
        });
    }

    /// A move has revealed that the pressure was wrong by this share (× 2^16) of the width of its bounds. The new
    /// bounds describe the remaining uncertainty.
    pub(crate) fn correct(&mut self, share: i32) {
        let [low, high] = self.bounds;
        let width = high.saturating_sub(low);
        let wrong = mul_shr_sat(width, share, 16);
        let pressure = self.pressure.saturating_add(wrong).max(low).min(high);
        let moved = pressure.saturating_sub(self.pressure);
        self.expected = self.expected.saturating_add(moved).max(low).min(high);
        self.pressure = pressure;
        let left = width.wrapping_shr(AIR_LEFT_SHIFT);
        self.bounds = [
            low.max(pressure.saturating_sub(left)),
            high.min(pressure.saturating_add(left)),
        ];
    }

    /// Everything that others have sent is over with the tick that ends at `end`. `plan` is what was sent of the period
    /// that began at `begin`, fill and vent, µs.
    pub(crate) fn release(&mut self, model: &AxisModel, begin: u32, end: u32, plan: [u16; 2]) {
        let span = end.wrapping_sub(begin) as i32;
        for (track, on) in [&mut self.fill, &mut self.vent].into_iter().zip(plan) {
            track.energise(begin, i32::from(on), span, &model.times);
            track.energise(end, 0, 1, &model.times);
        }
    }
}

/// Powers of the open valves of a chamber over its piston area: pressure times speed, in 2^8 Pa mm/s
/// (1 Pa mm/s is 1 mW/m²).
#[derive(Clone, Copy, Debug, Default)]
struct Powers {
    fill: i32,
    vent: i32,
}

impl Powers {
    /// Powers at `pressure` of the valves that are `open` at all.
    fn at(model: &AxisModel, choked_speed: i32, pressure: i32, [fill, vent]: [i32; 2]) -> Self {
        Self {
            fill: if fill > 0 {
                model.fill_power(choked_speed, pressure)
            } else {
                0
            },
            vent: if vent > 0 {
                model.vent_power(choked_speed, pressure)
            } else {
                0
            },
        }
    }

    /// Change of pressure in 1/256 Pa with the valves open for `fill` and `vent` µs and with the piston delivering the
    /// power `compression` for `span` µs, in a chamber of `n_per_length` ([`AxisModel::exponent_per_length`]).
    fn change(
        &self,
        [fill, vent]: [i32; 2],
        compression: i32,
        span: i32,
        n_per_length: i32,
    ) -> i32 {
        let product = |power: i32, us: i32| i64::from(power).wrapping_mul(i64::from(us));
        // Powers below 2^28, times below 2^18: in 2^24 Pa mm/s µs below 2^31.
        let work = product(self.fill, fill)
            .wrapping_sub(product(self.vent, vent))
            .wrapping_add(product(compression, span))
            .wrapping_add(1 << 15)
            .wrapping_shr(16) as i32;
        // × n/L: see `AxisModel::exponent_per_length`.
        mul_shr_sat(work, n_per_length, 10)
    }
}

/// Limits of a pressure while valves are open or about to open. No valve fills beyond the supply or vents below the
/// atmosphere, however long a step is for a small chamber; and no motion is assumed to pull the pressure below half the
/// atmosphere.
const fn limits(model: &AxisModel, [fill, vent]: [i32; 2]) -> [i32; 2] {
    [
        if vent > 0 {
            model.ambient
        } else {
            model.ambient.wrapping_shr(VACUUM_SHIFT)
        },
        if fill > 0 { model.supply } else { PRESSURE_MAX },
    ]
}

/// `p` within these limits.
fn within_limits(p: i32, [least, most]: [i32; 2]) -> i32 {
    p.max(least).min(most)
}

impl AxisModel {
    /// Length of chamber A with the piston at `stroke`, raw mm.
    #[inline]
    #[must_use]
    pub(crate) const fn length_a(&self, stroke: i32) -> i32 {
        stroke.saturating_add(self.dead_length_a)
    }

    /// Length of chamber B.
    #[inline]
    #[must_use]
    pub(crate) const fn length_b(&self, stroke: i32) -> i32 {
        self.stroke
            .saturating_sub(stroke)
            .saturating_add(self.dead_length_b)
    }

    /// n / L of a chamber of `length` (raw mm), × 1.048576 × 2^22 / mm: a work of 2^24 Pa mm/s µs times this is in
    /// 2^-18 Pa.
    #[inline]
    #[must_use]
    pub(crate) fn exponent_per_length(&self, length: i32) -> i32 {
        let short = length.wrapping_shr(8).max(CHAMBER_LENGTH_MIN);
        self.exponent.checked_div(short).unwrap_or(0)
    }

    /// Power over area of an open fill valve with this choked speed (raw mm/s) into a chamber at `pressure`: K p_s ψ.
    #[inline]
    pub(crate) fn fill_power(&self, choked_speed: i32, pressure: i32) -> i32 {
        self.curve.power(self.supply, pressure, choked_speed)
    }

    /// Power over area of an open vent valve, K p ψ; positive lowers the pressure.
    #[inline]
    pub(crate) fn vent_power(&self, choked_speed: i32, pressure: i32) -> i32 {
        self.curve.power(pressure, self.ambient, choked_speed)
    }

    /// Force of the two pressures, mN, positive extending.
    #[inline]
    #[must_use]
    pub fn pressure_force(&self, p: Pressures) -> i32 {
        mul_shr(p.a, self.force_a, 32)
            .saturating_sub(mul_shr(p.b, self.force_b, 32))
            .saturating_sub(self.force_rod)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    use wheeleg_units::{Micros, PositionMm};

    fn model() -> AxisModel {
        AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default")
    }

    /// State of a chamber after this many periods, with valves open for these times in each of them.
    fn followed(
        model: &AxisModel,
        mut chamber: Chamber,
        motion: &ChamberMotion,
        open: [u16; 2],
        periods: u32,
    ) -> Chamber {
        let sent = Sent {
            plan: [0; 2],
            external: open,
        };
        for number in 0..periods {
            let begin = number * 4000;
            let period = Period {
                begin,
                next: begin + 4000,
                moment: begin + 2500,
            };
            chamber.update(model, &period, motion, sent);
        }
        chamber
    }

    /// A piston that stands at mid stroke.
    fn at_rest(model: &AxisModel) -> ChamberMotion {
        ChamberMotion {
            choked_speed: model.choked_speed_a,
            lengths: [model.length_a(90 << 16); 2],
            speeds: [0; 2],
        }
    }

    /// Whatever the pressure was, filling ends at the supply and venting at the atmosphere; the bounds contain it all
    /// the way, and close.
    #[test]
    fn errors_of_the_pressure_die_out_and_the_bounds_close() {
        let model = model();
        let unknown = [model.ambient, model.supply];
        for (open, end) in [([4000, 0], model.supply), ([0, 4000], model.ambient)] {
            for start in [model.ambient, model.mean, model.supply] {
                let mut chamber = Chamber::new(start, unknown);
                let mut width = model.supply - model.ambient;
                for _ in 0..400 {
                    chamber = followed(&model, chamber, &at_rest(&model), open, 1);
                    let [low, high] = chamber.bounds;
                    assert!(low <= chamber.pressure + 256 && chamber.pressure <= high + 256);
                    assert!(low <= high && high - low <= width);
                    width = high - low;
                }
                assert!((chamber.pressure - end).abs() < 2_000 << 8, "{start}");
                assert!(width < 5_000 << 8, "{width}");
            }
        }
    }

    /// With the valves shut nothing is learnt.
    #[test]
    fn a_chamber_that_is_shut_keeps_its_pressure_and_its_bounds() {
        let model = model();
        let start = Chamber::new(model.mean, [model.ambient, model.supply]);
        let chamber = followed(&model, start, &at_rest(&model), [0, 0], 50);
        assert_eq!(
            (chamber.pressure, chamber.bounds),
            (start.pressure, start.bounds)
        );
    }

    /// A chamber, with its bounds, that is shut while the piston compresses it at this speed for 2 s.
    fn compressed(speed_mm_s: i32) -> Chamber {
        let model = model();
        let chamber = Chamber::new(model.mean, [model.ambient, model.supply]);
        let motion = ChamberMotion {
            choked_speed: model.choked_speed_a,
            lengths: [90 << 16; 2],
            speeds: [speed_mm_s << 16; 2],
        };
        followed(&model, chamber, &motion, [0; 2], 500)
    }

    /// 2.1 MPa: at the fastest speed of the format its power is below 2^28, like those of the valves.
    #[test]
    fn air_that_is_compressed_ends_at_a_pressure_that_fits() {
        let chamber = compressed(500);
        for p in [chamber.pressure, chamber.expected]
            .into_iter()
            .chain(chamber.bounds)
        {
            let megapascals = f64::from(p) / 256e6;
            assert!((2.05..2.15).contains(&megapascals), "{megapascals}");
            assert!(power(p, i32::MAX) < 1 << 28);
        }
    }

    #[test]
    fn air_that_is_stretched_ends_at_half_the_atmosphere() {
        let chamber = compressed(-500);
        for p in [chamber.pressure, chamber.expected]
            .into_iter()
            .chain(chamber.bounds)
        {
            let kilopascals = f64::from(p) / 256e3;
            assert!((50.5..50.8).contains(&kilopascals), "{kilopascals}");
        }
    }

    /// Corrected by a quarter of the width, leaving an eighth on each side uncertain, and never beyond the bounds.
    #[test]
    fn a_pressure_is_corrected_within_its_bounds() {
        let model = model();
        let bounds = [model.ambient, model.supply];
        let width = model.supply - model.ambient;
        let mut chamber = Chamber::new(model.mean, bounds);
        chamber.correct(1 << 14);
        assert!((chamber.pressure - model.mean - width / 4).abs() < 256);
        assert_eq!(chamber.expected, chamber.pressure);
        let [low, high] = chamber.bounds;
        for half in [chamber.pressure - low, high - chamber.pressure] {
            assert!((half - width / 8).abs() < 256, "{half}");
        }
        let mut chamber = Chamber::new(model.mean, bounds);
        chamber.correct(-(1 << 16));
        assert_eq!(chamber.pressure, model.ambient);
        assert_eq!(chamber.bounds[0], model.ambient);
    }

    /// n/L of a chamber without dead volume is that of a length of 4 mm.
    #[test]
    fn a_chamber_is_never_shorter_than_its_line() {
        let model = AxisModel::new(
            &AxisData {
                bore: PositionMm::from_int(100),
                dead_a: PositionMm::from_f64(0.05),
                ..AxisData::default()
            },
            Micros(1000),
        )
        .expect("in range");
        let per_length = |tenths: i32| model.exponent_per_length((tenths << 16) / 10);
        assert_eq!(per_length(0), per_length(39));
        assert!(per_length(42) < per_length(39));
        let exact = 1.2 * 1.048_576 * 2_f64.powi(22) / 4.0;
        assert!((f64::from(per_length(0)) / exact - 1.0).abs() < 1e-3);
    }
}
