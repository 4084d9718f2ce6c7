//! The images of the boards: built by the rustup target, or by Debian's compiler
//! with `core` from source, and laid down in `target/firmware`.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};

use crate::no_std::{Way, cargo_for, way};
use crate::process::{command, run, target_dir};
use crate::report::{Report, StepError, StepResult};
use crate::sizes::elf::Elf;

/// The part on the boards.
pub(crate) const TARGET: &str = "thumbv7em-none-eabi";
const PACKAGE: &str = "wheeleg-board";

/// Images by the feature that they are built with.
const IMAGES: [(&str, &[&str]); 2] = [
    ("outputs", &["joint", "wheel"]),
    ("hil", &["joint-hil", "wheel-hil"]),
];

/// The profile of an image, by its name: only a joint board is short of flash.
pub(crate) fn profile(image: &str) -> &'static str {
    if image.contains("joint") {
        "firmware-joint"
    } else {
        "firmware"
    }
}

/// Images that drive outputs: the ones with budgets.
pub(crate) const SHIPPED: [&str; 2] = ["joint", "wheel"];

/// Images with deliberate bugs that the tests on emulated boards must find: the feature, the bug, and the
/// images that show it.
const MUTANTS: [(&str, &str, &[&str]); 5] = [
    (
        "mutant-valve-pins",
        "fill A and vent A are swapped",
        &["joint"],
    ),
    (
        "mutant-pwm-polarity",
        "outputs are on when they should be off",
        &["joint", "wheel"],
    ),
    (
        "mutant-adc-scale",
        "the converter's sum is halved",
        &["joint"],
    ),
    (
        "mutant-encoder",
        "the encoder counts the wrong way",
        &["wheel"],
    ),
    (
        "mutant-driver-limit",
        "the bus driver stays on beyond its limit",
        &["joint"],
    ),
];
/// The mark that such an image carries (firmware/board/src/g431/mutant.rs).
const MUTANT_MARK: &str = "THIS_IMAGE_IS_WRONG_ON_PURPOSE";

/// Code that saves parameters, for power cuts in mid-save, and code that copies and clears memory.
const PROBES: [&str; 2] = ["probe_store", "probe_memory"];

/// Undefined symbol that a reachable panic leaves for the linker to report.
const PANIC_SYMBOL: &str = "this_image_can_panic";

/// Images for a bench board, each with the shipped one of the same kind.
const BENCH: [(&str, &str); 2] = [("joint-hil", "joint"), ("wheel-hil", "wheel")];

/// The compiler's message if both `outputs` and `hil` are on (firmware/board/src/g431/mod.rs).
const EXCLUSION: &str =
    "a hardware-in-the-loop image must not contain the code that drives outputs";

/// Registers that a bench image must not use: their addresses, and the shipped images that use them.
const DRIVERS: [(&str, Range<u32>, &[&str]); 5] = [
    (
        "TIM1 (valves)",
        0x4001_2C00..0x4001_3000,
        &["joint", "wheel"],
    ),
    ("TIM8 (motor)", 0x4001_3400..0x4001_3800, &["wheel"]),
    (
        "TIM15 (bus driver)",
        0x4001_4000..0x4001_4400,
        &["joint", "wheel"],
    ),
    (
        "USART1 (bus)",
        0x4001_3800..0x4001_3C00,
        &["joint", "wheel"],
    ),
    ("DMA1 (bus)", 0x4002_0000..0x4002_0400, &["joint", "wheel"]),
];

/// One image.
pub(crate) struct Image {
    pub(crate) name: &'static str,
    pub(crate) elf: PathBuf,
    /// BLAKE3 of the flash contents.
    pub(crate) hash: String,
}

/// `cargo xtask firmware`.
pub(crate) fn steps(report: &mut Report) {
    report.step("firmware images", || build().map(drop));
    report.step("no panic is reachable in an image", link_check);
    report.step(
        "no fixed-point literal is parsed in an image",
        literal_check,
    );
    report.step(
        "images for a bench board cannot drive anything",
        exclusion_check,
    );
    report.step("lints of the board support", lint);
}

/// Builds all images and prints how.
pub(crate) fn build() -> StepResult<Vec<Image>> {
    build_into(way(TARGET)?, &target_dir().join("firmware"))
}

/// Builds all images in one of the ways and puts them into `folder`.
pub(crate) fn build_into(way: Way, folder: &Path) -> StepResult<Vec<Image>> {
    println!("    way: {}", way.text());
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let mut images = Vec::new();
    for (feature, names) in IMAGES {
        for name in names {
            run(&mut cargo(way, "build", feature, name)?)?;
            let elf = folder.join(format!("{name}.elf"));
            fs::copy(product(way, name), &elf)
                .with_context(|| format!("cannot copy the image {name}"))?;
            let contents = Elf::read(&elf)?;
            if contents.has_symbol(MUTANT_MARK) {
                return Err(anyhow::anyhow!("{name} is wrong on purpose").into());
            }
            let hash = contents.flash_hash();
            println!(
                "    {:<10} {:>6} bytes in flash  blake3 {}  {}",
                name,
                contents.flash_bytes(),
                hash.get(..16).unwrap_or(&hash),
                elf.display()
            );
            images.push(Image { name, elf, hash });
        }
    }
    Ok(images)
}

/// Builds the programs that exercise one driver on an emulated board.
pub(crate) fn probes(way: Way, folder: &Path) -> StepResult {
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    for probe in PROBES {
        run(&mut cargo(way, "build", "probe", probe)?)?;
        fs::copy(product(way, probe), folder.join(format!("{probe}.elf")))
            .with_context(|| format!("cannot copy the image {probe}"))?;
    }
    Ok(())
}

/// Builds the images with deliberate bugs, those of a mutation into a folder: `<folder>/<feature>/joint.elf`.
/// Never beside the images for flashing.
pub(crate) fn mutants(way: Way, folder: &Path) -> StepResult {
    for (feature, what, images) in MUTANTS {
        let place = folder.join(feature);
        fs::create_dir_all(&place).with_context(|| format!("cannot make {}", place.display()))?;
        for name in images {
            run(&mut cargo(way, "build", feature, name)?)?;
            let elf = place.join(format!("{name}.elf"));
            fs::copy(product(way, name), &elf)
                .with_context(|| format!("cannot copy the image {name}"))?;
            let marked = Elf::read(&elf)?.has_symbol(MUTANT_MARK);
            if !marked {
                return Err(anyhow::anyhow!("{}: no mark of a mutant", elf.display()).into());
            }
        }
        println!("    {feature}: {what}");
    }
    Ok(())
}

/// Links each image with a panic handler that does not exist. A third program, with a deliberate panic, must
/// *not* link: otherwise the check proves nothing.
pub(crate) fn link_check() -> StepResult {
    let way = way(TARGET)?;
    for name in ["link_check_joint", "link_check_wheel"] {
        run(&mut cargo(way, "build", "outputs", name)?)?;
    }
    let mut command = cargo(way, "build", "planted", "planted_panic")?;
    Ok(must_not_link(&mut command)?)
}

fn must_not_link(command: &mut Command) -> anyhow::Result<()> {
    println!("    the planted panic must be found");
    must_not_build(command, &format!("undefined symbol: {PANIC_SYMBOL}"))
        .context("the link check does not find a planted panic")
}

/// Runs a build that must fail with these words.
fn must_not_build(command: &mut Command, words: &str) -> anyhow::Result<()> {
    let output = command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .output()
        .context("cannot start cargo")?;
    let text = String::from_utf8_lossy(&output.stderr);
    ensure!(
        !output.status.success() && text.contains(words),
        "a build that must fail ({words}) ended with {}:\n{text}",
        output.status
    );
    Ok(())
}

/// Checks that no image for a bench board can be built together with the code that drives outputs, and that
/// none holds the address of a register that does. The shipped images must hold them, or the search would
/// prove nothing.
fn exclusion_check() -> StepResult {
    let way = way(TARGET)?;
    println!("    both of the features must be refused");
    for (bench, shipped) in BENCH {
        for image in [bench, shipped] {
            must_not_build(&mut cargo(way, "build", "outputs,hil", image)?, EXCLUSION)?;
        }
    }
    Ok(no_drivers(&build()?)?)
}

/// The second half of [`exclusion_check`].
fn no_drivers(images: &[Image]) -> anyhow::Result<()> {
    let constants = |name: &str| {
        let image = images.iter().find(|image| image.name == name);
        let elf = Elf::read(&image.with_context(|| format!("no image {name}"))?.elf)?;
        anyhow::Ok(elf.constants())
    };
    for (bench, shipped) in BENCH {
        let (in_bench, in_shipped) = (constants(bench)?, constants(shipped)?);
        for (what, registers, users) in DRIVERS {
            let found = |constants: &[u32]| constants.iter().any(|word| registers.contains(word));
            ensure!(!found(&in_bench), "{bench} holds an address of {what}");
            ensure!(
                !users.contains(&shipped) || found(&in_shipped),
                "the search does not find {what} in {shipped}, which uses it"
            );
        }
    }
    Ok(())
}

/// No image contains the parser of fixed-point literals; a program that does is
/// recognised.
pub(crate) fn literal_check() -> StepResult {
    for image in build()? {
        Elf::read(&image.elf)?
            .no_literal_parsing()
            .context(image.name)?;
    }
    let way = way(TARGET)?;
    const PLANTED: &str = "planted_literal";
    run(&mut cargo(way, "build", "planted", PLANTED)?)?;
    let planted = Elf::read(&product(way, PLANTED))?;
    match planted.no_literal_parsing() {
        Err(_) => Ok(()),
        Ok(()) => Err(anyhow::anyhow!("a planted run-time literal is not found").into()),
    }
}

/// The board support is not built on the host, so its lints are checked here.
fn lint() -> StepResult {
    let way = way(TARGET)?;
    if way == Way::DebianBuildStd {
        return Err(StepError::missing(
            format!("the Rust target {TARGET} for clippy"),
            format!("rustup target add {TARGET}"),
        ));
    }
    for (feature, names) in IMAGES {
        // In one profile: lints do not depend on it. The crates below are linted on
        // the host.
        let (first, rest) = names.split_first().context("a feature has images")?;
        let mut command = cargo(way, "clippy", feature, first)?;
        command.args(["--no-deps", "--lib"]);
        for name in rest {
            command.args(["--bin", name]);
        }
        run(command.args(["--", "-D", "warnings"]))?;
    }
    Ok(())
}

/// Where a compiled image lies.
fn product(way: Way, image: &str) -> PathBuf {
    folder(way).join(TARGET).join(profile(image)).join(image)
}

/// Own target folders: the flags differ from every other build's, and each
/// change of flags would rebuild everything in a shared folder.
fn folder(way: Way) -> PathBuf {
    target_dir().join(match way {
        Way::Rustup => "firmware-build",
        Way::DebianBuildStd => "firmware-build-debian",
    })
}

/// `cargo <sub>` for an image of only the board crate, so that no other crate's features affect it.
fn cargo(way: Way, sub: &str, features: &str, image: &str) -> StepResult<Command> {
    let mut command = cargo_for(way, sub);
    command
        .args(["--locked", "--package", PACKAGE, "--features", features])
        .args(["--profile", profile(image), "--target", TARGET])
        .args(["--bin", image])
        .env("CARGO_TARGET_DIR", folder(way))
        // Stack sizes go into a section that is not loaded; the flag is unstable, but does not affect the
        // code.
        .env("RUSTC_BOOTSTRAP", "1")
        .env("RUSTFLAGS", "-Zemit-stack-sizes");
    give_linker(way, &mut command)?;
    Ok(command)
}

/// Lets a build that links images find its linker.
pub(crate) fn give_linker(way: Way, command: &mut Command) -> StepResult {
    if way == Way::DebianBuildStd {
        let linker = linker_folder()?;
        let path = std::env::var_os("PATH").unwrap_or_default();
        let all = std::iter::once(linker).chain(std::env::split_paths(&path));
        let joined = std::env::join_paths(all).context("PATH with the linker's folder")?;
        command.env("PATH", joined);
    }
    Ok(())
}

/// A folder with the linker under the name by which Debian's compiler calls it.
fn linker_folder() -> StepResult<PathBuf> {
    let found = rustup_linker().or_else(|| {
        [
            "/usr/bin/ld.lld",
            "/usr/bin/ld.lld-19",
            "/usr/bin/ld.lld-14",
        ]
        .into_iter()
        .map(PathBuf::from)
        .find(|path| path.exists())
    });
    let Some(linker) = found else {
        return Err(StepError::missing("ld.lld", "apt-get install -y lld"));
    };
    let folder = target_dir().join("firmware-build-debian").join("linker");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let link = folder.join("rust-lld");
    let _ = fs::remove_file(&link);
    symlink(&linker, &link).with_context(|| format!("cannot link {}", link.display()))?;
    Ok(folder)
}

#[cfg(unix)]
fn symlink(original: &Path, link: &Path) -> std::io::Result<()> {
    std::os::unix::fs::symlink(original, link)
}

#[cfg(not(unix))]
fn symlink(original: &Path, link: &Path) -> std::io::Result<()> {
    fs::copy(original, link).map(drop)
}

/// rustup's own linker, if there is a rustup.
fn rustup_linker() -> Option<PathBuf> {
    let sysroot = crate::process::ask(command("rustc").args(["--print", "sysroot"]))?;
    let libraries = Path::new(&sysroot).join("lib/rustlib");
    let hosts = fs::read_dir(libraries).ok()?;
    hosts
        .flatten()
        .map(|host| host.path().join("bin/rust-lld"))
        .find(|path| path.exists())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process::root;

    /// Crates whose code runs in a tick: bare operators, which wrap silently on
    /// fixed-point numbers, are lint errors in each of them.
    const TICK_CRATES: [&str; 5] = [
        "firmware/units",
        "firmware/control",
        "firmware/node",
        "firmware/board",
        "protocol",
    ];

    #[test]
    fn bare_operators_are_errors_in_every_crate_of_the_tick() {
        for folder in TICK_CRATES {
            let source = fs::read_to_string(root().join(folder).join("src/lib.rs")).expect(folder);
            let from = source.find("deny(").expect(folder);
            let list = source[from..].split(")]").next().expect(folder);
            assert!(
                list.contains("clippy::arithmetic_side_effects"),
                "{folder}: {list}"
            );
        }
    }

    #[test]
    fn every_shipped_image_is_built_and_has_a_budget() {
        for name in SHIPPED {
            assert!(IMAGES.iter().any(|(_, names)| names.contains(&name)));
            assert!(root().join(format!("tests/budgets/{name}.toml")).exists());
        }
    }
}
