//! Mass flow through valves, fittings and tubes after ISO 6358, and laminar leaks.
//!
//! ```text
//! r = p2/p1 (absolute), p1 upstream
//! choked     r <= b          mdot = C rho0 p1 sqrt(T0/T1)
//! subsonic   b < r <= beta   mdot = C rho0 p1 sqrt(T0/T1) [1 - ((r-b)/(1-b))^2]^m
//! linear     beta < r <= 1   mdot = k1 p1 (1-r) sqrt(T0/T1), k1 from continuity at beta
//! ```
//!
//! Source: ISO 6358-1:2013 with the linear zone that simulation texts add so
//! that the slope at r = 1 is finite. Reference atmosphere (ANR, ISO 8778):
//! 20 °C, 100 kPa, 65 % relative humidity, rho0 = 1.185 kg/m³.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};

/// Gas and atmosphere. Every field comes from the parameter file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GasParams {
    /// Specific gas constant R \[J/(kg K)\]; dry air 287.05 (DATASHEET: ISO 2533).
    pub gas_constant_j_kg_k: f64,
    /// Ratio of specific heats γ \[-\]; air 1.4.
    pub heat_capacity_ratio: f64,
    /// Density at the reference atmosphere ρ0 \[kg/m³\]; 1.185 (ISO 8778, ANR).
    pub reference_density_kg_m3: f64,
    /// Temperature of the reference atmosphere T0 \[K\]; 293.15 (ISO 8778, ANR).
    pub reference_temperature_k: f64,
    /// Pressure of the reference atmosphere \[Pa\]; 100 000 (ISO 8778, ANR).
    pub reference_pressure_pa: f64,
    /// Ambient pressure p_atm \[Pa absolute\]; 101 325 (ASSUMED: sea level).
    pub ambient_pressure_pa: f64,
    /// Ambient, wall and supply gas temperature \[K\]; 293.15 (ASSUMED).
    pub ambient_temperature_k: f64,
}

impl GasParams {
    /// ρ0 R T \[Pa\]: the volume of its own gas that choked flow takes out of a chamber, per
    /// sonic conductance and time (ISO 6358), at ambient and near the reference temperature.
    #[must_use]
    pub fn choked_outflow_pa(&self) -> f64 {
        self.reference_density_kg_m3 * self.gas_constant_j_kg_k * self.ambient_temperature_k
    }

    /// Checks every field against its valid range.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the first field outside its range.
    pub fn validate(&self) -> Result<(), PlantError> {
        check(
            "gas.gas_constant_j_kg_k",
            self.gas_constant_j_kg_k,
            50.0,
            5000.0,
        )?;
        check(
            "gas.heat_capacity_ratio",
            self.heat_capacity_ratio,
            1.01,
            1.7,
        )?;
        check(
            "gas.reference_density_kg_m3",
            self.reference_density_kg_m3,
            0.01,
            10.0,
        )?;
        check(
            "gas.reference_temperature_k",
            self.reference_temperature_k,
            200.0,
            400.0,
        )?;
        check(
            "gas.reference_pressure_pa",
            self.reference_pressure_pa,
            5e4,
            2e5,
        )?;
        check(
            "gas.ambient_pressure_pa",
            self.ambient_pressure_pa,
            2e4,
            1.2e5,
        )?;
        check(
            "gas.ambient_temperature_k",
            self.ambient_temperature_k,
            200.0,
            400.0,
        )
    }
}

/// One flow path as ISO 6358 describes it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Iso6358 {
    /// Sonic conductance C \[m³/(s·Pa)\]. 1 dm³/(s·bar) = 1e-8 m³/(s·Pa).
    pub conductance_m3_s_pa: f64,
    /// Critical pressure ratio b \[-\], 0..0.9.
    pub critical_ratio: f64,
    /// Subsonic exponent m \[-\]; 0.5 by default (ISO 6358-1:2013).
    pub subsonic_exponent: f64,
    /// Ratio β above which the flow is linear \[-\], b < β < 1; 0.999 by default.
    pub linear_ratio: f64,
}

impl Iso6358 {
    /// A path with the standard exponent 0.5 and a linear zone above 0.999.
    #[must_use]
    pub const fn new(conductance_m3_s_pa: f64, critical_ratio: f64) -> Self {
        Self {
            conductance_m3_s_pa,
            critical_ratio,
            subsonic_exponent: 0.5,
            linear_ratio: 0.999,
        }
    }

    /// Checks every field against its valid range.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the first field outside its range.
    pub fn validate(&self) -> Result<(), PlantError> {
        check("conductance_m3_s_pa", self.conductance_m3_s_pa, 0.0, 1e-5)?;
        check("critical_ratio", self.critical_ratio, 0.0, 0.9)?;
        check("subsonic_exponent", self.subsonic_exponent, 0.3, 1.0)?;
        check(
            "linear_ratio",
            self.linear_ratio,
            self.critical_ratio.max(0.9) + 1e-6,
            0.999_999,
        )
    }

    /// Two paths in series, `self` upstream: the pair as one path.
    ///
    /// C is exact for the pair (the downstream path choked, the upstream one
    /// subsonic, or the upstream one choked); b follows from the common
    /// small-pressure-drop limit (1−b)/C² = Σ (1−b_i)/C_i². Both assume m = 0.5,
    /// as ISO 6358-3 does. The result keeps `self`'s exponent and linear zone.
    #[must_use]
    pub fn in_series(&self, downstream: &Self) -> Self {
        let (c1, b1) = (self.conductance_m3_s_pa, self.critical_ratio);
        let (c2, b2) = (downstream.conductance_m3_s_pa, downstream.critical_ratio);
        if c1 <= 0.0 || c2 <= 0.0 {
            return Self {
                conductance_m3_s_pa: 0.0,
                ..*self
            };
        }
        // Intermediate pressure ratio r at which the upstream path passes the flow that chokes the downstream
        // one: (c1/c2)² (1 - ((r-b1)/(1-b1))²) = r².
        let k2 = (c1 / c2) * (c1 / c2);
        let beta2 = (1.0 - b1) * (1.0 - b1);
        let denominator = beta2 + k2;
        // Below 0, k2 β² (β² + k2 − b1²): the upstream path chokes first, by far.
        let discriminant = k2 * k2 * b1 * b1 - denominator * k2 * (b1 * b1 - beta2);
        let r = (k2 * b1 + discriminant.max(0.0).sqrt()) / denominator;
        let c = if r <= b1 { c1 } else { c2 * r };
        let b = 1.0 - c * c * ((1.0 - b1) / (c1 * c1) + (1.0 - b2) / (c2 * c2));
        Self {
            conductance_m3_s_pa: c,
            critical_ratio: b.clamp(0.0, 0.9),
            ..*self
        }
    }
}

/// A flow path with everything a step needs precomputed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Restrictor {
    /// C ρ0 √T0, so that mdot = this · p1 · ψ(r) / √T1.
    scale: f64,
    critical_ratio: f64,
    inv_one_minus_b: f64,
    linear_ratio: f64,
    /// ψ(β)/(1−β), the slope of the linear zone.
    linear_slope: f64,
    subsonic_exponent: f64,
    square_root: bool,
}

impl Restrictor {
    /// Precomputes `path` for the gas.
    #[must_use]
    pub fn new(path: &Iso6358, gas: &GasParams) -> Self {
        let b = path.critical_ratio;
        let inv = 1.0 / (1.0 - b);
        let y = (path.linear_ratio - b) * inv;
        let psi_beta = libm::pow(1.0 - y * y, path.subsonic_exponent);
        Self {
            scale: path.conductance_m3_s_pa
                * gas.reference_density_kg_m3
                * gas.reference_temperature_k.sqrt(),
            critical_ratio: b,
            inv_one_minus_b: inv,
            linear_ratio: path.linear_ratio,
            linear_slope: psi_beta / (1.0 - path.linear_ratio),
            subsonic_exponent: path.subsonic_exponent,
            square_root: path.subsonic_exponent == 0.5,
        }
    }

    /// Slope of the mass flow in the pressure difference near equal pressures \[kg/(s Pa)\]:
    /// the steepest there is. `sqrt_t` is the root of the temperature upstream \[√K\].
    #[must_use]
    pub fn steepest_kg_s_pa(&self, sqrt_t: f64) -> f64 {
        self.scale * self.linear_slope / sqrt_t
    }

    /// Flow function ψ(r) \[-\], 1 when choked, 0 at r = 1.
    #[must_use]
    #[inline]
    pub fn psi(&self, ratio: f64) -> f64 {
        if ratio <= self.critical_ratio {
            1.0
        } else if ratio <= self.linear_ratio {
            let y = (ratio - self.critical_ratio) * self.inv_one_minus_b;
            let inside = 1.0 - y * y;
            if self.square_root {
                inside.sqrt()
            } else {
                libm::pow(inside, self.subsonic_exponent)
            }
        } else {
            self.linear_slope * (1.0 - ratio)
        }
    }

    /// p1 ψ(p2/p1) \[Pa\] for p1 ≥ p2, by one root instead of root and division: with
    /// m = 0.5, p1 ψ = √(p1² − ((p2 − b p1)/(1 − b))²). Equal to [`Restrictor::psi`]
    /// but for rounding; other exponents go through it.
    ///
    /// The steps of the plant use ψ itself, so that logs stay the same to the last bit.
    #[must_use]
    #[inline]
    pub fn throughput_pa(&self, up_pa: f64, down_pa: f64) -> f64 {
        let beyond = down_pa - self.critical_ratio * up_pa;
        if beyond <= 0.0 {
            up_pa
        } else if down_pa > self.linear_ratio * up_pa {
            self.linear_slope * (up_pa - down_pa)
        } else if self.square_root {
            let y = beyond * self.inv_one_minus_b;
            (up_pa * up_pa - y * y).sqrt()
        } else {
            up_pa * self.psi(down_pa / up_pa)
        }
    }

    /// Mass flow from `1` to `2` \[kg/s\], negative when gas runs back.
    ///
    /// Pressures absolute \[Pa\] and positive; temperatures \[K\]; the upstream
    /// one counts.
    #[must_use]
    #[inline]
    pub fn mass_flow_kg_s(&self, p1_pa: f64, sqrt_t1: f64, p2_pa: f64, sqrt_t2: f64) -> f64 {
        if p1_pa >= p2_pa {
            self.scale * p1_pa * self.psi(p2_pa / p1_pa) / sqrt_t1
        } else {
            -self.scale * p2_pa * self.psi(p1_pa / p2_pa) / sqrt_t2
        }
    }
}

/// Laminar leak past a seal: mdot = ρ0 G (p1² − p2²)/(2 p0).
///
/// G \[m³/(s·Pa)\] is the volume flow at the reference atmosphere per pascal
/// at pressures near it (Poiseuille flow of a compressible gas).
#[must_use]
#[inline]
pub fn leak_kg_s(g_m3_s_pa: f64, gas: &GasParams, p1_pa: f64, p2_pa: f64) -> f64 {
    gas.reference_density_kg_m3 * g_m3_s_pa * (p1_pa * p1_pa - p2_pa * p2_pa)
        / (2.0 * gas.reference_pressure_pa)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::air;
    use proptest::prelude::*;

    fn valve() -> Restrictor {
        Restrictor::new(&Iso6358::new(0.144e-8, 0.3), &air())
    }

    #[test]
    fn choked_flow_is_c_rho_p() {
        // 0.144 dm³/(s bar) at 7 bar abs: 1.008 dm³/s ANR = 1.19448e-3 kg/s at T0.
        let t = 293.15_f64.sqrt();
        let m = valve().mass_flow_kg_s(7e5, t, 1e5, t);
        assert!((m - 0.144e-8 * 7e5 * 1.185).abs() < 1e-12, "{m}");
    }

    #[test]
    fn catalogue_flow_six_to_five_bar() {
        // q_n[l/min] ≈ 254 C[dm³/(s bar)] for b = 0.3 (6 → 5 bar gauge).
        let t = 293.15_f64.sqrt();
        let path = Restrictor::new(&Iso6358::new(1e-8, 0.3), &air());
        let q = path.mass_flow_kg_s(7e5, t, 6e5, t) / 1.185 * 60e3;
        assert!((q - 254.0).abs() < 2.0, "{q}");
    }

    #[test]
    fn continuous_at_both_borders_and_monotone() {
        for (m, b) in [(0.5, 0.3), (0.6, 0.15), (0.5, 0.5)] {
            let mut path = Iso6358::new(1e-8, b);
            path.subsonic_exponent = m;
            let v = Restrictor::new(&path, &air());
            for border in [b, 0.999] {
                let step = (v.psi(border + 1e-9) - v.psi(border - 1e-9)).abs();
                assert!(step < 1e-6, "m {m} b {b} border {border}: jump {step}");
            }
            let mut last = v.psi(0.0);
            for i in 1..=100_000 {
                let psi = v.psi(f64::from(i) * 1e-5);
                assert!(psi <= last && psi >= 0.0);
                last = psi;
            }
            assert_eq!(v.psi(1.0), 0.0);
        }
    }

    #[test]
    fn throughput_is_psi_without_its_division() {
        for exponent in [0.5, 0.6] {
            let mut path = Iso6358::new(1e-8, 0.35);
            path.subsonic_exponent = exponent;
            let v = Restrictor::new(&path, &air());
            for i in 0..=10_000 {
                let ratio = f64::from(i) * 1e-4;
                let (ours, psi) = (v.throughput_pa(7e5, 7e5 * ratio), 7e5 * v.psi(ratio));
                // At ratio 1 the difference of two equal pressures is left: 0.
                assert!((ours - psi).abs() <= 1e-12 * 7e5, "{ratio}: {ours} {psi}");
            }
        }
    }

    #[test]
    fn hot_gas_flows_less_by_the_root_of_temperature() {
        let cold = valve().mass_flow_kg_s(6e5, 293.15_f64.sqrt(), 1e5, 1.0);
        let hot = valve().mass_flow_kg_s(6e5, (4.0 * 293.15_f64).sqrt(), 1e5, 1.0);
        assert!((cold / hot - 2.0).abs() < 1e-12);
    }

    #[test]
    fn series_of_equal_sharp_paths_is_close_to_root_two() {
        // The rule 1/C² = Σ 1/C_i² is an approximation; the exact value for
        // two equal paths with b = 0.3 lies within 15 % above it.
        let one = Iso6358::new(1e-8, 0.3);
        let two = one.in_series(&one);
        let c = two.conductance_m3_s_pa;
        assert!(c > 1e-8 / 2f64.sqrt() && c < 0.85e-8, "{c}");
        // A far larger partner changes nothing.
        let wide = one.in_series(&Iso6358::new(1e-6, 0.3));
        assert!((wide.conductance_m3_s_pa / 1e-8 - 1.0).abs() < 1e-3);
        let wide = Iso6358::new(1e-6, 0.3).in_series(&one);
        assert!((wide.conductance_m3_s_pa / 1e-8 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn series_choked_flow_agrees_with_two_paths_solved_numerically() {
        let gas = air();
        let t = gas.reference_temperature_k.sqrt();
        let ratios = [(1.0, 1.0), (1.0, 3.0), (3.0, 1.0), (1.0, 0.2), (1.0, 100.0)];
        // Upstream of a wide path one that chokes late does so first.
        let all = [0.0, 0.3, 0.55, 0.9].map(|b1| ratios.map(|(c1, c2)| (b1, c1, c2)));
        for (b1, c1, c2) in all.into_iter().flatten() {
            let a = Iso6358::new(c1 * 1e-8, b1);
            let b = Iso6358::new(c2 * 1e-8, 0.25);
            let (ra, rb) = (Restrictor::new(&a, &gas), Restrictor::new(&b, &gas));
            let pair = Restrictor::new(&a.in_series(&b), &gas);
            let (mut low, mut high) = (1e3, 7e5);
            for _ in 0..200 {
                let mid = 0.5 * (low + high);
                if ra.mass_flow_kg_s(7e5, t, mid, t) > rb.mass_flow_kg_s(mid, t, 1e3, t) {
                    low = mid;
                } else {
                    high = mid;
                }
            }
            let exact = ra.mass_flow_kg_s(7e5, t, low, t);
            let ours = pair.mass_flow_kg_s(7e5, t, 1e3, t);
            assert!(
                (ours / exact - 1.0).abs() < 1e-6,
                "{b1} {c1} {c2}: {ours} {exact}"
            );
        }
    }

    proptest! {
        #[test]
        fn flow_is_antisymmetric_and_never_runs_uphill(p1 in 1e4..1e6f64, p2 in 1e4..1e6f64, t in 250.0..350.0f64) {
            let v = valve();
            let s = t.sqrt();
            let forward = v.mass_flow_kg_s(p1, s, p2, s);
            let back = v.mass_flow_kg_s(p2, s, p1, s);
            prop_assert!((forward + back).abs() <= 1e-15);
            prop_assert!(forward * (p1 - p2) >= 0.0);
            let leak = leak_kg_s(1e-14, &air(), p1, p2);
            prop_assert!(leak * (p1 - p2) >= 0.0);
        }
    }
}
