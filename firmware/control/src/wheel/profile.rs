//! Trapezoidal profile and velocity ramp.
//!
//! ```text
//! profile   v_n = the largest v ≤ min(v_{n−1} + a, v_max) after which steps of a still stop at the target
//!           one sample at v and the stop after it cover (k + 1) v − a k (k + 1)/2,   k = ⌊v/a⌋
//! ramp      v_n = v_{n−1} towards the command by at most a;   x_n = x_{n−1} + v_n
//! ```
//!
//! Source: modes of the HCTL-1100 (DATASHEET). Its sequence of points is not published; this one is DERIVED.
//!
//! Positions in 1/256 count, velocities in 1/256 count per sample,
//! accelerations in 1/256 count per sample².

use wheeleg_units::WheelCount;

/// Fractional bits of positions, velocities and accelerations.
const FRACTION: u32 = 8;

/// A trapezoidal move, sample by sample.
///
/// From rest, velocity rises by at most the acceleration per sample, stays at the maximum, and falls so as to end
/// exactly on the final position; if the distance is too short for the maximum, the profile is a triangle. In each
/// sample the profile is as fast as a stop in steps of the acceleration still allows, so no profile within these limits
/// is faster by a whole sample. The chip's own sequence of points is not in its data sheet; shape, limits and end agree
/// with it.
///
/// The direction is the shorter one around the 24-bit circle, at most 7FFFFFH counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Profile {
    /// The position from which the next point is measured.
    target: WheelCount,
    forward: bool,
    /// Remaining distance, 1/256 count.
    remaining: u32,
    velocity: u32,
    maximum: u32,
    acceleration: u32,
}

impl Profile {
    /// A move from `start` to `target` with the maximum velocity in counts per sample (1…127) and the acceleration in
    /// 1/256 count per sample² (1…32 767); values outside these ranges are limited to them.
    #[must_use]
    pub const fn new(
        start: WheelCount,
        target: WheelCount,
        maximum: u8,
        acceleration_raw: u16,
    ) -> Self {
        let way = target.wrapping_difference(start);
        let maximum = if maximum == 0 {
            1
        } else if maximum > 127 {
            127
        } else {
            maximum
        };
        let acceleration = if acceleration_raw == 0 {
            1
        } else if acceleration_raw > 32_767 {
            32_767
        } else {
            acceleration_raw
        };
        Self {
            target,
            forward: way >= 0,
            // |way| <= 2^23: the shift fits 31 bits.
            remaining: way.unsigned_abs().wrapping_shl(FRACTION),
            velocity: 0,
            maximum: (maximum as u32).wrapping_shl(FRACTION),
            acceleration: acceleration as u32,
        }
    }

    /// Whether the last point has been generated.
    #[must_use]
    pub const fn is_finished(&self) -> bool {
        self.remaining == 0
    }

    /// Velocity of the last step, 1/256 count per sample, with its sign.
    #[must_use]
    pub const fn velocity_raw(&self) -> i32 {
        if self.forward {
            self.velocity as i32
        } else {
            (self.velocity as i32).wrapping_neg()
        }
    }

    /// The next point, to whole counts: the remaining distance is rounded to nearest. Stays on the final position once
    /// there. Never panics.
    #[inline]
    pub fn advance(&mut self) -> WheelCount {
        self.velocity = self.choose().min(self.remaining);
        self.remaining = self.remaining.saturating_sub(self.velocity);
        // remaining <= 2^31: another half count still fits a `u32`.
        let left = self
            .remaining
            .wrapping_add(1 << (FRACTION - 1))
            .wrapping_shr(FRACTION) as i32;
        self.target.wrapping_add(if self.forward {
            left.wrapping_neg()
        } else {
            left
        })
    }

    /// The largest velocity for this sample: at most v + a and the maximum, and such that the remaining distance allows
    /// one sample at it and then a stop in steps of a.
    ///
    /// One sample at w and the stop after it, w + (w − a) + (w − 2a) + … while positive, cover (n + 1) w − a n (n +
    /// 1)/2 with n = ⌊w/a⌋. That rises with w, so the largest w for a given n is (way + a n (n + 1)/2) / (n + 1),
    /// provided that it is at least n a, that is, that the way is at least a n (n + 1)/2. Since v − a always allows the
    /// stop, the search ends after at most three n.
    #[inline]
    fn choose(&self) -> u32 {
        // All terms below 2^31: v < 2^15 + 2^15, n a <= v, way <= 2^31.
        let a = self.acceleration;
        let high = self.velocity.wrapping_add(a).min(self.maximum);
        let mut n = high.checked_div(a).unwrap_or(0);
        let mut stop = a
            .wrapping_mul(n)
            .wrapping_mul(n.wrapping_add(1))
            .wrapping_shr(1);
        for _ in 0..4 {
            if stop <= self.remaining {
                let way = self.remaining.wrapping_add(stop);
                let best = way.checked_div(n.wrapping_add(1)).unwrap_or(0);
                return best.min(high);
            }
            // The distance for n − 1; for n = 0 it is zero.
            stop = stop.wrapping_sub(a.wrapping_mul(n));
            n = n.wrapping_sub(1);
        }
        self.velocity.saturating_sub(a)
    }
}

/// A velocity that follows its command with bounded acceleration, and the position that it generates (integral velocity
/// mode).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Ramp {
    position: WheelCount,
    /// 0…255: 1/256 count.
    fraction: u8,
    /// 1/256 count per sample.
    velocity: i32,
}

impl Ramp {
    /// At rest at a position.
    #[must_use]
    pub const fn new(position: WheelCount) -> Self {
        Self {
            position,
            fraction: 0,
            velocity: 0,
        }
    }

    /// The position generated so far, rounded down to whole counts.
    #[must_use]
    pub const fn position(&self) -> WheelCount {
        self.position
    }

    /// Velocity, 1/256 count per sample.
    #[must_use]
    pub const fn velocity_raw(&self) -> i32 {
        self.velocity
    }

    /// One sample towards `command` counts per sample at `acceleration_raw`/256 counts per sample². Returns the next
    /// position, which wraps. Never panics.
    #[inline]
    pub fn advance(&mut self, command: i8, acceleration_raw: u16) -> WheelCount {
        let target = i32::from(command).wrapping_shl(FRACTION);
        let step = i32::from(acceleration_raw);
        let low = self.velocity.wrapping_sub(step);
        let high = self.velocity.wrapping_add(step);
        // Not `clamp`: the compiler can not see that low <= high.
        self.velocity = target.max(low).min(high);
        let sum = i32::from(self.fraction).wrapping_add(self.velocity);
        self.fraction = (sum & 0xFF) as u8;
        self.position = self.position.wrapping_add(sum.wrapping_shr(FRACTION));
        self.position
    }
}
