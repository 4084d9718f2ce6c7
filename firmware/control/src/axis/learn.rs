//! The moving mass, from one move.
//!
//! While the piston slides one way, friction and load are constant but for the
//! viscous part, and the impulse of the known forces is
//!
//! ```text
//! J(t) = ∫ (F − viscous) dt = m v(t) + c t + J₀
//! ```
//!
//! A regression of J on v and t over the move gives m. Speeding up and slowing
//! down in one move tell the mass from the constant. The sums are of
//! integers, sampled every eighth tick.

use super::model::AxisModel;
use super::motion::Motion;
use super::{quotient, scaled};
use core::hash::{Hash, Hasher};

/// Ticks between two samples.
const STRIDE: u8 = 8;
/// Samples that are taken of one move at most.
const SAMPLES_MAX: i32 = 96;
/// Samples without which there is no result.
const SAMPLES_MIN: i32 = 10;
/// Sliding faster than this is sampled, raw mm/s (20 mm/s).
const SLIDES: i32 = 20 << 16;
/// A move must have been this fast at least, mm/s.
const FAST: i32 = 200;
/// The mass may be this many times what was told: a payload adds to it …
const MOST: i32 = 12;
/// … and at least this share of it, × 2^16 (0.6): the rod and the carriage stay.
const LEAST: i32 = 39_322;

/// Sums over the move under way, and its result.
///
/// Sample k is taken at t = k, so that sums of t alone follow from their number.
#[derive(Clone, Copy, Debug, Default)]
pub struct Learner {
    stride: u8,
    forward: bool,
    count: i32,
    /// mm/s.
    fastest: i32,
    /// Impulse since the first sample, mN × ticks.
    impulse: i64,
    sum_v: i32,
    sum_j: i32,
    sum_vt: i32,
    sum_vv: i64,
    sum_jv: i64,
    sum_jt: i64,
    /// Mass of the last move, kg × 2^16, until it is taken; 0 if none.
    mass: i32,
}

impl Hash for Learner {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Taken apart, so that a new field cannot be forgotten here.
        let Self {
            stride,
            forward,
            count,
            fastest,
            impulse,
            sum_v,
            sum_j,
            sum_vt,
            sum_vv,
            sum_jv,
            sum_jt,
            mass,
        } = self;
        let small = u32::from(*stride) | u32::from(*forward).wrapping_shl(8);
        state.write_i32(count ^ small.rotate_right(16) as i32);
        state.write_i32(*mass);
        state.write_i32(*fastest);
        state.write_i64(*impulse);
        state.write_i32(*sum_v);
        state.write_i32(*sum_j);
        state.write_i32(*sum_vt);
        state.write_i64(*sum_vv);
        state.write_i64(*sum_jv);
        state.write_i64(*sum_jt);
    }
}

impl Learner {
    /// Nothing seen.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A mass that was learnt and not yet taken, kg × 2^16.
    #[inline]
    pub fn take(&mut self) -> Option<i32> {
        let mass = core::mem::take(&mut self.mass);
        (mass > 0).then_some(mass)
    }

    /// One tick with pressure force `force`, mN.
    #[inline]
    pub fn sample(&mut self, model: &AxisModel, motion: &Motion, force: i32) {
        let speed = motion.speed;
        let forward = speed > 0;
        let sliding = speed.wrapping_abs() > SLIDES;
        if !sliding || (self.count > 0 && forward != self.forward) {
            if self.count > 0 {
                self.finish(model);
            }
            return;
        }
        if self.count == 0 {
            *self = Self {
                forward,
                mass: self.mass,
                ..Self::default()
            };
        } else {
            let viscous = scaled(speed, model.viscous, 24);
            self.impulse = self
                .impulse
                .wrapping_add(i64::from(force.saturating_sub(viscous)));
            self.stride = self.stride.wrapping_add(1);
            if self.stride < STRIDE {
                return;
            }
            self.stride = 0;
        }
        if self.count >= SAMPLES_MAX {
            return;
        }
        // At most 2^15.
        let v = speed.wrapping_shr(16);
        let t = self.count;
        // mN × ticks to 1/8 mN s: below 2^23 for 100 samples of 8 ticks of 10 kN.
        let per_tick = model.times.tick.wrapping_mul(134);
        let j = self
            .impulse
            .wrapping_mul(i64::from(per_tick))
            .wrapping_shr(24) as i32;
        self.count = t.wrapping_add(1);
        self.fastest = self.fastest.max(v.wrapping_abs());
        // |v t| summed: below 2^15 × 96² / 2; |j| summed: below 2^30.
        self.sum_v = self.sum_v.wrapping_add(v);
        self.sum_j = self.sum_j.wrapping_add(j);
        self.sum_vt = self.sum_vt.wrapping_add(v.wrapping_mul(t));
        let product = |a: i32, b: i32| i64::from(a).wrapping_mul(i64::from(b));
        self.sum_vv = self.sum_vv.wrapping_add(product(v, v));
        self.sum_jv = self.sum_jv.wrapping_add(product(j, v));
        self.sum_jt = self.sum_jt.wrapping_add(product(j, t));
    }

    /// The move has ended: solves for the mass.
    #[inline(never)]
    fn finish(&mut self, model: &AxisModel) {
        let count = core::mem::take(&mut self.count);
        if count < SAMPLES_MIN || self.fastest < FAST {
            return;
        }
        let n = i64::from(count);
        // 0 + 1 + … + n − 1, and their squares; n is at most 96.
        let last = count.wrapping_sub(1);
        let sum_t = count.wrapping_mul(last).wrapping_shr(1);
        let sum_tt = sum_t.wrapping_mul(last.wrapping_mul(2).wrapping_add(1)) / 3;
        // n times the sums about their means.
        let about = |xy: i64, x: i32, y: i32| {
            let means = i64::from(x).wrapping_mul(i64::from(y));
            n.wrapping_mul(xy).wrapping_sub(means)
        };
        let vv = about(self.sum_vv, self.sum_v, self.sum_v);
        let vt = about(i64::from(self.sum_vt), self.sum_v, sum_t);
        let tt = about(i64::from(sum_tt), sum_t, sum_t);
        let jv = about(self.sum_jv, self.sum_j, self.sum_v);
        let jt = about(self.sum_jt, self.sum_j, sum_t);
        // Without its part along t, v must still vary: else m and c are one.
        let (slope_v, slope_j) = (quotient(vt, tt, 16), quotient(jt, tt, 8));
        let along = |slope: i32, shift: u32| i64::from(slope).wrapping_mul(vt).wrapping_shr(shift);
        let free_vv = vv.wrapping_sub(along(slope_v, 16));
        let free_jv = jv.wrapping_sub(along(slope_j, 8));
        if free_vv < n.wrapping_mul(n).wrapping_mul(30 * 30) {
            return;
        }
        // 1/8 mN s per mm/s = 1/8 kg.
        let mass = quotient(free_jv, free_vv, 13);
        let told = model.mass;
        self.mass = mass
            .max(scaled(told, LEAST, 16))
            .min(told.saturating_mul(MOST));
    }
}
