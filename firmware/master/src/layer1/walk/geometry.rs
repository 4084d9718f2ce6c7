//! Where a foot can stand, and how the ground passes below the moving robot.
//!
//! Lengths in m, angles in rad, `f32`; X forward and Y left. The position of a foot is relative to the yaw axis O4 of
//! its leg, in the robot's axes.

use wheeleg_kinematics::LegParameters;
use wheeleg_units::VelocityMmS;

use crate::argument::{TURNS, WALK_SPEEDS};
use crate::contact::Side;

/// Dimensions of the robot that a walk needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkGeometry {
    /// Distance of the yaw axes ahead of the wheel axle, m.
    pub hip_x_m: f32,
    /// Distance of the left yaw axis to the left of the middle, m.
    pub hip_y_m: f32,
    /// Distance between the middles of the wheels, m.
    pub track_m: f32,
    /// Length of the nails below a sole, m: a foot moves forward only when they are out of the ground.
    pub nail_m: f32,
    /// Dimensions of a leg. Its strokes are limited to those of commands ([`crate::layer1::params::STROKE_MM`]),
    /// whatever is given here.
    pub leg: LegParameters<f32>,
}

impl Default for WalkGeometry {
    /// ASSUMED, as in `robots/wheeleg-2003.toml`.
    fn default() -> Self {
        Self {
            hip_x_m: 0.60,
            hip_y_m: 0.20,
            track_m: 0.56,
            nail_m: 0.0,
            leg: LegParameters::wheeleg_2003(),
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

    /// Distance of a foot from its yaw axis with b5 drawn back, m.
    fn radius_min_m(&self) -> f32 {
        let [_, b5, _] = self.leg.stroke_zero_m;
        b5
    }

    /// Distance of a foot from its yaw axis with b5 half out, m.
    pub(super) fn middle_m(&self) -> f32 {
        self.radius_min_m() + 0.5 * STROKE_M
    }

    /// Nearest distance of a planned foothold from the yaw axis, m.
    fn in_m(&self) -> f32 {
        self.radius_min_m() + MARGIN_M
    }

    /// Farthest distance of a planned foothold from the yaw axis, m.
    fn out_m(&self) -> f32 {
        self.radius_min_m() + STROKE_M - MARGIN_M
    }

    /// Tangent of the farthest planned yaw of a leg: the same share of the yaw cylinder's stroke for any crank.
    fn yaw_tangent(&self) -> f32 {
        YAW_TANGENT * (CRANK_M / self.leg.crank_m)
    }
}

/// Stroke of b5, m.
const STROKE_M: f32 = 0.18;
/// Stroke kept free at either end of b5, m, as room for deviations of a stance.
const MARGIN_M: f32 = 0.0075;
/// Tangent of the farthest planned yaw of a leg with this crank, m: 14.6° of the 18° that its cylinder turns it,
/// because the path of a foot is curved in a turn.
const YAW_TANGENT: f32 = 0.26;
const CRANK_M: f32 = 0.29;

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

/// A planned stance: where it begins and how long it lasts at this motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stance {
    /// Foothold, m.
    pub begin_m: [f32; 2],
    /// Time from there to the edge of the leg's reach, s; infinite for a robot that stands.
    pub duration_s: f32,
}

/// Plans the longest stance of a leg: over the whole stroke, yawed equally far to both sides.
pub(super) fn stance(twist: Twist, geometry: &WalkGeometry, side: Side) -> Stance {
    let (near, far, yaw_tangent) = (geometry.in_m(), geometry.out_m(), geometry.yaw_tangent());
    let middle = 0.5 * (far + near);
    let [ux, uy] = twist.ground_m_s(geometry, side, [middle, 0.0]);
    let longest_s = |out: f32| {
        let along = (out - near) / libm::fabsf(ux);
        // Both ends at the farthest yaw: |uy| T = tan ψ (x_begin + x_end), one of them far out.
        let across = 2.0 * yaw_tangent * out / (libm::fabsf(uy) + yaw_tangent * libm::fabsf(ux));
        if uy == 0.0 { along } else { along.min(across) }
    };
    let tangent = |out: f32, duration_s: f32| {
        // Yawed equally far to both sides.
        uy * duration_s / (2.0 * out - libm::fabsf(ux) * duration_s)
    };
    if !longest_s(far).is_finite() {
        return Stance {
            begin_m: [middle, 0.0],
            duration_s: f32::INFINITY,
        };
    }
    // A yawed leg reaches less far forward.
    let yaw = tangent(far, longest_s(far));
    let out = far / libm::sqrtf(1.0 + yaw * yaw);
    let duration_s = longest_s(out);
    let dx = ux * duration_s;
    // If drawn towards the robot it begins far out; if pushed away from it, it ends there.
    let begin = if dx <= 0.0 { out } else { out - dx };
    Stance {
        begin_m: [begin, -tangent(out, duration_s) * begin],
        duration_s,
    }
}

/// Time until a foot standing at `foot` reaches the edge of its leg's reach, s.
pub(super) fn time_left_s(
    twist: Twist,
    geometry: &WalkGeometry,
    side: Side,
    foot: [f32; 2],
) -> f32 {
    let [x, y] = foot;
    let [ux, uy] = twist.ground_m_s(geometry, side, foot);
    let along = if ux < 0.0 {
        (x - geometry.in_m()) / -ux
    } else if ux > 0.0 {
        (geometry.out_m() - x) / ux
    } else {
        f32::INFINITY
    };
    // The foot meets the line of the farthest yaw: ±(y + uy t) = tan ψ (x + ux t).
    let yaw_tangent = geometry.yaw_tangent();
    let closing = libm::fabsf(uy) - yaw_tangent * ux;
    let across = if uy == 0.0 || closing <= 0.0 {
        f32::INFINITY
    } else {
        (yaw_tangent * x - libm::copysignf(y, y * uy)) / closing
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
        leg: LegParameters {
            crank_m: 0.29,
            p4_m: [0.29, 0.40],
            stroke_zero_m: [0.31, 0.01, 0.01],
            stroke_m: [STROKE_M; 3],
            min_foot_radius_m: 0.01,
            min_cos_theta3: 0.05,
        },
    };

    /// The robot with another crank, its yaw cylinder moved accordingly, and with the feet this far out when b5 is
    /// drawn back.
    fn with_leg(crank_m: f32, radius_m: f32) -> WalkGeometry {
        let mut other = G;
        other.leg.crank_m = crank_m;
        other.leg.p4_m[0] = crank_m;
        other.leg.stroke_zero_m[1] = radius_m;
        other.leg.min_foot_radius_m = radius_m;
        other
    }

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
            assert!((plan.begin_m[0] - 0.1825).abs() < 1e-6);
            assert_eq!(twist.wheel_m_s(&G, side), 0.12);
        }
        let back = stance(twist.scaled(-1.0), &G, Side::Left);
        assert!((back.begin_m[0] - 0.0175).abs() < 1e-6);
        let long = stance(twist, &with_leg(0.29, 0.08), Side::Left);
        assert!((long.begin_m[0] - 0.2525).abs() < 1e-6);
        assert!((long.duration_s - 0.165 / 0.12).abs() < 1e-4);
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
        // In a left turn the right wheel is faster, and the ground moves to the right below the feet.
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
            // The leg of the paper, then others: the cylinder turns a leg by asin(0.09 m / crank), and a little more to
            // one side.
            let legs = [
                (0.29, 0.01),
                (0.23, 0.01),
                (0.35, 0.01),
                (0.23, 0.08),
                (0.35, 0.08),
            ];
            let cases = legs.map(|leg| [(leg, Side::Left), (leg, Side::Right)]);
            for ((crank_m, radius_m), side) in cases.into_iter().flatten() {
                let geometry = with_leg(crank_m, radius_m);
                let plan = stance(twist, &geometry, side);
                let mut foot = plan.begin_m;
                let steps = 200_u16;
                for _ in 0..=steps {
                    let [x, y] = foot;
                    let reach = libm::hypotf(x, y);
                    let yaw = libm::atan2f(y, x);
                    assert!(
                        yaw.abs() < libm::asinf(0.0896 / crank_m),
                        "{speed} {turn} {side:?} {crank_m} {radius_m} {yaw}"
                    );
                    assert!(reach < radius_m + STROKE_M, "{speed} {turn} {reach}");
                    assert!(reach > radius_m, "{speed} {turn} {reach}");
                    let [ux, uy] = twist.ground_m_s(&geometry, side, foot);
                    let dt = plan.duration_s / f32::from(steps);
                    foot = [x + ux * dt, y + uy * dt];
                }
            }
        }
    }
}
