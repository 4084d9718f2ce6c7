//! The joint board's control path on the bench: converter code to stroke,
//! [`JointController`], [`ValvePwm`], on-times. The code is the firmware's own.

use wheeleg_control::joint::{Announced, ConfigError, JointConfig, JointController, JointGains};
use wheeleg_control::joint::{Correction, JointInput};
use wheeleg_control::pwm::{PwmTiming, ValvePwm};
use wheeleg_node::sensor::SensorConfig;
use wheeleg_protocol::FaultBits;
use wheeleg_units::{Micros, PositionMm, Ticks, VelocityMmS};

use super::run::{Action, Board, Sample};

/// Control tick of a joint board.
pub const TICK: Micros = Micros(1000);

/// Sensor, law and valve timing of one board.
#[derive(Debug, Clone)]
pub struct Design {
    /// Gains and law.
    pub gains: JointGains,
    /// Correction of the fuzzy law.
    pub correction: Correction,
    /// Calibration of the position sensor.
    pub sensor: SensorConfig,
    /// Limits of the whole board around the control path; see [`super::Node`].
    pub supervision: Supervision,
}

/// Limits of a board around its control path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Supervision {
    /// Largest rate of the reference.
    pub slew_rate: VelocityMmS,
    /// Error that becomes a fault if it lasts …
    pub following_error: PositionMm,
    /// … for this long.
    pub following_time: Micros,
}

/// A joint board reduced to its control path.
#[derive(Debug, Clone)]
pub struct Firmware {
    /// The controller, with its state.
    pub controller: JointController,
    pwm: ValvePwm,
    sensor: SensorConfig,
}

impl Firmware {
    /// A board with a design.
    ///
    /// # Errors
    /// [`ConfigError`] names the parameter outside its range; valve delays that
    /// leave no pulse are reported as the axis's delay.
    pub fn new(design: &Design) -> Result<Self, ConfigError> {
        use wheeleg_control::axis::AxisField;
        use wheeleg_control::joint::JointParameter;
        let gains = &design.gains;
        let mut controller = JointController::new(JointConfig::new(gains, TICK)?);
        controller.set_correction(design.correction);
        let timing = PwmTiming::new(
            gains.pwm_period,
            TICK,
            gains.axis.valve_on,
            gains.axis.valve_off,
            gains.axis.margin,
        )
        .map_err(|_| ConfigError::OutOfRange(JointParameter::Axis(AxisField::Delay)))?;
        Ok(Self {
            controller,
            pwm: ValvePwm::new(timing),
            sensor: design.sensor,
        })
    }
}

impl Firmware {
    /// The stroke of a sample's reading.
    #[must_use]
    pub fn position(&self, sample: &Sample) -> PositionMm {
        self.sensor.position(sample.code)
    }
}

impl Board for Firmware {
    fn tick(&mut self, sample: &Sample) -> Action {
        let measured = self.position(sample);
        let output = self.controller.step(&JointInput {
            measured,
            reference: sample.reference,
            reference_velocity: sample.reference_velocity,
            announced: sample.announced.map(|(reference, after)| Announced {
                reference,
                after: Ticks(after),
            }),
        });
        let on_us = match output.direct {
            Some(on) => on,
            None if output.settled => self.pwm.shut(),
            None => self.pwm.tick(&output.openings),
        };
        Action {
            on_us,
            settled: output.settled,
            measured_mm: measured.to_f64(),
            faults: FaultBits::NONE,
            driving: true,
        }
    }
}
