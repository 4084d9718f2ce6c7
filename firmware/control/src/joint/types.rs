//! What goes into and comes out of a joint controller each tick.

use crate::pwm::OnTimes;
use crate::valve::ValveOpenings;
use wheeleg_units::{Duty, PositionMm, Ticks, VelocityMmS};

/// Which fuzzy correction is added to the proportional term (PAPER §8: chosen
/// according to the trajectory).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Correction {
    /// Inputs e, ė: for fast moves.
    #[default]
    Pd,
    /// Inputs ∫e, ė: for accurate, slower positioning.
    Id,
}

/// Control law of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Law {
    /// PAPER §8: proportional, with a fuzzy correction.
    #[default]
    Fuzzy,
    /// Full push or pull outside the settle band, nothing inside.
    OnOff,
    /// PWM of Kp e.
    Proportional,
    /// PWM of Kp e + Ki ∫e + Kd ė.
    Pid,
    /// Seven valve modes on a sliding surface e + T ė (after Hodgson, Le,
    /// Tavakoli and Pham, Mechatronics 22, 2012).
    Sliding,
    /// Estimated pressures, and motion predicted over the dead time: [`crate::axis`].
    Predictive,
}

impl Law {
    /// All laws, in the order of the numbers of the parameter `law`.
    pub const ALL: [Self; 6] = [
        Self::Fuzzy,
        Self::OnOff,
        Self::Proportional,
        Self::Pid,
        Self::Sliding,
        Self::Predictive,
    ];
}

/// Inputs of one joint tick, latched at its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointInput {
    /// Measured stroke.
    pub measured: PositionMm,
    /// Reference stroke.
    pub reference: PositionMm,
    /// Velocity of the reference; zero for a step.
    pub reference_velocity: VelocityMmS,
    /// The reference announced for later, and when it takes effect. The predictive law vents the counter chamber ahead
    /// of a known move; the output of the other laws does not depend on it.
    pub announced: Option<Announced>,
}

/// A reference known ahead of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Announced {
    /// The reference to come.
    pub reference: PositionMm,
    /// Control ticks until it becomes the reference.
    pub after: Ticks,
}

/// What shaped the output of this tick: indications, not faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct JointLimits {
    /// The duty was cut to the configured limit.
    pub duty: bool,
    /// The integral was not advanced, because the output is saturated and the error pushes further, or because the
    /// error is outside the integral zone. At rest it is not advanced, either, but that is not a limit.
    pub integral_frozen: bool,
    /// The integral is at its bound.
    pub integral_clamped: bool,
    /// The error was beyond the domain of the rule base and was limited to its edge.
    pub error: bool,
    /// The velocity error was beyond the domain of the rule base.
    pub velocity: bool,
    /// The duty was too small to act on; the valves are shut.
    pub below_minimum: bool,
    /// The reference was outside the stroke limits and was cut to them.
    pub reference: bool,
}

impl JointLimits {
    /// Whether any limit was active.
    #[must_use]
    pub fn any(&self) -> bool {
        *self != Self::default()
    }
}

/// Result of one joint tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointOutput {
    /// Signed duty after limit and dead-zone compensation; positive extends.
    pub duty: Duty,
    /// The duty allocated to the valves: effective openings per PWM period.
    pub openings: ValveOpenings,
    /// On-times of the next tick if the law times each pulse itself; the openings are then all zero and the PWM is not
    /// used.
    pub direct: Option<OnTimes>,
    /// Error, reference − measured.
    pub error: PositionMm,
    /// Velocity estimate, positive extending.
    pub velocity: VelocityMmS,
    /// Which limits shaped this output.
    pub limits: JointLimits,
    /// At rest in the settle band: all valves shut until the error leaves the
    /// release band.
    pub settled: bool,
}
