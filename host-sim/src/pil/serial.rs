//! Bench boards behind a serial port.

use std::fs::{File, OpenOptions};
use std::io::{Read as _, Write as _};
use std::path::Path;

use super::line::Line;
use super::partner::{Partner, Stream};
use crate::SimError;

/// A serial port as the operating system has set it up.
struct Port {
    file: File,
    name: String,
}

/// Opens a port for one board. Speed and mode are those of the port
/// (`stty -F PORT 921600 raw -echo`); a USB port ignores the speed.
///
/// # Errors
/// [`SimError::Simulation`] when it cannot be opened.
pub(crate) fn open(port: &Path) -> Result<Box<dyn Line>, SimError> {
    let name = format!("the board at {}", port.display());
    let file = OpenOptions::new().read(true).write(true).open(port);
    let file = file.map_err(|e| {
        SimError::simulation(
            format!("cannot open {}: {e}", port.display()),
            "is the board plugged in, and may you use the port (group dialout)?",
        )
    })?;
    Ok(Box::new(Partner::new(Port { file, name })))
}

impl Port {
    fn failed(&self, error: &dyn std::fmt::Display) -> SimError {
        SimError::simulation(
            format!("{}: {error}", self.name),
            "what was logged up to here is complete; check cable and image",
        )
    }
}

impl Stream for Port {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), SimError> {
        self.file.write_all(bytes).map_err(|e| self.failed(&e))
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, SimError> {
        loop {
            match self.file.read(buffer) {
                Ok(0) => return Err(self.failed(&"the port has closed")),
                Ok(count) => return Ok(count),
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(self.failed(&e)),
            }
        }
    }
}
