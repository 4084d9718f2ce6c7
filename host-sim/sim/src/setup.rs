//! The configuration of plant and master from a robot and a scenario: the one place where the two files' SI
//! values become the master's units.

use std::f64::consts::TAU;

use wheeleg_master::MasterConfig;
use wheeleg_master::config::{SwitchFrame, WheelDrive};
use wheeleg_master::layer0::odometry::WheelGeometry;
use wheeleg_master::layer1::homing::HomingConfig;
use wheeleg_master::layer1::params::Pattern;
use wheeleg_node::parameters::JointParameters;
use wheeleg_plant::PlantParams;
use wheeleg_units::{PositionMm, VelocityMmS};

use super::board::Board;
use super::clock::NS_PER_US;
use super::operator::side;
use super::world::LEFT_WHEEL;
use crate::SimError;
use wheeleg_config::{LegChoice, Motion, RobotConfig, Scenario};

/// Stroke of b5 with which a walk begins, m: almost as far out as a foothold can be, so that the feet carry
/// as much load as they can.
const WALK_S5_M: f64 = 0.165;
/// Places of a leg's cylinders.
const YAW: usize = 0;
const VERTICAL: usize = 2;

fn millimetres(m: f64) -> PositionMm {
    PositionMm::from_f64(m * 1e3)
}

/// Sums of the joints' parameters, as the file of the robot gives them.
fn sums(robot: &RobotConfig) -> [Option<u32>; 8] {
    let sum = |set: &Vec<(u16, i32)>| {
        let with = |parameters: JointParameters, (id, raw): &(u16, i32)| {
            parameters.with(*id, *raw, true).ok()
        };
        let set = set.iter().try_fold(JointParameters::default(), with);
        set.map(|set| set.sum())
    };
    std::array::from_fn(|i| robot.node.joints.get(i).and_then(sum))
}

/// The plant of the robot, standing on the scenario's ground in the start pose of the gait.
///
/// Powering up in the start pose, chambers at their initial pressures, is the paper's home position; the
/// start-up then arms and settles there. For a walk the robot is set down with both feet far out and the nose
/// at its walking height: with one leg drawn back and the nose up it falls on its tail on steep ground.
pub(super) fn plant(scenario: &Scenario, robot: &RobotConfig) -> PlantParams {
    let gait = &robot.gait;
    let home = [gait.yaw_s2_m, 0.0, gait.stroke_m];
    let held = [gait.yaw_s2_m, gait.held_leg_s5_m, gait.held_leg_s6_m];
    let mut plant = robot.plant.clone();
    let (left, right) = match scenario.motion {
        Motion::Walk(order) => {
            let nose_m = order.nose_mm.get().to_num::<f64>() * 1e-3;
            let feet_out = [gait.yaw_s2_m, WALK_S5_M, gait.stroke_m + nose_m];
            if nose_m < 0.0 {
                // Not at its end stop: no pressure may push it there.
                for leg in [0, 3] {
                    let trapped = &robot.plant.cylinders[leg + YAW];
                    let vertical = &mut plant.cylinders[leg + VERTICAL];
                    vertical.initial_pressure_a_pa = trapped.initial_pressure_a_pa;
                    vertical.initial_pressure_b_pa = trapped.initial_pressure_b_pa;
                }
            }
            (feet_out, feet_out)
        }
        _ if scenario.motion.stepping_leg() == LegChoice::Left => (home, held),
        _ => (held, home),
    };
    plant.initial_stroke_m[..3].copy_from_slice(&left);
    plant.initial_stroke_m[3..].copy_from_slice(&right);
    plant.terrain = scenario.ground.terrain.clone();
    plant
}

/// The master's configuration; [`super::world::World`] adds the sample time of
/// the wheel boards.
pub(super) fn master(scenario: &Scenario, robot: &RobotConfig) -> MasterConfig {
    let cycles = |s: f64| (s / robot.bus.cycle_s).round() as u16;
    let motor = &robot.plant.motors[0];
    let counts = 4.0 * f64::from(motor.encoder_lines) * motor.reduction;
    let circumference_um = robot.plant.body.wheel_radius_m * TAU * 1e6;
    MasterConfig {
        gait: robot
            .gait
            .of_master(Pattern::Single(side(scenario.motion.stepping_leg()))),
        homing: HomingConfig {
            slew_mm_s: VelocityMmS::from_f64(robot.homing.slew_m_s * 1e3),
            tolerance_mm: millimetres(robot.homing.tolerance_m),
            settle_cycles: cycles(robot.homing.settle_s),
            timeout_cycles: cycles(robot.homing.timeout_s),
        },
        wheels: WheelGeometry {
            counts_per_revolution: counts.round() as u32,
            circumference_um: circumference_um.round() as u32,
        },
        // A walk has no end that a profile of the boards could lead to.
        wheel_drive: if robot.gait.stream_wheels || matches!(scenario.motion, Motion::Walk(_)) {
            WheelDrive::Stream
        } else {
            WheelDrive::Profile
        },
        walk: robot.walk_geometry(),
        // The plant's soles name left and right in the robot's frame, on both legs.
        switch_frame: SwitchFrame::Robot,
        behaviours: scenario.behaviours,
        commissioned: robot.commissioned,
        parameters: sums(robot),
        ..MasterConfig::default()
    }
}

/// Sample time of the wheel boards with the robot's parameters, µs: both ends count speeds per
/// sample.
///
/// # Errors
/// [`SimError`] if the board refuses them.
pub(super) fn wheel_sample_us(robot: &RobotConfig) -> Result<u32, SimError> {
    let board = Board::new(LEFT_WHEEL, robot.node.of(LEFT_WHEEL))?;
    Ok((board.application.tick_ns() / NS_PER_US) as u32)
}
