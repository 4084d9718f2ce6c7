//! What a board provides to its application: sensors, switches and outputs.
//!
//! Outputs and switches are thin bundles over embedded-hal 1.0 pins and PWM channels, so that a board, the simulator
//! and a test mock plug in the same way. The two sensors have traits of our own, because embedded-hal 1.0 has none for
//! converters and counters.

use embedded_hal::digital::{InputPin, OutputPin, PinState};
use embedded_hal::pwm::SetDutyCycle;
use wheeleg_units::{AdcCode, WheelCount};

/// Why a sensor gave no reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorError {
    /// The conversion was not ready at the start of the tick.
    NotReady,
    /// The converter reported a fault of its own.
    Converter,
}

/// An output or input could not be driven or read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PinError;

/// Absolute position of a cylinder: the latest finished conversion.
pub trait PositionSensor {
    /// The code latched at the start of this tick; never waits.
    fn read(&mut self) -> Result<AdcCode, SensorError>;
}

/// Quadrature encoder of a wheel.
pub trait Encoder {
    /// The 24-bit count latched at the start of this tick; never waits. `before` is the count of the tick before,
    /// within 32 767 counts; a shorter counter is extended from it, so that no unsealed state is needed.
    fn count(&mut self, before: WheelCount) -> WheelCount;
}

/// Four valve outputs in the order `[fill A, vent A, fill B, vent B]`.
pub trait ValveBank {
    /// Duty that means open for the whole tick; equal for all four.
    fn max_duty(&self) -> u16;

    /// Presets the open time of each valve, effective at the next tick edge.
    ///
    /// All four are written even when one reports an error.
    fn write(&mut self, duty: [u16; 4]) -> Result<(), PinError>;
}

/// Four PWM channels as a valve bank.
///
/// The timer behind them runs at one period per control tick with preloaded
/// compare values.
#[derive(Clone, Copy, Debug)]
pub struct FourValves<A, B, C, D> {
    /// Fill of chamber A.
    pub fill_a: A,
    /// Vent of chamber A.
    pub vent_a: B,
    /// Fill of chamber B.
    pub fill_b: C,
    /// Vent of chamber B.
    pub vent_b: D,
}

impl<A, B, C, D> ValveBank for FourValves<A, B, C, D>
where
    A: SetDutyCycle,
    B: SetDutyCycle,
    C: SetDutyCycle,
    D: SetDutyCycle,
{
    fn max_duty(&self) -> u16 {
        self.fill_a.max_duty_cycle()
    }

    #[inline(always)]
    fn write(&mut self, duty: [u16; 4]) -> Result<(), PinError> {
        let [fill_a, vent_a, fill_b, vent_b] = duty;
        // Writes all four, even if one fails.
        let sound = self.fill_a.set_duty_cycle(fill_a).is_ok()
            & self.vent_a.set_duty_cycle(vent_a).is_ok()
            & self.fill_b.set_duty_cycle(fill_b).is_ok()
            & self.vent_b.set_duty_cycle(vent_b).is_ok();
        if sound { Ok(()) } else { Err(PinError) }
    }
}

/// A group of up to eight switches, one bit each.
pub trait SwitchBank {
    /// Raw levels, bit n = switch n, 1 = active.
    fn read(&mut self) -> Result<u8, PinError>;
}

/// The four optical switches of a foot, active high: bit n is pin n.
#[derive(Clone, Copy, Debug)]
pub struct FootSwitches<A, B, C, D>(pub A, pub B, pub C, pub D);

impl<A: InputPin, B: InputPin, C: InputPin, D: InputPin> SwitchBank for FootSwitches<A, B, C, D> {
    fn read(&mut self) -> Result<u8, PinError> {
        let levels = [
            self.0.is_high().map_err(|_| PinError)?,
            self.1.is_high().map_err(|_| PinError)?,
            self.2.is_high().map_err(|_| PinError)?,
            self.3.is_high().map_err(|_| PinError)?,
        ];
        Ok(levels
            .iter()
            .rev()
            .fold(0, |bits, level| bits << 1 | u8::from(*level)))
    }
}

/// One switch, active high: bit 0.
#[derive(Clone, Copy, Debug)]
pub struct SupplySwitch<A>(pub A);

impl<A: InputPin> SwitchBank for SupplySwitch<A> {
    fn read(&mut self) -> Result<u8, PinError> {
        self.0.is_high().map(u8::from).map_err(|_| PinError)
    }
}

/// A board without switches: always reads 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoSwitches;

impl SwitchBank for NoSwitches {
    fn read(&mut self) -> Result<u8, PinError> {
        Ok(0)
    }
}

/// Motor driver with one magnitude and one sign, like the HCTL-1100's Pulse and Sign pins (data sheet p. 23; low sign =
/// positive).
pub trait MotorDrive {
    /// Presets magnitude (0…100 % of the PWM period) and sign, effective at the
    /// next tick edge. Zero brakes the motor through the bridge.
    fn write(&mut self, percent: i8) -> Result<(), PinError>;
}

/// H-bridge on one PWM channel and one direction pin (high = backward).
#[derive(Clone, Copy, Debug)]
pub struct HBridge<P, D> {
    /// Magnitude.
    pub pulse: P,
    /// Direction.
    pub sign: D,
}

impl<P: SetDutyCycle, D: OutputPin> MotorDrive for HBridge<P, D> {
    fn write(&mut self, percent: i8) -> Result<(), PinError> {
        let sign = self.sign.set_state(PinState::from(percent < 0));
        let magnitude = percent.unsigned_abs().min(100);
        let pulse = if sign.is_ok() {
            self.pulse.set_duty_cycle_percent(magnitude)
        } else {
            // A bridge that may turn the wrong way must not be driven.
            self.pulse.set_duty_cycle_fully_off()
        };
        if sign.is_ok() && pulse.is_ok() {
            Ok(())
        } else {
            Err(PinError)
        }
    }
}

/// The valve that dumps the robot's air supply; only on the first wheel board.
pub trait DumpValve {
    /// Opens or closes the dump valve.
    fn set_open(&mut self, open: bool) -> Result<(), PinError>;
}

/// Dump valve on an output pin, high = open.
#[derive(Clone, Copy, Debug)]
pub struct DumpPin<P>(pub P);

impl<P: OutputPin> DumpValve for DumpPin<P> {
    fn set_open(&mut self, open: bool) -> Result<(), PinError> {
        self.0.set_state(PinState::from(open)).map_err(|_| PinError)
    }
}

/// A board without a dump valve.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoDumpValve;

impl DumpValve for NoDumpValve {
    fn set_open(&mut self, _open: bool) -> Result<(), PinError> {
        Ok(())
    }
}

/// The parameters could not be stored; the previous set is still there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoreError;

/// Memory that keeps parameters without power: of two copies the older one is replaced, so that a power cut at any
/// instant leaves a complete set.
pub trait ParameterStore {
    /// Stores a set, given as numbers and raw values.
    ///
    /// # Errors
    /// [`StoreError`]; then the previous set is still there.
    fn save(&mut self, records: impl Iterator<Item = (u16, i32)>) -> Result<(), StoreError>;
}
