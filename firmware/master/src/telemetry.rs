//! Telemetry records.
/// x
#[derive(Clone, Copy, Debug, Default)]
pub struct Record;
