//! Fuzzing with libFuzzer. The programs of `tests/fuzz` are built here with
//! coverage instrumentation by plain cargo, so that neither `cargo fuzz` nor a
//! nightly compiler is needed; a C++ compiler is (libFuzzer itself is C++).

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;

use crate::process::{ask, cargo, command, output, root, run, succeeds, target_dir};
use crate::report::{Report, StepError, StepResult};
use crate::{deep, tools};

/// The fuzzers' folder, from the root.
const FOLDER: &str = "tests/fuzz";

/// What libFuzzer needs of the compiler: edge counters and compared values.
/// These are codegen options of stable rustc.
const INSTRUMENTATION: [&str; 6] = [
    "-Cpasses=sancov-module",
    "-Cllvm-args=-sanitizer-coverage-level=4",
    "-Cllvm-args=-sanitizer-coverage-inline-8bit-counters",
    "-Cllvm-args=-sanitizer-coverage-pc-table",
    "-Cllvm-args=-sanitizer-coverage-trace-compares",
    "--cfg=fuzzing",
];

/// A fuzz target: name, longest input, whether it needs the simulator, what it is.
struct Target(&'static str, u32, bool, &'static str);

const TARGETS: [Target; 10] = [
    Target(
        "decoder",
        2000,
        false,
        "bytes in any chunks to the frame decoder",
    ),
    Target(
        "frames",
        4000,
        false,
        "sound, damaged and cut frames, the CRC fixed up",
    ),
    Target(
        "parse",
        200,
        false,
        "any payload below any header: parse, emit, parse",
    ),
    Target(
        "joint",
        2000,
        false,
        "a joint board under frames, time and readings",
    ),
    Target(
        "wheel",
        2000,
        false,
        "a wheel board under frames, time and encoder faults",
    ),
    Target(
        "master",
        1000,
        false,
        "the master under commands and failing boards",
    ),
    Target(
        "store",
        400,
        false,
        "the parameter store under power cuts and worn flash",
    ),
    Target(
        "remote",
        2000,
        false,
        "the line to bench boards, read by both sides",
    ),
    Target("scenario", 40_000, true, "scenario and robot files"),
    Target("files", 60_000, true, "reference vectors and axis files"),
];

/// Seconds for each target in the test suite.
const CI_SECONDS: u64 = 4;
/// Seconds within which a seeded bug must be found.
const SEEDED_SECONDS: u64 = 60;

#[derive(Args)]
pub(crate) struct Options {
    /// One target; without it all are run in turn.
    target: Option<String>,
    /// Seconds per target.
    #[arg(long, default_value_t = 60)]
    seconds: u64,
    /// Lists the targets.
    #[arg(long)]
    list: bool,
    /// Applies each seeded bug to a copy of the sources; the targets must find it within 60 s.
    #[arg(long)]
    seeded: bool,
    /// Afterwards, reduces the corpus to the fewest inputs with the same coverage and stores it.
    #[arg(long)]
    store: bool,
    /// Afterwards, appends a dated line per target to `docs/records/deep.md`.
    #[arg(long)]
    note: bool,
}

/// `cargo xtask fuzz`.
pub(crate) fn steps(report: &mut Report, options: &Options) {
    if options.list {
        report.step("targets", || {
            for Target(name, _, _, about) in &TARGETS {
                println!("    {name:<10} {about}");
            }
            Ok(())
        });
        return;
    }
    if options.seeded {
        seeded(report);
        return;
    }
    let chosen: Vec<&Target> = TARGETS
        .iter()
        .filter(|target| {
            options
                .target
                .as_deref()
                .is_none_or(|name| name == target.0)
        })
        .collect();
    if chosen.is_empty() {
        report.step("choose a target", || -> StepResult {
            let names: Vec<&str> = TARGETS.iter().map(|target| target.0).collect();
            let name = options.target.as_deref().unwrap_or_default();
            Err(anyhow::anyhow!("no target `{name}`; there are {}", names.join(", ")).into())
        });
        return;
    }
    let Some(bins) = report.step("fuzz: build", || {
        let sim = chosen.iter().any(|target| target.2);
        build(&root(), sim)
    }) else {
        return;
    };
    for target in chosen {
        let limit = Duration::from_secs(options.seconds);
        report.step(format!("fuzz: {}", target.0), || {
            let result = explore(&bins, target, limit);
            if options.note {
                let text = match &result {
                    Ok(text) => text.clone(),
                    Err(error) => format!("FAILED: {error}"),
                };
                deep::note(&format!("fuzz {}", target.0), &text)?;
            }
            result?;
            if options.store {
                store(&bins, target)?;
            }
            Ok(())
        });
    }
}

/// The part of the test suite: a short run of every target, from the stored corpus.
pub(crate) fn short_steps(report: &mut Report) {
    report.step("fuzz: seeded bugs apply", || Ok(patches_apply()?));
    let Some(bins) = report.step("fuzz: build", || build(&root(), true)) else {
        return;
    };
    report.step(format!("fuzz: {CI_SECONDS} s per target"), || {
        for target in &TARGETS {
            explore(&bins, target, Duration::from_secs(CI_SECONDS))?;
        }
        Ok(())
    });
}

/// Every target for `seconds`; a sentence about the result.
pub(crate) fn all_targets(seconds: u64) -> StepResult<String> {
    let bins = build(&root(), true)?;
    let mut texts = Vec::new();
    for target in &TARGETS {
        let text = explore(&bins, target, Duration::from_secs(seconds))?;
        texts.push(format!("{}: {text}", target.0));
    }
    Ok(texts.join("; "))
}

fn patches_apply() -> Result<()> {
    let patches = patches()?;
    ensure!(patches.len() >= 3, "seeded bugs are missing");
    for patch in patches {
        run(command("git").args(["apply", "--check"]).arg(&patch.path))?;
    }
    Ok(())
}

fn work_folder() -> PathBuf {
    target_dir().join("fuzz")
}

/// Builds the programs of the tree at `tree`; gives the folder they are in.
fn build(tree: &Path, sim: bool) -> StepResult<PathBuf> {
    if !tools::have("c++") {
        let missing = || StepError::missing("c++", "apt-get install -y g++");
        if !(tools::may_apt() && tools::apt_install(&["g++"]) && tools::have("c++")) {
            return Err(missing());
        }
    }
    let host = host_triple()?;
    let built = work_folder().join("build");
    let mut build = cargo();
    build
        .current_dir(tree.join(FOLDER))
        .args(["build", "--release", "--bins", "--target", &host])
        .args(sim.then_some("--features=sim"))
        .env("CARGO_TARGET_DIR", &built)
        .env("RUSTFLAGS", INSTRUMENTATION.join(" "))
        .env_remove("CARGO_ENCODED_RUSTFLAGS");
    run(&mut build)?;
    Ok(built.join(host).join("release"))
}

fn host_triple() -> Result<String> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let version = output(command(rustc).arg("-vV"))?;
    let host = version.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).context("rustc -vV names no host")
}

/// A libFuzzer program with what all its uses share.
fn fuzzer(bins: &Path, target: &Target) -> Command {
    let mut fuzzer = command(bins.join(target.0));
    fuzzer.args([
        format!("-max_len={}", target.1),
        "-timeout=20".to_owned(),
        "-rss_limit_mb=2048".to_owned(),
        "-verbosity=1".to_owned(),
        "-print_final_stats=1".to_owned(),
    ]);
    fuzzer
}

/// Inputs under `tests/fuzz` of one kind.
fn stored(kind: &str, target: &Target) -> PathBuf {
    root().join(FOLDER).join(kind).join(target.0)
}

/// Runs a target from the stored corpus for a time; a sentence about the result.
/// New inputs go to the target folder; an input that breaks a property ends the
/// run and is named.
fn explore(bins: &Path, target: &Target, limit: Duration) -> Result<String> {
    let found = work_folder().join("corpus").join(target.0);
    let artifacts = work_folder().join("artifacts").join(target.0);
    fs::create_dir_all(&found)?;
    fs::create_dir_all(&artifacts)?;
    let mut fuzzer = fuzzer(bins, target);
    fuzzer
        .arg(format!("-max_total_time={}", limit.as_secs()))
        .arg(format!("-artifact_prefix={}/", artifacts.display()))
        .arg(&found);
    for kind in ["corpus", "regressions"] {
        let folder = stored(kind, target);
        if folder.is_dir() {
            fuzzer.arg(folder);
        }
    }
    let result = fuzzer.output().context("cannot start the fuzzer")?;
    let log = String::from_utf8_lossy(&result.stderr);
    if !result.status.success() {
        println!("{}", last_lines(&log, 60));
        bail!(
            "{} broke a property; the input is in {}. Mend the cause, give the input a name \
             that says what was wrong, and keep it in {FOLDER}/regressions/{}",
            target.0,
            artifacts.display(),
            target.0
        );
    }
    let text = summary(&log, limit.as_secs());
    println!("    {:<10} {text}", target.0);
    Ok(text)
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

fn last_lines(text: &str, count: usize) -> String {
    let lines: Vec<&str> = text.lines().collect();
    lines[lines.len().saturating_sub(count)..].join("\n")
}

/// Reduces what was found and what was stored to the fewest inputs that cover
/// the same edges, and stores these.
fn store(bins: &Path, target: &Target) -> Result<()> {
    let fresh = work_folder().join("stored").join(target.0);
    if fresh.exists() {
        fs::remove_dir_all(&fresh)?;
    }
    fs::create_dir_all(&fresh)?;
    let corpus = stored("corpus", target);
    let mut merge = fuzzer(bins, target);
    merge
        .args(["-set_cover_merge=1", "-use_counters=0"])
        .arg(&fresh)
        .arg(work_folder().join("corpus").join(target.0));
    if corpus.is_dir() {
        merge.arg(&corpus);
    }
    let result = merge.output().context("cannot start the fuzzer")?;
    ensure!(result.status.success(), "the merge of {} failed", target.0);
    if corpus.exists() {
        fs::remove_dir_all(&corpus)?;
    }
    fs::create_dir_all(&corpus)?;
    let mut count = 0;
    for entry in fs::read_dir(&fresh)? {
        let entry = entry?;
        fs::copy(entry.path(), corpus.join(entry.file_name()))?;
        count += 1;
    }
    println!("    {:<10} {count} inputs stored", target.0);
    Ok(())
}

/// A seeded bug.
struct Patch {
    name: String,
    path: PathBuf,
    /// Targets that must find it.
    targets: Vec<String>,
}

fn patches() -> Result<Vec<Patch>> {
    let folder = root().join(FOLDER).join("seeded");
    let mut patches = Vec::new();
    for entry in fs::read_dir(&folder).with_context(|| format!("{}", folder.display()))? {
        let path = entry?.path();
        if path
            .extension()
            .is_none_or(|extension| extension != "patch")
        {
            continue;
        }
        let text = fs::read_to_string(&path)?;
        let targets = targets_of(&text);
        ensure!(
            !targets.is_empty(),
            "{} names no target in a line `Targets:`",
            path.display()
        );
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        patches.push(Patch {
            name: name.into_owned(),
            path,
            targets,
        });
    }
    patches.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(patches)
}

fn targets_of(patch: &str) -> Vec<String> {
    patch
        .lines()
        .find_map(|line| line.strip_prefix("Targets:"))
        .map(|names| names.split_whitespace().map(str::to_owned).collect())
        .unwrap_or_default()
}

/// Each seeded bug in a copy of the sources: the targets that it names must
/// find it, starting without a corpus, and what they found must be due to it.
fn seeded(report: &mut Report) {
    let Some(sound) = report.step("fuzz: build without a bug", || build(&root(), false)) else {
        return;
    };
    // The next builds replace these programs.
    let keep = work_folder().join("sound");
    let kept = report.step("keep the sound programs", || {
        fs::create_dir_all(&keep)?;
        for target in TARGETS.iter().filter(|target| !target.2) {
            fs::copy(sound.join(target.0), keep.join(target.0))?;
        }
        Ok(())
    });
    let patches = report.step("find the seeded bugs", || Ok(patches()?));
    let (Some(()), Some(patches)) = (kept, patches) else {
        return;
    };
    for patch in &patches {
        report.step(format!("seeded bug: {}", patch.name), || {
            let tree = copy_tree()?;
            run(command("git")
                .current_dir(&tree)
                .arg("apply")
                .arg(&patch.path))?;
            let bins = build(&tree, false)?;
            for name in &patch.targets {
                let target = TARGETS
                    .iter()
                    .find(|target| target.0 == name)
                    .with_context(|| format!("no target `{name}`"))?;
                find(&bins, &keep, target)?;
            }
            Ok(())
        });
    }
}

fn find(bins: &Path, sound: &Path, target: &Target) -> Result<()> {
    let artifacts = work_folder().join("seeded-artifacts");
    if artifacts.exists() {
        fs::remove_dir_all(&artifacts)?;
    }
    fs::create_dir_all(&artifacts)?;
    let begin = Instant::now();
    let result = fuzzer(bins, target)
        .arg("-seed=1")
        .arg(format!("-max_total_time={SEEDED_SECONDS}"))
        .arg(format!("-artifact_prefix={}/", artifacts.display()))
        .output()
        .context("cannot start the fuzzer")?;
    let took = begin.elapsed();
    ensure!(
        !result.status.success(),
        "{} did not find it within {SEEDED_SECONDS} s",
        target.0
    );
    let input = fs::read_dir(&artifacts)?
        .next()
        .context("the fuzzer failed without an input")??;
    let log = String::from_utf8_lossy(&result.stderr);
    let mut lines = log.lines().skip_while(|line| !line.contains("panicked at"));
    let (place, why) = (lines.next().unwrap_or("?"), lines.next().unwrap_or("?"));
    ensure!(
        succeeds(command(sound.join(target.0)).arg(input.path())),
        "{} fails without the bug, too",
        target.0
    );
    println!(
        "    found by {} in {:.1} s: {why} ({})",
        target.0,
        took.as_secs_f64(),
        place.rsplit("panicked at ").next().unwrap_or(place)
    );
    Ok(())
}

/// A copy of all sources, in a repository of its own so that `git apply` works
/// in it. File times are kept where nothing changed, for short builds.
fn copy_tree() -> Result<PathBuf> {
    let tree = work_folder().join("seeded-tree");
    fs::create_dir_all(&tree)?;
    let listed = output(command("git").args(["ls-files", "-co", "--exclude-standard"]))?;
    for name in listed
        .lines()
        .filter(|name| !name.starts_with("tests/fuzz/corpus"))
    {
        let (from, to) = (root().join(name), tree.join(name));
        let Ok(content) = fs::read(&from) else {
            // Deleted and not yet committed, or a link.
            continue;
        };
        if fs::read(&to).is_ok_and(|old| old == content) {
            continue;
        }
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder)?;
        }
        fs::write(&to, content)?;
    }
    if ask(command("git")
        .current_dir(&tree)
        .args(["rev-parse", "--show-toplevel"]))
    .is_none_or(|top| Path::new(&top) != tree)
    {
        run(command("git").current_dir(&tree).args(["init", "--quiet"]))?;
    }
    Ok(tree)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_program_is_a_target_and_every_patch_names_one() {
        let manifest = fs::read_to_string(root().join(FOLDER).join("Cargo.toml")).unwrap();
        let programs = manifest.matches("[[bin]]").count();
        assert_eq!(programs, TARGETS.len());
        for Target(name, _, sim, _) in &TARGETS {
            let at = manifest.find(&format!("name = \"{name}\"")).unwrap();
            let section = &manifest[at..at + 120.min(manifest.len() - at)];
            let needs = section.split("[[bin]]").next().unwrap();
            assert_eq!(needs.contains("required-features"), *sim, "{name}");
        }
        let patches = patches().unwrap();
        assert!(patches.len() >= 3);
        for patch in patches {
            for name in &patch.targets {
                assert!(TARGETS.iter().any(|t| t.0 == name), "{}", patch.name);
            }
        }
    }

    #[test]
    fn the_figures_of_a_run_come_from_the_end_of_its_log() {
        let log = "#2\tINITED cov: 9 ft: 10 corp: 1/1b\n#77\tDONE   cov: 1234 ft: 5678 corp: 4/9b\nDone 77 runs\nstat::number_of_executed_units: 77\n";
        let expected = "60 s, 77 inputs, 1234 edges, 5678 features, no finding";
        assert_eq!(summary(log, 60), expected);
    }

    #[test]
    fn the_targets_of_a_patch_stand_in_its_head() {
        assert_eq!(targets_of("A bug.\n\nTargets: a b\n\ndiff"), ["a", "b"]);
        assert!(targets_of("A bug.\n").is_empty());
    }
}
