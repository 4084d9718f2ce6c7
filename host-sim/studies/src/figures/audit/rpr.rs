//! Equations of the yaw chain: (17) to (38), (61), (64). On the closed leg its tip, O4, rests.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use nalgebra::{Vector3, Vector6};
use wheeleg_kinematics::{Theta3, printed};

use super::{Component, Equation, State, Status, components, twist_components};

const RATES: [&str; 2] = ["rad/s", "m/s"];
const ACCELERATIONS: [&str; 2] = ["rad/s²", "m/s²"];

pub(super) const EQUATIONS: [Equation; 16] = [
    Equation {
        number: "17",
        status: Status::Ambiguous,
        printed: "T123 with the translation [.01, .01, 0]",
        corrected: "[.29, b2, 0] at θ1 = π, θ3 = 0 (Table 2)",
        evaluate: |s| components(["x", "y"], "m", [0.01, 0.01], [crank(s), s.x[1]]),
    },
    Equation {
        number: "18",
        status: Status::Ambiguous,
        printed: "T3 with the translation .01",
        corrected: ".29 (Table 2, (22))",
        evaluate: |s| components(["x"], "m", [0.01], [crank(s)]),
    },
    Equation {
        number: "21",
        status: Status::Home,
        printed: "Q1 and Q3 as constant matrices",
        corrected: "Q1(θ1), Q3 = Rz(θ3)",
        evaluate: |s| {
            let ((s1, c1), (s3, c3)) = (s.x[0].sin_cos(), s.x[2].sin_cos());
            components(
                ["Q1 11", "Q1 13", "Q1 21", "Q1 23", "Q3 11", "Q3 12"],
                "1",
                [-1.0, 0.0, 0.0, 1.0, 1.0, 0.0],
                [c1, s1, s1, -c1, c3, -s3],
            )
        },
    },
    Equation {
        number: "25",
        status: Status::Singular,
        printed: "b2 = xt/s1 − .29 s3 + .29 c3 cot θ1",
        corrected: "(A5), without division by s1",
        evaluate: |s| {
            let ((s1, c1), (s3, c3)) = (s.x[0].sin_cos(), s.x[2].sin_cos());
            let [xt, _] = s.model.geometry.parameters().p4_m;
            let b2 = xt / s1 - crank(s) * s3 + crank(s) * c3 * c1 / s1;
            components(["b2"], "m", [b2], [s.x[1]])
        },
    },
    Equation {
        number: "27",
        status: Status::Wrong,
        printed: "quartic in γ = tan(θ1/2) with −2yt and −6·.29 c3; its root nearest to π",
        corrected: "(27*), a quadratic; θ1 by (A5)",
        evaluate: |s| components(["θ1"], "rad", [root_27(s)], [s.x[0]]),
    },
    Equation {
        number: "28",
        status: Status::Home,
        printed: "e2 = [0, 1, 0]",
        corrected: "e2 = [s1, −c1, 0]",
        evaluate: e2,
    },
    Equation {
        number: "31",
        status: Status::Wrong,
        printed: "J = [[0,0,0],[0,1,0],[1,0,1],[0,b2,−.29s3],[0,0,.29c3],[0,0,0]]; shown: J θ̇",
        corrected: "(31*)",
        evaluate: |s| {
            let (s3, c3) = s.x[2].sin_cos();
            let (w1, v2, w3) = (s.xd[0], s.xd[1], s.xd[2]);
            let printed = Vector6::new(
                0.0,
                v2,
                w1 + w3,
                s.x[1] * v2 - crank(s) * s3 * w3,
                crank(s) * c3 * w3,
                0.0,
            );
            twist_components(RATES, &printed, &tip_twist(s))
        },
    },
    Equation {
        number: "32",
        status: Status::Wrong,
        printed: "t = [0, 0, θ̇1 + θ̇3, −.29 s3 (θ̇1 + θ̇3), .29 c3 (θ̇1 + θ̇3), 0]",
        corrected: "(32*); O4 rests",
        evaluate: |s| {
            let printed = printed::twist_32(crank(s), Theta3::new(s.x[2]), &chain_rates(s));
            twist_components(RATES, &printed, &tip_twist(s))
        },
    },
    Equation {
        number: "33",
        status: Status::Singular,
        printed: "ḃ2 with division by sin² θ1",
        corrected: "ḃ2 = −ℓ c3 φ̇",
        evaluate: |s| {
            let ((s1, c1), (s3, c3)) = (s.x[0].sin_cos(), s.x[2].sin_cos());
            let [xt, _] = s.model.geometry.parameters().p4_m;
            let l = crank(s);
            let b2_dot = -(xt * c1 / (s1 * s1) + l * c3 / (s1 * s1)) * s.xd[0]
                - (l * c3 + l * s3 * c1 / s1) * s.xd[2];
            components(["ḃ2"], "m/s", [b2_dot], [-l * c3 * s.xd[3]])
        },
    },
    Equation {
        number: "34",
        status: Status::Wrong,
        printed: "θ̇1 = [cos(θ3+k3) − sin(θ3+k3)] sin²(θ1+k1)/sin(θ3+k3) θ̇3; k3 undefined, π/4 taken, \
                  θ3 as φ",
        corrected: "(34*), θ̇1 = −(ℓ/b2) s3 φ̇",
        evaluate: |s| {
            let [xt, yt] = s.model.geometry.parameters().p4_m;
            let k1 = -(FRAC_PI_2 + yt.atan2(xt));
            let (sin, cos) = (s.x[3] - FRAC_PI_2 + FRAC_PI_4).sin_cos();
            let factor = (cos - sin) * (s.x[0] + k1).sin().powi(2) / sin;
            components(["θ̇1"], "rad/s", [factor * s.xd[3]], [s.xd[0]])
        },
    },
    Equation {
        number: "35",
        status: Status::Home,
        printed: "ė2 = [−θ̇1, 0, 0]",
        corrected: "ė2 = θ̇1 [c1, s1, 0]",
        evaluate: |s| {
            let ((s1, c1), w) = (s.x[0].sin_cos(), s.xd[0]);
            components(["ė2x", "ė2y"], "1/s", [-w, 0.0], [w * c1, w * s1])
        },
    },
    Equation {
        number: "36",
        status: Status::Wrong,
        printed: "ṙ1 = [−.29 s3 φ̇, ḃ2 + .29 c3 φ̇, 0]",
        corrected: "ṙ1 = ṗ of (32*); O4 rests",
        evaluate: |s| {
            let ((s3, c3), l) = (s.x[2].sin_cos(), crank(s));
            let (w, twist) = (s.xd[0] + s.xd[2], tip_twist(s));
            components(
                ["ṙ1x", "ṙ1y"],
                "m/s",
                [-l * s3 * w, s.xd[1] + l * c3 * w],
                [twist[3], twist[4]],
            )
        },
    },
    Equation {
        number: "37",
        status: Status::Home,
        printed: "ṙ3 = [−.29 s3 φ̇, .29 c3 φ̇, 0]",
        corrected: "ṙ3 = .29 φ̇ [−sin φ, cos φ, 0]",
        evaluate: |s| {
            let ((s3, c3), l) = (s.x[2].sin_cos(), crank(s));
            let ((sin, cos), w) = ((s.x[3] - FRAC_PI_2).sin_cos(), s.xd[3]);
            components(
                ["ṙ3x", "ṙ3y"],
                "m/s",
                [-l * s3 * w, l * c3 * w],
                [-l * sin * w, l * cos * w],
            )
        },
    },
    Equation {
        number: "38",
        status: Status::Wrong,
        printed: "p̈ without 2ḃ2θ̇1 in full, b2θ̈1, b2θ̇1²; + .29 s3 φ̇² in y",
        corrected: "(38*); O4 rests",
        evaluate: |s| {
            let (v, a) = (chain_rates(s), chain_accelerations(s));
            let printed = printed::twist_dot_38(crank(s), Theta3::new(s.x[2]), &v, &a);
            let corrected = Vector6::new(0.0, 0.0, s.xdd[3], 0.0, 0.0, 0.0);
            twist_components(ACCELERATIONS, &printed, &corrected)
        },
    },
    Equation {
        number: "61",
        status: Status::Home,
        printed: "e2 in F1 = [0, 1, 0]",
        corrected: "e2 = [s1, −c1, 0]",
        evaluate: e2,
    },
    Equation {
        number: "64",
        status: Status::Wrong,
        printed: "ṙ21, ṙ31 without ḃ2 e2",
        corrected: "(64*)",
        evaluate: |s| {
            let (s1, c1) = s.x[0].sin_cos();
            let (u, w) = (Vector3::new(s1, -c1, 0.0), Vector3::new(c1, s1, 0.0));
            let [a, b, _] = s.model.bodies[1].com_m;
            // ρ2 = b2 u + com2 in F3 = [−w, u, k]; k × u = w, k × w = −u
            let turning = (w * (s.x[1] + b) + u * a) * s.xd[0];
            let whole = turning + u * s.xd[1];
            components(
                ["ṙ21x", "ṙ21y"],
                "m/s",
                [turning.x, turning.y],
                [whole.x, whole.y],
            )
        },
    },
];

fn crank(s: &State<'_>) -> f64 {
    s.model.geometry.parameters().crank_m
}

fn e2(s: &State<'_>) -> Vec<Component> {
    let (s1, c1) = s.x[0].sin_cos();
    components(["e2x", "e2y"], "1", [0.0, 1.0], [s1, -c1])
}

fn chain_rates(s: &State<'_>) -> Vector3<f64> {
    Vector3::new(s.xd[0], s.xd[1], s.xd[2])
}

fn chain_accelerations(s: &State<'_>) -> Vector3<f64> {
    Vector3::new(s.xdd[0], s.xdd[1], s.xdd[2])
}

/// On the closed leg the crank turns about a resting O4.
fn tip_twist(s: &State<'_>) -> Vector6<f64> {
    Vector6::new(0.0, 0.0, s.xd[3], 0.0, 0.0, 0.0)
}

/// θ1 of the printed (27), the root nearest to π, by Newton's method on the quartic's trigonometric
/// form xt c1 − yt s1 + ℓ c3 cos 2θ1 = 0 (MODEL.md §3), which is regular where γ is infinite.
fn root_27(s: &State<'_>) -> f64 {
    let [xt, yt] = s.model.geometry.parameters().p4_m;
    let lc = crank(s) * s.x[2].cos();
    let mut theta = PI;
    for _ in 0..50 {
        let ((sin, cos), (sin2, cos2)) = (theta.sin_cos(), (2.0 * theta).sin_cos());
        let value = xt * cos - yt * sin + lc * cos2;
        let slope = -xt * sin - yt * cos - 2.0 * lc * sin2;
        let step = value / slope;
        theta -= step;
        if step.abs() < 1e-15 {
            break;
        }
    }
    theta
}
