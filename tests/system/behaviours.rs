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
use wheeleg_studies::analysis::analyse;
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
    /// The test fails without the effect; otherwise `docs/records/behaviours.md` says why it is not
    /// there.
    required: bool,
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

/// Says what came out, and in short; whether the effect is there.
fn judge(pair: &Pair, runs: &[[f64; 2]]) -> (bool, String) {
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
    let short = format!("{} {on:.2}/{off:.2} p {p:.1e}", pair.behaviour.name());
    (met && wins > losses, short)
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

/// Reaches of more than 1.5 s, and those that a joint's board ended because nothing moved.
fn stalled_swings(recording: &Recording) -> f64 {
    let mut stalled = 0_u32;
    for codes in codes(recording) {
        let mut cycles = 0;
        for (_, code) in codes {
            cycles = if code == REACH { cycles + 1 } else { 0 };
            stalled += u32::from(cycles == 150);
        }
    }
    let latched = recording
        .events
        .iter()
        .any(|e| e.v.cause.code() == "fault_latched");
    f64::from(stalled + u32::from(latched))
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

/// Mean difference of the loads of two feet that both stand, N.
fn load_difference_n(recording: &Recording) -> f64 {
    let [left, right] = codes(recording);
    let (mut sum, mut count) = (0.0, 0.0);
    for ((t, left), (_, right)) in left.into_iter().zip(right) {
        let later = t > 2.0 && t < recording.feet[0].last().map_or(0.0, Row::t_s);
        if later && left == STANCE && right == STANCE {
            let [l, r] = [0, 1].map(|foot: usize| sil::at(&recording.feet[foot], t).normal_force_n);
            sum += (l - r).abs();
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

/// Push of b5 that has not moved by 5 mm for half a second, beyond that half second, N s.
fn pull_n_s(recording: &Recording) -> f64 {
    let mut pull = 0.0;
    for b5 in [1, 4] {
        let (mut from_mm, mut since) = (0.0_f64, 0);
        for row in recording.joints[b5].iter().filter(|r| r.t_s() > 1.0) {
            let drives = (row.v.reference_mm - row.v.position_mm).abs() > 5.0;
            if (row.v.position_mm - from_mm).abs() > 5.0 || (since < 500 && !drives) {
                (from_mm, since) = (row.v.position_mm, 0);
            }
            since += 1;
            if since > 500 {
                pull += 1e-3 * row.v.force_pressure_n.abs();
            }
        }
    }
    pull
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

const SAND: &str = "speed = { value = 60.0, unit = \"mm/s\" }\nturn = { value = 0.0, unit = \"rad/s\" }\n\
                    lift = { value = 90.0, unit = \"mm\" }\nnose = { value = -100.0, unit = \"mm\" }";

fn level(_: u64) -> String {
    String::new()
}

/// Ground whose strip below the left foot is 60 mm deeper from a place on that the seed chooses.
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

/// The right foot's way is 25 mm higher than the left one's.
fn ledges(seed: u64) -> String {
    format!(
        "[[terrain]]\nkind = \"plane\"\n[[terrain]]\nkind = \"block\"\n\
         x = {{ value = [{:.3}, 6.0], unit = \"m\" }}\ny = {{ value = [-0.25, 0.0], unit = \"m\" }}\n\
         height = {{ value = 25.0, unit = \"mm\" }}\n",
        0.9 + 0.008 * seed as f64,
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
        required: true,
        duration_s: 10.0,
        walk: UP,
        rest: |seed| slope(16.5 + 0.5 * seed as f64),
        measure: chassis_contact_s,
    },
    Pair {
        behaviour: Behaviour::Touchdown,
        without: &[],
        robot: "wheeleg",
        metric: "touchdown force, N",
        less: true,
        bar: 0.7,
        required: true,
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
        required: true,
        duration_s: 15.0,
        walk: FLAT,
        rest: pits,
        measure: onto_nothing,
    },
    Pair {
        behaviour: Behaviour::Bump,
        without: &[],
        robot: "wheeleg",
        metric: "stalled swings and swings that a board took for a fault",
        less: true,
        bar: 0.2,
        required: true,
        duration_s: 15.0,
        walk: LOW,
        rest: kerb,
        measure: stalled_swings,
    },
    Pair {
        behaviour: Behaviour::LostContact,
        // Its 10 mm would hide what this one does alone.
        without: &[Behaviour::TipGuard],
        robot: "wheeleg",
        metric: "nose drop, mm",
        less: true,
        bar: 0.6,
        required: true,
        duration_s: 6.0,
        walk: FLAT,
        rest: |_| "faults = [\"layer1-stall@2s\", \"foot-loses-contact=0.04@4s\"]".to_owned(),
        measure: nose_drop_mm,
    },
    Pair {
        behaviour: Behaviour::Overload,
        // It would draw the foot back before.
        without: &[Behaviour::Bump],
        robot: "wheeleg",
        metric: "pull of stalled cylinders, N s",
        less: true,
        bar: 0.5,
        required: true,
        duration_s: 15.0,
        walk: LOW,
        rest: kerb,
        measure: pull_n_s,
    },
    Pair {
        behaviour: Behaviour::Slip,
        without: &[],
        robot: "wheeleg-field",
        metric: "way up 10 degrees of sand, mm",
        less: false,
        bar: 1.2,
        required: true,
        duration_s: 15.0,
        walk: SAND,
        rest: |seed| slope(10.0 + 0.1 * seed as f64) + "material = \"volcanic-sand\"\n",
        measure: progress_mm,
    },
    Pair {
        behaviour: Behaviour::LoadShare,
        without: &[],
        robot: "wheeleg",
        metric: "difference of the loads, N",
        less: true,
        bar: 0.6,
        required: true,
        duration_s: 15.0,
        walk: FLAT,
        rest: ledges,
        measure: load_difference_n,
    },
    Pair {
        behaviour: Behaviour::Stuck,
        without: &[],
        robot: "wheeleg",
        metric: "stuck runs ended safely",
        less: false,
        bar: 1.0,
        required: true,
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
        required: true,
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
    let (mut missed, mut found) = (Vec::new(), Vec::new());
    for pair in PAIRS {
        let name = pair.behaviour.name();
        if only.as_deref().is_some_and(|only| only != name) {
            continue;
        }
        let (met, short) = judge(pair, &run(pair, seeds));
        found.push(short);
        if !met && pair.required {
            missed.push(name);
        }
    }
    println!(
        "{seeds} seeds, behaviours with and without: {}",
        found.join("; ")
    );
    assert!(missed.is_empty(), "no effect: {missed:?}");
}

/// A walk whose layer 1 stands still, and what then happens to the ground.
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
        let told = |code: &str, from_s: f64| {
            let all = recording.events.iter();
            let at =
                |e: &&Row<wheeleg_telemetry::Event>| e.t_s() >= from_s && e.v.cause.code() == code;
            all.filter(at).map(Row::t_s).next()
        };
        let hold = told("hold", 0.0).expect("it is told");
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
        assert!(told("fault_latched", 0.0).is_none(), "{story}");
        // The ground sinks: within two cycles of the 50 ms that make it lost, a leg follows.
        let open = recording.feet.iter().map(|foot| {
            let rows = sil::window(foot, 7.0, 7.5).iter();
            rows.clone().find(|r| r.v.switches == 0).map(Row::t_s)
        });
        let opens = open.flatten().fold(f64::INFINITY, f64::min);
        let lost = told("lost_ground", 7.0).unwrap_or(f64::INFINITY);
        let tips = told("tip_guard", 7.0).unwrap_or(f64::INFINITY);
        println!("frozen seed {seed}: opens {opens:.3}, followed {lost:.3}, tip guard {tips:.3}");
        assert!(
            lost.min(tips) - opens < 0.05 + 0.02 + 0.015,
            "{opens} {lost} {tips}\n{story}"
        );
        let loads = recording
            .feet
            .each_ref()
            .map(|foot| foot[foot.len() - 1].v.normal_force_n);
        assert!(loads.iter().all(|n| *n > 1.0), "{loads:?}");
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
                "late_ground" | "lost_ground" | "no_ground"
            )
        });
        assert!(deep.count() > 0, "the foot found the pit");
    }
}
