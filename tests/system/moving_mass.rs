//! The mass set in a joint's board is the one that its piston feels.

use wheeleg_config::{RobotConfig, builtin};
use wheeleg_node::parameters::JointParameters;
use wheeleg_plant::dynamics::floating::state::LEG;
use wheeleg_plant::dynamics::floating::{FloatingRobot, FloatingState, Velocity};
use wheeleg_protocol::param::JointParam;

/// Mass that a piston feels when it moves a freely hanging robot, kg: 1/(M⁻¹)ᵢᵢ.
fn felt_kg(robot: &FloatingRobot, state: &FloatingState, joint: usize) -> f64 {
    let kin = robot
        .prepare(state, &nalgebra::Vector3::zeros())
        .expect("the pose is one");
    let mut force = Velocity::zeros();
    force[LEG + joint] = 1.0;
    let rest = kin.solve(&Velocity::zeros()).expect("solves");
    let pushed = kin.solve(&force).expect("solves");
    1.0 / (pushed[LEG + joint] - rest[LEG + joint])
}

/// What a joint's board is told, kg.
fn told_kg(file: &RobotConfig, joint: usize, parameter: JointParam) -> f64 {
    let set = file.node.joints[joint].iter();
    let all = set.fold(JointParameters::default(), |all, (id, raw)| {
        all.with(*id, *raw, true).expect("built in")
    });
    f64::from(all.get(parameter)) / 65_536.0
}

#[test]
fn boards_are_told_the_mass_that_their_piston_feels() {
    for name in ["wheeleg", "wheeleg-field"] {
        let file = builtin::robot(name).expect("built in");
        let plant = FloatingRobot::new(&file.plant.floating()).expect("built in");
        for joint in 0..6 {
            let told_kg = told_kg(&file, joint, JointParam::MovingMass);
            let mut least = f64::INFINITY;
            let mut most = 0.0_f64;
            for share in [0.05, 0.5, 0.95] {
                let zero = file.plant.body.leg_parameters().stroke_zero_m;
                let leg_m = [zero[0] + 0.09, zero[1] + 0.18 * share, zero[2] + 0.12];
                let state = FloatingState::at_rest([leg_m; 2]);
                let felt = felt_kg(&plant, &state, joint);
                (least, most) = (least.min(felt), most.max(felt));
            }
            println!(
                "{name}, joint {}: told {told_kg:.2} kg, felt {least:.2} to {most:.2} kg",
                joint + 1
            );
            assert!(
                told_kg > 0.9 * least && told_kg < 1.15 * most,
                "{name}, joint {}: told {told_kg} kg, felt {least} to {most} kg",
                joint + 1
            );
        }
    }
}

/// A foot that stands lets its b6 pitch the robot about the axle: all of it if it stands alone, half of it with the other.
#[test]
fn the_boards_of_b6_are_told_the_mass_that_stands_on_them() {
    for name in ["wheeleg", "wheeleg-field"] {
        let file = builtin::robot(name).expect("built in");
        let plant = FloatingRobot::new(&file.plant.floating()).expect("built in");
        let zero = file.plant.body.leg_parameters().stroke_zero_m;
        let leg_m = [zero[0] + 0.09, zero[1] + 0.09, zero[2] + 0.12];
        let state = FloatingState::at_rest([leg_m; 2]);
        let kin = plant
            .prepare(&state, &nalgebra::Vector3::zeros())
            .expect("the pose is one");
        let pitch_kg_m2 = kin.mass_matrix()[(1, 1)];
        let arm_m = file.plant.body.o4_m[0] + leg_m[1];
        let alone_kg = pitch_kg_m2 / (arm_m * arm_m);
        for joint in 0..6 {
            let told_kg = told_kg(&file, joint, JointParam::StandingMass);
            println!(
                "{name}, joint {}: told {told_kg:.2} kg, alone {alone_kg:.2} kg",
                joint + 1
            );
            if joint % 3 == 2 {
                assert!((0.45..0.55).contains(&(told_kg / alone_kg)), "{name}");
            } else {
                assert_eq!(told_kg, 0.0, "{name}: no switch");
            }
        }
    }
}
