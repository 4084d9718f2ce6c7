//! From the mode and the control law to the four valve outputs of a tick.

use super::no_motion_detector::Driven;
use super::node::JointNode;
use super::precharge::{Filling, Precharge};
use super::reference::{Target, TickReference, advance};
use crate::JOINT_TICK;
use crate::hardware::{PinError, PositionSensor, SwitchBank, ValveBank};
use crate::mode::Mode;
use crate::supervisor::ExhaustKind;
use wheeleg_control::joint::{JointInput, JointLimits};
use wheeleg_control::pwm::OnTimes;
use wheeleg_control::valve::{ValveMode, ValveOpenings};
use wheeleg_protocol::{Fault, Limit, LimitBits};
use wheeleg_units::{Duty, Micros, PositionMm, Ticks, VelocityMmS};

impl<V: ValveBank, S: PositionSensor, W: SwitchBank> JointNode<V, S, W> {
    /// Closed loop on the reference of this tick.
    pub(super) fn drive(&mut self, now: Micros) -> OnTimes {
        let TickReference {
            supervised,
            expected,
            reference,
            announced,
            slew_limited,
        } = advance(
            self.state.supervised,
            self.state.reference,
            self.state.measured,
            &mut self.target,
            &self.settings,
        );
        self.state.supervised = supervised;
        self.state.reference = reference;
        let output = self.controller.step(&JointInput {
            measured: self.state.measured,
            reference: reference.position,
            reference_velocity: reference.velocity,
            announced,
        });
        // The law limits its reference to the stroke, and its error counts from there.
        let waits = supervised.saturating_sub(reference.position);
        let behind = output.error.saturating_add(waits);
        let beyond = behind.saturating_abs() > self.allowed_error();
        self.state.following = if beyond {
            self.state.following.next()
        } else {
            Ticks::ZERO
        };
        let driven = Driven {
            reference: expected,
            position: self.state.measured,
            velocity: output.velocity,
        };
        let overdue = self.state.motion.judge(&driven, &self.settings.motion);
        // At rest, and in the very tick in which a fault is found, no pulse continues.
        let on_times = if overdue || self.is_behind() {
            self.controller.stopped();
            self.pwm.shut()
        } else if let Some(on) = output.direct {
            self.pwm.direct(on)
        } else if output.settled {
            self.pwm.shut()
        } else {
            // A copy, so that the rest of the output need not be in memory.
            let openings = output.openings;
            self.pwm.tick(&openings)
        };
        let state = &mut self.state;
        state
            .motion
            .follow(&on_times, state.measured, &self.settings.motion);
        let mut limits = limit_bits(&output.limits, output.settled);
        if slew_limited {
            limits.insert(Limit::SlewLimited);
        }
        self.record(now, output.velocity, output.duty, on_times);
        self.snapshot.limits = limits;
        self.snapshot.settled = output.settled;
        on_times
    }

    /// Following error that is allowed to last. A piston that stands is not lagging, so its error is not due to a
    /// motion in progress, and a quarter of it is allowed.
    #[inline]
    fn allowed_error(&self) -> PositionMm {
        let allowed = self.settings.following_error;
        if self.state.motion.stands() {
            PositionMm::from_raw(allowed.raw() >> 2)
        } else {
            allowed
        }
    }

    /// Whether the following error has lasted for its time.
    fn is_behind(&self) -> bool {
        self.state.following >= self.settings.following_ticks
    }

    /// The fault that the last tick under control has found. That tick shut the valves; the fault is latched in this
    /// tick, which has no law to compute at the same time.
    #[inline]
    pub(super) fn found(&self) -> Option<Fault> {
        if self.is_behind() {
            Some(Fault::FollowingError)
        } else if self.state.motion.is_overdue() {
            Some(Fault::NoMotion)
        } else {
            None
        }
    }

    /// No control: the valves follow the mode, the reference follows the measured stroke, and no precharge is under
    /// way.
    #[cold]
    #[inline(never)]
    pub(super) fn rest(&mut self, now: Micros) -> OnTimes {
        self.state.start_from(self.state.measured);
        self.state.precharge = Precharge::default();
        self.target = Target::at(self.state.measured);
        let on_times = if self.core.mode() == Mode::Exhaust {
            let openings = self.exhaust_openings();
            self.pwm.tick(&openings)
        } else {
            self.pwm.shut()
        };
        // During exhaust the on-times count in full: a little more than what is actually let out.
        self.rested(now, on_times, &on_times);
        self.snapshot.limits = LimitBits::NONE;
        on_times
    }

    /// A tick of precharge: an armed axis fills its chambers. The reference stays at that of arming, and set-points are
    /// accepted. At the end all valves are shut, and the next tick is controlled, starting from where the piston is:
    /// reference := actual.
    #[cold]
    #[inline(never)]
    pub(super) fn fill(&mut self, now: Micros) -> OnTimes {
        self.target.grow_older();
        let shortest = self.pwm.timing().shortest_opening();
        let state = &mut self.state;
        let filling = state.precharge.tick(
            state.reference.position,
            state.measured,
            &state.motion,
            &self.settings,
            shortest,
        );
        let filling = filling.unwrap_or_else(|(end, after_ms)| {
            state.start_from(state.measured);
            self.core.supervisor.note(end, 0, after_ms, now);
            Filling::NONE
        });
        let on_times = self.pwm.tick(&filling.openings);
        self.rested(now, on_times, &filling.open);
        self.snapshot.limits = const { Limit::DriveInhibited.mask() };
        on_times
    }

    /// A tick that sends `on_times` without a law; the valves are `open` for these times, without their switching
    /// delays, µs.
    fn rested(&mut self, now: Micros, on_times: OnTimes, open: &OnTimes) {
        self.state.following = Ticks::ZERO;
        let velocity = self.controller.observe(self.state.measured);
        self.controller.external_on_times(open);
        let state = &mut self.state;
        state
            .motion
            .rest(open, state.measured, &self.settings.motion);
        self.record(now, velocity, Duty::ZERO, on_times);
        self.snapshot.settled = false;
    }

    fn exhaust_openings(&self) -> ValveOpenings {
        match self.core.supervisor.exhaust() {
            ExhaustKind::Staged => self.settings.staged_exhaust,
            ExhaustKind::Commanded => ValveMode::Exhaust.openings(self.settings.full_period),
            ExhaustKind::BlowThrough => ValveMode::BlowThrough.openings(self.settings.full_period),
        }
    }

    /// Records the tick; the caller records limits and rest.
    #[inline]
    fn record(&mut self, now: Micros, velocity: VelocityMmS, duty: Duty, on_times: OnTimes) {
        // Field by field: a whole one would be built elsewhere and copied.
        let snapshot = &mut self.snapshot;
        snapshot.at = now;
        snapshot.mode = self.core.mode();
        snapshot.measured = self.state.measured;
        snapshot.reference = self.state.reference.position;
        snapshot.commanded = self.target.reference();
        snapshot.velocity = velocity;
        snapshot.duty = duty;
        snapshot.pulses = on_times;
        snapshot.switches = self.switches.state();
        snapshot.faults = self.core.supervisor.faults().latched();
    }

    /// Scales on-times in µs to the counts of the PWM channels and writes them.
    #[inline(always)]
    pub(super) fn write(&mut self, on_times: OnTimes) -> Result<(), PinError> {
        let max = u32::from(self.valves.max_duty());
        if max == JOINT_TICK.get() {
            return self.valves.write(on_times);
        }
        self.valves.write(on_times.map(|on| {
            // 16 bits each: below 2^32. At most `max`, because an on-time is at most one tick.
            let scaled = u32::from(on)
                .wrapping_mul(max)
                .checked_div(JOINT_TICK.get());
            scaled.unwrap_or(0).min(max) as u16
        }))
    }
}

fn limit_bits(limits: &JointLimits, settled: bool) -> LimitBits {
    let bit = |active: bool, bits: LimitBits| if active { bits } else { LimitBits::NONE };
    let integral = limits.integral_frozen || limits.integral_clamped;
    bit(limits.duty, const { Limit::DutySaturated.mask() })
        .union(bit(limits.reference, const { Limit::TravelLimited.mask() }))
        .union(bit(integral, const { Limit::IntegralLimited.mask() }))
        .union(bit(
            limits.below_minimum,
            const { Limit::PulseTooShort.mask() },
        ))
        .union(bit(settled, const { Limit::SettledShut.mask() }))
}
