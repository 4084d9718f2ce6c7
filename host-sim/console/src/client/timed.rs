//! A socket that does not wait beyond a deadline, however little trickles in.

use std::io::{ErrorKind, Read, Result, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// A TCP connection with a time limit for each read and write, and one for all of them together.
pub(super) struct Timed {
    tcp: TcpStream,
    /// Longest read.
    pub(super) look: Duration,
    /// Longest write.
    patience: Duration,
    /// Deadline of everything.
    pub(super) until: Option<Instant>,
}

impl Timed {
    /// Each read and write may take `patience`, and all of them until `until`.
    pub(super) fn new(tcp: TcpStream, patience: Duration, until: Instant) -> Self {
        Self {
            tcp,
            look: patience,
            patience,
            until: Some(until),
        }
    }

    /// The rest of a time.
    fn left(&self, of: Duration) -> Result<Duration> {
        let until = self
            .until
            .map_or(of, |until| until.saturating_duration_since(Instant::now()));
        match until.min(of) {
            Duration::ZERO => Err(ErrorKind::TimedOut.into()),
            left => Ok(left),
        }
    }
}

impl Read for Timed {
    fn read(&mut self, buf: &mut [u8]) -> Result<usize> {
        self.tcp.set_read_timeout(Some(self.left(self.look)?))?;
        self.tcp.read(buf)
    }
}

impl Write for Timed {
    fn write(&mut self, buf: &[u8]) -> Result<usize> {
        self.tcp
            .set_write_timeout(Some(self.left(self.patience)?))?;
        self.tcp.write(buf)
    }

    fn flush(&mut self) -> Result<()> {
        self.tcp.flush()
    }
}
