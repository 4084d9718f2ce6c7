//! A value of a board's parameter: in the parameter's unit, and as the raw number on the bus.

use wheeleg_protocol::param::{Format, ParamInfo};

use super::reader::range;

/// Decimals that distinguish any two raw numbers: the finest format counts in 2^-30.
const DECIMALS: i32 = 10;

/// The raw number of a parameter among those stored in a board: its default if it is not one of them.
#[must_use]
pub fn stored_raw(info: &ParamInfo, stored: &[(u16, i32)]) -> i32 {
    let own = stored.iter().find(|(id, _)| *id == info.id);
    own.map_or(info.default, |(_, raw)| *raw)
}

/// The raw number nearest to a value in the parameter's unit. It saturates.
#[must_use]
pub fn raw_of(info: &ParamInfo, value: f64) -> i32 {
    (value * scale(info.format)).round() as i32
}

/// The raw number of an allowed value: within the parameter's limits, and whole if its format counts whole
/// numbers.
#[must_use]
pub fn allowed_raw(info: &ParamInfo, value: f64) -> Option<i32> {
    let whole = scale(info.format) != 1.0 || value.fract() == 0.0;
    raw_within(info, value).filter(|_| whole)
}

/// The raw number nearest to a value, if the limits allow it.
pub(super) fn raw_within(info: &ParamInfo, value: f64) -> Option<i32> {
    let raw = (value * scale(info.format)).round();
    let limits = f64::from(info.min)..=f64::from(info.max);
    limits.contains(&raw).then_some(raw as i32)
}

/// A raw number in the parameter's unit: the shortest decimal number that gives it back.
#[must_use]
pub fn in_unit(info: &ParamInfo, raw: i32) -> f64 {
    let exact = f64::from(raw) / scale(info.format);
    let rounded = |decimals| {
        let ten = 10_f64.powi(decimals);
        (exact * ten).round() / ten
    };
    let mut all = (0..=DECIMALS).map(rounded);
    all.find(|value| raw_of(info, *value) == raw)
        .unwrap_or(exact)
}

/// The allowed values in words: `0 to 4 1/mm`.
#[must_use]
pub fn allowed_values(info: &ParamInfo) -> String {
    let [min, max] = [info.min, info.max].map(|raw| in_unit(info, raw));
    let whole = if scale(info.format) == 1.0 {
        "whole numbers from "
    } else {
        ""
    };
    format!("{whole}{}", range(min, max, info.unit))
}

/// Raw numbers per unit.
pub(super) fn scale(format: Format) -> f64 {
    f64::from(format.fraction_bits()).exp2()
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_protocol::param::{JOINT_PARAMS, WHEEL_PARAMS};

    #[test]
    fn every_limit_and_default_goes_to_its_unit_and_back() {
        for info in JOINT_PARAMS.iter().chain(WHEEL_PARAMS) {
            for raw in [info.min, info.default, info.max] {
                let value = in_unit(info, raw);
                assert_eq!(allowed_raw(info, value), Some(raw), "{} {value}", info.name);
                assert_eq!(raw_of(info, value), raw, "{} {value}", info.name);
            }
            let step = 1.0 / scale(info.format);
            for beyond in [
                in_unit(info, info.min) - step,
                in_unit(info, info.max) + step,
                f64::NAN,
                f64::INFINITY,
            ] {
                assert_eq!(allowed_raw(info, beyond), None, "{} {beyond}", info.name);
            }
        }
    }

    #[test]
    fn values_are_told_as_people_write_them() {
        let row = |name: &str| {
            let found = JOINT_PARAMS.iter().find(|row| row.name == name);
            found.expect("in the table")
        };
        let gain = row("proportional");
        // I8F24: the nearest raw number is 0.02999997….
        assert_eq!(in_unit(gain, raw_of(gain, 0.03)).to_string(), "0.03");
        assert_eq!(allowed_values(gain), "0 to 4 1/mm");
        let whole = JOINT_PARAMS
            .iter()
            .find(|row| row.format == Format::Integer);
        let whole = whole.expect("in the table");
        assert!(allowed_values(whole).starts_with("whole numbers from "));
        assert_eq!(allowed_raw(whole, in_unit(whole, whole.min) + 0.5), None);
    }
}
