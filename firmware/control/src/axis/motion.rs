//! Stroke, speed and load from the measured stroke and the pressure force.

use super::model::AxisModel;
use super::{clip, mix, part, quotient, scaled, within};

/// Slower than this, raw mm/s, a piston held by its friction counts as stuck (4 mm/s).
const STICK: i32 = 4 << 16;

/// Slower than this, raw mm/s, a piston that is pressed against an end stop stays there (20 mm/s).
const REBOUND: i32 = 20 << 16;

/// A piston that stands so near to an end stop leans on it, raw mm (1 mm).
const STOP_ZONE: i32 = 1 << 16;

/// Length before an end stop in which a cushion may act, raw mm (6 mm).
const CUSHION: i32 = 6 << 16;

/// Share of the friction told that the observer counts on, × 2^16 (0.92): what is less than told
/// would let it overlook speed.
const RUBS: i32 = 60_293;

/// Least mass that is counted on, kg × 2^16 (0.02 kg): the least that may be told.
const LIGHTEST: i32 = 1311;

/// What follows from the moving mass; worked out when that changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inertia {
    /// Mass, kg × 2^16.
    pub mass: i32,
    /// mm/s² per mN, × 2^24.
    pub per_force: i32,
    /// Slope of the speed law, 1/s × 2^8.
    pub slope: i32,
    /// Gain of the speed error, 1/s × 2^8.
    pub damping: i32,
    /// Deceleration towards the target, mm/s².
    pub brake: i32,
    /// 1/(2 slope²), s² × 2^32.
    pub linear: i32,
    /// Load per innovation, mN/mm.
    pub load_gain: i32,
    /// Speed that Coulomb friction takes off in a period, raw mm/s.
    pub rubbed: i32,
    /// Speed that it takes off in the dead time, raw mm/s.
    pub rubbed_ahead: i32,
    /// Sum of all these.
    check: u32,
}

impl Inertia {
    /// None yet: there is no such mass.
    pub const TO_BE_MADE: Self = Self {
        mass: 0,
        per_force: 0,
        slope: 0,
        damping: 0,
        brake: 0,
        linear: 0,
        load_gain: 0,
        rubbed: 0,
        rubbed_ahead: 0,
        check: 0,
    };

    /// Whether it is [`Inertia::TO_BE_MADE`].
    #[inline]
    #[must_use]
    pub const fn is_to_be_made(&self) -> bool {
        self.mass == 0
    }

    /// For a mass in kg × 2^16; gains fall with the cube root of what the mass
    /// exceeds the axis's nimble mass by.
    // Seldom: small rather than fast.
    #[cold]
    #[inline]
    #[must_use]
    pub fn new(model: &AxisModel, mass: i32) -> Self {
        let mass = mass.max(LIGHTEST);
        let unsigned = mass.cast_unsigned();
        // 1/kg = mm/s² per mN: 2^(24+16) / raw kg.
        let per_force = quotient(1 << 40, unsigned, 0);
        let share = if mass > model.nimble_mass {
            cube_root(part(model.nimble_mass, per_force, 10).cast_unsigned())
        } else {
            1 << 16
        };
        // Shares are at most 1: what they are of fits as before.
        let squared = part(share, share, 16);
        let slope = part(model.slope, share, 16).max(1 << 8);
        // 2^32 / (2 slope²) with slope × 2^8, below 2^16: 2^47 / slope².
        let square = slope.cast_unsigned().wrapping_mul(slope.cast_unsigned());
        let rubs = scaled(part(model.coulomb, RUBS, 16), per_force, 24);
        let made = Self {
            mass,
            per_force,
            slope,
            damping: part(model.damping, share, 16),
            // Below 2^18 mm/s², 27 g: the speed law takes it × 2^13.
            brake: part(model.brake, squared, 16).min((1 << 18) - 1),
            linear: quotient(1 << 47, square, 0),
            // Below 2^27: times an innovation it fits.
            load_gain: part(model.observe_load, mass, 16).min((1 << 27) - 1),
            rubbed: scaled(rubs, model.period, 16),
            rubbed_ahead: scaled(rubs, model.horizon, 16),
            check: 0,
        };
        Self {
            check: made.sum(),
            ..made
        }
    }

    #[inline]
    fn sum(&self) -> u32 {
        // Taken apart, so that a new field cannot be forgotten here.
        let Self {
            mass,
            per_force,
            slope,
            damping,
            brake,
            linear,
            load_gain,
            rubbed,
            rubbed_ahead,
            check: _,
        } = *self;
        let sum = 0;
        let sum = mix(sum, mass);
        let sum = mix(sum, per_force);
        let sum = mix(sum, slope);
        let sum = mix(sum, damping);
        let sum = mix(sum, brake);
        let sum = mix(sum, linear);
        let sum = mix(sum, load_gain);
        let sum = mix(sum, rubbed);
        mix(sum, rubbed_ahead)
    }

    /// Whether all of it is as it was made.
    #[inline]
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.check == self.sum()
    }

    /// Acceleration of a force in mN, mm/s², within ±2^21 (213 g): what it gains in 8 ms fits
    /// raw mm/s.
    #[inline]
    #[must_use]
    pub fn acceleration(&self, force: i32) -> i32 {
        // Forces below 2^25 mN (33 kN), 2^40 over the least mass below 2^30: it fits.
        clip::<22>(part(clip::<26>(force), self.per_force, 24))
    }
}

/// Cube root, × 2^16, of a share × 2^30 of at most one.
///
/// Newton's method on a share that is brought into 1/8…1 by shifts of three bits: the
/// chord is within a ninth of the root there, and a step squares that.
fn cube_root(share: u32) -> i32 {
    if share >= 1 << 30 {
        return 1 << 16;
    }
    if share == 0 {
        return 0;
    }
    let third = share.leading_zeros().wrapping_sub(2) / 3;
    let near = share.wrapping_shl(third.wrapping_mul(3)).wrapping_shr(14);
    // The chord from 1/8 to 1.
    let mut root = near
        .wrapping_mul(9362)
        .wrapping_shr(14)
        .wrapping_add(28_087);
    for _ in 0..3 {
        let square = root.wrapping_mul(root.min((1 << 16) - 1)).wrapping_shr(16);
        let step = near.wrapping_shl(16).checked_div(square).unwrap_or(0);
        root = root.wrapping_mul(2).wrapping_add(step) / 3;
    }
    root.wrapping_shr(third) as i32
}

/// Estimated motion, of the moment of a period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Motion {
    /// Stroke, raw mm.
    pub stroke: i32,
    /// Speed, raw mm/s.
    pub speed: i32,
    /// Force from outside and what the model does not know, mN, positive extends.
    pub load: i32,
    /// Speed gained in the last period, raw mm/s.
    pub gained: i32,
    /// Held by its friction.
    pub stuck: bool,
}

/// What is left of a speed that loses `taken` to friction, which turns nothing round.
#[inline]
pub(super) fn rubbed(speed: i32, taken: i32) -> i32 {
    speed.saturating_sub(within(speed, taken))
}

impl Motion {
    /// Adds itself to a sum.
    #[inline]
    pub(super) fn sum(&self, sum: u32) -> u32 {
        // Taken apart, so that a new field cannot be forgotten here.
        let Self {
            stroke,
            speed,
            load,
            gained,
            stuck,
        } = *self;
        // A flipped bit of either flips one of it.
        let gained = gained ^ i32::from(stuck).wrapping_shl(31);
        mix(mix(mix(mix(sum, stroke), speed), load), gained)
    }

    /// Within a millimetre of an end stop.
    #[must_use]
    pub fn at_stop(&self, model: &AxisModel) -> bool {
        self.stroke < STOP_ZONE || self.stroke > model.stroke.saturating_sub(STOP_ZONE)
    }

    /// Within a millimetre of an end stop, with a `target` (raw mm) more than one behind it; or, for a
    /// piston that `lingers` there, less than one before it.
    #[inline]
    #[must_use]
    pub fn leans(&self, model: &AxisModel, target: i32, lingers: bool) -> bool {
        let zone = if lingers { STOP_ZONE } else { -STOP_ZONE };
        let far = model.stroke.saturating_sub(STOP_ZONE);
        (self.stroke < STOP_ZONE && target < zone)
            || (self.stroke > far && target > model.stroke.saturating_sub(zone))
    }

    /// One period, in which the chambers made `force` in the mean.
    #[inline]
    pub fn predict(&mut self, model: &AxisModel, inertia: &Inertia, force: i32) {
        let drive = force.saturating_add(self.load);
        // Pressed against an end stop, the stop takes what is left of the force.
        let against_stop = if drive > 0 {
            self.stroke > model.stroke.saturating_sub(STOP_ZONE)
        } else {
            self.stroke < STOP_ZONE
        };
        // A rebound from it is over within the period.
        self.stuck = if against_stop {
            (self.speed ^ drive) >= 0 || self.speed.wrapping_abs() < REBOUND
        } else {
            self.speed.wrapping_abs() < STICK && drive.saturating_abs() < model.breakaway
        };
        let speed = if self.stuck {
            // A bit more than half of it.
            part(self.speed, 38_400, 16)
        } else {
            let sliding = drive.saturating_sub(part(self.speed, model.viscous, 24));
            // mm/s² × s × 2^32 to raw mm/s: / 2^16.
            let gained = part(inertia.acceleration(sliding), model.period, 16);
            rubbed(self.speed.saturating_add(gained), inertia.rubbed)
        };
        self.gained = speed.saturating_sub(self.speed);
        let mean = self.speed.saturating_add(self.gained.wrapping_shr(1));
        self.stroke = self.stroke.saturating_add(part(mean, model.period, 32));
        self.speed = speed;
    }

    /// Corrects with the stroke measured at the moment; gives by how much that is more.
    #[inline]
    pub fn correct(&mut self, model: &AxisModel, inertia: &Inertia, measured: i32) {
        // Below 2^19; the shares below 2^24: what follows fits.
        let innovation = within(measured.saturating_sub(self.stroke), 8 << 16);
        self.stroke = self
            .stroke
            .saturating_add(part(innovation, model.observe_stroke, 16));
        self.speed = self
            .speed
            .saturating_add(part(innovation, model.observe_speed, 16));
        // Near an end the cushion brakes: that is no load.
        let cushioned = if self.speed > 0 {
            self.stroke > model.stroke.saturating_sub(CUSHION)
        } else {
            self.stroke < CUSHION
        };
        if !self.stuck && !cushioned {
            let load = self
                .load
                .saturating_add(part(innovation, inertia.load_gain, 16));
            self.load = within(load, model.force_out.max(model.force_in));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Inertia, Motion, STICK, cube_root};
    use crate::axis::{AxisData, AxisModel};
    use wheeleg_units::{Micros, PositionMm};

    #[test]
    fn a_light_piston_that_stands_is_seen_to_stand() {
        let data = AxisData::default();
        let model = AxisModel::new(&data, Micros(1000)).expect("the default");
        for mass in [1 << 14, 1 << 15, 1 << 16, 3 << 16] {
            let inertia = Inertia::new(&model, mass);
            for speed in [-40, -7, 7, 40] {
                let place = 90 << 16;
                let mut motion = Motion {
                    stroke: place,
                    speed: speed << 16,
                    ..Motion::default()
                };
                for _ in 0..50 {
                    motion.predict(&model, &inertia, 0);
                    motion.correct(&model, &inertia, place);
                }
                assert!(
                    motion.stuck && motion.speed.abs() < STICK / 4,
                    "{mass}: {motion:?}"
                );
            }
        }
    }

    #[test]
    fn every_flipped_bit_of_what_follows_from_the_mass_is_seen() {
        let model = AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default");
        let sound = Inertia::new(&model, 3 << 16);
        assert!(sound.is_sound());
        let words: [fn(&mut Inertia) -> &mut i32; 9] = [
            |own| &mut own.mass,
            |own| &mut own.per_force,
            |own| &mut own.slope,
            |own| &mut own.damping,
            |own| &mut own.brake,
            |own| &mut own.linear,
            |own| &mut own.load_gain,
            |own| &mut own.rubbed,
            |own| &mut own.rubbed_ahead,
        ];
        for word in words {
            for bit in 0..32 {
                let mut flipped = sound;
                *word(&mut flipped) ^= 1 << bit;
                assert!(!flipped.is_sound());
            }
        }
    }

    #[test]
    fn what_follows_from_a_mass_is_good_to_two_thousandths() {
        let model = AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default");
        for mass_kg in [0.05, 0.3, 1.0, 1.5, 6.0, 40.0, 200.0] {
            let raw = (mass_kg * 65_536.0) as i32;
            let inertia = Inertia::new(&model, raw);
            let share = (f64::from(model.nimble_mass) / f64::from(raw))
                .cbrt()
                .min(1.0);
            let slope = f64::from(model.slope) * share;
            for (value, exact) in [
                (inertia.per_force, 2_f64.powi(40) / f64::from(raw)),
                (inertia.slope, slope),
                (inertia.damping, f64::from(model.damping) * share),
                (inertia.brake, f64::from(model.brake) * share * share),
                (inertia.linear, 2_f64.powi(47) / (slope * slope)),
            ] {
                let difference = (f64::from(value) - exact).abs();
                assert!(
                    difference <= 2.0 + 2e-3 * exact,
                    "{mass_kg}: {value} {exact}"
                );
            }
        }
    }

    /// A light piston behind large and fast valves: brake × 2^13 must fit 32 bits, or the
    /// speed law would turn its sign.
    #[test]
    fn the_brake_of_the_lightest_and_fastest_axis_fits_its_format() {
        let data = AxisData {
            bore: PositionMm::from_int(10),
            rod: PositionMm::from_int(4),
            stroke: PositionMm::from_int(100),
            dead_a: PositionMm::from_int(1),
            dead_b: PositionMm::from_int(1),
            conductance: "0.42".parse().expect("a number"),
            mass: PositionMm::from_f64(0.1),
            valve_on: Micros(1000),
            valve_off: Micros(1000),
            line_delay: Micros(100),
            ..AxisData::default()
        };
        let model = AxisModel::new(&data, Micros(1000)).expect("in range");
        assert!(model.brake > 1 << 18, "{}", model.brake);
        // The largest that still fits times 2^13.
        let inertia = Inertia::new(&model, model.mass);
        assert_eq!(inertia.brake, i32::MAX >> 13);
    }

    #[test]
    fn cube_roots() {
        assert_eq!(cube_root(0), 0);
        assert_eq!(cube_root(1 << 30), 1 << 16);
        for share in [
            1_u32,
            20_000,
            100 << 14,
            8192 << 14,
            30_000 << 14,
            65_000 << 14,
        ] {
            let exact = (f64::from(share) / f64::from(1 << 30)).cbrt() * 65_536.0;
            assert!((f64::from(cube_root(share)) - exact).abs() < 2.0, "{share}");
        }
    }
}
