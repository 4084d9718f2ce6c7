//! Rest detection: two bands, two dwells.
//!
//! ```text
//! settles    |e| ≤ settle band, |v| and |reference velocity| ≤ settle velocity, for the settle dwell
//! releases   |e| > release band for the release dwell, or |reference velocity| > settle velocity at once
//! ```
//!
//! Source: hysteresis with dwell, DERIVED. Assumes: a release band wider than the settle band by more than the noise
//! of the position.

use super::config::JointConfig;
use wheeleg_units::{PositionMm, VelocityMmS};

/// Whether the joint is at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Settle {
    settled: bool,
    /// Ticks for which the condition for a change has held.
    held: u32,
}

impl Settle {
    pub(super) const fn new() -> Self {
        Self {
            settled: false,
            held: 0,
        }
    }

    pub(super) const fn is_settled(self) -> bool {
        self.settled
    }

    /// Takes the magnitudes of this tick. Returns whether the valves are to be shut: at rest, and also during the dwell
    /// before it, because the shortest opening of a valve would push a small error out of the band again.
    #[inline]
    pub(super) fn update(
        &mut self,
        config: &JointConfig,
        error: PositionMm,
        velocity: VelocityMmS,
        reference_velocity: VelocityMmS,
    ) -> bool {
        let gains = config.gains();
        let reference_moves = reference_velocity.saturating_abs() > gains.settle_velocity;
        let (change, dwell) = if self.settled {
            let outside = error.saturating_abs() > gains.release_band;
            (outside, config.release_ticks)
        } else {
            let inside = error.saturating_abs() <= gains.settle_band
                && velocity.saturating_abs() <= gains.settle_velocity
                && !reference_moves;
            (inside, config.settle_ticks)
        };
        self.held = if change {
            self.held.saturating_add(1)
        } else {
            0
        };
        // A dwell of 0 acts like one tick: the condition must hold now.
        let elapsed = change && self.held >= dwell;
        if elapsed || (self.settled && reference_moves) {
            self.settled = !self.settled;
            self.held = 0;
        }
        self.settled || self.held > 0
    }
}
