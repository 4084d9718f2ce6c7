//! End stops with a cushion: they push, never pull.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};

/// Both ends of one cylinder.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EndStopParams {
    /// Stiffness of the hard stop \[N/m\], 1e4..1e7.
    pub stiffness_n_m: f64,
    /// Hunt–Crossley damping factor \[s/m\], 0..50: F = k d (1 + λ d'). Zero at
    /// first touch, so the force does not jump.
    pub damping_s_m: f64,
    /// Length of the cushion before each stop \[m\], 0..0.05.
    pub cushion_length_m: f64,
    /// Cushion damping at the stop \[N s/m\], 0..2000; grows linearly from 0 over
    /// the cushion and acts only on the way in.
    pub cushion_damping_n_s_m: f64,
}

impl EndStopParams {
    /// Checks every field against its valid range.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the first field outside its range.
    pub fn validate(&self) -> Result<(), PlantError> {
        check("end_stop.stiffness_n_m", self.stiffness_n_m, 1e4, 1e7)?;
        check("end_stop.damping_s_m", self.damping_s_m, 0.0, 50.0)?;
        check(
            "end_stop.cushion_length_m",
            self.cushion_length_m,
            0.0,
            0.05,
        )?;
        check(
            "end_stop.cushion_damping_n_s_m",
            self.cushion_damping_n_s_m,
            0.0,
            2000.0,
        )
    }

    /// Force of one stop away from itself, >= 0 \[N\]. `depth_m` is the piston's depth in the stop (negative:
    /// still free), `rate_m_s` its rate of entry.
    #[inline]
    fn one_side_n(&self, depth_m: f64, rate_m_s: f64) -> f64 {
        let mut force = 0.0;
        if depth_m > 0.0 {
            force = (self.stiffness_n_m * depth_m * (1.0 + self.damping_s_m * rate_m_s)).max(0.0);
        }
        if rate_m_s > 0.0 && self.cushion_length_m > 0.0 {
            let share = (1.0 + depth_m / self.cushion_length_m).min(1.0);
            if share > 0.0 {
                force += self.cushion_damping_n_s_m * share * rate_m_s;
            }
        }
        force
    }

    /// Force on the piston \[N\], positive extending (from the retracted stop).
    #[must_use]
    #[inline]
    pub fn force_n(&self, stroke_m: f64, full_stroke_m: f64, v_m_s: f64) -> f64 {
        self.one_side_n(-stroke_m, -v_m_s) - self.one_side_n(stroke_m - full_stroke_m, v_m_s)
    }
}

#[cfg(test)]
mod tests {
    use crate::testing::end_stop;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn pushes_inwards_only(x in -0.002..0.182f64, v in -1.0..1.0f64) {
            let f = end_stop().force_n(x, 0.18, v);
            if x < 0.09 { prop_assert!(f >= 0.0); } else { prop_assert!(f <= 0.0); }
            if (0.02..0.16).contains(&x) { prop_assert_eq!(f, 0.0); }
        }
    }

    #[test]
    fn no_jump_at_first_touch_and_symmetric() {
        let e = end_stop();
        for v in [-0.3, 0.0, 0.3] {
            let jump = e.force_n(0.18 + 1e-9, 0.18, v) - e.force_n(0.18 - 1e-9, 0.18, v);
            assert!(jump.abs() < 0.02, "{jump}");
            let mirrored = e.force_n(-1e-4, 0.18, -v) + e.force_n(0.18 + 1e-4, 0.18, v);
            assert!(mirrored.abs() < 1e-6);
        }
        assert!((e.force_n(-1e-4, 0.18, 0.0) - e.stiffness_n_m * 1e-4).abs() < 1e-9);
    }

    #[test]
    fn a_hit_loses_energy() {
        let e = end_stop();
        let (mut x, mut v, h, m) = (0.17, 1.2, 1e-5, 0.8);
        for _ in 0..20_000 {
            v += h * e.force_n(x, 0.18, v) / m;
            x += h * v;
            assert!(x < 0.181, "{x}");
            if v < 0.0 && x < 0.18 {
                break;
            }
        }
        // The cushion takes 0.56 m/s on the way in, the stop some more; it does bounce.
        assert!(v < -0.1 && v > -0.6, "{v}");
    }
}
