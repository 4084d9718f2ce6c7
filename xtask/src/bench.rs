//! `cargo xtask bench`: our own code compared with the C references, in one run.
//!
//! Reference and own program run in the same round, seconds apart, and the ratio is taken round by round:
//! absolute times vary with the machine's load, ratios hardly. Every program prints `RESULT case peer unit
//! cpu wall check`; `check` shows that the work was the same. A missed target is a FAIL in the table and a
//! non-zero exit status, and so is a case that could not be run.

mod instructions;
mod table;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::process::{cargo, command, output, root, run, step_folder, target_dir};
use crate::report::{Report, StepError, StepResult};
use crate::tools::have;
use crate::{rust, tools};

use table::{Sample, Table};

/// What `cargo xtask bench` takes.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// `console`: the console's numbers in wall time instead, beside their bars.
    #[arg(value_enum)]
    of: Option<Of>,
    /// Rounds; each runs every program once.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
    /// Work per measurement, as a multiple of the full one.
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
    /// Also build with `-C target-cpu=native`, as the C references are, as a peer of its own.
    #[arg(long)]
    native: bool,
    /// Also count instructions per call with valgrind.
    #[arg(long)]
    instructions: bool,
    /// A folder of further programs that print RESULT lines; each executable in it runs once a round.
    #[arg(long)]
    peers: Option<PathBuf>,
    /// Print the table as JSON too, as one line of standard output (it begins with a brace).
    #[arg(long)]
    json: bool,
}

/// What is measured instead.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Of {
    /// Answers, lateness, cost and memory of `wheeleg serve`.
    Console,
}

/// A C program: name, sources below `tests/peers/c`, group of cases.
const C_PROGRAMS: [(&str, &[&str], &str); 7] = [
    ("leg_ref", &["leg/leg_ref.c"], "leg"),
    ("leg_casadi", &["leg/leg_cg.c", "leg/leg_cg_gen.c"], "leg"),
    (
        "robot_casadi",
        &["robot/robot_cg.c", "robot/robot_cg_gen.c"],
        "robot",
    ),
    ("pneu_ref", &["pneu/pneu_ref.c"], "pneu"),
    ("fuzzy_ref", &["fuzzy/fuzzy_ref.c"], "fuzzy"),
    ("filter_ref", &["filter/filter_ref.c"], "filter"),
    ("proto_ref", &["proto/proto_ref.c"], "proto"),
];

/// Groups in the order in which they run.
const GROUPS: [&str; 7] = [
    "leg", "robot", "terrain", "pneu", "fuzzy", "filter", "proto",
];

/// A program of a round.
struct Program {
    path: PathBuf,
    arguments: Vec<String>,
    label: Option<&'static str>,
    group: Option<&'static str>,
}

/// Builds, runs the rounds, prints the tables.
pub(crate) fn steps(report: &mut Report, options: &Options) {
    if let Some(Of::Console) = options.of {
        report.step("bench: console", || {
            let wheeleg = rust::build_wheeleg()?;
            run(command(tools::python()?)
                .arg("tests/python/bench_console.py")
                .arg(wheeleg))?;
            Ok(())
        });
        return;
    }
    let folder = step_folder("peers");
    let references = report.step("bench: compile the C references", || {
        compile(&folder, &["-O3", "-march=native"])
    });
    let ours = report.step("bench: build our program", || {
        let mut programs = vec![build(None)?];
        if options.native {
            programs.push(build(Some("native"))?);
        }
        Ok(programs)
    });
    let mut programs = references.unwrap_or_default();
    for (path, label) in ours.into_iter().flatten() {
        for group in GROUPS {
            programs.push(Program {
                path: path.clone(),
                arguments: vec![group.to_owned()],
                label: Some(label),
                group: Some(group),
            });
        }
    }
    let others = report.step("bench: further peers", || {
        Ok(match &options.peers {
            Some(folder) => executables(folder)?,
            None => Vec::new(),
        })
    });
    programs.extend(others.into_iter().flatten());
    let table = report.step("bench: rounds", || Ok(rounds(&programs, options)?));
    if let Some(table) = &table {
        print!("{table}");
        for row in table.verdicts() {
            report.step(format!("bench: {}", row.name()), || Ok(row.verdict()?));
        }
    }
    let counts = options
        .instructions
        .then(|| report.step("bench: instructions", || instructions::count(&folder)))
        .flatten();
    if let Some(counts) = &counts {
        print!("{counts}");
    }
    if options.json
        && let Some(table) = &table
    {
        let counts = counts.map(|counts| counts.to_json());
        println!(
            "{}",
            serde_json::json!({"rows": table.to_json(), "instructions": counts})
        );
    }
}

/// The C compiler: `CC`, or `cc`, or `gcc`.
fn compiler() -> StepResult<String> {
    let named = std::env::var("CC").ok();
    named
        .into_iter()
        .chain(["cc".to_owned(), "gcc".to_owned()])
        .find(|name| have(name))
        .ok_or_else(|| StepError::missing("C compiler", "apt-get install -y gcc libc6-dev"))
}

/// Compiles every C program into `folder`.
fn compile(folder: &Path, flags: &[&str]) -> StepResult<Vec<Program>> {
    let cc = compiler()?;
    fs::create_dir_all(folder).with_context(|| format!("{}", folder.display()))?;
    let sources = root().join("tests/peers/c");
    let mut programs = Vec::new();
    for (name, files, group) in C_PROGRAMS {
        let path = folder.join(name);
        run(command(&cc)
            .args(flags)
            .arg("-o")
            .arg(&path)
            .args(files.iter().map(|file| sources.join(file)))
            .arg("-lm"))?;
        programs.push(Program {
            path,
            arguments: Vec::new(),
            label: None,
            group: Some(group),
        });
    }
    Ok(programs)
}

/// Builds our program; returns it with its label.
fn build(target_cpu: Option<&str>) -> Result<(PathBuf, &'static str)> {
    let mut build = cargo();
    build.args([
        "build",
        "--locked",
        // The release build without its checks, which the C programs have not either.
        "--profile",
        "bench",
        "--package",
        "wheeleg-peers",
    ]);
    let (folder, label) = match target_cpu {
        None => (target_dir(), "wheeleg"),
        Some(cpu) => {
            let folder = step_folder("native");
            build
                .env("RUSTFLAGS", format!("-C target-cpu={cpu}"))
                .arg("--target-dir")
                .arg(&folder);
            (folder, "wheeleg_native")
        }
    };
    run(&mut build)?;
    Ok((folder.join("release").join("wheeleg-peers"), label))
}

/// Executable files of a folder, in order of their names.
fn executables(folder: &Path) -> Result<Vec<Program>> {
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| format!("--peers {}", folder.display()))? {
        let path = entry?.path();
        if path.is_file() && executable(&path) {
            paths.push(path.canonicalize()?);
        }
    }
    paths.sort();
    anyhow::ensure!(
        !paths.is_empty(),
        "--peers {}: no executable file in it",
        folder.display()
    );
    let program = |path| Program {
        path,
        arguments: Vec::new(),
        label: None,
        group: None,
    };
    Ok(paths.into_iter().map(program).collect())
}

#[cfg(unix)]
fn executable(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    fs::metadata(path).is_ok_and(|data| data.permissions().mode() & 0o111 != 0)
}

#[cfg(not(unix))]
fn executable(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "exe")
}

/// Group by group, so that a peer and its reference run close together.
fn rounds(programs: &[Program], options: &Options) -> Result<Table> {
    let mut table = Table::default();
    let groups = GROUPS.into_iter().map(Some).chain([None]);
    for group in groups {
        for round in 0..options.rounds {
            for program in programs.iter().filter(|program| program.group == group) {
                let mut command = command(&program.path);
                command
                    .args(&program.arguments)
                    .env("PEERS_SCALE", options.scale.to_string());
                if let Some(label) = program.label {
                    command.env("PEERS_LABEL", label);
                }
                for line in output(&mut command)?.lines() {
                    if let Some(sample) = Sample::parse(line)? {
                        table.add(round, sample);
                    }
                }
            }
        }
    }
    Ok(table)
}
