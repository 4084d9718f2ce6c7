//! Mocks of the embedded-hal traits that record what is written and count calls.

use embedded_hal::digital::{self, InputPin, OutputPin};
use embedded_hal::pwm::{self, SetDutyCycle};
use std::cell::Cell;
use std::rc::Rc;
use wheeleg_node::hardware::{Encoder, ParameterStore, PositionSensor, SensorError, StoreError};
use wheeleg_units::{AdcCode, WheelCount};

/// Error of a mock that was told to fail.
#[derive(Clone, Copy, Debug)]
pub struct MockError;

impl pwm::Error for MockError {
    fn kind(&self) -> pwm::ErrorKind {
        pwm::ErrorKind::Other
    }
}

impl digital::Error for MockError {
    fn kind(&self) -> digital::ErrorKind {
        digital::ErrorKind::Other
    }
}

/// PWM channel of 1000 counts and `more`; clones share their state.
#[derive(Clone, Default)]
pub struct Pwm {
    pub more: Rc<Cell<u16>>,
    pub duty: Rc<Cell<u16>>,
    pub writes: Rc<Cell<u32>>,
    pub fails: Rc<Cell<bool>>,
}

impl pwm::ErrorType for Pwm {
    type Error = MockError;
}

impl SetDutyCycle for Pwm {
    fn max_duty_cycle(&self) -> u16 {
        1000 + self.more.get()
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), MockError> {
        let max = self.max_duty_cycle();
        assert!(duty <= max, "duty {duty} beyond the maximum");
        self.writes.set(self.writes.get() + 1);
        if self.fails.get() {
            return Err(MockError);
        }
        self.duty.set(duty);
        Ok(())
    }
}

/// Digital pin, input or output; clones share their state.
#[derive(Clone, Default)]
pub struct Pin {
    pub high: Rc<Cell<bool>>,
    pub writes: Rc<Cell<u32>>,
    pub fails: Rc<Cell<bool>>,
}

impl digital::ErrorType for Pin {
    type Error = MockError;
}

impl InputPin for Pin {
    fn is_high(&mut self) -> Result<bool, MockError> {
        if self.fails.get() {
            return Err(MockError);
        }
        Ok(self.high.get())
    }

    fn is_low(&mut self) -> Result<bool, MockError> {
        self.is_high().map(|high| !high)
    }
}

impl OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), MockError> {
        self.set(false)
    }

    fn set_high(&mut self) -> Result<(), MockError> {
        self.set(true)
    }
}

impl Pin {
    fn set(&self, high: bool) -> Result<(), MockError> {
        self.writes.set(self.writes.get() + 1);
        if self.fails.get() {
            return Err(MockError);
        }
        self.high.set(high);
        Ok(())
    }
}

/// Position sensor whose next reading the test sets.
#[derive(Clone)]
pub struct Sensor(pub Rc<Cell<Result<AdcCode, SensorError>>>);

impl Sensor {
    pub fn at(code: u16) -> Self {
        Self(Rc::new(Cell::new(Ok(AdcCode::new(code)))))
    }

    pub fn set(&self, reading: Result<AdcCode, SensorError>) {
        self.0.set(reading);
    }
}

impl PositionSensor for Sensor {
    fn read(&mut self) -> Result<AdcCode, SensorError> {
        self.0.get()
    }
}

/// Encoder whose count the test sets.
#[derive(Clone, Default)]
pub struct Counter(pub Rc<Cell<i32>>);

impl Encoder for Counter {
    fn count(&mut self, _: WheelCount) -> WheelCount {
        WheelCount::wrapping_new(self.0.get())
    }
}

/// Memory for one set, which may fail.
#[derive(Default)]
pub struct Memory {
    pub set: Vec<(u16, i32)>,
    pub saves: u32,
    pub broken: bool,
}

impl ParameterStore for Memory {
    fn save(&mut self, records: impl Iterator<Item = (u16, i32)>) -> Result<(), StoreError> {
        if self.broken {
            return Err(StoreError);
        }
        self.set = records.collect();
        self.saves += 1;
        Ok(())
    }
}
