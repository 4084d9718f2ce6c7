//! The mass set in a joint's board is the one that its piston feels.

use wheeleg_config::builtin;
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

#[test]
fn boards_are_told_the_mass_that_their_piston_feels() {
    let file = builtin::robot("wheeleg").expect("built in");
    let plant = FloatingRobot::new(&file.plant.floating()).expect("built in");
    for joint in 0..6 {
        let set = file.node.joints[joint].iter();
        let told = set
            .fold(JointParameters::default(), |all, (id, raw)| {
                all.with(*id, *raw, true).expect("built in")
            })
            .get(JointParam::MovingMass);
        let told_kg = f64::from(told) / 65_536.0;
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
            "joint {}: told {told_kg:.2} kg, felt {least:.2} to {most:.2} kg",
            joint + 1
        );
        assert!(
            told_kg > 0.5 * least && told_kg < 2.5 * most,
            "joint {}: told {told_kg} kg, felt {least} to {most} kg",
            joint + 1
        );
    }
}
