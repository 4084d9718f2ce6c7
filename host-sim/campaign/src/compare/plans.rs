//! The plans of a comparison.

use std::path::Path;

use serde_json::json;
use wheeleg_config::ConfigError;
use wheeleg_config::bench::{Air, StartUp, Varied};
use wheeleg_config::plan::{Plan, Sources, Text};
use wheeleg_studies::compare::{Move, Variation};

use super::Options;

/// Moves under variations, unless chosen.
const VARIED: [Move; 2] = [Move::Step100, Move::SCurve];

/// Moves of a plan: those that were chosen, or else these.
pub(super) fn moves(options: &Options, otherwise: &[Move]) -> Vec<Move> {
    options.moves.clone().unwrap_or_else(|| otherwise.to_vec())
}

/// One plan: its name, first seed and number of seeds, moves, variations, and what is not known at power-up.
struct Part {
    name: &'static str,
    seeds: [u64; 2],
    moves: Vec<Move>,
    variations: Vec<Varied>,
    delays: StartUp,
    air: Air,
}

/// The plans with cases in them: as on the sheet for all seeds, one factor at a time, and random combinations, whose
/// seeds are their numbers.
pub(super) fn all(
    options: &Options,
    one_at_a_time: &[Variation],
) -> Result<Vec<Plan>, ConfigError> {
    let one_at_a_time = one_at_a_time.iter().copied();
    let parts = [
        Part {
            name: "sheet",
            seeds: [options.seed, options.seeds],
            moves: moves(options, &Move::LEARNT),
            variations: vec![Varied::Always(Variation::Nominal)],
            delays: StartUp::Sheet,
            air: Air::File,
        },
        Part {
            name: "factors",
            seeds: [options.seed, 1],
            moves: moves(options, &VARIED),
            variations: one_at_a_time.map(Varied::Always).collect(),
            delays: StartUp::Identified,
            air: Air::File,
        },
        Part {
            name: "combinations",
            seeds: [options.root, options.combinations],
            moves: moves(options, &[Move::Step100]),
            variations: vec![Varied::Drawn],
            delays: StartUp::Identified,
            air: Air::Unknown,
        },
    ];
    let parts = parts
        .iter()
        .filter(|part| part.seeds[1] > 0 && !part.variations.is_empty());
    parts.map(|part| plan(options, part)).collect()
}

fn plan(options: &Options, part: &Part) -> Result<Plan, ConfigError> {
    let axes = &options.axes;
    let controllers: Vec<&str> = options.kinds.iter().map(|kind| kind.name()).collect();
    let moves: Vec<&str> = part.moves.iter().map(|motion| motion.name()).collect();
    let variations: Vec<String> = part.variations.iter().map(ToString::to_string).collect();
    let [first_seed, replicates] = part.seeds;
    // A string of JSON is one of TOML.
    let text = format!(
        "name = {}\nroot = 1\nfirst_seed = {first_seed}\nreplicates = {replicates}\n\n\
         [base]\naxis = {}\ndelays = {}\nair = {}\n\n\
         [factor.axis]\nparameter = \"axis\"\ngrid = {}\n\n\
         [factor.variation]\nparameter = \"variation\"\ngrid = {}\n\n\
         [factor.controller]\nparameter = \"controller\"\ngrid = {}\n\n\
         [factor.move]\nparameter = \"move\"\ngrid = {}\n",
        json!(part.name),
        json!(axes[0]),
        json!(part.delays.name()),
        json!(part.air.name()),
        json!(axes),
        json!(variations),
        json!(controllers),
        json!(moves),
    );
    let file = format!("{}.toml", part.name);
    Plan::of(Sources::of(Text { file, text }, Path::new(""))?)
}
