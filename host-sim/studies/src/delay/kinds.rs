//! Laws and kinds of move.

use schemars::JsonSchema;
use serde::Serialize;

use crate::axis_sim;

/// Control law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// P + fuzzy PD, as the paper describes it.
    Paper,
    /// The predictive law.
    Default,
}

impl Law {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Paper, Self::Default];

    /// Name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Default => "default",
        }
    }

    pub(super) const fn kind(self) -> axis_sim::Kind {
        match self {
            Self::Paper => axis_sim::Kind::FuzzyPd,
            Self::Default => axis_sim::Kind::Predictive,
        }
    }
}

/// Start of a move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// Retracts from the extended stop, against which the law kept pushing.
    HomeHeld,
    /// Retracts from the extended stop, where the law had settled.
    HomeRest,
    /// Extends from the retracted stop, against which the law kept pushing.
    StopHeld,
    /// Extends from the retracted stop, where the law had settled.
    StopRest,
    /// Extends from a rest inside the stroke.
    MidExtend,
    /// Retracts from a rest inside the stroke.
    MidRetract,
    /// Turns round inside the stroke, while extending.
    Reversal,
}

impl Start {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::HomeHeld,
        Self::HomeRest,
        Self::StopHeld,
        Self::StopRest,
        Self::MidExtend,
        Self::MidRetract,
        Self::Reversal,
    ];

    /// Name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::HomeHeld => "home, held",
            Self::HomeRest => "home, at rest",
            Self::StopHeld => "stop, held",
            Self::StopRest => "stop, at rest",
            Self::MidExtend => "mid-stroke, extends",
            Self::MidRetract => "mid-stroke, retracts",
            Self::Reversal => "mid-stroke, reverses",
        }
    }

    /// One line for the reader.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::HomeHeld => {
                "retracts from the extended stop, where the law pushes on: one chamber at supply"
            }
            Self::HomeRest => "retracts from the extended stop, where the law has shut the valves",
            Self::StopHeld => "extends from the retracted stop, where the law pushes on",
            Self::StopRest => "extends from the retracted stop, where the law has shut the valves",
            Self::MidExtend => "extends from a settled rest at 30 to 70 % of the stroke",
            Self::MidRetract => "retracts from a settled rest at 30 to 70 % of the stroke",
            Self::Reversal => "reference reversed in the middle of an extending move",
        }
    }

    pub(super) const fn held(self) -> bool {
        matches!(self, Self::HomeHeld | Self::StopHeld)
    }

    /// Direction of the move that starts: 1 extends.
    #[must_use]
    pub const fn sign(self) -> f64 {
        match self {
            Self::StopHeld | Self::StopRest | Self::MidExtend => 1.0,
            _ => -1.0,
        }
    }
}
