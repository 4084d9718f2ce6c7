//! The air that the valves should have brought, and the force that it should make.
//!
//! A board has no pressure sensor, but it knows every on-time it has sent and every
//! stroke it has read. [`Air`] follows both chambers with that, for supervision only,
//! whatever law drives: cheap rather than exact. Volumes are lengths, volume over
//! piston area, and with n = 1.2 a chamber of length L obeys
//!
//! ```text
//! Δp = n (C' t_fill ψ_s − C' t_vent ψ_v p − p Δx) / L        C' = C ρ0 R T / area
//! ```
//!
//! Flow is choked up to a pressure ratio b and falls off beyond it; the chord
//! `min(1, 3 (1 − r)/(1 − b))` stands for the ellipse of ISO 6358, at most 0.2 off it.
//! Switching delays are left out: a pulse of a control law opens a valve for nearly as
//! long as it lasts, and a few milliseconds are a few newtons.
//!
//! What was in the chambers at power-up nobody knows. It no longer matters once both
//! have been vented for a while, so that is counted, too.

use wheeleg_control::axis::AxisModel;
use wheeleg_control::pwm::OnTimes;
use wheeleg_units::PositionMm;

/// Supply pressure in the unit of [`Air`].
const SUPPLY: i32 = 1 << 17;
/// Highest pressure that is followed: four times the supply.
const MOST: i32 = 4 * SUPPLY;
/// Largest motion and flow of a tick, raw mm (2 mm): keeps every product below 2^31.
const STEP: i32 = 2 << 16;
/// Polytropic exponent × 2^8 (ASSUMED: 1.2, usual for small cylinders).
const EXPONENT: i32 = 307;
/// Vented times count in 64 µs.
const VENTED_SHIFT: u32 = 6;

/// One chamber as its axis's data give it.
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
    /// Of a dead length in raw mm, a flow in raw mm/s and a force in mN per 1/256 Pa × 2^32.
    #[inline(never)]
    fn new(axis: &AxisModel, lead: i32, flow: i32, force: i32) -> Self {
        // Raw mm/s to mm × 2^24 per µs: × 2^8 / 10^6, which the exponent's 2^8 is.
        let flow = i64::from(flow)
            .wrapping_mul(i64::from(EXPONENT))
            .wrapping_div(1_000_000);
        Self {
            lead: lead >> 8,
            flow: clipped(flow).clamp(1, 1 << 19),
            force: clipped(i64::from(axis.supply).wrapping_mul(i64::from(force)) >> 32),
        }
    }
}

/// As a coefficient, saturating.
fn clipped(value: i64) -> i32 {
    i32::try_from(value).unwrap_or(i32::MAX)
}

/// What a chamber of `length` takes at `flow`, µs.
#[inline(never)]
fn time(length: i32, flow: i32) -> i64 {
    i64::from(length)
        .wrapping_mul(1_000_000)
        .checked_div(i64::from(flow))
        .unwrap_or(i64::MAX)
}

/// What the air of an axis obeys.
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
    /// Time after which a vented chamber is known, in 64 µs.
    known: u16,
}

impl AirModel {
    /// From the axis's coefficients.
    #[inline(never)]
    pub(super) fn new(axis: &AxisModel) -> Self {
        let share = i64::from(axis.ambient).wrapping_shl(17);
        // 18/16 of what both chambers take together.
        let both = time(axis.lead_a.saturating_add(axis.stroke), axis.flow_a)
            .saturating_add(time(axis.lead_b, axis.flow_b));
        let known = both.saturating_mul(18) >> (4_u32.wrapping_add(VENTED_SHIFT));
        Self {
            a: Chamber::new(axis, axis.lead_a, axis.flow_a, axis.force_a),
            b: Chamber::new(axis, axis.lead_b, axis.flow_b, axis.force_b),
            stroke: axis.stroke,
            ambient: clipped(share.checked_div(i64::from(axis.supply)).unwrap_or(0)),
            fall: clipped(i64::from(axis.curve.stretch).wrapping_mul(3) >> 7),
            rod: axis.force_rod,
            known: u16::try_from(known).unwrap_or(u16::MAX),
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

    /// Pressure of a chamber of `length` (1/256 mm) after a tick with its valves open
    /// for `fill` and `vent` µs, in which its length grew by `growth` (raw mm).
    #[inline(never)]
    fn after(&self, p: i32, chamber: &Chamber, length: i32, on: [u16; 2], growth: i32) -> i32 {
        let [fill, vent] = on.map(|on| (i32::from(on).wrapping_mul(chamber.flow) >> 8).min(STEP));
        let chord = |drop: i32| drop.wrapping_mul(self.fall) >> 8;
        let filling = chord(SUPPLY.wrapping_sub(p)).min(SUPPLY);
        let venting = chord(p.wrapping_sub(self.ambient)).min(p);
        // Pressures below 2^19, lengths of a tick below 2^18: sums below 2^39.
        let sum = i64::from(filling)
            .wrapping_mul(i64::from(fill))
            .wrapping_sub(i64::from(venting).wrapping_mul(i64::from(vent)))
            .wrapping_sub(i64::from(p).wrapping_mul(i64::from(growth)));
        // To pressure × mm × 2^8, below 2^31; at least a millimetre long.
        let change = ((sum >> 8) as i32)
            .checked_div(length.max(256))
            .unwrap_or(0);
        // Not `clamp`: bounds in the wrong order would be a panic.
        p.saturating_add(change).max(self.ambient >> 1).min(MOST)
    }
}

/// Air in both chambers, in 2^-17 of the supply pressure, absolute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Air {
    a: i32,
    b: i32,
    /// Stroke for which the pressures stand, raw mm.
    stroke: i32,
    /// For how long each chamber has been vented since it was last unknown, in 64 µs.
    vented: [u16; 2],
}

impl Air {
    /// At the atmosphere, for all the board knows.
    pub(super) const fn unknown(model: &AirModel, position: PositionMm) -> Self {
        Self {
            a: model.ambient,
            b: model.ambient,
            stroke: position.raw(),
            vented: [0; 2],
        }
    }

    /// A tick that ends at `position`, with these on-times.
    #[inline(never)]
    pub(super) fn follow(&mut self, on: &OnTimes, position: PositionMm, model: &AirModel) {
        let stroke = position.raw();
        let moved = stroke.wrapping_sub(self.stroke);
        // Noise of a reading at rest moves no air.
        if *on == [0; 4] && moved.wrapping_abs() < 1 << 13 {
            return;
        }
        self.stroke = stroke;
        // No piston goes that far in a tick: another calibration, or the first reading.
        let moved = if moved.wrapping_abs() > STEP {
            0
        } else {
            moved
        };
        let grown = moved.wrapping_mul(EXPONENT) >> 8;
        let [fill_a, vent_a, fill_b, vent_b] = *on;
        let length_a = (stroke >> 8).wrapping_add(model.a.lead);
        let length_b = (model.stroke.wrapping_sub(stroke) >> 8).wrapping_add(model.b.lead);
        self.a = model.after(self.a, &model.a, length_a, [fill_a, vent_a], grown);
        self.b = model.after(
            self.b,
            &model.b,
            length_b,
            [fill_b, vent_b],
            grown.wrapping_neg(),
        );
        let [a, b] = self.vented;
        self.vented = [
            a.saturating_add(vent_a >> VENTED_SHIFT),
            b.saturating_add(vent_b >> VENTED_SHIFT),
        ];
    }

    /// Force of both pressures, mN, positive extends.
    #[inline(never)]
    pub(super) fn force(&self, model: &AirModel) -> i32 {
        let part = |p: i32, force: i32| (i64::from(p).wrapping_mul(i64::from(force)) >> 17) as i32;
        part(self.a, model.a.force)
            .saturating_sub(part(self.b, model.b.force))
            .saturating_sub(model.rod)
    }

    /// What is in the chambers is no longer known: air has had time to leak.
    pub(super) const fn forget(&mut self) {
        self.vented = [0; 2];
    }

    /// Whether both chambers have been vented for long enough to compare forces with
    /// what was learnt: a quarter of the time after which they are known.
    #[inline]
    pub(super) fn is_comparable(&self, model: &AirModel) -> bool {
        let [a, b] = self.vented;
        a.min(b) >= model.known >> 2
    }

    /// Whether the chamber that opposes is known to have been emptied.
    #[inline]
    pub(super) fn is_known(&self, extends: bool, model: &AirModel) -> bool {
        let [a, b] = self.vented;
        let opposing = if extends { b } else { a };
        opposing >= model.known
    }

    /// Whether a chamber should hold more than eleven eighths of the supply: a
    /// valve or a seal has let out what should be in it.
    #[inline]
    pub(super) fn is_impossible(&self) -> bool {
        self.a.max(self.b) > SUPPLY + SUPPLY * 3 / 8
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::JOINT_TICK;
    use wheeleg_control::axis::AxisData;

    const MIDDLE: PositionMm = PositionMm::from_int(90);

    fn model() -> AirModel {
        AirModel::new(&AxisModel::new(&AxisData::default(), JOINT_TICK).unwrap())
    }

    /// Absolute pressures in bar after so many ticks with these on-times.
    fn after(ticks: u32, on: OnTimes, start: [f64; 2], model: &AirModel) -> [f64; 2] {
        let raw = |bar: f64| (bar / 7.01325 * f64::from(SUPPLY)) as i32;
        let mut air = Air {
            a: raw(start[0]),
            b: raw(start[1]),
            ..Air::unknown(model, MIDDLE)
        };
        for _ in 0..ticks {
            air.follow(&on, MIDDLE, model);
        }
        [air.a, air.b].map(|p| f64::from(p) / f64::from(SUPPLY) * 7.01325)
    }

    #[test]
    fn choked_flow_fills_at_a_constant_rate_and_empties_by_an_exponential() {
        let model = model();
        // C ρ0 R T: 0.085 dm³/(s bar) × 0.9972 bar; A: π/4 × 20² × 90 mm³ + 15.1 cm³.
        let volume_a = core::f64::consts::PI * 100.0 * 90.0 / 1e6 + 0.0151;
        let rate = 1.2 * 0.085 * 0.9972 * 7.01325 / volume_a;
        let [a, _] = after(100, [1000, 0, 0, 0], [1.2, 1.2], &model);
        assert!((a - 1.2 - rate * 0.1).abs() < 0.03, "{a} {rate}");
        let volume_b = core::f64::consts::PI * (100.0 - 16.0) * 90.0 / 1e6 + 0.0151;
        let [_, b] = after(100, [0, 0, 0, 1000], [7.0, 7.0], &model);
        let left = 7.0 * (-1.2 * 0.085 * 0.9972 / volume_b * 0.1_f64).exp();
        assert!((b - left).abs() < 0.03, "{b} {left}");
        // Both end where they must.
        let [a, b] = after(3000, [1000, 0, 0, 1000], [1.0, 7.0], &model);
        assert!(
            (a - 7.013).abs() < 0.01 && (b - 1.013).abs() < 0.01,
            "{a} {b}"
        );
        // Half the time open is half the air.
        let [half, _] = after(200, [500, 0, 0, 0], [1.2, 1.2], &model);
        let [full, _] = after(100, [1000, 0, 0, 0], [1.2, 1.2], &model);
        assert!((half - full).abs() < 0.01, "{half} {full}");
    }

    #[test]
    fn a_piston_that_moves_squeezes_by_the_polytropic_law() {
        let model = model();
        let mut air = Air::unknown(&model, MIDDLE);
        let (a, b) = (f64::from(air.a), f64::from(air.b));
        for step in 0..=600 {
            let at = PositionMm::from_raw((90 << 16) + step * 6554);
            air.follow(&[0; 4], at, &model);
        }
        let length = |lead: f64, stroke: f64| lead + stroke;
        let [lead_a, lead_b] = [model.a.lead, model.b.lead].map(|lead| f64::from(lead) / 256.0);
        let law = |from: f64, to: f64| (from / to).powf(1.2);
        let falls = law(length(lead_a, 90.0), length(lead_a, 150.0));
        let rises = law(length(lead_b, 90.0), length(lead_b, 30.0));
        assert!((f64::from(air.a) / a / falls - 1.0).abs() < 0.02);
        assert!((f64::from(air.b) / b / rises - 1.0).abs() < 0.02);
        // A new calibration moves no air, and noise none either.
        let before = air;
        air.follow(&[0; 4], MIDDLE, &model);
        air.follow(&[0; 4], PositionMm::from_raw((90 << 16) + 5000), &model);
        assert_eq!((air.a, air.b), (before.a, before.b));
    }

    #[test]
    fn forces_are_pressures_times_areas() {
        let model = model();
        let (bore, rod) = (core::f64::consts::PI * 100.0, core::f64::consts::PI * 16.0);
        let [out, back] = model.largest().map(|force| f64::from(force) / 1e3);
        assert!((out - 0.6 * bore).abs() < 0.2, "{out}");
        assert!((back - 0.6 * (bore - rod)).abs() < 0.2, "{back}");
        let mut air = Air::unknown(&model, MIDDLE);
        assert!(air.force(&model).abs() < 100, "{}", air.force(&model));
        air.a = SUPPLY;
        assert!((f64::from(air.force(&model)) / 1e3 - out).abs() < 0.2);
        (air.a, air.b) = (model.ambient, SUPPLY);
        assert!((f64::from(air.force(&model)) / 1e3 + back).abs() < 0.2);
    }

    #[test]
    fn what_has_been_vented_is_known() {
        let model = model();
        let mut air = Air::unknown(&model, MIDDLE);
        // 18/16 of 1.03 s.
        let mut vent = |ticks, on| (0..ticks).for_each(|_| air.follow(&on, MIDDLE, &model));
        vent(280, [0, 1000, 1000, 0]);
        vent(280, [1000, 0, 0, 1000]);
        assert!(!air.is_comparable(&model));
        let mut vent = |ticks, on| (0..ticks).for_each(|_| air.follow(&on, MIDDLE, &model));
        vent(30, [0, 1000, 1000, 0]);
        vent(30, [1000, 0, 0, 1000]);
        assert!(air.is_comparable(&model) && !air.is_known(true, &model));
        let mut vent = |ticks, on| (0..ticks).for_each(|_| air.follow(&on, MIDDLE, &model));
        vent(920, [1000, 0, 0, 1000]);
        assert!(air.is_known(true, &model) && !air.is_known(false, &model));
        air.forget();
        assert!(!air.is_comparable(&model) && !air.is_known(true, &model));
    }

    #[test]
    fn extremes_of_the_parameters_stay_in_their_bounds() {
        for (bore, conductance) in [(4, 20.0), (100, 0.006), (100, 20.0), (4, 0.006)] {
            let data = AxisData {
                bore: PositionMm::from_int(bore),
                rod: PositionMm::from_int(1),
                conductance: wheeleg_control::joint::Gain::from_num(conductance),
                supply: PositionMm::from_int(1700),
                ..AxisData::default()
            };
            let model = AirModel::new(&AxisModel::new(&data, JOINT_TICK).unwrap());
            let mut air = Air::unknown(&model, MIDDLE);
            for tick in 0..4000_u32 {
                let on = if tick % 1000 < 500 {
                    [1000, 0, 0, 1000]
                } else {
                    [0, 1000, 1000, 0]
                };
                let at = PositionMm::from_raw((90 << 16) + (tick % 2) as i32 * STEP);
                air.follow(&on, at, &model);
                let bounds = (model.ambient >> 1)..=MOST;
                assert!(bounds.contains(&air.a) && bounds.contains(&air.b));
            }
        }
    }
}
