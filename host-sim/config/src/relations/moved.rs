//! Whether a step of the plant follows what is stiff: friction, end stops, air.
//!
//! The plant advances by a kick, a drift and a kick of half a step each, with speeds predicted
//! half a step ahead. On m a = −c v − k x this is stable while
//!
//! ```text
//! c h / m  +  k h² / (4 m)  <  1        (characteristic root at −1)
//! ```
//!
//! Air is advanced by Heun's method, which on p' = −rate · p is stable while step × rate < 2.

use wheeleg_plant::cylinder::{CylinderModel, CylinderParams};
use wheeleg_plant::flow::GasParams;
use wheeleg_plant::supply::SupplyParams;

use super::{Broken, Facts, Relation};
use crate::quantity::{brief, pretty};

/// Where the explicit step of a mass becomes unstable.
const STEP_LIMIT: f64 = 1.0;
/// The same of the gas in a chamber.
const GAS_LIMIT: f64 = 2.0;
/// A piston runs into its stop this many times deeper than its full force presses it.
const IMPACT: f64 = 2.0;

/// One cylinder with what it moves.
pub(crate) struct Moved<'a> {
    /// The cylinder.
    pub cylinder: &'a CylinderParams,
    /// Its gas.
    pub gas: &'a GasParams,
    /// Its supply.
    pub supply: &'a SupplyParams,
    /// What moves, kg.
    pub mass_kg: f64,
    /// Force of the load, N, without sign.
    pub load_n: f64,
    /// Step of the integration, s.
    pub step_s: f64,
}

impl Moved<'_> {
    fn piston_m2(&self) -> f64 {
        std::f64::consts::FRAC_PI_4 * self.cylinder.bore_m * self.cylinder.bore_m
    }

    /// The largest force of air and load, N.
    fn force_n(&self) -> f64 {
        let gauge_pa = self.supply.set_pressure_pa - self.gas.ambient_pressure_pa;
        self.piston_m2() * gauge_pa.max(0.0) + self.load_n
    }

    /// c h / m + k h² / (4 m), with what the step or the mass would have to be.
    fn stability(&self, damping_n_s_m: f64, stiffness_n_m: f64) -> Option<Broken> {
        let (h, m) = (self.step_s, self.mass_kg);
        let number = damping_n_s_m * h / m + stiffness_n_m * h * h / (4.0 * m);
        if number < STEP_LIMIT {
            return None;
        }
        // k/4 h² + c h − m = 0, and a tenth below it.
        let (a, b) = (0.25 * stiffness_n_m, damping_n_s_m);
        let longest_s = 2.0 * m / (b + (b * b + 4.0 * a * m).sqrt());
        let step_us = (0.9 * longest_s * 1e6).floor().max(1.0);
        let mass_kg = 1.1 * number * m;
        Some(Broken {
            figures: format!(
                "damping × step / mass + stiffness × step² / (4 × mass) = {number:.2}, allowed \
                 below {STEP_LIMIT}"
            ),
            allowed: format!(
                "a step of at most {} us, or a mass of at least {} kg, is allowed",
                pretty(step_us),
                pretty((mass_kg * 1e4).ceil() * 1e-4)
            ),
        })
    }

    fn of_friction(&self) -> Option<Broken> {
        let f = &self.cylinder.friction;
        let damping = f.bristle_damping_n_s_m + f.viscous_n_s_m;
        self.stability(damping, f.bristle_stiffness_n_m)
    }

    fn of_end_stop(&self) -> Option<Broken> {
        let (f, stop) = (&self.cylinder.friction, &self.cylinder.end_stop);
        // Hunt–Crossley: k d (1 + λ d') damps with λ times the static force. The cushion acts on
        // the way in alone: in half of an oscillation.
        let damping = f.bristle_damping_n_s_m
            + f.viscous_n_s_m
            + 0.5 * stop.cushion_damping_n_s_m
            + stop.damping_s_m * self.force_n();
        let stiffness = f.bristle_stiffness_n_m + stop.stiffness_n_m;
        self.stability(damping, stiffness)
    }
}

/// The cylinder, if the relation's last field is that of its mass.
fn moved<'a>(f: &'a Facts<'_>, it: &Relation) -> Option<&'a Moved<'a>> {
    f.info(it.fields.last()?)?;
    f.moved
}

/// A step follows friction.
pub(super) fn friction(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    moved(f, it)?.of_friction()
}

/// A step follows the end stop, where it follows friction alone.
pub(super) fn end_stop(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let moved = moved(f, it)?;
    match moved.of_friction() {
        None => moved.of_end_stop(),
        Some(_) => None,
    }
}

/// Chamber B is that of the relation whose first field is its dead volume.
fn is_b(it: &Relation) -> bool {
    it.fields[0].ends_with("_b")
}

/// A step follows the air of a chamber.
pub(super) fn gas(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let moved = f.moved?;
    let model = CylinderModel::new(moved.cylinder, moved.gas).ok()?;
    let number = moved.step_s * model.fastest_rate_1_s(is_b(it));
    if number < GAS_LIMIT {
        return None;
    }
    let step_us = (0.9 * GAS_LIMIT / number * moved.step_s * 1e6).floor();
    Some(Broken {
        figures: format!("step × rate = {number:.2}, allowed below {GAS_LIMIT}"),
        allowed: format!(
            "a step of at most {} us is allowed, or a {} times larger volume",
            pretty(step_us.max(1.0)),
            pretty((number / (0.9 * GAS_LIMIT) * 10.0).ceil() / 10.0)
        ),
    })
}

/// The piston runs into its stop; the chamber there must not vanish.
pub(super) fn volume(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let moved = f.moved?;
    let c = moved.cylinder;
    let depth_m = IMPACT * moved.force_n() / c.end_stop.stiffness_n_m;
    let least_m3 = moved.piston_m2() * depth_m;
    let dead_m3 = if is_b(it) {
        c.dead_volume_b_m3
    } else {
        c.dead_volume_a_m3
    };
    let volume_m3 = dead_m3 + c.line_volume_m3;
    if volume_m3 > least_m3 {
        return None;
    }
    Some(Broken {
        figures: format!(
            "it runs {} mm into its stop, by {} cm3, and there are {} cm3 before it",
            brief(depth_m * 1e3),
            brief(least_m3 * 1e6),
            brief(volume_m3 * 1e6)
        ),
        allowed: format!(
            "a dead volume of at least {} cm3 is allowed, or a stiffer end stop",
            pretty(((least_m3 - c.line_volume_m3) * 1.05e7).ceil() * 0.1)
        ),
    })
}

/// A step follows the reservoir, which the regulator fills and the dump valve empties.
pub(super) fn supply(f: &Facts<'_>, _: &Relation) -> Option<Broken> {
    let moved = f.moved?;
    let (supply, gas) = (moved.supply, moved.gas);
    // Choked flow over the droop: the regulator opens in proportion to what is missing.
    let flow_kg_s = supply.regulator_flow.conductance_m3_s_pa
        * gas.reference_density_kg_m3
        * supply.source_pressure_pa;
    let volume_rate = gas.gas_constant_j_kg_k * gas.ambient_temperature_k * flow_kg_s;
    let least_m3 = volume_rate / supply.droop_pa * moved.step_s / GAS_LIMIT;
    if supply.reservoir_m3 > least_m3 {
        return None;
    }
    Some(Broken {
        figures: String::new(),
        allowed: format!(
            "a reservoir of at least {} dm3, a larger droop or a shorter step is allowed",
            brief(least_m3 * 1.1e3)
        ),
    })
}
