//! Motion that was expected and did not come.
//!
//! A frozen potentiometer, a valve that is stuck or slow, a cylinder that is
//! blocked: each reads like an axis at rest. What tells them apart is the air.
//! The watch keeps an account of how long the valves have been held open for
//! one direction, fills of one chamber and vents of the other, less the same
//! for the other direction:
//!
//! ```text
//! lead(k) = lead(k−1) + (fill A + vent B − fill B − vent A) / 2      µs of full opening
//! ```
//!
//! Once it has grown to the bound of the [`MotionModel`] without a millimetre of
//! motion in its direction, the model expects that the piston has moved by 2 mm.
//! From then on it has 200 ms to show that millimetre; if it does not, the axis is
//! at fault. Any such millimetre closes the account, as do rest, an end of the
//! travel in the direction of the lead, and everything but control.
//!
//! The account needs the valve times alone, which every control law gives. It
//! needs no pressure: while the flow is choked, the time in which a chamber is
//! filled or emptied to a share of the supply does not depend on the supply.

use super::settings::MotionModel;
use crate::JOINT_TICK;
use wheeleg_control::pwm::OnTimes;
use wheeleg_units::{Micros, PositionMm};

/// Motion that shows that the piston follows, mm: 20 converter steps.
const SHOWN: PositionMm = PositionMm::from_int(1);

/// Time that the motion has to show itself once it is expected, µs.
const GRACE_US: i32 = 200_000;

/// The account of one cylinder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct MotionWatch {
    /// Lead of the valves, µs, positive to extend; above the model's bound it
    /// grows by the time that passes.
    lead_us: i32,
    /// Stroke from which motion in the direction of the lead counts.
    from: PositionMm,
}

impl MotionWatch {
    /// A closed account at `position`.
    #[inline]
    pub(super) const fn closed(position: PositionMm) -> Self {
        Self {
            lead_us: 0,
            from: position,
        }
    }

    /// Takes the valve times that this tick sends and the stroke that it
    /// measured; true when an expected motion is overdue.
    #[inline]
    pub(super) fn sample(
        &mut self,
        on: &OnTimes,
        position: PositionMm,
        model: &MotionModel,
    ) -> bool {
        let [fill_a, vent_a, fill_b, vent_b] = *on;
        let (fill_a, vent_a) = (i32::from(fill_a), i32::from(vent_a));
        let (fill_b, vent_b) = (i32::from(fill_b), i32::from(vent_b));
        // Two on-times of at most a tick each way; a lead ends at the bound and
        // the grace, far below 2^31.
        let push = fill_a
            .wrapping_add(vent_b)
            .wrapping_sub(fill_b.wrapping_add(vent_a))
            >> 1;
        // Mirrored, so that the lead is never negative.
        let back = self.lead_us < 0;
        let mirror = |value: i32| if back { value.wrapping_neg() } else { value };
        let (lead, push) = (mirror(self.lead_us), mirror(push));
        let moved = mirror(position.saturating_sub(self.from).raw());
        let (low, high) = (position < model.low, position > model.high);
        let bound = if low || high {
            model.end_bound_us
        } else {
            model.bound_us
        };
        let lead = if lead < bound {
            lead.wrapping_add(push)
        } else if push < 0 {
            bound.wrapping_add(push)
        } else {
            lead.wrapping_add(JOINT_TICK.get() as i32)
        };
        let against_end = if back { low } else { high };
        if lead < 0 || against_end || moved >= SHOWN.raw() {
            *self = Self::closed(position);
            // What is left leads the other way.
            self.lead_us = mirror(lead.min(0));
            return false;
        }
        if moved < 0 {
            self.from = position;
        }
        self.lead_us = mirror(lead);
        lead >= bound.wrapping_add(GRACE_US)
    }

    /// Time since the model expects that the piston has moved by 2 mm; zero if
    /// it does not.
    #[inline]
    pub(super) fn overdue(&self, position: PositionMm, model: &MotionModel) -> Micros {
        let bound = model.bound_us(position).unsigned_abs();
        Micros(self.lead_us.unsigned_abs().saturating_sub(bound))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODEL: MotionModel = MotionModel {
        bound_us: 400_000,
        end_bound_us: 1_100_000,
        low: PositionMm::from_int(3),
        high: PositionMm::from_int(177),
    };
    const PUSH: OnTimes = [1000, 0, 0, 1000];
    const PULL: OnTimes = [0, 1000, 1000, 0];

    /// Tick in which the fault comes, if one comes in `ticks`.
    fn fault_at(
        ticks: u32,
        on: impl Fn(u32) -> OnTimes,
        position: impl Fn(u32) -> PositionMm,
    ) -> Option<u32> {
        let mut watch = MotionWatch::closed(position(0));
        (1..=ticks).find(|tick| watch.sample(&on(*tick), position(*tick), &MODEL))
    }

    fn still(millimetres: i16) -> impl Fn(u32) -> PositionMm {
        move |_| PositionMm::from_int(millimetres)
    }

    #[test]
    fn an_axis_that_does_not_move_is_at_fault_200_ms_after_motion_was_expected() {
        for on in [PUSH, PULL] {
            assert_eq!(fault_at(2000, |_| on, still(90)), Some(600));
        }
        // A quarter of the air: the bound takes four times as long, the grace not.
        let pulsed = |tick: u32| if tick % 20 < 5 { PUSH } else { [0; 4] };
        let at = fault_at(4000, pulsed, still(90)).unwrap();
        assert!((1770..=1800).contains(&at), "{at}");
        // One of two valves alone moves half the air.
        let one = fault_at(4000, |_| [1000, 0, 0, 0], still(90));
        assert_eq!(one, Some(1000));
    }

    #[test]
    fn overdue_counts_from_the_expectation() {
        let mut watch = MotionWatch::closed(PositionMm::from_int(90));
        for tick in 1..=550_u32 {
            watch.sample(&PULL, PositionMm::from_int(90), &MODEL);
            let overdue = watch.overdue(PositionMm::from_int(90), &MODEL);
            assert_eq!(overdue.get(), tick.saturating_sub(400) * 1000);
        }
    }

    #[test]
    fn a_millimetre_in_the_right_direction_each_half_second_is_enough() {
        let creep =
            |sign: i16| move |tick: u32| PositionMm::from_int(90 + sign * (tick / 500) as i16);
        assert_eq!(fault_at(20_000, |_| PUSH, creep(1)), None);
        assert_eq!(fault_at(20_000, |_| PULL, creep(-1)), None);
        // The wrong direction is no excuse.
        assert_eq!(fault_at(20_000, |_| PUSH, creep(-1)), Some(600));
        assert_eq!(fault_at(20_000, |_| PULL, creep(1)), Some(600));
        // Nor are 0.9 mm there and back.
        let shake = |tick: u32| PositionMm::from_raw(90 * 65_536 + 59_000 * (tick % 2) as i32);
        assert_eq!(fault_at(20_000, |_| PUSH, shake), Some(600));
    }

    #[test]
    fn leads_of_both_directions_cancel() {
        let balanced = |tick: u32| {
            if (tick / 390).is_multiple_of(2) {
                PUSH
            } else {
                PULL
            }
        };
        assert_eq!(fault_at(60_000, balanced, still(90)), None);
        // A pull within the grace starts it anew.
        let broken = |tick: u32| if tick.is_multiple_of(190) { PULL } else { PUSH };
        assert_eq!(fault_at(60_000, broken, still(90)), None);
    }

    #[test]
    fn nothing_is_expected_against_an_end_and_less_soon_away_from_it() {
        assert_eq!(fault_at(60_000, |_| PUSH, still(179)), None);
        assert_eq!(fault_at(60_000, |_| PULL, still(1)), None);
        assert_eq!(fault_at(60_000, |_| PULL, still(179)), Some(1300));
        assert_eq!(fault_at(60_000, |_| PUSH, still(1)), Some(1300));
    }
}
