//! What a board knows about itself after a tick, for telemetry and the simulator.

use crate::mode::Mode;
use wheeleg_control::pwm::OnTimes;
use wheeleg_control::wheel::WheelOutput;
use wheeleg_protocol::{FaultBits, LimitBits};
use wheeleg_units::{Duty, Micros, PositionMm, VelocityMmS, WheelCount};

/// Outcome of one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickReport {
    /// Mode after the tick.
    pub mode: Mode,
    /// Latched faults.
    pub faults: FaultBits,
    /// The tick started late after the last one, or an earlier tick took too long.
    pub overran: bool,
}

/// Internals of a joint board after its last tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JointSnapshot {
    /// Start of the tick.
    pub at: Micros,
    /// Mode.
    pub mode: Mode,
    /// Measured stroke.
    pub measured: PositionMm,
    /// Reference of the control law, after the slew limit; the measured stroke while disarmed, and that of arming
    /// during a precharge.
    pub reference: PositionMm,
    /// Reference of the newest SYNC slot.
    pub commanded: PositionMm,
    /// Velocity estimate.
    pub velocity: VelocityMmS,
    /// Signed duty of the control law; zero while not driving.
    pub duty: Duty,
    /// Energised time of each coil in the following tick, µs; order `[fill A, vent A, fill B, vent B]`.
    pub pulses: OnTimes,
    /// Debounced switches, one bit each.
    pub switches: u8,
    /// Latched faults.
    pub faults: FaultBits,
    /// Limits that shaped the output.
    pub limits: LimitBits,
    /// At rest with all valves shut.
    pub settled: bool,
}

/// Internals of a wheel board after its last sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WheelSnapshot {
    /// Start of the sample.
    pub at: Micros,
    /// Mode.
    pub mode: Mode,
    /// Encoder position.
    pub count: WheelCount,
    /// Result of the wheel controller.
    pub control: WheelOutput,
    /// Drive as written, per cent with sign.
    pub drive_percent: i8,
    /// Supply pressure present (debounced); false on boards without the switch.
    pub supply_present: bool,
    /// The dump valve is commanded open.
    pub dump_open: bool,
    /// Latched faults.
    pub faults: FaultBits,
    /// Limits that shaped the output.
    pub limits: LimitBits,
}

impl JointSnapshot {
    /// Before the first tick.
    pub(crate) const fn at_boot() -> Self {
        Self {
            at: Micros::ZERO,
            mode: Mode::Boot,
            measured: PositionMm::ZERO,
            reference: PositionMm::ZERO,
            commanded: PositionMm::ZERO,
            velocity: VelocityMmS::ZERO,
            duty: Duty::ZERO,
            pulses: [0; 4],
            switches: 0,
            faults: FaultBits::NONE,
            limits: LimitBits::NONE,
            settled: false,
        }
    }
}

impl WheelSnapshot {
    /// Before the first sample.
    pub(crate) fn at_boot() -> Self {
        Self {
            at: Micros::ZERO,
            mode: Mode::Boot,
            count: WheelCount::ZERO,
            control: WheelOutput::default(),
            drive_percent: 0,
            supply_present: false,
            dump_open: false,
            faults: FaultBits::NONE,
            limits: LimitBits::NONE,
        }
    }
}
