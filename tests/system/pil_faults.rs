//! Faults with the firmware images on emulated boards: the master dies, a program
//! stops, the supply fails in mid-move and in mid-save. (Flipped bits: `pil_flips.rs`.)
//! Each ends in the safe state of `docs/decisions/0010-safe-states.md`, seen on the commanded, the
//! sensed and the physical side. And a disturbed line, of which every board must hear
//! what its native application hears. `cargo xtask pil` runs this.

use crate::program;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::bench::pil::Board;
use crate::bench::power_up;
use crate::sil::{at, energised, gait, range, robot, run_with, window};
use wheeleg_config::{EventAction, LegChoice, Scenario};
use wheeleg_protocol::NodeMode;
use wheeleg_remote_host::{NodeChoice, NodeKind, Nodes, PilSummary};
use wheeleg_remote_link::{Hook, Power, Ran, Reply, Request, Run};
use wheeleg_telemetry::{JointSample, Recording, Row, WheelSample};

/// Valves commanded shut and wheel ramps begun within this, s.
const REACTION_S: f64 = 0.060;
/// Wheels stand after this, s.
const STAGE_S: f64 = 0.500;
const STANDING_MM_S: f64 = 5.0;
const TICK_S: f64 = 1e-3;
/// The watchdog of the boards, s, and its tolerance: it was fed at the end of the last
/// tick, and counts its own oscillator.
const WATCHDOG_S: [f64; 2] = [0.0480, 0.0505];

const HOLD: u8 = 4;
const EXHAUST: u8 = 5;

fn one(choice: &str) -> Nodes {
    let choice: NodeChoice = choice.parse().expect("a node");
    Nodes::new(&NodeKind::Sil, &[choice]).expect("one each")
}

/// The gait with one fault.
fn gait_with(fault: &str, duration_s: f64) -> Scenario {
    Scenario {
        faults: vec![fault.parse().expect("a fault")],
        ..gait(LegChoice::Left, duration_s, &[])
    }
}

/// End of the last tick after `from_s` in which `open` holds, counted from `from_s`; 0
/// without one.
fn last(rows: &[Row<JointSample>], from_s: f64, open: impl Fn(&JointSample) -> bool) -> f64 {
    let from = window(rows, from_s, f64::INFINITY);
    let row = from.iter().rfind(|row| open(&row.v));
    row.map_or(0.0, |row| row.t_s() + TICK_S - from_s)
}

/// From the end of a coil's current to the end of the flow, s.
fn closing_s(joint: usize) -> f64 {
    let valves = &robot().plant.cylinders[joint];
    valves.fill_valve.t_off_s.max(valves.vent_valve.t_off_s) + valves.line_delay_s
}

/// An instant in mid-move at which valves of the joint are at work, so that there is
/// something to shut.
fn busy(rows: &[Row<JointSample>]) -> f64 {
    let at_work = rows.windows(5).find(|ticks| {
        let moves = ticks.iter().all(|row| row.v.velocity_mm_s.abs() > 50.0);
        let open = ticks.iter().all(|row| row.v.valves_open != 0);
        moves && open && ticks.iter().all(|row| energised(&row.v))
    });
    at_work.expect("a moving joint")[2].t_s()
}

#[test]
fn the_master_dies_and_every_image_goes_to_its_safe_state() {
    // The wheels push; the foot is in the air.
    for t in [1.0, 2.1] {
        let scenario = gait(LegChoice::Left, t + 1.0, &[(t, EventAction::KillMaster)]);
        let (recording, pil) = run_with(
            &scenario,
            &Nodes::new(&NodeKind::Pil, &[]).expect("one each"),
        );
        assert_eq!(pil.differing_bits, 0, "{:?}", pil.first_difference);
        let mut worst_ms = [0.0_f64; 2];
        for (joint, rows) in recording.joints.iter().enumerate() {
            let name = joint + 1;
            let until = window(rows, f64::NEG_INFINITY, t + STAGE_S);
            let commanded = last(until, t, energised);
            let physical = last(until, t, |s| s.valves_open != 0);
            assert!(
                commanded <= REACTION_S,
                "joint {name} at {t} s: {commanded}"
            );
            let limit = REACTION_S + closing_s(joint) + TICK_S;
            assert!(physical <= limit, "joint {name} at {t} s: {physical}");
            for (worst, s) in worst_ms.iter_mut().zip([commanded, physical]) {
                *worst = worst.max(s * 1e3);
            }
            for row in window(rows, t + REACTION_S, f64::INFINITY) {
                assert!([HOLD, EXHAUST].contains(&row.v.mode) && row.v.faults != 0);
            }
            assert!(at(rows, t).faults == 0 && at(rows, t).mode == 3);
        }
        for (wheel, rows) in recording.wheels.iter().enumerate() {
            let stood = window(rows, t + STAGE_S, f64::INFINITY);
            let (low, high) = range(stood, |s| s.velocity_mm_s);
            assert!(
                low > -STANDING_MM_S && high < STANDING_MM_S,
                "wheel {}: {low} … {high} mm/s",
                wheel + 7
            );
            assert!(
                stood
                    .iter()
                    .all(|row| row.v.mode == HOLD && row.v.faults != 0)
            );
        }
        println!(
            "master dies at {t} s: shut by command after {:.0} ms, physically after {:.0} ms",
            worst_ms[0], worst_ms[1]
        );
    }
}

#[test]
fn on_a_disturbed_line_every_image_hears_and_counts_what_the_host_does() {
    // From before the first round of questions on; the master asks for the counters
    // while it hears broken frames itself.
    let mut scenario = gait(LegChoice::Left, 2.5, &[]);
    scenario.faults = vec!["bit-errors=1e-4@0s..1.5s".parse().expect("a fault")];
    let (recording, pil) = run_with(
        &scenario,
        &Nodes::new(&NodeKind::Pil, &[]).expect("one each"),
    );
    assert_eq!(pil.differing_bits, 0, "{:?}", pil.first_difference);
    for (board, rows) in pil.boards.iter().zip(&recording.links) {
        assert_eq!(board.late_frames, 0, "{}", board.node);
        let counted = &rows.last().expect("an answer of every board").v;
        // Eight frames a cycle, minus the broken ones.
        let broken = counted.truncated + counted.short + counted.crc;
        assert!(
            counted.frames > 1_000 && broken > 3,
            "{}: {} sound, {broken} broken",
            board.node,
            counted.frames
        );
    }
}

/// Joint 2 is disarmed and shut from `from_s` on, every other axis is held, and this lasts.
fn assert_all_stopped(recording: &Recording, from_s: f64) {
    for (joint, rows) in recording.joints.iter().enumerate() {
        let rest = window(rows, from_s, f64::INFINITY);
        assert!(rest.len() > 200);
        for row in rest {
            assert!(
                !energised(&row.v),
                "joint {} at {:.3} s",
                joint + 1,
                row.t_s()
            );
            assert_eq!(
                row.v.valves_open,
                0,
                "joint {} at {:.3} s",
                joint + 1,
                row.t_s()
            );
            // Held, or restarted and not armed again.
            let held = row.v.mode == HOLD || joint == 1 && row.v.mode <= 1;
            assert!(held, "joint {} in mode {}", joint + 1, row.v.mode);
        }
        let (low, high) = range(rest, |s| s.position_mm);
        assert!(
            high - low < 20.0,
            "joint {} moves {low} … {high} mm",
            joint + 1
        );
        // The board senses the truth, to the noise.
        for row in rest.iter().skip(100) {
            let error = row.v.sensed_mm - row.v.position_mm;
            assert!(error.abs() < 2.0, "joint {}: {error} mm", joint + 1);
        }
    }
}

/// Required effects of a reset of joint 2 at `t`, with its outputs off `commanded` seconds later: valves
/// shut, one reset, all axes stopped. Returns the time until the valves are shut.
fn assert_shut_after_one_reset(
    what: &str,
    recording: &Recording,
    pil: &PilSummary,
    t: f64,
    commanded: f64,
) -> f64 {
    let physical = last(&recording.joints[1], t, |s| s.valves_open != 0);
    assert!(
        physical <= commanded + closing_s(1) + TICK_S,
        "{physical} s"
    );
    assert_eq!(pil.boards[0].resets, 1);
    // Down to the times in the record of the fault, for which the master asks.
    assert_eq!(pil.differing_bits, 0, "{:?}", pil.first_difference);
    assert_all_stopped(recording, t + 0.2);
    println!(
        "{what}: outputs off after {:.1} ms, valves shut after {:.1} ms",
        commanded * 1e3,
        physical * 1e3
    );
    physical
}

#[test]
fn a_stopped_program_is_reset_by_its_watchdog_with_the_outputs_off() {
    let (sound, _) = run_with(&gait(LegChoice::Left, 2.5, &[]), &one("joint2=pil"));
    let t = busy(&sound.joints[1]);
    let scenario = gait_with(&format!("node-hang:joint2@{t:.3}s"), t + 1.0);
    let (recording, pil) = run_with(&scenario, &one("joint2=pil"));
    let rows = &recording.joints[1];
    // The hardware keeps its last outputs.
    let hung = window(rows, t + 2.0 * TICK_S, t + 0.040);
    let told = |row: &Row<JointSample>| {
        [
            row.v.fill_a_us,
            row.v.vent_a_us,
            row.v.fill_b_us,
            row.v.vent_b_us,
        ]
    };
    let outputs: BTreeSet<[u16; 4]> = hung.iter().map(told).collect();
    assert_eq!(outputs.len(), 1, "{outputs:?}");
    let commanded = last(rows, t, energised);
    assert!(
        (WATCHDOG_S[0]..WATCHDOG_S[1] + TICK_S).contains(&commanded),
        "off after {commanded} s"
    );
    let physical = assert_shut_after_one_reset("program stops", &recording, &pil, t, commanded);
    assert!(physical > commanded, "{physical} s");
}

#[test]
fn a_brown_out_in_mid_move_turns_the_outputs_off_and_the_board_comes_back_disarmed() {
    let (sound, _) = run_with(&gait(LegChoice::Left, 2.5, &[]), &one("joint2=pil"));
    let t = busy(&sound.joints[1]);
    let scenario = gait_with(&format!("brown-out:joint2=30@{t:.3}s"), t + 1.0);
    let (recording, pil) = run_with(&scenario, &one("joint2=pil"));
    let rows = &recording.joints[1];
    let commanded = last(rows, t, energised);
    // The fault begins within the tick of its instant; the next one has none.
    assert!(commanded <= 2.0 * TICK_S, "off after {commanded} s");
    assert_shut_after_one_reset("supply fails", &recording, &pil, t, commanded);
}

#[test]
fn a_wheel_that_lost_its_supply_counts_from_zero_again_as_its_hardware_does() {
    // While the wheels push: at a standstill any zero would do.
    let (sound, _) = run_with(&gait(LegChoice::Left, 4.0, &[]), &one("wheel8=pil"));
    let pushes = |row: &&Row<WheelSample>| row.v.velocity_mm_s > 30.0;
    let push = sound.wheels[1].iter().find(pushes).expect("a push");
    let (t, off_s) = (push.t_s() + 0.1, 0.030);
    let scenario = gait_with(&format!("brown-out:wheel8=30@{t:.3}s"), t + 1.0);
    let (recording, pil) = run_with(&scenario, &one("wheel8=pil"));
    assert_eq!(pil.boards[0].resets, 1);
    assert_eq!(pil.differing_bits, 0, "{:?}", pil.first_difference);
    let rows = &recording.wheels[1];
    let before = window(rows, t - 0.1, t);
    let (slowest, fastest) = range(before, |s| s.velocity_mm_s);
    assert!(slowest > 20.0, "{slowest} … {fastest} mm/s");
    let count = before.last().expect("a sample").v.count;
    // From zero on, with a wheel that runs out: it would need twice the time that it is
    // looked at to come to half of the count that it had.
    let after = window(rows, t + off_s + 0.005, t + off_s + 0.020);
    let read: Vec<_> = after.iter().map(|row| row.v.count).collect();
    assert!(read.len() > 10 && count > 600, "{count}, {read:?}");
    assert!(
        read.iter().all(|now| (0..count / 2).contains(now)),
        "{count}, {read:?}"
    );
    assert!(read.is_sorted() && read.last() > read.first(), "{read:?}");
    // It may hold already: the master has commanded all axes to.
    let drives = [NodeMode::Armed.code(), NodeMode::Tracking.code()];
    let modes = after.iter().map(|row| row.v.mode);
    assert!(modes.clone().all(|m| !drives.contains(&m)), "armed again");
}

/// Two seconds of the gait.
fn short_gait(folder: &Path) -> PathBuf {
    let path = folder.join("gait.toml");
    let text = r#"
name = "gait"
description = "Two seconds of the paper's gait"
robot = "wheeleg-2003"
duration = { value = 2.0, unit = "s" }
seed = 1
targets = "none"

[motion]
kind = "square-wave"
leg = "left"
"#;
    std::fs::write(&path, text).expect("written");
    path
}

#[test]
fn a_native_run_is_that_of_boards_that_were_down_to_the_last_bit_of_the_log() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let scenario = short_gait(folder.path());
    let faults = [
        ["node-hang:joint2@0.8s", "brown-out:wheel8=30@1.2s"],
        ["brown-out:joint2=30@0.8s", "node-hang:wheel8@1.2s"],
        ["node-reset:joint2@0.8s", "node-off:wheel8@1.2s..1.3s"],
        ["processor-fault:joint2@0.8s", "processor-fault:wheel8@1.2s"],
    ];
    for pair in faults {
        let out = folder.path().join(pair[0].replace([':', '@', '='], "-"));
        let mut wheeleg = Command::new(program::path());
        wheeleg
            .arg("run")
            .arg(&scenario)
            .args(["--node", "joint2=pil", "--node", "wheel8=pil"])
            .args(["--compare-sil", "--json", "--out"])
            .arg(&out);
        for fault in pair {
            wheeleg.args(["--fault", fault]);
        }
        let ran = wheeleg.output().expect("runs");
        let said = String::from_utf8_lossy(&ran.stderr);
        assert!(ran.status.success(), "{pair:?}: {said}");
        let summary: serde_json::Value = serde_json::from_slice(&ran.stdout).expect("a summary");
        // Each of them was down once, and the comparison did not remove that.
        for board in summary["pil"]["boards"].as_array().expect("boards") {
            assert_eq!(board["resets"], 1, "{pair:?}: {board}");
        }
        assert_eq!(summary["pil"]["differing_bits"], 0, "{pair:?}");
        let log = |folder: &Path| std::fs::read(folder.join("log.mcap")).expect("a log");
        assert!(log(&out) == log(&out.join("sil")), "{pair:?}");
    }
}

/// A board that saves its parameters (firmware/board/src/bin/probe_store.rs).
struct Saver {
    board: Board,
    now_ns: u64,
}

/// Which set the program found when it started.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Set {
    Old,
    New,
    Neither,
}

impl Saver {
    fn new() -> Self {
        let folder = std::env::var_os("WHEELEG_PROBES").expect("run `cargo xtask pil`");
        let mut board = Board::new(PathBuf::from(folder).join("probe_store.elf"));
        board.ran(&power_up(1));
        Self { board, now_ns: 0 }
    }

    fn run(&mut self, ms: u64, power: Power) -> Ran {
        self.now_ns += ms * 1_000_000;
        let run = Run {
            until_ns: self.now_ns,
            power,
            byte_ns: 10_000,
            ..Run::default()
        };
        self.board.ran(&Request::Run(run))
    }

    /// Switches the supply off and on; returns the set found then.
    fn restart(&mut self) -> Set {
        self.run(5, Power::BrownOut);
        // The supply comes back at the end of a run.
        self.run(1, Power::Good);
        // Long enough for the clock to start and the pages to be read, too short for
        // the next save to begin.
        let outputs = self.run(60, Power::Good).outputs;
        match (outputs.bridge_backward, outputs.dump) {
            (true, false) => Set::Old,
            (false, true) => Set::New,
            _ => Set::Neither,
        }
    }
}

#[test]
fn a_power_cut_in_mid_save_leaves_the_old_parameters_or_the_new_ones_never_a_mixture() {
    // An erased page, the head, 40 records, the word with the checksum.
    const UNITS: u16 = 43;
    let mut found = Vec::new();
    for after in 0..=UNITS {
        let mut saver = Saver::new();
        saver.run(300, Power::Good);
        assert_eq!(
            saver.restart(),
            Set::Old,
            "the blank store took the old set"
        );
        let resets = saver.run(1, Power::Good).figures.resets;
        let hook = Hook::BrownOutInSave { after };
        assert_eq!(saver.board.ask(&Request::Hook(hook)), Reply::Done);
        // The new set is saved, and the supply fails in it.
        let cut = saver.run(300, Power::Good);
        let was_cut = cut.figures.resets > resets;
        assert_eq!(was_cut, after < UNITS, "after {after} units");
        found.push(saver.restart());
    }
    println!("found after a cut in each of the {UNITS} units: {found:?}");
    assert!(!found.contains(&Set::Neither), "{found:?}");
    // The word with the checksum decides, and nothing before it.
    let first_new = found.iter().position(|set| *set == Set::New);
    assert_eq!(first_new, Some(usize::from(UNITS)), "{found:?}");
}
