//! Filling both chambers after arming, before the control law drives.
//!
//! After a stop the chambers may be empty. A law that then sees an error would drive a piston without any air to hold
//! it back: it jumps. Therefore, after arming, an axis first fills both chambers to the precharge pressure, with the
//! outlets shut, in short pulses of one inlet at a time.
//!
//! * **The piston must not move.** The force of both chambers, as estimated by the air model, is kept at its value when
//!   arming: the next pulse goes to the chamber that pushes too little. If the two pulses differ in size, it goes to
//!   the larger chamber until the coarser pulse fits. If the piston moves nevertheless, this balance is shifted against
//!   its motion: the chamber that pushed it waits, and the other one is filled.
//! * **A pulse** lasts until its chamber has gained a 64th of the supply pressure. It is no shorter than the valve can
//!   be opened, and no longer than half a PWM period; each period has one pulse.
//! * **It ends** when both chambers have reached the pressure, when the piston has moved by more than [`WAY`], or after
//!   [`LONGEST`]. Then the closed loop takes over at the present position. That is the safest continuation: the law
//!   holds a leg that rises or sinks, whereas shut valves would leave it to the air in its chambers.
//!
//! The content of the chambers at power-up is unknown; the model assumes atmospheric pressure. With the valves shut the
//! model loses pressure faster than any intact seal does, so that an axis that has been idle for a while is filled
//! again. Chambers cannot be filled above the supply pressure, which a cylinder withstands. If the model is wrong, the
//! filling is unbalanced, and the travel of the piston limits it. Nor does a board have a pressure sensor for the
//! supply: without supply it counts air that does not arrive, but for no longer than with supply, and the lack of
//! motion is found under control.

use super::no_motion_detector::MotionWatch;
use super::settings::TickSettings;
use crate::JOINT_TICK;
use wheeleg_control::pwm::OnTimes;
use wheeleg_control::valve::ValveOpenings;
use wheeleg_protocol::LogEvent;
use wheeleg_units::{Micros, PositionMm};

/// Longest precharge, ticks of 1 ms (ASSUMED: four times what the slowest axis of this project takes to reach 1 bar).
const LONGEST: u32 = 2000;
const _: () = assert!(JOINT_TICK.get() == 1000);
/// Motion that ends it, raw mm (1.5 mm); the piston then stays below 2 mm (`tests/system/precharge.rs`).
const WAY: i32 = 3 << 15;

/// One tick of a precharge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filling {
    /// Openings for the PWM.
    pub(super) openings: ValveOpenings,
    /// How long in the tick each valve counts as open, without its switching delays, µs.
    pub(super) open: OnTimes,
}

impl Filling {
    /// All valves shut.
    pub(super) const NONE: Self = Self {
        openings: ValveOpenings::SHUT,
        open: [0; 4],
    };
}

/// Bits of the state: remaining ticks, ticks until the next pulse is chosen, and whether the present pulse fills B
/// (otherwise A).
const LEFT: u32 = 0xFFFF;
const NEXT: u32 = 0xFF << NEXT_SHIFT;
const NEXT_SHIFT: u32 = 16;
const FILLS_B: u32 = 1 << 24;

/// A precharge under way, or none. The motion watch keeps the force to be held, and learns none meanwhile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Precharge {
    /// [`LEFT`], [`NEXT`] and [`FILLS_B`] in one word, which is sealed as it is. All zero if none is under way.
    state: u32,
}

impl Precharge {
    /// Begins a precharge on an axis that has just been armed, unless it is disabled by its setting.
    pub(super) fn begin(motion: &mut MotionWatch, settings: &TickSettings) -> Self {
        if settings.precharge == 0 {
            return Self::default();
        }
        motion.hold_force(&settings.motion);
        Self { state: LONGEST }
    }

    /// Whether a precharge is under way.
    #[inline]
    pub(super) const fn is_under_way(&self) -> bool {
        self.state & LEFT != 0
    }

    /// Ticks until the next pulse is chosen.
    const fn next(self) -> u32 {
        (self.state & NEXT).wrapping_shr(NEXT_SHIFT)
    }

    /// What the coming tick does to a piston at `position` that was at `from` when the axis was armed; or how the
    /// precharge ends, and after how many milliseconds.
    #[inline(never)]
    pub(super) fn tick(
        &mut self,
        from: PositionMm,
        position: PositionMm,
        motion: &MotionWatch,
        settings: &TickSettings,
        shortest: Micros,
    ) -> Result<Filling, (LogEvent, u16)> {
        let moved = position.saturating_sub(from).raw();
        // Called only while some ticks are left.
        self.state = self.state.wrapping_sub(u32::from(self.is_under_way()));
        let left = self.state & LEFT;
        let full = motion.least_pressure() >= settings.precharge;
        let end = if moved.wrapping_abs() > WAY {
            LogEvent::PrechargeMoved
        } else if full && (self.next() == 0 || left == 0) {
            // Not within a pulse: if cut short, it might not open its valve.
            LogEvent::Precharged
        } else if left == 0 {
            LogEvent::PrechargeLate
        } else {
            return Ok(self.pulse(moved, position, motion, settings, shortest));
        };
        let taken = LONGEST.saturating_sub(left) as u16;
        *self = Self::default();
        Err((end, taken))
    }

    /// Opens one inlet for the time of a pulse; the other valves stay shut.
    #[inline]
    fn pulse(
        &mut self,
        moved: i32,
        position: PositionMm,
        motion: &MotionWatch,
        settings: &TickSettings,
        shortest: Micros,
    ) -> Filling {
        let model = &settings.motion;
        // A PWM period has one pulse: 10 to 60 ticks.
        let period = settings.full_period;
        // The PWM extends a nearly full pulse to the whole period. A valve that is open for half a period still has its
        // coil off for longer than the shortest gap, because t_on is less than half a period.
        let longest = Micros(period.get() >> 1).max(shortest);
        let (time_a, push_a) = model.pulse(false, position, shortest, longest);
        let (time_b, push_b) = model.pulse(true, position, shortest, longest);
        let mut next = self.next();
        if next == 0 {
            next = period
                .get()
                .checked_div(JOINT_TICK.get())
                .unwrap_or(0)
                .min(0xFF);
            let force = motion.unbalanced(model);
            let force = force.saturating_add(model.given_way(moved));
            self.state &= !FILLS_B;
            self.state |= if b_is_next(force, push_a, push_b) {
                FILLS_B
            } else {
                0
            };
        }
        let left = JOINT_TICK.get().wrapping_mul(next);
        self.state = (self.state & !NEXT) | next.saturating_sub(1).wrapping_shl(NEXT_SHIFT);
        let gone = period.get().saturating_sub(left);
        let fills_b = self.state & FILLS_B != 0;
        let opening = if fills_b { time_b } else { time_a };
        let open = opening.get().saturating_sub(gone).min(JOINT_TICK.get()) as u16;
        if fills_b {
            Filling {
                openings: ValveOpenings([Micros::ZERO, Micros::ZERO, opening, Micros::ZERO]),
                open: [0, 0, open, 0],
            }
        } else {
            Filling {
                openings: ValveOpenings([opening, Micros::ZERO, Micros::ZERO, Micros::ZERO]),
                open: [open, 0, 0, 0],
            }
        }
    }
}

#[cfg(test)]
impl Precharge {
    /// Flips one bit.
    pub(super) const fn flip(&mut self, bit: u32) {
        self.state ^= 1 << bit;
    }
}

/// Whether B is to be filled next, if the force of both chambers is too large by `force` and a pulse adds `push_a` to
/// it or takes `push_b` off it, mN. The coarser pulse, that of the smaller chamber, waits until it fits: it never goes
/// beyond balance.
#[inline]
const fn b_is_next(force: i32, push_a: i32, push_b: i32) -> bool {
    if push_a > push_b {
        force.saturating_add(push_a) > 0
    } else {
        force >= push_b
    }
}

#[cfg(test)]
mod tests {
    use super::b_is_next;

    /// Both chambers are empty and get 32 pulses: the force stays between balance and one coarse pulse, and fine pulses
    /// compensate for coarse ones.
    #[test]
    fn the_coarser_pulse_never_goes_beyond_balance() {
        for (push_a, push_b) in [(50, 50), (100, 30), (30, 100), (1, 7), (7, 1), (60, 59)] {
            let (mut force, mut pulses_a, mut pulses_b) = (0, 0, 0);
            for _ in 0..4000 {
                if b_is_next(force, push_a, push_b) {
                    force -= push_b;
                    pulses_b += 1;
                } else {
                    force += push_a;
                    pulses_a += 1;
                }
                let bounds = if push_a > push_b {
                    // A is coarser: it waits until it ends at balance at most.
                    -push_a - push_b..=0
                } else {
                    0..=push_a + push_b
                };
                assert!(bounds.contains(&force), "{push_a} {push_b}: {force}");
            }
            let balance: i32 = pulses_a * push_a - pulses_b * push_b;
            assert!(balance.abs() <= push_a + push_b, "{push_a} {push_b}");
        }
    }

    #[test]
    fn room_for_just_one_pulse_is_used() {
        // A is coarser: it just reaches balance, or would exceed it by 1 mN.
        assert!(!b_is_next(-100, 100, 30) && b_is_next(-99, 100, 30));
        // B is coarser, or equally coarse.
        assert!(b_is_next(100, 30, 100) && !b_is_next(99, 30, 100));
        assert!(b_is_next(50, 50, 50) && !b_is_next(49, 50, 50) && !b_is_next(0, 50, 50));
    }
}
