//! The boards on QEMU: emulator, images, the tests that compare them with the
//! host, and instructions per tick.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;
use serde_json::{Value, json};

use crate::firmware;
use crate::no_std::{Way, cargo_for, way};
use crate::process::{ask, cargo, command, empty_folder, run, target_dir};
use crate::report::{Report, StepError, StepResult};
use crate::runs;
use crate::rust;
use crate::tools::have;

pub(crate) const EMULATOR: &str = "qemu-system-arm";
const TARGET: &str = "thumbv7em-none-eabi";
const PACKAGE: &str = "wheeleg-board-qemu";
const IMAGES: [&str; 3] = ["qemu-joint", "qemu-wheel", "qemu-hil-joint"];

/// Regions counted in the images that have a tick: name, and the functions that mark begin and end.
const REGIONS: [(&str, &str, &str); 2] = [
    ("tick", "mark_tick_begins", "mark_tick_ended"),
    ("bytes", "mark_bytes_begin", "mark_bytes_ended"),
];

/// Arguments of `cargo xtask qemu`.
#[derive(Args, Debug, Default)]
pub(crate) struct Options {
    /// Print the figures as one line of JSON at the end.
    #[arg(long)]
    json: bool,
}

/// `cargo xtask qemu`.
pub(crate) fn steps(report: &mut Report, options: &Options) {
    if report.step("QEMU", emulator).is_none() {
        return;
    }
    let Some(images) = report.step("QEMU images", || images(way(TARGET)?)) else {
        return;
    };
    report.step("lints of the QEMU board support", lint);
    report.step("QEMU boards against the host, bit for bit", || {
        compare(&images)
    });
    report.step("three steps on eight QEMU boards", || three_steps(&images));
    let counts = report.step("instructions per tick on QEMU", || count(&images));
    if options.json
        && let Some(counts) = counts
    {
        println!("{counts}");
    }
}

/// Finds the emulator.
pub(crate) fn emulator() -> StepResult {
    if !have(EMULATOR) {
        return Err(StepError::not_set_up(EMULATOR));
    }
    let version = ask(command(EMULATOR).arg("--version")).unwrap_or_default();
    println!("    {}", version.lines().next().unwrap_or_default());
    Ok(())
}

/// Builds the images in one of the ways; returns their folder. They link only if no panic can be reached.
pub(crate) fn images(way: Way) -> StepResult<PathBuf> {
    println!("    way: {}", way.text());
    let products = match way {
        Way::Rustup => target_dir(),
        Way::DebianBuildStd => target_dir().join("debian"),
    }
    .join(TARGET);
    // All in one folder, where the simulator looks for them.
    let folder = products.join("firmware");
    for image in IMAGES {
        let profile = firmware::profile(image);
        let mut build = cargo_for(way, "build");
        build
            .args(["--locked", "--package", PACKAGE, "--features", "image"])
            .args(["--profile", profile, "--target", TARGET, "--bin", image]);
        firmware::give_linker(way, &mut build)?;
        run(&mut build)?;
        let (product, path) = (products.join(profile).join(image), folder.join(image));
        if product != path {
            fs::create_dir_all(&folder)
                .with_context(|| format!("cannot make {}", folder.display()))?;
            fs::copy(&product, &path).with_context(|| format!("cannot copy {image}"))?;
        }
        present(&path)?;
    }
    Ok(folder)
}

/// Images and tests that need them are not among the host's targets, so their
/// lints are checked here.
fn lint() -> StepResult {
    if way(TARGET)? == Way::DebianBuildStd {
        return Err(StepError::missing(
            format!("the Rust target {TARGET} for clippy"),
            format!("rustup target add {TARGET}"),
        ));
    }
    run(cargo()
        .args(["clippy", "--locked", "--no-deps", "--package", PACKAGE])
        .args(["--features", "image", "--target", TARGET])
        .args(["--", "-D", "warnings"]))?;
    Ok(())
}

fn present(path: &Path) -> anyhow::Result<()> {
    ensure!(path.is_file(), "no image {}", path.display());
    Ok(())
}

/// `cargo test` of the tests that need the images.
fn tests(images: &Path) -> std::process::Command {
    let mut test = cargo();
    test.args(["test", "--locked", "--release"])
        .args(rust::HOST)
        .args(["--features", "wheeleg-tests/qemu", "--test", "qemu"])
        .env("WHEELEG_IMAGES", images);
    test
}

fn compare(images: &Path) -> StepResult {
    run(&mut tests(images))?;
    Ok(())
}

/// The paper's test with the whole robot on QEMU: no bit may differ from the host.
fn three_steps(images: &Path) -> StepResult {
    let environment = [("WHEELEG_IMAGES", images)];
    let summary = runs::three_steps("qemu", "qemu-run", &environment, &["--compare-sil"])?;
    let pil = &summary["pil"];
    println!(
        "    {} bits compared, {} differ, {:.1} times real time",
        pil["compared_bits"],
        pil["differing_bits"],
        summary["realtime_factor"].as_f64().unwrap_or(0.0)
    );
    Ok(runs::ensure_equal(pil)?)
}

/// Runs the loops of the tests with the counting plugin. Gives, for each
/// application and region, passes and the smallest, median and largest count.
fn count(images: &Path) -> StepResult<Value> {
    run(cargo().args(["build", "--locked", "--release", "--package", "insn-plugin"]))?;
    let plugin = target_dir().join("release").join(format!(
        "{}insn_plugin{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    ));
    let folder = target_dir().join("qemu-counts");
    empty_folder(&folder)?;
    let mut argument = format!("{},out={}/{{n}}.txt", plugin.display(), folder.display());
    for (name, begin, end) in REGIONS {
        argument.push_str(&format!(",region={name}:{begin}:{end}"));
    }
    run(tests(images)
        .args(["--", "closed", "eventful"])
        .env("WHEELEG_QEMU_PLUGIN", argument))?;
    let mut figures = json!({});
    for application in ["joint", "wheel"] {
        for (region, ..) in REGIONS {
            let lines = results(&folder, application, region)?;
            let line = merge(&lines)
                .with_context(|| format!("nothing counted: {application}, {region}"))?;
            println!(
                "    {application} {region:<5} {:>6} passes, instructions: least {}, median {}, most {}",
                line.passes, line.least, line.median, line.most
            );
            figures[application][region] = json!({
                "passes": line.passes, "min": line.least, "median": line.median, "max": line.most,
            });
        }
    }
    fs::write(counts_file(), figures.to_string()).context("the file of counts")?;
    Ok(json!({ "qemu": { "machine": "mps2-an386", "instructions": figures } }))
}

fn counts_file() -> PathBuf {
    target_dir().join("qemu-counts.json")
}

/// Instructions counted by the last `cargo xtask qemu` in this target folder; null if there was none.
pub(crate) fn counts() -> Value {
    let text = fs::read_to_string(counts_file()).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or(Value::Null)
}

/// Counts of one emulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Line {
    passes: u64,
    least: u64,
    median: u64,
    most: u64,
}

/// The lines `region` of all emulators that ran this application.
fn results(folder: &Path, application: &str, region: &str) -> anyhow::Result<Vec<Line>> {
    let mut lines = Vec::new();
    for entry in fs::read_dir(folder).context("the folder of counts")? {
        let path = entry?.path();
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        if name.starts_with(&format!("qemu-{application}-")) {
            let text = fs::read_to_string(&path).context("a file of counts")?;
            lines.extend(text.lines().filter_map(|line| parse(line, region)));
        }
    }
    Ok(lines)
}

/// `name passes least median most pass-of-the-most`; `None` for another region
/// or one that was never passed.
fn parse(line: &str, region: &str) -> Option<Line> {
    let rest = line.strip_prefix(region)?.strip_prefix(' ')?;
    let numbers: Vec<u64> = rest.split(' ').map_while(|n| n.parse().ok()).collect();
    let [passes, least, median, most, _] = numbers[..] else {
        return None;
    };
    Some(Line {
        passes,
        least,
        median,
        most,
    })
}

/// All emulators together; the median is that of the emulator with the most passes.
fn merge(lines: &[Line]) -> Option<Line> {
    let longest = lines.iter().max_by_key(|line| line.passes)?;
    Some(Line {
        passes: lines.iter().map(|line| line.passes).sum(),
        least: lines.iter().map(|line| line.least).min()?,
        median: longest.median,
        most: lines.iter().map(|line| line.most).max()?,
    })
}

#[cfg(test)]
mod tests {
    use super::{Line, merge, parse};

    #[test]
    fn results_of_several_emulators_become_one() {
        let a = parse("tick 100 10 20 90 4", "tick").expect("a line");
        let b = parse("tick 300 12 25 60 9", "tick").expect("a line");
        assert_eq!(parse("bytes 7 1 2 3 0", "tick"), None);
        assert_eq!(parse("tick 0", "tick"), None, "never passed");
        let merged = merge(&[a, b]).expect("lines");
        let expected = Line {
            passes: 400,
            least: 10,
            median: 25,
            most: 90,
        };
        assert_eq!(merged, expected);
        assert_eq!(merge(&[]), None);
    }
}
