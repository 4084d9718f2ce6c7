//! The firmware images on emulated STM32G431 boards: emulator, images, the
//! tests, and the figures of the three-step run.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::ensure;
use clap::Args;
use serde_json::{Value, json};

use crate::firmware;
use crate::machine::Machine;
use crate::no_std::{self, Way, way};
use crate::process::{self, cargo, empty_folder, run, target_dir};
use crate::qemu;
use crate::report::{Report, StepError, StepResult};
use crate::runs::{ensure_equal, most, put_most, three_steps};
use crate::rust;
use crate::sizes;
use crate::tools::have;

mod further;
mod load;
mod profile;
mod speed;

use further::{eventful, mixed, predictive};
use speed::{SPEED_LEAST, Speed, is_met, speed_verdict, watched};

const PACKAGE: &str = "wheeleg-pil-unicorn";
/// Debian packages for building the Unicorn engine.
pub(crate) const PACKAGES: [&str; 3] = ["cmake", "pkg-config", "libclang-dev"];

/// Arguments of `cargo xtask pil`.
#[derive(Args, Debug, Default)]
pub(crate) struct Options {
    /// Only build emulator and images, so that `wheeleg run --nodes pil` finds them.
    #[arg(long)]
    build: bool,
    /// Print the figures as one line of JSON, and all else to standard error.
    #[arg(long)]
    json: bool,
    /// Only print, by function, where the instructions of the worst tick of three steps
    /// went; of other runs: `WHEELEG_PIL_PROFILE=FOLDER wheeleg run SCENARIO --nodes pil`.
    #[arg(long)]
    profile: bool,
    /// Print the boards' speed without judging it: in the suite, which runs on any machine.
    #[arg(skip)]
    any_speed: bool,
}

impl Options {
    /// As in the suite.
    pub(crate) fn suite() -> Self {
        Self {
            any_speed: true,
            ..Self::default()
        }
    }
}

/// `cargo xtask pil`.
pub(crate) fn steps(report: &mut Report, options: &Options) {
    let Some(machine) = Machine::of(report, options.json) else {
        return;
    };
    if report.step("build tools of the emulator", tools).is_none() {
        return;
    }
    let Some(emulator) = report.step("emulated STM32G431", emulator) else {
        return;
    };
    let only_images = options.build || options.profile;
    let images = report.step("images for the emulated boards", || {
        Images::build(way(firmware::TARGET)?, "firmware", !only_images)
    });
    let Some(images) = images else {
        return;
    };
    if options.profile {
        report.step("instructions of the worst tick, by function", || {
            profile(&emulator, &images.folder)
        });
        return;
    }
    if options.build {
        return;
    }
    report.step("lints and tests of the emulator", || {
        // Like the emulator itself: each further profile builds the engine again.
        let package = ["--locked", "--release", "--package", PACKAGE];
        run(cargo()
            .args(["clippy", "--all-targets"])
            .args(package)
            .args(["--", "-D", "warnings"]))?;
        run(cargo().arg("test").args(package))?;
        Ok(())
    });
    report.step(
        "emulated boards against the host, wrong board support, faults",
        || tests(&emulator, &images),
    );
    let figures = report.step("three steps on eight emulated boards", || {
        let times = if options.any_speed { 2 } else { TIMES_MOST };
        let (figures, speed) = figures(&emulator, &images.folder, times)?;
        if !options.any_speed {
            speed.map_err(anyhow::Error::msg)?;
        }
        Ok(figures)
    });
    let eventful = report.step("runs with faults on eight emulated boards", || {
        eventful(&emulator, &images.folder)
    });
    let predictive = report.step(
        "three steps and runs with faults with the predictive law",
        || predictive(&emulator, &images.folder),
    );
    report.step("one step with boards here, emulated, and on QEMU", || {
        mixed(&emulator, &images.folder, way(firmware::TARGET)?)
    });
    if let (Some(machine), Some(mut figures)) = (machine, figures) {
        figures["pil"]["eventful"] = json!(eventful);
        figures["pil"]["predictive"] = json!(predictive);
        report.step("figures for machines", || Ok(machine.print(&figures)?));
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

/// True if the build tools are there.
pub(crate) fn have_tools() -> bool {
    have("cmake") && have("pkg-config") && libclang()
}

/// Finds the build tools.
fn tools() -> StepResult {
    if have_tools() {
        return Ok(());
    }
    Err(StepError::not_set_up(
        "cmake, pkg-config or libclang, which the Unicorn engine is built with",
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

/// Images for the emulated boards.
struct Images {
    /// The ones that are flashed.
    folder: PathBuf,
    /// The ones that are wrong on purpose.
    mutants: PathBuf,
    /// The ones that exercise one driver.
    probes: PathBuf,
}

impl Images {
    /// Builds them in one of the ways, below the target folder; `all`: including those for the tests.
    fn build(way: Way, name: &str, all: bool) -> StepResult<Self> {
        let images = Self {
            folder: target_dir().join(name),
            mutants: target_dir().join(format!("{name}-mutants")),
            probes: target_dir().join(format!("{name}-probes")),
        };
        firmware::build_into(way, &images.folder)?;
        if all {
            firmware::mutants(way, &images.mutants)?;
            firmware::probes(way, &images.probes)?;
        }
        Ok(images)
    }
}

/// The tests that need emulated boards.
fn tests(emulator: &Path, images: &Images) -> StepResult {
    run(&mut test_programs(
        emulator,
        images,
        &["emulated", "pil_hil"],
    ))?;
    Ok(())
}

/// The command that runs test programs on emulated boards.
fn test_programs(emulator: &Path, images: &Images, names: &[&str]) -> Command {
    let mut test = cargo();
    // Optimised, as the program of the figures below is: one build serves both.
    test.args(["test", "--locked", "--release", "--no-fail-fast"]);
    test.args(rust::HOST)
        .args(["--features", "wheeleg-tests/pil"]);
    for name in names {
        test.args(["--test", name]);
    }
    test.env("WHEELEG_PIL", emulator)
        .env("WHEELEG_IMAGES", &images.folder)
        .env("WHEELEG_MUTANTS", &images.mutants)
        .env("WHEELEG_PROBES", &images.probes);
    test
}

/// The emulator and the images for flashing, built if missing.
fn boards() -> StepResult<(PathBuf, Images)> {
    tools()?;
    let images = Images::build(way(firmware::TARGET)?, "firmware", false)?;
    Ok((emulator()?, images))
}

/// Twenty times as many flipped bits as in the suite.
pub(crate) fn state_flips() -> StepResult<String> {
    let (emulator, images) = boards()?;
    let mut test = test_programs(&emulator, &images, &["emulated"]);
    test.args(["pil_flips", "--", "--nocapture"])
        .env("WHEELEG_FLIP_TIMES", "20");
    let found = process::figures(&mut test, |line| line.contains(" flips in "))?;
    let [joint, wheel] = found.as_slice() else {
        return Err(anyhow::anyhow!("a joint's and a wheel's line, not {found:?}").into());
    };
    Ok(format!("{joint}; {wheel}"))
}

/// The walks that the suite cuts short, to their ends: no bit may differ from the host.
pub(crate) fn walks() -> StepResult<String> {
    let (emulator, images) = boards()?;
    let mut test = test_programs(&emulator, &images, &["emulated"]);
    test.args(["pil_walks", "--", "--nocapture", "--test-threads", "1"])
        .env("WHEELEG_PIL_WHOLE", "1");
    let found = process::figures(&mut test, |line| line.contains(" bits compared, "))?;
    if found.len() != 3 {
        return Err(anyhow::anyhow!("a line for each of three walks, not {found:?}").into());
    }
    Ok(found.join("; "))
}

/// The whole suite with images of the second way of building: three steps, runs with
/// faults, the predictive law, and boards of three kinds. It shares only the sources with the first: compiler,
/// `core` and flags are others.
pub(crate) fn second_way() -> StepResult<String> {
    tools()?;
    let emulator = emulator()?;
    let way = no_std::second_way()?;
    let images = Images::build(way, "firmware-debian", true)?;
    tests(&emulator, &images)?;
    let (figures, _) = figures(&emulator, &images.folder, 2)?;
    let eventful = eventful(&emulator, &images.folder)?;
    predictive(&emulator, &images.folder)?;
    let mixed = mixed(&emulator, &images.folder, way)?;
    let pil = &figures["pil"];
    let of = |image: &str| {
        let (steps, tick) = (&pil[image], "tick_instructions_worst");
        let hash = steps["blake3"].as_str().unwrap_or_default();
        format!(
            "blake3 {hash:.16}, tick {} at worst, {} with faults",
            steps[tick], eventful[image][tick]
        )
    };
    Ok(format!(
        "Debian's compiler: {} bits compared, {} differ, {} and {} with boards of three \
         kinds; joint {}; wheel {}",
        pil["compared_bits"],
        pil["differing_bits"],
        mixed["compared_bits"],
        mixed["differing_bits"],
        of("joint"),
        of("wheel")
    ))
}

fn ensure_file(path: &Path) -> anyhow::Result<()> {
    ensure!(path.is_file(), "no file {}", path.display());
    Ok(())
}

/// Runs of the boards in which they may show that they are fast enough.
const TIMES_MOST: usize = 4;

/// Runs the paper's test twice on eight emulated boards, or up to `times` if it is slower than required: no
/// bit may differ from the host, nor between the runs. The second is the verdict on their speed.
fn figures(
    emulator: &Path,
    images: &Path,
    times: usize,
) -> StepResult<(Value, Result<String, String>)> {
    let environment = [("WHEELEG_PIL", emulator), ("WHEELEG_IMAGES", images)];
    let mut played = vec![
        watched("pil-run/first", &environment)?,
        watched("pil-run/second", &environment)?,
    ];
    let native = three_steps("sil", "pil-run/native", &environment, &[])?;
    let speed = |run: &Value| run["realtime_factor"].as_f64().unwrap_or(0.0);
    let rated = |played: &[(Value, Option<f64>)]| -> Vec<Speed> {
        played
            .iter()
            .map(|(run, others)| (speed(run), *others))
            .collect()
    };
    // Slower than it must be: was it us, or the machine?
    while !is_met(&rated(&played)) && played.len() < times {
        played.push(watched("pil-run/again", &environment)?);
    }
    let runs = rated(&played);
    let first = &played[0].0;
    let pil = &first["pil"];
    let speeds: Vec<f64> = runs.iter().map(|run| run.0).collect();
    let worse = speeds.iter().copied().fold(f64::INFINITY, f64::min);
    let mut figures = json!({
        "hash": first["hash"],
        "compared_bits": pil["compared_bits"],
        "differing_bits": pil["differing_bits"],
        "realtime_factors": speeds,
        "realtime_factor": worse,
        "realtime_factor_least": SPEED_LEAST,
        "cores_used_by_others": runs.iter().map(|run| run.1).collect::<Vec<_>>(),
    });
    put_most(&mut figures, &[pil]);
    let within_budget = sizes::check_run(images, &mut figures);
    figures["qemu"] = qemu::counts();
    println!("    {figures}");
    let verdict = speed_verdict(&runs);
    println!("    {}", verdict.as_ref().unwrap_or_else(|line| line));
    ensure_equal(pil)?;
    if first["hash"] != native["hash"] {
        return Err(anyhow::anyhow!(
            "the log of the native run differs: {} there, {} with the boards; \
             `wheeleg run three-step --nodes pil --compare-sil` names the first difference",
            native["hash"],
            first["hash"]
        )
        .into());
    }
    if played.iter().any(|(run, _)| run["hash"] != first["hash"]) {
        return Err(anyhow::anyhow!("two runs of the boards differ").into());
    }
    let either = |key| most(pil, key, "joint").max(most(pil, key, "wheel"));
    let (bytes, frames) = (either("late_bytes"), either("late_frames"));
    if bytes + frames > 0 {
        return Err(anyhow::anyhow!("{bytes} bytes and {frames} frames came late").into());
    }
    within_budget?;
    Ok((json!({ "pil": figures }), verdict))
}

/// The speed of eight emulated boards, against its target.
pub(crate) fn speed() -> StepResult<String> {
    let (emulator, images) = boards()?;
    let (_, speed) = figures(&emulator, &images.folder, TIMES_MOST)?;
    Ok(speed.map_err(anyhow::Error::msg)?)
}

/// Runs the paper's test on emulated boards and prints the profiles of their worst ticks.
fn profile(emulator: &Path, images: &Path) -> StepResult {
    let folder = target_dir().join("pil-run").join("profile");
    empty_folder(&folder)?;
    let environment = [
        ("WHEELEG_PIL", emulator),
        ("WHEELEG_IMAGES", images),
        ("WHEELEG_PIL_PROFILE", &folder),
    ];
    three_steps("pil", "pil-run/profiled", &environment, &[])?;
    profile::print(&folder, images)?;
    Ok(())
}
