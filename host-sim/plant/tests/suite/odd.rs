//! Odd numbers as input of a dynamics engine, and the permitted answers.

use proptest::prelude::*;
use wheeleg_plant::dynamics::DynamicsError;

/// Raw bits, edges of the format, and ordinary numbers, so that every branch is met.
pub(crate) fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        3 => any::<u64>().prop_map(f64::from_bits),
        1 => prop::sample::select(vec![
            0.0, -0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN,
            f64::MIN_POSITIVE, 5e-324, 1e154, 1e-154, 1e160, 1.0, -1.0,
        ]),
        3 => -1.0..1.0,
        2 => 0.3..0.5,
    ]
}

pub(crate) fn numbers<const N: usize>() -> impl Strategy<Value = [f64; N]> {
    proptest::array::uniform(number())
}

/// Lengths that a leg can often take, spoilt one at a time.
pub(crate) fn lengths() -> impl Strategy<Value = [f64; 3]> {
    (0.31..0.49, 0.01..0.19, 0.01..0.19, number(), 0..6_usize).prop_map(|(a, b, c, bad, at)| {
        let mut q = [a, b, c];
        if let Some(place) = q.get_mut(at) {
            *place = bad;
        }
        q
    })
}

pub(crate) fn finite<'a>(values: impl IntoIterator<Item = &'a f64>) -> bool {
    values.into_iter().all(|v| v.is_finite())
}

/// A refusal names the value that caused it, or the overflow.
pub(crate) fn named(error: &DynamicsError) -> bool {
    let text = error.to_string();
    match error {
        DynamicsError::NonFinite { value, .. } => !value.is_finite() && !text.is_empty(),
        DynamicsError::Leg { .. } | DynamicsError::Singular { .. } => !text.is_empty(),
        DynamicsError::Parameter { name, .. } => text.contains(name),
        _ => !text.is_empty(),
    }
}
