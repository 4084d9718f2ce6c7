//! Where a foot can stand, and how the ground passes below the moving robot.
//!
//! Lengths in m, angles in rad, `f32`; X forward and Y left. A foot's place is told from the yaw
//! axis O4 of its leg, in the robot's axes.

use wheeleg_units::VelocityMmS;

use crate::argument::{TURNS, WALK_SPEEDS};
use crate::contact::Side;

/// Dimensions of the robot that a walk needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkGeometry {
    /// Yaw axes ahead of the wheel axle, m.
    pub hip_x_m: f32,
    /// Left yaw axis left of the middle, m.
    pub hip_y_m: f32,
    /// Distance of the wheels' middles, m.
    pub track_m: f32,
    /// Length of the nails below a sole, m: a foot moves ahead when they are out of the ground.
    pub nail_m: f32,
}

impl Default for WalkGeometry {
    /// ASSUMED, as in `robots/wheeleg-2003.toml`.
    fn default() -> Self {
        Self {
            hip_x_m: 0.60,
            hip_y_m: 0.20,
            track_m: 0.56,
            nail_m: 0.0,
        }
    }
}

impl WalkGeometry {
    /// Speed of the outer wheel in the fastest and tightest walk that can be ordered.
    pub(crate) fn fastest_wheel(&self) -> VelocityMmS {
        let turn_rad_s = TURNS.max.to_num::<f32>();
        let outward_mm_s = 1e3 * 0.5 * self.track_m * turn_rad_s;
        VelocityMmS::from_f64(f64::from(WALK_SPEEDS.max.to_num::<f32>() + outward_mm_s))
    }
}

/// Distance of a foot from its yaw axis with b5 drawn back, m (`LegParameters`, ASSUMED).
const RADIUS_MIN_M: f32 = 0.01;
/// Stroke of b5, m.
const STROKE_M: f32 = 0.18;
/// Stroke kept free at either end of b5, m: what a stance may stray.
const MARGIN_M: f32 = 0.0075;
/// Tangent of the farthest planned yaw of a leg: 14.6° of the 18° that its cylinder turns, because
/// the way of a foot in a turn is bent.
const YAW_TANGENT: f32 = 0.26;

/// Farthest and nearest distance of a planned foothold from the yaw axis, m.
pub(super) const OUT_M: f32 = RADIUS_MIN_M + STROKE_M - MARGIN_M;
const IN_M: f32 = RADIUS_MIN_M + MARGIN_M;

/// Speed of the robot over the ground.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Twist {
    /// Forward, m/s.
    pub forward_m_s: f32,
    /// To the left, rad/s.
    pub turn_rad_s: f32,
}

impl Twist {
    /// This motion, slower by a factor.
    pub(crate) fn scaled(self, factor: f32) -> Self {
        Self {
            forward_m_s: factor * self.forward_m_s,
            turn_rad_s: factor * self.turn_rad_s,
        }
    }

    /// Speed of one wheel's rim, m/s.
    pub(crate) fn wheel_m_s(self, geometry: &WalkGeometry, side: Side) -> f32 {
        self.forward_m_s - sign(side) * 0.5 * geometry.track_m * self.turn_rad_s
    }

    /// The motion of both wheels, from the speeds (or distances) of their rims.
    pub(crate) fn of_wheels(geometry: &WalkGeometry, [left, right]: [f32; 2]) -> Self {
        Self {
            forward_m_s: 0.5 * (left + right),
            turn_rad_s: (right - left) / geometry.track_m,
        }
    }

    /// Velocity of the ground under a foot, seen from the robot, m/s.
    pub(crate) fn ground_m_s(
        self,
        geometry: &WalkGeometry,
        side: Side,
        foot: [f32; 2],
    ) -> [f32; 2] {
        let [x, y] = foot;
        let (x, y) = (geometry.hip_x_m + x, sign(side) * geometry.hip_y_m + y);
        [self.turn_rad_s * y - self.forward_m_s, -self.turn_rad_s * x]
    }
}

const fn sign(side: Side) -> f32 {
    match side {
        Side::Left => 1.0,
        Side::Right => -1.0,
    }
}

/// A stance as it is planned: where it begins and how long it lasts at this motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stance {
    /// Foothold, m.
    pub begin_m: [f32; 2],
    /// Time from there to the edge of the leg's reach, s; infinite for a robot that stands.
    pub duration_s: f32,
}

/// Plans the longest stance of a leg: over the whole stroke, yawed equally far to both sides.
pub(super) fn stance(twist: Twist, geometry: &WalkGeometry, side: Side) -> Stance {
    let middle = 0.5 * (OUT_M + IN_M);
    let [ux, uy] = twist.ground_m_s(geometry, side, [middle, 0.0]);
    let longest_s = |out: f32| {
        let along = (out - IN_M) / libm::fabsf(ux);
        // Both ends at the farthest yaw: |uy| T = tan ψ (x_begin + x_end), one of them far out.
        let across = 2.0 * YAW_TANGENT * out / (libm::fabsf(uy) + YAW_TANGENT * libm::fabsf(ux));
        if uy == 0.0 { along } else { along.min(across) }
    };
    let tangent = |out: f32, duration_s: f32| {
        // Yawed equally far to both sides.
        uy * duration_s / (2.0 * out - libm::fabsf(ux) * duration_s)
    };
    if !longest_s(OUT_M).is_finite() {
        return Stance {
            begin_m: [middle, 0.0],
            duration_s: f32::INFINITY,
        };
    }
    // A yawed leg reaches less far forward.
    let yaw = tangent(OUT_M, longest_s(OUT_M));
    let out = OUT_M / libm::sqrtf(1.0 + yaw * yaw);
    let duration_s = longest_s(out);
    let dx = ux * duration_s;
    // Drawn towards the robot it begins far out; pushed away from it, it ends there.
    let begin = if dx <= 0.0 { out } else { out - dx };
    Stance {
        begin_m: [begin, -tangent(out, duration_s) * begin],
        duration_s,
    }
}

/// Time until a foot that stands at `foot` reaches the edge of its leg's reach, s.
pub(super) fn time_left_s(
    twist: Twist,
    geometry: &WalkGeometry,
    side: Side,
    foot: [f32; 2],
) -> f32 {
    let [x, y] = foot;
    let [ux, uy] = twist.ground_m_s(geometry, side, foot);
    let along = if ux < 0.0 {
        (x - IN_M) / -ux
    } else if ux > 0.0 {
        (OUT_M - x) / ux
    } else {
        f32::INFINITY
    };
    // The foot meets the line of the farthest yaw: ±(y + uy t) = tan ψ (x + ux t).
    let closing = libm::fabsf(uy) - YAW_TANGENT * ux;
    let across = if uy == 0.0 || closing <= 0.0 {
        f32::INFINITY
    } else {
        (YAW_TANGENT * x - libm::copysignf(y, y * uy)) / closing
    };
    along.min(across).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: WalkGeometry = WalkGeometry {
        hip_x_m: 0.60,
        hip_y_m: 0.20,
        track_m: 0.56,
        nail_m: 0.0,
    };

    #[test]
    fn straight_ahead_a_stance_takes_the_stroke_and_stays_in_line() {
        let twist = Twist {
            forward_m_s: 0.12,
            turn_rad_s: 0.0,
        };
        for side in [Side::Left, Side::Right] {
            let plan = stance(twist, &G, side);
            assert!((plan.duration_s - 0.165 / 0.12).abs() < 1e-4);
            assert_eq!(plan.begin_m[1], 0.0);
            assert!((plan.begin_m[0] - OUT_M).abs() < 1e-6);
            assert_eq!(twist.wheel_m_s(&G, side), 0.12);
        }
        let back = stance(twist.scaled(-1.0), &G, Side::Left);
        assert!((back.begin_m[0] - IN_M).abs() < 1e-6);
    }

    #[test]
    fn wheels_and_twist_are_each_others_inverse() {
        let twist = Twist {
            forward_m_s: 0.06,
            turn_rad_s: 0.07,
        };
        let rims = [Side::Left, Side::Right].map(|side| twist.wheel_m_s(&G, side));
        let again = Twist::of_wheels(&G, rims);
        assert!((again.forward_m_s - 0.06).abs() < 1e-7);
        assert!((again.turn_rad_s - 0.07).abs() < 1e-6);
        // Turning left, the right wheel is faster, and the ground moves right below the feet.
        assert!(rims[1] > rims[0]);
        assert!(twist.ground_m_s(&G, Side::Left, [0.1, 0.0])[1] < 0.0);
    }

    #[test]
    fn every_stance_of_a_turn_stays_within_the_yaw_of_the_leg() {
        for (speed, turn) in [
            (0.12, 0.05),
            (0.06, 0.07),
            (0.0, 0.087),
            (-0.1, 0.05),
            (0.08, -0.07),
        ] {
            let twist = Twist {
                forward_m_s: speed,
                turn_rad_s: turn,
            };
            for side in [Side::Left, Side::Right] {
                let plan = stance(twist, &G, side);
                let mut foot = plan.begin_m;
                let steps = 200_u16;
                for _ in 0..=steps {
                    let [x, y] = foot;
                    let reach = libm::hypotf(x, y);
                    let yaw = libm::atan2f(y, x);
                    assert!(
                        yaw.abs() < 18.0_f32.to_radians(),
                        "{speed} {turn} {side:?} {yaw}"
                    );
                    assert!(reach < RADIUS_MIN_M + STROKE_M, "{speed} {turn} {reach}");
                    assert!(reach > RADIUS_MIN_M, "{speed} {turn} {reach}");
                    let [ux, uy] = twist.ground_m_s(&G, side, foot);
                    let dt = plan.duration_s / f32::from(steps);
                    foot = [x + ux * dt, y + uy * dt];
                }
            }
        }
    }
}
