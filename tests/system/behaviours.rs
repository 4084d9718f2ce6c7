//! Each behaviour of a walk with and without: pairs of runs that differ only in its switch, compared by the
//! behaviour's metric. Three seeds here; `cargo xtask deep behaviours` runs twenty, with a sign test.

mod every_walk;
pub(crate) mod metrics;
mod pairs;

use crate::sil;
use pairs::PAIRS;
use wheeleg_config::{RobotConfig, Scenario, builtin};
use wheeleg_master::behaviour::Behaviour;
use wheeleg_report::stats::mcnemar;
use wheeleg_studies::analysis::analyse;
use wheeleg_telemetry::{EventCode, Recording, Row};

/// Variable for the number of seeds of every pair.
const SEEDS: &str = "WHEELEG_BEHAVIOUR_SEEDS";

/// A pair of runs.
struct Pair {
    behaviour: Behaviour,
    /// Those that are off in both runs.
    without: &'static [Behaviour],
    robot: &'static str,
    /// The metric and its unit.
    metric: &'static str,
    /// Smaller is better.
    less: bool,
    /// Bound of the terrain's specification on the mean with the behaviour, as a share of the mean without:
    /// for `less` an upper bound, otherwise a lower one.
    asked: f64,
    /// Bracket around the measured share: the test fails on either side of it. `None`: there is no effect,
    /// and `docs/records/behaviours.md` says why.
    bracket: Option<[f64; 2]>,
    duration_s: f64,
    walk: &'static str,
    /// Terrain and faults of a seed, as in a file.
    rest: fn(u64) -> String,
    measure: fn(&Recording) -> f64,
}

fn scenario(pair: &Pair, seed: u64, on: bool) -> Scenario {
    let mut off: Vec<&str> = pair.without.iter().map(|one| one.name()).collect();
    if !on {
        off.push(pair.behaviour.name());
    }
    let name = pair.behaviour.name();
    let text = format!(
        "name = \"{name}\"\ndescription = \"{name}\"\nrobot = \"{}\"\n\
         duration = {{ value = {:.1}, unit = \"s\" }}\nseed = {seed}\ntargets = \"none\"\n{}\n\
         [motion]\nkind = \"walk\"\npattern = \"alternate\"\n{}\n[behaviours]\noff = {off:?}\n",
        pair.robot,
        pair.duration_s,
        (pair.rest)(seed),
        pair.walk,
    );
    // Tables of arrays come last in a file.
    let (head, terrain) = match text.find("[[terrain]]") {
        Some(at) => {
            let end = text.find("[motion]").expect("above");
            let parts = text[at..end].to_owned();
            (format!("{}{}", &text[..at], &text[end..]), parts)
        }
        None => (text, String::new()),
    };
    let text = format!("{head}{terrain}");
    Scenario::parse("pair.toml", &text).unwrap_or_else(|e| panic!("{e:?}\n{text}"))
}

/// The metric with and without, seed by seed.
fn run(pair: &Pair, seeds: u64) -> Vec<[f64; 2]> {
    let robot: RobotConfig = builtin::robot(pair.robot).expect("built in");
    let story = std::env::var("WHEELEG_BEHAVIOUR_STORY").is_ok();
    let one = |seed, on| {
        let recording = sil::run(&scenario(pair, seed, on), &robot, seed);
        if story {
            println!("{}", sil::story(&recording));
        }
        (pair.measure)(&recording)
    };
    (1..=seeds)
        .map(|seed| [one(seed, true), one(seed, false)])
        .collect()
}

/// With this many seeds the sign test must stay below [`CHANCE`].
const ENOUGH: u64 = 20;
const CHANCE: f64 = 0.01;

/// Result of a pair.
struct Judged {
    /// The share is in its bracket, and more seeds improve than worsen; with enough seeds not by chance.
    /// `None` where no effect is required.
    holds: Option<bool>,
    short: String,
}

/// A share as the change that it is.
fn change(share: f64) -> String {
    if share.is_finite() {
        format!("{:+.0} %", 100.0 * (share - 1.0))
    } else {
        "from nothing".to_owned()
    }
}

fn judge(pair: &Pair, runs: &[[f64; 2]]) -> Judged {
    let mean = |i: usize| runs.iter().map(|r| r[i]).sum::<f64>() / runs.len() as f64;
    let (on, off) = (mean(0), mean(1));
    let better = |[on, off]: &[f64; 2]| if pair.less { on < off } else { on > off };
    let worse = |[on, off]: &[f64; 2]| if pair.less { on > off } else { on < off };
    let wins = runs.iter().filter(|r| better(r)).count() as u64;
    let losses = runs.iter().filter(|r| worse(r)).count() as u64;
    let p = mcnemar(wins, losses);
    let share = on / off;
    let reached = if pair.less {
        share <= pair.asked
    } else {
        share >= pair.asked
    };
    let by_chance = runs.len() as u64 >= ENOUGH && p >= CHANCE;
    let holds = pair
        .bracket
        .map(|[least, most]| (least..=most).contains(&share) && wins > losses && !by_chance);
    println!(
        "pair {}: {} {on:.2} with, {off:.2} without; asked {}, measured {} ({}); better in {wins} of {}, \
         worse in {losses} (p {p:.2e})",
        pair.behaviour.name(),
        pair.metric,
        change(pair.asked),
        change(share),
        if reached { "reached" } else { "not reached" },
        runs.len(),
    );
    for [on, off] in runs {
        println!("    {on:9.3} {off:9.3}");
    }
    let short = format!(
        "{} {on:.2}/{off:.2} ({}, asked {}) p {p:.1e}",
        pair.behaviour.name(),
        change(share),
        change(pair.asked),
    );
    Judged { holds, short }
}

fn seeds(default: u64) -> u64 {
    let given = std::env::var(SEEDS).ok();
    given.map_or(default, |n| n.parse().expect("a number of seeds"))
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn each_behaviour_does_what_it_is_there_for() {
    let seeds = seeds(3);
    let only = std::env::var("WHEELEG_BEHAVIOUR").ok();
    let (mut missed, mut found) = (Vec::new(), Vec::new());
    for pair in PAIRS {
        let name = pair.behaviour.name();
        if only.as_deref().is_some_and(|only| only != name) {
            continue;
        }
        let judged = judge(pair, &run(pair, seeds));
        found.push(judged.short);
        if judged.holds == Some(false) {
            missed.push(name);
        }
    }
    println!(
        "{seeds} seeds, behaviours with and without: {}",
        found.join("; ")
    );
    assert!(missed.is_empty(), "not as measured: {missed:?}");
}

/// A walk whose layer 1 freezes, and the ground that then changes.
#[test]
fn a_walk_without_layer_1_comes_to_a_stand_and_its_behaviours_go_on() {
    let scenario = builtin::scenario("frozen-layer-1").expect("built in");
    let robot = builtin::robot(&scenario.robot).expect("built in");
    for seed in 1..=seeds(3) {
        let recording = sil::run(&scenario, &robot, seed);
        let story = sil::story(&recording);
        let missed: Vec<_> = analyse(&scenario, &robot, &recording)
            .targets
            .into_iter()
            .filter(|t| !t.pass)
            .map(|t| (t.id, t.value))
            .collect();
        assert!(missed.is_empty(), "seed {seed}: {missed:?}\n{story}");
        let told = |code: EventCode, from_s: f64| {
            let all = recording.events.iter();
            let at =
                |e: &&Row<wheeleg_telemetry::Event>| e.t_s() >= from_s && e.v.cause.code() == code;
            all.filter(at).map(Row::t_s).next()
        };
        let hold = told(EventCode::Hold, 0.0).expect("it is told");
        assert!((5.08..=5.14).contains(&hold), "{hold}\n{story}");
        // It stands 0.6 s after the freeze, on both feet, and no board has latched a fault.
        let stands = sil::window(&recording.body, 5.7, 6.9);
        let (slowest, fastest) = sil::range(stands, |v| v.speed_mm_s);
        println!("frozen seed {seed}: {slowest:.1} to {fastest:.1} mm/s from 0.7 s on");
        for wheel in &recording.wheels {
            let (low, high) = sil::range(sil::window(wheel, 5.6, 6.9), |v| v.velocity_mm_s);
            assert!(low > -12.0 && high < 12.0, "seed {seed}: {low} {high}");
        }
        for foot in &recording.feet {
            let loads = sil::window(foot, 6.7, 6.95);
            let (least, _) = sil::range(loads, |v| v.normal_force_n);
            assert!(least > 1.0, "seed {seed}: {least} N\n{story}");
        }
        assert!(told(EventCode::FaultLatched, 0.0).is_none(), "{story}");
        // The ground sinks: within two cycles of the 50 ms that make it lost, a leg follows.
        let open = recording.feet.iter().map(|foot| {
            let rows = sil::window(foot, 7.0, 7.5).iter();
            rows.clone().find(|r| r.v.switches == 0).map(Row::t_s)
        });
        let opens = open.flatten().fold(f64::INFINITY, f64::min);
        let lost = told(EventCode::LostGround, 7.0).unwrap_or(f64::INFINITY);
        let tips = told(EventCode::TipGuard, 7.0).unwrap_or(f64::INFINITY);
        println!("frozen seed {seed}: opens {opens:.3}, followed {lost:.3}, tip guard {tips:.3}");
        // 50 ms and two cycles after it opens; one more to sense and one to log.
        assert!(
            opens.is_finite(),
            "no foot loses the ground: {opens}\n{story}"
        );
        assert!(
            lost.min(tips) - opens < 0.05 + 0.02 + 0.015,
            "{opens} {lost} {tips}\n{story}"
        );
        // On ice below wheels and feet the loads part as they will; both feet touch, as they sense it.
        let ends = recording
            .feet
            .each_ref()
            .map(|foot| &foot[foot.len() - 1].v);
        assert!(
            ends.iter()
                .all(|v| v.switches != 0 && v.normal_force_n > 0.0),
            "{ends:?}"
        );
    }
}

#[test]
fn a_pit_below_a_foothold_is_searched_and_passed() {
    let scenario = builtin::scenario("pit").expect("built in");
    let robot = builtin::robot(&scenario.robot).expect("built in");
    for seed in 1..=seeds(2) {
        let recording = sil::run(&scenario, &robot, seed);
        let targets = analyse(&scenario, &robot, &recording).targets;
        let shown: Vec<_> = targets.iter().map(|t| (&t.id, t.value)).collect();
        println!("pit seed {seed}: {shown:?}");
        let last = &recording.behaviours.last().expect("it walks").v;
        let acts = last.search + last.lost_contact + last.touchdown;
        assert!(acts > 0 && targets.iter().all(|t| t.pass), "{shown:?}");
        let deep = recording.events.iter().filter(|e| {
            matches!(
                e.v.cause.code(),
                EventCode::LateGround | EventCode::LostGround | EventCode::NoGround
            )
        });
        assert!(deep.count() > 0, "the foot found the pit");
    }
}
