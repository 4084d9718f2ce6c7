//! Digest of the sources of `firmware/control`: the root of all randomness that judges its laws.

use std::env;
use std::path::PathBuf;

use wheeleg_identity::sources;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?).join("../..");
    Ok(sources::emit_of(&root, &["firmware/control"], "control")?)
}
