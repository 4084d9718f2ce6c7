//! Parameters of a wheel board in the form that the application uses.

use crate::parameters::WheelParameters;
use crate::supervisor::{SupervisionTimes, watchdog};
use wheeleg_control::wheel::{LeadFilter, SampleTimer, WheelAcceleration, WheelMode};
use wheeleg_protocol::WheelControlMode;
use wheeleg_protocol::link::CYCLE_US;
use wheeleg_protocol::param::WheelParam;
use wheeleg_units::{Micros, Ticks};

/// Clock of the virtual HCTL-1100: 2 MHz, its maximum (data sheet p. 1).
const CLOCK_HZ: u32 = 2_000_000;

/// Everything that follows from the parameters, computed when they change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct WheelSettings {
    /// Digital filter.
    pub filter: LeadFilter,
    /// Sample timer.
    pub timer: SampleTimer,
    /// Largest speed of a profile and of a reference, counts per sample: 1…127.
    pub max_speed: u8,
    /// Acceleration of profiles.
    pub acceleration: WheelAcceleration,
    /// Watchdog and tick.
    pub times: SupervisionTimes,
    /// Time of the ramp to standstill.
    pub stop_ramp: Micros,
    /// Samples of one bus cycle.
    pub cycle_ticks: u32,
    /// Following error, counts, that is a fault if it lasts …
    pub following_error: u32,
    /// … for this many samples.
    pub following_ticks: Ticks,
}

impl WheelSettings {
    /// Computes the settings for a controller mode; `None` if the sample timer is below the minimum of the mode.
    pub fn new(parameters: &WheelParameters, mode: WheelControlMode) -> Option<Self> {
        use WheelParam as P;
        let raw = |parameter| u32::try_from(parameters.get(parameter)).unwrap_or(0);
        let byte = |parameter| u8::try_from(parameters.get(parameter)).unwrap_or(u8::MAX);
        let timer = SampleTimer(byte(P::SampleTimer));
        if timer < SampleTimer::minimum(control_mode(mode)) {
            return None;
        }
        let tick = sample_time(timer);
        let millis = |parameter| Micros::from_millis(raw(parameter));
        Some(Self {
            filter: LeadFilter {
                zero: byte(P::FilterZero),
                pole: byte(P::FilterPole),
                gain: byte(P::FilterGain),
            },
            timer,
            max_speed: byte(P::MaxSpeed).min(127),
            acceleration: WheelAcceleration::from_bits(
                u16::try_from(raw(P::Acceleration)).unwrap_or(0),
            ),
            times: SupervisionTimes {
                tick,
                watchdog: watchdog(parameters.get(P::WatchdogCycles)),
                hold: Micros::MAX,
                blow_through: Micros::ZERO,
            },
            stop_ramp: millis(P::StopRamp),
            cycle_ticks: Micros(CYCLE_US).to_ticks_ceil(tick).get(),
            following_error: raw(P::FollowingError),
            following_ticks: millis(P::FollowingTime).to_ticks_ceil(tick),
        })
    }
}

/// Sample time of a timer value at the virtual clock, in whole microseconds: 8 (T + 1), exact at 2 MHz.
pub(super) fn sample_time(timer: SampleTimer) -> Micros {
    let nanos = timer.period_ns(CLOCK_HZ);
    Micros(u32::try_from(nanos.checked_div(1000).unwrap_or(0)).unwrap_or(u32::MAX))
}

/// The controller mode for a mode of the wire protocol.
pub(super) const fn control_mode(mode: WheelControlMode) -> WheelMode {
    match mode {
        WheelControlMode::Idle => WheelMode::Idle,
        WheelControlMode::Position => WheelMode::Position,
        WheelControlMode::ProportionalVelocity => WheelMode::ProportionalVelocity,
        WheelControlMode::Trapezoidal => WheelMode::Trapezoidal,
        WheelControlMode::IntegralVelocity => WheelMode::IntegralVelocity,
    }
}
