//! A plan of a campaign: one scenario, or one cylinder on the bench, many times, and the differences from case to
//! case.
//!
//! | file | what |
//! |---|---|
//! | `sources.rs` | the texts that a plan stands on: its own, of scenarios, of robots, of axes |
//! | `base.rs` | what every case starts from |
//! | `factor.rs` | one factor: what it sets, and its values |
//! | `value.rs` | one value: a number, a name, yes or no |
//! | `distribution.rs` | distributions, and where they end |
//! | `resolve.rs` | values of all factors to a scenario and a robot, or to a cylinder on the bench |
//! | `field.rs` | values of factors in the texts of files |
//! | `check.rs` | every value that a factor can have, against the files' own ranges |

mod base;
mod check;
mod distribution;
mod factor;
mod field;
mod resolve;
mod sources;
mod value;

pub use base::{AxisBase, Base, Setting};
pub use distribution::{Choice, Distribution};
pub use factor::{Factor, Field, Part, Sets, Values};
pub use resolve::{OnBench, OnRobot, Resolved, Resolver};
pub use sources::{Sources, Text};
pub use value::Value;

use toml_edit::{ArrayOfTables, DocumentMut};

use crate::error::ConfigError;
use crate::params::FieldSpec;
use crate::quantity::Dimension;
use crate::reader::{FileKind, Reader};
use crate::scenario::MAX_DURATION_S;

/// How the values of factors that are not on a grid are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampler {
    /// Each on its own, uniform.
    Random,
    /// One in each of as many equal parts as there are samples.
    LatinHypercube,
    /// The sequence of Sobol with the direction numbers of Joe and Kuo, shifted.
    Sobol,
    /// The design of Saltelli over that sequence: of each two points one, then one with a single factor
    /// taken from the other for each factor, then the other.
    Saltelli,
}

/// Samplers by name.
pub const SAMPLERS: [(&str, Sampler); 4] = [
    ("random", Sampler::Random),
    ("latin-hypercube", Sampler::LatinHypercube),
    ("sobol", Sampler::Sobol),
    ("saltelli", Sampler::Saltelli),
];

/// Which cases keep their log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeepLogs {
    /// No case.
    None,
    /// Cases that missed a required target, or have no result.
    Failed,
    /// All.
    All,
}

const KEEP: [(&str, KeepLogs); 3] = [
    ("none", KeepLogs::None),
    ("failed", KeepLogs::Failed),
    ("all", KeepLogs::All),
];

/// A plan, checked.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Name, as in reports.
    pub name: String,
    /// Root of all randomness.
    pub root: u64,
    /// Samples of each cell of the grid.
    pub samples: u64,
    /// Cases of each sample, which differ only in their seeds.
    pub replicates: u64,
    /// Seed of the first replicate; the others count on. `None`: each case has a seed that follows from its
    /// content.
    pub first_seed: Option<u64>,
    /// How samples are drawn.
    pub sampler: Sampler,
    /// Cases of a part file; `None`: as many as are 30 to 120 s of work.
    pub block: Option<u64>,
    /// Logs that are kept.
    pub keep: KeepLogs,
    /// Simulated time after which a case is given up, s.
    pub limit_s: Option<f64>,
    /// Bars that replace those of every scenario; `None`: they keep theirs.
    pub bars: Option<ArrayOfTables>,
    /// Start of every case.
    pub base: Base,
    /// The differences, in the order of the file.
    pub factors: Vec<Factor>,
    /// The texts that it is made from.
    pub sources: Sources,
}

const TOP: [&str; 12] = [
    "name",
    "root",
    "samples",
    "replicates",
    "first_seed",
    "sampler",
    "block",
    "keep",
    "limit",
    "bars",
    "base",
    "factor",
];

/// Most cases of a part file.
pub const MOST_IN_BLOCK: u64 = 1 << 16;
/// Most part files of a campaign: their names have six digits, and one folder holds them all.
pub const MOST_BLOCKS: u64 = 1_000_000;
/// Most samples, replicates and cases of a plan: indices stay exact in tables of floats, too.
const MOST: u64 = MOST_IN_BLOCK * MOST_BLOCKS;
/// Largest first seed, for the same reason.
pub const SEED_MOST: u64 = 1 << f64::MANTISSA_DIGITS;

impl Plan {
    /// A plan by built-in name, or from a TOML file.
    ///
    /// # Errors
    /// [`ConfigError`] with every problem of the plan, or those of a scenario or robot named in it.
    pub fn load(name_or_path: &str) -> Result<Self, ConfigError> {
        Self::of(Sources::load(name_or_path)?)
    }

    /// A plan from its texts.
    ///
    /// # Errors
    /// As [`Plan::load`].
    pub fn of(sources: Sources) -> Result<Self, ConfigError> {
        let Text { file, text } = &sources.plan;
        let what = format!("the plan {file} is not usable");
        let mut r = Reader::parse(&what, file, text, false)?;
        r.ensure_kind(&what, FileKind::Plan)?;
        let plan = read(&mut r, &sources);
        if let Some(plan) = &plan {
            if r.is_clean() {
                check::check(&mut r, plan)?;
            }
            ensure_samples_differ(&mut r, plan);
            ensure_saltelli_is_whole(&mut r, plan);
        }
        r.finish(&what, plan).map(|(plan, _)| plan)
    }

    /// Cells of the grid: one for each combination of values of the factors with a list.
    #[must_use]
    pub fn cells(&self) -> u64 {
        self.factors.iter().map(Factor::grid_len).product()
    }

    /// Number of cases.
    #[must_use]
    pub fn cases(&self) -> u64 {
        self.cells() * self.samples * self.replicates
    }

    /// Seed of all noise, and of rocks, of a replicate; `None` if it follows from the content of a case.
    #[must_use]
    pub fn seed(&self, replicate: u64) -> Option<u64> {
        self.first_seed.map(|first| first + replicate)
    }

    /// Factors that are drawn, in the order of the file.
    pub fn drawn(&self) -> impl Iterator<Item = &Factor> {
        let factors = self.factors.iter();
        factors.filter(|factor| matches!(factor.values, Values::Drawn(_)))
    }

    /// Samples that Saltelli's design makes of two points.
    #[must_use]
    pub fn saltelli_samples(&self) -> u64 {
        self.drawn().count() as u64 + 2
    }

    /// Whether two samples may well have the same values: some factors are drawn, and each of them from
    /// a list.
    #[must_use]
    pub fn draws_from_lists_alone(&self) -> bool {
        let mut from_list = self
            .drawn()
            .map(|factor| matches!(factor.values, Values::Drawn(Distribution::Choice(_))));
        from_list.next() == Some(true) && from_list.all(|from_list| from_list)
    }
}

fn read(r: &mut Reader, sources: &Sources) -> Option<Plan> {
    let top = r.table("")?;
    for (key, span) in top.keys() {
        if key == "cases" {
            r.problem(
                Some(span),
                "`cases` cannot be given: it is grid cells × `samples` × `replicates`".to_owned(),
                "follows from others",
                Some("write `samples` or `replicates`, from 1".to_owned()),
            );
        } else if !TOP.contains(&key) {
            r.reject_field(&top, key, span, &TOP, &[]);
        }
    }
    let name = r.name(&top, "name");
    let mut count = |key: &str, most: u64| match top.get(key) {
        Some(_) => r.whole(&top, key, 1..=most),
        None => Some(1),
    };
    let samples = count("samples", MOST);
    let replicates = count("replicates", MOST);
    let first_seed = match top.get("first_seed") {
        Some(_) => r.whole(&top, "first_seed", 0..=SEED_MOST).map(Some),
        None => Some(None),
    };
    let block = match top.get("block") {
        Some(_) => r.whole(&top, "block", 1..=MOST_IN_BLOCK).map(Some),
        None => Some(None),
    };
    let root = match top.get("root") {
        Some(_) => r.whole(&top, "root", 0..=u64::MAX),
        None => {
            r.problem(
                None,
                "`root` is missing".into(),
                "expected at the top of the file",
                Some("write `root = 1`: all randomness comes from it".into()),
            );
            None
        }
    };
    let sampler = match top.get("sampler") {
        Some(_) => r.choice(&top, "sampler", &SAMPLERS),
        None => Some(Sampler::Random),
    };
    let keep = match top.get("keep") {
        Some(_) => r.choice(&top, "keep", &KEEP),
        None => Some(KeepLogs::None),
    };
    let limit = FieldSpec::scalar(
        "limit",
        Dimension::Time,
        [0.01, MAX_DURATION_S],
        "simulated time after which a case is given up",
    );
    let limit_s = match top.get("limit") {
        Some(_) => r.quantity(&top, &limit).map(|s| s.first().copied()),
        None => Some(None),
    };
    let base = base::read(r);
    // Bars on the bench are none, whatever they say.
    let bars = match r.table("base").is_some_and(|base| base.has("axis")) {
        true => {
            ensure_bench_has(r, keep, limit_s);
            None
        }
        false => bars(r, sources),
    };
    let factors = factor::read_all(r);
    let plan = Plan {
        name: name?,
        root: root?,
        samples: samples?,
        replicates: replicates?,
        first_seed: first_seed?,
        sampler: sampler?,
        block: block?,
        keep: keep?,
        limit_s: limit_s?,
        bars,
        base: base?,
        factors: factors?,
        sources: sources.clone(),
    };
    if let Some(first) = plan.first_seed
        && first + (plan.replicates - 1) > SEED_MOST
    {
        r.problem(
            top.get("first_seed").map(|(key, _)| key),
            format!(
                "`first_seed` = {first} and {} replicates lead to seeds beyond {SEED_MOST}",
                plan.replicates
            ),
            "too large",
            Some(format!(
                "with these replicates it is allowed up to {}",
                SEED_MOST - (plan.replicates - 1)
            )),
        );
    }
    let cells = plan.factors.iter().map(Factor::grid_len);
    let numbers = cells.chain([plan.samples, plan.replicates]);
    let cases = numbers.fold(1_u128, |n, m| n.saturating_mul(u128::from(m)));
    if cases > u128::from(MOST) {
        r.problem(
            top.get("samples").map(|(key, _)| key),
            format!("the plan has {cases} cases: allowed are 1 to {MOST}"),
            "too many",
            Some("cases = grid cells × samples × replicates".into()),
        );
    } else if let Some(block) = plan.block
        && cases.div_ceil(u128::from(block)) > u128::from(MOST_BLOCKS)
    {
        let least = cases.div_ceil(u128::from(MOST_BLOCKS));
        r.problem(
            top.get("block").map(|(key, _)| key),
            format!(
                "`block` = {block} makes {} part files of {cases} cases (grid cells × `samples` × \
                 `replicates`): allowed is `block` from {least} to {MOST_IN_BLOCK}",
                cases.div_ceil(u128::from(block))
            ),
            "too many files",
            Some(format!("a campaign has at most {MOST_BLOCKS} part files")),
        );
    }
    Some(plan)
}

/// A move on the bench has its own length and its own limits, and is played again in a moment.
fn ensure_bench_has(r: &mut Reader, keep: Option<KeepLogs>, limit_s: Option<Option<f64>>) {
    let top = r.table("");
    let none = "not of a cylinder on the bench";
    let mut told = |key: &str, why: &str, help: &str| {
        let span = top
            .as_ref()
            .and_then(|top| top.get(key))
            .map(|(key, _)| key);
        r.problem(span, why.to_owned(), none, Some(help.to_owned()));
    };
    if limit_s.is_some_and(|limit| limit.is_some()) {
        let why = "`limit` is of a scenario's time: a move on the bench has its own";
        told("limit", why, "leave `limit` out");
    }
    if top.as_ref().is_some_and(|top| top.has("bars")) {
        let why = "`[[bars]]` do not exist on the bench: they are limits of a robot's travel, and a move has its own";
        let help = "leave `[[bars]]` out; for limits of your own ask the table, as in \
            `SELECT count(*) FILTER (abs(\"rest-error\") <= 0.2) FROM 'cases.parquet'`";
        told("bars", why, help);
    }
    if keep.is_some_and(|keep| keep != KeepLogs::None) {
        let why = "`keep`: a case on the bench has no log; allowed is \"none\"";
        told(
            "keep",
            why,
            "`wheeleg campaign replay` plays a case again, with tables and figures",
        );
    }
}

/// Reports samples without anything drawn: each case would be computed again.
fn ensure_samples_differ(r: &mut Reader, plan: &Plan) {
    let samples = plan.samples;
    if samples == 1 || plan.drawn().next().is_some() {
        return;
    }
    let top = r.table("");
    let key = top.as_ref().and_then(|top| top.get("samples"));
    r.problem(
        key.map(|(key, _)| key),
        format!(
            "`samples` = {samples} would compute each case {samples} times, as no factor is drawn: \
             allowed is 1"
        ),
        "no factor is drawn",
        Some("for other noise write `replicates`; for other values let a factor be drawn".into()),
    );
}

/// Saltelli's design needs factors to tell apart, and all samples that belong to two points.
fn ensure_saltelli_is_whole(r: &mut Reader, plan: &Plan) {
    if plan.sampler != Sampler::Saltelli {
        return;
    }
    let top = r.table("");
    let span = |key: &str| Some(top.as_ref()?.get(key)?.0);
    let (drawn, samples) = (plan.drawn().count(), plan.samples);
    let set = plan.saltelli_samples();
    if drawn < 2 {
        r.problem(
            span("sampler"),
            format!(
                "`sampler` = \"saltelli\" with {} drawn factor{}: allowed from 2",
                drawn,
                if drawn == 1 { "" } else { "s" }
            ),
            "nothing to tell apart",
            Some("it says how much of a figure's variance each drawn factor causes".into()),
        );
    } else if !samples.is_multiple_of(set) {
        let below = samples / set * set;
        let near = match below {
            0 => format!("{set}"),
            below => format!("{below} or {}", below + set),
        };
        r.problem(
            span("samples"),
            format!(
                "`samples` = {samples} with `sampler` = \"saltelli\" and {drawn} drawn factors: allowed \
                 are multiples of {set}, such as {near}"
            ),
            "not a multiple",
            Some("two points make a sample each, and one for each drawn factor".into()),
        );
    }
}

/// The bars as they stand in the plan, once they are known to be right.
fn bars(r: &mut Reader, sources: &Sources) -> Option<ArrayOfTables> {
    if crate::bars::read(r, &TOP).is_empty() {
        return None;
    }
    let document = sources.plan.text.parse::<DocumentMut>().ok()?;
    document.get("bars")?.as_array_of_tables().cloned()
}
