//! How far the wheels have moved, and where the feet are relative to the ground that passes below.

use wheeleg_units::PositionMm;

use super::{SIDES, Senses};
use crate::contact::Side;
use crate::layer1::units::metres;
use crate::layer1::walk::{Twist, WalkGeometry};
use crate::mirror;
use crate::setpoint::{Cylinder, WHEELS};

/// Travel of the wheels at the last call, µm; `None` before the first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Ways(Option<[i64; WHEELS]>);

impl Ways {
    /// How far each wheel has moved since the last call, µm; zero at the first.
    pub(super) fn since(&mut self, senses: &Senses) -> [i64; WHEELS] {
        let mut ways = senses.wheels.map(|wheel| wheel.travel_um);
        let before = self.0.replace(ways).unwrap_or(ways);
        for (way, before) in ways.iter_mut().zip(before) {
            *way = way.saturating_sub(before);
        }
        ways
    }
}

/// Ways of the feet over the ground, as seen from the robot: how far each has moved ahead and to the left.
///
/// A foot that keeps its place on the ground has no way, however the robot moves, as long as no wheel slips.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::layer0) struct FootWays {
    wheels: Ways,
    /// Where the feet were at the last call, m from their yaw axes; `None` if a joint of the leg was never heard, or
    /// its yaw does not close.
    feet_m: [Option<[f32; 2]>; WHEELS],
    ways_um: [[i64; 2]; WHEELS],
}

impl FootWays {
    /// One cycle; returns the ways so far, µm.
    pub(in crate::layer0) fn update(
        &mut self,
        geometry: &WalkGeometry,
        senses: &Senses,
    ) -> [[i64; 2]; WHEELS] {
        let robot = moved(geometry, self.wheels.since(senses));
        let feet = self.feet_m.iter_mut().zip(&mut self.ways_um);
        for (side, (foot, way)) in SIDES.into_iter().zip(feet) {
            let here = sensed_foot_m(geometry, senses, side);
            let Some((here, before)) = here.zip(core::mem::replace(foot, here)) else {
                continue;
            };
            let ground = robot.ground_m_s(geometry, side, before);
            for (axis, way) in way.iter_mut().enumerate() {
                let at = |of: [f32; 2]| of.get(axis).copied().unwrap_or(0.0);
                let step_m = at(here) - at(before) - at(ground);
                *way = way.saturating_add((step_m * 1e6) as i64);
            }
        }
        self.ways_um
    }
}

/// Motion of the robot, m and rad, from the travel of its wheels, µm.
pub(super) fn moved(geometry: &WalkGeometry, ways_um: [i64; WHEELS]) -> Twist {
    Twist::of_wheels(geometry, ways_um.map(|um| um as f32 * 1e-6))
}

/// Position of a leg's foot, forward and left of its yaw axis, m, from the strokes of its yaw cylinder and b5.
pub(super) fn foot_m(
    geometry: &WalkGeometry,
    side: Side,
    [yaw, b5]: [PositionMm; 2],
) -> Option<[f32; 2]> {
    // The height does not matter: the vertical cylinder is parallel to the yaw axis.
    let [x, y, _] = mirror::foot_of_strokes(&geometry.leg, side, [metres(yaw), metres(b5), 0.1])?;
    Some([x, y])
}

/// The same from the boards' reports; `None` if one was never heard.
pub(super) fn sensed_foot_m(
    geometry: &WalkGeometry,
    senses: &Senses,
    side: Side,
) -> Option<[f32; 2]> {
    let stroke = |cylinder| Some(senses.joint(side, cylinder)?.stroke_mm);
    foot_m(
        geometry,
        side,
        [stroke(Cylinder::Yaw)?, stroke(Cylinder::Horizontal)?],
    )
}

#[cfg(test)]
mod tests {
    use super::super::JointSense;
    use super::*;

    /// Ways ahead, turns on the spot, and both: distances of both rims in a cycle, µm.
    const TURNS: [[i64; WHEELS]; 3] = [[1_000, 1_000], [-300, 300], [700, 1_300]];
    const CYCLES: i64 = 25;

    /// Senses of a robot whose feet are here, m from their yaw axes.
    fn senses(
        geometry: &WalkGeometry,
        feet_m: [[f32; 2]; WHEELS],
        travel_um: [i64; WHEELS],
    ) -> Senses {
        let mut senses = Senses::default();
        for (side, [x, y]) in SIDES.into_iter().zip(feet_m) {
            let down = mirror::foot_of_strokes(&geometry.leg, side, [0.09; 3]).expect("closes")[2];
            let (strokes, _) = mirror::strokes_of_foot(&geometry.leg, side, [x, y, down], [0.0; 3])
                .expect("in reach");
            let cylinders = [Cylinder::Yaw, Cylinder::Horizontal, Cylinder::Vertical];
            for (cylinder, stroke_m) in cylinders.into_iter().zip(strokes) {
                senses.joints[side.joint(cylinder)] = Some(JointSense {
                    stroke_mm: PositionMm::from_f64(f64::from(stroke_m) * 1e3),
                    ..JointSense::default()
                });
            }
        }
        for (wheel, um) in senses.wheels.iter_mut().zip(travel_um) {
            wheel.travel_um = um;
        }
        senses
    }

    /// Feet in the middle of their reach.
    fn middle(geometry: &WalkGeometry) -> [[f32; 2]; WHEELS] {
        SIDES.map(|side| {
            let [x, y, _] =
                mirror::foot_of_strokes(&geometry.leg, side, [0.09; 3]).expect("closes");
            [x, y]
        })
    }

    #[test]
    fn a_foot_that_keeps_its_place_on_the_ground_has_no_way() {
        let geometry = WalkGeometry::default();
        for rims_um in TURNS {
            let mut ways = FootWays::default();
            let mut feet_m = middle(&geometry);
            for cycle in 0..CYCLES {
                let travel_um = rims_um.map(|um| um * cycle);
                let way_um = ways.update(&geometry, &senses(&geometry, feet_m, travel_um));
                assert!(
                    way_um.as_flattened().iter().all(|um| um.abs() < 1_500),
                    "{rims_um:?} {cycle}: {way_um:?}"
                );
                // Where the ground takes the feet.
                let robot = moved(&geometry, rims_um);
                for (side, foot) in SIDES.into_iter().zip(&mut feet_m) {
                    let ground = robot.ground_m_s(&geometry, side, *foot);
                    *foot = [foot[0] + ground[0], foot[1] + ground[1]];
                }
            }
        }
    }

    /// Turning left it goes to the left, and ahead on the right side: the turn times its distance from the middle of the
    /// axle.
    #[test]
    fn a_foot_that_keeps_its_place_on_the_robot_goes_where_the_robot_goes() {
        let geometry = WalkGeometry::default();
        for rims_um in TURNS {
            let mut ways = FootWays::default();
            let feet_m = middle(&geometry);
            let mut way_um = [[0; 2]; WHEELS];
            for cycle in 0..=CYCLES {
                let travel_um = rims_um.map(|um| um * cycle);
                way_um = ways.update(&geometry, &senses(&geometry, feet_m, travel_um));
            }
            let [left_um, right_um] = rims_um.map(|um| (um * CYCLES) as f32);
            let turn = (right_um - left_um) * 1e-6 / geometry.track_m;
            let ahead_um = 0.5 * (left_um + right_um);
            for ((way, foot), sign) in way_um.into_iter().zip(feet_m).zip([1.0, -1.0]) {
                let (x, y) = (
                    geometry.hip_x_m + foot[0],
                    sign * geometry.hip_y_m + foot[1],
                );
                let exact_um = [ahead_um - turn * y * 1e6, turn * x * 1e6];
                for (um, exact) in way.into_iter().zip(exact_um) {
                    assert!(
                        (um as f32 - exact).abs() < 200.0,
                        "{rims_um:?}: {um} {exact}"
                    );
                }
            }
        }
    }

    /// Neither the first cycle nor a count that comes late is a jump, and a leg that was never heard has no way.
    #[test]
    fn nothing_jumps_with_what_is_heard() {
        let geometry = WalkGeometry::default();
        let mut ways = FootWays::default();
        let feet_m = middle(&geometry);
        let far = [5_000_000; WHEELS];
        assert_eq!(ways.update(&geometry, &Senses::default()), [[0; 2]; WHEELS]);
        let mut ways_at_first = FootWays::default();
        assert_eq!(
            ways_at_first.update(&geometry, &senses(&geometry, feet_m, far)),
            [[0; 2]; WHEELS]
        );
        // Ten cycles without counts, and then all of them at once.
        let late = far.map(|um| um + 10_000);
        let way_um = ways_at_first.update(&geometry, &senses(&geometry, feet_m, late));
        for [ahead, left] in way_um {
            assert!((ahead - 10_000).abs() < 5 && left.abs() < 5, "{way_um:?}");
        }
    }
}
