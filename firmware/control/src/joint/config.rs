//! Gains in physical units, and the validated configuration computed from them.

use super::types::Law;
use crate::axis::{AxisData, AxisField, AxisModel};
use crate::gain::Gain;
use crate::paper::fuzzy::GridRules;
use crate::paper::rules;
use crate::paper::velocity::VelocityWindow;
use core::hash::{Hash, Hasher};
use wheeleg_units::{Duty, Micros, PositionMm, VelocityMmS, divide_signed, saturate_i32};

/// Rule base of a joint correction: seven by seven sets.
pub type JointRules = GridRules<7, 7>;

/// Parameters of a joint controller in physical units.
///
/// [`JointGains::default`] is a cautious start for a bore 20 mm, stroke 180 mm cylinder with throttled valves. Each
/// field states its effect and its sensible range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct JointGains {
    /// Kp, duty per millimetre of error. Range 0…4; sensible 0.005…0.1. Larger is
    /// faster and stiffer, until the pressure lag makes it overshoot.
    pub proportional: Gain,
    /// Duty at full output of the PD rule base. Range 0…2; sensible 0.2…1. This is
    /// where the damping comes from: raise it with Kp.
    pub correction_pd: Gain,
    /// Duty at full output of the ID rule base. Range 0…2; sensible 0.2…1.
    pub correction_id: Gain,
    /// Duty per mm/s of reference velocity. Range 0…0.1; sensible 1/(top speed), 0.002…0.004 for 250…500 mm/s. Removes
    /// the lag behind a moving reference.
    pub feed_forward: Gain,
    /// Error at the edge of the rule base. 0.25…1000 mm; sensible 10…60.
    pub error_scale: PositionMm,
    /// Velocity error at the edge of the rule base. 1…5000 mm/s; sensible 200…500.
    pub velocity_scale: VelocityMmS,
    /// Time integral of the error at the edge of the rule base, in mm·s (the number of the `PositionMm` is in mm·s),
    /// and its anti-windup bound. 0.05…1000; sensible 0.5…10.
    pub integral_scale: PositionMm,
    /// The integral advances only while |error| is at most this. 0…1000 mm;
    /// sensible 5…30: outside it, the proportional term does the work.
    pub integral_zone: PositionMm,
    /// Largest |duty|. 0…1, above `minimum_duty` and `dead_zone_duty`.
    pub duty_limit: Duty,
    /// Duty added, with its sign, to a duty that drives towards the reference from outside the settle band, or along a
    /// moving reference; not added to one that brakes. It bridges the static friction and the shortest opening that a
    /// valve can make. 0…0.5; sensible (t_off + margin) / PWM period, 0.05…0.25; below that, small duties give pulses
    /// that [`crate::pwm`] can not send.
    pub dead_zone_duty: Duty,
    /// |duty| of the law below which the valves stay shut. 0…0.5; sensible 0.005…0.03. Must exceed what Kp makes of
    /// measurement noise.
    pub minimum_duty: Duty,
    /// At rest, all valves shut, when |error| is at most this … 0…100 mm; sensible
    /// 0.3…1, at least half of what the shortest opening moves the piston.
    pub settle_band: PositionMm,
    /// … and |velocity| is at most this … 0.1…1000 mm/s; sensible 5…20, above the
    /// noise of the velocity estimate.
    pub settle_velocity: VelocityMmS,
    /// … and settled after this long. 0…10 s; sensible 20…100 ms.
    pub settle_dwell: Micros,
    /// Released when |error| exceeds this; larger than `settle_band` by more
    /// than the measurement noise. Sensible 2…3 times the settle band.
    pub release_band: PositionMm,
    /// … for this long: one noisy sample does not move a valve. 0…1 s; sensible 3 ms.
    pub release_dwell: Micros,
    /// Time over which the step after a change of law is faded out. 0…10 s; sensible 50…200 ms.
    pub bumpless_time: Micros,
    /// Window of the velocity estimate, in ticks: 2…64; sensible 10…32. Its delay
    /// is (N − 1)/2 ticks; its noise falls with N^1.5.
    pub velocity_window: u8,
    /// Lower limit of the reference, in the stroke.
    pub stroke_min: PositionMm,
    /// Upper limit of the reference, in the stroke.
    pub stroke_max: PositionMm,
    /// Control law.
    pub law: Law,
    /// Ki of the PID law, duty per mm·s. Range 0…100.
    pub integral: Gain,
    /// Kd of the PID law, duty per mm/s of velocity error. Range 0…1.
    pub derivative: Gain,
    /// T of the sliding surface e + T ė. 0…1 s; sensible: the time in which the
    /// axis stops, 30…100 ms.
    pub sliding_time: Micros,
    /// Data of the axis, for the predictive law.
    pub axis: AxisData,
    /// Valve PWM period: 10…20 ms for 50…100 Hz (ASSUMED), longer for slower valves; a whole number of ticks in 1 ms…1
    /// s.
    pub pwm_period: Micros,
}

impl Default for JointGains {
    fn default() -> Self {
        Self {
            proportional: const { Gain::lit("0.02") },
            correction_pd: const { Gain::lit("0.6") },
            correction_id: const { Gain::lit("0.6") },
            feed_forward: Gain::ZERO,
            error_scale: PositionMm::from_int(40),
            velocity_scale: VelocityMmS::from_int(400),
            integral_scale: PositionMm::from_int(4),
            integral_zone: PositionMm::from_int(15),
            duty_limit: Duty::ONE,
            dead_zone_duty: Duty::from_per_mille(120),
            minimum_duty: Duty::from_per_mille(10),
            settle_band: PositionMm::from_raw(52_429),
            settle_velocity: VelocityMmS::from_int(10),
            settle_dwell: Micros::from_millis(40),
            release_band: PositionMm::from_int(2),
            release_dwell: Micros::from_millis(3),
            bumpless_time: Micros::from_millis(100),
            velocity_window: 16,
            stroke_min: PositionMm::ZERO,
            stroke_max: PositionMm::from_int(180),
            law: Law::Fuzzy,
            integral: Gain::ZERO,
            derivative: Gain::ZERO,
            sliding_time: Micros::from_millis(50),
            axis: AxisData::default(),
            pwm_period: Micros::from_millis(20),
        }
    }
}

/// Which parameter was rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum JointParameter {
    /// The control tick given to the builder.
    Tick,
    /// [`JointGains::proportional`].
    Proportional,
    /// [`JointGains::correction_pd`].
    CorrectionPd,
    /// [`JointGains::correction_id`].
    CorrectionId,
    /// [`JointGains::feed_forward`].
    FeedForward,
    /// [`JointGains::error_scale`].
    ErrorScale,
    /// [`JointGains::velocity_scale`].
    VelocityScale,
    /// [`JointGains::integral_scale`].
    IntegralScale,
    /// [`JointGains::integral_zone`].
    IntegralZone,
    /// [`JointGains::duty_limit`].
    DutyLimit,
    /// [`JointGains::dead_zone_duty`].
    DeadZoneDuty,
    /// [`JointGains::minimum_duty`].
    MinimumDuty,
    /// [`JointGains::settle_band`].
    SettleBand,
    /// [`JointGains::settle_velocity`].
    SettleVelocity,
    /// [`JointGains::settle_dwell`].
    SettleDwell,
    /// [`JointGains::release_band`].
    ReleaseBand,
    /// [`JointGains::release_dwell`].
    ReleaseDwell,
    /// [`JointGains::bumpless_time`].
    BumplessTime,
    /// [`JointGains::velocity_window`].
    VelocityWindow,
    /// [`JointGains::stroke_min`] and [`JointGains::stroke_max`].
    Stroke,
    /// [`JointGains::pwm_period`].
    PwmPeriod,
    /// [`JointGains::integral`].
    Integral,
    /// [`JointGains::derivative`].
    Derivative,
    /// [`JointGains::sliding_time`].
    SlidingTime,
    /// A rule base given to the builder.
    Rules,
    /// [`JointGains::axis`].
    Axis(AxisField),
}

/// A parameter outside its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ConfigError {
    /// The parameter is outside its documented range.
    OutOfRange(JointParameter),
    /// The parameter contradicts another one: the release band does not exceed
    /// the settle band, the minimum or the dead-zone duty is not below the limit, the stroke is
    /// empty, or the PWM period is not a whole number of ticks.
    Inconsistent(JointParameter),
}

// Code that runs once, at start-up or for a request, is marked `#[inline]`, here and in what it calls. It is then
// compiled in the calling crate, which on a joint board is compiled for size, while the code of a tick is compiled
// here, for speed.

/// The shipped rule bases, each at a single address.
static RULES_PD: JointRules = rules::PD;
static RULES_ID: JointRules = rules::ID;

/// A validated configuration: raw coefficients for one tick length.
///
/// Its `Hash` is for sealing memory; the rule bases, which are constants, enter it by their address.
#[derive(Clone, Copy, Debug)]
pub struct JointConfig {
    gains: JointGains,
    tick: Micros,
    pub(super) rules_pd: &'static JointRules,
    pub(super) rules_id: &'static JointRules,
    /// Fuzzy input per raw error, × 2^28.
    pub(super) error_to_input: i32,
    /// Fuzzy input per raw velocity, × 2^28.
    pub(super) velocity_to_input: i32,
    /// Fuzzy input per unit of the error sum, × 2^40.
    pub(super) integral_to_input: i64,
    /// Bound of the error sum: raw mm × ticks.
    pub(super) integral_limit: i64,
    pub(super) window: VelocityWindow,
    pub(super) settle_ticks: u32,
    pub(super) release_ticks: u32,
    pub(super) bumpless_ticks: u32,
    /// Coefficients of the predictive law, when it is chosen.
    pub(super) axis: Option<AxisModel>,
}

/// Fractional bits of the factors from error and velocity to a fuzzy input.
pub(super) const INPUT_SHIFT: u32 = 28;
/// Fractional bits of the factor from the error sum to a fuzzy input.
pub(super) const INTEGRAL_SHIFT: u32 = 40;
/// Full scale of a fuzzy input and output of the joint rules.
const FULL_SCALE: i64 = 32_767;

impl JointConfig {
    /// Checks the gains and computes the coefficients for a control tick of `tick` (100 µs…2 ms), with the shipped rule
    /// bases.
    ///
    /// # Errors
    /// [`ConfigError`] names the first parameter that is out of its range.
    #[inline]
    pub fn new(gains: &JointGains, tick: Micros) -> Result<Self, ConfigError> {
        Self::with_rules(gains, tick, &RULES_PD, &RULES_ID)
    }

    /// As [`JointConfig::new`], with the caller's own rule bases. Their inputs and outputs have full scale ±32 767, and
    /// at most two neighbouring sets of an input may overlap, because a tick has time for four rules only.
    ///
    /// # Errors
    /// [`ConfigError`] names the first parameter that is out of its range.
    #[inline]
    pub fn with_rules(
        gains: &JointGains,
        tick: Micros,
        rules_pd: &'static JointRules,
        rules_id: &'static JointRules,
    ) -> Result<Self, ConfigError> {
        use JointParameter as P;
        check(P::Tick, tick.get(), 100, 2000)?;
        let window = VelocityWindow::new(gains.velocity_window, tick.get())
            .ok_or(ConfigError::OutOfRange(P::VelocityWindow))?;
        if !(rules_pd.is_fan() && rules_id.is_fan()) {
            return Err(ConfigError::OutOfRange(P::Rules));
        }
        check_ranges(gains)?;
        check_relations(gains, tick)?;

        let axis = match gains.law {
            Law::Predictive => Some(
                AxisModel::new(&gains.axis, tick)
                    .map_err(|field| ConfigError::OutOfRange(P::Axis(field)))?,
            ),
            _ => None,
        };
        let integral_limit = divide_signed(
            i64::from(gains.integral_scale.raw()).saturating_mul(1_000_000),
            i64::from(tick.get()),
        );
        Ok(Self {
            gains: *gains,
            tick,
            rules_pd,
            rules_id,
            error_to_input: input_factor(gains.error_scale.raw()),
            velocity_to_input: input_factor(gains.velocity_scale.raw()),
            integral_to_input: factor(INTEGRAL_SHIFT, integral_limit),
            integral_limit,
            window,
            settle_ticks: gains.settle_dwell.to_ticks_ceil(tick).get(),
            release_ticks: gains.release_dwell.to_ticks_ceil(tick).get(),
            bumpless_ticks: gains.bumpless_time.to_ticks_ceil(tick).get(),
            axis,
        })
    }

    /// The gains this configuration was made of.
    #[must_use]
    pub const fn gains(&self) -> &JointGains {
        &self.gains
    }

    /// The control tick this configuration was made for.
    #[must_use]
    pub const fn tick(&self) -> Micros {
        self.tick
    }
}

impl JointConfig {
    /// Coefficients of the predictive law, when it is chosen.
    #[must_use]
    pub const fn axis(&self) -> Option<&AxisModel> {
        self.axis.as_ref()
    }
}

impl Hash for JointConfig {
    fn hash<H: Hasher>(&self, state: &mut H) {
        // Destructured, so that a new field cannot be forgotten here.
        let Self {
            gains,
            tick,
            rules_pd,
            rules_id,
            error_to_input,
            velocity_to_input,
            integral_to_input,
            integral_limit,
            window,
            settle_ticks,
            release_ticks,
            bumpless_ticks,
            axis,
        } = self;
        (gains.stroke_min, gains.stroke_max, gains.law, tick).hash(state);
        axis.hash(state);
        if axis.is_some() {
            // The predictive law does not use the rest.
            return;
        }
        gains.hash(state);
        core::ptr::hash(*rules_pd, state);
        core::ptr::hash(*rules_id, state);
        (error_to_input, velocity_to_input).hash(state);
        (integral_to_input, integral_limit, window).hash(state);
        (settle_ticks, release_ticks, bumpless_ticks).hash(state);
    }
}

/// Full scale / `scale`, × 2^28: below 2^30, because no scale is below 2^14.
#[inline]
fn input_factor(scale: i32) -> i32 {
    saturate_i32(factor(INPUT_SHIFT, i64::from(scale)))
}

/// Full scale / `scale`, × 2^bits.
#[inline]
fn factor(bits: u32, scale: i64) -> i64 {
    divide_signed(FULL_SCALE.wrapping_shl(bits), scale)
}

fn check<T: PartialOrd>(
    parameter: JointParameter,
    value: T,
    low: T,
    high: T,
) -> Result<(), ConfigError> {
    if value >= low && value <= high {
        Ok(())
    } else {
        Err(ConfigError::OutOfRange(parameter))
    }
}

#[inline]
fn check_ranges(gains: &JointGains) -> Result<(), ConfigError> {
    use JointParameter as P;
    let zero = Gain::ZERO;
    let mm = PositionMm::from_int;
    let half = Duty::from_per_mille(500);
    check(
        P::Proportional,
        gains.proportional,
        zero,
        const { Gain::lit("4") },
    )?;
    check(
        P::CorrectionPd,
        gains.correction_pd,
        zero,
        const { Gain::lit("2") },
    )?;
    check(
        P::CorrectionId,
        gains.correction_id,
        zero,
        const { Gain::lit("2") },
    )?;
    check(
        P::FeedForward,
        gains.feed_forward,
        zero,
        const { Gain::lit("0.1") },
    )?;
    check(
        P::ErrorScale,
        gains.error_scale,
        PositionMm::from_raw(16_384),
        mm(1000),
    )?;
    let (low, high) = (VelocityMmS::from_int(1), VelocityMmS::from_int(5000));
    check(P::VelocityScale, gains.velocity_scale, low, high)?;
    check(
        P::IntegralScale,
        gains.integral_scale,
        PositionMm::from_raw(3277),
        mm(1000),
    )?;
    check(
        P::IntegralZone,
        gains.integral_zone,
        PositionMm::ZERO,
        mm(1000),
    )?;
    check(P::DutyLimit, gains.duty_limit, Duty::ZERO, Duty::ONE)?;
    check(P::DeadZoneDuty, gains.dead_zone_duty, Duty::ZERO, half)?;
    check(P::MinimumDuty, gains.minimum_duty, Duty::ZERO, half)?;
    check(P::SettleBand, gains.settle_band, PositionMm::ZERO, mm(100))?;
    let (low, high) = (VelocityMmS::from_raw(6554), VelocityMmS::from_int(1000));
    check(P::SettleVelocity, gains.settle_velocity, low, high)?;
    check(
        P::SettleDwell,
        gains.settle_dwell,
        Micros::ZERO,
        Micros::from_millis(10_000),
    )?;
    check(
        P::ReleaseBand,
        gains.release_band,
        PositionMm::ZERO,
        mm(200),
    )?;
    check(
        P::ReleaseDwell,
        gains.release_dwell,
        Micros::ZERO,
        Micros::from_millis(1000),
    )?;
    check(
        P::BumplessTime,
        gains.bumpless_time,
        Micros::ZERO,
        Micros::from_millis(10_000),
    )?;
    check(P::Stroke, gains.stroke_min, mm(-1000), mm(1000))?;
    check(P::Stroke, gains.stroke_max, mm(-1000), mm(1000))?;
    let most = const { Gain::lit("100") };
    check(P::Integral, gains.integral, zero, most)?;
    let most = const { Gain::lit("1") };
    check(P::Derivative, gains.derivative, zero, most)?;
    check(
        P::SlidingTime,
        gains.sliding_time,
        Micros::ZERO,
        Micros::from_millis(1000),
    )?;
    check(
        P::PwmPeriod,
        gains.pwm_period,
        Micros::from_millis(1),
        Micros::from_millis(1000),
    )
}

#[inline]
fn check_relations(gains: &JointGains, tick: Micros) -> Result<(), ConfigError> {
    use JointParameter as P;
    let relations = [
        (P::ReleaseBand, gains.release_band > gains.settle_band),
        (P::MinimumDuty, gains.minimum_duty < gains.duty_limit),
        (P::DeadZoneDuty, gains.dead_zone_duty < gains.duty_limit),
        (P::Stroke, gains.stroke_min < gains.stroke_max),
        (
            P::PwmPeriod,
            gains.pwm_period.get().checked_rem(tick.get()) == Some(0),
        ),
    ];
    for (parameter, holds) in relations {
        if !holds {
            return Err(ConfigError::Inconsistent(parameter));
        }
    }
    Ok(())
}
