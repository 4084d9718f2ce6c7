//! What goes into and comes out of a wheel controller each sample.

use fixed::types::extra::{U4, U8};
use fixed::{FixedI16, FixedU16};
use wheeleg_units::WheelCount;

/// Velocity of proportional velocity mode: I12F4 counts per sample, ±2048.
pub type WheelVelocity = FixedI16<U4>;

/// Acceleration: U8F8 counts per sample²; 0…127.996 is allowed.
pub type WheelAcceleration = FixedU16<U8>;

/// Operating mode (HCTL-1100 data sheet p. 31–35).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum WheelMode {
    /// INIT/IDLE: motor command zero, filter memory cleared. The only mode from
    /// which another may be entered.
    #[default]
    Idle,
    /// Position control: 24-bit command − 24-bit actual through the filter.
    Position,
    /// Proportional velocity: only the gain acts, on the velocity error.
    ProportionalVelocity,
    /// Trapezoidal profile in progress; ends by itself in [`WheelMode::Position`].
    Trapezoidal,
    /// Integral velocity: the position command advances at a velocity that ramps
    /// at the acceleration.
    IntegralVelocity,
}

/// Lead filter D(z) = K (z − A/256) / (4 (z + B/256)) (data sheet p. 23).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LeadFilter {
    /// A, register 20H: the zero stands at z = A/256.
    pub zero: u8,
    /// B, register 21H: the pole stands at z = −B/256.
    pub pole: u8,
    /// K, register 22H, in quarters: 64 is a high-frequency gain of 16.
    pub gain: u8,
}

impl Default for LeadFilter {
    /// The chip's reset values: A = E5H, B = K = 40H.
    fn default() -> Self {
        Self {
            zero: 0xE5,
            pole: 0x40,
            gain: 0x40,
        }
    }
}

/// Sample timer T: the sample time is 16 (T + 1) / f_clk (data sheet p. 24).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SampleTimer(pub u8);

impl Default for SampleTimer {
    /// The chip's reset value, 40H: 520 µs at 2 MHz.
    fn default() -> Self {
        Self(0x40)
    }
}

impl SampleTimer {
    /// Sample time in nanoseconds, rounded to nearest, for a clock of `clock_hz`; zero for a clock of zero.
    #[must_use]
    pub const fn period_ns(self, clock_hz: u32) -> u64 {
        let clocks = (self.0 as u64).wrapping_add(1).wrapping_mul(16);
        let half = (clock_hz as u64).wrapping_shr(1);
        // clocks <= 4096: the product is below 2^42.
        let scaled = clocks.wrapping_mul(1_000_000_000).wrapping_add(half);
        match scaled.checked_div(clock_hz as u64) {
            Some(period) => period,
            None => 0,
        }
    }

    /// Smallest T of a mode (data sheet Table 4; the values are RECALLED): 7 in
    /// position and proportional velocity mode, 15 where a profile is generated.
    /// Idle has none.
    #[must_use]
    pub const fn minimum(mode: WheelMode) -> Self {
        match mode {
            WheelMode::Idle => Self(0),
            WheelMode::Position | WheelMode::ProportionalVelocity => Self(7),
            WheelMode::Trapezoidal | WheelMode::IntegralVelocity => Self(15),
        }
    }
}

/// Inputs of one sample, latched at its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct WheelInput {
    /// Encoder position.
    pub actual: WheelCount,
    /// LIMIT input active: goes to idle at once, motor command zero. The pin itself is active low; `true` means that it
    /// is triggered.
    pub limit: bool,
    /// STOP input active: in integral velocity mode, ramps to a standstill and holds.
    pub stop: bool,
}

/// Result of one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WheelOutput {
    /// Motor command, −128…127: the 8-bit port.
    pub motor_command: i8,
    /// PWM duty in per cent with its sign, −100…100.
    pub pwm: i8,
    /// The first PWM period of this sample is blanked, because the sign changed.
    pub blank_first_pulse: bool,
    /// Mode in which this sample was computed.
    pub mode: WheelMode,
    /// Position command of this sample; the actual position where the mode has none.
    pub command: WheelCount,
    /// Command − actual, in counts; in proportional velocity mode the velocity error in
    /// sixteenths of a count per sample.
    pub error: i32,
    /// Change of the actual position since the last sample, counts.
    pub velocity: i32,
    /// Status flags of this sample.
    pub status: WheelStatus,
}

/// Status flags (data sheet Table 3), and what limited the output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct WheelStatus {
    /// LIMIT was triggered; stays until cleared with the input inactive.
    pub limit: bool,
    /// STOP was triggered; stays until cleared with the input inactive.
    pub stop: bool,
    /// A trapezoidal profile is in progress (F0). False means that the profile has
    /// been generated, not that the wheel has arrived.
    pub profile: bool,
    /// The motor command was cut to 8 bits.
    pub command_saturated: bool,
    /// The PWM was cut to ±100.
    pub pwm_saturated: bool,
}

/// Why a request was refused; then nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum WheelError {
    /// A mode can be entered from idle only.
    NotIdle,
    /// A profile is running; it accepts no new data.
    ProfileActive,
    /// A profile can be started from idle or position control only.
    NotPositioning,
    /// LIMIT is latched: clear the status first.
    LimitLatched,
    /// LIMIT or STOP is still active at its input, so its flag can not be cleared.
    InputActive,
    /// The sample timer is below the minimum of the mode.
    SampleTimer {
        /// Smallest timer of the mode.
        minimum: SampleTimer,
    },
    /// Acceleration above 127.996, or zero for a profile.
    Acceleration,
    /// Maximum velocity above 127, or zero for a profile.
    MaximumVelocity,
    /// Two successive velocity commands differ by more than 127.
    VelocityStep,
}

/// A typed request to the controller: what the bus commands map to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WheelCommand {
    /// Soft reset: as after power-on, including the parameters.
    Reset,
    /// To INIT/IDLE: motor command zero, filter memory cleared.
    Idle,
    /// From idle into a mode. [`WheelMode::Idle`] acts as [`WheelCommand::Idle`];
    /// [`WheelMode::Trapezoidal`] starts a profile to the final position.
    Enter(WheelMode),
    /// Position command of position control.
    Position(WheelCount),
    /// Velocity of proportional velocity mode.
    Velocity(WheelVelocity),
    /// Velocity of integral velocity mode, counts per sample.
    IntegralVelocity(i8),
    /// Acceleration of integral velocity and trapezoidal mode.
    Acceleration(WheelAcceleration),
    /// Maximum velocity of trapezoidal mode, 0…127 counts per sample.
    MaximumVelocity(u8),
    /// Final position of trapezoidal mode.
    FinalPosition(WheelCount),
    /// Filter parameters; allowed at any time.
    Filter(LeadFilter),
    /// Sample timer; takes effect after the present sample.
    SampleTimer(SampleTimer),
    /// Blanking after a change of sign.
    SignReversalInhibit(bool),
    /// Clears the LIMIT and STOP flags whose inputs are inactive.
    ClearStatus,
}
