//! The simulated hardware below a board application: converter results, switches, PWM channels and pins that
//! the event loop can reach.
//!
//! A handle and its clone share one cell: the application owns one, the event
//! loop the other. The cells are atomic so that a board can go to another thread;
//! no two threads use one at a time. Inputs are written by the loop at the start of a tick and
//! stay latched; PWM compare values are preloaded by the application and read
//! by the loop at the next tick edge, as the hardware timer does.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU16, Ordering::Relaxed};

use embedded_hal::digital::{self, InputPin, OutputPin};
use embedded_hal::pwm::{self, SetDutyCycle};
use wheeleg_node::hardware::{Encoder, PositionSensor, SensorError};
use wheeleg_units::{AdcCode, WheelCount};

/// A digital line, as input or output.
#[derive(Debug, Clone, Default)]
pub(super) struct Line(Arc<AtomicBool>);

impl Line {
    /// Level seen by an input, or driven by an output.
    #[must_use]
    pub(super) fn level(&self) -> bool {
        self.0.load(Relaxed)
    }

    /// A separate line at the same level.
    pub(super) fn copy(&self) -> Self {
        Self(Arc::new(self.level().into()))
    }

    /// Sets the level of an input.
    pub(super) fn set_level(&self, high: bool) {
        self.0.store(high, Relaxed);
    }
}

impl digital::ErrorType for Line {
    type Error = Infallible;
}

impl InputPin for Line {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(self.level())
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(!self.level())
    }
}

impl OutputPin for Line {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set_level(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set_level(true);
        Ok(())
    }
}

/// One channel of a timer with preloaded compare register.
#[derive(Debug, Clone)]
pub(super) struct PwmChannel {
    compare: Arc<AtomicU16>,
    max: u16,
}

impl PwmChannel {
    /// A channel that is off, with `max` counts a period.
    #[must_use]
    pub(super) fn new(max: u16) -> Self {
        Self {
            compare: Arc::default(),
            max,
        }
    }

    /// A separate channel with the same compare value.
    pub(super) fn copy(&self) -> Self {
        Self {
            compare: Arc::new(self.preloaded().into()),
            max: self.max,
        }
    }

    /// The preloaded compare value, in counts.
    #[must_use]
    pub(super) fn preloaded(&self) -> u16 {
        self.compare.load(Relaxed)
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
        self.compare.store(duty.min(self.max), Relaxed);
        Ok(())
    }
}

/// Converter result of a linear potentiometer, latched at the tick edge.
#[derive(Debug, Clone, Default)]
pub(super) struct AdcInput(Arc<AtomicU16>);

impl AdcInput {
    /// A separate input with the same code.
    pub(super) fn copy(&self) -> Self {
        Self(Arc::new(self.0.load(Relaxed).into()))
    }

    /// Latches a code, 16 bits left-aligned.
    pub(super) fn latch(&self, code: u16) {
        self.0.store(code, Relaxed);
    }
}

impl PositionSensor for AdcInput {
    fn read(&mut self) -> Result<AdcCode, SensorError> {
        Ok(AdcCode::new(self.0.load(Relaxed)))
    }
}

/// Quadrature counter of a wheel, latched at the sample edge.
#[derive(Debug, Clone, Default)]
pub(super) struct CounterInput(Arc<AtomicI32>);

impl CounterInput {
    /// Latches the total number of quadrature edges; the counter keeps 24 bits.
    pub(super) fn latch(&self, edges: i64) {
        // Truncation keeps the low bits, of which the counter keeps 24.
        self.0.store(edges as i32, Relaxed);
    }
}

impl Encoder for CounterInput {
    fn count(&mut self, _: WheelCount) -> WheelCount {
        WheelCount::wrapping_new(self.0.load(Relaxed))
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
