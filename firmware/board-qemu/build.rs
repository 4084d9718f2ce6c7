//! Gives the images their own linker script, see `mps2-an386.ld`, and the digest of their sources.

use std::env;
use std::path::PathBuf;

use wheeleg_identity::sources::{self, Images};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo:rerun-if-changed=mps2-an386.ld");
    let bare_metal = env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none");
    if bare_metal {
        let here = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?);
        let script = here.join("mps2-an386.ld");
        println!("cargo:rustc-link-arg-bins=-T{}", script.display());
        println!("cargo:rustc-link-arg-bins=--nmagic");
        sources::emit(&here.join("../.."), Images::Qemu, "sources")?;
    }
    Ok(())
}
