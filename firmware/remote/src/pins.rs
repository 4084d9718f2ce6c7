//! Stand-ins for the peripherals: cells that the session writes before a tick and reads after it.

use core::cell::Cell;
use core::convert::Infallible;

use embedded_hal::digital::{self, OutputPin};
use embedded_hal::pwm::{self, SetDutyCycle};
use wheeleg_node::hardware::{Encoder, PinError, PositionSensor, SensorError, SwitchBank};
use wheeleg_units::{AdcCode, WheelCount};

/// Counts of a valve channel in one tick, 1 µs each.
pub const VALVE_COUNTS: u16 = 1000;
/// Counts of the H-bridge channel in one period: per cent, as on the HCTL-1100.
pub const BRIDGE_COUNTS: u16 = 100;

/// Inputs and outputs of a joint board.
#[derive(Debug, Default)]
pub struct JointPins {
    /// Position, 16 bits left-aligned.
    pub code: Cell<u16>,
    /// Raw foot switches, bit n = switch n, 1 = closed.
    pub switches: Cell<u8>,
    /// Open time of each valve in the next tick, µs, `[fill A, vent A, fill B, vent B]`.
    pub duty: [Cell<u16>; 4],
}

/// Inputs and outputs of a wheel board.
#[derive(Debug, Default)]
pub struct WheelPins {
    /// Quadrature count; the low 24 bits count.
    pub count: Cell<i32>,
    /// Raw supply-pressure switch in bit 0.
    pub supply: Cell<u8>,
    /// Magnitude of the bridge in the next sample, per cent.
    pub pulse: Cell<u16>,
    /// Direction of the bridge: true = backward.
    pub backward: Cell<bool>,
    /// The dump valve is driven open.
    pub dump: Cell<bool>,
}

/// A PWM channel with a preloaded compare value.
#[derive(Clone, Copy, Debug)]
pub struct Channel<'p> {
    compare: &'p Cell<u16>,
    max: u16,
}

impl<'p> Channel<'p> {
    /// The channel whose compare value is `compare`, with `max` counts a period.
    pub const fn new(compare: &'p Cell<u16>, max: u16) -> Self {
        Self { compare, max }
    }
}

impl pwm::ErrorType for Channel<'_> {
    type Error = Infallible;
}

impl SetDutyCycle for Channel<'_> {
    fn max_duty_cycle(&self) -> u16 {
        self.max
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        // The compare register of a timer that counts to `max` holds no more.
        self.compare.set(duty.min(self.max));
        Ok(())
    }
}

/// A digital output.
#[derive(Clone, Copy, Debug)]
pub struct Output<'p>(pub &'p Cell<bool>);

impl digital::ErrorType for Output<'_> {
    type Error = Infallible;
}

impl OutputPin for Output<'_> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set(true);
        Ok(())
    }
}

/// The position sensor of a joint.
#[derive(Clone, Copy, Debug)]
pub struct Potentiometer<'p>(pub &'p Cell<u16>);

impl PositionSensor for Potentiometer<'_> {
    fn read(&mut self) -> Result<AdcCode, SensorError> {
        Ok(AdcCode::new(self.0.get()))
    }
}

/// The encoder of a wheel.
#[derive(Clone, Copy, Debug)]
pub struct Quadrature<'p>(pub &'p Cell<i32>);

impl Encoder for Quadrature<'_> {
    fn count(&mut self, _: WheelCount) -> WheelCount {
        WheelCount::wrapping_new(self.0.get())
    }
}

/// Switches, of which the board has those in `mask`.
#[derive(Clone, Copy, Debug)]
pub struct Switches<'p> {
    /// Raw levels.
    pub levels: &'p Cell<u8>,
    /// Switches that the board has; the others read 0.
    pub mask: u8,
}

impl SwitchBank for Switches<'_> {
    fn read(&mut self) -> Result<u8, PinError> {
        Ok(self.levels.get() & self.mask)
    }
}
