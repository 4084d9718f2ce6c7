//! The `wheeleg` program; see `wheeleg --help`.
//!
//! # Glossary
//!
//! * **study**: the computation of a command, with folder, summary and report
//! * **exit code**: 0 done, 1 a target missed or a run failed, 2 bad input;
//!   `docs/reference/exit-codes.md` lists all

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
