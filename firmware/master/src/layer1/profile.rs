//! Closed-form trapezoidal speed profile of the wheels' push (f32, mm and s).

/// Trapezoid from rest to rest over `distance_mm`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trapezoid {
    distance_mm: f32,
    speed_mm_s: f32,
    acceleration_mm_s2: f32,
    ramp_s: f32,
    cruise_s: f32,
}

impl Trapezoid {
    /// Profile over `distance_mm` ≥ 0 with the given limits, both > 0.
    ///
    /// A distance below `speed²/acceleration` gives a triangle with a lower peak speed. Values that are not finite or
    /// out of range give a profile that stays at rest.
    #[must_use]
    pub fn new(distance_mm: f32, speed_mm_s: f32, acceleration_mm_s2: f32) -> Self {
        let usable = distance_mm > 0.0
            && speed_mm_s > 0.0
            && acceleration_mm_s2 > 0.0
            && distance_mm.is_finite()
            && speed_mm_s.is_finite()
            && acceleration_mm_s2.is_finite();
        if !usable {
            return Self {
                distance_mm: 0.0,
                speed_mm_s: 0.0,
                acceleration_mm_s2: 0.0,
                ramp_s: 0.0,
                cruise_s: 0.0,
            };
        }
        let peak = libm::sqrtf(distance_mm * acceleration_mm_s2).min(speed_mm_s);
        let ramp_s = peak / acceleration_mm_s2;
        Self {
            distance_mm,
            speed_mm_s: peak,
            acceleration_mm_s2,
            ramp_s,
            cruise_s: (distance_mm / peak - ramp_s).max(0.0),
        }
    }

    /// Distance from rest to rest, mm.
    #[must_use]
    pub const fn distance_mm(&self) -> f32 {
        self.distance_mm
    }

    /// Time from rest to rest, s.
    #[must_use]
    pub fn duration_s(&self) -> f32 {
        self.cruise_s + 2.0 * self.ramp_s
    }

    /// Position (mm) and speed (mm/s) at `t_s` after the start; clamped to the ends outside `0..=duration_s`.
    #[must_use]
    pub fn at(&self, t_s: f32) -> (f32, f32) {
        if t_s.is_nan() || t_s <= 0.0 {
            return (0.0, 0.0);
        }
        let total = self.duration_s();
        if t_s >= total {
            return (self.distance_mm, 0.0);
        }
        let a = self.acceleration_mm_s2;
        if t_s < self.ramp_s {
            return (0.5 * a * t_s * t_s, a * t_s);
        }
        let left = total - t_s;
        if left < self.ramp_s {
            return (self.distance_mm - 0.5 * a * left * left, a * left);
        }
        let ramp_mm = 0.5 * self.speed_mm_s * self.ramp_s;
        (
            ramp_mm + self.speed_mm_s * (t_s - self.ramp_s),
            self.speed_mm_s,
        )
    }
}
