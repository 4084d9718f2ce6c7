//! The firmware images on emulated STM32G431 boards: emulator, images, the
//! tests, and the figures of the three-step run.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use clap::Args;
use serde_json::{Value, json};

use crate::firmware;
use crate::machine::Machine;
use crate::no_std::{self, Way, set_up};
use crate::process::{cargo, command, output, root, run, target_dir};
use crate::qemu;
use crate::report::{Report, StepError, StepResult};
use crate::sizes;
use crate::tools::{apt_install, have, may_apt};

mod load;
mod profile;

const PACKAGE: &str = "wheeleg-pil-unicorn";
/// What building the Unicorn engine takes, as Debian packages.
const PACKAGES: [&str; 3] = ["cmake", "pkg-config", "libclang-dev"];
/// Least speed of eight boards with the plant, times real time, on 2 cores.
const SPEED_LEAST: f64 = 2.0;
/// Cores that others may use in a run that has to meet it: what a system does by itself.
const OTHERS_MOST: f64 = 0.15;

/// Runs in which boards latch faults, with what strikes them: the master falls silent, a
/// wheel runs against its drive, a valve does not open, the emergency stop.
const EVENTFUL: [(&str, &[&str]); 3] = [
    ("master-lost", &[]),
    ("estop", &["--fault", "encoder-reversed:wheel8@5s"]),
    ("estop", &["--fault", "valve-stuck-shut:joint3.fill-a@1s"]),
];
/// What is measured of each board.
const MEASURED: [&str; 5] = [
    "tick_instructions_median",
    "tick_instructions_worst",
    "longest_awake_instructions",
    "stack_used_bytes",
    "stack_size_bytes",
];

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
}

/// `cargo xtask pil`.
pub(crate) fn steps(report: &mut Report, options: &Options) {
    let Some(machine) = Machine::of(report, options.json) else {
        return;
    };
    if report
        .step("set-up: build tools of the emulator", tools)
        .is_none()
    {
        return;
    }
    let Some(emulator) = report.step("emulated STM32G431", emulator) else {
        return;
    };
    let only_images = options.build || options.profile;
    let images = report.step("images for the emulated boards", || {
        Images::build(set_up(firmware::TARGET)?, "firmware", !only_images)
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
        let clippy = ["clippy", "--locked", "--all-targets", "--package", PACKAGE];
        run(cargo().args(clippy).args(["--", "-D", "warnings"]))?;
        run(cargo().args(["test", "--locked", "--package", PACKAGE]))?;
        Ok(())
    });
    report.step(
        "emulated boards against the host, wrong board support, faults",
        || tests(&emulator, &images),
    );
    let figures = report.step("three steps on eight emulated boards", || {
        figures(&emulator, &images.folder)
    });
    let eventful = report.step("runs with faults on eight emulated boards", || {
        eventful(&emulator, &images.folder)
    });
    report.step("three steps with the predictive law", || {
        predictive(&emulator, &images.folder)
    });
    report.step("one step with boards here, emulated, and on QEMU", || {
        mixed(&emulator, &images.folder)
    });
    if let (Some(machine), Some(mut figures)) = (machine, figures) {
        figures["pil"]["eventful"] = json!(eventful);
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
    /// Builds them in one of the ways, below the target folder; `all` says whether
    /// those for the tests, too.
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
    let names = [
        "pil",
        "pil_faults",
        "pil_flips",
        "pil_hil",
        "pil_store",
        "pil_mutants",
    ];
    run(&mut test_programs(emulator, images, &names))?;
    Ok(())
}

/// The command that runs test programs on emulated boards.
fn test_programs(emulator: &Path, images: &Images, names: &[&str]) -> Command {
    let mut test = cargo();
    // Optimised, as the program of the figures below is: one build serves both.
    test.args(["test", "--locked", "--release", "--no-fail-fast"]);
    test.args(["--package", "wheeleg-tests", "--features", "pil"]);
    for name in names {
        test.args(["--test", name]);
    }
    test.env("WHEELEG_PIL", emulator)
        .env("WHEELEG_IMAGES", &images.folder)
        .env("WHEELEG_MUTANTS", &images.mutants)
        .env("WHEELEG_PROBES", &images.probes);
    test
}

/// Twenty times as many flipped bits as in the suite.
pub(crate) fn state_flips() -> StepResult<String> {
    tools()?;
    let emulator = emulator()?;
    let images = Images::build(set_up(firmware::TARGET)?, "firmware", false)?;
    let mut test = test_programs(&emulator, &images, &["pil_flips"]);
    test.args(["--", "--nocapture"])
        .env("WHEELEG_FLIP_TIMES", "20");
    let text = output(&mut test)?;
    let found: Vec<&str> = text.lines().filter(|l| l.contains(" flips in ")).collect();
    let [joint, wheel] = found.as_slice() else {
        return Err(anyhow::anyhow!("a joint's and a wheel's line, not {found:?}").into());
    };
    Ok(format!("{joint}; {wheel}"))
}

/// The whole suite with images of the second way of building. It shares only
/// the sources with the first: compiler, `core` and flags are others.
pub(crate) fn second_way() -> StepResult<String> {
    tools()?;
    let emulator = emulator()?;
    let images = Images::build(no_std::second_way()?, "firmware-debian", true)?;
    tests(&emulator, &images)?;
    let figures = figures(&emulator, &images.folder)?;
    let pil = &figures["pil"];
    let of = |image: &str| {
        let (image, tick) = (&pil[image], "tick_instructions_worst");
        let hash = image["blake3"].as_str().unwrap_or_default();
        format!("blake3 {hash:.16}, tick {} at worst", image[tick])
    };
    Ok(format!(
        "Debian's compiler: {} bits compared, {} differ; joint {}; wheel {}",
        pil["compared_bits"],
        pil["differing_bits"],
        of("joint"),
        of("wheel")
    ))
}

fn ensure_file(path: &Path) -> anyhow::Result<()> {
    ensure!(path.is_file(), "no file {}", path.display());
    Ok(())
}

/// Runs the paper's test with all nodes of one kind; gives its summary.
pub(crate) fn three_steps(
    nodes: &str,
    folder: &str,
    environment: &[(&str, &Path)],
    further: &[&str],
) -> anyhow::Result<Value> {
    let nodes = ["--nodes", nodes];
    run_nodes(
        Path::new("three-step"),
        &nodes,
        folder,
        environment,
        further,
    )
}

/// Builds the program.
fn build_wheeleg() -> anyhow::Result<()> {
    run(cargo().args(["build", "--locked", "--release", "--package", "wheeleg-sim"]))
}

/// Builds the program and runs a scenario with it; gives its summary. `nodes` says which
/// node runs where.
fn run_nodes(
    scenario: &Path,
    nodes: &[&str],
    folder: &str,
    environment: &[(&str, &Path)],
    further: &[&str],
) -> anyhow::Result<Value> {
    build_wheeleg()?;
    let mut wheeleg = command(target_dir().join("release").join("wheeleg"));
    wheeleg
        .arg("run")
        .arg(scenario)
        .args(nodes)
        .args(["--json", "--out"])
        .arg(target_dir().join(folder))
        .args(further);
    for (name, value) in environment {
        wheeleg.env(name, value);
    }
    serde_json::from_str(&output(&mut wheeleg)?).context("the summary of the run")
}

/// Boards were compared with the host, and no bit differed.
pub(crate) fn ensure_equal(pil: &Value) -> anyhow::Result<()> {
    let (compared, differ) = (&pil["compared_bits"], &pil["differing_bits"]);
    ensure!(
        *differ == 0 && compared.as_u64() > Some(1_000_000),
        "{compared} bits compared, {differ} differ: {}",
        pil["first_difference"]
    );
    Ok(())
}

/// One run: times real time, and cores that others used meanwhile, if that is known.
type Speed = (f64, Option<f64>);

/// Whether nobody else was at work in a run.
fn was_alone((_, others): Speed) -> bool {
    others.is_some_and(|cores| cores <= OTHERS_MOST)
}

/// The speeds against the target. A run that was alone on the machine must meet it. One
/// that was not says nothing about us, and is not shown as met, either.
///
/// # Errors
/// The same line, if the target is missed.
fn speed_verdict(runs: [Speed; 2]) -> Result<String, String> {
    let each = runs.map(|(factor, others)| {
        let others = others.map_or("unknown".to_owned(), |cores| format!("{cores:.2} cores"));
        format!("{factor:.2} (others used {others})")
    });
    let missed = |run: &Speed| run.0 < SPEED_LEAST;
    let verdict = if runs.iter().any(|run| missed(run) && was_alone(*run)) {
        "MISSED"
    } else if runs.iter().any(missed) {
        "NOT JUDGED: run it again while nobody else is at work"
    } else {
        "met"
    };
    let line = format!(
        "speed: {} times real time, target at least {SPEED_LEAST:.1} where others use at most \
         {OTHERS_MOST:.2} cores: {verdict}",
        each.join(" and ")
    );
    if verdict == "MISSED" {
        Err(line)
    } else {
        Ok(line)
    }
}

/// Three steps on emulated boards, and the cores that others used meanwhile. Only the run
/// itself is watched: what is built for it stands before.
fn watched(folder: &str, environment: &[(&str, &Path)]) -> anyhow::Result<(Value, Option<f64>)> {
    build_wheeleg()?;
    let meter = load::Meter::begin();
    let summary = three_steps("pil", folder, environment, &[])?;
    Ok((summary, meter.and_then(|meter| meter.others())))
}

/// Runs the paper's test twice on eight emulated boards: no bit may differ from
/// the host, nor between the runs.
fn figures(emulator: &Path, images: &Path) -> StepResult<Value> {
    let environment = [("WHEELEG_PIL", emulator), ("WHEELEG_IMAGES", images)];
    let (first, others_first) = watched("pil-run/first", &environment)?;
    let (second, others_second) = watched("pil-run/second", &environment)?;
    let native = three_steps("sil", "pil-run/native", &environment, &[])?;
    let pil = &first["pil"];
    let speeds = [&first, &second].map(|run| run["realtime_factor"].as_f64().unwrap_or(0.0));
    let worse = speeds[0].min(speeds[1]);
    let mut figures = json!({
        "hash": first["hash"],
        "compared_bits": pil["compared_bits"],
        "differing_bits": pil["differing_bits"],
        "realtime_factors": speeds,
        "realtime_factor": worse,
        "realtime_factor_least": SPEED_LEAST,
        "cores_used_by_others": [others_first, others_second],
    });
    put_most(&mut figures, &[pil]);
    let within_budget = sizes::check_run(images, &mut figures);
    figures["qemu"] = qemu::counts();
    println!("    {figures}");
    let runs = [(speeds[0], others_first), (speeds[1], others_second)];
    let verdict = speed_verdict(runs);
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
    if first["hash"] != second["hash"] {
        return Err(anyhow::anyhow!("two runs differ").into());
    }
    let either = |key| most(pil, key, "joint").max(most(pil, key, "wheel"));
    let (bytes, frames) = (either("late_bytes"), either("late_frames"));
    if bytes + frames > 0 {
        return Err(anyhow::anyhow!("{bytes} bytes and {frames} frames came late").into());
    }
    within_budget?;
    verdict.map_err(anyhow::Error::msg)?;
    Ok(json!({ "pil": figures }))
}

/// Runs with faults: no bit may differ from the host, and the worst ticks have the budgets
/// of the others.
fn eventful(emulator: &Path, images: &Path) -> StepResult<Value> {
    let environment = [("WHEELEG_PIL", emulator), ("WHEELEG_IMAGES", images)];
    let mut runs = Vec::new();
    for (number, (scenario, faults)) in EVENTFUL.into_iter().enumerate() {
        let folder = format!("pil-run/eventful-{number}");
        let further = [&["--compare-sil"], faults].concat();
        let mut run = run_nodes(
            Path::new(scenario),
            &["--nodes", "pil"],
            &folder,
            &environment,
            &further,
        )?;
        ensure_equal(&run["pil"]).with_context(|| format!("{scenario} {faults:?}"))?;
        runs.push(run["pil"].take());
    }
    let mut figures = json!({});
    put_most(&mut figures, &runs.iter().collect::<Vec<_>>());
    let within_budget = sizes::check_run(images, &mut figures);
    println!("    {figures}");
    within_budget?;
    Ok(figures)
}

/// Puts the largest figures of each image in these runs.
fn put_most(figures: &mut Value, runs: &[&Value]) {
    for image in ["joint", "wheel"] {
        for key in MEASURED {
            let each = runs.iter().map(|pil| most(pil, key, image));
            figures[image][key] = json!(each.max().unwrap_or(0));
        }
    }
}

/// Largest figure of the boards with this image.
fn most(pil: &Value, key: &str, image: &str) -> u64 {
    let boards = pil["boards"].as_array().into_iter().flatten();
    let boards = boards.filter(|board| board["image"] == image);
    let figures = boards.filter_map(|board| board[key].as_u64());
    figures.max().unwrap_or(0)
}

/// A copy of a file of the simulator's in `folder`, with one text replaced.
fn changed(folder: &Path, from: &str, to: &str, old: &str, new: &str) -> anyhow::Result<PathBuf> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let path = root().join("host-sim").join(from);
    let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    ensure!(text.matches(old).count() == 1, "{from} has no `{old}`");
    let path = folder.join(to);
    fs::write(&path, text.replace(old, new)).with_context(|| path.display().to_string())?;
    Ok(path)
}

/// A copy of the paper's test in which the joints have the predictive law.
fn predictive_scenario() -> anyhow::Result<PathBuf> {
    let folder = target_dir().join("pil-run").join("predictive");
    let law = r#"law = { value = 5, unit = "1", source = "ASSUMED: this run's" }"#;
    changed(
        &folder,
        "robots/wheeleg-2003.toml",
        "robot.toml",
        "[node.joint]\n",
        &format!("[node.joint]\n{law}\n"),
    )?;
    changed(
        &folder,
        "scenarios/three-step.toml",
        "three-step.toml",
        r#"robot = "wheeleg-2003""#,
        r#"robot = "robot.toml""#,
    )
}

/// The paper's test with the predictive law: no bit may differ from the host, and the
/// worst tick has a budget of its own.
fn predictive(emulator: &Path, images: &Path) -> StepResult {
    let environment = [("WHEELEG_PIL", emulator), ("WHEELEG_IMAGES", images)];
    let summary = run_nodes(
        &predictive_scenario()?,
        &["--nodes", "pil"],
        "pil-run/predictive/out",
        &environment,
        &["--compare-sil"],
    )?;
    let pil = &summary["pil"];
    let tick = |key| most(pil, key, "joint");
    let worst = tick("tick_instructions_worst");
    println!(
        "    joint tick with the predictive law: {} instructions in the median, {worst} at worst",
        tick("tick_instructions_median")
    );
    ensure_equal(pil)?;
    sizes::check_predictive(worst)
}

/// Which nodes of a mixed run are outside, and where.
const MIXED: [&str; 10] = [
    "--node",
    "joint1=qemu",
    "--node",
    "joint2=pil",
    "--node",
    "joint6=pil",
    "--node",
    "wheel7=pil",
    "--node",
    "wheel8=qemu",
];

/// Part of the paper's test with boards of three kinds on one bus: in the simulator, as
/// images on the emulated part, and on QEMU. No bit may differ from the host, and the log
/// must be that of the native run.
fn mixed(emulator: &Path, images: &Path) -> StepResult {
    qemu::emulator()?;
    let folder = target_dir().join("pil-run").join("mixed");
    let both = folder.join("images");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&both).with_context(|| both.display().to_string())?;
    // The program looks for all images in one folder.
    let on_qemu = qemu::images()?;
    let wanted = [(images, "joint.elf"), (images, "wheel.elf")]
        .into_iter()
        .chain([(&*on_qemu, "qemu-joint"), (&*on_qemu, "qemu-wheel")]);
    for (from, name) in wanted {
        fs::copy(from.join(name), both.join(name)).with_context(|| name.to_owned())?;
    }
    // Start-up and the first step.
    let scenario = changed(
        &folder,
        "scenarios/three-step.toml",
        "first-step.toml",
        "duration = { value = 10.0,",
        "duration = { value = 3.5,",
    )?;
    let environment = [("WHEELEG_PIL", emulator), ("WHEELEG_IMAGES", &both)];
    let further = ["--compare-sil"];
    let summary = run_nodes(
        &scenario,
        &MIXED,
        "pil-run/mixed/out",
        &environment,
        &further,
    )?;
    let pil = &summary["pil"];
    let kinds = pil["nodes"].as_array().into_iter().flatten();
    let kinds: BTreeSet<&str> = kinds.filter_map(Value::as_str).collect();
    ensure_three_kinds(&kinds)?;
    println!(
        "    {} bits compared, {} differ; the log is that of the native run",
        pil["compared_bits"], pil["differing_bits"]
    );
    Ok(ensure_equal(pil)?)
}

fn ensure_three_kinds(kinds: &BTreeSet<&str>) -> anyhow::Result<()> {
    let all = BTreeSet::from(["pil", "qemu", "sil"]);
    ensure!(*kinds == all, "boards of {kinds:?}, not {all:?}");
    Ok(())
}

/// Runs the paper's test on emulated boards and prints the profiles of their worst ticks.
fn profile(emulator: &Path, images: &Path) -> StepResult {
    let folder = target_dir().join("pil-run").join("profile");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let environment = [
        ("WHEELEG_PIL", emulator),
        ("WHEELEG_IMAGES", images),
        ("WHEELEG_PIL_PROFILE", &folder),
    ];
    three_steps("pil", "pil-run/profiled", &environment, &[])?;
    profile::print(&folder, images)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_alone_must_be_fast_and_a_disturbed_one_is_never_shown_as_met() {
        let alone = |factor| (factor, Some(0.05));
        let disturbed = |factor| (factor, Some(0.8));
        let said = |runs| match speed_verdict(runs) {
            Ok(line) | Err(line) => line,
        };
        assert!(said([alone(2.0), disturbed(3.0)]).ends_with(": met"));
        for runs in [[alone(2.5), alone(1.98)], [alone(1.2), disturbed(3.0)]] {
            let line = speed_verdict(runs).expect_err("too slow");
            assert!(line.ends_with("MISSED"), "{line}");
        }
        for slow in [disturbed(1.2), (1.2, None)] {
            let line = speed_verdict([alone(2.5), slow]).expect("nobody's fault");
            assert!(
                line.contains("NOT JUDGED") && line.contains("2.50"),
                "{line}"
            );
        }
    }
}
