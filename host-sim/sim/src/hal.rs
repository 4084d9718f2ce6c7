//! The simulated hardware that a board application is built on: converter
//! results, switches, PWM channels and pins that the event loop can reach.
//!
//! A handle and its clone share one cell: the application owns one, the event
//! loop the other. Inputs are written by the loop at the start of a tick and
//! stay latched; PWM compare values are preloaded by the application and read
//! by the loop at the next tick edge, as the hardware timer does.

use std::cell::Cell;
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::digital::{self, InputPin, OutputPin};
use embedded_hal::pwm::{self, SetDutyCycle};
use wheeleg_node::hardware::{Encoder, PositionSensor, SensorError};
use wheeleg_units::{AdcCode, WheelCount};

/// A digital line, as input or output.
#[derive(Debug, Clone, Default)]
pub(super) struct Line(Rc<Cell<bool>>);

impl Line {
    /// Level seen by an input, or driven by an output.
    #[must_use]
    pub(super) fn level(&self) -> bool {
        self.0.get()
    }

    /// Sets the level of an input.
    pub(super) fn set_level(&self, high: bool) {
        self.0.set(high);
    }
}

impl digital::ErrorType for Line {
    type Error = Infallible;
}

impl InputPin for Line {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(self.0.get())
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(!self.0.get())
    }
}

impl OutputPin for Line {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set(true);
        Ok(())
    }
}

/// One channel of a timer with preloaded compare register.
#[derive(Debug, Clone)]
pub(super) struct PwmChannel {
    compare: Rc<Cell<u16>>,
    max: u16,
}

impl PwmChannel {
    /// A channel that is off, with `max` counts a period.
    #[must_use]
    pub(super) fn new(max: u16) -> Self {
        Self {
            compare: Rc::new(Cell::new(0)),
            max,
        }
    }

    /// The preloaded compare value, in counts.
    #[must_use]
    pub(super) fn preloaded(&self) -> u16 {
        self.compare.get()
    }
}

impl pwm::ErrorType for PwmChannel {
    type Error = Infallible;
}

impl SetDutyCycle for PwmChannel {
    fn max_duty_cycle(&self) -> u16 {
        self.max
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        // The compare register of a timer that counts to `max` holds no more.
        self.compare.set(duty.min(self.max));
        Ok(())
    }
}

/// Converter result of a linear potentiometer, latched at the tick edge.
#[derive(Debug, Clone, Default)]
pub(super) struct AdcInput(Rc<Cell<u16>>);

impl AdcInput {
    /// Latches a code, 16 bits left-aligned.
    pub(super) fn latch(&self, code: u16) {
        self.0.set(code);
    }
}

impl PositionSensor for AdcInput {
    fn read(&mut self) -> Result<AdcCode, SensorError> {
        Ok(AdcCode::new(self.0.get()))
    }
}

/// Quadrature counter of a wheel, latched at the sample edge.
#[derive(Debug, Clone)]
pub(super) struct CounterInput(Rc<Cell<WheelCount>>);

impl Default for CounterInput {
    fn default() -> Self {
        Self(Rc::new(Cell::new(WheelCount::ZERO)))
    }
}

impl CounterInput {
    /// Latches the total number of quadrature edges; the counter keeps 24 bits.
    pub(super) fn latch(&self, edges: i64) {
        // Truncation keeps the low bits, of which the counter keeps 24.
        self.0.set(WheelCount::wrapping_new(edges as i32));
    }
}

impl Encoder for CounterInput {
    fn count(&mut self, _: WheelCount) -> WheelCount {
        self.0.get()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compare_values_are_seen_only_when_read_and_never_exceed_the_period() {
        let channel = PwmChannel::new(1000);
        let mut application = channel.clone();
        application.set_duty_cycle(350).expect("infallible");
        assert_eq!(channel.preloaded(), 350);
        application.set_duty_cycle(4000).expect("infallible");
        assert_eq!(channel.preloaded(), 1000);
    }

    #[test]
    fn counter_wraps_at_24_bits_like_the_chip() {
        let input = CounterInput::default();
        let mut application = input.clone();
        input.latch(8_388_607);
        assert_eq!(application.count(WheelCount::ZERO).get(), 8_388_607);
        input.latch(8_388_608);
        assert_eq!(application.count(WheelCount::ZERO).get(), -8_388_608);
        input.latch(-1);
        assert_eq!(application.count(WheelCount::ZERO).get(), -1);
        input.latch((1 << 40) + 5);
        assert_eq!(application.count(WheelCount::ZERO).get(), 5);
    }
}
