//! What a plan asks: the start of every case, and what differs from case to case.

use schemars::JsonSchema;
use serde::Serialize;
use wheeleg_config::plan::{Factor, Plan, SAMPLERS, Sets, Values};

/// Most values of a list that are named.
const LISTED: usize = 20;

/// What a plan asks.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Asked {
    /// Settings of every case, each with its value; those that a factor sets are left out.
    pub base: Vec<(String, String)>,
    /// The factors, in the order of the plan.
    pub factors: Vec<OfFactor>,
    /// How the samples are drawn.
    pub sampler: String,
    /// Samples of each cell.
    pub samples: u64,
    /// Cases that differ only in their noise.
    pub replicates: u64,
    /// Seed of the first replicate; null if seeds follow from the cases.
    pub first_seed: Option<u64>,
    /// Root of all randomness, a whole number as text: JSON numbers are exact only up to 2^53.
    pub root: String,
    /// The text of the plan.
    pub text: String,
}

/// One factor.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct OfFactor {
    /// Its name.
    pub name: String,
    /// What it sets.
    pub sets: Vec<String>,
    /// Whether its values multiply those of the file.
    pub scale: bool,
    /// Its values in words: a list, or a distribution.
    pub values: String,
    /// Unit of the values; empty if they have none.
    pub unit: String,
    /// Whether all of its values meet the same noise.
    pub paired: bool,
}

impl OfFactor {
    fn of(factor: &Factor) -> Self {
        Self {
            name: factor.name.clone(),
            sets: factor.sets.names(),
            scale: factor.scale,
            values: match &factor.values {
                Values::Grid(list) => {
                    let named = list.iter().take(LISTED).map(ToString::to_string);
                    let more = list.len().saturating_sub(LISTED);
                    let more = (more > 0).then(|| format!("and {more} more"));
                    named.chain(more).collect::<Vec<_>>().join(", ")
                }
                Values::Drawn(distribution) => distribution.to_string(),
            },
            unit: factor.unit.clone(),
            paired: factor.paired,
        }
    }
}

impl Asked {
    pub(super) fn of(plan: &Plan) -> Self {
        let is_set = |name: &str| {
            let mut sets = plan.factors.iter().map(|factor| &factor.sets);
            sets.any(|sets| matches!(sets, Sets::Base(setting) if setting.name() == name))
        };
        let base = plan.base.settings().into_iter();
        let base = base.map(|(setting, value)| (setting.name().to_owned(), value));
        let sampler = SAMPLERS.iter().find(|(_, known)| *known == plan.sampler);
        Self {
            base: base.filter(|(name, _)| !is_set(name)).collect(),
            factors: plan.factors.iter().map(OfFactor::of).collect(),
            sampler: sampler.map_or(String::new(), |(name, _)| (*name).to_owned()),
            samples: plan.samples,
            replicates: plan.replicates,
            first_seed: plan.first_seed,
            root: plan.root.to_string(),
            text: plan.sources.plan.text.clone(),
        }
    }
}
