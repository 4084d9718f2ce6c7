//! Equations as printed in the paper beside the corrected ones (MODEL.md §10), evaluated over the workspace:
//! how far apart they are, where, and whether any figure of the paper can show it.

mod r2p;
mod rpr;

use nalgebra::{Vector3, Vector6};
use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_kinematics::r2p::R2p;
use wheeleg_kinematics::{LegGeometry, LegLengths, LegParameters, LegPosture};
use wheeleg_plant::dynamics::noc::Leg;
use wheeleg_plant::dynamics::{DynamicsError, LegBodies, RobotDynamicsParams};

/// Largest rate of a cylinder tried (m/s). PAPER: axis of Fig. 14.
const RATE_M_S: f64 = 0.4;
/// Largest acceleration of a cylinder tried (m/s²). PAPER: axis of Fig. 15, in m/s².
const ACCELERATION_M_S2: f64 = 10.0;
/// Differences up to this are rounding.
const ROUNDING: f64 = 1e-9;

/// Kind of error of an equation. MODEL.md §10.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// Wrong as printed.
    Wrong,
    /// Right only at the home pose.
    Home,
    /// Can be read in a way that is wrong.
    Ambiguous,
    /// Right, but 0/0 at the home pose.
    Singular,
}

/// One number of an equation, in both forms.
#[derive(Debug, Clone, Copy)]
struct Component {
    label: &'static str,
    unit: &'static str,
    printed: f64,
    corrected: f64,
}

/// An equation of the list.
struct Equation {
    number: &'static str,
    status: Status,
    printed: &'static str,
    corrected: &'static str,
    evaluate: fn(&State<'_>) -> Vec<Component>,
}

/// A state of the closed leg with everything that the equations need.
struct State<'a> {
    model: &'a Model,
    leg: LegPosture<f64>,
    chain: R2p<f64>,
    q: Vector3<f64>,
    rates: Vector3<f64>,
    accelerations: Vector3<f64>,
    /// [θ1, b2, θ3, θ4, b5, b6] and its derivatives.
    x: [f64; 6],
    xd: Vector6<f64>,
    xdd: Vector6<f64>,
}

struct Model {
    geometry: LegGeometry<f64>,
    leg: Leg,
    bodies: LegBodies,
}

/// One line of the table: an equation, in one unit.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Misprint {
    /// Number in the paper.
    pub equation: &'static str,
    /// Kind of error.
    pub status: Status,
    /// As printed.
    pub printed: &'static str,
    /// Corrected.
    pub corrected: &'static str,
    /// The component with the largest difference.
    pub component: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Largest difference over the workspace; none if the printed form is not finite.
    pub worst: Option<f64>,
    /// Printed form's value there; none if it is not finite.
    pub printed_value: Option<f64>,
    /// Corrected form's value there.
    pub corrected_value: f64,
    /// Lengths b2, b5, b6 there (m).
    pub lengths_m: [f64; 3],
    /// Rates there (m/s).
    pub rates_m_s: [f64; 3],
    /// Accelerations there (m/s²).
    pub accelerations_m_s2: [f64; 3],
    /// Share of the states that differ by more than rounding.
    pub differing_share: f64,
    /// Share of the states in which the printed form is not finite.
    pub not_finite_share: f64,
    /// Largest difference at the home pose b2 = 0.40, b5 = b6 = 0.01 m, same rates; none if the printed form
    /// is not finite.
    pub at_home: Option<f64>,
    /// Largest difference in motions like those of the figures: no yaw; none as above.
    pub in_figures: Option<f64>,
}

/// Signs of rates and accelerations that are tried together.
fn motions(yaw: bool) -> Vec<[Vector3<f64>; 2]> {
    let signs = [-1.0, 1.0];
    let mut out = vec![[Vector3::zeros(); 2]];
    for a in signs {
        for b in signs {
            for c in signs {
                for d in signs {
                    let turn = if yaw { 1.0 } else { 0.0 };
                    out.push([
                        Vector3::new(turn * a, b, c) * RATE_M_S,
                        Vector3::new(turn * d, -a * d, b * d) * ACCELERATION_M_S2,
                    ]);
                }
            }
        }
    }
    out
}

fn steps(from: f64, to: f64, n: usize) -> impl Iterator<Item = f64> + Clone {
    (0..=n).map(move |i| from + (to - from) * i as f64 / n as f64)
}

impl Model {
    fn new() -> Result<Self, DynamicsError> {
        let dimensions = LegParameters::<f64>::wheeleg_2003();
        let refused = |source| DynamicsError::Leg { leg: 0, source };
        let bodies = RobotDynamicsParams::wheeleg_2003().leg_bodies;
        Ok(Self {
            geometry: LegGeometry::new(dimensions).map_err(refused)?,
            leg: Leg::new(dimensions, &bodies, [0.0; 3])?,
            bodies,
        })
    }

    fn state(
        &self,
        q: [f64; 3],
        [rates, accelerations]: [Vector3<f64>; 2],
    ) -> Result<State<'_>, DynamicsError> {
        let refused = |source| DynamicsError::Leg { leg: 0, source };
        let lengths = LegLengths::new(q[0], q[1], q[2]);
        let leg = self.geometry.posture(&lengths).map_err(refused)?;
        let x = leg.joints();
        let chain = R2p::new(x.theta4_rad, x.b5_m, x.b6_m).map_err(refused)?;
        Ok(State {
            model: self,
            chain,
            q: q.into(),
            rates,
            accelerations,
            x: [
                x.theta1_rad,
                x.b2_m,
                x.theta3.rad(),
                x.theta4_rad,
                x.b5_m,
                x.b6_m,
            ],
            xd: leg.joint_rates(&rates).map_err(refused)?,
            xdd: leg
                .joint_accelerations(&rates, &accelerations)
                .map_err(refused)?,
            leg,
        })
    }

    /// States over the workspace, at home, and in motions without yaw.
    fn states(&self) -> Result<[Vec<State<'_>>; 3], DynamicsError> {
        let (mut workspace, mut home, mut figures) = (Vec::new(), Vec::new(), Vec::new());
        let p = self.geometry.parameters();
        let span = |i: usize, n| steps(p.stroke_zero_m[i], p.stroke_zero_m[i] + p.stroke_m[i], n);
        let (all, straight) = (motions(true), motions(false));
        for b5 in span(1, 6) {
            for b6 in span(2, 2) {
                for b2 in span(0, 12) {
                    for motion in &all {
                        workspace.push(self.state([b2, b5, b6], *motion)?);
                    }
                }
                for motion in &straight {
                    figures.push(self.state([HOME_M[0], b5, b6], *motion)?);
                }
            }
        }
        for motion in &all {
            home.push(self.state(HOME_M, *motion)?);
        }
        Ok([workspace, home, figures])
    }
}

/// Home pose b2, b5, b6 (m). PAPER Tables 1 and 2; b2 DERIVED (MODEL.md §3).
const HOME_M: [f64; 3] = [0.40, 0.01, 0.01];

/// Largest difference; none as soon as a printed value is not finite.
fn largest(states: &[State<'_>], equation: &Equation, unit: &str) -> Option<f64> {
    let mut worst = 0.0_f64;
    for state in states {
        for c in (equation.evaluate)(state) {
            let difference = (c.printed - c.corrected).abs();
            if c.unit != unit {
                continue;
            }
            if !difference.is_finite() {
                return None;
            }
            worst = worst.max(difference);
        }
    }
    Some(worst)
}

fn line(equation: &Equation, unit: &'static str, states: &[Vec<State<'_>>; 3]) -> Misprint {
    let [workspace, home, figures] = states;
    let (mut differing, mut not_finite) = (0_usize, 0_usize);
    let mut worst: Option<(f64, Component, &State<'_>)> = None;
    let mut endless: Option<(Component, &State<'_>)> = None;
    for state in workspace {
        let (mut differs, mut finite) = (false, true);
        let components = (equation.evaluate)(state);
        for c in components.into_iter().filter(|c| c.unit == unit) {
            let difference = (c.printed - c.corrected).abs();
            if !difference.is_finite() {
                finite = false;
                endless = endless.or(Some((c, state)));
                continue;
            }
            differs |= difference > ROUNDING;
            if worst.as_ref().is_none_or(|(w, ..)| difference > *w) {
                worst = Some((difference, c, state));
            }
        }
        differing += usize::from(differs || !finite);
        not_finite += usize::from(!finite);
    }
    let share = |n: usize| n as f64 / workspace.len().max(1) as f64;
    let place = endless.or(worst.as_ref().map(|(_, c, s)| (*c, *s)));
    let (lengths_m, rates_m_s, accelerations_m_s2) = place.map_or_else(
        || ([0.0; 3], [0.0; 3], [0.0; 3]),
        |(_, s)| (s.q.into(), s.rates.into(), s.accelerations.into()),
    );
    Misprint {
        equation: equation.number,
        status: equation.status,
        printed: equation.printed,
        corrected: equation.corrected,
        component: place.map_or("", |(c, _)| c.label),
        unit,
        worst: worst.filter(|_| not_finite == 0).map(|(w, ..)| w),
        printed_value: place.map(|(c, _)| c.printed).filter(|v| v.is_finite()),
        corrected_value: place.map_or(0.0, |(c, _)| c.corrected),
        lengths_m,
        rates_m_s,
        accelerations_m_s2,
        differing_share: share(differing),
        not_finite_share: share(not_finite),
        at_home: largest(home, equation, unit),
        in_figures: largest(figures, equation, unit),
    }
}

/// The table, one line for each equation and unit. `progress` gets the share that is done.
///
/// # Errors
/// [`DynamicsError`]; not inside the strokes.
pub fn misprints(progress: &mut dyn FnMut(f64)) -> Result<Vec<Misprint>, DynamicsError> {
    let model = Model::new()?;
    let states = model.states()?;
    let equations: Vec<&Equation> = r2p::EQUATIONS.iter().chain(&rpr::EQUATIONS).collect();
    let mut lines = Vec::new();
    for (i, equation) in equations.iter().enumerate() {
        let mut units: Vec<&'static str> = Vec::new();
        for c in states[0]
            .iter()
            .take(1)
            .flat_map(|s| (equation.evaluate)(s))
        {
            if !units.contains(&c.unit) {
                units.push(c.unit);
            }
        }
        lines.extend(units.into_iter().map(|unit| line(equation, unit, &states)));
        progress((i + 1) as f64 / equations.len() as f64);
    }
    let key = |m: &Misprint| {
        let digits: String = m
            .equation
            .chars()
            .take_while(char::is_ascii_digit)
            .collect();
        digits.parse::<u32>().unwrap_or(u32::MAX)
    };
    lines.sort_by_key(key);
    Ok(lines)
}

/// Components with one unit from two arrays.
fn components<const N: usize>(
    labels: [&'static str; N],
    unit: &'static str,
    printed: [f64; N],
    corrected: [f64; N],
) -> Vec<Component> {
    labels
        .into_iter()
        .zip(printed.into_iter().zip(corrected))
        .map(|(label, (printed, corrected))| Component {
            label,
            unit,
            printed,
            corrected,
        })
        .collect()
}

/// Components of a twist: angular velocity, then velocity.
fn twist_components(
    units: [&'static str; 2],
    printed: &Vector6<f64>,
    corrected: &Vector6<f64>,
) -> Vec<Component> {
    let part = |v: &Vector6<f64>, i: usize| [v[i], v[i + 1], v[i + 2]];
    let mut out = components(
        ["ωx", "ωy", "ωz"],
        units[0],
        part(printed, 0),
        part(corrected, 0),
    );
    out.extend(components(
        ["ṗx", "ṗy", "ṗz"],
        units[1],
        part(printed, 3),
        part(corrected, 3),
    ));
    out
}

#[cfg(test)]
mod tests;
