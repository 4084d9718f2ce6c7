//! Reference generator: turns steps of the command into a motion that a piston can follow.
//!
//! It is second order and time-optimal within a speed and an acceleration, after the text-book profile of a double
//! integrator; a reference governor limits its lead over the piston:
//!
//! ```text
//! d = target − r                                  distance that is left
//! e = (r − measured) · sgn d                      how far the reference is ahead
//! g = min(1, max(0, (2 ℓ − e) / ℓ))               governor: 1 up to the lead ℓ, 0 from twice it
//! v* = v_target + sgn d · min(v_max, √(2 a |d|)) · g
//! |v(i) − v(i−1)| ≤ a T_t                         T_t: one tick, s
//! r(i) = r(i−1) + v(i) T_t
//! ```
//!
//! r, measured, target, d, e, ℓ in mm; v, v*, v_max in mm/s; a in mm/s². Source: the profile is text-book (Biagiotti
//! and Melchiorri, Trajectory Planning for Automatic Machines and Robots); the governor is that of Gilbert and
//! Kolmanovsky in its simplest form: it holds back only the pace, never the target.
//!
//! The profile ends, with r = target and v = v_target, as soon as a step would reach the target; this last change of v
//! may exceed a T_t. A new target is accepted at any time and approached from the present r and v.
//!
//! If the reference ran away from a piston that has not begun to move, it would demand a speed that no valve can
//! deliver, and the piston would then overshoot. Ahead of a stuck piston the reference brakes fully from a lead of 2 ℓ
//! on, at the latest: it stops at most 2 ℓ + v²/(2 a) ahead, where v is its speed there. From rest that is less than 4
//! ℓ (3.2 ℓ at 350 mm/s, 1500 mm/s² and 4 mm). If the piston jams in motion it may be far more (45 to 49 mm at the full
//! 350 mm/s). Whoever supervises the piston must compare it with the command.
//!
//! Assumes: a tick of 1 ms and a call in every tick, whatever tick the law is made for (the joint board has this tick,
//! and calls it in `firmware/node/src/joint/reference.rs`); v_max and a that the axis can follow; a true measured
//! stroke; a target that rests or moves evenly. If the supply falls, the piston lags, and the governor keeps the
//! reference close to it; for a moving target it holds back only the approach, not v_target.
//!
//! Config [`GeneratorConfig`], state [`Reference`], update [`Reference::update`]. Without an acceleration in the
//! board's parameters it is left out, and the law follows the command. It is guarded by the tests at the end of this
//! file: it has no row in [`crate::tuning`], because its limits are parameters of the board.

use crate::math::square_root;
use wheeleg_units::{PositionMm, VelocityMmS};

/// Ticks of 1 ms per second.
const TICKS_PER_SECOND: i64 = 1000;
/// Raw steps per unit: I16F16.
const ONE: i64 = 1 << 16;
/// The reference counts as arrived within this distance of the target, raw mm (30 nm).
const THERE: i64 = 2;

/// Limits of the reference, one set per axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct GeneratorConfig {
    /// Largest speed, v_max.
    pub speed: VelocityMmS,
    /// Acceleration a, mm/s², positive.
    pub acceleration: i32,
    /// Lead ℓ.
    pub lead: PositionMm,
}

/// A reference, on its way or at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Reference {
    /// r.
    pub position: PositionMm,
    /// v.
    pub velocity: VelocityMmS,
}

impl Reference {
    /// At rest.
    #[must_use]
    pub const fn at(position: PositionMm) -> Self {
        Self {
            position,
            velocity: VelocityMmS::ZERO,
        }
    }

    /// The reference of the next tick towards `target`, which itself moves at its velocity, with the piston at
    /// `measured`; and whether it is so far from the target that v_max limits it.
    #[must_use]
    pub fn update(
        self,
        config: &GeneratorConfig,
        target: Self,
        measured: PositionMm,
    ) -> (Self, bool) {
        let raw = |position: PositionMm| i64::from(position.raw());
        let missing = raw(target.position).saturating_sub(raw(self.position));
        let distance = missing.saturating_abs();
        let sign = if missing < 0 { -1 } else { 1 };
        let acceleration = i64::from(config.acceleration);

        // The root of (mm/s)² × 2^16 is in mm/s × 2^8. Beyond 32 bits, 2^-10 of the square has 2^-5 of that root.
        let square = acceleration.saturating_mul(2).saturating_mul(distance);
        let root = match u32::try_from(square) {
            Ok(square) => i64::from(square_root(square)) << 8,
            Err(_) => {
                let square = u32::try_from(square >> 10).unwrap_or(u32::MAX);
                i64::from(square_root(square)) << 13
            }
        };
        let top = i64::from(config.speed.raw());
        let lead = raw(config.lead).max(1);
        let ahead = raw(self.position)
            .saturating_sub(raw(measured))
            .saturating_mul(sign);
        let room = lead
            .saturating_mul(2)
            .saturating_sub(ahead)
            .max(0)
            .min(lead);
        let pace = root.min(top).saturating_mul(room);
        let pace = pace.checked_div(lead).unwrap_or(0);
        let goal = pace
            .saturating_mul(sign)
            .saturating_add(i64::from(target.velocity.raw()));

        let most = acceleration
            .saturating_mul(ONE)
            .checked_div(TICKS_PER_SECOND)
            .unwrap_or(0);
        let last = i64::from(self.velocity.raw());
        let change = goal
            .saturating_sub(last)
            .max(most.saturating_neg())
            .min(most);
        let velocity = last.saturating_add(change);
        let step = velocity.checked_div(TICKS_PER_SECOND).unwrap_or(0);
        if distance <= THERE || step.saturating_mul(sign) >= distance {
            return (target, false);
        }
        let narrow = |wide: i64| wide.max(i64::from(i32::MIN)).min(i64::from(i32::MAX)) as i32;
        let next = Self {
            position: PositionMm::from_raw(narrow(raw(self.position).saturating_add(step))),
            velocity: VelocityMmS::from_raw(narrow(velocity)),
        };
        (next, root >= top)
    }
}

#[cfg(test)]
mod tests {
    use super::{GeneratorConfig, Reference};
    use wheeleg_units::{PositionMm, VelocityMmS};

    const CONFIG: GeneratorConfig = GeneratorConfig {
        speed: VelocityMmS::from_int(250),
        acceleration: 2500,
        lead: PositionMm::from_int(4),
    };

    /// References of every tick towards `target`, with a piston at the position that `piston` returns.
    fn run(
        from: i16,
        target: i16,
        piston: impl Fn(PositionMm) -> PositionMm,
    ) -> impl Iterator<Item = Reference> {
        let mut reference = Reference::at(PositionMm::from_int(from));
        let target = Reference::at(PositionMm::from_int(target));
        core::iter::repeat_with(move || {
            (reference, _) = reference.update(&CONFIG, target, piston(reference.position));
            reference
        })
    }

    #[test]
    fn a_step_takes_the_time_of_the_trapezoid_and_stays_within_speed_and_acceleration() {
        for (from, target) in [(0, 180), (180, 0), (20, 21)] {
            let mut last = Reference::at(PositionMm::from_int(from));
            let mut ticks = 0;
            for now in run(from, target, |reference| reference).take(2000) {
                if now.position == PositionMm::from_int(target) {
                    break;
                }
                let change = now.velocity.raw() - last.velocity.raw();
                assert!(
                    change.abs() <= (2500 << 16) / 1000,
                    "{now:?} after {last:?}"
                );
                assert!(now.velocity.raw().abs() <= 250 << 16, "{now:?}");
                last = now;
                ticks += 1;
            }
            let distance = f64::from((target - from).abs());
            let ramp = 0.25_f64 / 2.5;
            let expected = if distance > 25.0 {
                distance / 250.0 + ramp
            } else {
                2.0 * (distance / 2500.0).sqrt()
            };
            // Sampling cuts off the end of the parabola.
            let expected = expected * 1000.0;
            assert!(
                (f64::from(ticks) - expected).abs() < 12.0,
                "{ticks} {expected}"
            );
        }
    }

    /// How far, in mm, the reference stops ahead of a piston stuck at 100 mm, if it starts there at `speed` mm/s.
    fn ahead_of_a_stuck_piston(config: &GeneratorConfig, speed: i16, target: i16) -> f64 {
        let stuck = PositionMm::from_int(100);
        let target = Reference::at(PositionMm::from_int(target));
        let mut reference = Reference {
            position: stuck,
            velocity: VelocityMmS::from_int(speed),
        };
        for _ in 0..5000 {
            (reference, _) = reference.update(config, target, stuck);
        }
        (reference.position.to_f64() - 100.0).abs()
    }

    const ROBOT: GeneratorConfig = GeneratorConfig {
        speed: VelocityMmS::from_int(350),
        acceleration: 1500,
        lead: PositionMm::from_int(4),
    };

    #[test]
    fn a_piston_stuck_at_rest_holds_the_reference_within_four_leads() {
        for target in [180, 20] {
            let ahead = ahead_of_a_stuck_piston(&ROBOT, 0, target);
            assert!((12.4..13.2).contains(&ahead), "{ahead}");
            let ahead = ahead_of_a_stuck_piston(&CONFIG, 0, target);
            assert!((8.0..16.0).contains(&ahead), "{ahead}");
        }
    }

    /// The braking distance is added, starting from one lead at the earliest and two at the latest.
    #[test]
    fn a_piston_that_jams_lets_the_reference_run_on_by_its_braking_distance() {
        for (config, speed) in [(CONFIG, 250), (ROBOT, 350)] {
            let braking = f64::from(speed).powi(2) / 2.0 / f64::from(config.acceleration);
            for (speed, target) in [(speed, 180), (-speed, 20)] {
                let ahead = ahead_of_a_stuck_piston(&config, speed, target);
                let bounds = 4.0 + braking..8.0 + braking;
                assert!(bounds.contains(&ahead), "{ahead} {bounds:?}");
            }
        }
    }

    #[test]
    fn a_new_target_behind_it_turns_it_round_without_a_jump() {
        let mut last = run(0, 180, |reference| reference).nth(300).unwrap();
        let home = Reference::at(PositionMm::ZERO);
        for _ in 0..3000 {
            let (next, _) = last.update(&CONFIG, home, last.position);
            let change = next.velocity.raw() - last.velocity.raw();
            let arrives = next == home;
            assert!(arrives || change.abs() <= (2500 << 16) / 1000);
            last = next;
        }
        assert_eq!(last, home);
    }

    #[test]
    fn a_moving_target_is_met_and_kept() {
        let mut target = Reference {
            position: PositionMm::from_int(10),
            velocity: VelocityMmS::from_int(50),
        };
        let mut reference = Reference::at(PositionMm::ZERO);
        for _ in 0..1000 {
            target.position = PositionMm::from_raw(target.position.raw() + (50 << 16) / 1000);
            (reference, _) = reference.update(&CONFIG, target, reference.position);
        }
        assert_eq!(reference, target);
    }
}
