//! A serial port without hardware: this program is at its other end.

use std::io::{self, Read as _, Write as _};
use std::time::Duration;

use serialport::{SerialPort, TTYPort};

use crate::RemoteError;
use crate::port::is_idle;

/// A pseudo-terminal. Its far end stays open, so that programs may come and go there.
#[derive(Debug)]
pub struct Pty {
    near: TTYPort,
    far: TTYPort,
}

impl Pty {
    /// A new one.
    ///
    /// # Errors
    /// [`RemoteError`] with the operating system's reason.
    pub fn open() -> Result<Self, RemoteError> {
        let failed = |e: serialport::Error| {
            RemoteError::new(
                format!("cannot make a pseudo-terminal: {e}"),
                "end programs that have many of them open",
            )
        };
        let (mut near, far) = TTYPort::pair().map_err(failed)?;
        near.set_timeout(Duration::ZERO).map_err(failed)?;
        Ok(Self { near, far })
    }

    /// Path of the far end.
    #[must_use]
    pub fn path(&self) -> String {
        self.far.name().unwrap_or_default()
    }

    /// Received bytes, up to the size of the buffer.
    ///
    /// # Errors
    /// The operating system's error.
    pub fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        idle(self.near.read(buffer))
    }

    /// Sends bytes. If nobody reads at the far end, they are lost once the system has no more room.
    ///
    /// # Errors
    /// The operating system's error.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        idle(self.near.write_all(bytes).map(|()| bytes.len())).map(|_| ())
    }
}

/// Nothing to read and no room to write are no errors.
fn idle(result: io::Result<usize>) -> io::Result<usize> {
    match result {
        Err(e) if is_idle(&e) => Ok(0),
        other => other,
    }
}
