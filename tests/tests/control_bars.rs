//! The bars of position control with four on/off valves and one potentiometer,
//! on the bench axis (bore 20 x 180 mm, VQ110U-class valves, 1.5 kg, 6 bar gauge)
//! and on axes that nobody tuned for. All on the firmware's own control path.

use wheeleg_plant::axis::AxisParams;
use wheeleg_plant::testing::wheeleg_2003_axis;
use wheeleg_sim::bench::suite::{self, Factors, StartUp};
use wheeleg_sim::bench::{Bench, Firmware, Kind, Metrics, Motion, design, optimal, plant_check};
use wheeleg_sim::config::AxisConfig;
use wheeleg_units::{Duty, PositionMm};

fn bench_axis() -> AxisParams {
    AxisConfig::load("bench-vq110u").expect("built in").axis
}

/// Metrics of steps after one another; the first is the learning move.
fn moves(
    kind: Kind,
    factors: &Factors,
    start: StartUp,
    seed: u64,
    targets: &[f64],
) -> Vec<Metrics> {
    suite::steps(&bench_axis(), factors, kind, start, seed, targets, 2.5)
        .expect("the axis runs")
        .iter()
        .map(Metrics::of)
        .collect()
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
    // Measured 0.33 and 0.35; below 0.24 would beat perfect knowledge.
    assert!((0.24..=0.50).contains(&median), "{median}");
    assert!(worst <= 0.60, "{worst}");
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
        for m in
            suite::s_curves(&bench_axis(), Kind::Predictive, seed, 0.06, 0.124, 1.0).expect("runs")
        {
            assert!(m.worst_mm <= 1.5 && m.worst_mm > 0.1, "seed {seed}: {m:?}");
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
fn two_hundred_combinations() {
    let sheet = bench_axis();
    let mut tried = 0;
    for seed in 0..200 {
        let factors = Factors::random(seed);
        if factors.static_margin(&sheet) < 1.25 {
            continue;
        }
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
    assert!(tried >= 190, "{tried}");
}

#[test]
fn nothing_switches_at_rest() {
    let sheet = bench_axis();
    for seed in 0..5 {
        let board = Firmware::new(&design(&sheet, Kind::Predictive)).expect("valid");
        let mut bench = Bench::new(&sheet, seed, board).expect("valid");
        let step = Motion::Step {
            at_s: 0.05,
            from_m: 0.04,
            to_m: 0.11,
        };
        let moved = bench.run(&step, &[], 3.0).expect("runs");
        assert!(
            moved
                .rows
                .last()
                .is_some_and(|r| r.settled && r.switches > 0)
        );
        let rest = bench.run(&Motion::hold(0.11), &[], 10.0).expect("runs");
        let last = rest.rows.last().expect("rows");
        assert_eq!(last.switches, 0, "seed {seed}");
        assert!((last.stroke_m - 0.11).abs() < 5e-4);
    }
}

#[test]
fn contact_lost_and_found() {
    for load_n in [-60.0, 60.0] {
        for seed in 0..5 {
            let (trace, worst_mm) =
                suite::contact_loss(&bench_axis(), Kind::Predictive, seed, load_n).expect("runs");
            assert!(worst_mm <= 2.0, "{load_n} N, seed {seed}: {worst_mm}");
            assert!(!Metrics::of(&trace).limit_cycle());
        }
    }
}

#[test]
fn the_start_from_home_and_what_notice_does() {
    let axis = wheeleg_2003_axis();
    // The paper's law, its settle band off, pushing against the stop.
    let mut paper = design(&axis, Kind::FuzzyPd);
    paper.gains.stroke_max = PositionMm::from_int(185);
    paper.gains.settle_band = PositionMm::ZERO;
    paper.gains.minimum_duty = Duty::ZERO;
    let home = |design, notice_s| {
        let trace = suite::home_retract(&axis, design, 1, notice_s).expect("runs");
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

    // The default, once from where it rests, once made to push against the stop.
    let resting = design(&axis, Kind::Predictive);
    let mut pushing = resting.clone();
    pushing.gains.stroke_max = PositionMm::from_int(185);
    for design in [&resting, &pushing] {
        let (m, _) = home(design, 0.4);
        assert!(m.start_delay_s.expect("moves") <= 0.08, "{m:?}");
        assert!(m.early_mm <= 1.0, "{m:?}");
    }
    let (without, _) = home(&pushing, 0.0);
    assert!(without.start_delay_s.expect("moves") > 0.15, "{without:?}");
}

#[test]
fn the_time_optimal_bound_and_the_ratio_to_it() {
    let sheet = bench_axis();
    let board = Firmware::new(&design(&sheet, Kind::Predictive)).expect("valid");
    let mut bench = Bench::new(&sheet, 1, board).expect("valid");
    let mut at_m = 0.04;
    for to_m in [0.14, 0.04] {
        bench
            .run(
                &Motion::Step {
                    at_s: 0.05,
                    from_m: at_m,
                    to_m,
                },
                &[],
                2.0,
            )
            .expect("runs");
        at_m = to_m;
    }
    let bound = optimal::fastest(bench.axis(), &bench.state, 0.14, 1, 1500).expect("runs");
    assert!((0.19..=0.26).contains(&bound.settle_s), "{bound:?}");
    let step = Motion::Step {
        at_s: 0.0,
        from_m: 0.04,
        to_m: 0.14,
    };
    let ours = Metrics::of(&bench.run(&step, &[], 1.5).expect("runs"))
        .settle_s
        .expect("settles");
    let ratio = ours / bound.settle_s;
    // Nobody beats perfect knowledge; measured 1.6 extending, 1.4 retracting.
    assert!((1.0..=1.75).contains(&ratio), "{ours} / {bound:?}");
}

#[test]
fn axes_that_nobody_tuned_for() {
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
            for m in traces[1..].iter().map(Metrics::of) {
                let context = format!("{name}, seed {seed}: {m:?}");
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
