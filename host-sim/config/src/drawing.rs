//! The robot's sizes for drawings to scale, in reports and on the console's page.

use serde::Serialize;

use crate::RobotConfig;

/// Sizes from the robot file, mm to a thousandth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Drawing {
    crank_mm: f64,
    p4_mm: [f64; 2],
    o4_mm: [f64; 3],
    stroke_zero_mm: [f64; 3],
    foot_pad_mm: f64,
    sole_radius_mm: f64,
    wheel_radius_mm: f64,
    track_mm: f64,
}

impl Drawing {
    /// The sizes of a robot.
    #[must_use]
    pub fn of(robot: &RobotConfig) -> Self {
        let (plant, body) = (&robot.plant, &robot.plant.body);
        let [yaw, horizontal, vertical, ..] = plant.stroke_zero_m;
        Self {
            crank_mm: mm(body.crank_m),
            p4_mm: body.p4_m.map(mm),
            o4_mm: body.o4_m.map(mm),
            stroke_zero_mm: [yaw, horizontal, vertical].map(mm),
            foot_pad_mm: mm(body.foot_pad_m),
            sole_radius_mm: mm(plant.contacts.foot.sole_radius_m),
            wheel_radius_mm: mm(body.wheel_radius_m),
            track_mm: mm(robot.spatial.track_m),
        }
    }

    /// Distance between the middles of both wheels \[mm\].
    #[must_use]
    pub fn track_mm(&self) -> f64 {
        self.track_mm
    }
}

fn mm(metres: f64) -> f64 {
    (metres * 1e6).round() * 1e-3
}
