//! Forward dynamics of whole robots: the reference tree of 14 coordinates, and the robot that a run
//! steps; then its whole plant.

use std::hint::black_box;

use nalgebra::{SVector, Vector3};
use wheeleg_plant::dynamics::DynamicsError;
use wheeleg_plant::dynamics::chain::FloatingState;
use wheeleg_plant::dynamics::chain::reference::{ROBOT14, robot_state};
use wheeleg_plant::dynamics::floating::{
    Contacts, FloatingParams, FloatingRobot, FloatingState as OwnState,
};
use wheeleg_plant::testing::wheeleg_2003;
use wheeleg_plant::{Inputs, Plant};

use crate::measure::{put_ns, put_realtime, repetitions, scale, timed};

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
    plant();
}

/// The whole plant in steps of 100 µs, valves and wheels at work: what a run steps, without
/// firmware, bus and log.
fn plant() {
    let built = Plant::new(&wheeleg_2003());
    let Ok((plant, mut state)) = built.and_then(|p| p.initial_state(1).map(|s| (p, s))) else {
        return;
    };
    let ticks = (20_000.0 * scale()) as usize + 1;
    let took = timed(|| {
        for tick in 0..ticks {
            let _ = plant.tick(&mut state, black_box(&commands(tick)));
        }
    });
    let check = format!("x={:.3} m", plant.outputs(&state).position_m[0]);
    put_realtime("plant_flat", "", took, ticks as f64 * 1e-3, &check);
}

/// Both legs up and down by turns, valves in pulses, the wheels driving: one step takes a second.
fn commands(tick: usize) -> Inputs {
    let mut inputs = Inputs::default();
    let (leg, up) = (tick / 1000 % 2, tick % 1000 < 400);
    let on = if tick % 20 < 10 { 1000 } else { 0 };
    inputs.valve_on_us[3 * leg + 2] = if up { [0, on, on, 0] } else { [on, 0, 0, on] };
    inputs.bridge_duty = [0.2; 2];
    inputs.bridge_enabled = [true; 2];
    inputs
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
