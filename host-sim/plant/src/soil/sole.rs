//! A flat sole on soil, or an even share of one, with nails under it.
//!
//! Pad: pressure (k_c/R + k_φ) z^n, plastic as under a wheel; friction up to the pressure times tan φ.
//!
//! Nails, after the resistive force theory of Li, Zhang and Goldman (2013) with its values for flat
//! and upright plates, z being the depth of the tip and ξ the soil's scale:
//!
//! ```text
//! pushed in   ½ ξ (π d²/4) z
//! pulled out  ¼ ξ (π d²/4) z, downward
//! sideways    0.377 ξ d z²/2
//! ```
//!
//! Shear is mobilised by sliding after Janosi and Hanamoto, F = F_most (1 − exp(−j/K)). As a state with
//! a direction that is Dahl's bristle, w' = (v − |v| w)/K with F = −F_most w: the same curve from
//! rest, and a hysteresis when the motion turns. For soil slower than 0.5 m/s and nails much thicker
//! than its grains.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::curve::{Curve, Grid};
use super::params::Soil;
use crate::error::{PlantError, check};

/// Resistance of a flat plate pushed down, over ξ z and its area: a nail's tip is a cone, half as much.
const PUSHED: f64 = 0.5;
/// Of a flat plate pulled up.
const PULLED: f64 = 0.25;
/// Of an upright plate pushed forward.
const SIDEWAYS: f64 = 0.377;

/// Nails of a sole.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Nails {
    /// How many.
    pub count: u32,
    /// Diameter d \[m\].
    pub diameter_m: f64,
    /// Length below the sole \[m\].
    pub length_m: f64,
    /// Displacement that mobilises 63 % of their lateral strength \[m\].
    pub shear_m: f64,
}

impl Nails {
    /// A sole without nails.
    pub const NONE: Self = Self {
        count: 0,
        diameter_m: 1e-3,
        length_m: 0.0,
        shear_m: 5e-3,
    };

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the field.
    pub fn validate(&self) -> Result<(), PlantError> {
        check("nails.count", f64::from(self.count), 0.0, 100.0)?;
        check("nails.diameter_m", self.diameter_m, 1e-4, 0.05)?;
        check("nails.length_m", self.length_m, 0.0, 0.5)?;
        check("nails.shear_m", self.shear_m, 1e-3, 0.1)
    }
}

/// State that a sole has left in the soil.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Print {
    /// Share of the pad's friction that is mobilised, along the sliding.
    pub rubbed: Vector3<f64>,
    /// Share of the nails' strength, along the sliding.
    pub raked: Vector3<f64>,
    /// Deepest sinkage of the pad \[m\].
    pub deepest_m: f64,
    /// How far the soil at the tips is pressed together \[m\], negative when pulled.
    pub pressed_m: f64,
}

/// How a sole touches soil at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stepped {
    /// Sinkage of the pad \[m\]; negative over the soil, with only nails in it.
    pub depth_m: f64,
    /// Outward unit normal of the soil.
    pub normal: Vector3<f64>,
    /// Velocity of the pad against the soil \[m/s\].
    pub velocity_m_s: Vector3<f64>,
    /// Way of the pad since the last instant \[m\].
    pub moved_m: Vector3<f64>,
}

/// Force of soil on a sole.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SoleForce {
    /// Force \[N\], world axes.
    pub force_n: Vector3<f64>,
    /// Normal component \[N\], negative while nails are pulled out.
    pub normal_n: f64,
}

/// The law of a sole, or a share of one, on one soil.
#[derive(Debug, Clone)]
pub struct SoleLaw {
    soil: Soil,
    friction: f64,
    /// Pressure of the pad \[Pa\] over sinkage.
    pressure: Curve,
    area_m2: f64,
    /// Way over which a pad that slides leaves its print behind \[m\].
    leaves_m: f64,
    /// Inverse of the most stiffness \[m/Pa\].
    softest_m_pa: f64,
    nails: Nails,
    /// Of all tips, pressed soil below them \[N/m\].
    tip_stiffness_n_m: f64,
    /// ξ d times the number of nails \[N/m²\].
    shafts_n_m2: f64,
    shear_damping_n_s_m: f64,
}

impl SoleLaw {
    /// A sole's share of 1/`count`.
    #[must_use]
    pub fn new(radius_m: f64, nails: &Nails, soil: &Soil, count: usize) -> Self {
        let share = 1.0 / count as f64;
        let scale = share * f64::from(nails.count) * soil.resistive_scale_n_m3();
        let d = nails.diameter_m;
        let quarter_pi = std::f64::consts::FRAC_PI_4;
        // From 8 µm to 0.5 m.
        let grid = Grid::new(1.0 / 131_072.0, 64);
        let pressure = Curve::new(grid, |z| {
            let p = soil.pressure_pa(radius_m, z);
            [p, soil.exponent * p / z]
        });
        Self {
            soil: *soil,
            friction: soil.friction(),
            pressure,
            area_m2: share * std::f64::consts::PI * radius_m * radius_m,
            leaves_m: soil.rebound * 2.0 * radius_m,
            softest_m_pa: 1.0 / soil.stiffness_most_pa_m,
            nails: *nails,
            tip_stiffness_n_m: PUSHED * scale * quarter_pi * d * d / soil.rebound,
            shafts_n_m2: scale * d,
            shear_damping_n_s_m: share * soil.shear_damping_n_s_m,
        }
    }

    /// How far over the soil a sole is already held \[m\].
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        if self.nails.count > 0 {
            self.nails.length_m
        } else {
            0.0
        }
    }

    /// A sole that was pressed in to this depth \[m\], straight down.
    #[must_use]
    pub fn pressed(&self, depth_m: f64) -> Print {
        Print {
            deepest_m: depth_m.max(0.0),
            pressed_m: self.soil.rebound * (depth_m + self.reach_m()).max(0.0),
            ..Print::default()
        }
    }

    /// Follows the motion of the step just ended, and returns the force.
    #[must_use]
    #[inline]
    pub fn force(&self, print: &mut Print, touch: &Stepped) -> SoleForce {
        let n = &touch.normal;
        let closing = -n.dot(&touch.velocity_m_s);
        let slide = touch.velocity_m_s + closing * n;
        let pressed = -n.dot(&touch.moved_m);
        let slid = touch.moved_m + pressed * n;
        let way = slid.norm();

        let pad_n = self.pad_n(print, touch.depth_m, closing, way);
        let (tips_n, shafts_n) = self.nails_n(print, touch.depth_m, pressed);
        let rubbing = self.friction * pad_n;
        let most = rubbing + shafts_n;
        let mut shear = Vector3::zeros();
        if most > 0.0 {
            let follow = |state: &Vector3<f64>, shear_m: f64| {
                let laid = state - n.dot(state) * n;
                (shear_m * laid + slid) * (1.0 / (shear_m + way))
            };
            print.rubbed = follow(&print.rubbed, self.soil.shear_m);
            print.raked = if shafts_n > 0.0 {
                follow(&print.raked, self.nails.shear_m)
            } else {
                Vector3::zeros()
            };
            let held = rubbing * print.rubbed + shafts_n * print.raked;
            shear = -held - self.shear_damping_n_s_m * slide;
            let squared = shear.norm_squared();
            if squared > most * most {
                shear *= most / squared.sqrt();
            }
        }
        let normal_n = pad_n + tips_n;
        SoleForce {
            force_n: normal_n * n + shear,
            normal_n,
        }
    }

    /// Pressure on the pad \[N\].
    #[inline]
    fn pad_n(&self, print: &mut Print, depth_m: f64, closing_m_s: f64, way_m: f64) -> f64 {
        if depth_m <= 0.0 {
            print.deepest_m = 0.0;
            return 0.0;
        }
        let mut above = print.deepest_m - depth_m;
        let mut share = 1.0;
        let pressure;
        if above > 0.0 {
            above *= self.leaves_m / (self.leaves_m + way_m);
            print.deepest_m = depth_m + above;
            pressure = self.pressure.value(print.deepest_m);
            let band = (self.softest_m_pa * pressure).max(self.soil.rebound * print.deepest_m);
            share = (1.0 - above / band).max(0.0);
        } else {
            print.deepest_m = depth_m;
            pressure = self.pressure.value(depth_m);
        }
        // No more than the pressure itself, so that nothing jumps at touch-down.
        let damping = (self.soil.damping_pa_s_m * closing_m_s.max(0.0)).min(pressure);
        share * self.area_m2 * (pressure + damping)
    }

    /// Force at the tips and most force on the shafts \[N\].
    #[inline]
    fn nails_n(&self, print: &mut Print, depth_m: f64, pressed_m: f64) -> (f64, f64) {
        let tip = depth_m + self.reach_m();
        if self.nails.count == 0 || tip <= 0.0 {
            return (0.0, 0.0);
        }
        let most = self.soil.rebound * tip;
        print.pressed_m = (print.pressed_m + pressed_m).clamp(-PULLED / PUSHED * most, most);
        let tips = self.tip_stiffness_n_m * print.pressed_m;
        let top = depth_m.max(0.0);
        let shafts = 0.5 * SIDEWAYS * self.shafts_n_m2 * (tip * tip - top * top);
        (tips, shafts)
    }
}
