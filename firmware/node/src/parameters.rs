//! Parameter values of one board in RAM, with the limits of the protocol's table.
//!
//! A value is set in two steps. [`Parameters::with`] checks one new value against its row and returns a trial copy. The
//! application turns the copy into settings, which checks the relations between parameters, and only then replaces the
//! old values. So a refused value changes nothing.

use wheeleg_protocol::NackReason;
use wheeleg_protocol::param::{JointParam, ParamLimits, WheelParam, parameter_sum};

/// Raw values of all rows of a table, in its order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Parameters<const N: usize> {
    values: [i32; N],
}

/// Parameters of a joint board.
pub type JointParameters = Parameters<{ JointParam::COUNT }>;

/// Parameters of a wheel board.
pub type WheelParameters = Parameters<{ WheelParam::COUNT }>;

impl<const N: usize> Parameters<N> {
    fn defaults(table: &'static [ParamLimits]) -> Self {
        let mut values = [0; N];
        for (value, row) in values.iter_mut().zip(table) {
            *value = row.default;
        }
        Self { values }
    }

    fn value(&self, table: &[ParamLimits], id: u16) -> Result<i32, NackReason> {
        table
            .iter()
            .zip(&self.values)
            .find_map(|(row, value)| (row.id == id).then_some(*value))
            .ok_or(NackReason::UnknownParameter)
    }

    fn changed(
        &self,
        table: &[ParamLimits],
        id: u16,
        raw: i32,
        disarmed: bool,
    ) -> Result<Self, NackReason> {
        let mut trial = *self;
        let (row, value) = table
            .iter()
            .zip(&mut trial.values)
            .find(|(row, _)| row.id == id)
            .ok_or(NackReason::UnknownParameter)?;
        if row.disarmed_only && !disarmed {
            return Err(NackReason::Armed);
        }
        if !row.permits(raw) {
            return Err(NackReason::OutOfRange);
        }
        *value = raw;
        Ok(trial)
    }

    /// Sum that distinguishes sets of parameters (protocol/SPEC.md, Parameter sets): any single differing value changes
    /// it.
    pub fn sum(&self) -> u32 {
        parameter_sum(&self.values)
    }

    fn at(&self, index: usize) -> i32 {
        self.values.get(index).copied().unwrap_or(0)
    }
}

macro_rules! parameters_of {
    ($parameters:ident, $param:ident) => {
        impl Default for $parameters {
            fn default() -> Self {
                Self::defaults($param::LIMITS)
            }
        }

        impl $parameters {
            /// Raw value of one parameter.
            pub fn get(&self, parameter: $param) -> i32 {
                self.at(parameter.index())
            }

            /// Every parameter that is not at its default, as number and raw value.
            pub fn changed_from_default(&self) -> impl Iterator<Item = (u16, i32)> + '_ {
                let rows = $param::LIMITS.iter().zip(&self.values);
                rows.filter(|(row, value)| row.default != **value)
                    .map(|(row, value)| (row.id, *value))
            }

            /// Raw value by wire number.
            ///
            /// # Errors
            /// [`NackReason::UnknownParameter`].
            pub fn by_id(&self, id: u16) -> Result<i32, NackReason> {
                self.value($param::LIMITS, id)
            }

            /// A copy with one value changed, checked against its row.
            ///
            /// # Errors
            /// [`NackReason::UnknownParameter`], [`NackReason::OutOfRange`], or
            /// [`NackReason::Armed`] for a row that can be set only while
            /// `disarmed`.
            pub fn with(&self, id: u16, raw: i32, disarmed: bool) -> Result<Self, NackReason> {
                self.changed($param::LIMITS, id, raw, disarmed)
            }
        }
    };
}

parameters_of!(JointParameters, JointParam);
parameters_of!(WheelParameters, WheelParam);

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_protocol::param::WHEEL_PARAMS;

    #[test]
    fn every_row_keeps_its_own_value() {
        let mut parameters = JointParameters::default();
        for parameter in JointParam::ALL {
            let row = parameter.info();
            assert_eq!(parameters.get(*parameter), row.default, "{}", row.name);
            parameters = parameters.with(row.id, row.max, true).unwrap();
        }
        for parameter in JointParam::ALL {
            assert_eq!(parameters.get(*parameter), parameter.info().max);
            assert_eq!(parameters.by_id(parameter.id()), Ok(parameter.info().max));
        }
    }

    #[test]
    fn limits_are_inclusive_and_refusals_name_the_reason() {
        let parameters = WheelParameters::default();
        for row in WHEEL_PARAMS {
            assert!(parameters.with(row.id, row.min, true).is_ok());
            let refused = |raw: Option<i32>| {
                raw.is_none_or(|raw| {
                    parameters.with(row.id, raw, true) == Err(NackReason::OutOfRange)
                })
            };
            assert!(refused(row.max.checked_add(1)) && refused(row.min.checked_sub(1)));
            let armed = parameters.with(row.id, row.default, false);
            assert_eq!(armed.is_err(), row.disarmed_only, "{}", row.name);
            if row.disarmed_only {
                assert_eq!(armed, Err(NackReason::Armed));
            }
        }
        assert_eq!(
            parameters.with(0, 0, true),
            Err(NackReason::UnknownParameter)
        );
        assert_eq!(parameters.by_id(0x0101), Err(NackReason::UnknownParameter));
    }
}
