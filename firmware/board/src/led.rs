//! Patterns of the status LED.
//!
//! | pattern | meaning |
//! |---|---|
//! | steady | armed |
//! | half a second on, half off | not armed, no fault |
//! | two flashes, pause | a fault is latched |
//! | three flashes, pause | address straps invalid; outputs off |
//! | dark for a moment every two seconds, in any pattern | runs on the internal oscillator |

use wheeleg_node::mode::{Mode, ModeRules};
use wheeleg_node::snapshot::TickReport;
use wheeleg_protocol::FaultBits;
use wheeleg_units::Micros;

/// State of the board that the LED shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Not armed, no fault.
    Ready,
    /// Armed.
    Armed,
    /// A fault is latched.
    Fault,
    /// The straps name no board of this kind.
    NoAddress,
}

impl Status {
    /// The status after a tick.
    #[must_use]
    pub fn of(report: &TickReport) -> Self {
        let mode: Mode = report.mode;
        if report.faults != FaultBits::NONE {
            Self::Fault
        } else if mode.may_drive() {
            Self::Armed
        } else {
            Self::Ready
        }
    }

    const fn flashes(self) -> u32 {
        match self {
            Self::Ready | Self::Armed => 0,
            Self::Fault => 2,
            Self::NoAddress => 3,
        }
    }

    /// Whether the LED is lit at `now`.
    #[must_use]
    pub const fn is_lit(self, now: Micros, internal_oscillator: bool) -> bool {
        // Units of 2^17 µs, about 1/8 s; 16 of them make a period of about 2 s.
        let phase = now.get() >> 17 & 15;
        if internal_oscillator && phase == 15 {
            return false;
        }
        match self {
            Self::Armed => true,
            Self::Ready => phase & 4 == 0,
            Self::Fault | Self::NoAddress => phase & 1 == 0 && phase >> 1 < self.flashes(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edges(status: Status, internal: bool) -> usize {
        let lit: Vec<bool> = (0..16_u32)
            .map(|phase| status.is_lit(Micros(phase << 17), internal))
            .collect();
        (0..16).filter(|i| lit[*i] && !lit[(i + 1) % 16]).count()
    }

    #[test]
    fn patterns_differ_by_their_number_of_flashes() {
        assert_eq!(edges(Status::Armed, false), 0);
        assert!(Status::Armed.is_lit(Micros(0), false));
        assert_eq!(edges(Status::Armed, true), 1);
        assert_eq!(edges(Status::Fault, false), 2);
        assert_eq!(edges(Status::NoAddress, false), 3);
        assert_eq!(edges(Status::Ready, false), 2);
        let on = (0..16_u32).filter(|p| Status::Ready.is_lit(Micros(p << 17), false));
        assert_eq!(on.count(), 8);
    }
}
