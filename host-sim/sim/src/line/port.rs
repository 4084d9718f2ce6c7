//! Lines in wall-clock time: the master's serial port, and the boards behind a pseudo-terminal.

use std::thread;
use std::time::{Duration, Instant};

use wheeleg_remote_host::port::BusPort;
#[cfg(unix)]
use wheeleg_remote_host::pty::Pty;
#[cfg(unix)]
use wheeleg_telemetry::Recorder;

use super::Line;
#[cfg(unix)]
use super::LineBoards;
#[cfg(unix)]
use crate::SimError;

/// Time between two looks at a port: less than the turnaround of the bus takes.
const LOOK: Duration = Duration::from_micros(200);
/// A wait longer than this means that the program was held up; the clock leaves that time out.
const LATE: Duration = Duration::from_millis(100);
/// Largest piece that is read at once: the bytes of a bus cycle.
const PIECE: usize = 1_024;

/// A wall clock that leaves out times in which its program was held up.
#[derive(Debug)]
struct WallClock {
    base: Instant,
}

impl WallClock {
    fn new() -> Self {
        Self {
            base: Instant::now(),
        }
    }

    fn now_ns(&self) -> u64 {
        self.base.elapsed().as_nanos() as u64
    }

    /// Begins a wait until `t_ns`.
    fn expect(&mut self, t_ns: u64) {
        let late = Duration::from_nanos(self.now_ns().saturating_sub(t_ns));
        if late > LATE {
            self.base += late;
        }
    }
}

/// A serial port as a line, in wall-clock time.
#[derive(Debug)]
pub struct PortLine {
    port: BusPort,
    clock: WallClock,
}

impl PortLine {
    /// The clock begins now.
    #[must_use]
    pub fn new(port: BusPort) -> Self {
        Self {
            port,
            clock: WallClock::new(),
        }
    }
}

impl Line for PortLine {
    fn wait(&mut self, t_ns: u64, heard: &mut dyn FnMut(&[u8], u64)) -> u64 {
        self.clock.expect(t_ns);
        let mut buffer = [0; PIECE];
        loop {
            let count = self.port.read(&mut buffer);
            let now_ns = self.clock.now_ns();
            if count > 0 {
                heard(buffer.get(..count).unwrap_or_default(), now_ns);
            }
            if now_ns >= t_ns {
                return now_ns;
            }
            thread::sleep(Duration::from_nanos(t_ns - now_ns).min(LOOK));
        }
    }

    fn send(&mut self, bytes: &[u8]) {
        self.port.write(bytes);
    }

    fn broken(&self) -> Option<&str> {
        self.port.broken()
    }
}

#[cfg(unix)]
impl LineBoards {
    /// Runs the boards behind a pseudo-terminal, in wall-clock time, until `ended`.
    ///
    /// # Errors
    /// [`SimError`] when the plant leaves the range of its model, or the terminal fails.
    pub fn serve(
        &mut self,
        pty: &mut Pty,
        recorder: &mut Recorder,
        ended: &dyn Fn() -> bool,
    ) -> Result<(), SimError> {
        let failed = |e: std::io::Error| {
            SimError::simulation(format!("the pseudo-terminal fails: {e}"), "start again")
        };
        let mut clock = WallClock::new();
        let mut buffer = [0; PIECE];
        while !ended() {
            clock.expect(self.now_ns());
            let now_ns = clock.now_ns();
            let count = pty.read(&mut buffer).map_err(failed)?;
            let said = self.step_to(now_ns, recorder)?;
            self.hear(buffer.get(..count).unwrap_or_default());
            if !said.is_empty() {
                pty.write(&said).map_err(failed)?;
            }
            thread::sleep(LOOK);
        }
        Ok(())
    }
}
