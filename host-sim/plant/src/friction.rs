//! Seal friction: LuGre in its elasto-plastic form, so that a loaded piston sticks.
//!
//! ```text
//! F  = σ0 z + σ1 dz/dt + σ2 v
//! dz/dt = v (1 − α(z, v) |z| / z_ss(v)),   z_ss(v) = g(v)/σ0
//! g(v) = Fc + (Fs − Fc) / (1 + (v/v_s)²)
//! ```
//!
//! α is 0 while the bristle is deflected less than a set share of z_ss or is
//! being relaxed (pure elastic presliding), 1 at z_ss, and smooth between
//! (Dupont, Hayward, Armstrong, Altpeter 2002). The plain LuGre model
//! (Canudas de Wit et al. 1995, α = 1 throughout) creeps under a varying load below Fs;
//! this one cannot. The rational Stribeck curve is that of Hess and Soom 1990:
//! no exponential per step.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};

/// Friction of one cylinder's seals and bearings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FrictionParams {
    /// Coulomb force Fc \[N\], 0..500.
    pub coulomb_n: f64,
    /// Break-away force Fs \[N\], Fc..500.
    pub static_n: f64,
    /// Stribeck velocity v_s \[m/s\], 1e-4..1.
    pub stribeck_m_s: f64,
    /// Viscous coefficient σ2 \[N s/m\], 0..1000.
    pub viscous_n_s_m: f64,
    /// Bristle stiffness σ0 \[N/m\], 1e3..1e6.
    pub bristle_stiffness_n_m: f64,
    /// Bristle damping σ1 \[N s/m\], 0..2000.
    pub bristle_damping_n_s_m: f64,
    /// Share of z_ss below which presliding is purely elastic \[-\], 0..0.95.
    pub elastic_share: f64,
    /// Growth of Fc with the higher of the two chamber pressures above ambient
    /// \[N/Pa = m²\], 0..1e-3; Fs grows in proportion. 0: friction does not depend on
    /// pressure. A lip seal is pressed on by what it seals.
    pub pressure_area_m2: f64,
}

impl FrictionParams {
    /// Checks every field against its valid range.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the first field outside its range.
    pub fn validate(&self) -> Result<(), PlantError> {
        check("friction.coulomb_n", self.coulomb_n, 0.0, 500.0)?;
        check("friction.static_n", self.static_n, self.coulomb_n, 500.0)?;
        check("friction.stribeck_m_s", self.stribeck_m_s, 1e-4, 1.0)?;
        check("friction.viscous_n_s_m", self.viscous_n_s_m, 0.0, 1000.0)?;
        check(
            "friction.bristle_stiffness_n_m",
            self.bristle_stiffness_n_m,
            1e3,
            1e6,
        )?;
        check(
            "friction.bristle_damping_n_s_m",
            self.bristle_damping_n_s_m,
            0.0,
            2000.0,
        )?;
        check("friction.elastic_share", self.elastic_share, 0.0, 0.95)?;
        check(
            "friction.pressure_area_m2",
            self.pressure_area_m2,
            0.0,
            1e-3,
        )
    }

    /// The friction with `gauge_pa` as the higher chamber pressure above ambient.
    /// Bristles break at the same deflection: stiffness grows with the force.
    #[must_use]
    pub fn under_pressure(&self, gauge_pa: f64) -> Self {
        if self.pressure_area_m2 <= 0.0 || self.coulomb_n <= 0.0 {
            return *self;
        }
        let grown = 1.0 + self.pressure_area_m2 * gauge_pa.max(0.0) / self.coulomb_n;
        Self {
            coulomb_n: self.coulomb_n * grown,
            static_n: self.static_n * grown,
            bristle_stiffness_n_m: self.bristle_stiffness_n_m * grown,
            ..*self
        }
    }

    /// Largest steady bristle deflection z_ss at speed `v` \[m\] and its inverse.
    #[inline]
    fn steady_deflection_m(&self, v_m_s: f64) -> (f64, f64) {
        let s = v_m_s / self.stribeck_m_s;
        let r = 1.0 + s * s;
        let (g, scale) = (
            self.coulomb_n * r + (self.static_n - self.coulomb_n),
            r * self.bristle_stiffness_n_m,
        );
        (g / scale, scale / g)
    }

    /// Share α of plastic sliding, 0..1, for a deflection as a share of z_ss.
    /// Relaxing bristles are elastic; v = 0 leaves dz/dt = 0 either way.
    #[inline]
    fn plastic_share(&self, share: f64, v_m_s: f64) -> f64 {
        let depth = share.abs() - self.elastic_share;
        if depth <= 0.0 || share * v_m_s <= 0.0 {
            return 0.0;
        }
        let width = 1.0 - self.elastic_share;
        if depth >= width {
            return 1.0;
        }
        let x = depth / width;
        x * x * (3.0 - 2.0 * x)
    }

    /// dz/dt \[m/s\] for bristle deflection `z_m` at piston speed `v_m_s`.
    #[must_use]
    #[inline]
    pub fn bristle_rate_m_s(&self, z_m: f64, v_m_s: f64) -> f64 {
        if self.static_n <= 0.0 {
            return 0.0;
        }
        let share = z_m * self.steady_deflection_m(v_m_s).1;
        v_m_s * (1.0 - self.plastic_share(share, v_m_s) * share.abs())
    }

    /// Bristle deflection `h` seconds later at constant speed `v_m_s`.
    ///
    /// The decay towards z_ss uses 1/(1 + x + x²/2) for exp(−x), which is second
    /// order, positive and bounded for every x, so no step is too long. α is
    /// taken at the middle of the step.
    #[must_use]
    #[inline]
    pub fn advance_bristle_m(&self, z_m: f64, v_m_s: f64, h: f64) -> f64 {
        if self.static_n <= 0.0 {
            return 0.0;
        }
        let (z_ss, inverse) = self.steady_deflection_m(v_m_s);
        let rate = v_m_s.abs() * inverse;
        let step = |alpha: f64, h: f64| {
            if alpha == 0.0 {
                return z_m + h * v_m_s;
            }
            let x = alpha * rate * h;
            (z_m + h * v_m_s * (1.0 + 0.5 * x)) / (1.0 + x + 0.5 * x * x)
        };
        let middle = step(self.plastic_share(z_m * inverse, v_m_s), 0.5 * h);
        let next = step(self.plastic_share(middle * inverse, v_m_s), h);
        // Elastic motion in one long step could overshoot the largest
        // deflection the bristle can carry.
        let limit = z_ss.max(z_m.abs());
        // Not `clamp`, which panics on NaN; the state check names it instead.
        next.max(-limit).min(limit)
    }

    /// Friction force on the piston, against its motion \[N\].
    #[must_use]
    #[inline]
    pub fn force_n(&self, z_m: f64, v_m_s: f64) -> f64 {
        self.bristle_stiffness_n_m * z_m
            + self.bristle_damping_n_s_m * self.bristle_rate_m_s(z_m, v_m_s)
            + self.viscous_n_s_m * v_m_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::seal_friction;

    /// Drags a mass with a force for a time; returns position, speed, bristle.
    fn drag(f: &FrictionParams, mass: f64, force: impl Fn(f64) -> f64, t_end: f64) -> [f64; 3] {
        let h = 1e-4;
        let (mut x, mut v, mut z) = (0.0, 0.0, 0.0);
        let mut a = force(0.0) / mass;
        let steps = (t_end / h).round() as u64;
        for i in 1..=steps {
            let v_half = v + 0.5 * h * a;
            x += h * v_half;
            z = f.advance_bristle_m(z, v_half, h);
            let v_pred = v_half + 0.5 * h * a;
            a = (force(i as f64 * h) - f.force_n(z, v_pred)) / mass;
            v = v_half + 0.5 * h * a;
        }
        [x, v, z]
    }

    #[test]
    fn sticks_for_a_minute_below_break_away() {
        let f = seal_friction();
        for share in [0.3, 0.69, -0.5] {
            // Laid on in 0.2 s; a load that drops on shakes the seal loose a little.
            let load = share * f.static_n;
            let force = |t: f64| load * (t / 0.2).min(1.0);
            let early = drag(&f, 1.5, force, 0.5);
            let late = drag(&f, 1.5, force, 60.0);
            let elastic = load / f.bristle_stiffness_n_m;
            assert!((late[0] - elastic).abs() < 1e-9, "{} {elastic}", late[0]);
            assert!((late[0] - early[0]).abs() < 1e-9);
        }
        // Nearer to Fs the bristle yields, but a minute later it still holds.
        let force = |t: f64| 0.95 * f.static_n * (t / 0.2).min(1.0);
        let (early, late) = (drag(&f, 1.5, force, 2.0), drag(&f, 1.5, force, 60.0));
        assert!(late[0] < 5.0 * f.static_n / f.bristle_stiffness_n_m);
        assert!((late[0] - early[0]).abs() < 1e-6, "{}", late[0] - early[0]);
    }

    #[test]
    fn shaken_load_below_break_away_does_not_drift() {
        // Where plain LuGre walks: a load with a ripple, both below Fs.
        let f = seal_friction();
        let load = |t: f64| 7.0 + 2.0 * (2.0 * std::f64::consts::PI * 20.0 * t).sin();
        let x1 = drag(&f, 1.5, load, 10.0)[0];
        let x2 = drag(&f, 1.5, load, 60.0)[0];
        assert!((x2 - x1).abs() < 1e-8, "walked {}", x2 - x1);
        let lugre = FrictionParams {
            elastic_share: 0.0,
            ..f
        };
        let y1 = drag(&lugre, 1.5, load, 10.0)[0];
        let y2 = drag(&lugre, 1.5, load, 60.0)[0];
        assert!(y2 - y1 > 1e-6, "the test tells the two apart: {}", y2 - y1);
    }

    #[test]
    fn slides_above_break_away_and_reaches_the_steady_speed() {
        let f = seal_friction();
        let late = drag(&f, 1.5, |_| 1.01 * f.static_n, 5.0);
        assert!(late[0] > 0.05, "{}", late[0]);
        // F = Fc + (Fs−Fc)/(1+(v/vs)²) + σ2 v holds at the speed reached.
        let s = late[1] / f.stribeck_m_s;
        let resisting =
            f.coulomb_n + (f.static_n - f.coulomb_n) / (1.0 + s * s) + f.viscous_n_s_m * late[1];
        assert!((resisting - 1.01 * f.static_n).abs() < 1e-3, "{resisting}");
    }

    #[test]
    fn breaks_away_between_coulomb_and_static() {
        let f = seal_friction();
        // Slow ramp: it lets go within 3 % of Fs.
        let h = 1e-4;
        let (mut v, mut z, mut x, mut a) = (0.0, 0.0, 0.0, 0.0);
        let mut t = 0.0;
        while x < 1e-3 {
            t += h;
            let v_half = v + 0.5 * h * a;
            x += h * v_half;
            z = f.advance_bristle_m(z, v_half, h);
            a = (5.0 * t - f.force_n(z, v_half + 0.5 * h * a)) / 1.5;
            v = v_half + 0.5 * h * a;
        }
        let force = 5.0 * t;
        assert!(
            force > 0.97 * f.static_n && force < 1.05 * f.static_n,
            "{force}"
        );
    }

    #[test]
    fn pressure_raises_both_limits_alike() {
        let f = FrictionParams {
            pressure_area_m2: 1e-5,
            ..seal_friction()
        };
        let g = f.under_pressure(5e5);
        assert!((g.coulomb_n - 15.0).abs() < 1e-12 && (g.static_n - 22.5).abs() < 1e-12);
        assert_eq!(f.under_pressure(-1e5), f.under_pressure(0.0));
        // A piston held at 20 N slides without the pressure and sticks with it.
        assert!(drag(&f, 1.5, |_| 20.0, 1.0)[0] > 0.05);
        let held = drag(&g, 1.5, |t| 20.0 * (t / 0.2).min(1.0), 1.0);
        assert!(held[0] < 1e-3, "{}", held[0]);
    }

    #[test]
    fn bristle_is_bounded_and_stable_for_any_step() {
        let f = seal_friction();
        let limit = f.static_n / f.bristle_stiffness_n_m * (1.0 + 1e-12);
        for v in [1e-4, 0.01, 0.4, 5.0, -5.0] {
            for h in [1e-9, 1e-5, 1e-4, 1e-2, 1.0] {
                let mut z = 0.0;
                for _ in 0..1000 {
                    z = f.advance_bristle_m(z, v, h);
                    assert!(z.abs() <= limit, "v {v} h {h} z {z}");
                }
            }
        }
    }

    #[test]
    fn step_is_second_order_in_the_sliding_transient() {
        let f = seal_friction();
        let run = |n: u32| {
            let h = 2e-3 / f64::from(n);
            (0..n).fold(5e-5, |z, _| f.advance_bristle_m(z, 0.05, h))
        };
        let exact = run(1 << 16);
        let (e1, e2) = ((run(64) - exact).abs(), (run(128) - exact).abs());
        assert!(e1 / e2 > 3.3, "{e1} {e2}");
    }
}
