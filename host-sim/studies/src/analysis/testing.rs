//! Recordings made from the reference model, to test the analysis against
//! known answers. Never used by the program.

use super::ReferenceModel;
use wheeleg_config::RobotConfig;
use wheeleg_telemetry::{FootSample, JointSample, MasterSample, Recorder, Recording, WheelSample};

/// Ten seconds of gait of a left leg that follows the reference model exactly, but `delay_s` late, starting
/// at `start_s`.
pub(crate) fn from_reference(robot: &RobotConfig, delay_s: f64, start_s: f64) -> Recording {
    let model = ReferenceModel::new(robot.reference, robot.gait);
    let mut recorder = Recorder::in_memory();
    record_reference(&mut recorder, robot, &model, delay_s, start_s);
    recorder.finish().expect("no file, no error")
}

/// The same into any recorder.
pub(crate) fn record_reference(
    recorder: &mut Recorder,
    robot: &RobotConfig,
    model: &ReferenceModel,
    delay_s: f64,
    start_s: f64,
) {
    let gait = &robot.gait;
    let total_ms = ((start_s + f64::from(gait.steps) * gait.period_s) * 1e3).ceil() as u64;
    for ms in 0..total_ms {
        let t_ns = ms * 1_000_000;
        let t_s = ms as f64 * 1e-3 - start_s;
        let p = model.at(t_s - delay_s);
        let u = t_s.max(0.0) % gait.period_s;
        let started = t_s >= 0.0;
        let stroke_mm = gait.stroke_m * 1e3;
        let lifted = started && (gait.lift_s..gait.lower_s).contains(&u);
        let reached = started && (gait.reach_s..gait.push_s).contains(&u);
        // A reference that is still at zero in the push: the model has no node.
        let b5_mm = if reached { stroke_mm } else { p.s5_m * 1e3 };
        let b6_mm = if lifted { 0.0 } else { stroke_mm };
        let b5 = JointSample {
            commanded_mm: b5_mm,
            reference_mm: b5_mm,
            sensed_mm: p.s5_m * 1e3,
            position_mm: p.s5_m * 1e3,
            velocity_mm_s: p.v5_m_s * 1e3,
            acceleration_raw_m_s2: p.a5_m_s2,
            mode: 3,
            ..JointSample::default()
        };
        let b6 = JointSample {
            commanded_mm: b6_mm,
            reference_mm: b6_mm,
            sensed_mm: p.s6_m * 1e3,
            position_mm: p.s6_m * 1e3,
            velocity_mm_s: p.v6_m_s * 1e3,
            acceleration_raw_m_s2: p.a6_m_s2,
            force_net_raw_n: p.f6_n,
            force_pressure_n: p.f6_n,
            mode: 3,
            ..JointSample::default()
        };
        let held = JointSample {
            commanded_mm: 90.0,
            reference_mm: 90.0,
            sensed_mm: 90.0,
            position_mm: 90.0,
            mode: 3,
            ..JointSample::default()
        };
        for joint in 0..6 {
            let sample = match joint {
                1 => b5.clone(),
                2 => b6.clone(),
                _ => held.clone(),
            };
            recorder.joint(t_ns, joint, sample);
        }
        for wheel in 0..2 {
            recorder.wheel(t_ns, wheel, WheelSample::default());
        }
        let down = FootSample {
            normal_force_n: p.load_n,
            switches: if p.load_n > 0.0 { 15 } else { 0 },
            ..FootSample::default()
        };
        recorder.foot(t_ns, 0, down);
        if ms % 10 == 0 {
            let step = if started {
                1 + (t_s / gait.period_s) as u32
            } else {
                0
            };
            let master = MasterSample {
                alive: true,
                step,
                ..MasterSample::default()
            };
            recorder.master(t_ns, master);
        }
    }
}
