//! A robot that does not get ready is reported by the fields of its file that decide it.

use miette::Diagnostic as _;
use wheeleg_config::{RobotConfig, builtin};
use wheeleg_sim::SimError;
use wheeleg_studies::StudyError;
use wheeleg_studies::run::run_read;
use wheeleg_studies::study::Settings;

/// The error for a robot that should stand, and its help; empty if it stands.
fn told(robot: &RobotConfig) -> [String; 2] {
    let mut scenario = builtin::scenario("stand").expect("built in");
    scenario.duration_s = 0.1;
    let folder = tempfile::tempdir().expect("temporary folder");
    let failure = match run_read(
        &scenario,
        robot,
        1,
        &Settings::new(folder.path().join("out")),
    ) {
        Ok(finished) => finished.result.failure,
        Err(StudyError::Sim(error)) => Some(error),
        Err(other) => panic!("another error: {other}"),
    };
    failure.map_or_else(Default::default, |failure| {
        assert!(matches!(failure, SimError::NotReady { .. }), "{failure}");
        let help = failure.help().expect("a remedy").to_string();
        [failure.to_string(), help]
    })
}

/// The time that a robot may take to get ready has its rest in it.
#[test]
fn the_limit_of_the_start_up_is_kept() {
    let mut robot = builtin::robot("wheeleg").expect("built in");
    assert_eq!(told(&robot), ["", ""]);
    robot.start_up.limit_s = 2.0;
    let [said, help] = told(&robot);
    assert!(said.contains("did not get ready in 2.0"), "{said}");
    assert!(said.contains("settling in the start pose"), "{said}");
    for part in [
        "`start_up.limit` = 2.00 s",
        "`start_up.rest`, takes 1.00 s",
        &robot.file,
    ] {
        assert!(help.contains(part), "{part}: {help}");
    }
}

/// A pose in which its joint does not come to rest in time is reported by the field of the gait that asks for it.
#[test]
fn a_pose_that_does_not_settle_is_named_by_its_field() {
    for stroke_m in [0.005, 0.09] {
        let mut robot = builtin::robot("wheeleg").expect("built in");
        robot.gait.stroke_m = stroke_m;
        // The longest move takes longer.
        robot.homing.timeout_s = 0.4;
        let [said, help] = told(&robot);
        assert!(said.contains("did not get ready"), "{said}");
        let asked = format!("to `gait.stroke` = {:.1} mm", stroke_m * 1e3);
        for part in [
            "joint 3 goes from `start.vertical.stroke` = 180.0 mm",
            &asked,
        ] {
            assert!(help.contains(part), "{part}: {help}");
        }
    }
}
