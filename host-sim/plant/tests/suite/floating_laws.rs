//! Laws of mechanics that the floating robot must keep, over random states.

use crate::floating_states::{
    Draw, STATES, along, derivative, derivative_over, frictionless, rubbing,
};
use nalgebra::{Matrix3, SVector, Vector3};
use wheeleg_plant::dynamics::floating::reference::BODIES;
use wheeleg_plant::dynamics::floating::{
    Contacts, FloatingReference, FloatingRobot, FloatingState, FloatingSystem, Velocity,
};

fn reference() -> FloatingReference {
    FloatingReference::new(&rubbing()).unwrap()
}

/// Twists of all bodies, stacked.
fn twists(system: &FloatingSystem) -> SVector<f64, { 6 * BODIES }> {
    let each = system.blocks.bodies.map(|b| b.t * system.blocks.rates);
    SVector::from_fn(|i, _| each[i / 6][i % 6])
}

#[test]
fn twists_are_the_rates_of_the_poses() {
    let plain = reference();
    let mut draw = Draw::new(51);
    let (mut worst, mut fastest) = ([0.0_f64; 3], 0.0_f64);
    for _ in 0..STATES {
        let c = draw.case();
        let at = |t: f64| plain.at(&along(&c.state, &c.acceleration, t)).unwrap();
        let now = at(0.0);
        let twist = twists(&now);
        let centres: SVector<f64, { 3 * BODIES }> = derivative(|t| {
            let placements = at(t).placements;
            SVector::from_fn(|i, _| placements[i / 3].com_m[i % 3])
        });
        let points: SVector<f64, 15> = derivative(|t| {
            let points = at(t).points_m;
            SVector::from_fn(|i, _| points[i / 3][i % 3])
        });
        let rotations: SVector<f64, { 9 * BODIES }> = derivative(|t| {
            let placements = at(t).placements;
            SVector::from_fn(|i, _| placements[i / 9].rotation[i % 9])
        });
        // A rotor's angle is no coordinate: its placement is the chassis's.
        for i in 0..15 {
            let rate = Matrix3::from_iterator(rotations.iter().copied().skip(9 * i).take(9));
            let spin = rate * now.placements[i].rotation.transpose();
            let expected = twist.fixed_rows::<3>(6 * i).into_owned().cross_matrix();
            worst[0] = worst[0].max((spin - expected).amax());
            let linear = twist.fixed_rows::<3>(6 * i + 3);
            worst[1] = worst[1].max((centres.fixed_rows::<3>(3 * i) - linear).amax());
            fastest = fastest.max(linear.amax());
        }
        for i in 0..5 {
            let velocity = now.contact_jacobians[i] * now.blocks.rates;
            let error = points.fixed_rows::<3>(3 * i) - velocity.fixed_rows::<3>(3);
            worst[2] = worst[2].max(error.amax());
        }
    }
    println!("rad/s, m/s, m/s: {worst:?}; fastest {fastest} m/s");
    assert!(fastest > 1.0);
    assert!(worst.iter().all(|w| *w < 1e-10), "{worst:?}");
}

#[test]
fn twist_rates_follow_from_the_derivative_of_t() {
    let plain = reference();
    let mut draw = Draw::new(52);
    let mut worst = 0.0_f64;
    for _ in 0..STATES {
        let c = draw.case();
        let now = plain.at(&c.state).unwrap();
        let rates =
            derivative(|t| twists(&plain.at(&along(&c.state, &c.acceleration, t)).unwrap()));
        for (i, body) in now.blocks.bodies.iter().enumerate() {
            let expected = body.t * c.acceleration + body.t_dot * c.state.velocity;
            let error = rates.fixed_rows::<6>(6 * i) - expected;
            worst = worst.max(error.amax() / expected.amax().max(1.0));
        }
    }
    println!("{worst:e}");
    assert!(worst < 1e-10, "{worst:e}");
}

#[test]
fn coriolis_forces_do_no_work_beyond_the_change_of_inertia() {
    let plain = reference();
    let mut draw = Draw::new(53);
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for _ in 0..STATES {
        let state = draw.state();
        let nu = state.velocity;
        let rate = derivative(|t| {
            let moved = along(&state, &Velocity::zeros(), t);
            plain.at(&moved).unwrap().blocks.inertia()
        });
        let coriolis = plain.at(&state).unwrap().blocks.coriolis();
        worst = worst.max(nu.dot(&((rate - coriolis * 2.0) * nu)).abs());
        largest = largest.max(nu.dot(&(rate * nu)).abs());
    }
    println!("{worst:e} W of {largest} W");
    assert!(largest > 1.0);
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn inertia_is_symmetric_positive_definite_and_holds_the_energy() {
    let fast = FloatingRobot::new(&rubbing()).unwrap();
    let plain = reference();
    let mut draw = Draw::new(54);
    for _ in 0..STATES {
        let state = draw.state();
        let system = plain.at(&state).unwrap();
        let kin = fast.prepare(&state, &Vector3::zeros()).unwrap();
        for inertia in [system.blocks.inertia(), kin.mass_matrix()] {
            let odd = (inertia - inertia.transpose()).amax() / inertia.amax();
            assert!(odd < 1e-15, "{odd:e}");
            let smallest = inertia.symmetric_eigenvalues().min();
            assert!(smallest > 1e-3, "{smallest}");
            // Body by body: ½ ωᵀ I ω + ½ m ċ².
            let energy: f64 = system
                .blocks
                .bodies
                .iter()
                .map(|b| {
                    let twist = b.t * state.velocity;
                    0.5 * twist.dot(&(b.m * twist))
                })
                .sum();
            let ours = 0.5 * state.velocity.dot(&(inertia * state.velocity));
            assert!(
                (ours - energy).abs() < 1e-12 * energy,
                "{ours} and {energy}"
            );
        }
    }
}

#[test]
fn forward_undoes_inverse() {
    let fast = FloatingRobot::new(&rubbing()).unwrap();
    let plain = reference();
    let mut draw = Draw::new(55);
    let mut worst = 0.0_f64;
    for _ in 0..STATES {
        let c = draw.case();
        let force = fast
            .inverse(&c.state, &c.acceleration, &c.gravity, &c.contacts)
            .unwrap();
        let back = fast
            .forward(&c.state, &force, &c.gravity, &c.contacts)
            .unwrap();
        let system = plain.at(&c.state).unwrap();
        let force = system
            .inverse(&c.acceleration, &c.gravity, &c.contacts)
            .unwrap();
        let slow = system.forward(&force, &c.gravity, &c.contacts).unwrap();
        let scale = c.acceleration.amax();
        worst = worst.max(
            (back - c.acceleration)
                .amax()
                .max((slow - c.acceleration).amax())
                / scale,
        );
    }
    println!("{worst:e}");
    assert!(worst < 1e-12, "{worst:e}");
}

#[test]
fn power_of_all_forces_is_the_change_of_energy() {
    let params = rubbing();
    let fast = FloatingRobot::new(&params).unwrap();
    let plain = reference();
    let mut draw = Draw::new(56);
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for _ in 0..STATES {
        let c = draw.case();
        let nu = c.state.velocity;
        let acceleration = fast
            .forward(&c.state, &c.force, &c.gravity, &c.contacts)
            .unwrap();
        let at = |t: f64| along(&c.state, &acceleration, t);
        // The wrenches on the light feet accelerate strongly: a short step.
        let change: f64 = derivative_over(1e-4, |t| {
            let kin = fast.prepare(&at(t), &c.gravity).unwrap();
            kin.kinetic_energy_j() + kin.potential_energy_j(&c.gravity)
        });
        // Contacts: force on the moving point, moment on the turning body.
        let system = plain.at(&c.state).unwrap();
        let wrenches = c.contacts.all();
        let turning = [6, 12, 13, 14, 0].map(|body: usize| {
            let block = &system.blocks.bodies[body];
            (block.t * nu).fixed_rows::<3>(0).into_owned()
        });
        let mut ground = 0.0;
        for i in 0..5 {
            let velocity: Vector3<f64> = derivative_over(1e-4, |t| {
                fast.prepare(&at(t), &c.gravity).unwrap().points_m()[i]
            });
            ground += wrenches[i].force_n.dot(&velocity) + wrenches[i].moment_n_m.dot(&turning[i]);
        }
        let rubbed: f64 = params
            .viscous()
            .iter()
            .zip(nu.iter())
            .map(|(d, v)| d * v * v)
            .sum();
        let power = nu.dot(&c.force) + ground - rubbed;
        worst = worst.max((change - power).abs());
        largest = largest.max(power.abs());
    }
    println!("{worst:e} W of {largest} W");
    assert!(largest > 100.0);
    assert!(worst < 1e-9 * largest, "{worst:e}");
}

/// Errors after a fall of `seconds` in steps of `step_s`: energy (J), linear momentum against
/// m g t (kg m/s), angular momentum (kg m²/s).
fn fall(
    robot: &FloatingRobot,
    start: &FloatingState,
    gravity: &Vector3<f64>,
    seconds: f64,
    steps: u32,
) -> [f64; 3] {
    let (none, step_s) = (Velocity::zeros(), seconds / f64::from(steps));
    let mut state = *start;
    for _ in 0..steps {
        state = robot
            .step_rk4(&state, &none, gravity, &Contacts::NONE, step_s)
            .unwrap();
    }
    let (before, after) = (
        robot.prepare(start, gravity).unwrap(),
        robot.prepare(&state, gravity).unwrap(),
    );
    let mass = robot.params().robot.total_mass_kg();
    let energy = |k: &wheeleg_plant::dynamics::floating::FloatingKin| {
        k.kinetic_energy_j() + k.potential_energy_j(gravity)
    };
    let (p, q) = (before.momentum(), after.momentum());
    [
        (energy(&after) - energy(&before)).abs(),
        (q.linear_kg_m_s - p.linear_kg_m_s - gravity * (mass * seconds)).norm(),
        (q.angular_kg_m2_s - p.angular_kg_m2_s).norm(),
    ]
}

#[test]
fn free_fall_keeps_energy_and_momentum_to_the_order_of_the_integrator() {
    let robot = FloatingRobot::new(&frictionless()).unwrap();
    let mut draw = Draw::new(57);
    let (mut coarse, mut fine, mut finest) = ([0.0; 3], [0.0; 3], [0.0_f64; 3]);
    for _ in 0..STATES {
        let mut start = draw.state();
        // Gravity across a slope; cylinders that stay within the loop for the whole fall.
        let gravity = draw.vector(10.0);
        for k in 6..12 {
            start.velocity[k] *= 0.4;
        }
        for (sum, steps) in [(&mut coarse, 8), (&mut fine, 16)] {
            let errors = fall(&robot, &start, &gravity, 0.16, steps);
            for (s, e) in sum.iter_mut().zip(errors) {
                *s += e / STATES as f64;
            }
        }
        let errors = fall(&robot, &start, &gravity, 0.16, 320);
        for (s, e) in finest.iter_mut().zip(errors) {
            *s = s.max(e);
        }
    }
    println!("mean at 20 ms {coarse:?}, at 10 ms {fine:?}, worst at 0.5 ms {finest:?}");
    for i in 0..3 {
        // Fourth order: 16; energy gains an order where the error oscillates.
        let ratio = coarse[i] / fine[i];
        assert!((12.0..40.0).contains(&ratio), "{i}: {ratio}");
        assert!(finest[i] < 1e-6, "{i}: {:e}", finest[i]);
    }
}

#[test]
fn a_screw_is_followed_exactly_and_stays_a_rotation() {
    let mut draw = Draw::new(58);
    for _ in 0..STATES {
        let state = draw.state();
        let nu = state.velocity;
        // One step and many agree, and both with the Runge–Kutta path of constant velocity.
        let once = state.advanced(&nu, 0.1);
        let mut often = state;
        for _ in 0..100 {
            often = often.advanced(&nu, 0.001);
        }
        assert!((once.position_m - often.position_m).norm() < 1e-13);
        assert!(once.orientation.angle_to(&often.orientation) < 1e-7);
        assert!((once.orientation.coords.norm() - 1.0).abs() < 1e-15);
        let path = along(&state, &Velocity::zeros(), 1e-3);
        let short = state.advanced(&nu, 1e-3);
        assert!((path.position_m - short.position_m).norm() < 1e-14);
        assert!((path.orientation.coords - short.orientation.coords).norm() < 1e-14);
        assert!((path.lengths_m[1][2] - short.lengths_m[1][2]).abs() < 1e-15);
    }
    // A full turn while moving ahead: a circle.
    let mut state = FloatingState::at_rest([[0.4, 0.1, 0.1]; 2]);
    state.velocity[2] = 1.0;
    state.velocity[3] = 2.0;
    let half_way = state.advanced(&state.velocity, std::f64::consts::PI);
    assert!((half_way.position_m - Vector3::new(0.0, 4.0, 0.0)).norm() < 1e-12);
    let around = half_way.advanced(&state.velocity, std::f64::consts::PI);
    assert!(around.position_m.norm() < 1e-12);
}
