//! A wheel on soil from step to step: slip as a state, the side of the piled-up soil, the depth of the rut.
//!
//! # Slip
//!
//! x' = (vs − x V)/ℓ with vs = rs ω − v, the patch's length ℓ and the fastest speed in it, V =
//! max(|v|, rs |ω|, |vs|). In steady rolling x = vs/V, which is the slip s = 1 − v/(rs ω) of a wheel
//! that drives, and s/(1 − s) of one that brakes. At rest x is a spring that holds without creep. After a
//! change it takes the time in which the tread passes its patch once. The same state sideways gives the
//! lateral force; the resultant of both shear displacements mobilises the strength, and the force points
//! along it (Janosi and Hanamoto).
//!
//! # Directions
//!
//! The textbook's wheel rolls forward: soil is piled up ahead of it and pushes back, and even without slip
//! the rim shears. A wheel that rolls backward is the mirror image. Two states, each from −1 to 1, lead
//! from one to the other and stay where they are at rest: `pile`, on which side soil is piled up, follows the
//! travel over a twentieth of the patch; `rolled`, which way the rim has been sheared, over half of it. Shear
//! and normal force are means of both pictures, weighted by `rolled`; the pile's push is weighted by
//! `pile`. A wheel that was set down has 0 in both, and nothing pushes it either way.
//!
//! # Rut
//!
//! Sinkage is plastic: a wheel that rises from its deepest place is carried along a straight line, and is
//! free after the soil's rebound. Rolling, it leaves that place behind over the same share of its patch; a
//! wheel that has become lighter then rises within about one patch.

use serde::{Deserialize, Serialize};

use super::params::Soil;
use super::table::WheelTable;
use super::wheel::{Wheel, WheelForces};

/// Travel that piles soil up ahead of a wheel, in lengths of the patch; ASSUMED.
const PILE: f64 = 0.05;
/// Travel that the pile's push is ahead of, over the speed \[s\]: damps a wheel at rest; ASSUMED.
const PILE_DAMPING_S: f64 = 0.05;
/// Travel that shears the rim as in rolling, in lengths of the patch; ASSUMED: from backward to forward the
/// whole patch.
const ROLLED: f64 = 0.5;
/// Shear displacement where the pressure is largest, over that at the lowest point.
const SHEARED: f64 = 0.6;

/// State that a wheel has left in the soil.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Rolling {
    /// Slip coordinate along the wheel, −1..1: positive pushes it forward.
    pub slip: f64,
    /// The same sideways: positive pushes it to the left.
    pub drift: f64,
    /// Where soil is piled up: −1 behind, 1 ahead.
    pub pile: f64,
    /// Which way the rim has been sheared by rolling: −1 backward, 1 forward.
    pub rolled: f64,
    /// Deepest sinkage \[m\].
    pub deepest_m: f64,
}

/// Speeds against the soil \[m/s\], or ways during a step \[m\].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Motion {
    /// Axle forward.
    pub travel: f64,
    /// Tips of the lugs under the axle backward: rs ω.
    pub tread: f64,
    /// Axle to the left.
    pub left: f64,
}

/// How a wheel touches soil at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rolled {
    /// Sinkage of the lowest point of its rim \[m\], above 0.
    pub depth_m: f64,
    /// Speed into the soil \[m/s\].
    pub closing_m_s: f64,
    /// Speeds now.
    pub speed: Motion,
    /// Ways since the last instant.
    pub moved: Motion,
}

/// Forces of the soil on a wheel. They act at the axle, except the lateral one, which acts at the rim.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RollingForce {
    /// Along the normal \[N\].
    pub normal_n: f64,
    /// Forward: drawbar pull \[N\].
    pub forward_n: f64,
    /// To the left \[N\].
    pub left_n: f64,
    /// Torque against the wheel's turning forward \[N m\].
    pub torque_n_m: f64,
}

/// The law of one wheel on one soil.
#[derive(Debug, Clone)]
pub struct RollingLaw {
    table: WheelTable,
    friction: f64,
    /// Shear displacement j/K over slip and length of the patch \[1/m\].
    per_shear: f64,
}

impl Motion {
    fn slip(&self) -> f64 {
        self.tread - self.travel
    }

    /// The fastest of all.
    fn fastest(&self) -> f64 {
        let along = self.travel.abs().max(self.tread.abs());
        along.max(self.slip().abs()).max(self.left.abs())
    }
}

/// Share of a shear displacement j/K that is mobilised, over j/K.
#[inline]
fn mobilised(displacement: f64) -> f64 {
    if displacement < 1e-6 {
        1.0
    } else {
        -libm::expm1(-displacement) / displacement
    }
}

impl RollingLaw {
    /// Builds the table.
    #[must_use]
    pub fn new(wheel: &Wheel, soil: &Soil) -> Self {
        Self {
            table: WheelTable::new(wheel, soil),
            friction: soil.friction(),
            per_shear: SHEARED / soil.shear_m,
        }
    }

    /// The wheel.
    #[must_use]
    pub fn wheel(&self) -> &Wheel {
        self.table.wheel()
    }

    /// A wheel that was pressed in to this depth \[m\] without rolling.
    #[must_use]
    pub fn pressed(depth_m: f64) -> Rolling {
        Rolling {
            deepest_m: depth_m,
            ..Rolling::default()
        }
    }

    /// Follows the motion of the step just ended, and returns the force.
    #[must_use]
    #[inline]
    pub fn force(&self, state: &mut Rolling, touch: &Rolled) -> RollingForce {
        let (wheel, soil) = (self.table.wheel(), self.table.soil());
        let radius = wheel.shear_radius_m();
        let patch = wheel.entry_rad(state.deepest_m.max(touch.depth_m));
        let length = radius * patch;
        // Ways and speeds in lengths of the patch.
        let per_length = 1.0 / length;
        let moved = &touch.moved;
        let rolled_on = per_length * moved.travel;

        let above = state.deepest_m - touch.depth_m;
        state.deepest_m = touch.depth_m;
        if above > 0.0 {
            state.deepest_m += above / (1.0 + rolled_on.abs() / soil.rebound);
        }
        let keep = 1.0 / (1.0 + per_length * moved.fastest());
        state.slip = keep * (state.slip + per_length * moved.slip());
        state.drift = keep * (state.drift - per_length * moved.left);
        let clamped = |x: f64| x.clamp(-1.0, 1.0);
        state.pile = clamped(state.pile + rolled_on / PILE);
        state.rolled = clamped(state.rolled + rolled_on / ROLLED);

        let speed = &touch.speed;
        let rolled = self.both_ways(state);
        let ahead = PILE_DAMPING_S / PILE * per_length * speed.travel;
        let piled = clamped(state.pile + ahead);
        let area = wheel.radius_m * wheel.width_m * patch;
        let mut share = 1.0;
        let above = state.deepest_m - touch.depth_m;
        if above > 0.0 {
            let steepest = rolled.normal_n / (area * soil.stiffness_most_pa_m);
            let band = steepest.max(soil.rebound * state.deepest_m);
            share -= above / band;
            if share <= 0.0 {
                return RollingForce::default();
            }
        }
        let damping = soil.damping_pa_s_m * area * touch.closing_m_s.max(0.0);
        let normal_n = share * (rolled.normal_n + damping);

        // The resultant displacement mobilises the strength.
        let per = self.per_shear * length;
        let across = per * state.drift;
        let (whole, turned) = if across.abs() < 1e-9 {
            (1.0, 1.0)
        } else {
            let along = (per * state.slip).abs();
            let whole = mobilised((along * along + across * across).sqrt());
            (whole, whole / mobilised(along))
        };
        let strength = share * soil.cohesion_pa * area + self.friction * normal_n;
        let fastest = speed.fastest();
        let lagging = soil.shear_damping_n_s_m;
        let lag = lagging * (speed.slip() - state.slip * fastest);
        let thrust = share * turned * rolled.thrust_n + lag;
        let left = strength * whole * across - lagging * (speed.left + state.drift * fastest);
        let pull_squared = thrust * thrust + left * left;
        let within = if pull_squared > strength * strength {
            strength / pull_squared.sqrt()
        } else {
            1.0
        };
        RollingForce {
            normal_n,
            forward_n: within * thrust - share * piled * rolled.compaction_n,
            left_n: within * left,
            torque_n_m: within * (share * turned * rolled.torque_n_m + radius * lag),
        }
    }

    /// Mean of a wheel that rolls forward and one that rolls backward; the pile's push without its sign.
    #[inline]
    fn both_ways(&self, state: &Rolling) -> WheelForces {
        let forward = 0.5 * (1.0 + state.rolled);
        let mut sum = WheelForces::default();
        for (share, sign) in [(forward, 1.0), (1.0 - forward, -1.0)] {
            if share > 0.0 {
                let f = self.table.forces(state.deepest_m, sign * state.slip);
                sum.normal_n += share * f.normal_n;
                sum.compaction_n += share * f.compaction_n;
                sum.thrust_n += sign * share * f.thrust_n;
                sum.torque_n_m += sign * share * f.torque_n_m;
            }
        }
        sum
    }
}
