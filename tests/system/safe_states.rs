//! Safe states of the whole robot: loss of the master at many instants of the
//! gait, E-stop, and coming back from it. Checked on the commanded, sensed and
//! physical signals.

use crate::sil::{at, energised, gait, range, robot, run, story, window};
use wheeleg_config::{EventAction, LegChoice};
use wheeleg_master::command::{Command, CommandCode};
use wheeleg_master::dispatcher::Refusal;
use wheeleg_master::event::Event as MasterEvent;
use wheeleg_telemetry::{Cause, JointSample, Recording, Row};
use wheeleg_tests::{STEP, mix};

/// Valves commanded shut and wheel ramps begun within this, s.
const REACTION_S: f64 = 0.060;
/// Wheels stopped, and a staged exhaust not before this, s.
const STAGE_S: f64 = 0.500;
/// A rim slower than this is at rest, mm/s.
const STANDING_MM_S: f64 = 5.0;
const TICK_S: f64 = 1e-3;

const IDLE: u8 = 1;
const ARMED: u8 = 2;
const HOLD: u8 = 4;
const EXHAUST: u8 = 5;

/// Outlets of both chambers, in the bits of the log.
const VENTS: u8 = 0b1010;

/// Instant `k` of `n` spread over the three steps, at random within its part (the
/// same every time: a hash of the number).
fn spread(k: u64, n: u64) -> f64 {
    let random = mix(k.wrapping_add(1).wrapping_mul(STEP));
    let share = (random >> 40) as f64 / (1_u64 << 24) as f64;
    // On the grid of the samples.
    ((0.1 + (k as f64 + share) * 9.8 / n as f64) * 1e3).round() * 1e-3
}

/// Whether the stepping foot is in the air at `t_s` by the clock of the gait;
/// `None` too close to a change for the last SYNC to be known.
fn airborne(t_s: f64) -> Option<bool> {
    let gait = robot().gait;
    // The gait's clock starts with the first master cycles after scenario time 0.
    let start_s = 0.02;
    let u = (t_s - start_s).rem_euclid(gait.period_s);
    let clear = |edge: f64| (u - edge).abs() > 0.03 && (u - edge - gait.period_s).abs() > 0.03;
    (clear(gait.lift_s) && clear(gait.lower_s)).then_some(u > gait.lift_s && u < gait.lower_s)
}

/// Last sample in which `open` holds; the time from `from_s` to the end of its tick.
fn last(
    rows: &[Row<JointSample>],
    from_s: f64,
    open: impl Fn(&JointSample) -> bool,
) -> Option<f64> {
    let row = rows.iter().rfind(|r| open(&r.v))?;
    Some(row.t_s() + TICK_S - from_s)
}

/// All valves of all joints commanded shut in time, physically shut when their
/// closing time is over, and not before; then shut until the stage is over.
fn assert_shut(recording: &Recording, t: f64, reaction_s: f64) -> u32 {
    let robot = robot();
    let mut closings = 0;
    for (joint, rows) in recording.joints.iter().enumerate() {
        let valves = &robot.plant.cylinders[joint];
        let name = joint + 1;
        // From the end of the coil current to the end of the flow: the valve closes, and its effect has to
        // travel through the line.
        let t_off = valves.fill_valve.t_off_s.max(valves.vent_valve.t_off_s) + valves.line_delay_s;
        let held = window(rows, t, t + STAGE_S);
        let commanded = last(held, t, energised);
        let physical = last(held, t, |s| s.valves_open != 0);
        let commanded_s = commanded.unwrap_or(0.0);
        assert!(
            commanded_s <= reaction_s,
            "master lost at {t} s: joint {name} commanded until {commanded_s} s"
        );
        let physical_s = physical.unwrap_or(0.0);
        assert!(
            physical_s <= reaction_s + t_off + TICK_S,
            "master lost at {t} s: joint {name} open until {physical_s} s"
        );
        if let (Some(commanded), Some(physical)) = (commanded, physical)
            // Otherwise the last pulse was cut before the valve opened.
            && physical > commanded
        {
            // Later by the expected delay: not at once, and the coil is off within its tick.
            let takes = physical - commanded;
            assert!(
                (t_off - TICK_S..t_off + TICK_S).contains(&takes),
                "joint {name}: coil off at {commanded} s, shut at {physical} s"
            );
            closings += 1;
        }
    }
    closings
}

/// Wheels: the drive ramps down from the reaction time on and never up again,
/// and the rim stands when the stage is over.
fn assert_wheels_stop(recording: &Recording, t: f64, reaction_s: f64) -> bool {
    let mut moved = false;
    for (wheel, rows) in recording.wheels.iter().enumerate() {
        let name = wheel + 7;
        let before = at(rows, t).velocity_mm_s.abs();
        let ramp = window(rows, t + reaction_s, t + 2.0);
        assert!(
            ramp.iter().all(|r| r.v.mode == HOLD),
            "wheel {name} at {t} s"
        );
        for pair in ramp.windows(2) {
            assert!(
                pair[1].v.drive.abs() <= pair[0].v.drive.abs(),
                "wheel {name}, lost at {t} s: the drive rises at {:.3} s",
                pair[1].t_s()
            );
        }
        let (low, high) = range(window(rows, t + STAGE_S, t + 2.0), |s| s.velocity_mm_s);
        assert!(
            low > -STANDING_MM_S && high < STANDING_MM_S,
            "wheel {name}, lost at {t} s: {low} … {high} mm/s"
        );
        assert!(range(window(rows, t + STAGE_S, t + 2.0), |s| s.drive.abs()).1 <= 0.0);
        // The ramp starts from the mean drive: no single sample of it speeds a wheel up.
        let (low, high) = range(window(rows, t, t + 2.0), |s| s.velocity_mm_s);
        assert!(
            low > -10.0 && high < before + 10.0,
            "wheel {name}, lost at {t} s at {before} mm/s: {low} … {high} mm/s"
        );
        if before > 100.0 {
            moved = true;
            // Begun: slower soon after. A ramp: not stopped at once.
            let soon = at(rows, t + 0.2).velocity_mm_s;
            assert!(
                soon < 0.95 * before,
                "wheel {name}: {before} then {soon} mm/s"
            );
            assert!(
                soon > 0.2 * before,
                "wheel {name}: {before} then {soon} mm/s"
            );
        }
    }
    moved
}

fn assert_latched(recording: &Recording, from_s: f64, safe: &[u8]) {
    for (joint, rows) in recording.joints.iter().enumerate() {
        for row in window(rows, from_s, f64::INFINITY) {
            assert!(
                safe.contains(&row.v.mode) && row.v.faults != 0,
                "joint {}",
                joint + 1
            );
        }
    }
    for rows in &recording.wheels {
        for row in window(rows, from_s, f64::INFINITY) {
            assert!(row.v.mode == HOLD && row.v.faults != 0);
        }
    }
}

#[test]
fn losing_the_master_at_any_instant_is_safe() {
    let robot = robot();
    let (mut flights, mut stances, mut rolling, mut closings) = (0, 0, 0, 0);
    for t in (0..12).map(|k| spread(k, 12)) {
        let scenario = gait(LegChoice::Left, t + 2.0, &[(t, EventAction::KillMaster)]);
        let recording = run(&scenario, &robot, 1);
        closings += assert_shut(&recording, t, REACTION_S);
        rolling += u32::from(assert_wheels_stop(&recording, t, REACTION_S));
        assert_latched(&recording, t + REACTION_S, &[HOLD, EXHAUST]);
        // Before the loss nothing of this was true.
        assert!(
            recording
                .joints
                .iter()
                .all(|rows| at(rows, t).mode == 3 && at(rows, t).faults == 0)
        );

        // The staged exhaust: of the cylinders that swing the foot, while it is in the air.
        let Some(flying) = airborne(t) else { continue };
        let sent = at(&recording.master, t - 0.005).link_loss_action;
        assert_eq!(sent != 0, flying, "at {t} s the master sent action {sent}");
        if flying {
            flights += 1;
        } else {
            stances += 1;
        }
        for (joint, rows) in recording.joints.iter().enumerate() {
            let name = joint + 1;
            let stage = window(rows, t + 0.1, f64::INFINITY);
            let first = stage.iter().find(|r| r.v.valves_open != 0);
            let exhausts = flying && (joint == 1 || joint == 2);
            let Some(first) = first else {
                assert!(!exhausts, "lost at {t} s: joint {name} does not exhaust");
                assert!(stage.iter().all(|r| r.v.mode == HOLD), "joint {name}");
                continue;
            };
            assert!(exhausts, "lost at {t} s: joint {name} exhausts");
            let after = first.t_s() - t;
            assert!(
                (STAGE_S..STAGE_S + 0.1).contains(&after),
                "joint {name}: {after} s"
            );
            for row in stage {
                assert_eq!(
                    row.v.valves_open & !VENTS,
                    0,
                    "joint {name}: an inlet opens"
                );
                assert_eq!([row.v.fill_a_us, row.v.fill_b_us], [0, 0], "joint {name}");
            }
            // At limited speed, but to the end: the chambers empty.
            let (first, end) = (&stage[0].v, &rows[rows.len() - 1].v);
            for (from, to) in [
                (first.pressure_a_bar, end.pressure_a_bar),
                (first.pressure_b_bar, end.pressure_b_bar),
            ] {
                assert!(to < from.max(1.2), "joint {name}: {from} to {to} bar");
            }
            let (slow, fast) = range(stage, |s| s.velocity_mm_s);
            assert!(
                slow > -250.0 && fast < 250.0,
                "joint {name}: {slow} … {fast} mm/s"
            );
        }
    }
    // The instants reach their intended phases.
    assert!(
        flights >= 2 && stances >= 5,
        "{flights} flights, {stances} stances"
    );
    assert!(rolling >= 2, "{rolling} with turning wheels");
    assert!(closings >= 6, "{closings} valves caught open");
}

/// A hundred instants over the whole walk, at random (the same every time): every axis
/// is in its safe state in time, and stays there although the master comes back.
#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn losing_the_master_at_a_hundred_instants_is_latched_in_time() {
    let robot = robot();
    let instants: Vec<f64> = (0..100).map(|k| spread(k, 100)).collect();
    let half = instants.len() / 2;
    let moving = std::thread::scope(|threads| {
        let work = |part: &'static str, instants: Vec<f64>| {
            let robot = &robot;
            threads.spawn(move || instants.iter().map(|t| lose_master(robot, *t, part)).sum())
        };
        let first = work("first", instants[..half].to_vec());
        let second: std::thread::ScopedJoinHandle<'_, u32> =
            work("second", instants[half..].to_vec());
        first.join().expect("first half") + second.join().expect("second half")
    });
    // At most instants some valve or wheel was driven, so that there was something to stop.
    assert!(moving >= 60, "something moves at {moving} instants");
}

/// Loses the master for 100 ms from `t` on; 1 if a valve was driven within 20 ms before.
fn lose_master(robot: &wheeleg_config::RobotConfig, t: f64, part: &str) -> u32 {
    let mut scenario = gait(LegChoice::Left, t + 0.25, &[]);
    let text = format!("master-silent@{t:.3}s..{:.3}s", t + 0.1);
    scenario.faults.push(text.parse().expect("a fault"));
    let recording = run(&scenario, robot, 1);
    for (joint, rows) in recording.joints.iter().enumerate() {
        let shut_s = last(window(rows, t, f64::INFINITY), t, energised).unwrap_or(0.0);
        assert!(
            shut_s <= REACTION_S,
            "{part} half, lost at {t} s: joint {} commanded until {shut_s} s",
            joint + 1
        );
    }
    assert_latched(&recording, t + REACTION_S, &[HOLD]);
    let before =
        |rows: &Vec<Row<JointSample>>| window(rows, t - 0.02, t).iter().any(|r| energised(&r.v));
    u32::from(recording.joints.iter().any(before))
}

/// E-stop in flight, in the push and at rest.
#[test]
fn e_stop_holds_everything_and_dumps_the_supply() {
    let robot = robot();
    // The bit goes out with the next SYNC.
    let reaction_s = robot.bus.cycle_s + 0.003;
    for t in [0.8, 2.5, 3.3, 6.05] {
        let scenario = gait(LegChoice::Left, t + 2.0, &[(t, EventAction::EStop)]);
        let recording = run(&scenario, &robot, 1);
        assert_shut(&recording, t, reaction_s);
        assert_wheels_stop(&recording, t, reaction_s);
        assert_latched(&recording, t + reaction_s, &[HOLD]);
        let dump = recording.supply.iter().find(|r| r.v.dump_open);
        let opens_s = dump.expect("the dump valve opens").t_s() - t;
        let t_on = robot.plant.supply.dump_valve.t_on_s;
        assert!(
            opens_s > t_on && opens_s <= t_on + reaction_s + TICK_S,
            "the dump valve opens after {opens_s} s"
        );
        let rest = window(&recording.supply, t + opens_s, f64::INFINITY);
        assert!(rest.iter().all(|r| r.v.dump_open));
        assert!(at(&recording.supply, t).pressure_bar > 6.5);
        assert!(
            at(&recording.supply, t + 1.5).pressure_bar < 1.1,
            "the supply is empty"
        );
        assert!(at(&recording.supply, t).pressure_switch);
        assert!(!at(&recording.supply, t + 1.0).pressure_switch);
        // The air in the chambers is trapped: no joint drops.
        for (joint, rows) in recording.joints.iter().enumerate() {
            assert!(
                last(window(rows, t + 0.1, f64::INFINITY), t, |s| s.valves_open
                    != 0)
                .is_none()
            );
            let (low, high) = range(window(rows, t + 0.1, f64::INFINITY), |s| s.position_mm);
            assert!(high - low < 12.0, "joint {}: {low} … {high} mm", joint + 1);
        }
    }
}

/// After an E-stop: clear, wait for the supply, arm. The axes resume from their positions.
#[test]
fn coming_back_from_an_e_stop_moves_nothing() {
    let robot = robot();
    for t in [0.8, 2.5, 6.05] {
        let (clear, arm) = (t + 1.0, t + 3.5);
        let events = [
            (t, EventAction::EStop),
            // Too early: the stop is latched.
            (t + 0.5, EventAction::Command(Command::Arm)),
            (clear, EventAction::ClearFault),
            (arm, EventAction::Command(Command::Arm)),
        ];
        let recording = run(&gait(LegChoice::Left, arm + 1.5, &events), &robot, 1);
        let told = story(&recording);
        for (joint, rows) in recording.joints.iter().enumerate() {
            let name = joint + 1;
            assert_eq!(
                at(rows, clear - TICK_S).mode,
                HOLD,
                "joint {name} latched\n{told}"
            );
            assert_eq!(
                at(rows, arm - TICK_S).faults,
                0,
                "joint {name} cleared\n{told}"
            );
            let armed = rows
                .iter()
                .position(|r| r.t_s() > arm && r.v.mode >= ARMED)
                .unwrap_or_else(|| panic!("joint {name} does not arm\n{told}"));
            assert!(rows[armed].t_s() < arm + REACTION_S, "joint {name}");
            assert!(
                rows[armed..].iter().all(|r| r.v.mode == ARMED),
                "joint {name}\n{told}"
            );
            // Reference := position.
            let now = &rows[armed].v;
            assert!(
                (now.reference_mm - now.sensed_mm).abs() < 0.2,
                "joint {name}: {} against {} mm",
                now.reference_mm,
                now.sensed_mm
            );
            let after = &rows[armed..];
            let (low, high) = range(after, |s| s.reference_mm);
            assert!(
                high - low < 0.2,
                "joint {name}: the reference wanders {low} … {high} mm"
            );
            let (back, forth) = range(after, |s| s.velocity_mm_s);
            assert!(
                back > -20.0 && forth < 20.0,
                "joint {name}: {back} … {forth} mm/s"
            );
            let (low, high) = range(after, |s| s.position_mm);
            assert!(high - low < 2.0, "joint {name} jumps: {low} … {high} mm");
        }
        for rows in &recording.wheels {
            let after = window(rows, arm, f64::INFINITY);
            assert_eq!(rows[rows.len() - 1].v.mode, ARMED);
            let (back, forth) = range(after, |s| s.velocity_mm_s);
            assert!(
                back > -STANDING_MM_S && forth < STANDING_MM_S,
                "{back} … {forth} mm/s"
            );
        }
        let end = &recording.supply[recording.supply.len() - 1].v;
        assert!(!end.dump_open && end.pressure_switch && end.pressure_bar > 6.5);
    }
}

/// Arming before the supply is back must not be possible.
#[test]
fn without_supply_pressure_the_robot_does_not_arm() {
    let t = 2.5;
    let events = [
        (t, EventAction::EStop),
        (t + 1.2, EventAction::ClearFault),
        (t + 1.3, EventAction::Command(Command::Arm)),
    ];
    let recording = run(&gait(LegChoice::Left, t + 3.0, &events), &robot(), 1);
    assert!(!at(&recording.supply, t + 1.3).pressure_switch);
    let told = story(&recording);
    let refused = recording.events.iter().any(|e| match e.v.cause {
        Cause::Master(MasterEvent::Refused { ticket, reason }) => {
            (ticket.code, reason) == (CommandCode::Arm, Refusal::NoAir)
        }
        _ => false,
    });
    assert!(refused, "{told}");
    for rows in &recording.joints {
        assert!(last(window(rows, t + 0.1, f64::INFINITY), t, energised).is_none());
        // Cleared, and not armed for a single tick.
        let after = window(rows, t + 1.25, f64::INFINITY);
        assert!(after.iter().all(|r| r.v.mode == IDLE), "{told}");
    }
}
