//! Signals that ask a study to stop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use schemars::JsonSchema;
use serde::Serialize;
#[cfg(unix)]
use signal_hook::consts::SIGHUP;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Windows has no hang-up, and sends none.
#[cfg(not(unix))]
const SIGHUP: i32 = 1;

/// A signal that asks the program to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub enum Signal {
    /// Ctrl-C.
    #[serde(rename = "SIGINT")]
    Interrupt,
    /// Sent by `kill` and by a machine that shuts down.
    #[serde(rename = "SIGTERM")]
    Terminate,
    /// The terminal or the connection is gone.
    #[serde(rename = "SIGHUP")]
    HangUp,
}

impl Signal {
    const ALL: [Self; 3] = [Self::Interrupt, Self::Terminate, Self::HangUp];

    const fn number(self) -> i32 {
        match self {
            Self::Interrupt => SIGINT,
            Self::Terminate => SIGTERM,
            Self::HangUp => SIGHUP,
        }
    }

    /// Exit code of a program that this signal has stopped, as shells expect it.
    #[must_use]
    pub const fn exit_code(self) -> u8 {
        128 + self.number() as u8
    }

    /// What happened to the program, in words.
    #[must_use]
    pub const fn label(self) -> &'static str {
        match self {
            Self::Interrupt => "interrupted",
            Self::Terminate => "terminated",
            Self::HangUp => "hung up",
        }
    }
}

/// From here on, reaching the limit on a file's size (`ulimit -f`, a batch system) is an error of the write,
/// like a full disk. Its signal would end the program without a message.
///
/// # Errors
/// The operating system's error if a handler cannot be set.
pub fn outlive_file_limit() -> std::io::Result<()> {
    #[cfg(unix)]
    flag::register(signal_hook::consts::SIGXFSZ, Arc::default())?;
    Ok(())
}

/// Whether a study should stop. Copies share their state.
#[derive(Debug, Clone, Default)]
pub struct Stop {
    /// Number of the signal; 0: none.
    signal: Arc<AtomicUsize>,
    /// Nothing has begun: a signal ends the program as if it had no handler.
    idle: Arc<AtomicBool>,
}

impl Stop {
    /// One that the program's signals set. Until [`begin`](Self::begin) they end the program at once: there
    /// is nothing to finish, and a pipe that is read may never end. From then on the first asks; a second
    /// Ctrl-C or TERM ends the program. A hang-up that the program was started to ignore (`nohup`) stays
    /// ignored.
    ///
    /// # Errors
    /// The operating system's error if a handler cannot be set.
    pub fn on_signals() -> std::io::Result<Self> {
        let stop = Self {
            idle: Arc::new(AtomicBool::new(true)),
            ..Self::default()
        };
        let asked = Arc::new(AtomicBool::new(false));
        for signal in Signal::ALL {
            let number = signal.number();
            if signal == Signal::HangUp {
                if !cfg!(unix) || is_ignored(number) {
                    continue;
                }
            } else {
                // A closing terminal may hang up twice, so only these.
                flag::register_conditional_default(number, Arc::clone(&asked))?;
            }
            flag::register_conditional_default(number, Arc::clone(&stop.idle))?;
            flag::register(number, Arc::clone(&asked))?;
            flag::register_usize(number, Arc::clone(&stop.signal), number as usize)?;
        }
        Ok(stop)
    }

    /// From here on there is something to finish.
    pub fn begin(&self) {
        self.idle.store(false, Ordering::SeqCst);
    }

    /// Asks to stop, as the signal does.
    pub fn ask(&self, signal: Signal) {
        self.signal
            .store(signal.number() as usize, Ordering::SeqCst);
    }

    /// The signal that asked to stop.
    #[must_use]
    pub fn signal(&self) -> Option<Signal> {
        let number = self.signal.load(Ordering::SeqCst);
        let mut all = Signal::ALL.into_iter();
        all.find(|signal| signal.number() as usize == number)
    }

    /// Whether it was asked to stop.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.signal().is_some()
    }
}

/// Whether this process was started to ignore a signal, as far as the system says.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mut lines = status.lines();
    let mask = lines.find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_are_one_and_know_the_signal() {
        let stop = Stop::default();
        let copy = stop.clone();
        assert!(!copy.is_asked());
        stop.ask(Signal::Terminate);
        assert_eq!(copy.signal(), Some(Signal::Terminate));
        let codes = Signal::ALL.map(Signal::exit_code);
        assert_eq!(codes, [130, 143, 129]);
    }
}
