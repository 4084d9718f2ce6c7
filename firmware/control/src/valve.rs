//! Valve combinations, and the allocation of a signed duty to four valves.
//!
//! Each cylinder has four on/off valves, in the order `[fill A, vent A, fill B, vent B]` (PAPER §8: two inlet, two
//! outlet). Chamber A extends. Of the 16 combinations, seven are useful for motion: each chamber may be filled, vented
//! or shut, without filling both or venting both at once (the topology and the count of Hodgson, Le, Tavakoli and Pham,
//! Mechatronics 22, 2012; the enumeration is DERIVED). Two more serve as commands: exhaust, and the literal
//! blow-through.
//! ```text
//! u > 0: fill A and vent B open for |u| · period      u < 0: fill B and vent A open for |u| · period
//! ```
//!
//! Assumes: one period and one conductance for all four valves.

use wheeleg_units::{Duty, Micros, shift_right_round_inner};

/// Number of valves of one cylinder.
pub const VALVE_COUNT: usize = 4;

/// A combination of open valves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ValveMode {
    /// All shut: both chambers trap their air.
    #[default]
    Hold,
    /// Fill A, vent B: full push, extends.
    Push,
    /// Fill B, vent A: full pull, retracts.
    Pull,
    /// Fill A only: pushes against the air trapped in B, stiffens.
    FillA,
    /// Vent A only: the trapped air of B pulls, softens.
    VentA,
    /// Fill B only: pulls against the air trapped in A, stiffens.
    FillB,
    /// Vent B only: the trapped air of A pushes, softens.
    VentB,
    /// Both inlets shut, both outlets open: what the command "open all valves"
    /// means here. The cylinder goes limp.
    Exhaust,
    /// All four open: supply blows through to the exhaust. A maintenance
    /// command that the board refuses unless it is disarmed.
    BlowThrough,
}

impl ValveMode {
    /// The seven combinations that are useful for motion.
    pub const USEFUL: [Self; 7] = [
        Self::Hold,
        Self::Push,
        Self::Pull,
        Self::FillA,
        Self::VentA,
        Self::FillB,
        Self::VentB,
    ];

    /// Which valves are open, `[fill A, vent A, fill B, vent B]`.
    #[must_use]
    pub const fn open(self) -> [bool; VALVE_COUNT] {
        match self {
            Self::Hold => [false, false, false, false],
            Self::Push => [true, false, false, true],
            Self::Pull => [false, true, true, false],
            Self::FillA => [true, false, false, false],
            Self::VentA => [false, true, false, false],
            Self::FillB => [false, false, true, false],
            Self::VentB => [false, false, false, true],
            Self::Exhaust => [false, true, false, true],
            Self::BlowThrough => [true, true, true, true],
        }
    }

    /// The same opening time for every open valve of this combination, zero for the others.
    #[must_use]
    pub const fn openings(self, opening: Micros) -> ValveOpenings {
        let [fill_a, vent_a, fill_b, vent_b] = self.open();
        ValveOpenings([
            if fill_a { opening } else { Micros::ZERO },
            if vent_a { opening } else { Micros::ZERO },
            if fill_b { opening } else { Micros::ZERO },
            if vent_b { opening } else { Micros::ZERO },
        ])
    }
}

/// Wanted effective opening per valve and PWM period, in microseconds.
///
/// In the order `[fill A, vent A, fill B, vent B]`. This is how long the valve is to be *open*, not how long its coil
/// is energised: [`crate::pwm::ValvePwm`] compensates the switching delays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ValveOpenings(pub [Micros; VALVE_COUNT]);

impl ValveOpenings {
    /// All valves shut.
    pub const SHUT: Self = Self([Micros::ZERO; VALVE_COUNT]);

    /// Whether every valve is to stay shut.
    #[must_use]
    pub fn is_shut(&self) -> bool {
        self.0.iter().all(|opening| opening.get() == 0)
    }
}

/// Allocates a signed duty to a push or pull of `period`.
///
/// Positive duty gives [`ValveMode::Push`], negative [`ValveMode::Pull`], zero
/// [`ValveMode::Hold`]. The opening is `|duty| × period`, to the nearest
/// microsecond and at most `period`. Odd-symmetric: `-duty` gives the same
/// times on the opposite pair. Never panics.
#[must_use]
pub const fn allocate(duty: Duty, period: Micros) -> ValveOpenings {
    let magnitude = duty.abs().raw() as i64;
    // |duty| <= 2^30 and period < 2^32: the product fits 62 bits.
    let opening = shift_right_round_inner(magnitude.wrapping_mul(period.get() as i64), 30);
    let opening = Micros(opening as u32);
    if duty.raw() > 0 {
        ValveMode::Push.openings(opening)
    } else if duty.raw() < 0 {
        ValveMode::Pull.openings(opening)
    } else {
        ValveOpenings::SHUT
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_positive_duty_fills_a_and_vents_b() {
        let period = Micros(20_000);
        let half = Micros(10_000);
        let shut = Micros::ZERO;
        assert_eq!(
            allocate(Duty::from_per_mille(500), period).0,
            [half, shut, shut, half]
        );
        assert_eq!(
            allocate(Duty::from_per_mille(-500), period).0,
            [shut, half, half, shut]
        );
        assert_eq!(allocate(Duty::ZERO, period), ValveOpenings::SHUT);
        assert_eq!(
            allocate(Duty::ONE, period),
            ValveMode::Push.openings(period)
        );
        assert_eq!(
            allocate(Duty::MINUS_ONE, Micros::MAX),
            ValveMode::Pull.openings(Micros::MAX)
        );
        // The smallest duty rounds to nothing rather than to a microsecond.
        assert!(allocate(Duty::from_raw(1), period).is_shut());
        assert!(allocate(Duty::from_raw(-1), period).is_shut());
    }

    #[test]
    fn the_useful_modes_are_distinct_and_never_short_a_chamber() {
        for (index, mode) in ValveMode::USEFUL.iter().enumerate() {
            let [fill_a, vent_a, fill_b, vent_b] = mode.open();
            assert!(
                !(fill_a && vent_a || fill_b && vent_b),
                "{mode:?} blows through"
            );
            assert!(
                !(fill_a && fill_b || vent_a && vent_b),
                "{mode:?} has no direction"
            );
            for other in &ValveMode::USEFUL[..index] {
                assert_ne!(mode.open(), other.open());
            }
        }
        assert_eq!(ValveMode::Exhaust.open(), [false, true, false, true]);
        assert_eq!(ValveMode::BlowThrough.open(), [true; 4]);
    }

    proptest! {
        #[test]
        fn allocation_is_bounded_odd_and_within_half_a_microsecond(
            raw in -(1_i32 << 30)..=(1 << 30), period in 1_u32..100_000,
        ) {
            let duty = Duty::from_raw(raw);
            let [fill_a, vent_a, fill_b, vent_b] = allocate(duty, Micros(period)).0;
            prop_assert_eq!(allocate(duty.negated(), Micros(period)).0, [fill_b, vent_b, fill_a, vent_a]);
            prop_assert_eq!((fill_a, fill_b), (vent_b, vent_a));
            let open = fill_a.get().max(fill_b.get());
            prop_assert!(open <= period);
            prop_assert!((f64::from(open) - duty.to_f64().abs() * f64::from(period)).abs() <= 0.5 + 1e-9);
        }
    }
}
