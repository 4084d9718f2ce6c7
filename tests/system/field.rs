//! The walks over terrain on five seeds, as the page of `wheeleg field` judges them.

use wheeleg_studies::field::{self, Met, Options, SCENARIOS, Summary, Tried};
use wheeleg_studies::study::Settings;

fn field(scenarios: &[&str], seeds: u32) -> Summary {
    let folder = tempfile::tempdir().expect("a folder");
    let options = Options {
        scenarios: SCENARIOS
            .iter()
            .copied()
            .filter(|name| scenarios.contains(name))
            .collect(),
        seeds,
    };
    let finished = field::write(&options, &Settings::new(folder.path())).expect("written");
    let page = std::fs::read_to_string(&finished.report).expect("a page");
    assert!(page.contains("</html>") && page.len() < 3_000_000);
    for tried in &finished.result.scenarios {
        println!("{}: {} of {}", tried.scenario, tried.passed, tried.runs);
        for m in &tried.measured {
            let (mean, low, high) = (m.mean, m.lowest, m.highest);
            println!("  {} {mean:?} ({low:?} to {high:?}) {}", m.measure, m.unit);
        }
    }
    finished.result
}

fn tried<'a>(summary: &'a Summary, name: &str) -> &'a Tried {
    let found = summary.scenarios.iter().find(|t| t.scenario == name);
    found.expect("tried")
}

/// The smoke test of what rests on 100 seeds in `cargo xtask deep field`.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn the_claims_that_hold_hold_on_five_seeds() {
    let summary = field(&["sand-flat", "sand-slope-10", "rocks-30"], 5);
    let met = |paper: &str| {
        summary
            .claims
            .iter()
            .find(|c| c.paper == paper)
            .map(|c| c.met)
    };
    assert_eq!(met("12 cm/s on flat sand"), Some(Met::Met));
    assert_eq!(met("7.5 cm/s over rocks"), Some(Met::Met));
    assert_eq!(met("rocks of up to about 30 cm"), Some(Met::Met));
    assert_eq!(tried(&summary, "sand-slope-10").passed, 5);
    // Another seed is another field.
    let speeds: std::collections::BTreeSet<u64> = summary
        .runs
        .iter()
        .filter(|run| run.scenario == "rocks-30")
        .filter_map(|run| run.bars.iter().find(|b| b.id == "speed")?.value)
        .map(f64::to_bits)
        .collect();
    assert_eq!(speeds.len(), 5);
}

/// What cannot be done must not look as if it could: a wall of 30 cm, and a slope on which soft
/// soil carries the wheels so far ahead of the axle that the robot tips.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn a_wall_and_steep_sand_are_not_climbed() {
    let summary = field(&["sand-slope-20", "wall-30"], 1);
    assert_eq!(tried(&summary, "wall-30").passed, 1);
    assert_eq!(tried(&summary, "sand-slope-20").passed, 0);
    let claim = summary
        .claims
        .iter()
        .find(|c| c.scenario == "sand-slope-20");
    assert_eq!(claim.map(|c| c.met), Some(Met::NotMet));
}
