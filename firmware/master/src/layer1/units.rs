//! Conversions between the units of layers 0 and 1.

use wheeleg_units::PositionMm;

/// Seconds to whole µs, saturating; not-a-number gives 0.
#[must_use]
pub(crate) fn seconds_to_us(seconds: f32) -> u32 {
    // A float to integer `as` saturates and maps NaN to 0.
    (seconds * 1.0e6) as u32
}

/// Whole µs to seconds, exact to 24 bits.
#[must_use]
pub(crate) fn us_to_seconds(us: u64) -> f32 {
    us as f32 * 1.0e-6
}

/// mm in I16F16 to m.
#[must_use]
pub(crate) fn metres(mm: PositionMm) -> f32 {
    mm.get().to_num::<f32>() * 1.0e-3
}

/// Distance in µm to mm in I16F16, to the nearest LSB (15 nm); saturates at ±32 m.
#[must_use]
pub(crate) fn um_to_mm(um: i64) -> PositionMm {
    // × 65 536 / 1000 = × 8192 / 125, rounded, ties away from zero.
    let scaled = um.saturating_mul(8192);
    let half = if um < 0 { -62 } else { 62 };
    let raw = scaled.saturating_add(half).checked_div(125).unwrap_or(0);
    PositionMm::from_raw(i32::try_from(raw).unwrap_or(if raw < 0 { i32::MIN } else { i32::MAX }))
}

/// Stroke or distance in mm to µm, to the nearest µm.
#[must_use]
pub(crate) fn mm_to_um(mm: PositionMm) -> i64 {
    let scaled = i64::from(mm.raw()).saturating_mul(125);
    let half = if scaled < 0 { -4096 } else { 4096 };
    scaled.saturating_add(half).checked_div(8192).unwrap_or(0)
}
