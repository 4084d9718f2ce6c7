//! What each part of the predictive law is worth: it is taken out, and the same random combinations are played with and
//! without it. `cargo xtask deep ablation` plays them and writes the table of `docs/guide/on-off-valves.md`.

mod long_checks;

use std::fmt::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use long_checks::number;
use wheeleg_config::AxisConfig;
use wheeleg_control::ablation::{Part, take_out};
use wheeleg_report::stats::{failure_bound, mcnemar, quantile};
use wheeleg_studies::axis_sim::Kind;
use wheeleg_studies::compare::{Case, Move, Variation, judging_root};

/// Combinations of an axis, half of them from vented chambers and half with air that nobody knows.
const COMBINATIONS_VARIABLE: &str = "WHEELEG_ABLATION";
const COMBINATIONS: u64 = 300;
/// Number of the first one, instead of the hash of the law's sources.
const ROOT_VARIABLE: &str = "WHEELEG_ABLATION_ROOT";
/// The first is that of the table's columns of its own.
const AXES: [&str; 4] = ["bench-vq110u", "small-12x50", "long-16x400", "heavy-40x250"];

/// What the table says of a part.
const fn told(part: Part) -> &'static str {
    match part {
        Part::LoadObserver => "load observer",
        Part::MassEstimator => "mass estimator and identification",
        Part::AirIdentification => "identification of the air only",
        Part::DeadTimePredictor => "dead-time prediction of the motion",
        Part::Parabola => {
            "the parabola of the switching curve (straight line up to top speed instead)"
        }
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

/// What came of a combination.
struct Outcome {
    keeps: bool,
    /// Until within 1 mm for good, s; infinite if never.
    settle_s: f64,
}

/// Every combination of an axis, with the delays of its valves as a board finds them.
fn cases(axis: &str, root: u64, count: u64) -> Vec<Case> {
    let sheet = AxisConfig::load(axis).expect("built in").axis;
    (0..count)
        .map(|k| {
            let variation = if k % 2 == 0 {
                Variation::Combination(root + k)
            } else {
                Variation::Drawn(root + k)
            };
            Case::new(axis, &sheet, variation, 1).expect("runs")
        })
        .collect()
}

/// Plays all, two at a time, in their order.
fn played(cases: &[Case]) -> Vec<Outcome> {
    let next = AtomicU64::new(0);
    let play = || {
        let mut mine = Vec::new();
        loop {
            let k = next.fetch_add(1, Ordering::Relaxed) as usize;
            let Some(case) = cases.get(k) else {
                return mine;
            };
            let (kind, motion) = (Kind::Predictive, Move::Step100);
            let played = case.play(kind, motion).expect("runs");
            assert!(played.is_some(), "drawn to be feasible");
            let row = case.row(kind, motion, played.as_ref(), None);
            let outcome = Outcome {
                keeps: row.keeps(),
                settle_s: row.figures.settle_s.unwrap_or(f64::INFINITY),
            };
            mine.push((k, outcome));
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

/// A law without a part, beside the whole one.
struct Row {
    worse: u64,
    better: u64,
    p: f64,
    text: String,
}

impl Row {
    /// `whole` and `without` are in one order, those of the first axis first.
    fn new(name: &str, whole: &[Outcome], without: &[Outcome], first_axis: usize) -> Self {
        let missed = |of: &[Outcome]| of.iter().filter(|outcome| !outcome.keeps).count() as u32;
        let of = |of: &[Outcome]| {
            let bound = 100.0 * failure_bound(missed(of), of.len() as u32);
            format!("{} (≤ {bound:.1} %)", missed(of))
        };
        let turned = |from: bool| {
            let pairs = whole.iter().zip(without);
            pairs
                .filter(|(a, b)| a.keeps == from && b.keeps != from)
                .count() as u64
        };
        let (worse, better) = (turned(true), turned(false));
        let p = mcnemar(worse, better);
        let own = &without[..first_axis];
        let times: Vec<f64> = own.iter().map(|outcome| outcome.settle_s).collect();
        let mut text = format!("| {name} | {} | {} | ", of(own), of(without));
        if !std::ptr::eq(whole, without) {
            let _ = write!(text, "{worse}, {better}; p ");
            let _ = match p {
                p if p < 0.001 => write!(text, "< 0.001"),
                p if p < 0.1 => write!(text, "{p:.3}"),
                p => write!(text, "{p:.1}"),
            };
        }
        let [median, most] = [0.5, 0.9].map(|share| seconds(quantile(&times, share)));
        let _ = writeln!(text, " | {median}, {most} |");
        Self {
            worse,
            better,
            p,
            text,
        }
    }
}

#[test]
fn what_each_part_of_the_law_is_worth() {
    let (count, root) = (
        number(COMBINATIONS_VARIABLE, COMBINATIONS),
        number(ROOT_VARIABLE, judging_root()),
    );
    let cases: Vec<Case> = AXES
        .iter()
        .flat_map(|axis| cases(axis, root, count))
        .collect();
    let first_axis = count as usize;
    let whole = played(&cases);
    let mut table = Row::new("nothing: the complete law", &whole, &whole, first_axis).text;
    let mut rows = Vec::new();
    for part in Part::ALL {
        take_out(Some(part));
        let row = Row::new(told(part), &whole, &played(&cases), first_axis);
        take_out(None);
        table += &row.text;
        rows.push((part, row));
    }
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("ablation.md");
    std::fs::write(&path, &table).expect("written");
    println!("{table}");
    let pairs = cases.len();
    // One line: it goes into the record of long checks.
    println!(
        "each part of the law taken out, {pairs} combinations on four axes from number {root}, worse and better: {}; \
table in {}",
        rows.iter()
            .map(|(part, row)| format!("{part:?} {}, {}", row.worse, row.better))
            .collect::<Vec<_>>()
            .join("; "),
        path.display()
    );
    // These two carry the law: without them it misses often, whatever the combinations are.
    for (part, row) in rows.iter().take(2) {
        assert!(
            row.worse > row.better && row.p < 1e-3,
            "{part:?}: {}",
            row.text
        );
    }
}
