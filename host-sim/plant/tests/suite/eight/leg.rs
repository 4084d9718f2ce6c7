//! One leg's share of the equations of motion.

use wheeleg_kinematics::LegPosture;

use super::dynamics::RobotDynamics;
use wheeleg_plant::dynamics::BodyParams;

/// The joint that slides a body along its yaw frame's forward axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Slide {
    None,
    B2,
    B5,
}

/// A leg body in its yaw frame: n lateral, f forward (along the cylinder), z up.
#[derive(Debug, Clone, Copy)]
pub(super) struct YawBody {
    m: f64,
    n: f64,
    f: f64,
    z: f64,
    i_n: f64,
    i_f: f64,
    i_up: f64,
    slide: Slide,
    /// Also lowered by b6.
    lowered: bool,
}

/// Link frame axes in the yaw frame, as (source index, sign) of n, f and up.
pub(super) type Axes = [(usize, f64); 3];

impl YawBody {
    pub(super) fn new(body: &BodyParams, axes: Axes, slide: Slide, lowered: bool) -> Self {
        let [n, f, z] = axes.map(|(i, sign)| sign * body.com_m[i]);
        let [i_n, i_f, i_up] = axes.map(|(i, _)| body.inertia_kg_m2[i]);
        Self {
            m: body.mass_kg,
            n,
            f,
            z,
            i_n,
            i_f,
            i_up,
            slide,
            lowered,
        }
    }
}

/// A yaw frame in motion.
struct YawFrame {
    pivot_x: f64,
    n: [f64; 2],
    f: [f64; 2],
    /// Yaw angle's first and second derivative by b2.
    prime: f64,
    second: f64,
}

/// One leg's share of the equations, chassis axes (mirrored for the right leg).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LegTerms {
    /// Contributions to the (s, p) block: ss is the mass, the others as named.
    pub(super) sp: f64,
    pub(super) pp: f64,
    /// Coupling of s and p with b2, b5, b6.
    pub(super) s: [f64; 3],
    pub(super) p: [f64; 3],
    /// Leg block: 22, 25, 55, 66.
    pub(super) d: [f64; 4],
    /// Bias and gravity: s, p, b2, b5, b6.
    pub(super) h: [f64; 5],
    /// First mass moments from the axle (kg m).
    pub(super) moment: [f64; 3],
}

impl RobotDynamics {
    pub(super) fn leg_terms(
        &self,
        leg: &LegPosture<f64>,
        rates: &[f64; 3],
        pitch_rate: f64,
        e: [f64; 2],
        g: [f64; 3],
    ) -> LegTerms {
        let p = &self.params;
        let [b2_dot, b5_dot, b6_dot] = *rates;
        let frames = [
            YawFrame {
                pivot_x: p.o4_m[0] - p.p4_m[0],
                n: [leg.cos1, leg.sin1],
                f: [leg.sin1, -leg.cos1],
                prime: leg.theta1_prime,
                second: leg.theta1_second,
            },
            YawFrame {
                pivot_x: p.o4_m[0],
                n: [leg.cos4, leg.sin4],
                f: [leg.sin4, -leg.cos4],
                prime: leg.phi_prime,
                second: leg.phi_second,
            },
        ];
        let pivot_y = [p.o4_m[1] - p.p4_m[1], p.o4_m[1]];
        let pitch_squared = pitch_rate * pitch_rate;
        let mut t = LegTerms::default();
        for (i, body) in self.bodies.iter().enumerate() {
            let group = usize::from(i >= 2);
            let frame = &frames[group];
            let (n, f) = (frame.n, frame.f);
            let (slide, slide_dot) = match body.slide {
                Slide::None => (0.0, 0.0),
                Slide::B2 => (leg.lengths.b2_m, b2_dot),
                Slide::B5 => (leg.lengths.b5_m, b5_dot),
            };
            let (drop, drop_dot) = if body.lowered {
                (leg.lengths.b6_m, b6_dot)
            } else {
                (0.0, 0.0)
            };
            let ahead = body.f + slide;
            let r = [body.n * n[0] + ahead * f[0], body.n * n[1] + ahead * f[1]];
            // k × r, with k × f = n and k × n = −f
            let k_r = [ahead * n[0] - body.n * f[0], ahead * n[1] - body.n * f[1]];
            let mut l2 = [frame.prime * k_r[0], frame.prime * k_r[1]];
            let mut l5 = [0.0; 2];
            match body.slide {
                Slide::None => {}
                Slide::B2 => l2 = [l2[0] + f[0], l2[1] + f[1]],
                Slide::B5 => l5 = f,
            }
            let v_x = l2[0] * b2_dot + l5[0] * b5_dot;
            let v_z = -drop_dot;
            let yaw_rate = frame.prime * b2_dot;
            let yaw_bias = frame.second * b2_dot * b2_dot;
            let coriolis = 2.0 * yaw_rate * slide_dot;
            let c_x = frame.pivot_x + r[0];
            let c_z = p.o4_m[2] + body.z - drop;
            let centripetal = yaw_rate * yaw_rate;
            // Acceleration with all second derivatives zero, less gravity.
            let a = [
                yaw_bias * k_r[0] - centripetal * r[0] + coriolis * n[0]
                    - pitch_squared * c_x
                    - 2.0 * pitch_rate * v_z
                    - g[0],
                yaw_bias * k_r[1] - centripetal * r[1] + coriolis * n[1] - g[1],
                2.0 * pitch_rate * v_x - pitch_squared * c_z - g[2],
            ];
            let i_yy = body.i_n * n[1] * n[1] + body.i_f * f[1] * f[1];
            let i_xy = body.i_n * n[0] * n[1] + body.i_f * f[0] * f[1];

            let m = body.m;
            t.sp += m * (e[1] * c_x - e[0] * c_z);
            t.pp += m * (c_x * c_x + c_z * c_z) + i_yy;
            t.s[0] += m * e[0] * l2[0];
            t.s[1] += m * e[0] * l5[0];
            t.p[0] -= m * c_z * l2[0];
            t.p[1] -= m * c_z * l5[0];
            t.d[0] += m * (l2[0] * l2[0] + l2[1] * l2[1]) + frame.prime * frame.prime * body.i_up;
            t.d[1] += m * (l2[0] * l5[0] + l2[1] * l5[1]);
            t.d[2] += m * (l5[0] * l5[0] + l5[1] * l5[1]);
            t.h[0] += m * (e[0] * a[0] + e[1] * a[2]);
            // Pitch and yaw exchange momentum through the product of inertia:
            // dI_yy/dyaw = 2 I_xy.
            t.h[1] += m * (c_x * a[2] - c_z * a[0]) + 2.0 * pitch_rate * yaw_rate * i_xy;
            t.h[2] += m * (l2[0] * a[0] + l2[1] * a[1])
                + frame.prime * (body.i_up * yaw_bias - pitch_squared * i_xy);
            t.h[3] += m * (l5[0] * a[0] + l5[1] * a[1]);
            if body.lowered {
                t.s[2] -= m * e[1];
                t.p[2] -= m * c_x;
                t.d[3] += m;
                t.h[4] -= m * a[2];
            }
            t.moment[0] += m * c_x;
            t.moment[1] += m * (pivot_y[group] + r[1]);
            t.moment[2] += m * c_z;
        }
        t
    }
}
