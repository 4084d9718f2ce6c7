//! The one entry point for developers: `cargo xtask <command>`.
//!
//! `cargo xtask test` is the whole test suite; the other commands are its parts, so that a failed part can be
//! repeated alone. A step either passed, failed, or was NOT RUN because a tool is missing; the last two both
//! end the program with a non-zero status.
//!
//! # Glossary
//!
//! * **step**: one part of the suite
//! * **image**: a linked program for a board
//! * **deep**: checks that take longer than the suite may
//! * **peer**: another implementation of the same work, for the benchmark

mod bench;
mod browser;
mod campaign;
mod conformance;
mod deep;
mod docs;
mod firmware;
mod fuzz;
mod hashes;
mod machine;
mod main_job;
mod mcap;
mod mutants;
mod no_std;
mod pil;
mod plant;
mod process;
mod python;
mod qemu;
mod record;
mod report;
mod rigid_body;
mod runs;
mod rust;
mod setup;
mod sizes;
mod tools;
mod vectors;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::report::Report;

#[derive(Parser)]
#[command(
    name = "cargo xtask",
    bin_name = "cargo xtask",
    about = "Developer tasks of the Wheeleg workspace"
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Say what the suite needs and this machine lacks, and install it.
    Setup,
    /// Set up, then run the whole test suite.
    Test,
    /// Format, lints, seeded bugs and bare-metal checks; no tests.
    Check,
    /// Build all board images into `target/firmware`, and check that none can panic.
    Firmware,
    /// Flash, static RAM and worst stack of the board images, against `tests/budgets`.
    Sizes(sizes::Options),
    /// Boards on QEMU: images, comparison with the host, instructions per tick.
    Qemu(qemu::Options),
    /// The firmware images on emulated boards: comparison with the host, faults, figures.
    Pil(pil::Options),
    /// Check every `no_std` crate for a bare-metal target.
    NoStd,
    /// Rerun the reference generators; their output must equal the checked-in vectors.
    Vectors,
    /// Release build, then the main job twice in different folders: the hashes must be equal.
    MainJob,
    /// The log hash of every built-in scenario, beside those of an earlier record.
    Hashes(hashes::Options),
    /// Our own code beside the C references: times, ratios, targets.
    Bench(bench::Options),
    /// The Rust and the Python implementation of the bus must agree, both ways.
    Conformance,
    /// Fuzz the protocol, the boards, the master and the configuration files.
    Fuzz(fuzz::Options),
    /// Compare the robot's dynamics with Pinocchio on the same states.
    RigidBody,
    /// Compare the pneumatic plant with an integration by scipy.
    Plant,
    /// The table of a campaign and its SQL in DuckDB.
    Campaign,
    /// The Python package: wheel, fresh environment, tests, notebooks, and the mock-up units in FMPy.
    Python,
    /// Mutate the code that decides safe states: tests must notice every mutant.
    Mutants(mutants::Options),
    /// Make a book of `docs`, if mdbook is there.
    Docs,
    /// The long checks; results are appended to docs/records/deep.md.
    Deep(deep::Options),
    /// Open the MCAP log of a run with the Python reader and check every channel.
    McapCheck {
        /// The run's output folder.
        run_dir: PathBuf,
    },
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let mut report = Report::new();
    match cli.command {
        Command::Setup => setup::steps(&mut report),
        Command::Test => test(&mut report),
        Command::Check => {
            lints(&mut report);
            no_std::steps(&mut report);
        }
        Command::Firmware => firmware::steps(&mut report),
        Command::Sizes(options) => sizes::steps(&mut report, &options),
        Command::Qemu(options) => qemu::steps(&mut report, &options),
        Command::Pil(options) => pil::steps(&mut report, &options),
        Command::NoStd => no_std::steps(&mut report),
        Command::Vectors => vectors::steps(&mut report),
        Command::MainJob => {
            main_job::steps(&mut report);
        }
        Command::Hashes(options) => hashes::steps(&mut report, &options),
        Command::Bench(options) => bench::steps(&mut report, &options),
        Command::Conformance => conformance::steps(&mut report),
        Command::Fuzz(options) => fuzz::steps(&mut report, &options),
        Command::RigidBody => rigid_body::steps(&mut report),
        Command::Plant => plant::steps(&mut report),
        Command::Campaign => campaign::steps(&mut report),
        Command::Python => python::steps(&mut report),
        Command::Mutants(options) => mutants::steps(&mut report, &options),
        Command::Docs => docs::steps(&mut report),
        Command::Deep(options) => deep::steps(&mut report, &options),
        Command::McapCheck { run_dir } => mcap::steps(&mut report, Some(&run_dir)),
    }
    print!("{report}");
    if report.all_passed() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

/// The whole suite. Every step is run, even if earlier ones failed, so that one run shows all errors.
fn test(report: &mut Report) {
    setup::steps(report);
    lints(report);
    report.step("cargo test --workspace", rust::test);
    no_std::steps(report);
    firmware::steps(report);
    sizes::steps(report, &sizes::Options::default());
    qemu::steps(report, &qemu::Options::default());
    pil::steps(report, &pil::Options::suite());
    vectors::steps(report);
    conformance::steps(report);
    fuzz::short_steps(report);
    let run = main_job::steps(report);
    mcap::steps(report, run.as_deref());
    browser::steps(report, run.as_deref());
    browser::client(report);
    browser::api(report);
    browser::viewer(report);
    rigid_body::steps(report);
    plant::steps(report);
    campaign::steps(report);
    python::steps(report);
}

fn lints(report: &mut Report) {
    report.step("cargo fmt --check", rust::fmt);
    report.step("cargo clippy -D warnings", rust::clippy);
    report.step("fuzz: seeded bugs apply", fuzz::seeded_bugs_apply);
}
