//! Why a board does not run, and until when.

use wheeleg_protocol::ResetCause;

/// Why a board does not run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Down {
    /// It runs.
    No,
    /// It has no power: all its outputs are off.
    Off {
        /// When power comes back, ns.
        until_ns: u64,
    },
    /// Its processor starts: all its outputs are off.
    Starting {
        /// When its first tick begins at the earliest, ns; it hears the line a tick before.
        until_ns: u64,
        /// The cause of its reset, as it finds it.
        cause: ResetCause,
    },
    /// It stores its parameters, which keeps its processor from everything else: its
    /// outputs stay as they are, off.
    Storing {
        /// When that is done, ns.
        until_ns: u64,
    },
    /// Its program has stopped: its outputs stay unchanged.
    Hung {
        /// When the watchdog bites, ns.
        until_ns: u64,
    },
}

impl Down {
    /// Whether nothing drives the outputs of the board.
    pub(super) fn is_off(self) -> bool {
        matches!(self, Self::Off { .. } | Self::Starting { .. })
    }
}
