//! Where the piston goes until the end of the dead time, for the chambers.
//!
//! ```text
//! middle = x + (v + Δv/2) T/2                  in the period to the next moment
//! end    = middle + (v + Δv/2) T/2 + v T_d     where the pulses of the next period act
//! ```
//!
//! x: stroke, mm; v: speed, mm/s, both at the moment; Δv: speed gained in the last period; T: period, T_d: dead time,
//! s. Source: this project, decision 7; a truncated Taylor series of the motion.
//!
//! If the end would be beyond an end stop, it is the stop, and the speed in the dead time is taken as 0.
//!
//! Assumes: the acceleration of the last period for one more, and constant speed after that. The acceleration is not
//! extrapolated further, because the compressed air pushes back, the more the shorter a chamber is. The supply is not
//! used.
//!
//! Config [`AxisModel`]; computed in each period ([`PeriodTrajectory::of`]) from the corrected motion, and used in the
//! next.

use super::motion::Motion;
use crate::axis::AxisModel;
use crate::math::mul_shr;

/// Where the piston goes in the next period and the dead time after it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct PeriodTrajectory {
    /// Stroke in the middle of the period to the next moment, raw mm.
    pub(crate) middle: i32,
    /// Speed there, raw mm/s.
    pub(crate) speed: i32,
    /// Stroke at the end of the dead time after it, raw mm.
    pub(crate) end: i32,
    /// Speed during that dead time, raw mm/s; 0 if it would end beyond an end stop.
    pub(crate) ahead: i32,
}

impl PeriodTrajectory {
    /// Standing at `stroke`, raw mm.
    pub(crate) const fn at(stroke: i32) -> Self {
        Self {
            middle: stroke,
            speed: 0,
            end: stroke,
            ahead: 0,
        }
    }

    /// Where the present speed takes the piston, but not beyond an end stop, where there is no air to be compressed.
    pub(crate) fn of(model: &AxisModel, motion: &Motion) -> Self {
        let speed = motion.speed.saturating_add(motion.gained >> 1);
        let half = mul_shr(speed, model.period >> 1, 32);
        let middle = motion.stroke.saturating_add(half);
        let rest = half.saturating_add(mul_shr(motion.speed, model.dead_time, 32));
        let free = middle.saturating_add(rest);
        let end = free.max(0).min(model.stroke);
        Self {
            middle,
            speed,
            end,
            ahead: if end == free { motion.speed } else { 0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    use wheeleg_units::Micros;

    #[test]
    fn nothing_is_squeezed_beyond_an_end_stop() {
        let model = AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default");
        let trajectory = |stroke_mm: i32, speed_mm_s: i32| {
            let motion = Motion {
                stroke: stroke_mm << 16,
                speed: speed_mm_s << 16,
                ..Motion::default()
            };
            PeriodTrajectory::of(&model, &motion)
        };
        assert_eq!(model.stroke, 180 << 16);
        for (stroke, speed, end) in [(1, -400, 0), (179, 400, 180)] {
            let trajectory = trajectory(stroke, speed);
            assert_eq!((trajectory.end, trajectory.ahead), (end << 16, 0));
        }
        let free = trajectory(90, 400);
        let distance = f64::from(free.end) / 65_536.0 - 90.0;
        let time_us = model.times.period + model.dead_time_us;
        assert!(
            (distance - 400e-6 * f64::from(time_us)).abs() < 1e-2,
            "{distance}"
        );
        assert_eq!(free.ahead, 400 << 16);
    }
}
