//! Draws the values of the random factors; the value for any sample is available without those before it.
//!
//! For a factor and a sample, each sampler returns a share strictly between 0 and 1. The factor's
//! distribution turns it into a value ([`quantile::quantile`]).

mod feistel;
pub(crate) mod quantile;
mod sobol;

use wheeleg_config::plan::{Plan, Sampler, Value, Values};

use crate::CampaignError;
use feistel::Permutation;
use sobol::Directions;

/// Draws the samples of a plan.
pub struct Draws<'a> {
    plan: &'a Plan,
    kind: Kind,
}

enum Kind {
    Random,
    LatinHypercube(Vec<Permutation>),
    Sobol(Vec<Directions>),
    /// Directions of the first of the two points, then of the second.
    Saltelli(Vec<Directions>),
}

impl<'a> Draws<'a> {
    /// Creates the sampler of a plan.
    ///
    /// # Errors
    /// [`CampaignError::Refused`] if a Sobol sequence does not have this many dimensions.
    pub fn new(plan: &'a Plan) -> Result<Self, CampaignError> {
        let drawn: Vec<&str> = plan.drawn().map(|factor| factor.name.as_str()).collect();
        let of_point = |point: u64| drawn.iter().map(move |name| (*name, point));
        let kind = match plan.sampler {
            Sampler::Random => Kind::Random,
            Sampler::LatinHypercube => {
                let key = |name: &&str| hash(plan.root, "permutation", name, 0);
                let permutations = drawn.iter().map(key);
                let permutations = permutations.map(|key| Permutation::new(key, plan.samples));
                Kind::LatinHypercube(permutations.collect())
            }
            Sampler::Sobol => Kind::Sobol(sobol::directions(plan.root, of_point(0))?),
            Sampler::Saltelli => {
                let both = of_point(0).chain(of_point(1));
                Kind::Saltelli(sobol::directions(plan.root, both)?)
            }
        };
        Ok(Self { plan, kind })
    }

    /// Value of each factor for a sample and a cell of the grid.
    #[must_use]
    pub fn values(&self, cell: u64, sample: u64) -> Vec<Value> {
        let mut drawn = 0;
        // The last factor with a list changes from one cell to the next.
        let mut rest = cell;
        let mut places: Vec<u64> = Vec::new();
        for factor in self.plan.factors.iter().rev() {
            places.push(rest % factor.grid_len());
            rest /= factor.grid_len();
        }
        let factors = self.plan.factors.iter().zip(places.into_iter().rev());
        factors
            .map(|(factor, place)| match &factor.values {
                Values::Grid(list) => list[place as usize].clone(),
                Values::Drawn(distribution) => {
                    let share = self.share(&factor.name, drawn, sample);
                    drawn += 1;
                    quantile::quantile(distribution, share)
                }
            })
            .collect()
    }

    /// The share for `factor`, which is the `dimension`-th drawn factor, in a sample.
    fn share(&self, factor: &str, dimension: usize, sample: u64) -> f64 {
        let root = self.plan.root;
        match &self.kind {
            Kind::Random => unit(first(hash(root, "random", factor, sample))),
            Kind::LatinHypercube(permutations) => {
                let cell = permutations[dimension].of(sample) as f64;
                let within = unit(first(hash(root, "within", factor, sample)));
                ((cell + within) / self.plan.samples as f64).clamp(LEAST, MOST)
            }
            Kind::Sobol(directions) => unit(directions[dimension].shifted(sample)),
            Kind::Saltelli(directions) => {
                let factors = directions.len() / 2;
                let (point, place) = (sample / (factors as u64 + 2), sample % (factors as u64 + 2));
                // The first of two points, then that point with one factor at a time from the second, then
                // the second.
                let of_other = place == factors as u64 + 1 || place == dimension as u64 + 1;
                let dimension = dimension + if of_other { factors } else { 0 };
                unit(directions[dimension].shifted(point))
            }
        }
    }
}

/// Half a unit of the 53rd bit away from either end.
const LEAST: f64 = 0.5 / (1_u64 << 53) as f64;
const MOST: f64 = 1.0 - 2.0 * LEAST;

/// The first 53 bits as a share, taken at the middle of their step and therefore never 0 or 1.
fn unit(bits: u64) -> f64 {
    (((bits >> 11) as f64 + 0.5) / (1_u64 << 53) as f64).min(MOST)
}

fn first(hash: [u8; 32]) -> u64 {
    let (bytes, _) = hash.split_first_chunk().expect("32 bytes");
    u64::from_le_bytes(*bytes)
}

/// BLAKE3 hash of the root, a purpose, a factor and a number.
fn hash(root: u64, purpose: &str, factor: &str, number: u64) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new_derive_key("wheeleg campaign draw v1");
    hasher.update(&root.to_le_bytes());
    for text in [purpose, factor] {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    }
    hasher.update(&number.to_le_bytes());
    *hasher.finalize().as_bytes()
}
