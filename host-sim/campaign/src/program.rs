//! Identifies the program that made a part.

use std::fmt::Write as _;

/// Digest of the sources that rows depend on.
const SOURCES: [u8; 24] = *include_bytes!(concat!(env!("OUT_DIR"), "/sources"));

/// Version of this program and digest of its sources. Another program may compute different rows.
#[must_use]
pub fn program() -> String {
    let mut digest = String::new();
    for byte in &SOURCES[..16] {
        let _ = write!(digest, "{byte:02x}");
    }
    format!("wheeleg {} {digest}", env!("CARGO_PKG_VERSION"))
}
