//! The plant's one error type: every failure names the variable and its value.

/// Why the plant cannot continue.
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
    #[error(
        "{name}[{index}] = {} is outside {} to {}: the plant state exploded",
        shown(*.value), shown(*.min), shown(*.max)
    )]
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
    #[error("parameter {name} = {} is outside {} to {}", shown(*.value), shown(*.min), shown(*.max))]
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
    #[error(
        "input {name}[{index}] = {} is outside {} to {}",
        shown(*.value), shown(*.min), shown(*.max)
    )]
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
    /// `advance` was called for an interval that does not start at the state's time.
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
    /// The robot does not stand at rest in its start pose at the start place.
    #[error(
        "the robot does not stand on its wheels and feet at the start place, x = 0 and y = 0, heading along x"
    )]
    NotStanding,
    /// At rest in its start pose the robot lies on its chassis, and no wheel bears anything.
    #[error(
        "at the start place, x = 0 and y = 0, heading along x, the robot lies on its chassis, which \
         bears {} N; its wheels bear nothing, its feet {} N",
        shown(*.chassis_n), shown(*.feet_n)
    )]
    OnChassis {
        /// Normal force on the chassis \[N\].
        chassis_n: f64,
        /// On both feet \[N\].
        feet_n: f64,
    },
    /// In its start pose the robot has ground inside its chassis.
    #[error(
        "at the start place, x = 0 and y = 0, heading along x, ground stands {} m into the robot's chassis, at \
         x = {} and y = {} m",
        shown(*.into_m), shown(.place_m[0]), shown(.place_m[1])
    )]
    InChassis {
        /// Where the ground is highest above the belly \[m\].
        place_m: [f64; 2],
        /// How far above the belly \[m\].
        into_m: f64,
    },
    /// The mechanics could not be evaluated (closed loop cannot close, singular inertia).
    #[error("mechanics: {0}")]
    Mechanics(String),
}

/// A value in six digits: one that has exploded has hundreds.
fn shown(value: f64) -> String {
    let short = format!("{value:.5e}");
    match short.parse::<f64>() {
        Ok(v) if v == 0.0 || (1e-4..1e9).contains(&v.abs()) => v.to_string(),
        _ => short,
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exploded_value_is_told_in_few_digits() {
        let said = check_state("velocity_m_s", 0, 1.5e60, -100.0, 100.0).expect_err("too fast");
        assert_eq!(
            said.to_string(),
            "velocity_m_s[0] = 1.50000e60 is outside -100 to 100: the plant state exploded"
        );
        let said = check_state("stroke_m", 0, 0.011_030_916_378_739_838, -0.001, 0.011);
        let said = said.expect_err("beyond its stop").to_string();
        assert!(
            said.starts_with("stroke_m[0] = 0.0110309 is outside -0.001 to 0.011:"),
            "{said}"
        );
        let said = check("moving_mass_kg", 0.002, 0.01, 1000.0).expect_err("too light");
        assert_eq!(
            said.to_string(),
            "parameter moving_mass_kg = 0.002 is outside 0.01 to 1000"
        );
    }
}
