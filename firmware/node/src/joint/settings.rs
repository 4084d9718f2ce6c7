//! Parameters of a joint board in the form that the application uses.

use core::hash::Hash;

use super::air::SUPPLY;
use super::no_motion_detector::MotionModel;
use crate::JOINT_TICK;
use crate::parameters::JointParameters;
use crate::sensor::SensorConfig;
use crate::supervisor::{SupervisionTimes, watchdog};
use wheeleg_control::axis::AxisData;
use wheeleg_control::joint::{Correction, Gain, JointConfig, JointGains, Law};
use wheeleg_control::law::reference_generator::GeneratorConfig;
use wheeleg_control::pwm::PwmTiming;
use wheeleg_control::valve::{ValveMode, ValveOpenings, allocate};
use wheeleg_protocol::param::JointParam;
use wheeleg_units::{AdcCode, Duty, Micros, PositionMm, Ticks, VelocityMmS, divide_signed};

/// Margin by which a valve pulse must exceed the switching delay, µs (ASSUMED: a tenth of the VQ110's 3.5 ms).
const PULSE_MARGIN: Micros = Micros(350);

/// Longest PWM period at which chambers are filled: with one pulse of a 64th of the supply per period they reach 1 bar
/// in 1.6 s of the 2 s that a precharge may take (`joint_precharge.rs`).
const PRECHARGE_PERIOD: Micros = Micros(60_000);

/// Longest literal blow-through (ASSUMED: empties a 2 l reservoir).
const BLOW_THROUGH_TIME: Micros = Micros::from_millis(5000);

/// Everything that follows from the parameters, computed when they change. The controller, the PWM and the supervision
/// keep their parts; the board keeps `tick`.
#[derive(Clone, Debug)]
pub struct JointSettings {
    /// Control law.
    pub control: JointConfig,
    /// Valve timing.
    pub timing: PwmTiming,
    /// Watchdog and staging.
    pub times: SupervisionTimes,
    /// The rest.
    pub tick: TickSettings,
}

/// The settings that the board application itself uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TickSettings {
    /// Position sensor.
    pub sensor: SensorConfig,
    /// Correction after start-up.
    pub correction: Correction,
    /// Largest change of the reference per tick.
    pub slew_step: PositionMm,
    /// Velocity of a reference at the slew limit.
    pub slew_rate: VelocityMmS,
    /// Generator of the predictive law's reference; `None`: the law follows the command within the slew limit.
    pub generator: Option<GeneratorConfig>,
    /// Following error that is a fault if it lasts …
    pub following_error: PositionMm,
    /// … for this many ticks.
    pub following_ticks: Ticks,
    /// What is expected of the piston.
    pub motion: MotionModel,
    /// Absolute pressure to which both chambers are filled after arming, 2^-17 of the supply pressure; 0: no precharge.
    pub precharge: i32,
    /// Outlet openings of a staged exhaust.
    pub staged_exhaust: ValveOpenings,
    /// Opening of a valve that stays open.
    pub full_period: Micros,
}

impl JointSettings {
    /// Computes the settings; `None` if parameters contradict each other.
    pub fn new(parameters: &JointParameters) -> Option<Self> {
        use JointParam as P;
        let raw = |parameter| parameters.get(parameter);
        let micros = |parameter| Micros(u32::try_from(raw(parameter)).unwrap_or(0));
        let millis = |parameter| Micros::from_millis(u32::try_from(raw(parameter)).unwrap_or(0));
        // The table permits only codes (checked by a test).
        let code = |parameter| AdcCode::new(raw(parameter) as u16);
        let position = |parameter| PositionMm::from_raw(raw(parameter));

        let gains = gains(parameters);
        let control = JointConfig::new(&gains, JOINT_TICK).ok()?;
        let timing = PwmTiming::new(
            gains.pwm_period,
            JOINT_TICK,
            micros(P::ValveOn),
            micros(P::ValveOff),
            PULSE_MARGIN,
        )
        .ok()?;
        let sensor = SensorConfig {
            zero: code(P::SensorZero),
            full_scale: position(P::SensorFullScale),
            code_min: code(P::SensorCodeMin),
            code_max: code(P::SensorCodeMax),
            travel_min: position(P::SensorMin),
            travel_max: position(P::SensorMax),
            step_max: per_tick(raw(P::SensorRate)),
        };
        if sensor.code_min >= sensor.code_max || sensor.travel_min >= sensor.travel_max {
            return None;
        }
        let motion = MotionModel::new(&gains, position(P::MotionMargin))?;
        let precharge = precharge(raw(P::Precharge), &gains, &motion)?;
        let exhaust_duty = Duty::from_raw(raw(P::ExhaustDuty));
        let [opening, ..] = allocate(exhaust_duty, gains.pwm_period).0;
        // A pulse too short for the valve would never exhaust at all.
        let opening = opening.max(timing.shortest_opening());
        Some(Self {
            control,
            timing,
            times: SupervisionTimes {
                tick: JOINT_TICK,
                watchdog: watchdog(raw(P::WatchdogCycles)),
                hold: millis(P::HoldTime),
                blow_through: BLOW_THROUGH_TIME,
            },
            tick: TickSettings {
                sensor,
                correction: if raw(P::Correction) == 0 {
                    Correction::Pd
                } else {
                    Correction::Id
                },
                slew_step: per_tick(raw(P::SlewRate)),
                slew_rate: VelocityMmS::from_raw(raw(P::SlewRate)),
                generator: generator(parameters, gains.law),
                following_error: position(P::FollowingError),
                following_ticks: millis(P::FollowingTime).to_ticks_ceil(JOINT_TICK),
                motion,
                precharge,
                staged_exhaust: ValveMode::Exhaust.openings(opening),
                full_period: gains.pwm_period,
            },
        })
    }
}

/// The reference generator that these parameters demand. The other laws follow the command, because the step makes
/// their error.
fn generator(parameters: &JointParameters, law: Law) -> Option<GeneratorConfig> {
    use JointParam as P;
    let acceleration = parameters.get(P::ReferenceAcceleration) >> 16;
    (law == Law::Predictive && acceleration > 0).then(|| GeneratorConfig {
        speed: VelocityMmS::from_raw(parameters.get(P::SlewRate)),
        acceleration,
        lead: PositionMm::from_raw(parameters.get(P::ReferenceLead)),
    })
}

/// The gains of the control crate from raw parameters; the formats agree row by row.
fn gains(parameters: &JointParameters) -> JointGains {
    use JointParam as P;
    let gain = |parameter| Gain::from_bits(parameters.get(parameter));
    let position = |parameter| PositionMm::from_raw(parameters.get(parameter));
    let velocity = |parameter| VelocityMmS::from_raw(parameters.get(parameter));
    let duty = |parameter| Duty::from_raw(parameters.get(parameter));
    let micros = |parameter| Micros(u32::try_from(parameters.get(parameter)).unwrap_or(0));
    JointGains {
        proportional: gain(P::Proportional),
        correction_pd: gain(P::CorrectionPd),
        correction_id: gain(P::CorrectionId),
        feed_forward: gain(P::FeedForward),
        error_scale: position(P::ErrorScale),
        velocity_scale: velocity(P::VelocityScale),
        integral_scale: position(P::IntegralScale),
        integral_zone: position(P::IntegralZone),
        duty_limit: duty(P::DutyLimit),
        dead_zone_duty: duty(P::DeadZoneDuty),
        minimum_duty: duty(P::MinimumDuty),
        settle_band: position(P::SettleBand),
        settle_velocity: velocity(P::SettleVelocity),
        settle_dwell: micros(P::SettleDwell),
        release_band: position(P::ReleaseBand),
        release_dwell: micros(P::ReleaseDwell),
        bumpless_time: micros(P::BumplessTime),
        velocity_window: u8::try_from(parameters.get(P::VelocityWindow)).unwrap_or(0),
        stroke_min: position(P::StrokeMin),
        stroke_max: position(P::StrokeMax),
        pwm_period: micros(P::PwmPeriod),
        law: usize::try_from(parameters.get(P::Law))
            .ok()
            .and_then(|number| Law::ALL.get(number).copied())
            .unwrap_or_default(),
        integral: gain(P::Integral),
        derivative: gain(P::Derivative),
        sliding_time: micros(P::SlidingTime),
        axis: AxisData {
            bore: position(P::Bore),
            rod: position(P::Rod),
            dead_a: position(P::DeadVolumeA),
            dead_b: position(P::DeadVolumeB),
            conductance: gain(P::Conductance),
            critical_ratio: gain(P::CriticalRatio),
            supply: position(P::SupplyPressure),
            mass: position(P::MovingMass),
            standing_mass: position(P::StandingMass),
            coulomb: position(P::FrictionCoulomb),
            breakaway: position(P::FrictionBreakaway),
            viscous: position(P::FrictionViscous),
            valve_on: micros(P::ValveOn),
            valve_off: micros(P::ValveOff),
            margin: PULSE_MARGIN,
            line_delay: micros(P::LineDelay),
            band: position(P::RestBand),
            release: position(P::RestRelease),
            precharged: parameters.get(P::Precharge) > 0,
            learns_mass: parameters.get(P::MassLearning) != 0,
            stroke: position(P::StrokeMax),
        },
    }
}

/// Pressure of a precharge to `bar` (raw bar, gauge) on this supply (raw kPa, absolute), in the unit of
/// [`TickSettings::precharge`]. `None` if it is more than seven eighths of the supply, which the air model is not sure
/// to reach, or if the pulses are too infrequent to reach 1 bar in time.
fn precharge(bar: i32, gains: &JointGains, motion: &MotionModel) -> Option<i32> {
    if bar == 0 {
        return Some(0);
    }
    if gains.pwm_period > PRECHARGE_PERIOD {
        return None;
    }
    let supply = gains.axis.supply;
    let share = i64::from(bar).saturating_mul(100 << 17);
    let share = divide_signed(share, i64::from(supply.raw()));
    let absolute = i64::from(motion.ambient()).saturating_add(share);
    let absolute = i32::try_from(absolute).ok()?;
    (absolute <= SUPPLY / 8 * 7).then_some(absolute)
}

/// A rate in raw mm/s as raw mm per joint tick, rounded down, but at least one step.
fn per_tick(rate_raw: i32) -> PositionMm {
    let product = i64::from(rate_raw).saturating_mul(i64::from(JOINT_TICK.get()));
    let step = divide_signed(product, 1_000_000);
    PositionMm::from_raw(i32::try_from(step).unwrap_or(i32::MAX).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_control::joint::ConfigError;

    #[test]
    fn defaults_of_the_table_are_those_of_the_control_law() {
        assert_eq!(gains(&JointParameters::default()), JointGains::default());
    }

    #[test]
    fn codes_are_codes() {
        for parameter in [
            JointParam::SensorZero,
            JointParam::SensorCodeMin,
            JointParam::SensorCodeMax,
        ] {
            let row = parameter.info();
            assert!(u16::try_from(row.min).is_ok() && u16::try_from(row.max).is_ok());
        }
    }

    #[test]
    fn the_default_dead_zone_bridges_the_shortest_opening_and_not_much_more() {
        let settings = JointSettings::new(&JointParameters::default()).unwrap();
        let gains = settings.control.gains();
        let [added, ..] = allocate(gains.dead_zone_duty, gains.pwm_period).0;
        let shortest = settings.timing.shortest_opening();
        assert!(added >= shortest, "{added:?} {shortest:?}");
        assert!(
            added.get() <= shortest.get() * 5 / 4,
            "{added:?} {shortest:?}"
        );
    }

    #[test]
    fn bounds_of_the_table_are_accepted_by_the_control_law() {
        // Rows of the law, each at both limits, with the parameters related to them out of the way.
        for parameter in JointParam::ALL {
            let row = parameter.info();
            for raw in [row.min, row.max] {
                let mut trial = JointParameters::default();
                for (id, partner) in [
                    (JointParam::MinimumDuty, 0),
                    (JointParam::DeadZoneDuty, 0),
                    (JointParam::SettleBand, 0),
                    (JointParam::ReleaseBand, JointParam::ReleaseBand.info().max),
                    (JointParam::StrokeMin, JointParam::StrokeMin.info().min),
                    (JointParam::StrokeMax, JointParam::StrokeMax.info().max),
                ] {
                    trial = trial.with(id.id(), partner, true).unwrap();
                }
                trial = trial.with(row.id, raw, true).unwrap();
                let result = JointConfig::new(&gains(&trial), JOINT_TICK);
                let contradiction = matches!(result, Err(ConfigError::Inconsistent(_)));
                assert!(
                    result.is_ok() || contradiction,
                    "{} {raw}: {result:?}",
                    row.name
                );
            }
        }
    }
}
