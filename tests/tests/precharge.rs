//! Precharge on simulated cylinders: what it makes of the first motion after a stop, and how far
//! the piston moves while the chambers are filled. The board is the whole application.

use wheeleg_plant::axis::AxisParams;
use wheeleg_protocol::param::JointParam;
use wheeleg_protocol::{Arm, ClearFault, Limit, LinkLossAction, SCHEMA_HASH};
use wheeleg_sim::bench::{Bench, Kind, Motion, Node, Trace, design};
use wheeleg_sim::config::{AxisConfig, builtin};

/// Raw value of a bar.
const BAR: f64 = 65_536.0;

/// Axes that the precharge is tried on: those of the axis files, and the robot's cylinder.
fn axes() -> Vec<(&'static str, AxisParams)> {
    let names = ["bench-vq110u", "small-12x50", "long-16x400", "heavy-40x250"];
    let mut axes: Vec<_> = names
        .iter()
        .map(|name| (*name, AxisConfig::load(name).unwrap().axis))
        .collect();
    let robot = builtin::robot("wheeleg-2003").unwrap();
    let mut axis = axes[0].1.clone();
    axis.cylinder = robot.plant.cylinders[0].clone();
    axes.push(("wheeleg-2003", axis));
    axes
}

/// A bench whose board fills its chambers to `bar` when it is armed; 0: it does not.
fn bench(axis: &AxisParams, bar: f64) -> Bench<Node> {
    let sheet = design(axis, Kind::FuzzyPd);
    let raw = (bar * BAR).round() as i32;
    let node = Node::with(&sheet, &[(JointParam::Precharge, raw)]).unwrap();
    Bench::new(axis, 1, node).unwrap()
}

/// A run from an arming on, and what the precharge in it did.
struct Start {
    trace: Trace,
    /// Length of the precharge, ms.
    filled_ms: usize,
    /// Largest way of the piston in it, mm.
    way_mm: f64,
    /// Lowest pressure, gauge, at its end, bar.
    least_bar: f64,
}

/// Runs from here on, where the board is about to be armed or just was.
fn start(bench: &mut Bench<Node>, motion: &Motion, duration_s: f64) -> Start {
    let from_m = bench.state.core.motion.stroke_m;
    let (mut filled_ms, mut way_m, mut least_pa) = (0, 0.0_f64, 0.0_f64);
    let trace = bench
        .watch(motion, &[], duration_s, |row, node| {
            if node.snapshot().limits.contains(Limit::DriveInhibited) {
                filled_ms += 1;
                way_m = way_m.max((row.stroke_m - from_m).abs());
                least_pa = row.pressure_pa[0].min(row.pressure_pa[1]);
            }
        })
        .unwrap();
    Start {
        trace,
        filled_ms,
        way_mm: way_m * 1e3,
        least_bar: (least_pa - 101_325.0) * 1e-5,
    }
}

#[test]
fn experiment() {
    for (name, axis) in axes() {
        for bar in [1.0, 2.0] {
            for (empty, shares) in [
                (true, [0.0, 0.02, 0.5, 1.0]),
                (false, [0.05, 0.3, 0.5, 0.9]),
            ] {
                for share in shares {
                    let mut line = String::new();
                    for load in [-60.0, -12.0, -4.0, 0.0, 4.0, 12.0, 60.0] {
                        let mut p = axis.clone();
                        let c = &mut p.cylinder;
                        let area = std::f64::consts::FRAC_PI_4 * c.bore_m * c.bore_m;
                        let rod = std::f64::consts::FRAC_PI_4 * c.rod_m * c.rod_m;
                        p.initial_stroke_m = share * c.stroke_m;
                        p.load_n = load;
                        let ambient = p.gas.ambient_pressure_pa;
                        if empty {
                            c.initial_pressure_a_pa = ambient;
                            c.initial_pressure_b_pa = ambient;
                            let stands = load.abs() < 0.6 * c.friction.static_n
                                || (share == 0.0 && load < 0.0)
                                || (share == 1.0 && load > 0.0);
                            if !stands {
                                continue;
                            }
                        } else {
                            c.initial_pressure_a_pa = 4e5;
                            c.initial_pressure_b_pa =
                                (4e5 * area - ambient * rod + load) / (area - rod);
                            if !(ambient..7e5).contains(&c.initial_pressure_b_pa) {
                                continue;
                            }
                        }
                        let mut bench = bench(&p, bar);
                        let s = start(&mut bench, &Motion::hold(p.initial_stroke_m), 2.2);
                        line += &format!(
                            " {load}: {:.2}mm {}ms {:.2}bar",
                            s.way_mm, s.filled_ms, s.least_bar
                        );
                    }
                    println!("{name} {bar} bar empty {empty} at {share}:{line}");
                }
            }
        }
    }
}
