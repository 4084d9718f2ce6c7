//! What the fields of a file must be to each other, though each is within its own range.
//!
//! | relation | fields | source |
//! |---|---|---|
//! | a step follows friction | friction, mass, step | stability of the explicit step, below |
//! | a step follows the end stop | the same, end stop, supply | the same |
//! | a step follows the air | valve, line, dead volume, step | Heun's method: step × rate < 2 |
//! | a step follows the supply | regulator, droop, reservoir, step | the same |
//! | a chamber outlasts its stop | bore, dead volume, end stop, supply | volume > 0 at twice the static depth |
//! | break-away holds what slides | static and Coulomb friction | Stribeck curve falls |
//! | air comes from the supply | start pressures, set pressure | |
//! | pressures fall | source, set and initial pressure, ambient | a regulator raises none |
//! | a contact closes | contact, set pressure; the one at the source, source pressure | |
//! | a contact opens below where it closes | both pressures of a contact | |
//! | a rod leaves a chamber | rod, bore | |
//! | a cushion is a part of the stroke | cushion, stroke | |
//! | a piston starts in its cylinder | start stroke, stroke | |
//! | a gait stays in its cylinders | strokes of the gait, stroke | |
//! | a gait is in order | its times, push | the master's own relations |
//! | there is time to get ready | time-outs and rests of homing and start-up | |
//! | a load comes back after it begins to | reload of the reference | |
//! | wheels have room | width, track | |
//! | what sticks holds what slides | static and kinetic friction of each contact | |
//! | a sole holds its spheres | radii of sole and sphere | |
//! | a box has a size | its corners | |
//! | a leg closes its loop | crank, p4, joint lengths, start stroke | geometry |
//! | a body can have its inertias | three of a body | triangle inequality |
//! | the ground is below | gravity | |
//!
//! # Stability of the explicit step
//!
//! The plant advances by a kick, a drift and a kick of half a step each, with speeds predicted
//! half a step ahead. On m a = −c v − k x this is stable while
//!
//! ```text
//! c h / m  +  k h² / (4 m)  <  1        (characteristic root at −1)
//! ```

use wheeleg_plant::PlantError;
use wheeleg_plant::body::RobotContacts;
use wheeleg_plant::cylinder::{CylinderModel, CylinderParams};
use wheeleg_plant::flow::GasParams;
use wheeleg_plant::supply::SupplyParams;

use crate::quantity::{brief, pretty};
use crate::reader::Reader;

/// Where the explicit step of a mass becomes unstable.
const STEP_LIMIT: f64 = 1.0;
/// The same of the gas in a chamber: Heun's method on p' = −rate · p.
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
    /// The fields that the mass is the sum of.
    pub mass_fields: &'a [&'a str],
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

    /// Reports every relation that does not hold.
    pub(crate) fn check(&self, r: &mut Reader) {
        self.check_friction(r);
        self.check_end_stop(r);
        self.check_gas(r);
        self.check_volume(r);
    }

    /// c h / m + k h² / (4 m), with what the step or the mass would have to be.
    fn stability(&self, damping_n_s_m: f64, stiffness_n_m: f64) -> Option<(f64, String)> {
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
        Some((
            number,
            format!(
                "a step of at most {} us, or a mass of at least {} kg, is stable",
                pretty(step_us),
                pretty((mass_kg * 1e4).ceil() * 1e-4)
            ),
        ))
    }

    fn check_friction(&self, r: &mut Reader) {
        let f = &self.cylinder.friction;
        let damping = f.bristle_damping_n_s_m + f.viscous_n_s_m;
        let Some((number, help)) = self.stability(damping, f.bristle_stiffness_n_m) else {
            return;
        };
        let fields = [
            "friction.bristle_damping",
            "friction.viscous",
            "friction.bristle_stiffness",
            "numerics.step",
        ];
        r.contradiction(
            &[&fields, self.mass_fields].concat(),
            &format!(
                "the step is too long for so much friction on so little mass (damping × step / \
                 mass + stiffness × step² / (4 × mass) = {number:.2}, allowed below {STEP_LIMIT})"
            ),
            &help,
        );
    }

    fn check_end_stop(&self, r: &mut Reader) {
        let (f, stop) = (&self.cylinder.friction, &self.cylinder.end_stop);
        if self
            .stability(
                f.bristle_damping_n_s_m + f.viscous_n_s_m,
                f.bristle_stiffness_n_m,
            )
            .is_some()
        {
            return;
        }
        // Hunt–Crossley: k d (1 + λ d') damps with λ times the static force. The cushion acts on
        // the way in alone: in half of an oscillation.
        let damping = f.bristle_damping_n_s_m
            + f.viscous_n_s_m
            + 0.5 * stop.cushion_damping_n_s_m
            + stop.damping_s_m * self.force_n();
        let stiffness = f.bristle_stiffness_n_m + stop.stiffness_n_m;
        let Some((number, help)) = self.stability(damping, stiffness) else {
            return;
        };
        let fields = [
            "end_stop.stiffness",
            "end_stop.damping",
            "end_stop.cushion_damping",
            "friction.bristle_damping",
            "numerics.step",
        ];
        r.contradiction(
            &[&fields, self.mass_fields].concat(),
            &format!(
                "the step is too long for this end stop and this mass (damping × step / mass + \
                 stiffness × step² / (4 × mass) = {number:.2}, allowed below {STEP_LIMIT})"
            ),
            &help,
        );
    }

    fn check_gas(&self, r: &mut Reader) {
        let Ok(model) = CylinderModel::new(self.cylinder, self.gas) else {
            return;
        };
        for (chamber, dead) in [
            ("A", "cylinder.dead_volume_a"),
            ("B", "cylinder.dead_volume_b"),
        ] {
            let number = self.step_s * model.fastest_rate_1_s(chamber == "B");
            if number < GAS_LIMIT {
                continue;
            }
            let step_us = (0.9 * GAS_LIMIT / number * self.step_s * 1e6).floor();
            r.contradiction(
                &[
                    dead,
                    "line.volume",
                    "fill_valve.conductance",
                    "vent_valve.conductance",
                    "line.conductance",
                    "numerics.step",
                ],
                &format!(
                    "the step is too long for so much flow into so little volume of chamber \
                     {chamber} (step × rate = {number:.2}, allowed below {GAS_LIMIT})"
                ),
                &format!(
                    "a step of at most {} us is stable, or a {} times larger volume",
                    pretty(step_us.max(1.0)),
                    pretty((number / (0.9 * GAS_LIMIT) * 10.0).ceil() / 10.0)
                ),
            );
        }
    }

    /// The piston runs into its stop; the chamber there must not vanish.
    fn check_volume(&self, r: &mut Reader) {
        let (c, area_m2) = (self.cylinder, self.piston_m2());
        let depth_m = IMPACT * self.force_n() / c.end_stop.stiffness_n_m;
        let least_m3 = area_m2 * depth_m;
        for (dead, dead_m3) in [
            ("cylinder.dead_volume_a", c.dead_volume_a_m3),
            ("cylinder.dead_volume_b", c.dead_volume_b_m3),
        ] {
            let volume_m3 = dead_m3 + c.line_volume_m3;
            if volume_m3 > least_m3 {
                continue;
            }
            r.contradiction(
                &[
                    dead,
                    "line.volume",
                    "cylinder.bore",
                    "end_stop.stiffness",
                    "supply.set_pressure",
                ],
                &format!(
                    "the piston runs {} mm into its stop, by {} cm3, and there are {} cm3 \
                     before it",
                    brief(depth_m * 1e3),
                    brief(least_m3 * 1e6),
                    brief(volume_m3 * 1e6)
                ),
                &format!(
                    "a dead volume of at least {} cm3, or a stiffer end stop, holds the air",
                    pretty(((least_m3 - c.line_volume_m3) * 1.05e7).ceil() * 0.1)
                ),
            );
        }
    }
}

/// A step follows the reservoir, which the regulator fills and the dump valve empties.
pub(crate) fn check_supply(r: &mut Reader, supply: &SupplyParams, gas: &GasParams, step_s: f64) {
    // Choked flow over the droop: the regulator opens in proportion to what is missing.
    let flow_kg_s = supply.regulator_flow.conductance_m3_s_pa
        * gas.reference_density_kg_m3
        * supply.source_pressure_pa;
    let volume_rate = gas.gas_constant_j_kg_k * gas.ambient_temperature_k * flow_kg_s;
    let least_m3 = volume_rate / supply.droop_pa * step_s / GAS_LIMIT;
    if supply.reservoir_m3 > least_m3 {
        return;
    }
    r.contradiction(
        &[
            "supply.reservoir",
            "supply.droop",
            "supply.source_pressure",
            "regulator.conductance",
            "numerics.step",
        ],
        "the step is too long for a reservoir that fills so fast",
        &format!(
            "a reservoir of at least {} dm3, a larger droop or a shorter step is stable",
            brief(least_m3 * 1.1e3)
        ),
    );
}

/// The force to break away is at least that of sliding.
pub(crate) fn check_break_away(r: &mut Reader, coulomb_n: f64, static_n: f64) {
    if static_n >= coulomb_n {
        return;
    }
    r.contradiction(
        &["friction.static", "friction.coulomb"],
        "the force to break away is below that of sliding",
        &format!(
            "allowed from {} N, which is `friction.coulomb`, up",
            pretty(coulomb_n)
        ),
    );
}

/// Chambers are filled from the supply.
pub(crate) fn check_start(r: &mut Reader, section: &str, pressures_pa: [f64; 2], most_pa: f64) {
    for (key, pressure_pa) in ["pressure_a", "pressure_b"].into_iter().zip(pressures_pa) {
        if pressure_pa > most_pa * (1.0 + 1e-9) {
            r.contradiction(
                &[&format!("{section}.{key}"), "supply.set_pressure"],
                "a chamber has more pressure than its supply",
                &format!(
                    "allowed up to {} Pa, which is `supply.set_pressure`",
                    pretty(most_pa)
                ),
            );
        }
    }
}

/// A piston starts between the stops.
pub(crate) fn check_start_stroke(r: &mut Reader, section: &str, start_m: f64, stroke_m: f64) {
    if start_m <= stroke_m * (1.0 + 1e-9) {
        return;
    }
    r.contradiction(
        &[&format!("{section}.stroke"), "cylinder.stroke"],
        "the piston starts beyond its stop",
        &format!(
            "allowed up to {} mm, which is `cylinder.stroke`",
            pretty(stroke_m * 1e3)
        ),
    );
}

/// What the soles, the wheels and the chassis touch the ground with.
pub(crate) fn check_contacts(r: &mut Reader, contacts: &RobotContacts) {
    let RobotContacts {
        foot,
        wheel,
        chassis,
    } = contacts;
    for (section, law) in [
        ("contact", &foot.law),
        ("wheel_contact", &wheel.law),
        ("chassis_contact", &chassis.law),
    ] {
        if law.mu_kinetic > law.mu_static {
            r.contradiction(
                &[
                    &format!("{section}.mu_kinetic"),
                    &format!("{section}.mu_static"),
                ],
                "what slides would hold more than what sticks",
                &format!(
                    "allowed from 0 to {}, which is `{section}.mu_static`",
                    pretty(law.mu_static)
                ),
            );
        }
    }
    if foot.sphere_radius_m > foot.sole_radius_m {
        r.contradiction(
            &["contact.sphere_radius", "contact.sole_radius"],
            "the spheres reach beyond the sole that they are part of",
            &format!(
                "allowed up to {} mm, which is `contact.sole_radius`",
                pretty(foot.sole_radius_m * 1e3)
            ),
        );
    }
    let corners = chassis.from_m.iter().zip(&chassis.to_m);
    if corners.into_iter().any(|(from, to)| from > to) {
        r.contradiction(
            &["chassis_contact.from", "chassis_contact.to"],
            "the corners make no box",
            "each value of `from` is at most that of `to`: rear to front, right to left, lower to \
             upper",
        );
    }
}

/// Of the three principal inertias of a body none exceeds the sum of the others: each is a
/// sum of two of ∫x² dm, ∫y² dm, ∫z² dm.
pub(crate) fn check_inertias(r: &mut Reader, fields: &[&str], inertia_kg_m2: [f64; 3]) {
    let sum: f64 = inertia_kg_m2.iter().sum();
    let largest = inertia_kg_m2.into_iter().fold(0.0, f64::max);
    let others = sum - largest;
    if largest <= others * (1.0 + 1e-9) {
        return;
    }
    r.contradiction(
        fields,
        &format!(
            "no body has these inertias: the largest, {} kg m2, exceeds the sum of the others, \
             {} kg m2",
            brief(largest),
            brief(others)
        ),
        "a thin rod has two equal ones and the third near 0; a plate has one equal to the sum \
         of the others",
    );
}

/// What the plant itself refuses, so that its answer, too, names file and field.
pub(crate) fn check_plant(r: &mut Reader, built: Result<(), PlantError>) {
    let Err(error) = built else { return };
    match error {
        PlantError::Parameter {
            name,
            value,
            min,
            max,
        } => {
            let field = r.listed(name).unwrap_or_else(|| name.to_owned());
            // In the unit of the file, where the field is one of it.
            let (factor, unit) = r.unit_of(&field).unwrap_or((1.0, "in SI units".to_owned()));
            r.contradiction(
                &[&field],
                &format!(
                    "with the other values of this file {} is too much or too little",
                    brief(value / factor)
                ),
                &format!(
                    "allowed with the masses, sizes and step of this file: {} to {} {unit}",
                    pretty(min / factor),
                    pretty(max / factor)
                ),
            );
        }
        PlantError::Mechanics(why) => r.contradiction(
            &[
                "body.crank",
                "body.p4",
                "body.stroke_zero",
                "start.yaw.stroke",
                "body.min_cos_theta3",
            ],
            &format!("they make no leg ({why})"),
            "a yaw cylinder of `body.stroke_zero` + `start.yaw.stroke` closes a triangle with \
             `body.crank`, which is the shorter, and `body.p4`",
        ),
        other => r.problem(
            None,
            format!("the plant cannot be built: {other}"),
            "of this file",
            None,
        ),
    }
}

/// Gravity points to the ground.
pub(crate) fn check_gravity(r: &mut Reader, gravity_m_s2: [f64; 3]) {
    let [forward, left, up] = gravity_m_s2;
    let along = (forward * forward + left * left).sqrt();
    if up < 0.0 && along < -up {
        return;
    }
    r.contradiction(
        &["body.gravity"],
        "the robot does not stand: its weight must point to the ground, at less than 45° from \
         its normal",
        "the third value, normal to the ground, is negative: [0.0, 0.0, -9.81] on level ground",
    );
}
