//! The firmware's arithmetic against exact rational arithmetic.
//!
//! The vectors were written by the Python scripts beside them
//! (`tests/vectors/*.py`, standard library only), which share no code and no
//! number format with the firmware.

use serde_json::Value;
use wheeleg_control::joint::{
    Correction, Gain, JointConfig, JointController, JointGains, JointInput,
};
use wheeleg_control::paper::fuzzy::{
    ANY, CHIP_LEVELS, GridRules, Partition, Rule, RuleList, Triangle,
};
use wheeleg_control::paper::rules;
use wheeleg_control::wheel::{
    LeadFilter, Profile, WheelCommand, WheelController, WheelInput, WheelMode,
};
use wheeleg_units::{Duty, Micros, PositionMm, VelocityMmS, WheelCount};

fn load(text: &str) -> Value {
    serde_json::from_str(text).expect("vectors are JSON")
}

fn int(value: &Value) -> i32 {
    i32::try_from(value.as_i64().expect("an integer")).expect("32 bits")
}

fn short(value: &Value) -> i16 {
    i16::try_from(int(value)).expect("16 bits")
}

fn real(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn list(value: &Value) -> &[Value] {
    value.as_array().expect("an array")
}

fn triangles<const N: usize>(sets: [(i16, u16, u16); N]) -> [Triangle; N] {
    sets.map(|(vertex, left, right)| Triangle {
        vertex,
        left,
        right,
    })
}

/// A half for the rounding of the mean; the rest is what membership in steps of
/// 2^-14 can move neighbouring singletons, which are at most 2^14 apart.
const SURFACE_TOLERANCE: f64 = 2.0;

#[test]
fn shipped_rule_bases_match_the_exact_surface() {
    let vectors = load(include_str!("../vectors/fuzzy.json"));
    for (name, base) in [("pd", &rules::PD), ("id", &rules::ID)] {
        let rows = list(&vectors[name]);
        assert!(rows.len() > 1000);
        let mut worst = 0.0_f64;
        for row in rows {
            let got = f64::from(base.infer(short(&row[0]), short(&row[1])));
            let deviation = (got - real(&row[2])).abs();
            assert!(deviation <= SURFACE_TOLERANCE, "{name} {row}: {got}");
            worst = worst.max(deviation);
        }
        println!("{name}: worst deviation {worst:.2} of 32767");
    }
}

#[test]
fn four_bit_membership_matches_exactly() {
    let first = Partition::with_levels(
        -128,
        127,
        triangles([
            (-128, 0, 64),
            (-64, 64, 64),
            (0, 64, 64),
            (64, 64, 63),
            (127, 63, 0),
        ]),
        CHIP_LEVELS,
    )
    .expect("valid");
    let second = Partition::with_levels(
        -128,
        127,
        triangles([(-128, 0, 128), (0, 128, 127), (127, 127, 0)]),
        CHIP_LEVELS,
    )
    .expect("valid");
    let table = [
        [-127, -90, -20],
        [-100, -50, 10],
        [-60, 0, 60],
        [-10, 50, 100],
        [20, 90, 127],
    ];
    let base = GridRules::new(first, second, table).expect("valid");
    let vectors = load(include_str!("../vectors/fuzzy.json"));
    let rows = list(&vectors["chip"]);
    assert!(rows.len() > 1500);
    for row in rows {
        assert_eq!(
            base.infer(short(&row[0]), short(&row[1])),
            short(&row[2]),
            "{row}"
        );
    }
}

#[test]
fn overlapping_sets_match_the_exact_surface() {
    let first = Partition::new(
        -100,
        100,
        triangles([(-100, 0, 180), (-30, 90, 150), (10, 60, 60), (100, 150, 0)]),
    )
    .expect("valid");
    let second = Partition::new(
        -100,
        100,
        triangles([(-100, 0, 250), (0, 40, 40), (100, 250, 0)]),
    )
    .expect("valid");
    assert!(!first.is_fan() && !second.is_fan());
    let table = [
        [-9000, -4000, 100],
        [-7000, 0, 3000],
        [500, 2500, -800],
        [1000, 6000, 9000],
    ];
    let base = GridRules::new(first, second, table).expect("valid");
    let vectors = load(include_str!("../vectors/fuzzy.json"));
    for row in list(&vectors["wide"]) {
        let got = f64::from(base.infer(short(&row[0]), short(&row[1])));
        assert!((got - real(&row[2])).abs() <= 1.5, "{row}: {got}");
    }
}

#[test]
fn three_input_rule_list_matches_the_exact_surface() {
    let partitions = [
        Partition::<3>::fan([-100, 0, 100]).expect("valid"),
        Partition::fan([0, 40, 200]).expect("valid"),
        Partition::fan([-50, 5, 50]).expect("valid"),
    ];
    let rule = |sets: [u8; 3], consequent: i16| Rule { sets, consequent };
    let base = RuleList::new(
        partitions,
        [
            rule([0, 0, ANY], -1000),
            rule([1, ANY, 1], 250),
            rule([2, 1, 2], 900),
            rule([ANY, 2, 0], -333),
            rule([2, 2, ANY], 32_767),
            rule([0, ANY, 2], -32_768),
        ],
    )
    .expect("valid");
    let vectors = load(include_str!("../vectors/fuzzy.json"));
    let mut silent = 0;
    for row in list(&vectors["list"]) {
        let got = f64::from(base.infer([short(&row[0]), short(&row[1]), short(&row[2])]));
        // Where the weights are small, their rounding weighs more.
        assert!((got - real(&row[3])).abs() <= 6.0, "{row}: {got}");
        silent += usize::from(got == 0.0);
    }
    assert!(silent > 0, "no point where no rule fires was tried");
}

#[test]
fn lead_filter_matches_the_exact_recursion() {
    let vectors = load(include_str!("../vectors/wheel.json"));
    for case in list(&vectors["filters"]) {
        let byte = |name: &str| u8::try_from(int(&case[name])).expect("a byte");
        let mut wheel = WheelController::new();
        let filter = LeadFilter {
            zero: byte("a"),
            pole: byte("b"),
            gain: byte("k"),
        };
        wheel.apply(WheelCommand::Filter(filter)).expect("any time");
        wheel
            .apply(WheelCommand::Enter(WheelMode::Position))
            .expect("from idle");
        let pairs = list(&case["errors"]).iter().zip(list(&case["commands"]));
        for (sample, (error, exact)) in pairs.enumerate() {
            let position = WheelCount::checked_new(int(error)).expect("24 bits");
            wheel
                .apply(WheelCommand::Position(position))
                .expect("position mode");
            let got = wheel.step(&WheelInput::default()).motor_command;
            // Half a count for the port; the feedback, rounded to 2^-11, adds at
            // most 2^-11 / (1 − 255/256) = 1/8.
            let deviation = (f64::from(got) - real(exact)).abs();
            assert!(
                deviation <= 0.5 + 0.126,
                "{filter:?} sample {sample}: {got} {exact}"
            );
        }
    }
}

#[test]
fn profiles_match_the_exact_points() {
    let vectors = load(include_str!("../vectors/wheel.json"));
    let cases = list(&vectors["profiles"]);
    assert_eq!(cases.len(), 15);
    for case in cases {
        for direction in [1, -1] {
            let start = WheelCount::wrapping_new(8_388_000);
            let target = start.wrapping_add(direction * int(&case["way"]));
            let maximum = u8::try_from(int(&case["maximum"])).expect("a byte");
            let raw = u16::try_from(int(&case["acceleration_raw"])).expect("16 bits");
            let mut profile = Profile::new(start, target, maximum, raw);
            let mut points = Vec::new();
            while !profile.is_finished() {
                points.push(profile.advance().wrapping_difference(start) * direction);
            }
            let stride = usize::try_from(int(&case["stride"])).expect("positive");
            assert_eq!(
                i32::try_from(points.len()).expect("short"),
                int(&case["samples"])
            );
            let kept: Vec<i32> = points.into_iter().step_by(stride).collect();
            let exact: Vec<i32> = list(&case["points"]).iter().map(int).collect();
            assert_eq!(kept, exact, "{} in steps of {raw}", case["way"]);
        }
    }
}

/// The gains of `vectors/joint.py`.
fn vector_gains() -> JointGains {
    JointGains {
        proportional: Gain::lit("0.02"),
        correction_pd: Gain::lit("0.6"),
        correction_id: Gain::lit("0.5"),
        feed_forward: Gain::lit("0.003"),
        error_scale: PositionMm::from_int(40),
        velocity_scale: VelocityMmS::from_int(400),
        integral_scale: PositionMm::from_f64(0.25),
        integral_zone: PositionMm::from_int(15),
        duty_limit: Duty::from_per_mille(900),
        dead_zone_duty: Duty::from_per_mille(100),
        minimum_duty: Duty::from_per_mille(10),
        settle_band: PositionMm::from_int(1),
        settle_velocity: VelocityMmS::from_int(20),
        settle_dwell: Micros::from_millis(20),
        release_band: PositionMm::from_int(2),
        release_dwell: Micros::from_millis(3),
        bumpless_time: Micros::from_millis(50),
        velocity_window: 16,
        stroke_min: PositionMm::ZERO,
        stroke_max: PositionMm::from_int(180),
        pwm_period: Micros::from_millis(20),
        ..JointGains::default()
    }
}

#[test]
fn joint_law_matches_the_exact_sequence() {
    let config = JointConfig::new(&vector_gains(), Micros(1000)).expect("valid gains");
    let mut joint = JointController::new(config);
    let vectors = load(include_str!("../vectors/joint.json"));
    let rows = list(&vectors);
    assert_eq!(rows.len(), 1400);
    let (mut settled_ticks, mut cut, mut extending, mut retracting) = (0, 0, 0, 0);
    let (mut worst_duty, mut worst_velocity) = (0.0_f64, 0.0_f64);
    for (tick, row) in rows.iter().enumerate() {
        match tick {
            300 => joint.set_correction(Correction::Id),
            900 => joint.set_correction(Correction::Pd),
            _ => {}
        }
        let output = joint.step(&JointInput {
            measured: PositionMm::from_raw(int(&row[0])),
            reference: PositionMm::from_raw(int(&row[1])),
            reference_velocity: VelocityMmS::from_raw(int(&row[2])),
            announced: None,
        });
        let duty = (output.duty.to_f64() - real(&row[3])).abs();
        let velocity = (output.velocity.to_f64() - real(&row[4])).abs();
        assert!(
            duty <= 2e-4,
            "tick {tick}: duty {} {row}",
            output.duty.to_f64()
        );
        assert!(velocity <= 1e-4, "tick {tick}: velocity {row}");
        assert_eq!(output.settled, row[5] == Value::Bool(true), "tick {tick}");
        worst_duty = worst_duty.max(duty);
        worst_velocity = worst_velocity.max(velocity);
        settled_ticks += usize::from(output.settled);
        cut += usize::from(output.limits.duty);
        extending += usize::from(output.duty > Duty::ZERO);
        retracting += usize::from(output.duty < Duty::ZERO);
    }
    println!("worst duty {worst_duty:.1e}, velocity {worst_velocity:.1e} mm/s");
    // The sequence goes through all of it.
    assert!(settled_ticks > 50 && cut > 20 && extending > 200 && retracting > 200);
}
