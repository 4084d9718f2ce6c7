//! The plant's one error type: every failure names the variable and its value.

/// Why the plant refused to go on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// A state variable stopped being a finite number.
    #[error("{name}[{index}] is {value}: the plant state is no longer finite")]
    NonFinite {
        /// State variable, with its unit suffix.
        name: &'static str,
        /// Cylinder, wheel or coordinate number, from 0.
        index: usize,
        /// The value found.
        value: f64,
    },
    /// A state variable left the range in which the model means anything.
    #[error("{name}[{index}] = {value} is outside {min}..={max}: the plant state exploded")]
    OutOfBounds {
        /// State variable, with its unit suffix.
        name: &'static str,
        /// Cylinder, wheel or coordinate number, from 0.
        index: usize,
        /// The value found.
        value: f64,
        /// Smallest value accepted.
        min: f64,
        /// Largest value accepted.
        max: f64,
    },
    /// A parameter is outside its valid range.
    #[error("parameter {name} = {value} is outside {min}..={max}")]
    Parameter {
        /// Field path in [`crate::robot::PlantParams`] or a part of it.
        name: &'static str,
        /// The value given.
        value: f64,
        /// Smallest value accepted.
        min: f64,
        /// Largest value accepted.
        max: f64,
    },
    /// An input of one tick is outside its valid range.
    #[error("input {name}[{index}] = {value} is outside {min}..={max}")]
    Input {
        /// Input field.
        name: &'static str,
        /// Joint, valve or wheel number, from 0.
        index: usize,
        /// The value given.
        value: f64,
        /// Smallest value accepted.
        min: f64,
        /// Largest value accepted.
        max: f64,
    },
    /// `advance` was asked for an interval that does not start where the state stands.
    #[error(
        "time does not follow on: the state stands at {state_ns} ns, asked for {from_ns}..{to_ns} ns"
    )]
    Time {
        /// Time of the state, nanoseconds.
        state_ns: u64,
        /// Start asked for, nanoseconds.
        from_ns: u64,
        /// End asked for, nanoseconds.
        to_ns: u64,
    },
    /// More switching edges are under way in a line than the model can hold.
    #[error("valve {0}: more edges under way in its line than the model holds")]
    EdgeQueueFull(usize),
    /// The robot does not stand at rest in its start pose where it starts.
    #[error(
        "the robot does not stand on its wheels and feet at the start place, x = 0 and y = 0, heading along x"
    )]
    NotStanding,
    /// The mechanics could not be evaluated (closed loop cannot close, singular inertia).
    #[error("mechanics: {0}")]
    Mechanics(String),
}

/// Checks a parameter against its valid range; NaN is always outside.
pub(crate) fn check(name: &'static str, value: f64, min: f64, max: f64) -> Result<(), PlantError> {
    if value >= min && value <= max {
        Ok(())
    } else {
        Err(PlantError::Parameter {
            name,
            value,
            min,
            max,
        })
    }
}

/// Checks one state variable: finite first, then within bounds.
pub(crate) fn check_state(
    name: &'static str,
    index: usize,
    value: f64,
    min: f64,
    max: f64,
) -> Result<(), PlantError> {
    if value >= min && value <= max {
        Ok(())
    } else if value.is_finite() {
        Err(PlantError::OutOfBounds {
            name,
            index,
            value,
            min,
            max,
        })
    } else {
        Err(PlantError::NonFinite { name, index, value })
    }
}
