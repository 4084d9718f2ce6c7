//! Experiments.
use wheeleg_config::AxisConfig;
use wheeleg_config::builtin;
use wheeleg_studies::axis_sim::Kind;
use wheeleg_studies::compare::{Case, Figures, Move, Variation};
fn fails(f: &Figures) -> bool {
    f.steady_error_mm.is_none_or(|e| e.abs() > 0.5)
        || f.overshoot_mm.is_none_or(|o| o > 6.0)
        || f.limit_cycle != Some(false)
        || !f.faults.is_empty()
        || f.stopped != Some(false)
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    match args[1].as_str() {
        "cases" => {
            let axis = &args[2];
            let n: u64 = args[3].parse().unwrap();
            let filled = args.get(4).map(String::as_str) == Some("filled");
            let sheet = AxisConfig::load(axis).unwrap().axis;
            let (mut miss, mut over, mut settle, mut count) = (0, Vec::new(), Vec::new(), 0);
            let mut missed = Vec::new();
            for c in 1..=n {
                let case = Case::new(
                    axis,
                    &sheet,
                    if filled {
                        Variation::Drawn(c)
                    } else {
                        Variation::Combination(c)
                    },
                    1,
                )
                .unwrap();
                let Some(played) = case.play(Kind::Predictive, Move::Step100).unwrap() else {
                    continue;
                };
                let f = Figures::of(Move::Step100, &played, None);
                count += 1;
                if fails(&f) {
                    miss += 1;
                    missed.push(c);
                }
                over.push(f.overshoot_mm.unwrap_or(99.0));
                settle.push(f.settle_s.unwrap_or(9.0));
            }
            over.sort_by(f64::total_cmp);
            settle.sort_by(f64::total_cmp);
            let q = |v: &Vec<f64>, p: f64| v[((v.len() as f64 * p) as usize).min(v.len() - 1)];
            println!(
                "{axis} {} miss {miss}/{count} over p50 {:.2} p99 {:.2} settle p50 {:.3} p90 {:.3} p99 {:.3} {missed:?}",
                if filled { "filled" } else { "vented" },
                q(&over, 0.5),
                q(&over, 0.99),
                q(&settle, 0.5),
                q(&settle, 0.9),
                q(&settle, 0.99)
            );
        }
        "nominal" => {
            let axis = "bench-vq110u";
            let sheet = AxisConfig::load(axis).unwrap().axis;
            let n: u64 = args[2].parse().unwrap();
            for motion in [Move::Step100, Move::SCurve, Move::Step20] {
                let (mut settle, mut worst, mut over, mut steady) =
                    (Vec::new(), Vec::new(), Vec::new(), Vec::new());
                for seed in 1..=n {
                    let case = Case::new(axis, &sheet, Variation::Nominal, seed).unwrap();
                    let played = case.play(Kind::Predictive, motion).unwrap().unwrap();
                    let f = Figures::of(motion, &played, None);
                    if motion == Move::SCurve {
                        worst.push(f.worst_mm.unwrap());
                    } else {
                        settle.push(f.settle_s.unwrap_or(9.0));
                    }
                    over.push(f.overshoot_mm.unwrap_or(0.0));
                    steady.push(f.steady_error_mm.unwrap().abs());
                }
                for v in [&mut settle, &mut worst, &mut over, &mut steady] {
                    v.sort_by(f64::total_cmp);
                }
                let q = |v: &Vec<f64>, p: f64| {
                    v.get(((v.len() as f64 * p) as usize).min(v.len().saturating_sub(1)))
                        .copied()
                        .unwrap_or(0.0)
                };
                println!(
                    "{} settle p50 {:.3} max {:.3} worst p50 {:.2} max {:.2} over max {:.2} steady max {:.3}",
                    motion.name(),
                    q(&settle, 0.5),
                    q(&settle, 1.0),
                    q(&worst, 0.5),
                    q(&worst, 1.0),
                    q(&over, 1.0),
                    q(&steady, 1.0)
                );
            }
        }
        "robot" => {
            let name = &args[2];
            let scenario = builtin::scenario(name).unwrap();
            let robot = builtin::robot("wheeleg").unwrap();
            let (from, to): (u64, u64) = (args[3].parse().unwrap(), args[4].parse().unwrap());
            let (mut n, mut miss) = (0, 0);
            for seed in from..=to {
                let mut recorder = wheeleg_telemetry::Recorder::in_memory();
                wheeleg_sim::run(&scenario, &robot, seed, &mut recorder, &mut |_| {
                    std::ops::ControlFlow::Continue(())
                })
                .expect("runs");
                let recording = recorder.finish().expect("memory");
                let analysis = wheeleg_studies::analysis::analyse(&scenario, &robot, &recording);
                let failed: Vec<_> = analysis
                    .targets
                    .iter()
                    .filter(|t| t.required && !t.pass)
                    .map(|t| format!("{} {:?}", t.id, t.value))
                    .collect();
                n += 1;
                if !failed.is_empty() {
                    miss += 1;
                    println!("  seed {seed}: {failed:?}");
                }
            }
            println!("{name}: {miss}/{n} missed");
        }
        "edges" => {
            let scenario = builtin::scenario(&args[2]).unwrap();
            let robot = builtin::robot("wheeleg").unwrap();
            let mut recorder = wheeleg_telemetry::Recorder::in_memory();
            wheeleg_sim::run(
                &scenario,
                &robot,
                args[3].parse().unwrap(),
                &mut recorder,
                &mut |_| std::ops::ControlFlow::Continue(()),
            )
            .expect("runs");
            let recording = recorder.finish().expect("memory");
            for (j, rows) in recording.joints.iter().enumerate() {
                let (mut last, mut shown) = (0.0, 0);
                for k in 1..rows.len() {
                    let (a, b) = (&rows[k - 1], &rows[k]);
                    if (a.v.reference_mm - b.v.reference_mm).abs() > 1e-9 {
                        last = b.t_s();
                    }
                    if b.t_s() - last > 1.2 && b.v.valve_edges > a.v.valve_edges && shown < 25 {
                        shown += 1;
                        let next = rows[k..]
                            .windows(2)
                            .find(|w| (w[0].v.reference_mm - w[1].v.reference_mm).abs() > 1e-9)
                            .map_or(99.0, |w| w[1].t_s());
                        println!(
                            "joint {} t {:.2} +{} next in {:.2} ref {:.2} sensed {:.3} v {:.1} net {:.1} press {:.1} on {:?}",
                            j + 1,
                            b.t_s(),
                            b.v.valve_edges - a.v.valve_edges,
                            next - b.t_s(),
                            b.v.reference_mm,
                            b.v.sensed_mm,
                            b.v.velocity_mm_s,
                            b.v.force_net_n,
                            b.v.force_pressure_n,
                            (b.v.valves_open, b.v.limits)
                        );
                    }
                }
            }
        }
        _ => panic!(),
    }
}
