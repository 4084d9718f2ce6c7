//! The square-wave gait of a robot file.

use fixed::types::I16F16;
use wheeleg_master::argument;
use wheeleg_master::layer1::params::{GaitParams as MasterGait, Pattern};
use wheeleg_units::{PositionMm, VelocityMmS};

use super::command::bounds;
use super::params::params;

// The gait has the master's ranges, SI.
const STEPS: [f64; 2] = bounds(&argument::STEPS);
const PERIOD: [f64; 2] = bounds(&argument::PERIOD);
const INSTANT: [f64; 2] = bounds(&argument::PUSH);
const STEP_STROKE: [f64; 2] = bounds(&argument::STEP_STROKE);
const STROKE: [f64; 2] = bounds(&argument::HELD_LEG_S5);
const PUSH_SPEED: [f64; 2] = bounds(&argument::PUSH_SPEED);
const PUSH_ACCELERATION: [f64; 2] = bounds(&argument::PUSH_ACCELERATION);
const TOUCHDOWN_SPEED: [f64; 2] = bounds(&argument::TOUCHDOWN_SPEED);

params! {
    /// Square-wave gait (paper Figs. 9, 12–16). Times count from the start of a step.
    GaitParams {
        /// Number of steps.
        steps: u16, "steps", Count, STEPS[0], STEPS[1];
        /// Duration of one step.
        period_s: f64, "period", Time, PERIOD[0], PERIOD[1];
        /// Start of the lift: the reference of b6 jumps to 0.
        lift_s: f64, "lift", Time, INSTANT[0], INSTANT[1];
        /// Start of the reach: the reference of b5 jumps to the full stroke.
        reach_s: f64, "reach", Time, INSTANT[0], INSTANT[1];
        /// Start of the lowering: the reference of b6 jumps to the full stroke.
        lower_s: f64, "lower", Time, INSTANT[0], INSTANT[1];
        /// Start of the push: the wheels drive, b5 gives way.
        push_s: f64, "push", Time, INSTANT[0], INSTANT[1];
        /// Stroke of b5 and b6 used by a step.
        stroke_m: f64, "stroke", Length, STEP_STROKE[0], STEP_STROKE[1];
        /// Stroke of b5 at which the held leg stands.
        held_leg_s5_m: f64, "held_leg_s5", Length, STROKE[0], STROKE[1];
        /// Stroke of b6 at which the held leg stands.
        held_leg_s6_m: f64, "held_leg_s6", Length, STROKE[0], STROKE[1];
        /// Stroke of both yaw cylinders; half is straight ahead.
        yaw_s2_m: f64, "yaw_s2", Length, STROKE[0], STROKE[1];
        /// Speed of the push.
        push_speed_m_s: f64, "push_speed", Velocity, PUSH_SPEED[0], PUSH_SPEED[1];
        /// Acceleration of the push.
        push_acceleration_m_s2: f64, "push_acceleration", Acceleration, PUSH_ACCELERATION[0], PUSH_ACCELERATION[1];
        /// Speed at which a foot is lowered from 15 mm above where it last stood; 0: the reference jumps.
        touchdown_speed_m_s: f64, "touchdown_speed", Velocity, TOUCHDOWN_SPEED[0], TOUCHDOWN_SPEED[1];
        /// Stop the lowering of a foot where its switches close.
        touchdown_reflex: bool, "touchdown_reflex", Flag, 0.0, 1.0;
        /// The master leads the wheels in every cycle, as a walk needs; otherwise their boards make profiles of their own.
        stream_wheels: bool, "stream_wheels", Flag, 0.0, 1.0;
    }
}

impl GaitParams {
    /// The same in the master's units.
    #[must_use]
    pub fn of_master(&self, pattern: Pattern) -> MasterGait {
        let millimetres = |m: f64| PositionMm::from_f64(m * 1e3);
        let microseconds = |s: f64| (s * 1e6).round() as u32;
        MasterGait {
            steps: self.steps,
            period_us: microseconds(self.period_s),
            lift_us: microseconds(self.lift_s),
            reach_us: microseconds(self.reach_s),
            lower_us: microseconds(self.lower_s),
            push_us: microseconds(self.push_s),
            stroke_mm: millimetres(self.stroke_m),
            held_leg_s5_mm: millimetres(self.held_leg_s5_m),
            held_leg_s6_mm: millimetres(self.held_leg_s6_m),
            yaw_s2_mm: millimetres(self.yaw_s2_m),
            push_speed_mm_s: VelocityMmS::from_f64(self.push_speed_m_s * 1e3),
            push_acceleration_mm_s2: I16F16::from_num(self.push_acceleration_m_s2 * 1e3),
            pattern,
            touchdown_speed_mm_s: VelocityMmS::from_f64(self.touchdown_speed_m_s * 1e3),
            touchdown_reflex: self.touchdown_reflex,
        }
    }
}
