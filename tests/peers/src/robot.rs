//! Forward dynamics of whole robots: the reference tree of 14 coordinates, and the robot that a run
//! steps.

use std::hint::black_box;

use nalgebra::{SVector, Vector3};
use wheeleg_peers::chain::FloatingState;
use wheeleg_peers::chain::reference::{ROBOT14, robot_state};
use wheeleg_plant::dynamics::DynamicsError;
use wheeleg_plant::dynamics::floating::{
    Contacts, FloatingParams, FloatingRobot, FloatingState as OwnState,
};

use crate::measure::{put_ns, repetitions, timed};

#[inline(never)]
fn robot_fd(
    state: &FloatingState<8, 14>,
    tau: &[f64; 14],
    gravity: &[f64; 3],
) -> Result<[f64; 14], DynamicsError> {
    ROBOT14.forward(state, tau, gravity)
}

pub(crate) fn run() {
    let (mut state, tau) = (robot_state(0.0), black_box([1.0; 14]));
    let gravity = black_box([0.0, 0.0, -9.81]);
    let repetitions = repetitions(60_000.0);
    let mut sum = 0.0;
    let took = timed(|| {
        for r in 0..repetitions {
            state.joints[0] = 1e-6 * r as f64;
            let y = robot_fd(&state, &tau, &gravity);
            sum += black_box(&y).as_ref().map_or(f64::NAN, |y| y[0]);
        }
    });
    let check = format!("nv=14 sum={sum:.3}");
    put_ns("robot_fd_14dof", "", took, repetitions, &check);
    own_floating_robot();
}

/// No reference: the engine of every run, both legs with closed loops, no contact.
fn own_floating_robot() {
    let Ok(robot) = FloatingRobot::new(&FloatingParams::wheeleg_2003()) else {
        return;
    };
    let mut state = OwnState::at_rest([[0.40, 0.10, 0.19]; 2]);
    state.velocity = SVector::repeat(0.1);
    let force = SVector::<f64, 14>::repeat(1.0);
    let (down, contacts) = (Vector3::new(0.0, 0.0, -9.81), Contacts::NONE);
    let repetitions = repetitions(60_000.0);
    let mut sum = 0.0;
    let took = timed(|| {
        for r in 0..repetitions {
            state.lengths_m[0][0] = 0.40 + 1e-7 * r as f64;
            let y = robot.forward(&state, black_box(&force), &down, &contacts);
            sum += black_box(&y).as_ref().map_or(f64::NAN, |y| y[0]);
        }
    });
    let check = format!("nv=14 sum={sum:.3}");
    put_ns("robot_fd_own_14dof", "", took, repetitions, &check);
}
