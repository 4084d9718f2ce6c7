//! A wheel in soil by integration over its patch, after Wong and Reece (1967).
//!
//! Angles θ from the lowest point forward; the rim enters the soil at θ1, cos θ1 = 1 − z/r, and
//! leaves it at the lowest point. The pressure is largest at
//! θm = (0.4 + 0.2 s) θ1, with the skid 1 − rs ω/v of a braking wheel in place of s:
//!
//! ```text
//! θ ≥ θm   σ = k [r (cos θ − cos θ1)]^n
//! θ < θm   the same at θ1 − (θ/θm)(θ1 − θm) in place of θ
//! j = rs [(θ1 − θ) − (1 − s)(sin θ1 − sin θ)]
//! τ = (c + σ tan φ)(1 − exp(−|j|/K)) sgn j
//! ```
//!
//! with rs the radius over the lugs. Gauss and Legendre's nodes, 4 below θm and 5 above it, come
//! within 5e-4 of the integrals in the named soils.

use serde::{Deserialize, Serialize};

use super::params::Soil;
use crate::error::{PlantError, check};

/// Nodes on −1..1 with their weights.
const FOUR: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
    (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
];
const FIVE: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    (-0.538_469_310_105_683, 0.478_628_670_499_366_47),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683, 0.478_628_670_499_366_47),
    (0.906_179_845_938_664, 0.236_926_885_056_189_08),
];

/// A rigid wheel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Wheel {
    /// Radius of the rim r \[m\].
    pub radius_m: f64,
    /// Width b \[m\].
    pub width_m: f64,
    /// Height of the lugs over the rim \[m\]: soil between them shears at their tips.
    pub lug_m: f64,
}

/// Forces of soil on a wheel that rolls forward.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WheelForces {
    /// Normal force N \[N\].
    pub normal_n: f64,
    /// Compaction resistance R: the pressure's push against the motion \[N\].
    pub compaction_n: f64,
    /// Thrust H: the shear's push along the motion \[N\].
    pub thrust_n: f64,
    /// Torque T that the shear takes from the wheel \[N m\].
    pub torque_n_m: f64,
}

impl WheelForces {
    /// Drawbar pull DP = H − R \[N\].
    #[must_use]
    pub fn drawbar_n(&self) -> f64 {
        self.thrust_n - self.compaction_n
    }
}

impl Wheel {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the field.
    pub fn validate(&self) -> Result<(), PlantError> {
        check("wheel.radius_m", self.radius_m, 0.01, 10.0)?;
        check("wheel.width_m", self.width_m, 1e-3, 10.0)?;
        check("wheel.lug_m", self.lug_m, 0.0, 0.5 * self.radius_m)
    }

    /// Radius over the lugs rs \[m\].
    #[must_use]
    pub fn shear_radius_m(&self) -> f64 {
        self.radius_m + self.lug_m
    }

    /// Angle θ1 at which the rim enters the soil \[rad\].
    #[must_use]
    #[inline]
    pub fn entry_rad(&self, sinkage_m: f64) -> f64 {
        // 2 asin √(z/2r) is acos(1 − z/r) without its loss of digits.
        let half = (0.5 * sinkage_m / self.radius_m).clamp(0.0, 1.0);
        2.0 * libm::asin(half.sqrt())
    }

    /// Forces at a sinkage of 0..2 r \[m\] and a slip s = 1 − v/(rs ω), below 0 when braking.
    #[must_use]
    pub fn forces(&self, soil: &Soil, sinkage_m: f64, slip: f64) -> WheelForces {
        let entry = self.entry_rad(sinkage_m);
        // Skid, 1 − rs ω/v, of a wheel that brakes: never above 1 either.
        let slipping = if slip < 0.0 {
            slip / (slip - 1.0)
        } else {
            slip
        };
        let deepest = (0.4 + 0.2 * slipping) * entry;
        let patch = Patch {
            soil: *soil,
            friction: soil.friction(),
            modulus: soil.modulus(self.width_m),
            radius_m: self.radius_m,
            shear_radius_m: self.shear_radius_m(),
            entry,
            entry_trig: libm::sincos(entry),
            slip,
        };
        let mut sum = [0.0; 4];
        let mut add = |from: f64, to: f64, nodes: &[(f64, f64)], front: bool| {
            let half = 0.5 * (to - from);
            for (node, weight) in nodes {
                let angle = from + half * (1.0 + node);
                // Behind the peak the pressure mirrors that before it, stretched.
                let alike = if front {
                    angle
                } else {
                    entry - angle / deepest * (entry - deepest)
                };
                let stresses = patch.along_rim(angle, alike);
                for (sum, stress) in sum.iter_mut().zip(stresses) {
                    *sum += half * weight * stress;
                }
            }
        };
        if entry > 0.0 {
            add(0.0, deepest, &FOUR, false);
            add(deepest, entry, &FIVE, true);
        }
        let [normal, compaction, thrust, shear] = sum.map(|s| self.radius_m * self.width_m * s);
        WheelForces {
            normal_n: normal,
            compaction_n: compaction,
            thrust_n: thrust,
            torque_n_m: self.shear_radius_m() * shear,
        }
    }
}

/// A patch of rim in the soil.
struct Patch {
    soil: Soil,
    friction: f64,
    modulus: f64,
    radius_m: f64,
    shear_radius_m: f64,
    entry: f64,
    /// Sine and cosine of the entry.
    entry_trig: (f64, f64),
    slip: f64,
}

impl Patch {
    /// Stresses at an angle \[Pa\] whose pressure is that at the angle `alike`: up, back, forward,
    /// along the rim.
    fn along_rim(&self, angle: f64, alike: f64) -> [f64; 4] {
        let (sin_entry, cos_entry) = self.entry_trig;
        let (sin, cos) = libm::sincos(angle);
        let depth = self.radius_m * (libm::cos(alike) - cos_entry);
        let pressure = self.modulus * libm::pow(depth.max(0.0), self.soil.exponent);
        let slid = (self.entry - angle) - (1.0 - self.slip) * (sin_entry - sin);
        let sheared = self.shear_radius_m * slid;
        let mobilised = -libm::expm1(-sheared.abs() / self.soil.shear_m);
        let strength = self.soil.cohesion_pa + pressure * self.friction;
        let shear = (strength * mobilised).copysign(sheared);
        [
            pressure * cos + shear * sin,
            pressure * sin,
            shear * cos,
            shear,
        ]
    }
}
