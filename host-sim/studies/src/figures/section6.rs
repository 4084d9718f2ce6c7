//! The sinusoidal trajectory of the paper's section 6 in both readings of its time axis
//! (MODEL.md §6.1), through the inverse kinematics, against the axes of Figs. 5 to 8.

use std::f64::consts::PI;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_kinematics::{FootState, KinematicsError, LegGeometry};

/// A reading of the words "y = sin²(time/8)" and a time axis of 0 to 3.5.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// `argument` or `literal`.
    pub name: &'static str,
    /// In words.
    pub text: &'static str,
    /// Label of the time axis.
    pub abscissa: &'static str,
    /// Its unit.
    pub abscissa_unit: &'static str,
    /// Height of the arch A (m).
    pub amplitude_m: f64,
    /// Travel X over the whole motion (m).
    pub travel_m: f64,
    /// Angular rate Ω of sin²(Ω t) (rad/s). PAPER: 1/8.
    pub omega_rad_s: f64,
    /// Duration (s).
    pub duration_s: f64,
    /// Abscissa per second: 1/8 if it is the argument time/8, 1 if it is seconds.
    pub abscissa_per_s: f64,
}

/// Home length of the vertical cylinder (m). ASSUMED, MODEL.md §6.1.
const B6_HOME_M: f64 = 0.19;
/// Length of the horizontal cylinder at the start (m). PAPER Table 1.
const B5_START_M: f64 = 0.01;

/// The abscissa is the argument τ = time/8 from 0 to π: 8π s. INFERRED; A, X ASSUMED within the range that
/// the axes allow.
pub const ARGUMENT: Reading = Reading {
    name: "argument",
    text: "the abscissa is the argument time/8, so the motion lasts 8π = 25.1 s",
    abscissa: "argument time/8 [rad]",
    abscissa_unit: "rad",
    amplitude_m: 0.18,
    travel_m: 0.24,
    omega_rad_s: 0.125,
    duration_s: 8.0 * PI,
    abscissa_per_s: 0.125,
};

/// The abscissa is in seconds and the trajectory in metres, as printed. X ASSUMED as above.
pub const LITERAL: Reading = Reading {
    name: "literal",
    text: "taken literally: seconds and metres, so the motion lasts 3.5 s",
    abscissa: "time [s]",
    abscissa_unit: "s",
    amplitude_m: 1.0,
    travel_m: 0.24,
    omega_rad_s: 0.125,
    duration_s: 3.5,
    abscissa_per_s: 1.0,
};

/// One instant of the motion. SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// Place on the abscissa.
    pub abscissa: f64,
    /// Foot point relative to the start: forward, left, up (m).
    pub foot_m: [f64; 3],
    /// Cylinder lengths b5, b6 (m).
    pub length_m: [f64; 2],
    /// Their rates (m/s).
    pub rate_m_s: [f64; 2],
    /// Their accelerations (m/s²).
    pub acceleration_m_s2: [f64; 2],
    /// Yaw cylinder length, rate and acceleration: it must not move.
    pub yaw: [f64; 3],
}

impl Reading {
    /// The foot in F4 (m and derivatives) after `t_s` (s).
    fn foot(&self, t_s: f64) -> FootState<f64> {
        let (a, w) = (self.amplitude_m, self.omega_rad_s);
        let speed = self.travel_m / self.duration_s;
        let (sin, cos) = (2.0 * w * t_s).sin_cos();
        FootState {
            position: Vector3::new(
                B5_START_M + speed * t_s,
                0.0,
                a * (w * t_s).sin().powi(2) - B6_HOME_M,
            ),
            velocity: Vector3::new(speed, 0.0, a * w * sin),
            acceleration: Vector3::new(0.0, 0.0, 2.0 * a * w * w * cos),
        }
    }

    /// The motion at `n` + 1 instants, by the inverse kinematics (7*), (13*), (16*), and the foot by the
    /// forward kinematics of its result.
    ///
    /// # Errors
    /// [`KinematicsError`] where no leg can follow.
    pub fn motion(
        &self,
        geometry: &LegGeometry<f64>,
        n: usize,
    ) -> Result<Vec<Instant>, KinematicsError<f64>> {
        let start = self.foot(0.0).position;
        (0..=n)
            .map(|i| {
                let t_s = self.duration_s * i as f64 / n as f64;
                let motion = geometry.inverse_motion(&self.foot(t_s))?;
                let foot = geometry.posture(&motion.lengths)?.foot() - start;
                let (v, a) = (motion.rates, motion.accelerations);
                Ok(Instant {
                    abscissa: t_s * self.abscissa_per_s,
                    foot_m: foot.into(),
                    length_m: [motion.lengths.b5_m, motion.lengths.b6_m],
                    rate_m_s: [v.y, v.z],
                    acceleration_m_s2: [a.y, a.z],
                    yaw: [motion.lengths.b2_m, v.x, a.x],
                })
            })
            .collect()
    }
}

/// An axis of a figure of the paper and the values computed for it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct AxisCheck {
    /// Id of MODEL.md §11.
    pub id: &'static str,
    /// Figure number.
    pub figure: u8,
    /// Reading of the time axis, or `model` where there is only one.
    pub reading: &'static str,
    /// Quantity.
    pub quantity: &'static str,
    /// Unit of all numbers.
    pub unit: &'static str,
    /// Lower end of the paper's axis.
    pub axis_min: f64,
    /// Upper end of the paper's axis.
    pub axis_max: f64,
    /// Smallest computed value.
    pub min: f64,
    /// Largest computed value.
    pub max: f64,
    /// Whether all computed values are inside the axis.
    pub fits: bool,
}

impl AxisCheck {
    pub(super) fn new(
        (id, figure, quantity): (&'static str, u8, &'static str),
        reading: &'static str,
        unit: &'static str,
        (axis_min, axis_max): (f64, f64),
        values: impl Iterator<Item = f64>,
    ) -> Self {
        let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values {
            min = min.min(value);
            max = max.max(value);
        }
        Self {
            id,
            figure,
            reading,
            quantity,
            unit,
            axis_min,
            axis_max,
            min,
            max,
            fits: min >= axis_min && max <= axis_max,
        }
    }
}

/// Axes of Figs. 5 to 8 (PAPER, MODEL.md §11) beside a motion.
#[must_use]
pub fn checks(reading: &Reading, motion: &[Instant]) -> Vec<AxisCheck> {
    let mm = |f: fn(&Instant) -> f64| motion.iter().map(move |i| 1e3 * f(i));
    let row = |id, figure, quantity, unit, axis, f: fn(&Instant) -> f64| {
        AxisCheck::new((id, figure, quantity), reading.name, unit, axis, mm(f))
    };
    vec![
        row("A4", 5, "x", "mm", (0.0, 250.0), |i| i.foot_m[0]),
        row("A5", 5, "y", "mm", (-1.0, 1.0), |i| i.foot_m[1]),
        row("A6", 5, "z", "mm", (0.0, 200.0), |i| i.foot_m[2]),
        row("A8", 6, "b5", "mm", (-100.0, 300.0), |i| i.length_m[0]),
        row("A9", 6, "b6", "mm", (0.0, 200.0), |i| i.length_m[1]),
        AxisCheck::new(
            ("A10", 6, "abscissa"),
            reading.name,
            reading.abscissa_unit,
            (0.0, 3.5),
            motion.iter().map(|i| i.abscissa),
        ),
        row("A11", 7, "ḃ5", "mm/s", (-10.0, 10.0), |i| i.rate_m_s[0]),
        row("A11", 7, "ḃ6", "mm/s", (-40.0, 40.0), |i| i.rate_m_s[1]),
        row("A12", 8, "b̈5", "mm/s²", (-1.0, 1.0), |i| {
            i.acceleration_m_s2[0]
        }),
        row("A12", 8, "b̈6", "mm/s²", (-10.0, 10.0), |i| {
            i.acceleration_m_s2[1]
        }),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_kinematics::LegParameters;

    fn motion(reading: &Reading) -> Vec<Instant> {
        let geometry = LegGeometry::new(LegParameters::wheeleg_2003()).expect("the paper's leg");
        reading.motion(&geometry, 2000).expect("reachable")
    }

    fn check<'a>(checks: &'a [AxisCheck], figure: u8, quantity: &str) -> &'a AxisCheck {
        let found = checks
            .iter()
            .find(|c| c.figure == figure && c.quantity == quantity);
        found.expect("listed")
    }

    #[test]
    fn the_argument_reading_fits_every_axis_and_its_peaks_are_those_of_the_closed_form() {
        let checks = checks(&ARGUMENT, &motion(&ARGUMENT));
        assert!(checks.iter().all(|c| c.fits), "{checks:#?}");
        let near = |figure, quantity, min: f64, max: f64| {
            let c = check(&checks, figure, quantity);
            assert!(
                (c.min - min).abs() < 2e-3 && (c.max - max).abs() < 2e-3,
                "{c:?}"
            );
        };
        near(5, "z", 0.0, 180.0);
        near(5, "x", 0.0, 240.0);
        near(6, "b6", 10.0, 190.0);
        near(7, "ḃ5", 240.0 / (8.0 * PI), 240.0 / (8.0 * PI));
        near(7, "ḃ6", -22.5, 22.5);
        near(8, "b̈6", -5.625, 5.625);
        near(8, "b̈5", 0.0, 0.0);
    }

    #[test]
    fn the_literal_reading_breaks_the_axes_of_speed_and_acceleration() {
        let checks = checks(&LITERAL, &motion(&LITERAL));
        let near = |figure, quantity, value: f64, fits: bool| {
            let c = check(&checks, figure, quantity);
            let largest = c.max.abs().max(c.min.abs());
            assert!((largest - value).abs() < 0.05 && c.fits == fits, "{c:?}");
        };
        near(5, "z", 179.5, true);
        near(7, "ḃ6", 95.9, false);
        near(8, "b̈6", 31.25, false);
        near(7, "ḃ5", 240.0 / 3.5, false);
    }

    #[test]
    fn the_yaw_cylinder_rests_and_rates_are_derivatives() {
        for reading in [ARGUMENT, LITERAL] {
            let motion = motion(&reading);
            for i in &motion {
                assert!((i.yaw[0] - 0.4).abs() < 1e-12 && i.yaw[1].abs() < 1e-15);
                assert!(i.foot_m[1].abs() < 1e-15);
            }
            let dt = reading.duration_s / 2000.0;
            for w in motion.windows(3) {
                for k in 0..2 {
                    let rate = (w[2].length_m[k] - w[0].length_m[k]) / (2.0 * dt);
                    assert!((rate - w[1].rate_m_s[k]).abs() < 1e-6);
                    let second = (w[2].rate_m_s[k] - w[0].rate_m_s[k]) / (2.0 * dt);
                    assert!((second - w[1].acceleration_m_s2[k]).abs() < 1e-6);
                }
            }
        }
    }
}
