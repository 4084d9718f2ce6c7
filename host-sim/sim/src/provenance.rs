//! The inputs of a run, as the head of its record.

use wheeleg_config::{RobotConfig, Scenario};
use wheeleg_telemetry::Recorder;

/// Records program, scenario, robot, seed and parameters as messages at time zero: part of the
/// log and of the hash, so without paths and wall-clock times.
pub fn provenance(recorder: &mut Recorder, scenario: &Scenario, robot: &RobotConfig, seed: u64) {
    recorder.provenance("program", concat!("wheeleg ", env!("CARGO_PKG_VERSION")));
    recorder.provenance("scenario", &scenario.name);
    recorder.provenance("robot", &robot.name);
    recorder.provenance("seed", seed.to_string());
    for fault in &scenario.faults {
        recorder.provenance("fault", fault.to_string());
    }
    for part in &scenario.ground.parts {
        recorder.wording("terrain", part.as_str());
    }
    if let Some(fingerprint) = scenario.ground.fingerprint() {
        recorder.provenance("terrain fingerprint", fingerprint);
    }
    for p in &robot.parameters {
        recorder.provenance(
            "parameter",
            format!("{} = {} {}", p.path, p.value_text(), p.unit),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::builtin;

    /// A scenario counts by its values, not by its wording; another height is another run.
    #[test]
    fn the_spelling_of_the_ground_is_no_part_of_the_hash() {
        let robot = builtin::robot(builtin::DEFAULT_ROBOT).expect("built in");
        let hash = |height: &str| {
            let text = format!(
                "name = \"t\"\ndescription = \"d\"\nrobot = \"wheeleg\"\nduration = \"1 s\"\nseed = 1\n\
                 targets = \"none\"\n[motion]\nkind = \"stand\"\n[[terrain]]\nkind = \"step\"\n\
                 at = \"1 m\"\nheight = \"{height}\"\n"
            );
            let scenario = Scenario::parse("my.toml", &text).expect("usable");
            let mut recorder = Recorder::in_memory();
            provenance(&mut recorder, &scenario, &robot, 1);
            recorder.hash()
        };
        assert_eq!(hash("0.057 m"), hash("57 mm"));
        assert_ne!(hash("0.057 m"), hash("58 mm"));
    }
}
