//! Whether a step of the plant can follow stiff parts: friction, end stops, air.
//!
//! The plant advances by a kick, a drift and a kick of half a step each, with speeds predicted
//! half a step ahead. On m a = −c v − k x this is stable while
//!
//! ```text
//! c h / m  +  k h² / (4 m)  <  1        (characteristic root at −1)
//! ```
//!
//! Air is advanced by Heun's method, which on p' = −rate · p is stable while step × rate < 2.

use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::cylinder::{CylinderModel, CylinderParams};
use wheeleg_plant::flow::GasParams;
use wheeleg_plant::supply::SupplyParams;

use super::{Bound, Broken, Facts, Offer, Relation};
use crate::quantity::brief;

/// Where the explicit step of a mass becomes unstable.
const STEP_LIMIT: f64 = 1.0;
/// The same of the gas in a chamber.
const GAS_LIMIT: f64 = 2.0;
/// The shortest step that a file may have, s.
const SHORTEST_STEP_S: f64 = 1e-6;
/// Its field.
const STEP: &str = "numerics.step";
/// A piston that hits its stop goes this many times deeper than under its full force at rest.
const IMPACT: f64 = 2.0;

/// One cylinder and its load.
pub(crate) struct Moved<'a> {
    /// The cylinder.
    pub cylinder: &'a CylinderParams,
    /// Its gas.
    pub gas: &'a GasParams,
    /// Its supply.
    pub supply: &'a SupplyParams,
    /// Moving mass, kg.
    pub mass_kg: f64,
    /// Force of the load, N, without sign.
    pub load_n: f64,
    /// Step of the integration, s.
    pub step_s: f64,
}

/// Smallest mass that the step of an axis can follow \[kg\]; `None` if it follows the axis's own.
#[must_use]
pub fn least_mass_kg(axis: &AxisParams) -> Option<f64> {
    let moved = Moved::of(axis);
    let both = [moved.of_friction(), moved.in_end_stop()];
    let follows = both.iter().all(|it| it.number() < STEP_LIMIT);
    let least_kg = both.iter().map(Oscillator::least_mass_kg);
    (!follows).then(|| least_kg.fold(0.0, f64::max))
}

impl<'a> Moved<'a> {
    /// The cylinder of an axis.
    pub(crate) fn of(axis: &'a AxisParams) -> Self {
        Self {
            cylinder: &axis.cylinder,
            gas: &axis.gas,
            supply: &axis.supply,
            mass_kg: axis.moving_mass_kg,
            load_n: axis.load_n.abs(),
            step_s: axis.step_ns as f64 * 1e-9,
        }
    }
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

    /// Only friction.
    fn of_friction(&self) -> Oscillator {
        let f = &self.cylinder.friction;
        Oscillator {
            damping_n_s_m: f.bristle_damping_n_s_m + f.viscous_n_s_m,
            stiffness_n_m: f.bristle_stiffness_n_m,
            ..self.free()
        }
    }

    /// In its end stop.
    fn in_end_stop(&self) -> Oscillator {
        let (friction, stop) = (self.of_friction(), &self.cylinder.end_stop);
        // Hunt–Crossley: k d (1 + λ d') damps with λ times the static force. The cushion acts only on the way
        // in: in half of an oscillation.
        Oscillator {
            damping_n_s_m: friction.damping_n_s_m
                + 0.5 * stop.cushion_damping_n_s_m
                + stop.damping_s_m * self.force_n(),
            stiffness_n_m: friction.stiffness_n_m + stop.stiffness_n_m,
            ..self.free()
        }
    }

    fn free(&self) -> Oscillator {
        Oscillator {
            mass_kg: self.mass_kg,
            step_s: self.step_s,
            damping_n_s_m: 0.0,
            stiffness_n_m: 0.0,
        }
    }
}

/// A mass that the plant moves in explicit steps.
#[derive(Debug, Clone, Copy)]
struct Oscillator {
    mass_kg: f64,
    step_s: f64,
    damping_n_s_m: f64,
    stiffness_n_m: f64,
}

impl Oscillator {
    /// c h / m + k h² / (4 m)
    fn number(&self) -> f64 {
        let Self {
            mass_kg: m,
            step_s: h,
            damping_n_s_m: c,
            stiffness_n_m: k,
        } = self;
        c * h / m + k * h * h / (4.0 * m)
    }

    /// A tenth below the step at which k/4 h² + c h − m = 0, in whole microseconds.
    fn longest_step_s(&self) -> f64 {
        let (a, b, m) = (0.25 * self.stiffness_n_m, self.damping_n_s_m, self.mass_kg);
        let longest_s = 2.0 * m / (b + (b * b + 4.0 * a * m).sqrt());
        (0.9 * longest_s * 1e6).floor().max(1.0) * 1e-6
    }

    /// A tenth above the mass for which the step is slightly too long.
    fn least_mass_kg(&self) -> f64 {
        (1.1 * self.number() * self.mass_kg * 1e4).ceil() * 1e-4
    }

    /// The error for one whose step is too long, with a step or a mass that is enough for it and the other.
    fn broken(&self, other: &Self, f: &Facts<'_>, it: &Relation) -> Option<Broken> {
        if self.number() < STEP_LIMIT {
            return None;
        }
        let mass = it.fields.last()?;
        let step_s = self.longest_step_s().min(other.longest_step_s());
        let mass_kg = self.least_mass_kg().max(other.least_mass_kg());
        // If neither range is enough: a tenth of the step, and the mass that it needs.
        let short_s = (0.1 * self.step_s).max(SHORTEST_STEP_S);
        let stepped = |it: &Self| {
            Self {
                step_s: short_s,
                ..*it
            }
            .least_mass_kg()
        };
        Some(Broken {
            figures: format!(
                "damping × step / mass + stiffness × step² / (4 × mass) = {:.2}, allowed below \
                 {STEP_LIMIT}",
                self.number()
            ),
            offers: vec![
                f.offer(STEP, Bound::UpTo, step_s),
                f.offer(mass, Bound::From, mass_kg),
                vec![
                    Offer::new(f, STEP, Bound::UpTo, short_s),
                    Offer::new(f, mass, Bound::From, stepped(self).max(stepped(other))),
                ],
            ],
            words: String::new(),
        })
    }
}

/// The cylinder, if the relation's last field is its mass.
fn moved<'a>(f: &'a Facts<'_>, it: &Relation) -> Option<&'a Moved<'a>> {
    f.info(it.fields.last()?)?;
    f.moved
}

/// The step can follow friction.
pub(super) fn friction(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let moved = moved(f, it)?;
    moved.of_friction().broken(&moved.in_end_stop(), f, it)
}

/// The step can follow the end stop, if it can follow friction alone.
pub(super) fn end_stop(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let moved = moved(f, it)?;
    let friction = moved.of_friction();
    match friction.number() < STEP_LIMIT {
        true => moved.in_end_stop().broken(&friction, f, it),
        false => None,
    }
}

/// Chamber of a cylinder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Chamber {
    A,
    B,
}

/// The step can follow the air of chamber A.
pub(super) fn gas_a(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    gas(f, it, Chamber::A)
}

/// The step can follow the air of chamber B.
pub(super) fn gas_b(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    gas(f, it, Chamber::B)
}

fn gas(f: &Facts<'_>, it: &Relation, chamber: Chamber) -> Option<Broken> {
    let moved = f.moved?;
    let model = CylinderModel::new(moved.cylinder, moved.gas).ok()?;
    let number = moved.step_s * model.fastest_rate_1_s(chamber == Chamber::B);
    if number < GAS_LIMIT {
        return None;
    }
    let slower = 0.9 * GAS_LIMIT / number;
    let step_s = (slower * moved.step_s * 1e6).floor().max(1.0) * 1e-6;
    let line_m3 = moved.cylinder.line_volume_m3;
    let dead_m3 = (f.si(it.fields[0])? + line_m3) / slower - line_m3;
    Some(Broken {
        figures: format!("step × rate = {number:.2}, allowed below {GAS_LIMIT}"),
        offers: vec![
            f.offer(STEP, Bound::UpTo, step_s),
            f.offer(it.fields[0], Bound::From, (dead_m3 * 1e7).ceil() * 1e-7),
        ],
        words: String::new(),
    })
}

/// A piston that arrives at its stop, which damps it, goes this many times deeper than one that its full
/// force holds there.
const ARRIVAL: f64 = 1.4;

/// The stop holds the piston within the range of its model.
pub(super) fn depth(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    let moved = f.moved?;
    let c = moved.cylinder;
    let depth_m = ARRIVAL * moved.force_n() / c.end_stop.stiffness_n_m;
    let most_m = c.stop_margin_m();
    if depth_m <= most_m {
        return None;
    }
    let stiffness_n_m = ARRIVAL * moved.force_n() / most_m;
    Some(Broken {
        figures: format!(
            "its full force presses it {} mm into its stop, of which {} mm are allowed",
            brief(depth_m * 1e3),
            brief(most_m * 1e3)
        ),
        offers: vec![f.offer(
            it.fields[0],
            Bound::From,
            (stiffness_n_m * 1e-3).ceil() * 1e3,
        )],
        words: String::new(),
    })
}

/// A piston that runs into its stop must leave some volume of chamber A.
pub(super) fn volume_a(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    volume(f, it, Chamber::A)
}

/// The same for chamber B.
pub(super) fn volume_b(f: &Facts<'_>, it: &Relation) -> Option<Broken> {
    volume(f, it, Chamber::B)
}

fn volume(f: &Facts<'_>, it: &Relation, chamber: Chamber) -> Option<Broken> {
    let moved = f.moved?;
    let c = moved.cylinder;
    let depth_m = IMPACT * moved.force_n() / c.end_stop.stiffness_n_m;
    let least_m3 = moved.piston_m2() * depth_m;
    let dead_m3 = match chamber {
        Chamber::A => c.dead_volume_a_m3,
        Chamber::B => c.dead_volume_b_m3,
    };
    let volume_m3 = dead_m3 + c.line_volume_m3;
    if volume_m3 > least_m3 {
        return None;
    }
    let dead_m3 = ((least_m3 - c.line_volume_m3) * 1.05e7).ceil() * 1e-7;
    let stiffer_n_m = 1.05 * c.end_stop.stiffness_n_m * least_m3 / volume_m3;
    Some(Broken {
        figures: format!(
            "it runs {} mm into its stop, by {} cm3, and there are {} cm3 before it",
            brief(depth_m * 1e3),
            brief(least_m3 * 1e6),
            brief(volume_m3 * 1e6)
        ),
        offers: vec![
            f.offer(it.fields[0], Bound::From, dead_m3),
            f.offer(
                "end_stop.stiffness",
                Bound::From,
                (stiffer_n_m * 1e-3).ceil() * 1e3,
            ),
        ],
        words: String::new(),
    })
}

/// The step can follow the reservoir, which the regulator fills and the dump valve empties.
pub(super) fn supply(f: &Facts<'_>, _: &Relation) -> Option<Broken> {
    let moved = f.moved?;
    let (supply, gas) = (moved.supply, moved.gas);
    // Choked flow over the droop: the regulator opens in proportion to the missing pressure.
    let flow_kg_s = supply.regulator_flow.conductance_m3_s_pa
        * gas.reference_density_kg_m3
        * supply.source_pressure_pa;
    let volume_rate = gas.gas_constant_j_kg_k * gas.ambient_temperature_k * flow_kg_s;
    let least_m3 = volume_rate / supply.droop_pa * moved.step_s / GAS_LIMIT;
    if supply.reservoir_m3 > least_m3 {
        return None;
    }
    // A tenth above the limit, in round figures.
    let more = 1.1 * least_m3 / supply.reservoir_m3;
    let step_s = (moved.step_s / more * 1e6).floor().max(1.0) * 1e-6;
    Some(Broken {
        figures: String::new(),
        offers: vec![
            f.offer(
                "supply.reservoir",
                Bound::From,
                (1.1 * least_m3 * 1e6).ceil() * 1e-6,
            ),
            f.offer(
                "supply.droop",
                Bound::From,
                (more * supply.droop_pa * 1e-2).ceil() * 1e2,
            ),
            f.offer(STEP, Bound::UpTo, step_s),
        ],
        words: String::new(),
    })
}
