//! The joint tick: from reference and position to valve openings. The equations are in the parent module
//! ([`crate::joint`]), `modes.rs` and `settle.rs`; the predictive law ([`crate::law`]) has its own tick.

use super::config::{INPUT_SHIFT, INTEGRAL_SHIFT, JointConfig};
use super::modes;
use super::settle::Settle;
use super::types::{Correction, JointInput, JointLimits, JointOutput, Law};
use crate::law::Predictive;
use crate::paper::velocity::VelocityEstimator;
use crate::pwm::OnTimes;
use crate::valve::{ValveOpenings, allocate};
use core::hash::{Hash, Hasher};
use wheeleg_units::{
    Duty, PositionMm, VelocityMmS, saturate_i16, saturate_i32, shift_right_round_inner,
};

/// From gain (24) × position or velocity (16) fractional bits to duty (30).
const PHYSICAL_SHIFT: u32 = 24 + 16 - 30;
/// From gain (24) × rule output (15) fractional bits to duty (30).
const RULE_SHIFT: u32 = 24 + 15 - 30;

/// Controller of one joint: configuration and state.
///
/// Call [`JointController::step`] once per control tick while the joint tracks,
/// and [`JointController::observe`] once per tick while it does not. A board
/// seals configuration and [`JointController::state`].
#[derive(Clone, Debug)]
pub struct JointController {
    config: JointConfig,
    correction: Correction,
    /// The joint tracked in the last tick.
    tracked: bool,
    /// Set by a change of law: the next tick continues from `last_law`.
    changed: bool,
    velocity: VelocityEstimator,
    settle: Settle,
    /// Σ e in raw mm × ticks, within the configured bound.
    integral: i64,
    /// u of the last tick before the limit, × 2^30 and within ±2.
    last_law: i32,
    /// What is still added to the law after a change, × 2^30, and its decay per tick.
    fade: i32,
    fade_step: i32,
    /// The predictive law, when it is chosen.
    predictive: Option<Predictive>,
}

impl JointController {
    /// A controller at rest with an empty history.
    #[inline]
    #[must_use]
    pub fn new(config: JointConfig) -> Self {
        Self {
            correction: Correction::default(),
            tracked: false,
            changed: false,
            velocity: VelocityEstimator::new(),
            settle: Settle::new(),
            integral: 0,
            last_law: 0,
            fade: 0,
            fade_step: 0,
            predictive: config.axis().map(Predictive::new),
            config,
        }
    }

    /// The configuration in use.
    #[must_use]
    pub const fn config(&self) -> &JointConfig {
        &self.config
    }

    /// What a tick changes and the next one reads, to be sealed separately from the configuration.
    #[must_use]
    pub const fn state(&self) -> State<'_> {
        State(self)
    }

    /// The correction in use.
    #[must_use]
    pub const fn correction(&self) -> Correction {
        self.correction
    }

    /// Whether all valves are held shut because the joint is at rest.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        match &self.predictive {
            Some(law) => law.is_settled(),
            None => self.settle.is_settled(),
        }
    }

    /// Whether the next tick has more work than others, because the predictive law plans its period in it.
    #[must_use]
    pub fn plans(&self) -> bool {
        self.predictive.as_ref().is_some_and(Predictive::plans)
    }

    /// The predictive law's estimates, when it is chosen.
    #[must_use]
    pub const fn predictive(&self) -> Option<&Predictive> {
        self.predictive.as_ref()
    }

    /// Notes that nothing was sent of what the last [`JointController::step`] returned; it is not called again before
    /// something else has driven.
    #[inline]
    pub fn stopped(&mut self) {
        if let (Some(law), Some(model)) = (&mut self.predictive, &self.config.axis) {
            law.stopped(model);
        }
    }

    /// Notes what was sent for the next tick while no law drives, once after each [`JointController::observe`]: how
    /// long each valve counts as open in that tick, without its switching delays, µs. The predictive law tracks the air
    /// from this.
    #[inline]
    pub fn external_on_times(&mut self, open: &OnTimes) {
        if let Some(law) = &mut self.predictive {
            law.external_on_times(open);
        }
    }

    /// Notes whether the foot at the rod stands, before [`JointController::step`] or [`JointController::observe`]. The
    /// predictive law then counts on the standing mass; the output of the other laws does not depend on it.
    #[inline]
    pub fn set_foot_stands(&mut self, stands: bool) {
        if let Some(law) = &mut self.predictive {
            law.set_foot_stands(stands);
        }
    }

    /// Selects the correction, without a bump. The integral starts from zero.
    #[inline]
    pub fn set_correction(&mut self, correction: Correction) {
        if correction != self.correction {
            self.correction = correction;
            self.integral = 0;
            self.changed = true;
        }
    }

    /// Changes the configuration, without a bump. The integral is limited to the new bound; the velocity window starts
    /// afresh if its length or the tick changes.
    #[inline]
    pub fn retune(&mut self, config: JointConfig) {
        if config.window != self.config.window {
            self.velocity.reset();
        }
        self.integral = within(self.integral, config.integral_limit);
        // Compares the inputs of the coefficients, which are fewer than the coefficients.
        let made_of =
            |config: &JointConfig| (config.axis.is_some(), config.tick(), config.gains().axis);
        if made_of(&config) != made_of(&self.config) {
            // The state of the remaining law was not updated while another one was in use.
            self.config = config;
            self.reset();
        }
        self.config = config;
        self.changed = true;
    }

    /// Forgets everything but configuration and correction, as after [`JointController::new`].
    pub fn reset(&mut self) {
        let correction = self.correction;
        *self = Self::new(self.config);
        self.correction = correction;
    }

    /// A tick in which the joint does not track (idle, hold, exhaust). It follows the measured position, and forgets
    /// the integral and the rest state, so that the next [`JointController::step`] starts afresh with a valid velocity.
    pub fn observe(&mut self, measured: PositionMm) -> VelocityMmS {
        if let (Some(law), Some(model)) = (&mut self.predictive, &self.config.axis) {
            return law.observe(model, measured);
        }
        self.settle = Settle::new();
        self.integral = 0;
        self.tracked = false;
        self.changed = false;
        self.fade = 0;
        self.velocity.update(&self.config.window, measured)
    }

    /// One control tick. Never panics.
    pub fn step(&mut self, input: &JointInput) -> JointOutput {
        let mut limits = JointLimits::default();
        let (low, high) = {
            let gains = self.config.gains();
            (gains.stroke_min, gains.stroke_max)
        };
        let reference = input.reference.limit(low, high);
        limits.reference = reference != input.reference;
        let error = reference.saturating_sub(input.measured);
        if let (Some(law), Some(model)) = (&mut self.predictive, &self.config.axis) {
            let drive = law.drive(
                model,
                &JointInput {
                    reference,
                    ..*input
                },
            );
            limits.duty = drive.limited;
            return JointOutput {
                duty: drive.duty,
                openings: ValveOpenings::SHUT,
                direct: Some(drive.on),
                error,
                velocity: drive.velocity,
                limits,
                settled: drive.settled,
            };
        }
        let velocity = self.velocity.update(&self.config.window, input.measured);
        let error_rate = input.reference_velocity.saturating_sub(velocity);

        let law = self.law(error, error_rate, input.reference_velocity, &mut limits);
        // A value beyond ±2 is cut to a duty of ±1 in any case.
        let law = self.faded(saturate_i32(law));
        self.last_law = law;
        self.tracked = true;

        let quiet = self
            .settle
            .update(&self.config, error, velocity, input.reference_velocity);
        let duty = if quiet {
            self.fade = 0;
            Duty::ZERO
        } else {
            self.shaped(law, error, input.reference_velocity, &mut limits)
        };
        let integrates = match self.config.gains().law {
            Law::Fuzzy => self.correction == Correction::Id,
            Law::Pid => true,
            _ => false,
        };
        if integrates && !quiet {
            self.integrate(error, duty, &mut limits);
        }
        let gains = self.config.gains();
        JointOutput {
            duty,
            openings: match gains.law {
                Law::Sliding if !quiet => modes::sliding(gains, error, error_rate, velocity),
                _ if duty == Duty::ZERO => ValveOpenings::SHUT,
                _ => allocate(duty, gains.pwm_period),
            },
            direct: None,
            error,
            velocity,
            limits,
            settled: self.settle.is_settled(),
        }
    }

    /// Kp·e + correction + feed-forward, × 2^30. |result| < 2^50.
    #[inline]
    fn law(
        &self,
        error: PositionMm,
        error_rate: VelocityMmS,
        reference_velocity: VelocityMmS,
        limits: &mut JointLimits,
    ) -> i64 {
        let config = &self.config;
        let gains = config.gains();
        if gains.law != Law::Fuzzy {
            return modes::law(
                gains,
                error,
                error_rate,
                reference_velocity,
                self.integral,
                config.tick(),
            );
        }
        let (rate, rate_limited) = to_input(
            error_rate.raw(),
            gains.velocity_scale.raw(),
            config.velocity_to_input,
        );
        limits.velocity = rate_limited;
        let (gain, output) = match self.correction {
            Correction::Pd => {
                let (input, limited) =
                    to_input(error.raw(), gains.error_scale.raw(), config.error_to_input);
                limits.error = limited;
                (gains.correction_pd, config.rules_pd.infer_fan(input, rate))
            }
            Correction::Id => {
                // |integral| <= bound, and bound × factor = 32 767 × 2^40 < 2^55.
                let scaled = self.integral.wrapping_mul(config.integral_to_input);
                let input = saturate_i16(shift_right_round_inner(scaled, INTEGRAL_SHIFT));
                (gains.correction_id, config.rules_id.infer_fan(input, rate))
            }
        };
        // |gain| <= 4 × 2^24 and |raw| <= 2^31: products stay below 2^58.
        let proportional = product(gains.proportional.to_bits(), error.raw());
        let feed_forward = product(gains.feed_forward.to_bits(), reference_velocity.raw());
        let correction = product(gain.to_bits(), i32::from(output));
        shift_right_round_inner(proportional.wrapping_add(feed_forward), PHYSICAL_SHIFT)
            .wrapping_add(shift_right_round_inner(correction, RULE_SHIFT))
    }

    /// Adds the rest of the bump of the last change of law. A bump of more than 2, which would exceed the range of the
    /// duty end to end, is faded as 2.
    #[inline]
    fn faded(&mut self, law: i32) -> i32 {
        if self.changed {
            self.changed = false;
            let last = if self.tracked { self.last_law } else { law };
            // Symmetric, so that its absolute value fits, too.
            self.fade = last.saturating_sub(law).max(-i32::MAX);
            // Rounded up: the fade ends within the configured time.
            match self
                .fade
                .unsigned_abs()
                .checked_div(self.config.bumpless_ticks)
            {
                // Below 2^31.
                Some(step) => self.fade_step = (step as i32).saturating_add(1),
                None => self.fade = 0,
            }
        } else if self.fade > 0 {
            self.fade = self.fade.wrapping_sub(self.fade_step).max(0);
        } else {
            self.fade = self.fade.wrapping_add(self.fade_step).min(0);
        }
        law.saturating_add(self.fade)
    }

    /// Minimum, dead-zone compensation and limit.
    #[inline]
    fn shaped(
        &self,
        law: i32,
        error: PositionMm,
        reference_velocity: VelocityMmS,
        limits: &mut JointLimits,
    ) -> Duty {
        let gains = self.config.gains();
        // At most 2^31: the sum stays below 2^32, because no duty of the gains is negative.
        let magnitude = law.unsigned_abs();
        if magnitude == 0 {
            return Duty::ZERO;
        }
        if magnitude < gains.minimum_duty.raw().cast_unsigned() {
            limits.below_minimum = true;
            return Duty::ZERO;
        }
        let away = error.saturating_abs() > gains.settle_band && same_sign(law, error.raw());
        let bridged = if away || same_sign(law, reference_velocity.raw()) {
            magnitude.wrapping_add(gains.dead_zone_duty.raw().cast_unsigned())
        } else {
            magnitude
        };
        let limit = gains.duty_limit.raw().cast_unsigned();
        limits.duty = bridged > limit;
        let cut = bridged.min(limit) as i32;
        Duty::from_raw(if law < 0 { cut.wrapping_neg() } else { cut })
    }

    /// Conditional, bounded integration; what it adds takes effect from the next tick on.
    #[inline]
    fn integrate(&mut self, error: PositionMm, duty: Duty, limits: &mut JointLimits) {
        let outside = error.saturating_abs() > self.config.gains().integral_zone;
        let pushes = limits.duty && same_sign(duty.raw(), error.raw());
        limits.integral_frozen = outside || pushes;
        if !limits.integral_frozen {
            let sum = self.integral.wrapping_add(i64::from(error.raw()));
            self.integral = within(sum, self.config.integral_limit);
        }
        limits.integral_clamped = self.integral.wrapping_abs() == self.config.integral_limit;
    }
}

/// See [`JointController::state`].
#[derive(Clone, Copy, Debug)]
pub struct State<'a>(&'a JointController);

impl Hash for State<'_> {
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Destructured, so that a new field cannot be forgotten here.
        let JointController {
            config: _,
            correction,
            tracked,
            changed,
            velocity,
            settle,
            integral,
            last_law,
            fade,
            fade_step,
            predictive,
        } = self.0;
        (correction, tracked, changed).hash(state);
        if let Some(law) = predictive {
            // The other laws start afresh after it.
            return law.hash(state);
        }
        (velocity, settle, integral, last_law, fade, fade_step).hash(state);
    }
}

/// `value` limited to ±`bound`. Not `clamp`, which panics if its bounds are swapped: the compiler can not see that a
/// bound is never negative.
#[inline]
fn within(value: i64, bound: i64) -> i64 {
    value.max(bound.wrapping_neg()).min(bound)
}

/// Whether both are positive or both negative.
#[inline]
const fn same_sign(a: i32, b: i32) -> bool {
    a != 0 && b != 0 && (a ^ b) >= 0
}

/// Exact product of two raw numbers.
#[inline]
fn product(a: i32, b: i32) -> i64 {
    i64::from(a).wrapping_mul(i64::from(b))
}

/// A raw error or velocity as fuzzy input, and whether it was cut to `scale`.
#[inline]
fn to_input(raw: i32, scale: i32, factor: i32) -> (i16, bool) {
    let cut = raw.max(scale.wrapping_neg()).min(scale);
    // |cut| × factor <= 32 767 × 2^28: the input is at most 32 767.
    let scaled = i64::from(cut).wrapping_mul(i64::from(factor));
    let input = shift_right_round_inner(scaled, INPUT_SHIFT) as i16;
    (input, cut != raw)
}
