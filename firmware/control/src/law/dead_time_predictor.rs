//! Dead-time predictor: the motion at the end of the dead time, where a pulse that begins now acts.
//!
//! ```text
//! T_d = rest of the period + t_on + t_line
//! F̄   = (F now + F expected) / 2                      expected: with the pulses that are under way
//! v'  = v + (F̄ + load − d v) T_d / m, less what Coulomb friction takes, which turns nothing round
//! x'  = x + (v + v') T_d / 2                           not beyond an end stop
//! ```
//!
//! Control of a plant with dead time by its predicted state (Smith 1957; Manitius and Olbrot 1979). A piston
//! that is stuck, and whose force stays below break-away, is predicted to stand.
//!
//! Config [`AxisModel`]; no state of its own; update [`PredictedState::new`].

use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat};
use crate::observer::Observer;
use crate::observer::motion::after_coulomb;

/// Motion at the end of the dead time.
#[derive(Clone, Copy, Debug)]
pub(super) struct PredictedState {
    /// Raw mm.
    pub(super) stroke: i32,
    /// Raw mm/s.
    pub(super) speed: i32,
}

impl PredictedState {
    /// From what the observer knows now.
    pub(super) fn new(model: &AxisModel, observer: &Observer) -> Self {
        let Observer {
            motion,
            inertia,
            force,
            ..
        } = observer;
        let then = model.pressure_force(observer.expected());
        let drive = then.saturating_add(motion.load);
        let speed = if motion.stuck && drive.saturating_abs() < model.breakaway {
            0
        } else {
            let mean = force.saturating_add(then) >> 1;
            let viscous = mul_shr(motion.speed, model.viscous, 24);
            let sliding = mean.saturating_add(motion.load).saturating_sub(viscous);
            let gained = mul_shr_sat(inertia.acceleration(sliding), model.dead_time, 16);
            let free = motion.speed.saturating_add(gained);
            after_coulomb(free, inertia.coulomb_speed_ahead)
        };
        let mean = motion.speed.saturating_add(speed) >> 1;
        let free = motion
            .stroke
            .saturating_add(mul_shr(mean, model.dead_time, 32));
        Self {
            stroke: free.max(0).min(model.stroke),
            speed,
        }
    }
}
