//! Each behaviour of a walk with and without: pairs of runs that differ in its switch alone, held
//! against the metric that it is there for. Three seeds here; `cargo xtask deep behaviours` runs
//! twenty, with a sign test.

use crate::sil;
use wheeleg_config::{RobotConfig, Scenario, builtin};
use wheeleg_master::behaviour::Behaviour;
use wheeleg_master::contact::Side;
use wheeleg_master::mirror;
use wheeleg_master::setpoint::Cylinder;
use wheeleg_report::stats::mcnemar;
use wheeleg_telemetry::{FootSample, Recording, Row};

/// Variable for the number of seeds of every pair.
const SEEDS: &str = "WHEELEG_BEHAVIOUR_SEEDS";

/// Codes of a leg in the log.
const STANCE: u8 = 1;
const REACH: u8 = 3;
const LOWER: u8 = 4;

/// A pair of runs.
struct Pair {
    behaviour: Behaviour,
    /// Those that are off in both runs.
    without: &'static [Behaviour],
    robot: &'static str,
    /// What is measured, and its unit.
    metric: &'static str,
    /// Smaller is better.
    less: bool,
    /// What the mean with the behaviour must be, as a share of that without, for `less` at most,
    /// otherwise at least.
    bar: f64,
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
    let one = |seed, on| (pair.measure)(&sil::run(&scenario(pair, seed, on), &robot, seed));
    (1..=seeds)
        .map(|seed| [one(seed, true), one(seed, false)])
        .collect()
}

/// Says what came out; whether the effect is there.
fn judge(pair: &Pair, runs: &[[f64; 2]]) -> bool {
    let mean = |i: usize| runs.iter().map(|r| r[i]).sum::<f64>() / runs.len() as f64;
    let (on, off) = (mean(0), mean(1));
    let better = |[on, off]: &[f64; 2]| if pair.less { on < off } else { on > off };
    let worse = |[on, off]: &[f64; 2]| if pair.less { on > off } else { on < off };
    let wins = runs.iter().filter(|r| better(r)).count() as u64;
    let losses = runs.iter().filter(|r| worse(r)).count() as u64;
    let p = mcnemar(wins, losses);
    let met = if pair.less {
        on <= pair.bar * off
    } else {
        on >= pair.bar * off
    };
    println!(
        "pair {}: {} {on:.2} with, {off:.2} without ({:+.0} %), better in {wins} of {} (p {p:.2e}), bar {}",
        pair.behaviour.name(),
        pair.metric,
        100.0 * (on - off) / off.abs().max(1e-9),
        runs.len(),
        if met { "met" } else { "missed" },
    );
    for [on, off] in runs {
        println!("    {on:9.3} {off:9.3}");
    }
    met && wins > losses
}

fn seeds(default: u64) -> u64 {
    let given = std::env::var(SEEDS).ok();
    given.map_or(default, |n| n.parse().expect("a number of seeds"))
}

// What is measured.

fn codes(recording: &Recording) -> [Vec<(f64, u8)>; 2] {
    let of = |code: fn(&wheeleg_telemetry::BehaviourSample) -> u8| {
        let rows = recording.behaviours.iter();
        rows.map(|row| (row.t_s(), code(&row.v))).collect()
    };
    [of(|v| v.left), of(|v| v.right)]
}

/// Begins of a code, s.
fn begins(codes: &[(f64, u8)], from: u8, to: u8) -> Vec<f64> {
    let changes = codes.windows(2);
    let begun = changes.filter(|w| w[0].1 == from && w[1].1 == to);
    begun.map(|w| w[1].0).collect()
}

fn peak_n(rows: &[Row<FootSample>]) -> f64 {
    rows.iter().map(|r| r.v.normal_force_n).fold(0.0, f64::max)
}

/// Mean of the largest forces in the first 50 ms of a foot that comes down, N.
fn touchdown_force_n(recording: &Recording) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (foot, codes) in recording.feet.iter().zip(codes(recording)) {
        let end = foot.last().map_or(0.0, Row::t_s);
        for t in begins(&codes, REACH, LOWER) {
            if t < 2.0 || t + 1.0 > end {
                continue;
            }
            let way = sil::window(foot, t, t + 0.9);
            if let Some(touch) = way.iter().find(|r| r.v.normal_force_n > 1.0) {
                sum += peak_n(sil::window(foot, touch.t_s(), touch.t_s() + 0.05));
                count += 1.0;
            }
        }
    }
    sum / f64::max(count, 1.0)
}

/// Stances that begin without a load for their first 0.1 s.
fn onto_nothing(recording: &Recording) -> f64 {
    let mut count = 0;
    for (foot, codes) in recording.feet.iter().zip(codes(recording)) {
        let end = foot.last().map_or(0.0, Row::t_s);
        let starts = begins(&codes, LOWER, STANCE).into_iter();
        count += starts
            .filter(|t| t + 0.1 < end && peak_n(sil::window(foot, *t, t + 0.1)) < 1.0)
            .count();
    }
    count as f64
}

/// Time that the feet have spent in reaches of more than 1.5 s, s.
fn stalled_swings_s(recording: &Recording) -> f64 {
    let mut stalled = 0.0;
    for codes in codes(recording) {
        let mut cycles = 0;
        for (_, code) in codes {
            cycles = if code == REACH { cycles + 1 } else { 0 };
            if cycles > 150 {
                stalled += 0.01;
            }
        }
    }
    stalled
}

/// How far the nose falls in 1 s after 4 s, mm at the hips.
fn nose_drop_mm(recording: &Recording) -> f64 {
    let before = sil::at(&recording.body, 3.99).pitch_deg;
    let (lowest, _) = sil::range(sil::window(&recording.body, 4.0, 5.5), |v| v.pitch_deg);
    600.0 * (before - lowest).to_radians().sin()
}

/// Time with the tail or the nose on the ground, s.
fn chassis_contact_s(recording: &Recording) -> f64 {
    let down = recording.body.iter().filter(|r| r.v.chassis_force_n > 0.0);
    1e-3 * down.count() as f64
}

/// Way of the chassis, mm.
fn progress_mm(recording: &Recording) -> f64 {
    let first = &recording.body[0].v;
    let last = &recording.body[recording.body.len() - 1].v;
    last.x_mm - first.x_mm
}

/// How far loaded feet slide over level ground, mm.
fn drag_mm(recording: &Recording) -> f64 {
    let mut drag = 0.0;
    for (side, foot) in [Side::Left, Side::Right].into_iter().zip(&recording.feet) {
        let first = side.joint(Cylinder::Yaw);
        let mut before: Option<[f64; 2]> = None;
        for i in (0..foot.len()).step_by(10) {
            if foot[i].v.normal_force_n < 2.0 {
                before = None;
                continue;
            }
            let strokes =
                [0, 1, 2].map(|j| (1e-3 * recording.joints[first + j][i].v.position_mm) as f32);
            let Some([x, y, _]) = mirror::foot_of_strokes(side, strokes) else {
                continue;
            };
            let hip_y = if side == Side::Left { 0.2 } else { -0.2 };
            let (x, y) = (0.6 + f64::from(x), hip_y + f64::from(y));
            let body = &recording.body[i].v;
            let (sin, cos) = body.yaw_deg.to_radians().sin_cos();
            let here = [
                body.x_mm + 1e3 * (cos * x - sin * y),
                body.y_mm + 1e3 * (sin * x + cos * y),
            ];
            if let Some(there) = before {
                // Less is the creep of a foot that holds.
                let way = (here[0] - there[0]).hypot(here[1] - there[1]);
                drag += if way > 0.2 { way } else { 0.0 };
            }
            before = Some(here);
        }
    }
    drag
}

/// Whether the robot stands at the end and has said that it is stuck: 1.
fn stands_stuck(recording: &Recording) -> f64 {
    let told = recording.events.iter().any(|e| e.v.cause.code() == "stuck");
    let end = recording.body.last().map_or(0.0, Row::t_s);
    let last = sil::window(&recording.body, end - 1.0, end);
    let (slowest, fastest) = sil::range(last, |v| v.speed_mm_s);
    let drive = recording.wheels.iter().map(|wheel| {
        let last = &wheel[wheel.len() - 1].v;
        last.velocity_mm_s.abs()
    });
    let turns = drive.fold(0.0, f64::max);
    f64::from(u8::from(
        told && slowest > -5.0 && fastest < 5.0 && turns < 5.0,
    ))
}

const FLAT: &str = "speed = { value = 100.0, unit = \"mm/s\" }\nturn = { value = 0.0, unit = \"rad/s\" }\n\
                    lift = { value = 60.0, unit = \"mm\" }\nnose = { value = -40.0, unit = \"mm\" }";
const UP: &str = "speed = { value = 60.0, unit = \"mm/s\" }\nturn = { value = 0.0, unit = \"rad/s\" }\n\
                  lift = { value = 60.0, unit = \"mm\" }\nnose = { value = -20.0, unit = \"mm\" }";
const FAST: &str = "speed = { value = 150.0, unit = \"mm/s\" }\nturn = { value = 0.0, unit = \"rad/s\" }\n\
                    lift = { value = 150.0, unit = \"mm\" }\nnose = { value = -20.0, unit = \"mm\" }";
const LOW: &str = "speed = { value = 85.0, unit = \"mm/s\" }\nturn = { value = 0.0, unit = \"rad/s\" }\n\
                   lift = { value = 30.0, unit = \"mm\" }\nnose = { value = -40.0, unit = \"mm\" }";

fn level(_: u64) -> String {
    String::new()
}

/// Ground that ends in a pit of 60 mm below the left foot, from a place that the seed chooses.
fn pits(seed: u64) -> String {
    let from = 1.0 + 0.01 * seed as f64;
    let mut text =
        String::from("[[terrain]]\nkind = \"plane\"\nheight = { value = -60.0, unit = \"mm\" }\n");
    let mut block = |x: [f64; 2], y: [f64; 2]| {
        text.push_str(&format!(
            "[[terrain]]\nkind = \"block\"\nx = {{ value = {x:?}, unit = \"m\" }}\n\
             y = {{ value = {y:?}, unit = \"m\" }}\nheight = {{ value = 60.0, unit = \"mm\" }}\n"
        ));
    };
    // The wheels' tracks and the right foot's, then the left foot's with its pits.
    block([-3.0, 9.0], [-2.0, 0.1]);
    block([-3.0, 9.0], [0.255, 2.0]);
    block([-3.0, from], [0.1, 0.255]);
    for i in 0..4 {
        let at = from + 0.3 * f64::from(i);
        block([at + 0.15, at + 0.3], [0.1, 0.255]);
    }
    block([from + 1.2, 9.0], [0.1, 0.255]);
    text
}

/// A low kerb across the feet's way, at a place that the seed chooses.
fn kerb(seed: u64) -> String {
    format!(
        "[[terrain]]\nkind = \"plane\"\n[[terrain]]\nkind = \"block\"\n\
         x = {{ value = [{:.3}, {:.3}], unit = \"m\" }}\ny = {{ value = [-0.25, 0.25], unit = \"m\" }}\n\
         height = {{ value = 100.0, unit = \"mm\" }}\n",
        0.95 + 0.008 * seed as f64,
        1.55 + 0.008 * seed as f64,
    )
}

/// A wall that the robot cannot climb.
fn wall(seed: u64) -> String {
    format!(
        "[[terrain]]\nkind = \"plane\"\n[[terrain]]\nkind = \"block\"\n\
         x = {{ value = [{:.3}, 4.0], unit = \"m\" }}\ny = {{ value = [-2.0, 2.0], unit = \"m\" }}\n\
         height = {{ value = 300.0, unit = \"mm\" }}\n",
        1.0 + 0.005 * seed as f64,
    )
}

fn slope(degrees: f64) -> String {
    format!("[[terrain]]\nkind = \"plane\"\nslope = {{ value = {degrees:.2}, unit = \"deg\" }}\n")
}

const PAIRS: &[Pair] = &[
    Pair {
        behaviour: Behaviour::TipGuard,
        without: &[],
        robot: "wheeleg",
        metric: "time on the tail, s",
        less: true,
        bar: 0.0,
        duration_s: 10.0,
        walk: UP,
        rest: |seed| slope(16.0 + 0.1 * seed as f64),
        measure: chassis_contact_s,
    },
    Pair {
        behaviour: Behaviour::Touchdown,
        without: &[],
        robot: "wheeleg",
        metric: "touchdown force, N",
        less: true,
        bar: 0.7,
        duration_s: 12.0,
        walk: FLAT,
        rest: level,
        measure: touchdown_force_n,
    },
    Pair {
        behaviour: Behaviour::Search,
        without: &[],
        robot: "wheeleg",
        metric: "steps onto nothing",
        less: true,
        bar: 0.2,
        duration_s: 15.0,
        walk: FLAT,
        rest: pits,
        measure: onto_nothing,
    },
    Pair {
        behaviour: Behaviour::Bump,
        without: &[],
        robot: "wheeleg",
        metric: "stalled swings, s",
        less: true,
        bar: 0.2,
        duration_s: 15.0,
        walk: LOW,
        rest: kerb,
        measure: stalled_swings_s,
    },
    Pair {
        behaviour: Behaviour::LostContact,
        without: &[],
        robot: "wheeleg",
        metric: "nose drop, mm",
        less: true,
        bar: 0.6,
        duration_s: 6.0,
        walk: FLAT,
        rest: |_| "faults = [\"foot-loses-contact=0.02@4s\"]".to_owned(),
        measure: nose_drop_mm,
    },
    Pair {
        behaviour: Behaviour::Stuck,
        without: &[],
        robot: "wheeleg",
        metric: "stuck runs ended safely",
        less: false,
        bar: 1.0,
        duration_s: 45.0,
        walk: FLAT,
        rest: wall,
        measure: stands_stuck,
    },
    Pair {
        behaviour: Behaviour::StrokeGovernor,
        without: &[],
        robot: "wheeleg",
        metric: "foot drag, mm",
        less: true,
        bar: 0.2,
        duration_s: 12.0,
        walk: FAST,
        rest: level,
        measure: drag_mm,
    },
];

#[test]
fn each_behaviour_does_what_it_is_there_for() {
    let seeds = seeds(3);
    let only = std::env::var("WHEELEG_BEHAVIOUR").ok();
    let mut missed = Vec::new();
    for pair in PAIRS {
        let name = pair.behaviour.name();
        if only.as_deref().is_some_and(|only| only != name) {
            continue;
        }
        if !judge(pair, &run(pair, seeds)) {
            missed.push(name);
        }
    }
    assert!(missed.is_empty(), "no effect: {missed:?}");
    let _ = progress_mm;
}
