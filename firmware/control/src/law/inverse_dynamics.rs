//! Inverse dynamics: the force that produces the wanted speed, with friction feed-forward.
//!
//! ```text
//! e    = r + v_r T_r − x'
//! a_b' = max(200 mm/s², min(a_b, 0.7 F_left / m))        F_left = F_in − load   for e > 0, F_out + load otherwise
//! v*   = v_r + curve(e, a_b')                            or the landing, on a first approach to a target that rests
//! a*   = k(e) (v_r − v') + D (v* − v')                   within ± 7/2 a_b; half of it where patience is over and half is enough
//! F*   = m a* + Fc sat(w / 10 mm/s) + d v* + ramp − load   w = v' if |v'| > 10 mm/s, otherwise v*; on a start 10 mm/s sgn v_r
//! ```
//!
//! | | unit | |
//! |---|---|---|
//! | r, v_r | mm, mm/s | reference and its speed |
//! | x', v' | mm, mm/s | motion at the end of the dead time, `dead_time_predictor` |
//! | T_r | s | dead time from this tick: one tick, t_on and the line |
//! | curve, k(e), D, a_b | mm/s, 1/s, 1/s, mm/s² | speed as a function of the error and its slope, damping, deceleration: `switching_curve` |
//! | F_in, F_out | mN | largest force that the supply can deliver, retracting and extending: available for braking |
//! | load, Fc, d, m | mN, mN, mN s/mm, kg | as in [`crate::observer::motion`]; Fb instead of Fc while \|v\| < 3 mm/s and on a start; faded by `standstill` |
//! | sat(u) | 1 | u limited to ±1 |
//! | ramp | mN | towards r: +5 Fb per second while \|v\| < 3 mm/s or stuck, and r rests; −41 % per period above 10 mm/s; at most F_out; unchanged in between, and while the valves are shut |
//!
//! **Start.** A piston that still stands where it rested (`standstill`), while the reference moves faster than 3 mm/s,
//! is given all of its break-away friction in the direction of the reference. In proportion to the wanted speed the
//! force would come only when the piston already lags: it takes a dead time, and at the break-away the reference of an
//! S-curve gains 10 mm/s in 30 ms.
//!
//! Source: computed torque (Craig, Introduction to Robotics, ch. 10) on one axis; friction by Coulomb and viscous
//! coefficients, with break-away friction while the piston stands (Armstrong-Hélouvry et al. 1994). The deceleration
//! that the load leaves, and the ramp, are this project's (decision 38). The friction feed-forward is faded out where
//! the piston does not come to rest, because more than the real friction makes a relay. The ramp is an integral that is
//! forgotten with each target more than one band from the last one, and when another part drives. Halving the
//! acceleration when patience is over (`standstill`) is the usual reduction of the gain against a limit cycle (Slotine
//! and Li, Applied Nonlinear Control, ch. 5): a heavy piston that sticks beside its target yields to a pulse on the
//! spring of its friction, faster than the curve allows, and with the full gain further pulses push it back.
//! `switching_curve` determines whether half is enough.
//!
//! Assumes: the supply as specified. Friction, load and mass are those of the observer. The demanded
//! force is reached at the end of the dead time, as far as the pulses of one period can make it. If the supply falls,
//! F_in and F_out are overestimated, and under a load the piston brakes too late. The force that is missing is made up
//! by the load estimate while the piston moves, and by the ramp while it stands.
//!
//! Config [`AxisModel`] and [`SpeedGains`], state [`BreakawayRamp`], updates [`ForceDemand::ramp`] and
//! [`ForceDemand::force`].

use super::dead_time_predictor::PredictedState;
use super::standstill::Standstill;
use super::switching_curve::SpeedGains;
use crate::ablation::{Part, is_without};
use crate::axis::AxisModel;
use crate::math::{along, clip, mul_shr, mul_shr_sat, within};
use crate::observer::Observer;
use crate::tuning::{
    ACCELERATION_LIMIT_HALVES, BRAKE_FORCE_USED, BRAKE_LEAST, FULL_FRICTION_SPEED, HELD_BREAKAWAYS,
    IMPATIENT_DIVISOR, RAMP_DECAY, REFERENCE_RESTS, SLIDING_SPEED, START_SPEED, STILL_SPEED,
};

/// Extra force on a stuck piston: it grows until the piston slips.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct BreakawayRamp {
    /// mN × 2^8.
    force: i32,
}

impl BreakawayRamp {
    /// Grown to this force, mN.
    #[cfg(test)]
    pub(super) const fn of(force: i32) -> Self {
        Self {
            force: force.wrapping_shl(8),
        }
    }

    /// Whether something holds the piston back: it has stood until the ramp had grown by [`HELD_BREAKAWAYS`].
    pub(super) const fn is_held(self, model: &AxisModel) -> bool {
        self.force.wrapping_abs() >> 8 > model.breakaway.saturating_mul(HELD_BREAKAWAYS)
    }

    /// One period at `speed`, raw mm/s, with `missing` raw mm to a reference of `reference_speed`. A piston slower than
    /// sliding speed only yields on the spring of its friction; that takes nothing off the ramp.
    fn update(&mut self, model: &AxisModel, speed: i32, missing: i32, reference_speed: i32) {
        if speed > SLIDING_SPEED {
            let decay = mul_shr(self.force, RAMP_DECAY, 16);
            self.force = self.force.saturating_sub(decay);
        } else if speed < STILL_SPEED
            && reference_speed.wrapping_abs() <= REFERENCE_RESTS
            && !is_without(Part::BreakawayRamp)
        {
            let step = if missing > 0 {
                model.stick_step
            } else {
                model.stick_step.wrapping_neg()
            };
            let most = model.force_out.min(1 << 22).wrapping_shl(8);
            self.force = within(self.force.saturating_add(step), most);
        }
    }
}

/// The demand, and what it is computed from.
pub(super) struct ForceDemand<'a> {
    /// Raw mm.
    pub(super) reference: i32,
    /// Raw mm/s.
    pub(super) reference_speed: i32,
    /// What the observer knows now.
    pub(super) observer: &'a Observer,
    /// Motion at the end of the dead time.
    pub(super) ahead: PredictedState,
    /// Gains for the mass.
    pub(super) gains: &'a SpeedGains,
}

impl ForceDemand<'_> {
    /// Updates the ramp in a period in which the law acts on the piston.
    pub(super) fn ramp(&self, model: &AxisModel, ramp: &mut BreakawayRamp) {
        let motion = &self.observer.motion;
        let missing = self.reference.saturating_sub(motion.stroke);
        let speed = if motion.stuck {
            0
        } else {
            motion.speed.wrapping_abs()
        };
        ramp.update(model, speed, missing, self.reference_speed);
    }

    /// F*, mN.
    pub(super) fn force(&self, model: &AxisModel, ramp: BreakawayRamp, rest: &Standstill) -> i32 {
        let Self {
            reference,
            reference_speed,
            observer,
            ahead,
            gains,
        } = *self;
        let Observer {
            motion, inertia, ..
        } = observer;
        let load = motion.load;
        let error = reference
            .saturating_add(mul_shr(reference_speed, model.dead_time_reference, 32))
            .saturating_sub(ahead.stroke);
        // The force left for braking, given the load.
        let left = if error > 0 {
            model.force_in.saturating_sub(load)
        } else {
            model.force_out.saturating_add(load)
        };
        let possible = inertia.acceleration(mul_shr(clip::<26>(left), BRAKE_FORCE_USED, 16));
        let brake = gains.brake.min(possible).max(BRAKE_LEAST);
        let (curve, slope) = gains.speed(error, brake, model.top_speed);
        let target_rests = reference_speed.wrapping_abs() <= REFERENCE_RESTS;
        let speed = if target_rests && rest.may_land() {
            gains.landing(model, inertia, (error, brake), curve)
        } else {
            curve
        };
        let wanted = reference_speed.saturating_add(speed);
        // 1/s × 2^8 times raw mm/s makes mm/s² × 2^24.
        let pull = mul_shr_sat(slope, reference_speed.saturating_sub(ahead.speed), 24);
        let damp = mul_shr(gains.damping, wanted.saturating_sub(ahead.speed), 24);
        let limit = gains.brake.saturating_mul(ACCELERATION_LIMIT_HALVES) >> 1;
        let acceleration = within(pull.saturating_add(damp), limit);
        let acceleration =
            if gains.half_is_enough && rest.patience_is_over() && !is_without(Part::EasedGain) {
                acceleration / IMPATIENT_DIVISOR
            } else {
                acceleration
            };

        // While it is not overcome, friction acts against the motion that is wanted, and it is the break-away friction:
        // in proportion to the speed it would be fed forward too late, and the piston would start behind the reference.
        let starts = rest.has_not_left() && reference_speed.wrapping_abs() > START_SPEED;
        let full = rest.faded(if starts || motion.speed.wrapping_abs() < STILL_SPEED {
            model.breakaway
        } else {
            model.coulomb
        });
        let direction = if starts {
            along(FULL_FRICTION_SPEED << 16, reference_speed)
        } else if ahead.speed.wrapping_abs() > SLIDING_SPEED {
            ahead.speed
        } else {
            wanted
        };
        // Proportional to speed up to that of full friction, 10 mm/s.
        let friction = mul_shr(
            within(direction, FULL_FRICTION_SPEED << 16),
            full / FULL_FRICTION_SPEED,
            16,
        )
        .saturating_add(mul_shr(wanted, model.viscous, 24));
        let friction = if is_without(Part::FrictionFeedForward) {
            0
        } else {
            friction
        };
        mul_shr_sat(inertia.mass, acceleration, 16)
            .saturating_add(friction)
            .saturating_add(ramp.force.wrapping_shr(8))
            .saturating_sub(load)
    }
}

#[cfg(test)]
mod tests;
