//! The force that is wanted at the end of the dead time.

use super::STILL;
use super::rest::{REFERENCE_RESTS, Rest};
use crate::axis::gas::Pressures;
use crate::axis::model::AxisModel;
use crate::axis::motion::{Inertia, Motion, rubbed};
use crate::axis::{clip, mix, part, scaled, square_root, within};

/// Fast enough for the sign of friction to be that of the motion (10 mm/s).
const SLIDES: i32 = 10 << 16;

/// Where the piston goes until the end of the dead time of the next period, for the chambers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Course {
    /// Stroke in the middle of the period to the next moment, raw mm.
    pub(super) middle: i32,
    /// Speed there, raw mm/s.
    pub(super) speed: i32,
    /// Stroke at the end of the dead time after it, raw mm.
    pub(super) end: i32,
    /// Speed in that, raw mm/s; 0 if that would end beyond an end stop.
    pub(super) ahead: i32,
    /// Speed now, raw mm/s …
    pub(super) now: i32,
    /// … and the pressure force in the period up to now, mN: for the learner.
    pub(super) force: i32,
}

impl Course {
    /// Standing at `stroke`, raw mm.
    pub(super) const fn at(stroke: i32) -> Self {
        Self {
            middle: stroke,
            speed: 0,
            end: stroke,
            ahead: 0,
            now: 0,
            force: 0,
        }
    }

    /// Adds itself up.
    #[inline]
    pub(super) const fn sum(&self) -> u32 {
        // Taken apart, so that a new field cannot be forgotten here.
        let Self {
            middle,
            speed,
            end,
            ahead,
            now,
            force,
        } = *self;
        let sum = mix(mix(mix(mix(0, middle), speed), end), ahead);
        mix(mix(sum, now), force)
    }

    /// Where the present speed takes the piston: not beyond an end stop, where air would be
    /// squeezed that is not there. The acceleration is not counted on beyond the period: the air
    /// that is squeezed pushes back, the more the shorter a chamber is.
    #[inline]
    pub(super) fn of(model: &AxisModel, motion: &Motion, force: i32) -> Self {
        let speed = motion.speed.saturating_add(motion.gained >> 1);
        let half = part(speed, model.period >> 1, 32);
        let middle = motion.stroke.saturating_add(half);
        let way = half.saturating_add(part(motion.speed, model.horizon, 32));
        let free = middle.saturating_add(way);
        let end = free.max(0).min(model.stroke);
        Self {
            middle,
            speed,
            end,
            ahead: if end == free { motion.speed } else { 0 },
            now: motion.speed,
            force,
        }
    }
}

/// Motion at the end of the dead time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ahead {
    /// Raw mm.
    pub(super) stroke: i32,
    /// Speed, raw mm/s.
    pub(super) speed: i32,
}

impl Ahead {
    /// With the pressure force `force` now and `expected` pressures then; not beyond an end
    /// stop.
    #[inline]
    pub(super) fn new(
        model: &AxisModel,
        inertia: &Inertia,
        motion: &Motion,
        force: i32,
        expected: Pressures,
    ) -> Self {
        let then = model.pressure_force(expected);
        let drive = then.saturating_add(motion.load);
        let speed = if motion.stuck && drive.saturating_abs() < model.breakaway {
            0
        } else {
            // Mean of the forces now and then.
            let mean = force.saturating_add(then) >> 1;
            let viscous = part(motion.speed, model.viscous, 24);
            let sliding = mean.saturating_add(motion.load).saturating_sub(viscous);
            let gained = scaled(inertia.acceleration(sliding), model.horizon, 16);
            rubbed(motion.speed.saturating_add(gained), inertia.rubbed_ahead)
        };
        let mean = motion.speed.saturating_add(speed) >> 1;
        let free = motion.stroke.saturating_add(part(mean, model.horizon, 32));
        Self {
            stroke: free.max(0).min(model.stroke),
            speed,
        }
    }
}

/// Extra force on a piston that sticks: it grows until the piston slips.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Push {
    /// mN × 2^8.
    force: i32,
}

impl Push {
    /// Its sum.
    #[inline]
    pub(super) const fn sum(self) -> u32 {
        mix(0, self.force)
    }

    /// One period at `speed` raw mm/s with `missing` raw mm to a reference of
    /// `reference_speed`. What moves slower than it slides only gives way by the spring
    /// of its friction: that takes nothing back.
    #[inline]
    fn update(&mut self, model: &AxisModel, speed: i32, missing: i32, reference_speed: i32) {
        if speed > SLIDES {
            self.force = self.force.saturating_sub(part(self.force, 27_000, 16));
        } else if speed < STILL && reference_speed.wrapping_abs() <= REFERENCE_RESTS {
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

/// What is asked for, and with what.
pub(super) struct Wish<'a> {
    /// Raw mm.
    pub(super) reference: i32,
    /// Raw mm/s.
    pub(super) reference_speed: i32,
    /// As estimated.
    pub(super) motion: &'a Motion,
    /// At the end of the dead time.
    pub(super) ahead: Ahead,
    /// Mass and what follows from it.
    pub(super) inertia: &'a Inertia,
}

impl Wish<'_> {
    /// One period in which the law acts on the piston.
    #[inline]
    pub(super) fn push(&self, model: &AxisModel, push: &mut Push) {
        let missing = self.reference.saturating_sub(self.motion.stroke);
        let speed = if self.motion.stuck {
            0
        } else {
            self.motion.speed.wrapping_abs()
        };
        push.update(model, speed, missing, self.reference_speed);
    }

    /// F*, mN.
    #[inline]
    pub(super) fn force(&self, model: &AxisModel, push: Push, rest: &Rest) -> i32 {
        let Self {
            reference,
            reference_speed,
            motion,
            ahead,
            inertia,
        } = *self;
        let load = motion.load;
        let error = reference
            .saturating_add(part(reference_speed, model.horizon_reference, 32))
            .saturating_sub(ahead.stroke);
        // The force that can brake, beside the load: seven tenths of it are used.
        let left = if error > 0 {
            model.force_in.saturating_sub(load)
        } else {
            model.force_out.saturating_add(load)
        };
        let possible = inertia.acceleration(part(clip::<26>(left), 45_875, 16));
        let brake = inertia.brake.min(possible).max(200);
        let (speed, slope) = speed_law(error, brake, inertia, model.top_speed);
        let wanted = reference_speed.saturating_add(speed);
        // 1/s × 2^8 times raw mm/s: mm/s² × 2^24.
        let pull = scaled(slope, reference_speed.saturating_sub(ahead.speed), 24);
        let damp = part(inertia.damping, wanted.saturating_sub(ahead.speed), 24);
        let limit = inertia.brake.saturating_mul(5) >> 1;
        let acceleration = within(pull.saturating_add(damp), limit);

        let speed_now = motion.speed.wrapping_abs();
        let grip = rest.faded(if speed_now < STILL {
            model.breakaway
        } else {
            model.coulomb
        });
        let along = if ahead.speed.wrapping_abs() > SLIDES {
            ahead.speed
        } else {
            wanted
        };
        // Full grip from 10 mm/s: × grip / (10 × 2^16).
        let friction = part(within(along, SLIDES), grip / 10, 16);
        scaled(inertia.mass, acceleration, 16)
            .saturating_add(friction)
            .saturating_add(part(wanted, model.viscous, 24))
            .saturating_add(push.force.wrapping_shr(8))
            .saturating_sub(load)
    }
}

/// Speed towards the target, raw mm/s, and its slope over the error, 1/s × 2^8.
#[inline]
fn speed_law(error: i32, brake: i32, inertia: &Inertia, top: i32) -> (i32, i32) {
    // Half of the error up to which the law is a straight line: brake / (2 slope²),
    // mm/s² × s² × 2^32 to raw mm.
    let half = scaled(brake, inertia.linear, 16);
    let size = error.saturating_abs();
    if size <= half.saturating_mul(2) {
        return (scaled(inertia.slope, error, 8), inertia.slope);
    }
    // (32 v)² = 2 brake e × 2^10, e raw: × 2^11 / 2^16.
    let square = i64::from(brake)
        .wrapping_mul(i64::from(size.saturating_sub(half)))
        .wrapping_shr(5);
    let square = u32::try_from(square).unwrap_or(u32::MAX);
    // At most 65 536 / 32 mm/s: fits raw mm/s.
    let root = square_root(square).max(1) as i32;
    let speed = root.wrapping_shl(11);
    if speed >= top {
        return (if error < 0 { top.wrapping_neg() } else { top }, 0);
    }
    let slope = brake.wrapping_shl(13).checked_div(root).unwrap_or(0);
    (
        if error < 0 {
            speed.wrapping_neg()
        } else {
            speed
        },
        slope,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    use wheeleg_units::Micros;

    #[test]
    fn nothing_is_squeezed_beyond_an_end_stop() {
        let model = AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default");
        let course = |stroke_mm: i32, speed_mm_s: i32| {
            let motion = Motion {
                stroke: stroke_mm << 16,
                speed: speed_mm_s << 16,
                ..Motion::default()
            };
            Course::of(&model, &motion, 0)
        };
        assert_eq!(model.stroke, 180 << 16);
        for (stroke, speed, end) in [(1, -400, 0), (179, 400, 180)] {
            let course = course(stroke, speed);
            assert_eq!((course.end, course.ahead), (end << 16, 0));
        }
        let free = course(90, 400);
        let way = f64::from(free.end) / 65_536.0 - 90.0;
        let time_us = model.times.period + model.horizon_us;
        assert!((way - 400e-6 * f64::from(time_us)).abs() < 1e-2, "{way}");
        assert_eq!(free.ahead, 400 << 16);
    }
}
