//! Inverse and forward dynamics and steps of the two reference legs, and of the robot's own leg.

use std::hint::black_box;

use wheeleg_peers::chain::ChainLeg;
use wheeleg_peers::chain::reference::{
    GRAVITY_M_S2, LegState, RPP, RPR, Rpp, Rpr, leg_states, weighted,
};
use wheeleg_plant::dynamics::{DynamicsError, RobotDynamicsParams};

use crate::measure::{put_ns, repetitions, timed};

type Answer = Result<[f64; 3], DynamicsError>;
/// Positions, rates, accelerations or forces, gravity.
type Call = fn(&[f64; 3], &[f64; 3], &[f64; 3], &[f64; 3]) -> Answer;

macro_rules! call {
    ($name:ident, $chain:ident, $method:ident) => {
        // Not inlined: one state per call, as in the C programs.
        #[inline(never)]
        fn $name(q: &[f64; 3], v: &[f64; 3], a: &[f64; 3], g: &[f64; 3]) -> Answer {
            $chain.$method(q, v, a, g)
        }
    };
}
call!(rpp_id, RPP, inverse);
call!(rpp_fd, RPP, forward);
call!(rpr_id, RPR, inverse);
call!(rpr_fd, RPR, forward);

/// The same chains with masses and dimensions that the compiler does not know: one type, any values.
macro_rules! loaded {
    ($name:ident, $chain:ident, $type:ty, $method:ident) => {
        #[inline(never)]
        fn $name(q: &[f64; 3], v: &[f64; 3], a: &[f64; 3], g: &[f64; 3]) -> Answer {
            static CHAIN: $type = $chain;
            black_box(&CHAIN).$method(q, v, a, g)
        }
    };
}
loaded!(loaded_rpp_id, RPP, Rpp, inverse);
loaded!(loaded_rpp_fd, RPP, Rpp, forward);
loaded!(loaded_rpr_id, RPR, Rpr, inverse);
loaded!(loaded_rpr_fd, RPR, Rpr, forward);

/// Peer of the rows whose parameters are known only at run time.
const LOADED: &str = "_loaded";

pub(crate) fn run() {
    let (rpp, rpr) = ([true, false, false], [true, false, true]);
    bench("rpp", rpp, rpp_id, rpp_fd);
    bench("rpr", rpr, rpr_id, rpr_fd);
    for (leg, turns, id, fd) in [
        ("rpp", rpp, loaded_rpp_id as Call, loaded_rpp_fd as Call),
        ("rpr", rpr, loaded_rpr_id, loaded_rpr_fd),
    ] {
        let states = leg_states(turns);
        per_call(&format!("leg_id_{leg}"), LOADED, &states, id, 9);
        per_call(&format!("leg_fd_{leg}"), LOADED, &states, fd, 6);
    }
    own_leg();
}

fn per_call(name: &str, detail: &str, states: &[LegState], call: Call, decimals: usize) {
    let gravity = black_box(GRAVITY_M_S2);
    let sum: f64 = states
        .iter()
        .map(|s| call(&s.q, &s.v, &s.a, &gravity).map_or(f64::NAN, |y| weighted(&y)))
        .sum();
    let repetitions = repetitions(2000.0);
    let took = timed(|| {
        for _ in 0..repetitions {
            for s in states {
                // By reference: the value must be computed, not copied.
                let _ = black_box(&call(&s.q, &s.v, &s.a, &gravity));
            }
        }
    });
    let check = format!("sum={sum:.decimals$}");
    put_ns(name, detail, took, repetitions * states.len(), &check);
}

fn bench(leg: &str, turns: [bool; 3], id: Call, fd: Call) {
    let states = leg_states(turns);
    per_call(&format!("leg_id_{leg}"), "", &states, id, 9);
    per_call(&format!("leg_fd_{leg}"), "", &states, fd, 6);
    let gravity = black_box(GRAVITY_M_S2);
    let repetitions = repetitions(4000.0);
    let (mut q, mut v) = ([0.0; 3], [0.0; 3]);
    let took = timed(|| {
        for _ in 0..repetitions {
            (q, v) = ([0.0; 3], [1.0, 0.0, 0.0]);
            for _ in 0..200 {
                let a = fd(&q, &v, &[0.0; 3], &gravity).unwrap_or([f64::NAN; 3]);
                for j in 0..3 {
                    v[j] += 1e-3 * a[j];
                    q[j] += 1e-3 * v[j];
                }
            }
            black_box(&q);
        }
    });
    let check = format!("q(0.2s)={:.6},{:.6},{:.6}", q[0], q[1], q[2]);
    put_ns(
        &format!("leg_step_{leg}"),
        "",
        took,
        repetitions * 200,
        &check,
    );
}

/// No reference: six bodies and the closed loop of the yaw cylinder.
fn own_leg() {
    let p = RobotDynamicsParams::wheeleg_2003();
    let Ok(leg) = ChainLeg::new(p.leg_parameters(), &p.leg_bodies, [20.0, 15.0, 15.0]) else {
        return;
    };
    // Lengths from 0.35 to 0.45 m and 0.05 to 0.15 m.
    let states: Vec<LegState> = leg_states([false; 3])
        .into_iter()
        .map(|s| LegState {
            q: [s.q[0] + 0.40, s.q[1] + 0.10, s.q[2] + 0.10],
            ..s
        })
        .collect();
    let gravity = black_box(GRAVITY_M_S2);
    let foot = black_box([1.0, -2.0, 60.0]);
    let repetitions = repetitions(1000.0);
    let items = repetitions * states.len();
    let sum: f64 = states
        .iter()
        .map(|s| {
            let y = leg.inverse(&s.q, &s.v, &s.a, &gravity, &foot);
            y.map_or(f64::NAN, |y| weighted(&y))
        })
        .sum();
    let took = timed(|| {
        for _ in 0..repetitions {
            for s in &states {
                let _ = black_box(&leg.inverse(&s.q, &s.v, &s.a, &gravity, &foot));
            }
        }
    });
    put_ns("leg_id_own", "", took, items, &format!("sum={sum:.9}"));
    let took = timed(|| {
        for _ in 0..repetitions {
            for s in &states {
                let _ = black_box(&leg.forward(&s.q, &s.v, &s.a, &gravity, &foot));
            }
        }
    });
    // The forces of the states' accelerations must give those back. A refusal stays in the maximum,
    // which passes over NaN.
    let worst = states
        .iter()
        .map(|s| {
            let back = leg
                .inverse(&s.q, &s.v, &s.a, &gravity, &foot)
                .and_then(|tau| leg.forward(&s.q, &s.v, &tau, &gravity, &foot));
            let error = |y: [f64; 3]| (0..3).map(|i| (y[i] - s.a[i]).abs()).fold(0.0, f64::max);
            back.map_or(f64::INFINITY, error)
        })
        .fold(0.0, f64::max);
    put_ns(
        "leg_fd_own",
        "",
        took,
        items,
        &format!("fd(id)-a={worst:.0e}"),
    );
}
