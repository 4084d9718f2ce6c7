//! What goes into a run, as the head of its record.

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
        recorder.provenance("terrain", part.as_str());
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
