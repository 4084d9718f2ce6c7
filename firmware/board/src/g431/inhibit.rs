//! An output that hardware holds off.

use embedded_hal::pwm::{Error, ErrorKind};

/// The output is inhibited: POWER_OK is low.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inhibited;

impl Error for Inhibited {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}
