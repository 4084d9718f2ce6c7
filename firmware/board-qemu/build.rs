//! Gives the images their own linker script, see `mps2-an386.ld`.

fn main() {
    println!("cargo:rerun-if-changed=mps2-an386.ld");
    let bare_metal = std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none");
    if bare_metal {
        let here = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_default();
        println!("cargo:rustc-link-arg-bins=-T{here}/mps2-an386.ld");
        println!("cargo:rustc-link-arg-bins=--nmagic");
    }
}
