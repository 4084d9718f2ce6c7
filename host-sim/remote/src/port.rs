//! A serial port with the robot's bus behind it.
//!
//! Nothing here waits: available bytes are read, and the system gets only as many as it takes at once. A lost
//! port is opened again, once in [`RETRY`].

use std::io::{self, Read as _, Write as _};
use std::time::{Duration, Instant};

use serialport::SerialPort;

use crate::RemoteError;
use crate::serial::{HilOptions, open};

/// Time between two tries to open a port that was lost.
const RETRY: Duration = Duration::from_secs(1);

/// A serial port that nobody else has.
pub struct BusPort {
    options: HilOptions,
    open: Option<Box<dyn SerialPort>>,
    /// Why it is not open.
    lost: String,
    tried: Instant,
}

impl std::fmt::Debug for BusPort {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BusPort")
            .field("options", &self.options)
            .field("lost", &self.broken())
            .finish_non_exhaustive()
    }
}

impl BusPort {
    /// Opens the port for exclusive use.
    ///
    /// # Errors
    /// [`RemoteError`]: another program has it, or the operating system's reason.
    pub fn open(options: &HilOptions) -> Result<Self, RemoteError> {
        Ok(Self {
            open: Some(open(options, Duration::ZERO)?),
            options: options.clone(),
            lost: String::new(),
            tried: Instant::now(),
        })
    }

    /// Why nothing passes, while nothing does.
    #[must_use]
    pub fn broken(&self) -> Option<&str> {
        self.open.is_none().then_some(self.lost.as_str())
    }

    /// Received bytes, up to the size of the buffer; none from a lost port.
    pub fn read(&mut self, buffer: &mut [u8]) -> usize {
        self.retry();
        let Some(port) = &mut self.open else {
            return 0;
        };
        match port.read(buffer) {
            Ok(0) => self.lose(&io::ErrorKind::UnexpectedEof.into()),
            Ok(count) => return count,
            Err(e) if is_idle(&e) => {}
            Err(e) => self.lose(&e),
        }
        0
    }

    /// Sends bytes. Those that the system does not take at once are lost, as on a cut cable.
    pub fn write(&mut self, bytes: &[u8]) {
        if let Some(port) = &mut self.open
            && let Err(e) = port.write_all(bytes)
            && !is_idle(&e)
        {
            self.lose(&e);
        }
    }

    fn lose(&mut self, error: &io::Error) {
        self.lost = format!("the serial port {} is lost: {error}", self.options.port);
        self.open = None;
        self.tried = Instant::now();
    }

    fn retry(&mut self) {
        if self.open.is_none() && self.tried.elapsed() >= RETRY {
            self.tried = Instant::now();
            self.open = open(&self.options, Duration::ZERO).ok();
        }
    }
}

/// Nothing to read yet, or no room to write.
pub(crate) fn is_idle(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), Interrupted | TimedOut | WouldBlock)
}
