//! When the piston may rest, and when it must move again.

use super::STILL;
use crate::axis::model::AxisModel;
use crate::axis::motion::Motion;
use crate::axis::{mix, part, scaled, square_root};

/// Slower than this a piston in the band is caught by shutting the valves, raw mm/s (4 mm/s).
const CATCH: i32 = 4 << 16;
/// A reference slower than this is a step (1 mm/s).
pub(super) const REFERENCE_RESTS: i32 = 1 << 16;
/// Periods in the band before rest.
const REST_PERIODS: u16 = 6;
/// Periods near the target without coming to rest after which the law acts and waits …
const PATIENCE: u16 = 100;
/// … and, so many periods later, the band widens …
const WIDENS: i32 = 120;
/// … by one band in so many periods, up to three bands in all …
const PATIENCE_STEP: i32 = 1 << PATIENCE_SHIFT;
const PATIENCE_SHIFT: u32 = 7;
/// … but never wider than this, raw mm (0.4 mm).
const WIDEST: i32 = 26_214;
/// A piston further from its target than this does not rest there, raw mm (0.45 mm).
const LEFT: i32 = 29_491;
/// A piston that rests may be so much further from its target than one that comes to rest, in
/// sixteenths of the band.
const RELEASE: i32 = 16;
/// Periods near the target (24 bands) after which the piston counts as near.
const NEAR: u16 = 4;
/// Periods outside before the end of rest at the same target, …
const RELEASE_PERIODS: u16 = 5;
/// … and with a new one.
const START_PERIODS: u16 = 1;
/// Periods of a pause that one counts for in which the piston stands beside the band.
const PAUSE_SPENT: u16 = 8;
/// Share of the friction told that is counted on to stop a piston, × 2^16 (0.85).
const STOPS: i32 = 55_705;
/// Faster than this a piston would not stay where it is, raw mm/s (40 mm/s).
const GENTLE: i32 = 40 << 16;
/// Nor does one that is further from its target than this, raw mm (2 mm), and outside its band.
const FLED: i32 = 2 << 16;

/// Rest at a target, and how long it has been tried. In an order in which it is whole words,
/// which are sealed as they are.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(super) struct Rest {
    target: i32,
    held: u16,
    released: u16,
    near: u16,
    /// What is left of the pause under way, periods.
    pause: u16,
    /// In the band in the last period.
    inside: bool,
    /// The target has changed since the piston came to rest.
    aimed: bool,
    settled: bool,
    /// The target was a new one when the last stroke looked at it.
    fresh: bool,
}

impl Rest {
    /// Adds itself to a sum. Fields that are narrower than a word share one, such that a
    /// flipped bit of any flips one bit of it.
    #[inline]
    pub(super) fn sum(&self, sum: u32) -> u32 {
        let [first, second, third, fourth] = self.words();
        mix(mix(mix(mix(sum, first), second), third), fourth)
    }

    #[inline]
    fn words(&self) -> [i32; 4] {
        // Taken apart, so that a new field cannot be forgotten here.
        let Self {
            target,
            held,
            released,
            near,
            pause,
            inside,
            aimed,
            settled,
            fresh,
        } = *self;
        let two = |low: u16, high: u16| i32::from(low) | i32::from(high).wrapping_shl(16);
        let flags = i32::from(inside)
            | i32::from(aimed).wrapping_shl(8)
            | i32::from(settled).wrapping_shl(16)
            | i32::from(fresh).wrapping_shl(24);
        [target, two(held, released), two(near, pause), flags]
    }

    /// At rest.
    pub(super) const fn is_settled(&self) -> bool {
        self.settled
    }

    /// Whether it has been near its target without coming to rest for longer than patience allows.
    #[inline]
    pub(super) fn lingers(&self) -> bool {
        self.near > PATIENCE
    }

    /// At rest, by what is known beside its error.
    pub(super) const fn settle(&mut self) {
        self.settled = true;
        self.aimed = false;
        self.released = 0;
        self.near = 0;
        self.pause = 0;
    }

    /// Whether it rests at the present target.
    #[inline]
    pub(super) const fn holds(&self) -> bool {
        self.settled && !self.aimed
    }

    /// Whether the piston has been near its target for some time.
    #[inline]
    pub(super) const fn is_near(&self) -> bool {
        self.near > NEAR
    }

    /// Forgets the rest state with the piston at `stroke`.
    #[inline]
    pub(super) const fn release(&mut self, stroke: i32) {
        self.settled = false;
        self.held = 0;
        self.pause = 0;
        self.target = stroke;
    }

    /// Whether the reference is another target.
    #[inline]
    pub(super) const fn is_other(&self, model: &AxisModel, reference: i32) -> bool {
        reference.saturating_sub(self.target).saturating_abs() > model.band
    }

    /// Whether the target was a new one when the last stroke looked at it.
    #[inline]
    pub(super) const fn is_fresh(&self) -> bool {
        self.fresh
    }

    /// Takes over the reference.
    #[inline]
    pub(super) const fn aim(&mut self, model: &AxisModel, reference: i32) {
        self.fresh = self.is_other(model, reference);
        if self.fresh {
            self.target = reference;
            self.near = 0;
            self.pause = 0;
            self.aimed = true;
        }
    }

    /// One period; whether the valves are to stay shut.
    #[inline]
    pub(super) fn quiet(&mut self, model: &AxisModel, now: &Approach) -> bool {
        // A band of at most 5 mm, below 2^19, times up to 24: all of it fits.
        let narrow = model.band;
        let steps = now.reference_speed.wrapping_abs() <= REFERENCE_RESTS;
        if self.settled && self.stays(model, now, steps) {
            return true;
        }
        let error = now
            .reference
            .saturating_sub(now.motion.stroke)
            .saturating_abs();
        if !steps {
            self.near = self.near.saturating_sub(1);
            self.held = 0;
            self.pause = 0;
            self.inside = false;
            return false;
        }
        self.near = if error < narrow.wrapping_mul(24) {
            self.near.wrapping_add(1).min(PATIENCE * 4)
        } else {
            self.near.saturating_sub(1)
        };
        // Patience: what has not come to rest for long may do so in a wider band.
        let beyond = self.beyond();
        let (band, catch) = if beyond > WIDENS {
            let beyond = beyond.wrapping_sub(WIDENS).min(2 * PATIENCE_STEP);
            // A band of at most 5 mm and the catch, both below 2^19, times up to 3.
            let extra = |base: i32| base.wrapping_mul(beyond).wrapping_shr(PATIENCE_SHIFT);
            let band = narrow.wrapping_add(extra(narrow)).min(WIDEST.max(narrow));
            (band, CATCH.wrapping_add(extra(CATCH)))
        } else {
            (narrow, CATCH)
        };
        let speed = now.motion.speed.wrapping_abs();
        let inside = error < band;
        let waits = self.waits(model, now, speed, error, inside);
        let slow = inside && speed < catch;
        if !(slow || now.stops_within(model, band)) {
            self.held = 0;
            return waits;
        }
        self.held = self.held.wrapping_add(1);
        if self.held > REST_PERIODS {
            self.settled = true;
            self.aimed = false;
            self.released = 0;
        }
        true
    }

    /// One period of a piston that rests; whether it stays so.
    #[inline]
    fn stays(&mut self, model: &AxisModel, now: &Approach, steps: bool) -> bool {
        let narrow = model.band;
        let beyond = self.beyond().wrapping_sub(WIDENS);
        let beyond = beyond.clamp(0, 2 * PATIENCE_STEP);
        let extra = narrow.wrapping_mul(beyond).wrapping_shr(PATIENCE_SHIFT);
        let band = narrow.wrapping_add(extra).min(WIDEST.max(narrow));
        let release = narrow
            .wrapping_mul(RELEASE)
            .wrapping_shr(4)
            .wrapping_add(band)
            .min(LEFT.max(band.wrapping_add(narrow >> 1)));
        // The ground pushes a standing joint to and fro. A target that has moved is another matter.
        let release = if self.aimed {
            release
        } else {
            release.max(model.release)
        };
        let away = now.reference.saturating_sub(now.measured).saturating_abs();
        if steps && away <= release {
            self.released = 0;
            self.aimed = false;
            return true;
        }
        self.released = self.released.wrapping_add(1);
        let periods = if self.aimed {
            START_PERIODS
        } else {
            RELEASE_PERIODS
        };
        if steps && self.released < periods {
            return true;
        }
        self.settled = false;
        self.held = 0;
        self.near = self.near.max(PATIENCE);
        false
    }

    /// Act and wait. Where acting alone has not brought the piston to rest for long,
    /// each gentle entry into the band is followed by a pause with the valves shut, about one
    /// swing on the air of the chambers: a piston that swings on it, or on the bristles of
    /// its friction, comes to rest by itself, and every pulse meant to help would keep it
    /// going. One that flees, because the forces on it are not in balance, is not waited for.
    #[inline]
    fn waits(
        &mut self,
        model: &AxisModel,
        now: &Approach,
        speed: i32,
        error: i32,
        inside: bool,
    ) -> bool {
        let entered = inside && !self.inside;
        self.inside = inside;
        if speed > GENTLE || (error > FLED && !inside) {
            self.pause = 0;
        } else if self.pause > 0 {
            let spent = if inside || speed >= STILL {
                1
            } else {
                PAUSE_SPENT
            };
            self.pause = self.pause.saturating_sub(spent);
        } else if entered && self.beyond() > 0 {
            self.pause = swing(model, now.mass);
        }
        self.pause > 0
    }

    /// Periods near the target beyond what patience allows.
    fn beyond(&self) -> i32 {
        i32::from(self.near.saturating_sub(PATIENCE))
    }

    /// What is fed forward for friction that is less than told makes a relay: where
    /// the piston does not come to rest, it fades.
    #[inline]
    pub(super) fn faded(&self, grip: i32) -> i32 {
        let left = (PATIENCE_STEP + PATIENCE_STEP / 4)
            .saturating_sub(self.beyond())
            .max(0);
        part(grip, left.min(PATIENCE_STEP), PATIENCE_SHIFT)
    }
}

/// Periods of a swing of a mass (kg × 2^16) on the air of both chambers, 25…250.
#[inline]
fn swing(model: &AxisModel, mass: i32) -> u16 {
    let square_8 = scaled(mass, model.swing, 16);
    let periods = square_root(square_8.unsigned_abs()).wrapping_shr(4);
    periods.clamp(25, 250) as u16
}

/// How the piston comes to its target.
pub(super) struct Approach<'a> {
    /// Raw mm.
    pub(super) reference: i32,
    /// Raw mm/s.
    pub(super) reference_speed: i32,
    /// As measured, raw mm.
    pub(super) measured: i32,
    /// As estimated.
    pub(super) motion: &'a Motion,
    /// Pressure force, mN.
    pub(super) force: i32,
    /// kg × 2^16.
    pub(super) mass: i32,
}

impl Approach<'_> {
    /// Whether friction alone stops the piston within the band, if the valves shut:
    /// the way is the kinetic energy over what friction has left beside the
    /// forces that act.
    #[inline]
    fn stops_within(&self, model: &AxisModel, band: i32) -> bool {
        let speed = self.motion.speed.wrapping_shr(8);
        let error = self.reference.saturating_sub(self.motion.stroke);
        if error.saturating_abs() > band.wrapping_mul(12) {
            return false;
        }
        let net = self.force.saturating_add(self.motion.load);
        let along = if speed < 0 { net.saturating_neg() } else { net };
        let stopping = part(model.coulomb, STOPS, 16).saturating_sub(along);
        if stopping < model.coulomb >> 2 {
            return false;
        }
        // kg × mm²/s² = µJ = mN × mm, all × 2^16.
        let energy = i64::from(self.mass)
            .wrapping_mul(i64::from(speed).wrapping_mul(i64::from(speed)))
            .wrapping_shr(17);
        let ahead = if speed < 0 {
            error.saturating_neg()
        } else {
            error
        };
        let work = |way: i32| i64::from(stopping).wrapping_mul(i64::from(way));
        energy > work(ahead.saturating_sub(band)) && energy < work(ahead.saturating_add(band))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    use wheeleg_units::{Micros, PositionMm};

    #[test]
    fn every_flipped_bit_of_the_rest_state_flips_one_that_is_sealed() {
        let sealed = Rest::words;
        let some = Rest {
            target: 0x12_3456,
            held: 77,
            released: 5,
            near: 501,
            pause: 150,
            inside: true,
            aimed: false,
            settled: true,
            fresh: false,
        };
        let flips_one = |flip: &dyn Fn(&mut Rest)| {
            let mut flipped = some;
            flip(&mut flipped);
            let pairs = sealed(&flipped).into_iter().zip(sealed(&some));
            let bits: u32 = pairs.map(|(a, b)| (a ^ b).count_ones()).sum();
            assert_eq!(bits, 1, "{flipped:?}");
        };
        for bit in 0..32 {
            flips_one(&|rest| rest.target ^= 1 << bit);
        }
        for bit in 0..16 {
            flips_one(&|rest| rest.held ^= 1 << bit);
            flips_one(&|rest| rest.released ^= 1 << bit);
            flips_one(&|rest| rest.near ^= 1 << bit);
            flips_one(&|rest| rest.pause ^= 1 << bit);
        }
        flips_one(&|rest| rest.inside ^= true);
        flips_one(&|rest| rest.aimed ^= true);
        flips_one(&|rest| rest.settled ^= true);
        flips_one(&|rest| rest.fresh ^= true);
    }

    /// Against the period of mass and air springs in SI units, on cylinders of this project.
    #[test]
    fn a_swing_is_that_of_the_mass_on_the_air() {
        // Bore, rod, stroke, mm; dead volumes, cm³; supply, kPa.
        for (bore, rod, stroke, dead, supply) in [
            (20, 8, 180, 3, 701),
            (12, 6, 50, 2, 701),
            (16, 6, 400, 4, 601),
            (40, 16, 250, 12, 701),
        ] {
            let data = AxisData {
                bore: PositionMm::from_int(bore),
                rod: PositionMm::from_int(rod),
                stroke: PositionMm::from_int(stroke),
                dead_a: PositionMm::from_int(dead),
                dead_b: PositionMm::from_int(dead),
                supply: PositionMm::from_int(supply),
                ..AxisData::default()
            };
            let circle = |d: PositionMm| core::f64::consts::FRAC_PI_4 * d.to_f64().powi(2) * 1e-6;
            let area_a = circle(data.bore);
            let area_b = area_a - circle(data.rod);
            let spring = |area: f64| {
                let volume = f64::from(dead) * 1e-6 + 0.5e-3 * data.stroke.to_f64() * area;
                area * area / volume
            };
            let mean_pa = 0.5 * (f64::from(supply) * 1e3 + 101_325.0);
            let stiffness = 1.2 * mean_pa * (spring(area_a) + spring(area_b));
            for tick_us in [1000, 500] {
                let model = AxisModel::new(&data, Micros(tick_us)).expect("in range");
                for mass_kg in [0.5, 1.5, 10.0, 60.0] {
                    let period_s = core::f64::consts::TAU * f64::sqrt(mass_kg / stiffness);
                    let exact = (period_s * 1e6 / f64::from(4 * tick_us)).clamp(25.0, 250.0);
                    let periods = f64::from(swing(&model, (mass_kg * 65_536.0) as i32));
                    let off = (periods - exact).abs();
                    assert!(
                        off < 1.0 + 0.1 * exact,
                        "{bore} {mass_kg}: {periods} {exact}"
                    );
                }
            }
        }
    }
}
