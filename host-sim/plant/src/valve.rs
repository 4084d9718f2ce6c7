//! On/off valve: when commands become physical, and when that is felt in the chamber.
//!
//! Three levels, each a pure consequence of the one before:
//! 1. command: the driver is energised or not (normally closed: no current, shut);
//! 2. poppet: opens t_on after the command rises, shuts t_off after it falls; a
//!    pulse shorter than t_on never opens, a gap shorter than t_off never shuts;
//! 3. effect: the poppet's edges, later by the travel time of the pressure wave
//!    in the line. What the chamber sees.
//!
//! Without power every driver is off and every valve shuts after its t_off.
//!
//! Simplification (stated, not hidden): a poppet caught half-way goes back at
//! once and keeps no memory of it; lift is all or nothing.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};
use crate::flow::Iso6358;
use crate::hash::StateHasher;

/// Time "never", for comparisons with the next edge.
pub const NEVER_NS: u64 = u64::MAX;

/// Edges that can be under way in a line at once. With at most two command
/// edges a millisecond this covers every delay that [`ValveParams`] allows.
const LINE_EDGES: usize = 16;

/// One valve type.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ValveParams {
    /// Flow path of the open valve.
    pub flow: Iso6358,
    /// Command to open, 0..0.1 \[s\].
    pub t_on_s: f64,
    /// Command to shut, 0..0.1 \[s\].
    pub t_off_s: f64,
}

impl ValveParams {
    /// Checks every field against its valid range.
    ///
    /// # Errors
    /// [`PlantError::Parameter`] names the first field outside its range.
    pub fn validate(&self) -> Result<(), PlantError> {
        self.flow.validate()?;
        check("valve.t_on_s", self.t_on_s, 0.0, 0.1)?;
        check("valve.t_off_s", self.t_off_s, 0.0, 0.1)
    }
}

/// Fault of a valve, for fault injection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum ValveFault {
    /// Healthy.
    #[default]
    None,
    /// Passes flow for any command.
    StuckOpen,
    /// Never passes flow.
    StuckShut,
}

/// Delays of one valve in whole nanoseconds, spread included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ValveTiming {
    /// Command to open \[ns\].
    pub t_on_ns: u64,
    /// Command to shut \[ns\].
    pub t_off_ns: u64,
    /// Wave travel time from valve to chamber \[ns\].
    pub line_delay_ns: u64,
}

/// Seconds to whole nanoseconds, rounded; for non-negative times far below
/// the range of u64.
#[must_use]
pub fn seconds_to_ns(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

impl ValveTiming {
    /// Delays of one specimen: `spread` scales both of its switching times.
    #[must_use]
    pub fn new(params: &ValveParams, spread: f64, line_delay_s: f64) -> Self {
        Self {
            t_on_ns: seconds_to_ns(params.t_on_s * spread),
            t_off_ns: seconds_to_ns(params.t_off_s * spread),
            line_delay_ns: seconds_to_ns(line_delay_s),
        }
    }
}

/// State of one valve. Times are absolute, nanoseconds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ValveState {
    commanded: bool,
    poppet_open: bool,
    /// When the poppet will change over; [`NEVER_NS`] if it is at rest.
    poppet_edge_ns: u64,
    /// Effect as the chamber sees it.
    open: bool,
    /// Effect edges under way in the line, oldest first. They alternate, so
    /// times are enough.
    line: [u64; LINE_EDGES],
    line_len: u8,
    switches: u64,
    /// Injected fault.
    pub fault: ValveFault,
}

impl Default for ValveState {
    fn default() -> Self {
        Self {
            commanded: false,
            poppet_open: false,
            poppet_edge_ns: NEVER_NS,
            open: false,
            line: [NEVER_NS; LINE_EDGES],
            line_len: 0,
            switches: 0,
            fault: ValveFault::None,
        }
    }
}

impl ValveState {
    /// The driver's level as last commanded.
    #[must_use]
    pub fn commanded(&self) -> bool {
        self.commanded
    }

    /// Whether the poppet is open (before the line delay and faults).
    #[must_use]
    pub fn poppet_open(&self) -> bool {
        self.poppet_open
    }

    /// Whether the chamber sees the valve open, faults included.
    #[must_use]
    #[inline]
    pub fn is_open(&self) -> bool {
        match self.fault {
            ValveFault::None => self.open,
            ValveFault::StuckOpen => true,
            ValveFault::StuckShut => false,
        }
    }

    /// Poppet movements so far, openings and closings counted separately.
    #[must_use]
    pub fn switches(&self) -> u64 {
        self.switches
    }

    /// Next moment at which the effect or the poppet changes \[ns\].
    #[must_use]
    #[inline]
    pub fn next_edge_ns(&self) -> u64 {
        self.poppet_edge_ns.min(self.line[0])
    }

    /// Sets the driver's level at `now_ns`. Repeating a level does nothing.
    ///
    /// Take due edges with [`Self::settle`] first.
    pub fn command(&mut self, on: bool, now_ns: u64, timing: &ValveTiming) {
        if on == self.commanded {
            return;
        }
        self.commanded = on;
        self.poppet_edge_ns = if on == self.poppet_open {
            // Called back before it moved: the pulse or gap was too short.
            NEVER_NS
        } else if on {
            now_ns.saturating_add(timing.t_on_ns)
        } else {
            now_ns.saturating_add(timing.t_off_ns)
        };
    }

    /// Takes every edge that is due at `now_ns`, in order of time.
    ///
    /// # Errors
    /// [`PlantError::EdgeQueueFull`] if the line holds too many edges
    /// (impossible with valid parameters and two command edges per millisecond).
    pub fn settle(&mut self, now_ns: u64, timing: &ValveTiming) -> Result<(), PlantError> {
        if self.poppet_edge_ns <= now_ns {
            self.poppet_open = !self.poppet_open;
            self.switches += 1;
            let effect_ns = self.poppet_edge_ns.saturating_add(timing.line_delay_ns);
            self.poppet_edge_ns = NEVER_NS;
            let slot = self
                .line
                .get_mut(usize::from(self.line_len))
                .ok_or(PlantError::EdgeQueueFull(0))?;
            *slot = effect_ns;
            self.line_len += 1;
        }
        while self.line[0] <= now_ns {
            self.open = !self.open;
            self.line.rotate_left(1);
            self.line[LINE_EDGES - 1] = NEVER_NS;
            self.line_len -= 1;
        }
        Ok(())
    }

    /// Adds the state to a hash in declaration order.
    pub fn feed(&self, hasher: &mut StateHasher) {
        hasher.bytes(&[
            u8::from(self.commanded),
            u8::from(self.poppet_open),
            u8::from(self.open),
            self.line_len,
            match self.fault {
                ValveFault::None => 0,
                ValveFault::StuckOpen => 1,
                ValveFault::StuckShut => 2,
            },
        ]);
        hasher.u64(self.poppet_edge_ns);
        for edge in &self.line[..usize::from(self.line_len)] {
            hasher.u64(*edge);
        }
        hasher.u64(self.switches);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const T: ValveTiming = ValveTiming {
        t_on_ns: 5_000_000,
        t_off_ns: 4_000_000,
        line_delay_ns: 0,
    };

    /// Total time open for one pulse, seen by stepping from edge to edge.
    fn open_time_ns(timing: &ValveTiming, pulse_ns: u64, until_ns: u64) -> (u64, u64) {
        let mut v = ValveState::default();
        let mut now = 0;
        let mut open = 0;
        v.command(true, 0, timing);
        let mut fallen = false;
        while now < until_ns {
            let mut next = v.next_edge_ns().min(until_ns);
            if !fallen {
                next = next.min(pulse_ns);
            }
            if v.is_open() {
                open += next - now;
            }
            now = next;
            v.settle(now, timing).unwrap();
            if now == pulse_ns && !fallen {
                v.command(false, now, timing);
                fallen = true;
            }
        }
        (open, v.switches())
    }

    #[test]
    fn pulse_shorter_than_t_on_never_opens() {
        assert_eq!(open_time_ns(&T, 4_999_999, 50_000_000), (0, 0));
    }

    #[test]
    fn longer_pulse_is_open_for_pulse_minus_on_plus_off() {
        for pulse in [5_000_001, 7_350_000, 20_000_000] {
            let (open, switches) = open_time_ns(&T, pulse, 60_000_000);
            assert_eq!(open, pulse - 5_000_000 + 4_000_000);
            assert_eq!(switches, 2);
        }
    }

    #[test]
    fn line_delay_shifts_the_effect_without_changing_its_length() {
        let late = ValveTiming {
            line_delay_ns: 2_900_000,
            ..T
        };
        assert_eq!(
            open_time_ns(&T, 8_000_000, 60_000_000),
            open_time_ns(&late, 8_000_000, 60_000_000)
        );
        let mut v = ValveState::default();
        v.command(true, 0, &late);
        v.settle(7_899_999, &late).unwrap();
        assert!(v.poppet_open() && !v.is_open());
        assert_eq!(v.next_edge_ns(), 7_900_000);
        v.settle(7_900_000, &late).unwrap();
        assert!(v.is_open());
    }

    #[test]
    fn gap_shorter_than_t_off_never_shuts() {
        let mut v = ValveState::default();
        v.command(true, 0, &T);
        v.settle(5_000_000, &T).unwrap();
        assert!(v.is_open());
        v.command(false, 10_000_000, &T);
        v.settle(13_999_999, &T).unwrap();
        v.command(true, 13_999_999, &T);
        for ms in 14..40 {
            v.settle(ms * 1_000_000, &T).unwrap();
            assert!(v.is_open());
        }
        assert_eq!(v.switches(), 1);
        // One nanosecond more and it does shut.
        v.command(false, 40_000_000, &T);
        v.settle(44_000_000, &T).unwrap();
        assert!(!v.is_open());
    }

    #[test]
    fn faults_override_the_effect() {
        let mut v = ValveState {
            fault: ValveFault::StuckOpen,
            ..ValveState::default()
        };
        assert!(v.is_open());
        v.fault = ValveFault::StuckShut;
        v.command(true, 0, &T);
        v.settle(6_000_000, &T).unwrap();
        assert!(!v.is_open());
        assert!(v.poppet_open());
    }

    proptest! {
        /// For any pulse train at two edges a millisecond, the line queue never fills and the effect ends
        /// where the command ends.
        #[test]
        fn any_pulse_train_ends_where_commanded(
            pulses in proptest::collection::vec((0u64..=1000, any::<bool>()), 1..200),
            t_on in 0u64..3_000_000, t_off in 0u64..3_000_000, delay in 0u64..7_000_000,
        ) {
            let timing = ValveTiming { t_on_ns: t_on, t_off_ns: t_off, line_delay_ns: delay };
            let mut v = ValveState::default();
            let mut now = 0;
            for (us, on) in &pulses {
                let fall = now + us * 1000;
                v.settle(now, &timing)?;
                v.command(*on && *us > 0, now, &timing);
                while v.next_edge_ns() <= fall { let e = v.next_edge_ns(); v.settle(e, &timing)?; }
                if *us < 1000 { v.command(false, fall, &timing); }
                now += 1_000_000;
                while v.next_edge_ns() <= now { let e = v.next_edge_ns(); v.settle(e, &timing)?; }
            }
            let last = v.commanded();
            while v.next_edge_ns() != NEVER_NS { let e = v.next_edge_ns(); v.settle(e, &timing)?; }
            prop_assert_eq!(v.is_open(), last);
            prop_assert_eq!(v.switches() % 2 == 1, last);
        }
    }
}
