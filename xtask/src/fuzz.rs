//! Fuzzing with libFuzzer by cargo-fuzz, without a sanitizer, so that the stable compiler
//! does. It needs a C++ compiler (libFuzzer itself is C++).

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use clap::Args;

use crate::process::{cargo, command, empty_folder, remove_folder, root, run, target_dir};
use crate::record;
use crate::report::{Report, StepResult};

/// Of cargo-fuzz, as `cargo xtask setup` installs it.
pub(crate) const VERSION: &str = "0.13.2";

/// The fuzzers' folder, from the root.
const FOLDER: &str = "tests/fuzz";

/// The targets, with the longest input of each.
const TARGETS: [(&str, u32); 13] = [
    ("decoder", 2000),
    ("frames", 4000),
    ("parse", 200),
    ("joint", 2000),
    ("wheel", 2000),
    ("master", 1000),
    ("store", 400),
    ("remote", 2000),
    ("scenario", 40_000),
    ("files", 60_000),
    ("written", 16_000),
    ("tables", 4_000),
    ("console", 4_096),
];

/// Targets that read the simulator's files. Their build takes four minutes, so the suite leaves them to `cargo xtask fuzz`
/// and `deep fuzz`; `cargo test` replays their inputs and lets bolero draw new ones.
const OF_THE_SIMULATOR: [&str; 5] = ["scenario", "files", "written", "tables", "console"];

/// Seconds for each target in the test suite.
const SUITE_SECONDS: u64 = 4;
/// Seconds within which a seeded bug must be found.
const SEEDED_SECONDS: u64 = 60;

#[derive(Args)]
pub(crate) struct Options {
    /// One target; without it all are run in turn.
    target: Option<String>,
    /// Seconds per target.
    #[arg(long, default_value_t = 60)]
    seconds: u64,
    /// Applies each seeded bug to a copy of the commit; the targets must find it within 60 s.
    #[arg(long)]
    seeded: bool,
    /// Afterwards, appends a dated line per target to `docs/records/deep.md`.
    #[arg(long)]
    note: bool,
}

/// `cargo xtask fuzz`.
pub(crate) fn steps(report: &mut Report, options: &Options) {
    if options.seeded {
        seeded(report);
        return;
    }
    let wanted = |name: &str| options.target.as_deref().is_none_or(|only| only == name);
    let chosen: Vec<&str> = names().filter(|name| wanted(name)).collect();
    if chosen.is_empty() {
        report.step("choose a target", || -> StepResult {
            let all: Vec<&str> = names().collect();
            Err(anyhow::anyhow!("the targets are {}", all.join(", ")).into())
        });
        return;
    }
    let Some(fuzzers) = report.step("fuzz: build", || Ok(Fuzzers::build(root(), &chosen)?)) else {
        return;
    };
    for name in chosen {
        report.step(format!("fuzz: {name}"), || {
            let result = fuzzers.explore(name, options.seconds);
            if options.note {
                record::note(&format!("fuzz {name}"), &result)?;
            }
            Ok(result.map(drop)?)
        });
    }
}

/// The seeded bugs still fit the sources. Takes no time, and a changed comment is enough to break it.
pub(crate) fn seeded_bugs_apply() -> StepResult {
    for Patch { path, .. } in patches()? {
        run(command("git").args(["apply", "--check"]).arg(path))?;
    }
    Ok(())
}

/// The part of the test suite: a short run of every target of the bus and the firmware, from the stored corpus.
pub(crate) fn short_steps(report: &mut Report) {
    report.step(format!("fuzz: {SUITE_SECONDS} s per target"), || {
        let of_the_bus: Vec<&str> = names()
            .filter(|name| !OF_THE_SIMULATOR.contains(name))
            .collect();
        targets(&of_the_bus, SUITE_SECONDS).map(drop)
    });
}

/// Every target for `seconds`; a sentence about the result.
pub(crate) fn all_targets(seconds: u64) -> StepResult<String> {
    targets(&names().collect::<Vec<_>>(), seconds)
}

fn targets(names: &[&str], seconds: u64) -> StepResult<String> {
    let fuzzers = Fuzzers::build(root(), names)?;
    let mut texts = Vec::new();
    for name in names {
        texts.push(format!("{name}: {}", fuzzers.explore(name, seconds)?));
    }
    Ok(texts.join("; "))
}

fn names() -> impl Iterator<Item = &'static str> {
    TARGETS.iter().map(|(name, _)| *name)
}

/// The libFuzzer programs of one tree of sources.
struct Fuzzers {
    tree: PathBuf,
    /// Whether they are built with the simulator.
    sim: bool,
}

impl Fuzzers {
    /// Builds the named targets.
    fn build(tree: PathBuf, names: &[&str]) -> Result<Self> {
        let sim = names.iter().any(|name| OF_THE_SIMULATOR.contains(name));
        let fuzzers = Self { tree, sim };
        let mut build = fuzzers.cargo_fuzz("build");
        if let [name] = names {
            build.arg(name);
        }
        run(&mut build)?;
        Ok(fuzzers)
    }

    fn cargo_fuzz(&self, sub: &str) -> Command {
        let mut command = cargo();
        command
            .current_dir(&self.tree)
            .args(["fuzz", sub, "--fuzz-dir", FOLDER])
            .args(["--sanitizer=none", "--codegen-units=4", "--target-dir"])
            .arg(work_folder().join("build"))
            .args(self.sim.then_some("--features=sim"));
        command
    }

    /// Runs inputs, or folders of them; new inputs go to the first folder.
    fn run(&self, name: &str, inputs: &[PathBuf], options: &[String]) -> Result<Output> {
        let longest = TARGETS.iter().find(|(other, _)| *other == name);
        let (_, longest) = longest.with_context(|| format!("no target `{name}`"))?;
        self.cargo_fuzz("run")
            .arg(name)
            .args(inputs)
            .args(["--", "-timeout=20", "-print_final_stats=1"])
            .arg(format!("-max_len={longest}"))
            .args(options)
            .output()
            .context("cannot start cargo fuzz")
    }

    /// Runs a target from the stored corpus for a time; a sentence about the result. New
    /// inputs go below the target folder; an input that breaks a property ends the run and
    /// is named.
    fn explore(&self, name: &str, seconds: u64) -> Result<String> {
        let found = work_folder().join("corpus").join(name);
        fs::create_dir_all(&found).with_context(|| found.display().to_string())?;
        let stored = |kind: &str| self.tree.join(FOLDER).join(kind).join(name);
        let mut inputs = vec![found, stored("corpus"), stored("regressions")];
        inputs.retain(|folder| folder.is_dir());
        let result = self.run(name, &inputs, &[format!("-max_total_time={seconds}")])?;
        let log = String::from_utf8_lossy(&result.stderr);
        if !result.status.success() {
            println!("{log}");
            bail!(
                "{name} broke a property; see above for the input. Mend the cause, give the \
                 input a name that says what was wrong, and keep it in \
                 {FOLDER}/regressions/{name}"
            );
        }
        let text = summary(&log, seconds);
        println!("    {name:<10} {text}");
        Ok(text)
    }
}

fn work_folder() -> PathBuf {
    target_dir().join("fuzz")
}

/// Seconds, inputs and coverage from a fuzzer's log. Edges are those of all code
/// linked in, the standard library's among them.
fn summary(log: &str, seconds: u64) -> String {
    let stat = |name: &str| {
        let line = log.lines().find_map(|line| line.strip_prefix(name));
        line.map_or("?", str::trim)
    };
    let done = log.lines().rfind(|line| line.contains(" cov: "));
    let after = |name: &str| {
        let rest = done.and_then(|line| line.split_once(name));
        rest.and_then(|(_, rest)| rest.split_whitespace().next())
            .unwrap_or("?")
    };
    format!(
        "{seconds} s, {} inputs, {} edges, {} features, no finding",
        stat("stat::number_of_executed_units:"),
        after(" cov: "),
        after(" ft: "),
    )
}

/// A seeded bug.
struct Patch {
    name: String,
    path: PathBuf,
    /// Targets that must find it, from its line `Targets:`.
    targets: Vec<String>,
}

fn patches() -> Result<Vec<Patch>> {
    let mut patches = Vec::new();
    for entry in fs::read_dir(root().join(FOLDER).join("seeded"))? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let Some(name) = name.strip_suffix(".patch").map(str::to_owned) else {
            continue;
        };
        let text = fs::read_to_string(&path)?;
        let line = text.lines().find_map(|line| line.strip_prefix("Targets:"));
        let line = line.with_context(|| format!("{name} has no line `Targets:`"))?;
        let targets = line.split_whitespace().map(str::to_owned).collect();
        patches.push(Patch {
            name,
            path,
            targets,
        });
    }
    patches.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(patches)
}

/// Applies each seeded bug to a copy of the commit: the targets that it names must find it, starting without
/// a corpus, and their findings must be due to it.
fn seeded(report: &mut Report) {
    let copy = report.step("a copy of the commit", || {
        let copy = work_folder().join("seeded");
        remove_folder(&copy)?;
        run(command("git")
            .args(["clone", "--quiet"])
            .arg(root())
            .arg(&copy))?;
        Ok((copy, patches()?))
    });
    let Some((copy, patches)) = copy else { return };
    for Patch {
        name,
        path,
        targets,
    } in patches
    {
        report.step(format!("seeded bug: {name}"), || {
            let apply = |how: &[&str]| {
                run(command("git")
                    .current_dir(&copy)
                    .arg("apply")
                    .args(how)
                    .arg(&path))
            };
            apply(&[])?;
            let found = targets.iter().try_for_each(|target| find(&copy, target));
            apply(&["--reverse"])?;
            Ok(found?)
        });
    }
}

fn find(copy: &Path, target: &str) -> Result<()> {
    let artifacts = copy.join(FOLDER).join("artifacts").join(target);
    let empty = work_folder().join("seeded-corpus");
    remove_folder(&artifacts)?;
    empty_folder(&empty)?;
    let limit = [
        format!("-max_total_time={SEEDED_SECONDS}"),
        "-seed=1".to_owned(),
    ];
    let wrong = Fuzzers::build(copy.to_path_buf(), &[target])?;
    let begin = Instant::now();
    let result = wrong.run(target, &[empty], &limit)?;
    let took = begin.elapsed();
    ensure!(
        !result.status.success(),
        "{target} did not find it within {SEEDED_SECONDS} s"
    );
    let input = fs::read_dir(&artifacts)
        .ok()
        .and_then(|mut inputs| inputs.next())
        .context("the fuzzer failed without an input")??;
    let without = Fuzzers::build(root(), &[target])?.run(target, &[input.path()], &[])?;
    ensure!(
        without.status.success(),
        "{target} fails without the bug, too"
    );
    let log = String::from_utf8_lossy(&result.stderr);
    let mut lines = log.lines().skip_while(|line| !line.contains("panicked at"));
    let (place, why) = (lines.next().unwrap_or("?"), lines.next().unwrap_or("?"));
    println!(
        "    found by {target} in {:.1} s: {why} ({})",
        took.as_secs_f64(),
        place.rsplit("panicked at ").next().unwrap_or(place)
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_program_is_a_target_and_every_patch_names_one() {
        let manifest = fs::read_to_string(root().join(FOLDER).join("Cargo.toml")).unwrap();
        let programs: Vec<&str> = manifest.split("[[bin]]").skip(1).collect();
        assert_eq!(programs.len(), TARGETS.len());
        for name in names() {
            let line = format!("name = \"{name}\"");
            let program = programs.iter().find(|text| text.contains(&line)).unwrap();
            let sim = program.contains("required-features = [\"sim\"]");
            assert_eq!(sim, OF_THE_SIMULATOR.contains(&name), "{name}");
        }
        let patches = patches().unwrap();
        assert!(patches.len() >= 3, "seeded bugs are missing");
        for patch in patches {
            assert!(!patch.targets.is_empty(), "{}", patch.name);
            for target in patch.targets {
                assert!(names().any(|name| name == target), "{}", patch.name);
            }
        }
    }

    #[test]
    fn the_figures_of_a_run_come_from_the_end_of_its_log() {
        let log = "#2\tINITED cov: 9 ft: 10 corp: 1/1b\n#77\tDONE   cov: 1234 ft: 5678 corp: 4/9b\nDone 77 runs\nstat::number_of_executed_units: 77\n";
        let expected = "60 s, 77 inputs, 1234 edges, 5678 features, no finding";
        assert_eq!(summary(log, 60), expected);
    }
}
