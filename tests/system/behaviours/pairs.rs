//! The pairs: which robot walks where, and which runs are compared.

use wheeleg_master::behaviour::Behaviour;

use super::Pair;
use super::metrics::{
    chassis_contact_s, drag_mm, load_difference_n, nose_drop_mm, not_ended_safely, onto_nothing,
    progress_mm, pull_n_s, stalled_swings, touchdown_force_n,
};

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

/// Ground whose strip below the left foot is 60 mm deeper from a place that the seed chooses.
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

pub(super) const PAIRS: &[Pair] = &[
    Pair {
        behaviour: Behaviour::TipGuard,
        without: &[],
        robot: "wheeleg",
        metric: "time on the tail, s",
        less: true,
        asked: 0.0,
        bracket: Some([0.0, 0.0]),
        duration_s: 10.0,
        walk: UP,
        // The steepest first: below 21.3 degrees the robot may not tip at all, and three seeds would tell nothing.
        rest: |seed| slope(22.04 - 0.04 * seed as f64),
        measure: chassis_contact_s,
    },
    Pair {
        behaviour: Behaviour::Touchdown,
        without: &[],
        robot: "wheeleg",
        metric: "touchdown force, N",
        less: true,
        asked: 0.7,
        // 0.77 of three seeds (2026-12-01): landings without it are gentler since boards know the mass of the foot.
        bracket: Some([0.65, 0.88]),
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
        asked: 0.2,
        // Steps are counted: one in three seeds is a third, and one in ten is the rate.
        bracket: Some([0.0, 0.4]),
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
        asked: 0.2,
        bracket: Some([0.0, 0.4]),
        duration_s: 15.0,
        walk: LOW,
        rest: kerb,
        measure: stalled_swings,
    },
    Pair {
        behaviour: Behaviour::LostContact,
        // Its 10 mm would hide the effect of this one alone.
        without: &[Behaviour::TipGuard],
        robot: "wheeleg",
        metric: "nose drop, mm",
        less: true,
        asked: 0.6,
        bracket: Some([0.74, 0.86]),
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
        asked: 0.5,
        bracket: None,
        duration_s: 15.0,
        walk: LOW,
        rest: kerb,
        measure: pull_n_s,
    },
    Pair {
        behaviour: Behaviour::Slip,
        without: &[],
        robot: "wheeleg-field",
        metric: "way up 15 degrees of sand, mm",
        less: false,
        asked: 1.2,
        bracket: None,
        duration_s: 15.0,
        walk: SAND,
        rest: |seed| slope(14.5 + 0.1 * seed as f64) + "material = \"volcanic-sand\"\n",
        measure: progress_mm,
    },
    Pair {
        behaviour: Behaviour::LoadShare,
        without: &[],
        robot: "wheeleg",
        metric: "difference of the loads, N",
        less: true,
        asked: 0.6,
        bracket: None,
        duration_s: 15.0,
        walk: FLAT,
        rest: ledges,
        measure: load_difference_n,
    },
    Pair {
        behaviour: Behaviour::Stuck,
        without: &[],
        robot: "wheeleg",
        metric: "stuck runs not ended safely",
        less: true,
        asked: 0.0,
        bracket: Some([0.0, 0.0]),
        // The feet meet the wall after 3 s; the robot has 20 s to give up.
        duration_s: 23.0,
        walk: FLAT,
        rest: wall,
        measure: not_ended_safely,
    },
    Pair {
        behaviour: Behaviour::StrokeGovernor,
        without: &[],
        robot: "wheeleg",
        metric: "foot drag, mm",
        less: true,
        asked: 0.2,
        bracket: Some([0.2, 0.32]),
        duration_s: 12.0,
        walk: FAST,
        rest: level,
        measure: drag_mm,
    },
];
