//! What each part of the predictive law is worth: it is taken out, and the same random combinations and cylinders are
//! played with and without it. `cargo xtask deep ablation` plays them and writes the table of
//! `docs/guide/on-off-valves.md`.

mod long_checks;
mod random_cylinder;

use std::fmt::Write as _;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use long_checks::number;
use wheeleg_config::AxisConfig;
use wheeleg_control::ablation::{Part, take_out};
use wheeleg_plant::axis::AxisParams;
use wheeleg_report::stats::{failure_bound, mcnemar, quantile};
use wheeleg_studies::axis_sim::Kind;
use wheeleg_studies::compare::{Case, Move, Variation, judging_root};

/// Combinations of an axis, half of them from vented chambers and half with air that nobody knows; as many cylinders
/// with fine valves, and as many with coarse ones.
const COMBINATIONS_VARIABLE: &str = "WHEELEG_ABLATION";
const COMBINATIONS: u64 = 300;
/// Number of the first one, instead of the hash of the law's sources.
const ROOT_VARIABLE: &str = "WHEELEG_ABLATION_ROOT";
/// Names of the parts that are taken out, with commas between them, instead of all.
const PARTS_VARIABLE: &str = "WHEELEG_ABLATION_PARTS";
/// The first is that of the table's columns of its own.
const AXES: [&str; 4] = ["bench-vq110u", "small-12x50", "long-16x400", "heavy-40x250"];

/// What the table says of a part.
const fn told(part: Part) -> &'static str {
    match part {
        Part::LoadObserver => "load observer",
        Part::MassEstimator => "mass estimator and identification",
        Part::FrictionEstimator => "friction learnt from sliding to and fro",
        Part::AirIdentification => "identification of the air only",
        Part::DeadTimePredictor => "dead-time prediction of the motion",
        Part::Parabola => {
            "the parabola of the switching curve (straight line up to top speed instead)"
        }
        Part::Landing => "landing by friction (the straight line down to the target)",
        Part::FrictionFeedForward => "friction feed-forward",
        Part::BreakawayRamp => {
            "break-away ramp: a slowly growing force until a piston at rest moves"
        }
        Part::StoppingDistance => "closing the valves early and letting friction stop the piston",
        Part::Patience => {
            "the fallback near a target that is not reached (*patience* in the code): wider band, fading friction \
feed-forward, pause, half the acceleration"
        }
        Part::EasedGain => "of that fallback, half the acceleration only",
        Part::Inching => "steps with shut valves between them, on coarse valves",
    }
}

/// What is played with a law and without one of its parts.
enum Tried {
    /// A step of an axis, with one combination of what varies.
    Combination(Box<Case>),
    /// Two moves of a random cylinder, after one that teaches.
    Cylinder(Box<AxisParams>, u64),
}

impl Tried {
    fn play(&self) -> Outcome {
        match self {
            Self::Combination(case) => {
                let (kind, motion) = (Kind::Predictive, Move::Step100);
                let played = case.play(kind, motion).expect("runs");
                assert!(played.is_some(), "drawn to be feasible");
                let row = case.row(kind, motion, played.as_ref(), None);
                Outcome {
                    keeps: row.keeps(),
                    settle_s: row.figures.settle_s.unwrap_or(f64::INFINITY),
                }
            }
            Self::Cylinder(sheet, which) => {
                let outcome = random_cylinder::played(sheet, *which);
                let times = outcome.judged.iter().map(|m| m.settle_s);
                Outcome {
                    keeps: outcome.keeps(),
                    settle_s: times
                        .map(|s| s.unwrap_or(f64::INFINITY))
                        .fold(0.0, f64::max),
                }
            }
        }
    }
}

/// Every combination of an axis, with the delays of its valves as a board finds them.
fn combinations(axis: &str, root: u64, count: u64) -> impl Iterator<Item = Tried> {
    let sheet = AxisConfig::load(axis).expect("built in").axis;
    (0..count).map(move |k| {
        let variation = if k % 2 == 0 {
            Variation::Combination(root + k)
        } else {
            Variation::Drawn(root + k)
        };
        Tried::Combination(Box::new(
            Case::new(axis, &sheet, variation, 1).expect("runs"),
        ))
    })
}

/// The first random cylinders with valves of one kind.
fn cylinders(coarse: bool, root: u64, count: u64) -> impl Iterator<Item = Tried> {
    let drawn = (root..).map(|which| (random_cylinder::drawn(which), which));
    drawn
        .filter(move |(sheet, _)| random_cylinder::is_coarse(sheet) == coarse)
        .take(count as usize)
        .map(|(sheet, which)| Tried::Cylinder(Box::new(sheet), which))
}

/// What came of it.
struct Outcome {
    keeps: bool,
    /// Until within 1 mm for good, s; infinite if never.
    settle_s: f64,
}

/// Plays all, two at a time, in their order.
fn played(tried: &[Tried]) -> Vec<Outcome> {
    let next = AtomicU64::new(0);
    let play = || {
        let mut mine = Vec::new();
        loop {
            let k = next.fetch_add(1, Ordering::Relaxed) as usize;
            let Some(tried) = tried.get(k) else {
                return mine;
            };
            mine.push((k, tried.play()));
        }
    };
    let mut all: Vec<_> = thread::scope(|scope| {
        let two = [scope.spawn(play), scope.spawn(play)];
        two.into_iter()
            .flat_map(|thread| thread.join().expect("plays"))
            .collect()
    });
    all.sort_by_key(|(k, _)| *k);
    all.into_iter().map(|(_, outcome)| outcome).collect()
}

fn seconds(value: Option<f64>) -> String {
    match value {
        Some(s) if s.is_finite() => format!("{s:.2}"),
        _ => "never".to_owned(),
    }
}

/// Where the groups of the table stand in the list of all: the first axis, all four, cylinders with fine valves, with
/// coarse ones.
fn groups(count: u64) -> [Range<usize>; 4] {
    let n = count as usize;
    [0..n, 0..4 * n, 4 * n..5 * n, 5 * n..6 * n]
}

/// How the outcomes of some differ without a part: those that fail only so, and only with it.
struct Change {
    worse: u64,
    better: u64,
}

impl Change {
    fn between(whole: &[Outcome], without: &[Outcome]) -> Self {
        let turned = |from: bool| {
            let pairs = whole.iter().zip(without);
            pairs
                .filter(|(a, b)| a.keeps == from && b.keeps != from)
                .count() as u64
        };
        Self {
            worse: turned(true),
            better: turned(false),
        }
    }

    fn p(&self) -> f64 {
        mcnemar(self.worse, self.better)
    }

    fn told(&self) -> String {
        let Self { worse, better } = self;
        match self.p() {
            p if p < 0.001 => format!("{worse}, {better}; p < 0.001"),
            p if p < 0.1 => format!("{worse}, {better}; p {p:.3}"),
            p => format!("{worse}, {better}; p {p:.1}"),
        }
    }
}

/// A line of the table: a law without a part beside the whole one.
fn line(name: &str, without: &[Outcome], changes: Option<&[Change; 3]>, count: u64) -> String {
    let mut text = format!("| {name} |");
    for group in groups(count) {
        let of = &without[group];
        let missed = of.iter().filter(|outcome| !outcome.keeps).count() as u32;
        let bound = 100.0 * failure_bound(missed, of.len() as u32);
        let _ = write!(text, " {missed} (≤ {bound:.1} %) |");
    }
    for k in 0..3 {
        let told = changes.map_or(String::new(), |changes| changes[k].told());
        let _ = write!(text, " {told} |");
    }
    let [first_axis, ..] = groups(count);
    let times: Vec<f64> = without[first_axis].iter().map(|o| o.settle_s).collect();
    let [median, most] = [0.5, 0.9].map(|share| seconds(quantile(&times, share)));
    let _ = writeln!(text, " {median}, {most} |");
    text
}

/// The parts that are taken out.
fn parts() -> Vec<Part> {
    let Ok(wanted) = std::env::var(PARTS_VARIABLE) else {
        return Part::ALL.to_vec();
    };
    let named = |name: &str| {
        let part = Part::ALL.into_iter().find(|p| format!("{p:?}") == name);
        part.unwrap_or_else(|| panic!("{PARTS_VARIABLE}: {name} is none of {:?}", Part::ALL))
    };
    wanted.split(',').map(named).collect()
}

#[test]
fn what_each_part_of_the_law_is_worth() {
    let (count, root) = (
        number(COMBINATIONS_VARIABLE, COMBINATIONS),
        number(ROOT_VARIABLE, judging_root()),
    );
    let of_axes = AXES.iter().flat_map(|axis| combinations(axis, root, count));
    let of_cylinders = [false, true]
        .into_iter()
        .flat_map(|coarse| cylinders(coarse, root, count));
    let tried: Vec<Tried> = of_axes.chain(of_cylinders).collect();
    let whole = played(&tried);
    let mut table = line("nothing: the complete law", &whole, None, count);
    let [_, axes, fine, coarse] = groups(count);
    let mut rows = Vec::new();
    for part in parts() {
        take_out(Some(part));
        let without = played(&tried);
        take_out(None);
        let changes = [&axes, &fine, &coarse]
            .map(|group| Change::between(&whole[group.clone()], &without[group.clone()]));
        table += &line(told(part), &without, Some(&changes), count);
        rows.push((part, changes));
    }
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("ablation.md");
    std::fs::write(&path, &table).expect("written");
    println!("{table}");
    let told = rows.iter().map(|(part, changes)| {
        let each = changes.each_ref().map(Change::told);
        format!("{part:?} {}", each.join(", "))
    });
    // One line: it goes into the record of long checks.
    println!(
        "each part of the law taken out, {count} combinations on each of four axes, {count} cylinders with fine and {count} \
with coarse valves from number {root}, worse and better on the axes, fine, coarse: {}; table in target/tmp/ablation.md",
        told.collect::<Vec<_>>().join("; ")
    );
    // These two carry the law: without them it misses often, whatever the combinations are.
    for (part, [axes, ..]) in &rows {
        let carries = matches!(part, Part::LoadObserver | Part::MassEstimator);
        assert!(
            !carries || (axes.worse > axes.better && axes.p() < 1e-3),
            "{part:?}: {}",
            axes.told()
        );
    }
}
