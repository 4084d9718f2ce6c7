//! From the set-points of the bus to the reference of every tick.
//!
//! ```text
//! wanted(k) = reference + velocity · k · tick      k = ticks since the SYNC, at most one bus cycle
//! reference(k) = reference(k−1) + limit(wanted(k) − reference(k−1), ± slew step)
//! ```
//!
//! When a SYNC is missed, the wanted reference stops at the end of the cycle until the watchdog decides. While the
//! joint is disarmed, the reference follows the measured stroke, and a precharge ends at the measured stroke. So the
//! first reference of the law is the actual position, and from there the slew limit applies: no jump after arming,
//! wherever the set-point is.
//!
//! If its acceleration is set, the predictive law follows the reference generator of
//! `wheeleg_control::law::reference_generator` instead; supervision still compares the piston with the reference above.
//!
//! The next reference of a slot is counted down to the tick and passed to the control law. The predictive law fills and
//! vents ahead of it; the others do not use it.

use super::settings::TickSettings;
use crate::JOINT_TICK;
use core::hash::{Hash, Hasher};
use wheeleg_control::joint::Announced;
use wheeleg_control::law::reference_generator::Reference;
use wheeleg_protocol::JointSetpoint;
use wheeleg_protocol::link::CYCLE_US;
use wheeleg_units::{PositionMm, Ticks, VelocityMmS, divide_signed};

/// Ticks of one bus cycle.
const CYCLE_TICKS: u32 = CYCLE_US / JOINT_TICK.get();

/// Ticks per second.
const TICKS_PER_SECOND: i32 = 1_000_000 / JOINT_TICK.get() as i32;
const _: () = assert!(1_000_000 % JOINT_TICK.get() == 0);

/// What the bus requests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Target {
    reference: PositionMm,
    velocity: VelocityMmS,
    /// The next reference, if the slot has one; otherwise all zero.
    next: Announced,
    has_next: bool,
    age: u32,
}

impl Hash for Target {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Destructured, so that a new field cannot be forgotten here. Without branches: whether there is a next
        // reference is a bit of the age.
        let Self {
            reference,
            velocity,
            next: Announced {
                reference: next,
                after,
            },
            has_next,
            age,
        } = self;
        state.write_i32(reference.raw());
        state.write_i32(velocity.raw());
        state.write_i32(next.raw());
        state.write_u32(after.get());
        state.write_u32(age ^ u32::from(*has_next).rotate_right(1));
    }
}

impl Target {
    /// Stands still at `position`.
    pub(super) fn at(position: PositionMm) -> Self {
        Self {
            reference: position,
            ..Self::default()
        }
    }

    /// The set-point of a SYNC latched before this tick.
    pub(super) fn from_setpoint(setpoint: &JointSetpoint) -> Self {
        let next = setpoint.next.map(|next| Announced {
            reference: PositionMm::from_wire(next.reference),
            after: Ticks(u32::from(next.cycles.get()).saturating_mul(CYCLE_TICKS)),
        });
        Self {
            reference: setpoint.reference,
            velocity: setpoint.velocity_mm_s(),
            next: next.unwrap_or_default(),
            has_next: next.is_some(),
            age: 0,
        }
    }

    /// Reference of the SYNC slot.
    pub(super) const fn reference(&self) -> PositionMm {
        self.reference
    }

    /// A tick that does not use the target.
    pub(super) const fn grow_older(&mut self) {
        self.age = self.age.saturating_add(1);
    }

    /// Wanted reference and velocity of this tick; then makes the target one tick older.
    fn advance(&mut self) -> (PositionMm, VelocityMmS) {
        let moving = self.age < CYCLE_TICKS;
        let ticks = self.age.min(CYCLE_TICKS);
        let travel = PositionMm::from_raw(travel(self.velocity.raw(), ticks));
        self.grow_older();
        let velocity = if moving {
            self.velocity
        } else {
            VelocityMmS::ZERO
        };
        (self.reference.saturating_add(travel), velocity)
    }

    /// The announced reference, counted from this tick.
    fn announced(&self) -> Option<Announced> {
        self.has_next.then(|| Announced {
            reference: self.next.reference,
            after: Ticks(self.next.after.get().saturating_sub(self.age)),
        })
    }
}

/// Distance at `velocity`, raw mm/s, over `ticks`, at most one bus cycle; rounded toward zero.
fn travel(velocity: i32, ticks: u32) -> i32 {
    // Up to the velocities of the wire format, and beyond, the product fits 32 bits, and the division is compiled to a
    // multiplication.
    if let Ok(ticks) = i32::try_from(ticks)
        && let Some(product) = velocity.checked_mul(ticks)
    {
        return product / TICKS_PER_SECOND;
    }
    let product = i64::from(velocity).saturating_mul(i64::from(ticks));
    let travel = divide_signed(product, i64::from(TICKS_PER_SECOND));
    i32::try_from(travel).unwrap_or(0)
}

/// Reference of one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct TickReference {
    /// The command within the slew limit.
    pub(super) supervised: PositionMm,
    /// Where the piston is expected to be on its way: the same, limited to the range between piston and command. A
    /// piston that was held up and is commanded back is not expected to go further first.
    pub(super) expected: PositionMm,
    /// What the law follows.
    pub(super) reference: Reference,
    pub(super) announced: Option<Announced>,
    pub(super) slew_limited: bool,
}

/// Next reference on the way to the target, from the `supervised` reference and the followed one of the last tick.
pub(super) fn advance(
    supervised: PositionMm,
    last: Reference,
    measured: PositionMm,
    target: &mut Target,
    settings: &TickSettings,
) -> TickReference {
    let announced = target.announced();
    let (wanted, velocity) = target.advance();
    let step = settings.slew_step;
    let down = PositionMm::ZERO.saturating_sub(step);
    let difference = wanted.saturating_sub(supervised);
    let change = difference.limit(down, step);
    let slew_limited = change != difference;
    let supervised = supervised.saturating_add(change);
    let (reference, slew_limited) = if let Some(generator) = &settings.generator {
        let target = Reference {
            position: wanted,
            velocity,
        };
        last.update(generator, target, measured)
    } else {
        let velocity = match (slew_limited, change.raw() > 0) {
            (false, _) => velocity,
            (true, true) => settings.slew_rate,
            (true, false) => VelocityMmS::ZERO.saturating_sub(settings.slew_rate),
        };
        let reference = Reference {
            position: supervised,
            velocity,
        };
        (reference, slew_limited)
    };
    TickReference {
        supervised,
        expected: supervised.limit(wanted.min(measured), wanted.max(measured)),
        reference,
        announced,
        slew_limited,
    }
}

#[cfg(test)]
mod tests {
    use super::{CYCLE_TICKS, Target, TickReference, advance, travel};
    use crate::joint::settings::{JointSettings, TickSettings};
    use crate::parameters::JointParameters;
    use core::hash::{Hash, Hasher};
    use core::num::NonZeroU8;
    use std::hash::DefaultHasher;
    use wheeleg_control::joint::Announced;
    use wheeleg_control::law::reference_generator::Reference;
    use wheeleg_protocol::{JointSetpoint, LinkLossAction, NextReference};
    use wheeleg_units::{PositionMm, Ticks, VelocityMmS};

    fn settings() -> TickSettings {
        JointSettings::new(&JointParameters::default())
            .unwrap()
            .tick
    }

    /// At 20 mm with 100 mm/s, and 50 mm announced for this many cycles later.
    fn moving(announced_cycles: Option<u8>) -> Target {
        let next = announced_cycles.map(|cycles| NextReference {
            reference: PositionMm::from_int(50).to_wire(),
            cycles: NonZeroU8::new(cycles).unwrap(),
        });
        Target::from_setpoint(&JointSetpoint {
            reference: PositionMm::from_int(20),
            velocity: VelocityMmS::from_int(100).to_wire(),
            next,
            on_link_loss: LinkLossAction::Hold,
            track: true,
        })
    }

    /// The references of the ticks after a set-point, from where it starts.
    fn follow(mut target: Target) -> impl Iterator<Item = TickReference> {
        let settings = settings();
        let mut last = PositionMm::from_int(20);
        core::iter::repeat_with(move || {
            let tick = advance(last, Reference::at(last), last, &mut target, &settings);
            last = tick.supervised;
            tick
        })
    }

    #[test]
    fn a_setpoint_moves_on_for_one_bus_cycle_and_then_stands() {
        for (k, tick) in (0..).zip(follow(moving(None)).take(35)) {
            let on_the_way = k < CYCLE_TICKS;
            let velocity = if on_the_way { 100 } else { 0 };
            assert_eq!(
                tick.reference.velocity,
                VelocityMmS::from_int(velocity),
                "tick {k}"
            );
            // 100 mm/s is 0.1 mm per tick.
            let tenths = f64::from(k.min(CYCLE_TICKS));
            let off = tick.reference.position.to_f64() - (20.0 + tenths / 10.0);
            assert!(off.abs() < 1e-4, "tick {k}: {off}");
            assert!(!tick.slew_limited, "tick {k}");
        }
    }

    /// A piston that is held up at 20 mm is commanded out, and after 0.2 s back, or out less far: it is not expected to
    /// go further first, although the reference within the slew limit is still on its way back.
    #[test]
    fn a_piston_that_is_told_to_come_back_is_not_expected_to_go_on() {
        let settings = settings();
        let held = PositionMm::from_int(20);
        let command = |mm: i16| {
            Target::from_setpoint(&JointSetpoint {
                reference: PositionMm::from_int(mm),
                velocity: VelocityMmS::ZERO.to_wire(),
                next: None,
                on_link_loss: LinkLossAction::Hold,
                track: true,
            })
        };
        let mut target = command(170);
        let mut last = held;
        let mut tick = |target: &mut Target| {
            let tick = advance(last, Reference::at(held), held, target, &settings);
            last = tick.supervised;
            tick
        };
        for _ in 0..200 {
            let TickReference {
                supervised,
                expected,
                ..
            } = tick(&mut target);
            assert_eq!(expected, supervised);
        }
        for (mm, expected_mm) in [(5, 20), (24, 24), (160, 160)] {
            let TickReference {
                supervised,
                expected,
                ..
            } = tick(&mut command(mm));
            assert!(supervised > PositionMm::from_int(160), "{supervised:?}");
            assert_eq!(expected, PositionMm::from_int(expected_mm));
        }
    }

    #[test]
    fn an_announced_reference_is_counted_down_to_its_tick() {
        for (k, tick) in (0..).zip(follow(moving(Some(3))).take(40)) {
            let announced = Announced {
                reference: PositionMm::from_int(50),
                after: Ticks((3 * CYCLE_TICKS).saturating_sub(k)),
            };
            assert_eq!(tick.announced, Some(announced), "tick {k}");
        }
        for tick in follow(moving(None)).take(40) {
            assert_eq!(tick.announced, None);
        }
    }

    fn hash(target: &Target) -> u64 {
        let mut hasher = DefaultHasher::new();
        target.hash(&mut hasher);
        hasher.finish()
    }

    #[test]
    fn every_bit_of_a_target_is_sealed() {
        for (has_next, age) in [(false, 0), (true, 0), (false, u32::MAX), (true, u32::MAX)] {
            let sound = Target {
                has_next,
                age,
                ..moving(Some(3))
            };
            let no_next = Target {
                has_next: !has_next,
                ..sound
            };
            assert_ne!(hash(&no_next), hash(&sound), "{sound:?}");
            for bit in 0..32 {
                let flip = |raw: i32| raw ^ 1_i32.rotate_left(bit);
                let position = |of: PositionMm| PositionMm::from_raw(flip(of.raw()));
                let Announced { reference, after } = sound.next;
                let next = |reference, after| Target {
                    next: Announced { reference, after },
                    ..sound
                };
                for damaged in [
                    Target {
                        reference: position(sound.reference),
                        ..sound
                    },
                    Target {
                        velocity: VelocityMmS::from_raw(flip(sound.velocity.raw())),
                        ..sound
                    },
                    next(position(reference), after),
                    next(reference, Ticks(after.get() ^ 1 << bit)),
                    Target {
                        age: age ^ 1 << bit,
                        ..sound
                    },
                ] {
                    assert_ne!(hash(&damaged), hash(&sound), "bit {bit}: {damaged:?}");
                }
            }
        }
    }

    #[test]
    fn the_way_of_a_cycle_is_exact_for_every_velocity() {
        let edges = [
            i32::MAX,
            i32::MAX / 10,
            i32::MAX / 10 + 1,
            65_536,
            999,
            1,
            0,
        ];
        for velocity in edges
            .into_iter()
            .flat_map(|v| [v, -v, v.wrapping_neg() - 1])
        {
            for ticks in 0..=CYCLE_TICKS {
                let exact = i64::from(velocity) * i64::from(ticks) * 1000 / 1_000_000;
                assert_eq!(
                    i64::from(travel(velocity, ticks)),
                    exact,
                    "{velocity} {ticks}"
                );
            }
        }
    }
}
