//! What each part of observer and law is worth: a study takes out one at a time
//! (`cargo xtask deep ablation`, table in `docs/guide/on-off-valves.md`).
//!
//! Only with the feature `ablation`, which no image and no program is built with. Without it [`is_without`] is a
//! constant, and the compiler leaves nothing of it.

/// A part that can be taken out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Part {
    /// The load stays zero.
    LoadObserver = 1,
    /// The mass stays as specified; pressures are not identified either.
    MassEstimator,
    /// The mass comes from three instants of the move alone, and the pressures stay as they are.
    AirIdentification,
    /// The law acts by the motion of the moment.
    DeadTimePredictor,
    /// Instead of the parabola the straight line goes on, up to top speed.
    Parabola,
    /// No friction is fed forward.
    FrictionFeedForward,
    /// A piston that sticks is pushed with no more force than at first.
    BreakawayRamp,
    /// The valves do not shut for friction to stop the piston in the band.
    StoppingDistance,
    /// Patience with a target is never over.
    Patience,
    /// Where patience is over the whole acceleration is asked for.
    EasedGain,
    /// On coarse valves the position servo acts up to the target.
    Inching,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::LoadObserver,
        Self::MassEstimator,
        Self::AirIdentification,
        Self::DeadTimePredictor,
        Self::Parabola,
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

    /// Number of the part that is out; none has 0.
    static OUT: AtomicU8 = AtomicU8::new(0);

    /// Takes a part out of every law of this process, or puts the last one back.
    pub fn take_out(part: Option<Part>) {
        OUT.store(part.map_or(0, |part| part as u8), Ordering::Relaxed);
    }

    /// Whether this part is out.
    pub(crate) fn is_without(part: Part) -> bool {
        OUT.load(Ordering::Relaxed) == part as u8
    }
}

#[cfg(feature = "ablation")]
pub(crate) use switch::is_without;
#[cfg(feature = "ablation")]
pub use switch::take_out;

/// Whether this part is out: never, without the feature.
#[cfg(not(feature = "ablation"))]
pub(crate) const fn is_without(_: Part) -> bool {
    false
}
