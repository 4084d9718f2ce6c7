//! Computes a digest of the sources that the rows of a campaign depend on. It tells the parts of two
//! different programs apart.

use std::env;
use std::path::PathBuf;

use wheeleg_identity::sources;

/// Everything this crate is built from.
const NAMES: [&str; 21] = [
    "Cargo.toml",
    "Cargo.lock",
    "protocol",
    "protocol/remote-link",
    "firmware/identity",
    "firmware/units",
    "firmware/control",
    "firmware/kinematics",
    "firmware/node",
    "firmware/master",
    "host-sim/access",
    "host-sim/config",
    "host-sim/interface",
    "host-sim/plant",
    "host-sim/remote",
    "host-sim/report",
    "host-sim/sim",
    "host-sim/studies",
    "host-sim/scene",
    "host-sim/telemetry",
    "host-sim/campaign",
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?).join("../..");
    Ok(sources::emit_of(&root, &NAMES, "sources")?)
}
