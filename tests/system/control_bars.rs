//! The bars of position control with four on/off valves and one potentiometer,
//! on the bench axis (bore 20 x 180 mm, VQ110U-class valves, 1.5 kg, 6 bar gauge)
//! and on axes that nobody tuned for. All on the joint board's whole application,
//! supervision included: a fault in any of these cases is a false alarm and fails it.

use wheeleg_config::AxisConfig;
use wheeleg_control::axis::AxisData;
use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::testing::wheeleg_2003_axis;
use wheeleg_studies::axis_sim::suite::{self, Factors, StartUp, TestRig};
use wheeleg_studies::axis_sim::{
    Kind, Metrics, Motion, Trace, axis_data, design, identify, optimal, plant_check,
};
use wheeleg_studies::compare::{Case, Figures, Move, RECOVERY_S, Sizes, Variation, fault_names};
use wheeleg_units::{Duty, PositionMm};

fn bench_axis() -> AxisParams {
    AxisConfig::load("bench-vq110u").expect("built in").axis
}

/// No case here has a fault in it.
fn without_alarm(trace: &Trace, context: &str) {
    assert!(
        trace.faults.is_empty() && trace.drove,
        "{context}: {:?}",
        trace.faults
    );
}

/// Metrics of steps after one another; the first is the learning move.
fn moves(
    kind: Kind,
    factors: &Factors,
    start: StartUp,
    seed: u64,
    targets: &[f64],
) -> Vec<Metrics> {
    let traces = suite::steps(&bench_axis(), factors, kind, start, seed, targets, 2.5)
        .expect("the axis runs");
    for trace in &traces {
        without_alarm(trace, &format!("{}, {factors:?}, seed {seed}", kind.name()));
    }
    traces.iter().map(Metrics::of).collect()
}

/// Figures of a case of `wheeleg compare`, as on the sheet.
fn nominal(axis: &str, kind: Kind, motion: Move, seed: u64) -> Figures {
    let sheet = AxisConfig::load(axis).expect("built in").axis;
    let case = Case::new(axis, &sheet, Variation::Nominal, seed).expect("runs");
    let played = case
        .play(kind, motion)
        .expect("runs")
        .expect("no load is feasible");
    let figures = Figures::of(motion, &played);
    let name = case.id(kind, motion);
    assert_eq!(
        (fault_names(figures.faults).as_str(), figures.stopped),
        ("", Some(false)),
        "{name}"
    );
    figures
}

/// 100 mm out, back, out; 20 mm back and out.
const TARGETS: [f64; 5] = [0.14, 0.04, 0.14, 0.12, 0.14];

#[test]
fn the_default_settles_fast_and_close_on_fifty_seeds() {
    let mut times = Vec::new();
    for seed in 0..50 {
        let all = moves(
            Kind::Predictive,
            &Factors::NONE,
            StartUp::Sheet,
            seed,
            &TARGETS,
        );
        for m in &all[1..] {
            assert!(m.steady_error_mm.abs() <= 0.20, "seed {seed}: {m:?}");
            assert!(!m.limit_cycle(), "seed {seed}: {m:?}");
        }
        for m in &all[1..3] {
            assert!(m.overshoot_mm <= 1.0, "seed {seed}: {m:?}");
            times.push(m.settle_s.expect("settles"));
        }
    }
    times.sort_by(f64::total_cmp);
    let (median, worst) = (times[times.len() / 2], times[times.len() - 1]);
    // Measured 0.29 and 0.30; below 0.24 would beat perfect knowledge. The bars are 0.50 and
    // 0.60; above these here would be a step back.
    assert!((0.24..=0.32).contains(&median), "{median}");
    assert!(worst <= 0.40, "{worst}");
}

#[test]
fn the_fuzzy_laws_keep_their_bars() {
    for (kind, bar_mm) in [(Kind::FuzzyPd, 3.0), (Kind::FuzzyId, 0.5)] {
        for seed in 0..3 {
            for m in &moves(kind, &Factors::NONE, StartUp::Sheet, seed, &TARGETS)[1..] {
                assert!(m.steady_error_mm.abs() <= bar_mm, "{}: {m:?}", kind.name());
            }
        }
    }
}

#[test]
fn an_s_curve_is_followed() {
    for seed in 0..10 {
        let f = nominal("bench-vq110u", Kind::Predictive, Move::SCurve, seed);
        let worst_mm = f.worst_mm.expect("tracked");
        assert!((0.1..=1.5).contains(&worst_mm), "seed {seed}: {f:?}");
    }
}

#[test]
fn no_supervision_trips_whatever_the_controller() {
    for kind in Kind::ALL {
        for motion in Move::ALL {
            nominal("bench-vq110u", kind, motion, 1);
        }
    }
    for axis in ["small-12x50", "long-16x400", "heavy-40x250"] {
        for motion in Move::ALL {
            nominal(axis, Kind::Predictive, motion, 1);
        }
    }
}

#[test]
fn one_factor_at_a_time() {
    let base = Factors::NONE;
    let mut list = Vec::new();
    for load_share in [-0.8, -0.4, 0.4, 0.8] {
        list.push(Factors { load_share, ..base });
    }
    for mass in [1.0, 3.0, 8.0] {
        list.push(Factors {
            mass_kg: Some(mass),
            ..base
        });
    }
    for bar in [4.0, 5.0, 7.0] {
        list.push(Factors {
            supply_pa: Some(bar * 1e5),
            ..base
        });
    }
    for friction in [0.5, 2.0] {
        list.push(Factors { friction, ..base });
    }
    for valve_delay in [0.5, 2.0] {
        list.push(Factors {
            valve_delay,
            ..base
        });
    }
    for factors in list {
        for seed in 0..3 {
            let all = moves(
                Kind::Predictive,
                &factors,
                StartUp::Identified,
                seed,
                &TARGETS,
            );
            for m in &all[1..] {
                let context = format!("{factors:?}, seed {seed}: {m:?}");
                assert!(m.steady_error_mm.abs() <= 0.5, "{context}");
                assert!(m.overshoot_mm <= 3.0, "{context}");
                assert!(!m.limit_cycle(), "{context}");
            }
        }
    }
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn two_hundred_combinations() {
    let sheet = bench_axis();
    let mut tried = 0;
    for seed in 0..200 {
        let factors = Factors::random(&sheet, seed);
        // Drawn within 80 % of the force left; less rounding.
        assert!(factors.static_margin(&sheet) >= 1.25 - 1e-9);
        tried += 1;
        let all = moves(
            Kind::Predictive,
            &factors,
            StartUp::Identified,
            seed,
            &TARGETS[..3],
        );
        for m in &all[1..] {
            let context = format!("{seed}: {factors:?}: {m:?}");
            assert!(m.steady_error_mm.abs() <= 0.5, "{context}");
            assert!(m.overshoot_mm <= 6.0, "{context}");
            assert!(!m.limit_cycle(), "{context}");
        }
    }
    assert_eq!(tried, 200);
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn off_the_bench_axis_few_combinations_miss() {
    // Of 1,200, 600 and 1,200 moves on the axes we measured 21, 3 and 48: reversals that had not died out, a
    // rest beside the bar, a false alarm near the target.
    for (name, count) in [
        ("small-12x50", 60),
        ("long-16x400", 30),
        ("heavy-40x250", 60),
    ] {
        let sheet = AxisConfig::load(name).expect("built in").axis;
        let mut missed = Vec::new();
        for number in 0..count {
            let variation = Variation::Combination(number);
            let case = Case::new(name, &sheet, variation, 1).expect("runs");
            let played = case.play(Kind::Predictive, Move::Step100).expect("runs");
            let f = Figures::of(Move::Step100, &played.expect("feasible"));
            let holds = f.steady_error_mm.is_some_and(|mm| mm.abs() <= 0.5)
                && f.overshoot_mm.is_some_and(|mm| mm <= 6.0)
                && f.limit_cycle == Some(false)
                && f.faults.is_empty()
                && f.stopped == Some(false);
            if !holds {
                missed.push((number, f));
            }
        }
        assert!(missed.len() <= 2, "{name}: {missed:?}");
    }
}

#[test]
fn the_valve_delay_is_found_under_every_load() {
    for name in ["bench-vq110u", "small-12x50"] {
        let sheet = AxisConfig::load(name).expect("built in").axis;
        for load_share in [-0.8, 0.0, 0.8] {
            for bar in [4.0, 6.0, 7.0] {
                for valve_delay in [0.5, 1.0, 2.0] {
                    let factors = Factors {
                        load_share,
                        supply_pa: Some(bar * 1e5),
                        valve_delay,
                        ..Factors::NONE
                    };
                    let context = format!("{name}: {factors:?}");
                    let found = identify(&factors.plant(&sheet), &sheet, 1)
                        .expect("runs")
                        .expect(&context);
                    let excess_ms =
                        (found.t_on_s - valve_delay * sheet.cylinder.fill_valve.t_on_s) * 1e3;
                    assert!(
                        (-0.15..=0.5).contains(&excess_ms),
                        "{context}: {excess_ms} ms"
                    );
                }
            }
        }
    }
}

#[test]
fn nothing_switches_at_rest() {
    // At the stated leakage of both sets, the bench axis and the robot's cylinder.
    let kind = Kind::Predictive;
    for (set, sheet) in [("A", bench_axis()), ("B", wheeleg_2003_axis())] {
        for seed in 0..5 {
            let context = format!("set {set}, seed {seed}");
            let mut rig = TestRig::new(&sheet, &design(&sheet, kind), seed).expect("valid");
            let moved = rig.step(0.11, 3.0).expect("runs");
            let moved_to = moved.rows.last().expect("rows");
            assert!(moved_to.settled && moved_to.switches > 0, "{context}");
            let rest = rig.run(&Motion::hold(0.11), &[], 10.0).expect("runs");
            let last = rest.rows.last().expect("rows");
            assert_eq!(last.switches, 0, "{context}");
            let drift_m = (last.stroke_m - moved_to.stroke_m).abs();
            assert!(drift_m < 1e-3, "{context}: {drift_m}");
            without_alarm(&rest, &context);
        }
    }
}

/// Moves of the robot's cylinder between places all over its stroke, by a law that is configured with `axis`:
/// 40 boards, five moves each after the first.
fn wandering_moves(axis: &AxisData) -> Vec<Trace> {
    let sheet = wheeleg_2003_axis();
    let mut design = design(&sheet, Kind::Predictive);
    design.gains.axis = *axis;
    let mut traces = Vec::new();
    for seed in 0..240_u32 {
        let mut rig = TestRig::new(&sheet, &design, u64::from(seed)).expect("valid");
        for k in 0..6 {
            // Multiples of the golden ratio leave no gap.
            let share = (f64::from(6 * seed + k) * 0.618_033_988_75).fract();
            let trace = rig.step(0.01 + 0.16 * share, 2.5).expect("runs");
            if k > 0 {
                traces.push(trace);
            }
        }
    }
    traces
}

/// Moves more than 1 mm from their target a second after their start, and those not at rest within 1 mm at
/// their end or oscillating about it.
fn late_and_restless(traces: &[Trace]) -> (usize, usize) {
    let late = |trace: &&Trace| {
        let at = ((trace.motion.start_s() + 1.0) * 1e3).round() as usize;
        (trace.rows[at].stroke_m - trace.motion.to_m()).abs() > 1e-3
    };
    let restless = |trace: &&Trace| {
        let m = Metrics::of(trace);
        m.settle_s.is_none() || m.limit_cycle()
    };
    let count = |what: &dyn Fn(&&Trace) -> bool| traces.iter().filter(what).count();
    (count(&late), count(&restless))
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn valve_times_of_another_cylinder_make_moves_late_but_rest_is_found() {
    let told = axis_data(&wheeleg_2003_axis());
    // The defaults of an unconfigured board: a faster valve in front of the same cylinder. Its shortest
    // pulses, of 3.85 to 5 ms, open nothing here.
    let other = AxisData::default();
    assert!(other.valve_on < told.valve_on && other.valve_off < told.valve_off);
    assert_eq!(
        AxisData {
            valve_on: told.valve_on,
            valve_off: told.valve_off,
            margin: told.margin,
            critical_ratio: told.critical_ratio,
            band: told.band,
            ..other
        },
        told
    );
    let (right, wrong) = (wandering_moves(&told), wandering_moves(&other));
    for (name, traces) in [("right", &right), ("wrong", &wrong)] {
        for trace in traces {
            without_alarm(trace, name);
        }
    }
    // With the right times none of 1,200 moves is late and one is restless, and so it is of 7,200. With an explicit
    // prediction 7 of 1,200 were late, and none restless (decision 69).
    let (late, restless) = late_and_restless(&right);
    println!("right times: {late} late, {restless} restless");
    assert!(late <= 2 && restless <= 1, "{late}, {restless}");
    let (later, more_restless) = late_and_restless(&wrong);
    println!("wrong times: {later} late, {more_restless} restless");
    assert!(later > late && later <= 60, "{later}, {late}");
    assert!(more_restless <= 20, "{more_restless}");
}

#[test]
fn contact_lost_and_found() {
    assert_eq!(Sizes::of(&bench_axis()).contact_n, 60.0);
    assert_eq!(RECOVERY_S, 0.5);
    for motion in [Move::Contact, Move::ContactHelped] {
        for seed in 0..5 {
            let f = nominal("bench-vq110u", Kind::Predictive, motion, seed);
            let context = format!("{}, seed {seed}: {f:?}", motion.name());
            assert!(f.contact_error_mm.is_some_and(|mm| mm <= 2.0), "{context}");
            assert!(f.recovery_s.is_some_and(|s| s <= 0.5), "{context}");
            assert_eq!(f.limit_cycle, Some(false), "{context}");
        }
    }
}

#[test]
fn the_start_from_home_and_what_a_preview_does() {
    let axis = wheeleg_2003_axis();
    // The paper's law, its settle band off, pushing against the stop.
    let mut paper = design(&axis, Kind::FuzzyPd);
    paper.gains.stroke_max = PositionMm::from_int(185);
    paper.gains.settle_band = PositionMm::ZERO;
    paper.gains.minimum_duty = Duty::ZERO;
    let home = |design, preview_s| {
        let trace = suite::home_retract(&axis, design, 1, preview_s).expect("runs");
        // The row before the step.
        let pressure = trace.rows[699].pressure_pa;
        (Metrics::of(&trace), pressure)
    };
    let (m, pressure) = home(&paper, 0.0);
    assert!(pressure[0] > 6.9e5 && pressure[1] < 1.1e5, "{pressure:?}");
    assert!(
        (m.start_delay_s.expect("moves") - 0.25).abs() <= 0.05,
        "{m:?}"
    );
    assert!(m.peak_speed_mm_s <= 400.0, "{m:?}");

    // The default law, once from its rest position, once pushed against the stop.
    let resting = design(&axis, Kind::Predictive);
    let mut pushing = resting.clone();
    pushing.gains.stroke_max = PositionMm::from_int(185);
    for design in [&resting, &pushing] {
        let (m, _) = home(design, 0.4);
        assert!(m.start_delay_s.expect("moves") <= 0.08, "{m:?}");
        assert!(m.early_mm <= 1.0, "{m:?}");
    }
    let (without, _) = home(&pushing, 0.0);
    // It is the preview that does it: the air of a full chamber needs its time.
    assert!(without.start_delay_s.expect("moves") > 0.09, "{without:?}");
}

#[test]
fn the_time_optimal_bound_and_the_ratio_to_it() {
    let sheet = bench_axis();
    let mut rig = TestRig::new(&sheet, &design(&sheet, Kind::Predictive), 1).expect("valid");
    for to_m in [0.14, 0.04] {
        rig.step(to_m, 2.0).expect("runs");
    }
    let bench = rig.bench();
    let bound = optimal::fastest(bench.axis(), &bench.state, 0.14, 1, 1500).expect("runs");
    assert!((0.19..=0.26).contains(&bound.settle_s), "{bound:?}");
    let ours = Metrics::of(&rig.step(0.14, 1.5).expect("runs"))
        .settle_s
        .expect("settles");
    let ratio = ours / bound.settle_s;
    // Nobody beats perfect knowledge.
    assert!((1.0..=1.5).contains(&ratio), "{ours} / {bound:?}");
}

#[test]
fn the_other_axis_files() {
    for name in ["small-12x50", "long-16x400", "heavy-40x250"] {
        let sheet = AxisConfig::load(name).expect("built in").axis;
        assert!(plant_check::check(&sheet).expect("runs").passed, "{name}");
        let s = sheet.cylinder.stroke_m;
        let targets = [0.76 * s, 0.2 * s, 0.76 * s, 0.65 * s, 0.76 * s];
        for seed in 0..3 {
            let traces = suite::steps(
                &sheet,
                &Factors::NONE,
                Kind::Predictive,
                StartUp::Sheet,
                seed,
                &targets,
                3.0,
            )
            .expect("runs");
            for trace in &traces[1..] {
                let m = Metrics::of(trace);
                let context = format!("{name}, seed {seed}: {m:?}");
                without_alarm(trace, &context);
                assert!(m.steady_error_mm.abs() <= 0.5, "{context}");
                assert!(m.overshoot_mm <= 3.0, "{context}");
                assert!(m.settle_s.is_some_and(|t| t <= 1.0), "{context}");
                assert!(!m.limit_cycle(), "{context}");
            }
        }
    }
}

#[test]
fn the_plant_keeps_its_balances_and_order() {
    let check = plant_check::check(&bench_axis()).expect("runs");
    assert!(check.passed, "{check:?}");
    let mut thermal = bench_axis();
    thermal.cylinder.gas_model = wheeleg_plant::chamber::GasModel::Thermal {
        heat_transfer_w_m2_k: 60.0,
    };
    thermal.cylinder.friction.pressure_area_m2 = 1e-5;
    let check = plant_check::check(&thermal).expect("runs");
    assert!(check.passed, "{check:?}");
}
