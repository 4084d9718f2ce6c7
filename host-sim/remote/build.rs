//! Digests of the firmware sources beside this program, which tell images of other sources from those of the
//! same. And the archive of interface definitions: the compiler would not notice a new file in it.

use std::env;
use std::path::PathBuf;

use wheeleg_identity::sources::{self, Images};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?).join("../..");
    sources::emit(&root, Images::G431, "sources-g431")?;
    sources::emit(&root, Images::Qemu, "sources-qemu")?;
    println!(
        "cargo:rerun-if-changed={}",
        root.join("protocol/interfaces").display()
    );
    Ok(())
}
