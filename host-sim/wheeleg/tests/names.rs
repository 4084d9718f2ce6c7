//! Names that the host shares with the boards and the master.

use wheeleg_protocol::NodeMode;
use wheeleg_telemetry::{JointSample, Sample};

/// Log viewers see mode numbers; the channel's description explains them.
#[test]
fn description_of_the_mode_signal_is_that_of_the_protocol() {
    let field = JointSample::FIELDS.iter().find(|f| f.name == "mode");
    let doc = field.expect("declared").doc;
    for mode in [
        NodeMode::Boot,
        NodeMode::Idle,
        NodeMode::Armed,
        NodeMode::Tracking,
        NodeMode::Hold,
        NodeMode::Exhaust,
        NodeMode::Fault,
    ] {
        let entry = format!("{} {mode:?}", mode.code()).to_lowercase();
        assert!(doc.contains(&entry), "{entry} is not in: {doc}");
    }
}
