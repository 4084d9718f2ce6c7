//! The 96-bit unique id of the processor.

use super::pac;

/// The id's twelve bytes, lowest address first (RM0440 §48.1).
#[must_use]
pub fn unique_id() -> [u8; 12] {
    let uid = pac::UID;
    let [a, b, c, d] = uid.uid(0).read().to_le_bytes();
    let [e, f, g, h] = uid.uid(1).read().to_le_bytes();
    let [i, j, k, l] = uid.uid(2).read().to_le_bytes();
    [a, b, c, d, e, f, g, h, i, j, k, l]
}
