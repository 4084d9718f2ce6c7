//! Gives the linker its script and the memory map in the workspace's root, and the images the digest of their
//! sources.

use std::path::PathBuf;
use std::{env, fs};

use wheeleg_identity::sources::{self, Images};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?).join("../..");
    let map = root.join("memory.x");
    println!("cargo:rerun-if-changed={}", map.display());
    if env::var("CARGO_CFG_TARGET_OS")? == "none" && env::var_os("CARGO_FEATURE_G431").is_some() {
        let out = PathBuf::from(env::var("OUT_DIR")?);
        fs::copy(&map, out.join("memory.x"))?;
        println!("cargo:rustc-link-search={}", out.display());
        println!("cargo:rustc-link-arg-bins=-Tlink.x");
        // No page alignment of sections: the image is written to flash, not loaded.
        println!("cargo:rustc-link-arg-bins=--nmagic");
        sources::emit(&root, Images::G431, "sources")?;
    }
    Ok(())
}
