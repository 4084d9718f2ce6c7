//! Hardware in the loop: the application on a bench board, sensors and valves on
//! a serial port, the plant in this program.
//!
//! # Pacing
//!
//! The simulator leads. Every tick is one request with the inputs latched at its edge and one reply with the
//! outputs, and simulated time stands still until the reply is there. So a run gives the same bits at any
//! speed of the port: a slow port makes it slow, never wrong. Real time is not required: the board has no
//! output that could move anything (its image says so when the session opens, and is refused otherwise).
//!
//! Overruns, which a real-time loop would show, are measured on the board itself: it times the work of each
//! tick on its own clock and latches the fault of the application when a tick takes longer than its period.
//! That fault is in the log.
//!
//! # Latency
//!
//! A round trip costs the time of about 30 + 60 bytes on the line (8 ms at 115 200 Bd, 1 ms at 1 MBd) and the
//! latency of the USB bridge, 1 to 16 ms. One joint takes some 20 exchanges in a bus cycle of 10 ms: ten
//! ticks and the frames that it hears. [`SerialLine::statistics`] gives their times.
//!
//! # Loss
//!
//! A port that vanishes, or a board that stays silent longer than [`HilOptions::patience`], ends the run with
//! an error; the log up to there is complete. The board waits for a new session and has no outputs.

use std::io::{self, Read as _, Write as _};
use std::time::{Duration, Instant};

use serialport::{ClearBuffer, SerialPort};
use wheeleg_remote_link::Hello;

use crate::RemoteError;
use crate::{Stream, Transport};

/// Rate of the hardware-in-the-loop images on the debug probe's serial port.
const BAUD: u32 = 1_000_000;
/// An exchange takes milliseconds; after this long the board has gone.
const PATIENCE: Duration = Duration::from_secs(2);
/// How often a board is called before it counts as absent.
const CALLS: u32 = 3;

/// A serial port with a bench board.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HilOptions {
    /// The port, for example `/dev/ttyACM0` or `COM3`.
    pub port: String,
    /// Rate, bit/s.
    pub baud: u32,
    /// How long an answer may take.
    pub patience: Duration,
}

impl HilOptions {
    /// A port with the default rate, or with its own behind an `@`:
    /// `/dev/ttyACM0@115200`.
    ///
    /// # Errors
    /// [`RemoteError`]: no port, or an invalid rate.
    pub fn parse(text: &str) -> Result<Self, RemoteError> {
        let (port, baud) = match text.rsplit_once('@') {
            Some((port, baud)) => (port, baud.parse().ok()),
            None => (text, Some(BAUD)),
        };
        match baud {
            Some(baud @ 1_200..=12_000_000) if !port.is_empty() => Ok(Self {
                port: port.to_owned(),
                baud,
                patience: PATIENCE,
            }),
            _ => Err(RemoteError::new(
                format!("`{text}` is not a serial port"),
                "write PORT or PORT@RATE with a rate from 1200 to 12000000, for example \
                 /dev/ttyACM0@115200; --node has hil: before it",
            )),
        }
    }
}

/// How long the board took to answer, in real time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Requests answered.
    pub exchanges: u64,
    /// Total time spent waiting for answers.
    pub waited: Duration,
    /// Longest wait.
    pub longest: Duration,
}

/// An open serial port.
pub struct SerialLine {
    port: Box<dyn SerialPort>,
    options: HilOptions,
    asked: Option<Instant>,
    statistics: Statistics,
}

impl std::fmt::Debug for SerialLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SerialLine")
            .field("options", &self.options)
            .field("statistics", &self.statistics)
            .finish_non_exhaustive()
    }
}

impl SerialLine {
    /// Opens the port for exclusive use.
    ///
    /// # Errors
    /// [`RemoteError`] with the operating system's reason.
    pub fn open(options: &HilOptions) -> Result<Self, RemoteError> {
        Ok(Self {
            port: open(options, options.patience)?,
            options: options.clone(),
            asked: None,
            statistics: Statistics::default(),
        })
    }

    /// Times of all answers so far.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }

    fn lost(&self, error: &io::Error) -> RemoteError {
        let port = &self.options.port;
        if error.kind() == io::ErrorKind::TimedOut {
            let seconds = self.options.patience.as_secs_f64();
            return RemoteError::new(
                format!("the board on {port} has not answered for {seconds} s"),
                "check the board's power and its cable, and start the run again (a board that \
                 was reset has forgotten its session); what was logged up to here is complete",
            );
        }
        RemoteError::new(
            format!("the serial port {port} is lost: {error}"),
            "check the board's cable and power, plug it in again and start the run again; \
             what was logged up to here is complete",
        )
    }
}

/// Opens a port for exclusive use; reading and writing wait for at most `timeout`. It is also locked, since
/// exclusive use means nothing to root.
pub(crate) fn open(
    options: &HilOptions,
    timeout: Duration,
) -> Result<Box<dyn SerialPort>, RemoteError> {
    let port = serialport::new(&options.port, options.baud).timeout(timeout);
    let port = port.open().map_err(|e| {
        RemoteError::new(
            format!("cannot open the serial port {}: {e}", options.port),
            "check that the board is plugged in, that nobody else has the port open, \
             and that you may use it (group `dialout` on Debian)",
        )
    })?;
    // Drop the rest of an earlier session in the buffers.
    let _ = port.clear(ClearBuffer::All);
    Ok(port)
}

impl Stream for SerialLine {
    fn name(&self) -> String {
        format!("the board on {}", self.options.port)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), RemoteError> {
        self.asked.get_or_insert_with(Instant::now);
        self.port.write_all(bytes).map_err(|e| self.lost(&e))
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, RemoteError> {
        let count = loop {
            match self.port.read(buffer) {
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Ok(0) => return Err(self.lost(&io::ErrorKind::UnexpectedEof.into())),
                Ok(count) => break count,
                Err(e) => return Err(self.lost(&e)),
            }
        };
        // A frame ends with a zero and contains no other.
        if buffer[..count].contains(&0)
            && let Some(asked) = self.asked.take()
        {
            let waited = asked.elapsed();
            self.statistics.exchanges += 1;
            self.statistics.waited += waited;
            self.statistics.longest = self.statistics.longest.max(waited);
        }
        Ok(count)
    }
}

/// Opens a session with the bench board on a port. `application` is the one
/// that the node needs, `joint` or `wheel`.
///
/// # Errors
/// [`RemoteError`]: no such port, nobody answers, or the image is not a
/// hardware-in-the-loop image of this application and version.
pub fn connect(
    options: &HilOptions,
    application: &str,
) -> Result<(Transport<SerialLine>, Hello), RemoteError> {
    let port = &options.port;
    let mut answer = call(options)?;
    for _ in 1..CALLS {
        if answer.is_ok() {
            break;
        }
        // The first call may have met the rest of an earlier session. Opening the port again drops what is
        // still under way.
        answer = call(options)?;
    }
    let (transport, hello) = answer.map_err(|e| {
        RemoteError::new(
            format!("no hardware-in-the-loop image answers on {port}: {e}"),
            format!(
                "the plain images `joint` and `wheel` do not listen on this port; flash \
                 `{application}-hil` (firmware/board/BOARD.md) and check the rate, {} bit/s",
                options.baud
            ),
        )
    })?;
    if !hello.outputs_are_virtual {
        return Err(RemoteError::new(
            format!(
                "the image `{}` on {port} drives real outputs: it is no \
                 hardware-in-the-loop image",
                hello.image.name
            ),
            format!("flash `{application}-hil` (firmware/board/BOARD.md)"),
        ));
    }
    if hello.image.name != application {
        return Err(RemoteError::new(
            format!(
                "the board on {port} runs the application `{}`, the node needs `{application}`",
                hello.image.name
            ),
            format!("flash `{application}-hil` (firmware/board/BOARD.md)"),
        ));
    }
    Ok((transport, hello))
}

/// One call: a port that cannot be opened is the outer error, a board that does
/// not answer well the inner one.
fn call(
    options: &HilOptions,
) -> Result<Result<(Transport<SerialLine>, Hello), RemoteError>, RemoteError> {
    let mut transport = Transport::new(SerialLine::open(options)?);
    Ok(transport.hello().map(|hello| (transport, hello)))
}

#[cfg(test)]
mod tests {
    use super::HilOptions;

    #[test]
    fn a_port_may_bring_its_rate() {
        let plain = HilOptions::parse("/dev/ttyACM0").expect("a port");
        assert_eq!(
            (plain.port.as_str(), plain.baud),
            ("/dev/ttyACM0", 1_000_000)
        );
        let slow = HilOptions::parse("COM3@115200").expect("a port");
        assert_eq!((slow.port.as_str(), slow.baud), ("COM3", 115_200));
        for wrong in ["", "@9600", "COM3@fast", "COM3@0", "COM3@99999999"] {
            let error = HilOptions::parse(wrong).expect_err(wrong);
            assert!(error.to_string().contains("not a serial port"), "{error}");
        }
    }
}
