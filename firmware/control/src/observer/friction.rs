//! Friction estimator: friction as a share of that specified, from sliding to and fro at one target.
//!
//! ```text
//! R     = F − m (v − v before) / T              in each period of sliding: ±friction − load
//! Q     = Fc + d |v|                            friction as specified
//! R±, Q±                                        fading means of about 16 such periods, out (+) and back (−)
//! share = (R₊ − R₋) / (Q₊ + Q₋)                 within 1/2 and 2
//! ```
//!
//! | | unit | |
//! |---|---|---|
//! | F | mN | pressure force, mean of the period; positive extends |
//! | m | kg | mass in use |
//! | v, v before | mm/s | speed at the moments that end and begin the period |
//! | T | s | the period |
//! | Fc, d | mN, mN s/mm | Coulomb and viscous friction, as specified |
//!
//! The mean force is friction less load one way, and friction and load the other way: half the difference is friction.
//! A load, and an error of the pressures, drop out as far as they stay the same. So both means begin anew with each
//! target, whenever the pressures are corrected, and while another part drives. At one target both directions usually
//! follow each other within tenths of a second: the piston hunts or has overshot. These pistons need it most: more than
//! the real friction fed forward makes a relay, and less leaves the piston standing. The share is kept from target to
//! target; break-away friction has the same share. Source: difference of the forces for motion in both directions
//! (Armstrong-Hélouvry, Control of Machines with Friction, 1991, ch. 3), with Newton's second law for a piston that
//! accelerates.
//!
//! A period counts as sliding if the piston is faster than 10 mm/s at both of its moments, in one direction, and more
//! than 6 mm from its ends (no cushion). It counts only while both widths of the bounds of the pressures, as forces,
//! are together within a tenth of the largest extending force: air that is not known would appear as friction.
//!
//! Assumes: a load that does not change while the piston hunts; axes for which it does switch learning off
//! ([`crate::axis::AxisData::learns_mass`]). Coulomb, viscous and break-away friction that differ from the specified
//! ones by the same factor; friction that is specified as 0 is not learnt. The mass in use: its error counts with the
//! acceleration. If the supply falls, a chamber that is filled appears as friction of one direction, and counts half.
//!
//! Config [`AxisModel`] and [`Inertia`], state [`FrictionEstimator`], update [`FrictionEstimator::update`].

use super::motion::{Inertia, Motion};
use crate::axis::AxisModel;
use crate::math::{mul_shr, mul_shr_sat};
use crate::tuning::{
    CUSHION, FRICTION_AIR, FRICTION_LEAST, FRICTION_MOST, FRICTION_PERIODS, FRICTION_PERIODS_MIN,
    SLIDING_SPEED,
};

/// All of the friction specified, × 2^16.
const ONE: i32 = 1 << 16;

/// Means over the last periods of sliding in one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
struct Sliding {
    /// R, mN.
    force: i32,
    /// Q, mN.
    specified: i32,
    /// How many periods, up to [`FRICTION_PERIODS`].
    periods: i32,
}

impl Sliding {
    fn add(&mut self, force: i32, specified: i32) {
        self.periods = self.periods.saturating_add(1).min(FRICTION_PERIODS);
        let share = |difference: i32| difference.checked_div(self.periods).unwrap_or(0);
        let toward = |mean: i32, value: i32| mean.saturating_add(share(value.saturating_sub(mean)));
        self.force = toward(self.force, force);
        self.specified = toward(self.specified, specified);
    }
}

/// Sliding at the present target, and what has been learnt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct FrictionEstimator {
    extending: Sliding,
    retracting: Sliding,
    share: i32,
}

impl Default for FrictionEstimator {
    /// Friction as specified.
    fn default() -> Self {
        Self {
            extending: Sliding::default(),
            retracting: Sliding::default(),
            share: ONE,
        }
    }
}

impl FrictionEstimator {
    /// Friction over that specified, × 2^16.
    pub(crate) const fn share(&self) -> i32 {
        self.share
    }

    /// Friction learnt before a test.
    #[cfg(test)]
    pub(crate) fn of(share: i32) -> Self {
        let sliding = Sliding {
            periods: FRICTION_PERIODS,
            ..Sliding::default()
        };
        Self {
            extending: sliding,
            retracting: sliding,
            share,
        }
    }

    /// Flips a bit of the share, for the test of the hash.
    #[cfg(test)]
    pub(crate) fn flip(&mut self, bit: u32) {
        self.share ^= 1 << bit;
    }

    /// Forgets the sliding so far; what has been learnt stays.
    pub(crate) fn forget(&mut self) {
        self.extending = Sliding::default();
        self.retracting = Sliding::default();
    }

    /// One period, after which the piston moves as in `motion`, and before which its speed was `before` (raw mm/s),
    /// with the mean pressure force `force` and with the `widths` of the bounds of both pressures as forces, mN.
    /// `specified` is the model with the friction of the axis data. Returns whether the share has changed.
    pub(crate) fn update(
        &mut self,
        specified: &AxisModel,
        inertia: &Inertia,
        motion: &Motion,
        before: i32,
        force: i32,
        [width_a, width_b]: [i32; 2],
    ) -> bool {
        let speed = motion.speed;
        let slides = speed.wrapping_abs().min(before.wrapping_abs()) > SLIDING_SPEED
            && (speed ^ before) >= 0;
        let free =
            motion.stroke > CUSHION && motion.stroke < specified.stroke.saturating_sub(CUSHION);
        let known =
            width_a.saturating_add(width_b) <= mul_shr(specified.force_out, FRICTION_AIR, 16);
        if !slides || !free || !known {
            return false;
        }
        // kg × 2^16 times mm/s × 2^16 over s × 2^32: mN.
        let impulse = i64::from(inertia.mass).wrapping_mul(i64::from(speed.saturating_sub(before)));
        let inertial = impulse
            .checked_div(i64::from(specified.period))
            .unwrap_or(0)
            .clamp(-(1 << 30), 1 << 30) as i32;
        let resistance =
            specified
                .coulomb
                .saturating_add(mul_shr(speed.wrapping_abs(), specified.viscous, 24));
        let direction = if speed > 0 {
            &mut self.extending
        } else {
            &mut self.retracting
        };
        direction.add(force.saturating_sub(inertial), resistance);
        self.learn()
    }

    /// The share, if both directions tell it.
    fn learn(&mut self) -> bool {
        let [out, back] = [self.extending, self.retracting];
        if out.periods.min(back.periods) < FRICTION_PERIODS_MIN {
            return false;
        }
        let found = i64::from(out.force.saturating_sub(back.force))
            .wrapping_shl(16)
            .checked_div(i64::from(out.specified.saturating_add(back.specified)))
            .unwrap_or(i64::from(ONE));
        let share = found.clamp(i64::from(FRICTION_LEAST), i64::from(FRICTION_MOST)) as i32;
        core::mem::replace(&mut self.share, share) != share
    }
}

impl AxisModel {
    /// The same axis with this share (× 2^16, at most 2) of its friction.
    pub(crate) fn with_friction(&self, share: i32) -> Self {
        let of = |value: i32| mul_shr_sat(value, share, 16);
        Self {
            coulomb: of(self.coulomb),
            breakaway: of(self.breakaway),
            viscous: of(self.viscous),
            stick_step: of(self.stick_step),
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisData;
    use wheeleg_units::Micros;

    fn model() -> AxisModel {
        AxisModel::new(&AxisData::default(), Micros(1000)).expect("the default")
    }

    /// A piston that slides to and fro in mid stroke.
    struct Hunting {
        model: AxisModel,
        estimator: FrictionEstimator,
        mass_kg: f64,
        /// Friction over that specified.
        friction: f64,
        /// Load, and what the estimated pressures have wrong.
        load_n: f64,
        wrong_n: f64,
        stroke_mm: i32,
        /// Widths of both bounds over the largest extending force.
        width: f64,
    }

    impl Default for Hunting {
        fn default() -> Self {
            Self {
                model: model(),
                estimator: FrictionEstimator::default(),
                mass_kg: 2.0,
                friction: 0.8,
                load_n: 30.0,
                wrong_n: -20.0,
                stroke_mm: 90,
                width: 0.09,
            }
        }
    }

    impl Hunting {
        /// So many periods that begin and end at 20 mm/s or more in this direction. Returns how many changed the share.
        fn slides(&mut self, periods: i32, sign: f64) -> usize {
            self.slides_at(periods, sign, 20.0)
        }

        fn slides_at(&mut self, periods: i32, sign: f64, least_mm_s: f64) -> usize {
            let model = &self.model;
            let inertia = Inertia::new(model, (self.mass_kg * 65_536.0) as i32);
            let raw = |mm: f64| (mm * 65_536.0) as i32;
            let friction_n = |speed: f64| {
                let (coulomb, viscous) = (f64::from(model.coulomb), f64::from(model.viscous));
                self.friction * 1e-3 * (coulomb + viscous / 256.0 * speed.abs())
            };
            let width = (self.width * f64::from(model.force_out) / 2.0) as i32;
            let mut taught = 0;
            for period in 0..periods {
                // Accelerates and brakes by turns.
                let speeds =
                    [0, 1].map(|k| sign * (least_mm_s + 4.0 * f64::from((period + k) % 2)));
                let [before, now] = speeds;
                let inertial_n = self.mass_kg * (now - before) * 1e-3 / 4e-3;
                let force_n = inertial_n + sign * friction_n(now) - self.load_n + self.wrong_n;
                let motion = Motion {
                    stroke: self.stroke_mm << 16,
                    speed: raw(now),
                    ..Motion::default()
                };
                taught += usize::from(self.estimator.update(
                    model,
                    &inertia,
                    &motion,
                    raw(before),
                    (force_n * 1e3) as i32,
                    [width; 2],
                ));
            }
            taught
        }

        fn share(&self) -> f64 {
            f64::from(self.estimator.share()) / 65_536.0
        }
    }

    /// Under a load, with wrong pressures, at any mass.
    #[test]
    fn friction_is_learnt_from_sliding_to_and_fro() {
        for friction in [0.55, 0.8, 1.0, 1.9] {
            for (load_n, wrong_n) in [(0.0, 0.0), (60.0, 0.0), (-60.0, 15.0)] {
                for mass_kg in [0.3, 2.0, 9.0] {
                    let mut hunting = Hunting {
                        friction,
                        load_n,
                        wrong_n,
                        mass_kg,
                        ..Hunting::default()
                    };
                    // An odd number: the last one is not evened out by the one before.
                    hunting.slides(9, 1.0);
                    hunting.slides(9, -1.0);
                    let found = hunting.share();
                    assert!((found / friction - 1.0).abs() < 0.02, "{friction}: {found}");
                }
            }
        }
    }

    #[test]
    fn four_periods_each_way_tell_the_friction() {
        for (out, back, tells) in [(4, 4, true), (3, 40, false), (40, 3, false), (40, 0, false)] {
            let mut hunting = Hunting::default();
            hunting.slides(out, 1.0);
            assert_eq!(hunting.slides(back, -1.0) > 0, tells, "{out} {back}");
        }
    }

    /// Of a change of friction 1/e is still missing after 16 periods each way, and nothing in the end.
    #[test]
    fn a_mean_forgets_after_sixteen_periods() {
        let mut hunting = Hunting {
            friction: 0.7,
            ..Hunting::default()
        };
        for sign in [1.0, -1.0] {
            hunting.slides(40, sign);
        }
        hunting.friction = 1.4;
        for sign in [1.0, -1.0] {
            hunting.slides(16, sign);
        }
        let left = (1.4 - hunting.share()) / 0.7;
        assert!((left - (15.0_f64 / 16.0).powi(16)).abs() < 0.02, "{left}");
        for sign in [1.0, -1.0] {
            hunting.slides(100, sign);
        }
        assert!((hunting.share() - 1.4).abs() < 0.02, "{}", hunting.share());
    }

    #[test]
    fn what_cannot_be_is_bounded() {
        for (friction, most) in [(3.0, 2.0), (0.2, 0.5)] {
            let mut hunting = Hunting {
                friction,
                ..Hunting::default()
            };
            hunting.slides(10, 1.0);
            hunting.slides(10, -1.0);
            assert!((hunting.share() - most).abs() < 1e-4, "{friction}");
        }
    }

    /// Both widths together up to a tenth of the largest force.
    #[test]
    fn air_that_is_not_known_tells_no_friction() {
        for (width, tells) in [(0.09, true), (0.105, false)] {
            let mut hunting = Hunting {
                width,
                ..Hunting::default()
            };
            hunting.slides(10, 1.0);
            assert_eq!(hunting.slides(10, -1.0) > 0, tells, "{width}");
        }
    }

    /// Neither in a cushion nor below 10 mm/s.
    #[test]
    fn a_cushion_and_a_slow_piston_tell_no_friction() {
        for (stroke_mm, least_mm_s, tells) in [
            (7, 20.0, true),
            (173, 20.0, true),
            (6, 20.0, false),
            (174, 20.0, false),
            (90, 10.5, true),
            (90, 9.5, false),
        ] {
            let mut hunting = Hunting {
                stroke_mm,
                ..Hunting::default()
            };
            hunting.slides_at(20, 1.0, least_mm_s);
            let taught = hunting.slides_at(20, -1.0, least_mm_s);
            assert_eq!(taught > 0, tells, "{stroke_mm} mm, {least_mm_s} mm/s");
        }
    }

    /// Each target has sliding of its own; what has been learnt stays.
    #[test]
    fn a_new_target_keeps_the_share_alone() {
        let mut hunting = Hunting {
            friction: 0.6,
            ..Hunting::default()
        };
        hunting.slides(10, 1.0);
        hunting.slides(10, -1.0);
        let learnt = hunting.estimator.share();
        hunting.estimator.forget();
        hunting.friction = 1.5;
        assert_eq!(hunting.slides(40, 1.0), 0, "one direction");
        assert_eq!(hunting.estimator.share(), learnt);
    }

    /// Everything that friction makes follows from it.
    #[test]
    fn a_model_has_the_friction_that_is_learnt() {
        let model = model();
        let half = model.with_friction(ONE / 2);
        let of = |model: &AxisModel| {
            [
                model.coulomb,
                model.breakaway,
                model.viscous,
                model.stick_step,
            ]
        };
        assert_eq!(of(&half), of(&model).map(|value| value / 2));
        assert_eq!(model.with_friction(ONE), model);
    }
}
