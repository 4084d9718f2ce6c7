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
use super::scaled;

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
const MOST: i64 = 12;
/// … and at least this share of it, × 2^16 (0.6): the rod and the carriage stay.
const LEAST: i64 = 39_322;

/// Sums over the move under way, and its result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Learner {
    stride: u8,
    forward: bool,
    count: i32,
    fastest: i32,
    /// Impulse since the first sample, mN × ticks.
    impulse: i64,
    sum_v: i64,
    sum_t: i64,
    sum_j: i64,
    sum_vv: i64,
    sum_vt: i64,
    sum_tt: i64,
    sum_jv: i64,
    sum_jt: i64,
    /// Mass of the last move, kg × 2^16, until it is taken; 0 if none.
    mass: i32,
}

impl Learner {
    /// Nothing seen.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A mass that was learnt and not yet taken, kg × 2^16.
    pub fn take(&mut self) -> Option<i32> {
        let mass = core::mem::take(&mut self.mass);
        (mass > 0).then_some(mass)
    }

    /// One tick with pressure force `force`, mN.
    #[inline]
    pub fn sample(&mut self, model: &AxisModel, motion: &Motion, force: i32) {
        let forward = motion.speed > 0;
        let sliding = motion.speed.wrapping_abs() > SLIDES;
        if !sliding || (self.count > 0 && forward != self.forward) {
            if self.count > 0 {
                self.finish(model);
            }
            return;
        }
        let viscous = scaled(motion.speed, model.viscous, 24);
        if self.count == 0 {
            *self = Self {
                forward,
                mass: self.mass,
                ..Self::default()
            };
        } else {
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
        let v = i64::from(motion.speed.wrapping_shr(16));
        let t = i64::from(self.count);
        // mN × ticks to 1/8 mN s: below 2^23 for 100 samples of 8 ticks of 10 kN.
        let tick_us = i64::from(model.times.tick);
        let j = self
            .impulse
            .wrapping_mul(tick_us)
            .wrapping_mul(134)
            .wrapping_shr(24);
        self.count = self.count.wrapping_add(1);
        self.fastest = self
            .fastest
            .max(motion.speed.wrapping_abs().wrapping_shr(16));
        self.sum_v = self.sum_v.wrapping_add(v);
        self.sum_t = self.sum_t.wrapping_add(t);
        self.sum_j = self.sum_j.wrapping_add(j);
        self.sum_vv = self.sum_vv.wrapping_add(v.wrapping_mul(v));
        self.sum_vt = self.sum_vt.wrapping_add(v.wrapping_mul(t));
        self.sum_tt = self.sum_tt.wrapping_add(t.wrapping_mul(t));
        self.sum_jv = self.sum_jv.wrapping_add(j.wrapping_mul(v));
        self.sum_jt = self.sum_jt.wrapping_add(j.wrapping_mul(t));
    }

    /// The move has ended: solves for the mass.
    fn finish(&mut self, model: &AxisModel) {
        let n = i64::from(self.count);
        let enough = self.count >= SAMPLES_MIN && self.fastest >= FAST;
        self.count = 0;
        if !enough {
            return;
        }
        // Sums about their means, divided by n.
        let about = |xy: i64, x: i64, y: i64| {
            xy.wrapping_sub(x.wrapping_mul(y).checked_div(n).unwrap_or(0))
        };
        let vv = about(self.sum_vv, self.sum_v, self.sum_v);
        let vt = about(self.sum_vt, self.sum_v, self.sum_t);
        let tt = about(self.sum_tt, self.sum_t, self.sum_t);
        let jv = about(self.sum_jv, self.sum_j, self.sum_v);
        let jt = about(self.sum_jt, self.sum_j, self.sum_t);
        // Without its part along t, v must still vary: else m and c are one.
        let (Some(slope_v), Some(slope_j)) = (ratio(vt, tt), ratio(jt, tt)) else {
            return;
        };
        let free_vv = vv.wrapping_sub(slope_v.wrapping_mul(vt).wrapping_shr(16));
        let free_jv = jv.wrapping_sub(slope_j.wrapping_mul(vt).wrapping_shr(16));
        if free_vv < n.wrapping_mul(30 * 30) {
            return;
        }
        // 1/8 mN s per mm/s = 1/8 kg.
        let Some(mass) = ratio(free_jv, free_vv) else {
            return;
        };
        let mass = mass.wrapping_shr(3);
        let told = i64::from(model.mass);
        let (low, high) = (
            told.wrapping_mul(LEAST).wrapping_shr(16),
            told.wrapping_mul(MOST),
        );
        self.mass = i32::try_from(mass.max(low).min(high)).unwrap_or(0);
    }
}

/// a / b × 2^16.
fn ratio(a: i64, b: i64) -> Option<i64> {
    if b == 0 {
        return None;
    }
    // |a| < 2^46.
    a.wrapping_shl(16).checked_div(b)
}
