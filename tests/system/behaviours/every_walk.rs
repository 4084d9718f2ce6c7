//! Requirements of every built-in walk, with every behaviour on.

use wheeleg_config::{Motion, builtin};
use wheeleg_telemetry::{EventCode, Recording};

use super::metrics::codes;
use crate::sil;

/// Codes of a leg in the log.
const STANCE: u8 = 1;
const LIFT: u8 = 2;

/// Seconds of each walk.
const SUITE_S: f64 = 14.0;
/// Largest change in a cycle of the reference of a foot that stays on the ground, mm. b5 and yaw go with
/// the ground (150 mm/s and a turn, as the encoders tell it), and the lead of a pulling leg
/// changes by 0.5 mm.
const PLANE_MM: f64 = 3.0;
/// Cycles after which a board has brought the piston of a foot that lands to its stop.
const LANDED: usize = 10;
/// b6: 1 mm after lost ground, 0.3 mm by the nose, 0.15 mm by the share of the load.
const HEIGHT_MM: f64 = 1.5;

/// Largest change in a cycle of the references of yaw, b5 and b6 of feet that stand, mm, and when it
/// was; a foot that begins to rise counts for yaw and b5. As SYNC carries them, half a cycle on.
fn steps(recording: &Recording) -> [(f64, f64); 3] {
    let mut most = [(0.0, 0.0); 3];
    for (leg, codes) in codes(recording).into_iter().enumerate() {
        for (cylinder, most) in most.iter_mut().enumerate() {
            let rows = &recording.joints[3 * leg + cylinder];
            let end = rows.last().map_or(0.0, wheeleg_telemetry::Row::t_s);
            for cycles in codes.windows(LANDED + 2) {
                let [.., (t, _), (next_t, next)] = cycles else {
                    unreachable!("windows are as long as they are")
                };
                let (t, next_t) = (*t, *next_t);
                let stood = cycles.iter().rev().skip(1).all(|(_, code)| *code == STANCE);
                let stays = stood && (*next == STANCE || cylinder != 2 && *next == LIFT);
                if !stays || next_t + 0.006 > end {
                    continue;
                }
                let reference = |t: f64| sil::at(rows, t + 0.005).commanded_mm;
                let step = (reference(next_t) - reference(t)).abs();
                if step > most.0 {
                    *most = (step, t);
                }
            }
        }
    }
    most
}

#[test]
#[ignore = "long; `cargo xtask test` runs it"]
fn no_standing_foot_is_moved_by_a_step_and_no_switch_is_taken_for_broken_on_uneven_ground() {
    let mut told = Vec::new();
    for (name, ..) in builtin::SCENARIOS {
        let mut scenario = builtin::scenario(name).expect("built in");
        if !matches!(scenario.motion, Motion::Walk(_)) {
            continue;
        }
        scenario.duration_s = scenario.duration_s.min(SUITE_S);
        let robot = builtin::robot(&scenario.robot).expect("built in");
        let recording = sil::run(&scenario, &robot, 1);
        let most = steps(&recording);
        let [yaw, b5, b6] = most.map(|(mm, _)| mm);
        println!("{name}: steps of yaw {yaw:.2}, b5 {b5:.2}, b6 {b6:.2} mm");
        let broken = recording.events.iter();
        let broken = broken
            .filter(|e| e.v.cause.code() == EventCode::FootSwitch)
            .count();
        if yaw > PLANE_MM || b5 > PLANE_MM || b6 > HEIGHT_MM || broken > 0 {
            told.push(format!(
                "{name}: {most:.2?}, {broken} switches told\n{}",
                sil::story(&recording)
            ));
        }
    }
    assert!(told.is_empty(), "{}", told.join("\n"));
}
