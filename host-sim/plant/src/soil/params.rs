//! Parameters of a soil, and the soils that have a name.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};
use crate::hash::StateHasher;

/// A soft, homogeneous soil of any depth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Soil {
    /// Cohesive modulus of sinkage, Bekker's k_c \[N/m^(n+1)\].
    pub kc_n_m: f64,
    /// Frictional modulus of sinkage, Bekker's k_φ \[N/m^(n+2)\].
    pub kphi_n_m: f64,
    /// Exponent of sinkage n.
    pub exponent: f64,
    /// Cohesion c \[Pa\].
    pub cohesion_pa: f64,
    /// Angle of internal friction φ \[rad\].
    pub friction_rad: f64,
    /// Shear displacement at which 63 % of the shear strength is mobilised, Janosi's K \[m\].
    pub shear_m: f64,
    /// Density \[kg/m³\].
    pub density_kg_m3: f64,
    /// Pressure against a surface that sinks, over its speed \[Pa s/m\].
    pub damping_pa_s_m: f64,
    /// Share of the deepest sinkage over which an unloaded surface rises and comes free.
    pub rebound: f64,
    /// Most stiffness of a surface that rises \[Pa/m\].
    pub stiffness_most_pa_m: f64,
    /// Damping of shear that has not come to its steady state yet, a wheel or a sole \[N s/m\].
    pub shear_damping_n_s_m: f64,
}

/// Common properties of the four soils.
const COMMON: Soil = Soil {
    kc_n_m: 0.0,
    kphi_n_m: 0.0,
    exponent: 1.1, // - ASSUMED: as Wong's dry sand
    cohesion_pa: 0.0,
    friction_rad: 0.0,
    shear_m: 0.0,
    density_kg_m3: 1500.0,      // kg/m3 ASSUMED: loose dry sand
    damping_pa_s_m: 3e4,        // Pa s/m ASSUMED: presets of Chrono's SCM terrain
    rebound: 0.05,              // - ASSUMED: sand springs back little
    stiffness_most_pa_m: 2e8,   // Pa/m ASSUMED: presets of Chrono's SCM terrain; bounds the step
    shear_damping_n_s_m: 100.0, // N s/m ASSUMED
};

impl Soil {
    /// Angular basaltic sand. Chosen so that a slope of 20 degrees is near the limit of the robot with
    /// lugged wheels 100 mm wide: that it climbs such a slope is consistency, not evidence.
    pub const VOLCANIC_SAND: Self = Self {
        kphi_n_m: 3.0e6,                                   // N/m^(n+2) ASSUMED
        exponent: 1.1,                                     // - ASSUMED
        cohesion_pa: 300.0,                                // Pa ASSUMED
        friction_rad: 36.0 * std::f64::consts::PI / 180.0, // rad ASSUMED
        shear_m: 0.010,                                    // m ASSUMED
        ..COMMON
    };

    /// Dry sand of Wong, Theory of Ground Vehicles.
    pub const DRY_SAND: Self = Self {
        kc_n_m: 0.99e3,                                    // N/m^(n+1) Wong, from memory
        kphi_n_m: 1.528e6,                                 // N/m^(n+2) Wong, from memory
        exponent: 1.1,                                     // - Wong, from memory
        cohesion_pa: 1040.0,                               // Pa Wong, from memory
        friction_rad: 28.0 * std::f64::consts::PI / 180.0, // rad Wong, from memory
        shear_m: 0.025,                                    // m ASSUMED: upper end of sands
        ..COMMON
    };

    /// Firm, damp sand.
    pub const FIRM_SAND: Self = Self {
        kc_n_m: 102e3,       // N/m^(n+1) preset "hard" of Chrono's SCM terrain
        kphi_n_m: 5.301e6,   // N/m^(n+2) the same
        exponent: 0.793,     // - the same
        cohesion_pa: 1300.0, // Pa the same
        friction_rad: 31.1 * std::f64::consts::PI / 180.0, // rad the same
        shear_m: 0.012,      // m the same
        density_kg_m3: 1600.0, // kg/m3 ASSUMED
        ..COMMON
    };

    /// Fresh volcanic ash, loose.
    pub const LOOSE_ASH: Self = Self {
        kphi_n_m: 0.5e6,                                   // N/m^(n+2) ASSUMED
        exponent: 1.1,                                     // - ASSUMED
        cohesion_pa: 200.0,                                // Pa ASSUMED
        friction_rad: 34.0 * std::f64::consts::PI / 180.0, // rad ASSUMED
        shear_m: 0.025,                                    // m ASSUMED
        density_kg_m3: 1100.0,                             // kg/m3 ASSUMED
        ..COMMON
    };

    /// The soils that have a name.
    pub const NAMED: [(&'static str, Self); 4] = [
        ("volcanic-sand", Self::VOLCANIC_SAND),
        ("dry-sand", Self::DRY_SAND),
        ("firm-sand", Self::FIRM_SAND),
        ("loose-ash", Self::LOOSE_ASH),
    ];

    /// The soil of a name; `None` if no soil has it.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let found = Self::NAMED.iter().find(|(n, _)| *n == name);
        found.map(|(_, soil)| *soil)
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the field.
    pub fn validate(&self) -> Result<(), PlantError> {
        check("soil.kc_n_m", self.kc_n_m, 0.0, 1e8)?;
        check("soil.kphi_n_m", self.kphi_n_m, 1e3, 1e9)?;
        check("soil.exponent", self.exponent, 0.3, 2.0)?;
        check("soil.cohesion_pa", self.cohesion_pa, 0.0, 1e5)?;
        check("soil.friction_rad", self.friction_rad, 0.01, 1.0)?;
        check("soil.shear_m", self.shear_m, 1e-3, 0.2)?;
        check("soil.density_kg_m3", self.density_kg_m3, 100.0, 5000.0)?;
        check("soil.damping_pa_s_m", self.damping_pa_s_m, 0.0, 1e6)?;
        check("soil.rebound", self.rebound, 0.01, 1.0)?;
        // On a large foot 2e8 Pa/m are 2.3 N/µm; the step of 100 µs bears 3.2 N/µm.
        let most = self.stiffness_most_pa_m;
        check("soil.stiffness_most_pa_m", most, 1e6, 2e8)?;
        check(
            "soil.shear_damping_n_s_m",
            self.shear_damping_n_s_m,
            0.0,
            500.0,
        )
    }

    /// Adds every parameter to a hash.
    pub fn feed(&self, hasher: &mut StateHasher) {
        hasher.bytes(b"soil");
        for value in [
            self.kc_n_m,
            self.kphi_n_m,
            self.exponent,
            self.cohesion_pa,
            self.friction_rad,
            self.shear_m,
            self.density_kg_m3,
            self.damping_pa_s_m,
            self.rebound,
            self.stiffness_most_pa_m,
            self.shear_damping_n_s_m,
        ] {
            hasher.f64(value);
        }
    }

    /// tan φ.
    #[must_use]
    pub fn friction(&self) -> f64 {
        libm::tan(self.friction_rad)
    }

    /// Bekker's modulus k_c/b + k_φ under a surface whose smaller half dimension or width is `b`
    /// \[N/m^(n+2)\].
    #[must_use]
    pub fn modulus(&self, b_m: f64) -> f64 {
        self.kc_n_m / b_m + self.kphi_n_m
    }

    /// Pressure under a flat surface at a sinkage \[Pa\].
    #[must_use]
    pub fn pressure_pa(&self, b_m: f64, sinkage_m: f64) -> f64 {
        self.modulus(b_m) * libm::pow(sinkage_m.max(0.0), self.exponent)
    }

    /// Scale of the resistive forces ξ on things much larger than the grains, on Earth \[N/m³\]: a fit
    /// of Li, Zhang and Goldman (2013) over their materials, with μ = tan φ.
    #[must_use]
    pub fn resistive_scale_n_m3(&self) -> f64 {
        const GRAVITY_M_S2: f64 = 9.81;
        let mu = self.friction();
        let fit = ((894.0 * mu - 386.0) * mu + 89.0) * mu;
        self.density_kg_m3 * GRAVITY_M_S2 * fit
    }
}
