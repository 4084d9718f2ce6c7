//! The firmware images on emulated STM32G431 boards: emulator, images, the
//! tests, and the figures of the three-step run.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;
use serde_json::{Value, json};

use crate::firmware;
use crate::process::{cargo, command, output, run, target_dir};
use crate::report::{Report, StepError, StepResult};
use crate::tools::{apt_install, have, may_apt};

const PACKAGE: &str = "wheeleg-pil-unicorn";
/// What building the Unicorn engine takes, as Debian packages.
const PACKAGES: [&str; 3] = ["cmake", "pkg-config", "libclang-dev"];
/// Least speed of eight boards with the plant, times real time (on an idle
/// machine with 2 cores).
const SPEED_LEAST: f64 = 2.0;

/// Arguments of `cargo xtask pil`.
#[derive(Args, Debug, Default)]
pub(crate) struct Options {
    /// Only build emulator and images, so that `wheeleg run --nodes pil` finds them.
    #[arg(long)]
    build: bool,
    /// Print the figures as one line of JSON at the end.
    #[arg(long)]
    json: bool,
}

/// `cargo xtask pil`.
pub(crate) fn steps(report: &mut Report, options: &Options) {
    if report
        .step("set-up: build tools of the emulator", tools)
        .is_none()
    {
        return;
    }
    let Some(emulator) = report.step("emulated STM32G431", emulator) else {
        return;
    };
    let Some(images) = report.step("images for the emulated boards", images) else {
        return;
    };
    if options.build {
        return;
    }
    report.step("lints and tests of the emulator", || {
        let clippy = ["clippy", "--locked", "--all-targets", "--package", PACKAGE];
        run(cargo().args(clippy).args(["--", "-D", "warnings"]))?;
        run(cargo().args(["test", "--locked", "--package", PACKAGE]))?;
        Ok(())
    });
    report.step("emulated boards against the host, and faults", || {
        let test = ["test", "--locked", "--package", "wheeleg-tests"];
        run(cargo()
            .args(test)
            .args(["--features", "pil", "--test", "pil"])
            .env("WHEELEG_PIL", &emulator)
            .env("WHEELEG_IMAGES", &images))?;
        Ok(())
    });
    report.step("board support that is wrong on purpose is found", || {
        let mutants = firmware::mutants()?;
        let test = ["test", "--locked", "--package", "wheeleg-tests"];
        run(cargo()
            .args(test)
            .args(["--features", "pil", "--test", "pil_mutants"])
            .env("WHEELEG_PIL", &emulator)
            .env("WHEELEG_IMAGES", &images)
            .env("WHEELEG_MUTANTS", mutants))?;
        Ok(())
    });
    let figures = report.step("three steps on eight emulated boards", || {
        figures(&emulator, &images)
    });
    if options.json
        && let Some(figures) = figures
    {
        println!("{figures}");
    }
}

fn libclang() -> bool {
    let named = std::env::var_os("LIBCLANG_PATH").is_some();
    let below = |folder: &str| {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        entries
            .filter_map(|entry| entry.file_name().into_string().ok())
            .any(|name| name.starts_with("libclang") || name.starts_with("llvm-"))
    };
    named
        || ["/usr/lib", "/usr/lib64", "/usr/lib/x86_64-linux-gnu"]
            .into_iter()
            .any(below)
}

/// Finds the build tools or installs them.
fn tools() -> StepResult {
    let there = || have("cmake") && have("pkg-config") && libclang();
    if there() || (may_apt() && apt_install(&PACKAGES) && there()) {
        return Ok(());
    }
    Err(StepError::missing(
        "cmake, pkg-config or libclang, which the Unicorn engine is built with",
        format!("apt-get install -y {}", PACKAGES.join(" ")),
    ))
}

/// Builds the emulator.
fn emulator() -> StepResult<PathBuf> {
    run(cargo().args(["build", "--locked", "--release", "--package", PACKAGE]))?;
    let name = format!("{PACKAGE}{}", std::env::consts::EXE_SUFFIX);
    let path = target_dir().join("release").join(name);
    ensure_file(&path)?;
    Ok(path)
}

/// Builds the images; gives the folder in which they lie.
fn images() -> StepResult<PathBuf> {
    let images = firmware::build()?;
    let elf = images.first().map(|image| image.elf.clone());
    let folder = elf.as_deref().and_then(Path::parent).map(Path::to_path_buf);
    Ok(folder.context("no image was built")?)
}

fn ensure_file(path: &Path) -> anyhow::Result<()> {
    ensure!(path.is_file(), "no file {}", path.display());
    Ok(())
}

/// Runs the paper's test twice on eight emulated boards: no bit may differ from
/// the host, nor between the runs.
fn figures(emulator: &Path, images: &Path) -> StepResult<Value> {
    run(cargo().args(["build", "--locked", "--release", "--package", "wheeleg-sim"]))?;
    let wheeleg = target_dir().join("release").join("wheeleg");
    let folder = target_dir().join("pil-run");
    let once = |name: &str, compare: &[&str]| -> anyhow::Result<Value> {
        let json = output(
            command(&wheeleg)
                .args(["run", "three-step", "--nodes", "pil", "--json", "--out"])
                .arg(folder.join(name))
                .args(compare)
                .env("WHEELEG_PIL", emulator)
                .env("WHEELEG_IMAGES", images),
        )?;
        serde_json::from_str(&json).context("the summary of the run")
    };
    let first = once("first", &["--compare-sil"])?;
    let second = once("second", &[])?;
    let pil = &first["pil"];
    let most = |key: &str, image: &str| {
        let boards = pil["boards"].as_array().into_iter().flatten();
        let boards = boards.filter(|board| board["image"] == image);
        boards
            .filter_map(|board| board[key].as_u64())
            .max()
            .unwrap_or(0)
    };
    let mut figures = json!({
        "hash": first["hash"],
        "compared_bits": pil["compared_bits"],
        "differing_bits": pil["differing_bits"],
        "realtime_factor": first["realtime_factor"],
        "realtime_factor_least": SPEED_LEAST,
    });
    for image in ["joint", "wheel"] {
        for key in [
            "tick_instructions_median",
            "tick_instructions_worst",
            "longest_awake_instructions",
            "stack_used_bytes",
            "stack_size_bytes",
        ] {
            figures[image][key] = json!(most(key, image));
        }
    }
    println!("    {figures}");
    let equal = pil["differing_bits"] == 0 && pil["compared_bits"].as_u64() > Some(1_000_000);
    if !equal {
        return Err(anyhow::anyhow!("{} bits differ", pil["differing_bits"]).into());
    }
    if first["hash"] != second["hash"] {
        return Err(anyhow::anyhow!("two runs differ").into());
    }
    Ok(json!({ "pil": figures }))
}
