//! Equations of the foot's chain: (5) to (16), (39), (55), (58).

use nalgebra::{Vector3, Vector6};
use wheeleg_kinematics::{Phi, printed};
use wheeleg_plant::dynamics::printed::tau_l_printed_58_64;

use super::{Component, Equation, State, Status, components, twist_components};

const RATES: [&str; 2] = ["rad/s", "m/s"];
const ACCELERATIONS: [&str; 2] = ["rad/s²", "m/s²"];

pub(super) const EQUATIONS: [Equation; 14] = [
    Equation {
        number: "5",
        status: Status::Wrong,
        printed: "Q4 = Rz(θ4), Q5 = 1, hence p = [0, 0, b5 + b6]",
        corrected: "(5*), p = [b5 s4, −b5 c4, −b6]",
        evaluate: |s| {
            let p = s.leg.foot();
            let printed = [0.0, 0.0, s.x[4] + s.x[5]];
            components(["px", "py", "pz"], "m", printed, p.into())
        },
    },
    Equation {
        number: "7",
        status: Status::Ambiguous,
        printed: "θ4 = arctg(−xp/yp), b5 = xp/sin θ4, principal value",
        corrected: "(7*), two-argument arctangent and hypotenuse",
        evaluate: |s| {
            let p = s.leg.foot();
            let theta4 = (-p.x / p.y).atan();
            let mut out = components(["θ4"], "rad", [theta4], [s.x[3]]);
            out.extend(components(["b5"], "m", [p.x / theta4.sin()], [s.x[4]]));
            out
        },
    },
    Equation {
        number: "8",
        status: Status::Ambiguous,
        printed: "θ3 = θ4 − π/2 and its derivatives, θ3 of Table 2",
        corrected: "(8*), true of φ = θ1 + θ3 − π",
        evaluate: |s| {
            let angle = s.x[3] - std::f64::consts::FRAC_PI_2;
            let mut out = components(["θ3"], "rad", [angle], [s.x[2]]);
            out.extend(components(["θ̇3"], "rad/s", [s.xd[3]], [s.xd[2]]));
            out.extend(components(["θ̈3"], "rad/s²", [s.xdd[3]], [s.xdd[2]]));
            out
        },
    },
    Equation {
        number: "9",
        status: Status::Home,
        printed: "e5 = [1, 0, 0]",
        corrected: "e5 = [s4, −c4, 0]",
        evaluate: e5,
    },
    Equation {
        number: "11",
        status: Status::Wrong,
        printed: "J = [[0,1,0],[0,0,0],[1,0,−1],[0,0,0],[0,−.02,0],[0,0,0]]; shown: J θ̇",
        corrected: "(11*), prismatic columns [0; e]",
        evaluate: |s| {
            let v = chain_rates(s);
            let printed = Vector6::new(v.y, 0.0, v.x - v.z, 0.0, -0.02 * v.y, 0.0);
            twist_components(RATES, &printed, &(s.chain.jacobian() * v))
        },
    },
    Equation {
        number: "13",
        status: Status::Wrong,
        printed: "t = [0, 0, −θ̇4, ḃ5, 0, −ḃ6]",
        corrected: "(13*)",
        evaluate: |s| {
            let v = chain_rates(s);
            twist_components(RATES, &printed::twist_13(&v), &(s.chain.jacobian() * v))
        },
    },
    Equation {
        number: "14",
        status: Status::Home,
        printed: "ė5 = [0, θ̇4, 0]",
        corrected: "ė5 = θ̇4 [c4, s4, 0]",
        evaluate: |s| {
            let w = s.xd[3];
            components(
                ["ė5x", "ė5y"],
                "1/s",
                [0.0, w],
                [w * s.leg.cos4, w * s.leg.sin4],
            )
        },
    },
    Equation {
        number: "15",
        status: Status::Wrong,
        printed: "ṙ4 = [ḃ5, 0, −ḃ6]",
        corrected: "ṙ4 = ṗ of (13*)",
        evaluate: |s| {
            let v = chain_rates(s);
            let twist = s.chain.jacobian() * v;
            components(
                ["ṙ4x", "ṙ4y", "ṙ4z"],
                "m/s",
                [v.y, 0.0, -v.z],
                [twist[3], twist[4], twist[5]],
            )
        },
    },
    Equation {
        number: "16",
        status: Status::Home,
        printed: "ṫ = [0, 0, θ̈4, b̈5, 2θ̇4ḃ5, −b̈6]",
        corrected: "(16*)",
        evaluate: |s| {
            let (v, a) = (chain_rates(s), chain_accelerations(s));
            let printed = printed::twist_dot_16(&v, &a);
            let corrected = s.chain.twist_dot(&v, &a);
            let corrected = corrected.unwrap_or_else(|_| Vector6::repeat(f64::NAN));
            twist_components(ACCELERATIONS, &printed, &corrected)
        },
    },
    Equation {
        number: "39",
        status: Status::Wrong,
        printed: "Yp = b2 cot θ4",
        corrected: "Yp = −b5 cos θ4",
        evaluate: |s| {
            let phi = Phi::from_theta4(s.x[3]);
            let printed = printed::foot_y_39(s.x[1], phi);
            components(["Yp"], "m", [printed], [s.leg.foot().y])
        },
    },
    Equation {
        number: "55",
        status: Status::Home,
        printed: "e5 in F4 = [1, 0, 0]",
        corrected: "e5 = [s4, −c4, 0]",
        evaluate: e5,
    },
    Equation {
        number: "58",
        status: Status::Wrong,
        printed: "ṙ54, ṙ64 without the slides' own rates",
        corrected: "(58*), with ḃ5 e5 and ḃ6 e6",
        evaluate: |s| {
            let (f, w) = (Vector3::new(s.leg.sin4, -s.leg.cos4, 0.0), s.xd[3]);
            let n = Vector3::new(s.leg.cos4, s.leg.sin4, 0.0);
            let of = |body: usize| {
                let [a, b, _] = s.model.bodies[body].com_m;
                // k × ρ of what turns with the leg
                (f * a * -1.0 + n * (b + s.x[4])) * w
            };
            let slides = [f * s.xd[4], f * s.xd[4] - Vector3::z() * s.xd[5]];
            let (r54, r64) = (of(4), of(5));
            let (c54, c64) = (r54 + slides[0], r64 + slides[1]);
            components(
                ["ṙ54x", "ṙ54y", "ṙ64x", "ṙ64y", "ṙ64z"],
                "m/s",
                [r54.x, r54.y, r64.x, r64.y, r64.z],
                [c54.x, c54.y, c64.x, c64.y, c64.z],
            )
        },
    },
    Equation {
        number: "58, 64 in (54)",
        status: Status::Wrong,
        printed: "forces τ = I q̈ + C q̇ with Ṫ of (58) and (64) as printed",
        corrected: "with (58*) and (64*)",
        evaluate: |s| {
            let (q, v, a) = (&s.q, &s.rates, &s.accelerations);
            let lost = Vector3::repeat(f64::NAN);
            let printed = tau_l_printed_58_64(&s.model.leg, q, v, a).unwrap_or(lost);
            let corrected = s.model.leg.at(q, v).map(|system| system.inertial_force(a));
            components(
                ["τ of b2", "τ of b5", "τ of b6"],
                "N",
                printed.into(),
                corrected.unwrap_or(lost).into(),
            )
        },
    },
    Equation {
        number: "24",
        status: Status::Ambiguous,
        printed: "θ1 = −k1 + arcsin(ℓ/b2 sin(θ3 − π/2 + k4)), θ3 of Table 2",
        corrected: "(24*), the same with φ for θ3",
        evaluate: |s| {
            let p = s.model.geometry.parameters();
            let [xt, yt] = p.p4_m;
            let k = -(std::f64::consts::FRAC_PI_2 + yt.atan2(xt));
            let right_angle = std::f64::consts::FRAC_PI_2;
            let angle =
                |theta: f64| -k + (p.crank_m / s.x[1] * (theta - right_angle + k).sin()).asin();
            components(["θ1"], "rad", [angle(s.x[2])], [s.x[0]])
        },
    },
];

fn e5(s: &State<'_>) -> Vec<Component> {
    components(["e5x", "e5y"], "1", [1.0, 0.0], [s.leg.sin4, -s.leg.cos4])
}

fn chain_rates(s: &State<'_>) -> Vector3<f64> {
    Vector3::new(s.xd[3], s.xd[4], s.xd[5])
}

fn chain_accelerations(s: &State<'_>) -> Vector3<f64> {
    Vector3::new(s.xdd[3], s.xdd[4], s.xdd[5])
}
