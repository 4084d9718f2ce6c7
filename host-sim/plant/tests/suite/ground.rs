//! Uneven ground: soles on ledges, in pits and on level patches.

use wheeleg_plant::contact::{ContactParams, ContactState, FlatGround, GroundHeight};
use wheeleg_plant::dynamics::{FootKin, RobotDynamics};
use wheeleg_plant::ground::{Ground, GroundPatch};
use wheeleg_plant::testing::{ground_contact, wheeleg_2003};
use wheeleg_plant::{Inputs, Plant, PlantError};

const RADIUS_M: f64 = 0.03;
const WIDE_M: f64 = 10.0;

fn patch(x_m: [f64; 2], y_m: [f64; 2], height_m: f64) -> GroundPatch {
    GroundPatch { x_m, y_m, height_m }
}

fn ground(patches: &[GroundPatch]) -> Ground {
    Ground {
        patches: patches.to_vec(),
    }
}

/// A level sole at rest, centre over the origin of x and y.
fn sole(z_m: f64) -> FootKin {
    FootKin {
        position_m: [0.0, 0.0, z_m],
        velocity_m_s: [0.0; 3],
        jacobian: [[0.0; 3]; 5],
        forward: [1.0, 0.0, 0.0],
        left: [0.0, 1.0, 0.0],
    }
}

fn contact() -> ContactParams {
    let params = ground_contact();
    assert_eq!(params.sole_radius_m, RADIUS_M);
    params
}

/// Ledges under one side of a sole at the origin, as `[front, back, left, right]`.
fn ledges(from_m: f64, height_m: f64) -> [GroundPatch; 4] {
    let (ahead, behind) = ([from_m, WIDE_M], [-WIDE_M, -from_m]);
    let all = [-WIDE_M, WIDE_M];
    [
        patch(ahead, all, height_m),
        patch(behind, all, height_m),
        patch(all, ahead, height_m),
        patch(all, behind, height_m),
    ]
}

#[test]
fn a_sole_on_a_ledge_is_carried_and_switched_by_that_side_alone() {
    let contact = contact();
    let directions = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
    for (side, ledge) in ledges(0.015, 0.010).into_iter().enumerate() {
        let ground = ground(&[ledge]);
        let foot = sole(0.008);
        let support = ground.support(&foot, RADIUS_M);
        let force = contact.force(&ContactState::default(), &foot, &support);
        // A fifth of the sole, 2 mm deep.
        let expected = contact.stiffness_n_m / 5.0 * 0.002;
        assert!((force.normal_n - expected).abs() < 1e-9, "{force:?}");
        for (offset, direction) in support.offset_m.iter().zip(directions[side]) {
            assert!((offset - RADIUS_M * direction).abs() < 1e-12);
        }
        let mut closed = [false; 4];
        closed[side] = true;
        assert_eq!(contact.switches(&foot, &ground).to_array(), closed);
        assert!((ground.clearance_m(&foot, RADIUS_M) + 0.002).abs() < 1e-12);

        let above = sole(0.0101);
        let support = ground.support(&above, RADIUS_M);
        let force = contact.force(&ContactState::default(), &above, &support);
        assert_eq!(force.normal_n, 0.0);
        assert_eq!(contact.switches(&above, &ground).to_array(), [false; 4]);
        assert!((ground.clearance_m(&above, RADIUS_M) - 0.0001).abs() < 1e-12);
    }
}

#[test]
fn a_ledge_just_beyond_the_rim_carries_nothing() {
    for ledge in ledges(RADIUS_M + 1e-4, 0.010) {
        let foot = sole(0.005);
        let support = ground(&[ledge]).support(&foot, RADIUS_M);
        let force = contact().force(&ContactState::default(), &foot, &support);
        assert_eq!(force.normal_n, 0.0);
    }
}

#[test]
fn a_ledge_under_the_centre_takes_four_fifths() {
    // Front, centre, left and right on the ledge, the back over nothing.
    let ledge = ledges(-0.015, 0.010)[0];
    let foot = sole(0.009);
    let support = ground(&[ledge]).support(&foot, RADIUS_M);
    let contact = contact();
    let force = contact.force(&ContactState::default(), &foot, &support);
    let expected = contact.stiffness_n_m * 0.001 * 4.0 / 5.0;
    assert!((force.normal_n - expected).abs() < 1e-9, "{force:?}");
    assert!((support.offset_m[0] - RADIUS_M / 4.0).abs() < 1e-12);
    assert_eq!(support.offset_m[1], 0.0);
}

#[test]
fn a_sole_deep_on_both_sides_of_a_low_step_feels_the_mean_height() {
    let ledge = ledges(0.015, 0.0005)[0];
    let foot = sole(-0.001);
    let support = ground(&[ledge]).support(&foot, RADIUS_M);
    let mean = 0.001 + 0.0005 / 5.0;
    assert!((support.surface.height_m - foot.position_m[2] - mean).abs() < 1e-12);
}

#[test]
fn overlapping_patches_count_by_the_highest_and_pits_lie_below_zero() {
    let all = [-1.0, 1.0];
    let ground = ground(&[
        patch(all, all, -0.05),
        patch([0.0, 0.5], all, -0.02),
        patch([0.2, 0.3], all, 0.01),
    ]);
    for (x, height) in [
        (-0.5, -0.05),
        (0.1, -0.02),
        (0.25, 0.01),
        (0.6, -0.05),
        (1.5, 0.0),
    ] {
        assert_eq!(ground.height_m(x, 0.0), height, "at {x}");
        assert_eq!(ground.at(x, 0.0).normal, [0.0, 0.0, 1.0]);
    }
    assert_eq!(ground.height_m(0.25, 1.1), 0.0);
}

#[test]
fn ground_without_patches_is_flat_ground() {
    let contact = contact();
    let mut foot = sole(-0.0007);
    foot.velocity_m_s = [0.01, -0.02, -0.1];
    let state = ContactState {
        bristle_m: [1e-4, -2e-4],
    };
    let support = Ground::default().support(&foot, RADIUS_M);
    assert_eq!(
        contact.force(&state, &foot, &support),
        contact.force(&state, &foot, &FlatGround)
    );
    assert_eq!(support.offset_m, [0.0; 2]);
}

#[test]
fn patches_out_of_reach_change_no_bit_of_the_motion() {
    let flat = wheeleg_2003();
    let mut far = flat.clone();
    far.ground = ground(&[patch([2.0, 3.0], [-1.0, 1.0], 0.05)]);
    let hash = |params| {
        let plant = Plant::new(params).unwrap();
        let mut state = plant.initial_state(1).unwrap();
        let mut inputs = Inputs::default();
        inputs.valve_on_us[2] = [0, 1000, 1000, 0];
        for _ in 0..300 {
            plant.tick(&mut state, &inputs).unwrap();
        }
        plant.state_hash(&state)
    };
    assert_eq!(hash(&flat), hash(&far));
}

/// A force at the centre of pressure does the work of that point of the sole.
#[test]
fn the_moved_jacobian_is_the_derivative_of_the_centre_of_pressure() {
    let dynamics = RobotDynamics::new(&wheeleg_2003().body).unwrap();
    // Off every symmetry: pitched, yawed, legs apart.
    let q = [0.3, 0.04, 0.385, 0.12, 0.17, 0.42, 0.07, 0.15];
    let at = |q: &[f64; 8]| dynamics.prepare(q, &[0.0; 8]).unwrap().feet;
    for leg in 0..2 {
        let foot = at(&q)[leg];
        let [x, y, z] = foot.position_m;
        // Ledges ahead and to the left, of different heights.
        let ledges = ground(&[
            patch([x + 0.015, WIDE_M], [y - 0.02, y + 0.02], z + 0.004),
            patch([x - 0.02, x + 0.02], [y + 0.015, WIDE_M], z + 0.001),
        ]);
        let support = ledges.support(&foot, RADIUS_M);
        let [ahead, aside] = support.offset_m;
        assert!(ahead > 0.01 && aside > 0.002, "{support:?}");
        let point = |foot: &FootKin| -> [f64; 3] {
            std::array::from_fn(|k| {
                foot.position_m[k] + ahead * foot.forward[k] + aside * foot.left[k]
            })
        };
        let loaded = support.loaded(&foot, q[3 + 3 * leg]);
        for (column, coordinate) in [0, 1, 2 + 3 * leg, 3 + 3 * leg, 4 + 3 * leg]
            .into_iter()
            .enumerate()
        {
            let h = 1e-6;
            let (mut plus, mut minus) = (q, q);
            plus[coordinate] += h;
            minus[coordinate] -= h;
            let (a, b) = (point(&at(&minus)[leg]), point(&at(&plus)[leg]));
            for k in 0..3 {
                let slope = (b[k] - a[k]) / (2.0 * h);
                let exact = loaded.jacobian[column][k];
                assert!(
                    (slope - exact).abs() < 1e-7,
                    "leg {leg}, column {column}, axis {k}: {slope} {exact}"
                );
            }
        }
    }
}

#[test]
fn the_robot_stands_with_one_foot_half_on_a_ledge() {
    let mut params = wheeleg_2003();
    // The left sole stands at x = 0.61, y = 0.2: its front is over the ledge, its centre not.
    params.ground = ground(&[patch([0.625, 0.70], [0.1, 0.3], 0.012)]);
    let plant = Plant::new(&params).unwrap();
    let mut state = plant.initial_state(1).unwrap();
    for _ in 0..300 {
        plant.tick(&mut state, &Inputs::default()).unwrap();
    }
    let o = plant.outputs(&state);
    // Front only; the other foot hangs: the robot does not roll.
    assert_eq!(o.foot_switches, [[true, false, false, false], [false; 4]]);
    let depth = -o.foot_clearance_m[0];
    let expected = params.contact.stiffness_n_m / 5.0 * depth;
    assert!(
        (o.foot_normal_n[0] - expected).abs() < 0.02 * expected,
        "{} {expected}",
        o.foot_normal_n[0]
    );
    // It carries the moment about the axle on the lever of the sole's front, not its centre.
    let dynamics = &plant.assembly.mechanics.dynamics;
    let motion = &state.core.motion;
    let kin = dynamics.prepare(&motion.position, &[0.0; 8]).unwrap();
    let lever = o.sole_m[0][0] - o.travel_m + RADIUS_M;
    let weight = dynamics.params().total_mass_kg() * 9.81;
    let moment = weight * (kin.com_m()[0] - o.travel_m);
    assert!(
        (o.foot_normal_n[0] * lever / moment - 1.0).abs() < 0.01,
        "{} N on {lever} m for {moment} N m",
        o.foot_normal_n[0]
    );
    assert!((o.foot_clearance_m[1] - o.sole_m[1][2]).abs() < 0.001);
}

#[test]
fn impossible_patches_are_refused_by_name() {
    let all = [0.0, 1.0];
    for (bad, field) in [
        (patch([1.0, 0.0], all, 0.0), "ground.patches.x_m[1]"),
        (patch(all, [1.0, 0.0], 0.0), "ground.patches.y_m[1]"),
        (patch([f64::NAN, 1.0], all, 0.0), "ground.patches.x_m[0]"),
        (patch(all, all, 0.6), "ground.patches.height_m"),
        (patch(all, all, f64::NAN), "ground.patches.height_m"),
    ] {
        let mut params = wheeleg_2003();
        params.ground = ground(&[bad]);
        match Plant::new(&params) {
            Err(PlantError::Parameter { name, .. }) => assert_eq!(name, field),
            other => panic!("{field}: {other:?}"),
        }
    }
}
