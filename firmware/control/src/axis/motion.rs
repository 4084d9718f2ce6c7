//! Stroke, speed and load from the measured stroke and the pressure force.

use super::model::AxisModel;
use super::{scaled, within};
use wheeleg_units::saturate_i32;

/// Slower than this, raw mm/s, a piston held by its friction counts as stuck (4 mm/s).
const STICK: i32 = 4 << 16;

/// A piston that stands so near to an end stop leans on it, raw mm (1 mm).
const STOP_ZONE: i32 = 1 << 16;

/// Length before an end stop in which a cushion may act, raw mm (6 mm).
const CUSHION: i32 = 6 << 16;

/// What follows from the moving mass; worked out when that changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
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
}

impl Inertia {
    /// For a mass in kg × 2^16; gains fall with the cube root of what the mass
    /// exceeds the axis's nimble mass by.
    #[must_use]
    pub fn new(model: &AxisModel, mass: i32) -> Self {
        let mass = mass.max(1000);
        // 1/kg = mm/s² per mN: 2^(24+16) / raw kg.
        let per_force = (1_i64 << 40).checked_div(i64::from(mass)).unwrap_or(0);
        let share = if mass > model.nimble_mass {
            let ratio = i64::from(model.nimble_mass)
                .wrapping_shl(16)
                .checked_div(i64::from(mass))
                .unwrap_or(0);
            cube_root(ratio as u32)
        } else {
            1 << 16
        };
        let squared = scaled(share, share, 16);
        let slope = scaled(model.slope, share, 16).max(1 << 8);
        // 2^32 / (2 slope²) with slope × 2^8: 2^47 / slope².
        let linear = (1_i64 << 47)
            .checked_div(i64::from(slope).wrapping_mul(i64::from(slope)))
            .unwrap_or(0);
        Self {
            mass,
            per_force: saturate_i32(per_force),
            slope,
            damping: scaled(model.damping, share, 16),
            brake: scaled(model.brake, squared, 16),
            linear: saturate_i32(linear),
            load_gain: scaled(model.observe_load, mass, 16),
        }
    }

    /// Acceleration of a force in mN, mm/s².
    #[inline]
    #[must_use]
    pub const fn acceleration(&self, force: i32) -> i32 {
        scaled(force, self.per_force, 24)
    }
}

/// Cube root of a share × 2^16 of at most one.
fn cube_root(share: u32) -> i32 {
    let (mut low, mut high) = (0_u64, 1_u64 << 16);
    for _ in 0..17 {
        let middle = low.wrapping_add(high).wrapping_add(1).wrapping_shr(1);
        let cube = middle.wrapping_mul(middle).wrapping_mul(middle);
        if cube <= u64::from(share).wrapping_shl(32) {
            low = middle;
        } else {
            high = middle.wrapping_sub(1);
        }
    }
    low as i32
}

/// Estimated motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Motion {
    /// Stroke, raw mm.
    pub stroke: i32,
    /// Speed, raw mm/s.
    pub speed: i32,
    /// Force from outside and what the model does not know, mN, positive extends.
    pub load: i32,
    /// Acceleration, mm/s².
    pub acceleration: i32,
    /// Friction as it acts against the motion, mN.
    pub friction: i32,
    /// Held by its friction.
    pub stuck: bool,
}

impl Motion {
    /// Within a millimetre of an end stop.
    #[must_use]
    pub fn at_stop(&self, model: &AxisModel) -> bool {
        self.stroke < STOP_ZONE || self.stroke > model.stroke.saturating_sub(STOP_ZONE)
    }

    /// One tick: predicts with the pressure force of that tick, corrects with
    /// the measured stroke.
    #[inline]
    pub fn update(&mut self, model: &AxisModel, inertia: &Inertia, force: i32, measured: i32) {
        let drive = force.saturating_add(self.load);
        // Pressed against an end stop, the stop takes what is left of the force.
        let against_stop = if drive > 0 {
            self.stroke > model.stroke.saturating_sub(STOP_ZONE)
        } else {
            self.stroke < STOP_ZONE
        };
        self.stuck = self.speed.wrapping_abs() < STICK
            && (against_stop || drive.saturating_abs() < model.breakaway);
        self.friction = if self.stuck {
            drive
        } else {
            // Coulomb over ±4 mm/s, raw: × coulomb / 2^18.
            scaled(within(self.speed, STICK), model.coulomb, 18).saturating_add(scaled(
                self.speed,
                model.viscous,
                24,
            ))
        };
        self.acceleration = inertia.acceleration(drive.saturating_sub(self.friction));
        // mm/s² × s × 2^32 to raw mm/s: / 2^16.
        let gained = scaled(self.acceleration, model.tick, 16);
        let mean = self.speed.saturating_add(gained.wrapping_shr(1));
        self.stroke = self.stroke.saturating_add(scaled(mean, model.tick, 32));
        self.speed = self.speed.saturating_add(gained);
        if self.stuck {
            self.speed = self.speed.wrapping_sub(self.speed.wrapping_shr(3));
        }
        let innovation = within(measured.saturating_sub(self.stroke), 8 << 16);
        self.stroke = self
            .stroke
            .saturating_add(scaled(innovation, model.observe_stroke, 16));
        self.speed = self
            .speed
            .saturating_add(scaled(innovation, model.observe_speed, 16));
        // Near an end the cushion brakes: that is no load.
        let cushioned = if self.speed > 0 {
            self.stroke > model.stroke.saturating_sub(CUSHION)
        } else {
            self.stroke < CUSHION
        };
        if !self.stuck && !cushioned {
            let load = self
                .load
                .saturating_add(scaled(innovation, inertia.load_gain, 16));
            self.load = within(load, model.force_out.max(model.force_in));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::cube_root;

    #[test]
    fn cube_roots() {
        assert_eq!(cube_root(0), 0);
        assert_eq!(cube_root(1 << 16), 1 << 16);
        for share in [1_u32, 100, 8192, 30_000, 65_000] {
            let exact = (f64::from(share) / 65_536.0).cbrt() * 65_536.0;
            assert!((f64::from(cube_root(share)) - exact).abs() < 2.0, "{share}");
        }
    }
}
