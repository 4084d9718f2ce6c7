//! What each part of observer and law is worth: a study removes one at a time (`cargo xtask deep ablation`, table in
//! `docs/guide/on-off-valves.md`).
//!
//! This needs the feature `ablation`, with which no image and no program is built. Without it [`is_without`] is a
//! constant, and the compiler removes it entirely.

/// A part that can be removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Part {
    /// The load stays zero.
    LoadObserver = 1,
    /// The mass stays as specified; pressures are not identified, either.
    MassEstimator,
    /// Friction stays as specified.
    FrictionEstimator,
    /// The mass comes only from three instants of the move, and the pressures stay as they are.
    AirIdentification,
    /// The law acts on the motion at the moment.
    DeadTimePredictor,
    /// The straight line replaces the parabola, up to top speed.
    Parabola,
    /// No landing: the straight line reaches down to the target.
    Landing,
    /// No friction is fed forward.
    FrictionFeedForward,
    /// The force on a stuck piston does not grow.
    BreakawayRamp,
    /// The valves do not shut early to let friction stop the piston in the band.
    StoppingDistance,
    /// Patience with a target never ends.
    Patience,
    /// The full acceleration is demanded even when patience is over.
    EasedGain,
    /// On coarse valves the position servo acts all the way to the target.
    Inching,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 13] = [
        Self::LoadObserver,
        Self::MassEstimator,
        Self::FrictionEstimator,
        Self::AirIdentification,
        Self::DeadTimePredictor,
        Self::Parabola,
        Self::Landing,
        Self::FrictionFeedForward,
        Self::BreakawayRamp,
        Self::StoppingDistance,
        Self::Patience,
        Self::EasedGain,
        Self::Inching,
    ];
}

#[cfg(feature = "ablation")]
mod switch {
    use super::Part;
    use core::sync::atomic::{AtomicU8, Ordering};

    /// Number of the part that is removed; 0 for none.
    static OUT: AtomicU8 = AtomicU8::new(0);

    /// Removes a part from every law of this process, or restores the last one.
    pub fn take_out(part: Option<Part>) {
        OUT.store(part.map_or(0, |part| part as u8), Ordering::Relaxed);
    }

    /// Whether this part is removed.
    pub(crate) fn is_without(part: Part) -> bool {
        OUT.load(Ordering::Relaxed) == part as u8
    }
}

#[cfg(feature = "ablation")]
pub(crate) use switch::is_without;
#[cfg(feature = "ablation")]
pub use switch::take_out;

/// Whether this part is removed: never, without the feature.
#[cfg(not(feature = "ablation"))]
pub(crate) const fn is_without(_: Part) -> bool {
    false
}
