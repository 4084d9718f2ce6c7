//! Precharge on simulated cylinders: its effect on the first motion after a stop, and how far the piston
//! moves while the chambers fill. The board is the whole application.

use crate::sil::{range, robot, robot_with, run, stand, story, window};
use wheeleg_config::{AxisConfig, EventAction};
use wheeleg_master::command::Command;
use wheeleg_master::event::Event as MasterEvent;
use wheeleg_plant::axis::AxisParams;
use wheeleg_protocol::param::JointParam;
use wheeleg_protocol::{Arm, ClearFault, Limit, LinkLossAction, LogEvent, SCHEMA_HASH};
use wheeleg_studies::axis_sim::{AxisSim, Kind, Motion, Node, Trace, design};
use wheeleg_telemetry::Cause;

/// Raw value of a bar.
const BAR: f64 = 65_536.0;
/// Log records with which a board reports the end of its precharge, and how it ended.
const ENDED: [LogEvent; 3] = [
    LogEvent::Precharged,
    LogEvent::PrechargeMoved,
    LogEvent::PrechargeLate,
];

/// Axes that the precharge is tried on: those of the axis files, and the robot's cylinder.
fn axes() -> Vec<(&'static str, AxisParams)> {
    let names = ["bench-vq110u", "small-12x50", "long-16x400", "heavy-40x250"];
    let mut axes: Vec<_> = names
        .iter()
        .map(|name| (*name, AxisConfig::load(name).unwrap().axis))
        .collect();
    let robot = robot();
    let mut axis = axes[0].1.clone();
    axis.cylinder = robot.plant.cylinders[0].clone();
    axes.push(("wheeleg-2003", axis));
    axes
}

/// A bench whose board fills its chambers to `bar` when armed; 0: no precharge.
fn bench(axis: &AxisParams, bar: f64) -> AxisSim<Node> {
    let sheet = design(axis, Kind::FuzzyPd);
    let raw = (bar * BAR).round() as i32;
    let node = Node::with(&sheet, &[(JointParam::Precharge, raw)]).unwrap();
    AxisSim::new(axis, 1, node).unwrap()
}

/// A run from an arming on, and the effect of its precharge.
struct Start {
    trace: Trace,
    /// Length of the precharge, ms.
    filled_ms: usize,
    /// Largest way of the piston in it, mm.
    way_mm: f64,
    /// Lowest pressure, gauge, at its end, bar.
    least_bar: f64,
}

/// Runs from here on, with the board about to be armed or just armed.
fn start(bench: &mut AxisSim<Node>, motion: &Motion, duration_s: f64) -> Start {
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

/// Strokes and chamber contents at which a piston may rest when it is armed: emptied, or with air unknown to
/// the board, in balance with the load.
fn standing(axis: &AxisParams) -> Vec<AxisParams> {
    let loads = [-60.0, -12.0, -4.0, 0.0, 4.0, 12.0, 60.0];
    let ambient = axis.gas.ambient_pressure_pa;
    let area = |d: f64| std::f64::consts::FRAC_PI_4 * d * d;
    let (bore, rod) = (area(axis.cylinder.bore_m), area(axis.cylinder.rod_m));
    let mut found = Vec::new();
    for load_n in loads {
        let mut at = |share: f64, pressure_a_pa: f64, pressure_b_pa: f64| {
            let mut p = axis.clone();
            p.load_n = load_n;
            p.initial_stroke_m = share * p.cylinder.stroke_m;
            p.cylinder.initial_pressure_a_pa = pressure_a_pa;
            p.cylinder.initial_pressure_b_pa = pressure_b_pa;
            found.push(p);
        };
        for share in [0.0, 0.02, 0.5, 1.0] {
            let held = (share == 0.0 && load_n < 0.0) || (share == 1.0 && load_n > 0.0);
            if held || load_n.abs() < 0.6 * axis.cylinder.friction.static_n {
                at(share, ambient, ambient);
            }
        }
        let balance = (4e5 * bore - ambient * rod + load_n) / (bore - rod);
        if (ambient..axis.supply.set_pressure_pa).contains(&balance) {
            for share in [0.05, 0.3, 0.5, 0.9] {
                at(share, 4e5, balance);
            }
        }
    }
    found
}

#[test]
fn the_piston_stays_where_it_is() {
    let mut worst = (0.0_f64, String::new());
    for (name, axis) in axes() {
        let (mut cases, mut full) = (0, 0);
        for bar in [1.0, 2.0] {
            for p in standing(&axis) {
                let at_m = p.initial_stroke_m;
                let run = start(&mut bench(&p, bar), &Motion::hold(at_m), 2.2);
                let what = format!(
                    "{name}, {bar} bar, {:.0} mm, {} N, {:.1} bar in A: {:.2} mm, {} ms, {:.2} bar",
                    at_m * 1e3,
                    p.load_n,
                    p.cylinder.initial_pressure_a_pa * 1e-5,
                    run.way_mm,
                    run.filled_ms,
                    run.least_bar
                );
                assert!(run.way_mm < 2.0, "{what}");
                assert!((30..1500).contains(&run.filled_ms), "{what}");
                // Nothing stops it short unless the piston has moved.
                let filled = run.least_bar > 0.7 * bar;
                assert!(filled || run.way_mm > 1.3, "{what}");
                cases += 1;
                full += usize::from(filled);
                if run.way_mm > worst.0 {
                    worst = (run.way_mm, what);
                }
            }
        }
        println!("{name}: {full} of {cases} filled to seven tenths of the pressure and more");
        assert!(full * 10 >= cases * 8, "{name}: {full} of {cases}");
    }
    println!("farthest: {}", worst.1);
}

/// Largest speed (mm/s) and overshoot (mm) of the first motion after an E-stop with staged
/// exhaust, to a set-point `travel_m` away.
fn first_motion(axis: &AxisParams, bar: f64, travel_m: f64) -> (f64, f64) {
    let mut bench = bench(axis, bar);
    let begin = Motion::hold(axis.initial_stroke_m);
    bench.board.on_link_loss = LinkLossAction::HoldThenExhaust;
    bench.run(&begin, &[], 1.0).unwrap();
    bench.board.emergency_stop = true;
    bench.run(&begin, &[], 0.1).unwrap();
    bench.board.emergency_stop = false;
    bench.run(&begin, &[], 8.0).unwrap();
    let c = &bench.state.core;
    let left = bench.axis().assembly.cylinders[0].pressures_pa(&c.cylinders[0], c.motion.stroke_m);
    assert!(left.iter().all(|p| *p < 1.1e5), "emptied: {left:?}");
    let from_m = c.motion.stroke_m;
    bench.board.request(&ClearFault {}.into());
    bench.run(&begin, &[], 0.05).unwrap();
    let schema_hash = SCHEMA_HASH;
    bench.board.request(&Arm { schema_hash }.into());
    let run = start(&mut bench, &Motion::hold(from_m + travel_m), 3.0);
    assert_eq!(run.filled_ms > 0, bar > 0.0);
    assert!(run.way_mm < 2.0, "{}", run.way_mm);
    let rows = &run.trace.rows;
    let speed = rows
        .iter()
        .map(|r| r.velocity_m_s.abs())
        .fold(0.0, f64::max);
    let beyond = rows
        .iter()
        .map(|r| (r.stroke_m - from_m - travel_m) * travel_m.signum());
    let farthest = beyond.clone().fold(f64::NEG_INFINITY, f64::max);
    assert!(farthest > -5e-3, "it gets there: {farthest}");
    (speed * 1e3, beyond.fold(0.0, f64::max) * 1e3)
}

#[test]
fn after_a_stop_the_first_motion_is_slower_than_without() {
    for (name, axis) in axes() {
        for (from, travel) in [(0.3, 1.0), (0.7, -1.0)] {
            let mut p = axis.clone();
            let stroke_m = p.cylinder.stroke_m;
            p.initial_stroke_m = from * stroke_m;
            let travel_m = travel * (0.4 * stroke_m).min(0.05);
            let [without, one, two] = [0.0, 1.0, 2.0].map(|bar| first_motion(&p, bar, travel_m));
            let what = format!(
                "{name} by {:.0} mm, speed in mm/s and overshoot in mm: without {without:.1?}, \
                 1 bar {one:.1?}, 2 bar {two:.1?}",
                travel_m * 1e3
            );
            println!("{what}");
            assert!(one.0 < 0.97 * without.0, "{what}");
            assert!(two.0 < 0.95 * one.0 + 0.02 * without.0, "{what}");
            assert!(one.1 < without.1, "{what}");
            if name == "wheeleg-2003" {
                assert!(one.0 < 0.9 * without.0 && one.1 < 0.6 * without.1, "{what}");
            }
        }
    }
}

#[test]
fn without_supply_it_ends_and_the_fault_that_follows_names_the_supply() {
    for (name, mut p) in axes() {
        let ambient = p.gas.ambient_pressure_pa;
        p.initial_stroke_m = 0.5 * p.cylinder.stroke_m;
        p.supply.source_pressure_pa = ambient;
        p.supply.initial_pressure_pa = ambient;
        p.cylinder.initial_pressure_a_pa = ambient;
        p.cylinder.initial_pressure_b_pa = ambient;
        let to_m = p.initial_stroke_m + 0.3 * p.cylinder.stroke_m;
        let run = start(&mut bench(&p, 1.0), &Motion::hold(to_m), 8.0);
        assert!(
            (30..2000).contains(&run.filled_ms),
            "{name}: {}",
            run.filled_ms
        );
        assert!(run.least_bar.abs() < 0.05, "{name}: {}", run.least_bar);
        let told: Vec<_> = run.trace.faults.iter().map(|f| f.remedy()).collect();
        assert!(
            told.iter().any(|t| t.contains("supply")),
            "{name}: {told:?}"
        );
    }
}

#[test]
fn a_robot_that_stands_on_its_legs_neither_rises_nor_sinks() {
    let (stop, clear, arm) = (0.8, 1.8, 4.3);
    let events = [
        (stop, EventAction::EStop),
        (clear, EventAction::ClearFault),
        (arm, EventAction::Command(Command::Arm)),
    ];
    let recording = run(
        &stand(arm + 2.0, &events),
        &robot_with(JointParam::Precharge, BAR as i32),
        1,
    );
    for (joint, rows) in recording.joints.iter().enumerate() {
        let ended = recording.events.iter().any(|e| match e.v.cause {
            Cause::Master(MasterEvent::Log { node, entry }) => {
                usize::from(node) == joint + 1 && ENDED.contains(&entry.event)
            }
            _ => false,
        });
        assert!(ended, "joint {}: {}", joint + 1, story(&recording));
        let after = window(rows, arm, f64::INFINITY);
        assert!(after[after.len() - 1].v.mode >= 2, "armed");
        let (low, high) = range(after, |s| s.position_mm);
        assert!(high - low < 2.0, "joint {}: {low} to {high} mm", joint + 1);
    }
}
