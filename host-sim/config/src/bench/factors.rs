//! How a plant is off its data sheet: factors of its numbers, one at a time or a random combination.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::sensors::AdcNoise;

/// Deviations from the data sheet.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Factors {
    /// Force on the rod as a share of the force left at the actual supply on the
    /// weaker side, −0.8…0.8; positive extends.
    pub load_share: f64,
    /// Moving mass \[kg\]; `None` leaves the sheet's.
    pub mass_kg: Option<f64>,
    /// Supply pressure \[Pa gauge\]; `None` leaves the sheet's.
    pub supply_pa: Option<f64>,
    /// Factor on all friction forces.
    pub friction: f64,
    /// Factor on the valves' switching times.
    pub valve_delay: f64,
    /// Spread between the valves: fill A and vent B switch slower by this share,
    /// vent A and fill B faster.
    pub valve_spread: f64,
    /// Factor on the converter's noise.
    pub noise: f64,
}

impl Factors {
    /// Nothing differs.
    pub const NONE: Self = Self {
        load_share: 0.0,
        mass_kg: None,
        supply_pa: None,
        friction: 1.0,
        valve_delay: 1.0,
        valve_spread: 0.0,
        noise: 1.0,
    };

    /// One combination of the random suite: load ±0.8, mass 2/3 to 16/3 of the
    /// sheet's, supply from 2 bar below to 1 bar above the sheet's, friction and
    /// valve delay 0.5…2; mass, friction and delay uniform in their logarithm.
    #[must_use]
    pub fn random(sheet: &AxisParams, seed: u64) -> Self {
        let gauge = sheet.supply.set_pressure_pa - sheet.gas.ambient_pressure_pa;
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut unit = || rng.random_range(0.0..1.0_f64);
        Self {
            load_share: 0.8 * (2.0 * unit() - 1.0),
            mass_kg: Some(sheet.moving_mass_kg * 2.0 / 3.0 * 8.0_f64.powf(unit())),
            supply_pa: Some(gauge + 1e5 * (3.0 * unit() - 2.0)),
            friction: 2.0_f64.powf(2.0 * unit() - 1.0),
            valve_delay: 2.0_f64.powf(2.0 * unit() - 1.0),
            ..Self::NONE
        }
    }

    /// The plant with these factors.
    #[must_use]
    pub fn plant(&self, sheet: &AxisParams) -> AxisParams {
        let mut p = sheet.clone();
        if let Some(mass) = self.mass_kg {
            p.moving_mass_kg = mass;
        }
        if let Some(gauge) = self.supply_pa {
            let absolute = gauge + p.gas.ambient_pressure_pa;
            p.supply.set_pressure_pa = absolute;
            p.supply.initial_pressure_pa = absolute;
            p.supply.source_pressure_pa = p.supply.source_pressure_pa.max(absolute + 1e5);
        }
        let f = &mut p.cylinder.friction;
        f.coulomb_n *= self.friction;
        f.static_n *= self.friction;
        f.viscous_n_s_m *= self.friction;
        for (spread, sign) in p
            .cylinder
            .timing_spread
            .iter_mut()
            .zip([1.0, -1.0, -1.0, 1.0])
        {
            *spread *= self.valve_delay * (1.0 + sign * self.valve_spread);
        }
        match &mut p.adc.noise {
            AdcNoise::Uniform {
                half_width_lsb: width,
            }
            | AdcNoise::Gaussian { sigma_lsb: width } => {
                *width *= self.noise;
            }
            AdcNoise::None => {}
        }
        p.load_n += self.load_share * force_left_n(&p);
        p
    }

    /// Force left over the load: 1.25 means a quarter more than the load needs.
    #[must_use]
    pub fn static_margin(&self, sheet: &AxisParams) -> f64 {
        let p = self.plant(sheet);
        force_left_n(&p) / p.load_n.abs().max(1e-9)
    }
}

/// Force at the supply of a plant on the weaker side, less break-away friction under that pressure \[N\].
#[must_use]
pub fn force_left_n(p: &AxisParams) -> f64 {
    let gauge = p.supply.set_pressure_pa - p.gas.ambient_pressure_pa;
    weaker_force_n(p) - p.cylinder.friction.under_pressure(gauge).static_n
}

/// Force at the supply of a plant on the weaker side \[N\].
#[must_use]
pub fn weaker_force_n(p: &AxisParams) -> f64 {
    let c = &p.cylinder;
    let area = std::f64::consts::FRAC_PI_4 * (c.bore_m * c.bore_m - c.rod_m * c.rod_m);
    let gauge = p.supply.set_pressure_pa - p.gas.ambient_pressure_pa;
    gauge * area
}
